"""A step solves Drake's equations of motion, its tangent is their derivative, and nothing makes
energy."""

from __future__ import annotations

import numpy as np
import pytest
from cut_walks import inputs_of
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable, MultibodyForces

from vsf_drake.laws.bushing import axis_force
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS, TOLERANCE


@pytest.mark.parametrize("side", ["right", "left"])
def test_steps_solve_drakes_equations_of_motion_with_the_forces_they_record(walker, motion, side):
    """M a + C - tau_g - sum J^T f = load, which is 0 for what is free: all but f and load from
    Drake and the laws."""
    person = walker(side)
    walk = person.walk(motion(side), fulcrum_m=0.108, start_s=0.0, end_s=0.94, step_s=2e-3)
    plant, context, record, mechanism = (
        person.gait.plant,
        walk.mechanism.context,
        walk.record,
        walk.mechanism,
    )
    free = np.setdiff1d(np.arange(record.q.shape[1]), inputs_of(walk, person).prescribed)
    for k in range(60, 440, 20):
        q0, v0, q, v = record.q[k - 1], record.v[k - 1], record.q[k], record.v[k]
        plant.SetPositionsAndVelocities(context, np.concatenate([q0, v0]))
        own = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, own)
        need = plant.CalcInverseDynamics(context, (v - v0) / 2e-3, own)
        need -= ground_on_coordinates(plant, context, mechanism, record.sites[k])
        law = dict(zip(SPRING_COLUMNS, mechanism.springs.T, strict=True))
        springs = mechanism.spring_index
        need[springs] -= axis_force(q[springs], v[springs], **law)[0]
        need -= record.fulcrum[k, 0] * support_row(plant, context, person.gait.person.foot, 0.108)
        r = 2e-3 * (need - record.load[k])[free]
        M = plant.CalcMassMatrix(context)[np.ix_(free, free)]
        assert np.sqrt(r @ np.linalg.solve(M, r)) < 2.0 * TOLERANCE
        held = np.setdiff1d(np.arange(len(q)), free)
        np.testing.assert_allclose(
            record.load[k, held], need[held], rtol=0.0, atol=1e-9 * np.abs(need).max()
        )


def ground_on_coordinates(plant, context, mechanism, sites):
    """(n,) J^T f of the ground, at the lowest points of the spheres."""
    total, world = np.zeros(plant.num_velocities()), plant.world_frame()
    for site, b, row in zip(sites, mechanism.site_bodies, mechanism.sites, strict=True):
        if site[1] > 0.0:
            body = plant.get_body(BodyIndex(int(b)))
            X = body.EvalPoseInWorld(context)
            p_B = X.inverse() @ (X @ row[:3] - [0.0, 0.0, row[3]])
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, body.body_frame(), p_B, world, world
            )
            total += J.T @ [site[2], site[3], site[1]]
    return total


def support_row(plant, context, foot, position):
    """(n,) rate of the keel's point at `position` in the foot's frame along its z, by each
    coordinate."""
    j = foot.keel_body_at(position)
    J = plant.CalcJacobianTranslationalVelocity(
        context,
        JacobianWrtVariable.kV,
        foot.keel[j].body_frame(),
        [position - foot.keel_starts[j], 0.0, 0.0],
        foot.frame.body_frame(),
        foot.frame.body_frame(),
    )
    return J[2]
