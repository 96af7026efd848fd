"""A 3-D motion seen from the side: the sagittal coordinates that come nearest to it, instant by instant.

    minimise over q(t), for every t by itself, and over one constant d:
        sum over points |p(q) - p_3D - d_p|^2 / sigma_p^2  +  sum over angles (q_c - recorded)^2 / sigma_q^2

Points are both feet's contact spheres (height and place along the way are weighed apart), the knees, the ankle, the
pylon's end, the two hips and the whole body's centre of mass. A sphere counts fully where it is near the floor and
little in swing: 1 mm of height of the loaded prosthetic foot is about 3 % of body weight in its force (a sensitivity
found in this model). The centre of mass counts because its acceleration is the sum of the ground's forces. The two
hips are one point from the side: the pelvis's obliquity and rotation move them apart, by up to a centimetre, so that
the hip must go somewhere between and the angles take up the rest.

d_p is d for hips and centre of mass and zero for all other points: legs that lean outward are shorter seen from the
side, by millimetres that hardly change with time. A body that is moved by a constant does not accelerate otherwise;
knees that had to take that difference up, near straight, would bend by degrees.
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

ITERATIONS = 50
SMALLEST_STEP = 1e-7
"""m and rad: what moves by less has arrived."""


# How far (standard deviations; choices) the sagittal model may be from the 3-D one, m and rad.
LOADED_HEIGHT, LOADED_ALONG, SWINGING = 1e-4, 5e-4, 5e-3
"""Of a contact sphere near the floor, and of one far from it, both ways."""
JOINTS = {"hip": 2e-2, "knee": 5e-3, "ankle": 5e-3}
MASS = 2e-4
"""Of the whole body's centre of mass."""
ANGLE, PELVIS_TILT = 0.03, 0.01
"""Of hip, knee and ankle angles from the recorded ones, and of the pelvis's."""
FLOOR_M, FADE_M = 0.01, 0.002
"""Gap under a sphere at which it counts half, and over which that fades."""


@dataclass(frozen=True, eq=False)
class Misfit:
    """What the sum of squares is made of; n instants, k points of the chain and, last, the centre of mass.

    Attributes:
        wanted: (n, k + 1) complex, m. along, height: (n, k + 1) weights, m^-2. shifted: (k + 1,) whether d moves it.
        recorded: (n, 8) angles that are wanted. turned: (8,) their weights.
    """

    wanted: np.ndarray
    along: np.ndarray
    height: np.ndarray
    shifted: np.ndarray
    recorded: np.ndarray
    turned: np.ndarray

    def cost(self, chain: SagittalChain, q: np.ndarray, d: complex) -> np.ndarray:
        """(n,) the sum of squares of every instant."""
        r = with_mass(chain, chain.points(q)[0])[0] - self.wanted - d * self.shifted
        return (np.sum(self.along * r.real**2 + self.height * r.imag**2, axis=1)
                + (q - self.recorded) ** 2 @ self.turned)

    def normal(self, chain: SagittalChain, q: np.ndarray, d: complex) -> tuple[np.ndarray, ...]:
        """Newton's blocks per instant: A (n, 8, 8), b (n, 8), C (n, 8, 2), D (n, 2), e (n, 2), B (n, 8, 8).

        The step (dq, dd) solves [A + B, C; C', D] (dq, dd) = -(b, e), summed over the instants where d is concerned.
        B is what the curvature of the points' paths adds, which may be negative: without it, steps overshoot twofold
        where a knee is nearly straight.
        """
        places, J = with_mass(chain, *chain.points(q, jacobian=True))
        r = places - self.wanted - d * self.shifted
        A = np.einsum("nkc,nkd->ncd", self.along[:, :, None] * J.real, J.real)
        A += np.einsum("nkc,nkd->ncd", self.height[:, :, None] * J.imag, J.imag)
        B = chain.curvature(J, self.along * r.real + 1j * self.height * r.imag)
        A[:, range(8), range(8)] += self.turned
        b = np.einsum("nk,nkc->nc", self.along * r.real, J.real)
        b += np.einsum("nk,nkc->nc", self.height * r.imag, J.imag) + self.turned * (q - self.recorded)
        part = [weight[:, self.shifted] for weight in (self.along, self.height)]
        C = -np.stack([np.einsum("nk,nkc->nc", part[0], J.real[:, self.shifted]),
                       np.einsum("nk,nkc->nc", part[1], J.imag[:, self.shifted])], axis=2)
        D = np.stack([weight.sum(axis=1) for weight in part], axis=1)
        e = -np.stack([(part[0] * r.real[:, self.shifted]).sum(axis=1),
                       (part[1] * r.imag[:, self.shifted]).sum(axis=1)], axis=1)
        return A, b, C, D, e, B


