"""Noise of kinematics has the stated size, touches the stated angles, and closes over the gait cycle."""

from __future__ import annotations

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.validation.settings_walks import SPLINES, KinematicNoise, NoiseSizes, smooth_basis
from vsf_drake.motion.fitted_trial import gait_phase


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
    assert np.degrees(recordings[:, names.index("pelvis_tilt")].std()) == pytest.approx(0.1, rel=0.08)
    assert 1e3 * recordings[:, names.index("pelvis_ty")].std() == pytest.approx(0.4, rel=0.08)


def test_the_other_leg_stays_and_no_noise_changes_nothing(trial):
    names, random = trial.trajectory.names, np.random.default_rng(2)
    noise = KinematicNoise(trial)
    other = [i for i, name in enumerate(names) if name.endswith("_l")]
    assert not noise.session(random)[:, other].any() and not noise.recording(random)[other].any()
    none = KinematicNoise(trial, NoiseSizes(session_deg=0.0, session_smooth_deg=0.0, recording_deg=0.0,
                                            recording_mm=0.0))
    same = none.perturbed(none.session(random) + none.recording(random)).trajectory
    assert np.array_equal(same.values, trial.trajectory.values)
