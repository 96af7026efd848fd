"""What a run is differentiated by, as arrays, and the workspace that this takes.

A direction is one in which bodies can be displaced: each free coordinate is one, and so are, for
parameters that move something, a prescribed coordinate, or the foot's mount as if it were a joint
without mass. All parameters that move the same prescribed coordinate share its direction: constant
shifts, and perturbations that change with time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.lanes import WIDTH
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed
from vsf_drake.simulation.stepping.tree import Tree

UNRELATED = 0
INBOARD = 1
OUTBOARD = 2


class TangentDirections(NamedTuple):
    """C directions, the f free coordinates first, and how P parameters enter, K of them as
    perturbations, on n steps."""

    coordinate: np.ndarray  # (C,) or -1 for the mount
    body: np.ndarray  # (C,) what moves, and parent (C,): relative to which body
    parent: np.ndarray
    mount: np.ndarray
    """(C, 6) motion about the body's origin in its frame, where there is no coordinate"""
    rows: np.ndarray
    """(r,) coordinates whose equations are differentiated: the free ones, then prescribed ones"""
    relation: np.ndarray
    """(r, C) whether it carries the row's coordinate (or is it), is carried by it, or neither"""
    unit: np.ndarray
    """(C, P) displacement by a unit of each parameter at the start, 0 for free coordinates"""
    displaced_start: np.ndarray
    """(blocks + 1,) of each WIDTH parameters their entries in the next one"""
    displaced: np.ndarray  # prescribed directions that any of these displaces
    perturbation_direction: np.ndarray
    """(K,) which direction a perturbation displaces, and which parameter it is"""
    perturbation_parameter: np.ndarray
    path: np.ndarray  # (n + 1, K) displacement by a unit of each perturbation on the grid
    path_rate: np.ndarray  # (K,) its rate at the start
    slide: np.ndarray  # (P,) of the fulcrum along the keel
    slides: bool  # whether any of them is not 0
    site_start: np.ndarray
    """(S + 1,) of the site's entries in the next three: what changes in its row"""
    site_parameter: np.ndarray
    site_column: np.ndarray
    site_unit: np.ndarray
    spring_parameter: np.ndarray  # (E,) and the next two: the same of springs
    spring_row: np.ndarray
    spring_unit: np.ndarray  # (E, 3) stiffness, stiffness_negative, damping
    support: np.ndarray  # (P, 2) to stiffness and damping of the fulcrum
    measured: np.ndarray  # (S,) sites whose force is asked for


class Tangent(NamedTuple):
    """Work space and state of the sensitivities: B bodies, f free coordinates, r rows, C
    directions, P parameters, filled up to a multiple of `lanes.WIDTH`."""

    S: np.ndarray  # (C, 6) motion of a unit of each direction
    rate: np.ndarray
    """(C, 6) what its parent's motion adds to the velocity of what it carries, at the step's
    start"""
    second: np.ndarray  # (C, 6) likewise to the acceleration
    end: np.ndarray  # (C, 6) likewise to the velocity at the step's end
    units: np.ndarray  # (6, WIDTH) the six unit motions, and so are the columns of the next four
    coriolis: np.ndarray  # (B, 6, WIDTH) composites: derivative of inertial forces by velocity
    shift: np.ndarray  # of contact by displacement
    measured_shift: np.ndarray  # of the measured wrench by displacement
    measured_K: np.ndarray  # and by minus the velocity
    wrench_by_q: np.ndarray  # (C, 6) of the measured wrench by a displacement of each direction
    wrench_by_end: np.ndarray  # and by minus the velocity at the end
    touched: np.ndarray  # (B,) whether the body, or one that it carries, has a loaded site
    dF: np.ndarray  # (B, 6, P) what parameters change directly in the wrenches
    dT: np.ndarray  # (6, P) and in the measured one
    Gq: np.ndarray  # (r, C) derivatives of the residual / h by displacement
    Gv: np.ndarray  # (r, C) by the initial velocity
    E: np.ndarray  # (r, P) by parameters
    B: np.ndarray  # (r, C) of the residual by the end velocity, springs and support apart
    q: np.ndarray  # (C, P) sensitivities of the state
    v: np.ndarray
    v_end: np.ndarray  # (C, P) of the velocity at the step's end
    rhs: np.ndarray  # (f, P)
    d_row: np.ndarray  # (n,) workspace for the support's power on the keel's coordinates


