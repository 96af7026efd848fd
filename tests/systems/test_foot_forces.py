"""The foot's forces from one system: against separate systems, AutoDiffXd, momentum, closed forms
of the ground."""

from __future__ import annotations

import numpy as np
import pytest
from foot_forces_apart import (
    FulcrumSupport,
    GroundReaction,
    KeelElasticity,
    KelvinVoigtContact,
    StickSlipFriction,
)
from made_feet import GRAVITY_W, PARAMETERS, LooseFoot, add_loose_shank, loose_foot, some_state
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import AffineSystem

from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.plants import add_foot
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS
from vsf_drake.plants.wiring import (
    connect_kinematics,
    servo,
    share_generalized_forces,
    share_spatial_forces,
    velocity_indices,
)
from vsf_drake.systems.foot_forces import CONTACT_LAWS

SEEDS = (1, 2, 3)
UNEVEN = Ground(
    patches=(
        GroundPatch(slope_deg=2.0, bank_deg=-1.0),
        GroundPatch(
            name="mat",
            from_x_m=0.0,
            height_m=1e-3,
            slope_deg=2.0,
            bank_deg=-1.0,
            stiffness_n_per_m=3e4,
            mu_static=0.9,
            mu_kinetic=0.8,
        ),
    )
)
"""A mat on a slope: the higher patch is the one that bears."""
LEVEL = Ground()


@pytest.fixture(scope="module")
def feet():
    """feet(contact, ground): wired once."""
    made: dict = {}

    def foot(contact: str = "kelvin_voigt", ground: Ground = LEVEL) -> LooseFoot:
        if (contact, ground) not in made:
            made[contact, ground] = loose_foot(contact=contact, ground=ground)
        return made[contact, ground]

    return foot


class Apart:
    """The same foot under the same shank with every force from a system of its own."""

    def __init__(self) -> None:
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(0.0))
        foot = add_foot(self.plant, add_loose_shank(self.plant, "rpy").body_frame(), PARAMETERS)
        self.plant.Finalize()
        fulcrum = foot.parameters.fulcrum
        keel = builder.AddSystem(
            KeelElasticity(
                num_velocities=self.plant.num_velocities(),
                velocity_indices=velocity_indices(self.plant, foot.keel_joint_names),
                stiffness=foot.joint_stiffness,
                damping=foot.joint_damping,
            )
        )
        support = builder.AddSystem(
            FulcrumSupport(
                frame_body_index=foot.frame.index(),
                X_FK=RigidTransform(),
                keel_body_indices=[body.index() for body in foot.keel],
                keel_body_starts=foot.keel_starts,
                stiffness=fulcrum.stiffness_n_per_m,
                damping=fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
            )
        )
        carriage = builder.AddSystem(
            servo(self.plant, (foot.carriage_joint_name,), np.array([fulcrum.carriage_mass_kg]))
        )
        desired = builder.AddSystem(AffineSystem(D=np.array([[1.0], [0.0]])))
        builder.Connect(desired.get_output_port(), carriage.GetInputPort("desired_state"))
        builder.ExportInput(support.GetInputPort("fulcrum_position"), "fulcrum_position")
        builder.ConnectInput("fulcrum_position", desired.get_input_port())
        place = {
            "body_indices": foot.sites.body_indices,
            "p_BS": foot.sites.p_BS,
            "radius": foot.sites.radius,
        }
        friction = PARAMETERS.friction
        contact = builder.AddSystem(KelvinVoigtContact(**place, **foot.sites.law))
        slip = builder.AddSystem(
            StickSlipFriction(
                **place,
                mu_static=friction.mu_static,
                mu_kinetic=friction.mu_kinetic,
                threshold_velocity=friction.threshold_velocity_m_per_s,
            )
        )
        reaction = builder.AddSystem(GroundReaction(**place))
        for receiver in (slip, reaction):
            builder.Connect(
                contact.GetOutputPort("normal_force"), receiver.GetInputPort("normal_force")
            )
        builder.Connect(
            slip.GetOutputPort("friction_force"), reaction.GetInputPort("friction_force")
        )
        for system in (keel, support, carriage, contact, slip, reaction):
            connect_kinematics(builder, self.plant, system)
        for system in (support, contact, slip):
            share_spatial_forces(builder, self.plant, system.GetOutputPort("spatial_forces"))
        for system in (keel, carriage):
            share_generalized_forces(builder, self.plant, system.GetOutputPort("generalized_force"))
        self.sources = {
            "support_force": support,
            "joint_moment": keel,
            "normal_force": contact,
            "depth": contact,
            "depth_rate": contact,
            "friction_force": slip,
            **dict.fromkeys(("grf", "cop", "free_moment"), reaction),
        }
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.diagram.GetInputPort("fulcrum_position").FixValue(self.context, [0.108])

    def derivatives(self, state: np.ndarray) -> np.ndarray:
        self.plant.SetPositionsAndVelocities(
            self.plant.GetMyMutableContextFromRoot(self.context), state
        )
        return self.diagram.EvalTimeDerivatives(self.context).CopyToVector()

    def output(self, name: str) -> np.ndarray:
        system = self.sources[name]
        return system.GetOutputPort(name).Eval(system.GetMyContextFromRoot(self.context))


