"""Where the fulcrum must stand for a wanted stiffness of the forefoot: a design variable in a
MathematicalProgram, with derivatives by AutoDiffXd.

The foot under a vertical slide, tilted toes down, is pressed on the ground by LOADS_N. Unknown are
the fulcrum's position l, and for each load the slide's height z and the keel's nine joint angles q.
At rest the keel's rates are zero and the ground bears the load; wanted is that the slide sinks by 1
mm for each WANTED_N_PER_M more, in the least squares. All of it is asked of one diagram, in which l
is an input, converted by ToAutoDiffXd.

Rates are zero at rest, and with them friction and damping: any contact law has the same rest, and
"smooth" has the derivatives that SNOPT needs.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, SpatialInertia
from pydrake.solvers import MathematicalProgram, SnoptSolver
from pydrake.systems.framework import Diagram, DiagramBuilder

import vsf_drake as vsf
from vsf_drake.report.style import drawing, label, save_figure

TILT_RAD = 0.35
LOADS_N = np.array([150.0, 300.0, 450.0, 600.0])
WANTED_N_PER_M = 20e3
MOST_ANGLE_RAD, FOAM_N_PER_M = 0.3, 1e5
"""Bound of the keel's angles, and what sinks a straight keel: where the search begins."""
FULCRUM_SIZE_M, HEIGHT_SIZE_M, ANGLE_SIZE_RAD = 0.1, 0.01, 0.01
RATE_SIZE_RAD_PER_S, LOAD_SIZE_N = 10.0, 100.0
KEEL_JOINTS = 9
SIZE = np.array([FULCRUM_SIZE_M, HEIGHT_SIZE_M, *[ANGLE_SIZE_RAD] * KEEL_JOINTS])


