"""What holds the prescribed joints: exact following, and loads that an independent inverse dynamics confirms."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

STEP_S = 2.5e-4


@pytest.fixture(scope="module", params=["right", "left"])
def side(request):
    return request.param


def test_prescribed_coordinates_are_followed_exactly(side, walker, stance):
    walk = stance(side, 1e-3)
    columns = [walk.mechanism.tree.index(name) for name in walker(side).gait.prescribed]
    assert np.abs(walk.record.q[:, columns] - walk.commanded).max() < 1e-12


def inverse_dynamics(gait, context, q, v, acceleration, fulcrum_m):
    """Generalized forces (n,) that the recorded motion needs beyond gravity and what the LeafSystems exert."""
    plant, plant_context = gait.plant, gait.plant_context(context)
    gait.diagram.GetInputPort("fulcrum_position").FixValue(context, [fulcrum_m])
    plant.SetPositionsAndVelocities(plant_context, np.concatenate((q, v)))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(plant_context, forces)
    for applied in plant.get_applied_spatial_force_input_port().Eval(plant_context):
        plant.get_body(applied.body_index).AddInForce(
            plant_context, applied.p_BoBq_B, applied.F_Bq_W, plant.world_frame(), forces)
    for system in (gait.forces["prosthetic"], gait.bushing):
        forces.mutable_generalized_forces()[:] += system.GetOutputPort("generalized_force").Eval(
            system.GetMyContextFromRoot(context))
    return plant.CalcInverseDynamics(plant_context, acceleration, forces)


@pytest.fixture(scope="module")
def confirmed(side, walker, stance):
    """(names, loads of the stepper, loads by inverse dynamics), every fourth step of the stance."""
    gait, walk = walker(side).gait, stance(side, STEP_S)
    record = walk.record
    context = gait.diagram.CreateDefaultContext()
    rows = np.arange(4, len(record.time_s), 4)
    acceleration = (record.v[rows] - record.v[rows - 1]) / STEP_S
    loads = [inverse_dynamics(gait, context, record.q[k], record.v[k], a, walk.fulcrum_m[k + 1])
             for k, a in zip(rows, acceleration, strict=True)]
    return walk.mechanism.tree.coordinate_names, record.load[rows], np.array(loads)


def test_joint_loads_equal_inverse_dynamics(confirmed, walker, side):
    """Within 1 % of each joint's largest load, as root mean square over the stance."""
    names, loads, expected = confirmed
    for name in walker(side).gait.prescribed:
        i = names.index(name)
        error = np.sqrt(np.mean((loads[:, i] - expected[:, i]) ** 2)) / np.abs(expected[:, i]).max()
        assert error < 0.01, name


def test_free_coordinates_need_no_load(confirmed, walker, side):
    """Inverse dynamics finds nothing missing in socket and keel, compared with their own forces."""
    names, loads, expected = confirmed
    gait = walker(side).gait
    for name, scale in (("socket_tz", 800.0), ("socket_tx", 200.0), ("socket_flexion", 50.0), ("keel_pin", 20.0)):
        i = names.index(name)
        assert np.sqrt(np.mean(expected[:, i] ** 2)) < 0.01 * scale, name
    free = [i for i, name in enumerate(names) if name not in (*gait.prescribed, "fulcrum")]
    assert np.abs(loads[:, free]).max() < 1.0, "the residual of Newton's method"


def test_load_on_the_pelvis_balances_weight_and_ground(walker, stance, side, body_weight):
    """Over the whole stance vertical impulses balance: driver + ground - weight = change of momentum."""
    walk = stance(side, STEP_S)
    record, gait = walk.record, walker(side).gait
    context = gait.plant.CreateDefaultContext()

    def momentum(q, v):
        gait.plant.SetPositionsAndVelocities(context, np.concatenate((q, v)))
        return gait.plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3)).translational()[2]

    lift = record.load[:, walk.mechanism.tree.index("pelvis_ty")]
    ground = walk.prosthetic.grf_W[:, 2] + walk.intact.grf_W[:, 2]
    impulse = STEP_S * np.sum(lift + ground - body_weight)
    change = momentum(record.q[-1], record.v[-1]) - momentum(record.q0, record.v0)
    assert impulse == pytest.approx(change, abs=2e-3 * body_weight * 0.94)
