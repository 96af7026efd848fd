"""Optimum against sweep, and what a sweep is read for."""

from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.tuning.level1 import COSTS, WEIGHTED, solve
from vsf_drake.analysis.tuning.level1.sweep import Sweep, local_minima, lowest, positions
from vsf_drake.analysis.tuning.level1.uncertainty import difference, flat_range, fulcrum_uncertainty

GRID = np.linspace(66.0, 151.0, 86)


@pytest.mark.slow
@pytest.mark.parametrize("cost", [*COSTS, WEIGHTED])
def test_optimum_of_each_cost_is_that_of_a_sweep_in_millimetres(made_tuning, cost):
    """Within 1 mm and 0.5 % of the cost's size, confirmed by other solvers, in less than a minute."""
    solution = solve(made_tuning(cost=cost, step_s=1e-3, confirm=("ipopt", "nlopt")))
    checks = {check.name: check for check in solution.checks}
    assert solution.success, solution.message
    size = solution.tuning.combination.size
    i = int(np.argmin(solution.sweep.cost))
    assert abs(solution.fulcrum_mm - solution.sweep.fulcrum_mm[i]) <= 1.0
    assert solution.cost <= solution.sweep.cost[i] + 1e-9 * size
    # Between two positions a parabola falls by at most a quarter of what it rises to the next.
    between = solution.sweep.cost[[max(i - 1, 0), min(i + 1, 85)]].max() - solution.sweep.cost[i]
    assert solution.cost >= solution.sweep.cost[i] - 0.25 * between - 1e-9 * size
    for name in ("brute_force_position", "brute_force_cost", "solver_ipopt", "solver_nlopt", "gradient", "step",
                 "smoothing", "smoothing_shift", "convergence", "recorded_force", "force_change"):
        if name != "force_change" or cost != "tracking":
            assert checks[name].met, checks[name]
    assert solution.wall_s < 60.0


def test_a_parabola_is_lowest_where_it_is():
    where, cost = lowest(GRID, 2.0 + 3e-4 * (GRID - 101.37) ** 2)
    assert where == pytest.approx(101.37, abs=1e-9)
    assert cost == pytest.approx(2.0, abs=1e-12)


def test_a_curve_that_falls_to_its_end_is_lowest_there():
    assert lowest(GRID, -GRID) == (151.0, -151.0)
    assert np.isnan(lowest(GRID, np.full(86, np.nan))).all()


def test_local_minima_come_lowest_first_with_the_ends():
    assert local_minima(np.array([1.0, 2.0, 0.5, 3.0, np.nan, 0.7])) == [2, 5, 0]


def test_a_sweep_holds_both_ends():
    tuning = SimpleNamespace(low=np.array([66.0]), high=np.array([151.0]))
    grid, rest = positions(tuning, np.array([80.0, 0.02]), 4.0).T
    assert (grid[0], grid[-1]) == (66.0, 151.0)
    assert set(rest) == {0.02}
    assert np.diff(grid).max() <= 4.0


def test_differences_are_paired_within_repetitions():
    """Two motions, two trials each: the level of a trial does not count, nor what the motions differ by."""
    ramp = np.linspace(0.0, 1.0, 86)
    each = np.array([5.0 + 1.9 * ramp, 9.0 + 2.1 * ramp, 1.0 - 3.8 * ramp, 2.0 - 4.2 * ramp])
    found = difference(each, [66.0, 66.0, 151.0, 151.0])
    assert found.range == pytest.approx(3.0)
    assert found.spread == pytest.approx(np.sqrt((2 * 0.1**2 + 2 * 0.2**2) / 2.0))
    assert found.matters(4.0) is True
    assert difference(each[:1], [66.0]).spread is None
    assert difference(each[:1], [66.0]).matters(4.0) is None
    assert difference(each[:1] * 1e-3, [66.0]).matters(4.0) is False


def test_settings_within_a_percent_are_as_good():
    each = 2.0 + 1.9e-4 * (GRID - 100.0)[None, :] ** 2
    low, high = flat_range(GRID, each, [66.0], 100.0, 2.0)
    assert (low, high) == (90.0, 110.0)


def test_settings_that_repeated_trials_cannot_tell_apart_are_as_good():
    """Three trials whose optima are 8 mm apart: the paired test allows more than 1 % does."""
    each = np.array([2.0 + 2e-3 * (GRID - at) ** 2 for at in (92.0, 100.0, 108.0)])
    narrow = flat_range(GRID, each[1:2], [66.0], 100.0, 2.0)
    low, high = flat_range(GRID, each, [66.0] * 3, 100.0, 2.0)
    assert low < narrow[0] and narrow[1] < high
    slope = 2.0 * 2e-3 * 8.0
    error = slope * np.abs(GRID - 100.0) / np.sqrt(3.0)
    wanted = 2e-3 * (GRID - 100.0) ** 2 <= np.maximum(0.02, 4.302652729911275 * error)
    assert (low, high) == (GRID[wanted][0], GRID[wanted][-1])


def swept(each, change=0.0):
    """A sweep of these costs (T, m) with a change of force of `change` body weights a millimetre from 108 mm."""
    force = np.tile((change * (GRID - 108.0)) ** 2, (len(each), 1))
    return Sweep(x=GRID[:, None], costs={"consistency": force}, terms={"only": each})


def test_a_setting_that_changes_nothing_is_said_to_hardly_matter():
    each = 2.0 + 1e-6 * (GRID - 100.0)[None, :] ** 2 + np.array([[0.0], [0.3], [0.5]])
    interval_mm, _, worth = fulcrum_uncertainty(swept(each), 100.0, (), [66.0] * 3, size=2.0, unit="J/kg",
                                                allowed_bw=0.1, gain=1e-4)
    assert worth["matters"] is False
    assert interval_mm == [66.0, 151.0]
    assert "hardly matters" in worth["sentence"]
    assert "next to nothing" in worth["sentence"]


def test_a_setting_that_matters_more_than_trials_differ_is_said_to_matter():
    each = 2.0 + 2e-3 * (GRID - 100.0)[None, :] ** 2 + np.array([[0.0], [0.3], [0.5]])
    _, _, worth = fulcrum_uncertainty(swept(each, change=0.0049), 100.0, (), [66.0] * 3, size=2.0, unit="J/kg",
                                      allowed_bw=0.1, gain=0.06)
    assert worth["matters"] is True
    assert difference(each, [66.0] * 3).range == pytest.approx(2e-3 * 51.0**2)
    assert worth["sentence"].startswith("From the best to the worst position the cost changes by 5.2 J/kg, 260% of its")
    assert "from 88 to 128 mm, the cost varies by 78.4%" in worth["sentence"]
    assert "gains 6.0%." in worth["sentence"]
