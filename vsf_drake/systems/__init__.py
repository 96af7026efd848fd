"""Forces, sensors and controllers that Drake does not have, as LeafSystems for float and AutoDiffXd.

Each system evaluates one law of `vsf_drake.laws` for all its sites at once. Ports are found by name; physical constants
are numeric parameters in the Context, read and set by name with `GetParameter` and `SetParameters`.
"""

from vsf_drake.systems.contact import KelvinVoigtContact, KelvinVoigtContact_, StickSlipFriction, StickSlipFriction_
from vsf_drake.systems.foot_forces import FootForces, FootForces_
from vsf_drake.systems.fulcrum import FulcrumActuator, FulcrumActuator_, FulcrumSupport, FulcrumSupport_
from vsf_drake.systems.ground_reaction import GroundReaction, GroundReaction_
from vsf_drake.systems.joint_forces import (
    GaitDriver,
    GaitDriver_,
    KeelElasticity,
    KeelElasticity_,
    SocketBushing,
    SocketBushing_,
)
from vsf_drake.systems.swing_controller import (
    AdjustmentRecorder,
    AdjustmentRecorder_,
    ShankAngle,
    ShankAngle_,
    SwingController,
    SwingController_,
)
from vsf_drake.systems.testing_machine import TestingMachine, TestingMachine_

__all__ = [
    "AdjustmentRecorder", "AdjustmentRecorder_", "FootForces", "FootForces_", "FulcrumActuator", "FulcrumActuator_",
    "FulcrumSupport", "FulcrumSupport_", "GaitDriver", "GaitDriver_", "GroundReaction", "GroundReaction_",
    "KeelElasticity", "KeelElasticity_", "KelvinVoigtContact", "KelvinVoigtContact_", "ShankAngle", "ShankAngle_",
    "SocketBushing", "SocketBushing_", "StickSlipFriction", "StickSlipFriction_", "SwingController", "SwingController_",
    "TestingMachine", "TestingMachine_",
]