@dataclass(frozen=True, eq=False)
class Projection:
    """Attributes: q: (n, 8). shift: complex, m, the constant d. converged: whether nothing moved any more."""

    q: np.ndarray
    shift: complex
    converged: bool


def make_misfit(chain: SagittalChain, wanted: np.ndarray, recorded: np.ndarray, *, ground: float = 0.0) -> Misfit:
    """What `project` minimises.

    Args:
        wanted: (n, k) complex, m: where the chain's points are in 3-D, see `targets`.
        recorded: (n, 8) the coordinates of the same names in the 3-D motion.
        ground: z of the floor, m.
    """
    turned = np.full(8, 1.0 / ANGLE**2)
    turned[TILT], turned[TILT + 1 : HIP_P] = 1.0 / PELVIS_TILT**2, 0.0
    share = near_floor(chain, wanted, ground)
    along, height = (np.zeros((len(wanted), len(chain.labels) + 1)) for _ in range(2))
    for s in FEET:
        for name, sigma in JOINTS.items():
            along[:, chain.rows(f"{name} {s}")] = height[:, chain.rows(f"{name} {s}")] = sigma**-2
        rows = chain.rows(f"sphere {s}")
        for weight, sigma in ((along, LOADED_ALONG), (height, LOADED_HEIGHT)):
            weight[:, rows] = (share[:, rows] / sigma**2 + (1.0 - share[:, rows]) / SWINGING**2) / len(rows)
    along[:, -1] = height[:, -1] = MASS**-2
    shifted = np.append([label.startswith("hip") for label in chain.labels], True)
    return Misfit(with_mass(chain, wanted)[0], along, height, shifted, recorded, turned)


def project(chain: SagittalChain, misfit: Misfit) -> Projection:
    """The sagittal motion nearest to a 3-D one: damped Newton steps from the recorded angles."""
    q, d, damping = np.array(misfit.recorded), 0j, 1e-3
    cost = misfit.cost(chain, q, d).sum()
    for _ in range(ITERATIONS):
        A, b, C, D, e, B = misfit.normal(chain, q, d)
        A += B
        A[:, range(8), range(8)] += damping * np.abs(A[:, range(8), range(8)])
        solved = np.linalg.solve(A, np.concatenate([b[:, :, None], C], axis=2))
        S = np.diag(D.sum(axis=0)) - np.einsum("ncx,ncy->xy", C, solved[:, :, 1:])
        step_d = np.linalg.solve(S, np.einsum("ncx,nc->x", C, solved[:, :, 0]) - e.sum(axis=0))
        step = -solved[:, :, 0] - solved[:, :, 1:] @ step_d
        tried = misfit.cost(chain, q + step, d + complex(*step_d)).sum()
        if not tried <= cost * (1.0 + 1e-12):
            damping *= 10.0
            continue
        q, d, damping, cost = q + step, d + complex(*step_d), max(0.1 * damping, 1e-12), tried
        if max(np.abs(step).max(), np.abs(step_d).max()) < SMALLEST_STEP:
            return Projection(q, d, True)
    return Projection(q, d, False)


def near_floor(chain: SagittalChain, wanted: np.ndarray, ground: float) -> np.ndarray:
    """(n, k) from 0 to 1: how near the floor a contact sphere is; 0 for all other points."""
    gap = wanted.imag - chain.radius - ground
    return np.where(chain.radius > 0.0, 0.5 - 0.5 * np.tanh(0.5 * (gap - FLOOR_M) / FADE_M), 0.0)


