"""Standing on the keel: equilibrium, linearisation by AutoDiff, LQR, and what the fulcrum changes.

Three things to know before copying this. (1) The horizontal place is neutral and no torque can
regulate it: friction is creep, so where the sole ends up depends on the impulse of friction, which
is the change of momentum. That state is left out. (2) The keel's pieces ring and die away at rates
up to 5e7 1/s. LQR acts on the slow modes only, those slower than SLOW, through their left
eigenvectors; the fast ones hear the torques and feed nothing back, so closed-loop eigenvalues are
the fast ones as they were and the slow ones as designed. (3) The gains use the keel's angles too; a
real controller would need an observer.

implicit_euler at accuracy 1e-4 takes one to two seconds of computing for one of standing, a
linearisation by AutoDiff 40 ms, an equilibrium 1 to 2 s.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.controllers import LinearQuadraticRegulator
from pydrake.systems.framework import Context
from pydrake.systems.primitives import AffineSystem, Linearize
from scipy.linalg import eig, expm
from standing_leg import StandingLeg, equilibrium, make_standing_leg

from vsf_drake.report.style import colour_of, drawing, label, name_of, save_figure

FULCRUMS_M = (0.066, 0.151)
SLOW, NEUTRAL = 90.0, 1e-4
POSTURE = ("pitch", "hip_flexion", "knee_flexion")
ANGLE_RAD, RATE_RAD_PER_S, TORQUE_NM = 0.05, 0.5, 30.0
LOCK = (2e5, 2e3)
"""Stiffness and damping (N m/rad, N m s/rad) of hip and knee that are as good as locked."""
PUSH_RAD_PER_S, STEP_S = 0.10, 0.01


def main(out: Path, quick: bool = False) -> dict:
    """Linearises, regulates and pushes the person at each fulcrum; returns numbers by fulcrum
    position."""
    found = {fulcrum_m: _stand(fulcrum_m, 1.0 if quick else 3.0) for fulcrum_m in FULCRUMS_M}
    _draw(out, found)
    return found


def _stand(fulcrum_m: float, duration_s: float) -> dict:
    leg = make_standing_leg(fulcrum_m)
    root, torque = equilibrium(leg)
    x0, forces = (
        root.get_continuous_state_vector().CopyToVector(),
        leg.wired.forces.GetMyContextFromRoot(root),
    )
    context = leg.plant.GetMyContextFromRoot(root)
    linear = Linearize(leg.diagram, root, equilibrium_check_tolerance=1e-5)
    A, B = linear.A(), linear.B()
    gain, neutral_B = slow_lqr(leg, A, B)
    at = [leg.index(name) for name in POSTURE[1:]]
    lock = np.zeros_like(gain)
    for row, i in enumerate(at):
        lock[row, i], lock[row, leg.plant.num_positions() + i] = LOCK
    push = np.zeros(len(x0))
    push[leg.plant.num_positions() + leg.index("pitch")] = PUSH_RAD_PER_S
    regulated = _respond(fulcrum_m, x0, torque, gain, push, duration_s)
    dropped = _respond(fulcrum_m, x0, torque, 0.0 * gain, push, 0.3)
    transition, predicted = expm((A - B @ gain) * STEP_S), [push]
    for _ in regulated["time"][1:]:
        predicted.append(transition @ predicted[-1])
    return {
        "leg": leg,
        "A": A,
        "B": B,
        "x0": x0,
        "gain": gain,
        "torque": torque,
        "neutral_B": neutral_B,
        "difference": central_difference(leg, root),
        "open": np.linalg.eigvals(A),
        "locked": np.linalg.eigvals(A - B @ lock),
        "closed": np.linalg.eigvals(A - B @ gain),
        "grf": leg.wired.GetOutputPort("grf").Eval(forces),
        "cop": leg.wired.GetOutputPort("cop").Eval(forces),
        "com": leg.plant.CalcCenterOfMassPositionInWorld(context),
        "outline": _outline(leg, context, forces),
        "weight": leg.plant.CalcTotalMass(context) * 9.81,
        "regulated": regulated,
        "dropped": dropped,
        "predicted": np.array(predicted) + x0,
    }


def _outline(leg: StandingLeg, context: Context, forces: Context) -> np.ndarray:
    """(n, 2) forward of the centre of pressure and up (m): trunk, hip, knee, pylon, keel."""
    frames = [leg.plant.GetFrameByName(name) for name in ("trunk", "hip", "shank", "pylon_end")]
    points = [frame.CalcPoseInWorld(context).translation() for frame in frames]
    points += [body.EvalPoseInWorld(context).translation() for body in leg.wired.foot.keel]
    return (np.array(points) - leg.wired.GetOutputPort("cop").Eval(forces))[:, [0, 2]]


def slow_lqr(leg: StandingLeg, A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, float]:
    """Gain (2, n) on the state from LQR of the slow modes, and how far torques reach the neutral
    one (1, relative)."""
    values, left, right = eig(A, left=True, right=True)
    neutral = np.abs(values) < NEUTRAL
    reach = np.abs(left[:, neutral].conj().T @ B).max() / np.abs(left[:, neutral]).max()
    slow = (np.abs(values) < SLOW) & ~neutral & (values.imag >= 0)
    pairs = [(v[:, i].real, v[:, i].imag) for v in (left, right) for i in np.flatnonzero(slow)]
    basis = [
        np.array([part for pair in half for part in pair if np.abs(part).max() > 0]).T
        for half in (pairs[: slow.sum()], pairs[slow.sum() :])
    ]
    L = basis[0] @ np.linalg.inv(basis[1].T @ basis[0])  # L' R = 1
    R = basis[1]
    count = leg.plant.num_positions()
    weight = np.zeros(2 * count)
    for name in POSTURE:
        weight[[leg.index(name), count + leg.index(name)]] = ANGLE_RAD**-2, RATE_RAD_PER_S**-2
    K, _ = LinearQuadraticRegulator(
        L.T @ A @ R, L.T @ B, R.T @ np.diag(weight) @ R, np.eye(2) / TORQUE_NM**2
    )
    return K @ L.T, float(reach)


def central_difference(leg: StandingLeg, root: Context, step: float = 1e-7) -> np.ndarray:
    """A by differences of the diagram in doubles, column by column."""
    x0, columns = root.get_continuous_state_vector().CopyToVector(), []
    for i in range(len(x0)):
        sides = []
        for sign in (1.0, -1.0):
            root.SetContinuousState(x0 + sign * step * np.eye(len(x0))[i])
            sides.append(leg.diagram.EvalTimeDerivatives(root).CopyToVector())
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    root.SetContinuousState(x0)
    return np.array(columns).T


def _respond(
    fulcrum_m: float,
    x0: np.ndarray,
    torque: np.ndarray,
    gain: np.ndarray,
    push: np.ndarray,
    duration_s: float,
) -> dict[str, np.ndarray]:
    """The nonlinear diagram from `x0` + `push`, its torques torque - gain (x - x0)."""
    n = len(x0)
    controller = AffineSystem(
        np.zeros((0, 0)), np.zeros((0, n)), np.zeros(0), np.zeros((2, 0)), -gain, torque + gain @ x0
    )
    leg = make_standing_leg(fulcrum_m, controller)
    simulator = Simulator(leg.diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="implicit_euler",
            accuracy=1e-4,
            max_step_size=5e-3,
            use_error_control=True,
        ),
        simulator,
    )
    root = simulator.get_mutable_context()
    leg.set_up(root)
    root.SetContinuousState(x0 + push)
    times, rows = np.arange(0.0, duration_s, STEP_S), []
    for t in times:
        simulator.AdvanceTo(float(t))
        rows.append(root.get_continuous_state_vector().CopyToVector())
    states = np.array(rows)
    return {"time": times, "state": states, "torque": torque - (states - x0) @ gain.T}


def _draw(out: Path, found: dict) -> None:
    with drawing(11.0, 3.2) as figure:
        body, modes, lean, torque = figure.subplots(1, 4, width_ratios=(0.8, 1.0, 1.0, 1.0))
        ticks = [(name, fulcrum_m) for name in ("open", "locked", "closed") for fulcrum_m in found]
        for fulcrum_m, run in found.items():
            colour, leg = colour_of(1e3 * fulcrum_m), run["leg"]
            body.plot(*run["outline"].T, "-", color=colour, label=name_of(1e3 * fulcrum_m))
            body.plot(run["com"][0] - run["cop"][0], run["com"][2], "o", color=colour, markersize=4)
            for name in ("open", "locked", "closed"):
                rates = run[name].real[np.abs(run[name]) < SLOW]
                modes.plot(
                    rates,
                    np.full(len(rates), ticks.index((name, fulcrum_m))),
                    "o",
                    color=colour,
                    markersize=5,
                )
            i, time_s, fall = leg.index("pitch"), run["regulated"]["time"], run["dropped"]
            for times, states, kind, what in (
                (time_s, run["regulated"]["state"], "-", "LQR"),
                (time_s, run["predicted"], ":", "LQR, linear"),
                (fall["time"], fall["state"], "--", "constant torques"),
            ):
                lean.plot(
                    times, np.degrees(states[:, i] - run["x0"][i]), kind, color=colour, label=what
                )
            for k, kind in enumerate(("-", "--")):
                torque.plot(
                    time_s,
                    run["regulated"]["torque"][:, k],
                    kind,
                    color=colour,
                    label=("hip", "knee")[k],
                )
        body.set_aspect("equal")
        body.set_xlim(-0.25, 0.25)
        body.axhline(0.0, color="0.3", linewidth=0.8)
        modes.axvline(0.0, color="0.3", linewidth=0.8)
        modes.set_xlim(-20.0, 21.0)
        modes.set_yticks(
            range(len(ticks)), [f"{name}, {1e3 * fulcrum_m:g} mm" for name, fulcrum_m in ticks]
        )
        modes.invert_yaxis()
        for axes, place in ((lean, "upper right"), (torque, (0.6, 0.55))):
            axes.legend(fontsize=7, loc=place)
        figure.legend(*body.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        label(body, x="from its pressure (m)", y="up (m)", title="At rest")
        label(modes, x="growth rate of slow modes (1/s)", y="", title="Eigenvalues' real parts")
        label(
            lean,
            x="time (s)",
            y="trunk, from rest (deg)",
            title=f"After a push of {PUSH_RAD_PER_S:g} rad/s",
        )
        label(torque, x="time (s)", y="torque (N m)", title="What it takes")
        save_figure(figure, out / "standing_lqr")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="1 s instead of 3 s")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for position, values in main(arguments.out, arguments.quick).items():
        print(
            f"fulcrum {1e3 * position:g} mm: torques {values['torque']}, centre of pressure "
            f"{values['cop'][0]:.4f} m"
        )
        for which in ("open", "locked", "closed"):
            slow = values[which][np.abs(values[which]) < SLOW]
            print(f"  {which:7s}", np.round(slow[np.argsort(-slow.real)], 3))
