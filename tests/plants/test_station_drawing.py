"""A drawn station: its shapes go with its own bodies, and its physics is that of the station without them."""

from __future__ import annotations

from dataclasses import replace

import meshcat_page
import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.files import resource
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.plants.station import make_station
from vsf_drake.plants.visuals import draw_ground
from vsf_drake.report.show.drawing import open_meshcat
from vsf_drake.scenario import load_scenario

BENCH, PERSON = (load_scenario(resource(f"models/scenarios/{kind}.yaml")) for kind in ("bench", "person"))
KINDS = {"bench": BENCH, "person over patches": PERSON, "person on a plane": replace(PERSON, ground=None)}
LIFT_M = 0.93
"""Pelvis height at which the person's feet are in the ground."""


def moving(station):
    """A Context with the ground or the platen against the foot, bodies moving, inputs fixed."""
    context, plant = station.diagram.CreateDefaultContext(), station.plant
    n = plant.num_positions()
    x = np.random.default_rng(5).uniform(-1, 1, 2 * n) * np.repeat([0.01, 0.05], n)
    if station.scenario.kind == "person":
        x[plant.GetJointByName("pelvis_ty").position_start()] = LIFT_M
        count = station.diagram.GetInputPort("desired_state").size()
        station.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(count))
    else:
        station.diagram.GetInputPort("platen").FixValue(context, [station.parts.contact_height + 0.005, 0.01])
    plant.SetPositionsAndVelocities(station.plant_context(context), x)
    return context


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_change_no_acceleration_and_a_drawn_station_converts(kind):
    plain, drawn = make_station(KINDS[kind]), make_station(KINDS[kind], visual=True)
    one, two = moving(plain), moving(drawn)
    rates = plain.diagram.EvalTimeDerivatives(one).CopyToVector()
    load = plain.diagram.GetOutputPort("load" if kind == "bench" else "grf").Eval(one)[-1]
    assert load > 50.0
    np.testing.assert_array_equal(drawn.diagram.EvalTimeDerivatives(two).CopyToVector(), rates)
    converted = drawn.diagram.ToAutoDiffXd()
    context = converted.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(two)
    converted.FixInputPortsFrom(drawn.diagram, two, context)
    own = [rate.value() for rate in converted.EvalTimeDerivatives(context).CopyToVector()]
    np.testing.assert_allclose(own, rates, rtol=1e-9, atol=1e-9 * np.abs(rates).max())


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


@pytest.mark.parametrize("scenario", [BENCH, PERSON], ids=["bench", "person"])
def test_meshcat_shows_every_body_where_it_is(scenario):
    meshcat = open_meshcat()
    station = make_station(scenario, meshcat=meshcat)
    for context in (station.diagram.CreateDefaultContext(), moving(station)):
        station.diagram.ForcedPublish(context)
        shown = {}
        for command in meshcat_page.commands(meshcat.StaticHtml()):
            if command["type"] == "set_transform":
                shown[command["path"]] = np.reshape(command["matrix"], (4, 4), order="F")
        seen = 0
        for index in station.plant.GetBodyIndices(station.feet["vsf"].instance):
            body = station.plant.get_body(index)
            path = f"/drake/visualizer/vsf/{body.name()}"
            if path in shown:
                pose = body.EvalPoseInWorld(station.plant_context(context)).GetAsMatrix4()
                np.testing.assert_allclose(shown[path], pose, atol=1e-6)
                seen += 1
        assert seen == len(station.feet["vsf"].keel) + 2  # frame and carriage
    station.diagram.ToAutoDiffXd()
