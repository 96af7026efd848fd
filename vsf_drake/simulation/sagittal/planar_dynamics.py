"""Kinematics and inverse dynamics of a planar tree for many instants at once, in arrays of any
shape, real or complex.

    twist  (omega, vx, vz): turn about +y, velocity of the body's point that passes W's origin
    wrench (my, fx, fz): moment about +y at W's origin, force

All are taken at W's origin, so that what a branch does is a plain sum over its links: velocities
over the links that carry one, forces over those that it carries (Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 2 and 5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.simulation.stepping.tree import REVOLUTE, WELD, Tree


@dataclass(frozen=True, eq=False)
class PlanarMotion:
    """L links at one or many instants."""

    x: np.ndarray  # (L, ...) m, origins of the links' frames in W
    z: np.ndarray
    c: np.ndarray  # cosine and sine of the frames' angles about +y
    s: np.ndarray
    S: np.ndarray  # (3, L, ...) twist of each link's joint at unit rate
    V: np.ndarray  # (3, L, ...) twists
    A: np.ndarray  # (3, L, ...) their rates, in a world that gravity is a rise of
    H: np.ndarray  # (2, L, ...) kg m, first moments of mass about W's origin
    J: np.ndarray  # (L, ...) moments of inertia about it


class PlanarDynamics:
    """A tree whose every link has a coordinate of its own."""

    def __init__(self, tree: PlanarTree) -> None:
        self.gravity = tree.gravity
        (
            self.parent,
            self.coordinate,
            self.turn,
            self._direction,
            self._offset,
            self._angle,
            self.mass,
            self._moment,
            self._inertia,
        ) = (np.array(column).T for column in zip(*map(astuple, tree.links), strict=True))
        self.link = np.argsort(self.coordinate)  # (L,) of the coordinates; `turn` (L,) as of `Link`
        # (L, L), [i, j] is 1 where link i carries link j, or is it
        self.carries = np.eye(len(tree.links))
        for j, link in enumerate(tree.links):
            if link.parent >= 0:
                self.carries[:, j] += self.carries[:, link.parent]

    def move(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> PlanarMotion:
        q = q[self.coordinate]
        v = v[self.coordinate]
        a = a[self.coordinate]
        tail = (-1, *(1,) * (q.ndim - 1))
        turn = self.turn.reshape(tail)
        angle = self._angle.reshape(tail)
        own = angle + turn * q
        phi = self.of_carriers(own)
        direction = self._direction.reshape(2, *tail)
        offset = self._offset.reshape(2, *tail)
        dx, dz = turned(direction[0], direction[1], phi - own + angle)
        ox, oz = turned(offset[0], offset[1], phi - own)
        x, z = self.of_carriers(np.stack([ox + dx * q, oz + dz * q]))
        S = np.stack([turn + 0.0 * q, dx - turn * z, dz + turn * x])
        V = self.of_carriers(S * v)
        A = self.of_carriers(S * a + cross(V, S) * v)
        A[2] += self.gravity
        c = np.cos(phi)
        s = np.sin(phi)
        mass, (mx, mz) = self.mass.reshape(tail), self._moment.reshape(2, *tail)
        hx = c * mx + s * mz
        hz = c * mz - s * mx
        H = np.stack([hx + mass * x, hz + mass * z])
        J = self._inertia.reshape(tail) + x * (hx + H[0]) + z * (hz + H[1])
        return PlanarMotion(x=x, z=z, c=c, s=s, S=S, V=V, A=A, H=H, J=J)

    def inertial(self, motion: PlanarMotion) -> np.ndarray:
        """(3, L, ...) wrenches that each link's inertia and weight take."""
        p = self.momentum(motion, motion.V)
        f = self.momentum(motion, motion.A)
        omega, vx, vz = motion.V
        return np.asarray(f + np.stack([vz * p[1] - vx * p[2], omega * p[2], -omega * p[1]]))

    def momentum(self, motion: PlanarMotion, m: np.ndarray) -> np.ndarray:
        """(3, L, ...) inertia of each link times the twists `m`."""
        mass = self.mass.reshape(-1, *(1,) * (m.ndim - 2))
        return inertia_times(motion.J, motion.H, mass, m)

    def of_carriers(self, y: np.ndarray) -> np.ndarray:
        """(L, ...) or (n, L, ...): for each link, the sum of y over what carries it, and it."""
        return _product(self.carries.T, y)

    def of_carried(self, y: np.ndarray) -> np.ndarray:
        return _product(self.carries, y)

    def joint_forces(self, motion: PlanarMotion, F: np.ndarray) -> np.ndarray:
        """(L, ...) by coordinate, what the joints must give where F (3, L, ...) is taken by what
        each link carries."""
        return np.asarray(np.einsum("cl...,cl...->l...", motion.S, F)[self.link])


