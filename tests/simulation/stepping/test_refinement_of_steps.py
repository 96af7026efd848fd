"""A step that does not converge is cut into pieces that cover it, down to a floor, and everything says so."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker, inputs_of

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS, split_coordinates, step_room
from vsf_drake.simulation.stepping.newton import MAX_ITERATIONS, step
from vsf_drake.simulation.stepping.stepper import (
    CHUNK,
    LEVELS,
    PARTS,
    Drive,
    Inputs,
    Stepper,
    advance,
    drive_of,
    next_piece,
    no_torques,
    piece,
)

walked = cache(cut_walk)


def cut(outcome):
    """Accepted pieces (begin, size) of one step whose pieces converge as `outcome(done, size)` says; and all tries."""
    done, size, accepted, tries = 0, PARTS, [], []
    while done < PARTS:
        converged, begin = outcome(done, size), done
        tries.append((begin, size, converged))
        done, next_size, taken = next_piece(done, size, converged)
        if taken:
            accepted.append((begin, size))
        size = next_size
    return accepted, tries


def test_step_that_converges_is_one_piece():
    assert cut(lambda done, size: True) == ([(0, PARTS)], [(0, PARTS, True)])


def test_pieces_cover_a_step_without_gap_or_overlap_whatever_converges():
    rng = np.random.default_rng(0)
    for share in np.repeat([0.1, 0.5, 0.8, 0.95], 200):
        accepted, tries = cut(lambda done, size, share=share: rng.random() < share)
        begins, sizes = np.array(accepted).T
        np.testing.assert_array_equal(begins, np.concatenate([[0], np.cumsum(sizes)[:-1]]))
        assert sizes.sum() == PARTS
        assert len(accepted) <= PARTS
        assert all(PARTS % size == 0 and begin % size == 0 for begin, size in accepted)
        assert all(converged or size == 1 for begin, size, converged in tries if (begin, size) in accepted)


def test_nothing_converges_down_to_the_floor_only():
    accepted, tries = cut(lambda done, size: False)
    assert accepted == [(i, 1) for i in range(PARTS)]
    assert min(size for _, size, _ in tries) == 1
    assert PARTS == 2**LEVELS


def test_pieces_grow_again_as_soon_as_they_can():
    """Hard only at the very beginning: 1, 1, 2, 4, 8, 16 of 32."""
    accepted, _ = cut(lambda done, size: done > 0 or size == 1)
    assert [size for _, size in accepted] == [1, *(2**i for i in range(LEVELS))]


def test_pieces_are_small_only_where_it_is_hard():
    """Before an instant that only a smallest piece gets over, sizes fall; after it each comes twice at most."""
    for hard in range(PARTS):
        accepted, _ = cut(lambda done, size, hard=hard: size == 1 or not done <= hard < done + size)
        assert (hard, 1) in accepted
        assert len(accepted) <= 3 * LEVELS + 1


def test_ends_of_pieces_lie_on_straight_lines_between_the_grid_points():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5e-3, 2e-3, 6))
    drive = Drive(time_s=time, prescribed_q=rng.normal(size=(6, 3)), fulcrum=rng.uniform(0.06, 0.15, 6),
                  ground=rng.normal(size=6), ground_rate=rng.normal(size=6), torques=no_torques(5))
    q_next = np.zeros(3)
    for k in range(5):
        for share in (0.1, 0.7, 0.9):
            accepted, _ = cut(lambda done, size, share=share: rng.random() < share)
            t = time[k]
            for begin, size in accepted:
                h, fulcrum, ground, rate = piece(drive, k, begin, size, q_next)
                t += h
                assert h == pytest.approx((time[k + 1] - time[k]) * size / PARTS, rel=1e-14)
                for found, column in ((fulcrum, drive.fulcrum), (ground, drive.ground), *zip(
                        q_next, drive.prescribed_q.T, strict=True)):
                    assert found == pytest.approx(np.interp(t, time, column), rel=1e-12, abs=1e-12)
                assert rate == drive.ground_rate[k + 1]
            assert t == pytest.approx(time[k + 1], rel=1e-14)
            assert fulcrum == drive.fulcrum[k + 1] and ground == drive.ground[k + 1]
            np.testing.assert_array_equal(q_next, drive.prescribed_q[k + 1])


def pieces_of(mechanism, inputs, q0, v0):
    """Ends (s) of all pieces of a run, and how many each step has, by the compiled step and a loop of its own."""
    stepper, forces, drive = Stepper(mechanism), mechanism.forces, drive_of(inputs)
    split = split_coordinates(mechanism.tree, forces, inputs.prescribed)
    room = step_room(mechanism.tree, forces, split)
    out = np.zeros(len(q0)), np.zeros((len(mechanism.sites), 9)), np.zeros(3)
    none, nothing = np.empty((0, 0)), np.empty(0)
    q, v, q_next, ends, counts = q0.copy(), v0.copy(), np.zeros(len(inputs.prescribed)), [], []
    for k in range(len(inputs.time_s) - 1):
        begun = len(ends)

        def tried(done, size, k=k):
            h, fulcrum, ground, rate = piece(drive, k, done, size, q_next)
            before = q.copy(), v.copy()
            _, converged = step(h, stepper.tree, forces, split, room, ground, rate, fulcrum, q_next, none,
                                nothing, q, v, *out)
            if not converged and size > 1:
                q[:], v[:] = before
            else:
                share = (done + size) / PARTS
                ends.append((1.0 - share) * inputs.time_s[k] + share * inputs.time_s[k + 1])
            return converged

        cut(tried)
        counts.append(len(ends) - begun)
    return np.array(ends), np.array(counts)


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_run_whose_steps_are_cut_is_a_run_on_the_grid_of_its_pieces(name):
    """A load is the mean over the pieces. Agreement is to what Newton's method leaves, since some hundred contacts
    pass on the rounding of a time."""
    walk = walked(name)
    setting, _, _ = SETTINGS[name]
    inputs, record = inputs_of(walk, hard_walker(setting)[0]), walk.record
    ends, counts = pieces_of(walk.mechanism, inputs, record.q0, record.v0)
    np.testing.assert_array_equal(counts, record.parts)
    assert record.parts.max() > 1 and record.converged.all()
    grid = np.concatenate([inputs.time_s[:1], ends])
    q = np.column_stack([np.interp(grid, inputs.time_s, column) for column in inputs.prescribed_q.T])
    fine = dataclasses.replace(inputs, time_s=grid, prescribed_q=q, fulcrum=q[:, -1], ground=np.zeros(len(grid)))
    uncut = Stepper(walk.mechanism).run(fine, record.q0, record.v0)
    np.testing.assert_array_equal(uncut.parts, 1)
    last = np.cumsum(counts) - 1
    share = np.diff(grid) / np.repeat(np.diff(inputs.time_s), counts)
    load = np.add.reduceat(share[:, None] * uncut.load, np.cumsum(counts) - counts, axis=0)
    for column in ("q", "v", "sites", "fulcrum", "load"):
        wanted = load if column == "load" else getattr(uncut, column)[last]
        np.testing.assert_allclose(getattr(record, column), wanted, rtol=0.0, atol=1e-6 * np.abs(wanted).max())


def test_cut_steps_took_more_than_newtons_method_may_and_the_others_less():
    record = walked("catching").record
    assert np.all(record.iterations[record.parts == 1] < MAX_ITERATIONS)
    assert np.all(record.iterations[record.parts > 1] > MAX_ITERATIONS)
    assert np.count_nonzero(record.parts > 1) < 0.02 * len(record.parts)


def test_prescribed_coordinates_and_fulcrum_are_those_of_the_inputs_at_the_end_of_cut_steps():
    walk = walked("catching")
    inputs = inputs_of(walk, hard_walker(0)[0])
    np.testing.assert_array_equal(walk.record.q[:, inputs.prescribed], inputs.prescribed_q[1:])


def test_cut_steps_leave_the_method_first_order():
    """The impulse's error halves with the step, whether steps are cut (8, 4, 2 ms) or not (1 ms)."""
    fine_s = 6.25e-5

    def impulse(step_s):
        return np.cumsum(cut_walk("landing", step_s).prosthetic.grf_W, axis=0) * step_s

    reference, steps = impulse(fine_s), (8e-3, 4e-3, 2e-3, 1e-3)
    errors = []
    for step_s in steps:
        every = round(step_s / fine_s)
        coarse, fine = impulse(step_s), reference[every - 1 :: every]
        rows = min(len(coarse), len(fine))
        errors.append(np.abs(coarse[:rows] - fine[:rows]).max())
    assert [walk.record.parts.max() > 1 for walk in (cut_walk("landing", s) for s in steps)] == [True] * 3 + [False]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert np.all((ratios > 1.6) & (ratios < 2.4))


