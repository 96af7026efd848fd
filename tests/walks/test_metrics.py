"""Walks whose agreement with the plate is known in advance."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from made_results import (
    FOOT_LENGTH_M,
    LIFT_S,
    MASS_KG,
    STRIKE_S,
    WEIGHT_N,
    make_plate,
    make_walk,
    turned,
    walk_load,
)

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import plain, record
from vsf_drake.simulation.options import TRANSIENT_S
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.metrics import WalkMetrics, stance_curve, walk_metrics
from vsf_drake.walks.null_model import ALONE, CUT, KnownCurve

COMPARED = (
    "grf_rmse_bw",
    "grf_r2",
    "vertical_rmse_bw",
    "fore_aft_rmse_bw",
    "medio_lateral_rmse_bw",
    "cop_rmse_fl",
    "impulse_rmse_bws",
    "impulse_r2",
    "cop_ml_rmse_fl",
    "cop_r2",
    "stance_measured_s",
    "stance_model_s",
    "heel_strike_error_s",
)


def scored_time(start=STRIKE_S - 0.25, end=LIFT_S + 0.25, rate=1e5):
    return np.arange(start, end, 1.0 / rate)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_walk_that_equals_its_plate_has_no_error():
    m = walk_metrics(make_walk(), make_plate())
    for key in (
        "grf_rmse_bw",
        "vertical_rmse_bw",
        "fore_aft_rmse_bw",
        "medio_lateral_rmse_bw",
        "impulse_rmse_bws",
    ):
        assert getattr(m, key) < 1e-4, key
    assert m.cop_rmse_fl < 1e-3
    for key in ("grf_r2", "impulse_r2", "cop_r2"):
        assert getattr(m, key) == pytest.approx(1.0, abs=1e-4), key
    assert m.vertical_impulse_error == pytest.approx(0.0, abs=1e-5)
    assert m.heel_strike_error_s == pytest.approx(0.0, abs=1e-4)
    assert m.stance_measured_s == pytest.approx(m.stance_model_s, abs=1e-4)
    assert m.stance_measured_s == pytest.approx(LIFT_S - STRIKE_S, abs=0.01)
    assert m.angle_rmse_deg == 0.0
    assert m.null_model_grf_rmse_bw is None
    assert m.coverage == pytest.approx(1.0)
    assert m.extra_model_stances == 0


def test_tenth_more_load_is_a_tenth_more_of_everything():
    m = walk_metrics(make_walk(scale=1.1), make_plate())
    time = scored_time()
    load = walk_load(time) / WEIGHT_N
    assert m.grf_rmse_bw == pytest.approx(0.1 * rms(np.linalg.norm(load, axis=1)), rel=5e-3)
    assert m.vertical_rmse_bw == pytest.approx(0.1 * rms(load[:, 2]), rel=5e-3)
    assert m.fore_aft_rmse_bw == pytest.approx(0.1 * rms(load[:, 0]), rel=5e-3)
    assert m.medio_lateral_rmse_bw == pytest.approx(0.1 * rms(load[:, 1]), rel=2e-2)
    assert m.vertical_impulse_error == pytest.approx(0.1, rel=1e-3)
    stance = scored_time(STRIKE_S, LIFT_S)
    cumulative = np.cumsum(np.linalg.norm(walk_load(stance) / WEIGHT_N, axis=1)) * 1e-5
    assert m.impulse_rmse_bws == pytest.approx(0.1 * rms(cumulative), rel=1e-2)
    peaks = m.stances[0]
    assert peaks.model_peaks_bw.vertical_first_half == pytest.approx(
        1.1 * peaks.measured_peaks_bw.vertical_first_half, rel=1e-4
    )
    assert m.measured_peak_vertical_bw == pytest.approx(load[:, 2].max(), rel=5e-3)
    assert m.peak_vertical_bw == pytest.approx(1.1 * load[:, 2].max(), rel=5e-3)
    for own, scale in ((peaks.measured_peaks_bw, 1.0), (peaks.model_peaks_bw, 1.1)):
        assert own.braking == pytest.approx(scale * load[:, 0].min(), rel=2e-2)
        assert own.propulsion == pytest.approx(scale * load[:, 0].max(), rel=2e-2)


def test_peaks_are_of_the_halves_of_stance():
    """Humps of 1.0 and 1.2 body weights at 20 and 85 % of stance, slow against the filter's
    40 Hz."""
    walk, plate = make_walk(), make_plate()
    share = (plate.time_s - STRIKE_S) / (LIFT_S - STRIKE_S)
    body_weights = (
        0.3
        + 0.7 * np.exp(-(((share - 0.2) / 0.12) ** 2))
        + 0.9 * np.exp(-(((share - 0.85) / 0.12) ** 2))
    )
    pushes = 0.2 * np.exp(-(((share - 0.25) / 0.1) ** 2)) - 0.15 * np.exp(
        -(((share - 0.75) / 0.1) ** 2)
    )
    loaded = (share > 0) & (share < 1)
    vertical, fore_aft = (
        np.where(loaded, WEIGHT_N * force, 0.0) for force in (body_weights, pushes)
    )
    plate = dataclasses.replace(
        plate, force_W=np.column_stack([fore_aft, 0.0 * fore_aft, vertical])
    )
    peaks = walk_metrics(walk, plate).stances[0].measured_peaks_bw
    assert peaks.vertical_first_half == pytest.approx(1.0, rel=0.01)
    assert peaks.vertical_second_half == pytest.approx(1.2, rel=0.01)
    assert (peaks.propulsion, peaks.braking) == pytest.approx((0.2, -0.15), rel=0.02), (
        "of the whole stance"
    )


def test_resultant_is_the_euclidean_norm_and_a_lateral_force_that_the_plate_lacks_is_not_scored():
    time = make_walk().time_s
    steady = np.tile([0.0, 300.0, 400.0], (len(time), 1))
    plate = make_plate()
    plate = dataclasses.replace(plate, force_W=np.tile([0.0, 0.6, 500.0], (len(plate.time_s), 1)))
    m = walk_metrics(make_walk(grf_W=steady), plate)
    assert m.grf_rmse_bw == pytest.approx(0.0, abs=1e-6)
    assert m.vertical_rmse_bw == pytest.approx(100.0 / WEIGHT_N)
    assert m.medio_lateral_rmse_bw == pytest.approx(299.4 / WEIGHT_N)
    flat = dataclasses.replace(plate, force_W=plate.force_W * [1.0, 0.0, 1.0])
    assert walk_metrics(make_walk(grf_W=steady), flat).medio_lateral_rmse_bw is None


def test_late_foot_is_late_because_nothing_is_shifted():
    m = walk_metrics(make_walk(delay_s=0.012), make_plate())
    assert m.heel_strike_error_s == pytest.approx(0.012, abs=2e-4)
    assert m.toe_off_error_s == pytest.approx(0.012, abs=2e-4)
    assert m.stance_model_s == pytest.approx(m.stance_measured_s, abs=4e-4)
    assert m.grf_rmse_bw > 0.02


def test_shifted_centre_of_pressure_is_the_shift_in_foot_lengths():
    m = walk_metrics(make_walk(cop_shift=(0.02, -0.01)), make_plate())
    assert m.cop_rmse_fl == pytest.approx(0.02 / FOOT_LENGTH_M, rel=1e-3)
    assert m.cop_ml_rmse_fl == pytest.approx(0.01 / FOOT_LENGTH_M, rel=1e-2)
    assert m.foot_length_m == FOOT_LENGTH_M, "the length that both are shares of"
    variance = (0.9 * FOOT_LENGTH_M * m.stance_measured_s / (LIFT_S - STRIKE_S)) ** 2 / 12.0
    assert m.cop_r2 == pytest.approx(1.0 - 0.02**2 / variance, rel=3e-2)
    assert m.cop_points == pytest.approx(101, abs=3)


@pytest.mark.parametrize("angle", [np.pi, -2.0])
def test_metrics_do_not_depend_on_the_direction_of_walking(angle):
    walk, plate = make_walk(scale=0.9, cop_shift=(0.03, 0.01), delay_s=0.01), make_plate()
    straight, oblique = walk_metrics(walk, plate), walk_metrics(*turned(walk, plate, angle))
    for key in COMPARED:
        assert getattr(oblique, key) == pytest.approx(getattr(straight, key), rel=1e-6), key
    assert np.cos(np.radians(oblique.heading_deg) - angle) == pytest.approx(1.0, abs=1e-9)


def test_error_outside_stance_and_margin_or_above_the_cutoff_is_not_scored():
    walk = make_walk()
    ripple = 100.0 * np.sin(2.0 * np.pi * 250.0 * walk.time_s)
    m = walk_metrics(
        dataclasses.replace(walk, grf_W=walk.grf_W + ripple[:, None] * [0.0, 0.0, 1.0]),
        make_plate(),
    )
    assert m.vertical_rmse_bw < 0.01 * rms(ripple) / WEIGHT_N + 1e-4
    extra = 300.0 * (walk.time_s < STRIKE_S - 0.35)[:, None] * [0.0, 0.0, 1.0]
    m = walk_metrics(dataclasses.replace(walk, grf_W=walk.grf_W + extra), make_plate())
    assert m.grf_rmse_bw < 1e-3
    assert m.extra_model_stances == 1
    assert m.scored_window_s[0] == pytest.approx([STRIKE_S - 0.25, LIFT_S + 0.25], abs=0.01)


def test_a_stance_in_which_the_walk_starts_is_scored_after_the_transient():
    walk = make_walk(start_s=0.85, end_s=1.5, cop_shift=(0.02, 0.0), scale=1.1)
    m = walk_metrics(walk, make_plate())
    assert m.stance_measured_s is None
    assert m.stance_model_s is None
    assert m.heel_strike_error_s is None
    assert m.toe_off_error_s == pytest.approx(0.0, abs=1e-3)
    assert [s.complete for s in m.stances] == [False]
    assert m.stances[0].model_start_s is None
    assert m.cop_rmse_fl == pytest.approx(0.02 / FOOT_LENGTH_M, rel=1e-3)
    scored_s = 0.85 + TRANSIENT_S
    seen = (LIFT_S - scored_s) / (LIFT_S - STRIKE_S)
    assert m.cop_points == pytest.approx(101 * seen, abs=3)
    assert m.vertical_impulse_error == pytest.approx(0.1, rel=1e-2)
    assert m.scored_window_s[0] == pytest.approx((scored_s, walk.time_s[-1]), abs=2e-3)
    assert m.coverage == pytest.approx((1.5 - scored_s) / (LIFT_S - STRIKE_S + 0.5), abs=0.01)


def test_event_that_only_one_of_the_two_shows_has_no_error():
    """The model stands already when the simulation begins, or still when it ends; the plate shows
    the event."""
    early = walk_metrics(make_walk(delay_s=-0.05, start_s=STRIKE_S - 0.03), make_plate())
    assert (early.heel_strike_error_s, early.stance_model_s) == (None, None)
    assert early.toe_off_error_s == pytest.approx(-0.05, abs=1e-3)
    late = walk_metrics(make_walk(delay_s=0.05, end_s=LIFT_S + 0.03), make_plate())
    assert (late.toe_off_error_s, late.stance_model_s) == (None, None)
    assert late.heel_strike_error_s == pytest.approx(0.05, abs=1e-3)
    for m, start, end in ((early, None, LIFT_S - 0.05), (late, STRIKE_S + 0.05, None)):
        assert m.stance_measured_s == pytest.approx(LIFT_S - STRIKE_S, abs=0.01)
        for event, known in ((m.stances[0].model_start_s, start), (m.stances[0].model_end_s, end)):
            assert event == (known if known is None else pytest.approx(known, abs=5e-3))


def test_two_footprints_are_scored_each_about_itself():
    """The second is a metre ahead: a distance that no model had to explain."""
    stances = ((0.1, 0.7), (1.2, 1.8))
    walk, plate = (
        make_walk(start_s=0.0, end_s=2.0, stances=stances, cop_shift=(0.02, 0.0)),
        make_plate(stances=stances),
    )
    walk, plate = (
        dataclasses.replace(side, cop_W=side.cop_W + np.outer(side.time_s > 0.95, [1.0, 0.0, 0.0]))
        for side in (walk, plate)
    )
    m = walk_metrics(walk, plate)
    assert [s.complete for s in m.stances] == [True, True]
    assert m.stance_measured_s == pytest.approx(0.6, abs=0.01)
    assert m.cop_rmse_fl == pytest.approx(0.02 / FOOT_LENGTH_M, rel=1e-3)
    one = walk_metrics(make_walk(cop_shift=(0.02, 0.0)), make_plate())
    assert m.cop_r2 == pytest.approx(one.cop_r2, rel=2e-2)


def test_centre_of_pressure_is_not_filtered_across_a_gap():
    walk = make_walk(stances=((0.6, 0.9), (1.0, 1.3)))
    # too little to count as loaded
    walk = dataclasses.replace(walk, grf_W=walk.grf_W + np.array([0.0, 0.0, 10.0]))
    jump = np.where(walk.time_s[:, None] > 0.95, [[5.0, 0.0, 0.0]], 0.0)
    curves = [
        compare(each, make_plate()).stances[0].model_cop[:40, 0]
        for each in (walk, dataclasses.replace(walk, cop_W=walk.cop_W + jump))
    ]
    assert np.count_nonzero(np.isfinite(curves[0])) > 30
    np.testing.assert_allclose(
        *curves, atol=1e-9, err_msg="the jump at the second contact leaks into the first"
    )


def test_followed_angles_are_compared_in_degrees_without_translations():
    walk = make_walk()
    commanded = walk.prescribed_q.copy()
    commanded[:, 3] += np.radians(0.5)
    commanded[:, 0] += 1.0
    m = walk_metrics(dataclasses.replace(walk, prescribed_q=commanded), make_plate())
    assert m.angle_rmse_deg == pytest.approx(0.5 / np.sqrt(2.0))


def test_null_model_is_another_trial_stretched():
    plate = make_plate(stances=((STRIKE_S, LIFT_S),))
    other = make_plate(stances=((0.3, 1.2),))
    curve = stance_curve(other, subject_mass_kg=MASS_KG)
    assert curve.shape == (101,)
    m = walk_metrics(make_walk(), plate, others=[KnownCurve(0.1, curve)])
    assert m.null_model_grf_rmse_bw < 0.02
    flat = walk_metrics(make_walk(), plate, others=[KnownCurve(0.1, np.zeros(101))])
    load = np.linalg.norm(walk_load(scored_time()) / WEIGHT_N, axis=1)
    assert flat.null_model_grf_rmse_bw == pytest.approx(rms(load), rel=5e-3)


def test_of_a_stance_that_was_seen_in_part_the_null_model_tells_nothing_and_not_zero():
    """The plate is loaded in its first frame: what is left beside the stance is zeros against an
    unloaded plate."""
    cut = walk_metrics(make_walk(), make_plate(start_s=0.8), others=[KnownCurve(0.1, np.ones(101))])
    assert cut.grf_rmse_bw is not None
    assert cut.null_model_grf_rmse_bw is None and cut.stretched_null_grf_rmse_bw is None
    assert cut.null_model_unknown == CUT
    assert walk_metrics(make_walk(), make_plate()).null_model_unknown == ALONE


def test_what_cannot_be_known_is_none_and_comes_back_from_json():
    walk, plate = make_walk(), make_plate()
    lost = walk_metrics(
        dataclasses.replace(walk, grf_W=0.0 * walk.grf_W, cop_W=walk.cop_W + np.nan), plate
    )
    assert lost.vertical_impulse_error == pytest.approx(-1.0)
    assert lost.cop_rmse_fl is lost.cop_r2 is lost.stance_model_s is None
    assert record(WalkMetrics, json.loads(json.dumps(plain(lost), allow_nan=False))) == lost
    blind = walk_metrics(
        walk, dataclasses.replace(plate, cop_W=plate.cop_W + np.nan, has_cop=False)
    )
    assert blind.cop_rmse_fl is None and blind.grf_rmse_bw < 1e-4
    unseen = walk_metrics(walk, make_plate(stances=()))
    assert unseen.stances == () and unseen.grf_rmse_bw is unseen.impulse_rmse_bws is None
    assert unseen.extra_model_stances == 1
    with pytest.raises(InputError, match="does not overlap"):
        walk_metrics(walk, make_plate(start_s=5.0, end_s=6.0, stances=()))
