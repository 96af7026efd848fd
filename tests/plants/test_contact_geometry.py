"""Drake's own contact under the foot, held against our laws and closed forms in given poses and motions."""

from __future__ import annotations

import gc
import weakref
from dataclasses import dataclass, replace

import numpy as np
import pytest
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import FootParameters, FrictionParameters
from vsf_drake.plants import add_foot, add_ground_geometry, wire_foot
from vsf_drake.plants.contact_geometry import (
    PAD_THICKNESS_M,
    RIM_M,
    pad_widths,
    point_law,
)
from vsf_drake.plants.foot_handles import FootHandles

FOOT = FootParameters()
NAMES = ("grf", "cop", "free_moment")


@dataclass
class Stand:
    """A floating shank with the foot over a ground, whose pose and motion are given."""

    diagram: Diagram
    plant: MultibodyPlant
    foot: FootHandles
    context: Context

    def place(self, position=(0.0, 0.0, 0.0), angles=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
        """Pose of the foot's frame K in W, with K's origin where the unloaded sole is at `position`; velocity of K."""
        own = self.plant.GetMyMutableContextFromRoot(self.context)
        X_WK = RigidTransform(RollPitchYaw(*angles), np.zeros(3))
        sole = X_WK.rotation() @ [0.0, 0.0, -(0.5 * FOOT.keel.thickness_m + FOOT.foam_thickness_m)]
        X_WK.set_translation(np.array(position) - sole)
        X_KS = self.foot.frame.EvalPoseInWorld(own).inverse() @ self.shank.EvalPoseInWorld(own)
        self.plant.SetFreeBodyPose(own, self.shank, X_WK @ X_KS)
        v = np.zeros(self.plant.num_velocities())
        start = self.shank.floating_velocities_start_in_v()
        v[start + 3 : start + 6] = velocity
        self.plant.SetVelocities(own, v)

    @property
    def shank(self):
        return self.plant.GetBodyByName("shank")

    def reads(self):
        return {name: self.diagram.GetOutputPort(name).Eval(self.context) for name in NAMES}


def stand(contact, ground=None, parameters=FOOT):
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(5.0, 0.1, 0.1, 0.4))
    foot = add_foot(plant, shank.body_frame(), parameters, contact=contact)
    own = contact in ("drake_point", "hydroelastic")
    if own:
        add_ground_geometry(plant, ground, foot=parameters, contact=contact)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot, ground=None if own else ground)
    for name in NAMES:
        builder.ExportOutput(wired.GetOutputPort(name), name)
    diagram = builder.Build()
    return Stand(diagram, plant, foot, diagram.CreateDefaultContext())


@pytest.fixture(scope="module")
def point():
    return stand("drake_point")


@pytest.fixture(scope="module")
def pads():
    return stand("hydroelastic")


def test_point_contact_is_the_hunt_crossley_law_of_the_same_foot(point):
    ours = stand("hunt_crossley")
    for angles, velocity in (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.02, 0.15, 0.3), (0.0, 0.0, -0.2)),
                             ((-0.03, -0.2, 0.0), (0.0, 0.0, 0.1))):
        for each in (point, ours):
            each.place((0.3, 0.1, -0.004), angles, velocity)
        drake, law = point.reads(), ours.reads()
        np.testing.assert_allclose(drake["grf"][2], law["grf"][2], rtol=1e-5)
        assert law["grf"][2] > 50.0
    for each in (point, ours):  # at rest, where there is no friction to act at different heights
        each.place((0.3, 0.1, -0.004), (0.02, 0.1, 0.3))
    np.testing.assert_allclose(point.reads()["cop"], ours.reads()["cop"], atol=1e-6)
    np.testing.assert_allclose(point.reads()["free_moment"], 0.0, atol=1e-9)


