"""What a fit is worth: null model, fulcrum sweep, what is left out, the bench; in numbers and in
words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_fit import (
    METRICS,
    made_curves,
    made_layer_row,
    made_layers,
    made_search,
    made_uncertainty,
    recording,
)

from vsf_drake.base.errors import FitError
from vsf_drake.fit import assessment as module
from vsf_drake.fit.assessment import (
    LEFT_OUT,
    Assessment,
    BenchRow,
    Beside,
    LeftOut,
    SimulatedBench,
    TrialScore,
    assess,
    bench_score,
    marked_verdict,
    sweep_fulcrum,
    verdict,
)
from vsf_drake.fit.paper import PaperEnd
from vsf_drake.fit.solution import Contradiction, JointEnd
from vsf_drake.fit.solve import Pair
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.walks.angle_errors import AngleErrorRow
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.fulcrum_sweep import RIGHT_WITHIN_M, FulcrumSweep
from vsf_drake.walks.metrics import stance_curve, walk_metrics


@pytest.fixture(scope="module")
def trials():
    return {name: recording(name) for name in ("low_1", "low_2", "medium_1", "high_1")}


@pytest.fixture(autouse=True)
def no_machine(monkeypatch):
    """Fits that are made up here have no foot to press."""
    monkeypatch.setattr(module, "simulated_bench", lambda _: None)


class Model:
    """A finished fit that walks as the unfitted model does."""

    def __init__(self, walker, trials):
        self.walker, self.end = walker, None
        self.fit = SimpleNamespace(
            trials=tuple(trials),
            labels=tuple(trial.path.stem for trial in trials),
            bench=None,
            machine=None,
            options=SimpleNamespace(series=("vertical", "cop_fore_aft"), report_step_s=2e-3),
        )
        self.asked = []

    def check(self):
        pass

    def predict(self, trial, label, *, step_s):
        self.asked.append((trial.path.stem, label))
        walk = self.walker.walk_trial(trial, step_s=step_s)
        result = self.walker.result(walk, trial, trial.offsets, energy=False)
        return compare(result, trial.prosthetic_plate), result


def test_scores_are_the_metrics_of_fitted_and_held_out_trials_beside_the_harder_null(
    fit_walker, trials
):
    """By hand: the resultant of each other fitted trial over 0-100 % of this one's stance; of two
    settings, 66 and 151 mm, the harder null is what lies between them at 108 mm."""
    fitted = [trials["low_1"], trials["high_1"]]
    model = Model(fit_walker, fitted)
    found = assess(
        model,
        [trials["medium_1"]],
        sweep=False,
        angle_errors=False,
        layers=False,
        leave_out=False,
        floors={"medium_1": 0.01},
    )
    assert model.asked == [
        ("low_1", "low_1"),
        ("high_1", "high_1"),
        ("medium_1", None),
    ]
    others = {"low_1": fitted[1:], "high_1": fitted[:1], "medium_1": fitted}
    assert [(s.label, s.role, s.floor_grf_rmse_bw) for s in found.scores] == [
        ("low_1", "fitted", None),
        ("high_1", "fitted", None),
        ("medium_1", "held out", 0.01),
    ]
    for score in found.scores:
        trial = trials[score.label]
        comparison, result = model.predict(trial, None, step_s=2e-3)
        wanted = walk_metrics(result, trial.prosthetic_plate, comparison=comparison)
        weight = wanted.body_weight_n
        for name in ("grf_rmse_bw", "cop_rmse_fl", "impulse_rmse_bws"):
            assert getattr(score.metrics, name) == pytest.approx(getattr(wanted, name), rel=1e-12)
        np.testing.assert_allclose(score.curves.model_bw * weight, comparison.model)
        np.testing.assert_allclose(
            score.curves.cop_model_fl * result.foot_length_m, comparison.stances[0].model_cop[:, 0]
        )
        stance, nulls = comparison.stances[0].measured, []
        measured = np.linalg.norm(comparison.measured, axis=1) / weight
        for other in others[score.label]:
            curve = stance_curve(other.prosthetic_plate, subject_mass_kg=other.subject.mass_kg)
            share = (comparison.time_s - stance.start_s) / stance.duration_s
            nulls.append(np.interp(share, np.linspace(0.0, 1.0, 101), curve, left=0.0, right=0.0))
        beyond = (trial.fulcrum_m - 0.066) / (0.151 - 0.066)
        harder = nulls[0] if len(nulls) == 1 else (1.0 - beyond) * nulls[0] + beyond * nulls[1]
        single = min(np.sqrt(np.mean((null - measured)[comparison.scored] ** 2)) for null in nulls)
        error = np.sqrt(np.mean((harder - measured)[comparison.scored] ** 2))
        assert score.metrics.null_model_grf_rmse_bw == pytest.approx(error, rel=1e-3), score.label
        assert score.metrics.stretched_null_grf_rmse_bw == pytest.approx(single, rel=1e-3), (
            score.label
        )
        assert error <= single, "as it is called: on these walks"
    held, mean = found.mean("held out", "grf_rmse_bw"), found.mean("fitted", "grf_rmse_bw")
    assert held == found.scores[2].metrics.grf_rmse_bw
    assert mean == pytest.approx(np.mean([s.metrics.grf_rmse_bw for s in found.scores[:2]]))
    assert found.left_out == () and found.bench is None
    alone = assess(
        Model(fit_walker, fitted[:1]), [fitted[1]], sweep=False, angle_errors=False, layers=False
    ).scores
    assert (
        alone[0].metrics.null_model_grf_rmse_bw is None
        and alone[1].metrics.null_model_grf_rmse_bw > 0.0
    )
    assert alone[1].metrics.null_model_grf_rmse_bw == alone[1].metrics.stretched_null_grf_rmse_bw


# lower ones would strike once more in the window
@pytest.mark.parametrize("true_m", [0.0031, 0.0064])
def test_the_own_height_of_a_held_out_trial_made_its_plate_and_is_said_to_be_no_prediction(
    fit_walker, trials, true_m
):
    """The plate is the model's own force with the foot raised, in the finer step of the report."""
    trial, model = trials["medium_1"], Model(fit_walker, [trials["low_1"]])
    raised = replace(
        trial, offsets=replace(trial.offsets, height_m=trial.offsets.height_m + true_m)
    )
    _, made = model.predict(raised, None, step_s=1e-3)
    plate = PlateRecording(made.time_s, made.grf_W, made.cop_W, np.zeros(len(made.time_s)), True)
    seen = replace(trial, plates={trial.subject.prosthetic_side: plate})
    known = {"sweep": False, "angle_errors": False, "layers": False, "leave_out": False}
    own, bare = (
        assess(model, [seen], own_height=asked, **known).scores[1] for asked in (True, False)
    )
    assert own.own_height_m == pytest.approx(true_m, abs=2e-4) and bare.own_height_m is None
    assert own.metrics.grf_rmse_bw < 0.005 and bare.metrics.grf_rmse_bw > 0.05
    assert own.metrics.null_model_grf_rmse_bw == bare.metrics.null_model_grf_rmse_bw
    said = words(None, own)
    assert "no prediction" in said and f"medium_1 {1e3 * own.own_height_m:+.1f} mm." in said
    assert "at the bound" in words(
        None, replace(own, own_height_m=-0.01)
    ) and "no prediction" not in words(None, bare)


