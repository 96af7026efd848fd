"""A 3-D motion seen from the side: the sagittal coordinates that come nearest to it, instant by
instant.

    minimise over q(t), for every t by itself, and over one constant d:
        sum over points |p(q) - p_3D - d_p|^2 / sigma_p^2
        +  sum over angles (q_c - recorded)^2 / sigma_q^2

Points are both feet's contact spheres (height and place along the way are weighed apart), the
knees, the ankle, the pylon's end, the two hips and the whole body's centre of mass. A sphere counts
fully where it is near the floor and little in swing: 1 mm of height of the loaded prosthetic foot
is about 3 % of body weight in its force (a sensitivity found in this model). The centre of mass
counts because its acceleration is the sum of the ground's forces. The two hips are one point from
the side: the pelvis's obliquity and rotation move them apart, by up to a centimetre, so that the
hip must go somewhere between and the angles take up the rest.

d_p is d for hips and centre of mass and zero for all other points: legs that lean outward are
shorter seen from the side, by millimetres that hardly change with time. A body that is moved by a
constant does not accelerate otherwise; knees that had to take that difference up, near straight,
would bend by degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.tree import BodyIndex

from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.sagittal.planar_dynamics import (
    PlanarDynamics,
    PlanarMotion,
    planar_tree,
    without_branch,
)
from vsf_drake.simulation.walk import Walker

FEET = {"P": "prosthetic", "I": "intact"}  # in this order wherever both appear
TILT, TX, TY, HIP_P, KNEE_P, HIP_I, KNEE_I, ANKLE_I = range(
    8
)  # places of the coordinates in `sagittal_coordinates`
SEGMENTS = {
    TILT: "pelvis",
    HIP_P: "thigh_P",
    KNEE_P: "shank_P",
    HIP_I: "thigh_I",
    KNEE_I: "shank_I",
    ANKLE_I: "foot_I",
}
"""Rigid segments of the sagittal model by the coordinate that moves each; socket, pylon and
prosthetic foot belong to "shank_P"."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Points:
    """k points of the person: by foot hip, knee, ankle and contact spheres, then the centres of
    mass of all bodies."""

    labels: tuple[
        str, ...
    ]  # (k,) "hip P", "knee P", "ankle P", "sphere P", the same with I, "mass"
    carrier: np.ndarray  # (k,) place of the coordinate of SEGMENTS that carries the point
    mass: np.ndarray  # (k,) kg where the point is a centre of mass, else 0
    radius: np.ndarray  # (k,) m where it is the centre of a contact sphere, else 0

    def rows(self, start: str) -> np.ndarray:
        return np.array(
            [k for k, label in enumerate(self.labels) if label.startswith(start)], dtype=int
        )


# Where the points are in the 3-D model. Keel and socket are undeformed: what the recording
# prescribes is all that is known.


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyPoints(_Points):
    """The points at n instants in W (x forward, y left, z up), m; the prosthetic "ankle" is the
    pylon's lower end."""

    pelvis: np.ndarray  # (n, 3) its origin
    places: np.ndarray  # (n, k, 3)
    ground: float  # z of the floor, m

    def of(self, start: str) -> np.ndarray:
        return self.places[:, self.rows(start)]

    def seen(self, forward: np.ndarray) -> np.ndarray:
        """(n, k) complex x + i z of the points from the side, x along `forward` (2,), a unit vector
        in the floor."""
        along: np.ndarray = self.places[..., :2] @ forward
        return along + 1j * self.places[..., 2]


