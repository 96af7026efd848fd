"""Every contact under every way to advance it: what runs, how fast, how far from the fitted law.

All are held to one drop and one press. What is compared is the whole of foot, contact and
integrator, under Drake's own Simulator.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus
from pydrake.systems.primitives import PassThrough

from vsf_drake.base.errors import InputError
from vsf_drake.model.model_file import secant_stiffness, spheres_under_load
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS, REFERENCE_LOAD_N, add_ground_geometry
from vsf_drake.plants.foot import CONTACTS, add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import wire_foot
from vsf_drake.plants.wiring import share_spatial_forces

# One foot dropped under a leg, and pressed with dead loads, under Drake's own Simulator.
#
# The leg is a mass on a damped vertical slide with the foot under it, its shank leaning so that the
# forefoot lands, dropped from DROP_M. The press has the bench's load point of a foot whose mount is
# held.


LEG_KG, LEAN_RAD, DROP_M, RAIL_N_S_PER_M = 10.0, np.radians(15.0), 0.01, 150.0
"""Of the dropped leg without foot; its shank's lean forward; height of the lowest sphere above the
ground; damping of the slide, with which the leg is at rest at the end of the drop (choices)."""
SAMPLE_S = 1e-3
PRESS_LOADS_N, PRESS_S = (200.0, 600.0), 0.15
"""Dead loads between which stiffness is the slope, as on the bench, and the time each is left to
settle."""


@dataclass(frozen=True)
class Advance:
    """A way to advance a plant: name, time step (s; 0 is continuous), scheme and accuracy of a
    continuous one."""

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
    slide = plant.AddJoint(
        PrismaticJoint(
            "height",
            plant.world_frame(),
            shank.body_frame(),
            [0.0, 0.0, 1.0],
            damping=RAIL_N_S_PER_M,
        )
    )
    ankle = plant.AddFrame(
        FixedOffsetFrame(
            "ankle",
            shank.body_frame(),
            RigidTransform(RotationMatrix.MakeYRotation(LEAN_RAD), np.zeros(3)),
        )
    )
    handles = add_foot(plant, ankle, foot, contact=contact, fulcrum_m=fulcrum_m)
    if contact in DRAKE_CONTACTS:
        add_ground_geometry(plant, foot=foot, contact=contact)
    plant.Finalize()
    builder.ExportOutput(wire_foot(builder, plant, handles).GetOutputPort("grf"), "grf")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    sites = handles.sites
    bottoms = [
        (plant.get_body(BodyIndex(int(body))).EvalPoseInWorld(own) @ point)[2] - radius
        for body, point, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
    ]
    slide.set_translation(own, DROP_M - min(bottoms))
    return diagram, plant, handles, context


def drop(
    foot: FootParameters,
    contact: str,
    way: Advance,
    fulcrum_m: float,
    drop_s: float,
    wall_limit_s: float,
) -> tuple[np.ndarray, float, str]:
    """Vertical force (N) every SAMPLE_S as far as it came, wall time (s), and why it stopped
    early."""
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


def press(
    foot: FootParameters, way: Advance, fulcrum_m: float, wall_limit_s: float = np.inf
) -> np.ndarray | None:
    """(2,) rise (m) of the load point under PRESS_LOADS_N with the mount held; None if it does not
    get there."""
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
    diagram: Diagram,
    context: Context,
    way: Advance,
    duration_s: float,
    wall_limit_s: float,
    sample: Callable[[Context], None],
    *,
    every_s: float = SAMPLE_S,
) -> tuple[float, str]:
    """Advances `context` by `duration_s` with a sample every `every_s`; wall time, and why it
    stopped early or ""."""
    simulator = Simulator(diagram, context)
    if way.scheme:
        ApplySimulatorConfig(
            SimulatorConfig(
                integration_scheme=way.scheme, accuracy=way.accuracy, max_step_size=way.max_step_s
            ),
            simulator,
        )
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
                    f"stopped after {wall_limit_s:g} s of wall time at {context.get_time():.3g} s"
                )
            sample(context)
    except (RuntimeError, InputError) as error:
        return (
            time.perf_counter() - started,
            f"fails at {context.get_time():.4g} s: {str(error)[:160]}",
        )
    return time.perf_counter() - started, ""


DROP_S, LAST_S = 0.8, 0.05
"""Length of a drop, and of its end over which the settled load is averaged."""
REFERENCE = Advance("discrete 0.01 ms", time_step_s=1e-5)
"""Explicit in contact, a tenth of what is stable: the stiff integrators need hours for the paper's
law to this end."""
WAYS = (
    Advance("radau3", scheme="radau3"),
    Advance("implicit_euler", scheme="implicit_euler"),
    Advance(
        "velocity_implicit_euler", scheme="velocity_implicit_euler", accuracy=1e-4, max_step_s=1e-3
    ),
    Advance("runge_kutta3", scheme="runge_kutta3"),
    Advance("cenic, steps to 1 ms", scheme="cenic", max_step_s=1e-3),
    Advance("cenic, steps to 10 ms", scheme="cenic"),
    Advance("cenic, steps to 0.1 ms", scheme="cenic", max_step_s=1e-4),
    Advance("discrete 1 ms", time_step_s=1e-3),
    Advance("discrete 0.1 ms", time_step_s=1e-4),
    Advance("discrete 0.05 ms", time_step_s=5e-5),
)


@dataclass(frozen=True)
class Row:
    """One contact under one way to advance it; None where it does not run so far.

    Attributes:
        note: why it does not run; else "".
        simulated_s: how far the drop came.
        real_time_factor: wall time / simulated time of the drop, its samples every SAMPLE_S
            included.
        settled: mean load over the last LAST_S / weight.
        stiffness_n_per_m: of the forefoot with the foam of this contact in series, between
            PRESS_LOADS_N.
        peak_n: largest vertical force. rms_n: difference from the reference's, root of mean square
            over the drop.
    """

    contact: str
    way: str
    note: str
    simulated_s: float
    real_time_factor: float | None
    settled: float | None
    stiffness_n_per_m: float | None
    peak_n: float | None
    rms_n: float | None


@dataclass(frozen=True)
class Comparison:
    """All rows, the vertical forces (N) by (contact, way) over `time_s`, and what they are held
    against."""

    rows: tuple[Row, ...]
    time_s: np.ndarray
    force_n: dict[tuple[str, str], np.ndarray]
    reference_n: np.ndarray
    reference_name: str
    weight_n: float
    fulcrum_m: float


def compare_contacts(
    foot: FootParameters,
    *,
    contacts: Sequence[str] = CONTACTS,
    ways: Sequence[Advance] = WAYS,
    reference: Advance = REFERENCE,
    fulcrum_m: float = 0.108,
    drop_s: float = DROP_S,
    wall_limit_s: float = 60.0,
    progress: Callable[[str], None] | None = None,
) -> Comparison:
    """Drops the leg and presses the foot, for each of `contacts` under each of `ways`.

    Args:
        reference: how the paper's law is advanced that all forces are held against, without a limit
            of wall time.
        wall_limit_s: a drop or press that takes longer is stopped, and its row says how far it
            came.
        progress: called with what is done next.

    Raises:
        InputError: the reference does not run, or the carriage cannot reach `fulcrum_m`.
    """
    tell = progress or (lambda text: None)
    tell(f"reference: kelvin_voigt, {reference.name}")
    samples = round(drop_s / SAMPLE_S)
    fitted, _, note = drop(foot, "kelvin_voigt", reference, fulcrum_m, drop_s, np.inf)
    if len(fitted) < samples:
        raise InputError(f"the reference does not run: {note}", where="foot")
    rises = {}
    for way in ways:
        tell(f"press: {way.name}")
        rises[way.name] = press(foot, way, fulcrum_m, wall_limit_s)
    rows, forces = [], {}
    for contact in contacts:
        for way in ways:
            tell(f"drop: {contact}, {way.name}")
            force, wall_s, note = drop(foot, contact, way, fulcrum_m, drop_s, wall_limit_s)
            forces[contact, way.name] = force
            rows.append(_row(foot, contact, way, rises[way.name], force, wall_s, note, fitted))
    return Comparison(
        rows=tuple(rows),
        time_s=SAMPLE_S * np.arange(1, samples + 1),
        force_n=forces,
        reference_n=fitted,
        reference_name=reference.name,
        weight_n=(LEG_KG + foot.mass_kg) * GRAVITY,
        fulcrum_m=fulcrum_m,
    )


def foam_stiffness(foot: FootParameters, contact: str) -> float:
    """Secant stiffness (N/m) between PRESS_LOADS_N of the foam under the bench's load, as `contact`
    has it.

    Of our laws and the bench itself: `series_stiffness_n_per_m`. Of Drake's: the spheres or pads in
    the patch of `series_patch_m`, which are equally stiff.
    """
    if contact not in DRAKE_CONTACTS:
        depth = (np.array(PRESS_LOADS_N) / foot.series_stiffness_n_per_m) ** (
            1.0 / foot.series_exponent
        )
        return float(np.diff(PRESS_LOADS_N)[0] / np.diff(depth)[0])
    return sum(
        secant_stiffness(zone.stiffness, zone.exponent, REFERENCE_LOAD_N)
        for zone, _ in spheres_under_load(foot)
    )


def _row(
    foot: FootParameters,
    contact: str,
    way: Advance,
    rise: np.ndarray | None,
    force: np.ndarray,
    wall_s: float,
    note: str,
    reference: np.ndarray,
) -> Row:
    whole, refused = len(force) == len(reference), note.startswith("refused")
    if whole and not np.all(np.isfinite(force)):
        whole, note = False, "gives forces that are not finite"
    weight = (LEG_KG + foot.mass_kg) * GRAVITY
    stiffness = None
    if rise is not None and not refused:
        slope = (PRESS_LOADS_N[1] - PRESS_LOADS_N[0]) / (rise[1] - rise[0])
        stiffness = float(1.0 / (1.0 / slope + 1.0 / foam_stiffness(foot, contact)))
    simulated = SAMPLE_S * len(force)
    return Row(
        contact=contact,
        way=way.name,
        note=note,
        simulated_s=simulated,
        real_time_factor=wall_s / simulated if simulated else None,
        settled=float(np.mean(force[-round(LAST_S / SAMPLE_S) :]) / weight) if whole else None,
        stiffness_n_per_m=stiffness,
        peak_n=float(np.max(force)) if whole else None,
        rms_n=float(np.sqrt(np.mean((force - reference) ** 2))) if whole else None,
    )
