"""A person on one leg, in the sagittal plane, standing on the foot's keel: the model, and where it
can stand still.

The leg of `models/leg.urdf` under a trunk of 50 kg, free to move in x and z and to pitch; torques
in hip and knee, the prosthesis has no ankle. The foot is that of `models/soft_support.yaml`: on the
nominal one, with the fulcrum at 66 mm, Newton's method finds no rest from the start taken here. It
is mounted 0.1 rad toes-up, so that the shank leans forward over a flat foot. Contact is the
"smooth" law: derivatives exist everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    JacobianWrtVariable,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import FirstOrderTaylorApproximation

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.foot_wiring import WiredFoot

TRUNK_KG, TRUNK_SIZE_M, TRUNK_ABOVE_HIP_M = 50.0, (0.2, 0.3, 0.5), 0.3
KNEE_RAD, ALIGNMENT_RAD = 0.15, 0.1
PRESSURE_M = 0.10
"""Where the centre of pressure is to be, ahead of the keel's posterior end A: 45 mm ahead of the
pylon (a choice)."""


@dataclass(frozen=True)
class StandingLeg:
    """A finished diagram. Input: torques in hip and knee (2, N m), unless a controller gives
    them."""

    diagram: Diagram
    plant: MultibodyPlant
    wired: WiredFoot

    def set_up(self, root: Context) -> Context:
        """The plant's part of `root`, with the foot aligned."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        set_mount(context, self.wired.foot, alignment=ALIGNMENT_RAD)
        return context

    def index(self, name: str) -> int:
        """Of the joint `name` in the positions; the same in the velocities."""
        return self.plant.GetJointByName(name).position_start()


