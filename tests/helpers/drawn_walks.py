"""Walks with parameters drawn at random over the whole bounds of a search, and what became of
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import qmc

from vsf_drake.base.errors import SimulationError
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.stepping.newton import MAX_ITERATIONS
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.embedded import embedded_trials

MOST_UNCONVERGED = 0.005
"""Share of the steps that may stay unconverged, which is what was promised."""
PROSTHETIC_SIDE = ("contact", "friction", "keel", "fulcrum", "socket", "offset")
"""First words of the variables that belong to the prosthesis; the others move the recording."""


@dataclass(frozen=True)
class Outcome:
    """One walk; numbers are 0 where it failed."""

    values: Mapping[str, float]
    failure: str | None = None  # what the SimulationError said
    steps: int = 0
    unconverged: int = 0  # steps of which a part did not converge
    iterations: int = 0  # of Newton's method over all steps
    finite: bool = True
    """every number of the record, and the centre of pressure wherever the foot is loaded"""
    peak_bw: float = np.nan  # largest vertical force, body weights


def draws(
    variables: Mapping[str, Variable],
    count: int,
    *,
    seed: int,
    bounds: Mapping[str, tuple[float, float]],
) -> list[dict[str, float]]:
    """`count` sets of all variables of the prosthetic side, a Latin hypercube between their bounds.

    Uniform in the logarithm where the lower bound is positive.

    Args:
        bounds: instead of the variables' own, by name.
    """
    names = [name for name in variables if name.split(".")[0] in PROSTHETIC_SIDE]
    low, high = np.array(
        [bounds.get(name, (variables[name].low, variables[name].high)) for name in names]
    ).T
    scaled = low > 0.0
    low, high = (np.where(scaled, np.log(np.where(scaled, end, 1.0)), end) for end in (low, high))
    drawn = low + (high - low) * qmc.LatinHypercube(len(names), seed=seed).random(count)
    return [
        dict(zip(names, row, strict=True))
        for row in np.where(scaled, np.exp(drawn), drawn).tolist()
    ]


def reach(walker: Walker, fulcrum_m: float) -> dict[str, tuple[float, float]]:
    """Bounds of the fulcrum's shift within what the carriage can do: beyond it a walk is
    refused."""
    fulcrum = walker.model.foot.fulcrum
    return {"fulcrum.shift": (fulcrum.rearmost_m - fulcrum_m, fulcrum.foremost_m - fulcrum_m)}


def outcomes(
    walker: Walker, trajectory, sets: Sequence[Mapping[str, float]], **options
) -> list[Outcome]:
    """Walks `trajectory` once with each of `sets`; `options` are of `Walker.walk`."""
    found = []
    for values in sets:
        try:
            walk = walker.walk(trajectory, values=values, **options)
        except SimulationError as error:
            found.append(Outcome(values=values, failure=error.what))
            continue
        record = walk.record
        found.append(
            Outcome(
                values=values,
                steps=len(record.time_s),
                unconverged=np.count_nonzero(~record.converged),
                iterations=int(record.iterations.sum()),
                finite=all_finite(walk),
                peak_bw=float(walk.prosthetic.grf_W[:, 2].max())
                / (walker.subject.mass_kg * GRAVITY),
            )
        )
    return found


def all_finite(walk: Walk) -> bool:
    """Whether every number of a walk is finite that can be."""
    record = walk.record
    arrays = [record.q, record.v, record.load, record.sites, record.fulcrum, walk.commanded]
    for foot in (walk.prosthetic, walk.intact):
        arrays += [foot.grf_W, foot.free_moment_nm, foot.cop_W[foot.grf_W[:, 2] > LOADED_N]]
    return all(np.isfinite(array).all() for array in arrays)


@cache
def reference_walk(setting):
    """(walker, trajectory, span) of an embedded trial: setting 0 soft, 1 medium, 2 stiff."""
    trial = load_trial(embedded_trials("exact")[3 * setting])
    span = {"fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s}
    return Walker(trial.subject, trial.model), trial.trajectory, span


def drawn(
    setting: int, count: int, *, seed: int, step_s: float, **bounds: tuple[float, float]
) -> list[Outcome]:
    """Outcomes of `count` walks of an embedded trial."""
    walker, trajectory, span = reference_walk(setting)
    sets = draws(
        walker.variables, count, seed=seed, bounds=reach(walker, span["fulcrum_m"]) | bounds
    )
    return outcomes(walker, trajectory, sets, step_s=step_s, **span)


def assert_sound(found):
    """None NaN, none without end, hardly a step unconverged; what fails left the model's range and
    did not diverge."""
    walked = [one for one in found if one.failure is None]
    assert all(one.finite for one in walked)
    assert all(one.iterations <= MAX_ITERATIONS * one.steps for one in walked)
    assert sum(one.unconverged for one in walked) < MOST_UNCONVERGED * sum(
        one.steps for one in walked
    )
    assert len(walked) > 0.5 * len(found)
    for one in found:
        if one.failure is not None:
            assert "beyond the" in one.failure, f"{one.failure} with {one.values}"
