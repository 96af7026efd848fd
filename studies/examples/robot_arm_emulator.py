"""A robot arm tests the foot: it rolls the foot from heel to toe along a prescribed path, at two
fulcrum settings.

The path comes from the roll-over machine: the shank turns from 15 degrees back to 30 degrees
forward in 0.7 s, at such heights that a foot at 108 mm bears two humps of 550 N along the shank.
The arm of `arm.urdf` follows it by inverse dynamics, its joints' errors critically damped at 15 Hz;
nothing tells it of the load, so it yields by up to a millimetre and the stiff heel bears 470 N
instead: look at the tracking error before believing a stiffness. Work is that of force and moment
in the mount.

velocity_implicit_euler takes 3 to 4 s of computing for a second at accuracy 1e-3, 5 to 6 s at 1e-4;
the peak force then changes by 0.05 %.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from foot_energy import LOSSES, foot_energy
from matplotlib.axes import Axes
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context
from robot_arm import ArmWithFoot, make_arm
from scipy.interpolate import PchipInterpolator

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.report.style import colour_of, drawing, label, name_of, save_figure
from vsf_drake.simulation.roll_over import RollOver

FULCRUMS_M, DESIGN_M = (0.066, 0.108), 0.108
DURATION_S, TILT_DEG = 0.7, (-15.0, 30.0)
HUMPS = ((0.0, 0.22, 0.5, 0.77, 1.0), (0.0, 550.0, 420.0, 550.0, 0.0))
KNOT_S, COP_N = 0.02, 50.0


def main(out: Path, quick: bool = False) -> dict:
    """Tests the foot; returns by fulcrum position what its test asserts and the picture shows."""
    parameters = load_model(resource("models/nominal.yaml")).foot
    machine = RollOver(parameters, friction=True)
    times = np.linspace(0.0, DURATION_S, 701)
    tilt = np.radians(np.interp(times, (0.0, DURATION_S), TILT_DEG))
    force = PchipInterpolator(*HUMPS)(times / DURATION_S)
    designed, _ = machine.roll(fulcrum_m=DESIGN_M, time_s=times, tilt_rad=tilt, force_n=force)
    at = np.arange(0.0, DURATION_S + 1e-9, KNOT_S)
    path = np.column_stack([np.interp(at, designed.time_s, column) for column in designed.mount.T])
    found = {}
    for fulcrum_m in FULCRUMS_M:
        run = _test(make_arm(parameters, at, path, fulcrum_m), 1e-3 if quick else 1e-4)
        again = np.arange(0.0, run["time"][-1], 1e-3)
        mount = np.column_stack(
            [np.interp(again, run["time"], column) for column in run["mount"].T]
        )
        run["stepper"] = machine.follow(fulcrum_m=fulcrum_m, time_s=again, mount=mount)
        found[fulcrum_m] = run
    _draw(out, found)
    return found


def _test(arm: ArmWithFoot, accuracy: float) -> dict:
    simulator = Simulator(arm.diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="velocity_implicit_euler",
            accuracy=accuracy,
            max_step_size=1e-3,
            use_error_control=True,
        ),
        simulator,
    )
    root = simulator.get_mutable_context()
    context = arm.plant.GetMyMutableContextFromRoot(root)
    arm.plant.SetPositions(context, arm.arm, arm.joints.value(0.0).ravel())
    arm.plant.SetVelocities(context, arm.arm, arm.joints.derivative().value(0.0).ravel())
    slide = arm.plant.GetJointByName(arm.wired.foot.carriage_joint_name)
    slide.set_translation(
        context,
        float(
            arm.wired.forces.GetParameter(arm.wired.forces.GetMyContextFromRoot(root), "fulcrum_m")
        ),
    )
    rows, started = [], time.process_time()
    simulator.set_monitor(lambda moment: rows.append(_row(moment, arm)))
    simulator.AdvanceTo(DURATION_S)
    cpu_s = time.process_time() - started
    run = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    run["error"] = _errors(arm, run)
    work = _integral(run["power"], run["time"])
    energy = run["stored"] + run["mechanical"] - run["stored"][0] - run["mechanical"][0]
    lost = {name: _integral(run[name], run["time"]) for name in LOSSES}
    loaded = run["grf"][:, 2] > COP_N
    return {
        **run,
        "work": work,
        "lost": lost,
        "loaded": loaded,
        "arm": arm,
        "stored_j": float(work.max()),
        "returned_j": float(work.max() - work[np.argmax(work) :].min()),
        "peak": float(run["grf"][:, 2].max()),
        "unaccounted_j": float(np.abs(work - energy - sum(lost.values())).max()),
        "tracking_mm": 1e3 * float(np.abs(run["error"][:, :2]).max()),
        "tracking_deg": float(np.degrees(np.abs(run["error"][:, 2]).max())),
        "real_time_factor": cpu_s / DURATION_S,
    }


def _row(root: Context, arm: ArmWithFoot) -> dict:
    """What is kept of each step of the integrator."""
    plant, foot = arm.plant, arm.wired.foot
    context, forces = plant.GetMyContextFromRoot(root), arm.wired.forces.GetMyContextFromRoot(root)
    weld = plant.GetJointByName(f"{foot.name}_mount_weld", foot.instance)
    # on the foot, at M, in M
    reaction = plant.get_reaction_forces_output_port().Eval(context)[int(weld.index())]
    R_WM, V_WM = (
        foot.mount.CalcPoseInWorld(context).rotation(),
        foot.mount.CalcSpatialVelocityInWorld(context),
    )
    power = (
        R_WM.multiply(reaction.translational()) @ V_WM.translational()
        + R_WM.multiply(reaction.rotational()) @ V_WM.rotational()
    )
    mass, place = (
        foot.parameters.mass_kg,
        plant.CalcCenterOfMassPositionInWorld(context, [foot.instance]),
    )
    momentum = plant.CalcSpatialMomentumInWorldAboutPoint(
        context, [foot.instance], place
    ).translational()
    return {
        "time": root.get_time(),
        "state": plant.GetPositionsAndVelocities(context),
        "mount": _mount(arm, context),
        "power": power,
        "grf": arm.wired.GetOutputPort("grf").Eval(forces),
        "cop": arm.wired.GetOutputPort("cop").Eval(forces),
        "mechanical": 0.5 * momentum @ momentum / mass + 9.81 * mass * place[2],
        **foot_energy(arm.wired, plant, root),
    }


def _mount(arm: ArmWithFoot, context: Context) -> np.ndarray:
    """Forward, up (m) and toes up (rad) of the foot's mount."""
    X_WM = arm.wired.foot.mount.CalcPoseInWorld(context)
    x_M = X_WM.rotation().matrix()[:, 0]
    return np.array([*X_WM.translation()[[0, 2]], np.arctan2(x_M[2], x_M[0])])