# The sweep, of walks of which only the error is known: a function of the fulcrum's position.


@pytest.fixture
def sweep_of(monkeypatch, trials):
    def make(error, fulcrum_m=0.066):
        trial = replace(trials["low_1"], fulcrum_m=fulcrum_m)
        model = SimpleNamespace(
            fit=SimpleNamespace(walker=None), fitted_for=lambda trial, label: {"values": {}}
        )
        monkeypatch.setattr(
            module,
            "fulcrum_errors",
            lambda walker, trial, positions, values: np.array([error(x) for x in positions]),
        )
        return sweep_fulcrum(model, trial, None)

    return make


def parabola(best, floor=0.02, width=0.05):
    """The square of the error is a parabola about `best`."""
    return lambda position: np.sqrt(floor**2 + (0.1 * (position - best) / width) ** 2)


def failing(error, where):
    return lambda position: np.nan if where(position) else error(position)


@pytest.mark.parametrize("best", [0.07, 0.1234])
def test_sweep_finds_the_vertex_of_an_exact_parabola_between_its_positions(sweep_of, trials, best):
    found = sweep_of(parabola(best), best + 0.9 * RIGHT_WITHIN_M)
    assert found.best_mm == pytest.approx(1e3 * best, abs=1e-6)
    assert (
        found.right
        and found.true_mm == pytest.approx(1e3 * (best + 0.9 * RIGHT_WITHIN_M))
        and not found.at_end
    )
    fulcrum = trials["low_1"].model.foot.fulcrum
    assert (found.fulcrum_mm[0], found.fulcrum_mm[-1]) == (
        1e3 * fulcrum.rearmost_m,
        1e3 * fulcrum.foremost_m,
    )
    assert found.grf_rmse_bw == pytest.approx([parabola(best)(1e-3 * x) for x in found.fulcrum_mm])
    assert not sweep_of(parabola(best), best - 1.1 * RIGHT_WITHIN_M).right


