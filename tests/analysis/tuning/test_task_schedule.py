"""A schedule of tasks against parabolas whose best settings are known, and its lookup against straight lines."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsf_drake.analysis.tuning.schedule import (
    DESCRIPTORS,
    GRID_MM,
    load_schedule,
    make_schedule,
    on_carriage,
    policy_table,
    schedule_of,
)
from vsf_drake.errors import FitError, InputError

REACH = (66.0, 151.0)
SPEEDS, BEST = (0.8, 1.2, 1.6), (75.0, 105.0, 125.0)


def tuned(best: float, *, weight: float = 1.0, cost: float = 2.0, optimal: bool = True, matters: bool | None = True,
          interval: tuple[float, float] | None = None):
    """The table of a tuning whose cost is `cost` + `weight` 1e-4 (mm - best)²."""
    def parabola(mm: float) -> float:
        return cost + weight * 1e-4 * (mm - best) ** 2

    return {"fulcrum_mm": best, "cost": cost, "optimal": optimal, "status": "solved" if optimal else "iterations",
            "sweep": [{"fulcrum_mm": mm, "cost": parabola(mm)} for mm in np.linspace(*REACH, 86).tolist()],
            "outcomes": [{"name": "cost", "matters": matters}], "cost_name": "joint_load",
            "fulcrum_interval_mm": interval or [best - 5.0, best + 5.0]}


def described(**values):
    return dict.fromkeys(DESCRIPTORS) | values


def by_speed(**options):
    return make_schedule([(f"task {speed}", described(speed_m_per_s=speed), tuned(best))
                          for speed, best in zip(SPEEDS, BEST, strict=True)], reach_mm=REACH, **options)


def test_best_for_all_of_equal_parabolas_is_their_mean():
    found = by_speed().common_fulcrum_mm
    assert found == pytest.approx(np.mean(BEST), abs=0.05), "1 mm points and their cubic"
    assert by_speed(resolution_mm=2.0).common_fulcrum_mm == pytest.approx(102.0, abs=1e-9), "66 + 18 · 2 mm"


def test_best_for_all_of_weighted_parabolas_is_their_weighted_mean():
    found = make_schedule([("a", described(), tuned(80.0, weight=3.0)), ("b", described(), tuned(120.0))],
                          reach_mm=REACH).common_fulcrum_mm
    assert found == pytest.approx((3.0 * 80.0 + 120.0) / 4.0, abs=0.05)


def test_costs_of_one_setting_for_all_are_the_parabolas():
    found = by_speed()
    for task, best in zip(found.tasks, BEST, strict=True):
        assert task.cost == pytest.approx(2.0, abs=1e-12), "the optimum is a point of the curve"
        assert task.cost_common == pytest.approx(2.0 + 1e-4 * (found.common_fulcrum_mm - best) ** 2, rel=1e-4)


def test_own_setting_matters_where_the_common_one_is_outside_of_its_interval():
    rows = [("near", described(), tuned(100.0, interval=(90.0, 110.0))), ("far", described(), tuned(110.0)),
            ("flat", described(), tuned(90.0, matters=False)), ("unknown", described(), tuned(90.0, matters=None))]
    found = make_schedule(rows, reach_mm=REACH)
    assert found.common_fulcrum_mm == pytest.approx(97.5, abs=0.05)
    assert [task.matters for task in found.tasks] == [False, True, False, None]


@pytest.mark.parametrize(("speed", "expected"), [(0.8, 75.0), (1.0, 90.0), (1.2, 105.0), (1.3, 110.0), (1.6, 125.0),
                                                 (0.1, 75.0), (3.0, 125.0)])
def test_lookup_is_linear_between_tasks_and_clamped_outside(speed, expected):
    assert by_speed().lookup(speed=speed) == pytest.approx(expected, abs=1e-9)


@given(st.floats(0.0, 3.0), st.floats(0.1, 20.0))
def test_lookup_stays_within_the_reach_and_on_a_step_of_the_carriage(speed, step):
    at = by_speed(resolution_mm=step).lookup(speed=speed)
    steps = (at - REACH[0]) / step
    assert REACH[0] <= at <= REACH[1] + 1e-9
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert abs(at - by_speed().lookup(speed=speed)) <= max(step, REACH[1] - REACH[0] - step * int(85.0 / step)) + 1e-9


def test_stored_settings_are_rounded_and_the_lookup_rounds_once():
    """Steps of 4 mm from 66: 75, 105, 125 mm become 74, 106, 126. A third of the way from 105 to 125 is 111.6 mm, which
    becomes 110; between the stored settings it would be 112.6, which becomes 114."""
    found = by_speed(resolution_mm=4.0)
    assert [task.fulcrum_mm for task in found.tasks] == [74.0, 106.0, 126.0]
    assert [task.exact_mm for task in found.tasks] == [*BEST]
    assert found.lookup(speed=1.2 + 0.33 * 0.4) == 110.0


def test_on_a_grid_of_two_descriptors_the_lookup_is_bilinear():
    def plane(speed, slope):
        return 70.0 + 20.0 * speed + 1.5 * slope

    rows = [(f"{speed} {slope}", described(speed_m_per_s=speed, slope_deg=slope, carried_kg=0.0),
             tuned(plane(speed, slope))) for speed, slope in itertools.product((0.8, 1.6), (-5.0, 5.0))]
    found = make_schedule(rows, reach_mm=REACH)
    assert found.lookup(speed=1.1, slope=2.0) == pytest.approx(plane(1.1, 2.0))
    assert found.lookup(speed=9.0, slope=-90.0) == pytest.approx(plane(1.6, -5.0)), "clamped in both"
    assert found.lookup(speed=1.1, slope=2.0, carried=30.0) == pytest.approx(plane(1.1, 2.0)), "one load in all tasks"
    with pytest.raises(InputError, match="slope_deg: is missing: the tasks differ in it"):
        found.lookup(speed=1.1)
    with pytest.raises(InputError, match=r"no full grid: there is none at speed_m_per_s 1\.6, slope_deg 5"):
        make_schedule(rows[:3], reach_mm=REACH).lookup(speed=1.1, slope=2.0)


def test_lookup_refuses_what_it_cannot_know():
    plain = make_schedule([("a", described(), tuned(80.0)), ("b", described(), tuned(120.0))], reach_mm=REACH)
    with pytest.raises(InputError, match="told apart by nothing"):
        plain.lookup()
    with pytest.raises(InputError, match="speed_m_per_s: no task of this schedule says its own"):
        plain.lookup(speed=1.0)
    with pytest.raises(InputError, match="nan is no value"):
        by_speed().lookup(speed=float("nan"))
    half = make_schedule([("a", described(speed_m_per_s=1.0), tuned(80.0)), ("b", described(), tuned(120.0))],
                         reach_mm=REACH)
    with pytest.raises(InputError, match="some tasks say it and others do not"):
        half.lookup(speed=1.0)
    twice = make_schedule([(str(i), described(speed_m_per_s=speed), tuned(80.0)) for i, speed in
                           enumerate((1.0, 1.0, 2.0))], reach_mm=REACH)
    with pytest.raises(InputError, match="two tasks have the same descriptors"):
        twice.lookup(speed=1.0)


def test_a_schedule_with_a_task_that_failed_is_not_looked_up():
    rows = [("good", described(speed_m_per_s=1.0), tuned(80.0)),
            ("bad", described(speed_m_per_s=2.0), tuned(90.0, optimal=False))]
    found = make_schedule(rows, reach_mm=REACH)
    assert not found.optimal
    with pytest.raises(FitError, match="not optimal: bad: iterations"):
        found.lookup(speed=1.0)


def test_a_task_without_any_result_leaves_no_common_setting():
    nothing = tuned(90.0, optimal=False) | {"fulcrum_mm": None, "cost": None, "sweep": []}
    found = make_schedule([("good", described(), tuned(80.0)), ("none", described(), nothing)], reach_mm=REACH)
    assert found.common_fulcrum_mm is None
    assert (found.tasks[1].fulcrum_mm, found.tasks[1].cost, found.tasks[0].cost_common) == (None, None, None)


def test_carriage_stops_at_its_ends():
    assert on_carriage(60.0, REACH, None) == 66.0
    assert on_carriage(160.0, REACH, None) == 151.0
    assert on_carriage(151.0, REACH, 10.0) == 146.0, "the last whole step within its reach"
    assert on_carriage(70.9, REACH, 10.0) == 66.0
    assert abs(on_carriage(100.004, REACH, GRID_MM) - 100.0) < 1e-9


@pytest.mark.parametrize("step", [0.0, -1.0, 86.0, float("nan")])
def test_a_resolution_in_which_the_carriage_cannot_move_is_refused(step):
    with pytest.raises(InputError, match="is no resolution"):
        by_speed(resolution_mm=step)


def test_policy_goes_to_a_file_and_back(tmp_path):
    found = by_speed(resolution_mm=0.5)
    table = policy_table(found)
    assert schedule_of(json.loads(json.dumps(table))) == found
    path = tmp_path / "policy.json"
    path.write_text(json.dumps(table), encoding="utf-8")
    assert load_schedule(path).lookup(speed=1.0) == found.lookup(speed=1.0) == pytest.approx(90.0)


@pytest.mark.parametrize(("text", "words"), [("{", "cannot be read as JSON"), ("[]", "no table"),
                                             ('{"format": "x"}', "no policy table"),
                                             ('{"format": "vsf_drake schedule 1"}', "KeyError")])
def test_a_damaged_policy_is_refused_with_its_file(tmp_path, text, words):
    path = tmp_path / "policy.json"
    with pytest.raises(InputError, match="there is no such file"):
        load_schedule(path)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words) as raised:
        load_schedule(path)
    assert str(path) in str(raised.value)
