"""Drake's own contact under the foot, held against our laws and closed forms in given poses and
motions."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from made_feet import loose_foot
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    MultibodyPlant,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import FootParameters, FrictionParameters
from vsf_drake.plants import add_foot, add_ground_geometry, wire_foot
from vsf_drake.plants.contact_geometry import (
    PAD_THICKNESS_M,
    RIM_M,
    pad_widths,
    point_law,
)
from vsf_drake.plants.foot import sole_height

FOOT = FootParameters()


def put(foot, position, angles=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    """The straight foot with its unloaded sole under K's origin at `position`, moving; its ground
    reaction."""
    R_WK = RotationMatrix(RollPitchYaw(*angles))
    X_WK = RigidTransform(R_WK, np.array(position) - R_WK @ np.array([0.0, 0.0, sole_height(FOOT)]))
    joints = len(foot.foot.keel_joint_names)
    foot.place(
        X_WK,
        np.append(np.zeros(3), velocity),
        np.append(np.zeros(joints), 0.108),
        np.zeros(joints + 1),
    )
    return {name: foot.output(name) for name in ("grf", "cop", "free_moment")}


@pytest.fixture(scope="module")
def point():
    return loose_foot(contact="drake_point")


@pytest.fixture(scope="module")
def pads():
    return loose_foot(contact="hydroelastic")


def test_point_contact_is_the_hunt_crossley_law_of_the_same_foot(point):
    ours = loose_foot(contact="hunt_crossley")
    for angles, velocity in (
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.02, 0.15, 0.3), (0.0, 0.0, -0.2)),
        ((-0.03, -0.2, 0.0), (0.0, 0.0, 0.1)),
    ):
        drake, law = (put(each, (0.3, 0.1, -0.004), angles, velocity) for each in (point, ours))
        np.testing.assert_allclose(drake["grf"][2], law["grf"][2], rtol=1e-5)
        assert law["grf"][2] > 50.0
    # at rest, where there is no friction to act at different heights
    drake, law = (put(each, (0.3, 0.1, -0.004), (0.02, 0.1, 0.3)) for each in (point, ours))
    np.testing.assert_allclose(drake["cop"], law["cop"], atol=1e-6)
    np.testing.assert_allclose(drake["free_moment"], 0.0, atol=1e-9)


def test_flat_pads_bear_the_zones_stiffness_times_depth_and_are_damped_after_hunt_and_crossley(
    pads,
):
    """But for the rim of each, over which the pressure falls: at most 2 rim / width, wide in
    proportion to depth."""
    sites = pads.foot.sites
    _, dissipation = point_law(sites)
    assert np.ptp(dissipation) < 1e-9 * dissipation[0]
    for depth in (1e-3, 6e-3, 0.015):
        read = put(pads, (0.0, 0.0, -depth))
        lost = 1.0 - read["grf"][2] / (depth * np.sum(sites.stiffness))
        rim = RIM_M * depth / (PAD_THICKNESS_M - RIM_M)
        assert 0.0 <= lost <= 2.0 * rim / pad_widths(sites).min() < 0.003
        damped = put(pads, (0.0, 0.0, -depth), velocity=(0.0, 0.0, -0.1))
        np.testing.assert_allclose(
            damped["grf"][2], read["grf"][2] * (1.0 + 0.1 * dissipation[0]), rtol=1e-6
        )
    x = [x for zone in FOOT.zones for x in zone.x_mm]
    k = [zone.stiffness for zone in FOOT.zones for _ in zone.x_mm]
    np.testing.assert_allclose(read["cop"], [1e-3 * np.dot(k, x) / np.sum(k), 0.0, 0.0], atol=1e-4)


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_sliding_foot_is_held_back_by_the_patchs_kinetic_friction(contact):
    sliding = loose_foot(
        contact=contact, ground=Ground(patches=(GroundPatch(mu_static=0.3, mu_kinetic=0.12),))
    )
    force = put(sliding, (0.0, 0.0, -0.003), velocity=(0.6, -0.8, 0.0))["grf"]
    np.testing.assert_allclose(force[:2], -0.12 * force[2] * np.array([0.6, -0.8]), rtol=1e-3)


def test_force_stands_on_a_sloping_patch_as_our_law_has_it():
    """Its bounds are not about the origin, nor about the foot."""
    ground = Ground(
        patches=(
            GroundPatch(
                height_m=0.2,
                reference_x_m=0.1,
                slope_deg=8.0,
                bank_deg=-3.0,
                from_y_m=-0.5,
                to_y_m=2.0,
            ),
        )
    )
    feet = (
        loose_foot(contact=contact, ground=ground) for contact in ("drake_point", "hunt_crossley")
    )
    drake, law = (
        put(foot, (0.1, 0.0, 0.195), (0.0, -np.radians(8.0), 0.0))["grf"] for foot in feet
    )
    np.testing.assert_allclose(drake, law, rtol=1e-5)
    assert law[0] < -10.0 < 10.0 < law[2]


def test_steps_and_bounds_are_where_patches_have_them_and_a_soft_one_gives_in_series():
    ground = Ground(
        patches=(GroundPatch(to_x_m=0.5), GroundPatch(name="step", from_x_m=0.5, height_m=0.1))
    )
    made = loose_foot(contact="drake_point", ground=ground)
    own = made.foot.sites.stiffness
    assert put(made, (0.6, 0.0, 0.101))["grf"][2] == 0.0
    np.testing.assert_allclose(
        put(made, (0.6, 0.0, 0.098))["grf"][2], 2e-3 * np.sum(own), rtol=1e-5
    )
    soft = loose_foot(
        contact="drake_point", ground=Ground(patches=(GroundPatch(stiffness_n_per_m=2e4),))
    )
    np.testing.assert_allclose(
        put(soft, (0.0, 0.0, -0.004))["grf"][2], 0.004 * np.sum(own * 2e4 / (own + 2e4)), rtol=1e-9
    )


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_bent_keel_does_not_collide_with_itself(contact, request):
    made = request.getfixturevalue("point" if contact == "drake_point" else "pads")
    made.place(
        RigidTransform([0.0, 0.0, 1.0]),
        np.zeros(6),
        np.append(np.full(9, 0.1), 0.108),
        np.zeros(10),
    )
    results = made.plant.get_contact_results_output_port().Eval(made.plant_context)
    counts = results.num_point_pair_contacts(), results.num_hydroelastic_contacts()
    assert counts == (0, 0)


@pytest.mark.parametrize(
    ("contact", "time_step"), [("kelvin_voigt", 0.0), ("drake_point", 0.0), ("hydroelastic", 1e-3)]
)
def test_diagram_is_freed_when_nobody_holds_it(contact, time_step):
    """The plant meets its SceneGraph by hand, for AddMultibodyPlantSceneGraph keeps both alive
    (Drake 1.51)."""

    def build():
        builder = DiagramBuilder()
        plant, graph = builder.AddSystem(MultibodyPlant(time_step)), builder.AddSystem(SceneGraph())
        plant.RegisterAsSourceForSceneGraph(graph)
        builder.Connect(graph.get_query_output_port(), plant.get_geometry_query_input_port())
        builder.Connect(
            plant.get_geometry_pose_output_port(), graph.get_source_pose_port(plant.get_source_id())
        )
        foot = add_foot(plant, plant.world_frame(), FOOT, contact=contact)
        if contact != "kelvin_voigt":
            add_ground_geometry(plant, contact=contact)
        plant.Finalize()
        wired = wire_foot(builder, plant, foot)
        diagram = builder.Build()
        return [weakref.ref(x) for x in (wired.reaction or wired.forces, wired.forces, diagram)]

    held = build()
    for _ in range(3):
        gc.collect()
    assert [reference() for reference in held] == [None] * 3


def plant_with_graph():
    return AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)[0]


@pytest.mark.parametrize(
    ("patches", "contact", "where"),
    [
        ((GroundPatch(), GroundPatch(from_x_m=1.0)), "drake_point", r"patches\[1\]"),
        ((GroundPatch(stiffness_n_per_m=1e4),), "hydroelastic", "stiffness_n_per_m"),
        ((GroundPatch(mu_static=1.2),), "drake_point", "mu_static"),
        ((GroundPatch(belt_m_per_s=-1.0),), "drake_point", "belt_m_per_s.*own_ground=True"),
    ],
)
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
        (
            r"no SceneGraph.*AddMultibodyPlantSceneGraph",
            add_foot,
            (bare, bare.world_frame(), FOOT),
            "drake_point",
        ),
        ("no SceneGraph", add_ground_geometry, (bare,), "drake_point"),
        (r"kPoint.*drake_point", add_foot, (points, points.world_frame(), FOOT), "hydroelastic"),
        (r"finalized.*before plant.Finalize\(\)", add_ground_geometry, (finalized,), "drake_point"),
        (
            r"kelvin_voigt.*drake_point, hydroelastic",
            add_ground_geometry,
            (points,),
            "kelvin_voigt",
        ),
        ("has a ground already.*once for all feet", add_ground_geometry, (plant,), "drake_point"),
        (
            "has a ground already.*once for all feet",
            add_ground_geometry,
            (plant, ice),
            "drake_point",
        ),
    ):
        with pytest.raises(InputError, match=message):
            function(*arguments, contact=contact)


@pytest.mark.parametrize(("contact", "time_step"), [("drake_point", 1e-3), ("hydroelastic", 0.0)])
def test_a_foot_that_would_fall_through_is_refused_unless_its_ground_is_the_users_own(
    contact, time_step
):
    """Geometry of a body beside it that moves is no ground unless somebody says so."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step)
    belt = plant.AddRigidBody("belt", SpatialInertia.SolidBoxWithMass(5.0, 2.0, 0.5, 0.1))
    plant.RegisterCollisionGeometry(
        belt, RigidTransform(), Box(2.0, 0.5, 0.1), "belt", CoulombFriction(0.5, 0.3)
    )
    foot = add_foot(plant, plant.world_frame(), FOOT, contact=contact)
    plant.Finalize()
    before = builder.connection_map()
    with pytest.raises(
        InputError, match=r"fall through.*add_ground_geometry\(plant, ground\).*own_ground=True"
    ):
        wire_foot(builder, plant, foot)
    with pytest.raises(InputError, match="add_ground_geometry"):
        wire_foot(builder, plant, foot, ground=Ground())
    assert builder.connection_map() == before
    wire_foot(builder, plant, foot, own_ground=True)
    builder.Build()
