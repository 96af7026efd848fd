"""A URDF leg with the foot under it: the whole diagram under AutoDiffXd against central differences."""

from __future__ import annotations

import numpy as np
import pytest
from made_feet import EVERY_BRANCH
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.files import resource
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import FootParameters, FrictionParameters
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.foot import sole_height
from vsf_drake.plants.foot_wiring import add_rigid_foot
from vsf_drake.systems.foot_forces import CONTACT_LAWS

FOOT = FootParameters()
UNEVEN = Ground(patches=(
    GroundPatch(slope_deg=2.0, bank_deg=-1.0),
    GroundPatch(name="mat", from_x_m=0.1, height_m=2e-3, stiffness_n_per_m=3e4, mu_static=0.9, mu_kinetic=0.8)))


class Leg:
    """models/leg.urdf, loose, with the foot; accelerations as a function of state, position and parameters."""

    def __init__(self, contact: str, ground: Ground) -> None:
        builder = DiagramBuilder()
        self.plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
        Parser(self.plant).AddModels(str(resource("models/leg.urdf")))
        self.foot = add_foot(self.plant, self.plant.GetFrameByName("pylon_end"), FOOT, contact=contact)
        self.plant.Finalize()
        self.wired = wire_foot(builder, self.plant, self.foot, ground=ground)
        builder.ExportInput(self.wired.fulcrum_position, "fulcrum_position")
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.converted = self.diagram.ToAutoDiffXd()

    def stand(self, depth: float, *, seed: int | None = None) -> np.ndarray:
        """State with the sole `depth` in the level ground: at rest and straight, or somewhat off it with a `seed`."""
        own = self.plant.GetMyMutableContextFromRoot(self.context)
        q, v = np.zeros(self.plant.num_positions()), np.zeros(self.plant.num_velocities())
        q[0] = 1.0
        self.plant.SetPositionsAndVelocities(own, np.concatenate((q, v)))
        self.plant.SetPositions(own, self.foot.instance, np.append(np.zeros(9), 0.108))
        hip = self.plant.GetBodyByName("hip")
        X_WK = self.foot.frame.EvalPoseInWorld(own)
        X_WH = RigidTransform([0.0, 0.0, -X_WK.translation()[2] - sole_height(FOOT) - depth])
        self.plant.SetFreeBodyPose(own, hip, X_WH)
        state = self.plant.GetPositionsAndVelocities(own)
        if seed is not None:
            rng = np.random.default_rng(seed)
            self.plant.SetFreeBodyPose(own, hip, X_WH @ RigidTransform(RollPitchYaw(*rng.uniform(-0.02, 0.02, 3)),
                                                                       np.zeros(3)))
            state = self.plant.GetPositionsAndVelocities(own)
            state[7:19] += rng.uniform(-0.01, 0.01, 12)
            state[19:] = rng.normal(scale=0.2, size=18)
        return state

    def acceleration(self, state: np.ndarray) -> np.ndarray:
        self.plant.SetPositionsAndVelocities(self.plant.GetMyMutableContextFromRoot(self.context), state)
        return self.diagram.EvalTimeDerivatives(self.context).CopyToVector()[19:]

    def converted_context(self, state: np.ndarray):
        context = self.converted.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(self.context)
        self.converted.FixInputPortsFrom(self.diagram, self.context, context)
        context.SetContinuousState(state)
        return context

    def converted_acceleration(self, context) -> np.ndarray:
        return self.converted.EvalTimeDerivatives(context).CopyToVector()[19:]


@pytest.fixture(scope="module", params=CONTACT_LAWS)
def leg(request):
    return Leg(request.param, UNEVEN)


def assert_columns_agree(found, expected, rtol):
    """Each column against its own size: one of the keel is a million times one of the hip."""
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / np.maximum(size, 1e-9), expected / np.maximum(size, 1e-9), atol=rtol)


def central(function, step) -> np.ndarray:
    return (function(step) - function(-step)) / (2.0 * step)


def test_accelerations_and_their_derivatives_by_the_state(leg):
    state = leg.stand(5e-3, seed=4)
    assert state.shape == (37,)
    forces = leg.wired.forces
    converted = leg.converted_acceleration(leg.converted_context(InitializeAutoDiff(state).ravel()))
    plain = leg.acceleration(state)
    normal = leg.wired.GetOutputPort("normal_force").Eval(forces.GetMyContextFromRoot(leg.context))
    assert (normal > 0).sum() > 8
    np.testing.assert_allclose(ExtractValue(converted).ravel(), plain, rtol=1e-8, atol=1e-9 * np.abs(plain).max())
    expected = np.stack([central(lambda s, e=e: leg.acceleration(state + s * e), 1e-7) for e in np.eye(37)], axis=1)
    assert_columns_agree(ExtractGradient(converted), expected, 1e-4)