def make_standing_leg(fulcrum_m: float, controller: LeafSystem | None = None) -> StandingLeg:
    """The person on the foot; `controller` takes the plant's state and gives two torques."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resource("models/leg.urdf")))
    person, parent, hip = (
        plant.AddModelInstance("person"),
        plant.world_frame(),
        plant.GetFrameByName("hip"),
    )
    for name, axis in (("x", [1.0, 0.0, 0.0]), ("z", [0.0, 0.0, 1.0])):
        body = plant.AddRigidBody(name, person, SpatialInertia.Zero())
        plant.AddJoint(PrismaticJoint(name, parent, body.body_frame(), axis))
        parent = body.body_frame()
    plant.AddJoint(RevoluteJoint("pitch", parent, hip, [0.0, 1.0, 0.0]))
    trunk = plant.AddRigidBody(
        "trunk", person, SpatialInertia.SolidBoxWithMass(TRUNK_KG, *TRUNK_SIZE_M)
    )
    plant.AddJoint(
        WeldJoint("trunk", hip, trunk.body_frame(), RigidTransform([0.0, 0.0, TRUNK_ABOVE_HIP_M]))
    )
    for name in ("hip_flexion", "knee_flexion"):
        plant.AddJointActuator(name, plant.GetJointByName(name))
    foot = add_foot(
        plant,
        plant.GetFrameByName("pylon_end"),
        load_model(resource("models/soft_support.yaml")).foot,
        contact="smooth",
    )
    plant.Finalize()
    wired = wire_foot(builder, plant, foot, fulcrum_m=fulcrum_m)
    if controller is None:
        builder.ExportInput(plant.get_actuation_input_port(), "torque")
    else:
        builder.AddNamedSystem("controller", controller)
        builder.Connect(plant.get_state_output_port(), controller.get_input_port())
        builder.Connect(controller.get_output_port(), plant.get_actuation_input_port())
    return StandingLeg(diagram=builder.Build(), plant=plant, wired=wired)


def equilibrium(leg: StandingLeg, pressure_m: float = PRESSURE_M) -> tuple[Context, np.ndarray]:
    """A Context in which nothing moves or accelerates, and the torques (2,) that it takes.

    Newton's method with derivatives by AutoDiff. Unknown are height, trunk lean, hip angle, keel,
    carriage and torques; equations are all generalized forces but the one along x, which is
    friction and zero at rest, and that the centre of mass is `pressure_m` ahead of A.

    Raises:
        RuntimeError: there is no rest to be found.
    """
    root, plant, foot = leg.diagram.CreateDefaultContext(), leg.plant, leg.wired.foot
    context, count = leg.set_up(root), plant.num_positions()
    names = ["z", "pitch", "hip_flexion", *foot.keel_joint_names, foot.carriage_joint_name]
    choice = np.eye(count)[:, [leg.index(name) for name in names]]
    start = np.zeros(count)
    start[leg.index("knee_flexion")] = start[leg.index("hip_flexion")] = KNEE_RAD
    start[leg.index("pitch")] = ALIGNMENT_RAD
    start[leg.index(foot.carriage_joint_name)] = leg.wired.forces.GetParameter(
        leg.wired.forces.GetMyContextFromRoot(root), "fulcrum_m"
    )
    plant.SetPositions(context, start)
    frame = foot.frame.EvalPoseInWorld(context).translation()
    start[leg.index("z")] = -frame[2] - sole_height(foot.parameters) - 0.004

    def residual(unknown: np.ndarray) -> np.ndarray:
        plant.SetPositions(context, start + choice @ unknown[:-2])
        leg.diagram.get_input_port(0).FixValue(root, unknown[-2:])
        accelerations = leg.diagram.EvalTimeDerivatives(root).CopyToVector()[count:]
        ahead = (
            plant.CalcCenterOfMassPositionInWorld(context)
            - foot.frame.EvalPoseInWorld(context).translation()
        )[0]
        return np.append(plant.CalcMassMatrix(context) @ accelerations, 1e4 * (ahead - pressure_m))

    def jacobian(unknown: np.ndarray) -> np.ndarray:
        residual(unknown)
        linear = FirstOrderTaylorApproximation(leg.diagram, root)
        world, wrt = plant.world_frame(), JacobianWrtVariable.kV
        ahead = plant.CalcJacobianCenterOfMassTranslationalVelocity(context, wrt, world, world)[0]
        ahead = (
            ahead
            - plant.CalcJacobianTranslationalVelocity(
                context, wrt, foot.frame.body_frame(), np.zeros((3, 1)), world, world
            )[0]
        )
        forces = np.hstack([linear.A()[count:, :count] @ choice, linear.B()[count:]])
        return np.vstack(
            [plant.CalcMassMatrix(context) @ forces, np.append(1e4 * ahead @ choice, [0.0, 0.0])]
        )

    unknown = np.zeros(len(names) + 2)
    for _ in range(80):
        error = residual(unknown)
        if np.linalg.norm(error) < 1e-9:
            return root, unknown[-2:]
        step, part = np.linalg.lstsq(jacobian(unknown), -error, rcond=None)[0], 1.0
        while part > 1e-4 and not np.linalg.norm(residual(unknown + part * step)) < np.linalg.norm(
            error
        ):
            part *= 0.5
        unknown = unknown + part * step
    raise RuntimeError("there is no rest to be found")


def inverted_pendulum(fulcrum_m: float, shift_m: float = 0.002) -> tuple[float, float, float]:
    """Of the person with locked joints: stiffness of the foot against tilt, weight times height (N
    m/rad), inertia.

    From statics alone: between two states of rest, the centre of pressure `shift_m` to either side
    of PRESSURE_M, the foot's stiffness is weight times the shift over the change of the foot's
    tilt. Inertia (kg m^2) about the pressure.
    """
    leg, tilts = make_standing_leg(fulcrum_m), []
    for pressure_m in (PRESSURE_M - shift_m, PRESSURE_M + shift_m):
        root, _ = equilibrium(leg, pressure_m)
        context = leg.plant.GetMyContextFromRoot(root)
        X_WF = leg.wired.foot.frame.EvalPoseInWorld(context)
        x_F = X_WF.rotation().matrix()[:, 0]
        tilts.append(np.arctan2(-x_F[2], x_F[0]))
    pressure = leg.wired.GetOutputPort("cop").Eval(leg.wired.forces.GetMyContextFromRoot(root))
    weight = leg.plant.CalcTotalMass(context) * 9.81
    bodies = ("hip", "trunk", "thigh", "shank", leg.wired.foot.frame.name())
    height = leg.plant.CalcCenterOfMassPositionInWorld(context)[2] - pressure[2]
    inertia = leg.plant.CalcSpatialInertia(
        context, leg.plant.world_frame(), [leg.plant.GetBodyByName(name).index() for name in bodies]
    )
    about = inertia.Shift(pressure).CalcRotationalInertia().CopyToFullMatrix3()[1, 1]
    return weight * 2.0 * shift_m / (tilts[1] - tilts[0]), weight * height, float(about)