def test_sweep_at_an_end_or_beside_failed_walks_takes_the_lowest_position(sweep_of, trials):
    fulcrum = trials["low_1"].model.foot.fulcrum
    assert (
        sweep_of(parabola(0.02)).best_mm == 1e3 * fulcrum.rearmost_m
        and sweep_of(parabola(0.02)).at_end
    )
    assert sweep_of(parabola(0.2)).best_mm == 1e3 * fulcrum.foremost_m
    found = sweep_of(failing(parabola(0.1), lambda position: position > 0.12), 0.1)
    assert found.best_mm == pytest.approx(100.0) and found.right
    assert [error is None for error in found.grf_rmse_bw] == [x > 120.0 for x in found.fulcrum_mm]
    positions = np.linspace(fulcrum.rearmost_m, fulcrum.foremost_m, 18)
    beside = failing(
        parabola(positions[7] + 1e-3), lambda position: abs(position - positions[8]) < 1e-9
    )
    assert sweep_of(beside).best_mm == 1e3 * positions[7]
    lost = sweep_of(failing(parabola(0.1), lambda position: True))
    assert lost.best_mm is None and lost.right is False
    assert np.isfinite(sweep_of(lambda position: 0.03).best_mm), "errors that are all the same"


# What is left out in turn.


class Refitting(Model):
    """Fits again without some labels, unless it `fails` without them; none by the paper's
    procedure."""

    # it holds nothing
    def __init__(self, trials, *, fails=(), end=JointEnd(None, None, None, (), 0)):  # noqa: B008
        super().__init__(None, trials)
        self.fails, self.end, self.fitted_without = fails, end, []

    def refitted_without(self, labels):
        self.fitted_without.append(labels)
        if set(labels) & set(self.fails):
            raise FitError(f"cannot do without {labels}")
        return SimpleNamespace(left=labels)


@pytest.fixture
def scored(monkeypatch):
    """Each left-out trial's error is its fulcrum position."""

    def score(fewer, trial, label, name, *_):
        assert not hasattr(fewer, "left") or (label is None and name in fewer.left)
        at = trial.fulcrum_m
        return SimpleNamespace(
            metrics=replace(METRICS, grf_rmse_bw=at, cop_rmse_fl=None, cop_ml_rmse_fl=0.5 * at)
        )

    monkeypatch.setattr(module, "_trial_score", score)