def test_derivatives_by_the_fulcrum_position_as_input_and_as_parameter(leg):
    state, port = leg.stand(5e-3, seed=4), leg.diagram.GetInputPort("fulcrum_position")
    forces, converted_port = leg.wired.forces, leg.converted.GetInputPort("fulcrum_position")

    def by_parameter(s):
        forces.SetParameters(forces.GetMyMutableContextFromRoot(leg.context), fulcrum_m=0.108 + s)
        return leg.acceleration(state)

    expected = central(by_parameter, 1e-7)
    by_parameter(0.0)
    context = leg.converted_context(state)
    converted = leg.converted.GetSubsystemByName("vsf_forces")
    converted.SetParameters(converted.GetMyMutableContextFromRoot(context), fulcrum_m=AutoDiffXd(0.108, [1.0]))
    found = ExtractGradient(leg.converted_acceleration(context))
    assert_columns_agree(found, expected[:, None], 1e-5)
    context = leg.converted_context(state)
    converted_port.FixValue(context, [AutoDiffXd(0.108, [1.0])])
    np.testing.assert_allclose(ExtractGradient(leg.converted_acceleration(context)), found, rtol=1e-12,
                               atol=1e-12 * np.abs(found).max())
    port.FixValue(leg.context, [0.12])
    moved = leg.acceleration(state)
    leg.context = leg.diagram.CreateDefaultContext()
    by_parameter(0.012)
    np.testing.assert_array_equal(leg.acceleration(state), moved)
    by_parameter(0.0)


def test_derivatives_by_every_parameter(leg):
    """Each along a random direction of its own entries; the bounds of the patches have none."""
    leg.context = leg.diagram.CreateDefaultContext()
    state, forces, rng = leg.stand(5e-3, seed=4), leg.wired.forces, np.random.default_rng(8)
    sub = forces.GetMyMutableContextFromRoot(leg.context)
    forces.SetParameters(sub, **EVERY_BRANCH)
    names = [name for name in forces.parameter_names if name != "ground_bounds"]
    values = {name: forces.GetParameter(sub, name) for name in names}
    ways = {name: rng.uniform(0.5, 1.0, np.shape(value)) * (np.abs(value).max() or 1e-3)
            for name, value in values.items()}
    # For central differences, off the bounds.
    values = {name: value + 1e-4 * ways[name] for name, value in values.items()}
    forces.SetParameters(sub, **values)
    context = leg.converted_context(state)
    converted = leg.converted.GetSubsystemByName("vsf_forces")
    own = converted.GetMyMutableContextFromRoot(context)
    for i, name in enumerate(names):
        s = AutoDiffXd(0.0, np.eye(len(names))[i])
        converted.SetParameters(own, **{name: values[name] + ways[name] * s})
    found = ExtractGradient(leg.converted_acceleration(context))

    def along(name, s):
        forces.SetParameters(sub, **{name: values[name] + s * ways[name]})
        return leg.acceleration(state)

    expected = np.zeros_like(found)
    for i, name in enumerate(names):
        expected[:, i] = central(lambda s, name=name: along(name, s), 1e-5)
        along(name, 0.0)
    unused = {"kelvin_voigt": {"dissipation", "depth_width", "rate_width"}, "smooth": {"dissipation"},
              "hunt_crossley": {"damping", "full_damping_depth", "depth_width", "rate_width"}}[leg.foot.contact]
    assert {name for i, name in enumerate(names) if not expected[:, i].any()} == unused
    assert_columns_agree(found, expected, 1e-4)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_derivatives_are_numbers_at_rest_at_touch_down_and_in_the_air(contact):
    """Zero slip and depth rate; depth exactly zero; no load, no centre of pressure."""
    leg = Leg(contact, Ground())
    forces = leg.converted.GetSubsystemByName("vsf_forces")
    for depth in (3e-3, 0.0, -0.2):
        context = leg.converted_context(InitializeAutoDiff(leg.stand(depth)).ravel())
        assert np.all(np.isfinite(ExtractGradient(leg.converted_acceleration(context))))
        for i in range(forces.num_output_ports()):
            port = forces.get_output_port(i)
            if port.get_name() != "spatial_forces":
                value = port.Eval(forces.GetMyContextFromRoot(context))
                assert np.all(np.isfinite(ExtractValue(value))), port.get_name()
                assert np.all(np.isfinite(ExtractGradient(value))), port.get_name()


def test_a_rigid_foot_is_one_body():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    plant.Finalize()
    with pytest.raises(ValueError, match="bodies, but must be on one"):
        add_rigid_foot(builder, plant, foot.sites, FrictionParameters(), Ground(), name="rigid")
