"""The loop over the steps of a run, compiled: of one walk, and of WIDTH side by side."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.laws.lanes import every, first, negated, select, some
from vsf_drake.laws.packed import InMemory, call
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.newton import clear, copy, step, velocities
from vsf_drake.simulation.stepping.runs import Torques
from vsf_drake.simulation.stepping.tree import TreeArrays

POSE = 30
"""Numbers of a body in a row: R_WB (9), p_WB (3), velocity, acceleration, and velocity at the end
of the step (6 each). After the bodies come 7 of each coordinate: its load, and its motion."""


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
    limits: np.ndarray  # (n,) see `Mechanism`
    failed: np.ndarray  # (2,) step and coordinate that diverged, or -1
    beyond: np.ndarray  # (2,) the same of the first that was larger than its limit
    q0: np.ndarray  # (n,) at the start of the step, or of its piece
    v0: np.ndarray
    load: np.ndarray  # (n,) see `newton.step`
    q_next: np.ndarray  # (p,) where the prescribed coordinates go


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
def _read_row(row: np.ndarray, dofs: FreePrescribed, workspace: Workspace) -> None:
    """Places the base bodies as the row says, unloaded, with the loads and motions of the
    coordinates that carry them."""
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
        at += POSE
    for c in range(dofs.carried.shape[0]):
        if carries(dofs, c):
            workspace.bias[c] = row[at]
            for x in range(6):
                motion.S[c, x] = row[at + 1 + x]
            at += 7


@internal
def _move_still(
    k: int,
    tree: TreeArrays,
    dofs: FreePrescribed,
    drive: Drive,
    state: State,
    workspace: Workspace,
) -> None:
    """What `_read_row` does, worked out for step k: each walk has its own motion."""
    motion = workspace.motion
    v = workspace.v
    acceleration = workspace.acceleration
    h = drive.time_s[k + 1] - drive.time_s[k]
    for i in range(dofs.prescribed.shape[0]):
        c = dofs.prescribed[i]
        v[c] = (drive.prescribed_q[k + 1, i] - state.q[c]) / h
        acceleration[c] = (v[c] - state.v[c]) / h
    rb.stop_world(tree, motion)
    rb.place(tree, dofs.still, state.q, motion)
    rb.outwards(tree, dofs.still, state.v, acceleration, motion)
    velocities(tree.links, dofs.still, motion.S, v, workspace.contact.V)
    rb.inwards(tree, dofs.still, motion, workspace.bias)


@internal
def _begin_step(
    k: int,
    begin: int,
    tree: TreeArrays,
    dofs: FreePrescribed,
    drive: Drive,
    state: State,
    workspace: Workspace,
    written: Written,
    rows: np.ndarray,
    live: bool,
) -> None:
    """Makes ready what a step adds to and begins with: what only prescribed coordinates move is
    placed, and its base bodies unloaded, unless all is `live`."""
    clear(written.load[k])

    # Torques that are held over the whole step come from the state at its start.
    sample_torques(k, drive.torques, state.q, state.v, workspace.applied)
    if live:
        return
    if rows.shape[0] > 0:
        _read_row(rows[k - begin], dofs, workspace)
    else:
        _move_still(k, tree, dofs, drive, state, workspace)
    for i in range(dofs.base.shape[0]):
        rb.put(workspace.motion.f, dofs.base[i], rb.REST)
        for x in range(10):
            workspace.motion.composite[dofs.base[i], x] = 0.0


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
    """Writes the state at the end of step k, and which walks that are `running` have diverged or
    are beyond a limit.

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
        beyond = running & (math.fabs(state.q[c]) > state.limits[c]) & (state.beyond[0] < 0.0)
        state.beyond[0] = select(beyond, 1.0 * k, state.beyond[0])
        state.beyond[1] = select(beyond, 1.0 * c, state.beyond[1])


class Arguments(NamedTuple):
    """Those of `advance` beside the steps."""

    tree: TreeArrays
    forces: Forces
    dofs: FreePrescribed
    workspace: Workspace
    drive: Drive
    max_speed: float
    state: State
    written: Written
    rows: np.ndarray
    """(steps, size) what is known ahead of each step from `begin` on, where that is the same for
    all walks; else there are none"""
    live: bool  # whether everything is worked out in its step
    carry: int  # the machine code of `sensitivity.carry`, or 0
    carried: InMemory | None  # what that takes, or nothing


@partial(compiled, nogil=True)
def advance(begin: int, last: int, arguments: Arguments) -> None:
    """Advances the state over the steps `begin` ... `last` - 1, as far as a walk has them and has
    not diverged."""
    tree = arguments.tree
    forces = arguments.forces
    dofs = arguments.dofs
    workspace = arguments.workspace
    drive = arguments.drive
    state = arguments.state
    written = arguments.written
    live = arguments.live
    for k in range(begin, last):
        running = (state.steps[0] > k) & (state.failed[0] < 0.0)
        if not some(running):
            break
        counts = written.counts[k]
        total = written.load[k]
        _begin_step(k, begin, tree, dofs, drive, state, workspace, written, arguments.rows, live)

        # One step of h. Then substeps of it for each walk that has not converged, one walk after
        # the other, as they are cut differently: a substep that does not converge is taken back and
        # halved.
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
            if arguments.carry != 0 and some(accepted):
                call(arguments.carry, (arguments.carried, h, k, end, share))

            # The first attempt is over, or that walk: the next one begins with halves.
            if some(finished) or whole:
                waiting = waiting & negated(finished)
                going = first(waiting)
                done = 0 * done
                size = done + PARTS // 2
        _end_step(k, running, dofs, drive, arguments.max_speed, state, written)


@internal
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