def make_directions(
    tree: Tree,
    forces: Forces,
    dofs: FreePrescribed,
    tangents: Sequence[ParameterTangent],
    *,
    measured: np.ndarray,
    loads: bool = False,
) -> TangentDirections:
    """The directions of a run with these `dofs`, for the parameters that `tangents` describe.

    `measured` (S,) bool are the sites whose resultant wrench is asked for; with `loads` the
    equations of prescribed coordinates are differentiated too. ValueError if a parameter shifts a
    coordinate that is not prescribed.
    """
    parent_of, carriers = _carriers(tree)
    # by coordinate, or -1 - axis of the mount
    direction_of = {int(c): place for place, c in enumerate(dofs.free)}
    units: dict[tuple[int, int], float] = {}  # displacement by direction and parameter
    for p, by_unit in enumerate(tangents):
        for c, amount in _shifts(tree, by_unit).items():
            if c >= 0 and dofs.place[c] >= 0:
                raise ValueError(f"{tree.coordinate_names[c]} is free: it has no shift")
            units[direction_of.setdefault(c, len(direction_of)), p] = float(amount)
    unit = np.zeros((len(direction_of), len(tangents)))
    for place, amount in units.items():
        unit[place] = amount
    coordinate = np.array(list(direction_of), dtype=np.int64)
    of_mount = coordinate < 0
    mirrored = any(by_unit.mirrored for by_unit in tangents)
    mount = np.zeros((len(coordinate), 6))
    mount[of_mount] = _mount_motions(tree, forces.frame_body, mirrored=mirrored)[
        -1 - coordinate[of_mount]
    ]
    body = np.where(of_mount, forces.frame_body, tree.coordinate_bodies[coordinate])
    rows = np.concatenate([dofs.free, dofs.prescribed]) if loads else dofs.free
    joints = tree.coordinate_bodies[rows]
    perturbed = {p: one for p, one in enumerate(tangents) if one.perturbation is not None}
    perturbation_direction = np.array(
        [direction_of[tree.index(one.coordinate or "")] for one in perturbed.values()],
        dtype=np.int64,
    )
    perturbation_parameter = np.array(list(perturbed), dtype=np.int64)
    displaces = np.zeros((len(unit), filled_up(len(tangents))), dtype=bool)
    displaces[:, : len(tangents)] = unit != 0.0
    displaces[perturbation_direction, perturbation_parameter] = True
    blocks = displaces.shape[1] // WIDTH
    by_block = displaces.reshape(len(unit), blocks, WIDTH)[len(dofs.free) :]
    block, displaced = _where(np.asarray(by_block.any(axis=2)).T)
    slide = np.array([by_unit.fulcrum_shift for by_unit in tangents])
    return TangentDirections(
        coordinate=np.maximum(coordinate, -1),
        body=body,
        parent=parent_of[body],
        mount=mount,
        rows=rows,
        unit=unit,
        relation=np.where(
            carriers[joints][:, body],
            INBOARD,
            np.where(carriers[body][:, joints].T, OUTBOARD, UNRELATED),
        ),
        displaced_start=np.searchsorted(block, np.arange(blocks + 1)),
        displaced=displaced + len(dofs.free),
        perturbation_direction=perturbation_direction,
        perturbation_parameter=perturbation_parameter,
        path=np.ascontiguousarray(
            np.array([one.perturbation for one in perturbed.values()], dtype=float).T
        )
        if perturbed
        else np.zeros((0, 0)),
        path_rate=np.array([one.perturbation_rate for one in perturbed.values()], dtype=float),
        slide=slide,
        slides=bool(slide.any()),
        **_entries(tuple(tangents), forces.sites.shape, forces.springs.shape),
        support=_stacked([by_unit.fulcrum for by_unit in tangents], (2,)),
        measured=np.asarray(measured, dtype=np.bool_),
    )


@lru_cache(maxsize=8)
def _entries(
    tangents: tuple[ParameterTangent, ...], of_sites: tuple[int, ...], of_springs: tuple[int, ...]
) -> dict[str, np.ndarray]:
    """What of the fields of `TangentDirections` sites and springs, arrays of these shapes, give."""
    sites = _stacked([by_unit.sites for by_unit in tangents], of_sites)
    site, site_parameter, site_column = _where(sites.transpose(1, 0, 2))
    springs = _stacked([by_unit.springs for by_unit in tangents], of_springs)
    spring_parameter, spring_row = _where(np.asarray(springs.any(axis=2)))
    return {
        "site_start": np.searchsorted(site, np.arange(of_sites[0] + 1)),
        "site_parameter": site_parameter,
        "site_column": site_column,
        "site_unit": sites[site_parameter, site, site_column],
        "spring_parameter": spring_parameter,
        "spring_row": spring_row,
        "spring_unit": springs[spring_parameter, spring_row, :3],
    }


