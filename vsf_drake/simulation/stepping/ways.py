"""What a run is differentiated by, as arrays, and the room that this takes.

A way is a direction in which bodies can be displaced: each free coordinate is one, and so are, for parameters that
move something, a prescribed coordinate, or the foot's mount as if it were a joint without mass. All parameters that
move the same prescribed coordinate share its way: constant shifts, and courses that change with time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vsf_drake.simulation.stepping.assembly import Forces, Split
from vsf_drake.simulation.stepping.tree import Tree

UNRELATED, CARRIES, CARRIED = 0, 1, 2


class Ways(NamedTuple):
    """C ways, the f free coordinates first, and how P parameters enter, K of them as courses, on n steps."""

    coordinate: np.ndarray  # (C,) or -1 for the mount
    body: np.ndarray  # (C,) what moves, and parent (C,): relative to which body
    parent: np.ndarray
    mount: np.ndarray  # (C, 6) motion about the body's origin in its frame, where there is no coordinate
    rows: np.ndarray  # (r,) coordinates whose equations are differentiated: the free ones, then prescribed ones
    relation: np.ndarray  # (r, C) whether the way carries the row's coordinate (or is it), is carried by it, or neither
    unit: np.ndarray  # (C, P) displacement by a unit of each parameter at the start, 0 for free coordinates
    course_way: np.ndarray  # (K,) which way a course displaces, and which parameter it is
    course_parameter: np.ndarray
    path: np.ndarray  # (n + 1, K) displacement by a unit of each course on the grid
    path_rate: np.ndarray  # (K,) its rate at the start
    slide: np.ndarray  # (P,) of the fulcrum along the keel
    slides: bool  # whether any of them is not 0
    edit_start: np.ndarray  # (S + 1,) of the site's entries in the next three: what changes in its row
    edit_parameter: np.ndarray
    edit_column: np.ndarray
    edit_unit: np.ndarray
    spring_parameter: np.ndarray  # (E,) and the next two: the same of springs
    spring_row: np.ndarray
    spring_unit: np.ndarray  # (E, 3) stiffness, stiffness_negative, damping
    support: np.ndarray  # (P, 2) to stiffness and damping of the fulcrum
    measured: np.ndarray  # (S,) sites whose force is asked for


class Tangent(NamedTuple):
    """Work space and state of the sensitivities: B bodies, f free coordinates, r rows, C ways, P parameters."""

    S: np.ndarray  # (C, 6) motion of a unit of each way
    rate: np.ndarray  # (C, 6) what its parent's motion adds to the velocity of what it carries, at the step's start
    second: np.ndarray  # (C, 6) likewise to the acceleration
    end: np.ndarray  # (C, 6) likewise to the velocity at the step's end
    coriolis: np.ndarray  # (B, 6, 6) composites: derivative of inertial forces by velocity
    shift: np.ndarray  # (B, 6, 6) of contact by displacement
    out_shift: np.ndarray  # (B, 6, 6) of the measured wrench by displacement
    out_K: np.ndarray  # (B, 6, 6) and by minus the velocity
    touched: np.ndarray  # (B,) whether the body, or one that it carries, has a loaded site
    dF: np.ndarray  # (B, P, 6) what parameters change directly in the wrenches
    dT: np.ndarray  # (P, 6) and in the measured one
    Gq: np.ndarray  # (r, C) derivatives of the residual / h by displacement
    Gv: np.ndarray  # (r, C) by the initial velocity
    E: np.ndarray  # (r, P) by parameters
    B: np.ndarray  # (r, C) of the residual by the end velocity, springs and support apart
    q: np.ndarray  # (C, P) sensitivities of the state
    v: np.ndarray
    v_end: np.ndarray  # (C, P) of the velocity at the step's end
    torque: np.ndarray  # (f, P) of the applied torques
    rhs: np.ndarray  # (f, P)
    d_row: np.ndarray  # (n,) room for the support's power on the keel's coordinates


def make_ways(
    tree: Tree, forces: Forces, split: Split, edits: Sequence[Edit], *, measured: np.ndarray, loads: bool = False
) -> Ways:
    """The ways of a run split like `split`, for the parameters that `edits` describe.

    `measured` (S,) bool are the sites whose resultant wrench is asked for; with `loads` the equations of prescribed
    coordinates are differentiated too. ValueError if an edit shifts a coordinate that is not prescribed.
    """
    parent_of = np.zeros(len(tree.body_names), dtype=np.int64)
    parent_of[tree.links[:, 2]] = tree.links[:, 1]
    carriers = np.eye(len(parent_of), dtype=np.bool_)  # whether the second body carries the first, or is it
    for _, parent, child, _ in tree.links:
        carriers[child] |= carriers[parent]
    way_of = {int(c): way for way, c in enumerate(split.free)}  # by coordinate, or -1 - axis of the mount
    units: dict[tuple[int, int], float] = {}  # displacement by way and parameter
    courses: list[tuple[int, int]] = []  # way and parameter
    for p, edit in enumerate(edits):
        shifts = {-1 - axis: amount for axis, amount in enumerate(edit.mount) if amount}
        if edit.coordinate is not None:
            shifts[tree.index(edit.coordinate)] = 1.0 if edit.course is None else edit.course[0]
        if edit.fulcrum_shift:
            shifts[tree.index("fulcrum")] = edit.fulcrum_shift
        for c, amount in shifts.items():
            if c >= 0 and split.place[c] >= 0:
                raise ValueError(f"{tree.coordinate_names[c]} is free: it has no shift")
            units[way_of.setdefault(c, len(way_of)), p] = float(amount)
        if edit.course is not None:
            courses.append((way_of[tree.index(edit.coordinate or "")], p))
    coordinate = np.array(list(way_of), dtype=np.int64)
    rows = np.concatenate([split.free, split.prescribed]) if loads else split.free
    of_mount, joints = coordinate < 0, tree.coordinate_bodies[rows]
    body = np.where(of_mount, forces.frame_body, tree.coordinate_bodies[coordinate])
    mount, unit = np.zeros((len(coordinate), 6)), np.zeros((len(coordinate), len(edits)))
    mount[of_mount] = _mount_motions(tree, forces.frame_body)[-1 - coordinate[of_mount]]
    for place, amount in units.items():
        unit[place] = amount
    entries = sorted((int(s), p, int(column), float(edit.sites[s, column])) for p, edit in enumerate(edits)
                     if edit.sites is not None for s, column in np.argwhere(edit.sites))
    springs = [(p, int(row), edit.springs[row, :3]) for p, edit in enumerate(edits) if edit.springs is not None
               for row in np.flatnonzero(edit.springs.any(axis=1))]
    return Ways(
        coordinate=np.maximum(coordinate, -1), body=body, parent=parent_of[body], mount=mount, rows=rows, unit=unit,
        relation=np.where(carriers[joints][:, body], CARRIES,
                          np.where(carriers[body][:, joints].T, CARRIED, UNRELATED)),
        course_way=np.array([way for way, _ in courses], dtype=np.int64),
        course_parameter=np.array([p for _, p in courses], dtype=np.int64),
        path=np.ascontiguousarray(np.array([edits[p].course for _, p in courses], dtype=float).T) if courses
        else np.zeros((0, 0)),
        path_rate=np.array([edits[p].course_rate for _, p in courses], dtype=float),
        slide=np.array([edit.fulcrum_shift for edit in edits]), slides=any(edit.fulcrum_shift for edit in edits),
        edit_start=np.searchsorted([s for s, *_ in entries], np.arange(len(forces.sites) + 1)).astype(np.int64),
        edit_parameter=np.array([p for _, p, _, _ in entries], dtype=np.int64),
        edit_column=np.array([column for _, _, column, _ in entries], dtype=np.int64),
        edit_unit=np.array([amount for *_, amount in entries], dtype=float),
        spring_parameter=np.array([p for p, _, _ in springs], dtype=np.int64),
        spring_row=np.array([row for _, row, _ in springs], dtype=np.int64),
        spring_unit=np.array([amount for *_, amount in springs]).reshape(-1, 3),
        support=np.array([np.zeros(2) if edit.fulcrum is None else edit.fulcrum for edit in edits]).reshape(-1, 2),
        measured=np.asarray(measured, dtype=np.bool_))


def tangent_room(tree: Tree, split: Split, ways: Ways) -> Tangent:
    """Room for these ways; the state's sensitivities are those of a start where only prescribed ways change."""
    B, f, r, (C, P) = len(tree.body_names), len(split.free), len(ways.rows), ways.unit.shape
    v = np.zeros((C, P))
    v[ways.course_way, ways.course_parameter] = ways.path_rate
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("S", "rate", "second", "end"), (C, 6)),
        **dict.fromkeys(("coriolis", "shift", "out_shift", "out_K"), (B, 6, 6)), "dF": (B, P, 6), "dT": (P, 6),
        **dict.fromkeys(("Gq", "Gv", "B"), (r, C)), "E": (r, P), "v_end": (C, P), "torque": (f, P), "rhs": (f, P),
        "d_row": (len(split.place),)}
    return Tangent(touched=np.zeros(B, dtype=np.bool_), q=ways.unit.copy(), v=v,
                   **{name: np.zeros(shape) for name, shape in shapes.items()})


