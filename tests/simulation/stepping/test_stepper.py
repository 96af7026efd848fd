"""Steps that do not converge are cut into pieces that cover them; runs that diverge; torques."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker, inputs_of

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.reactions import energy_ledger
from vsf_drake.simulation.stepping.advance import (
    LEVELS,
    PARTS,
    Drive,
    advance,
    next_substep,
    substep,
)
from vsf_drake.simulation.stepping.assembly import split_coordinates, step_workspace
from vsf_drake.simulation.stepping.block import MAX_SPEED, _drive_of
from vsf_drake.simulation.stepping.newton import MAX_ITERATIONS, step
from vsf_drake.simulation.stepping.runs import Inputs, Torques, no_torques
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.stepping.tree import tree_arrays

walked = cache(cut_walk)
take_step = compiled(step.py_func)
"""To be called from Python."""


def cut(outcome):
    """Accepted pieces (begin, size) of one step whose pieces converge as `outcome(done, size)`
    says; and all tries."""
    done, size, accepted, tries = 0, PARTS, [], []
    while done < PARTS:
        converged, begin = outcome(done, size), done
        tries.append((begin, size, converged))
        done, next_size, taken = next_substep(done, size, converged)
        if taken:
            accepted.append((begin, size))
        size = next_size
    return accepted, tries


def test_pieces_cover_a_step_without_gap_or_overlap_whatever_converges():
    rng = np.random.default_rng(0)
    for share in np.repeat([0.1, 0.5, 0.8, 0.95], 200):
        accepted, tries = cut(lambda done, size, share=share: rng.random() < share)
        begins, sizes = np.array(accepted).T
        np.testing.assert_array_equal(begins, np.concatenate([[0], np.cumsum(sizes)[:-1]]))
        assert sizes.sum() == PARTS
        assert len(accepted) <= PARTS
        assert all(PARTS % size == 0 and begin % size == 0 for begin, size in accepted)
        assert all(
            converged or size == 1 for begin, size, converged in tries if (begin, size) in accepted
        )


def test_a_piece_that_fails_is_halved_and_its_size_grows_again_where_it_stood():
    accepted, tries = cut(lambda done, size: size <= PARTS // 4 or done >= PARTS // 2)
    assert [size for _, size, _ in tries] == [PARTS, PARTS // 2, PARTS // 4, PARTS // 4, PARTS // 2]
    assert accepted == [(0, PARTS // 4), (PARTS // 4, PARTS // 4), (PARTS // 2, PARTS // 2)]


def test_ends_of_pieces_lie_on_straight_lines_between_the_grid_points():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5e-3, 2e-3, 6))
    drive = Drive(
        time_s=time,
        prescribed_q=rng.normal(size=(6, 3)),
        fulcrum=rng.uniform(0.06, 0.15, 6),
        ground=rng.normal(size=6),
        ground_rate=rng.normal(size=6),
        torques=no_torques(5),
    )
    q_next = np.zeros(3)
    for k in range(5):
        for share in (0.1, 0.7, 0.9):
            accepted, _ = cut(lambda done, size, share=share: rng.random() < share)
            t = time[k]
            for begin, size in accepted:
                h, fulcrum, ground, rate = substep(drive, k, begin, size, q_next)
                t += h
                assert h == pytest.approx((time[k + 1] - time[k]) * size / PARTS, rel=1e-14)
                for found, column in (
                    (fulcrum, drive.fulcrum),
                    (ground, drive.ground),
                    *zip(q_next, drive.prescribed_q.T, strict=True),
                ):
                    assert found == pytest.approx(np.interp(t, time, column), rel=1e-12, abs=1e-12)
                assert rate == drive.ground_rate[k + 1]
            assert t == pytest.approx(time[k + 1], rel=1e-14)
            assert fulcrum == drive.fulcrum[k + 1] and ground == drive.ground[k + 1]
            np.testing.assert_array_equal(q_next, drive.prescribed_q[k + 1])


def substeps_of(mechanism, inputs, q0, v0):
    """Ends (s) of all pieces of a run, how many each step has, its iterations with those that were
    taken back, and whether all of its pieces converged, by the compiled step and a loop of its
    own."""
    tree, forces, steps = mechanism.tree, mechanism.forces, len(inputs.time_s) - 1
    arrays, drive = tree_arrays(tree), _drive_of(inputs, steps)
    dofs = split_coordinates(tree, forces, inputs.prescribed)
    workspace = step_workspace(tree, forces, dofs)
    out = np.zeros(len(q0)), np.zeros((0, 9)), np.zeros((2, 7)), np.zeros(3)
    q, v, q_next, ends, counts = q0.copy(), v0.copy(), np.zeros(len(inputs.prescribed)), [], []
    spent, converges = np.zeros(steps), np.ones(steps, dtype=bool)
    for k in range(steps):
        begun = len(ends)

        def tried(done, size, k=k):
            h, fulcrum, ground, rate = substep(drive, k, done, size, q_next)
            before = q.copy(), v.copy()
            iterations, converged = take_step(
                h,
                arrays,
                forces,
                dofs,
                workspace,
                ground,
                rate,
                fulcrum,
                q_next,
                True,
                False,
                q,
                v,
                *out,
            )
            spent[k] += iterations
            if not converged and size > 1:
                q[:], v[:] = before
            else:
                converges[k] &= converged
                share = (done + size) / PARTS
                ends.append((1.0 - share) * inputs.time_s[k] + share * inputs.time_s[k + 1])
            return converged

        cut(tried)
        counts.append(len(ends) - begun)
    return np.array(ends), np.array(counts), spent, converges


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_run_whose_steps_are_cut_is_a_run_on_the_grid_of_its_pieces(name):
    """A load is the mean over the pieces. Agreement is to what Newton's method leaves, since some
    hundred contacts pass on the rounding of a time."""
    walk = walked(name)
    setting, _, _ = SETTINGS[name]
    inputs, record = inputs_of(walk, hard_walker(setting)[0]), walk.record
    ends, counts, spent, _ = substeps_of(walk.mechanism, inputs, record.q0, record.v0)
    np.testing.assert_array_equal(counts, record.parts)
    np.testing.assert_array_equal(spent, record.iterations)
    assert record.parts.max() > 1 and record.converged.all()
    grid = np.concatenate([inputs.time_s[:1], ends])
    q = np.column_stack(
        [np.interp(grid, inputs.time_s, column) for column in inputs.prescribed_q.T]
    )
    fine = dataclasses.replace(
        inputs, time_s=grid, prescribed_q=q, fulcrum=q[:, -1], ground=np.zeros(len(grid))
    )
    uncut = Stepper(walk.mechanism).run(fine, record.q0, record.v0)
    np.testing.assert_array_equal(uncut.parts, 1)
    last = np.cumsum(counts) - 1
    share = np.diff(grid) / np.repeat(np.diff(inputs.time_s), counts)
    load = np.add.reduceat(share[:, None] * uncut.load, np.cumsum(counts) - counts, axis=0)
    for column in ("q", "v", "sites", "fulcrum", "load"):
        wanted = load if column == "load" else getattr(uncut, column)[last]
        np.testing.assert_allclose(
            getattr(record, column), wanted, rtol=0.0, atol=1e-6 * np.abs(wanted).max()
        )


def test_step_that_converges_in_no_size_is_kept_and_counted():
    """A smallest piece has at least LEVELS others beside it."""
    walk = walked("lost")
    record = walk.record
    _, counts, _, converges = substeps_of(
        walk.mechanism, inputs_of(walk, hard_walker(SETTINGS["lost"][0])[0]), record.q0, record.v0
    )
    assert not converges.all()
    np.testing.assert_array_equal(record.parts, counts)
    np.testing.assert_array_equal(record.converged, converges)
    assert np.all(record.parts[~record.converged] > LEVELS)
    assert np.all(record.iterations <= MAX_ITERATIONS * 2 * PARTS)
    assert np.isfinite(record.q).all() and np.isfinite(record.sites).all()


@pytest.mark.parametrize("wrong", [MAX_SPEED, -MAX_SPEED, np.inf, -np.inf, np.nan])
def test_speed_beyond_the_limit_either_way_and_what_is_no_number_have_diverged(wrong):
    """Here by what prescribes the coordinate; just within the limit it goes on."""
    mechanism, h = walked("landing").mechanism, 1e-3
    n = mechanism.tree.num_coordinates
    c = mechanism.tree.index("pelvis_tx")
    mechanism = dataclasses.replace(mechanism, limits=np.full(n, np.inf))

    def run(speed):
        q = np.zeros((4, n))
        q[2, c] = h * speed
        return Stepper(mechanism).run(
            Inputs(
                time_s=h * np.arange(4),
                prescribed=np.arange(n),
                prescribed_q=q,
                fulcrum=np.full(4, 0.1),
                ground=np.full(4, -10.0),
            ),
            q[0],
            np.zeros(n),
        )

    with pytest.raises(SimulationError, match="pelvis_tx diverged") as error:
        run(wrong)
    assert error.value.time_s == pytest.approx(2.0 * h)
    if np.isfinite(wrong):
        assert len(run(0.999 * wrong).time_s) == 3


def test_advance_goes_on_where_it_stopped():
    """In two calls as in one, also when the first ends with a cut step."""
    walk = walked("landing")
    inputs, record, mechanism = inputs_of(walk, hard_walker(1)[0]), walk.record, walk.mechanism
    first = int(np.argmax(record.parts > 1)) + 1
    part = dataclasses.replace(
        inputs,
        **{
            name: getattr(inputs, name)[first:]
            for name in ("time_s", "prescribed_q", "fulcrum", "ground")
        },
    )
    shares = []
    later = Stepper(mechanism).run(
        part, record.q[first - 1], record.v[first - 1], progress=shares.append
    )
    assert shares == sorted(shares) and shares[0] > 0.0 and shares[-1] == 1.0
    assert advance.signatures
    np.testing.assert_array_equal(later.q, record.q[first:])
    np.testing.assert_array_equal(later.parts, record.parts[first:])


def test_torques_with_feedback_bring_a_displaced_knee_back_as_a_damped_oscillator(walker, motion):
    """e'' + 2 w e' + w^2 e = 0 from rest: e = e0 (1 + w t) exp(-w t), with gains w^2 M and 2 w M
    beside what holds the knee of the leg in the air. The torques' work is found as energy."""
    w, e0, step_s = 60.0, 0.02, 2.5e-4
    q, _, _ = motion("right").sample(0.0)
    still = CoordinateTrajectory(
        np.linspace(0.0, 1.0, 11), np.repeat(q, 11, axis=0), motion("right").names
    )
    walk = walker("right").walk(still, fulcrum_m=0.108, start_s=0.0, end_s=0.15, step_s=step_s)
    inputs, record, mechanism = inputs_of(walk, walker("right")), walk.record, walk.mechanism
    knee, steps = mechanism.tree.index("knee_angle_l"), len(record.time_s)
    context = mechanism.plant.CreateDefaultContext()
    mechanism.plant.SetPositions(context, record.q0)
    M, at, holding = (
        mechanism.plant.CalcMassMatrix(context)[knee, knee],
        record.q0[knee],
        record.load[-1, knee],
    )
    torques = Torques(
        coordinates=np.array([knee]),
        sensed=np.array([knee]),
        feedforward=np.full((steps, 1), holding),
        feedback=np.tile([w * w * M, 2.0 * w * M], (steps, 1, 1)),
        reference=np.tile([at, 0.0], (steps, 1)),
    )
    held = inputs.prescribed != knee
    q0, driven = record.q0.copy(), inputs.prescribed[held]
    q0[knee] += e0
    swung = Stepper(mechanism).run(
        dataclasses.replace(
            inputs, prescribed=driven, prescribed_q=inputs.prescribed_q[:, held], torques=torques
        ),
        q0,
        np.zeros_like(q0),
    )
    t = swung.time_s
    # Gravity, some 10 N m/rad beside 700, and the hold over a step make the difference.
    np.testing.assert_allclose(
        swung.q[:, knee] - at, e0 * (1.0 + w * t) * np.exp(-w * t), atol=0.03 * e0
    )
    q, v = (
        np.append(start, series[:-1, knee])
        for start, series in ((q0[knee], swung.q), (0.0, swung.v))
    )
    np.testing.assert_allclose(
        swung.load[:, knee], holding - w * w * M * (q - at) - 2.0 * w * M * v, atol=1e-3
    )
    ledger = energy_ledger(mechanism, swung, driven=driven, fulcrum_m=inputs.fulcrum)
    assert np.abs(ledger["remainder"]).max() < 0.05 * np.abs(ledger["driver_work"]).max()
