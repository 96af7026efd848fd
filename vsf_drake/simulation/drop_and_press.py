"""One foot dropped under a leg, and pressed with dead loads, under Drake's own Simulator.

The leg is a mass on a damped vertical slide with the foot under it, its shank leaning so that the forefoot lands,
dropped from DROP_M. The press has the bench's load point of a foot whose mount is held.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus
from pydrake.systems.primitives import PassThrough

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import wire_foot
from vsf_drake.plants.ground_geometry import add_ground_geometry
from vsf_drake.plants.wiring import share_spatial_forces

LEG_KG, LEAN_RAD, DROP_M, RAIL_N_S_PER_M = 10.0, np.radians(15.0), 0.01, 150.0
"""Of the dropped leg without foot; its shank's lean forward; height of the lowest sphere above the ground; damping of
the slide, with which the leg is at rest at the end of the drop (choices)."""
SAMPLE_S = 1e-3
PRESS_LOADS_N, PRESS_S = (200.0, 600.0), 0.15
"""Dead loads between which stiffness is the slope, as on the bench, and the time each is left to settle."""


@dataclass(frozen=True)
class Advance:
    """A way to advance a plant: name, time step (s; 0 is continuous), scheme and accuracy of a continuous one."""

    name: str
    time_step_s: float = 0.0
    scheme: str | None = None
    accuracy: float = 1e-3
    max_step_s: float = 0.01


def make_leg(
    foot: FootParameters, contact: str, time_step_s: float, fulcrum_m: float
) -> tuple[Diagram, MultibodyPlant, FootHandles, Context]:
    """The leg above the ground, with output `grf`, and a Context in which it is about to fall.

    Raises:
        InputError: see `add_foot`.
    """
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step_s)
    plant.set_name("plant")
    size = (0.1, 0.1, 0.4)
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(LEG_KG, *size))
    slide = plant.AddJoint(PrismaticJoint(
        "height", plant.world_frame(), shank.body_frame(), [0.0, 0.0, 1.0], damping=RAIL_N_S_PER_M))
    ankle = plant.AddFrame(FixedOffsetFrame(
        "ankle", shank.body_frame(), RigidTransform(RotationMatrix.MakeYRotation(LEAN_RAD), np.zeros(3))))
    handles = add_foot(plant, ankle, foot, contact=contact, fulcrum_m=fulcrum_m)
    if contact in DRAKE_CONTACTS:
        add_ground_geometry(plant, foot=foot, contact=contact)
    plant.Finalize()
    builder.ExportOutput(wire_foot(builder, plant, handles).GetOutputPort("grf"), "grf")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    sites = handles.sites
    bottoms = [(plant.get_body(BodyIndex(int(body))).EvalPoseInWorld(own) @ point)[2] - radius
               for body, point, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)]
    slide.set_translation(own, DROP_M - min(bottoms))
    return diagram, plant, handles, context


def drop(
    foot: FootParameters, contact: str, way: Advance, fulcrum_m: float, drop_s: float, wall_limit_s: float
) -> tuple[np.ndarray, float, str]:
    """Vertical force (N) every SAMPLE_S as far as it came, wall time (s), and why it stopped early."""
    try:
        diagram, _, _, context = make_leg(foot, contact, way.time_step_s, fulcrum_m)
    except InputError as error:
        return np.zeros(0), 0.0, f"refused: {error.what}"
    force: list[float] = []
    port = diagram.GetOutputPort("grf")

    def sample(root: Context) -> None:
        force.append(float(port.Eval(root)[2]))

    wall_s, note = _advance(diagram, context, way, drop_s, wall_limit_s, sample)
    return np.array(force), wall_s, note


def press(foot: FootParameters, way: Advance, fulcrum_m: float, wall_limit_s: float = np.inf) -> np.ndarray | None:
    """(2,) rise (m) of the load point under PRESS_LOADS_N with the mount held; None if it does not get there."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, way.time_step_s)
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    handles = add_foot(plant, plant.world_frame(), foot, contact="drake_point", fulcrum_m=fulcrum_m)
    plant.Finalize()
    wire_foot(builder, plant, handles, own_ground=True)  # held, over none
    load = builder.AddSystem(PassThrough(AbstractValue.Make([ExternallyAppliedSpatialForce()])))
    share_spatial_forces(builder, plant, load.get_output_port())
    builder.ExportInput(load.get_input_port(), "load")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    piece = handles.keel_body_at(foot.load_point_m)
    force = ExternallyAppliedSpatialForce()
    force.body_index = handles.keel[piece].index()
    force.p_BoBq_B = [foot.load_point_m - handles.keel_starts[piece], 0.0, 0.0]
    heights: list[float] = []

    def height(root: Context) -> None:
        X_WB = handles.keel[piece].EvalPoseInWorld(plant.GetMyContextFromRoot(root))
        heights.append(float((X_WB @ force.p_BoBq_B)[2]))

    height(context)
    for newton in PRESS_LOADS_N:
        force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=[0.0, 0.0, newton])
        diagram.GetInputPort("load").FixValue(context, [force])
        _, note = _advance(diagram, context, way, PRESS_S, wall_limit_s, height, every_s=PRESS_S)
        if note:
            return None
    return np.array(heights[1:]) - heights[0]


def _advance(
    diagram: Diagram, context: Context, way: Advance, duration_s: float, wall_limit_s: float,
    sample: Callable[[Context], None], *, every_s: float = SAMPLE_S
) -> tuple[float, str]:
    """Advances `context` by `duration_s` with a sample every `every_s`; wall time, and why it stopped early or ""."""
    simulator = Simulator(diagram, context)
    if way.scheme:
        ApplySimulatorConfig(SimulatorConfig(
            integration_scheme=way.scheme, accuracy=way.accuracy, max_step_size=way.max_step_s), simulator)
    started, first = time.perf_counter(), context.get_time()

    def stop_when_late(root: Context) -> EventStatus | None:
        late = time.perf_counter() - started > wall_limit_s
        return EventStatus.ReachedTermination(diagram, "too slow") if late else None

    simulator.set_monitor(stop_when_late)
    try:
        simulator.Initialize()
        for i in range(round(duration_s / every_s)):
            moment = first + (i + 1) * every_s
            simulator.AdvanceTo(moment)
            if context.get_time() < moment - 1e-9:
                return time.perf_counter() - started, (
                    f"stopped after {wall_limit_s:g} s of wall time at {context.get_time():.3g} s")
            sample(context)
    except (RuntimeError, InputError) as error:
        return time.perf_counter() - started, f"fails at {context.get_time():.4g} s: {str(error)[:160]}"
    return time.perf_counter() - started, ""