def test_each_trial_and_each_stiffness_is_left_out_once(scored, trials):
    model = Refitting([trials[name] for name in ("low_1", "low_2", "high_1")])
    found = assess(model, sweep=False, angle_errors=False, layers=False).left_out
    assert [(row.kind, row.left_out) for row in found] == [
        ("trial", ("low_1",)),
        ("trial", ("low_2",)),
        ("trial", ("high_1",)),
        ("stiffness", ("low_1", "low_2")),
        ("stiffness", ("high_1",)),
    ]
    assert [row.error_bw for row in found] == pytest.approx([0.066, 0.066, 0.151, 0.066, 0.151])
    assert all(row.number("cop_rmse_fl") is None and not row.failed for row in found)
    assert [row.number("cop_ml_rmse_fl") for row in found] == pytest.approx(
        [0.5 * row.error_bw for row in found]
    )
    assert len(model.fitted_without) == 4, (
        "the one stiff trial is a trial and a stiffness, fitted without once"
    )


def test_nothing_is_left_out_of_one_trial_stiffness_or_of_the_papers_fit_and_failures_are_told(
    scored, trials
):
    one, same, two = (
        [trials[name] for name in names]
        for names in (("low_1",), ("low_1", "low_2"), ("low_1", "high_1"))
    )
    assert assess(Refitting(one), sweep=False, angle_errors=False, layers=False).left_out == ()
    assert [
        row.kind
        for row in assess(Refitting(same), sweep=False, angle_errors=False, layers=False).left_out
    ] == ["trial", "trial"]
    assert (
        assess(
            Refitting(two), sweep=False, angle_errors=False, layers=False, leave_out=False
        ).left_out
        == ()
    )
    assert (
        assess(Refitting(two, end=None), sweep=False, angle_errors=False, layers=False).left_out
        == ()
    )
    rows = {
        row.left_out: row
        for row in assess(
            Refitting(two, fails=("high_1",)), sweep=False, angle_errors=False, layers=False
        ).left_out
    }
    assert "cannot do without" in rows["high_1",].failed and rows["high_1",].error_bw is None
    assert rows["low_1",].failed == "" and rows["low_1",].error_bw == pytest.approx(0.066)


def test_held_out_recordings_of_one_file_name_are_told_by_their_folder(trials, monkeypatch):
    named = []
    monkeypatch.setattr(
        module, "_trial_score", lambda _, trial, label, name, *__: named.append((label, name))
    )
    assess(
        Refitting([trials["low_1"]]),
        [replace(trials["high_1"], path=Path("/there/low_1.yaml"))],
        sweep=False,
        angle_errors=False,
        layers=False,
    )
    assert named == [("low_1", "low_1"), (None, "there/low_1")]


def test_the_bench_is_scored_in_newtons_per_millimetre_and_millimetres_with_the_heel_apart(
    bench_curves,
):
    stiffness = np.array([*bench_curves.stiffness_n_per_m, bench_curves.heel_stiffness_n_per_m])
    displaced = np.array([*bench_curves.mid_range_m, bench_curves.heel_mid_range_m])

    def score(bench, heel=True):
        end = None if heel else -1
        return bench_score(
            SimpleNamespace(
                all_values=lambda label: {},
                fit=SimpleNamespace(
                    walker=SimpleNamespace(model=ModelParameters()),
                    bench=bench,
                    machine=SimpleNamespace(
                        evaluate=lambda values: (
                            (stiffness + 1e3 * np.array([1.0, -1.0, 0.0, 2.0, 0.0, 5.0]))[:end],
                            None,
                        ),
                        displacement=lambda values: (
                            (displaced + 1e-3 * np.array([0.3, -0.3, 0, 0.4, 0, 2.0]))[:end],
                            None,
                        ),
                    ),
                ),
            )
        )

    found = score(bench_curves)
    assert found.fulcrum_mm == pytest.approx([66, 87, 108, 129, 151])
    for row, apart, rms, heel in (
        (found.stiffness, [1, -1, 0, 2, 0], np.sqrt(6 / 5), 5.0),
        (found.mid_range, [0.3, -0.3, 0.0, 0.4, 0.0], np.sqrt(0.34 / 5), 2.0),
    ):
        assert np.subtract(row.model, row.measured) == pytest.approx(apart, abs=1e-9)
        assert row.rmse == pytest.approx(rms), "without the heel"
        assert row.heel_model - row.heel_measured == pytest.approx(heel)
    assert found.stiffness.measured[0] == pytest.approx(1e-3 * stiffness[0])
    assert found.mid_range.uncertainty == pytest.approx(0.5)
    bare = replace(
        bench_curves, mid_range_m=None, heel_mid_range_m=None, mid_range_uncertainty_m=None
    )
    assert score(bare).mid_range is None
    assert (
        score(replace(bare, heel_stiffness_n_per_m=None), heel=False).stiffness.heel_model is None
    )
    assert score(None) is None


