"""Tunings with the motion given: derivatives, known answers, what is refused, what is left when one
is broken off."""

import copy
import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.base.errors import FitError, InputError
from vsf_drake.base.files import plain
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.tuning.common import COSTS, DESIGN, WEIGHTED
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.tuning.problem import StiffnessTuning
from vsf_drake.tuning.solution import tuning_arrays, tuning_table
from vsf_drake.tuning.solve import search, solve
from vsf_drake.tuning.sweep import SettingSweep, local_minima, lowest, positions
from vsf_drake.tuning.uncertainty import difference, flat_range, fulcrum_uncertainty

GRID = np.linspace(66.0, 151.0, 86)
QUICK = {"sweep_mm": 5.0}
TRUE_MM = 93.4
SETTING, STEPS = (97.3, 1.1, 0.01, 6.2), (1e-2, 1e-3, 1e-5, 1e-3)


@pytest.fixture(scope="module")
def solution(made_tuning):
    return solve(made_tuning("medium_1", "high_1", draws=1, sweep_mm=5.0))


def test_a_table_of_the_tuning_has_its_sweep_with_the_cost_as_the_mean_of_the_trials_terms(
    solution,
):
    frame, dataset = solution.to_dataframe(), solution.to_xarray()
    assert np.array_equal(frame.fulcrum_mm, solution.sweep.fulcrum_mm)
    assert frame.attrs["units"]["fulcrum_mm"] == "mm"
    terms = sum(dataset[name] for name in dataset if name.startswith("term_"))
    assert np.allclose(terms.mean("trial"), frame.cost, rtol=1e-12)
    assert (
        frame.attrs["units"]["stored_energy_medium_1"] == "J"
        and frame.attrs["optimum_mm"] == solution.fulcrum_mm
    )
    assert "SYNTHETIC" in solution._repr_html_() and "No result:" not in solution._repr_html_()
    failed = copy.copy(solution)
    failed.success = False
    with pytest.raises(FitError):
        failed.to_dataframe()
    assert "No result:" in failed._repr_html_()


# The problem: its cost, its derivatives, and what it refuses.


@pytest.mark.parametrize("cost", [*COSTS, WEIGHTED])
def test_gradient_of_each_cost_by_each_variable_is_that_of_differences(made_tuning, cost):
    tuning = made_tuning(cost=cost, design=DESIGN)
    x = np.array(SETTING)
    exact = tuning.evaluate(x).gradient
    for p, step in enumerate(STEPS):
        ends = [
            tuning.evaluate(x + sign * step * np.eye(4)[p], derivatives=False).cost
            for sign in (1.0, -1.0)
        ]
        central = (ends[0] - ends[1]) / (2.0 * step)
        assert exact[p] == pytest.approx(central, rel=0.01), tuning.design[p].name


def test_gradient_is_continuous_where_the_fulcrum_passes_a_joint_of_the_keel(made_tuning):
    """At 100.93 mm (facts of the nominal keel: 66 + 23.29 * 1.5 mm) the smoothed cost's slope does
    not jump."""
    tuning, joint = made_tuning(), 66.0 + 1.5 * 163.0 / 7.0
    slopes, sharp = (
        [one.evaluate(np.array([joint + side])).gradient[0] for side in (-0.01, 0.01)]
        for one in (tuning, tuning.without_smoothing())
    )
    assert abs(slopes[1] - slopes[0]) < 0.05 * abs(slopes[0])
    assert abs(slopes[1] - slopes[0]) < 0.2 * abs(sharp[1] - sharp[0])


def test_several_trials_cost_their_mean(made_tuning):
    x = np.array([100.0])
    both, *alone = (
        made_tuning(*names, cost="tracking").evaluate(x)
        for names in (("medium_1", "medium_2"), ("medium_1",), ("medium_2",))
    )
    assert both.cost == pytest.approx(np.mean([one.cost for one in alone]), rel=1e-12)
    assert both.gradient == pytest.approx(
        np.mean([one.gradient for one in alone], axis=0), rel=1e-9
    )


def test_at_the_recorded_setting_no_force_changes_and_each_part_of_a_weighted_cost_is_its_weight(
    made_tuning,
):
    tuning = made_tuning()
    at = tuning.evaluate(tuning.parts[0].own, derivatives=False)
    assert at.terms["consistency"][0] == pytest.approx(0.0, abs=1e-20)
    assert at.cost == pytest.approx(tuning.combination.size, rel=1e-9)
    tuning = made_tuning(cost="weighted", weights={"joint_load": 3.0, "push_off": 1.0})
    at = tuning.evaluate(tuning.parts[0].own, derivatives=False)
    assert {name: term[0] for name, term in at.terms.items()} == pytest.approx(
        {"joint_load": 0.75, "push_off": -0.25, "consistency": 0.0}, abs=1e-9
    )


