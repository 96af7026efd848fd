"""The shapes that foot, person and ground are seen by: closed, where the model is, without a part in the physics."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import Role, SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.person import add_person
from vsf_drake.plants.solids import frustum_volume
from vsf_drake.plants.visuals import (
    add_foot_visuals,
    add_visuals,
    draw_ground,
    frustum_shape,
)


def subject(side):
    return Subject(mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side=side)


def drawn_person(side):
    plant, scene_graph = registered_plant()
    person = add_person(plant, subject(side), ModelParameters())
    add_visuals(plant, person)
    plant.Finalize()
    return plant, scene_graph.model_inspector(), person


def obj_mesh(shape):
    lines = [line.split() for line in shape.source().in_memory().mesh_file.contents().decode().splitlines()]
    points = np.array([[float(x) for x in line[1:]] for line in lines if line[0] == "v"])
    faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[0] == "f"]
    return points, faces


def test_frustum_is_closed_and_faces_outward():
    points, faces = obj_mesh(frustum_shape(0.09, 0.05, 0.4))
    edges = [(a, b) for face in faces for a, b in zip(face, face[1:] + face[:1], strict=True)]
    assert len(edges) == len(set(edges)), "an edge is walked twice in one direction"
    assert {(b, a) for a, b in edges} == set(edges), "the surface has a border"
    volume = sum(np.dot(points[face[0]], np.cross(points[face[i]], points[face[i + 1]])) / 6.0
                 for face in faces for i in range(1, len(face) - 1))
    sides = len(points) // 2
    polygon = sides / (2.0 * np.pi) * np.sin(2.0 * np.pi / sides)
    assert volume == pytest.approx(polygon * frustum_volume(0.09, 0.05, 0.4), rel=1e-4)


def test_every_segment_and_device_part_is_drawn():
    plant, inspector, person = drawn_person("left")
    drawn = {plant.GetBodyFromFrameId(inspector.GetFrameId(g)).name()
             for g in inspector.GetAllGeometryIds(Role.kIllustration)}
    bodies = [*person.segments.values(), *person.foot.keel, person.foot.frame, person.socket.socket,
              person.socket.pylon]
    assert drawn == {body.name() for body in bodies} | {"vsf_carriage"}
    assert inspector.NumGeometriesWithRole(Role.kProximity) == 0


def test_pelvis_and_its_ellipsoid_have_the_trunks_radii_of_gyration():
    plant, inspector, person = drawn_person("right")
    body, inertia = person.body, person.pelvis.default_spatial_inertia()
    expected = body.pelvis_mass * (np.array(body.table.trunk_gyration) * body.trunk_length) ** 2
    central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    np.testing.assert_allclose(central.get_moments(), expected, rtol=1e-12)
    frame = plant.GetBodyFrameIdOrThrow(person.pelvis.index())
    geometry = inspector.GetGeometryIdByName(frame, Role.kIllustration, "person::trunk")
    shape = inspector.GetShape(geometry)
    solid = SpatialInertia.SolidEllipsoidWithMass(body.pelvis_mass, shape.a(), shape.b(), shape.c())
    np.testing.assert_allclose(solid.CalcRotationalInertia().get_moments(), expected, rtol=1e-12)
    np.testing.assert_allclose(inspector.GetPoseInFrame(geometry).translation(), inertia.get_com(), atol=1e-15)


def registered_plant():
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def test_plants_that_take_no_shapes_and_feet_that_have_them_are_refused_with_the_remedy():
    bare, (plant, _) = MultibodyPlant(0.0), registered_plant()
    for where in (bare, plant):
        foot = add_foot(where, where.world_frame(), FootParameters())
        if where is bare:
            with pytest.raises(InputError, match="AddMultibodyPlantSceneGraph"):
                add_foot_visuals(bare, foot)
    add_foot_visuals(plant, foot)
    with pytest.raises(InputError, match=r"'vsf' has its shapes already.*once a foot"):
        add_foot_visuals(plant, foot)
    with pytest.raises(InputError, match="foot: is a RigidBody"):
        add_foot_visuals(plant, foot.frame)
    plant.Finalize()
    with pytest.raises(InputError, match="between add_foot and"):
        add_foot_visuals(plant, foot)


def test_a_patch_far_off_is_drawn_where_it_is_and_whole():
    """Its middle in the plane, its sides as long as the slope makes them."""
    patch = GroundPatch(from_x_m=5.0, to_x_m=7.0, from_y_m=-8.0, to_y_m=-6.0, slope_deg=10.0, height_m=0.1)
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    draw_ground(plant, Ground(patches=(patch, GroundPatch())))
    inspector = scene_graph.model_inspector()
    plates = {inspector.GetName(i).split("::")[-1]: i for i in inspector.GetAllGeometryIds(Role.kIllustration)}
    far = plates["ground_0_ground"]
    rise = np.tan(np.radians(10.0))
    size = inspector.GetShape(far).size()
    np.testing.assert_allclose(size[:2], [2.0 * np.hypot(1.0, rise), 2.0])
    top = inspector.GetPoseInFrame(far) @ np.array([0.0, 0.0, 0.5 * size[2]])
    np.testing.assert_allclose(top, [6.0, -7.0, 0.1 + 6.0 * rise], atol=1e-12)
    np.testing.assert_allclose(inspector.GetShape(plates["ground_1_ground"]).size()[:2], [6.0, 6.0])
