"""Where the person's joints, contact spheres and centres of mass are in the 3-D model, instant by instant.

Keel and socket are undeformed: what the recording prescribes is all that is known.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import BodyIndex

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walker

FEET = ("P", "I")
"""The prosthetic and the intact side, in this order wherever both appear."""


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Points of the person in W (x forward, y left, z up), m. n instants; sides in the order of `FEET`.

    Attributes:
        pelvis: (n, 3) the pelvis's origin.
        hip, knee, ankle: (n, 2, 3) joint centres; the prosthetic "ankle" is the pylon's lower end.
        spheres: by side, (n, m, 3) centres of the contact spheres. radius: by side, (m,).
        mass: (b,) kg of the bodies that have one. mass_center: (n, b, 3) their centres.
        mass_body: (b,) index into `SEGMENTS` of the planar segment that carries each.
        ground: z of the floor, m.
    """

    pelvis: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    ankle: np.ndarray
    spheres: dict[str, np.ndarray]
    radius: dict[str, np.ndarray]
    mass: np.ndarray
    mass_center: np.ndarray
    mass_body: np.ndarray
    ground: float

    def at(self, rows: np.ndarray) -> BodyPoints:
        """The same at some of the instants only; rows: (n,) bool."""
        return dataclasses.replace(
            self, pelvis=self.pelvis[rows], hip=self.hip[rows], knee=self.knee[rows], ankle=self.ankle[rows],
            spheres={s: centres[rows] for s, centres in self.spheres.items()}, mass_center=self.mass_center[rows])

    @property
    def whole_center(self) -> np.ndarray:
        """(n, 3) m, the whole body's centre of mass."""
        return np.einsum("b,nbk->nk", self.mass, self.mass_center) / self.mass.sum()


SEGMENTS = ("pelvis", "thigh_P", "shank_P", "thigh_I", "shank_I", "foot_I")
"""Rigid segments of the sagittal model; socket, pylon and prosthetic foot belong to "shank_P"."""


def body_points(walker: Walker, offsets: GeometricOffsets, names: Sequence[str], values: np.ndarray,
                *, fulcrum_m: float) -> BodyPoints:
    """The points of `BodyPoints` for n sets of coordinates.

    Args:
        walker: the person; its Context is copied, not changed.
        offsets: of the prosthesis.
        names: m coordinates. values: (n, m) rad and m; coordinates that are not named are zero.
    """
    gait = walker.gait
    plant, person = gait.plant, gait.person
    root = walker.context.Clone()
    context = gait.plant_context(root)
    set_mount(context, person.foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
              alignment=offsets.alignment_rad)
    mechanism = gait_mechanism(gait, root)
    side = {"P": person.subject.prosthetic_side, "I": "left" if person.subject.prosthetic_side == "right" else "right"}
    segments = person.segments
    frames = [segments["pelvis"].body_frame(), *(segments[f"thigh_{side[s]}"].body_frame() for s in FEET),
              *(segments[f"shank_{side[s]}"].body_frame() for s in FEET), person.socket.distal,
              segments[f"foot_{side['I']}"].body_frame()]
    count = len(person.foot.sites.radius)
    carriers = [plant.get_body(BodyIndex(int(i))) for i in mechanism.site_bodies]
    heavy, parents = _heavy(walker, context, side)
    columns = [plant.GetJointByName(name).position_start() for name in names]
    q = np.zeros(plant.num_positions())
    q[plant.GetJointByName(person.foot.carriage_joint_name, person.foot.instance).position_start()] = fulcrum_m
    origins = np.empty((len(values), len(frames), 3))
    centres = np.empty((len(values), len(mechanism.sites), 3))
    masses = np.empty((len(values), len(heavy), 3))
    own = [(body, body.CalcCenterOfMassInBodyFrame(context)) for body in heavy]
    for i, row in enumerate(np.asarray(values, dtype=float)):
        q[columns] = row
        plant.SetPositions(context, q)
        for j, frame in enumerate(frames):
            origins[i, j] = frame.CalcPoseInWorld(context).translation()
        for j, (body, p_BS) in enumerate(zip(carriers, mechanism.sites[:, :3], strict=True)):
            centres[i, j] = plant.EvalBodyPoseInWorld(context, body) @ p_BS
        for j, (body, p_BC) in enumerate(own):
            masses[i, j] = plant.EvalBodyPoseInWorld(context, body) @ p_BC
    radius = mechanism.sites[:, 3]
    return BodyPoints(
        pelvis=origins[:, 0], hip=origins[:, 1:3], knee=origins[:, 3:5], ankle=origins[:, 5:7],
        spheres={"P": centres[:, :count], "I": centres[:, count:]},
        radius={"P": radius[:count], "I": radius[count:]},
        mass=np.array([body.get_mass(context) for body in heavy]), mass_center=masses, mass_body=np.array(parents),
        ground=float(mechanism.ground_height))


def _heavy(walker: Walker, context, side: dict[str, str]) -> tuple[list, list[int]]:
    """Bodies with mass, and the planar segment of each."""
    plant = walker.gait.plant
    rigid = {walker.gait.person.segments["pelvis"].index(): 0}
    for name, segment in ((f"thigh_{side['P']}", 1), (f"thigh_{side['I']}", 3), (f"shank_{side['I']}", 4),
                          (f"foot_{side['I']}", 5)):
        rigid[walker.gait.person.segments[name].index()] = segment
    bodies = [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]
    heavy = [body for body in bodies if body.get_mass(context) > 0.0]
    return heavy, [rigid.get(body.index(), SEGMENTS.index("shank_P")) for body in heavy]