def _errors(arm: ArmWithFoot, run: dict) -> np.ndarray:
    """(n, 3) of the mount: where it was less where it should have been."""
    context, wanted = arm.plant.CreateDefaultContext(), []
    for moment in run["time"]:
        arm.plant.SetPositions(context, arm.arm, arm.joints.value(moment).ravel())
        wanted.append(_mount(arm, context))
    return run["mount"] - np.array(wanted)


def _integral(power: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))))


def _draw(out: Path, found: dict) -> None:
    with drawing(10.5, 5.2) as figure:
        axes = figure.subplot_mosaic(
            [["arm", "force", "pressure"], ["arm", "work", "error"]], width_ratios=(0.8, 1, 1)
        )
        arm, force, pressure, work, error = (
            axes[name] for name in ("arm", "force", "pressure", "work", "error")
        )
        _draw_arm(arm, next(iter(found.values())))
        for fulcrum_m, run in found.items():
            colour, t, loaded = colour_of(1e3 * fulcrum_m), run["time"], run["loaded"]
            force.plot(t, run["grf"][:, 2], color=colour, label=name_of(1e3 * fulcrum_m))
            force.plot(t, run["grf"][:, 0], color=colour, linewidth=0.9)
            force.plot(
                run["stepper"].time_s, run["stepper"].grf_W[:, 2], ":", color="0.85", linewidth=1.2
            )
            pressure.plot(t[loaded], 1e3 * run["cop"][loaded, 0], color=colour)
            work.plot(t, run["work"], color=colour)
            work.plot(t, run["stored"], "--", color=colour)
            error.plot(t, 1e3 * run["error"][:, 1], color=colour)
            error.plot(t, np.degrees(run["error"][:, 2]), "--", color=colour)
        figure.legend(*force.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        label(
            force,
            x="time (s)",
            y="force (N)",
            title="Vertical, fore-aft (thin), implicit stepper (dots)",
        )
        label(pressure, x="time (s)", y="forward (mm)", title="Centre of pressure, heel to toe")
        label(work, x="time (s)", y="energy (J)", title="Work put in; held by springs (dashed)")
        label(
            error, x="time (s)", y="error (mm, deg)", title="The arm yields: up; toes up (dashed)"
        )
        save_figure(figure, out / "robot_arm_emulator")


def _draw_arm(axes: Axes, run: dict) -> None:
    plant, foot = run["arm"].plant, run["arm"].wired.foot
    context = plant.CreateDefaultContext()
    frames = [plant.GetFrameByName(name) for name in ("base", "upper", "forearm", "wrist", "tool")]
    for share, shade in ((0.05, 0.75), (0.45, 0.5), (0.85, 0.0)):
        plant.SetPositionsAndVelocities(
            context, run["state"][np.searchsorted(run["time"], share * DURATION_S)]
        )
        lines = [
            [frame.CalcPoseInWorld(context).translation() for frame in frames],
            [body.EvalPoseInWorld(context).translation() for body in (foot.frame, *foot.keel)],
        ]
        for line, kind in zip(lines, ("o-", "-"), strict=True):
            axes.plot(np.array(line)[:, 0], np.array(line)[:, 2], kind, color=str(shade))
        ends = np.array([lines[0][-1], lines[1][0]])
        axes.plot(
            ends[:, 0],
            ends[:, 2],
            color=str(shade),
            linewidth=0.8,
            label=f"{share * DURATION_S:.2f} s",
        )
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.set_aspect("equal")
    axes.legend()
    label(axes, x="forward (m)", y="up (m)", title="The arm and the foot")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="accuracy 1e-3 instead of 1e-4")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for position, values in main(arguments.out, arguments.quick).items():
        print(
            f"fulcrum {1e3 * position:g} mm: "
            + ", ".join(
                f"{name} {value:.4g}" for name, value in values.items() if isinstance(value, float)
            )
        )
