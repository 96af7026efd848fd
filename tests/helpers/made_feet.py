"""A foot under a loose shank, wired in a diagram of its own, for tests of its forces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import RigidBody, RpyFloatingJoint, SpatialInertia
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import FootHandles, WiredFoot, add_foot, add_ground_geometry, wire_foot
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS
from vsf_drake.plants.foot import mount_pose, sole_height

PARAMETERS = FootParameters()
UNUSUAL = replace(
    PARAMETERS,
    pylon_x_m=0.07,
    mass_kg=0.8,
    build_height_m=0.11,
    keel=replace(
        PARAMETERS.keel, element_lengths_m=(0.05, 0.04, 0.03, 0.06, 0.049), thickness_m=0.007
    ),
)
EVERY_BRANCH = {
    "full_damping_depth": 0.09,
    "threshold_velocity": 0.15,
    "depth_width": 0.02,
    "rate_width": 0.2,
}
"""Constants of the forces for which the spheres of one state are on all branches of their laws."""
GRAVITY_W = np.array([0.0, 0.0, -9.81])


@dataclass
class LooseFoot:
    """A shank of 3 kg with the foot below it, and a context to put it into states."""

    diagram: Diagram
    plant: MultibodyPlant
    shank: RigidBody
    foot: FootHandles
    wired: WiredFoot
    context: Context

    @property
    def plant_context(self) -> Context:
        """The plant's part of the context."""
        return self.plant.GetMyMutableContextFromRoot(self.context)

    @property
    def forces_context(self) -> Context:
        """The part of the context that holds the constants of the forces."""
        return self.wired.forces.GetMyMutableContextFromRoot(self.context)

    def output(self, name: str) -> np.ndarray:
        """An output of the foot in the present state."""
        port = self.wired.GetOutputPort(name)
        return port.Eval(port.get_system().GetMyContextFromRoot(self.context)).copy()

    def outputs(self) -> dict[str, np.ndarray]:
        """All vector outputs of the foot's forces."""
        ports = [
            self.wired.forces.get_output_port(i)
            for i in range(self.wired.forces.num_output_ports())
        ]
        return {
            port.get_name(): port.Eval(self.forces_context).copy()
            for port in ports
            if port.get_name() not in ("spatial_forces", "constants")
        }

    def keel_rates(self) -> np.ndarray:
        """Accelerations of keel joints and carriage."""
        self.diagram.EvalTimeDerivatives(self.context)
        acceleration = self.plant.get_generalized_acceleration_output_port().Eval(
            self.plant_context
        )
        return self.plant.GetVelocitiesFromArray(self.foot.instance, acceleration)

    def frame_acceleration(self) -> np.ndarray:
        """(6,) spatial acceleration of the foot's frame in W."""
        return self.plant.EvalBodySpatialAccelerationInWorld(
            self.plant_context, self.foot.frame
        ).get_coeffs()

    def place(self, X_WK: RigidTransform, V_WM: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
        """Puts the keel frame at X_WK with the mount moving at V_WM, keel joints and carriage at q,
        v."""
        X_WM = X_WK @ mount_pose(self.foot.parameters)
        if self.plant.HasJointNamed("floating"):
            joint = self.plant.GetJointByName("floating")
            joint.SetPose(self.plant_context, X_WM)
            joint.set_angular_velocity(self.plant_context, V_WM[:3])
            joint.set_translational_velocity(self.plant_context, V_WM[3:])
        else:
            self.plant.SetFloatingBaseBodyPoseInWorldFrame(self.plant_context, self.shank, X_WM)
            self.plant.SetFreeBodySpatialVelocity(
                self.plant_context, self.shank, SpatialVelocity(V_WM)
            )
        self.plant.SetPositions(self.plant_context, self.foot.instance, q)
        self.plant.SetVelocities(self.plant_context, self.foot.instance, v)


def foot_to_wire(*, finalized: bool = True) -> tuple[DiagramBuilder, MultibodyPlant, FootHandles]:
    """A plant with a foot under a loose shank, in a builder, before wire_foot."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    foot = add_foot(plant, add_loose_shank(plant, "quaternion").body_frame(), PARAMETERS)
    if finalized:
        plant.Finalize()
    return builder, plant, foot


def add_loose_shank(plant: MultibodyPlant, base: str) -> RigidBody:
    """A body free in W by a "quaternion", or by roll, pitch and yaw ("rpy")."""
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3))
    if base == "rpy":
        plant.AddJoint(RpyFloatingJoint("floating", plant.world_frame(), shank.body_frame()))
    return shank


def loose_foot(
    *,
    base: str = "rpy",
    gravity_W: np.ndarray = GRAVITY_W,
    parameters: FootParameters = PARAMETERS,
    contact: str = "kelvin_voigt",
    ground: Ground | None = None,
) -> LooseFoot:
    """The foot with its forces on `ground`, by default the plane z = 0."""
    builder = DiagramBuilder()
    drakes = contact in DRAKE_CONTACTS
    plant = (
        AddMultibodyPlantSceneGraph(builder, 0.0)[0]
        if drakes
        else builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    )
    plant.mutable_gravity_field().set_gravity_vector(gravity_W)
    shank = add_loose_shank(plant, base)
    foot = add_foot(plant, shank.body_frame(), parameters, contact=contact)
    if drakes:
        add_ground_geometry(plant, ground, foot=parameters, contact=contact)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot, ground=None if drakes else ground)
    diagram = builder.Build()
    return LooseFoot(diagram, plant, shank, foot, wired, diagram.CreateDefaultContext())


def some_state(
    seed: int, *, depth: float = 4e-3
) -> tuple[RigidTransform, np.ndarray, np.ndarray, np.ndarray]:
    """Arguments of `place`: sole about `depth` (m) in the level ground, somewhat tilted, moving,
    keel bent."""
    rng = np.random.default_rng(seed)
    R_WK = RotationMatrix(RollPitchYaw(*rng.uniform(-0.03, 0.03, 2), rng.uniform(-1.0, 1.0)))
    X_WK = RigidTransform(R_WK, [*rng.uniform(-0.3, 0.3, 2), -sole_height(PARAMETERS) - depth])
    joints = len(PARAMETERS.keel.element_lengths_m) + 1
    q = np.append(rng.uniform(-0.01, 0.01, joints), rng.uniform(0.07, 0.15))
    return X_WK, rng.normal(scale=0.2, size=6), q, rng.normal(scale=0.3, size=joints + 1)
