"""The sagittal model's geometry: a planar tree of rigid segments, for many instants at once.

Points of the plane are complex numbers x + i z (x forward, z up), so that a turn by an angle toward "front up" is a
factor exp(i angle). With out-of-plane coordinates at zero every joint of the person turns about W's y axis:

    trunk     phi = tilt
    thigh     phi + hip flexion
    shank     phi + hip flexion - knee angle              (prosthetic side: socket, pylon and foot move with it)
    foot      phi + hip flexion - knee angle + ankle      (intact side)

Lengths are the Walker's own, read off its plant with every coordinate at zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.recorded_points import FEET, SEGMENTS, BodyPoints, body_points
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.walk import Walker

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
