"""The implicit stepper: advances a plant of one-degree-of-freedom joints under stiff forces by
fixed steps, one walk or several side by side.

All of a step is compiled (`newton`), and so is the loop over them (the last section). Any subset of
coordinates is prescribed: it follows its values exactly at every step, and the loads that this
takes come out with it. First order in the step. A step that does not converge is halved.

Walks side by side are taken WIDTH at a time in the lanes of the processor (`laws.lanes`) by the
same code as one alone, and every one is to the bit what it is alone.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.laws.lanes import (
    SHARED,
    WIDTH,
    every,
    first,
    lanes,
    negated,
    select,
    side_by_side,
    some,
)
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.directions import (
    ParameterTangent,
    Tangent,
    TangentDirections,
    filled_up,
)
from vsf_drake.simulation.stepping.newton import EXACT, copy, step, tangent_matrix, velocities
from vsf_drake.simulation.stepping.sensitivity import (
    Carried,
    ForwardSensitivity,
    carry,
    linearise,
    write_state,
)
from vsf_drake.simulation.stepping.tree import Motion, Tree, TreeArrays, tree_arrays

CHUNK = 128  # steps between looks for progress and interruption
LOOKS = 32  # steps between looks whether a run may stop
MAX_SPEED = 1e3  # coordinate speed (m/s or rad/s) beyond which a simulation counts as diverged
_warm: set[str] = set()  # the variants of `advance` that are compiled
SETTLED_TOLERANCE, SETTLED_SPEED = 1e-10, 1e-9
"""Of the steps that lead to rest (with the usual one they would coast at 1e-7 m/s), and m/s or
rad/s at it."""
ALONE, SIDE_BY_SIDE, WITH_SENSITIVITIES = "one walk", "walks side by side", "sensitivities"
"""Variants of the compiled loop."""


@dataclass(frozen=True)
class Mechanism:
    """A plant and the stiff forces on it, as arrays: see `assembly.Forces` for those that are not
    described here."""

    plant: MultibodyPlant
    context: Context
    tree: Tree  # of the plant, with the parameters that `context` holds
    sites: np.ndarray
    site_bodies: np.ndarray
    feet: np.ndarray
    ground_height: float  # z (m) of the ground in W, where it does not move
    springs: np.ndarray
    spring_index: np.ndarray  # keel joints, then the socket's six
    fulcrum: np.ndarray
    keel_bodies: np.ndarray
    keel_coordinates: np.ndarray
    keel_starts: np.ndarray
    frame_body: int
    limits: np.ndarray
    """(n,) coordinates (m, rad) beyond which the model means nothing; a run that ends there has
    failed."""
    support_width: float = 0.0  # at most half the distance of two joints
    law: int = 0

    @property
    def forces(self) -> Forces:
        """The stiff forces, for compiled code."""
        return Forces(**{name: getattr(self, name) for name in Forces._fields})


@dataclass(frozen=True)
class Inputs:
    """What drives a run, on the grid `time_s` (n + 1,), first entry = start."""

    time_s: np.ndarray
    prescribed: np.ndarray  # coordinate indices
    prescribed_q: np.ndarray  # (n + 1, len(prescribed)) their values
    fulcrum: np.ndarray  # (n + 1,) position from A (m)
    ground: np.ndarray  # (n + 1,) height of the ground in W (m)
    torques: Torques | None = None  # on coordinates that are not prescribed, of the n steps


@dataclass(frozen=True, eq=False)
class Run:
    """One of the runs that `run_side_by_side` takes."""

    mechanism: Mechanism
    inputs: Inputs
    q0: np.ndarray  # (n,) at the start
    v0: np.ndarray


def run_side_by_side(
    runs: Sequence[Run],
    *,
    tolerance: float = assembly.TOLERANCE,
    sites: bool = True,
    stop: Callable[[int, Record], bool] | None = None,
    progress: Callable[[float], None] | None = None,
    forward: ForwardSensitivity | None = None,
) -> list[Record | SimulationError]:
    """The record of each run, or why there is none: a coordinate becomes NaN, too fast or larger
    than its limit. It is the same to the bit in whatever company a run is taken.

    The runs have the bodies, joints, inertias and keel of the first one, its contact law and width
    of the support, and prescribe the same coordinates; numbers of frames, contact, springs and
    support, motions, grids and lengths are their own. ValueError if law or width differ. A step has
    converged within `tolerance`, see `assembly.Workspace`. `sites`: whether the record of each site
    is kept. `stop` is called now and then with the number of finished steps and the record of each
    run (true ends the run), `progress` with the finished fraction. `forward` says what the
    sensitivities of a single run are carried to.
    """
    done: list[Record | SimulationError] = []
    for begin in range(0, len(runs), WIDTH):
        block = _Block(runs[begin : begin + WIDTH], tolerance, sites=sites, forward=forward)
        share = len(block.runs) / len(runs)

        def tell(finished: float, begin: int = begin, share: float = share) -> None:
            if progress:
                progress(begin / len(runs) + share * finished)

        done += block.run(stop, tell)
    return done


class Stepper:
    """Runs one `Mechanism`; holds no state between runs. See `run_side_by_side` for the
    arguments."""

    def __init__(self, mechanism: Mechanism, *, tolerance: float = assembly.TOLERANCE) -> None:
        self.mechanism = mechanism
        self.tolerance = tolerance

    def run(
        self,
        inputs: Inputs,
        q0: np.ndarray,
        v0: np.ndarray,
        *,
        forward: ForwardSensitivity | None = None,
        stop: Callable[[int, Record], bool] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Record:
        """Advances from `q0`, `v0` over the grid of `inputs`; SimulationError as said there."""
        (outcome,) = run_side_by_side(
            [Run(self.mechanism, inputs, q0, v0)],
            tolerance=self.tolerance,
            stop=stop,
            progress=progress,
            forward=forward,
        )
        if isinstance(outcome, SimulationError):
            raise outcome
        return outcome

    def warm_up(self, variant: str = ALONE) -> float:
        """Seconds in which a throw-away step has compiled a variant of the loop; 0 if it was."""
        if variant in _warm:
            return 0.0
        _warm.add(variant)
        started = time.perf_counter()
        collecting = gc.isenabled()
        # looking through what the compiler makes, again and again, is a seventh of its time
        gc.disable()
        n = self.mechanism.tree.num_coordinates
        held = Inputs(
            time_s=np.array([0.0, 1e-3]),
            prescribed=np.arange(n),
            prescribed_q=np.zeros((2, n)),
            fulcrum=np.zeros(2),
            ground=np.zeros(2),
        )
        forward = ForwardSensitivity(
            tangents=(ParameterTangent(),),
            measured=np.ones(len(self.mechanism.sites), dtype=bool),
            q0=np.zeros((n, 1)),
        )
        run = Run(self.mechanism, held, np.zeros(n), np.zeros(n))
        try:
            run_side_by_side(
                [run] * (2 if variant == SIDE_BY_SIDE else 1),
                forward=forward if variant == WITH_SENSITIVITIES else None,
            )
        finally:
            if collecting:
                gc.enable()
        return time.perf_counter() - started

    def settle(
        self, inputs: Inputs, q0: np.ndarray, *, step_s: float = 0.02, steps: int = 100
    ) -> tuple[np.ndarray, float]:
        """Rest position with everything prescribed held at the first row of `inputs`, and the
        largest speed left; see `settle_side_by_side`."""
        run = Run(self.mechanism, inputs, q0, np.zeros_like(q0))
        (outcome,) = settle_side_by_side([run], step_s=step_s, steps=steps)
        if isinstance(outcome, SimulationError):
            raise outcome
        return outcome


def settle_side_by_side(
    runs: Sequence[Run], *, step_s: float = 0.02, steps: int = 100
) -> list[tuple[np.ndarray, float] | SimulationError]:
    """Of each run the rest position near its q0 with everything prescribed held at the first row of
    its inputs, and the largest speed left.

    Large implicit steps without damping and friction, which would only delay the same equilibrium,
    until no coordinate is faster than SETTLED_SPEED, at most `steps` of them.
    """
    lossy = ("damping", "dissipation", "mu_static", "mu_kinetic")
    columns = [assembly.SITE_COLUMNS.index(name) for name in lossy]
    held = []
    for run in runs:
        sites = run.mechanism.sites.copy()
        springs = run.mechanism.springs.copy()
        fulcrum = run.mechanism.fulcrum.copy()
        sites[:, columns] = 0.0
        springs[:, assembly.SPRING_COLUMNS.index("damping")] = 0.0
        fulcrum[1] = 0.0
        still = Inputs(
            time_s=step_s * np.arange(steps + 1),
            prescribed=run.inputs.prescribed,
            prescribed_q=np.repeat(run.inputs.prescribed_q[:1], steps + 1, axis=0),
            fulcrum=np.full(steps + 1, run.inputs.fulcrum[0]),
            ground=np.full(steps + 1, run.inputs.ground[0]),
        )
        undamped = dataclasses.replace(run.mechanism, sites=sites, springs=springs, fulcrum=fulcrum)
        held.append(Run(undamped, still, run.q0, np.zeros_like(run.q0)))
    records = run_side_by_side(
        held,
        tolerance=SETTLED_TOLERANCE,
        sites=False,
        stop=lambda done, record: bool(np.abs(record.v[done - 1]).max() < SETTLED_SPEED),
    )
    return [
        record
        if isinstance(record, SimulationError)
        else (record.q[-1], float(np.abs(record.v[-1]).max()))
        for record in records
    ]


# What a run of the stepper leaves.


class Record(NamedTuple):
    """What a run leaves: one row for the end of each step; P carried parameters."""

    time_s: np.ndarray
    q0: np.ndarray
    v0: np.ndarray
    q: np.ndarray  # (n, coordinates)
    v: np.ndarray
    load: np.ndarray
    """(n, coordinates) what drives the coordinates, on average over the step: it holds the
    prescribed ones, and is what was applied to the others."""
    sites: np.ndarray  # (n, S, 9) columns SITE_RECORD; S = 0 where it was not kept
    wrench: np.ndarray
    """(n, feet, 6) of the ground on each foot: moment about W's origin at the ground's height, and
    force"""
    deepest: np.ndarray  # (n, feet) m in the ground of the foot's lowest loaded site, 0 without
    fulcrum: np.ndarray  # (n, 3) support force (N), deflection (m), rate (m/s)
    iterations: np.ndarray  # (n,) of Newton's method
    parts: np.ndarray  # (n,) substeps that the step was cut into, 1 if it converged at once
    converged: np.ndarray  # (n,) whether all of its substeps did
    wrench_by: np.ndarray
    """(n, 6, P) derivatives of the measured sites' wrench, moment about W's origin at the ground's
    height, then force; P = 0 where none are carried."""
    load_by: np.ndarray
    """(n, coordinates, P) derivatives of load, or (0, coordinates, P) if not asked for"""
    q_by: np.ndarray  # likewise
    v_by: np.ndarray

    def site(self, column: str) -> np.ndarray:
        """(n, S) column of the sites' record by its name."""
        return self.sites[:, :, assembly.SITE_RECORD.index(column)]

    def counts(self, steps: int | None = None) -> dict[str, int]:
        """Of the first `steps`, how many were accepted without convergence, and how many were cut
        to converge."""
        return {
            "unconverged_steps": int(np.sum(~self.converged[:steps])),
            "refined_steps": int(np.sum(self.parts[:steps] > 1)),
        }


