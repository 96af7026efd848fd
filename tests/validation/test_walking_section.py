"""Walking: tracking, scores and sweeps against known answers, and the section as a whole."""

from __future__ import annotations

import dataclasses
import re
import statistics

import numpy as np
import pytest
from made_study import embedded_study, saved_section
from made_study_walk import with_plate, with_walks
from shown_chapter import Shown

from vsf_drake.base.sentences import say
from vsf_drake.fit.assessment import swept
from vsf_drake.model.setting import AtSetting
from vsf_drake.motion.trial import load_trial
from vsf_drake.report.validation.walking_chapter import layers_chapter, walking_chapter
from vsf_drake.simulation.batch import WalkOutcome
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation import walking_section as walking
from vsf_drake.validation.study import StudyOptions
from vsf_drake.validation.walking_section import (
    OF_METRICS,
    QUICK_POSITIONS,
    SCORED,
    WalkRow,
    condition,
    corrected_deg,
    pearson,
    summary,
    sweep_entry,
    walking_section,
)
from vsf_drake.walks.comparison import compare, rmse
from vsf_drake.walks.numbers import Spread, spread
from vsf_drake.walks.prediction import learned


def test_joints_follow_the_recording_within_a_hundredth_of_a_degree():
    """By a second way: the trajectory itself at the instants of the result, not the command that
    the walk kept."""
    walk = embedded_study().walks[1]
    names = list(corrected_deg(walk.result, walk.trial.trajectory))
    wanted = walk.trial.trajectory.ordered(names).sample(walk.result.time_s)[0]
    followed = np.column_stack([walk.result.column(name) for name in names])
    assert np.degrees(np.sqrt(np.mean((followed - wanted) ** 2, axis=0))).max() < 0.01


def test_what_a_fit_corrected_is_told_apart_from_tracking():
    walk = embedded_study().walks[0]
    found = corrected_deg(walk.result, walk.recorded.trajectory)
    shift = (
        walk.trial.trajectory.ordered(("hip_adduction_r",)).values
        - walk.recorded.trajectory.ordered(("hip_adduction_r",)).values
    )
    assert found["hip_adduction_r"] == pytest.approx(np.degrees(abs(shift).mean()), rel=0.2)
    assert found["hip_flexion_l"] < 0.01


def row(label, role="held out", beats_null=None, **known):
    return WalkRow(
        label=label,
        role=role,
        fulcrum_mm=66.0,
        beats_null=beats_null,
        null_model_unknown="alone",
        sweep=None,
        scores=dict.fromkeys((*OF_METRICS, *SCORED)) | known,
    )


ROWS = [
    row(
        "a",
        grf_rmse_bw=0.02,
        stance_measured_s=0.70,
        stance_model_s=0.71,
        stance_error_s=0.01,
        beats_null=True,
    ),
    row(
        "b",
        grf_rmse_bw=0.05,
        stance_measured_s=0.74,
        stance_model_s=0.72,
        stance_error_s=-0.02,
        beats_null=False,
    ),
    row(
        "c",
        "fitted",
        grf_rmse_bw=0.01,
        stance_measured_s=0.78,
        stance_model_s=0.79,
        stance_error_s=0.01,
    ),
]


def test_spread_is_the_mean_and_the_sample_standard_deviation_of_what_is_known():
    values = [0.02, 0.05, None, 0.01]
    known = [0.02, 0.05, 0.01]
    assert spread(values) == Spread(
        pytest.approx(statistics.mean(known)), pytest.approx(statistics.stdev(known)), 3
    )
    assert spread([0.02]) == Spread(0.02, None, 1) and spread([None, None]) == Spread(None, None, 0)


def test_correlation_of_stance_times_is_pearsons_and_not_known_of_two_walks_or_of_equal_ones():
    keys = "stance_measured_s", "stance_model_s"
    a, b = ([r.scores[key] for r in ROWS] for key in keys)
    assert pearson([*ROWS, row("d")], *keys) == (pytest.approx(statistics.correlation(a, b)), 3)
    assert pearson(ROWS[:2], *keys) == (None, 2) and pearson([ROWS[0]] * 3, *keys) == (None, 3)


