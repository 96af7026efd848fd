"""How often does the foot slip on ground of uncertain friction? One diagram, a Context for each
draw.

The foot stands flat under a load of 40 kg that slides forward and up without turning, and is pulled
forward with a quarter of its weight. Static friction is drawn from a normal distribution, 0.30 with
a standard deviation of 0.08 and never below 0.05; kinetic friction is 0.6 of it (choices, no survey
of floors). Nothing is built anew: each draw sets two parameters in a copy of the settled Context,
so that draws repeat with the seed and can run side by side.

Drake's MonteCarloSimulation is of no use here: it sets a random Context after its simulator is
made, and this puts parameters without a declared distribution back to their defaults.

Closed form. With all spheres at one speed v friction is mu(v) times the load, mu(v) = mu_static v /
v_th up to v_th: the foot creeps at the speed where that is the pull, or slips for good if the pull
exceeds mu_static times the load. The way follows from dv/dt = g (pull - mu(v)), one equation for
what Drake solves with twelve coordinates. "Sticking" is creep in the paper's law: 14 to 26 mm in
0.3 s here, at up to v_th = 0.1 m/s.

implicit_euler at accuracy 1e-3 runs five times faster than real time, since the sliding foot hardly
bends.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from scipy.integrate import solve_ivp
from scipy.stats import binomtest, norm

from vsf_drake.base.files import resource
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.stick_slip import per_speed
from vsf_drake.model.model_file import load_model
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.plants.foot_wiring import WiredFoot
from vsf_drake.report.style import drawing, label, save_figure

LOAD_KG, PULL, MU_MEAN, MU_DEVIATION, MU_LEAST, KINETIC_SHARE = 40.0, 0.25, 0.30, 0.08, 0.05, 0.6
DURATION_S, SEED = 0.3, 8


def make_sled() -> tuple[Diagram, MultibodyPlant, WiredFoot]:
    """The load on two slides, pulled by an actuator of the plant, the foot under it."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    middle = plant.AddRigidBody("middle", SpatialInertia.Zero())
    load = plant.AddRigidBody("load", SpatialInertia.SolidBoxWithMass(LOAD_KG, 0.2, 0.2, 0.2))
    forward = plant.AddJoint(
        PrismaticJoint("forward", plant.world_frame(), middle.body_frame(), [1.0, 0.0, 0.0])
    )
    plant.AddJoint(PrismaticJoint("up", middle.body_frame(), load.body_frame(), [0.0, 0.0, 1.0]))
    plant.AddJointActuator("pull", forward)
    foot = add_foot(plant, load.body_frame(), load_model(resource("models/nominal.yaml")).foot)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot)
    return builder.Build(), plant, wired


def main(out: Path, quick: bool = False) -> dict:
    """Draws, slides, compares; returns what the closed form is compared with, arrays in the order
    of the draws."""
    diagram, plant, wired = make_sled()
    settled, weight = _settled(diagram, plant, wired)
    count, random = (24 if quick else 200), np.random.default_rng(SEED)
    mu = np.maximum(random.normal(MU_MEAN, MU_DEVIATION, count), MU_LEAST)
    started = time.process_time()
    rows = np.array([_slide(diagram, plant, wired, settled, weight, value) for value in mu])
    cpu_s = time.process_time() - started
    limit = wired.foot.parameters.friction.threshold_velocity_m_per_s
    speed, distance, ratio = rows.T
    slips = speed > limit
    expected = np.array([_expected_distance(value, limit) for value in mu])
    low, high = binomtest(int(slips.sum()), count).proportion_ci(method="wilson")
    probability = float(norm.cdf((PULL - MU_MEAN) / MU_DEVIATION))
    found = {
        "mu_static": mu,
        "slips": slips,
        "speed": speed,
        "distance": distance,
        "expected_distance": expected,
        "ratio": ratio,
        "fraction": float(slips.mean()),
        "fraction_low": low,
        "fraction_high": high,
        "probability": probability,
        "weight": weight,
        "real_time_factor": cpu_s / (count * DURATION_S),
    }
    _draw(out, found)
    return found


