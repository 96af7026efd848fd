"""Drake's own integrators on the same diagrams: the person over the heel strike, the bench, and cenic where it runs."""

from __future__ import annotations

import cenic
import numpy as np
from reference_runs import simulate_bench_reference, simulate_reference
from table import Row
from walks import difference, span, the_trial, the_walker

from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench

SCHEMES = (("radau3", 1e-3), ("implicit_euler", 1e-2), ("velocity_implicit_euler", 1e-2))
BEFORE_STRIKE_S, STRIKE_N = 0.05, 20.0


def rows(quick: bool = False) -> list[Row]:
    """In the quick form over half the time, compared with a looser reference."""
    return [*_person(0.1 if quick else 0.2, 1e-4 if quick else 1e-5), *_bench(quick), *cenic.rows()]


def _person(length_s: float, exact_accuracy: float) -> list[Row]:
    trial, walker = the_trial(), the_walker()
    whole = span(1e3)
    vertical = walker.walk(trial.trajectory, **whole).prosthetic.grf_W[:, 2]
    strike = whole["start_s"] + 1e-3 * np.flatnonzero((vertical[1:] > STRIKE_N) & (vertical[:-1] <= STRIKE_N))[0]
    start = max(whole["start_s"], strike - BEFORE_STRIKE_S)
    options = {"fulcrum_m": trial.fulcrum_m, "start_s": start, "end_s": start + length_s}
    exact = simulate_reference(walker, trial.trajectory, accuracy=exact_accuracy, **options).grf_W[1:]
    against = f"from radau3 {exact_accuracy:g}"
    made = []
    for scheme, accuracy in SCHEMES:
        run = simulate_reference(walker, trial.trajectory, integrator=scheme, accuracy=accuracy, **options)
        made.append(Row(f"person, heel strike, Simulator {scheme} {accuracy:g}", length_s, run.wall_s, (
            f"{difference(run.grf_W[1:], 1e-3, exact, 1e-3):.4f} % BW {against}; "
            f"{1e6 * run.wall_s / run.evaluations:.0f} us an evaluation")))
    walk = walker.walk(trial.trajectory, **options)
    made.append(Row("person, heel strike, stepper at 1 ms", length_s, walk.wall_s,
                    f"{difference(walk.prosthetic.grf_W, 1e-3, exact, 1e-3):.4f} % BW {against}"))
    return made


def _bench(quick: bool) -> list[Row]:
    """One stroke of the bench at the published speed, to 600 N or, in the quick form, a tenth of the way."""
    bench = Bench(the_trial().model.foot)
    stroke = bench.press(fulcrum_m=0.066, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    options = {"fulcrum_m": 0.066, "speed_m_per_s": PUBLISHED_SPEED_M_PER_S,
               "travel_m": stroke.platen_m[-1] * (0.1 if quick else 1.0)}
    exact = simulate_bench_reference(bench, accuracy=1e-6, **options).load_n
    made = []
    for scheme, _ in SCHEMES:
        run = simulate_bench_reference(bench, integrator=scheme, accuracy=1e-4, **options)
        made.append(Row(f"bench, 66 mm, Simulator {scheme} 1e-4", run.time_s[-1], run.wall_s,
                        f"{np.abs(run.load_n - exact).max():.4f} N of {exact[-1]:.0f} N from radau3 1e-6"))
    return made
