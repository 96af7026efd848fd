"""A foot that is coupled to its plant by one vector each way against the same foot by the plant's
lists: motions, reactions, moved frames, joints of every kind."""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from made_feet import PARAMETERS, loose_foot
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    RpyFloatingJoint,
    ScrewJoint,
    SpatialInertia,
    UniversalJoint,
    WeldJoint,
)
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.plants import add_foot, wire_foot, wiring
from vsf_drake.plants.foot import set_mount
from vsf_drake.systems import _foot_kernel as kernel
from vsf_drake.systems.foot_forces import FootForces

AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
JOINTS = {
    "revolute": lambda F, M: RevoluteJoint("leg", F, M, AXIS),
    "prismatic": lambda F, M: PrismaticJoint("leg", F, M, AXIS),
    "weld": lambda F, M: WeldJoint("leg", F, M, RigidTransform([0.1, 0.2, 0.3])),
    "universal": lambda F, M: UniversalJoint("leg", F, M),
    "planar": lambda F, M: PlanarJoint("leg", F, M),
    "ball": lambda F, M: BallRpyJoint("leg", F, M),
    "rpy_floating": lambda F, M: RpyFloatingJoint("leg", F, M),
    "quaternion_floating": None,
    "screw": lambda F, M: ScrewJoint("leg", F, M, AXIS, 0.1, 0.0),
}


class Pair:
    """The same plant twice, the foot coupled in one and fed by lists in the other."""

    def __init__(self, kind: str) -> None:
        self.diagrams = []
        self.plants = []
        self.feet = []
        self.forces = []
        for coupled in (True, False):
            rng = np.random.default_rng(3)

            def pose(rng=rng) -> RigidTransform:
                return RigidTransform(
                    RollPitchYaw(rng.uniform(-0.5, 0.5, 3)), rng.uniform(-0.3, 0.3, 3)
                )

            builder = DiagramBuilder()
            plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
            thigh, shank = (
                plant.AddRigidBody(name, SpatialInertia.SolidBoxWithMass(3.0, 0.1, 0.1, 0.3))
                for name in ("thigh", "shank")
            )

            def frame(name, of, plant=plant, pose=pose):
                return plant.AddFrame(FixedOffsetFrame(name, of, pose()))

            if JOINTS[kind] is not None:
                plant.AddJoint(
                    JOINTS[kind](frame("F", plant.world_frame()), frame("M", thigh.body_frame()))
                )
            knee = (frame("above", thigh.body_frame()), frame("below", shank.body_frame()))
            plant.AddJoint(RevoluteJoint("knee", *knee, AXIS))
            foot = add_foot(plant, frame("ankle", shank.body_frame()), PARAMETERS)
            plant.Finalize()
            if coupled:
                forces = wire_foot(builder, plant, foot).forces
                self.arguments = forces._arguments
            else:
                forces = FootForces(**self.arguments | {"chain": None})
                wiring.add_forces(builder, plant, "forces", forces)
            self.diagrams.append(builder.Build())
            self.plants.append(plant)
            self.feet.append(foot)
            self.forces.append(forces)
        self.contexts = [diagram.CreateDefaultContext() for diagram in self.diagrams]

    def own(self, i: int):
        return self.plants[i].GetMyMutableContextFromRoot(self.contexts[i])

    def place(self, seed: int) -> None:
        """Somewhere with spheres in the ground and others above it, moving."""
        rng = np.random.default_rng(seed)
        for i, plant in enumerate(self.plants):
            foot = self.feet[i]
            if i == 0:
                state = rng.normal(scale=0.3, size=plant.num_multibody_states())
                keel = [
                    plant.GetJointByName(name, foot.instance).position_start()
                    for name in foot.keel_joint_names
                ]
                state[keel] *= 0.02
                state[foot.carriage_joint(plant).position_start()] = 0.108
                plant.SetPositionsAndVelocities(self.own(0), state)
                height = foot.frame.EvalPoseInWorld(self.own(0)).translation()[2]
            plant.SetPositionsAndVelocities(self.own(i), state)
            self.forces[i].SetParameters(
                self.forces[i].GetMyMutableContextFromRoot(self.contexts[i]), ground_height=height
            )

    def follows_the_chain(self) -> bool:
        forces = self.forces[0]
        given = forces.GetInputPort("gathered").Eval(forces.GetMyContextFromRoot(self.contexts[0]))
        return kernel.foot_vector(given, True, np.zeros(forces._size))

    def assert_alike(self) -> None:
        for name in ("normal_force", "friction_force", "grf", "cop", "depth_rate", "joint_moment"):
            values = [
                forces.GetOutputPort(name).Eval(forces.GetMyContextFromRoot(context))
                for forces, context in zip(self.forces, self.contexts, strict=True)
            ]
            size = np.abs(values[1]).max()
            np.testing.assert_allclose(values[0], values[1], atol=1e-12 * size, err_msg=name)
        assert np.linalg.norm(values[0]) > 0
        for port in ("generalized_acceleration", "reaction_forces"):
            first, second = (
                plant.GetOutputPort(port).Eval(self.own(i)) for i, plant in enumerate(self.plants)
            )
            if port == "reaction_forces":
                first, second = (
                    np.array([force.get_coeffs() for force in forces]) for forces in (first, second)
                )
            np.testing.assert_allclose(first, second, atol=1e-10 * np.abs(second).max())


