"""Forces, sensors and controllers that Drake does not have, as LeafSystems for float and
AutoDiffXd.

Each system evaluates one law of `vsf_drake.laws` for all its sites at once. Physical constants are
arguments and, under the same names, numeric parameters in the Context, for `GetParameter` and
`SetParameters`; a scalar stands for an array of equal values, and an array of another shape is a
ValueError.

Inputs named body_poses, body_spatial_velocities (of all bodies) and state are for the
MultibodyPlant's ports of those names; `plants.share_spatial_forces` and
`plants.share_generalized_forces` bring the outputs spatial_forces (one per body) and
generalized_force to its applied_spatial_force and applied_generalized_force, beside what acts there
already.
"""

from vsf_drake.systems.contact import (
    TestingMachine,
    TestingMachine_,
)
from vsf_drake.systems.foot_forces import FootForces, FootForces_
from vsf_drake.systems.fulcrum import (
    FulcrumActuator,
    FulcrumActuator_,
    FulcrumSlider,
    FulcrumSlider_,
)
from vsf_drake.systems.joint_forces import (
    GaitDriver,
    GaitDriver_,
    SocketBushing,
    SocketBushing_,
)
from vsf_drake.systems.massless_foot import MasslessFootForces, MasslessFootForces_
from vsf_drake.systems.swing_controller import (
    AdjustmentRecorder,
    AdjustmentRecorder_,
    ShankAngle,
    ShankAngle_,
    SwingController,
    SwingController_,
)

__all__ = [
    "AdjustmentRecorder",
    "AdjustmentRecorder_",
    "FootForces",
    "FootForces_",
    "FulcrumActuator",
    "FulcrumActuator_",
    "FulcrumSlider",
    "FulcrumSlider_",
    "GaitDriver",
    "GaitDriver_",
    "MasslessFootForces",
    "MasslessFootForces_",
    "ShankAngle",
    "ShankAngle_",
    "SocketBushing",
    "SocketBushing_",
    "SwingController",
    "SwingController_",
    "TestingMachine",
    "TestingMachine_",
]
