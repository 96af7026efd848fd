"""The linear model of a walk answers small changes as the stepper does, where no sphere slides off or lands."""

from __future__ import annotations

import numpy as np
import pytest
from made_sagittal import embedded_walker, loaded_motion

from vsf_drake.analysis.tuning.resimulation.resimulate import drive, linear_steps, walk_prescribed

STEPS = 12
SMALL_Q, SMALL_V, SMALL_TORQUE = 1e-6, 1e-4, 1e-2


@pytest.fixture(scope="module")
def solution():
    return loaded_motion(40)


@pytest.fixture(scope="module")
def walk(solution):
    return walk_prescribed(embedded_walker(), solution)


def state(walk, k):
    return (walk.record.q[k - 1].copy(), walk.record.v[k - 1].copy())


def run(walk, names, first, q0, v0, more=0.0):
    """End of STEPS steps under the loads that prescribed the walk, from another start or with more torque."""
    columns = [walk.mechanism.tree.index(name) for name in names]
    load = walk.record.load[first : first + STEPS, columns] + more
    time_s = walk.step_s * np.arange(STEPS + 1)
    driven = drive(walk, names, time_s=time_s, feedforward=load, gains=np.zeros((STEPS, 8, 16)),
                   states=np.zeros((STEPS, 16)) + np.r_[q0[columns], v0[columns]], q0=q0, v0=v0)
    return driven.record


@pytest.mark.parametrize("phase", [0.4, 0.5, 0.65])
def test_linear_answer_is_the_limit_of_the_stepper_s(solution, walk, phase):
    first = int(np.argmin(np.abs(walk.record.time_s - (solution.start_s + phase * solution.period_s))))
    steps = linear_steps(walk, solution.names, first, first + STEPS)
    tree = walk.mechanism.tree
    free = np.setdiff1d(np.arange(tree.num_coordinates),
                        [i for i, n in enumerate(tree.coordinate_names)
                         if n not in solution.names and not n.startswith(("socket", "keel"))])
    f = len(free)
    q0, v0 = state(walk, first)
    nominal = run(walk, solution.names, first, q0, v0)
    np.testing.assert_allclose(nominal.q[-1], walk.record.q[first + STEPS - 1], atol=1e-8)
    transition, by_torque = np.eye(2 * f), np.zeros((2 * f, 8))
    for A, B in zip(steps.A, steps.B, strict=True):
        transition, by_torque = A @ transition, A @ by_torque + B

    def end(record):
        return np.concatenate([record.q[-1, free], record.v[-1, free]])

    rng = np.random.default_rng(2)
    for _ in range(3):
        dx = np.concatenate([SMALL_Q * rng.normal(size=f), SMALL_V * rng.normal(size=f)])
        dq, dv = np.zeros_like(q0), np.zeros_like(v0)
        dq[free], dv[free] = dx[:f], dx[f:]
        ends = [end(run(walk, solution.names, first, q0 + s * dq, v0 + s * dv)) for s in (1, -1)]
        found, expected = (ends[0] - ends[1]) / 2, transition @ dx
        assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)
    more = SMALL_TORQUE * rng.normal(size=8)
    ends = [end(run(walk, solution.names, first, q0, v0, s * more)) for s in (1, -1)]
    expected = by_torque @ more
    assert np.linalg.norm((ends[0] - ends[1]) / 2 - expected) < 0.01 * np.linalg.norm(expected)


def test_person_s_places_and_what_is_inside_are_told_apart(solution, walk):
    steps = linear_steps(walk, solution.names, 400, 403)
    f = steps.A.shape[1] // 2
    assert f == 8 + 6 + 9
    np.testing.assert_allclose(steps.whole[:, steps.person], np.tile(np.eye(16), (3, 1, 1)))
    assert sorted(steps.person[8:] - f) == sorted(steps.person[:8])
