"""A leg on its foot that learns and is controlled: the implicit stepper as one discrete system.

The leg of `models/leg.urdf` on its rail, with the springs and dampers of `leg_drop`, advances 10 ms
a period in steps of 1 ms. Three uses, each a few lines:

`LegEnvironment` has `reset` and `step` as an environment of gymnasium has them. That package is not
needed for it; to hand it to a trainer, let it inherit gymnasium.Env and name its two spaces.

`track` bends hip and knee to and fro under the leg's weight, by PD beside the torques that springs
and dampers take, held over 10 ms.

`shaken` asks Drake's MonteCarloSimulation for the ground's force while random torques shake the
leg. That puts parameters and state back to their defaults before each run, so what is random must
come from a system that declares it, as RandomSource does.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from leg_drop import BEND_RAD, DAMPING_NM_S_PER_RAD, SPRING_NM_PER_RAD, make_leg
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.analysis import MonteCarloSimulation, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Gain, RandomSource

from vsf_drake.base.errors import SimulationError
from vsf_drake.report.style import drawing, label, save_figure
from vsf_drake.simulation.stepped import SteppedPlant, make_stepped_leg

HEIGHT_M = 0.85
"""Of the hip at first, with which the leg falls some millimetres."""
GAIN, RATE_GAIN = 400.0, 5.0
"""N m/rad, N m s/rad: twice as much is unstable with a period of 10 ms."""
SHAKE_NM, SHAKEN_S = 5.0, 1.0


def make_stepped() -> SteppedPlant:
    """The leg, its hip just above where it stands."""
    diagram, plant, wired = make_leg()
    plant.GetJointByName("rail").set_default_translation(HEIGHT_M)
    return make_stepped_leg(diagram, wired)


class LegEnvironment:
    """Torques (3,) on rail, hip and knee in, [q; v] of the leg out; the reward is the hip's height
    (m)."""

    def __init__(self) -> None:
        self.stepped = make_stepped()
        self.simulator = Simulator(self.stepped)
        self.start = self.simulator.get_context().Clone()

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple:
        """Everything is as it was at first: nothing is outside the Context."""
        self.simulator.get_mutable_context().SetTimeStateAndParametersFrom(self.start)
        self.simulator.Initialize()
        self.periods = 0
        return self._observed(), {}

    def step(self, action: np.ndarray) -> tuple:
        """One period on."""
        self.stepped.GetInputPort("torques").FixValue(self.simulator.get_mutable_context(), action)
        self.periods += 1
        try:
            self.simulator.AdvanceTo(self.periods * self.stepped.period_s)
        except SimulationError:
            return self._observed(), -1.0, True, False, {}
        observed = self._observed()
        return observed, observed[0], False, False, {}

    def _observed(self) -> np.ndarray:
        return self.stepped.GetOutputPort("state").Eval(self.simulator.get_context())


class Tracker(LeafSystem):
    """PD torques on hip and knee about a path, with what the leg's springs and dampers take."""

    def __init__(self, stepped: SteppedPlant) -> None:
        super().__init__()
        names = stepped.mechanism.tree.coordinate_names
        at = [names.index(name) for name in ("hip_flexion", "knee_flexion")]
        n = len(names)
        state = self.DeclareVectorInputPort("state", 2 * n)

        def control(context: Context, torques) -> None:
            x = state.Eval(context)
            angle, rate = wanted(context.get_time())
            held = SPRING_NM_PER_RAD * (angle - BEND_RAD) + DAMPING_NM_S_PER_RAD * rate
            error = GAIN * (angle - x[:n][at]) + RATE_GAIN * (rate - x[n:][at])
            torques.SetFromVector([0.0, *(held + error)])

        self.DeclareVectorOutputPort("torques", 3, control)