def test_worst_is_the_largest_in_size_with_its_sign_and_its_walk():
    found = summary(ROWS)
    assert (found.scores["grf_rmse_bw_worst"], found.scores["grf_rmse_bw_worst_trial"]) == (
        0.05,
        "b",
    )
    assert (
        summary([row("d", impulse_rmse_bws=0.1), row("e", impulse_rmse_bws=-0.2)]).scores[
            "impulse_rmse_bws_worst"
        ]
        == -0.2
    )
    assert (found.beats_null, found.beats_null_of) == (1, 2) and found.scores[
        "null_model_unknown"
    ] == "alone"
    assert found.scores["cop_rmse_fl_worst"] is None and found.scores["cop_rmse_fl"] is None
    assert summary([]) is None


def test_condition_tells_fitted_and_held_out_walks_apart():
    found = condition(AtSetting(fulcrum_mm=66.0), ROWS).scores
    assert (
        list(found) == ["all", "held out", "fitted"] and found["all"].spreads["grf_rmse_bw"].n == 3
    )
    assert found["held out"].spreads["grf_rmse_bw"].mean == pytest.approx(0.035)
    assert found["fitted"].spreads["grf_rmse_bw"] == Spread(0.01, None, 1)
    assert list(condition(AtSetting(fulcrum_mm=66.0), ROWS[:2]).scores) == ["held out"]


@pytest.mark.parametrize(
    ("fulcrum_mm", "name"), [(66.0, "low"), (108.0, "medium"), (150.4, "high"), (87.0, None)]
)
def test_only_the_papers_three_settings_have_its_numbers(fulcrum_mm, name):
    found = condition(AtSetting(fulcrum_mm=fulcrum_mm), ROWS)
    assert found.name == name and (found.paper is None) == (name is None)


@pytest.fixture(scope="module")
def section(quick_validation):
    return saved_section(quick_validation, "walking")


def of_one(walk):
    return walking_section(with_walks(embedded_study(), walk))


def test_error_is_least_where_the_fulcrum_stood_in_every_walk(section):
    """From 10 to 32 N/mm: the far end of the carriage is another foot."""
    assert [row.label for row in section.table.rows] == ["low_2", "medium_2", "high_2"]
    assert [row.sweep.at_end for row in section.table.rows] == [True, False, True]
    for row in section.table.rows:
        assert row.sweep.right is True and max(row.sweep.grf_rmse_bw) > 5.0 * min(
            row.sweep.grf_rmse_bw
        )


def test_error_of_a_position_is_that_of_a_walk_made_by_hand(section):
    trial, sweep, i = embedded_study().walks[1].trial, section.table.rows[1].sweep, 4
    walker = Walker(trial.subject, trial.model)
    made = walker.result(
        walker.walk(
            trial.trajectory,
            fulcrum_m=1e-3 * sweep.fulcrum_mm[i],
            start_s=trial.start_s,
            end_s=trial.end_s,
            step_s=2e-3,
            offsets=trial.offsets,
        ),
        trial,
        trial.offsets,
        energy=False,
    )
    c = compare(made, trial.prosthetic_plate)
    sizes = [np.linalg.norm(force, axis=1)[c.scored] for force in (c.model, c.measured)]
    assert sweep.grf_rmse_bw[i] == pytest.approx(
        rmse(*sizes) / (trial.subject.mass_kg * 9.81), rel=1e-6
    )


@pytest.mark.parametrize(
    ("errors", "known"),
    [
        ((0.3, 0.1, 0.2, 0.4), True),
        ((0.1, 0.2, 0.3, np.nan), True),
        ((np.nan, 0.1, 0.2, 0.3), False),
        ((np.nan, np.nan, 0.1, np.nan), False),
        ((np.nan,) * 4, False),
    ],
)
def test_least_error_beside_a_walk_that_failed_names_no_position(errors, known):
    """It might be lower there: a number would be the failure's, not the foot's."""
    found = sweep_entry(swept(np.array([0.066, 0.087, 0.108, 0.129]), errors, true_m=0.087))
    assert [value is not None for value in (found.best_mm, found.off_mm, found.right)] == [
        known
    ] * 3
    assert [error is None for error in found.grf_rmse_bw] == [np.isnan(error) for error in errors]