def planar(trial):
    values = np.array(trial.trajectory.values)
    for name in ("hip_adduction_r", "hip_rotation_r", "knee_adduction_r", "knee_rotation_r"):
        values[:, trial.trajectory.names.index(name)] = 0.0
    motion = CoordinateTrajectory(trial.trajectory.time_s, values, trial.trajectory.names)
    return dataclasses.replace(trial, trajectory=motion)


def test_trials_that_do_not_bear_the_cost_are_refused(tuned_trials, made_tuning):
    trial = tuned_trials["medium_2"]
    left = dataclasses.replace(
        trial, subject=dataclasses.replace(trial.subject, prosthetic_side="left")
    )
    plate = dataclasses.replace(
        trial.prosthetic_plate, force_W=trial.prosthetic_plate.force_W * [1.0, 0.0, 1.0]
    )
    noted = dataclasses.replace(
        trial, notes=("Not in walk.mot, taken as zero: knee_adduction_r, knee_rotation_r.",)
    )
    adduction = TuningOptions(joints=("knee_angle", "knee_adduction"))
    for trials, words, message in (
        (
            [trial],
            {"cost": "comfort"},
            r"no 'comfort'.*joint_load, metabolic, push_off, tracking, weighted",
        ),
        ([], {}, "no trial to tune to"),
        ("low_1.yaml", {}, "no list of trials"),
        ([trial, left], {}, "on the left"),
        (
            [dataclasses.replace(trial, plates={})],
            {"cost": "tracking"},
            "no plate measured the force on the right",
        ),
        (
            [dataclasses.replace(trial, unmeasured={"right": ((0.0, 9.0),)})],
            {"cost": "tracking"},
            "no plate measured the force on the right",
        ),
        (
            [dataclasses.replace(trial, plates={"right": plate})],
            {"cost": "weighted", "options": TuningOptions(weights={"tracking": 1.0})},
            "no lateral force",
        ),
        ([planar(trial)], {}, r"no hip_adduction_r.*joints=\('hip_flexion', 'knee_angle'\)"),
        ([noted], {"options": adduction}, "no knee_adduction_r"),
        ([trial], {"labels": ["slow", "fast"]}, "does not name 1 trials"),
        (
            [trial],
            {"options": TuningOptions(bounds_mm=(50.0, 100.0))},
            "must lie within 66 to 151 mm",
        ),
        (
            [trial],
            {
                "options": TuningOptions(
                    design=("alignment",), design_bounds={"alignment": (-2.0, 0.1)}
                )
            },
            "out of range",
        ),
    ):
        with pytest.raises(InputError, match=message):
            StiffnessTuning(trials, **words)
    for end_s in (0.35, 0.9):
        with pytest.raises(InputError, match="no whole stance"):
            made_tuning(dataclasses.replace(trial, end_s=end_s))
    assert made_tuning(planar(trial), joints=("hip_flexion", "knee_angle")).own_cost > 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bounds_mm": (120.0, 90.0)}, "lower bound 120 is not below its upper one 90"),
        ({"bounds_mm": (90.0,)}, "no pair of numbers"),
        ({"bounds_mm": (False, True)}, "bounds_mm: .* is no pair"),
        ({"design": ("alignment", "alignment")}, "names alignment twice"),
        ({"design": "alignment"}, "no tuple"),
        ({"joints": ()}, "is empty"),
        ({"weights": {"joint_load": True}}, r"weights\['joint_load'\]: True is no weight"),
        ({"weights": {1: 1.0}}, "weights: there is no 1"),
        ({"weights": {"joint_load": 0.0}}, "all zero"),
        ({"cutoff_hz": 150.0, "search_step_s": 4e-3}, "below 125 Hz"),
        ({"pareto": ("joint_load",)}, "Give two costs"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        TuningOptions(**options)


# Known answers.


def walked(trial, walker, fulcrum_mm, **options):
    """The trial with the force of its own model, with the fulcrum there, as the plate."""
    walk = walker.walk(
        trial.trajectory,
        fulcrum_m=1e-3 * fulcrum_mm,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=2e-3,
        offsets=trial.offsets,
        support_width_m=4e-3,
        **options,
    )
    reaction = walk.prosthetic
    plate = PlateRecording(
        time_s=walk.record.time_s,
        force_W=reaction.grf_W,
        cop_W=reaction.cop_W,
        free_moment_nm=reaction.free_moment_nm,
        has_cop=True,
    )
    return dataclasses.replace(
        trial, plates=dict(trial.plates) | {trial.subject.prosthetic_side: plate}
    )


def test_tracking_finds_the_fulcrum_that_made_the_force(tuned_trials, shared_walker, made_tuning):
    ended = solve(
        made_tuning(
            walked(tuned_trials["medium_2"], shared_walker, TRUE_MM), cost="tracking", sweep_mm=5.0
        )
    )
    assert ended.fulcrum_mm == pytest.approx(TRUE_MM, abs=0.05)
    assert ended.cost < 1e-8


@pytest.mark.slow
def test_tracking_finds_fulcrum_heel_and_alignment_together(
    tuned_trials, shared_walker, made_tuning
):
    values = {"offset.alignment": 0.012} | {
        name: 1.25 * variable.default
        for name, variable in shared_walker.variables.items()
        if name.startswith("contact.heel") and name.endswith(".stiffness")
    }
    tuning = made_tuning(
        walked(tuned_trials["medium_2"], shared_walker, TRUE_MM, values=values),
        cost="tracking",
        design=("heel_stiffness", "alignment"),
        sweep_mm=10.0,
        more_starts=0,
    )
    ended = solve(tuning).values
    assert ended["fulcrum"] == pytest.approx(TRUE_MM, abs=0.3)
    assert ended["heel_stiffness"] == pytest.approx(1.25, abs=0.02)
    assert ended["alignment"] == pytest.approx(0.012, abs=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("label", "true_mm"), [("low_1", 66.0), ("medium_1", 108.0)])
def test_tracking_the_virtual_laboratory_finds_its_setting(made_tuning, label, true_mm):
    """Another model than the one that walks made these plates: within half the distance of the
    device's settings."""
    assert solve(made_tuning(label, cost="tracking", sweep_mm=20.0)).fulcrum_mm == pytest.approx(
        true_mm, abs=10.5
    )


@pytest.mark.slow
def test_a_softer_foot_stores_less_under_the_same_motion_and_more_under_the_same_load(made_tuning):
    """A spring pressed as far stores k x^2 / 2, one that bears the same F^2 / 2 k."""
    rows = {
        row.name: row
        for row in tuning_table(solve(made_tuning(same_load=True, sweep_mm=20.0))).outcomes
    }
    for name in ("stored_energy", "push_off_work"):
        assert rows[name].softest < rows[name].recorded < rows[name].stiffest
        same = rows[f"{name}_same_load"]
        assert same.softest > same.recorded > same.stiffest
    assert rows["force_change"].recorded == pytest.approx(0.0, abs=1e-12)
    assert all(row.softest is not None for row in rows.values())


@pytest.mark.slow
def test_optimum_is_that_of_a_sweep_in_millimetres(made_tuning):
    """Of all costs together, within 1 mm and 0.5 % of the cost's size, confirmed by other
    solvers."""
    ended = solve(
        made_tuning(
            cost="weighted",
            weights=dict.fromkeys(COSTS, 1.0),
            step_s=1e-3,
            confirm=("ipopt", "nlopt"),
        )
    )
    checks = {check.name: check for check in ended.checks}
    assert ended.success, ended.message
    size = ended.tuning.combination.size
    i = int(np.argmin(ended.sweep.cost))
    assert abs(ended.fulcrum_mm - ended.sweep.fulcrum_mm[i]) <= 1.0
    assert ended.cost <= ended.sweep.cost[i] + 1e-9 * size
    # Between two positions a parabola falls by at most a quarter of what it rises to the next.
    between = ended.sweep.cost[[max(i - 1, 0), min(i + 1, 85)]].max() - ended.sweep.cost[i]
    assert ended.cost >= ended.sweep.cost[i] - 0.25 * between - 1e-9 * size
    for name in (
        "brute_force_position",
        "brute_force_cost",
        "solver_ipopt",
        "solver_nlopt",
        "gradient",
        "step",
        "smoothing",
        "smoothing_shift",
        "convergence",
        "recorded_force",
        "force_change",
    ):
        assert checks[name].met, checks[name]


# What a tuning leaves, complete or broken off.


def test_an_optimum_is_below_its_neighbours_and_the_sweep_and_within_its_interval(solution):
    assert solution.success, solution.message
    tuning, best = solution.tuning, solution.fulcrum_mm
    beside = [
        tuning.evaluate(np.array([best + side]), derivatives=False).cost for side in (-0.5, 0.5)
    ]
    assert solution.cost < min(beside) and solution.cost <= solution.sweep.cost.min() + 1e-12
    (low, high), drawn = solution.worth.interval_mm, [draw.lowest()[0] for draw in solution.draws]
    assert len(drawn) == 1 and low <= min(best, *drawn) and max(best, *drawn) <= high


def test_table_and_arrays_are_of_the_solution(solution):
    table, arrays = tuning_table(solution), tuning_arrays(solution)
    assert table.optimal and table.fulcrum_mm == solution.fulcrum_mm
    assert sum(term.value for term in table.terms) == pytest.approx(table.cost)
    for row in table.sweep:
        assert sum(row.terms.values()) == pytest.approx(row.cost)
    assert arrays["sweep_cost_trials"].shape == (len(arrays["sweep_mm"]), 2)
    assert arrays["sweep_cost_trials"].mean(axis=1) == pytest.approx(solution.sweep.cost)
    for name in ("softest", "optimum", "stiffest", "recorded"):
        assert arrays[f"grf_{name}"].shape == (len(arrays["grf_time"]), 3)
        assert np.isfinite(arrays[f"trial_1_{name}"]).all()


def test_more_weight_never_makes_a_cost_worse(solution):
    """The weight is that of the first cost: from 0 to 1 it falls and the second rises."""
    assert [row.weight for row in solution.pareto] == pytest.approx(np.linspace(0.0, 1.0, 11))
    first, second = (
        [getattr(row, name) for row in solution.pareto] for name in ("first", "second")
    )
    assert np.all(np.diff(first) <= 1e-4 * abs(first[0]))
    assert np.all(np.diff(second) >= -1e-3 * abs(second[0]))


@pytest.mark.slow
def test_the_numbers_repeat(made_tuning):
    tuning = {
        "draws": 1,
        "design": ("alignment",),
        "sweep_mm": 20.0,
        "bounds_mm": (95.0, 120.0),
        "more_starts": 1,
    }
    one, other = (
        dataclasses.replace(tuning_table(solve(made_tuning("medium_1", **tuning))), wall_s=0.0)
        for _ in range(2)
    )
    assert one == other


def test_solvers_end_at_the_same_point_unless_they_may_not_iterate(made_tuning):
    tuning = made_tuning()
    ends = [
        search(tuning, np.array([80.0]), solver=name, step_s=2e-3)
        for name in ("snopt", "ipopt", "nlopt")
    ]
    assert all(end.success for end in ends)
    assert np.ptp([end.x[0] for end in ends]) < 0.1
    assert np.ptp([end.cost for end in ends]) < 1e-3 * tuning.combination.size
    assert not search(made_tuning(iterations=1, **QUICK), np.array([140.0]), step_s=2e-3).success


def test_an_interrupt_keeps_the_best_point_and_says_that_it_is_none(made_tuning):
    def stop_at(stage):
        def stop(what, share):
            if what.startswith(stage):
                raise KeyboardInterrupt

        return stop

    near = {"bounds_mm": (100.0, 120.0), **QUICK}
    broken = solve(made_tuning(**near), progress=stop_at("search"))
    assert not broken.success and "interrupted" in broken.message
    for name in ("fulcrum_mm", "cost", "values"):
        with pytest.raises(FitError, match="interrupted"):
            getattr(broken, name)
    table = tuning_table(broken)
    assert not table.optimal and table.notes[0].startswith("NOT OPTIMAL")
    assert table.cost == broken.best.cost and 100.0 <= table.fulcrum_mm <= 120.0
    for stage in ("sweep", "confirming with IPOPT"):
        broken = solve(made_tuning(confirm=("ipopt",), **near), progress=stop_at(stage))
        assert not broken.success and broken.searched.success
        assert (broken.sweep is None) == (stage == "sweep")
        json.dumps(plain(tuning_table(broken)), allow_nan=False)
    with pytest.raises(KeyboardInterrupt):
        solve(made_tuning(**near), progress=stop_at(""))


def test_a_narrow_range_ends_on_its_bound_and_a_warm_start_begins_where_it_is_told(
    made_tuning, solution
):
    ended = solve(
        made_tuning(bounds_mm=(120.0, 140.0), sweep_mm=10.0), warm_start={"fulcrum": 133.0}
    )
    assert ended.searches[-1].start == pytest.approx([133.0])
    assert ended.at_bound == ("fulcrum",) == tuning_table(ended).at_bound
    assert ended.fulcrum_mm == pytest.approx(120.0, abs=1e-6)
    with pytest.raises(InputError, match="does not hold fulcrum, alignment"):
        solve(made_tuning(design=("alignment",)), warm_start=solution.values)


# What a sweep is read for.


def test_where_a_curve_is_lowest():
    where, cost = lowest(GRID, 2.0 + 3e-4 * (GRID - 101.37) ** 2)
    assert where == pytest.approx(101.37, abs=1e-9) and cost == pytest.approx(2.0, abs=1e-12)
    assert lowest(GRID, -GRID) == (151.0, -151.0)
    assert np.isnan(lowest(GRID, np.full(86, np.nan))).all()
    assert local_minima(np.array([1.0, 2.0, 0.5, 3.0, np.nan, 0.7])) == [2, 5, 0], (
        "lowest first, with the ends"
    )
    tuning = SimpleNamespace(low=np.array([66.0]), high=np.array([151.0]))
    grid, rest = positions(tuning, np.array([80.0, 0.02]), 4.0).T
    assert (grid[0], grid[-1], set(rest)) == (66.0, 151.0, {0.02}) and np.diff(grid).max() <= 4.0


def test_differences_are_paired_within_repetitions():
    """Two motions, two trials each: the level of a trial does not count, nor what the motions
    differ by."""
    ramp = np.linspace(0.0, 1.0, 86)
    each = np.array([5.0 + 1.9 * ramp, 9.0 + 2.1 * ramp, 1.0 - 3.8 * ramp, 2.0 - 4.2 * ramp])
    paired = difference(each, [66.0, 66.0, 151.0, 151.0])
    assert paired.range == pytest.approx(3.0)
    assert paired.spread == pytest.approx(np.sqrt((2 * 0.1**2 + 2 * 0.2**2) / 2.0))
    assert paired.matters(0.04) is True
    assert difference(each[:1], [66.0]).spread is None
    assert difference(each[:1], [66.0]).matters(0.04) is None
    assert difference(each[:1] * 1e-3, [66.0]).matters(0.04) is False


def test_settings_within_a_percent_or_that_repeated_trials_cannot_tell_apart_are_as_good():
    """Three trials whose optima are 8 mm apart: the paired test allows more than 1 % does."""
    half_mm = np.sqrt(0.02 / 1.9e-4)
    for grid in (GRID, GRID[::5]):  # no narrower than it is, and wider by no more than the spacing
        low, high = flat_range(
            grid, 2.0 + 1.9e-4 * (grid - 100.0)[None, :] ** 2, [66.0], 100.0, 2.0
        )
        spacing_mm = grid[1] - grid[0]
        assert 100.0 - half_mm - spacing_mm <= low <= 100.0 - half_mm
        assert 100.0 + half_mm <= high <= 100.0 + half_mm + spacing_mm
    each = np.array([2.0 + 2e-3 * (GRID - at) ** 2 for at in (92.0, 100.0, 108.0)])
    narrow = flat_range(GRID, each[1:2], [66.0], 100.0, 2.0)
    low, high = flat_range(GRID, each, [66.0] * 3, 100.0, 2.0)
    assert low < narrow[0] and narrow[1] < high
    error = 2.0 * 2e-3 * 8.0 * np.abs(GRID - 100.0) / np.sqrt(3.0)
    wanted = 2e-3 * (GRID - 100.0) ** 2 <= np.maximum(0.02, 4.302652729911275 * error)
    assert (low, high) == (66.0, GRID[wanted][-1] + 1.0), (
        "a position farther than what cannot be told apart"
    )


@pytest.mark.parametrize(
    ("curvature", "matters", "words"),
    [(1e-6, False, "hardly matters"), (2e-3, True, "from 88 to 128 mm, the cost varies by 78.4%")],
)
def test_a_setting_matters_if_its_range_is_more_than_a_percent_and_than_trials_differ(
    curvature, matters, words
):
    """With a change of force of 0.49 % of body weight a millimetre from 108 mm, of which 10 % are
    allowed."""
    each = 2.0 + curvature * (GRID - 100.0)[None, :] ** 2 + np.array([[0.0], [0.3], [0.5]])
    force = np.tile((0.0049 * (GRID - 108.0)) ** 2, (3, 1))
    worth = fulcrum_uncertainty(
        SettingSweep(x=GRID[:, None], costs={"consistency": force}, terms={"only": each}),
        100.0,
        (),
        [66.0] * 3,
        size=2.0,
        unit="J/kg",
        allowed_bw=0.1,
        gain=0.06,
    )
    assert worth.matters is matters
    assert difference(each, [66.0] * 3).range == pytest.approx(curvature * 51.0**2)
    assert matters or worth.interval_mm == (66.0, 151.0)
    assert words in worth.sentence
