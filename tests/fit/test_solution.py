"""What a fit found: readable only if it succeeded, and the same walk wherever it is applied."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.files import resource
from vsf_drake.fit.assessment import failure, simulated_bench
from vsf_drake.fit.parameters import standard_parameters
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import ContactFitSolution, JointEnd, solve
from vsf_drake.fit.solve import FitSearch, uncertainty, uncertainty_at
from vsf_drake.model.contact_file import load_contact, model_with, save_contact
from vsf_drake.model.model_file import load_model
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.walk import Walker, simulate_trial
from vsf_drake.walks.metrics import walk_metrics

LABELS = ["low_1", "high_1"]
SHORT = {"starts": 2, "screened": 2, "iterations": 30, "step_s": 4e-3, "report_step_s": 2e-3}


def ended(fit, u, **changes):
    """A solution at u, as if a search had come there."""
    at = fit.evaluate(u)
    search = FitSearch(
        start=u,
        u=u,
        start_cost=at.cost,
        cost=at.cost,
        success=True,
        message="done",
        evaluations=1,
        failed=0,
    )
    end = JointEnd(
        u=u, evaluation=at, searches=(search,), best=0, uncertainty=uncertainty_at(fit, u)
    )
    return replace(
        ContactFitSolution(fit=fit, success=True, message="done", end=end, wall_s=1.0), **changes
    )


@pytest.fixture(scope="module")
def everything(fit_walker, soft, stiff, measured_bench):
    """Two trials fitted in everything that there is, somewhere near the start."""
    parameters = standard_parameters(
        fit_walker.variables, "right", LABELS, damping_by_zone=True, paths=True
    )
    parameters = parameters.changed([*parameters.by_name], frozen=False)
    fit = ContactFit(
        [soft, stiff], bench=measured_bench, parameters=parameters, walker=fit_walker, labels=LABELS
    )
    low, high = parameters.bounds
    return ended(
        fit,
        np.clip(np.random.default_rng(4).normal(0.0, 0.3, len(parameters)), 0.9 * low, 0.9 * high),
    )


@pytest.fixture(scope="module")
def contact_file(everything, tmp_path_factory):
    path = tmp_path_factory.mktemp("contact") / "contact.yaml"
    save_contact(everything.contact(("Made up.",)), path)
    return path


def test_a_table_of_the_fit_has_every_parameter_with_unit_and_interval_and_none_of_a_failed_one(
    everything,
):
    frame = everything.to_dataframe().set_index("name")
    assert dict(frame.value) == everything.values
    for item in everything.fit.parameters.items:
        assert frame.unit[item.name] == item.unit
        assert frame.low_95[item.name] <= frame.value[item.name] <= frame.high_95[item.name]
    assert frame.attrs["synthetic"] and "SYNTHETIC" in everything._repr_html_()
    failed = replace(everything, success=False, message="no search converged")
    with pytest.raises(FitError, match="no search converged"):
        failed.to_dataframe()
    assert "No result:" in failed._repr_html_() and "to_dataframe" not in failed._repr_html_()


@pytest.mark.parametrize("label", LABELS)
def test_applied_to_its_recording_the_contact_file_gives_the_fits_own_walk(
    everything, contact_file, label
):
    """To what samples 10 ms apart leave of curves that the fit knows at every instant."""
    trial = everything.fit.trials[LABELS.index(label)]
    own, result = everything.predict(trial, label, step_s=1e-3)
    applied = trial_with(trial, load_contact(contact_file))
    walk = simulate_trial(applied, step_s=1e-3)
    largest = np.abs(result.grf_W).max()
    np.testing.assert_allclose(walk.grf_W, result.grf_W, atol=1e-4 * largest)
    found = walk_metrics(walk, applied.prosthetic_plate)
    wanted = walk_metrics(result, trial.prosthetic_plate, comparison=own)
    for name in ("grf_rmse_bw", "cop_rmse_fl", "impulse_rmse_bws"):
        assert getattr(found, name) == pytest.approx(getattr(wanted, name), rel=1e-3), name


def test_applied_to_another_recording_it_gives_the_prediction_of_a_held_out_trial(
    everything, contact_file
):
    """A recording of the same walk that the fit has not seen: no height and no path of its own."""
    trial = everything.fit.trials[0]
    other = replace(trial, start_s=trial.start_s + 2e-3)
    wanted = everything.predict(other, None, step_s=1e-3)[1]
    walk = simulate_trial(trial_with(other, load_contact(contact_file)), step_s=1e-3)
    np.testing.assert_allclose(walk.grf_W, wanted.grf_W, atol=1e-4 * np.abs(wanted.grf_W).max())
    own = everything.predict(trial, "low_1", step_s=1e-3)[1]
    assert np.abs(wanted.grf_W[:-2] - own.grf_W[2 : len(wanted.grf_W)]).max() > 10.0, (
        "its own height and path do count"
    )


def test_on_the_bench_the_contact_files_foot_is_the_fits(
    everything, contact_file, soft, measured_bench
):
    contact = load_contact(contact_file)
    model = model_with(
        soft.model,
        {
            name: v
            for name, v in contact.values.items()
            if not name.startswith(("offset", "coordinate"))
        },
    )
    stiffness, _ = BenchStiffness(
        model.foot,
        fulcrums_m=measured_bench.fulcrum_m,
        heel=True,
        max_load_n=measured_bench.max_load_n,
    ).evaluate({})
    np.testing.assert_allclose(
        stiffness, everything.fit.bench_stiffness(everything.end.u), rtol=1e-9
    )


def test_the_contact_is_that_of_the_device_it_was_fitted_on_whatever_model_it_is_read_into(
    few_free,
):
    """Keel and support were not free."""
    fit = few_free("offset.height")
    contact, own = ended(fit, np.zeros(1)).contact(), fit.walker.model.foot
    other = model_with(load_model(resource("models/soft_support.yaml")), contact.values).foot
    assert other.keel == own.keel
    assert other.fulcrum.stiffness_n_per_m == own.fulcrum.stiffness_n_per_m


def test_the_contact_file_says_whose_it_is_and_which_heights_are_whose(everything, soft):
    contact, values = everything.contact(("One.", "Two.")), everything.values
    assert contact.verdict == ("One.", "Two.") and contact.converged and contact.strategy == "joint"
    assert (
        contact.subject.mass_kg == soft.subject.mass_kg
        and [trial.name for trial in contact.trials] == LABELS
    )
    half = 0.5 * (values["trial.low_1.height"] - values["trial.high_1.height"])
    assert [trial.height_m for trial in contact.trials] == pytest.approx([half, -half])
    assert contact.values["offset.height"] == pytest.approx(values["offset.height"])


def test_reading_a_fit_that_failed_raises_what_went_wrong(few_free, soft):
    fit = few_free("offset.height")
    failed = ended(fit, np.zeros(1), success=False, message="the walk fell over")
    for read in (
        lambda: failed.values,
        lambda: failed.walk_values,
        failed.contact,
        lambda: failed.predict(soft, None, step_s=2e-3),
        lambda: failed.all_values(None),
        lambda: failed.refitted_without(["low_1"]),
        failed.check,
    ):
        with pytest.raises(FitError, match="the fit failed: the walk fell over"):
            read()


def test_a_failed_fit_can_be_opened_by_who_says_that_it_failed(few_free):
    fit = few_free("offset.height")
    failed = ended(fit, np.array([0.5]), success=False, message="the walk fell over")
    assert failed.opened().values["offset.height"] == pytest.approx(0.005)
    told = " ".join(failure(failed))
    assert (
        told.startswith("NOT CONVERGED: the walk fell over")
        and "offset.height (" in told
        and "--starts" in told
    )


def test_priors_that_the_data_contradict_are_widened_once_and_both_costs_are_told(
    few_free, soft, fit_walker
):
    """With narrow priors height and alignment end far from what was believed; the foam, with a wide
    one, does not."""
    names = ("offset.height", "offset.alignment", "contact.forefoot.force")
    free = few_free(*names, **SHORT)
    narrow = free.parameters.changed(names[:1], scale=1e-3).changed(names[1:2], scale=1e-2)
    fit = ContactFit(
        [soft], walker=fit_walker, labels=["low_1"], parameters=narrow, options=free.options
    )
    found = solve(fit)
    told = found.contradiction
    assert set(told.sd_away) == set(names[:2]) and all(
        abs(away) > 3.0 for away in told.sd_away.values()
    )
    before = fit.evaluate(found.end.searches[0].u).cost
    assert (
        told.cost == pytest.approx(before, rel=1e-3)
        and told.cost_widened == found.end.evaluation.cost < told.cost
    )
    assert solve(free).contradiction is None
    scales = {
        name: found.fit.parameters.by_name[name].scale / narrow.by_name[name].scale
        for name in names
    }
    assert scales == pytest.approx({names[0]: 2.0, names[1]: 2.0, names[2]: 1.0})
    assert len(found.end.searches) == SHORT["starts"] + 1 and found.end.best == SHORT["starts"]


def test_solve_ends_at_the_lowest_of_its_searches(few_free):
    fit = few_free("offset.height", "contact.forefoot.force", **SHORT)
    found = solve(fit)
    assert found.success, found.message
    end, searches = found.end, found.end.searches
    assert end.searches[end.best].cost == min(s.cost for s in searches)
    assert fit.evaluate(end.u).cost == end.searches[end.best].cost == end.evaluation.cost
    assert found.values["offset.height"] == pytest.approx(0.01 * end.u[1])
    assert end.uncertainty.names == ("contact.forefoot.force", "offset.height")
    assert found.wall_s > 0.0
    assert [s.cost for s in end.alike()] == [
        s.cost for s in searches if not s.met and s.cost <= min(t.cost for t in searches) + 2.0
    ]


def test_what_is_held_with_a_prior_widens_the_errors_and_what_is_held_without_one_is_known(
    few_free,
):
    few = few_free("offset.height", "offset.alignment", step_s=4e-3)
    held, u = (
        [name for name in few.parameters.by_name if name not in few.parameters.names],
        np.zeros(2),
    )
    known = few.with_parameters(few.parameters.changed(held, prior=False))
    alone = uncertainty(few.parameters, u, few.evaluate(u).terms, few.joint.noise)
    np.testing.assert_array_equal(uncertainty_at(known, u).standard_error, alone.standard_error)
    assert np.all(uncertainty_at(few, u).standard_error > 1.5 * alone.standard_error)
    sure = few.with_parameters(few.parameters.changed(held, scale=1e-6))
    np.testing.assert_allclose(
        uncertainty_at(sure, u).standard_error, alone.standard_error, rtol=1e-4
    )


def test_a_converged_search_is_preferred_to_a_lower_one_that_is_not(few_free, monkeypatch):
    # to replace one of its names
    from vsf_drake.fit import solution as module  # noqa: PLC0415

    fit = few_free("offset.height")
    good, low = np.zeros(1), np.array([-0.2])
    searches = tuple(
        FitSearch(
            start=u,
            u=u,
            start_cost=1.0,
            cost=cost,
            success=success,
            message="as it ended",
            evaluations=1,
            failed=0,
        )
        for u, cost, success in ((low, 1.0, False), (good, 2.0, True))
    )
    monkeypatch.setattr(module, "run_searches", lambda *_, **__: searches)
    found = solve(fit)
    assert found.end.best == 1 and found.success
    np.testing.assert_array_equal(found.end.u, good)


def test_a_walk_that_fails_wherever_a_search_starts_ends_the_fit(few_free, monkeypatch):
    fit = few_free("offset.height", **SHORT)

    def broken(*_, **__):
        raise SimulationError("broke", time_s=0.2)

    monkeypatch.setattr(fit, "evaluate", broken)
    with pytest.raises(FitError, match=r"fails wherever a search starts: .*broke"):
        solve(fit)


def test_a_minimum_that_fails_at_the_reports_step_is_no_success(few_free, monkeypatch):
    fit = few_free("offset.height", starts=1, step_s=4e-3)
    walk = Walker.walk

    def fragile(self, *words, step_s, **options):
        if step_s < 3e-3:
            raise SimulationError("broke in small steps", time_s=0.2)
        return walk(self, *words, step_s=step_s, **options)

    monkeypatch.setattr(Walker, "walk", fragile)
    found = solve(fit)
    assert not found.success
    assert (
        "low_1 fails at the step of the report" in found.message
        and "broke in small steps" in found.message
    )


def test_without_a_trial_the_fit_is_searched_again_from_where_it_was(few_free, soft, stiff):
    fit = few_free(
        "offset.height", "trial.low_1.height", "trial.high_1.height", trials=[soft, stiff], **SHORT
    )
    found = solve(fit)
    fewer = found.refitted_without(["high_1"])
    assert fewer.fit.labels == ("low_1",)
    assert fewer.fit.parameters.names == ("offset.height", "trial.low_1.height")
    np.testing.assert_allclose(fewer.end.searches[0].start, fit.parameters.u(found.values)[:2])
    assert fewer.fit.options == fit.options and fewer.fit.walker is fit.walker
    with pytest.raises(FitError, match="no trial is left"):
        found.refitted_without(["low_1", "high_1"])


def test_without_a_bench_the_simulated_one_presses_the_fitted_foot(few_free, soft, stiff):
    """As the machine of a measured bench does, at the trials' fulcrums."""
    fit = few_free("contact.forefoot.force", trials=[soft, stiff])
    found = ended(fit, np.array([-1.0]))
    shown = simulated_bench(found)
    assert shown.fulcrum_mm == pytest.approx((66.0, 151.0))
    machine = BenchStiffness(fit.walker.model.foot, fulcrums_m=(0.066, 0.151), heel=True)
    expected = 1e-3 * machine.evaluate(found.all_values(None))[0]
    assert (*shown.fitted_n_per_mm, shown.heel_n_per_mm) == pytest.approx(expected.tolist())
    assert all(
        fitted < model
        for fitted, model in zip(shown.fitted_n_per_mm, shown.model_n_per_mm, strict=True)
    )
