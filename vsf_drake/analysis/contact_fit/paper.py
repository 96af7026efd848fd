"""Contact parameters fitted by the procedure of McGeehan et al. 2021 (doi 10.1115/1.4050456), as it is written.

- Objective: the sum of squared differences of the resultant ground reaction force, model less plate.
- Initial guess: exponent 1, full damping at 1 mm, damping (N s/mm) half of the stiffness (N/mm), and one stiffness for
  all spheres, raised until they carry the person. We read that as: until the model's vertical force over the measured
  stances is on average what the plates measured.
- Varied: stiffness, exponent, damping and full-damping depth of each zone. No geometry; friction as given.
- Search: Latin hypercube, stratified, normal distributions within bounds; the best scenario is carried to the next
  iteration. The paper does not say how many scenarios, how wide and within which bounds: see `PaperOptions`. The
  distributions are as wide in the last iteration as in the first, since it does not say that they shrink.
- End: 100 iterations, or the objective changes by less than 0.1 N and the parameters by less than 0.001. Since the best
  scenario is carried on, an iteration that finds none better changes nothing, and ends the search, though another one
  might have found something (`PaperOptions.settled`). If 100 iterations do not converge, the search is begun again from
  their result.

What such a fit is worth beyond its own trial is for the caller to find out: it knows neither centre of pressure nor
bench, and contact makes up for whatever is wrong with the geometry.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import truncnorm

from vsf_drake.analysis.comparison import Comparison, compare
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.cases import digest
from vsf_drake.simulation.variables import Variable, check_number, check_values, check_whole
from vsf_drake.simulation.walk import Walker

__all__ = ["PaperFit", "PaperOptions", "fit_like_the_paper"]

_PATH_OPTIONS = ("scenarios", "spread", "fold", "exponents", "full_damping_mm", "step_s", "friction", "seed")
"""Options that the way of the search depends on; the others only say when it ends, and on how many threads it runs."""


@dataclass(frozen=True, kw_only=True)
class PaperFit:
    """What the procedure ended with.

    Attributes:
        values, initial_values: of variables of a walk (SI), of the best scenario and of the initial guess.
        objective_n2, initial_objective_n2: N², of the same.
        rms_n, initial_rms_n: the same as root mean square difference of the resultants.
        history: of each iteration its number (from 1), the objective of the best scenario so far (N²) and the largest
            change of a parameter of it, over the distance of its bounds.
        stopped_by: why it ended, in words.
        converged: whether by its own tolerances.
        simulations, failed_simulations: walks, those for the initial guess included.
        wall_s: time that it took, over all parts of an interrupted fit.
        seed: of the scenarios.
    """

    values: dict[str, float]
    objective_n2: float
    rms_n: float
    initial_values: dict[str, float]
    initial_objective_n2: float
    initial_rms_n: float
    history: tuple[tuple[int, float, float], ...]
    stopped_by: str
    converged: bool
    simulations: int
    failed_simulations: int
    wall_s: float
    seed: int


def fit_like_the_paper(
    trials: Sequence[Trial], options: PaperOptions | None = None, *, walker: Walker | None = None,
    progress: Callable[[int, float, float], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[Mapping[str, Any]], None] | None = None
) -> PaperFit:
    """Fits one trial, as the paper did, or several.

    Args:
        trials: of one subject with one prosthesis.
        walker: the person, built before; made here if None.
        progress: called after each iteration (0: the initial guess) with its number, the best root mean square
            difference so far (N) and the fraction of the iterations that the fit may take.
        resume: what `checkpoint` was given; the fit goes on from there as if it had not been interrupted. More
            iterations, restarts or other tolerances than before may be asked for.
        checkpoint: called after each iteration with the state of the search as plain values (JSON keeps them exactly).

    Raises:
        InputError: a trial cannot be fitted, the foot cannot carry the person, or `resume` belongs to another fit.
        SimulationError: every walk of an iteration fails.
    """
    options = PaperOptions() if options is None else options
    if isinstance(trials, Trial):
        raise InputError("is one trial, not a sequence of trials", where="trials", right="Give [trial]")
    trials = tuple(trials)
    if not trials:
        raise InputError("there is no trial to fit", where="trials")
    walker = Walker(trials[0].subject, trials[0].model) if walker is None else walker
    objective = PaperObjective(trials, walker, step_s=options.step_s, workers=options.workers)
    key = _key(objective, options)
    state = _begin(objective, options) if resume is None else _resumed(resume, key)
    space = _space(walker, options, state.stiffness)
    began = time.perf_counter() - state.wall_s
    while True:
        end = verdict(state, options)
        if progress:
            fraction = 1.0 if end else len(state.history) / (options.iterations * (1 + options.restarts))
            progress(len(state.history), state.rms_n(state.objective_n2), fraction)
        if end:
            break
        state = replace(iterate(state, space, objective.scores, options), wall_s=time.perf_counter() - began)
        if checkpoint:
            checkpoint({"key": key, **asdict(state)})
    return PaperFit(
        values=space.values(np.array(state.best)), objective_n2=state.objective_n2,
        rms_n=state.rms_n(state.objective_n2), initial_values=space.values(space.start),
        initial_objective_n2=state.initial_objective_n2, initial_rms_n=state.rms_n(state.initial_objective_n2),
        history=state.history, stopped_by=end[1], converged=end[0], simulations=state.simulations,
        failed_simulations=state.failed_simulations, wall_s=state.wall_s, seed=options.seed)


def _begin(objective: PaperObjective, options: PaperOptions) -> SearchState:
    """The initial guess."""
    began = time.perf_counter()

    def values(stiffness: float) -> dict[str, float]:
        space = _space(objective.walker, options, stiffness)
        return space.values(space.start)

    stiffness, simulations, failed = objective.carrying_stiffness(values)
    apart = np.concatenate([differences(objective.compare(trial, values(stiffness))) for trial in objective.trials])
    start = _space(objective.walker, options, stiffness).start
    total = float(np.sum(apart**2))
    return SearchState(
        stiffness=stiffness, initial_objective_n2=total, objective_n2=total, best=tuple(map(float, start)),
        instants=len(apart), simulations=simulations + len(objective.trials), failed_simulations=failed,
        wall_s=time.perf_counter() - began)


def _space(walker: Walker, options: PaperOptions, stiffness: float) -> PaperSpace:
    return paper_space(walker.variables, stiffness, fold=options.fold, exponents=options.exponents,
                       full_damping_mm=options.full_damping_mm, friction=options.friction)


def _key(objective: PaperObjective, options: PaperOptions) -> str:
    """Of everything that the way of the search depends on, but for the software."""
    walker = objective.walker
    plain = {"options": {name: getattr(options, name) for name in _PATH_OPTIONS},
             "subject": to_plain(walker.subject), "model": to_plain(walker.model),
             "trials": [[trial.fulcrum_m, trial.start_s, trial.end_s, to_plain(trial.offsets),
                         list(trial.trajectory.names)] for trial in objective.trials]}
    arrays: dict[str, np.ndarray] = {}
    for i, trial in enumerate(objective.trials):
        plate = trial.prosthetic_plate
        arrays |= {f"{i} motion time": trial.trajectory.time_s, f"{i} motion": trial.trajectory.values,
                   f"{i} plate time": plate.time_s, f"{i} plate": plate.force_W}
    return digest(plain, arrays)


def _resumed(resume: Mapping[str, Any], key: str) -> SearchState:
    try:
        rest = dict(resume)
        own = rest.pop("key")
        state = to_state(rest)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError("is no state of such a fit", where="resume") from error
    if own != key:
        raise InputError("is the state of a fit with other trials, parameters or options", where="resume",
                         right="Resume with what the fit was begun with, or begin it again")
    return state


# The search of the paper's contact fit: Latin hypercube scenarios round the best so far, and its rule for stopping.
#
# In each iteration scenarios are drawn and scored, and the best one seen, be it new or old, is the centre of the next
# iteration. What has been reached after any iteration is a `SearchState`, from which the search goes on to the same
# end.


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
            object.__setattr__(self, name, check_whole(getattr(self, name), name, least))
        for name, above in (("spread", 0.0), ("fold", 1.0), ("objective_tolerance_n", 0.0),
                            ("parameter_tolerance", 0.0), ("step_s", 0.0)):
            value = check_number(getattr(self, name), name)
            if not value > above:
                raise InputError(f"{value:g} is not usable", where=name, right=f"It must be above {above:g}")
            object.__setattr__(self, name, value)
        for name in ("exponents", "full_damping_mm"):
            bounds = getattr(self, name)
            if not isinstance(bounds, (tuple, list)) or len(bounds) != 2:
                raise InputError(f"{bounds!r} are no bounds", where=name, right="Give (low, high)")
            low, high = (check_number(bound, name) for bound in bounds)
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


# The objective of the paper's contact fit, and the stiffness from which it starts.


SOFTEST_N_PER_MM, STIFFEST_N_PER_MM, RAISE = 0.1, 1000.0, 1.1
"""Stiffness of one sphere at which the search for the initial guess begins and gives up, and the ratio of two of its
steps (choices): 24 spheres of the softest carry 70 N at 30 mm, the thickness of the foam."""


@dataclass(frozen=True)
class Score:
    """What one scenario came to.

    Attributes:
        objective_n2: infinite if a walk failed.
        simulations: walks that were run.
        error: of the walk that failed, which is the last of them.
    """

    objective_n2: float
    simulations: int
    error: SimulationError | None = None


class PaperObjective:
    """Sum of squared differences (N²) of the resultant ground reaction force, of one or several trials.

    Resultants are lengths of the vectors low-passed at 40 Hz, on the model's instants, over each measured stance
    ± 0.25 s.

    Args:
        trials: at least one. walker: of their subject. step_s: of the walks. workers: threads.

    Raises:
        InputError: a trial has another subject than the walker, or another model than the first trial.
    """

    def __init__(self, trials: Sequence[Trial], walker: Walker, *, step_s: float, workers: int) -> None:
        for trial in trials:
            for what, own, common in (("subject", trial.subject, walker.subject),
                                      ("model", trial.model, trials[0].model)):
                if own != common:
                    raise InputError(f"is a trial with another {what}", file=trial.path, where=what,
                                     right="A contact fit takes trials of one subject with one prosthesis")
        self.trials, self.walker, self.step_s, self.workers = tuple(trials), walker, step_s, workers

    def compare(self, trial: Trial, values: Mapping[str, float]) -> Comparison:
        """A trial's walk with these values beside its plate.

        Raises:
            SimulationError: the walk fails.
            InputError: there is no measured stance in the trial's window.
        """
        walk = self.walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s,
                                end_s=trial.end_s, step_s=self.step_s, offsets=trial.offsets, values=values)
        c = compare(self.walker.result(walk, trial, trial.offsets, energy=False), trial.prosthetic_plate)
        if not c.scored.any():
            raise InputError("the prosthetic foot's plate is not loaded in the window", file=trial.path, where="window")
        return c

    def score(self, values: Mapping[str, float]) -> Score:
        """One scenario; a walk that fails makes it lose."""
        total = 0.0
        for i, trial in enumerate(self.trials, start=1):
            try:
                total += float(np.sum(differences(self.compare(trial, values)) ** 2))
            except SimulationError as error:
                return Score(np.inf, i, error)
        return Score(total, len(self.trials))

    def scores(self, scenarios: Sequence[Mapping[str, float]]) -> list[Score]:
        """Of several scenarios, on threads; an interruption waits for those that run, not for the rest."""
        if self.workers == 1:
            return [self.score(values) for values in scenarios]
        with ThreadPoolExecutor(self.workers) as pool:
            futures = [pool.submit(self.score, values) for values in scenarios]
            try:
                return [future.result() for future in futures]
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def carries(self, values: Mapping[str, float]) -> bool:
        """Whether the model's vertical force, taken over all measured stances, is on average at least the plates'.

        Raises:
            SimulationError: a walk fails.
        """
        surplus = 0.0
        for trial in self.trials:
            c = self.compare(trial, values)
            for stance in c.stances:
                rows = c.within(stance.measured.start_s, stance.measured.end_s)
                surplus += float(np.sum(c.model[rows, 2] - c.measured[rows, 2]))
        return surplus >= 0.0

    def carrying_stiffness(self, values: Callable[[float], Mapping[str, float]]) -> tuple[float, int, int]:
        """The initial guess's stiffness (N/mm), raised from SOFTEST_N_PER_MM in steps of RAISE until it `carries`.

        A walk that fails does not carry.

        Args:
            values: the initial guess, by its stiffness.

        Returns:
            Stiffness, walks that were run, walks that failed.

        Raises:
            InputError: it never carries.
            SimulationError: every walk fails.
        """
        stiffness, steps, failed, last = SOFTEST_N_PER_MM, 0, 0, None
        while stiffness <= STIFFEST_N_PER_MM:
            steps += 1
            try:
                if self.carries(values(stiffness)):
                    return stiffness, steps * len(self.trials), failed
            except SimulationError as error:
                failed, last = failed + 1, error
            stiffness *= RAISE
        if last is not None and failed == steps:
            raise last
        raise InputError(
            f"the prosthetic foot does not carry the recorded load with spheres of up to {STIFFEST_N_PER_MM:g} N/mm",
            file=self.trials[0].path, where="offsets",
            right="Check the height of the prosthesis, and that kinematics and forces share time and frame")


def differences(c: Comparison) -> np.ndarray:
    """(k,) N, resultant of the model less the plate's at the scored instants."""
    return np.linalg.norm(c.model[c.scored], axis=1) - np.linalg.norm(c.measured[c.scored], axis=1)


