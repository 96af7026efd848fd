"""The spring alone under an equal load: at its own setting it is the stride, elsewhere the foot's
vertical force is kept, and nothing of the other leg is anybody's answer."""

import numpy as np
import pytest

from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.optimal_control.equal_load import under_equal_load
from vsf_drake.optimal_control.reference import LOADED_BW
from vsf_drake.optimal_control.search import StrideTuning, tracked
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.walks.embedded import embedded_contact, embedded_trials


@pytest.fixture(scope="module")
def stride_and_solution():
    (path,) = (path for path in embedded_trials(tier="exact") if path.stem == "medium_1")
    trial = trial_with(load_trial(path), load_contact(embedded_contact("exact")))
    tuning = StrideTuning([trial], cost="activation", options=StrideOptions(intervals=12))
    return tuning.stride, tracked(tuning.stride)


def test_at_its_own_setting_it_is_the_stride_itself(stride_and_solution):
    stride, solution = stride_and_solution
    y = stride.function.evaluate(solution.last.z, solution.last.p)
    assert under_equal_load(stride, solution, stride.own_m) == pytest.approx(
        y, rel=1e-6, abs=1e-4 * stride.model.weight
    )


def test_elsewhere_the_load_is_kept_and_a_softer_spring_stores_more(stride_and_solution):
    stride, solution = stride_and_solution
    index = stride.function.index
    y = stride.function.evaluate(solution.last.z, solution.last.p)
    soft, stiff = (under_equal_load(stride, solution, mm) for mm in (0.066, 0.151))
    (up,) = index("prosthetic_fz")
    stands = y[:, up] > LOADED_BW * stride.model.weight
    for other in (soft, stiff):
        off = (other - y)[stands, up]
        assert np.sqrt(np.mean(off**2)) <= 0.01 * stride.model.weight
        theirs = index("torque_hip_flexion_l", "torque_ankle_angle_l", "intact_fz", "q_pelvis_ty")
        assert np.array_equal(other[:, theirs], y[:, theirs])
    (stored,) = index("stored_energy")
    (knee,) = index("torque_knee_angle_r")
    assert soft[:, stored].max() > 1.2 * y[:, stored].max() > 1.2 * 1.2 * stiff[:, stored].max()
    assert np.abs(soft - y)[stands, knee].max() > 1.0, "the force's arm about the knee changes"