def wanted(time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles (rad) and rates of hip and knee, once a second to and fro."""
    phase = 2.0 * np.pi * time_s
    sign = np.array([1.0, 2.0])
    bent = 0.15 + 0.05 * (1.0 - np.cos(phase))
    return sign * bent, sign * 0.05 * 2.0 * np.pi * np.sin(phase)


def track(duration_s: float = 2.0) -> dict[str, np.ndarray]:
    """Time (s), angles wanted and reached (rad), and the ground's force (N) at each period."""
    builder = DiagramBuilder()
    stepped = builder.AddSystem(make_stepped())
    tracker = builder.AddSystem(Tracker(stepped))
    builder.Connect(stepped.GetOutputPort("state"), tracker.GetInputPort("state"))
    builder.Connect(tracker.GetOutputPort("torques"), stepped.GetInputPort("torques"))
    simulator = Simulator(builder.Build())
    context = stepped.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    angles = dict(zip(("hip_flexion", "knee_flexion"), wanted(0.0)[0], strict=True))
    stepped.SetStart(context, {"rail": HEIGHT_M, **angles})
    simulator.Initialize()
    rows = []
    for k in range(1, round(duration_s / stepped.period_s) + 1):
        simulator.AdvanceTo(k * stepped.period_s)
        reached = stepped.GetOutputPort("state").Eval(context)[1:3]
        force = stepped.GetOutputPort("grf").Eval(context)[2]
        rows.append([k * stepped.period_s, *wanted(k * stepped.period_s)[0], *reached, force])
    time_s, *angles, force = np.array(rows).T
    return {
        "time_s": time_s,
        "wanted": np.array(angles[:2]),
        "reached": np.array(angles[2:]),
        "force": force,
    }


def make_shaken() -> tuple[Diagram, SteppedPlant]:
    """The leg with random torques on hip and knee, new ones every 10 ms."""
    builder = DiagramBuilder()
    stepped = builder.AddSystem(make_stepped())
    noise = builder.AddSystem(RandomSource(RandomDistribution.kGaussian, 3, stepped.period_s))
    gain = builder.AddSystem(Gain([0.0, SHAKE_NM, SHAKE_NM]))
    builder.Connect(noise.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), stepped.GetInputPort("torques"))
    return builder.Build(), stepped


def shaken(count: int = 50) -> np.ndarray:
    """(count,) the ground's force (N) after SHAKEN_S, of so many draws."""
    diagram, stepped = make_shaken()

    def force(system: Diagram, context: Context) -> float:
        return stepped.GetOutputPort("grf").Eval(stepped.GetMyContextFromRoot(context))[2]

    results = MonteCarloSimulation(
        make_simulator=lambda generator: Simulator(diagram),
        output=force,
        final_time=SHAKEN_S,
        num_samples=count,
        generator=RandomGenerator(8),
    )
    return np.array([result.output for result in results])


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """All three, drawn; returns what they come to, in m, rad and N."""
    environment = LegEnvironment()
    environment.reset()
    for _ in range(100):
        observed, *_ = environment.step(np.zeros(3))
    tracked = track()
    forces = shaken(10 if quick else 50)
    error = tracked["reached"] - tracked["wanted"]
    _draw(out, tracked, forces)
    return {
        "height": float(observed[0]),
        "error": float(np.abs(error[:, len(error[0]) // 2 :]).max()),
        "force": float(tracked["force"][len(error[0]) // 2 :].mean()),
        "shaken": float(forces.mean()),
        "spread": float(forces.std()),
    }


def _draw(out: Path, tracked: dict[str, np.ndarray], forces: np.ndarray) -> None:
    with drawing(8.0, 3.0) as figure:
        angles, draws = figure.subplots(1, 2)
        for name, wanted_angle, reached in zip(
            ("hip", "knee"), tracked["wanted"], tracked["reached"], strict=True
        ):
            angles.plot(tracked["time_s"], wanted_angle, ":", color="0.4")
            angles.plot(tracked["time_s"], reached, label=name)
        angles.legend()
        label(angles, x="time (s)", y="angle (rad)", title="PD every 10 ms; dotted: wanted")
        draws.hist(forces, bins=12)
        label(
            draws,
            x=f"ground's force after {SHAKEN_S:g} s (N)",
            y="draws",
            title=f"{len(forces)} draws",
        )
        save_figure(figure, out / "stepped_leg")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="10 draws instead of 50")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:8s} {value:.5g}")
