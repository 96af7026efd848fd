"""What a fit is worth: null model, fulcrum sweep, what is left out, the bench."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.contact_fit import assessment as module
from vsf_drake.analysis.contact_fit.assessment import (
    RIGHT_WITHIN_M,
    Assessment,
    LeftOut,
    assess,
    bench_score,
    sweep_fulcrum,
)
from vsf_drake.analysis.metrics import stance_curve, walk_metrics
from vsf_drake.errors import FitError, SimulationError
from vsf_drake.files import resource
from vsf_drake.motion.trial import load_trial

SETTINGS = {"low_1": 0.066, "low_2": 0.066, "medium_1": 0.108, "high_1": 0.151}


def recording(name):
    return load_trial(resource(f"data/reference_subject/exact/{name}.yaml"))


@pytest.fixture(scope="module")
def trials():
    return {name: recording(name) for name in SETTINGS}


class Model:
    """A finished fit that walks as the unfitted model does."""

    def __init__(self, walker, trials):
        self.walker = walker
        self.fit = SimpleNamespace(
            trials=tuple(trials), labels=tuple(trial.path.stem for trial in trials), bench=None,
            options=SimpleNamespace(series=("vertical", "cop_fore_aft"), report_step_s=2e-3))
        self.asked, self.lock = [], threading.Lock()

    def check(self):
        pass

    def predict(self, trial, label, *, step_s, fulcrum_m=None):
        with self.lock:
            self.asked.append((trial.path.stem, label, step_s, fulcrum_m))
        walk = self.walker.walk(trial.trajectory, fulcrum_m=fulcrum_m or trial.fulcrum_m, start_s=trial.start_s,
                                end_s=trial.end_s, step_s=step_s, offsets=trial.offsets)
        result = self.walker.result(walk, trial, trial.offsets, energy=False)
        return compare(result, trial.prosthetic_plate), result

    def refitted_without(self, labels):
        raise AssertionError("not asked for")


class Curve(Model):
    """A fit of whose walks only the error is known: a function of the fulcrum's position."""

    def __init__(self, trials, error):
        super().__init__(None, trials)
        self.error = error

    def predict(self, trial, label, *, step_s, fulcrum_m=None):
        return None, self.error(trial.fulcrum_m if fulcrum_m is None else fulcrum_m)


@pytest.fixture
def errors_alone(monkeypatch):
    monkeypatch.setattr(module, "walk_metrics", lambda result, *_, **__: {"grf_rmse_bw": result})


def parabola(best, floor=0.02, width=0.05):
    """The square of the error is a parabola about `best`."""
    return lambda position: np.sqrt(floor**2 + (0.1 * (position - best) / width) ** 2)


def test_scores_are_the_metrics_of_fitted_and_held_out_trials_in_order(fit_walker, trials):
    model = Model(fit_walker, [trials["low_1"], trials["high_1"]])
    found = assess(model, [trials["medium_1"]], sweep=False, leave_out=False, floors={"medium_1": 0.01})
    assert [(s.label, s.role) for s in found.scores] == [
        ("low_1", "fitted"), ("high_1", "fitted"), ("medium_1", "held out")]
    assert [(name, label) for name, label, *_ in model.asked] == [
        ("low_1", "low_1"), ("high_1", "high_1"), ("medium_1", None)]
    assert [s.floor_grf_rmse_bw for s in found.scores] == [None, None, 0.01]
    for score in found.scores:
        trial = trials[score.label]
        comparison, result = model.predict(trial, None, step_s=2e-3)
        wanted = walk_metrics(result, trial.prosthetic_plate, comparison=comparison)
        for name in ("grf_rmse_bw", "cop_rmse_fl", "impulse_rmse_bws"):
            assert getattr(score.metrics, name) == pytest.approx(getattr(wanted, name), rel=1e-12)
        curves, weight = score.curves, wanted["body_weight_n"]
        np.testing.assert_allclose(curves["model_bw"] * weight, comparison.model)
        assert {len(curves[n]) for n in ("time_s", "model_bw", "measured_bw")} == {len(comparison.time_s)}
        np.testing.assert_allclose(curves["cop_model_fl"] * result.foot_length_m, comparison.stances[0].model_cop[:, 0])
        assert score.sweep is None
    held, fitted = found.mean("held out", "grf_rmse_bw"), found.mean("fitted", "grf_rmse_bw")
    assert held == found.scores[2].metrics.grf_rmse_bw
    assert fitted == pytest.approx(np.mean([s.metrics.grf_rmse_bw for s in found.scores[:2]]))
    assert found.mean("expected", "grf_rmse_bw") is None
    assert found.left_out == () and found.bench is None


