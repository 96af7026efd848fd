"""Every walk of a block is to the bit what it is alone, whatever goes on beside it."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker, inputs_of
from laned import lanes

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.bench import Bench
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.reactions import PROSTHETIC
from vsf_drake.simulation.stepping.advance import PARTS
from vsf_drake.simulation.stepping.assembly import (
    MAX_APPROACH,
    SITE_COLUMNS,
    SPRING_COLUMNS,
    TOLERANCE,
)
from vsf_drake.simulation.stepping.block import LOOKS, Block
from vsf_drake.simulation.stepping.newton import solve_columns
from vsf_drake.simulation.stepping.runs import Inputs, Record, Run
from vsf_drake.simulation.stepping.stepper import (
    SETTLED_SPEED,
    Stepper,
    run_side_by_side,
    settle_side_by_side,
)

COUNT = 11
"""Runs that differ in all that runs may differ in: more than a block, so that one is not full."""
JOINTS_M = (0.07764, 0.1242)
"""Two joints of the keel, next to which the support stands on two pieces of it."""
WIDTH_M = 4e-3


def values_of(i, walker):
    """Another foot, ground, socket and mount for each i."""
    rng, values = np.random.default_rng(i), {}
    for name, variable in walker.variables.items():
        family, _, number = name.partition(".")
        if family in ("contact", "keel", "socket", "friction") and not name.endswith("rise"):
            values[name] = variable.default * np.exp(rng.uniform(-0.7, 0.7))
        if number.endswith("rise"):
            values[name] = rng.uniform(-2e-3, 2e-3)
        if family == "offset":
            values[name] = rng.uniform(-1.0, 1.0) * {"height": 4e-3, "fore_aft": 0.01}.get(
                number, 0.04
            )
    for name in [name for name in values if name.endswith("exponent")]:
        zone = name.removesuffix("exponent")
        values[name] = 1.0 if i == 3 else rng.uniform(1.05, 1.6)
        # as stiff at some 5 mm
        values[zone + "stiffness"] *= 5e-3 ** (1.0 - values[name])
    return values


@cache
def different_runs() -> tuple[Run, ...]:
    """Windows of three recordings with values_of, each of its own length and grid, some uneven; the
    fulcrum may move."""
    runs = []
    for i in range(COUNT):
        walker, trial = hard_walker(i % 3)
        start, steps = 0.32 + 0.045 * i, 48 + 7 * (5 * i % COUNT)
        near = JOINTS_M[i % 2] + 3e-3 * (i % 4)
        speed = -0.05 if i % 3 == 1 else 0.0
        step_s = (1e-3, 2e-3, 0.7e-3)[i % 3]
        walk = walker.walk(
            trial.trajectory,
            values=values_of(i, walker),
            fulcrum_m=lambda t, near=near, speed=speed, start=start: near + speed * (t - start),
            support_width_m=WIDTH_M,
            start_s=start,
            end_s=start + steps * step_s,
            step_s=step_s,
        )
        inputs = inputs_of(walk, walker)
        if i % 4 == 2:
            inputs = on_grid(inputs, inputs.time_s + 0.3 * step_s * np.sin(np.arange(steps + 1.0)))
        runs.append(Run(walk.mechanism, inputs, walk.record.q0, walk.record.v0))
    return tuple(runs)


def on_grid(inputs, time_s):
    """The same motion at other instants."""
    rows = np.column_stack([inputs.prescribed_q, inputs.fulcrum, inputs.ground])
    rows = np.column_stack([np.interp(time_s, inputs.time_s, column) for column in rows.T])
    return dataclasses.replace(
        inputs,
        time_s=time_s,
        prescribed_q=rows[:, :-2].copy(),
        fulcrum=rows[:, -2].copy(),
        ground=rows[:, -1].copy(),
    )


def window(run, first, last):
    """The steps `first` ... `last` - 1 of what became of a run."""
    (record,) = run_side_by_side([run])
    rows = slice(first, last + 1)
    inputs = dataclasses.replace(
        run.inputs,
        **{
            name: getattr(run.inputs, name)[rows]
            for name in ("time_s", "prescribed_q", "fulcrum", "ground")
        },
    )
    return Run(run.mechanism, inputs, record.q[first - 1], record.v[first - 1])


@cache
def cut_run(name):
    """Some steps around the first one that is cut of `cut_walks.SETTINGS`."""
    walk, walker = cut_walk(name), hard_walker(SETTINGS[name][0])[0]
    at = int(np.argmax(walk.record.parts > 1 if name != "lost" else ~walk.record.converged))
    whole = Run(walk.mechanism, inputs_of(walk, walker), walk.record.q0, walk.record.v0)
    return window(whole, at - 10, at + 15)


@cache
def alone(run, sites=True):
    """What a run is by itself."""
    (outcome,) = run_side_by_side([run], sites=sites)
    return outcome


def assert_same_bits(found, wanted):
    """Every field of both records; or both failed, at the same time of the same."""
    if isinstance(wanted, SimulationError):
        assert isinstance(found, SimulationError)
        assert str(found) == str(wanted) and found.time_s == wanted.time_s
        return
    assert isinstance(found, Record)
    for name, one, other in zip(Record._fields, found, wanted, strict=True):
        assert one.dtype == other.dtype and one.shape == other.shape, name
        assert np.ascontiguousarray(one).tobytes() == np.ascontiguousarray(other).tobytes(), name


def assert_as_alone(runs, sites=True):
    found = run_side_by_side(runs, sites=sites)
    assert len(found) == len(runs)
    for run, outcome in zip(runs, found, strict=True):
        assert_same_bits(outcome, alone(run, sites))


def changed(run, **arrays):
    """With arrays of its mechanism replaced."""
    return dataclasses.replace(run, mechanism=dataclasses.replace(run.mechanism, **arrays))


def with_site(run, site, column, value):
    sites = run.mechanism.sites.copy()
    sites[site, SITE_COLUMNS.index(column)] = value
    return changed(run, sites=sites)


def without_number(run, steps=None):
    """With a sphere of the prosthesis of which the stiffness is NaN, and that is on the ground
    sooner or later, or in the first `steps`."""
    force = alone(run).site("normal_force")[:steps] * (run.mechanism.feet == PROSTHETIC)
    return with_site(run, np.argmax(force.max(axis=0)), "stiffness", np.nan)


def pushed_away(run):
    """With springs that push instead of pull."""
    pushing = [SPRING_COLUMNS.index(name) for name in ("stiffness", "stiffness_negative")]
    springs = run.mechanism.springs.copy()
    springs[:, pushing] *= -10.0
    return changed(run, springs=springs)


def test_runs_are_what_the_test_needs():
    """Different in everything, loaded, with the support on one and on two pieces of the keel."""
    runs = different_runs()
    records = [alone(run) for run in runs]
    assert len({len(record.time_s) for record in records}) == COUNT
    for name in ("stiffness", "exponent", "damping", "mu_static", "threshold_velocity"):
        column = SITE_COLUMNS.index(name)
        assert len({tuple(run.mechanism.sites[:, column]) for run in runs}) == COUNT
    assert len({run.mechanism.tree.frames.tobytes() for run in runs}) == COUNT
    assert len({run.mechanism.springs.tobytes() for run in runs}) == COUNT
    assert all(record.wrench[:, PROSTHETIC, 5].max() > 50.0 for record in records)
    rounds = np.array([record.iterations[:LOOKS] for record in records])
    assert np.sum(np.ptp(rounds, axis=0) > 0) > 5
    distance = np.array([np.abs(run.inputs.fulcrum[0] - JOINTS_M).min() for run in runs])
    assert 2 < np.sum(distance < WIDTH_M) < COUNT - 2
    assert min(len(record.time_s) for record in records) > LOOKS


@pytest.mark.parametrize("sites", [True, False])
@pytest.mark.parametrize(
    "order",
    [
        (0, 1),
        (1, 0),
        (4, 9, 2),
        (0, 1, 2, 3, 4, 5, 6, 7),
        (7, 6, 5, 4, 3, 2, 1, 0),
        (10, 3, 8, 5, 0, 9, 1, 7),
        tuple(range(COUNT)),
        (6, 6, 6),
    ],
    ids=str,
)
def test_different_runs_are_to_the_bit_what_each_is_alone(order, sites):
    """In any order and grouping, with and without the record of each site."""
    assert_as_alone([different_runs()[i] for i in order], sites)


def test_what_is_recorded_of_sites_changes_nothing_else():
    for run in different_runs()[:3]:
        kept, left = alone(run, True), alone(run, False)
        assert kept.sites.shape[1] == len(run.mechanism.sites) and left.sites.shape[1] == 0
        assert_same_bits(left._replace(sites=kept.sites), kept)


def test_a_stepper_runs_alone_as_a_block_of_one():
    run = different_runs()[1]
    record = Stepper(run.mechanism).run(run.inputs, run.q0, run.v0)
    assert_same_bits(record, alone(run))


def test_steps_that_are_cut_are_cut_beside_others_as_alone():
    """Two walks whose steps are cut at different places, one of which a step converges in no size,
    and others that converge at once."""
    cut = [cut_run(name) for name in ("landing", "catching", "lost")]
    parts = [alone(run).parts for run in cut]
    assert all(part.max() > 1 for part in parts)
    assert not alone(cut[2]).converged.all()
    a, b, c = cut
    runs = [changed(run, support_width=0.0) for run in different_runs()[:5]]
    assert all(np.all(alone(run).parts == 1) for run in runs)
    assert_as_alone([runs[0], a, runs[1], b, runs[2], c, runs[3], runs[4]])
    assert_as_alone([c, c, a])
    assert_as_alone([b, a])


def test_runs_with_another_law_or_support_are_refused():
    run = different_runs()[0]
    for other in (changed(run, support_width=0.0), changed(run, law=1)):
        with pytest.raises(ValueError, match="one contact law and one width"):
            run_side_by_side([run, other])


def test_run_that_diverges_ends_alone():
    """One without a number, one whose springs push: their errors are what they are alone, and the
    others go on."""
    runs = list(different_runs()[:6])
    lost = [without_number(runs[1]), pushed_away(runs[2])]
    for run in lost:
        assert isinstance(alone(run), SimulationError)
        assert "diverged" in str(alone(run))
    assert_as_alone([runs[0], lost[0], *runs[1:4], lost[1], *runs[4:6]])
    assert_as_alone([lost[0], runs[0]])
    assert_as_alone(lost)


def test_run_beyond_its_limits_ends_alone():
    runs = list(different_runs()[:4])
    limits = runs[2].mechanism.limits.copy()
    c = runs[2].mechanism.tree.index("knee_angle_r")
    limits[c] = np.median(np.abs(alone(runs[2]).q[:, c]))
    beyond = changed(runs[2], limits=limits)
    assert "knee_angle_r reached" in str(alone(beyond))
    assert_as_alone([runs[0], runs[2], beyond, runs[3]])


def test_newton_stops_at_once_where_nothing_is_a_number():
    """One round a try; all of them for every try would cost the others the same."""
    runs = list(different_runs()[:4])
    lost = without_number(runs[1])
    block = Block([runs[0], lost, *runs[2:]], TOLERANCE, sites=False, forward=None)
    failed_s = block.run(None, lambda finished: None)[1].time_s
    at = int(np.searchsorted(lost.inputs.time_s[1:], failed_s - 1e-9))
    iterations = block.written.counts[:, 0, 1]
    tries = 2 * PARTS  # at most, of a step in which nothing converges
    assert len(iterations) > at
    assert 1 < iterations[at] <= tries
    assert not iterations[at + 1 :].any()


def test_a_block_rests_as_each_of_its_runs_does():
    """To the bit, also beside one that never rests since it has no number."""
    runs = [
        Run(run.mechanism, run.inputs, run.q0 + 1e-3 * (k % 3), run.v0)
        for k, run in enumerate(different_runs()[:WIDTH])
    ]
    singly = [settle_side_by_side([run])[0] for run in runs]
    together = settle_side_by_side(runs)
    for (q, speed), (q_alone, speed_alone) in zip(together, singly, strict=True):
        assert q.tobytes() == q_alone.tobytes() and speed == speed_alone
        assert speed < SETTLED_SPEED
    run = without_number(different_runs()[6], steps=1)
    (wrong,) = settle_side_by_side([run])
    assert isinstance(wrong, SimulationError)
    found = settle_side_by_side([runs[0], run, runs[1]])
    assert str(found[1]) == str(wrong)
    for k, (q, speed) in ((0, found[0]), (1, found[2])):
        assert q.tobytes() == singly[k][0].tobytes() and speed == singly[k][1]


def test_stop_ends_one_run_and_no_other():
    runs = list(different_runs()[:5])
    ends = len(runs[3].inputs.time_s) - 1
    found = run_side_by_side(
        runs, stop=lambda done, record: len(record.time_s) == ends and done >= LOOKS
    )
    assert len(found[3].time_s) == LOOKS
    for k, (run, record) in enumerate(zip(runs, found, strict=True)):
        whole = alone(run)
        steps = LOOKS if k == 3 else len(whole.time_s)
        kept = {name: getattr(whole, name)[:steps] for name in Record._fields if name[1:] != "0"}
        assert_same_bits(record, whole._replace(**kept))


def test_nothing_is_asked_of_a_run_that_has_diverged():
    """Its record has no more rows than it went."""
    runs = list(different_runs()[:3])
    lost = without_number(runs[1])
    asked = []

    def stop(done, record):
        if len(record.time_s) == len(lost.inputs.time_s) - 1:
            asked.append((done, record.time_s[done - 1]))
        return False

    found = run_side_by_side([runs[0], lost, runs[2]], stop=stop)
    assert_same_bits(found[1], alone(lost))
    assert all(time_s < found[1].time_s for _, time_s in asked)


def test_a_block_ends_where_all_of_its_runs_have():
    shares = []
    run_side_by_side(
        list(different_runs()[:3]), stop=lambda done, record: True, progress=shares.append
    )
    assert len(shares) == 1


def test_progress_goes_from_block_to_block_to_the_end():
    shares = []
    run_side_by_side(list(different_runs()), progress=shares.append)
    assert shares == sorted(shares) and shares[-1] == pytest.approx(1.0)
    assert len(shares) > 1


def test_the_bench_presses_eight_feet_at_once():
    """The ground moves, up to different heights with different speeds, and so may the fulcrum."""
    bench = Bench(FootParameters())
    mechanism = bench_mechanism(bench.bench, bench.context)
    carriage = mechanism.tree.index(bench.bench.foot.carriage_joint_name)
    runs = []
    for k in range(WIDTH):
        t = np.linspace(0.0, 0.2 + 0.05 * k, 40 + 3 * k)
        fulcrum = 0.07 + 0.01 * k + (0.1 * t if k % 2 else 0.0 * t)
        sites, springs = mechanism.sites.copy(), mechanism.springs.copy()
        sites[:, SITE_COLUMNS.index("stiffness")] *= 1.0 + 0.1 * k
        springs[:, SPRING_COLUMNS.index("stiffness")] *= 1.0 - 0.05 * k
        q0 = np.zeros(mechanism.tree.num_coordinates)
        q0[carriage] = fulcrum[0]
        inputs = Inputs(
            time_s=t,
            prescribed=np.array([carriage]),
            prescribed_q=fulcrum[:, None],
            fulcrum=fulcrum,
            ground=bench.bench.contact_height + 0.04 * t + 0.002 * np.sin(30.0 * t),
        )
        runs.append(
            Run(
                dataclasses.replace(mechanism, sites=sites, springs=springs),
                inputs,
                q0,
                np.zeros_like(q0),
            )
        )
    loads = [alone(run).wrench[:, 0, 5].max() for run in runs]
    assert min(loads) > 20.0 and np.ptp(loads) > 20.0
    assert_as_alone(runs)
    assert_as_alone(runs[2:5][::-1])


def test_a_sphere_that_comes_faster_than_one_looks_for_is_left_out_beside_others_too():
    """It begins a step further above the ground than it could come at MAX_APPROACH, and ends it in
    the ground; the same sphere of the walk beside it is in the ground all the while."""
    run = different_runs()[0]
    h, steps = 1e-3, 4
    tree, p = run.mechanism.tree, run.inputs.prescribed
    ty = tree.index("pelvis_ty")
    q0, v0 = run.q0.copy(), np.zeros_like(run.v0)
    v0[ty] = -1.6 * MAX_APPROACH
    q = np.tile(q0[p], (steps + 1, 1))
    q[:, p == ty] += v0[ty] * h * np.arange(steps + 1)[:, None]
    falling = Inputs(
        time_s=h * np.arange(steps + 1),
        prescribed=p,
        prescribed_q=q,
        fulcrum=np.full(steps + 1, run.inputs.fulcrum[0]),
        ground=np.full(steps + 1, -10.0),
    )
    bottoms = -10.0 - alone(Run(run.mechanism, falling, q0, v0)).site("depth")[0]
    ground = np.full(steps + 1, bottoms.min() - 1.3 * MAX_APPROACH * h)
    one = Run(run.mechanism, dataclasses.replace(falling, ground=ground), q0, v0)
    force = alone(one).site("normal_force").max(axis=1)
    assert force[0] == 0.0 < force[1]
    assert_as_alone([one, run])


# Linear equations: rows of a matrix are exchanged in the walks that need it.


@compiled
def _solve(A, B):
    solve_columns(A, B)


@compiled
def _solve_lanes(A, B):
    solve_columns(lanes(A), lanes(B))


def test_rows_are_exchanged_in_the_walks_that_need_it():
    """Nothing on the diagonal, little, a permutation, several exchanges; and matrices that need
    none."""
    rng = np.random.default_rng(6)
    n, m = 7, 2
    A = rng.normal(size=(n, n, WIDTH))
    A[:, :, 0] += 10.0 * np.eye(n)
    A[0, 0, 1] = 0.0
    A[:, :, 2] = np.eye(n)[rng.permutation(n)]
    A[np.arange(n), np.arange(n), 3] = 0.0
    A[2, 2, 4] = 1e-14
    A[:, :, 5] = np.eye(n)[::-1] * np.arange(1.0, n + 1.0)
    A[:, :, 6] = np.triu(A[:, :, 6]) + 3.0 * np.eye(n)
    B = rng.normal(size=(n, m, WIDTH))
    found = B.copy()
    _solve_lanes(A.copy(), found)
    for walk in range(WIDTH):
        wanted = np.linalg.solve(A[:, :, walk], B[:, :, walk])
        np.testing.assert_allclose(
            found[:, :, walk], wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max()
        )
        single = np.ascontiguousarray(B[:, :, walk])
        _solve(np.ascontiguousarray(A[:, :, walk]), single)
        assert single.tobytes() == np.ascontiguousarray(found[:, :, walk]).tobytes()


def test_python_exchanges_rows_of_eight_right_sides_too():
    """As they are without numba, where A has numbers and B rows of WIDTH of them."""
    rng = np.random.default_rng(7)
    n, m = 5, 2
    A = rng.normal(size=(n, n))
    A[0, 0] = 0.0
    B = rng.normal(size=(n, m, WIDTH))
    found = B.copy()
    solve_columns.py_func(A.copy(), found)
    wanted = np.linalg.solve(A, B.reshape(n, m * WIDTH)).reshape(B.shape)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())