def make_press() -> tuple[Diagram, float]:
    """The foot under its slide, and the height (m) at which it comes to the ground. Input: the
    fulcrum's position (m from A). State: height, its rate, the keel's angles. Output: the ground
    reaction force."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    head = plant.AddRigidBody("head", SpatialInertia.SolidSphereWithMass(10.0, 0.1))
    plant.AddJoint(PrismaticJoint("slide", plant.world_frame(), head.body_frame(), [0.0, 0.0, 1.0]))
    tilted = RigidTransform(RollPitchYaw(0.0, TILT_RAD, 0.0), [0.0, 0.0, 0.0])
    end = plant.AddFrame(FixedOffsetFrame("end", head.body_frame(), tilted))
    foot = vsf.add_foot(plant, end, vsf.FootParameters(), contact="smooth", keel="massless")
    plant.Finalize()
    wired = vsf.wire_foot(builder, plant, foot)
    builder.ExportInput(wired.fulcrum_position, "fulcrum")
    builder.ExportOutput(wired.GetOutputPort("grf"), "grf")
    context = plant.CreateDefaultContext()
    bottoms = [
        (plant.get_body(body).EvalPoseInWorld(context) @ p_BS)[2] - radius
        for body, p_BS, radius in zip(
            foot.sites.body_indices, foot.sites.p_BS, foot.sites.radius, strict=True
        )
    ]
    return builder.Build(), -min(bottoms)


class Rest:
    """What is missing to rest under a load, for numbers of any kind."""

    def __init__(self) -> None:
        diagram, self.touching = make_press()
        self.diagrams = {False: diagram, True: diagram.ToAutoDiffXd()}
        self.contexts = {k: system.CreateDefaultContext() for k, system in self.diagrams.items()}

    def missing(self, load: float, variables: np.ndarray) -> np.ndarray:
        """Rates (9,) of the keel and the force beyond `load` (N), over their sizes; `variables` are
        fulcrum, way down from `touching`, and angles, over SIZE."""
        derived = variables.dtype == object
        diagram = self.diagrams[derived]
        context = self.contexts[derived]
        fulcrum, down, *angles = variables * SIZE
        diagram.GetInputPort("fulcrum").FixValue(context, [fulcrum])
        context.SetContinuousState([self.touching - down, 0.0 * down, *angles])
        rates = diagram.EvalTimeDerivatives(context).CopyToVector()[2:]
        grf = diagram.GetOutputPort("grf").Eval(context)
        return np.append(rates / RATE_SIZE_RAD_PER_S, (grf[2] - load) / LOAD_SIZE_N)


@dataclass(frozen=True)
class Pressed:
    """The `fulcrum` (m from A), how far (m) the slide has `sunk` under each of LOADS_N, the keel's
    `angles` (rad) then, and the root mean square (m) of what `sunk` is `off`."""

    fulcrum: float
    sunk: np.ndarray
    angles: np.ndarray
    off: float


def fulcrum_for(rest: Rest, least_m: float, most_m: float, start: Pressed | None = None) -> Pressed:
    """The best fulcrum position between two; the search begins at `start`, else with the keel
    straight.

    Raises:
        RuntimeError: SNOPT found no rest.
    """
    program = MathematicalProgram()
    fulcrum = program.NewContinuousVariables(1, "fulcrum")
    down = program.NewContinuousVariables(len(LOADS_N), "down")
    angles = program.NewContinuousVariables(len(LOADS_N), KEEL_JOINTS, "angle")
    program.AddBoundingBoxConstraint(least_m / FULCRUM_SIZE_M, most_m / FULCRUM_SIZE_M, fulcrum)
    most = MOST_ANGLE_RAD / ANGLE_SIZE_RAD
    program.AddBoundingBoxConstraint(-most, most, angles)
    for load, one, keel in zip(LOADS_N, down, angles, strict=True):
        program.AddConstraint(
            partial(rest.missing, load),
            np.zeros(KEEL_JOINTS + 1),
            np.zeros(KEEL_JOINTS + 1),
            np.concatenate([fulcrum, [one], keel]),
        )
    more = np.hstack([-np.ones((len(LOADS_N) - 1, 1)), np.eye(len(LOADS_N) - 1)])
    wanted = more @ LOADS_N / WANTED_N_PER_M
    program.Add2NormSquaredCost(more, wanted / HEIGHT_SIZE_M, down)
    program.SetInitialGuess(fulcrum, [0.5 * (least_m + most_m) / FULCRUM_SIZE_M])
    sunk = start.sunk if start else LOADS_N / FOAM_N_PER_M
    bent = start.angles if start else np.zeros(angles.shape)
    program.SetInitialGuess(down, sunk / HEIGHT_SIZE_M)
    program.SetInitialGuess(angles, bent / ANGLE_SIZE_RAD)
    result = SnoptSolver().Solve(program)
    if not result.is_success():
        raise RuntimeError(f"SNOPT found no rest: {result.get_solution_result()}")
    sunk = result.GetSolution(down) * HEIGHT_SIZE_M
    off = more @ sunk - wanted
    return Pressed(
        fulcrum=float(result.GetSolution(fulcrum)[0] * FULCRUM_SIZE_M),
        sunk=sunk,
        angles=result.GetSolution(angles) * ANGLE_SIZE_RAD,
        off=float(np.sqrt(np.mean(off**2))),
    )


def gradient_error(rest: Rest, fulcrum_m: float, step: float = 1e-5) -> float:
    """The largest difference of the derivatives by AutoDiffXd to those by differences, over each
    row's largest, at rest with the fulcrum there and a little beside."""
    load = LOADS_N[1]
    bent = 0.3 * np.sin(np.arange(KEEL_JOINTS))
    at = np.array([fulcrum_m / FULCRUM_SIZE_M, 1.0, *bent])
    exact = ExtractGradient(rest.missing(load, InitializeAutoDiff(at).ravel()).reshape(-1, 1))
    columns = [
        (rest.missing(load, at + step * one) - rest.missing(load, at - step * one)) / (2.0 * step)
        for one in np.eye(len(at))
    ]
    most = np.abs(exact).max(axis=1, keepdims=True)
    return float((np.abs(exact - np.array(columns).T) / most).max())


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """Finds the fulcrum, sweeps it, and draws; returns positions (m) by either way, the root mean
    square (m) that is left, the stiffness (N/m) reached, and the error of the gradients."""
    rest = Rest()
    found = fulcrum_for(rest, 0.066, 0.151)
    swept = np.linspace(0.07, 0.15, 5 if quick else 17)
    runs = [fulcrum_for(rest, place, place, found) for place in swept]
    _draw(out, found, runs)
    return {
        "fulcrum": found.fulcrum,
        "off": found.off,
        "least_swept": min(run.off for run in runs),
        "stiffness": float(np.ptp(LOADS_N) / np.ptp(found.sunk)),
        "gradient_error": gradient_error(rest, found.fulcrum),
    }


def _draw(out: Path, found: Pressed, runs: list[Pressed]) -> None:
    with drawing(8.0, 3.0) as figure:
        press, sweep = figure.subplots(1, 2)
        for run in (runs[0], found, runs[-1]):
            sunk_mm = 1e3 * (run.sunk - run.sunk[0])
            press.plot(sunk_mm, LOADS_N, "o-", label=f"fulcrum {1e3 * run.fulcrum:.0f} mm")
        more = LOADS_N - LOADS_N[0]
        press.plot(1e3 * more / WANTED_N_PER_M, LOADS_N, ":", color="0.3", label="wanted")
        press.legend()
        label(press, x="sunk since the first load (mm)", y="load (N)", title="Pressed toes down")
        sweep.plot([1e3 * run.fulcrum for run in runs], [1e3 * run.off for run in runs])
        sweep.plot(1e3 * found.fulcrum, 1e3 * found.off, "o", label="found by gradients")
        sweep.legend()
        label(sweep, x="fulcrum from A (mm)", y="off, root mean square (mm)", title="Which fulcrum")
        save_figure(figure, out / "fulcrum_by_gradient")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="5 places swept instead of 17")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:14s} {value:.6g}")
