"""The embedded walk that every row walks, and how two walks are compared."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.walk import Walk, Walker

WALK_S = 1.2
EXACT_STEP_S = 6.25e-5
MILLISECOND = 1e-3


@cache
def the_trial() -> Trial:
    """The first of the embedded trials, a synthetic walk."""
    return load_trial(embedded_trials("exact")[0])


@cache
def the_walker() -> Walker:
    """Its person."""
    return Walker(the_trial().subject, the_trial().model)


@cache
def stance(step_s: float) -> Walk:
    """The last WALK_S of the walk by the stepper, at steps of `step_s`."""
    return the_walker().walk(the_trial().trajectory, step_s=step_s, **span(WALK_S))


def span(length_s: float) -> dict[str, float]:
    """The last `length_s` of the trial's window, or all of it, as arguments of a walk."""
    trial = the_trial()
    return {"fulcrum_m": trial.fulcrum_m, "start_s": max(trial.start_s, trial.end_s - length_s), "end_s": trial.end_s}


def best(run: Callable[[], Any], seconds: Callable[[Any], float], repeats: int) -> Any:
    """What the quickest of `repeats` runs left."""
    return min((run() for _ in range(repeats)), key=seconds)


def sampled(force: np.ndarray, step_s: float, spacing_s: float) -> np.ndarray:
    """Of (n, ...) values at the ends of steps of `step_s` those at multiples of `spacing_s`."""
    stride = round(spacing_s / step_s)
    return force[stride - 1 :: stride]


def difference(force: np.ndarray, step_s: float, exact: np.ndarray, exact_step_s: float) -> float:
    """RMS difference of the 40 Hz resultants, in percent of body weight.

    Args:
        force, exact: (n, 3) N at the ends of steps of `step_s` and `exact_step_s`; compared each millisecond, or
            at the longer of the two steps.
    """
    spacing = max(MILLISECOND, step_s, exact_step_s)
    pair = sampled(force, step_s, spacing), sampled(exact, exact_step_s, spacing)
    count = min(len(pair[0]), len(pair[1]))
    first, second = (np.linalg.norm(low_pass(f[:count], rate_hz=1 / spacing, cutoff_hz=40.0), axis=1) for f in pair)
    return 100 * float(np.sqrt(np.mean((first - second) ** 2))) / (the_trial().subject.mass_kg * GRAVITY)