def test_null_model_is_the_best_stretched_curve_of_another_fitted_trial(fit_walker, trials):
    """Worked out by hand: the resultant of each other fitted trial over 0-100 % of this one's stance."""
    fitted = [trials["low_1"], trials["high_1"]]
    model = Model(fit_walker, fitted)
    found = {s.label: s for s in assess(model, [trials["medium_1"]], sweep=False, leave_out=False).scores}
    for label, others in (("low_1", fitted[1:]), ("high_1", fitted[:1]), ("medium_1", fitted)):
        trial = trials[label]
        comparison, _ = model.predict(trial, None, step_s=2e-3)
        weight, stance = trial.subject.mass_kg * 9.81, comparison.stances[0].measured
        measured = np.linalg.norm(comparison.measured, axis=1) / weight
        errors = []
        for other in others:
            curve = stance_curve(other.prosthetic_plate, subject_mass_kg=other.subject.mass_kg)
            share = (comparison.time_s - stance.start_s) / stance.duration_s
            null = np.interp(share, np.linspace(0.0, 1.0, 101), curve, left=0.0, right=0.0)
            errors.append(np.sqrt(np.mean((null - measured)[comparison.scored] ** 2)))
        assert found[label].metrics.null_model_grf_rmse_bw == pytest.approx(min(errors), rel=1e-3), label


def test_a_single_fitted_trial_is_its_own_null_models_only_source(fit_walker, trials):
    model = Model(fit_walker, [trials["low_1"]])
    scores = assess(model, [trials["high_1"]], sweep=False).scores
    assert scores[0].metrics.null_model_grf_rmse_bw is None
    assert scores[1].metrics.null_model_grf_rmse_bw > 0.0


@pytest.mark.parametrize("best", [0.07, 0.1, 0.1234, 0.148])
def test_sweep_finds_the_vertex_of_an_exact_parabola_between_its_positions(errors_alone, trials, best):
    trial = replace(trials["low_1"], fulcrum_m=best + 0.9 * RIGHT_WITHIN_M)
    found = sweep_fulcrum(Curve([trial], parabola(best)), trial, None)
    assert found.best_mm == pytest.approx(1e3 * best, abs=1e-6)
    assert found.right and found.true_mm == 1e3 * trial.fulcrum_m
    fulcrum = trial.model.foot.fulcrum
    assert (found.fulcrum_mm[0], found.fulcrum_mm[-1]) == (1e3 * fulcrum.rearmost_m, 1e3 * fulcrum.foremost_m)
    assert found.grf_rmse_bw == pytest.approx([parabola(best)(1e-3 * x) for x in found.fulcrum_mm])
    wrong = replace(trial, fulcrum_m=best - 1.1 * RIGHT_WITHIN_M)
    assert not sweep_fulcrum(Curve([wrong], parabola(best)), wrong, None).right


@pytest.mark.parametrize("beyond", [0.02, 0.2])
def test_sweep_whose_errors_fall_to_an_end_has_its_best_there(errors_alone, trials, beyond):
    trial = trials["low_1"]
    fulcrum = trial.model.foot.fulcrum
    found = sweep_fulcrum(Curve([trial], parabola(beyond)), trial, None)
    assert found.best_mm == 1e3 * (fulcrum.rearmost_m if beyond < 0.1 else fulcrum.foremost_m)


