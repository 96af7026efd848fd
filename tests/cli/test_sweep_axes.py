"""From words to values: what `sweep` accepts, and how it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.cli.sweep import MANY, MOST, axis, check_count, values_of
from vsf_drake.errors import InputError


def test_a_range_holds_both_ends_and_count_values():
    assert values_of("66:151:5", "") == pytest.approx(np.linspace(66.0, 151.0, 5))
    assert axis("offset.height=-0.01:0.01:3", sampled=False).values == (-0.01, 0.0, 0.01)


def test_a_list_and_a_single_value_stay_as_they_are():
    assert values_of("66,87,108", "") == (66.0, 87.0, 108.0)
    assert values_of("108", "") == (108.0,)
    assert axis("friction.mu_static=0.5,0.3", sampled=False).values == (0.5, 0.3)


def test_a_sample_takes_a_name_with_its_own_or_with_other_bounds():
    assert axis("offset.height", sampled=True).values == ()
    assert axis("offset.height=-0.01:0.02", sampled=True).values == (-0.01, 0.02)


@pytest.mark.parametrize(("text", "said"), [
    ("151:66:5", "does not rise"), ("66:66:5", "does not rise"), ("66:151:0", "0 values"), ("66:151:-3", "-3 values"),
    ("66:151:1", "single value alone"), ("66:151:1000000000", "1000000000 values"), ("66:151:1e9", "whole number"),
    ("66:151:2.5", "whole number"), ("66:151", "no range"), ("66:80:90:3", "no range"), ("nan", "finite"),
    ("66:inf:5", "finite"), ("", "finite"), ("66,,87", "finite"), ("66,66", "twice"), ("soft", "'soft'")])
def test_what_is_no_range_is_refused(text, said):
    with pytest.raises(InputError, match=said) as caught:
        values_of(text, "--fulcrum-mm")
    assert caught.value.where == "--fulcrum-mm"


@pytest.mark.parametrize(("text", "sampled", "said"), [
    ("offset.height", False, "no values"), ("offset.height=0:1:5", True, "no bounds"),
    ("offset.height=1", True, "no bounds"), ("offset.height=1:0", True, "does not rise"),
    ("offset.height=", False, "finite")])
def test_grids_need_values_and_samples_bounds(text, sampled, said):
    with pytest.raises(InputError, match=said):
        axis(text, sampled=sampled)


def test_thousands_of_walks_have_to_be_meant_and_tens_of_thousands_are_refused():
    check_count(MANY, meant=False)
    check_count(MOST, meant=True)
    with pytest.raises(InputError, match="--yes"):
        check_count(MANY + 1, meant=False)
    with pytest.raises(InputError, match="at a time"):
        check_count(MOST + 1, meant=True)