# In words: each sentence appears where its numbers are so, and nowhere else.


def trial_score(
    label="soft", role="fitted", error=0.02, null=None, floor=None, sweep=None, unknown=""
):
    return TrialScore(
        label=label,
        role=role,
        floor_grf_rmse_bw=floor,
        sweep=sweep,
        curves=made_curves(),
        metrics=replace(
            METRICS,
            grf_rmse_bw=error,
            null_model_grf_rmse_bw=null,
            stretched_null_grf_rmse_bw=null and null + 0.01,
            null_model_unknown=unknown,
        ),
    )


def sweep(right=True, best_mm=100.0, at_end=False):
    return FulcrumSweep(
        fulcrum_mm=(70.0, 100.0),
        grf_rmse_bw=(0.03, 0.02),
        true_mm=100.0,
        best_mm=best_mm,
        right=right,
        at_end=at_end,
    )


def solution(
    *,
    fulcrums=(0.066, 0.151),
    ratios=(0.8,),
    searches=(10.0,),
    lost=(),
    late=False,
    contradiction=None,
    **uncertainty,
):
    """Four parameters, of which the curve's and the trial's belong to no foot."""
    known = made_uncertainty(
        **{
            "names": (
                "offset.height",
                "contact.heel.force",
                "curve.knee_angle_r.0",
                "trial.soft.height",
            ),
            "unidentified": (),
            "singular_values": np.array([3.0, 2.0, 1.5, 0.4]),
            "at_bound": (),
            "together": (),
        }
        | uncertainty
    )
    terms = [
        SimpleNamespace(trial=f"soft{i}", name="vertical", residual=np.array([r]))
        for i, r in enumerate(ratios)
    ]
    end = JointEnd(
        u=np.zeros(1),
        evaluation=SimpleNamespace(terms=terms),
        uncertainty=known,
        best=0,
        late=late,
        searches=(
            *(made_search(cost=cost) for cost in searches),
            *(made_search(cost=cost, success=False) for cost in lost),
        ),
    )
    return SimpleNamespace(
        fit=SimpleNamespace(
            walker=SimpleNamespace(model=ModelParameters()),
            trials=[SimpleNamespace(fulcrum_m=x, synthetic=False) for x in fulcrums],
        ),
        end=end,
        message="done",
        contradiction=contradiction,
    )


def bench(off=0.5, heel=(65.0, 67.25), mid_range=None):
    def beside(rmse, heel):
        return Beside(
            uncertainty=0.5,
            measured=(),
            model=(),
            heel_measured=heel[0],
            heel_model=heel[1],
            rmse=rmse,
        )

    return BenchRow(
        name="a foot",
        synthetic=False,
        max_load_n=600.0,
        fulcrum_mm=(),
        stiffness=beside(off, heel),
        mid_range=None if mid_range is None else beside(*mid_range),
    )


def words(found=None, *scores, left_out=(), measured=None, angle_errors=(), alone=None):
    text = verdict(
        found or solution(),
        Assessment(
            scores=(trial_score(), *scores),
            left_out=left_out,
            bench=measured,
            angle_errors=angle_errors,
            simulated_bench=alone,
        ),
    )
    assert all(
        sentence.endswith(".") and "nan" not in sentence and "None" not in sentence
        for sentence in text
    )
    return " ".join(text)


