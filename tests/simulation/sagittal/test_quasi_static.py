"""Keel and socket in balance over a whole motion, against the stepper, which knows their inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from vsf_drake.analysis.tuning.level2.stride import BALANCED, quasi_static_motion
from vsf_drake.errors import SimulationError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker

STEP_S = 0.005
OWN = np.array([0.108, 1.0, 0.0, 1.0])
SHARP = Smoothing(depth_m=1e-4, rate_m_per_s=0.002)


def backward_rates(count):
    """Rates by the second-order backward difference, from rest."""
    rates = sp.lil_matrix((count, count))
    rates[1, 0], rates[1, 1] = -1.0, 1.0
    for i in range(2, count):
        rates[i, i - 2:i + 1] = [0.5, -2.0, 1.5]
    return rates.tocsr() / STEP_S


def planar(motion, names):
    """The motion without what leaves the sagittal plane."""
    values = [motion.values[:, i] if name in names else 0.0 * motion.time_s for i, name in enumerate(motion.names)]
    return CoordinateTrajectory(motion.time_s, np.column_stack(values), motion.names)


@pytest.fixture(scope="module")
def rolling(walker, motion):
    """A walker whose friction does not fall beyond its threshold, where the smooth law is not the stepper's; its
    sagittal model, a planar roll-over and the instants at which it is looked at."""
    parameters, subject = ModelParameters(), walker("right").subject
    level = replace(parameters.foot.friction, mu_kinetic=parameters.foot.friction.mu_static)
    parameters = replace(parameters, foot=replace(parameters.foot, friction=level),
                         intact_foot=replace(parameters.intact_foot, friction=level))
    person = Walker(subject, parameters)
    model = SagittalModel(person)
    path, time = planar(motion("right"), model.coordinates), np.arange(0.02, 0.9, STEP_S)
    return person, model, path, time, [x.T for x in path.ordered(model.coordinates).sample(time)]


@pytest.fixture(scope="module")
def balanced(rolling):
    _, model, _, time, state = rolling
    rates = backward_rates(len(time))
    first, _ = quasi_static_motion(model, *state, OWN, rates, Smoothing())
    return quasi_static_motion(model, *state, OWN, rates, SHARP, start=first)


def test_every_joint_is_in_balance_at_every_instant(rolling, balanced):
    _, model, _, time, state = rolling
    y = model.evaluate(*state, *balanced, np.repeat(OWN[:, None], len(time), 1), SHARP)
    assert np.abs(y[3:15]).max() <= BALANCED * model.weight


def test_ground_reaction_is_the_steppers_but_for_the_inertia_of_what_yields(rolling, balanced):
    """What is left out is the acceleration of keel and socket in themselves: its force, in the mean square, and twice
    what the stepper changes by in half its step bound the difference. That is less than 0.5 % of body weight."""
    person, model, path, time, state = rolling
    w, u = balanced
    p = np.repeat(OWN[:, None], len(time), 1)
    y = dict(zip(model.outputs, model.evaluate(*state, w, u, p, SHARP), strict=True))
    coarse, fine = (person.walk(path, fulcrum_m=OWN[0], start_s=0.0, end_s=0.9, step_s=h) for h in (1e-3, 5e-4))
    own = (backward_rates(len(time)) @ u.T).T
    nil = np.zeros((2, len(time)))
    dynamics, still = model.dynamics, model.motion(*state, w, u, p)
    moved = dynamics.move(np.concatenate([state[0], w, p[:1], p[2:3]]), np.concatenate([state[1], u, nil]),
                          np.concatenate([state[2], own, nil]))
    left_out = (dynamics.inertial(moved) - dynamics.inertial(still)).sum(axis=1)

    def size(x):
        return np.sqrt((x * x).mean())

    for name, column, missing in (("prosthetic_fx", 0, left_out[1]), ("prosthetic_fz", 2, left_out[2])):
        known, other = (np.interp(time, walk.record.time_s, walk.prosthetic.grf_W[:, column])
                        for walk in (fine, coarse))
        assert size(y[name] - known) <= size(missing) + 2.0 * size(other - known)
        assert size(y[name] - known) < 0.005 * model.weight
    assert y["prosthetic_fz"].max() > 0.9 * model.weight


def test_motion_without_balance_says_where(rolling):
    _, model, _, time, state = rolling
    q = state[0].copy()
    q[2, 40] = np.nan
    place = f"at instant 41 of {len(time)} socket_tx is off by nan"
    with pytest.raises(SimulationError, match=f"find no balance .* {place}"):
        quasi_static_motion(model, q, *state[1:], OWN, backward_rates(len(time)), Smoothing())
