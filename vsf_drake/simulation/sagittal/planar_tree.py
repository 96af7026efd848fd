"""A plant's tree of joints, seen from the side: bodies that move and turn in the x-z plane only.

    x forward, z up; angles phi about +y (left), so that a turn takes z to x

Joints whose axis is y, x or z move; every other joint, and those not asked for, are held at zero. Frames, masses
and inertias are the plant's own, as `stepping.tree` reads them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.stepping.tree import REVOLUTE, WELD, Tree

IN_PLANE = 0.999999
"""Least share of a joint's axis in the plane's own directions."""


@dataclass(frozen=True)
class Link:
    """One joint that moves, and the rigid body of all that is welded to what it carries.

    Attributes:
        parent: index of the link that carries it, -1 for the world.
        coordinate: its place among the coordinates asked for.
        turns: whether it is revolute; sign: of its axis along +y, or along the direction.
        direction: (2,) x, z of the way of a prismatic joint, in the frame of its parent.
        offset: (2,) m, its place in the frame of its parent; angle: rad, how its frame is turned there.
        mass: kg; moment: (2,) first moments m c, kg m, in its frame; inertia: about its origin, kg m^2.
    """

    parent: int
    coordinate: int
    turns: bool
    sign: float
    direction: np.ndarray
    offset: np.ndarray
    angle: float
    mass: float
    moment: np.ndarray
    inertia: float


@dataclass(frozen=True)
class PlanarTree:
    """Links, parents first, and where the plant's bodies are on them.

    Attributes:
        bodies: by the plant's body index, the link (-1 for the world) and the body's (x, z, angle) in its frame.
        gravity: m/s^2, downwards.
    """

    links: tuple[Link, ...]
    bodies: dict[int, tuple[int, np.ndarray, float]]
    gravity: float


def turned(x: np.ndarray, z: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """(x, z) turned by `angle` about +y."""
    c, s = np.cos(angle), np.sin(angle)
    return c * x + s * z, c * z - s * x


def planar_tree(tree: Tree, names: Sequence[str], *, turning_weld: str | None = None) -> PlanarTree:
    """The sagittal tree with the coordinates `names`, in that order; all others at zero.

    Args:
        turning_weld: a body whose weld turns too, clockwise seen from the left (about -y, at the frame on the child),
            as one more coordinate after `names`.

    Raises:
        InputError: a fixed frame between two bodies is turned out of the plane, or a coordinate is not in it.
    """
    missing = [name for name in names if name not in tree.coordinate_names]
    if missing:
        raise InputError(f"the plant has no coordinate {', '.join(missing)}", where="sagittal model")
    wanted = {tree.index(name): i for i, name in enumerate(names)}
    links: list[dict] = []
    bodies: dict[int, tuple[int, np.ndarray, float]] = {0: (-1, np.zeros(2), 0.0)}
    for (kind, parent, child, coordinate), frame in zip(tree.links, tree.frames, strict=True):
        on, at, angle = bodies[int(parent)]
        name = tree.coordinate_names[coordinate] if coordinate >= 0 else f"weld of {tree.body_names[child]}"
        place, turn = _then(at, angle, frame[9:12], frame[:9], name)
        if kind == WELD and tree.body_names[child] == turning_weld:
            links.append(_link(on, len(names), True, -1.0, np.zeros(2), place, turn))
            on, place, turn = len(links) - 1, np.zeros(2), 0.0
        elif kind != WELD and int(coordinate) in wanted:
            axis = frame[24:27]
            inside = axis[1] if kind == REVOLUTE else np.hypot(axis[0], axis[2])
            if abs(inside) < IN_PLANE:
                raise InputError(f"{name} does not move in the sagittal plane", where="sagittal model")
            sign = float(np.sign(axis[1])) if kind == REVOLUTE else 1.0
            links.append(_link(on, wanted[int(coordinate)], bool(kind == REVOLUTE), sign, axis[[0, 2]], place, turn))
            on, place, turn = len(links) - 1, np.zeros(2), 0.0
        place, turn = _then(place, turn, frame[21:24], frame[12:21], name)
        bodies[int(child)] = (on, place, turn)
        if on >= 0:
            _add_inertia(links[on], tree.inertias[child], place, turn)
    return PlanarTree(links=tuple(Link(**link) for link in links), bodies=bodies, gravity=-float(tree.gravity[2]))


def _then(at: np.ndarray, angle: float, p: np.ndarray, R: np.ndarray, name: str) -> tuple[np.ndarray, float]:
    """A frame at (p, R) in one that is at (at, angle)."""
    R = R.reshape(3, 3)
    if abs(R[1, 1]) < IN_PLANE:
        raise InputError(f"the frame of {name} is turned out of the sagittal plane by "
                         f"{np.degrees(np.arccos(np.clip(R[1, 1], -1, 1))):.1f} deg", where="sagittal model",
                         right="The sagittal model knows no toe-out and no inversion of the prosthesis: leave them out")
    x, z = turned(p[0], p[2], angle)
    return at + np.array([x, z]), angle + float(np.arctan2(R[0, 2], R[0, 0]))


def _link(
    parent: int, coordinate: int, turns: bool, sign: float, direction: np.ndarray, offset: np.ndarray, angle: float
) -> dict:
    return {"parent": parent, "coordinate": coordinate, "turns": turns, "sign": sign, "direction": np.array(direction),
            "offset": offset, "angle": angle, "mass": 0.0, "moment": np.zeros(2), "inertia": 0.0}


def _add_inertia(link: dict, inertia: np.ndarray, place: np.ndarray, angle: float) -> None:
    mass, moment = inertia[0], np.array(turned(inertia[1], inertia[3], angle))
    link["mass"] += mass
    link["inertia"] += inertia[5] + 2.0 * float(place @ moment) + mass * float(place @ place)
    link["moment"] = link["moment"] + moment + mass * place
