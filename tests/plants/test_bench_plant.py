"""The roll-over machine: its coordinates turn and lift the foot as they say."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.bench import MOUNT_COORDINATES, make_roll_over_machine
from vsf_drake.plants.foot import sole_height
from vsf_drake.plants.wiring import velocity_indices

FOOT = FootParameters()


@pytest.fixture(scope="module")
def machine():
    return make_roll_over_machine(FOOT, friction=True)


def pose(machine, forward=0.0, up=0.0, pitch=0.0):
    """X_WK of the foot's rigid frame for the mount's coordinates."""
    context = machine.plant.CreateDefaultContext()
    q = machine.plant.GetPositions(context)
    q[velocity_indices(machine.plant, MOUNT_COORDINATES)] = forward, up, pitch
    machine.plant.SetPositions(context, q)
    return machine.foot.frame.EvalPoseInWorld(context)


def test_mount_stands_at_build_height_over_the_sole_and_positive_pitch_lifts_the_toes_about_it(machine):
    X, turned = pose(machine, up=0.2), pose(machine, forward=0.3, up=0.2, pitch=0.25)
    sole = np.array([FOOT.pylon_x_m, 0.0, sole_height(FOOT)])
    np.testing.assert_allclose(X @ sole, [0.0, 0.0, 0.2 - FOOT.build_height_m], atol=1e-12)
    np.testing.assert_allclose(turned @ (sole + np.array([0.0, 0.0, FOOT.build_height_m])), [0.3, 0.0, 0.2], atol=1e-12)
    heel, toe = turned @ np.zeros(3), turned @ np.array([0.229, 0.0, 0.0])
    assert toe[2] - heel[2] == pytest.approx(0.229 * np.sin(0.25))
