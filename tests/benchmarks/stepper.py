"""The implicit stepper: compilation, the walking person at four steps, the bench."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

import numpy as np
from reference_runs import simulate_bench_reference
from table import YARDSTICK, Row
from walks import EXACT_STEP_S, WALK_S, best, difference, span, stance, the_trial, the_walker

from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.simulation.walk import Walk

STEPS_S = (2e-3, 1e-3, 5e-4, 2.5e-4)
SECOND_EXACT_STEP_S = 1.25e-4
REPEATS = 10
ZONES = ("heel_posterior", "heel", "heel_anterior", "midfoot", "forefoot")
BY = (*(f"contact.{zone}.{number}" for zone in ZONES for number in ("stiffness", "damping", "rise")),
      "friction.mu_static", "friction.threshold_velocity", "keel.flexural_modulus", "fulcrum.stiffness",
      "fulcrum.shift", "socket.ty.stiffness", "socket.flexion.stiffness", "offset.height", "offset.fore_aft",
      "offset.alignment")
"""Variables such as a fit of the contact would have."""
INSIDE_M = 0.108
"""A position (m from A) from which the fulcrum can shift both ways."""
COLD_START = """
import time
started = time.perf_counter()
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
trial = load_trial(embedded_trials("exact")[0])
walk = Walker(trial.subject, trial.model).walk(
    trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s)
print(time.perf_counter() - started)
"""


def rows(quick: bool = False) -> list[Row]:
    """Without the compilations in the quick form."""
    return [*([] if quick else _starts()), *_walks(), _sensitivities(), _bench()]


def _starts() -> list[Row]:
    """From the first import to the end of the first walk, with an empty and with a filled cache of compiled code."""
    with tempfile.TemporaryDirectory() as cache:
        def start(name: str) -> Row:
            done = subprocess.run([sys.executable, "-c", COLD_START], env=os.environ | {"NUMBA_CACHE_DIR": cache},
                                  capture_output=True, text=True, check=True)
            return Row(name, None, float(done.stdout), "a new process until its first walk has ended")

        return [start("start, compiling everything"), start("start, compiled code from the cache")]


def _walks() -> list[Row]:
    """The whole person: 21 coordinates follow the recording, socket and keel respond, both feet on the ground."""
    exact, second = (stance(step_s).prosthetic.grf_W for step_s in (EXACT_STEP_S, SECOND_EXACT_STEP_S))
    made = []
    for step_s in STEPS_S:
        def once(step_s: float = step_s) -> Walk:
            return the_walker().walk(the_trial().trajectory, step_s=step_s, **span(WALK_S))

        walk = best(once, lambda walk: walk.wall_s, REPEATS)
        record, force = walk.record, walk.prosthetic.grf_W
        cut, failed = np.count_nonzero(record.parts > 1), np.count_nonzero(~record.converged)
        name = YARDSTICK if step_s == 1e-3 else f"person, stepper at {1e3 * step_s:g} ms"
        made.append(Row(name, len(record.time_s) * step_s, walk.wall_s, (
            f"{difference(force, step_s, second, SECOND_EXACT_STEP_S):.3f} % BW from 0.125 ms, "
            f"{difference(force, step_s, exact, EXACT_STEP_S):.3f} from 0.0625 ms; {record.iterations.mean():.2f} "
            f"iterations a step, {cut} cut into smaller ones, {failed} unconverged")))
    return made


def _sensitivities() -> Row:
    """The same walk with exact derivatives of the prosthetic foot's reaction, and how near central differences come."""
    walker = the_walker()
    options = {"trajectory": the_trial().trajectory, "step_s": 1e-3, **span(WALK_S), "fulcrum_m": INSIDE_M}

    def wall_s(walk: Walk) -> float:
        return walk.wall_s

    plain = best(lambda: walker.walk(**options), wall_s, REPEATS)
    walk = best(lambda: walker.walk(**options, with_respect_to=BY), wall_s, REPEATS)
    medians, largest = [], []
    for i, name in enumerate(BY):
        variable = walker.variables[name]
        change = 3e-6 * (abs(variable.default) or variable.high)
        low, high = (walker.walk(**options, values={name: variable.default + sign * change}).prosthetic.grf_W
                     for sign in (-1.0, 1.0))
        exact = walk.sensitivity.grf_W[:, :, i]
        error = np.abs(exact - (high - low) / (2.0 * change)).max(axis=1) / np.abs(exact).max()
        medians.append(float(np.median(error)))
        largest.append(float(error.max()))
    return Row(f"{len(BY)} sensitivities, 1 ms", WALK_S, walk.wall_s, (
        f"{walk.wall_s / plain.wall_s:.2f} times the walk without them; force from central differences: median "
        f"{max(medians):.0e}, at most {max(largest):.0e} of its largest, the worst variable of each"))


def _bench() -> Row:
    model = the_trial().model
    result = best(lambda: run_bench(model), lambda result: result.wall_s, REPEATS)
    one = Bench(model.foot)
    stroke = one.press(fulcrum_m=0.066, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    exact = simulate_bench_reference(one, fulcrum_m=0.066, travel_m=stroke.platen_m[-1], accuracy=1e-6,
                                     speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    load = np.interp(exact.platen_m, np.append(0.0, stroke.platen_m), np.append(0.0, stroke.load_n))
    return Row("bench, five settings and heel, stepper", result.simulated_s, result.wall_s,
               f"{np.abs(load - exact.load_n).max():.3f} N from radau3 1e-6 (at 66 mm)")
