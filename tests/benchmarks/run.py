"""Prints how fast each way of advancing is and how accurate, as one table.

    python tests/benchmarks/run.py

"Faster" is simulated time / wall time on one core, best of three, compilation excluded. Accuracy of walking is
the root mean square difference of the 40 Hz ground reaction resultants in percent of body weight, of the bench the
largest difference of the load. Nothing is asserted: times belong to the machine.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable

import numpy as np

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.simulation.reference import simulate_reference
from vsf_drake.simulation.reference_bench import simulate_bench_reference
from vsf_drake.simulation.walk import Walk, Walker

WALK_S, SIMULATOR_S, REPEATS = 1.2, 0.2, 3
EXACT_STEP_S = 6.25e-5
COLD_START = """
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.stepper import Stepper
from vsf_drake.simulation.walk import Walker
trial = load_trial(embedded_trials()[0])
walker = Walker(trial.subject, trial.model)
print(Stepper(gait_mechanism(walker.gait, walker.context)).warm_up())
"""


def main() -> None:
    """Runs everything; takes about a minute."""
    trial = load_trial(embedded_trials()[0])
    walker = Walker(trial.subject, trial.model)
    print(f"{'':44} {'simulated':>10} {'wall':>10} {'faster':>9}   accuracy")
    for name, seconds in compilation():
        print(f"{name:44} {'':>10} {seconds:>8.2f} s")
    for row in (*walking(walker, trial), *bench(trial), *simulator(walker, trial)):
        name, simulated, wall, accuracy = row
        print(f"{name:44} {simulated:>8.2f} s {wall:>8.4f} s {simulated / wall:>8.2f}x   {accuracy}")


def compilation() -> list[tuple[str, float]]:
    """Seconds until the first step, with an empty cache of compiled code and with a filled one."""
    with tempfile.TemporaryDirectory() as cache:
        def start() -> float:
            done = subprocess.run([sys.executable, "-c", COLD_START], env=os.environ | {"NUMBA_CACHE_DIR": cache},
                                  capture_output=True, text=True, check=True)
            return float(done.stdout)

        return [("compilation, first time ever", start()), ("compilation, from the cache", start())]


def best(run: Callable[[], tuple[float, object]]) -> tuple[float, object]:
    """Shortest wall time of REPEATS, and what came out."""
    return min((run() for _ in range(REPEATS)), key=lambda result: result[0])


def span(trial: Trial, length_s: float) -> dict[str, float]:
    """The last `length_s` of the trial's window, or all of it."""
    return {"fulcrum_m": trial.fulcrum_m, "start_s": max(trial.start_s, trial.end_s - length_s), "end_s": trial.end_s}


def difference(force: np.ndarray, exact: np.ndarray, trial: Trial, rate_hz: float = 1000.0) -> float:
    """RMS difference of 40 Hz resultants of (n, 3) N, in percent of body weight."""
    count = min(len(force), len(exact))
    both = [np.linalg.norm(low_pass(f[:count], rate_hz=rate_hz, cutoff_hz=40.0), axis=1) for f in (force, exact)]
    return 100 * float(np.sqrt(np.mean((both[0] - both[1]) ** 2))) / (trial.subject.mass_kg * 9.81)


def every_millisecond(walk: Walk) -> np.ndarray:
    stride = round(1e-3 / walk.step_s)
    return walk.prosthetic.grf_W[stride - 1 :: stride]


def walking(walker: Walker, trial: Trial) -> list[tuple]:
    """The whole person by the stepper."""
    options = span(trial, WALK_S)
    exact = every_millisecond(walker.walk(trial.trajectory, step_s=EXACT_STEP_S, **options))
    rows = []
    for step_s in (2e-3, 1e-3, 5e-4, 2.5e-4):
        def once(step_s: float = step_s) -> tuple[float, Walk]:
            walk = walker.walk(trial.trajectory, step_s=step_s, **options)
            return walk.wall_s, walk

        wall, walk = best(once)
        record = walk.record
        stride = max(1, round(step_s / 1e-3))
        force = walk.prosthetic.grf_W if stride > 1 else every_millisecond(walk)
        error = difference(force, exact[stride - 1 :: stride], trial, rate_hz=1e3 / stride)
        rows.append((f"person, stepper at {1e3 * step_s:g} ms", len(record.time_s) * step_s, wall,
                     f"{error:.3f} % BW from {1e3 * EXACT_STEP_S:g} ms; {record.iterations.mean():.2f} iterations "
                     f"a step, {np.count_nonzero(~record.converged)} unconverged"))
    return rows


def bench(trial: Trial) -> list[tuple]:
    """Five settings and the heel by the stepper, one setting by Simulator."""
    def once() -> tuple[float, object]:
        result = run_bench(trial.model)
        return result.wall_s, result

    wall, result = best(once)
    one = Bench(trial.model.foot)
    stroke = one.press(fulcrum_m=0.066, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    reference = simulate_bench_reference(one, fulcrum_m=0.066, travel_m=stroke.platen_m[-1], accuracy=1e-6,
                                         speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    usual = simulate_bench_reference(one, fulcrum_m=0.066, travel_m=stroke.platen_m[-1],
                                     speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    steps = np.interp(reference.platen_m, np.append(0.0, stroke.platen_m), np.append(0.0, stroke.load_n))
    return [
        ("bench, five settings and heel, stepper", result.simulated_s, wall,
         f"{np.abs(steps - reference.load_n).max():.3f} N from Simulator at accuracy 1e-6"),
        ("bench, 66 mm, Simulator radau3 1e-4", usual.time_s[-1], usual.wall_s,
         f"{np.abs(usual.load_n - reference.load_n).max():.4f} N from accuracy 1e-6")]


def simulator(walker: Walker, trial: Trial) -> list[tuple]:
    """The whole person by Drake's Simulator, over the heel strike, and the stepper beside it."""
    plate = walker.walk(trial.trajectory, **span(trial, 1e3)).prosthetic.grf_W[:, 2]
    strike = trial.start_s + 1e-3 * np.flatnonzero((plate[1:] > 20.0) & (plate[:-1] <= 20.0))[0]
    start = max(trial.start_s, strike - 0.05)
    options = {"fulcrum_m": trial.fulcrum_m, "start_s": start, "end_s": start + SIMULATOR_S}
    exact = simulate_reference(walker, trial.trajectory, accuracy=1e-5, **options).grf_W[1:]
    rows = []
    for scheme, accuracy in (("radau3", 1e-3), ("implicit_euler", 1e-2), ("velocity_implicit_euler", 1e-2)):
        run = simulate_reference(walker, trial.trajectory, integrator=scheme, accuracy=accuracy, **options)
        rows.append((f"person, Simulator {scheme} {accuracy:g}", SIMULATOR_S, run.wall_s,
                     f"{difference(run.grf_W[1:], exact, trial):.4f} % BW from radau3 1e-5; "
                     f"{1e6 * run.wall_s / run.evaluations:.0f} us an evaluation"))
    walk = walker.walk(trial.trajectory, **options)
    rows.append(("the same 0.2 s, stepper at 1 ms", SIMULATOR_S, walk.wall_s,
                 f"{difference(every_millisecond(walk), exact, trial):.4f} % BW from radau3 1e-5"))
    return rows


if __name__ == "__main__":
    main()
