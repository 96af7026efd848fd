"""What a fit assumes of noise, and the options that it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit.options import SERIES, ContactFitOptions, FitNoise
from vsf_drake.errors import InputError


def test_correlation_falls_by_e_in_its_time():
    noise = FitNoise(correlation_s=0.04)
    times = np.array([0.0, 0.04, 0.12, 0.04])
    found = noise.correlation(times)
    np.testing.assert_allclose(found[0], [1.0, math.exp(-1), math.exp(-3), math.exp(-1)])
    np.testing.assert_allclose(found, found.T)
    assert np.all(np.diag(found) == 1.0) and found[1, 3] == 1.0


def test_samples_weigh_together_as_many_independent_ones_as_their_mean_tells():
    """The variance of the mean of a long correlated series is 2 tau / T, that of N independent ones 1 / N."""
    noise = FitNoise(correlation_s=0.05)
    times = np.arange(0.0, 20.0, 0.004)
    variance = noise.correlation(times).mean()
    assert len(times) * noise.weight(0.004) ** 2 == pytest.approx(1.0 / variance, rel=0.01)


def test_samples_that_are_far_apart_count_in_full_and_never_more():
    noise = FitNoise(correlation_s=0.05)
    assert noise.weight(0.1) == 1.0 and noise.weight(3.0) == 1.0
    assert noise.weight(0.025) == pytest.approx(0.5)


@pytest.mark.parametrize("name", [*SERIES, "correlation_s"])
@pytest.mark.parametrize("value", [0.0, -0.1, 1.1, math.inf, math.nan, "0.1", None])
def test_what_is_no_noise_is_refused_by_name(name, value):
    with pytest.raises(InputError, match=r"outside its physical range|not a (finite )?number") as caught:
        ContactFitOptions(noise=FitNoise(**{name: value}))
    assert caught.value.where == f"noise.{name}"


@pytest.mark.parametrize(("changes", "where", "match"), [
    ({"series": ()}, "series", "must name series"), ({"series": ("vertical", "vertical")}, "series", "each once"),
    ({"series": ("moment",)}, "series[0]", "'moment' is not known. Known are: fore_aft, lateral"),
    ({"series": ("resultant", "vertical")}, "series", "same data twice"),
    ({"solver": "newton"}, "solver", "not known. Known are: gauss_newton, snopt, ipopt, nlopt"),
    ({"starts": 0}, "starts", "at least 1"), ({"starts": 2.0}, "starts", "whole number"),
    ({"screened": 0}, "screened", "at least 1"), ({"seed": -1}, "seed", "at least 0"),
    ({"iterations": True}, "iterations", "whole number"), ({"tolerance": 0.0}, "tolerance", "physical range"),
    ({"step_s": 0.02}, "step_s", "and 0.01 s"), ({"report_step_s": -1e-3}, "report_step_s", "range"),
    ({"step_s": math.nan}, "step_s", "not a finite"), ({"tolerance": "1e-5"}, "tolerance", "not a number")])
def test_options_that_cannot_be_are_refused_by_name(changes, where, match):
    with pytest.raises(InputError, match=match) as caught:
        ContactFitOptions(**changes)
    assert caught.value.where == where


def test_what_is_compared_by_default_is_not_the_resultant_alone():
    assert ContactFitOptions().series == ("fore_aft", "lateral", "vertical", "cop_fore_aft")
    ContactFitOptions(series=("resultant", "cop_fore_aft"))