# A block of at most WIDTH runs: their numbers stacked along a last axis, if there are more than
# one.


def _stacked(parts: Sequence[Any], name: str = "") -> Any:
    """Arrays of float64, alone or in named tuples, along a new last axis; fields that walks share,
    and everything else, of the first."""
    first_one = parts[0]
    if hasattr(first_one, "_fields"):
        made = (
            _stacked(column, field)
            for field, column in zip(first_one._fields, zip(*parts, strict=True), strict=True)
        )
        return type(first_one)(*made)
    if isinstance(first_one, np.ndarray) and first_one.dtype == np.float64 and name not in SHARED:
        together = side_by_side(first_one.shape)
        return np.stack(parts, axis=-1, out=together)
    return first_one


class _Block:
    """At most WIDTH runs, and the arrays that they are advanced on."""

    def __init__(
        self,
        runs: Sequence[Run],
        tolerance: float,
        *,
        sites: bool,
        forward: ForwardSensitivity | None,
    ) -> None:
        if len({(run.mechanism.law, run.mechanism.support_width) for run in runs}) > 1:
            raise ValueError("runs side by side have one contact law and one width of the support")
        self.runs = runs
        of_first = runs[0].mechanism
        filled = [*runs, *[runs[-1]] * (WIDTH - len(runs) if len(runs) > 1 else 0)]
        walks = len(filled) > 1
        zeros: rb.Zeros = side_by_side if walks else np.zeros
        if forward is not None and (walks or runs[0].inputs.torques is not None):
            raise ValueError("sensitivities are carried along one run, without torques")
        self.lengths = [len(run.inputs.time_s) - 1 for run in runs]
        steps = max(self.lengths)
        n = of_first.tree.num_coordinates
        together: Callable[[Sequence[Any]], Any] = _stacked if walks else lambda parts: parts[0]
        self.tree = together([tree_arrays(run.mechanism.tree) for run in filled])
        self.forces = together([run.mechanism.forces for run in filled])
        prescribed = np.asarray(runs[0].inputs.prescribed, dtype=np.int64)
        self.dofs = assembly.split_coordinates(of_first.tree, of_first.forces, prescribed)
        self.workspace = assembly.step_workspace(
            of_first.tree, of_first.forces, self.dofs, tolerance, zeros
        )
        self.drive = together([_drive_of(run.inputs, steps) for run in filled])
        self.live = forward is not None
        still = int(np.sum(self.dofs.carried.any(axis=1)))
        size = POSE * len(self.dofs.base) + 7 * still
        numbers = side_by_side((size,)) if walks else np.zeros((size, 1))
        self.state = State(
            q=together([np.array(run.q0, dtype=float) for run in filled]),
            v=together([np.array(run.v0, dtype=float) for run in filled]),
            steps=together(
                [
                    np.array([float(length)])
                    for length in [*self.lengths, *[0] * (len(filled) - len(runs))]
                ]
            ),
            failed=zeros((2,)),
            **{name: zeros((n,)) for name in ("q0", "v0", "load")},
            q_next=zeros((len(prescribed),)),
            row=numbers if walks else numbers[:, 0],
            row_numbers=numbers,
        )
        self.state.failed[...] = -1.0
        count = len(of_first.sites) if sites else 0
        shapes = {
            "q": (n,),
            "v": (n,),
            "load": (n,),
            "sites": (count, len(assembly.SITE_RECORD)),
            "wrench": (int(of_first.feet.max(initial=0)) + 1, 7),
            "fulcrum": (3,),
            "counts": (3,),
        }
        self.written = Written(**{name: zeros((steps, *shape)) for name, shape in shapes.items()})
        self.directions: TangentDirections | None = None
        self.tangent: Tangent | None = None
        if forward is not None:
            self.directions, self.tangent = forward.prepare(
                of_first.tree, of_first.forces, self.dofs, steps
            )
        self.count = 0 if forward is None else len(forward.tangents)
        carried = filled_up(self.count)
        state = (steps if forward is not None and forward.loads else 0, n, carried)
        self.carried = Carried(np.zeros((steps, 6, carried)), *(np.zeros(state) for _ in range(3)))
        self.motions: list[_Prescribed] = []
        self.motion_of = np.zeros(len(filled), dtype=np.int64)
        if not self.live:
            for walk, run in enumerate(filled):
                self.motion_of[walk] = self._motion(run)
        self.walks = walks

    def _motion(self, run: Run) -> int:
        """Which of `motions` is the one that prescribes this run, a new one if none is."""
        new = _Prescribed(run, self.dofs)
        for place, known in enumerate(self.motions):
            if known.equals(new):
                return place
        self.motions.append(new)
        return len(self.motions) - 1

    def run(
        self, stop: Callable[[int, Record], bool] | None, progress: Callable[[float], None]
    ) -> list[Record | SimulationError]:
        """Advances all of them; see `run_side_by_side`."""
        steps = max(self.lengths)
        chunk = CHUNK if stop is None else LOOKS
        rows = np.zeros((max(1, len(self.motions)), chunk, len(self.state.row_numbers)))
        go = advance_side_by_side if self.walks else advance
        done = 0
        while done < steps and max(self.lengths) > done:
            last = min(done + chunk, steps)
            for place, motion in enumerate(self.motions):
                motion.write_rows(done, last, rows[place])
            go(
                done,
                last,
                self.tree,
                self.forces,
                self.dofs,
                self.workspace,
                self.drive,
                MAX_SPEED,
                self.state,
                self.written,
                rows,
                self.motion_of,
                self.live,
                self.directions,
                self.tangent,
                self.carried,
            )
            done = last
            progress(done / steps)
            if stop:
                self._look(stop, done)
        return [self._outcome(walk) for walk in range(len(self.runs))]

    def _look(self, stop: Callable[[int, Record], bool], done: int) -> None:
        """Ends the runs that may stop after `done` steps."""
        for walk, length in enumerate(self.lengths):
            if done < length and stop(done, self._record(walk, length)):
                self.lengths[walk] = done
                self._of(self.state.steps, walk)[...] = done

    def _of(self, array: np.ndarray, walk: int) -> np.ndarray:
        """The part of an array that is one run's."""
        return array[..., walk] if self.walks else array

    def _record(self, walk: int, steps: int) -> Record:
        run = self.runs[walk]
        rows = {
            name: self._of(array, walk)[:steps] for name, array in self.written._asdict().items()
        }
        iterations, parts, failed = rows.pop("counts").T
        on_feet = rows.pop("wrench")
        return Record(
            time_s=run.inputs.time_s[1 : steps + 1].astype(float),
            q0=np.array(run.q0),
            v0=np.array(run.v0),
            iterations=iterations.astype(np.int64),
            parts=parts.astype(np.int64),
            converged=failed == 0.0,
            wrench=on_feet[:, :, :6],
            deepest=on_feet[:, :, 6],
            **rows,
            **{
                name: array[:steps, :, : self.count]
                for name, array in self.carried._asdict().items()
            },
        )

    def _outcome(self, walk: int) -> Record | SimulationError:
        mechanism = self.runs[walk].mechanism
        names = mechanism.tree.coordinate_names
        record = self._record(walk, self.lengths[walk])
        step, coordinate = (int(number) for number in self._of(self.state.failed, walk))
        if step >= 0:
            return SimulationError(
                f"coordinate {names[coordinate]} diverged (speed {record.v[step, coordinate]:.3g})",
                time_s=float(record.time_s[step]),
            )
        beyond = np.abs(record.q) > mechanism.limits
        if np.any(beyond):
            row, column = np.argwhere(beyond)[0]
            return SimulationError(
                f"coordinate {names[column]} reached {record.q[row, column]:.3g}, beyond the "
                f"{mechanism.limits[column]:g} (m or rad) to which the model means anything",
                time_s=float(record.time_s[row]),
            )
        return record


