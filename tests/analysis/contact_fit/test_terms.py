"""What a trial's residuals are: the errors of the metrics in units of their noise, with exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit import problem as module
from vsf_drake.analysis.contact_fit.options import FitNoise
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.motion.formats.recording import PlateRecording

NOISE = FitNoise(fore_aft=0.01, lateral=0.02, vertical=0.03, resultant=0.04, cop_fore_aft=0.05, correlation_s=0.06)
SERIES = ("fore_aft", "lateral", "vertical", "cop_fore_aft")
METRIC = {"fore_aft": "fore_aft_rmse_bw", "lateral": "medio_lateral_rmse_bw", "vertical": "vertical_rmse_bw",
          "resultant": "grf_rmse_bw", "cop_fore_aft": "cop_rmse_fl"}
FREE = ("offset.height", "offset.fore_aft", "contact.forefoot.force")
SHIFT = np.array([0.01, 0.0, 0.0])


@pytest.fixture
def fit(few_free):
    def make(trial, series=SERIES, **options):
        return few_free(*FREE, trials=[trial], labels=["own"], series=series, noise=NOISE, **options)

    return make


def of(fit, *, derivatives=False):
    found = fit.terms_of(fit.trials[0], "own").terms(fit.parameters.start, derivatives=derivatives)
    return {term.name: term for term in found}


def own_walk(fit, **options):
    comparison, result, _, _ = fit.terms_of(fit.trials[0], "own").walk(fit.parameters.start, **options)
    return comparison, result


@pytest.mark.parametrize("series", [SERIES, ("resultant", "cop_fore_aft")])
def test_residuals_are_the_errors_of_the_metrics_over_their_noise(monkeypatch, fit, soft, series):
    monkeypatch.setattr(module, "STRIDE", 1)
    problem = fit(soft, series)
    comparison, result = own_walk(problem)
    metrics = walk_metrics(result, soft.prosthetic_plate, comparison=comparison)
    found = of(problem)
    monkeypatch.undo()
    strided = of(problem)
    assert set(found) == set(series) == set(strided)
    for name, term in found.items():
        residual = term.residual
        if name == "cop_fore_aft":
            residual = residual[np.isfinite(comparison.stances[0].model_cop[:, 0])]
            assert len(residual) == metrics.cop_points
        rms = getattr(NOISE, name) * np.sqrt(np.mean(residual**2))
        assert rms == pytest.approx(getattr(metrics, METRIC[name]), rel=1e-9), name
        assert len(strided[name].residual) < 0.27 * max(len(comparison.time_s), 101)
        fewer = getattr(NOISE, name) * np.sqrt(np.mean(strided[name].residual**2))
        assert fewer == pytest.approx(getattr(metrics, METRIC[name]), rel=0.05), f"{name}, every fourth instant"


def test_instants_are_where_the_series_was_compared_and_weigh_by_their_spacing(fit, soft):
    problem = fit(soft)
    comparison, _ = own_walk(problem)
    found, stance = of(problem), comparison.stances[0].measured
    for name, spacing in (("vertical", 8e-3), ("cop_fore_aft", 0.04 * stance.duration_s)):
        times = found[name].times_s
        np.testing.assert_allclose(np.diff(times), spacing, rtol=1e-6)
        assert found[name].weight == pytest.approx(np.sqrt(spacing / (2 * 0.06)))
    assert found["cop_fore_aft"].times_s[[0, -1]] == pytest.approx([stance.start_s, stance.end_s])
    inside = comparison.scored[np.searchsorted(comparison.time_s, found["vertical"].times_s - 1e-9)]
    assert inside.all()
    assert {term.trial for term in found.values()} == {"own"}


def test_a_plate_that_reads_more_makes_a_residual_of_that_much_less(fit, soft):
    _, result = own_walk(fit(soft))
    weight = soft.subject.mass_kg * 9.81
    plate = PlateRecording(result.time_s, result.grf_W * [1.0, 1.0, 1.1], result.cop_W + SHIFT,
                           result.free_moment_nm, True)
    heading = own_walk(fit(soft))[0].heading
    own = replace(soft, plates=soft.plates | {"right": plate})
    comparison, _ = own_walk(fit(own))
    found = of(fit(own))
    rows = np.searchsorted(comparison.time_s, found["vertical"].times_s - 1e-9)
    np.testing.assert_allclose(found["vertical"].residual, -0.1 * comparison.model[rows, 2] / weight / 0.03, atol=1e-6)
    inner = slice(3, -3)
    np.testing.assert_allclose(found["cop_fore_aft"].residual[inner],
                               -0.01 * heading[0] / result.foot_length_m / 0.05, rtol=1e-3)


def test_without_a_centre_of_pressure_on_either_side_there_is_no_residual_and_no_derivative(fit, soft):
    plate = soft.prosthetic_plate
    late = plate.time_s > 0.9
    cop = np.where(late[:, None], np.nan, plate.cop_W)
    own = replace(soft, plates=soft.plates | {"right": replace(plate, cop_W=cop)})
    term = of(fit(own), derivatives=True)["cop_fore_aft"]
    assert np.isfinite(term.residual).all() and np.isfinite(term.by).all()
    missing = term.times_s > 0.91
    assert missing.any() and not term.residual[missing].any() and not term.by[missing].any()
    assert term.residual[~missing].any() and term.by[~missing].any()


def test_derivatives_of_the_resultant_are_those_of_differences(fit, soft):
    """Of a walk whose forces change branch at single instants: compared in the mean."""
    problem = fit(soft, ("resultant",))
    terms, u, step = problem.terms_of(soft, "own"), problem.parameters.start, 1e-3
    exact = {term.name: term.by for term in terms.terms(u, derivatives=True)}
    for p in range(len(FREE)):
        sides = [terms.terms(u + sign * step * np.eye(len(u))[p], derivatives=False) for sign in (-1.0, 1.0)]
        for low, high in zip(*sides, strict=True):
            wanted = (high.residual - low.residual) / (2.0 * step)
            off = np.linalg.norm(exact[low.name][:, p] - wanted) / np.linalg.norm(wanted)
            assert off < 0.01, (low.name, FREE[p], off)