def test_sweep_survives_walks_that_fail_and_says_where(errors_alone, trials):
    def error(position):
        if position > 0.12:
            raise SimulationError("broke", time_s=0.1)
        return parabola(0.1)(position)

    trial = replace(trials["low_1"], fulcrum_m=0.1)
    found = sweep_fulcrum(Curve([trial], error), trial, None)
    assert found.best_mm == pytest.approx(100.0) and found.right
    assert [np.isnan(e) for e in found.grf_rmse_bw] == [x > 120.0 for x in found.fulcrum_mm]


def test_sweep_beside_a_failed_walk_has_no_vertex_and_takes_the_lowest_position(errors_alone, trials):
    trial = trials["low_1"]
    positions = np.linspace(trial.model.foot.fulcrum.rearmost_m, trial.model.foot.fulcrum.foremost_m, 18)

    def error(position):
        if abs(position - positions[8]) < 1e-9:
            raise SimulationError("broke", time_s=0.1)
        return parabola(positions[7] + 1e-3)(position)

    assert sweep_fulcrum(Curve([trial], error), trial, None).best_mm == 1e3 * positions[7]


def test_sweep_all_of_whose_walks_fail_is_not_right(errors_alone, trials):
    def error(position):
        raise SimulationError("broke", time_s=0.1)

    found = sweep_fulcrum(Curve([trials["low_1"]], error), trials["low_1"], None)
    assert np.isnan(found.best_mm) and not found.right


def test_flat_errors_have_a_best_position_that_is_a_number(errors_alone, trials):
    found = sweep_fulcrum(Curve([trials["low_1"]], lambda position: 0.03), trials["low_1"], None)
    assert np.isfinite(found.best_mm)


class Refitting(Model):
    """Fits again without some labels, unless it `fails` without them, or does not do that at all."""

    def __init__(self, trials, *, fails=(), refits=True):
        super().__init__(None, trials)
        self.fails, self.refits, self.fitted_without = fails, refits, []

    def refitted_without(self, labels):
        self.fitted_without.append(labels)
        if not self.refits:
            return None
        if set(labels) & set(self.fails):
            raise FitError(f"cannot do without {labels}")
        return SimpleNamespace(left=labels)


@pytest.fixture
def scored(monkeypatch):
    """Each left-out trial's error is its fulcrum position."""
    def score(fewer, trial, label, name, *_):
        assert not hasattr(fewer, "left") or (label is None and name in fewer.left)
        return SimpleNamespace(metrics={"grf_rmse_bw": trial.fulcrum_m, "cop_rmse_fl": None})

    monkeypatch.setattr(module, "_trial_score", score)


def test_each_trial_and_each_stiffness_is_left_out_once(scored, trials):
    model = Refitting([trials[name] for name in ("low_1", "low_2", "high_1")])
    found = assess(model, sweep=False).left_out
    assert [(row.kind, row.left_out) for row in found] == [
        ("trial", ("low_1",)), ("trial", ("low_2",)), ("trial", ("high_1",)),
        ("stiffness", ("low_1", "low_2")), ("stiffness", ("high_1",))]
    assert [row.grf_rmse_bw for row in found] == pytest.approx([0.066, 0.066, 0.151, 0.066, 0.151])
    assert all(row.cop_rmse_fl is None and not row.failed for row in found)
    assert len(model.fitted_without) == 4, "the one stiff trial is a trial and a stiffness, fitted without once"


def test_one_stiffness_cannot_be_left_out_of_itself(scored, trials):
    found = assess(Refitting([trials["low_1"], trials["low_2"]]), sweep=False).left_out
    assert [row.kind for row in found] == ["trial", "trial"]


def test_one_trial_leaves_nothing_out(scored, trials):
    model = Refitting([trials["low_1"]])
    assert assess(model, sweep=False).left_out == () and not model.fitted_without
    assert assess(Refitting([trials["low_1"], trials["high_1"]]), sweep=False, leave_out=False).left_out == ()


