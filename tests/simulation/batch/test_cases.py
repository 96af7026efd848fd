"""Members of a sweep: sampled values, and one that cannot be walked is one refused outcome that
names the field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.batch import (
    DEFAULT_KEEP,
    WalkCase,
    grid_values,
    sample_values,
    simulate_batch,
)
from vsf_drake.simulation.batch.cases import BLOCK, BLOCK_STEPS, Planner, blocks
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.variables import Variable


def fails(_):
    raise ZeroDivisionError("mine")


UNUSABLE = {
    "complex": ({"fulcrum_m": 0.1 + 0j}, "fulcrum_m"),
    "raising": ({"fulcrum_m": fails}, "fulcrum_m: the function raises ZeroDivisionError: mine"),
    "no values": ({"values": None}, "values: None is no mapping"),
    "value beyond printing": ({"values": {"offset.height": 10**5000}}, "values['offset.height']"),
    "offsets a word": ({"offsets": "x"}, "offsets: 'x'"),
    "offset a word": ({"offsets": GeometricOffsets(height_m="x")}, "offsets.height_m"),
    "no free": ({"free": None}, "free: None is no sequence of names"),
    "free a word": (
        {"free": "pelvis_ty"},
        "free: 'pelvis_ty' is one name, not a sequence of names. Give (",
    ),
    "step a word": ({"step_s": "short"}, "step_s"),
}


@pytest.mark.parametrize("held", UNUSABLE)
def test_a_member_that_holds_what_cannot_be_walked_is_refused_by_the_fields_name(
    trial, walks, held
):
    fields, word = UNUSABLE[held]
    [outcome] = simulate_batch([WalkCase(trial=trial, label="odd", **fields)], workers=1)
    assert not outcome.ok and not walks
    assert word in outcome.failure and "odd" in outcome.failure and trial.name in outcome.failure
    assert len(outcome.failure) < 500


def test_what_is_no_trial_is_refused_before_anything_runs(sweep, walks):
    with pytest.raises(InputError, match="member 1 is a str, no Trial"):
        simulate_batch([*sweep(1), WalkCase(trial="walk")], workers=1)
    assert not walks


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_blocks_hold_one_person_each_and_leave_no_worker_without_work(trial, sweep, workers):
    """Full lanes as long as there are walks for them; the last blocks are small, so that nobody
    waits long for the last worker."""
    heavier = replace(trial, subject=replace(trial.subject, mass_kg=90.0))
    longer = replace(trial, end_s=trial.end_s + 0.05)
    planner = Planner(DEFAULT_KEEP)
    cases = [WalkCase(trial=heavier), *sweep(90), WalkCase(trial=longer), WalkCase(trial=heavier)]
    tasks = [planner.task(case) for case in cases]
    made = [*blocks(tasks, workers)]
    assert sorted(task.key for block in made for task in block) == sorted(t.key for t in tasks)
    assert all(len({task.person_key for task in block}) == 1 for block in made)
    assert len(made) >= workers and max(map(len, made)) <= BLOCK
    assert all([t.steps for t in block] == sorted(t.steps for t in block) for block in made)
    whole = [len(block) for block in made if len(block) >= WIDTH]
    assert whole and sum(whole) >= 93 - 2 * workers * WIDTH
    if workers > 1:
        assert len(made[-1]) <= WIDTH


def test_long_walks_go_in_small_blocks(trial):
    """Minutes of walking: an interruption shall not cost an hour."""
    planner = Planner(DEFAULT_KEEP)
    slow = [planner.task(WalkCase(trial=trial, fulcrum_m=0.08 + 1e-4 * i)) for i in range(40)]
    long = [replace(task, steps=BLOCK_STEPS) for task in slow]
    assert [len(block) for block in blocks(long, 1)] == [WIDTH] * 5


VARIABLES = {
    "stiffness": Variable("stiffness", "N/m", 1e4, 1e3, 1e5, 1.0, ParameterTangent()),
    "height": Variable("height", "m", 0.0, -0.02, 0.06, -1.0, ParameterTangent(), added=True),
}


def test_grid_holds_every_combination_with_the_last_axis_fastest():
    assert grid_values({"a": [1, 2], "b": [3, 4]}) == [
        {"a": 1, "b": 3},
        {"a": 1, "b": 4},
        {"a": 2, "b": 3},
        {"a": 2, "b": 4},
    ]


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_each_slice_of_each_range_is_met_once(count):
    found = sample_values(VARIABLES, ["stiffness", "height"], count, seed=3)
    share = {
        "stiffness": np.log([v["stiffness"] / 1e3 for v in found]) / np.log(100.0),
        "height": (np.array([v["height"] for v in found]) + 0.02) / 0.08,
    }
    for values in share.values():
        assert sorted(np.floor(count * values)) == list(range(count))


def test_the_seed_decides_and_variables_are_independent():
    first, again, other = (
        sample_values(VARIABLES, list(VARIABLES), 500, seed=s) for s in (1, 1, 2)
    )
    assert first == again != other
    columns = np.array([list(v.values()) for v in first])
    assert abs(np.corrcoef(np.log(columns[:, 0]), columns[:, 1])[0, 1]) < 4 / np.sqrt(500)


@pytest.mark.parametrize(
    ("names", "count", "seed", "word"),
    [
        (["weight"], 3, 0, "no variable 'weight'"),
        (["height", "height"], 3, 0, "stands twice"),
        (["height"], 0, 0, "none"),
        ([], 3, 0, "none"),
        (["height"], 3.5, 0, "count: 3.5"),
        (["height"], "3", 0, "count"),
        (["height"], 3, -1, "seed: -1"),
        (["height"], 3, 0.5, "seed: 0.5"),
        ("height", 3, 0, "no list of names"),
        ([["height"]], 3, 0, "no variable"),
    ],
)
def test_values_that_cannot_be_sampled_are_refused(names, count, seed, word):
    with pytest.raises(InputError, match=word):
        sample_values(VARIABLES, names, count, seed=seed)