def test_step_that_converges_in_no_size_is_kept_and_counted():
    """A smallest piece has at least LEVELS others beside it."""
    record = walked("lost").record
    assert np.count_nonzero(~record.converged) == 1
    assert np.all(record.parts[~record.converged] > LEVELS)
    assert np.all(record.iterations <= MAX_ITERATIONS * 2 * PARTS)
    assert np.isfinite(record.q).all() and np.isfinite(record.sites).all()


@pytest.mark.parametrize(("name", "said"), [
    ("catching", ["{refined} of {steps} steps were cut into up to 4 pieces"]),
    ("lost", ["1 of {steps} steps did not converge", "{refined} of {steps} steps were cut into up to 6 pieces"])])
def test_result_says_how_many_steps_were_cut(name, said):
    walk = walked(name)
    walker, trial = hard_walker(SETTINGS[name][0])
    result = walker.result(walk, trial, GeometricOffsets(), energy=False)
    refined, steps = int(np.sum(walk.record.parts > 1)), len(walk.record.parts)
    assert result.refined_steps == refined > 0
    assert result.converged == (name == "catching")
    notes = [note for note in result.notes if "steps" in note]
    assert notes == [sentence.format(refined=refined, steps=steps) for sentence in said]


def stopped(walker, time_s, *, stop_ratio):
    """(stepper, inputs, q0) of the person in the air, the prosthesis falling against a stop of its socket."""
    mechanism = gait_mechanism(walker.gait, walker.context)
    tree, springs = mechanism.tree, np.array(mechanism.springs)
    row = list(mechanism.spring_index).index(tree.index("socket_tz"))
    springs[row, SPRING_COLUMNS.index("limit")] = 1e-3
    springs[row, SPRING_COLUMNS.index("stop_ratio")] = stop_ratio
    prescribed = np.array([tree.index(name) for name in (*walker.gait.prescribed, "fulcrum")])
    held = np.zeros((len(time_s), len(prescribed)))
    held[:, 1], held[:, -1] = 1000.0, 0.1
    q0 = np.zeros(tree.num_coordinates)
    q0[prescribed] = held[0]
    inputs = Inputs(time_s=time_s, prescribed=prescribed, prescribed_q=held, fulcrum=held[:, -1],
                    ground=np.zeros(len(time_s)))
    return Stepper(dataclasses.replace(mechanism, springs=springs)), inputs, q0