def test_a_fit_without_a_trial_that_fails_is_told(scored, trials):
    model = Refitting([trials["low_1"], trials["high_1"]], fails=("high_1",))
    rows = {row.left_out: row for row in assess(model, sweep=False).left_out if row.kind == "trial"}
    assert "cannot do without" in rows["high_1",].failed and rows["high_1",].grf_rmse_bw is None
    assert rows["low_1",].failed == "" and rows["low_1",].grf_rmse_bw == pytest.approx(0.066)


def test_a_strategy_that_does_not_fit_again_leaves_nothing_out(scored, trials):
    assert assess(Refitting([trials["low_1"], trials["high_1"]], refits=False), sweep=False).left_out == ()


def test_the_bench_is_scored_in_newtons_per_millimetre(measured_bench):
    measured = np.array([*measured_bench.stiffness_n_per_m, measured_bench.heel_stiffness_n_per_m])
    off = 1e3 * np.array([1.0, -1.0, 0.0, 2.0, 0.0, 5.0])
    model = SimpleNamespace(fit=SimpleNamespace(bench=measured_bench), bench_stiffness=lambda: measured + off)
    found = bench_score(model)
    assert found["fulcrum_mm"] == pytest.approx([66, 87, 108, 129, 151])
    assert found["measured_n_per_mm"] == pytest.approx([10.0, 13.739, 18.440, 24.316, 32.0])
    assert np.subtract(found["model_n_per_mm"], found["measured_n_per_mm"]) == pytest.approx([1, -1, 0, 2, 0], abs=1e-9)
    assert found["rmse_n_per_mm"] == pytest.approx(np.sqrt(6 / 5)), "without the heel"
    assert (found["heel_measured_n_per_mm"], found["heel_model_n_per_mm"]) == pytest.approx((65.0, 70.0))
    without = replace(measured_bench, heel_stiffness_n_per_m=None)
    model = SimpleNamespace(fit=SimpleNamespace(bench=without),
                            bench_stiffness=lambda: np.array(without.stiffness_n_per_m))
    assert bench_score(model)["heel_model_n_per_mm"] is None and bench_score(model)["rmse_n_per_mm"] == 0.0
    assert bench_score(SimpleNamespace(fit=SimpleNamespace(bench=None))) is None


def test_a_fit_that_failed_is_not_judged(trials):
    class Failed(Model):
        def check(self):
            raise FitError("the fit failed: it fell over")

    with pytest.raises(FitError, match="it fell over"):
        assess(Failed(None, [trials["low_1"]]))


def test_a_walk_that_fails_with_the_fitted_parameters_is_told(trials):
    def error(position):
        raise SimulationError("broke", time_s=0.1)

    with pytest.raises(SimulationError, match="broke"):
        assess(Curve([trials["low_1"]], error), sweep=False)


def test_progress_names_what_is_done(scored, trials):
    told = []
    assess(Refitting([trials["low_1"], trials["high_1"]]), [trials["medium_1"]], sweep=False,
           progress=lambda what, share: told.append((what, share)))
    assert [what for what, _ in told] == [
        "scoring low_1", "scoring high_1", "scoring medium_1", "fitting without low_1", "fitting without high_1",
        "fitting without low_1", "fitting without high_1"]
    assert all(0.0 <= share < 1.0 for _, share in told)


def test_held_out_recordings_of_one_file_name_are_told_by_their_folder(scored, trials, monkeypatch):
    model = Refitting([trials["low_1"]])
    named = []
    monkeypatch.setattr(module, "_trial_score", lambda _, trial, label, name, *__: named.append((label, name)))
    assess(model, [replace(trials["high_1"], path=Path("/there/low_1.yaml"))], sweep=False)
    assert named == [("low_1", "low_1"), (None, "there/low_1")]


def test_means_leave_out_what_is_not_known():
    scores = tuple(SimpleNamespace(role="fitted", metrics={"cop_rmse_fl": value}) for value in (0.02, None, 0.04))
    assert Assessment(scores=scores, left_out=(), bench=None).mean("fitted", "cop_rmse_fl") == pytest.approx(0.03)
    assert LeftOut(kind="trial", left_out=("a",), grf_rmse_bw=None, cop_rmse_fl=None).failed == ""
