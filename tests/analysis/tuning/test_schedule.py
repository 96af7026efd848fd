"""Tasks as a user names them; their schedule against parabolas whose best settings are known."""

from __future__ import annotations

import dataclasses
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_tuning import BEST, REACH, made_schedule, parabola, task

from vsf_drake.analysis.tuning.schedule import (
    DESCRIPTORS,
    GRID_MM,
    load_schedule,
    make_schedule,
    on_carriage,
    read_tasks,
)
from vsf_drake.errors import FitError, InputError
from vsf_drake.files import plain

NONE = dict.fromkeys(DESCRIPTORS)


def written(folder, text):
    path = folder / "tasks.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_words_and_files_name_tasks_their_trials_and_descriptors(tmp_path):
    slow, fast = read_tasks(["slow=a/low_1.yaml", "fast=x=1.yaml", "slow=a/low_2.yaml"])
    assert (slow.label, slow.manifests) == ("slow", (Path("a/low_1.yaml"), Path("a/low_2.yaml")))
    assert slow.descriptors == NONE
    assert (fast.label, fast.manifests) == ("fast", (Path("x=1.yaml"),)), "cut at the first ="
    path = written(
        tmp_path,
        "tasks:\n- {label: slow, trials: [low_1.yaml], speed_m_per_s: 0.8}\n"
        "- {label: up, trials: [x/up.yaml], speed_m_per_s: 1, slope_deg: 5, carried_kg: 0}\n",
    )
    slow, up = read_tasks([path])
    assert slow.manifests == (tmp_path / "low_1.yaml",) and up.manifests == (
        tmp_path / "x/up.yaml",
    )
    assert slow.descriptors == NONE | {"speed_m_per_s": 0.8}
    assert up.descriptors == {"speed_m_per_s": 1.0, "slope_deg": 5.0, "carried_kg": 0.0}
    with pytest.raises(InputError, match="'slow' is described in two ways"):
        read_tasks([path, "slow=z.yaml"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a=x.yaml"], "1 task make no schedule"),
        ([], "0 tasks make no schedule"),
        (["=x.yaml", "b=y.yaml"], "is no task"),
        (["a=", "b=y.yaml"], "is no task"),
        (["a=x.yaml", "b=x.yaml"], "x.yaml: a and b: is named twice"),
        (["a=x.yaml", "a=./x.yaml", "b=y.yaml"], "named twice"),
        (["none.yaml"], "none.yaml: there is no such file"),
        ("tasks: [{label: '', trials: [x.yaml]}]", "is empty"),
        ("tasks: [{label: a, trials: []}]", "names no trial"),
        (
            "tasks: [{label: a, trials: [x.yaml]}, {label: a, trials: [y.yaml]}]",
            "has two tasks 'a'",
        ),
    ],
)
def test_what_is_no_list_of_tasks_is_refused(tmp_path, words, said):
    with pytest.raises(InputError, match=said.replace(".", r"\.")):
        read_tasks([written(tmp_path, words)] if isinstance(words, str) else words)


def test_best_for_all_of_parabolas_is_their_mean_by_weight():
    schedule = made_schedule(resolution_mm=None)
    assert schedule.common_fulcrum_mm == pytest.approx(np.mean(BEST), abs=0.05), (
        "1 mm points and their cubic"
    )
    assert made_schedule(resolution_mm=2.0).common_fulcrum_mm == pytest.approx(102.0, abs=1e-9), (
        "66 + 18 · 2 mm"
    )
    for row, best in zip(schedule.tasks, BEST, strict=True):
        assert row.cost == pytest.approx(2.0, abs=1e-12), "the optimum is a point of the curve"
        assert row.cost_common == pytest.approx(
            2.0 + 1e-4 * (schedule.common_fulcrum_mm - best) ** 2, rel=1e-4
        )
    weighted = make_schedule(
        [(task("a"), parabola(80.0, weight=3.0)), (task("b"), parabola(120.0))], reach_mm=REACH
    )
    assert weighted.common_fulcrum_mm == pytest.approx((3.0 * 80.0 + 120.0) / 4.0, abs=0.05)


def test_own_setting_matters_where_the_common_one_is_outside_of_its_interval():
    rows = [
        (task("near"), parabola(100.0, interval_mm=(90.0, 110.0))),
        (task("far"), parabola(110.0)),
        (task("flat"), parabola(90.0, matters=False)),
        (task("unknown"), parabola(90.0, matters=None)),
    ]
    schedule = make_schedule(rows, reach_mm=REACH)
    assert schedule.common_fulcrum_mm == pytest.approx(97.5, abs=0.05)
    assert [row.matters for row in schedule.tasks] == [False, True, False, None]


def test_lookup_is_linear_between_tasks_and_clamped_outside():
    schedule = made_schedule(resolution_mm=None)
    for speed, expected in (
        (0.8, 75.0),
        (1.0, 90.0),
        (1.2, 105.0),
        (1.3, 110.0),
        (1.6, 125.0),
        (0.1, 75.0),
        (3.0, 125.0),
    ):
        assert schedule.lookup(speed=speed) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None)
