"""The foot in a plant with a time step: statics of beam and lever, the moving support, the drop,
what is refused."""

from __future__ import annotations

from dataclasses import replace

import contact_comparison
import numpy as np
import pytest
from contact_comparison import LAST_S, LEG_KG, PRESS_LOADS_N, SAMPLE_S, Advance, drop, press
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError
from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.model.parameters import FootParameters, FrictionParameters
from vsf_drake.plants import add_foot, follow_fulcrum, place_fulcrum, wire_foot
from vsf_drake.plants.foot import largest_step
from vsf_drake.simulation.bench_stiffness import BenchStiffness

FOOT = FootParameters()
POSITIONS_M = (0.066, 0.108, 0.151)
MILLISECOND = Advance("1 ms", time_step_s=1e-3)


class Held:
    """The foot with its mount held and its load point C pulled up by a dead load, without weight or
    ground."""

    def __init__(self, fulcrum_m=0.108):
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        self.foot = add_foot(
            self.plant, self.plant.world_frame(), FOOT, contact="drake_point", fulcrum_m=fulcrum_m
        )
        self.plant.Finalize()
        self.wired = wire_foot(builder, self.plant, self.foot, own_ground=True)
        force = ExternallyAppliedSpatialForce()
        self.piece = self.foot.keel_body_at(FOOT.load_point_m)
        force.body_index = self.foot.keel[self.piece].index()
        force.p_BoBq_B = [FOOT.load_point_m - self.foot.keel_starts[self.piece], 0.0, 0.0]
        self.force = force
        builder.ExportInput(self.plant.get_applied_spatial_force_input_port(), "load")
        builder.ExportInput(self.wired.fulcrum_position, "fulcrum_position")
        for name in ("support_force", "joint_moment"):
            builder.ExportOutput(self.wired.GetOutputPort(name), name)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.pull(0.0)
        self.move(fulcrum_m)

    def pull(self, newton):
        self.force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=[0.0, 0.0, newton])
        self.diagram.GetInputPort("load").FixValue(self.context, [self.force])

    def move(self, fulcrum_m):
        self.diagram.GetInputPort("fulcrum_position").FixValue(self.context, [fulcrum_m])

    def advance(self, seconds):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def read(self, name):
        return self.diagram.GetOutputPort(name).Eval(self.context)

    def height(self):
        X_WB = self.foot.keel[self.piece].EvalPoseInWorld(
            self.plant.GetMyContextFromRoot(self.context)
        )
        return (X_WB @ self.force.p_BoBq_B)[2]


def test_forefoot_is_as_stiff_in_a_discrete_plant_as_on_the_bench():
    """The keel under dead loads of 200 and 600 N at 1 ms, the bench's foam in series."""
    bench = BenchStiffness(FOOT, fulcrums_m=POSITIONS_M, heel=False).evaluate({})[0]
    for position, stiffness in zip(POSITIONS_M, bench, strict=True):
        rise = press(FOOT, MILLISECOND, position)
        slope = np.diff(PRESS_LOADS_N)[0] / (rise[1] - rise[0])
        assert 1.0 / (1.0 / slope + 1.0 / FOOT.series_stiffness_n_per_m) == pytest.approx(
            stiffness, rel=1e-3
        )


def test_keel_under_a_sudden_load_moves_as_in_a_continuous_plant(monkeypatch):
    """Half way to rest, 4 ms after each load: half the damping of springs or support would show as
    8 %."""
    monkeypatch.setattr(contact_comparison, "PRESS_S", 4e-3)
    discrete = press(FOOT, Advance("0.02 ms", time_step_s=2e-5), 0.066)
    continuous = press(
        FOOT, Advance("radau3", scheme="radau3", accuracy=1e-5, max_step_s=1e-3), 0.066
    )
    np.testing.assert_allclose(discrete, continuous, rtol=5e-3)


def test_small_load_bends_the_discrete_keel_as_beam_and_springs_in_series_which_bear_it():
    """Closed form of the overhung beam on its compliant support, which a chain of 8 joints follows
    to some per cent."""
    foot = Held(0.108)
    start = foot.height()
    foot.pull(5.0)
    foot.advance(0.2)
    bending = FOOT.keel.flexural_modulus_pa * section_inertia(
        FOOT.keel.width_m, FOOT.keel.thickness_m
    )
    beam = combined_stiffness(
        bending_stiffness=bending,
        support=0.108,
        load_point=FOOT.load_point_m,
        fulcrum_stiffness=FOOT.fulcrum.stiffness_n_per_m,
    )
    assert 5.0 / (foot.height() - start) == pytest.approx(float(beam), rel=0.05)
    assert foot.read("support_force")[0] == pytest.approx(
        -5.0 * FOOT.load_point_m / 0.108, rel=2e-3
    )
    ahead = foot.foot.keel_starts[foot.foot.keel_starts > 0.108]
    arms = np.maximum(FOOT.load_point_m - ahead, 0.0)
    np.testing.assert_allclose(
        foot.read("joint_moment")[-len(ahead) :], -5.0 * arms, rtol=2e-3, atol=1e-4
    )


