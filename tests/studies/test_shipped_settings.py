"""What is detectable, against closed forms and its own false alarms; settings as walked."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study
from made_study_walk import with_walks
from scipy.stats import norm
from scipy.stats import t as student
from shipped_sections import settings
from shipped_sections.settings import (
    DESIGNS,
    ModelError,
    NoiseVariance,
    detectable,
    model_error,
    noise_variance,
    quantile,
    settings_section,
    smallest_travel,
    walked_rows,
)
from shipped_sections.settings_walks import KEEP, NAMES, base_of

from vsf_drake.base.files import resource
from vsf_drake.simulation.batch import WalkCase, simulate_batch
from vsf_drake.validation.settings_section import NoiseSizes
from vsf_drake.validation.study import FITTED, HELD_OUT, OFFSETS_FITTED
from vsf_drake.walks.recorded_walk import STEP_S

SESSION, RECORDING, SLOPE = 0.7, 0.2, 1.5


def linear_outcomes(trials: int, draws: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """y(x1) = s + r, y(x2) = SLOPE (s + r) of trials with different means: all variances are
    known."""
    random = np.random.default_rng(seed)
    noise = SESSION * random.standard_normal(
        (trials, draws, 1, 1)
    ) + RECORDING * random.standard_normal((trials, draws, 2, 1))
    mean = 10.0 * random.standard_normal((trials, 1, 1, 1))
    return mean + noise, mean + SLOPE * noise


VARIANCES = {
    "same_recording": (SLOPE - 1.0) ** 2 * (SESSION**2 + RECORDING**2),
    "same_session": (SLOPE - 1.0) ** 2 * SESSION**2 + (SLOPE**2 + 1.0) * RECORDING**2,
    "two_sessions": (SLOPE**2 + 1.0) * (SESSION**2 + RECORDING**2),
}


@pytest.mark.parametrize("design", DESIGNS)
def test_variance_of_a_difference_is_that_of_the_design(design):
    found = noise_variance(design, *linear_outcomes(8, 400))
    # four standard errors of 3200 draws
    assert found.value[0] == pytest.approx(VARIANCES[design], rel=0.1)
    assert found.freedom == 8 * 399


def test_a_failed_walk_costs_its_own_draw_only():
    first, second = linear_outcomes(3, 200)
    whole = noise_variance("two_sessions", first, second).value[0]
    second[1, 5, 0] = np.nan
    assert noise_variance("two_sessions", first, second).value[0] == pytest.approx(whole, rel=0.02)
    gone = noise_variance("two_sessions", np.full_like(first, np.nan), second)
    assert np.isnan(gone.value[0]) and np.isnan(detectable(gone)[0])


def test_bias_cancels_and_spread_counts():
    errors = np.array([[0.1, 5.1], [0.3, 5.3], [0.2, 5.2], [0.4, np.nan]])
    found = model_error(errors)
    assert found.sd == pytest.approx([np.std([0.1, 0.2, 0.3, 0.4], ddof=1), 0.1])
    assert found.count.tolist() == [4, 3]


def test_too_few_held_out_walks_leave_the_sum_unknown():
    found = model_error(np.ones((2, 2)))
    assert np.isnan(found.sd).all() and found.count.tolist() == [2, 2]
    noise = NoiseVariance(np.ones(2), 100.0)
    assert np.isnan(detectable(noise, found)).all()
    # t tables, 100 degrees of freedom
    assert detectable(noise) == pytest.approx([1.984, 1.984], abs=1e-3)


def test_limits_are_students_and_add_as_squares():
    noise = NoiseVariance(np.array([4.0]), 1e9)
    model = ModelError(np.array([1.0]), np.array([3]))
    by_noise, by_model = norm.ppf(0.975) * 2.0, 4.3027 * 2.0**0.5  # t tables, 2 degrees of freedom
    assert detectable(noise, model)[0] == pytest.approx(np.hypot(by_noise, by_model), rel=1e-4)
    assert detectable(noise)[0] == pytest.approx(by_noise, rel=1e-6)
    assert np.isnan(quantile(0.0))


@pytest.mark.parametrize("walks", [3, 20])
def test_without_an_effect_at_most_one_in_twenty_is_called_one(walks):
    random = np.random.default_rng(walks)
    spread, model_sd, cases = 1.0, 0.8, 20000
    noise = NoiseVariance(np.array([2.0 * spread**2]), 1e6)
    errors = model_sd * random.standard_normal((walks, cases)) + 3.0
    limit = detectable(noise, model_error(errors))
    two = (
        spread * random.standard_normal((2, cases))
        + model_sd * random.standard_normal((2, cases))
        + 3.0
    )
    assert np.mean(np.abs(two[1] - two[0]) > limit) < 0.053


def test_the_smallest_travel_is_where_the_effect_leaves_the_band_for_good():
    travel = np.arange(1.0, 11.0)
    assert smallest_travel(travel, 2.0 * travel, np.full(10, 7.0)) == pytest.approx(3.5)
    assert smallest_travel(travel, -2.0 * travel, np.full(10, 1.0)) == 1.0
    assert np.isnan(smallest_travel(travel, 2.0 * travel, np.full(10, 30.0)))
    assert np.isnan(smallest_travel(travel, 2.0 * travel, np.full(10, np.nan)))
    hump = np.array([0.0, 3.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert smallest_travel(travel, hump, np.full(10, 1.5)) == pytest.approx(6.5)


AT = (66.0, 108.0, 151.0)


def bases(measured, simulated, role=HELD_OUT):
    """A walk for each row of (walks, 3 settings), all outcomes alike."""
    return [
        SimpleNamespace(
            walk=SimpleNamespace(fulcrum_mm=x, role=role),
            measured=SimpleNamespace(values=np.full(len(NAMES), measured[i, j])),
            simulated=SimpleNamespace(values=np.full(len(NAMES), simulated[i, j])),
        )
        for j, x in enumerate(AT)
        for i in range(len(measured))
    ]


def ends(found):
    return next(row for row in found if row.from_mm == AT[0] and row.to_mm == AT[-1])


@pytest.mark.parametrize("error", [0.1, 1.0])
def test_without_a_difference_of_settings_at_most_one_in_twenty_is_told_apart(error):
    """However well the model follows each stride: then it tells strides apart, and settings no
    better."""
    random = np.random.default_rng(5)
    told = 0
    for _ in range(400):
        measured = random.standard_normal((3, 3))
        told += ends(
            walked_rows(bases(measured, measured + error * random.standard_normal((3, 3))))
        ).told_apart
    assert told <= 0.05 * 400 + 3.0 * np.sqrt(400 * 0.05 * 0.95)


def test_half_widths_are_t_times_the_standard_errors_within_settings():
    random = np.random.default_rng(2)
    measured, error = random.standard_normal((3, 3)), random.standard_normal((3, 3))
    row = ends(walked_rows(bases(measured, measured + error)))
    width = student.ppf(0.975, 6) * np.sqrt(2.0 / 3.0)
    assert row.error_half_width == pytest.approx(width * np.sqrt(error.var(axis=0, ddof=1).mean()))
    assert row.stride_half_width == pytest.approx(
        width * np.sqrt((measured + error).var(axis=0, ddof=1).mean())
    )
    assert row.measured == pytest.approx(measured[:, 2].mean() - measured[:, 0].mean())


def test_difference_far_beyond_strides_and_error_is_told_apart_unless_the_model_errs_in_sign():
    random = np.random.default_rng(4)
    measured = 0.1 * random.standard_normal((3, 3)) + np.array([0.0, 5.0, 10.0])
    error = 0.1 * random.standard_normal((3, 3))
    assert all(row.told_apart is True for row in walked_rows(bases(measured, measured + error)))
    assert all(row.told_apart is False for row in walked_rows(bases(measured, error - measured)))


def test_one_walk_a_setting_or_walks_that_the_fit_has_seen_tell_nothing():
    measured = np.array([[0.0, 5.0, 10.0]])
    assert all(
        row.told_apart is None and row.beyond_strides is None
        for row in walked_rows(bases(measured, measured))
    )
    three = np.repeat(measured, 3, axis=0) + 0.1 * np.random.default_rng(1).standard_normal((3, 3))
    assert all(row.told_apart is None for row in walked_rows(bases(three, three, role=FITTED)))


@pytest.fixture(scope="module")
def table():
    return settings_section(embedded_study()).table


def with_options(study, **changes):
    return dataclasses.replace(study, options=dataclasses.replace(study.options, **changes))


def test_same_seed_gives_the_same_numbers_on_one_worker_and_on_two(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 18)
    study = with_walks(embedded_study(), embedded_study().walks[1])
    one, two = (settings_section(with_options(study, workers=workers)) for workers in (1, 2))
    assert one.table == two.table
    assert np.array_equal(one.arrays["effects"], two.arrays["effects"])
    other = settings_section(with_options(study, seed=1)).table.outcomes[0]
    assert other.effect == one.table.outcomes[0].effect
    assert (
        other.limits["noise_sdd_two_sessions"]
        != one.table.outcomes[0].limits["noise_sdd_two_sessions"]
    )


def test_the_section_counts_its_walks_and_answers_of_noise_alone_without_the_model_s_error(table):
    assert table.walks == 3 * 3 * (1 + 2 * table.draws) and table.failed_walks == 0
    assert [row.name for row in table.outcomes] == list(NAMES)
    assert len(table.pairs) == 3 * len(NAMES) and table.held_out_trials == 3
    assert "With the same motion, " in table.answer and "as far as noise" not in table.answer
    shipped = json.loads(resource("data/validation/settings.json").read_text(encoding="utf-8"))[
        "table"
    ]["answer"]
    assert shipped.startswith(
        "As they were walked, each with its own motion, 66 and 151 mm are distinguish"
    )
    assert " With the same motion, " in shipped
    unknown = [
        dataclasses.replace(row, limits={**row.limits, "sdd_same_recording": None})
        for row in table.outcomes
    ]
    words = settings.answer(table.positions_mm, unknown, table.pairs, table.as_walked)
    assert "With the same motion, as far as noise alone goes, " in words
    alone = settings.answer(table.positions_mm, table.outcomes, table.pairs, ())
    assert alone.startswith("With the same motion, ") and "As they were walked" not in alone


def test_more_that_differs_between_two_walks_makes_more_noise(table):
    for row in table.outcomes:
        limits = [row.limits[f"noise_sdd_{design}"] for design in DESIGNS]
        assert limits[0] < 1.05 * limits[1] < limits[2]
        if row.limits["sdd_same_recording"] is not None:
            assert all(row.limits[f"sdd_{d}"] >= row.limits[f"noise_sdd_{d}"] for d in DESIGNS)


def test_a_stiffer_setting_carries_more_under_the_same_motion(table):
    rows = {row.name: row for row in table.outcomes}
    assert rows["vertical_second_bw"].effect_ends > 0.3
    assert rows["cop_mid_stance_fl"].effect_ends > 0.05
    assert [*table.stiffness_n_per_mm] == sorted(table.stiffness_n_per_mm)
    for row in table.outcomes[-2:]:  # energy has no plate
        assert (
            row.unit == "J"
            and row.model_error_sd is None
            and row.limits["sdd_two_sessions"] is None
        )
        assert row.limits["noise_sdd_two_sessions"] > 0.0


def test_pairs_are_held_against_noise_alone_where_the_model_s_error_is_not_known(table):
    ends = {
        row.outcome: row.limits for row in table.pairs if (row.from_mm, row.to_mm) == (66.0, 151.0)
    }
    for row in table.outcomes:
        for design in DESIGNS:
            alone, both = (row.limits[f"{prefix}sdd_{design}"] for prefix in ("noise_", ""))
            assert ends[row.name][f"limit_{design}"] > 0.0 and (both is None) == (
                row.model_error_sd is None
            )
            if row.model_error_sd is not None:  # the model's part is the same at any two positions
                assert ends[row.name][f"limit_{design}"] > (both**2 - alone**2) ** 0.5


@pytest.mark.slow
def test_monte_carlo_agrees_with_linear_propagation_of_each_error_but_for_the_centre_of_pressure():
    """What linearity misses is less than what so many draws leave open: 1 / sqrt(2 (n - 1)) of a
    standard deviation.

    Where the even part of the answer, told from the odd one by the same errors with the other sign,
    is large, nothing linear is claimed. Only the centre of pressure may be so: at the strike it
    moves a centimetre in 4 ms, so that its rearmost place hops with that of the first loaded
    instant in a step.
    """
    base = base_of(embedded_study().walks[1], NoiseSizes(session_deg=0.0, session_smooth_deg=0.0))
    noise, size = base.noise, base.noise.sizes
    count = base.trial.trajectory.values.shape[1]
    sigma = {i: np.radians(size.recording_deg) for i in noise.angles}
    sigma |= {i: 1e-3 * size.recording_mm for i in noise.place}

    # in steps that resolve strike and lift-off four times finer than the section's
    def walked(errors):
        cases = [
            WalkCase(trial=noise.perturbed(error), fulcrum_m=0.108, step_s=STEP_S / 4)
            for error in errors
        ]
        return np.array(
            [base.record(outcome).values for outcome in simulate_batch(cases, keep=KEEP, workers=1)]
        )

    alone = walked([np.zeros(count)])[0]
    ends = walked(
        [sign * value * np.eye(count)[i] for i, value in sigma.items() for sign in (1.0, -1.0)]
    )
    slopes = 0.5 * (ends[::2] - ends[1::2])  # of one standard deviation of each error
    random, draws = np.random.default_rng(4), 60
    drawn = np.array([noise.recording(random) for _ in range(draws)])
    there, back = walked(drawn), walked(-drawn)
    linear = np.std(drawn[:, list(sigma)] / np.array([*sigma.values()]) @ slopes, axis=0, ddof=1)
    even = np.std(0.5 * (there + back) - alone, axis=0, ddof=1) / linear
    smooth = even < 0.3
    assert all(ok or name.startswith("cop_") for name, ok in zip(NAMES, smooth, strict=True))
    open_share = 1.0 / np.sqrt(2.0 * (draws - 1))
    assert np.all(np.abs(np.std(there, axis=0, ddof=1) / linear - 1.0)[smooth] < open_share)
    assert linear == pytest.approx(np.sqrt(np.sum(slopes**2, axis=0)), rel=3.0 * open_share)


def test_one_trial_without_contact_fit_still_says_what_noise_allows(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 24)
    study = embedded_study()
    section = settings_section(
        with_walks(study, dataclasses.replace(study.walks[0], role=OFFSETS_FITTED))
    )
    assert all(
        row.limits["sdd_same_session"] is None and row.limits["noise_sdd_same_session"] > 0.0
        for row in section.table.outcomes
    )
    assert section.table.as_walked == ()
    said = " ".join(section.missing)
    assert "offsets of every walk" in said and "one setting" in said
    assert "model's error is unknown" in section.table.answer


def test_a_stance_that_no_plate_shows_as_a_whole_is_named(monkeypatch):
    study = embedded_study()
    walk = study.walks[0]
    silent = dataclasses.replace(walk, comparison=dataclasses.replace(walk.comparison, stances=()))
    section = settings_section(with_walks(study, silent))
    assert section.table.outcomes == () and walk.label in section.missing[0]
