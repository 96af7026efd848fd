"""A biped on two feet of different stiffness: dropped 5 mm, it lands and stands.

Two legs of `models/leg.urdf` under a pelvis that floats freely, with springs and dampers in hips
and knees. The left foot's fulcrum is at 66 mm, the right one's at 151 mm, so that the left forefoot
is a third as stiff. The biped rocks from one foot to the other; together they carry the weight, and
their common centre of pressure is on average under the centre of mass. Drake's own renderer draws
the picture from the shapes that `add_foot` gives a foot in a plant with a SceneGraph.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import RevoluteSpring, SpatialInertia, WeldJoint
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.sensors import CameraInfo
from scipy.integrate import trapezoid

import vsf_drake as vsf
from vsf_drake.plants.foot_visuals import METAL, draw
from vsf_drake.plants.visuals import draw_ground
from vsf_drake.report.style import drawing, label, save_figure

FULCRUM_M = {"left": 0.066, "right": 0.151}
HALF_WIDTH_M, PELVIS_KG, DROP_M = 0.10, 20.0, 0.005
ROCKING_S = 0.63  # one period, side to side
PELVIS_SIZE_M = (0.16, 0.30, 0.12)
SPRING_NM_PER_RAD, DAMPING_NM_S_PER_RAD = 2000.0, 60.0


def make_biped() -> tuple[Diagram, MultibodyPlant, SceneGraph, dict[str, vsf.WiredFoot]]:
    """The biped with its feet, by side."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    pelvis = plant.AddRigidBody(
        "pelvis",
        plant.AddModelInstance("biped"),
        SpatialInertia.SolidBoxWithMass(PELVIS_KG, *PELVIS_SIZE_M),
    )
    draw(plant, pelvis, "pelvis", Box(*PELVIS_SIZE_M), METAL)
    feet = {}
    for side, y in (("left", HALF_WIDTH_M), ("right", -HALF_WIDTH_M)):
        (leg,) = Parser(plant, side).AddModels(str(vsf.resource("models/leg.urdf")))
        hip = plant.GetFrameByName("hip", leg)
        plant.AddJoint(
            WeldJoint(f"{side}_hip", pelvis.body_frame(), hip, RigidTransform([0.0, y, 0.0]))
        )
        for name in ("hip_flexion", "knee_flexion"):
            joint = plant.GetJointByName(name, leg)
            joint.set_default_damping(DAMPING_NM_S_PER_RAD)
            plant.AddForceElement(RevoluteSpring(joint, 0.0, SPRING_NM_PER_RAD))
        feet[side] = vsf.add_foot(
            plant,
            plant.GetFrameByName("pylon_end", leg),
            vsf.FootParameters(),
            name=f"{side}_foot",
            fulcrum_m=FULCRUM_M[side],
        )
    draw_ground(plant, None)
    plant.Finalize()
    wired = {side: vsf.wire_foot(builder, plant, foot) for side, foot in feet.items()}
    return builder.Build(), plant, scene_graph, wired


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """Drops the biped, draws it, and returns forces (N), places (m) and times (s)."""
    diagram, plant, scene_graph, wired = make_biped()
    sun = {"type": "directional", "frame": "world", "attenuation_values": [1.0, 0.0, 0.0]}
    renderer = RenderEngineVtkParams(
        default_clear_color=[1.0, 1.0, 1.0],
        lights=[
            LightParameter(direction=[0.3, 0.5, -1.0], intensity=0.9, **sun),
            LightParameter(direction=[-0.6, 0.8, -0.3], intensity=0.6, **sun),
        ],
        cast_shadows=True,
        shadow_map_size=2048,
    )
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(renderer))
    simulator = Simulator(diagram)
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme="implicit_euler", accuracy=1e-3, max_step_size=2e-3),
        simulator,
    )
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    foot = wired["left"].foot
    mount = foot.mount.CalcPoseInWorld(context).translation()[2]
    plant.SetFreeBodyPose(
        context,
        plant.GetBodyByName("pelvis"),
        RigidTransform([0.0, 0.0, foot.parameters.build_height_m + DROP_M - mount]),
    )
    rows = []
    started = time.process_time()
    simulator.set_monitor(lambda moment: rows.append(_row(moment, plant, wired)))
    simulator.AdvanceTo(0.045)
    pictures = [
        picture(scene_graph, root, eye=(1.1, -1.7, 0.8), at=(0.0, 0.0, 0.44), size=(400, 600)),
        picture(scene_graph, root, eye=(0.62, -0.66, 0.2), at=(0.04, 0.0, 0.05), size=(640, 600)),
    ]
    simulator.AdvanceTo(1.0 if quick else 2.0)
    cpu_s = time.process_time() - started
    run = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    times = run["time"]
    forces = {side: run[side] for side in wired}
    weight = plant.CalcTotalMass(context) * 9.81
    _draw(out, times, forces, pictures, weight)
    last = times > times[-1] - ROCKING_S
    off = trapezoid(run["off"][last], times[last], axis=0) / np.ptp(times[last])
    return {
        "weight": weight,
        "settled": float(sum(force[-1, 2] for force in forces.values())),
        **{f"{side}_peak": float(force[:, 2].max()) for side, force in forces.items()},
        "off_forward": float(off[0]),
        "off_sideways": float(off[1]),
        "real_time_factor": cpu_s / float(times[-1]),
    }


