"""Where the foot's frames, points and spheres are, asked of the plant that `add_foot` makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import Context

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles


@dataclass(frozen=True)
class FootPositions:
    """A foot whose unloaded sole would lie on the plane z = 0 of W, all in W (m).

    Attributes:
        X_WK, X_WM: poses of the keel frame and the mount.
        A, B, C, tip: (3,) the keel's posterior end, the point over the fulcrum, the load point, the keel's tip.
        joints: (m, 3) pin and sprung joints of the keel.
        carriage: (3,) origin of the carriage.
        spheres, radius, zone: (N, 3), (N,) m, (N,) index into `zone_names`.
        half_thickness, half_width: of the keel.
    """

    parameters: FootParameters
    fulcrum_m: float
    X_WK: RigidTransform
    X_WM: RigidTransform
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    tip: np.ndarray
    joints: np.ndarray
    carriage: np.ndarray
    spheres: np.ndarray
    radius: np.ndarray
    zone: np.ndarray
    zone_names: tuple[str, ...]

    @property
    def half_thickness(self) -> float:
        """Of the keel."""
        return 0.5 * self.parameters.keel.thickness_m

    @property
    def half_width(self) -> float:
        """Of the keel."""
        return 0.5 * self.parameters.keel.width_m


class DrawnFoot:
    """A foot with its mount held at (0, 0, build height) of W, and a context of its own."""

    def __init__(self, parameters: FootParameters) -> None:
        self.plant = MultibodyPlant(0.0)
        height = RigidTransform([0.0, 0.0, parameters.build_height_m])
        hung = self.plant.AddFrame(FixedOffsetFrame("place", self.plant.world_frame(), height))
        self.foot = add_foot(self.plant, hung, parameters)
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()

    def positions(self, fulcrum_m: float, angles: np.ndarray | None = None) -> FootPositions:
        """With the carriage at `fulcrum_m` (m from A) and the keel at `angles` (m,) rad, straight by default."""
        return foot_positions(self.plant, self.foot, self.context, fulcrum_m, angles)


def foot_positions(plant: MultibodyPlant, foot: FootHandles, context: Context, fulcrum_m: float,
                   angles: np.ndarray | None = None) -> FootPositions:
    """The positions of `foot` after moving it in `context`; see `DrawnFoot.positions`."""
    q = np.zeros(len(foot.keel)) if angles is None else angles
    for name, angle in zip(foot.keel_joint_names, q, strict=True):
        plant.GetJointByName(name, foot.instance).set_angle(context, float(angle))
    slide = plant.GetJointByName(foot.carriage_joint_name, foot.instance)
    slide.set_translation(context, fulcrum_m)

    def on_keel(x: float) -> np.ndarray:
        j = foot.keel_body_at(x)
        return foot.keel[j].EvalPoseInWorld(context) @ np.array([x - foot.keel_starts[j], 0.0, 0.0])

    sites, parameters = foot.sites, foot.parameters
    spheres = [plant.get_body(body).EvalPoseInWorld(context) @ centre
               for body, centre in zip(sites.body_indices, sites.p_BS, strict=True)]
    joints = [body.EvalPoseInWorld(context).translation() for body in foot.keel]
    return FootPositions(
        parameters=parameters, fulcrum_m=fulcrum_m, X_WK=foot.frame.EvalPoseInWorld(context),
        X_WM=foot.mount.CalcPoseInWorld(context), A=on_keel(0.0), B=on_keel(fulcrum_m),
        C=on_keel(parameters.load_point_m), tip=on_keel(sum(parameters.keel.element_lengths_m)),
        joints=np.array(joints),
        carriage=slide.child_body().EvalPoseInWorld(context).translation(), spheres=np.array(spheres),
        radius=sites.radius, zone=sites.zone, zone_names=sites.zone_names)
