"""The same foot in MuJoCo: is it the same foot, how far is its walk from this model's, how fast is it."""

from __future__ import annotations

import numpy as np
from table import Row
from walks import EXACT_STEP_S, best, difference, sampled, stance, the_trial, the_walker

from vsf_drake.analysis.bench_metrics import STIFFNESS_ABOVE_N
from vsf_drake.simulation.bench import run_bench

try:
    import mujoco_runs
except ModuleNotFoundError as error:
    if error.name != "mujoco":
        raise
    mujoco_runs = None

STEPS_S = (1e-3, 2.5e-4)
REPEATS = 10


def rows(quick: bool = False) -> list[Row]:
    """The quick form is the whole: it takes seconds."""
    del quick
    if mujoco_runs is None:
        return [Row("the same foot in MuJoCo", None, None, "MuJoCo is not installed: pip install 'vsf-drake[bench]'")]
    return [_bench(), *_walks()]


def _bench() -> Row:
    """All settings to the travel at which the stepper reaches its largest load."""
    model = the_trial().model
    pressed, stiffness, error = [], [], 0.0
    for setting in run_bench(model).settings:
        heel = setting.fulcrum_m is None
        press = mujoco_runs.press(model.foot, heel=heel, travel_m=setting.platen_m[-1],
                                  fulcrum_m=model.foot.fulcrum.rearmost_m if heel else setting.fulcrum_m)
        pressed.append(press)
        x = np.interp(STIFFNESS_ABOVE_N, press.load_n, press.travel_m)
        stiffness.append(1e-3 * (press.load_n[-1] - STIFFNESS_ABOVE_N) / (press.travel_m[-1] - x))
        error = max(error, np.abs(np.interp(setting.platen_m, press.travel_m, press.load_n) - setting.load_n).max())
    return Row("bench, five settings and heel, MuJoCo", sum(p.simulated_s for p in pressed),
               sum(p.wall_s for p in pressed),
               f"{', '.join(f'{k:.2f}' for k in stiffness)} N/mm; load within {error:.1f} N of the stepper's")


def _walks() -> list[Row]:
    """Only the prosthesis and its foot: the shank is led, there is no other foot and no inverse dynamics."""
    trial, walker, exact = the_trial(), the_walker(), stance(EXACT_STEP_S)
    ours = exact.prosthetic.grf_W
    converged, _ = mujoco_runs.walk(walker, trial, exact, EXACT_STEP_S)
    peak = np.linalg.norm(ours, axis=1).max()
    made = []
    for step_s in STEPS_S:
        force, wall_s = best(lambda step_s=step_s: mujoco_runs.walk(walker, trial, exact, step_s),
                             lambda run: run[1], REPEATS)
        vertical = (sampled(force, step_s, 1e-3) - sampled(ours, EXACT_STEP_S, 1e-3)[: len(force)])[:, 2]
        made.append(Row(f"prosthesis only, MuJoCo implicitfast at {1e3 * step_s:g} ms", len(force) * step_s, wall_s, (
            f"{difference(force, step_s, ours, EXACT_STEP_S):.2f} % BW from the stepper at 0.0625 ms, "
            f"{difference(force, step_s, converged, EXACT_STEP_S):.2f} from MuJoCo at 0.0625 ms; "
            f"peak {np.linalg.norm(force, axis=1).max():.0f} N of {peak:.0f} N; "
            f"vertical off by up to {np.abs(vertical).max():.0f} N")))
    return made
