"""With mass matrix, Coriolis and gravity terms from Drake the stepper does the same, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker, inputs_of

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import Bench
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.stepping.stepper import Inputs, Stepper

TOLERANCE = 1e-9
"""Share of the largest number of a column that the two may differ by after hundreds of steps."""


def both(mechanism, inputs, q0, v0):
    """Records of the same run; the mechanism's Context must still hold the foot's place of its walk."""
    return [Stepper(mechanism, dynamics=dynamics).run(inputs, q0, v0) for dynamics in ("compiled", "drake")]


def stance_by_both(walker, trajectory, **options):
    walk = walker.walk(trajectory, **{"fulcrum_m": 0.108, "start_s": 0.0, "end_s": 0.94, "step_s": 2e-3} | options)
    inputs = inputs_of(walk, walker)
    return inputs, *both(walk.mechanism, inputs, walk.record.q0, walk.record.v0)


def assert_same(inputs, compiled, drake):
    for name in ("q", "v", "sites", "fulcrum", "load"):
        found, wanted = getattr(compiled, name), getattr(drake, name)
        if name == "load":  # those of free coordinates are what Newton's method leaves of zero
            found, wanted = found[:, inputs.prescribed], wanted[:, inputs.prescribed]
        scale = np.abs(wanted).max(axis=tuple(range(wanted.ndim - 1)))
        # A coordinate that hardly moves or bears nothing has the rounding of its neighbours.
        floor = 1e-6 * scale.max()
        assert np.all(np.abs(found - wanted) <= TOLERANCE * np.maximum(scale, floor)), name
    np.testing.assert_array_equal(compiled.parts, drake.parts)
    np.testing.assert_array_equal(compiled.converged, drake.converged)


@pytest.mark.parametrize("side", ["right", "left"])
def test_whole_stance_is_the_same(walker, motion, side):
    inputs, compiled, drake = stance_by_both(walker(side), motion(side))
    assert np.abs(compiled.site("normal_force")).max() > 100.0
    for name in ("pelvis_ty", "hip_flexion_r", "knee_angle_l", "ankle_angle_l" if side == "right" else "ankle_angle_r"):
        column = walker(side).gait.prescribed.index(name)
        assert np.abs(drake.load[:, inputs.prescribed[column]]).max() > 0.1
    assert_same(inputs, compiled, drake)


def test_stance_with_a_shifted_foot_is_the_same(walker, motion):
    offsets = GeometricOffsets(height_m=0.004, fore_aft_m=-0.01, alignment_rad=0.03)
    assert_same(*stance_by_both(walker("right"), motion("right"), fulcrum_m=0.087, offsets=offsets))


@pytest.mark.parametrize("name", SETTINGS)
def test_walk_with_steps_that_are_cut_is_the_same(name):
    walk = cut_walk(name)
    inputs, record = inputs_of(walk, hard_walker(SETTINGS[name][0])[0]), walk.record
    compiled, drake = both(walk.mechanism, inputs, record.q0, record.v0)
    assert compiled.parts.max() > 1
    assert compiled.converged.all() == (name != "lost")
    assert_same(inputs, compiled, drake)


@pytest.mark.parametrize("heel", [False, True])
def test_bench_is_the_same(heel):
    """Its platen moves, and all joints but the carriage are free."""
    bench = Bench(FootParameters(), heel=heel)
    mechanism = bench_mechanism(bench.bench, bench.context)
    carriage = mechanism.tree.index(bench.bench.foot.carriage_joint_name)
    time = np.linspace(0.0, 0.5, 201)
    inputs = Inputs(time_s=time, prescribed=np.array([carriage]), prescribed_q=np.full((201, 1), 0.108),
                    fulcrum=np.full(201, 0.108), ground=bench.bench.contact_height + 0.01 * time)
    q0 = np.zeros(mechanism.tree.num_coordinates)
    q0[carriage] = 0.108
    compiled, drake = both(mechanism, inputs, q0, np.zeros_like(q0))
    assert compiled.site("normal_force")[-1].sum() > 10.0
    assert_same(inputs, compiled, drake)


def test_settling_is_the_same(walker, motion):
    walk = walker("right").walk(motion("right"), fulcrum_m=0.108, start_s=0.3, end_s=0.302)
    inputs = inputs_of(walk, walker("right"))
    rest = [Stepper(walk.mechanism, dynamics=dynamics).settle(inputs, walk.record.q0)[0]
            for dynamics in ("compiled", "drake")]
    np.testing.assert_allclose(rest[0], rest[1], rtol=0.0, atol=1e-9)


def test_unknown_dynamics_are_refused_by_name(stance):
    with pytest.raises(ValueError, match="dynamics is 'mujoco', but must be one of compiled, drake"):
        Stepper(stance("right", 2e-3).mechanism, dynamics="mujoco")