def with_mass(chain: SagittalChain, places: np.ndarray, J: np.ndarray | None = None
              ) -> tuple[np.ndarray, np.ndarray | None]:
    """The same with the whole body's centre of mass as a last point: (n, k + 1) and (n, k + 1, 8)."""
    share = chain.mass / chain.mass.sum()
    wider = np.concatenate([places, (places @ share)[:, None]], axis=1)
    return wider, None if J is None else np.concatenate([J, np.einsum("k,nkc->nc", share, J)[:, None]], axis=1)


# Where the person's joints, contact spheres and centres of mass are in the 3-D model, instant by instant.
#
# Keel and socket are undeformed: what the recording prescribes is all that is known.


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


# The sagittal model's geometry: a planar tree of rigid segments, for many instants at once.
#
# Points of the plane are complex numbers x + i z (x forward, z up), so that a turn by an angle toward "front up" is a
# factor exp(i angle). With out-of-plane coordinates at zero every joint of the person turns about W's y axis:
#
#     trunk     phi = tilt
#     thigh     phi + hip flexion
#     shank     phi + hip flexion - knee angle              (prosthetic side: socket, pylon and foot move with it)
#     foot      phi + hip flexion - knee angle + ankle      (intact side)
#
# Lengths are the Walker's own, read off its plant with every coordinate at zero.


TILT, TX, TY, HIP_P, KNEE_P, HIP_I, KNEE_I, ANKLE_I = range(8)
"""Places of the coordinates in `sagittal_coordinates`."""
_TURNS = {"pelvis": ((TILT, 1.0),)}
_TURNS["thigh_P"] = (*_TURNS["pelvis"], (HIP_P, 1.0))
_TURNS["shank_P"] = (*_TURNS["thigh_P"], (KNEE_P, -1.0))
_TURNS["thigh_I"] = (*_TURNS["pelvis"], (HIP_I, 1.0))
_TURNS["shank_I"] = (*_TURNS["thigh_I"], (KNEE_I, -1.0))
_TURNS["foot_I"] = (*_TURNS["shank_I"], (ANKLE_I, 1.0))
_ORDERS = (_TURNS["shank_P"], _TURNS["foot_I"])
"""The joints down either leg, with their signs."""
_PARENT = {"thigh_P": "pelvis", "shank_P": "thigh_P", "thigh_I": "pelvis", "shank_I": "thigh_I", "foot_I": "shank_I"}