def cross(m: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Twist m x n: rate of the twist n if it is fixed to a body that moves with m; (3, ...)."""
    return np.stack([0.0 * (m[0] + n[0]), m[0] * n[2] - n[0] * m[2], n[0] * m[1] - m[0] * n[1]])


def inertia_times(J: np.ndarray, H: np.ndarray, mass: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Momentum (3, ...) of what has moment J, first moments H and mass about W's origin, at the
    twist m."""
    return np.stack(
        [J * m[0] + H[1] * m[1] - H[0] * m[2], H[1] * m[0] + mass * m[1], mass * m[2] - H[0] * m[0]]
    )


def _product(M: np.ndarray, y: np.ndarray) -> np.ndarray:
    """M (L, L) on the axis of y that has the links: the first, or the second after one of another
    length."""
    lead = y.shape[:1] if y.shape[0] != M.shape[1] else ()
    flat = np.ascontiguousarray(y).reshape(*lead, M.shape[1], -1)
    # As pairs of reals: complex products with a real matrix would do everything twice.
    product = np.asarray((M @ flat.view(float)).view(y.dtype))
    return product.reshape(*lead, M.shape[0], *y.shape[len(lead) + 1 :])


# A plant's tree of joints, seen from the side: bodies that move and turn in the x-z plane only.
#
#     x forward, z up; angles phi about +y (left), so that a turn takes z to x
#
# Joints whose axis is y, x or z move; every other joint, and those not asked for, are held at zero.
# Frames, masses and inertias are the plant's own, as `stepping.tree` reads them.


IN_PLANE = 0.999999  # least share of a joint's axis in the plane's own directions


@dataclass
class Link:
    """One joint that moves, and the rigid body of all that is welded to what it carries."""

    parent: int  # index of the link that carries it, -1 for the world
    coordinate: int  # its place among the coordinates asked for
    turn: float  # 1 or -1 if it is revolute, of its axis along +y; 0 if it is prismatic
    direction: np.ndarray
    """(2,) x, z of the way of a prismatic joint, in the frame of its parent; else 0"""
    offset: np.ndarray  # (2,) m, its place in the frame of its parent
    angle: float  # rad, how its frame is turned there
    mass: float = 0.0  # kg
    moment: np.ndarray = field(default_factory=lambda: np.zeros(2))
    """first moments m c, kg m, in its frame"""
    inertia: float = 0.0  # about its origin, kg m^2


@dataclass(frozen=True)
class PlanarTree:
    """Links, parents first, and where the plant's bodies are on them."""

    links: list[Link]
    bodies: dict[int, tuple[int, np.ndarray, float]]
    """By the plant's body index, the link (-1 for the world) and the body's (x, z, angle) in its
    frame; by minus that index, the body's mirror image (`with_mirror_image`)."""
    gravity: float  # m/s^2, downwards


def turned(x: np.ndarray, z: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """(x, z) turned by `angle` about +y."""
    c = np.cos(angle)
    s = np.sin(angle)
    return c * x + s * z, c * z - s * x


def planar_tree(tree: Tree, names: Sequence[str], *, turning_weld: str | None = None) -> PlanarTree:
    """The sagittal tree with the coordinates `names`, in that order; all others at zero. InputError
    if it is not plane.

    The weld of the body `turning_weld` turns too, clockwise seen from the left (about -y, at the
    frame on the child), as one more coordinate after `names`.
    """
    missing = [name for name in names if name not in tree.coordinate_names]
    if missing:
        raise InputError(
            f"the plant has no coordinate {', '.join(missing)}", where="sagittal model"
        )
    wanted = {tree.index(name): i for i, name in enumerate(names)}
    links: list[Link] = []
    bodies: dict[int, tuple[int, np.ndarray, float]] = {0: (-1, np.zeros(2), 0.0)}
    for (kind, parent, child, coordinate), frame in zip(tree.links, tree.frames, strict=True):
        on, at, angle = bodies[int(parent)]
        name = (
            tree.coordinate_names[coordinate]
            if coordinate >= 0
            else f"weld of {tree.body_names[child]}"
        )
        place, turn = _then(at, angle, frame[9:12], frame[:9], name)
        new = None
        if kind == WELD and tree.body_names[child] == turning_weld:
            new = Link(on, len(names), -1.0, np.zeros(2), place, turn)
        elif kind != WELD and int(coordinate) in wanted:
            axis = frame[24:27]
            revolute = kind == REVOLUTE
            if abs(axis[1] if revolute else np.hypot(axis[0], axis[2])) < IN_PLANE:
                raise InputError(
                    f"{name} does not move in the sagittal plane", where="sagittal model"
                )
            new = Link(
                on,
                wanted[int(coordinate)],
                float(np.sign(axis[1])) if revolute else 0.0,
                np.zeros(2) if revolute else axis[[0, 2]],
                place,
                turn,
            )
        if new is not None:
            links.append(new)
            on = len(links) - 1
            place = np.zeros(2)
            turn = 0.0
        place, turn = _then(place, turn, frame[21:24], frame[12:21], name)
        bodies[int(child)] = (on, place, turn)
        if on >= 0:
            body = tree.inertias[child]
            link = links[on]
            mass = body[0]
            moment = np.array(turned(body[1], body[3], turn))
            link.mass += mass
            link.inertia += body[5] + 2.0 * float(place @ moment) + mass * float(place @ place)
            link.moment = link.moment + moment + mass * place
    return PlanarTree(links=links, bodies=bodies, gravity=-float(tree.gravity[2]))


def without_branch(tree: Tree, name: str) -> Tree:
    """The plant's tree without the joints that carry what the coordinate `name` moves."""
    kept = ~tree.ancestors[tree.links[:, 2], tree.index(name)]
    return replace(tree, links=tree.links[kept], frames=tree.frames[kept])


def with_mirror_image(tree: PlanarTree, images: Mapping[int, int], *, mass_kg: float) -> PlanarTree:
    """The tree and, on the same link, a copy of a branch; `images` names the copy's coordinate by
    that of each joint.

    The link that carries both gets the mass that they leave of `mass_kg`; its centre and radius of
    gyration stay.
    """
    links = list(tree.links)
    bodies = dict(tree.bodies)
    link_images: dict[int, int] = {}
    for i, link in enumerate(tree.links):
        if link.coordinate in images:
            link_images[i] = len(links)
            links.append(
                replace(
                    link,
                    coordinate=images[link.coordinate],
                    parent=link_images.get(link.parent, link.parent),
                )
            )
    for body, (link_index, place, angle) in tree.bodies.items():
        if link_index in link_images:
            bodies[-body] = link_images[link_index], place, angle
    root = tree.links[min(link_images)].parent
    trunk = links[root]
    share = 1.0 + (mass_kg - sum(link.mass for link in links)) / trunk.mass
    links[root] = replace(
        trunk, mass=share * trunk.mass, moment=share * trunk.moment, inertia=share * trunk.inertia
    )
    return replace(tree, links=links, bodies=bodies)


def _then(
    at: np.ndarray, angle: float, p: np.ndarray, R: np.ndarray, name: str
) -> tuple[np.ndarray, float]:
    R = R.reshape(3, 3)
    if abs(R[1, 1]) < IN_PLANE:
        raise InputError(
            f"the frame of {name} is turned out of the sagittal plane by "
            f"{np.degrees(np.arccos(np.clip(R[1, 1], -1, 1))):.1f} deg",
            where="sagittal model",
            right=(
                "The sagittal model knows no toe-out and no inversion of the prosthesis: leave "
                "them out"
            ),
        )
    x, z = turned(p[0], p[2], angle)
    return at + np.array([x, z]), angle + float(np.arctan2(R[0, 2], R[0, 0]))