def _mount_motions(tree: Tree, frame_body: int) -> np.ndarray:
    """(3, 6) height, fore-aft and alignment of `plants.foot.mount_pose` as motions of the foot's frame K, about and in
    K. The foot goes up along z_K, forward along x_K, and turns about the mount's own origin, toes up about -y_K."""
    link = tree.frames[np.flatnonzero(tree.links[:, 2] == frame_body)[0]]
    p_KM, toes_up = -link[12:21].reshape(3, 3).T @ link[21:24], np.array([0.0, -1.0, 0.0])
    return np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                     [*toes_up, *-np.cross(toes_up, p_KM)]])


# How a parameter enters the arrays that a run works on.


@dataclass(frozen=True, eq=False)
class Edit:
    """What a unit of a variable adds to the arrays of a `Mechanism` and of its `Inputs`; None for nothing."""

    sites: np.ndarray | None = None
    springs: np.ndarray | None = None
    fulcrum: np.ndarray | None = None
    mount: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """To height (m), fore-aft (m) and alignment (rad) of the foot under the pylon."""
    fulcrum_shift: float = 0.0  # m, to the fulcrum's position
    coordinate: str | None = None
    """Name of the prescribed coordinate that shifts."""
    course: np.ndarray | None = None
    """(n + 1,) what that shift is times, on the grid of the run; None for 1, a constant shift."""
    course_rate: float = 0.0  # of `course` at the start (1/s)