def test_one_system_does_what_the_separate_ones_do_on_any_kind_of_base(feet):
    one, quaternion, apart = feet(), loose_foot(base="quaternion"), Apart()
    for seed in SEEDS:
        for foot in (one, quaternion):
            foot.place(*some_state(seed))
        expected = apart.derivatives(one.plant.GetPositionsAndVelocities(one.plant_context))
        actual = one.diagram.EvalTimeDerivatives(one.context).CopyToVector()
        np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-10 * np.abs(expected).max())
        assert (one.output("normal_force") > 0).sum() > 5
        for name in apart.sources:
            np.testing.assert_allclose(
                one.output(name), apart.output(name), rtol=1e-9, atol=1e-11, err_msg=name
            )
        np.testing.assert_allclose(quaternion.keel_rates(), one.keel_rates(), rtol=1e-8)
        np.testing.assert_allclose(
            quaternion.frame_acceleration(), one.frame_acceleration(), rtol=1e-8
        )
    gradients = []
    for diagram, context in ((one.diagram, one.context), (apart.diagram, apart.context)):
        converted = diagram.ToAutoDiffXd()
        general = converted.CreateDefaultContext()
        general.SetTimeStateAndParametersFrom(context)
        converted.FixInputPortsFrom(diagram, context, general)
        state = context.get_continuous_state_vector().CopyToVector()
        general.SetContinuousState(InitializeAutoDiff(state).ravel())
        gradients.append(ExtractGradient(converted.EvalTimeDerivatives(general).CopyToVector()))
    np.testing.assert_allclose(
        gradients[0], gradients[1], rtol=1e-7, atol=1e-9 * np.abs(gradients[1]).max()
    )


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("ground", [LEVEL, UNEVEN], ids=["level", "uneven"])
def test_compiled_forces_equal_those_of_the_array_laws(feet, contact, ground):
    """AutoDiffXd takes the array laws."""
    foot = feet(contact, ground)
    general = foot.diagram.ToAutoDiffXd()
    context = general.CreateDefaultContext()
    forces = general.GetSubsystemByName("vsf_forces")
    for seed in SEEDS:
        foot.place(*some_state(seed, depth=6e-3))
        context.SetTimeStateAndParametersFrom(foot.context)
        assert foot.output("normal_force").any()
        for name, value in foot.outputs().items():
            other = ExtractValue(
                forces.GetOutputPort(name).Eval(forces.GetMyContextFromRoot(context))
            ).ravel()
            np.testing.assert_allclose(
                value, other, rtol=1e-10, atol=1e-12 * max(1.0, np.abs(other).max()), err_msg=name
            )
        expected = foot.diagram.EvalTimeDerivatives(foot.context).CopyToVector()
        actual = ExtractValue(general.EvalTimeDerivatives(context).CopyToVector()).ravel()
        np.testing.assert_allclose(actual, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def momentum_rate(foot: LooseFoot) -> np.ndarray:
    """(6,) rate of angular momentum about the origin of W and of momentum, by central differences
    along the motion."""
    derivative = foot.diagram.EvalTimeDerivatives(foot.context).CopyToVector()
    state = foot.plant.GetPositionsAndVelocities(foot.plant_context)
    other, momentum = foot.plant.CreateDefaultContext(), []
    step = 1e-8
    for sign in (1.0, -1.0):
        foot.plant.SetPositionsAndVelocities(other, state + sign * step * derivative)
        momentum.append(
            foot.plant.CalcSpatialMomentumInWorldAboutPoint(other, np.zeros(3)).get_coeffs()
        )
    return (momentum[0] - momentum[1]) / (2.0 * step)


@pytest.mark.parametrize(
    ("contact", "slope_deg"),
    [
        *((law, slope_deg) for law in CONTACT_LAWS for slope_deg in (0.0, 15.0)),
        *((contact, 0.0) for contact in DRAKE_CONTACTS),
    ],
)
def test_momentum_changes_by_what_the_ground_gives_and_by_nothing_else(contact, slope_deg):
    """Springs, support and servo are internal. Force and free moment act at the centre of pressure,
    across the mean normal; of Drake's own contact they are read from the plant's contact results.
    Moments are about a point 0.2 m below the ground."""
    ground = Ground(patches=(GroundPatch(slope_deg=slope_deg, height_m=0.2),))
    foot = loose_foot(contact=contact, gravity_W=np.zeros(3), ground=ground)
    R = RotationMatrix.MakeYRotation(-np.radians(slope_deg))
    X_WG, tolerance = (
        RigidTransform(R, [0.0, 0.0, 0.2]),
        1e-5 if contact in DRAKE_CONTACTS else 1e-4,
    )
    for seed in SEEDS:
        X, V, q, v = some_state(seed)
        foot.place(X_WG @ X, V, q, v)
        F, cop, free = foot.output("grf"), foot.output("cop"), foot.output("free_moment")[0]
        assert np.linalg.norm(F) > 50.0
        expected = np.append(np.cross(cop, F) + free * R.matrix()[:, 2], F)
        np.testing.assert_allclose(
            momentum_rate(foot), expected, rtol=tolerance, atol=tolerance * np.abs(expected).max()
        )
        assert (X_WG.inverse() @ cop)[2] == pytest.approx(
            0.0, abs=1e-6 if contact in DRAKE_CONTACTS else 1e-12
        )


def test_slope_is_the_level_ground_turned():
    """Gravity and state turned with the plane: all forces turn with them."""
    slope_deg, bank_deg = 12.0, -7.0
    n = np.array([-np.tan(np.radians(slope_deg)), -np.tan(np.radians(bank_deg)), 1.0])
    R = RotationMatrix.MakeFromOneVector(n, 2)
    tilted = loose_foot(
        ground=Ground(patches=(GroundPatch(slope_deg=slope_deg, bank_deg=bank_deg),))
    )
    level = loose_foot(gravity_W=R.inverse().matrix() @ GRAVITY_W)
    for seed in SEEDS:
        X, V, q, v = some_state(seed)
        level.place(X, V, q, v)
        tilted.place(
            RigidTransform(R) @ X, np.concatenate((R.matrix() @ V[:3], R.matrix() @ V[3:])), q, v
        )
        for name in ("normal_force", "depth", "depth_rate", "free_moment", "joint_moment"):
            np.testing.assert_allclose(
                tilted.output(name), level.output(name), rtol=1e-7, atol=1e-9, err_msg=name
            )
        for name in ("grf", "cop", "friction_force"):
            turned = (R.matrix() @ level.output(name).reshape(-1, 3).T).T.ravel()
            np.testing.assert_allclose(
                tilted.output(name), turned, rtol=1e-7, atol=1e-9, err_msg=name
            )
        np.testing.assert_allclose(tilted.keel_rates(), level.keel_rates(), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_nothing_carries_beyond_the_bounds_of_all_patches(contact):
    foot = loose_foot(
        contact=contact,
        ground=Ground(patches=(GroundPatch(to_x_m=-2.0), GroundPatch(from_y_m=2.0))),
    )
    foot.place(*some_state(1, depth=0.05))
    for name in ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force"):
        np.testing.assert_array_equal(foot.output(name), 0.0)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("slope_deg", [0.0, 8.0])
def test_a_foot_on_a_belt_feels_what_it_does_where_ground_and_foot_move_the_other_way(
    contact, slope_deg
):
    """Galilei: who rides along with the belt sees the foot slide over ground at rest."""
    speed = -1.3
    still, running = (
        loose_foot(
            contact=contact,
            ground=Ground(patches=(GroundPatch(slope_deg=slope_deg, belt_m_per_s=belt),)),
        )
        for belt in (0.0, speed)
    )
    R = RotationMatrix.MakeYRotation(-np.radians(slope_deg))
    uphill = R.matrix()[:, 0]
    for seed in SEEDS:
        X, V, q, v = some_state(seed, depth=8e-3)
        X = RigidTransform(R) @ X
        running.place(X, V, q, v)
        still.place(X, V - np.append(np.zeros(3), speed * uphill), q, v)
        assert np.linalg.norm(running.output("friction_force")) > 10.0
        for name, value in still.outputs().items():
            np.testing.assert_allclose(
                running.output(name), value, rtol=1e-9, atol=1e-9, err_msg=name
            )


def test_a_belt_drags_what_rests_on_it_by_kinetic_friction():
    foot = loose_foot(ground=Ground(patches=(GroundPatch(belt_m_per_s=-2.0),)))
    X, V, q, v = some_state(1, depth=8e-3)
    foot.place(X, 0.0 * V, q, 0.0 * v)
    normal = foot.output("normal_force").sum()
    np.testing.assert_allclose(
        foot.output("grf"), [-PARAMETERS.friction.mu_kinetic * normal, 0.0, normal], rtol=1e-3
    )