def picture(
    scene_graph: SceneGraph,
    root: Context,
    *,
    eye: tuple[float, float, float],
    at: tuple[float, float, float],
    size: tuple[int, int],
) -> np.ndarray:
    """(height, width, 3) bytes: what a camera at `eye` that looks at `at` (m in W) sees."""
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    R_WC = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
    camera = ColorRenderCamera(
        RenderCameraCore("vtk", CameraInfo(*size, 0.6), ClippingRange(0.01, 20.0), RigidTransform())
    )
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))
    seen = query.RenderColorImage(
        camera, scene_graph.world_frame_id(), RigidTransform(R_WC, np.array(eye))
    )
    return np.array(seen.data)[:, :, :3]


def _output(foot: vsf.WiredFoot, root: Context, name: str) -> np.ndarray:
    return foot.GetOutputPort(name).Eval(foot.forces.GetMyContextFromRoot(root))


def _row(root: Context, plant: MultibodyPlant, wired: dict[str, vsf.WiredFoot]) -> dict:
    """What is kept of each step of the integrator: forces, and how far the common centre of
    pressure is from under the centre of mass."""
    grf = {side: _output(foot, root, "grf") for side, foot in wired.items()}
    pressed = sum(grf[side][2] * _output(foot, root, "cop") for side, foot in wired.items())
    load = max(sum(force[2] for force in grf.values()), 1.0)
    mass = plant.CalcCenterOfMassPositionInWorld(plant.GetMyContextFromRoot(root))
    return {"time": root.get_time(), **grf, "off": pressed / load - mass}


def _draw(
    out: Path, times: np.ndarray, forces: dict, pictures: list[np.ndarray], weight: float
) -> None:
    with drawing(10.0, 3.6) as figure:
        whole, feet, force = figure.subplots(1, 3, width_ratios=(0.7, 1.07, 1.2))
        for axes, seen in ((whole, pictures[0]), (feet, pictures[1])):
            axes.imshow(seen)
            axes.set_axis_off()
        for side, values in forces.items():
            force.plot(times, values[:, 2], label=f"{side}, {1e3 * FULCRUM_M[side]:.0f} mm")
        force.plot(times, sum(forces.values())[:, 2], color="0.6", zorder=0, label="both")
        force.axhline(weight, color="0.4", linestyle=":", label=f"weight {weight:.0f} N")
        force.legend()
        label(force, x="time (s)", y="vertical force (N)", title="Ground reaction")
        save_figure(figure, out / "biped")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="1 s instead of 2 s")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:18s} {value:.6g}")
