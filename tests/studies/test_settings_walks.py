"""Outcomes of a made stance with known answers, and noise of kinematics of the stated size."""

from __future__ import annotations

import numpy as np
import pytest
from made_study import embedded_study
from shipped_sections.settings_walks import (
    NAMES,
    SPLINES,
    KinematicNoise,
    smooth_basis,
    stance_record,
)

from vsf_drake.motion.events import Stance
from vsf_drake.motion.fitted_trial import gait_phase
from vsf_drake.validation.settings_section import NoiseSizes

WEIGHT, FOOT, START, LONG = 800.0, 0.25, 0.5, 0.8
TIME = np.arange(0.0, 1.8, 1e-3)
FORWARD = np.array([1.0, 0.0])


def made(*, angle: float = 0.0, shift_s: float = 0.0, place_m: float = 0.0):
    """A smooth double bump, fore-aft one sine, the centre of pressure at a constant speed; walked
    towards `angle`."""
    phase = (TIME - START - shift_s) / LONG
    on = (phase > 0.0) & (phase < 1.0)
    bumps = np.where(on, np.sin(np.pi * phase) + 0.4 * np.sin(3.0 * np.pi * phase), 0.0)
    along = np.where(on, -0.2 * np.sin(2.0 * np.pi * phase), 0.0)
    path = np.where(on, 0.8 * FOOT * phase, np.nan) + place_m
    heading = np.array([np.cos(angle), np.sin(angle)])
    force = WEIGHT * np.column_stack([along * heading[0], along * heading[1], bumps])
    cop = np.column_stack([path * heading[0], path * heading[1], 0.0 * path])
    return force, cop, heading, Stance(START + shift_s, START + shift_s + LONG)


def values_of(force, cop, heading, stance, energy=None):
    record = stance_record(
        TIME,
        force,
        cop,
        near=stance,
        heading=heading,
        weight_n=WEIGHT,
        foot_length_m=FOOT,
        energy=energy,
    )
    return dict(zip(NAMES, record.values, strict=True))


def test_peaks_trough_and_impulse_are_those_of_the_curve():
    found = values_of(*made())
    phase = np.linspace(0.0, 1.0, 100001)
    curve = np.sin(np.pi * phase) + 0.4 * np.sin(3.0 * np.pi * phase)
    assert found["vertical_first_bw"] == pytest.approx(curve.max(), abs=4e-3)
    assert found["vertical_second_bw"] == pytest.approx(found["vertical_first_bw"], abs=1e-3)
    # sin(pi/2) + 0.4 sin(3 pi/2)
    assert found["vertical_trough_bw"] == pytest.approx(0.6, abs=4e-3)
    assert found["propulsion_bw"] == pytest.approx(0.2, abs=3e-3)
    assert found["propulsion_impulse_bws"] == pytest.approx(0.2 * LONG / np.pi, rel=0.02)
    resultant = np.hypot(curve, 0.2 * np.sin(2.0 * np.pi * phase))
    assert found["resultant_first_bw"] == pytest.approx(resultant.max(), abs=4e-3)
    assert found["resultant_rms_bw"] == pytest.approx(np.sqrt(np.mean(resultant**2)), abs=1e-2)


def test_the_centre_of_pressure_counts_from_its_rearmost_place():
    found = values_of(*made())
    # loaded, and its centre of pressure seen, from 20 N on: some percent of stance late at either
    # end
    assert found["cop_mid_stance_fl"] == pytest.approx(0.4, abs=0.015)
    assert found["cop_excursion_fl"] == pytest.approx(0.8, abs=0.03)


def test_time_place_and_heading_do_not_enter():
    reference = values_of(*made())
    moved = values_of(*made(angle=0.6, shift_s=0.2, place_m=1.7))
    known = [name for name in NAMES if not name.startswith("energy")]
    assert [moved[name] for name in known] == pytest.approx(
        [reference[name] for name in known], abs=2e-3
    )


def test_energy_counts_from_touch_down_and_pays_for_damping():
    strain = np.interp(TIME, [START, START + 0.5 * LONG, START + LONG], [0.5, 6.5, 1.0])
    loss = np.interp(TIME, [0.0, START + 0.5 * LONG, START + LONG], [0.0, 1.0, 1.3])
    found = values_of(*made(), energy={"keel_strain": strain, "keel_loss": loss})
    # the foot counts as loaded from 20 N on
    assert found["energy_stored_j"] == pytest.approx(6.0, abs=0.15)
    assert found["energy_returned_j"] == pytest.approx(6.5 - 1.0 - 0.3, abs=0.15)


def test_what_a_record_does_not_tell_is_not_a_number_and_no_stance_is_none():
    force, cop, heading, stance = made()
    known = {"near": stance, "heading": heading, "weight_n": WEIGHT, "foot_length_m": FOOT}
    record = stance_record(TIME, force, None, **known)
    told = dict(zip(NAMES, np.isfinite(record.values), strict=True))
    assert [name for name, known_ in told.items() if not known_] == [
        "cop_excursion_fl",
        "cop_mid_stance_fl",
        "energy_stored_j",
        "energy_returned_j",
    ]
    assert stance_record(TIME, 0.0 * force, cop, **known) is None
    cut = TIME < START + 0.5 * LONG
    assert stance_record(TIME[cut], force[cut], cop[cut], **known) is None


@pytest.fixture(scope="module")
def trial():
    return embedded_study().walks[0].trial


def test_the_smooth_error_has_no_mean_unit_size_and_a_period():
    phase = np.linspace(0.0, 1.0, 2001)[:-1]
    basis = smooth_basis(phase)
    assert np.abs(basis.mean(axis=0)).max() < 1e-6
    curves = basis @ np.random.default_rng(0).standard_normal((SPLINES, 4000))
    assert np.mean(curves**2) == pytest.approx(1.0, rel=0.03)
    assert smooth_basis(phase + 3.0) == pytest.approx(basis, abs=1e-9)


def test_draws_have_the_stated_standard_deviations(trial):
    noise, random = KinematicNoise(trial), np.random.default_rng(1)
    names = trial.trajectory.names
    sessions = np.degrees([noise.session(random) for _ in range(400)])
    hip = sessions[:, :, names.index("hip_flexion_r")]
    assert hip.mean() == pytest.approx(0.0, abs=0.25)
    in_cycle = (gait_phase(trial)(trial.trajectory.time_s) // 1.0) == 0.0
    assert hip[:, in_cycle].mean(axis=1).std() == pytest.approx(1.2, rel=0.12)
    assert np.sqrt(np.mean(hip[:, in_cycle].var(axis=1))) == pytest.approx(0.5, rel=0.1)
    recordings = np.array([noise.recording(random) for _ in range(2000)])
    assert np.degrees(recordings[:, names.index("pelvis_tilt")].std()) == pytest.approx(
        0.1, rel=0.08
    )
    assert 1e3 * recordings[:, names.index("pelvis_ty")].std() == pytest.approx(0.4, rel=0.08)


def test_the_other_leg_stays_and_no_noise_changes_nothing(trial):
    names, random = trial.trajectory.names, np.random.default_rng(2)
    noise = KinematicNoise(trial)
    other = [i for i, name in enumerate(names) if name.endswith("_l")]
    assert not noise.session(random)[:, other].any() and not noise.recording(random)[other].any()
    none = KinematicNoise(
        trial,
        NoiseSizes(session_deg=0.0, session_smooth_deg=0.0, recording_deg=0.0, recording_mm=0.0),
    )
    same = none.perturbed(none.session(random) + none.recording(random)).trajectory
    assert np.array_equal(same.values, trial.trajectory.values)
