"""Mid-range displacement in a fit: residuals with their derivatives, scores, table, words; nothing where unmeasured."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.bench_metrics import mid_range_displacement
from vsf_drake.analysis.contact_fit import ContactFit, ContactFitSolution, PaperOptions
from vsf_drake.analysis.contact_fit.assessment import Assessment, bench_row, bench_score, fit_table, verdict
from vsf_drake.analysis.contact_fit.paper import PaperEnd
from vsf_drake.analysis.contact_fit.problem import bench_of
from vsf_drake.analysis.contact_fit.solution import JointEnd
from vsf_drake.analysis.contact_fit.solve import search
from vsf_drake.analysis.validation.bench_lines import load_measured_bench
from vsf_drake.contact_file import model_with
from vsf_drake.files import resource
from vsf_drake.simulation.bench import run_bench

FREE = ("contact.forefoot.force", "contact.forefoot.exponent", "contact.heel.force", "contact.heel_posterior.rise",
        "offset.height")


@pytest.fixture(scope="module")
def curves():
    return load_measured_bench(resource("data/reference_subject/bench_curves.csv"))


def test_residuals_are_the_misfit_over_its_uncertainty_and_come_beside_those_of_stiffness(few_free, curves):
    fit = few_free(*FREE, bench=curves)
    u = fit.parameters.start + 0.1
    *_, stiffness, displaced, prior = fit.evaluate(u).terms
    assert (stiffness.name, displaced.name, prior.name) == ("bench", "mid-range displacement", "prior")
    measured = np.array([*curves.mid_range_m, curves.heel_mid_range_m])
    np.testing.assert_allclose(displaced.residual, (fit.bench_displacement(u) - measured) / 5e-4, rtol=1e-12)
    assert displaced.trial == "bench" and displaced.weight == 1.0 and displaced.times_s is None
    without = few_free(*FREE, bench=replace(curves, mid_range_m=None, heel_mid_range_m=None,
                                            mid_range_uncertainty_m=None))
    *_, alone, _ = without.evaluate(u).terms
    np.testing.assert_allclose(alone.residual, stiffness.residual, atol=1e-6)
    with pytest.raises(ValueError, match="without mid_range"):
        without.bench_displacement(u)
    with pytest.raises(ValueError, match="no bench"):
        few_free("offset.height").bench_displacement(np.zeros(1))


def test_gradients_are_the_limits_of_differences(few_free, curves):
    fit = few_free(*FREE, bench=curves)
    u = fit.parameters.start + np.array([0.2, -0.3, 0.1, 0.4, 0.1])
    by = fit.evaluate(u).terms[-2].by
    for p, name in enumerate(fit.parameters.names):
        step = 1e-3 * np.eye(len(u))[p]
        ends = [fit.evaluate(u + sign * step, derivatives=False).terms[-2].residual for sign in (1, -1)]
        np.testing.assert_allclose(by[:, p], (ends[0] - ends[1]) / 2e-3, rtol=2e-4, atol=1e-5, err_msg=name)
    assert np.abs(by).max(axis=0)[:-1].all() and not by[:, FREE.index("offset.height")].any()


def test_the_model_is_that_of_the_simulated_bench(few_free, curves):
    """Its passes end a step beyond 600 N; cut there."""
    fit = few_free(*FREE, bench=curves)
    u = fit.parameters.start + np.array([0.5, 0.5, 0.0, 0.0, 0.0])
    values = {"contact.forefoot.stiffness", "contact.forefoot.exponent"}
    walk = {name: value for name, value in fit._shared.at(u).values.items() if name in values}
    pressed = run_bench(model_with(fit.walker.model, walk), fulcrums_m=curves.fulcrum_m).forefoot
    simulated = []
    for setting in pressed:
        end = np.interp(600.0, setting.load_n, setting.platen_m)
        kept = setting.platen_m < end
        simulated.append(mid_range_displacement(np.append(setting.platen_m[kept], end),
                                                np.append(setting.load_n[kept], 600.0)))
    np.testing.assert_allclose(fit.bench_displacement(u)[:-1], simulated, rtol=2e-3)


def test_a_displacement_of_the_models_own_is_found_again(few_free, curves):
    """The data are what the model does elsewhere: stiffness, displacement and walks pull back from there together."""
    made = few_free(*FREE, bench=curves)
    u = made.parameters.start + np.array([0.6, 0.4, -0.3, 0.3, 0.0])
    stiffness, displaced = made.bench_stiffness(u), made.bench_displacement(u)
    sharp = replace(curves, stiffness_n_per_m=tuple(stiffness[:-1]), heel_stiffness_n_per_m=float(stiffness[-1]),
                    mid_range_m=tuple(displaced[:-1]), heel_mid_range_m=float(displaced[-1]),
                    mid_range_uncertainty_m=1e-6, uncertainty_n_per_m=1.0)
    fit = few_free(*FREE, bench=sharp)
    found = search(fit, fit.parameters.start)
    np.testing.assert_allclose(fit.bench_displacement(found.u), displaced, atol=5e-6)
    np.testing.assert_allclose(fit.bench_stiffness(found.u), stiffness, rtol=2e-3)


def test_the_papers_solution_is_pressed_likewise(curves, soft, fit_walker, few_free):
    """With nothing fitted both are the model as it stands."""
    def paper(bench):
        end = PaperEnd(state=None, values={}, initial_values={}, converged=True, stopped_by="its rule")
        fit = ContactFit([soft], walker=fit_walker, bench=bench, options=PaperOptions())
        return ContactFitSolution(fit=fit, success=True, message="its rule", end=end, wall_s=0.0)

    found = paper(curves)
    plain = bench_of(fit_walker.model.foot, curves)
    np.testing.assert_array_equal(found.bench_displacement(), plain.displacement({})[0])
    np.testing.assert_array_equal(found.bench_stiffness(), plain.evaluate({})[0])
    with pytest.raises(ValueError, match="no bench"):
        paper(None).bench_displacement()


def test_scores_are_in_millimetres_with_the_heel_apart(curves):
    stiffness = np.array([*curves.stiffness_n_per_m, curves.heel_stiffness_n_per_m])
    off = 1e-3 * np.array([0.3, -0.3, 0.0, 0.4, 0.0, 2.0])
    displaced = np.array([*curves.mid_range_m, curves.heel_mid_range_m]) + off
    model = SimpleNamespace(fit=SimpleNamespace(bench=curves), bench_stiffness=lambda: stiffness,
                            bench_displacement=lambda: displaced)
    found = bench_score(model)["mid_range"]
    assert np.subtract(found["model_mm"], found["measured_mm"]) == pytest.approx([0.3, -0.3, 0.0, 0.4, 0.0], abs=1e-9)
    assert found["rmse_mm"] == pytest.approx(np.sqrt(0.34 / 5)), "without the heel"
    assert found["heel_model_mm"] - found["heel_measured_mm"] == pytest.approx(2.0)
    bare = replace(curves, mid_range_m=None, heel_mid_range_m=None, mid_range_uncertainty_m=None)
    model = SimpleNamespace(fit=SimpleNamespace(bench=bare), bench_stiffness=lambda: stiffness)
    assert "mid_range" not in bench_score(model)


def test_the_table_has_displacements_only_where_they_were_measured(curves, few_free, measured_bench):
    row = fit_table(few_free("offset.height", bench=curves), failed="no")["bench"]
    assert row["mid_range"]["measured_mm"] == pytest.approx([1e3 * x for x in curves.mid_range_m])
    assert row["mid_range"]["heel_measured_mm"] == pytest.approx(1e3 * curves.heel_mid_range_m)
    assert row["mid_range"]["uncertainty_mm"] == pytest.approx(0.5) and row["mid_range"]["model_mm"] is None
    assert "mid_range" not in fit_table(few_free("offset.height", bench=measured_bench), failed="no")["bench"]


def scored(off, heel=2.0):
    mid = {"rmse_mm": off, "heel_measured_mm": 5.0, "heel_model_mm": 5.0 + heel}
    return {"rmse_n_per_mm": 0.0, "heel_measured_n_per_mm": 65.0, "heel_model_n_per_mm": 65.0, "mid_range": mid}


def words(bench):
    metrics = {"grf_rmse_bw": 0.02, "null_model_grf_rmse_bw": None}
    score = SimpleNamespace(label="a", role="fitted", metrics=metrics, floor_grf_rmse_bw=None, sweep=None)
    told = SimpleNamespace(names=("offset.height",), unidentified=(), singular_values=[3.0], at_bound=(), together=())
    terms = (SimpleNamespace(trial="a", name="vertical", residual=np.array([0.5])),)
    end = JointEnd(u=np.zeros(1), evaluation=SimpleNamespace(terms=terms), uncertainty=told, best=0,
                   searches=(SimpleNamespace(cost=1.0, success=True),))
    fit = SimpleNamespace(trials=[SimpleNamespace(fulcrum_m=x) for x in (0.066, 0.151)])
    solution = SimpleNamespace(fit=fit, end=end, message="done")
    return verdict(solution, Assessment(scores=(score,), left_out=(), bench=bench))


def test_the_verdict_says_how_far_off_the_displacement_is_beside_the_papers():
    [near] = [text for text in words(scored(0.3)) if "displacement" in text]
    assert "0.30 mm off" in near and "as near as the paper's model (0.45 mm)" in near and "+2.00 mm off" in near
    [far] = [text for text in words(scored(0.5, -1.0)) if "displacement" in text]
    assert "0.50 mm off" in far and "farther off than" in far and "-1.00 mm off" in far
    plain = words({key: value for key, value in scored(0.3).items() if key != "mid_range"})
    assert not any("displacement" in text for text in plain)
    assert [text for text in words(scored(0.3)) if "displacement" not in text] == list(plain)


def test_scores_keep_their_names_whether_the_model_is_known_or_not(curves):
    stiffness = np.array([*curves.stiffness_n_per_m, curves.heel_stiffness_n_per_m])
    displaced = np.array([*curves.mid_range_m, curves.heel_mid_range_m])
    unknown, known = bench_row(curves), bench_row(curves, stiffness, displaced)
    assert set(unknown) == set(known) and set(scored(0.1)) <= set(known)
    assert set(unknown["mid_range"]) == set(known["mid_range"]) == {
        "measured_mm", "model_mm", "heel_measured_mm", "heel_model_mm", "rmse_mm", "uncertainty_mm",
        "published_rmse_mm"}