# What the paper's contact fit varies, in the paper's units, and how it draws scenarios.
#
#     contact.ZONE.stiffness            k, N/mm^n      of each of the foot's zones
#     contact.ZONE.exponent             n
#     contact.ZONE.damping              b, N s/mm
#     contact.ZONE.full_damping_depth   mm
#     friction.*                        as in a walk (SI), only if asked for
#
# A normal distribution is not the same in other units. In these, a sphere 1 mm deep carries k whatever n is, so that n
# and k can be drawn independently of each other; in N/m^n they cannot.


FRICTION = ("friction.mu_static", "friction.mu_kinetic", "friction.threshold_velocity")
FULL_DAMPING_MM = 1.0
"""Depth of full damping in the initial guess (McGeehan 2021)."""
DAMPING_OVER_STIFFNESS = 0.5
"""Of the initial guess, N s/mm over N/mm (McGeehan 2021)."""
_MM_PER_M = 1e3


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperSpace:
    """The parameters of one fit.

    Attributes:
        names: (P) of variables of a walk.
        start, low, high: (P,) initial guess and bounds, in the units above.
    """

    names: tuple[str, ...]
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def values(self, x: np.ndarray) -> dict[str, float]:
        """The values of a walk's variables (SI) at x (P,)."""
        own = dict(zip(self.names, map(float, x), strict=True))
        found = dict(own)
        for name, value in own.items():
            if name.endswith(".stiffness"):
                found[name] = value * _MM_PER_M ** own[name.removesuffix("stiffness") + "exponent"]
            elif name.endswith(".damping"):
                found[name] = value * _MM_PER_M
            elif name.endswith(".full_damping_depth"):
                found[name] = value / _MM_PER_M
        return found

    def change(self, x: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of a parameter between two points, over the distance of its bounds."""
        return float(np.max(np.abs(other - x) / (self.high - self.low)))

    def sample(self, centre: np.ndarray, *, count: int, spread: float, random: np.random.Generator) -> np.ndarray:
        """(count, P) scenarios: a Latin hypercube of normal distributions round `centre`, cut off at the bounds.

        Each parameter's distribution is cut into `count` slices of equal probability and each slice is met once (McKay,
        Beckman & Conover 1979, doi 10.1080/00401706.1979.10489755).

        Args:
            spread: standard deviation over the value at the centre, before cutting off.
        """
        columns = []
        for value, low, high in zip(centre, self.low, self.high, strict=True):
            share = (random.permutation(count) + random.uniform(size=count)) / count
            scale = spread * value
            drawn = truncnorm.ppf(share, (low - value) / scale, (high - value) / scale, loc=value, scale=scale)
            columns.append(np.clip(drawn, low, high))
        return np.column_stack(columns)


def paper_space(
    variables: Mapping[str, Variable], stiffness: float, *, fold: float, exponents: tuple[float, float],
    full_damping_mm: tuple[float, float], friction: bool
) -> PaperSpace:
    """The paper's initial guess with one stiffness for all zones, and bounds about it.

    Args:
        variables: of the walker.
        stiffness: N/mm.
        fold: bounds of stiffness and damping are their initial guess divided and multiplied by this.
        exponents, full_damping_mm: bounds.
        friction: whether the coefficients are varied as well, within the variables' own bounds.

    Raises:
        InputError: the initial guess lies outside of bounds, or a bound is out of the model's range.
    """
    damping = DAMPING_OVER_STIFFNESS * stiffness
    law = {"stiffness": (stiffness, stiffness / fold, fold * stiffness), "exponent": (1.0, *exponents),
           "damping": (damping, damping / fold, fold * damping),
           "full_damping_depth": (FULL_DAMPING_MM, *full_damping_mm)}
    rows = {f"contact.{zone}.{name}": row for zone in zones(variables) for name, row in law.items()}
    if friction:
        rows |= {name: (variables[name].default, variables[name].low, variables[name].high) for name in FRICTION}
    for name, (start, low, high) in rows.items():
        if not low <= start <= high or not low < high:
            raise InputError(f"the initial guess {start:g} of {name} does not lie in its bounds {low:g} to {high:g}",
                             where="bounds")
    table = np.array([*rows.values()])
    space = PaperSpace(names=tuple(rows), start=table[:, 0], low=table[:, 1], high=table[:, 2])
    for corner in (space.low, space.high):
        check_values(space.values(corner), variables)
    return space


def zones(variables: Mapping[str, Variable]) -> tuple[str, ...]:
    """The zones of the foot's spheres."""
    return tuple(name.split(".")[1] for name in variables
                 if name.startswith("contact.") and name.endswith(".stiffness"))
