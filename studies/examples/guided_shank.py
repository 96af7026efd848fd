"""A shank led through strides of walking by three compliant guides, the foot under it free to
answer.

    knee: forward, up (slides), lean (hinge)   The shank's lean is a cycle of the shape of level
                                               walking; the
      |                                        knee goes where a rigid foot would have it that rolls
                                               over heel
      |  shank, leaning forward is positive    and forefoot without slipping. In stance the guides
                                               press with
      |                                        the two humps of walking; their springs are weak
                                               against the
    +-+----__                                  foot, so a softer keel sinks deeper. In swing they
                                               lift the
    ------------------ ground, z = 0           foot clear of the ground.

Every number of the cycle is a choice, near level walking at 1 m/s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial, StackedTrajectory
from scipy.interpolate import PchipInterpolator

from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import FootHandles, WiredFoot, add_foot, share_generalized_forces, wire_foot
from vsf_drake.plants.solids import FORWARD, LEFTWARD, UPWARD, add_chain, box
from vsf_drake.systems import GaitDriver

STRIDE_S, STANCE, STRIDE_M = 1.1, 0.62, 1.15
"""Duration of a stride (s), its share of stance, its length (m)."""
LEAN_DEG = {
    0.0: -17.0,
    0.06: -9.0,
    0.12: -2.0,
    0.3: 9.0,
    0.45: 21.0,
    0.54: 33.0,
    0.62: 45.0,
    0.68: 50.0,
    0.76: 40.0,
    0.86: 7.0,
    0.94: -16.0,
    0.97: -19.0,
    1.0: -17.0,
}
"""Lean of the shank (deg, forward positive) by the share of the stride."""
LOAD_N = {
    0.0: 0.0,
    0.06: 250.0,
    0.14: 600.0,
    0.3: 450.0,
    0.47: 600.0,
    0.56: 150.0,
    0.6: 0.0,
    1.0: 0.0,
}
"""What presses the knee down, beyond the leg's weight."""
CLEARANCE_M, SHANK_M, SHANK_KG = 0.05, 0.40, 3.0
GUIDES = ("knee_forward", "knee_up", "shank_lean")
STIFFNESS, DAMPING = np.array([4e3, 6e3, 3e3]), np.array([250.0, 300.0, 60.0])
"""Of the guides: N/m, N/m, N m/rad; N s/m, N s/m, N m s/rad."""
HEEL_X_M, FOREFOOT_X_M = -0.058, 0.145
"""Where a rigid foot would roll over, ahead of the shank's axis."""


@dataclass(frozen=True)
class GuidedShank:
    """Plant, foot and what the guides want: (3,) forward (m), up (m), lean (rad) by time."""

    plant: MultibodyPlant
    foot: FootHandles
    wired: WiredFoot
    desired: PiecewisePolynomial


def add_guided_shank(
    builder: DiagramBuilder, parameters: FootParameters, strides: int
) -> GuidedShank:
    """Builds plant, foot and guides for so many strides."""
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    instance = plant.AddModelInstance("leg")
    shank = plant.AddRigidBody(
        "shank", instance, box(SHANK_KG, (0.08, 0.08, SHANK_M), (0.0, 0.0, -0.5 * SHANK_M))
    )
    kinds = (PrismaticJoint, PrismaticJoint, RevoluteJoint)
    steps = list(zip(GUIDES, kinds, (FORWARD, UPWARD, LEFTWARD), strict=True))
    joints = add_chain(plant, instance, plant.world_frame(), np.zeros(3), shank, steps)
    end = plant.AddFrame(
        FixedOffsetFrame("pylon_end", shank.body_frame(), RigidTransform([0.0, 0.0, -SHANK_M]))
    )
    foot = add_foot(plant, end, parameters)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot)
    desired = guide_path(parameters, strides)
    count, at = plant.num_velocities(), [joint.velocity_start() for joint in joints]
    driver = builder.AddNamedSystem(
        "guides",
        GaitDriver(
            num_velocities=count,
            velocity_indices=at,
            position_gain=STIFFNESS,
            velocity_gain=DAMPING,
        ),
    )
    state = StackedTrajectory()
    state.Append(desired)
    state.Append(desired.derivative(1))
    source = builder.AddNamedSystem("guide_path", TrajectorySource(state))
    builder.Connect(source.get_output_port(), driver.GetInputPort("desired_state"))
    builder.Connect(plant.get_state_output_port(), driver.GetInputPort("state"))
    share_generalized_forces(builder, plant, driver.GetOutputPort("generalized_force"))
    push = np.zeros(count)
    push[at[1]] = 1.0
    weight = 9.81 * (SHANK_KG + parameters.mass_kg)
    times, load = _periodic(LOAD_N, strides)
    press = PiecewisePolynomial.FirstOrderHold(times, np.outer(push, weight - load))
    share_generalized_forces(
        builder, plant, builder.AddNamedSystem("press", TrajectorySource(press)).get_output_port()
    )
    return GuidedShank(plant=plant, foot=foot, wired=wired, desired=desired)


def guide_path(parameters: FootParameters, strides: int) -> PiecewisePolynomial:
    """(3,) where the guides want the knee (m) and the lean (rad), smooth in time."""
    share = np.linspace(0.0, 1.0, 111)
    lean = np.radians(PchipInterpolator(list(LEAN_DEG), list(LEAN_DEG.values()))(share))
    length = SHANK_M + parameters.build_height_m
    pivot = np.where(lean < 0.0, HEEL_X_M, FOREFOOT_X_M)
    up = length * np.cos(lean) + pivot * np.sin(lean)
    forward = length * np.sin(lean) - pivot * (np.cos(lean) - 1.0)
    swing = share > STANCE
    phase = np.where(swing, (share - STANCE) / (1.0 - STANCE), 0.0)
    up += CLEARANCE_M * PchipInterpolator([0.0, 0.25, 0.8, 1.0], [0.0, 1.0, 1.0, 0.0])(phase)
    off, on = forward[~swing][-1], forward[0] + STRIDE_M
    forward = np.where(swing, off + (on - off) * phase, forward)
    times = np.concatenate(
        [STRIDE_S * (k + share[:-1]) for k in range(strides)] + [[STRIDE_S * strides]]
    )
    walked = STRIDE_M * np.repeat(np.arange(strides), len(share) - 1)
    rows = [
        np.append(np.tile(forward[:-1], strides) + walked, forward[0] + strides * STRIDE_M),
        *(np.append(np.tile(row[:-1], strides), row[-1]) for row in (up, lean)),
    ]
    return PiecewisePolynomial.CubicShapePreserving(times, np.array(rows))


def _periodic(cycle: dict[float, float], strides: int) -> tuple[np.ndarray, np.ndarray]:
    share = np.linspace(0.0, 1.0, 111)[:-1]
    values = PchipInterpolator(list(cycle), list(cycle.values()))(share)
    times = np.append(
        np.concatenate([STRIDE_S * (k + share) for k in range(strides)]), STRIDE_S * strides
    )
    return times, np.append(np.tile(values, strides), values[0])