# What only prescribed coordinates move is known before a run: the poses, velocities and
# accelerations of the bodies that everything else hangs on, and what of the loads their own inertia
# takes. It is worked out ahead, WIDTH steps at a time in the lanes, and once for all runs of a
# block that share it.


POSE = 30
"""Numbers of a body in a row: R_WB (9), p_WB (3), velocity, acceleration, and velocity at the end
of the step (6 each). After the bodies come 7 of each coordinate: its load, and its motion."""


@dataclass(eq=False)
class _Prescribed:
    """The motion of the links that are `dofs.still` in a run, over its steps."""

    run: Run
    dofs: FreePrescribed
    frames: np.ndarray = field(init=False)
    columns: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.frames = self.run.mechanism.tree.frames[self.dofs.still]
        of_still = np.asarray(self.dofs.carried.any(axis=1))
        self.columns = np.flatnonzero(of_still[self.dofs.prescribed])
        self._lanes: Any = None

    def equals(self, other: _Prescribed) -> bool:
        """Whether another one is the same."""
        ours = self.run
        theirs = other.run
        moved = self.dofs.prescribed[self.columns]
        return all(
            a is b or np.array_equal(a, b)
            for a, b in (
                (ours.inputs.time_s, theirs.inputs.time_s),
                (
                    ours.inputs.prescribed_q[:, self.columns],
                    theirs.inputs.prescribed_q[:, self.columns],
                ),
                (ours.q0[moved], theirs.q0[moved]),
                (ours.v0[moved], theirs.v0[moved]),
                (self.frames, other.frames),
            )
        )

    def _prepared(self) -> tuple[TreeArrays, Motion, np.ndarray, tuple[np.ndarray, ...]]:
        """Tree and work space with lanes of steps, and q, v0, a, v (blocks, n, WIDTH) of them."""
        tree = self.run.mechanism.tree
        moved = self.dofs.prescribed[self.columns]
        h = np.diff(self.run.inputs.time_s)[:, None]
        q = self.run.inputs.prescribed_q[:, self.columns].astype(float)
        q[0] = self.run.q0[moved]
        v = np.diff(q, axis=0) / h
        v0 = np.vstack([self.run.v0[moved], v[:-1]])
        blocks = -(-len(h) // WIDTH)
        laned = []
        for rows in (q[:-1], v0, (v - v0) / h, v):
            whole = np.zeros((blocks * WIDTH, tree.num_coordinates))
            whole[: len(h), moved] = rows
            lane = side_by_side((blocks, tree.num_coordinates))
            lane[...] = whole.reshape(blocks, WIDTH, tree.num_coordinates).transpose(0, 2, 1)
            laned.append(lane)
        return (
            _stacked([tree_arrays(tree)] * WIDTH),
            rb.work_space(tree, side_by_side),
            side_by_side((len(tree.body_names), 6)),
            tuple(laned),
        )

    def write_rows(self, begin: int, last: int, rows: np.ndarray) -> None:
        """Writes to rows (chunk, size) those of the steps `begin` ... `last` - 1; `begin` is a
        multiple of WIDTH."""
        if not rows.shape[1]:
            return
        if self._lanes is None:
            self._lanes = self._prepared()
        tree, motion, V, (q, v0, a, v) = self._lanes
        low = begin // WIDTH
        high = min(-(-last // WIDTH), len(q))
        if low < high:
            write_rows(
                tree,
                self.dofs,
                motion,
                V,
                q[low:high],
                v0[low:high],
                a[low:high],
                v[low:high],
                rows[: last - begin],
            )


@compiled
def write_rows(
    tree: TreeArrays,
    dofs: FreePrescribed,
    motion: Motion,
    V: np.ndarray,
    q: np.ndarray,
    v0: np.ndarray,
    a: np.ndarray,
    v: np.ndarray,
    rows: np.ndarray,
) -> None:
    """Writes rows (steps, size) for q, v0, a at the starts of the steps and v at their ends
    (blocks, n, WIDTH); V (B, 6, WIDTH) is work space."""
    in_lanes = lanes(tree)
    moved = lanes(motion)
    end = lanes(V)
    laned_q = lanes(q)
    laned_v0 = lanes(v0)
    laned_a = lanes(a)
    laned_v = lanes(v)
    load = lanes(q)
    for block in range(q.shape[0]):
        rb.stop_world(in_lanes, moved)
        rb.place(in_lanes, dofs.still, laned_q[block], moved)
        rb.outwards(in_lanes, dofs.still, laned_v0[block], laned_a[block], moved)
        velocities(in_lanes.links, dofs.still, moved.S, laned_v[block], end)
        # the place of q is free now
        rb.inwards(in_lanes, dofs.still, moved, load[block])
        for walk in range(WIDTH):
            k = block * WIDTH + walk
            if k >= rows.shape[0]:
                break
            at = 0
            for i in range(dofs.base.shape[0]):
                b = dofs.base[i]
                for x in range(3):
                    for y in range(3):
                        rows[k, at + 3 * x + y] = motion.R[b, x, y, walk]
                    rows[k, at + 9 + x] = motion.p[b, x, walk]
                for x in range(6):
                    rows[k, at + 12 + x] = motion.V[b, x, walk]
                    rows[k, at + 18 + x] = motion.A[b, x, walk]
                    rows[k, at + 24 + x] = V[b, x, walk]
                at += POSE
            for c in range(dofs.carried.shape[0]):
                if carries(dofs, c):
                    rows[k, at] = q[block, c, walk]
                    for x in range(6):
                        rows[k, at + 1 + x] = motion.S[c, x, walk]
                    at += 7


# Steps one after the other, each halved where it does not converge (compiled).


LEVELS = 5  # how often a step is halved before it is accepted without convergence: down to 1/32
PARTS = 1 << LEVELS


class Drive(NamedTuple):
    """`Inputs` of n steps for compiled code, with the rate of the ground's height."""

    time_s: np.ndarray
    prescribed_q: np.ndarray
    fulcrum: np.ndarray
    ground: np.ndarray
    ground_rate: np.ndarray
    torques: Torques


class State(NamedTuple):
    """Where a run is, and what a step and its pieces begin with; n coordinates, p prescribed."""

    q: np.ndarray  # (n,)
    v: np.ndarray
    steps: np.ndarray  # (1,) how many there are
    failed: np.ndarray  # (2,) step and coordinate that diverged, or -1
    q0: np.ndarray  # (n,) at the start of the step, or of its piece
    v0: np.ndarray
    load: np.ndarray  # (n,) see `newton.step`
    q_next: np.ndarray  # (p,) where the prescribed coordinates go
    row: np.ndarray  # see POSE
    row_numbers: np.ndarray  # (size, walks) the same memory


class Written(NamedTuple):
    """`Record` of n steps for compiled code; `counts` are iterations, parts, and how many pieces
    did not converge."""

    q: np.ndarray
    v: np.ndarray
    load: np.ndarray
    sites: np.ndarray
    wrench: np.ndarray
    fulcrum: np.ndarray
    counts: np.ndarray


def _drive_of(inputs: Inputs, steps: int) -> Drive:
    """The inputs as arrays for compiled code, their last row repeated up to so many steps."""
    time_s, prescribed_q, fulcrum, ground = (
        np.ascontiguousarray(column, dtype=float)
        for column in (inputs.time_s, inputs.prescribed_q, inputs.fulcrum, inputs.ground)
    )
    rate = np.gradient(ground, time_s)
    more = steps + 1 - len(time_s)
    if more > 0:
        time_s, prescribed_q, fulcrum, ground, rate = (
            np.concatenate([column, np.repeat(column[-1:], more, axis=0)])
            for column in (time_s, prescribed_q, fulcrum, ground, rate)
        )
    return Drive(
        time_s=time_s,
        prescribed_q=prescribed_q,
        fulcrum=fulcrum,
        ground=ground,
        ground_rate=rate,
        torques=no_torques(steps) if inputs.torques is None else inputs.torques,
    )


@compiled
def substep(
    drive: Drive, k: int, done: int, size: int, q_next: np.ndarray
) -> tuple[float, float, float, float]:
    """The piece of step k from `done` on with `size`, in PARTS of it: h, and fulcrum, ground,
    ground_rate at its end; the prescribed coordinates at its end go to q_next (p,)."""
    h = (drive.time_s[k + 1] - drive.time_s[k]) * (size / PARTS)
    if done + size == PARTS:
        copy(drive.prescribed_q[k + 1], q_next)
        return h, drive.fulcrum[k + 1], drive.ground[k + 1], drive.ground_rate[k + 1]
    share = (done + size) / PARTS
    for i in range(q_next.shape[0]):
        q_next[i] = drive.prescribed_q[k, i] + share * (
            drive.prescribed_q[k + 1, i] - drive.prescribed_q[k, i]
        )
    return (
        h,
        drive.fulcrum[k] + share * (drive.fulcrum[k + 1] - drive.fulcrum[k]),
        drive.ground[k] + share * (drive.ground[k + 1] - drive.ground[k]),
        drive.ground_rate[k + 1],
    )


@compiled
def next_substep(done: int, size: int, converged: bool) -> tuple[int, int, bool]:
    """What is done and the next size after a substep, and whether that piece is accepted."""
    if not converged and size > 1:
        return done, size // 2, False
    done += size
    if done % (2 * size) == 0:
        size *= 2
    return done, min(size, PARTS), True


@internal
def carries(dofs: FreePrescribed, c: int) -> bool:
    """Whether a coordinate that is `dofs.still` carries one of the base bodies."""
    for k in range(dofs.base.shape[0]):
        if dofs.carried[c, k]:
            return True
    return False


@internal
def _fill_row(state: State, rows: np.ndarray, motion_of: np.ndarray, k: int) -> None:
    """Writes to the state's row the k-th of each walk's motion."""
    if rows.shape[0] == 1:
        for i in range(state.row.shape[0]):
            state.row[i] = rows[0, k, i]
        return
    for walk in range(state.row_numbers.shape[1]):
        for i in range(state.row_numbers.shape[0]):
            state.row_numbers[i, walk] = rows[motion_of[walk], k, i]


@internal
def _read_row(
    dofs: FreePrescribed,
    workspace: Workspace,
    state: State,
    rows: np.ndarray,
    motion_of: np.ndarray,
    k: int,
) -> None:
    """Places the base bodies of each walk as its motion's row k says, unloaded, with the loads and
    motions of the coordinates that carry them."""
    row = state.row
    _fill_row(state, rows, motion_of, k)
    motion = workspace.motion
    at = 0
    for i in range(dofs.base.shape[0]):
        b = dofs.base[i]
        for x in range(3):
            for y in range(3):
                motion.R[b, x, y] = row[at + 3 * x + y]
            motion.p[b, x] = row[at + 9 + x]
        for x in range(6):
            motion.V[b, x] = row[at + 12 + x]
            motion.A[b, x] = row[at + 18 + x]
            workspace.contact.V[b, x] = row[at + 24 + x]
            motion.f[b, x] = 0.0
        for x in range(10):
            motion.composite[b, x] = 0.0
        at += POSE
    for c in range(dofs.carried.shape[0]):
        if carries(dofs, c):
            workspace.bias[c] = row[at]
            for x in range(6):
                motion.S[c, x] = row[at + 1 + x]
            at += 7


@internal
def _end_step(
    k: int,
    running: bool,
    dofs: FreePrescribed,
    drive: Drive,
    max_speed: float,
    state: State,
    written: Written,
) -> None:
    """Writes the state at the end of step k, and which walks that are `running` have diverged.

    Prescribed coordinates of a step that was cut get the velocity of the whole step, which is known
    ahead of the next one; that of the last piece is the same but for rounding.
    """
    cut = running & (written.counts[k, 1] > 1.0)
    if some(cut):
        h = drive.time_s[k + 1] - drive.time_s[k]
        for i in range(dofs.prescribed.shape[0]):
            c = dofs.prescribed[i]
            whole = (drive.prescribed_q[k + 1, i] - drive.prescribed_q[k, i]) / h
            state.v[c] = select(cut, whole, state.v[c])
    copy(state.q, written.q[k])
    copy(state.v, written.v[k])
    for c in range(state.q.shape[0]):
        fine = (math.fabs(state.v[c]) < max_speed) & (math.fabs(state.q[c]) < math.inf)
        lost = running & negated(fine) & (state.failed[0] < 0.0)
        state.failed[0] = select(lost, 1.0 * k, state.failed[0])
        state.failed[1] = select(lost, 1.0 * c, state.failed[1])


@partial(compiled, nogil=True)
def advance(
    begin: int,
    last: int,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    drive: Drive,
    max_speed: float,
    state: State,
    written: Written,
    rows: np.ndarray,
    motion_of: np.ndarray,
    live: bool,
    directions: TangentDirections | None,
    tangent: Tangent | None,
    carried: Carried,
) -> None:
    """Advances `state` over the steps `begin` ... `last` - 1, as far as a walk has them and has not
    diverged.

    rows (motions, steps, size) hold what is known ahead of each step, and motion_of (walks,) which
    motion is a walk's, unless everything is worked out `live`. With `directions` and `tangent` the
    sensitivities are `carried` along.
    """
    for k in range(begin, last):
        running = (state.steps[0] > k) & (state.failed[0] < 0.0)
        if not some(running):
            break
        counts = written.counts[k]
        total = written.load[k]

        # Torques that are held over the whole step come from the state at its start.
        sample_torques(k, drive.torques, state.q, state.v, workspace.applied)

        # One step of h. Then substeps of it for each walk that has not converged, one walk after
        # the other, as they are cut differently: a substep that does not converge is taken back and
        # halved.
        if not live:
            _read_row(dofs, workspace, state, rows, motion_of, k - begin)
        waiting = running
        going = running
        done = begin * 0  # a literal 0 would compile what it is given to twice
        size = done + PARTS
        while some(waiting):
            whole = done == 0 and size == PARTS
            h, fulcrum, ground, ground_rate = substep(drive, k, done, size, state.q_next)
            copy(state.q, state.q0)
            copy(state.v, state.v0)
            iterations, converged = step(
                h,
                tree,
                forces,
                dofs,
                workspace,
                ground,
                ground_rate,
                fulcrum,
                state.q_next,
                going,
                whole and not live,
                state.q,
                state.v,
                state.load,
                written.sites[k],
                written.wrench[k],
                written.fulcrum[k],
            )
            counts[0] += iterations
            share = size / PARTS
            end = (done + size) / PARTS
            if whole:
                accepted = going & converged
                finished = accepted
            else:
                done, size, taken = next_substep(done, size, every(converged | negated(going)))
                accepted = going & taken
                finished = accepted & (done == PARTS)
            counts[1] += select(accepted, 1.0, 0.0)
            counts[2] += select(accepted & negated(converged), 1.0, 0.0)
            for c in range(total.shape[0]):
                total[c] += select(accepted, share * state.load[c], 0.0)
            back = going & negated(accepted)
            if some(back):
                for c in range(total.shape[0]):
                    state.q[c] = select(back, state.q0[c], state.q[c])
                    state.v[c] = select(back, state.v0[c], state.v[c])
            if directions is not None and tangent is not None and some(accepted):
                tangent_matrix(h, tree, forces, dofs, workspace, EXACT)
                linearise(h, tree, forces, dofs, directions, workspace, tangent, state.q0, state.v)
                carry(h, k, end, share, dofs, directions, workspace.A, tangent, carried)

            # The first attempt is over, or that walk: the next one begins with halves.
            if some(finished) or whole:
                waiting = waiting & negated(finished)
                going = first(waiting)
                done = 0 * done
                size = done + PARTS // 2
        if directions is not None and tangent is not None and carried.load_by.shape[0] > 0:
            write_state(k, directions, tangent, carried)
        _end_step(k, running, dofs, drive, max_speed, state, written)


@partial(compiled, nogil=True)
def advance_side_by_side(
    begin: int,
    last: int,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    drive: Drive,
    max_speed: float,
    state: State,
    written: Written,
    rows: np.ndarray,
    motion_of: np.ndarray,
    live: bool,
    directions: TangentDirections | None,
    tangent: Tangent | None,
    carried: Carried,
) -> None:
    """`advance` of WIDTH walks, whose numbers are along the last axis of the arrays."""
    advance(
        begin,
        last,
        lanes(tree),
        lanes(forces),
        dofs,
        lanes(workspace),
        lanes(drive),
        max_speed,
        lanes(state),
        lanes(written),
        rows,
        motion_of,
        live,
        directions,
        tangent,
        carried,
    )


# Forces that a sampled controller exerts on free coordinates: worked out at the start of a step and
# held over it.
#
#     tau = feedforward - feedback @ (state - reference),
#
# where the state is the positions, then the velocities, of sensed coordinates.
#
# A step that is cut into substeps keeps what its start gave.


class Torques(NamedTuple):
    """Of n steps, on c coordinates, from s sensed ones, in N m, rad, s (N, m, s)."""

    coordinates: np.ndarray  # (c,) indices, 0 of them for none
    sensed: np.ndarray  # (s,) indices, 0 of them without feedback
    feedforward: np.ndarray  # (n, c)
    feedback: np.ndarray  # (n, c, 2 s)
    reference: np.ndarray  # (n, 2 s)


def no_torques(steps: int) -> Torques:
    """None on that many steps."""
    none = np.zeros(0, dtype=np.int64)
    return Torques(
        coordinates=none,
        sensed=none,
        feedforward=np.zeros((steps, 0)),
        feedback=np.zeros((steps, 0, 0)),
        reference=np.zeros((steps, 0)),
    )


@compiled
def sample_torques(
    k: int, torques: Torques, q: np.ndarray, v: np.ndarray, force: np.ndarray
) -> None:
    """Writes the forces of step k from the state q, v (n,) at its start to `force` (n,)."""
    s = torques.sensed.shape[0]
    for i in range(torques.coordinates.shape[0]):
        value = torques.feedforward[k, i]
        for j in range(s):
            c = torques.sensed[j]
            value -= torques.feedback[k, i, j] * (q[c] - torques.reference[k, j])
            value -= torques.feedback[k, i, s + j] * (v[c] - torques.reference[k, s + j])
        force[torques.coordinates[i]] = value
