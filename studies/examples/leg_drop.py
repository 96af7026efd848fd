"""A URDF leg with the foot under it, dropped on the ground: forces, energy, and where it comes to
rest.

The leg of `models/leg.urdf` (17.6 kg with the foot) hangs by its hip on a vertical rail. Springs of
300 N m/rad in hip and knee stand for its muscles, the shank is upright, the sole 30 mm above the
ground.

Integrators, for one second: velocity_implicit_euler at accuracy 1e-4 takes about 4 s of computing
and loses 1 % of the energy to its own error; at 1e-3 2 s and 2 %. radau3 loses 0.4 %, but once
needed minutes where the foot leaves the ground. Explicit runge_kutta3 needs steps of 60 ns: never
under this foot.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from foot_energy import LOSSES, foot_energy
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteSpring
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.foot_wiring import WiredFoot
from vsf_drake.report.style import drawing, label, save_figure

LEG_JOINTS = ("hip_flexion", "knee_flexion")
BEND_RAD, SPRING_NM_PER_RAD, DAMPING_NM_S_PER_RAD, DROP_M = 0.35, 300.0, 5.0, 0.03


def make_leg() -> tuple[Diagram, MultibodyPlant, WiredFoot]:
    """The leg on its rail, the foot under its pylon."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resource("models/leg.urdf")))
    plant.AddJoint(
        PrismaticJoint("rail", plant.world_frame(), plant.GetFrameByName("hip"), [0.0, 0.0, 1.0])
    )
    for name in LEG_JOINTS:
        joint = plant.GetJointByName(name)
        joint.set_default_damping(DAMPING_NM_S_PER_RAD)
        plant.AddForceElement(RevoluteSpring(joint, BEND_RAD, SPRING_NM_PER_RAD))
    foot = add_foot(
        plant, plant.GetFrameByName("pylon_end"), load_model(resource("models/nominal.yaml")).foot
    )
    plant.Finalize()
    wired = wire_foot(builder, plant, foot)
    return builder.Build(), plant, wired


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """Drops the leg, draws it, and returns forces (N), energies (J), depth (m) and times (s)."""
    diagram, plant, wired = make_leg()
    simulator = Simulator(diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="velocity_implicit_euler",
            accuracy=1e-4,
            max_step_size=1e-3,
            use_error_control=True,
        ),
        simulator,
    )
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    for name in LEG_JOINTS:
        plant.GetJointByName(name).set_angle(context, BEND_RAD)
    plant.GetJointByName(wired.foot.carriage_joint_name).set_translation(context, 0.108)
    pylon_end = plant.GetFrameByName("pylon_end").CalcPoseInWorld(context).translation()[2]
    height = wired.foot.parameters.build_height_m + DROP_M - pylon_end
    plant.GetJointByName("rail").set_translation(context, height)
    rows, started = [], time.process_time()
    simulator.set_monitor(lambda moment: rows.append(_row(moment, plant, wired)))
    simulator.AdvanceTo(1.0 if quick else 2.0)
    cpu_s = time.process_time() - started
    run = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    times = run["time"]
    losses = {name: _integral(run[name], times) for name in ("joints", *LOSSES)}
    mechanical = run["kinetic"] + run["potential"] + run["stored"]
    weight = plant.CalcTotalMass(context) * 9.81
    _draw(out, run, mechanical - mechanical[-1], losses, weight)
    return {
        "weight": weight,
        "settled": float(run["grf"][-1, 2]),
        "peak": float(run["grf"][:, 2].max()),
        "touch_down": float(times[np.argmax(run["grf"][:, 2] > 0)]),
        "impulse": float(_integral(run["grf"][:, 2], times)[-1]),
        "momentum": float(run["momentum"][-1]),
        "duration": float(times[-1]),
        "largest_depth": float(run["depth"].max()),
        "foam_force": float(run["foam_force"][-1]),
        "dropped_energy": float(mechanical[0] - mechanical[-1]),
        "unaccounted": float(np.abs(mechanical + sum(losses.values()) - mechanical[0]).max()),
        "largest_rise": float(np.diff(mechanical).max()),
        "friction_loss": float(losses["friction"][-1]),
        "foam_loss": float(losses["foam"][-1]),
        "real_time_factor": cpu_s / float(times[-1]),
    }


