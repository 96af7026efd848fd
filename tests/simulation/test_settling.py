"""What a prosthesis is said to give under a standing person is what the simulated one gives."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.motion.markers.posture import settling
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.walk import Walker

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
LOWERED_M = 0.008


@pytest.fixture(scope="module")
def walker():
    return Walker(SUBJECT, ModelParameters())


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_the_load_on_a_lowered_person_settles_the_prosthesis_by_as_much(walker, fulcrum_m):
    """By the stepper, whose rotations are large and whose socket tilts; 5 % for what linear statics omit."""
    body, names = walker.gait.person.body, walker.gait.prescribed
    q = np.zeros((8, len(names)))
    q[:, names.index("pelvis_ty")] = body.leg_length - body.hip_up - LOWERED_M
    still = CoordinateTrajectory(np.linspace(0.0, 1.0, len(q)), q, names)
    walk = walker.walk(still, fulcrum_m=fulcrum_m, start_s=0.0, end_s=1.0)
    load = float(walk.prosthetic.grf_W[-1, 2])
    assert settling(load, ModelParameters(), fulcrum_m=fulcrum_m) == pytest.approx(LOWERED_M, rel=0.05)


def test_an_unloaded_prosthesis_has_its_length():
    assert settling(0.0, ModelParameters()) == 0.0