def body_points(
    walker: Walker,
    offsets: GeometricOffsets,
    names: Sequence[str],
    values: np.ndarray,
    *,
    fulcrum_m: float,
) -> BodyPoints:
    """The points for n sets of values (n, m), rad and m, of m named coordinates; the others are
    zero. The walker's Context is not changed."""
    gait = walker.gait
    person = walker.gait.person
    root = walker.context.Clone()
    plant = gait.plant
    context = gait.plant_context(root)
    set_mount(context, person.foot, **mount_of(offsets))
    mechanism = gait_mechanism(gait, root)
    own = person.subject.prosthetic_side
    segments = person.segments
    side = {"P": own, "I": "left" if own == "right" else "right"}
    count = len(person.foot.sites.radius)
    points = []
    nil = np.zeros(3)
    spheres = [
        (plant.get_body(BodyIndex(int(body))).body_frame(), site[:3], site[3])
        for body, site in zip(mechanism.site_bodies, mechanism.sites, strict=True)
    ]
    carriers = {}
    for coordinate, name in SEGMENTS.items():
        part, _, s = name.partition("_")
        carriers[segments[f"{part}_{side[s]}" if s else part].index()] = coordinate
    for s, hip, foot, distal, own_spheres in (
        ("P", HIP_P, KNEE_P, person.socket.distal, spheres[:count]),
        ("I", HIP_I, ANKLE_I, segments[f"foot_{side['I']}"].body_frame(), spheres[count:]),
    ):
        points += [
            (segments[f"thigh_{side[s]}"].body_frame(), nil, f"hip {s}", hip, 0.0, 0.0),
            (segments[f"shank_{side[s]}"].body_frame(), nil, f"knee {s}", hip + 1, 0.0, 0.0),
            (distal, nil, f"ankle {s}", foot, 0.0, 0.0),
            *(
                (frame, p_BS, f"sphere {s}", foot, 0.0, radius)
                for frame, p_BS, radius in own_spheres
            ),
        ]
    for body in (plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())):
        if (mass := body.get_mass(context)) > 0.0:
            points.append(
                (
                    body.body_frame(),
                    body.CalcCenterOfMassInBodyFrame(context),
                    "mass",
                    carriers.get(body.index(), KNEE_P),
                    mass,
                    0.0,
                )
            )
    columns = [plant.GetJointByName(name).position_start() for name in names]
    q = np.zeros(plant.num_positions())
    q[
        plant.GetJointByName(person.foot.carriage_joint_name, person.foot.instance).position_start()
    ] = fulcrum_m
    pelvis = np.empty((len(values), 3))
    places = np.empty((len(values), len(points), 3))
    for i, row in enumerate(np.asarray(values, dtype=float)):
        q[columns] = row
        plant.SetPositions(context, q)
        pelvis[i] = segments["pelvis"].body_frame().CalcPoseInWorld(context).translation()
        places[i] = [frame.CalcPoseInWorld(context) @ p_FP for frame, p_FP, *_ in points]
    _, _, labels, carrier, masses, radii = zip(*points, strict=True)
    return BodyPoints(
        labels=labels,
        carrier=np.array(carrier),
        mass=np.array(masses),
        radius=np.array(radii),
        pelvis=pelvis,
        places=places,
        ground=float(mechanism.ground_height),
    )


# The sagittal model's geometry: the walker's planar tree of rigid segments, for many instants at
# once, with the sagittal coordinates alone; everything else is at zero, and the prosthesis, which
# may be turned out of the plane, is where that puts it.
#
# Points of the plane are complex numbers x + i z (x forward, z up).


