"""The bench in a fit: stiffness and mid-range displacement as residuals with derivatives; nothing where unmeasured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.analysis.bench_metrics import mid_range_displacement
from vsf_drake.analysis.contact_fit.solve import search
from vsf_drake.contact_file import model_with
from vsf_drake.errors import InputError
from vsf_drake.simulation.bench import run_bench

FREE = ("contact.forefoot.force", "contact.forefoot.exponent", "contact.heel.force", "contact.heel_posterior.rise",
        "offset.height")


@pytest.fixture
def fit(few_free, bench_curves):
    return few_free(*FREE, bench=bench_curves)


def displacement(fit, u):
    return fit.machine.displacement(fit.shared.at(u).values)[0]


def test_residuals_are_the_misfits_over_their_uncertainty_and_need_no_displacement(few_free, fit, bench_curves):
    u = fit.parameters.start + 0.1
    *_, stiffness, displaced, prior = fit.evaluate(u).terms
    assert (stiffness.name, displaced.name, prior.name) == ("bench", "mid-range displacement", "prior")
    for term, model, measured, heel, sd in (
            (stiffness, fit.bench_stiffness(u), bench_curves.stiffness_n_per_m, bench_curves.heel_stiffness_n_per_m,
             bench_curves.uncertainty_n_per_m),
            (displaced, displacement(fit, u), bench_curves.mid_range_m, bench_curves.heel_mid_range_m, 5e-4)):
        np.testing.assert_allclose(term.residual, (model - np.array([*measured, heel])) / sd, rtol=1e-12)
        assert term.trial == "bench" and term.weight == 1.0 and term.times_s is None
    without = few_free(*FREE, bench=replace(bench_curves, mid_range_m=None, heel_mid_range_m=None,
                                            mid_range_uncertainty_m=None))
    *_, alone, _ = without.evaluate(u).terms
    np.testing.assert_allclose(alone.residual, stiffness.residual, atol=1e-6)
    with pytest.raises(ValueError, match="no bench"):
        few_free("offset.height").bench_stiffness(np.zeros(1))
    far = replace(bench_curves, fulcrum_m=(0.066, 0.4), stiffness_n_per_m=(1e4, 3e4), mid_range_m=(0.03, 0.01))
    with pytest.raises(InputError):
        few_free("offset.height", bench=far)


def test_gradients_are_the_limits_of_differences(fit):
    u = fit.parameters.start + np.array([0.2, -0.3, 0.1, 0.4, 0.1])
    by = fit.evaluate(u).terms[-2].by
    for p, name in enumerate(fit.parameters.names):
        step = 1e-3 * np.eye(len(u))[p]
        ends = [fit.evaluate(u + sign * step, derivatives=False).terms[-2].residual for sign in (1, -1)]
        np.testing.assert_allclose(by[:, p], (ends[0] - ends[1]) / 2e-3, rtol=2e-4, atol=1e-5, err_msg=name)
    assert np.abs(by).max(axis=0)[:-1].all() and not by[:, FREE.index("offset.height")].any()


def test_the_model_is_that_of_the_simulated_bench(fit, bench_curves):
    """Its passes end a step beyond 600 N; cut there."""
    u = fit.parameters.start + np.array([0.5, 0.5, 0.0, 0.0, 0.0])
    values = {"contact.forefoot.stiffness", "contact.forefoot.exponent"}
    walk = {name: value for name, value in fit.shared.at(u).values.items() if name in values}
    pressed = run_bench(model_with(fit.walker.model, walk), fulcrums_m=bench_curves.fulcrum_m).forefoot
    simulated = []
    for setting in pressed:
        end = np.interp(600.0, setting.load_n, setting.platen_m)
        rows = setting.platen_m < end
        simulated.append(mid_range_displacement(np.append(setting.platen_m[rows], end),
                                                np.append(setting.load_n[rows], 600.0)))
    np.testing.assert_allclose(displacement(fit, u)[:-1], simulated, rtol=2e-3)


def test_a_displacement_of_the_models_own_is_found_again(few_free, fit, bench_curves):
    """The data are what the model does elsewhere: stiffness, displacement and walks pull back from there together."""
    u = fit.parameters.start + np.array([0.6, 0.4, -0.3, 0.3, 0.0])
    stiffness, displaced = fit.bench_stiffness(u), displacement(fit, u)
    sharp = replace(bench_curves, stiffness_n_per_m=tuple(stiffness[:-1]), heel_stiffness_n_per_m=float(stiffness[-1]),
                    mid_range_m=tuple(displaced[:-1]), heel_mid_range_m=float(displaced[-1]),
                    mid_range_uncertainty_m=1e-6, uncertainty_n_per_m=1.0)
    again = few_free(*FREE, bench=sharp)
    found = search(again, again.parameters.start)
    np.testing.assert_allclose(displacement(again, found.u), displaced, atol=5e-6)
    np.testing.assert_allclose(again.bench_stiffness(found.u), stiffness, rtol=2e-3)
