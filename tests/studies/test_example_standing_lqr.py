"""Standing on the keel: at rest, linearised by two methods, unstable alone and stable with LQR."""

from __future__ import annotations

import numpy as np
import pytest
import standing_lqr as example
from standing_leg import inverted_pendulum

pytestmark = pytest.mark.slow
SOFT, STIFF = example.FULCRUMS_M


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    return example.main(tmp_path_factory.mktemp("standing"), quick=True)


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_at_rest_the_ground_carries_the_weight_under_the_centre_of_mass(standing, fulcrum_m):
    run = standing[fulcrum_m]
    np.testing.assert_allclose(run["grf"], [0.0, 0.0, run["weight"]], atol=1e-6 * run["weight"])
    assert run["cop"][0] == pytest.approx(run["com"][0], abs=1e-6)


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_automatic_derivatives_equal_central_differences(standing, fulcrum_m):
    """Row by row: accelerations of keel pieces have derivatives of 1e7, those of the trunk of 10."""
    run = standing[fulcrum_m]
    largest = np.abs(run["A"]).max(axis=1, keepdims=True)
    assert np.abs((run["A"] - run["difference"]) / largest).max() < 1e-5


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_the_horizontal_place_is_neutral_and_out_of_the_torques_reach(standing, fulcrum_m):
    """Creep sums the impulse of friction, which torques can only change together with the momentum."""
    run = standing[fulcrum_m]
    assert np.abs(run["A"][:, run["leg"].index("x")]).max() < 1e-6
    assert run["neutral_B"] < 1e-6


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_constant_torques_let_the_person_fall_and_lqr_keeps_the_person_up(standing, fulcrum_m):
    run = standing[fulcrum_m]
    moving = run["closed"][np.abs(run["closed"]) > example.NEUTRAL]
    assert run["open"].real.max() > 1.0
    assert moving.real.max() < -0.5
    at = [run["leg"].index(name) for name in example.POSTURE]
    fallen, instant = run["dropped"]["state"][-1, at] - run["x0"][at], len(run["dropped"]["time"]) - 1
    upright = run["regulated"]["state"][:, at] - run["x0"][at]
    assert np.abs(fallen).max() > 10.0 * np.abs(upright[instant]).max()
    assert np.abs(upright[-1]).max() < 0.5 * np.abs(upright).max()


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_the_regulated_leg_moves_as_its_linear_model_says(standing, fulcrum_m):
    run = standing[fulcrum_m]
    for name in example.POSTURE:
        i = run["leg"].index(name)
        linear, full = run["predicted"][:, i] - run["x0"][i], run["regulated"]["state"][:, i] - run["x0"][i]
        assert np.abs(full - linear).max() < 0.1 * np.abs(linear).max()


def test_with_joints_locked_the_leg_is_an_inverted_pendulum_on_the_spring_of_its_foot(standing):
    """Rate² = (weight times height - stiffness against tilt) / inertia, stiffness from statics: the soft foot falls.

    Within 10 %: the pendulum knows no damping, no sinking and no sway of the keel.
    """
    for fulcrum_m, run in standing.items():
        stiffness, weight_height, inertia = inverted_pendulum(fulcrum_m)
        squared = (weight_height - stiffness) / inertia
        slow = run["locked"][(np.abs(run["locked"]) < 10.0) & (np.abs(run["locked"]) > example.NEUTRAL)]
        rate = slow[np.argmax(slow.real)]
        assert np.sign(squared) == (1.0 if fulcrum_m == SOFT else -1.0)
        assert np.abs(rate) == pytest.approx(np.sqrt(np.abs(squared)), rel=0.1)
        assert (rate.real > 1.0) == (squared > 0)
    assert standing[SOFT]["open"].real.max() > standing[STIFF]["open"].real.max()