def test_flat_pads_bear_the_sum_of_the_zones_stiffness_times_depth_and_are_damped_after_hunt_and_crossley(pads):
    """But for the rim of each, over which the pressure falls: at most 2 rim / width, wide in proportion to depth."""
    _, dissipation = point_law(pads.foot.sites)
    assert np.ptp(dissipation) < 1e-9 * dissipation[0]
    for depth in (1e-3, 6e-3, 0.015):
        pads.place((0.0, 0.0, -depth))
        read = pads.reads()
        lost = 1.0 - read["grf"][2] / (depth * np.sum(pads.foot.sites.stiffness))
        rim = RIM_M * depth / (PAD_THICKNESS_M - RIM_M)
        assert 0.0 <= lost <= 2.0 * rim / pad_widths(pads.foot.sites).min() < 0.003
        pads.place((0.0, 0.0, -depth), velocity=(0.0, 0.0, -0.1))
        np.testing.assert_allclose(pads.reads()["grf"][2], read["grf"][2] * (1.0 + 0.1 * dissipation[0]), rtol=1e-6)
    x = [x for zone in FOOT.zones for x in zone.x_mm]
    k = [zone.stiffness for zone in FOOT.zones for _ in zone.x_mm]
    np.testing.assert_allclose(read["cop"], [1e-3 * np.dot(k, x) / np.sum(k), 0.0, 0.0], atol=1e-4)


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_sliding_foot_is_held_back_by_the_patchs_kinetic_friction(contact):
    ground = Ground(patches=(GroundPatch(mu_static=0.3, mu_kinetic=0.12),))
    sliding = stand(contact, ground)
    sliding.place((0.0, 0.0, -0.003), velocity=(0.6, -0.8, 0.0))
    force = sliding.reads()["grf"]
    np.testing.assert_allclose(force[:2], -0.12 * force[2] * np.array([0.6, -0.8]), rtol=1e-3)


def test_force_stands_on_a_sloping_patch_as_our_law_has_it():
    """Its bounds are not about the origin, nor about the foot."""
    ground = Ground(patches=(GroundPatch(height_m=0.2, reference_x_m=0.1, slope_deg=8.0, bank_deg=-3.0, from_y_m=-0.5,
                                         to_y_m=2.0),))
    made = {contact: stand(contact, ground) for contact in ("drake_point", "hunt_crossley")}
    for each in made.values():
        each.place((0.1, 0.0, 0.195), (0.0, -np.radians(8.0), 0.0))
    drake, law = (made[contact].reads()["grf"] for contact in ("drake_point", "hunt_crossley"))
    np.testing.assert_allclose(drake, law, rtol=1e-5)
    assert law[0] < -10.0 < 10.0 < law[2]


def test_steps_and_bounds_are_where_the_patches_have_them_and_a_soft_one_gives_in_series_with_each_sphere():
    ground = Ground(patches=(GroundPatch(to_x_m=0.5), GroundPatch(name="step", from_x_m=0.5, height_m=0.1)))
    made = stand("drake_point", ground)
    made.place((0.6, 0.0, 0.101))
    assert made.reads()["grf"][2] == 0.0
    made.place((0.6, 0.0, 0.098))
    np.testing.assert_allclose(made.reads()["grf"][2], 2e-3 * np.sum(made.foot.sites.stiffness), rtol=1e-5)
    soft = stand("drake_point", Ground(patches=(GroundPatch(stiffness_n_per_m=2e4),)))
    soft.place((0.0, 0.0, -0.004))
    own = soft.foot.sites.stiffness
    np.testing.assert_allclose(soft.reads()["grf"][2], 0.004 * np.sum(own * 2e4 / (own + 2e4)), rtol=1e-9)


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_bent_keel_does_not_collide_with_itself(contact, request):
    made = request.getfixturevalue("point" if contact == "drake_point" else "pads")
    made.place((0.0, 0.0, 1.0))
    own = made.plant.GetMyMutableContextFromRoot(made.context)
    for name in made.foot.keel_joint_names:
        made.plant.GetJointByName(name).set_angle(own, 0.1)
    results = made.plant.get_contact_results_output_port().Eval(own)
    counts = results.num_point_pair_contacts(), results.num_hydroelastic_contacts()
    for name in made.foot.keel_joint_names:
        made.plant.GetJointByName(name).set_angle(own, 0.0)
    assert counts == (0, 0)


