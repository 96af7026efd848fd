"""Whether the steps of Drake's discrete plants are steady with the foot's SDF.

python -m vsf_drake.engines.certificate.steady_in_drake FOLDER
"""

from __future__ import annotations

import importlib.metadata
import re
import sys
from pathlib import Path

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Role, Sphere
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.engines.certificate.steadiness import (
    DROPPED_KG,
    FALL_M,
    LAST_S,
    RAMP_S,
    STRIKE_RAD_PER_S,
    TIME_S,
    Drop,
    Held,
    write_answer,
)
from vsf_drake.plants.contact_geometry import add_ground_geometry

UPWARD = np.array([0.0, 0.0, 1.0])


def answer(folder: Path) -> None:
    """Writes steady_drake.npz, see `write_answer`."""
    write_answer(
        folder,
        "drake",
        ending="sdf",
        own_step=_own_step,
        held=_held,
        dropped=_dropped,
        version=importlib.metadata.version("drake"),
    )


def _own_step(file: Path) -> float:
    (milliseconds,) = re.findall(r"with steps of ([0-9.]+) ms", file.read_text(encoding="utf-8"))
    return 1e-3 * float(milliseconds)


def _held(asked: Held) -> np.ndarray:
    plant = MultibodyPlant(asked.step_s)
    Parser(plant).AddModels(asked.file)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("vsf_mount"))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.SetVelocities(context, np.full(len(asked.hinges), STRIKE_RAD_PER_S))
    body = plant.GetBodyByName(asked.body)
    load = ExternallyAppliedSpatialForce()
    load.body_index = body.index()
    load.p_BoBq_B = np.array([asked.x_m, 0.0, 0.0])

    def height() -> float:
        return float((body.EvalPoseInWorld(context) @ load.p_BoBq_B)[2])

    start = height()
    steps = round(TIME_S / asked.step_s)
    rises = []
    try:
        for step in range(steps):
            if step * asked.step_s <= RAMP_S:
                share = min(1.0, step * asked.step_s / RAMP_S)
                load.F_Bq_W = SpatialForce(np.zeros(3), share * asked.load_n * UPWARD)
                plant.get_applied_spatial_force_input_port().FixValue(context, Value([load]))
            simulator.AdvanceTo((step + 1) * asked.step_s)
            rises.append(height() - start)
    except RuntimeError:  # Drake's solver meets a NaN
        return np.array([np.nan])
    return np.array(rises[-round(LAST_S / asked.step_s) :])


def _dropped(file: Path, step_s: float) -> Drop:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, step_s)
    (foot,) = Parser(plant).AddModels(file)
    leg = plant.AddRigidBody("leg", foot, SpatialInertia.SolidSphereWithMass(DROPPED_KG, 0.1))
    plant.WeldFrames(leg.body_frame(), plant.GetFrameByName("vsf_mount"))
    rail = plant.AddJoint(PrismaticJoint("rail", plant.world_frame(), leg.body_frame(), UPWARD))
    add_ground_geometry(plant)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    inspector = scene_graph.model_inspector()
    lowest = min(
        (
            plant.GetBodyFromFrameId(inspector.GetFrameId(pad)).EvalPoseInWorld(context)
            @ inspector.GetPoseInFrame(pad).translation()
        )[2]
        - inspector.GetShape(pad).radius()
        for pad in inspector.GetAllGeometryIds(Role.kProximity)
        if isinstance(inspector.GetShape(pad), Sphere)
    )
    rail.set_translation(context, FALL_M - lowest)
    floor = plant.get_generalized_contact_forces_output_port(foot)
    lift = rail.velocity_start()
    states = []
    try:
        for step in range(round(TIME_S / step_s)):
            energies = plant.CalcKineticEnergy(context), plant.CalcPotentialEnergy(context)
            before = plant.GetVelocities(context)
            simulator.AdvanceTo((step + 1) * step_s)
            force = floor.Eval(context)
            work = 0.5 * step_s * force @ (before + plant.GetVelocities(context))
            states.append((*energies, work, force[lift]))
    except RuntimeError:  # Drake's solver meets a NaN
        states.append((np.nan,) * 4)
    return Drop(*np.transpose(states))


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
