"""Thirty made feet, fitted to their curves: what is stored meets what was asked."""

from __future__ import annotations

import json
from pathlib import Path

import foot_from_curves as study
import numpy as np
import pytest

STORED = Path(__file__).resolve().parents[2] / "studies" / "results" / "foot_from_curves.json"


@pytest.fixture(scope="module")
def stored():
    return json.loads(STORED.read_text(encoding="utf-8"))


def test_twenty_eight_of_thirty_feet_are_met_and_the_intervals_hold_their_loads(stored):
    feet = stored["feet"]
    assert stored["synthetic"] is True and len(feet) == study.COUNT
    worst = [max(foot["errors"].values()) for foot in feet]
    assert sum(error <= 0.05 for error in worst) == stored["within_5_percent"] >= 28
    coverage = np.mean([foot["coverage"] for foot in feet])
    assert coverage == pytest.approx(stored["coverage"])
    assert 0.85 <= coverage <= 0.95  # of intervals that are to hold 90 %


def test_half_of_the_feet_are_pressed_level_and_every_third_at_two_angles(stored):
    for number, foot in enumerate(stored["feet"]):
        angles = [name for name in foot["errors"] if name.startswith("forefoot")]
        assert ("heel at -15" in foot["errors"]) == (number % 2 == 1)
        assert len(angles) == (2 if number % 3 == 2 else 1)