def test_support_follows_the_fulcrum_position_from_joint_to_joint_under_load():
    """Moved 85 mm under 300 N the keel stands where it stands when it was there from the start."""
    moving, standing = Held(0.066), Held(0.151)
    follow_fulcrum(moving.simulator, moving.plant, moving.wired)
    for foot in (moving, standing):
        foot.pull(300.0)
        foot.advance(0.2)
    for position in np.linspace(0.066, 0.151, 50):
        moving.move(position)
        moving.advance(2e-3)
    moving.advance(0.2)
    standing.advance(0.3)
    assert moving.height() == pytest.approx(standing.height(), abs=1e-7)
    assert moving.read("support_force")[0] == pytest.approx(
        standing.read("support_force")[0], rel=1e-5
    )
    carriage = moving.plant.GetJointByName(moving.foot.carriage_joint_name)
    assert carriage.get_translation(
        moving.plant.GetMyContextFromRoot(moving.context)
    ) == pytest.approx(0.151, abs=1e-6)


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_dropped_leg_comes_to_rest_on_its_weight_at_a_millisecond(contact):
    force, _, note = drop(FOOT, contact, MILLISECOND, 0.151, 0.8, np.inf)
    assert note == ""
    assert force.max() > 200.0
    rest = force[-round(LAST_S / SAMPLE_S) :].mean()
    assert rest == pytest.approx((LEG_KG + FOOT.mass_kg) * 9.81, rel=5e-3)


@pytest.mark.slow
def test_on_the_forefoot_of_a_heavier_leg_a_step_that_friction_does_not_bear_ends_the_run(
    monkeypatch,
):
    """A step that friction bears is as near as `grip_limit` says, and halved at least twice as
    near: forces from the start of a step are of first order. Level, the heel bears the leg at the
    longer step too.
    """
    monkeypatch.setattr(contact_comparison, "LEG_KG", 40.0)
    monkeypatch.setattr(contact_comparison, "RAIL_N_S_PER_M", 600.0)

    def landing(step):
        return drop(FOOT, "kelvin_voigt", Advance("", time_step_s=step), 0.151, 0.14, np.inf)

    _, _, note = landing(1e-4)
    # 8 mass threshold velocity / (mu_static step)
    assert "friction under 150 N on keel body 8" in note
    (coarse, _, note), (half, _, _), (fine, _, _) = (
        landing(step) for step in (3e-5, 1.5e-5, 7.5e-6)
    )
    assert note == ""
    off, half_off = (np.sqrt(np.mean((force - fine) ** 2)) for force in (coarse, half))
    assert off < 0.03 * fine.max() and half_off < 0.5 * off
    monkeypatch.setattr(contact_comparison, "LEAN_RAD", 0.0)
    assert landing(1e-4)[2] == ""


def test_undamped_foam_without_friction_is_steady_up_to_the_largest_step_and_refused_beyond():
    """Its force in a drop is that of steps of a tenth of a millisecond."""
    bare = replace(
        FOOT,
        zones=tuple(replace(zone, damping_n_s_per_m=0.0) for zone in FOOT.zones),
        friction=FrictionParameters(mu_static=0.0, mu_kinetic=0.0),
    )
    plant = MultibodyPlant(1e-5)
    longest = largest_step(add_foot(plant, plant.world_frame(), bare))
    _, _, note = drop(
        bare, "kelvin_voigt", Advance("too long", time_step_s=1.05 * longest), 0.108, 0.4, np.inf
    )
    assert note.startswith("refused")
    (force, _, note), (fine, _, _) = (
        drop(bare, "kelvin_voigt", Advance("", time_step_s=step), 0.108, 0.4, np.inf)
        for step in (5e-4, 1e-4)
    )
    assert note == ""
    assert 5e-4 < longest < 1e-3
    assert np.abs(np.diff(force)).max() < 1.5 * np.abs(np.diff(fine)).max()
    assert force.max() == pytest.approx(fine.max(), rel=0.03)


def test_steps_and_supports_that_cannot_be_are_refused():
    coarse = MultibodyPlant(1e-3)
    with pytest.raises(
        InputError,
        match=r"kelvin_voigt is an explicit force.*at most 0\.11 ms, contact drake_point",
    ):
        add_foot(coarse, coarse.world_frame(), FOOT)
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(1e-5))
    foot = add_foot(plant, plant.world_frame(), FOOT, fulcrum_m=0.09)
    plant.Finalize()
    with pytest.raises(
        InputError, match=r"stands at 90 mm.*fulcrum_m=0\.12, or move it by place_fulcrum"
    ):
        wire_foot(builder, plant, foot, fulcrum_m=0.12)
    plant = MultibodyPlant(0.0)
    foot = add_foot(plant, plant.world_frame(), FOOT)
    plant.Finalize()
    with pytest.raises(InputError, match="continuous plant"):
        place_fulcrum(plant, plant.CreateDefaultContext(), foot, 0.1)
    foot = Held()
    with pytest.raises(
        InputError, match=r"plant_context: is not the plant's.*GetMyMutableContextFromRoot"
    ):
        place_fulcrum(foot.plant, foot.context, foot.foot, 0.1)
    with pytest.raises(InputError, match="what wire_foot returned"):
        follow_fulcrum(foot.simulator, foot.plant, foot.foot)
