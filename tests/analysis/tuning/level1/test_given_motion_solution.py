"""What a tuning leaves, complete or broken off."""

import json

import numpy as np
import pytest

from vsf_drake.analysis.tuning.common import KEYS, check_tuning_table
from vsf_drake.analysis.tuning.level1 import solve, tuning_arrays, tuning_table
from vsf_drake.analysis.tuning.level1.solve import search
from vsf_drake.errors import FitError, InputError

QUICK = {"sweep_mm": 5.0}


@pytest.fixture(scope="module")
def solution(made_tuning):
    return solve(made_tuning("medium_1", "medium_2", "high_1", tasks=["medium", "medium", "high"], draws=2,
                             sweep_mm=10.0))


def test_an_optimum_is_below_its_neighbours_and_the_sweep(solution):
    assert solution.success, solution.message
    tuning, best = solution.tuning, solution.fulcrum_mm
    beside = [tuning.evaluate(np.array([best + side]), derivatives=False).cost for side in (-0.5, 0.5)]
    assert solution.cost < min(beside)
    assert solution.cost <= solution.sweep.cost.min() + 1e-12


def test_the_table_has_every_key_and_is_plain_json(solution):
    table = tuning_table(solution)
    check_tuning_table(table)
    assert set(KEYS) <= set(table)
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    assert table["fulcrum_mm"] == solution.fulcrum_mm
    assert table["optimal"] is True
    assert sum(term["value"] for term in table["terms"]) == pytest.approx(table["cost"])
    for row in table["sweep"]:
        assert sum(row["terms"].values()) == pytest.approx(row["cost"])


def test_the_arrays_are_the_sweep_of_each_trial_and_its_forces(solution):
    arrays = tuning_arrays(solution)
    assert arrays["sweep_cost_trials"].shape == (len(arrays["sweep_mm"]), 3)
    assert arrays["sweep_cost_trials"].mean(axis=1) == pytest.approx(solution.sweep.cost)
    for name in ("softest", "optimum", "stiffest", "recorded"):
        assert arrays[f"grf_{name}"].shape == (len(arrays["grf_time"]), 3)
        assert np.isfinite(arrays[f"trial_2_{name}"]).all()


def test_one_setting_for_all_costs_each_task_at_least_its_own(solution):
    medium, high = solution.tasks
    assert (medium["label"], high["label"]) == ("medium", "high")
    assert medium["fulcrum_mm"] < solution.fulcrum_mm < high["fulcrum_mm"]
    for task in solution.tasks:
        assert task["cost_common"] >= task["cost"]
    together = (2.0 * medium["cost_common"] + high["cost_common"]) / 3.0
    assert together == pytest.approx(solution.cost, rel=0.01)


def test_more_weight_of_a_cost_never_makes_it_worse(solution):
    first, second = ([row[name] for row in solution.pareto] for name in ("first", "second"))
    assert np.all(np.diff(first) <= 1e-4 * abs(first[0]))
    assert np.all(np.diff(second) >= -1e-3 * abs(second[0]))


def test_the_interval_holds_the_optimum_and_the_draws(solution):
    (low, high), drawn = solution.interval_mm, [draw.lowest()[0] for draw in solution.draws]
    assert low <= solution.fulcrum_mm <= high
    assert len(drawn) == 2
    assert low <= min(drawn) and max(drawn) <= high


@pytest.mark.slow
def test_the_numbers_repeat(made_tuning):
    tuning = {"draws": 1, "design": ("alignment",), "sweep_mm": 20.0}
    found = [tuning_table(solve(made_tuning("medium_1", **tuning))) for _ in range(2)]
    for table in found:
        del table["wall_s"]
    assert found[0] == found[1]


def test_solvers_end_at_the_same_point(made_tuning):
    tuning = made_tuning()
    ends = [search(tuning, np.array([80.0]), solver=name, step_s=2e-3) for name in ("snopt", "ipopt", "nlopt")]
    assert all(end.success for end in ends)
    assert np.ptp([end.x[0] for end in ends]) < 0.1
    assert np.ptp([end.cost for end in ends]) < 1e-3 * tuning.combination.size


def test_an_interrupt_keeps_the_best_point_and_says_that_it_is_none(made_tuning):
    def stop(progress):
        if progress.stage.startswith("search") and progress.evaluations > 3:
            raise KeyboardInterrupt

    broken = solve(made_tuning(), progress=stop)
    assert not broken.success
    assert "interrupted" in broken.message
    for name in ("fulcrum_mm", "cost", "values"):
        with pytest.raises(FitError, match="interrupted"):
            getattr(broken, name)
    table = tuning_table(broken)
    check_tuning_table(table)
    assert table["optimal"] is False
    assert table["notes"][0].startswith("NOT OPTIMAL")
    assert table["cost"] == broken.best.cost
    assert 66.0 <= table["fulcrum_mm"] <= 151.0
    json.dumps(table, allow_nan=False)


@pytest.mark.parametrize("stage", ["sweep", "checks"])
def test_an_interrupt_late_keeps_what_was_found(made_tuning, stage):
    def stop(progress):
        if progress.stage == stage or (stage == "checks" and progress.stage == "confirming with IPOPT"):
            raise KeyboardInterrupt

    broken = solve(made_tuning(confirm=("ipopt",), **QUICK), progress=stop)
    assert not broken.success
    assert broken.searched.success
    assert (broken.sweep is None) == (stage == "sweep")
    json.dumps(tuning_table(broken), allow_nan=False)


def test_an_interrupt_before_anything_was_found_is_passed_on(made_tuning):
    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(made_tuning(), progress=stop)


def test_a_search_that_may_not_iterate_is_no_optimum(made_tuning):
    tuning = made_tuning(iterations=1, **QUICK)
    ended = search(tuning, np.array([140.0]), step_s=2e-3)
    assert not ended.success


@pytest.mark.slow
def test_a_warm_start_begins_where_the_last_tuning_ended(made_tuning, solution):
    tuning = made_tuning("medium_1", "medium_2", "high_1", **QUICK)
    again = solve(tuning, warm_start=tuning_table(solution))
    assert again.searches[-1].start == pytest.approx(solution.best.x)
    assert again.fulcrum_mm == pytest.approx(solution.fulcrum_mm, abs=0.05)
    with pytest.raises(InputError, match="does not hold"):
        solve(made_tuning(design=("alignment",)), warm_start=tuning_table(solution))


def test_a_narrow_range_ends_on_its_bound_and_says_so(made_tuning):
    found = solve(made_tuning(bounds_mm=(120.0, 140.0), sweep_mm=10.0))
    assert found.at_bound == ("fulcrum",)
    assert tuning_table(found)["at_bound"] == ["fulcrum"]
    assert found.fulcrum_mm == pytest.approx(120.0, abs=1e-6)