HELD = [
    trial_score("good", "held out", 0.02, null=0.03),
    trial_score("bad", "held out", 0.04, null=0.03),
    trial_score("even", "held out", 0.03, null=0.03),
]


def left(error):
    return dict.fromkeys(LEFT_OUT) | {"grf_rmse_bw": error}


LEFT = (
    LeftOut(kind="trial", left_out=("a",), scores=left(0.03)),
    LeftOut(kind="trial", left_out=("b",), scores=left(0.05)),
    LeftOut(kind="trial", left_out=("c",), scores=left(None), failed="fell over"),
    LeftOut(kind="stiffness", left_out=("a", "b"), scores=left(0.08)),
)
FLOORS = [
    trial_score("low", "fitted", 0.01, floor=0.02),
    trial_score("b", "held out", 0.04, floor=0.03),
]
DISTURBED = [
    AngleErrorRow(
        role=role,
        sd_deg=sd,
        walks=28,
        failed=0,
        grf_rmse_bw=error,
        grf_rmse_bw_worst=error,
        beats_null=beaten,
        beats_null_of=28 * (sd < 1.0),
    )
    for role, sd, error, beaten in (
        ("held out", 0.0, 0.026, 24),
        ("held out", 0.5, 0.061, 10),
        ("held out", 1.0, 0.104, 0),
        ("fitted", 0.5, 0.011, 28),
    )
]
SWEPT = [
    trial_score("a", "held out", sweep=sweep()),
    trial_score("b", "held out", sweep=sweep(at_end=True)),
    trial_score("c", "held out", sweep=sweep(right=False, best_mm=130.4)),
]
ALONE = SimulatedBench(
    fulcrum_mm=(66.0, 151.0),
    fitted_n_per_mm=(4.7, 7.0),
    heel_n_per_mm=49.2,
    model_n_per_mm=(16.9, 33.0),
    model_heel_n_per_mm=65.0,
)
PRIORS = Contradiction(
    sd_away={"coordinate.hip_adduction_r": 3.54, "offset.inversion": -3.2},
    factor=2.0,
    cost=81.26,
    cost_widened=60.0,
)
KNOWN = {
    "unidentified": ("contact.heel.force", "curve.knee_angle_r.0", "trial.soft.height"),
    "at_bound": ("offset.height",),
    "together": (
        Pair(("offset.height", "contact.heel.force"), -0.97),
        Pair(("offset.height", "trial.soft.height"), 0.99),
    ),
}