def test_stop_whose_rounding_is_too_large_for_a_whole_step_is_met_in_quarters(walker):
    """The error that rounding leaves in an impulse shrinks with the step. In powers of 2 all times are exact, so that
    a run of quarters gives the same bits as the cut steps."""
    stepper, inputs, q0 = stopped(walker("right"), np.arange(401) / 1024, stop_ratio=10**11.5)
    record = stepper.run(inputs, q0, np.zeros_like(q0))
    assert record.converged.all()
    assert np.count_nonzero(record.parts == 4) > 100
    first = int(np.argmax(record.parts == 4))
    while not np.all(record.parts[first : first + 10] == 4):
        first += 1
    held, inputs_4, _ = stopped(walker("right"), np.arange(41) / 4096, stop_ratio=10**11.5)
    quarters = held.run(inputs_4, record.q[first - 1], record.v[first - 1])
    np.testing.assert_array_equal(quarters.parts, 1)
    np.testing.assert_array_equal(quarters.q[3::4], record.q[first : first + 10])
    np.testing.assert_array_equal(quarters.v[3::4], record.v[first : first + 10])


def test_stop_that_no_step_can_meet_reaches_the_floor_and_each_step_says_so(walker):
    stepper, inputs, q0 = stopped(walker("right"), 1e-3 * np.arange(201), stop_ratio=1e16)
    record = stepper.run(inputs, q0, np.zeros_like(q0))
    assert np.count_nonzero(~record.converged) > 50
    assert record.parts.max() == PARTS
    assert np.all(record.parts[~record.converged] > LEVELS)
    assert np.isfinite(record.q).all()


def test_progress_and_early_end_count_steps_and_not_pieces():
    walk = walked("catching")
    inputs, record = inputs_of(walk, hard_walker(0)[0]), walk.record
    said = []
    short = Stepper(walk.mechanism).run(inputs, record.q0, record.v0, progress=said.append,
                                        stop=lambda done, _: done >= 5 * CHUNK)
    assert len(short.parts) == 5 * CHUNK and short.parts.max() > 1
    np.testing.assert_array_equal(short.q, record.q[: 5 * CHUNK])
    assert said == sorted(said) and said[-1] == pytest.approx(5 * CHUNK / len(record.parts))


def test_advance_goes_on_where_it_stopped():
    """In two calls as in one, also when the first ends with a cut step."""
    walk = walked("landing")
    inputs, record, mechanism = inputs_of(walk, hard_walker(1)[0]), walk.record, walk.mechanism
    first = int(np.argmax(record.parts > 1)) + 1
    part = dataclasses.replace(inputs, **{name: getattr(inputs, name)[first:] for name in (
        "time_s", "prescribed_q", "fulcrum", "ground")})
    later = Stepper(mechanism).run(part, record.q[first - 1], record.v[first - 1])
    assert advance.signatures
    np.testing.assert_array_equal(later.q, record.q[first:])
    np.testing.assert_array_equal(later.parts, record.parts[first:])