@dataclass(frozen=True, eq=False)
class SagittalChain:
    """A planar person with k points on it.

    Attributes:
        joints: by segment, the complex place of its proximal joint in its parent's axes (m); the pelvis's is 0.
        segment: (k,) index into `SEGMENTS` of the points. local: (k,) complex, from that segment's joint (m).
        labels: (k,) "hip P", "knee P", "ankle P", "sphere P", the same with I, "mass".
        mass: (k,) kg where the point is a centre of mass, else 0.
        radius: (k,) m where the point is the centre of a contact sphere, else 0.
    """

    joints: dict[str, complex]
    segment: np.ndarray
    local: np.ndarray
    labels: tuple[str, ...]
    mass: np.ndarray
    radius: np.ndarray

    def rows(self, start: str) -> np.ndarray:
        """Indices of the points whose label starts so."""
        return np.array([k for k, label in enumerate(self.labels) if label.startswith(start)], dtype=int)

    def points(self, q: np.ndarray, *, jacobian: bool = False) -> tuple[np.ndarray, np.ndarray | None]:
        """(n, k) complex places for coordinates (n, 8), and (n, k, 8) complex derivatives if asked for."""
        origin = {"pelvis": q[:, TX] + 1j * q[:, TY]}
        turn = {name: np.exp(1j * sum(sign * q[:, c] for c, sign in _TURNS[name])) for name in SEGMENTS}
        for name in SEGMENTS[1:]:
            parent = _PARENT[name]
            origin[name] = origin[parent] + self.joints[name] * turn[parent]
        names = [SEGMENTS[s] for s in self.segment]
        places = np.stack([origin[name] + r * turn[name] for name, r in zip(names, self.local, strict=True)], axis=1)
        if not jacobian:
            return places, None
        J = np.zeros((*places.shape, 8), dtype=complex)
        J[:, :, TX], J[:, :, TY] = 1.0, 1j
        pivot = {TILT: "pelvis", HIP_P: "thigh_P", KNEE_P: "shank_P", HIP_I: "thigh_I", KNEE_I: "shank_I",
                 ANKLE_I: "foot_I"}
        for k, name in enumerate(names):
            for c, sign in _TURNS[name]:
                J[:, k, c] = 1j * sign * (places[:, k] - origin[pivot[c]])
        return places, J

    def curvature(self, J: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """(n, 8, 8) sum over points of Re(conj(pull) d2p/dq2): what curved paths add to a least-squares Hessian.

        d2p/dq_c dq_d is i s_c dp/dq_d, c being the joint nearer to the pelvis and s_c its sign.

        Args:
            J: (n, k, 8) from `points`; the points need not be the chain's own, but may be sums of them.
            pull: (n, k) complex residuals, each part times its weight.
        """
        turned = np.einsum("nk,nkd->nd", pull.conj(), 1j * J).real
        H = np.zeros((len(J), 8, 8))
        for order in _ORDERS:
            for place, (c, sign) in enumerate(order):
                for deeper, _ in order[place:]:
                    H[:, c, deeper] = H[:, deeper, c] = sign * turned[:, deeper]
        return H

    def mass_center(self, q: np.ndarray) -> np.ndarray:
        """(n,) complex, m: the whole body's centre of mass."""
        return self.points(q)[0] @ self.mass / self.mass.sum()


def sagittal_chain(walker: Walker, offsets: GeometricOffsets, *, fulcrum_m: float) -> SagittalChain:
    """The sagittal model of a person with the prosthesis as `offsets` place it."""
    zero = body_points(walker, offsets, (), np.zeros((1, 0)), fulcrum_m=fulcrum_m)
    hip, knee, ankle = (flat(points)[0] for points in (zero.hip, zero.knee, zero.ankle))
    origin = flat(zero.pelvis)[0]
    base = {"pelvis": origin, "thigh_P": hip[0], "shank_P": knee[0], "thigh_I": hip[1], "shank_I": knee[1],
            "foot_I": ankle[1]}
    joints = {"pelvis": 0j} | {name: base[name] - base[parent] for name, parent in _PARENT.items()}
    places, segments, labels, mass, radius = [], [], [], [], []

    def add(points: np.ndarray, names: list[str], label: str, m: np.ndarray | float, r: np.ndarray | float) -> None:
        places.extend(points)
        segments.extend(SEGMENTS.index(name) for name in names)
        labels.extend([label] * len(points))
        mass.extend(np.broadcast_to(m, len(points)))
        radius.extend(np.broadcast_to(r, len(points)))

    for i, s in enumerate(FEET):
        foot = "shank_P" if s == "P" else "foot_I"
        add(hip[i : i + 1], [f"thigh_{s}"], f"hip {s}", 0.0, 0.0)
        add(knee[i : i + 1], [f"shank_{s}"], f"knee {s}", 0.0, 0.0)
        add(ankle[i : i + 1], [foot], f"ankle {s}", 0.0, 0.0)
        add(flat(zero.spheres[s])[0], [foot] * len(zero.radius[s]), f"sphere {s}", 0.0, zero.radius[s])
    add(flat(zero.mass_center)[0], [SEGMENTS[b] for b in zero.mass_body], "mass", zero.mass, 0.0)
    local = np.array([p - base[SEGMENTS[s]] for p, s in zip(places, segments, strict=True)])
    return SagittalChain(joints=joints, segment=np.array(segments), local=local, labels=tuple(labels),
                         mass=np.array(mass), radius=np.array(radius))


def flat(points: np.ndarray, forward: np.ndarray | None = None) -> np.ndarray:
    """(...) complex x + i z of points (..., 3) in W, x along `forward` ((2,) unit vector in the floor)."""
    ahead = points[..., 0] if forward is None else points[..., :2] @ forward
    return ahead + 1j * points[..., 2]


def targets(chain: SagittalChain, points: BodyPoints, forward: np.ndarray) -> np.ndarray:
    """(n, k) complex: where the 3-D model has the chain's points, projected on the plane of walking."""
    parts = []
    for i, s in enumerate(FEET):
        parts += [points.hip[:, i : i + 1], points.knee[:, i : i + 1], points.ankle[:, i : i + 1], points.spheres[s]]
    return flat(np.concatenate([*parts, points.mass_center], axis=1), forward)