@pytest.mark.parametrize(
    ("text", "there", "absent"),
    [
        (
            lambda: words(None, trial_score(error=0.04)),
            [
                "left with 3.0 % body weight",
                "paper's fitted trial with 5.3 %",
                "No trial was held out",
                "No bench was given",
            ],
            [
                "one stiffness",
                "left out",
                "fulcrum fits best",
                "too small",
                "Not identified",
                "Ended at a bound",
                "Known only together",
                "did not converge",
                "Below what",
                "displacement",
            ],
        ),
        (
            lambda: words(solution(fulcrums=(0.1, 0.1)), *HELD),
            [
                "one stiffness does not identify the model",
                "3 held-out trials: 3.0 % body weight",
                "at worst 4.0 % (bad)",
                "no nearer than the null model in bad, even.",
                "the nearest of them, is 3.0 % off on average. Physics alone is "
                "nearer than the null model in 1 of 3.",
            ],
            ["No trial was held out", "single curve"],
        ),
        (
            lambda: words(None, *HELD),
            [
                "interpolated to their settings, is 3.0 % off on average, the nearest single curve "
                "4.0 %."
            ],
            ["the nearest of them"],
        ),
        (
            lambda: words(None, trial_score("cut", "held out", unknown="cut")),
            [
                (
                    "null model's error is not known of cut: no stance of this walk was seen from "
                    "strike to lift-off."
                )
            ],
            ["stretched"],
        ),
        (
            lambda: words(
                None,
                *(
                    trial_score(label, "held out", unknown=why)
                    for label, why in (("cut", "cut"), ("lone", "alone"))
                ),
            ),
            [
                "not known of lone: no curve of another walk",
                "not known of cut: no stance of this walk was seen",
            ],
            [],
        ),
        (
            lambda: words(solution(fulcrums=(0.100, 0.1004))),
            ["one stiffness does not identify the model"],
            [],
        ),
        (
            lambda: words(alone=ALONE),
            [
                (
                    "No bench was given. On a simulated one (200 to 600 N) the fitted foot has 4.7 "
                    "N/mm at 66 mm (the model before the fit 16.9), 7.0 N/mm at 151 mm (the model "
                    "before the fit 33.0) and 49.2 N/mm at the heel (65.0)"
                )
            ],
            ["cannot bear"],
        ),
        (
            lambda: words(alone=replace(ALONE, fitted_n_per_mm=None, heel_n_per_mm=None)),
            ["the fitted foot cannot bear 600 N"],
            ["N/mm at"],
        ),
        (
            lambda: words(solution(contradiction=PRIORS)),
            [
                (
                    "The priors contradict the data: coordinate.hip_adduction_r by +3.5 standard "
                    "deviations, offset.inversion by -3.2 standard deviations. The results are "
                    "those with these priors 2 times as wide, at a cost of 60.0; as they were it "
                    "was 81.3"
                )
            ],
            ["did not converge"],
        ),
        (
            lambda: words(solution(contradiction=replace(PRIORS, cost_widened=None))),
            ["2 times as wide the fit did not converge", "at a cost of 81.3"],
            ["as they were it was"],
        ),
        (lambda: words(None, HELD[0]), ["stretched"], ["no nearer than", "for itself"]),
        (
            lambda: words(None, HELD[0], angle_errors=DISTURBED),
            [
                (
                    "for itself: 0.5° 6.1 % body weight, nearer than the null model in 10 of 28 "
                    "draws; 1° 10.4 % body weight. The value that applies"
                )
            ],
            ["2.6 %", "1.1 %"],
        ),
        (lambda: words(None, *FLOORS), ["happen to cancel: low."], []),
        (
            lambda: words(left_out=LEFT),
            [
                (
                    "without each trial in turn, the one left out is predicted within 3.0 % to "
                    "5.0 % body"
                ),
                (
                    "without each stiffness in turn, the one left out is predicted within 8.0 % to "
                    "8.0 %"
                ),
                "The fit without c failed.",
            ],
            [],
        ),
        (
            lambda: words(left_out=(LEFT[0], replace(LEFT[0], kind="stiffness"))),
            ["without each trial"],
            ["each stiffness"],
        ),
        (
            lambda: words(None, *SWEPT),
            [
                "where it really stood in 2 of 3 trials; 2 of them could have erred to both sides",
                "c: the fulcrum fits best at 130 mm, but stood at 100 mm.",
            ],
            ["a: the fulcrum"],
        ),
        (
            lambda: words(measured=bench(0.5, mid_range=(0.3, (5.0, 7.0)))),
            [
                "0.50 N/mm off",
                "still the foot of the bench",
                "heel +2.25 N/mm",
                "0.30 mm off",
                "as near as",
                "+2.00 mm off",
            ],
            ["N/mm: another foot", "farther off"],
        ),
        (
            lambda: words(measured=bench(1.5, heel=(None, None), mid_range=(0.5, (5.0, 4.0)))),
            ["1.50 N/mm off", ": another foot", "farther off than", "-1.00 mm off"],
            ["still the foot", "heel +", "as near"],
        ),
        (
            lambda: words(solution(ratios=(0.5, 1.0, 2.34), **KNOWN)),
            [
                "Residuals are 0.5 to 2.3 times that noise",
                "intervals are too small: soft2 vertical (2.3 times).",
                "1 of 3 free parameters that all trials share are determined by the data",
                "1 directions are determined less by the data than by the prior",
                "mostly determined by the prior: contact.heel.force.",
                "Ended at a bound, their errors mean nothing: offset.height.",
                "Known only together: offset.height and contact.heel.force (-0.97).",
            ],
            ["soft.height"],
        ),
        (
            lambda: words(solution(searches=(10.0, 11.5, 14.0), lost=(6.0, 9.5))),
            [
                "2 of 5 searches ended alike (cost within 2 of 10.0)",
                "2 did not converge",
                "got to a lower cost, 6.0: allow more iterations",
            ],
            [],
        ),
        (
            lambda: words(solution(late=True)),
            ["--time-limit ended the fit before its searches were done"],
            [],
        ),
        (lambda: words(solution(lost=(9.5,))), [], ["allow more iterations", "--time-limit"]),
    ],
)
def test_each_sentence_appears_where_its_numbers_are_so(text, there, absent):
    text = text()
    for part in there:
        assert part in text
    for part in absent:
        assert part not in text