@dataclass(frozen=True, eq=False, kw_only=True)
class SagittalChain(_Points):
    """A planar person with the points on it."""

    dynamics: PlanarDynamics
    local: np.ndarray  # (k,) complex, the points in the frames of what carries them (m)
    aside: np.ndarray  # (k,) m to the left of the pelvis, all coordinates at zero

    def _moved(self, q: np.ndarray) -> tuple[PlanarMotion, np.ndarray]:
        """The links at q (n, 8), and the points (k, n)."""
        still = np.zeros_like(q.T)
        motion = self.dynamics.move(q.T, still, still)
        origin, turn = frames(motion, self.dynamics.link[self.carrier])
        return motion, origin + turn * self.local[:, None]

    def points(self, q: np.ndarray) -> np.ndarray:
        return self._moved(q)[1].T

    def linearised(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The points, and their derivatives (n, k, 8), complex: the velocity of a point at unit
        rate of a coordinate that carries it."""
        motion, places = self._moved(q)
        link = self.dynamics.link
        omega, vx, vz = motion.S[:, link, None]
        carries = self.dynamics.carries[np.ix_(link, link[self.carrier])]
        J = carries[:, :, None] * (vx + 1j * vz - 1j * omega * places)
        return places.T, J.transpose(2, 1, 0)

    def curvature(self, J: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """(n, 8, 8) sum over points of Re(conj(pull) d2p/dq2): what curved paths add to a
        least-squares Hessian.

        d2p/dq_c dq_d is -i w_c dp/dq_d, c being the joint nearer to the pelvis and w_c its sign
        about +y. J (n, k, 8) are derivatives from `linearised`, or sums of them; pull (n, k)
        complex residuals, each part times its weight.
        """
        link = self.dynamics.link
        turned = np.einsum("nk,nkd->nd", pull.conj(), -1j * J).real
        deeper = self.dynamics.turn[link][:, None] * self.dynamics.carries[np.ix_(link, link)]
        H = deeper * turned[:, None, :]
        return np.asarray(H + np.triu(H, 1).transpose(0, 2, 1))

    def mass_center(self, q: np.ndarray) -> np.ndarray:
        return np.asarray(self.points(q) @ self.mass / self.mass.sum())

    def with_mass(self, values: np.ndarray) -> np.ndarray:
        """(n, k + 1, ...): values (n, k, ...) of the points and, last, that of the whole body's
        centre of mass."""
        mean = np.einsum("k,nk...->n...", self.mass / self.mass.sum(), values)
        return np.concatenate([values, mean[:, None]], axis=1)

    def near_floor(self, wanted: np.ndarray, ground: float) -> np.ndarray:
        """(n, k) from 0 to 1: how near the floor a contact sphere is; 0 for all other points."""
        gap = wanted.imag - self.radius - ground
        return np.where(self.radius > 0.0, 0.5 - 0.5 * np.tanh(0.5 * (gap - FLOOR_M) / FADE_M), 0.0)


def frames(motion: PlanarMotion, link: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins of links' frames, and the factors by which they are turned; complex, (k, ...)."""
    return (motion.x + 1j * motion.z)[link], (motion.c - 1j * motion.s)[link]


def straightened(trial: Trial) -> Trial:
    """The trial of the person with the prosthetic foot in the sagittal plane: neither turned out
    nor inverted under the pylon. A foot whose turn nobody measured is taken as it is: what a fit
    corrects there is part of the projection's error."""
    subject = trial.subject
    if (subject.prosthesis_inversion_rad, subject.prosthesis_toe_out_rad) == (None, None):
        return trial
    return replace(
        trial,
        subject=replace(subject, prosthesis_inversion_rad=None, prosthesis_toe_out_rad=None),
        offsets=replace(trial.offsets, inversion_rad=0.0, toe_out_rad=0.0),
    )


def sagittal_chain(walker: Walker, offsets: GeometricOffsets, *, fulcrum_m: float) -> SagittalChain:
    """The sagittal model of a person with the prosthesis as `offsets` place it."""
    zero = body_points(walker, offsets, (), np.zeros((1, 0)), fulcrum_m=fulcrum_m)
    tree = without_branch(
        gait_mechanism(walker.gait, walker.context).tree,
        walker.gait.person.socket.coordinate_names[0],
    )
    names = sagittal_coordinates(walker.subject.prosthetic_side)
    dynamics = PlanarDynamics(planar_tree(tree, names))
    nil = np.zeros(len(names))
    origin, turn = frames(dynamics.move(nil, nil, nil), dynamics.link[zero.carrier])
    return SagittalChain(
        labels=zero.labels,
        carrier=zero.carrier,
        mass=zero.mass,
        radius=zero.radius,
        dynamics=dynamics,
        local=(zero.seen(np.array([1.0, 0.0]))[0] - origin) / turn,
        aside=zero.places[0, :, 1],
    )


ITERATIONS = 50
SMALLEST_STEP = 1e-7  # m and rad: what moves by less has arrived
# How far (standard deviations; choices) the sagittal model may be from the 3-D one, m and rad.
LOADED_HEIGHT, LOADED_ALONG, SWINGING = 1e-4, 5e-4, 5e-3
"""Of a contact sphere near the floor, and of one far from it, both ways."""
JOINTS = {"hip": 2e-2, "knee": 5e-3, "ankle": 5e-3}
MASS = 2e-4  # of the whole body's centre of mass
# of hip, knee and ankle angles from the recorded ones, and of the pelvis's
ANGLE = 0.03
PELVIS_TILT = 0.01
# gap under a sphere at which it counts half, and over which that fades
FLOOR_M = 0.01
FADE_M = 0.002


@dataclass(frozen=True, eq=False)
class Misfit:
    """What the sum of squares is made of; n instants, k points of the chain and, last, the centre
    of mass."""

    chain: SagittalChain
    wanted: np.ndarray  # (n, k + 1) complex, m
    along: np.ndarray  # (n, k + 1) weights, m^-2, of what a point is off along the way
    height: np.ndarray  # and up
    shifted: np.ndarray  # (k + 1,) whether d moves the point
    recorded: np.ndarray  # (n, 8) angles that are wanted
    turned: np.ndarray  # (8,) their weights

    def cost(self, q: np.ndarray, d: complex) -> np.ndarray:
        """(n,)"""
        r = self.chain.with_mass(self.chain.points(q)) - self.wanted - d * self.shifted
        return np.asarray(
            np.sum(self.along * r.real**2 + self.height * r.imag**2, axis=1)
            + (q - self.recorded) ** 2 @ self.turned
        )

    def normal(self, q: np.ndarray, d: complex) -> tuple[np.ndarray, ...]:
        """Newton's blocks per instant: A (n, 8, 8), b (n, 8), C (n, 8, 2), D (n, 2), e (n, 2), B
        (n, 8, 8).

        The step (dq, dd) solves [A + B, C; C', D] (dq, dd) = -(b, e), summed over the instants
        where d is concerned. B is what the curvature of the points' paths adds, which may be
        negative: without it, steps overshoot twofold where a knee is nearly straight.
        """
        places, J = map(self.chain.with_mass, self.chain.linearised(q))
        r = places - self.wanted - d * self.shifted
        moved = self.shifted
        B = self.chain.curvature(J, self.along * r.real + 1j * self.height * r.imag)
        parts = ((self.along, r.real, J.real), (self.height, r.imag, J.imag))
        A = np.sum(
            [np.einsum("nkc,nkd->ncd", weight[:, :, None] * j, j) for weight, _, j in parts], axis=0
        )
        A[:, range(8), range(8)] += self.turned
        along, height = (np.einsum("nk,nkc->nc", weight * off, j) for weight, off, j in parts)
        b = along + (height + self.turned * (q - self.recorded))
        C = -np.stack(
            [np.einsum("nk,nkc->nc", weight[:, moved], j[:, moved]) for weight, _, j in parts],
            axis=2,
        )
        D = np.stack([weight[:, moved].sum(axis=1) for weight, _, _ in parts], axis=1)
        e = -np.stack([(weight * off)[:, moved].sum(axis=1) for weight, off, _ in parts], axis=1)
        return A, b, C, D, e, B


def make_misfit(
    chain: SagittalChain, wanted: np.ndarray, recorded: np.ndarray, *, ground: float = 0.0
) -> Misfit:
    """What `project` minimises: wanted (n, k) is where the chain's points are in 3-D, see
    `BodyPoints.seen`, recorded (n, 8) the coordinates of the same names, ground the floor's z
    (m)."""
    turned = np.full(8, 1.0 / ANGLE**2)
    turned[TILT], turned[TILT + 1 : HIP_P] = 1.0 / PELVIS_TILT**2, 0.0
    share = chain.near_floor(wanted, ground)
    along, height = (np.zeros((len(wanted), len(chain.labels) + 1)) for _ in range(2))
    for s in FEET:
        for name, sigma in JOINTS.items():
            along[:, chain.rows(f"{name} {s}")] = height[:, chain.rows(f"{name} {s}")] = sigma**-2
        rows = chain.rows(f"sphere {s}")
        for weight, sigma in ((along, LOADED_ALONG), (height, LOADED_HEIGHT)):
            weight[:, rows] = (
                share[:, rows] / sigma**2 + (1.0 - share[:, rows]) / SWINGING**2
            ) / len(rows)
    along[:, -1] = height[:, -1] = MASS**-2
    shifted = np.append([label.startswith("hip") for label in chain.labels], True)
    return Misfit(chain, chain.with_mass(wanted), along, height, shifted, recorded, turned)


def project(misfit: Misfit) -> tuple[np.ndarray, complex, bool]:
    """The sagittal motion q (n, 8) nearest to a 3-D one, the constant d (m), and whether nothing
    moved any more: damped Newton steps from the recorded angles."""
    q = np.array(misfit.recorded)
    d = 0j
    damping = 1e-3
    cost = misfit.cost(q, d).sum()
    for _ in range(ITERATIONS):
        A, b, C, D, e, B = misfit.normal(q, d)
        A += B
        A[:, range(8), range(8)] += damping * np.abs(A[:, range(8), range(8)])

        # d is the only unknown that all instants share: S dd = C'A^-1 b - e by the Schur complement
        # S = D - C'A^-1 C of the instants' blocks, then dq = -A^-1 (b + C dd).
        solved = np.linalg.solve(A, np.concatenate([b[:, :, None], C], axis=2))
        S = np.diag(D.sum(axis=0)) - np.einsum("ncx,ncy->xy", C, solved[:, :, 1:])
        step_d = np.linalg.solve(S, np.einsum("ncx,nc->x", C, solved[:, :, 0]) - e.sum(axis=0))
        step = -solved[:, :, 0] - solved[:, :, 1:] @ step_d
        tried = misfit.cost(q + step, d + complex(*step_d)).sum()
        if not tried <= cost * (1.0 + 1e-12):
            damping *= 10.0
            continue
        q = q + step
        d = d + complex(*step_d)
        damping = max(0.1 * damping, 1e-12)
        cost = tried
        if max(np.abs(step).max(), np.abs(step_d).max()) < SMALLEST_STEP:
            return q, d, True
    return q, d, False