def _carriers(tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """(B,) what each body hangs on, and (B, B) whether the second body carries the first, or is
    it."""
    parent_of = np.zeros(len(tree.body_names), dtype=np.int64)
    parent_of[tree.links[:, 2]] = tree.links[:, 1]
    carriers = np.eye(len(parent_of), dtype=np.bool_)
    for _, parent, child, _ in tree.links:
        carriers[child] |= carriers[parent]
    return parent_of, carriers


def _shifts(tree: Tree, by_unit: ParameterTangent) -> dict[int, float]:
    """What a unit of a parameter displaces at the start, by coordinate, or -1 - axis of the
    mount."""
    shifts = {-1 - axis: amount for axis, amount in enumerate(by_unit.mount) if amount}
    if by_unit.coordinate is not None:
        shifts[tree.index(by_unit.coordinate)] = (
            1.0 if by_unit.perturbation is None else by_unit.perturbation[0]
        )
    if by_unit.fulcrum_shift:
        shifts[tree.index("fulcrum")] = by_unit.fulcrum_shift
    return shifts


def _stacked(parts: Sequence[np.ndarray | None], shape: tuple[int, ...]) -> np.ndarray:
    """(P, *shape), zero where a parameter has no part."""
    stacked = np.zeros((len(parts), *shape))
    for p, part in enumerate(parts):
        if part is not None:
            stacked[p] = part
    return stacked


def _where(values: np.ndarray) -> Iterator[np.ndarray]:
    """Indices of what is not zero, by axis; numpy's are strided, which compiled code does not
    take."""
    return map(np.ascontiguousarray, np.nonzero(values))


def tangent_workspace(tree: Tree, dofs: FreePrescribed, directions: TangentDirections) -> Tangent:
    """Workspace for these directions; the state's sensitivities are those of a start where only
    prescribed directions change."""
    B = len(tree.body_names)
    f = len(dofs.free)
    r = len(directions.rows)
    C, count = directions.unit.shape
    P = filled_up(count)
    q = np.zeros((C, P))
    q[:, :count] = directions.unit
    v = np.zeros((C, P))
    v[directions.perturbation_direction, directions.perturbation_parameter] = directions.path_rate
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("S", "rate", "second", "end"), (C, 6)),
        **dict.fromkeys(("wrench_by_q", "wrench_by_end"), (C, 6)),
        **dict.fromkeys(("coriolis", "shift", "measured_shift", "measured_K"), (B, 6, WIDTH)),
        "dF": (B, 6, P),
        "dT": (6, P),
        **dict.fromkeys(("Gq", "Gv", "B"), (r, C)),
        "E": (r, P),
        "v_end": (C, P),
        "rhs": (f, P),
        "d_row": (len(dofs.place),),
    }
    return Tangent(
        units=np.eye(6, WIDTH),
        touched=np.zeros(B, dtype=np.bool_),
        q=q,
        v=v,
        **{name: np.zeros(shape) for name, shape in shapes.items()},
    )


def filled_up(count: int) -> int:
    """The least multiple of WIDTH that holds so many parameters."""
    return -(-count // WIDTH) * WIDTH


def _mount_motions(tree: Tree, frame_body: int, *, mirrored: bool) -> np.ndarray:
    """(5, 6) height, fore-aft, alignment, inversion and toe-out of `plants.foot.mount_pose` as
    motions of the foot's frame K, about and in K. The foot goes up along z_K, forward along x_K,
    and turns about the mount's own origin."""
    link = tree.frames[np.flatnonzero(tree.links[:, 2] == frame_body)[0]]
    R_MK = link[12:21].reshape(3, 3)
    right = -1.0 if mirrored else 1.0
    p_KM = -R_MK.T @ link[21:24]
    # R_MK = Ry(-alignment) Rx(right inversion) Rz(-right toe_out): the first turns about the
    # mount's -y, the last about the foot's -+z, the middle one about the axis forward that is
    # normal to both.
    toes_up = -R_MK[1]
    upright = np.array([0.0, 0.0, 1.0])
    forward = np.cross(upright, toes_up)
    turns = [toes_up, right * forward / np.linalg.norm(forward), -right * upright]
    return np.array(
        [
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            *([*axis, *-np.cross(axis, p_KM)] for axis in turns),
        ]
    )


# How a parameter enters the arrays that a run works on.


@dataclass(frozen=True, eq=False)
class ParameterTangent:
    """What a unit of a variable adds to the arrays of a `Mechanism` and of its `Inputs`; None for
    nothing."""

    sites: np.ndarray | None = None
    springs: np.ndarray | None = None
    fulcrum: np.ndarray | None = None
    mount: np.ndarray = field(default_factory=lambda: np.zeros(5))
    """To height, fore-aft (m), alignment, inversion and toe-out (rad) of the foot under the
    pylon."""
    mirrored: bool = False  # whether that is a left foot, which inverts and turns out the other way
    fulcrum_shift: float = 0.0  # m, to the fulcrum's position
    coordinate: str | None = None
    """Name of the prescribed coordinate that shifts."""
    perturbation: np.ndarray | None = None
    """(n + 1,) what that shift is times, on the grid of the run; None for 1, a constant shift."""
    perturbation_rate: float = 0.0  # of `perturbation` at the start (1/s)