def _simulator(diagram: Diagram, context: Context) -> Simulator:
    simulator = Simulator(diagram, context)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme="implicit_euler",
            accuracy=1e-3,
            max_step_size=5e-3,
            use_error_control=True,
        ),
        simulator,
    )
    return simulator


def _settled(diagram: Diagram, plant: MultibodyPlant, wired: WiredFoot) -> tuple[Context, float]:
    """A Context in which the foot stands, and the weight on it (N)."""
    root = diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    plant.get_actuation_input_port().FixValue(context, [0.0])
    plant.GetJointByName("up").set_translation(context, wired.foot.parameters.build_height_m)
    plant.GetJointByName(wired.foot.carriage_joint_name).set_translation(context, 0.108)
    _simulator(diagram, root).AdvanceTo(1.0)
    plant.SetVelocities(context, np.zeros(plant.num_velocities()))
    root.SetTime(0.0)
    return root, plant.CalcTotalMass(context) * 9.81


def _slide(
    diagram: Diagram,
    plant: MultibodyPlant,
    wired: WiredFoot,
    settled: Context,
    weight: float,
    mu: float,
) -> tuple[float, float, float]:
    """Speed (m/s), distance (m) and force forward over force up after DURATION_S of pull."""
    root = settled.Clone()
    context, forces = (
        plant.GetMyMutableContextFromRoot(root),
        wired.forces.GetMyMutableContextFromRoot(root),
    )
    wired.forces.SetParameters(forces, mu_static=mu, mu_kinetic=KINETIC_SHARE * mu)
    plant.get_actuation_input_port().FixValue(context, [PULL * weight])
    forward = plant.GetJointByName("forward")
    start = forward.get_translation(context)
    _simulator(diagram, root).AdvanceTo(DURATION_S)
    grf = wired.GetOutputPort("grf").Eval(forces)
    return (
        forward.get_translation_rate(context),
        forward.get_translation(context) - start,
        -grf[0] / grf[2],
    )


def _expected_distance(mu: float, limit: float) -> float:
    law = LawConstants(mu_static=mu, mu_kinetic=KINETIC_SHARE * mu, threshold_velocity=limit)

    def rates(_, y):
        speed = y[1]
        return [speed, 9.81 * (PULL - per_speed(speed, law)[0] * speed)]

    return float(
        solve_ivp(rates, (0.0, DURATION_S), [0.0, 0.0], rtol=1e-8, atol=1e-10, max_step=2e-3).y[
            0, -1
        ]
    )


def _draw(out: Path, found: dict) -> None:
    with drawing(8.0, 3.2) as figure:
        distances, ratios = figure.subplots(1, 2)
        order = np.argsort(found["mu_static"])
        mu, slips = found["mu_static"][order], found["slips"][order]
        distances.plot(
            mu, 1e3 * found["expected_distance"][order], color="0.5", label="one equation"
        )
        for axes, values in (
            (distances, 1e3 * found["distance"][order]),
            (ratios, found["ratio"][order]),
        ):
            axes.plot(mu[~slips], values[~slips], "o", markersize=4, label="creeps")
            axes.plot(mu[slips], values[slips], "x", markersize=5, label="slips")
            axes.axvline(PULL, color="0.4", linestyle=":", label="pull / weight")
        ratios.plot(
            mu, np.where(mu < PULL, KINETIC_SHARE * mu, PULL), color="0.5", label="closed form"
        )
        for axes in (distances, ratios):
            axes.legend()
        label(
            distances,
            x="static friction (1)",
            y=f"way in {DURATION_S:g} s (mm)",
            title=(
                f"{len(mu)} draws: {found['fraction']:.0%} slip, interval "
                f"{found['fraction_low']:.0%} to {found['fraction_high']:.0%}"
            ),
        )
        label(
            ratios,
            x="static friction (1)",
            y="friction / load at the end (1)",
            title=f"the distribution says {found['probability']:.0%}",
        )
        save_figure(figure, out / "friction_monte_carlo")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="24 draws instead of 200")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:18s} {value}")