def test_walks_of_a_sweep_that_failed_are_unknown_and_said_with_the_reason(monkeypatch):
    real = walking.simulate_batch
    monkeypatch.setattr(
        walking,
        "simulate_batch",
        lambda cases, **options: [
            WalkOutcome(case=o.case, failure="the worker runs other software")
            if o.case.fulcrum_m < 0.08
            else o
            for o in real(cases, **options)
        ],
    )
    found = of_one(embedded_study().walks[0])
    sweep = found.table.rows[0].sweep
    assert found.table.sweeps == 0 and sweep.right is None
    assert [error is None for error in sweep.grf_rmse_bw] == [x < 80.0 for x in sweep.fulcrum_mm]
    said = [sentence for sentence in found.missing if "other software" in sentence]
    assert len(said) == 1 and f"of the {QUICK_POSITIONS} walks" in said[0]
    assert "unknown for low_2" in Shown(walking_chapter(found.table, found.arrays)).words


def test_walks_stand_in_layers_where_the_contact_keeps_what_its_plates_taught(section):
    study = embedded_study()
    bare = dataclasses.replace(study.contact, momentum=None, person_curve=None)
    fitted = [
        load_trial(study.walks[0].recorded.path.with_name(f"{one.name}.yaml"))
        for one in bare.trials
    ]
    first = study.walks[0].trial
    taught = learned(
        bare, fitted, walker=Walker(first.subject, first.model), step_s=study.options.step_s
    )
    layers = walking.layers_section(dataclasses.replace(study, contact=taught))
    table = layers.table
    rows = table.rows
    assert [(row.label, row.role) for row in rows] == [
        (walk.label, walk.role) for walk in study.walks
    ]
    for row, walk in zip(rows, study.walks, strict=True):
        assert row.scores["physics_grf_rmse_bw"] == pytest.approx(
            walk.metrics.grf_rmse_bw, rel=1e-9
        )
        assert row.null_bw > 0.0 and row.scores["null_model_predicted_times_grf_rmse_bw"] > 0.0
        assert row.nearest_bw > 0.0
    held_out = [row for row in rows if row.role == "held out"]
    held_out.sort(key=lambda row: row.scores["person_grf_rmse_bw"])
    middle = held_out[len(held_out) // 2]
    assert table.shown.label == middle.label, "the middle one, not the best"
    curves = layers.arrays
    assert {"null", "null_predicted", "physics"} < set(curves) and "half_width" not in curves
    shown = Shown(layers_chapter(table, curves))
    caption = shown.captions["walking_layers_walk"]
    assert "No interval is told around the person's own curve" in caption
    assert middle.label in shown.titles["walking_layers_walk"]
    assert "By phase of stance, the person's own curve beside the harder null" in shown.words
    assert len(shown.grids["walking_layers"].rows) == len(rows)
    errors = [100.0 * row.momentum_bw for row in rows if row.role == "held out"]
    assert f"{np.mean(errors):.1f} % corrected by the person's own momentum" in shown.words
    nulls = ("null_model_grf_rmse_bw", "null_model_predicted_times_grf_rmse_bw")
    harder = min(np.mean([row.scores[name] for row in rows]) for name in nulls)
    harder_one = min(nulls, key=lambda name: np.mean([row.scores[name] for row in rows]))
    assert table.nearer == [
        row.scores["physics_grf_rmse_bw"] < row.scores[harder_one]
        for row in rows
        if row.role == "held out"
    ]
    for null_bw, again in ((harder, False), (harder + 0.004, True)):
        scores = {**section.table.held_out.scores, "null_model_grf_rmse_bw": null_bw}
        held_out = dataclasses.replace(section.table.held_out, scores=scores)
        walks = dataclasses.replace(section.table, held_out=held_out)
        found = {"walking": walks, "layers": table}
        told = " ".join(
            say(
                "validation",
                "verdict",
                found=found,
                held_out=held_out,
                synthetic=True,
                to_come=False,
                summary=(),
            )
        )
        assert (f"as a null model, leave {100.0 * harder:.1f} %" in told) == again
    person = np.mean([row.scores["person_grf_rmse_bw"] for row in rows])
    assert f"by the person's own curve {100.0 * person:.1f} %" in told
    untaught = dataclasses.replace(study, contact=dataclasses.replace(taught, person_curve=None))
    table = walking.layers_section(untaught).table
    assert [row.scores["person_grf_rmse_bw"] for row in table.rows] == [None] * 3, (
        "not the layer below again"
    )
    words = Shown(layers_chapter(table, {})).words
    assert (
        "holds no third layer" in words
        and "or did not ask for one." in words
        and "by physics alone" in words
    )


def test_rows_hold_the_walks_metrics_and_the_summary_their_mean(section):
    table = section.table
    for row, walk in zip(table.rows, embedded_study().walks, strict=True):
        assert row.error_bw == walk.metrics.grf_rmse_bw
        assert row.beats_null == (walk.metrics.grf_rmse_bw < walk.metrics.null_model_grf_rmse_bw)
        known = row.scores
        longer = known["stance_model_s"] - known["stance_measured_s"]
        late = known["toe_off_error_s"] - known["heel_strike_error_s"]
        assert known["stance_error_s"] == pytest.approx(longer)
        assert known["stance_error_s"] == pytest.approx(late, abs=1e-9)
    errors = [row.error_bw for row in table.rows]
    assert table.held_out.scores["grf_rmse_bw"] == pytest.approx(np.mean(errors))
    assert table.held_out.scores["grf_rmse_bw_worst"] == max(errors)
    assert table.fitted is None and table.offsets_fitted is None
    assert table.stance_n == 3 and table.stance_r > 0.99
    assert table.angle_recording_rmse_deg == pytest.approx(
        np.sqrt(
            np.mean(
                [
                    error**2
                    for walk in embedded_study().walks
                    for error in corrected_deg(walk.result, walk.recorded.trajectory).values()
                ]
            )
        )
    )


def test_one_bare_trial_has_its_numbers_and_names_what_is_not_there(monkeypatch):
    """No centre of pressure, no lateral force, no free moment, no other walk."""
    monkeypatch.setattr(walking, "QUICK_POSITIONS", 3)
    walk = embedded_study().walks[0]
    plate = walk.recorded.prosthetic_plate
    force = plate.force_W * [1.0, 0.0, 1.0]
    found = of_one(
        with_plate(
            walk,
            force_W=force,
            has_cop=False,
            cop_W=np.full_like(plate.cop_W, np.nan),
            free_moment_nm=np.zeros_like(plate.free_moment_nm),
        )
    )
    (row,) = found.table.rows
    for key in (
        "cop_rmse_fl",
        "cop_ml_rmse_fl",
        "cop_r2",
        "free_moment_rmse_nm",
        "free_moment_r2",
        "medio_lateral_rmse_bw",
        "beats_null",
    ):
        assert row.number(key) is None, key
    assert row.error_bw == pytest.approx(walk.metrics.grf_rmse_bw, rel=0.1)
    assert found.table.stance_r is None and found.table.stance_n == 1
    assert {d.quantity for d in found.table.differences} == {
        "resultant",
        "vertical",
        "fore_aft",
        "impulse",
    }
    assert {d.group for d in found.table.differences} == {0}
    text = " ".join(found.missing)
    for part in (
        "no centre of pressure",
        "medio-lateral",
        "free moment",
        "medium (108 mm) or high (151 mm)",
        "null model",
        "correlation of stance times",
        "One walk only",
    ):
        assert part in text


@pytest.mark.slow
def test_laboratory_trials_that_the_fit_has_not_seen_are_predicted_as_the_fit_found():
    """The fit judged itself on these trials by its own code when it was made; the contact file
    keeps its words."""
    study = embedded_study(quick=False)
    said = next(text for text in study.contact.verdict if "held-out trials" in text)
    mean, worst = (
        float(number) / 100.0
        for number in re.findall(r"([0-9.]+) %", said)[:1] + re.findall(r"at worst ([0-9.]+)", said)
    )
    # positions in the sweep
    few = dataclasses.replace(study, options=StudyOptions(quick=True, workers=1))
    table = walking_section(few).table
    assert table.held_out.n == 7 and table.fitted.n == 2
    assert table.held_out.scores["grf_rmse_bw"] == pytest.approx(mean, abs=0.00051)
    assert table.held_out.scores["grf_rmse_bw_worst"] == pytest.approx(worst, abs=0.00051)
    assert table.sweeps_right == table.sweeps == 9
    for own in table.conditions:
        assert (
            next(iter(own.scores.values())).spreads["grf_rmse_bw"].mean < own.paper["grf_rmse_bw"]
        )
