"""A member that cannot be walked, whatever it holds, is one refused outcome that names the field."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.many import WalkCase, simulate_many


def fails(_):
    raise ZeroDivisionError("mine")


UNUSABLE = {
    "too few": ({"fulcrum_m": lambda t: [0.1, 0.1]}, "fulcrum_m: gives float64 numbers of shape (2,)"),
    "a word": ({"fulcrum_m": lambda t: "here"}, "fulcrum_m"),
    "ragged": ({"fulcrum_m": lambda t: [[0.1], [0.1, 0.2]]}, "fulcrum_m"),
    "a table": ({"fulcrum_m": lambda t: np.full((2, t.size), 0.1)}, "fulcrum_m: gives float64 numbers of shape (2, "),
    "nothing": ({"fulcrum_m": lambda t: None}, "fulcrum_m"),
    "complex function": ({"fulcrum_m": lambda t: 0.1 + 0j * t}, "fulcrum_m"),
    "complex": ({"fulcrum_m": 0.1 + 0j}, "fulcrum_m"),
    "numpy complex": ({"fulcrum_m": np.complex128(0.1)}, "fulcrum_m"),
    "raising": ({"fulcrum_m": fails}, "fulcrum_m: the function raises ZeroDivisionError: mine"),
    "fulcrum too large": ({"fulcrum_m": 10**400}, "fulcrum_m"),
    "no values": ({"values": None}, "values: None is no mapping"),
    "values a word": ({"values": "abc"}, "values: 'abc' is no mapping"),
    "values a list": ({"values": [1.0]}, "values: [1.0] is no mapping"),
    "value too large": ({"values": {"offset.height": 10**400}}, "values['offset.height']"),
    "value beyond printing": ({"values": {"offset.height": 10**5000}}, "values['offset.height']"),
    "offsets a word": ({"offsets": "x"}, "offsets: 'x'"),
    "offset a word": ({"offsets": GeometricOffsets(height_m="x")}, "offsets.height_m"),
    "offset too large": ({"offsets": GeometricOffsets(height_m=10**400)}, "offsets.height_m"),
    "no free": ({"free": None}, "free: None is no sequence of names"),
    "free nested": ({"free": [["x"]]}, "free: [['x']] is no sequence of names"),
    "free a word": ({"free": "pelvis_ty"}, "free: 'pelvis_ty' is one name, not a sequence of names. Give ("),
    "steps too short for a function": ({"step_s": 1e-12, "fulcrum_m": lambda t: 0.1}, "step_s"),
    "steps too short": ({"step_s": 1e-12}, "step_s"),
    "steps of nothing": ({"step_s": 5e-324, "fulcrum_m": lambda t: 0.1}, "step_s"),
    "step a word": ({"step_s": "short"}, "step_s"),
}


@pytest.mark.parametrize("held", UNUSABLE)
def test_a_member_that_holds_what_cannot_be_walked_is_refused_by_the_fields_name(trial, walks, held):
    fields, word = UNUSABLE[held]
    [outcome] = simulate_many([WalkCase(trial=trial, label="odd", **fields)], workers=1)
    assert not outcome.ok and not walks
    assert word in outcome.failure and "odd" in outcome.failure and trial.name in outcome.failure
    assert len(outcome.failure) < 500


def test_members_that_cannot_be_walked_leave_the_others_alone(trial, sweep):
    odd = [WalkCase(trial=trial, **fields) for fields, _ in UNUSABLE.values()]
    outcomes = simulate_many([*odd, *sweep(1)], workers=1)
    assert [outcome.ok for outcome in outcomes] == [False] * len(odd) + [True]


@pytest.mark.parametrize("given", [None, "walk", 3])
def test_what_is_no_trial_is_refused_before_anything_runs(sweep, walks, given):
    with pytest.raises(InputError, match=f"member 1 is a {type(given).__name__}, no Trial"):
        simulate_many([*sweep(1), WalkCase(trial=given)], workers=1)
    assert not walks


def test_a_function_may_return_one_number_a_list_or_an_array(trial):
    outcomes = simulate_many([WalkCase(trial=trial, fulcrum_m=f) for f in (
        lambda t: 0.1, lambda t: [0.1] * len(t), lambda t: np.full(t.shape, 0.1))], keep=["fulcrum_m"], workers=1)
    for outcome in outcomes:
        np.testing.assert_array_equal(outcome.arrays["fulcrum_m"], 0.1)


def test_a_dictionary_that_is_used_again_does_not_change_earlier_members(trial):
    values, cases = {}, []
    for stiffness in (2e4, 4e4):
        values["contact.heel.stiffness"] = stiffness
        cases.append(WalkCase(trial=trial, values=values))
    assert [case.values["contact.heel.stiffness"] for case in cases] == [2e4, 4e4]
    soft, stiff = simulate_many(cases, workers=1)
    assert not np.array_equal(soft.arrays["grf_W"], stiff.arrays["grf_W"])


def test_nobody_can_put_other_arrays_into_an_outcome(sweep):
    [outcome] = simulate_many(sweep(1), workers=1)
    with pytest.raises(TypeError):
        outcome.arrays["grf_W"] = np.zeros(3)
    with pytest.raises(AttributeError):
        outcome.arrays.clear()
