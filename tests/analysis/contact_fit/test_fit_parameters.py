"""Parameters of a fit: bounds, priors, and the coordinates that a search runs in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vsf_drake.analysis.contact_fit.parameters import FitParameter, FitParameters
from vsf_drake.errors import InputError

PLAIN = FitParameter(name="offset.height", unit="m", start=0.002, low=-0.04, high=0.03, mean=0.001, scale=0.01)
LOG = FitParameter(name="contact.heel.force", unit="N", start=150.0, low=25.0, high=1600.0, mean=200.0, scale=0.5,
                   logarithmic=True)
FROZEN = replace(PLAIN, name="friction.mu_static", frozen=True, start=0.02)
EVERY = FitParameters([PLAIN, FROZEN, LOG])


@st.composite
def drawn(draw):
    """Any parameter, and a value within its bounds."""
    logarithmic = draw(st.booleans())
    low = draw(st.floats(1e-6, 1e3) if logarithmic else st.floats(-1e3, 1e3))
    high = low + draw(st.floats(1e-6, 1e3))
    assume(high > low * (1 + 1e-12))
    inside = st.floats(low, high)
    return FitParameter(name="a", unit="m", low=low, high=high, start=draw(inside), mean=draw(inside),
                        scale=draw(st.floats(1e-3, 1e3)), logarithmic=logarithmic), draw(inside)


@given(drawn())
def test_search_coordinate_and_value_are_each_others_inverse(case):
    item, value = case
    assert item.from_u(item.to_u(value)) == pytest.approx(value, rel=1e-9, abs=1e-9 * item.scale)
    assert item.to_u(item.mean) == 0.0


@given(drawn(), st.floats(-1e3, 1e3))
def test_any_search_coordinate_stands_for_a_value_within_the_bounds(case, u):
    item, _ = case
    assume(not item.logarithmic or abs(u) * item.scale < 700.0)
    assert item.low <= item.from_u(u) <= item.high


@pytest.mark.parametrize("item", [PLAIN, LOG], ids=lambda item: item.name)
def test_a_step_of_one_is_a_standard_deviation_of_the_prior(item):
    one = item.from_u(1.0)
    assert (math.log(one / item.mean) if item.logarithmic else one - item.mean) == pytest.approx(item.scale)
    for u in (-0.7, 0.0, 0.4):
        slope = (item.from_u(u + 1e-5) - item.from_u(u - 1e-5)) / 2e-5
        assert item.slope(item.from_u(u)) == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize(("changes", "match"), [
    ({"low": 0.03, "high": -0.04}, "bounds cross"), ({"low": 0.03, "high": 0.03}, "bounds cross"),
    ({"start": 0.05}, "start, 0.05 m, lies outside its bounds -0.04 to 0.03"), ({"mean": -1.0}, "mean, -1 m, lies"),
    ({"scale": 0.0}, "scale is 0"), ({"scale": -0.1}, "scale is -0.1"), ({"start": math.nan}, "start is nan"),
    ({"high": math.inf}, "high is inf"), ({"low": True}, "low is True"), ({"mean": "0"}, "mean is '0'"),
    ({"mean": None}, "mean is None")])
def test_what_makes_no_parameter_is_refused_by_name(changes, match):
    with pytest.raises(InputError, match=match) as caught:
        replace(PLAIN, **changes)
    assert caught.value.where == "parameter offset.height"


@pytest.mark.parametrize("low", [0.0, -1.0])
def test_a_logarithmic_parameter_has_a_positive_lower_bound(low):
    with pytest.raises(InputError, match="lower bound is"):
        replace(LOG, low=low)


def test_a_set_holds_each_name_once_and_something_free():
    with pytest.raises(InputError, match=r"offset.height stands twice"):
        FitParameters([PLAIN, LOG, replace(PLAIN, start=0.0)])
    for nothing_free in ([], [FROZEN]):
        with pytest.raises(InputError, match="all parameters are frozen"):
            FitParameters(nothing_free)
    with pytest.raises(InputError, match="all parameters are frozen"):
        EVERY.changed([PLAIN.name, LOG.name], frozen=True)


def test_frozen_parameters_stay_at_their_start_and_have_no_coordinate():
    assert EVERY.names == (PLAIN.name, LOG.name)
    assert len(EVERY) == 2
    u = np.array([0.3, -0.2])
    values = EVERY.values(u)
    assert values == {PLAIN.name: pytest.approx(0.004), FROZEN.name: FROZEN.start,
                      LOG.name: pytest.approx(200.0 * math.exp(-0.1))}
    np.testing.assert_allclose(EVERY.u(values), u)
    np.testing.assert_allclose(EVERY.slopes(u), [0.01, 0.5 * values[LOG.name]])
    assert EVERY.values(EVERY.start)[LOG.name] == pytest.approx(LOG.start)


def test_bounds_in_search_coordinates_are_those_of_the_values():
    low, high = EVERY.bounds
    np.testing.assert_allclose(low, [-4.1, math.log(25 / 200) / 0.5])
    np.testing.assert_allclose(high, [2.9, math.log(1600 / 200) / 0.5])
    for corner, field in ((low, "low"), (high, "high")):
        values = EVERY.values(corner)
        assert [values[item.name] for item in EVERY.free] == pytest.approx([getattr(i, field) for i in EVERY.free])


def test_values_outside_of_the_bounds_are_moved_to_them():
    values = {PLAIN.name: 1.0, LOG.name: 1.0}
    np.testing.assert_allclose(EVERY.u(values), [EVERY.bounds[1][0], EVERY.bounds[0][1]])


def test_changes_reach_the_named_parameters_and_no_others():
    changed = EVERY.changed([FROZEN.name, LOG.name], frozen=False, prior=False)
    assert [item.name for item in changed.items] == [item.name for item in EVERY.items]
    assert changed.by_name[PLAIN.name] is PLAIN
    assert changed.by_name[LOG.name] == replace(LOG, prior=False)
    assert changed.names == (PLAIN.name, FROZEN.name, LOG.name)
    assert [item.prior for item in changed.free] == [True, False, False]
    assert EVERY.by_name[FROZEN.name].frozen, "the set itself stays as it was"


def test_changes_that_cannot_be_are_refused():
    with pytest.raises(InputError, match=r"no parameter 'offset.hight'.*offset.height") as caught:
        EVERY.changed(["offset.hight"], frozen=True)
    assert caught.value.exit_code == 2
    with pytest.raises(InputError, match="lies outside its bounds"):
        EVERY.changed([LOG.name], low=160.0)


@pytest.mark.parametrize("u", [np.zeros(3), np.zeros(1), np.zeros((2, 1)), 0.0])
def test_coordinates_of_another_set_are_refused(u):
    with pytest.raises(ValueError, match="2 free parameters"):
        EVERY.values(u)
