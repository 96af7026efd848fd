"""Able-bodied walking by speed, against the group means that it is made of and Newton's laws."""

import numpy as np
import pytest

from vsf_drake.analysis.tuning.level2.normal import normal_gait
from vsf_drake.errors import InputError
from vsf_drake.parameters import GRAVITY

PHASE, LEG_M = np.linspace(0.0, 1.0, 501), 0.93


def at(dimensionless_speed):
    return normal_gait(dimensionless_speed * np.sqrt(GRAVITY * LEG_M), LEG_M)


@pytest.mark.parametrize(("speed", "extremes"), [
    (0.290, {"hip_flexion": (-2.4, 34.3), "knee_flexion": (3.6, 55.2), "ankle_dorsiflexion": (-13.6, 13.8)}),
    (0.429, {"hip_flexion": (-5.8, 36.7), "knee_flexion": (4.0, 59.1), "ankle_dorsiflexion": (-19.8, 11.8)})])
def test_angles_reach_what_was_published_of_the_slow_and_the_free_group(speed, extremes):
    """Schwartz 2008, degrees; six harmonics leave up to a degree at the ankle's narrow peak."""
    for angle, (least, most) in extremes.items():
        curve = at(speed).at(angle, PHASE)
        assert (curve.min(), curve.max()) == pytest.approx((least, most), abs=1.0)


@pytest.mark.parametrize(("speed", "first", "second"), [(0.290, 0.98, 1.03), (0.429, 1.10, 1.08)])
def test_both_feet_carry_the_body_and_the_peaks_are_the_published_ones(speed, first, second):
    """The mean of a periodic stride: body weight up, nothing forward, but for what averaging over persons leaves; peaks
    of Schwartz 2008 in body weights."""
    force, forward = (at(speed).at(name, PHASE[:-1]) for name in ("force_up", "force_forward"))
    assert 2.0 * force.mean() == pytest.approx(1.0, abs=0.015) and forward.mean() == pytest.approx(0.0, abs=2e-3)
    assert force[:150].max() == pytest.approx(first, abs=0.03) and force[150:].max() == pytest.approx(second, abs=0.03)


def test_rates_are_the_derivatives_of_the_curves():
    for rank in (1, 2):
        rates = np.gradient(at(0.35).at("knee_flexion", PHASE, rank - 1), PHASE)[2:-2]
        assert rates == pytest.approx(at(0.35).at("knee_flexion", PHASE, rank)[2:-2], rel=0.01, abs=5.0)


def test_between_the_groups_walking_is_between_them_and_out_of_reach_it_is_refused():
    low, high, middle = (at(speed).at("hip_flexion", PHASE) for speed in (0.290, 0.429, 0.3595))
    assert middle == pytest.approx(0.5 * (low + high))
    for speed in (0.3, 2.5):
        with pytest.raises(InputError, match="able-bodied walking"):
            normal_gait(speed, LEG_M)
