"""The shapes that foot, person and ground are seen by: closed, where the model is, without a part
in the physics."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.plants.foot import add_foot, sole_height
from vsf_drake.plants.foot_visuals import lofted
from vsf_drake.plants.person import add_person
from vsf_drake.plants.solids import frustum_volume
from vsf_drake.plants.visuals import add_visuals, draw_ground


def drawn_person(side, **lengths):
    plant, scene_graph = registered_plant()
    subject = Subject(mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side=side, **lengths)
    person = add_person(plant, subject, ModelParameters())
    add_visuals(plant, person)
    plant.Finalize()
    return plant, scene_graph.model_inspector(), person


def obj_mesh(shape):
    lines = [
        line.split()
        for line in shape.source().in_memory().mesh_file.contents().decode().splitlines()
    ]
    points = np.array([[float(x) for x in line[1:]] for line in lines if line[0] == "v"])
    faces = [
        [int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[0] == "f"
    ]
    return points, faces


@pytest.mark.parametrize("along", ["x", "z"])
def test_a_lofted_surface_is_closed_and_faces_outward(along):
    """A conical frustum of elliptical section, one end beside the other's axis, which changes no
    volume."""
    points, faces = obj_mesh(
        lofted(along, [(-0.4, 0.02, 0.01, 0.05, 0.025), (0.0, 0.0, 0.0, 0.09, 0.045)])
    )
    edges = [(a, b) for face in faces for a, b in zip(face, face[1:] + face[:1], strict=True)]
    assert len(edges) == len(set(edges)), "an edge is walked twice in one direction"
    assert {(b, a) for a, b in edges} == set(edges), "the surface has a border"
    volume = sum(
        np.dot(points[face[0]], np.cross(points[face[i]], points[face[i + 1]])) / 6.0
        for face in faces
        for i in range(1, len(face) - 1)
    )
    sides = len(points) // 2
    polygon = sides / (2.0 * np.pi) * np.sin(2.0 * np.pi / sides)
    assert volume == pytest.approx(0.5 * polygon * frustum_volume(0.09, 0.05, 0.4), rel=1e-3)
    size = np.ptp(points, axis=0)
    assert size["xz".index(along) * 2] == pytest.approx(0.4)


def outlines(plant, inspector, of):
    """(n, 3) vertices in W, all coordinates zero, of every mesh of this name, by body."""
    context, found = plant.CreateDefaultContext(), {}
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        if inspector.GetName(geometry).endswith(f"::{of}"):
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            X_WG = body.EvalPoseInWorld(context) @ inspector.GetPoseInFrame(geometry)
            found[body.name()] = (X_WG @ obj_mesh(inspector.GetShape(geometry))[0].T).T
    return found


def test_every_segment_and_device_part_is_drawn():
    plant, inspector, person = drawn_person("left")
    shapes = inspector.GetAllGeometryIds(Role.kIllustration)
    drawn = {plant.GetBodyFromFrameId(inspector.GetFrameId(g)).name() for g in shapes}
    bodies = [
        *person.segments.values(),
        *person.foot.keel,
        person.foot.frame,
        person.socket.socket,
        person.socket.pylon,
    ]
    assert drawn == {body.name() for body in bodies} | {"vsf_carriage"}
    assert inspector.NumGeometriesWithRole(Role.kProximity) == 0
    spheres = [inspector.GetName(g) for g in shapes if "site_" in inspector.GetName(g)]
    assert len(spheres) == len(person.foot.sites.radius) + len(person.intact_sites.radius)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_person_stands_as_tall_as_they_are_with_the_head_on_and_the_arms_beside(side):
    # short legs: the rest must be long
    plant, inspector, person = drawn_person(side, thigh_length_m=0.36)
    head, trunk = (outlines(plant, inspector, part)["pelvis"] for part in ("head", "trunk"))
    hips = person.body.hip_up
    assert head[:, 2].min() < trunk[:, 2].max()
    assert head[:, 2].max() == pytest.approx(hips - person.body.leg_length + 1.8, abs=1e-6)
    right, left = (outlines(plant, inspector, f"arm_{arm}")["pelvis"] for arm in ("right", "left"))
    np.testing.assert_allclose(sorted(left[:, 1]), sorted(-right[:, 1]), atol=1e-6)
    assert left[:, 1].min() > 0.1 and left[:, 2].min() < hips


def test_the_sole_is_as_long_and_as_low_as_the_models_and_moves_with_keel_and_frame():
    plant, scene_graph = registered_plant()
    parameters = FootParameters()
    foot = add_foot(plant, plant.world_frame(), parameters, side="right")
    plant.Finalize()
    frame_x, _, frame_z = foot.frame.EvalPoseInWorld(plant.CreateDefaultContext()).translation()
    soles = outlines(plant, scene_graph.model_inspector(), "sole")
    behind = [
        p.name()
        for p, end in zip(foot.keel, foot.keel_starts[1:], strict=False)
        if end <= parameters.fulcrum.rearmost_m
    ]
    assert set(soles) == {foot.frame.name(), *(piece.name() for piece in foot.keel)} - set(behind)
    points = np.vstack([*soles.values()]) - [frame_x, 0.0, frame_z]
    assert points[:, 0].min() == pytest.approx(parameters.heel_x_m, abs=1e-6)
    assert points[:, 0].max() == pytest.approx(
        parameters.heel_x_m + parameters.length_m, abs=2.5e-3
    )
    for sole in soles.values():
        assert sole[:, 2].min() - frame_z == pytest.approx(sole_height(parameters), abs=1e-6)
    toes = points[points[:, 0] > 0.9 * parameters.length_m]
    assert toes[:, 1].mean() > 0.003  # those of a right foot are on its left


def test_the_fulcrum_bears_on_the_keel_from_above():
    """As the load lifts the toe, the pin at A and the load push the keel up; only the fulcrum holds
    it down."""
    plant, scene_graph = registered_plant()
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    inspector, carriage = scene_graph.model_inspector(), foot.carriage_joint(plant).child_body()
    roller = inspector.GetGeometryIdByName(
        plant.GetBodyFrameIdOrThrow(carriage.index()), Role.kIllustration, "vsf::roller"
    )
    lowest = inspector.GetPoseInFrame(roller).translation()[2] - inspector.GetShape(roller).radius()
    assert lowest == pytest.approx(0.5 * foot.parameters.keel.thickness_m)


def test_the_pelvis_has_the_trunks_radii_of_gyration_whatever_is_drawn_on_it():
    _, _, person = drawn_person("right")
    body, inertia = person.body, person.pelvis.default_spatial_inertia()
    expected = body.pelvis_mass * (np.array(body.table.trunk_gyration) * body.trunk_length) ** 2
    central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    np.testing.assert_allclose(central.get_moments(), expected, rtol=1e-12)


def registered_plant():
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def test_a_foot_is_drawn_where_there_is_a_scene_graph_unless_nobody_wants_to_see_it():
    """Spheres stand where they touch: their lowest points are the contact spheres'."""
    plant, scene_graph = registered_plant()
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    add_foot(plant, plant.world_frame(), FootParameters(), name="hidden", visual=False)
    bare = MultibodyPlant(0.0)
    add_foot(bare, bare.world_frame(), FootParameters())
    inspector = scene_graph.model_inspector()
    names = [inspector.GetName(g) for g in inspector.GetAllGeometryIds(Role.kIllustration)]
    assert {"vsf::frame", "vsf::piece", "vsf::roller", "vsf::carriage", "vsf::sole"} <= set(names)
    assert not [name for name in names if name.startswith("hidden")]
    for i, (body, centre) in enumerate(zip(foot.sites.body_indices, foot.sites.p_BS, strict=True)):
        sphere = inspector.GetGeometryIdByName(
            plant.GetBodyFrameIdOrThrow(body), Role.kIllustration, f"vsf::site_{i}"
        )
        low = inspector.GetPoseInFrame(sphere).translation() - [
            0.0,
            0.0,
            inspector.GetShape(sphere).radius(),
        ]
        np.testing.assert_allclose(low, centre - [0.0, 0.0, foot.sites.radius[i]], atol=1e-12)


def test_a_patch_far_off_is_drawn_where_it_is_and_whole():
    """Its middle in the plane, its sides as long as the slope makes them."""
    patch = GroundPatch(
        from_x_m=5.0, to_x_m=7.0, from_y_m=-8.0, to_y_m=-6.0, slope_deg=10.0, height_m=0.1
    )
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    draw_ground(plant, Ground(patches=(patch, GroundPatch())))
    inspector = scene_graph.model_inspector()
    plates = {
        inspector.GetName(i).split("::")[-1]: i
        for i in inspector.GetAllGeometryIds(Role.kIllustration)
    }
    far = plates["ground_0_ground"]
    rise = np.tan(np.radians(10.0))
    size = inspector.GetShape(far).size()
    np.testing.assert_allclose(size[:2], [2.0 * np.hypot(1.0, rise), 2.0])
    top = inspector.GetPoseInFrame(far) @ np.array([0.0, 0.0, 0.5 * size[2]])
    np.testing.assert_allclose(top, [6.0, -7.0, 0.1 + 6.0 * rise], atol=1e-12)
    np.testing.assert_allclose(inspector.GetShape(plates["ground_1_ground"]).size()[:2], [6.0, 6.0])