@pytest.mark.parametrize("kind", JOINTS)
def test_a_coupled_foot_moves_and_bears_as_one_fed_by_the_plants_lists(kind, caplog):
    """Reactions in the joints, too: what acts on the frame is a spatial force, no joint force."""
    with caplog.at_level(logging.WARNING, "vsf_drake"):
        pair = Pair(kind)
    said = [record.getMessage() for record in caplog.records if "compiling" not in record.msg]
    if kind == "screw":
        assert len(said) == 1 and "a screw joint is unknown" in said[0] and "'leg'" in said[0]
    else:
        assert not said
    for seed in (1, 2):
        pair.place(seed)
        assert kind == "screw" or pair.follows_the_chain()
        pair.assert_alike()


@pytest.mark.parametrize("moved", ["mount", "ankle", "above", "F"])
def test_a_frame_whose_pose_was_changed_in_the_context_is_followed(moved):
    pair = Pair("universal")
    pair.place(4)
    before = (
        pair.forces[0]
        .GetOutputPort("grf")
        .Eval(pair.forces[0].GetMyContextFromRoot(pair.contexts[0]))
    )
    for i, plant in enumerate(pair.plants):
        if moved == "mount":
            set_mount(pair.own(i), pair.feet[i], toe_out=0.05, height=-0.002)
        else:
            frame = plant.GetFrameByName(moved)
            pose = frame.GetPoseInParentFrame(pair.own(i))
            turned = pose @ RigidTransform(RollPitchYaw(0.01, 0.0, 0.0), [0.0, 0.0, 0.002])
            frame.SetPoseInParentFrame(pair.own(i), turned)
    assert not pair.follows_the_chain()
    pair.assert_alike()
    after = (
        pair.forces[0]
        .GetOutputPort("grf")
        .Eval(pair.forces[0].GetMyContextFromRoot(pair.contexts[0]))
    )
    assert np.linalg.norm(after - before) > 1.0


def test_contexts_in_threads_of_their_own_have_what_they_have_alone():
    diagram = loose_foot(base="quaternion").diagram
    rng = np.random.default_rng(5)
    contexts = [diagram.CreateDefaultContext() for _ in range(8)]
    for context in contexts:
        state = context.get_continuous_state_vector().CopyToVector()
        context.SetContinuousState(state + 0.01 * rng.normal(size=len(state)))

    def accelerations(context) -> bytes:
        values = []
        for i in range(20):
            context.SetTime(0.01 * i)
            context.SetContinuousState(
                context.get_continuous_state_vector().CopyToVector() + 1e-5 * i
            )
            values.append(diagram.EvalTimeDerivatives(context).CopyToVector())
        return np.array(values).tobytes()

    alone = [accelerations(context.Clone()) for context in contexts]
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(accelerations, contexts)) == alone