def _row(root: Context, plant: MultibodyPlant, wired: WiredFoot) -> dict:
    """What is kept of each step of the integrator."""
    context, forces = plant.GetMyContextFromRoot(root), wired.forces.GetMyContextFromRoot(root)
    rates = np.array([plant.GetJointByName(name).get_angular_rate(context) for name in LEG_JOINTS])
    places = [
        plant.GetFrameByName(name).CalcPoseInWorld(context).translation()
        for name in ("hip", "shank", "pylon_end")
    ]
    depth = wired.GetOutputPort("depth").Eval(forces)
    law = [wired.forces.GetParameter(forces, name) for name in ("stiffness", "exponent")]
    keel = [body.EvalPoseInWorld(context).translation() for body in wired.foot.keel]
    return {
        "time": root.get_time(),
        "grf": wired.GetOutputPort("grf").Eval(forces),
        "depth": depth.max(),
        "foam_force": np.sum(law[0] * depth ** law[1]),
        "kinetic": plant.CalcKineticEnergy(context),
        "potential": plant.CalcPotentialEnergy(context),
        "momentum": plant.CalcSpatialMomentumInWorldAboutPoint(
            context, np.zeros(3)
        ).translational()[2],
        "joints": DAMPING_NM_S_PER_RAD * np.sum(rates**2),
        "places": np.array(places + keel),
        **foot_energy(wired, plant, root),
    }


def _integral(power: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))))


def _draw(out: Path, run: dict, energy: np.ndarray, losses: dict, weight: float) -> None:
    with drawing(10.0, 3.2) as figure:
        leg, force, ledger = figure.subplots(1, 3, width_ratios=(0.7, 1.0, 1.0))
        for i, shade in ((0, 0.75), (int(np.argmax(run["grf"][:, 2])), 0.5), (-1, 0.0)):
            points = run["places"][i]
            leg.plot(
                points[:3, 0],
                points[:3, 2],
                "o-",
                color=str(shade),
                label=f"{run['time'][i]:.2f} s",
            )
            leg.plot(points[[2, 3], 0], points[[2, 3], 2], color=str(shade), linewidth=0.8)
            leg.plot(points[3:, 0], points[3:, 2], color=str(shade), linewidth=2.0)
        leg.axhline(0.0, color="0.3", linewidth=0.8)
        leg.set_aspect("equal")
        leg.set_xlim(-0.1, 0.45)
        leg.legend(loc="upper right")
        label(leg, x="forward (m)", y="up (m)", title="The leg")
        force.plot(run["time"], run["grf"][:, 2], label="vertical")
        force.plot(run["time"], run["grf"][:, 0], label="fore-aft")
        force.axhline(weight, color="0.4", linestyle=":", label=f"weight {weight:.1f} N")
        force.legend()
        label(force, x="time (s)", y="force (N)", title="Ground reaction")
        lost = np.cumsum([losses[name] for name in losses], axis=0)
        ledger.fill_between(run["time"], energy, color="0.85", label="mechanical")
        for before, after, name in zip([0.0, *lost[:-1]], lost, losses, strict=True):
            ledger.fill_between(run["time"], energy + before, energy + after, label=f"lost: {name}")
        figure.legend(*ledger.get_legend_handles_labels(), loc="outside right center")
        label(ledger, x="time (s)", y="energy above rest (J)", title="Where the energy goes")
        save_figure(figure, out / "leg_drop")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="1 s instead of 2 s")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:18s} {value:.6g}")
