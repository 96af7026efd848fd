"""The person standing still with the pelvis free in height."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.standing import simulate_standing


@pytest.fixture(scope="module", params=[("right", "male"), ("left", "male"), ("right", "female")])
def standing(request):
    side, sex = request.param
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex=sex, prosthetic_side=side)
    return simulate_standing(subject, ModelParameters())


def test_settled_contact_force_equals_weight(standing):
    assert standing.weight_n == pytest.approx(78.0 * 9.81)
    assert standing.vertical_n[-1] == pytest.approx(standing.weight_n, rel=1e-3)
    assert np.ptp(standing.vertical_n[-200:]) < 1e-3 * standing.weight_n


def test_both_feet_carry_load_at_rest(standing):
    assert 0.1 < standing.prosthetic_share < 0.9
    assert standing.drift_m < 1e-4
    assert standing.walk.record.converged.all()


def test_held_joints_bear_what_the_ground_does_not(standing):
    """The free pelvis height needs no force; the load on it is Newton's residual."""
    names = standing.walk.mechanism.tree
    assert abs(standing.walk.record.load[-1, names.index("pelvis_ty")]) < 1e-2