def test_the_papers_fit_is_told_to_know_nothing_of_its_errors():
    paper = solution(fulcrums=(0.1,))
    paper.end = PaperEnd(state=None, values={}, initial_values={}, converged=True, stopped_by="")
    text = words(paper, measured=bench())
    assert "to the resultant force alone" in text and "It ended with: done." in text
    assert not any(part in text for part in ("searches", "told by the data", "times that noise"))


def test_what_tells_most_and_what_warns_is_marked_for_page_and_screen():
    """Each layer of the made-up held-out trial has one error in all its scores: 5, 4.1 and 4.2 %;
    its own is 2 %."""
    held, worse = (
        trial_score("good", "held out", 0.02, null=0.05, sweep=sweep()),
        trial_score("other", "held out", 0.06, null=0.05, sweep=sweep(right=False, best_mm=130.4)),
    )
    layers = made_layers(made_layer_row("good", (0.05, 0.041, 0.042), null=0.05))
    told = Assessment(scores=(trial_score(), held), left_out=(), bench=bench(0.76), layers=layers)
    marked = marked_verdict(solution(), told)
    walks, others, *full = marked
    assert walks == (
        "> 1 held-out walk: resultant force 2.0 % body weight off (RMS) by the foot's physics, "
        "4.1 % with the person's momentum, 4.2 % by the person's own curve; null model "
        "5.0 %, nearest single curve 6.0 %. Physics alone is nearer than the null model in 1 of 1."
    )
    assert "bench: stiffness 0.76 N/mm off; fulcrum found where it stood in 1 of 1 walks" in others
    told_in_layers = " ".join(marked)
    assert "4.1 % with the person's own momentum and 4.2 % by the person's own" in told_in_layers
    assert not any(sentence[0] in ">!" for sentence in full)
    assert verdict(solution(), told) == tuple(full)
    doubtful = marked_verdict(
        solution(
            fulcrums=(0.1, 0.1),
            ratios=(2.0,),
            contradiction=PRIORS,
            names=("offset.height",),
            at_bound=("offset.height",),
        ),
        replace(
            told,
            scores=(trial_score(), worse),
            bench=None,
            layers=replace(layers, person_curve=None),
        ),
    )
    assert [sentence[2:][:30] for sentence in doubtful if sentence[0] == "!"] == [
        "No bench was given: whether th",
        "The priors contradict the data",
        "All fitted trials have one ful",
        "Physics alone is no nearer tha",
        "other: the fulcrum fits best a",
        "Larger than assumed, so that t",
        "Ended at a bound, their errors",
        "The person's own curve, the th",
    ]
    alone = marked_verdict(
        solution(), replace(told, scores=(trial_score(unknown="alone"),), bench=bench(1.5))
    )
    assert {sentence[2:][:31] for sentence in alone if sentence[0] == "!"} == {
        "No trial was held out: how well",
        "The null model's error is not k",
        "On the bench, to which it was f",
    }
    assert alone[0] == (
        "> 1 fitted walk: resultant force 2.0 % body weight off (RMS); null model not known."
    )
