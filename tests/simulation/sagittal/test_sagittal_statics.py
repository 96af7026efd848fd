"""The person at rest: beam theory, weight, and energy that comes back."""

from __future__ import annotations

import keel_at_rest
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import root

from vsf_drake.analysis.tuning.level2.stride import quasi_static_motion
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing, Spheres, normal, touch
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS

LOADS = np.array([200.0, 600.0])
KEEL = slice(6, 15)
"""Of the outputs: balance of the keel's joints."""
OWN = np.array([0.108, 1.0, 0.0, 1.0])


def weightless(walker) -> SagittalModel:
    model = SagittalModel(walker)
    model.dynamics.gravity = 0.0
    return model


def on_the_bench(walker) -> SagittalModel:
    """Without weight, its ground a frictionless spring under the load point of the keel."""
    model = weightless(walker)
    foot, starts = walker.model.foot, model.support.starts
    piece = int(np.searchsorted(starts, foot.load_point_m, side="right") - 1)
    first = int(model.dynamics.link[11])
    law = {"radius": 0.0, "stiffness": 1e5, "exponent": 1.0, "damping": 0.0, "full_damping_depth": 1e-3,
           "mu_static": 0.0, "mu_kinetic": 0.0, "threshold_velocity": 1.0}
    far_up = 5.0
    model.spheres = Spheres(
        link=np.array([first + piece, 2]), x=np.array([foot.load_point_m - starts[piece], 0.0]),
        z=np.array([0.0, far_up]), count=np.ones(2), heel=np.zeros(2, dtype=bool),
        columns={name: np.full(2, law.get(name, 0.0)) for name in SITE_COLUMNS})
    model.feet = slice(0, 1), slice(1, 2)
    return model


def rise_under(model, load, fulcrum):
    """Rise (m) of the load point over the undeformed keel, socket held: keel's turns and the hip's height such that
    the joints balance and the ground bears `load`."""
    p = np.array([fulcrum, 1.0, 0.0, 1.0])[:, None]
    smoothing, fz = Smoothing(damping=0.0), model.outputs.index("prosthetic_fz")

    def arguments(unknown):
        q, w = np.zeros((8, 1)), np.zeros((12, 1))
        q[2], w[3:, 0] = unknown[0], unknown[1:]
        return q, 0.0 * q, 0.0 * q, w, 0.0 * w, p

    def left(unknown):
        y, by = linearise(model, *arguments(unknown), smoothing)
        columns = [2, *range(27, 36)]
        return np.append(y[KEEL, 0], y[fz, 0] - load), np.vstack([by[KEEL], by[fz:fz + 1]])[:, columns, 0]

    def height(unknown):
        return touch(model.spheres, model.motion(*arguments(unknown)), 0.0).z[0, 0] - unknown[0]

    flat = np.zeros(10)
    start = np.append(-height(flat) - load / 1e5, np.zeros(9))
    found = root(left, start, jac=True, tol=1e-14)
    assert np.abs(left(found.x)[0]).max() < 1e-7 * max(load, 1.0)
    return height(found.x) - height(flat)


@pytest.mark.parametrize("fulcrum", [0.066, 0.108, 0.139])
def test_forefoot_bends_as_on_the_bench(walker, fulcrum):
    """The stepper's keel under the same loads; the fulcrum is further than its blending from any joint."""
    foot = walker("right").model.foot
    known = keel_at_rest.rises(foot, LOADS, fulcrum)
    model = on_the_bench(walker("right"))
    np.testing.assert_allclose([rise_under(model, load, fulcrum) for load in LOADS], known, rtol=1e-7)


@pytest.mark.parametrize("fulcrum", [0.066, 0.108, 0.139])
def test_forefoot_has_the_stiffness_of_the_overhung_chain(walker, fulcrum):
    """Closed form for small loads."""
    foot = walker("left").model.foot
    known = lumped_stiffness(
        bending_stiffness=foot.keel.flexural_modulus_pa * section_inertia(foot.keel.width_m, foot.keel.thickness_m),
        element_lengths=foot.keel.element_lengths_m, support=fulcrum, load_point=foot.load_point_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m)
    assert 1e-2 / rise_under(on_the_bench(walker("left")), 1e-2, fulcrum) == pytest.approx(known, rel=1e-4)


