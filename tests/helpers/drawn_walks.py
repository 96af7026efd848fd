"""Walks with parameters drawn at random over the whole bounds of a search, and what became of them.

    python tests/helpers/drawn_walks.py --count 500 --setting 0 --step-ms 1
"""

from __future__ import annotations

import argparse
import collections
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.errors import SimulationError
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walk, Walker

PROSTHETIC_SIDE = ("contact", "friction", "keel", "fulcrum", "socket", "offset")
"""First words of the variables that belong to the prosthesis; the others move the recording."""


@dataclass(frozen=True)
class Outcome:
    """One walk.

    Attributes:
        values: what it was walked with.
        failure: what the SimulationError said, or None. failed_s: when (s).
        steps, iterations of Newton's method over all steps; zero where it failed.
        cut: indices of steps that were taken in several parts. unconverged: those of which a part did not converge.
        finite: every number of the record is, and the centre of pressure wherever the foot is loaded.
        peak_bw: largest vertical force, body weights.
    """

    values: Mapping[str, float]
    failure: str | None = None
    failed_s: float = np.nan
    steps: int = 0
    cut: tuple[int, ...] = ()
    unconverged: tuple[int, ...] = ()
    iterations: int = 0
    finite: bool = True
    peak_bw: float = np.nan
    wall_s: float = 0.0


def draws(
    variables: Mapping[str, Variable], count: int, *, seed: int, bounds: Mapping[str, tuple[float, float]]
) -> list[dict[str, float]]:
    """`count` sets of all variables of the prosthetic side, a Latin hypercube between their bounds.

    Uniform in the logarithm where the lower bound is positive.

    Args:
        bounds: instead of the variables' own, by name.
    """
    names = [name for name in variables if name.split(".")[0] in PROSTHETIC_SIDE]
    low, high = np.array([bounds.get(name, (variables[name].low, variables[name].high)) for name in names]).T
    scaled = low > 0.0
    low, high = (np.where(scaled, np.log(np.where(scaled, end, 1.0)), end) for end in (low, high))
    drawn = low + (high - low) * qmc.LatinHypercube(len(names), seed=seed).random(count)
    return [dict(zip(names, row, strict=True)) for row in np.where(scaled, np.exp(drawn), drawn).tolist()]


def reach(walker: Walker, fulcrum_m: float) -> dict[str, tuple[float, float]]:
    """Bounds of the fulcrum's shift within what the carriage can do: beyond it a walk is refused."""
    fulcrum = walker.model.foot.fulcrum
    return {"fulcrum.shift": (fulcrum.rearmost_m - fulcrum_m, fulcrum.foremost_m - fulcrum_m)}


def outcomes(walker: Walker, trajectory, sets: Sequence[Mapping[str, float]], **options) -> list[Outcome]:
    """Walks `trajectory` once with each of `sets`.

    Args:
        options: of `Walker.walk`.
    """
    found = []
    for values in sets:
        started = time.perf_counter()
        try:
            walk = walker.walk(trajectory, values=values, **options)
        except SimulationError as error:
            found.append(Outcome(values=values, failure=error.what, failed_s=error.time_s,
                                 wall_s=time.perf_counter() - started))
            continue
        record = walk.record
        found.append(Outcome(
            values=values, steps=len(record.time_s), cut=tuple(np.flatnonzero(record.parts > 1).tolist()),
            unconverged=tuple(np.flatnonzero(~record.converged).tolist()),
            iterations=int(record.iterations.sum()), finite=all_finite(walk),
            peak_bw=float(walk.prosthetic.grf_W[:, 2].max()) / (walker.subject.mass_kg * GRAVITY),
            wall_s=time.perf_counter() - started))
    return found


def all_finite(walk: Walk) -> bool:
    """Whether every number of a walk is finite that can be."""
    record = walk.record
    arrays = [record.q, record.v, record.load, record.sites, record.fulcrum, walk.commanded]
    for foot in (walk.prosthetic, walk.intact):
        arrays += [foot.grf_W, foot.free_moment_nm, foot.cop_W[foot.grf_W[:, 2] > LOADED_N]]
    return all(np.isfinite(array).all() for array in arrays)


def report(found: Sequence[Outcome]) -> str:
    """What a person wants to read of many outcomes."""
    walked = [one for one in found if one.failure is None]
    steps, lost = sum(one.steps for one in walked), sum(len(one.unconverged) for one in walked)
    peaks = np.quantile([one.peak_bw for one in walked], [0.0, 0.05, 0.5, 0.95, 1.0])
    lines = [
        f"{len(found)} walks: {len(walked)} finished, {sum(not one.finite for one in walked)} not finite",
        f"unconverged steps: {lost} of {steps} ({100 * lost / steps:.4f} %), in "
        f"{sum(bool(one.unconverged) for one in walked)} walks",
        f"steps cut into parts: {sum(len(one.cut) for one in walked)}, in {sum(bool(one.cut) for one in walked)} walks",
        f"Newton iterations a step: {sum(one.iterations for one in walked) / steps:.2f}",
        "peak vertical force (body weights), 0 5 50 95 100 %: " + " ".join(f"{peak:.2f}" for peak in peaks),
        f"wall time a walk: median {1e3 * np.median([one.wall_s for one in found]):.0f} ms, "
        f"longest {1e3 * max(one.wall_s for one in found):.0f} ms"]
    reasons = collections.Counter(one.failure.split(" reached")[0] for one in found if one.failure)
    lines += [f"failed: {count} times, {reason}" for reason, count in reasons.most_common()]
    worst = sorted(enumerate(found), key=lambda one: (-len(one[1].unconverged), -len(one[1].cut)))
    lines += [f"set {index}: cut {list(one.cut)}, unconverged {list(one.unconverged)}"
              for index, one in worst[:5] if one.cut]
    return "\n".join(lines)


def main() -> None:
    """Prints the report of many walks of an embedded trial."""
    parser = argparse.ArgumentParser(description="Walks with random parameters.")
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--setting", type=int, choices=(0, 1, 2), default=0, help="soft, medium, stiff")
    parser.add_argument("--step-ms", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--height-mm", type=float, default=None, help="bounds of offset.height, both signs")
    arguments = parser.parse_args()
    trial = load_trial(embedded_trials("exact")[3 * arguments.setting])
    walker = Walker(trial.subject, trial.model)
    bounds = reach(walker, trial.fulcrum_m)
    if arguments.height_mm is not None:
        bounds["offset.height"] = (-1e-3 * arguments.height_mm, 1e-3 * arguments.height_mm)
    sets = draws(walker.variables, arguments.count, seed=arguments.seed, bounds=bounds)
    print(report(outcomes(walker, trial.trajectory, sets, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s,
                          end_s=trial.end_s, step_s=1e-3 * arguments.step_ms)))


if __name__ == "__main__":
    main()
