"""The fulcrum moves while the foot is in the air: five strides under Drake's Simulator, two
adjustments.

The fulcrum starts at its softest position, 66 mm from the keel's posterior end, and is told to go
to the stiffest, 151 mm, which takes three swings. After the fourth stance it is told to come back
by 14 mm, which one swing does. In stance the motor is off and the screw holds. With every swing the
ground meets a stiffer foot.

The shank's angle and rate tell of swing, as of an inertial sensor, and of its end before the foot
lands. With `--signal contact` the ground's force does; it enables the motor for longer, so that two
swings are enough, but tells of a touch-down only when it has come. A second of walking takes about
1.5 s of computing (implicit_euler at accuracy 1e-2, with energies within 0.5 % of those at 1e-3).
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from guided_shank import GUIDES, STANCE, STRIDE_S, GuidedShank, add_guided_shank
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.plants.foot_wiring import FulcrumDrive, add_fulcrum_drive
from vsf_drake.report.style import SHADE, colour_of, drawing, label, save_figure

START_M, FAR_M, BACK_M = 0.066, 0.151, 0.137
SAMPLE_S = 5e-3
DRIVE = (
    "fulcrum_position",
    "motor_current",
    "energy",
    "work",
    "losses",
    "position_error",
    "enabled",
    "adjustments",
    "adjustment_energy",
    "adjustment_swings",
)
FOOT = ("grf", "support_force")


def make_diagram(strides: int, signal: str) -> tuple[Diagram, GuidedShank, FulcrumDrive]:
    """Shank, foot and drive; the desired position steps to FAR_M at once and to BACK_M before the
    fourth swing."""
    builder = DiagramBuilder()
    rig = add_guided_shank(builder, load_model(resource("models/nominal.yaml")).foot, strides)
    drive = add_fulcrum_drive(builder, rig.plant, rig.wired, signal=signal, initial_m=START_M)
    steps = PiecewisePolynomial.ZeroOrderHold([0.0, 3.5 * STRIDE_S, 1e3], [[FAR_M, BACK_M, BACK_M]])
    builder.Connect(
        builder.AddSystem(TrajectorySource(steps)).get_output_port(), drive.desired_position
    )
    return builder.Build(), rig, drive


def main(out: Path, quick: bool = False, signal: str = "shank") -> dict[str, float]:
    """Walks, draws, and returns energies (J), positions (m), loads (N) and times (s)."""
    strides = 1 if quick else 5
    diagram, rig, drive = make_diagram(strides, signal)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="implicit_euler",
            accuracy=1e-2,
            max_step_size=5e-3,
            use_error_control=True,
        ),
        simulator,
    )
    root = simulator.get_mutable_context()
    start(rig, drive, root)
    times, began = np.arange(0.0, strides * STRIDE_S + 1e-9, SAMPLE_S), time.perf_counter()
    rows = []
    for t in times:
        simulator.AdvanceTo(float(t))
        rows.append(sample(rig, drive, root))
    wall_s = time.perf_counter() - began
    run = {name: np.array([row[name] for row in rows]) for name in rows[0]} | {"time": times}
    draw(out, run, strides)
    stances = [(times >= k * STRIDE_S) & (times < (k + STANCE) * STRIDE_S) for k in range(strides)]
    enabled = run["enabled"] > 0.5
    result = {
        "furthest": float(run["fulcrum_position"].max()),
        "last": float(run["fulcrum_position"][-1]),
        "load_while_enabled": float(run["grf"][enabled, 2].max(initial=0.0)),
        "moved_in_stance": float(
            max(
                np.ptp(run["fulcrum_position"][one & (times - times[one][0] > 0.05) & ~enabled])
                for one in stances
            )
        ),
        "swings": float(np.count_nonzero(np.diff(run["enabled"]) > 0.5)),
        "energy": float(run["energy"][-1]),
        "balance": float(run["energy"][-1] - run["work"][-1] - run["losses"][-1]),
        "adjustments": float(run["adjustments"][-1]),
        "real_time_factor": wall_s / float(times[-1]),
    }
    ended = np.flatnonzero(np.diff(run["adjustments"]) > 0.5) + 1
    for k, i in enumerate(ended, start=1):
        result |= {
            f"adjustment_{k}_energy": float(run["adjustment_energy"][i]),
            f"adjustment_{k}_swings": float(run["adjustment_swings"][i]),
        }
    for k, one in enumerate(stances, start=1):
        k_n_m, i = stiffness(run, one)
        result |= {
            f"position_{k}": float(run["fulcrum_position"][i]),
            f"stiffness_{k}": float(k_n_m),
        }
    return result


def start(rig: GuidedShank, drive: FulcrumDrive, root) -> None:
    """The leg where its guides want it, the foot just off the ground, the fulcrum at START_M."""
    plant, context = rig.plant, rig.plant.GetMyMutableContextFromRoot(root)
    positions, velocities = plant.GetPositions(context), plant.GetVelocities(context)
    joints = [plant.GetJointByName(name) for name in GUIDES]
    positions[[joint.position_start() for joint in joints]] = rig.desired.value(0.0)[:, 0]
    velocities[[joint.velocity_start() for joint in joints]] = rig.desired.EvalDerivative(0.0)[:, 0]
    positions[
        plant.GetJointByName(rig.foot.carriage_joint_name, rig.foot.instance).position_start()
    ] = START_M
    plant.SetPositions(context, positions)
    plant.SetVelocities(context, velocities)
    drive.SetPosition(root, START_M)


def sample(rig: GuidedShank, drive: FulcrumDrive, root) -> dict:
    """Everything that is drawn, now."""
    values = {}
    for name in DRIVE:
        port = drive.GetOutputPort(name)
        value = port.Eval(port.get_system().GetMyContextFromRoot(root))
        values[name] = value[0]
    forces = rig.wired.forces.GetMyContextFromRoot(root)
    values |= {name: np.squeeze(rig.wired.GetOutputPort(name).Eval(forces)) for name in FOOT}
    context = rig.plant.GetMyContextFromRoot(root)
    x = rig.foot.parameters.load_point_m
    body = rig.foot.keel_body_at(x)
    point = [x - rig.foot.keel_starts[body], 0.0, 0.0]
    p_FC = rig.plant.CalcPointsPositions(
        context, rig.foot.keel[body].body_frame(), point, rig.foot.frame.body_frame()
    )
    R_WF = rig.foot.frame.EvalPoseInWorld(context).rotation().matrix()
    values["deflection"] = p_FC[2, 0]
    values["load_across"] = R_WF[:, 2] @ values["grf"]
    values["lean"] = rig.plant.GetJointByName("shank_lean").get_angle(context)
    return values


def stiffness(run: dict, stance: np.ndarray) -> tuple[float, int]:
    """Load across the foot / deflection (N/m) of the keel's load point where that is deflected
    most, and when."""
    i = int(np.flatnonzero(stance)[np.argmax(run["deflection"][stance])])
    return run["load_across"][i] / run["deflection"][i], i


def draw(out: Path, run: dict, strides: int) -> None:
    """Time series one below the other, the enabled times shaded; beside them load over deflection
    of each stance."""
    t = run["time"]
    with drawing(10.0, 7.0) as figure:
        figure.set_layout_engine("constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1.7, 1.0))
        axes = left.subplots(5, 1, sharex=True)
        series = (
            ("fulcrum_position", 1e3, "fulcrum (mm)"),
            ("grf", 1.0, "vertical (N)"),
            ("lean", 57.3, "lean (deg)"),
            ("motor_current", 1.0, "current (A)"),
            ("energy", 1.0, "energy (J)"),
        )
        for axis, (name, scale, title) in zip(axes, series, strict=True):
            values = scale * (run[name][:, 2] if name == "grf" else run[name])
            axis.fill_between(
                t,
                0,
                1,
                where=run["enabled"] > 0.5,
                transform=axis.get_xaxis_transform(),
                color=SHADE,
            )
            axis.plot(t, values, color="0.1")
            label(axis, x="", y=title)
        commanded = 1e3 * (run["fulcrum_position"] + run["position_error"])
        axes[0].plot(t, commanded, ":", color="0.45", label="commanded")
        axes[0].legend(loc="lower right")
        axes[0].set_title("The motor is enabled in swing (shaded)", loc="left")
        axes[-1].set_xlabel("time (s)")
        push_off = right.subplots()
        for k in range(strides):
            stance = (t >= k * STRIDE_S) & (t < (k + STANCE) * STRIDE_S)
            k_n_m, i = stiffness(run, stance)
            rest = np.flatnonzero(stance & (t >= t[i]) & (run["grf"][:, 2] > 0.0))
            position = run["fulcrum_position"][i]
            push_off.plot(
                1e3 * run["deflection"][rest],
                run["load_across"][rest],
                color=colour_of(1e3 * position),
                label=f"stance {k + 1}: {1e3 * position:.0f} mm, {1e-3 * k_n_m:.0f} N/mm",
            )
            push_off.plot(
                1e3 * run["deflection"][i],
                run["load_across"][i],
                "o",
                color=colour_of(1e3 * position),
            )
        push_off.legend(loc="lower right")
        push_off.set_xlim(left=0.0)
        push_off.set_ylim(bottom=0.0)
        label(
            push_off,
            x="deflection of the keel's load point (mm)",
            y="load across the foot (N)",
            title="What the ground meets in push-off",
        )
        save_figure(figure, out / "fulcrum_in_swing")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one stride instead of five")
    parser.add_argument(
        "--signal",
        default="shank",
        choices=("contact", "shank", "both"),
        help="what tells of swing",
    )
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick, arguments.signal).items():
        print(f"{key:22s} {value:.6g}")
