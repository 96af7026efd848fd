"""At most WIDTH runs as arrays, and their way through the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import SHARED, WIDTH, side_by_side
from vsf_drake.laws.packed import code_of, packed
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.advance import (
    POSE,
    Arguments,
    Drive,
    State,
    Written,
    advance,
    carries,
)
from vsf_drake.simulation.stepping.assembly import FreePrescribed
from vsf_drake.simulation.stepping.directions import (
    Tangent,
    TangentDirections,
    filled_up,
)
from vsf_drake.simulation.stepping.newton import velocities
from vsf_drake.simulation.stepping.runs import Inputs, Record, Run, no_torques
from vsf_drake.simulation.stepping.sensitivity import (
    Carried,
    Carrying,
    ForwardSensitivity,
    Linearised,
    carry,
)
from vsf_drake.simulation.stepping.tree import Motion, Tree, TreeArrays, tree_arrays

CHUNK = 256  # steps between looks for progress and interruption
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
        ahead: bool = True,
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
        live = forward is not None and forward.loads
        self.state = State(
            q=together([np.array(run.q0, dtype=float) for run in filled]),
            v=together([np.array(run.v0, dtype=float) for run in filled]),
            steps=together(
                [
                    np.array([float(length)])
                    for length in [*self.lengths, *[0] * (len(filled) - len(runs))]
                ]
            ),
            limits=together([run.mechanism.limits for run in filled]),
            failed=zeros((2,)),
            beyond=zeros((2,)),
            **{name: zeros((n,)) for name in ("q0", "v0", "load")},
            q_next=zeros((len(prescribed),)),
        )
        self.state.failed[...] = -1.0
        self.state.beyond[...] = -1.0
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
        # all of it is written in a step, and what is not taken is never read
        blank: rb.Zeros = partial(side_by_side, make=np.empty) if walks else np.empty
        self.written = Written(**{name: blank((steps, *shape)) for name, shape in shapes.items()})
        self.written.counts[...] = 0.0  # which tell that a step was not taken
        self.directions: TangentDirections | None = None
        self.tangent: Tangent | None = None
        self.ahead: tuple[Any, Any, Any] | None = None
        if ahead and not live and all(_move_alike(runs[0], run, self.dofs) for run in runs[1:]):
            space = _work_space(of_first.tree)
            self.ahead = packed(space), packed(space, walks=True), packed(self.dofs)
        carrying = int(np.sum(self.dofs.carried.any(axis=1)))
        row_size = POSE * len(self.dofs.base) + 7 * carrying
        self.rows = np.zeros((0 if self.ahead is None else CHUNK, row_size))
        self.count = 0 if forward is None else len(forward.tangents)
        state = (steps if live else 0, n, filled_up(self.count))
        wrench = (steps, 6, filled_up(self.count))
        self.carried = Carried(np.zeros(wrench), *(np.zeros(state) for _ in range(3)))
        carried = None
        if forward is not None:
            self.directions, self.tangent = forward.prepare(
                of_first.tree, of_first.forces, self.dofs, steps
            )
            system = Linearised(
                tree=self.tree,
                forces=self.forces,
                dofs=self.dofs,
                directions=self.directions,
                workspace=self.workspace,
                tangent=self.tangent,
            )
            carried = packed(Carrying(system, self.state.q0, self.state.v, self.carried))
        self.arguments = packed(
            Arguments(
                tree=self.tree,
                forces=self.forces,
                dofs=self.dofs,
                workspace=self.workspace,
                drive=self.drive,
                max_speed=MAX_SPEED,
                state=self.state,
                written=self.written,
                rows=self.rows,
                live=live,
                carry=0 if carried is None else code_of(carry, carried, 0.0, 0, 0.0, 0.0),
                carried=carried,
            ),
            walks=walks,
        )
        self.walks = walks

    def run(
        self, stop: Callable[[int, Record], bool] | None, progress: Callable[[float], None]
    ) -> list[Record | SimulationError]:
        """Advances all of them; see `run_side_by_side`."""
        steps = max(self.lengths)
        chunk = CHUNK if stop is None else LOOKS
        first = self.runs[0]
        instants = np.ascontiguousarray(first.inputs.time_s, dtype=float)
        prescribed_q = np.ascontiguousarray(first.inputs.prescribed_q, dtype=float)
        done = 0
        while done < steps and max(self.lengths) > done:
            last = min(done + chunk, steps)
            if self.ahead is not None:
                numbers, in_lanes, dofs = self.ahead
                write_rows(
                    numbers,
                    in_lanes,
                    dofs,
                    instants,
                    prescribed_q,
                    np.array(first.q0, dtype=float),
                    np.array(first.v0, dtype=float),
                    done,
                    self.rows[: last - done],
                )
            advance(done, last, self.arguments)
            done = last
            progress(done / steps)
            if stop:
                self._look(stop, done)
        return [self.outcome(walk) for walk in range(len(self.runs))]

    def _look(self, stop: Callable[[int, Record], bool], done: int) -> None:
        """Ends the runs that may stop after `done` steps, or have diverged, which nothing is
        written of from there on."""
        for walk, length in enumerate(self.lengths):
            if done >= length:
                continue
            diverged = bool(self._of(self.state.failed, walk)[0] >= 0.0)
            if diverged or stop(done, self._record(walk, length)):
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

    def outcome(self, walk: int) -> Record | SimulationError:
        """The record of a run that was advanced, or why there is none."""
        mechanism = self.runs[walk].mechanism
        names = mechanism.tree.coordinate_names
        record = self._record(walk, self.lengths[walk])
        step, coordinate = (int(number) for number in self._of(self.state.failed, walk))
        if step >= 0:
            return SimulationError(
                f"coordinate {names[coordinate]} diverged (speed {record.v[step, coordinate]:.3g})",
                time_s=float(record.time_s[step]),
            )
        row, column = (int(number) for number in self._of(self.state.beyond, walk))
        if row >= 0:
            return SimulationError(
                f"coordinate {names[column]} reached {record.q[row, column]:.3g}, beyond the "
                f"{mechanism.limits[column]:g} (m or rad) to which the model means anything",
                time_s=float(record.time_s[row]),
            )
        return record


# What only prescribed coordinates move is known before a run: the poses, velocities and
# accelerations of the bodies that everything else hangs on, and what of the loads their own inertia
# takes. Where all runs of a block share it, it is worked out ahead, once for all of them, WIDTH
# steps at a time in the lanes.


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


def _move_alike(one: Run, other: Run, dofs: FreePrescribed) -> bool:
    """Whether the links that are `dofs.still` move alike in two runs."""
    if one is other:
        return True
    carries_base = np.asarray(dofs.carried.any(axis=1))
    columns = np.flatnonzero(carries_base[dofs.prescribed])
    moved = dofs.prescribed[columns]
    return (
        np.array_equal(one.q0[moved], other.q0[moved])
        and np.array_equal(one.v0[moved], other.v0[moved])
        and np.array_equal(one.inputs.time_s, other.inputs.time_s)
        and np.array_equal(
            one.mechanism.tree.frames[dofs.still], other.mechanism.tree.frames[dofs.still]
        )
        and np.array_equal(
            one.inputs.prescribed_q[:, columns], other.inputs.prescribed_q[:, columns]
        )
    )


class Ahead(NamedTuple):
    """Work space for WIDTH steps of one motion, along the last axis; B bodies, n coordinates."""

    tree: TreeArrays
    motion: Motion
    q: np.ndarray  # (n,) here and below: at the start of the step
    v0: np.ndarray
    a: np.ndarray
    v: np.ndarray  # at its end
    load: np.ndarray
    V: np.ndarray  # (B, 6) at its end


def _work_space(tree: Tree) -> Ahead:
    arrays = tree_arrays(tree)
    frames = side_by_side(arrays.frames.shape)
    frames[...] = arrays.frames[..., None]
    return Ahead(
        tree=arrays._replace(frames=frames),
        motion=rb.work_space(tree, side_by_side),
        **{name: side_by_side((tree.num_coordinates,)) for name in ("q", "v0", "a", "v", "load")},
        V=side_by_side((len(tree.body_names), 6)),
    )


@compiled
def write_rows(
    ahead: Ahead,
    space: Ahead,
    dofs: FreePrescribed,
    time_s: np.ndarray,
    prescribed_q: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
    begin: int,
    rows: np.ndarray,
) -> None:
    """Writes rows (steps, size) of the steps from `begin` on of a run that starts at q0, v0 (n,)
    and whose prescribed coordinates follow prescribed_q (instants, p). `space` is `ahead` in
    lanes."""
    tree = space.tree
    motion = space.motion
    still = dofs.still
    for first_k in range(0, rows.shape[0], WIDTH):
        # Velocities of a step are those that lead to its end; its start has those of the one
        # before.
        for i in range(dofs.prescribed.shape[0]):
            c = dofs.prescribed[i]
            for walk in range(WIDTH):
                k = min(begin + first_k + walk, time_s.shape[0] - 2)
                h = time_s[k + 1] - time_s[k]
                here = prescribed_q[k, i] if k > 0 else q0[c]
                rate = (prescribed_q[k + 1, i] - here) / h
                before = v0[c]
                if k > 0:
                    behind = prescribed_q[k - 1, i] if k > 1 else q0[c]
                    before = (here - behind) / (time_s[k] - time_s[k - 1])
                ahead.q[c, walk] = here
                ahead.v0[c, walk] = before
                ahead.a[c, walk] = (rate - before) / h
                ahead.v[c, walk] = rate
        rb.stop_world(tree, motion)
        rb.place(tree, still, space.q, motion)
        rb.outwards(tree, still, space.v0, space.a, motion)
        velocities(tree.links, still, motion.S, space.v, space.V)
        rb.inwards(tree, still, motion, space.load)
        own = ahead.motion
        for walk in range(min(WIDTH, rows.shape[0] - first_k)):
            k = first_k + walk
            at = 0
            for i in range(dofs.base.shape[0]):
                b = dofs.base[i]
                for x in range(3):
                    for y in range(3):
                        rows[k, at + 3 * x + y] = own.R[b, x, y, walk]
                    rows[k, at + 9 + x] = own.p[b, x, walk]
                for x in range(6):
                    rows[k, at + 12 + x] = own.V[b, x, walk]
                    rows[k, at + 18 + x] = own.A[b, x, walk]
                    rows[k, at + 24 + x] = ahead.V[b, x, walk]
                at += POSE
            for c in range(dofs.carried.shape[0]):
                if carries(dofs, c):
                    rows[k, at] = ahead.load[c, walk]
                    for x in range(6):
                        rows[k, at + 1 + x] = own.S[c, x, walk]
                    at += 7
