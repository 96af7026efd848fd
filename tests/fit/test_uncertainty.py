"""Errors of a fit, against closed forms and against drawing the noise again and again."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.fit.options import ContactFitOptions, FitNoise
from vsf_drake.fit.parameters import FitParameter, FitParameters
from vsf_drake.fit.problem import ResidualTerm
from vsf_drake.fit.solve import NORMAL_95, SURE_SHARE, FitSearch, uncertainty

NOISE = FitNoise(correlation_s=0.05)
TIMES = np.arange(0.0, 0.8, 0.01)
DRAWS = 20_000


def plain(name, *, scale=2.0, low=-50.0, high=50.0, **more):
    return FitParameter(
        name=name, unit="m", start=0.0, mean=0.0, low=low, high=high, scale=scale, **more
    )


def series(by, *, times=TIMES, name="vertical", weight=None, residual=None):
    """Data with derivatives by (n, P)."""
    spacing = 0.01 if times is None else times[1] - times[0]
    weight = NOISE.weight(spacing) if weight is None else weight
    residual = np.zeros(len(by)) if residual is None else residual
    return ResidualTerm(
        name=name,
        trial="a",
        times_s=times,
        residual=residual,
        by=np.asarray(by, dtype=float),
        weight=weight,
    )


def prior(count, rows=None):
    rows = range(count) if rows is None else rows
    return ResidualTerm(
        name="prior",
        trial="prior",
        times_s=None,
        residual=np.zeros(len(rows)),
        by=np.eye(count)[list(rows)],
        weight=1.0,
    )


def constant(size, times=TIMES):
    return np.full((len(times), 1), size)


def known(parameters, *terms, u=None):
    return uncertainty(parameters, np.zeros(len(parameters)) if u is None else u, terms, NOISE)


def curves(count):
    """(n, count) slow functions of time, no two alike, of different sizes."""
    return np.column_stack(
        [(0.3 + j) * np.cos((j + 1) * math.pi * TIMES / 0.8 + 0.4 * j) for j in range(count)]
    )


def drawn(by, weight, rng, *, independent=None, held=None):
    """(DRAWS, P) errors of the estimate that minimises the fit's cost, where truth and noise are
    drawn as is assumed; `held` (n, H) are derivatives by what is drawn too and not estimated.

    The least squares of each draw are solved as they stand; nothing here knows a covariance of the
    estimate.
    """
    count = by.shape[1]
    truth = rng.normal(size=(count, DRAWS))
    noise = np.linalg.cholesky(NOISE.correlation(TIMES) + 1e-12 * np.eye(len(TIMES))) @ rng.normal(
        size=(len(TIMES), DRAWS)
    )
    if held is not None:
        noise += held @ rng.normal(size=(held.shape[1], DRAWS))
    rows, right = (
        [weight * by, np.eye(count)],
        [weight * (by @ truth + noise), np.zeros((count, DRAWS))],
    )
    if independent is not None:
        rows.append(independent)
        right.append(independent @ truth + rng.normal(size=(len(independent), DRAWS)))
    estimate = np.linalg.lstsq(np.vstack(rows), np.vstack(right), rcond=None)[0]
    return (estimate - truth).T


@pytest.mark.parametrize(("bench", "heavier"), [(False, 1.0), (True, 1.0), (False, 4.0)])
def test_covariance_is_that_of_drawn_truths_and_correlated_noise(bench, heavier):
    """Of a series counted four times too much, too: the estimate is worse, and so is what is said
    of it."""
    by, weight = curves(4), heavier * NOISE.weight(0.01)
    independent = np.array([[1.0, 0.0, -2.0, 0.5], [0.0, 0.3, 0.0, 3.0]]) if bench else None
    off = drawn(by, weight, np.random.default_rng(1), independent=independent)
    terms = [series(by, weight=weight), prior(4)]
    if bench:
        terms.insert(1, series(independent, times=None, name="bench", weight=1.0))
    found = known(FitParameters([plain(name) for name in "abcd"]), *terms)
    sampled = np.cov(off.T)
    np.testing.assert_allclose(found.share_of_prior, np.sqrt(np.diag(sampled)), rtol=0.03)
    np.testing.assert_allclose(found.correlation, np.corrcoef(off.T), atol=0.03)
    np.testing.assert_allclose(found.standard_error, 2.0 * found.share_of_prior)
    np.testing.assert_allclose(
        found.interval, np.outer(NORMAL_95 * found.standard_error, [-1.0, 1.0])
    )
    inside = np.abs(off) <= NORMAL_95 * found.share_of_prior
    np.testing.assert_allclose(inside.mean(axis=0), 0.95, atol=0.006)


def test_minima_beside_the_best_one_widen_errors_as_a_mixture_of_them_all_would():
    """Second moments about the best minimum of draws from the mixture; costs are minus logarithms
    of what is worth."""
    rng, sd, costs = np.random.default_rng(3), 0.2, np.array([5.0, 5.0, 6.2])
    places = np.array([[0.0, 0.0], [0.5, -0.3], [-0.4, 0.8]])
    found = FitSearch(
        start=places[0],
        u=places[0],
        start_cost=9.0,
        cost=costs[0],
        success=True,
        message="",
        evaluations=1,
        failed=0,
        beside=np.column_stack([costs, places])[1:],
    )
    worth = np.exp(-costs) / np.exp(-costs).sum()
    drawn_of = places[rng.choice(3, size=400_000, p=worth)] + sd * rng.normal(size=(400_000, 2))
    term = series(np.eye(2), times=None, name="bench", weight=math.sqrt(1.0 / sd**2 - 1.0))
    told = uncertainty(
        FitParameters([plain("a"), plain("b")]), places[0], [term, prior(2)], NOISE, found.apart
    )
    moments = drawn_of.T @ drawn_of / len(drawn_of)
    np.testing.assert_allclose(told.share_of_prior, np.sqrt(np.diag(moments)), rtol=0.01)
    assert told.correlation[0, 1] == pytest.approx(
        moments[0, 1] / np.sqrt(np.prod(np.diag(moments))), abs=0.01
    )


def test_what_the_fit_holds_is_as_wrong_as_its_prior_allows():
    """Each of two parameters that the fit leaves where they are moves the estimates, beside the
    noise."""
    by, weight, held = curves(4), NOISE.weight(0.01), np.column_stack([2.0 * TIMES, constant(0.5)])
    off = drawn(by, weight, np.random.default_rng(2), held=held)
    every = np.hstack([prior(4).by, np.zeros((4, 2))])
    parameters = FitParameters([plain(name) for name in "abcd"])
    found = known(
        parameters, series(np.hstack([by, held]), weight=weight), replace(prior(4), by=every)
    )
    np.testing.assert_allclose(found.share_of_prior, np.std(off, axis=0), rtol=0.03)
    np.testing.assert_allclose(found.correlation, np.corrcoef(off.T), atol=0.03)
    without = known(parameters, series(by, weight=weight), prior(4))
    assert np.all(found.share_of_prior > without.share_of_prior)
    np.testing.assert_allclose(found.singular_values, without.singular_values)


def test_a_constant_is_told_as_by_the_mean_of_a_correlated_series():
    """Without prior: the variance of the mean of n errors with an exponential correlation."""
    n, rho = len(TIMES), math.exp(-0.01 / 0.05)
    variance = (n * (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (1 - rho) ** 2) / n**2
    found = known(FitParameters([plain("a", prior=False)]), series(constant(3.0)))
    assert found.share_of_prior[0] == pytest.approx(math.sqrt(variance) / 3.0, rel=1e-12)


def test_the_priors_own_error_is_one_where_the_data_are_silent():
    found = known(
        FitParameters([plain("a"), plain("b")]),
        series(np.hstack([constant(30.0), constant(0.0)])),
        prior(2),
    )
    assert found.share_of_prior[1] == pytest.approx(1.0)
    assert found.share_of_prior[0] < 0.1
    assert found.unidentified == ("b",)
    assert found.singular_values[1] == 0.0


def test_what_neither_data_nor_prior_tell_has_no_finite_error():
    parameters = FitParameters([plain("a", prior=False), plain("b")])
    found = known(parameters, series(np.hstack([constant(0.0), constant(1.0)])), prior(2, [1]))
    assert found.standard_error[0] == np.inf
    np.testing.assert_array_equal(found.interval[0], [-50.0, 50.0])
    assert np.isfinite(found.interval[1]).all()
    assert "a" in found.unidentified
    assert np.isfinite(found.correlation).all()


def test_a_direction_that_nothing_tells_has_no_finite_error_either():
    """Two parameters that always act together, and no prior on either: each could be anything."""
    parameters = FitParameters([plain("a", prior=False), plain("b", prior=False)])
    found = known(parameters, series(np.hstack([constant(5.0), constant(5.0)])))
    assert set(found.unidentified) == {"a", "b"}
    assert np.all(found.standard_error == np.inf)


def test_two_that_act_together_are_named_together():
    by = np.hstack([constant(20.0), constant(20.0) + 0.2 * np.cos(4 * TIMES)[:, None]])
    found = known(FitParameters([plain("a"), plain("b")]), series(by), prior(2))
    (pair,) = found.together
    assert pair.names == ("a", "b") and pair.correlation < -0.9
    assert (
        found.correlation[0, 1]
        == pair.correlation
        == pytest.approx(found.correlation[1, 0], rel=1e-9)
    )


def test_singular_values_are_of_the_data_alone_and_twice_as_well_as_the_prior_is_identified():
    edge = math.sqrt(1.0 / SURE_SHARE**2 - 1.0)
    by = np.diag([5.0, 0.5, 1.01 * edge, 0.99 * edge])
    terms = [series(by, times=None, weight=1.0), prior(4)]
    found = known(FitParameters([plain(name) for name in "abcd"]), *terms)
    np.testing.assert_allclose(found.singular_values, [5.0, 1.01 * edge, 0.99 * edge, 0.5])
    np.testing.assert_allclose(found.share_of_prior, 1.0 / np.sqrt(1.0 + np.diag(by) ** 2))
    assert found.unidentified == ("b", "d")


def test_intervals_are_symmetric_in_the_search_and_cut_at_the_bounds():
    parameters = FitParameters(
        [
            FitParameter(
                name="force",
                unit="N",
                start=200.0,
                low=20.0,
                high=2000.0,
                mean=200.0,
                scale=0.5,
                logarithmic=True,
            ),
            plain("shift", low=-1.0, high=1.0),
        ]
    )
    found = known(parameters, prior(2), u=np.array([0.4, 0.3]))
    np.testing.assert_allclose(found.share_of_prior, 1.0)
    low, high = found.interval[0]
    value = 200.0 * math.exp(0.2)
    assert (
        math.log(high / value)
        == pytest.approx(-math.log(low / value))
        == pytest.approx(0.5 * NORMAL_95)
    )
    assert found.standard_error[0] == pytest.approx(0.5 * value)
    np.testing.assert_array_equal(found.interval[1], [-1.0, 1.0])


def test_what_ended_at_a_bound_is_named():
    parameters = FitParameters([plain(name, low=-4.0, high=6.0) for name in "abc"])
    found = known(
        parameters,
        series(10.0 * np.eye(3), times=None, weight=1.0),
        prior(3),
        u=np.array([-2.0, 0.0, 3.0]),
    )
    assert found.at_bound == ("a", "c")
    assert found.interval[0, 0] == -4.0 and found.interval[2, 1] == 6.0
    assert known(parameters, prior(3), u=np.array([-1.9, 0.0, 2.9])).at_bound == ()


# What is assumed of noise, and which series go together.


def test_correlation_falls_by_e_in_its_time():
    noise = FitNoise(correlation_s=0.04)
    times = np.array([0.0, 0.04, 0.12, 0.04])
    found = noise.correlation(times)
    np.testing.assert_allclose(found[0], [1.0, math.exp(-1), math.exp(-3), math.exp(-1)])
    np.testing.assert_allclose(found, found.T)
    assert np.all(np.diag(found) == 1.0) and found[1, 3] == 1.0


def test_samples_weigh_together_as_many_independent_ones_as_their_mean_tells():
    """The variance of the mean of a long correlated series is 2 tau / T, that of N independent ones
    1 / N."""
    noise = FitNoise(correlation_s=0.05)
    times = np.arange(0.0, 12.0, 0.004)
    variance = noise.correlation(times).mean()
    assert len(times) * noise.weight(0.004) ** 2 == pytest.approx(1.0 / variance, rel=0.01)
    assert noise.weight(0.1) == noise.weight(3.0) == 1.0 and noise.weight(0.025) == pytest.approx(
        0.5
    )


@pytest.mark.parametrize(
    ("series", "match"),
    [
        ((), "must name series"),
        (("vertical", "vertical"), "each once"),
        (("resultant", "vertical"), "same data twice"),
    ],
)
def test_series_that_do_not_go_together_are_refused(series, match):
    with pytest.raises(InputError, match=match):
        ContactFitOptions(series=series)
