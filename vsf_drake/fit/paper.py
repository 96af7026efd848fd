"""The search of McGeehan et al. 2021 (doi 10.1115/1.4050456) for contact parameters, as it is
written.

- Objective: the sum of squared differences of the resultant ground reaction force, model less
  plate.
- Initial guess: exponent 1, full damping at 1 mm, damping (N s/mm) half of the stiffness (N/mm),
  and one stiffness for all spheres, raised until they carry the person. We read that as: until the
  model's vertical force over the measured stances is on average what the plates measured.
- Varied: stiffness, exponent, damping and full-damping depth of each zone. No geometry, no
  friction.
- Search: Latin hypercube, stratified, normal distributions within bounds, which do not shrink; the
  best scenario is carried to the next iteration. How many scenarios, how wide and within which
  bounds is not said: choices.
- End: 100 iterations, or the objective changes by less than 0.1 N and the parameters by less than
  0.001. An iteration that finds nothing better changes nothing, and ends the search
  (`PaperOptions.settled`). If 100 iterations do not converge, the search is begun again from their
  result.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.threads import side_by_side
from vsf_drake.fit.options import PaperOptions
from vsf_drake.fit.parameters import zones_of
from vsf_drake.fit.problem import ContactFit, raised
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.simulation.variables import Variable
from vsf_drake.walks.comparison import Comparison, compare

SPREAD, FOLD = 0.1, 10.0
"""Standard deviation of a parameter's distribution over its value at the centre, and by how many
times a stiffness or damping may be larger or smaller than the initial guess (choices)."""
SOFTEST_N_PER_MM, STIFFEST_N_PER_MM, RAISE = 0.1, 1000.0, 1.1
"""Stiffness of one sphere at which the search for the initial guess begins and gives up, and the
ratio of two of its steps (choices): 24 spheres of the softest carry 70 N at 30 mm, the thickness of
the foam."""
_MM_PER_M = 1e3


@dataclass(frozen=True, kw_only=True)
class PaperState:
    """Where a search has got to after an iteration; it goes on from here to the same end.

    `history` holds of each iteration its number (from 1), the objective of the best scenario so far
    (N²) and the largest change of a parameter of it, over the distance of its bounds.
    """

    stiffness: float  # N/mm, of the initial guess
    initial_objective_n2: float
    objective_n2: float  # of the best scenario
    best: tuple[float, ...]  # (P,) in the units of `PaperSpace`
    history: tuple[tuple[int, float, float], ...] = ()
    instants: int  # how many differences are summed in the objective
    simulations: int  # those for the initial guess included
    failed_simulations: int
    wall_s: float  # over all parts of an interrupted search

    def rms_n(self, objective_n2: float) -> float:
        """An objective as root mean square difference."""
        return math.sqrt(objective_n2 / self.instants)


@dataclass(frozen=True, kw_only=True)
class PaperEnd:
    """How the search ended; values of variables of a walk (SI) for the best scenario and the
    initial guess."""

    state: PaperState
    values: dict[str, float]
    initial_values: dict[str, float]
    converged: bool  # by its own tolerances
    stopped_by: str


def search_like_the_paper(
    fit: ContactFit,
    *,
    progress: Callable[[str, float], None] | None = None,
    resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None,
) -> PaperEnd:
    """Searches for one trial's contact, as the paper did, or for that of several; see
    `solution.solve`."""
    options = fit.options
    assert isinstance(options, PaperOptions)
    state = (
        _initial(fit, options)
        if resume is None
        else fit.resumed(
            resume,
            lambda kept: PaperState(
                **{
                    **kept,
                    "best": tuple(kept["best"]),
                    "history": tuple(map(tuple, kept["history"])),
                }
            ),
        )
    )
    space = paper_space(fit.walker.variables, state.stiffness)
    began = time.perf_counter() - state.wall_s
    while True:
        done = len(state.history)
        end = verdict(state, options)
        if progress:
            progress(
                f"iteration {done}, resultant {state.rms_n(state.objective_n2):.1f} N off",
                1.0 if end else done / (options.iterations * (1 + options.restarts)),
            )
        if end:
            return PaperEnd(
                state=state,
                values=space.values(np.array(state.best)),
                converged=end[0],
                initial_values=space.values(space.start),
                stopped_by=end[1],
            )
        state = iterate(state, space, lambda scenarios: scores(fit, scenarios), options)
        state = replace(state, wall_s=time.perf_counter() - began)
        if checkpoint:
            checkpoint({"key": fit.key, **asdict(state)})


def iterate(
    state: PaperState,
    space: PaperSpace,
    score: Callable[[Sequence[Mapping[str, float]]], Sequence[Score]],
    options: PaperOptions,
) -> PaperState:
    """One iteration: scenarios (values of variables of a walk) are drawn round the best so far and
    scored, and the best seen is carried on. Raises SimulationError if every scenario fails."""
    iteration = len(state.history) + 1
    centre = np.array(state.best)
    drawn = space.sample(
        centre, options.scenarios, np.random.default_rng([options.seed, iteration])
    )
    scored = score([space.values(x) for x in drawn])
    failures = [item.error for item in scored if item.error is not None]
    if len(failures) == len(scored):
        raise failures[-1]
    first = int(np.argmin([item.objective_n2 for item in scored]))
    best, objective = min(
        (centre, state.objective_n2),
        (drawn[first], scored[first].objective_n2),
        key=lambda found: found[1],
    )
    change = float(np.max(np.abs(best - centre) / (space.high - space.low)))
    return replace(
        state,
        best=tuple(map(float, best)),
        objective_n2=objective,
        history=(*state.history, (iteration, objective, change)),
        simulations=state.simulations + sum(item.simulations for item in scored),
        failed_simulations=state.failed_simulations + len(failures),
    )


def verdict(state: PaperState, options: PaperOptions) -> tuple[bool, str] | None:
    """Whether the search converged, and why it ends, in words; None while it goes on."""
    done = len(state.history)
    rms = [
        *map(
            state.rms_n,
            (state.initial_objective_n2, *(objective for _, objective, _ in state.history)),
        )
    ]
    falls = [before - after for before, after in itertools.pairwise(rms)]
    small = [
        fall < options.objective_tolerance_n and change < options.parameter_tolerance
        for fall, (_, _, change) in zip(falls, state.history, strict=True)
    ]
    if done >= options.settled and all(small[-options.settled :]):
        restarts = (done - 1) // options.iterations
        return True, (
            (
                f"converged in iteration {done}: objective and parameters changed by less than "
                f"{options.objective_tolerance_n:g} N and {options.parameter_tolerance:g} of their "
                "bounds"
            )
            + (f", after {restarts} restarts" if restarts else "")
        )
    if done >= options.iterations * (1 + options.restarts):
        return False, (
            f"not converged in {options.iterations} iterations, restarted {options.restarts} "
            f"times: the last one changed the objective by {falls[-1]:.3g} N"
        )
    return None


# The objective, and the stiffness from which the search starts. Resultants are lengths of the
# vectors low-passed at 40 Hz, on the model's instants, over each measured stance ± 0.25 s.


@dataclass(frozen=True)
class Score:
    """What one scenario came to: an infinite objective if a walk failed."""

    objective_n2: float
    simulations: int
    error: SimulationError | None = None


def scores(fit: ContactFit, scenarios: Sequence[Mapping[str, float]]) -> list[Score]:
    """Of several scenarios, on threads, each of which walks some side by side."""
    assert isinstance(fit.options, PaperOptions)
    parts = [scenarios[begin : begin + WIDTH] for begin in range(0, len(scenarios), WIDTH)]
    with side_by_side(fit.options.workers) as pool:
        found = pool.map(lambda part: _compared(fit, part), parts)
        return [_score(comparisons) for part in found for comparisons in part]


def _compared(
    fit: ContactFit, scenarios: Sequence[Mapping[str, float]]
) -> list[tuple[Comparison | SimulationError, ...]]:
    """Of each scenario the walks of all trials beside their plates, or why one failed."""
    changes = [{"values": values} for values in scenarios]
    by_trial = [
        [
            walk if isinstance(walk, SimulationError) else compare(walk, trial.prosthetic_plate)
            for walk in fit.walks(trial, changes, step_s=fit.options.step_s)
        ]
        for trial in fit.trials
    ]
    return list(zip(*by_trial, strict=True))


def _score(comparisons: Sequence[Comparison | SimulationError]) -> Score:
    total = 0.0
    for c in comparisons:
        if isinstance(c, SimulationError):
            return Score(np.inf, len(comparisons), c)
        model, measured = (
            np.linalg.norm(force[c.scored], axis=1) for force in (c.model, c.measured)
        )
        total += float(np.sum((model - measured) ** 2))
    return Score(total, len(comparisons))


def _initial(fit: ContactFit, options: PaperOptions) -> PaperState:
    """The stiffness is raised until the model carries what the plates measured; a walk that fails
    does not carry."""

    def surplus_n(c: Comparison) -> float:
        return sum(float(np.sum(c.model[own, 2] - c.measured[own, 2])) for own in c.measured_rows())

    began = time.perf_counter()
    stiffness = SOFTEST_N_PER_MM
    steps = 0
    failures: list[SimulationError] = []
    while stiffness <= STIFFEST_N_PER_MM:
        space = paper_space(fit.walker.variables, stiffness)
        values = space.values(space.start)
        steps = steps + 1
        try:
            [found] = _compared(fit, [values])
            comparisons = [raised(c) for c in found]
            if sum(map(surplus_n, comparisons)) >= 0.0:
                first = _score(comparisons)
                return PaperState(
                    stiffness=stiffness,
                    initial_objective_n2=first.objective_n2,
                    objective_n2=first.objective_n2,
                    best=tuple(map(float, space.start)),
                    instants=sum(int(c.scored.sum()) for c in comparisons),
                    simulations=steps * len(fit.trials),
                    failed_simulations=len(failures),
                    wall_s=time.perf_counter() - began,
                )
        except SimulationError as error:
            failures.append(error)
        stiffness *= RAISE
    if len(failures) == steps:
        raise failures[-1]
    raise InputError(
        "the prosthetic foot does not carry the recorded load with spheres of up to "
        f"{STIFFEST_N_PER_MM:g} N/mm",
        file=fit.trials[0].path,
        where="offsets",
        right=(
            "Check the height of the prosthesis, and that kinematics and forces share time and "
            "frame"
        ),
    )


# What is varied, in the paper's units, and how scenarios are drawn.
#
#     contact.ZONE.stiffness            k, N/mm^n      of each of the foot's zones
#     contact.ZONE.exponent             n
#     contact.ZONE.damping              b, N s/mm
#     contact.ZONE.full_damping_depth   mm
#
# A normal distribution is not the same in other units. In these, a sphere 1 mm deep carries k
# whatever n is, so that n and k can be drawn independently of each other; in N/m^n they cannot.


@dataclass(frozen=True, eq=False)
class PaperSpace:
    """The parameters of one search: variables of a walk, initial guess and bounds (P,), in the
    units above."""

    names: tuple[str, ...]
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def values(self, x: np.ndarray) -> dict[str, float]:
        """The values of a walk's variables (SI) at x (P,)."""
        values = dict(zip(self.names, map(float, x), strict=True))
        for name in self.names:
            if name.endswith(".stiffness"):  # N/mm^n to N/m^n
                values[name] *= _MM_PER_M ** values[name.removesuffix("stiffness") + "exponent"]
            elif name.endswith(".damping"):
                values[name] *= _MM_PER_M
            elif name.endswith(".full_damping_depth"):
                values[name] /= _MM_PER_M
        return values

    def sample(self, centre: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
        """(count, P) scenarios: a Latin hypercube of normal distributions round `centre`, cut off
        at the bounds.

        Each parameter's distribution, of standard deviation SPREAD times the value at the centre
        before cutting off, is cut into `count` slices of equal probability and each slice is met
        once (McKay, Beckman & Conover 1979, doi 10.1080/00401706.1979.10489755).
        """
        from scipy.stats import truncnorm  # noqa: PLC0415 (half a second, for who draws)

        columns = []
        for value, low, high in zip(centre, self.low, self.high, strict=True):
            share = (random.permutation(count) + random.uniform(size=count)) / count
            scale = SPREAD * value
            drawn = truncnorm.ppf(
                share, (low - value) / scale, (high - value) / scale, loc=value, scale=scale
            )
            columns.append(np.clip(drawn, low, high))
        return np.column_stack(columns)


def paper_space(variables: Mapping[str, Variable], stiffness: float) -> PaperSpace:
    """The paper's initial guess with one stiffness (N/mm) for all zones, and bounds about it."""

    def tenfold(value: float) -> tuple[float, float, float]:
        return value, value / FOLD, FOLD * value

    law = {
        "stiffness": tenfold(stiffness),
        "exponent": (1.0, 1.0, 2.0),
        "damping": tenfold(0.5 * stiffness),
        "full_damping_depth": (1.0, 0.2, 5.0),
    }
    rows = {
        f"contact.{zone}.{name}": row for zone in zones_of(variables) for name, row in law.items()
    }
    return PaperSpace(tuple(rows), *np.array([*rows.values()]).T)