@pytest.mark.parametrize(("contact", "time_step"), [("drake_point", 0.0), ("hydroelastic", 1e-3)])
def test_diagram_with_drakes_contact_is_freed_when_nobody_holds_it(contact, time_step):
    """The plant meets its SceneGraph by hand, for AddMultibodyPlantSceneGraph keeps both alive (Drake 1.51)."""
    def build():
        builder = DiagramBuilder()
        plant, graph = builder.AddSystem(MultibodyPlant(time_step)), builder.AddSystem(SceneGraph())
        plant.RegisterAsSourceForSceneGraph(graph)
        builder.Connect(graph.get_query_output_port(), plant.get_geometry_query_input_port())
        builder.Connect(plant.get_geometry_pose_output_port(), graph.get_source_pose_port(plant.get_source_id()))
        foot = add_foot(plant, plant.world_frame(), FOOT, contact=contact)
        add_ground_geometry(plant, contact=contact)
        plant.Finalize()
        wired = wire_foot(builder, plant, foot)
        builder.Build()
        return weakref.ref(wired.reaction), weakref.ref(wired.forces)

    held = build()
    for _ in range(3):
        gc.collect()
    assert [reference() for reference in held] == [None, None]


def plant_with_graph():
    return AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)[0]


@pytest.mark.parametrize(("patches", "contact", "where"), [
    ((GroundPatch(), GroundPatch(from_x_m=1.0)), "drake_point", r"patches\[1\]"),
    ((GroundPatch(stiffness_n_per_m=1e4),), "hydroelastic", "stiffness_n_per_m"),
    ((GroundPatch(mu_static=1.2),), "drake_point", "mu_static"),
])
def test_ground_that_drakes_contact_cannot_have_is_refused(patches, contact, where):
    foot = replace(FOOT, friction=FrictionParameters(mu_static=0.5, mu_kinetic=0.3))
    with pytest.raises(InputError, match=where):
        add_ground_geometry(plant_with_graph(), Ground(patches=patches), foot=foot, contact=contact)


def test_a_plant_that_takes_no_geometry_and_a_contact_that_makes_none_are_refused():
    bare, points, plant = MultibodyPlant(0.0), plant_with_graph(), plant_with_graph()
    points.set_contact_model(ContactModel.kPoint)
    add_ground_geometry(plant)
    finalized = plant_with_graph()
    finalized.Finalize()
    ice = Ground(patches=(GroundPatch(name="ice", height_m=0.01, mu_static=0.1),))
    for message, function, arguments, contact in (
            (r"no SceneGraph.*AddMultibodyPlantSceneGraph", add_foot, (bare, bare.world_frame(), FOOT), "drake_point"),
            ("no SceneGraph", add_ground_geometry, (bare,), "drake_point"),
            (r"kPoint.*drake_point", add_foot, (points, points.world_frame(), FOOT), "hydroelastic"),
            (r"finalized.*before plant.Finalize\(\)", add_ground_geometry, (finalized,), "drake_point"),
            (r"kelvin_voigt.*drake_point, hydroelastic", add_ground_geometry, (points,), "kelvin_voigt"),
            ("has a ground already.*once for all feet", add_ground_geometry, (plant,), "drake_point"),
            ("has a ground already.*once for all feet", add_ground_geometry, (plant, ice), "drake_point")):
        with pytest.raises(InputError, match=message):
            function(*arguments, contact=contact)


@pytest.mark.parametrize(("contact", "time_step"), [("drake_point", 1e-3), ("hydroelastic", 0.0)])
def test_a_foot_that_would_fall_through_is_refused_unless_its_ground_is_the_users_own(contact, time_step):
    """Geometry of a body beside it that moves is no ground unless somebody says so."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step)
    belt = plant.AddRigidBody("belt", SpatialInertia.SolidBoxWithMass(5.0, 2.0, 0.5, 0.1))
    plant.RegisterCollisionGeometry(belt, RigidTransform(), Box(2.0, 0.5, 0.1), "belt", CoulombFriction(0.5, 0.3))
    foot = add_foot(plant, plant.world_frame(), FOOT, contact=contact)
    plant.Finalize()
    before = builder.connection_map()
    with pytest.raises(InputError, match=r"fall through.*add_ground_geometry\(plant, ground\).*own_ground=True"):
        wire_foot(builder, plant, foot)
    with pytest.raises(InputError, match="add_ground_geometry"):
        wire_foot(builder, plant, foot, ground=Ground())
    assert builder.connection_map() == before
    wire_foot(builder, plant, foot, own_ground=True)
    builder.Build()
