"""At most WIDTH runs as arrays, and their way through the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import SHARED, WIDTH, lanes, side_by_side
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.advance import (
    POSE,
    Drive,
    State,
    Written,
    advance,
    advance_side_by_side,
    carries,
)
from vsf_drake.simulation.stepping.assembly import FreePrescribed
from vsf_drake.simulation.stepping.directions import (
    Tangent,
    TangentDirections,
    filled_up,
    nothing_carried,
)
from vsf_drake.simulation.stepping.newton import velocities
from vsf_drake.simulation.stepping.runs import Inputs, Record, Run, no_torques
from vsf_drake.simulation.stepping.sensitivity import Carried, ForwardSensitivity
from vsf_drake.simulation.stepping.tree import Motion, TreeArrays, tree_arrays

CHUNK = 128  # steps between looks for progress and interruption
LOOKS = 32  # steps between looks whether a run may stop
MAX_SPEED = 1e3  # coordinate speed (m/s or rad/s) beyond which a simulation counts as diverged


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


def _in_common(run: Run) -> tuple[object, ...]:
    """What all runs of a block must have alike, as far as it is not the tree's."""
    torques = run.inputs.torques
    of_torques = (
        ()
        if torques is None
        else (torques.coordinates.tobytes(), torques.sensed.tobytes(), len(torques.feedforward))
    )
    prescribed = np.asarray(run.inputs.prescribed, dtype=np.int64).tobytes()
    return run.mechanism.law, run.mechanism.support_width, prescribed, *of_torques


class Block:
    """At most WIDTH runs, and the arrays that they are advanced on."""

    def __init__(
        self,
        runs: Sequence[Run],
        tolerance: float,
        *,
        sites: bool,
        forward: ForwardSensitivity | None,
    ) -> None:
        if len({_in_common(run) for run in runs}) > 1:
            raise ValueError(
                "runs side by side have one contact law and one width of the support, prescribe "
                "the same coordinates and have torques on the same, for as many steps"
            )
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
        relative_to = () if forward is None else forward.relative_to(of_first.tree)
        self.dofs = assembly.split_coordinates(
            of_first.tree, of_first.forces, prescribed, relative_to
        )
        self.workspace = assembly.step_workspace(
            of_first.tree, of_first.forces, self.dofs, tolerance, zeros
        )
        self.drive = together([_drive_of(run.inputs, steps) for run in filled])
        self.live = forward is not None and forward.loads
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
        if not walks:  # with and without sensitivities alike: it is compiled once
            self.directions, self.tangent = nothing_carried()
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