@given(st.floats(0.0, 3.0), st.floats(0.1, 20.0))
def test_lookup_stays_within_the_reach_and_on_a_step_of_the_carriage(speed, step):
    schedule = made_schedule(resolution_mm=None)
    at = dataclasses.replace(schedule, resolution_mm=step).lookup(speed=speed)
    steps = (at - REACH[0]) / step
    assert REACH[0] <= at <= REACH[1] + 1e-9
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert (
        abs(at - schedule.lookup(speed=speed)) <= max(step, 85.0 - step * int(85.0 / step)) + 1e-9
    )


def test_stored_settings_are_rounded_and_the_lookup_rounds_once():
    """Steps of 4 mm from 66: 75, 105, 125 mm become 74, 106, 126. A third of the way from 105 to 125 is 111.6 mm, which
    becomes 110; between the stored settings it would be 112.6, which becomes 114."""
    schedule = made_schedule(resolution_mm=4.0)
    assert [row.fulcrum_mm for row in schedule.tasks] == [74.0, 106.0, 126.0]
    assert [row.exact_mm for row in schedule.tasks] == [*BEST]
    assert schedule.lookup(speed=1.2 + 0.33 * 0.4) == 110.0


def test_on_a_grid_of_two_descriptors_the_lookup_is_bilinear():
    def plane(speed, slope):
        return 70.0 + 20.0 * speed + 1.5 * slope

    rows = [
        (
            task(f"{speed} {slope}", speed_m_per_s=speed, slope_deg=slope, carried_kg=0.0),
            parabola(plane(speed, slope)),
        )
        for speed, slope in itertools.product((0.8, 1.6), (-5.0, 5.0))
    ]
    schedule = make_schedule(rows, reach_mm=REACH)
    assert schedule.lookup(speed=1.1, slope=2.0) == pytest.approx(plane(1.1, 2.0))
    assert schedule.lookup(speed=9.0, slope=-90.0) == pytest.approx(plane(1.6, -5.0)), (
        "clamped in both"
    )
    assert schedule.lookup(speed=1.1, slope=2.0, carried=30.0) == pytest.approx(plane(1.1, 2.0)), (
        "one load in all"
    )
    with pytest.raises(InputError, match="slope_deg: is missing: the tasks differ in it"):
        schedule.lookup(speed=1.1)
    with pytest.raises(
        InputError, match=r"no full grid: there is none at speed_m_per_s 1\.6, slope_deg 5"
    ):
        make_schedule(rows[:3], reach_mm=REACH).lookup(speed=1.1, slope=2.0)


@pytest.mark.parametrize(
    ("speeds", "asked", "said"),
    [
        ((None, None), {}, "told apart by nothing"),
        ((None, None), {"speed": 1.0}, "speed_m_per_s: no task of this schedule says its own"),
        ((1.0, 2.0), {"speed": float("nan")}, "nan is no value"),
        ((1.0, None), {"speed": 1.0}, "some tasks say it and others do not"),
        ((1.0, 1.0, 2.0), {"speed": 1.0}, "two tasks have the same descriptors"),
    ],
)
def test_lookup_refuses_what_it_cannot_know(speeds, asked, said):
    rows = [
        (task(str(i), **({} if speed is None else {"speed_m_per_s": speed})), parabola(80.0 + i))
        for i, speed in enumerate(speeds)
    ]
    with pytest.raises(InputError, match=said):
        make_schedule(rows, reach_mm=REACH).lookup(**asked)


def test_a_task_that_failed_is_not_looked_up_and_one_without_a_result_leaves_no_common_setting():
    schedule = made_schedule(optimal=False)
    assert not schedule.optimal
    with pytest.raises(FitError, match=r"not optimal: speed 1\.2: the iteration limit was reached"):
        schedule.lookup(speed=1.0)
    nothing = parabola(90.0, optimal=False, fulcrum_mm=None, cost=None, sweep=())
    schedule = make_schedule(
        [(task("good"), parabola(80.0)), (task("none"), nothing)], reach_mm=REACH
    )
    assert schedule.common_fulcrum_mm is None
    assert [(row.fulcrum_mm, row.cost, row.cost_common) for row in schedule.tasks] == [
        (80.0, 2.0, None),
        (None,) * 3,
    ]


def test_carriage_stops_at_its_ends():
    assert on_carriage(60.0, REACH, None) == 66.0
    assert on_carriage(160.0, REACH, None) == 151.0
    assert on_carriage(151.0, REACH, 10.0) == 146.0, "the last whole step within its reach"
    assert on_carriage(70.9, REACH, 10.0) == 66.0
    assert abs(on_carriage(100.004, REACH, GRID_MM) - 100.0) < 1e-9
    for step in (0.0, -1.0, 86.0, float("nan")):
        with pytest.raises(InputError, match="is no resolution"):
            made_schedule(resolution_mm=step)


def test_policy_goes_to_a_file_and_back_and_a_damaged_one_is_refused_with_its_file(tmp_path):
    path = tmp_path / "policy.json"
    with pytest.raises(InputError, match="there is no such file"):
        load_schedule(path)
    path.write_text(json.dumps(plain(made_schedule())), encoding="utf-8")
    assert load_schedule(path) == made_schedule()
    for text, words in (
        ("{", "cannot be read as JSON"),
        ("[]", "no table"),
        ('{"format": "x"}', "no policy table"),
        ('{"format": "vsf_drake schedule 1"}', "schedule 1', not .*schedule 2'.*schedule` again"),
        ('{"format": "vsf_drake schedule 2"}', "optimal is missing"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=words) as raised:
            load_schedule(path)
        assert str(path) in str(raised.value)
