"""The dropped leg: free fall, momentum, weight and energy are those of mechanics."""

from __future__ import annotations

import math

import leg_drop
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("leg_drop")
    return {**leg_drop.main(folder, quick=True), "folder": folder}


def test_it_falls_freely_until_it_lands(drop):
    """Springs at their rest angle and no rail friction: sqrt(2 h / g), less a step of the integrator."""
    assert drop["touch_down"] == pytest.approx(math.sqrt(2 * leg_drop.DROP_M / 9.81), abs=1e-3)


def test_at_rest_the_ground_carries_the_weight_and_the_foam_carries_it_too(drop):
    mass = 10.0 + 5.0 + 2.0 + 0.649
    assert drop["weight"] == pytest.approx(mass * 9.81, rel=1e-6)
    assert drop["settled"] == pytest.approx(drop["weight"], rel=5e-3)
    assert drop["foam_force"] == pytest.approx(drop["weight"], rel=5e-3)
    assert 0.0 < drop["largest_depth"] < 0.03


def test_the_impulse_of_ground_and_weight_is_the_change_of_momentum(drop):
    change = drop["impulse"] - drop["weight"] * drop["duration"]
    assert change == pytest.approx(drop["momentum"], abs=1e-3 * drop["weight"] * drop["duration"])
    assert drop["peak"] > 2.0 * drop["weight"]


def test_energy_is_never_created_and_what_is_lost_is_accounted_for(drop):
    assert drop["largest_rise"] < 1e-6 * drop["dropped_energy"]
    assert drop["unaccounted"] < 0.02 * drop["dropped_energy"]
    assert drop["friction_loss"] > 0.0
    assert drop["foam_loss"] > 0.0


def test_the_picture_is_drawn(drop):
    assert (drop["folder"] / "leg_drop.png").stat().st_size < 150_000
