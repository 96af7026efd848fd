"""The search of the paper's contact fit: Latin hypercube scenarios round the best so far, and its rule for stopping.

In each iteration scenarios are drawn and scored, and the best one seen, be it new or old, is the centre of the next
iteration. What has been reached after any iteration is a `SearchState`, from which the search goes on to the same end.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.paper_objective import Score
from vsf_drake.analysis.contact_fit.paper_space import PaperSpace
from vsf_drake.errors import InputError
from vsf_drake.simulation.many.fields import number, whole


@dataclass(frozen=True, kw_only=True)
class PaperOptions:
    """What the paper states, and choices where it does not.

    Attributes:
        scenarios: in one iteration (a choice).
        spread: standard deviation of a parameter's distribution over its value at the centre (a choice).
        fold: bounds of stiffness and damping are those of the initial guess divided and multiplied by it (a choice).
        exponents, full_damping_mm: bounds (choices: those of the variables of a walk).
        iterations: after which a run that did not converge ends (the paper's).
        objective_tolerance_n: change of the objective, as root mean square difference of the resultants (N), below
            which it counts as settled (the paper's; that it means the root mean square is our reading, it says N).
        parameter_tolerance: the same of the parameters, the largest change over the distance of its bounds (the
            paper's; over what it takes the change is our reading).
        settled: iterations in a row that must change so little (1: the paper's words, read literally).
        restarts: how often a run that did not converge is begun again from its result (a choice).
        step_s: of the walks.
        friction: whether the friction coefficients are varied as well; the paper's were given.
        seed: 0 or more.
        workers: threads; they do not change the result.

    Raises:
        InputError: a number is out of range.
    """

    scenarios: int = 100
    spread: float = 0.1
    fold: float = 10.0
    exponents: tuple[float, float] = (1.0, 2.0)
    full_damping_mm: tuple[float, float] = (0.2, 5.0)
    iterations: int = 100
    objective_tolerance_n: float = 0.1
    parameter_tolerance: float = 1e-3
    settled: int = 1
    restarts: int = 2
    step_s: float = 2e-3
    friction: bool = False
    seed: int = 0
    workers: int = 2

    def __post_init__(self) -> None:
        for name, least in (("scenarios", 1), ("iterations", 1), ("settled", 1), ("restarts", 0), ("seed", 0),
                            ("workers", 1)):
            object.__setattr__(self, name, whole(getattr(self, name), name, least))
        for name, above in (("spread", 0.0), ("fold", 1.0), ("objective_tolerance_n", 0.0),
                            ("parameter_tolerance", 0.0), ("step_s", 0.0)):
            value = number(getattr(self, name), name)
            if not value > above:
                raise InputError(f"{value:g} is not usable", where=name, right=f"It must be above {above:g}")
            object.__setattr__(self, name, value)
        for name in ("exponents", "full_damping_mm"):
            bounds = getattr(self, name)
            if not isinstance(bounds, (tuple, list)) or len(bounds) != 2:
                raise InputError(f"{bounds!r} are no bounds", where=name, right="Give (low, high)")
            low, high = (number(bound, name) for bound in bounds)
            if not low < high:
                raise InputError(f"the bounds {low:g} to {high:g} cross", where=name, right="Give the lower one first")
            object.__setattr__(self, name, (low, high))
        if not isinstance(self.friction, bool):
            raise InputError(f"{self.friction!r} is not usable", where="friction", right="Give True or False")


@dataclass(frozen=True, kw_only=True)
class SearchState:
    """Where a search has got to after an iteration.

    Attributes:
        stiffness: N/mm, of the initial guess.
        initial_objective_n2, objective_n2: N², of the initial guess and of the best scenario.
        best: (P) the best scenario, in the units of the search.
        history: of each iteration its number (from 1), the objective of the best scenario so far (N²) and the largest
            change of a parameter of it, over the distance of its bounds.
        instants: how many differences are summed in the objective.
        simulations, failed_simulations: so far.
        wall_s: so far.
    """

    stiffness: float
    initial_objective_n2: float
    objective_n2: float
    best: tuple[float, ...]
    history: tuple[tuple[int, float, float], ...] = ()
    instants: int
    simulations: int
    failed_simulations: int
    wall_s: float

    def rms_n(self, objective_n2: float) -> float:
        """An objective as root mean square difference."""
        return math.sqrt(objective_n2 / self.instants)

    @property
    def falls_n(self) -> list[float]:
        """By which the objective, as root mean square difference, fell in each iteration."""
        found = [self.rms_n(objective) for objective in
                 (self.initial_objective_n2, *(objective for _, objective, _ in self.history))]
        return [before - after for before, after in itertools.pairwise(found)]


def iterate(
    state: SearchState, space: PaperSpace, score: Callable[[Sequence[Mapping[str, float]]], Sequence[Score]],
    options: PaperOptions
) -> SearchState:
    """One iteration.

    Args:
        score: of scenarios, each the values of variables of a walk.

    Raises:
        SimulationError: every scenario fails.
    """
    iteration = len(state.history) + 1
    centre = np.array(state.best)
    drawn = space.sample(centre, count=options.scenarios, spread=options.spread,
                         random=np.random.default_rng([options.seed, iteration]))
    found = score([space.values(x) for x in drawn])
    failures = [item.error for item in found if item.error is not None]
    if len(failures) == len(found):
        raise failures[-1]
    objectives = np.array([item.objective_n2 for item in found])
    first = int(np.argmin(objectives))
    better = bool(objectives[first] < state.objective_n2)
    best = drawn[first] if better else centre
    objective = float(objectives[first]) if better else state.objective_n2
    return replace(
        state, best=tuple(map(float, best)), objective_n2=objective,
        history=(*state.history, (iteration, objective, space.change(centre, best))),
        simulations=state.simulations + sum(item.simulations for item in found),
        failed_simulations=state.failed_simulations + len(failures))


def verdict(state: SearchState, options: PaperOptions) -> tuple[bool, str] | None:
    """Whether the search converged, and why it ends, in words; None while it goes on."""
    done, falls = len(state.history), state.falls_n
    small = [fall < options.objective_tolerance_n and change < options.parameter_tolerance
             for fall, (_, _, change) in zip(falls, state.history, strict=True)]
    if done >= options.settled and all(small[-options.settled:]):
        restarts = (done - 1) // options.iterations
        return True, (f"converged in iteration {done}: objective and parameters changed by less than "
                      f"{options.objective_tolerance_n:g} N and {options.parameter_tolerance:g} of their bounds"
                      + (f", after {restarts} restarts" if restarts else ""))
    if done >= options.iterations * (1 + options.restarts):
        return False, (f"not converged in {options.iterations} iterations, restarted {options.restarts} times: "
                       f"the last one changed the objective by {falls[-1]:.3g} N")
    return None


def to_state(plain: Mapping[str, Any]) -> SearchState:
    """The state that `dataclasses.asdict` made plain."""
    return SearchState(**{**plain, "best": tuple(plain["best"]), "history": tuple(map(tuple, plain["history"]))})