def test_what_a_person_at_rest_lacks_is_weight_less_ground(person, drawn, plant_state):
    """Action equals reaction: forces, and moments about the pelvis with the plant's centre of mass."""
    walker, model = person
    at = drawn(model, 10, seed=20, speed=0.0)
    y = dict(zip(model.outputs, model.evaluate(*at.all, Smoothing()), strict=True))
    plant = walker.gait.plant
    for i in range(10):
        context, _ = plant_state(walker, model, at, i)
        weight = plant.CalcTotalMass(context) * 9.81
        fx, fz, my = (sum(y[f"{foot}_{part}"][i] for foot in ("prosthetic", "intact")) for part in ("fx", "fz", "my"))
        com = plant.CalcCenterOfMassPositionInWorld(context)
        assert y["balance_pelvis_ty"][i] == pytest.approx(weight - fz, abs=1e-9)
        assert y["balance_pelvis_tx"][i] == pytest.approx(-fx, abs=1e-9)
        px, pz = at.q[1, i], at.q[2, i]
        need = -((com[0] - px) * weight + my - (pz * fx - px * fz))
        axis = plant.GetJointByName("pelvis_tilt").revolute_axis()[1]
        assert y["balance_pelvis_tilt"][i] == pytest.approx(axis * need, abs=1e-9)


def test_socket_bears_ground_less_weight_of_the_prosthesis(person, drawn, plant_state):
    """Turned into the residual shank, whose axes are the socket's."""
    walker, model = person
    at = drawn(model, 10, seed=21, speed=0.0)
    y = dict(zip(model.outputs, model.evaluate(*at.all, Smoothing()), strict=True))
    plant = walker.gait.plant
    shank = plant.GetBodyByName(f"shank_{walker.subject.prosthetic_side}")
    for i in range(10):
        context, _ = plant_state(walker, model, at, i)
        below = plant.GetBodiesKinematicallyAffectedBy([plant.GetJointByName("socket_tx").index()])
        mass = sum(plant.get_body(body).get_mass(context) for body in below)
        need = np.array([-y["prosthetic_fx"][i], 0.0, 9.81 * mass - y["prosthetic_fz"][i]])
        known = shank.EvalPoseInWorld(context).rotation().inverse() @ need
        found = [y[f"balance_socket_{axis}"][i] + y[f"force_socket_{axis}"][i] for axis in ("tx", "tz")]
        np.testing.assert_allclose(found, known[[0, 2]], atol=1e-9 * np.abs(known).max())


@pytest.mark.parametrize("hip", [0.25, 0.0, -0.3])
def test_what_the_ground_does_in_pressing_slowly_is_stored(walker, hip):
    """Onto the heel, flat, and onto the forefoot, without weight: work by the trapezoidal rule, of second order."""
    model, smoothing, count = weightless(walker("right")), Smoothing(depth_m=0.002), 401
    q = np.zeros((8, count))
    q[3], q[6] = hip, -1.2
    q[2] = 1.5
    still = np.zeros_like(q)
    above = model.evaluate(q, still, still, *np.zeros((2, 12, count)), np.repeat(OWN[:, None], count, 1), smoothing)
    q[2] -= above[model.outputs.index("prosthetic_sole"), 0] + np.linspace(-0.012, 0.025, count)
    w, u = quasi_static_motion(model, q, still, still, OWN, sp.csr_matrix((count, count)), smoothing)
    p = np.repeat(OWN[:, None], count, 1)
    at = touch(model.spheres, model.motion(q, still, still, w, u, p), model.ground)
    fz = normal(model.spheres, at.depth, -at.vz, p[1], smoothing)
    lift = at.z - q[2]
    work = 0.5 * ((fz[:, 1:] + fz[:, :-1]) * np.diff(lift, axis=1)).sum(axis=0)
    y = model.evaluate(q, still, still, w, u, p, smoothing)
    stored = y[model.outputs.index("stored_energy")]
    assert y[model.outputs.index("prosthetic_fz")].max() > 200.0
    np.testing.assert_allclose(np.cumsum(work), stored[1:] - stored[0], atol=2e-4 * stored.max())
