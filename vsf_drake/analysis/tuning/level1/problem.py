"""The tuning of a foot's stiffness to recorded motion, as a mathematical program.

    minimise    J(x) = mean over trials of sum over costs of factor * cost(walk of the trial at x)
    subject to  low <= x <= high

over x, the fulcrum position and what else of the device is tuned (`options`), searched in
u = (x - low) / (high - low). The motion is the recorded one at every x. Derivatives are the walks' own, exact for the
numerical solution (`Walker.walk`, `with_respect_to`).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import MathematicalProgram

from vsf_drake.analysis.contact_fit.recordings import labels_of
from vsf_drake.analysis.tuning.level1.costs import TRACKING, Combination, CostTerm, Terms, combine, sizes
from vsf_drake.analysis.tuning.level1.options import COSTS, WEIGHTED, TuningOptions, design_variables
from vsf_drake.analysis.tuning.level1.outcomes import TrialTuning, WalkOutcome
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.walk import Walker


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The cost at one setting.

    Attributes:
        x: (P,) the setting. step_s: of the walks.
        terms: of the cost, means over trials, each with its gradient.
        per_trial: (T,) the cost of each trial alone. walks: of each trial.
    """

    x: np.ndarray
    step_s: float
    terms: tuple[CostTerm, ...]
    per_trial: np.ndarray
    walks: tuple[WalkOutcome, ...]

    @property
    def cost(self) -> float:
        """J, in the unit of the cost."""
        return float(sum(term.value for term in self.terms))

    @property
    def gradient(self) -> np.ndarray:
        """(P,) of J, per unit of each design variable."""
        found: np.ndarray = np.sum([term.by for term in self.terms], axis=0)
        return found

    @property
    def unconverged(self) -> int:
        """Steps of the walks that did not converge."""
        return int(sum(np.sum(~walk.walk.record.converged) for walk in self.walks))


class StiffnessTuning:
    """One person's trials, and the cost by which the foot is to be tuned to them.

    Args:
        trials: one or more, with the contact that was fitted to them (`motion.fitted_trial.trial_with`).
        cost: "joint_load", "metabolic", "push_off", "tracking" or "weighted"; see `costs`.
        options: how.
        labels: of the trials; their files' names if None.
        tasks: name of the motion that each trial is of, such as a speed; trials of one name share a setting in the
            comparison of one setting for all with one for each. Every trial its own if None.
        walkers: of the trials, built before; made here if None.

    Attributes:
        design: what is tuned, the fulcrum first. low, high: (P,) its bounds.
        combination: the cost. size: of each cost at the trials' own settings.
        evaluations: how many settings were evaluated.

    Raises:
        InputError: the trials do not belong together or do not support the cost; bounds are out of reach; a trial has
            no whole stance of the prosthetic foot.
        SimulationError: a trial cannot be walked at its own setting.
    """

    def __init__(
        self, trials: Sequence[Trial], *, cost: str = "joint_load", options: TuningOptions | None = None,
        labels: Sequence[str] | None = None, tasks: Sequence[str] | None = None,
        walkers: Sequence[Walker] | None = None
    ) -> None:
        self.options = options or TuningOptions()
        if not isinstance(self.options, TuningOptions):
            raise InputError(f"is a {type(options).__name__}, no TuningOptions", where="options")
        self.cost_name = check_cost(cost)
        check_trials(trials)
        check_support(cost, trials, self.options)
        self.trials = tuple(trials)
        self.labels = _names(labels, labels_of(trials), "labels")
        self.tasks = _names(tasks, self.labels, "tasks")
        self.design = design_variables(self.options, [trial.model.foot for trial in trials])
        self.low, self.high = (np.array([getattr(v, end) for v in self.design]) for end in ("low", "high"))
        walkers = _walkers(trials) if walkers is None else walkers
        self.parts = tuple(TrialTuning(walker, trial, label, self.design, self.options)
                           for walker, trial, label in zip(walkers, trials, self.labels, strict=True))
        self.own: tuple[Terms, ...] = tuple(part.own_terms(self.options.step_s) for part in self.parts)
        self.size = sizes(list(self.own))
        needed = [name for name, weight in self.options.weights.items() if weight > 0.0] if cost == WEIGHTED else [cost]
        if any(name not in self.size for name in needed):
            raise InputError("the force of a trial's plate does not cover its window", where="trials",
                             right="Choose a window that the plate covers, or another cost")
        self.combination: Combination = combine(cost, self.size, self.options)
        self.evaluations = 0
        self._last: tuple[tuple, Evaluation] | None = None

    def without_smoothing(self) -> StiffnessTuning:
        """The same problem with a support that passes a keel joint at once."""
        return StiffnessTuning(
            self.trials, cost=self.cost_name, options=dataclasses.replace(self.options, support_width_m=0.0),
            labels=self.labels, tasks=self.tasks, walkers=[part.walker for part in self.parts])

    @property
    def start(self) -> np.ndarray:
        """(P,) the trials' own setting on average, within the bounds."""
        mean: np.ndarray = np.mean([part.own for part in self.parts], axis=0)
        return np.clip(mean, self.low, self.high)

    def from_u(self, u: np.ndarray) -> np.ndarray:
        """(P,) the setting at search coordinates within 0 and 1."""
        found: np.ndarray = self.low + np.asarray(u, dtype=float) * (self.high - self.low)
        return np.clip(found, self.low, self.high)

    def to_u(self, x: np.ndarray) -> np.ndarray:
        """(P,) search coordinates of a setting."""
        found: np.ndarray = (np.asarray(x, dtype=float) - self.low) / (self.high - self.low)
        return found

    def evaluate(
        self, x: np.ndarray, *, derivatives: bool = True, step_s: float | None = None,
        base: Mapping[str, float] | None = None
    ) -> Evaluation:
        """The cost at x (P,); trials are walked side by side.

        Args:
            step_s: of the walks; that of the options if None.
            base: values of the walks' variables in place of the model's.

        Raises:
            SimulationError: a walk fails there.
        """
        x = np.array(x, dtype=float)
        step = step_s or self.options.step_s
        key = (tuple(x), step, tuple((base or {}).items()))
        if self._last is not None and self._last[0] == key and (
                not derivatives or self._last[1].gradient.shape == x.shape):
            return self._last[1]
        self.evaluations += 1

        def one(part: TrialTuning) -> WalkOutcome:
            return part.at(x, step_s=step, derivatives=derivatives, base=base)

        if len(self.parts) == 1:
            walks = [one(self.parts[0])]
        else:
            with ThreadPoolExecutor(min(len(self.parts), self.workers)) as pool:
                walks = list(pool.map(one, self.parts))
        found = self.evaluation(x, step, walks)
        self._last = (key, found)
        return found

    def evaluation(self, x: np.ndarray, step_s: float, walks: Sequence[WalkOutcome]) -> Evaluation:
        """The cost that the trials' walks at x make."""
        each = [self.combination.terms(walk.terms) for walk in walks]
        means = tuple(CostTerm(terms[0].name, terms[0].label, float(np.mean([term.value for term in terms])),
                               np.mean([term.by for term in terms], axis=0)) for terms in zip(*each, strict=True))
        return Evaluation(x=x, step_s=step_s, terms=means, walks=tuple(walks),
                          per_trial=np.array([sum(term.value for term in terms) for terms in each]))

    @property
    def own_cost(self) -> float:
        """The cost with each trial at its own setting."""
        return float(np.mean([sum(term.value for term in self.combination.terms(own)) for own in self.own]))

    @property
    def groups(self) -> tuple[float, ...]:
        """(T,) mm, where the fulcrum stood in each trial: trials of one position repeat each other."""
        return tuple(round(float(part.own[0]), 1) for part in self.parts)

    @property
    def workers(self) -> int:
        """Threads."""
        return self.options.workers or os.cpu_count() or 1

    def program(
        self, cost: Callable[[np.ndarray, bool], tuple[float, np.ndarray]] | None = None
    ) -> MathematicalProgram:
        """The tuning for Drake's solvers: u within 0 and 1, and the cost over its size with its gradient.

        Args:
            cost: (u, whether the gradient is wanted) -> (cost over its size, gradient by u), e.g. to survive walks that
                fail; this problem's own if None.
        """
        evaluate = cost or self.scaled
        program = MathematicalProgram()
        u = program.NewContinuousVariables(len(self.design), "u")
        program.AddBoundingBoxConstraint(0.0, 1.0, u)

        def of(at: np.ndarray) -> float | AutoDiffXd:
            if at.dtype != object:
                return evaluate(at, False)[0]
            value, gradient = evaluate(ExtractValue(at).ravel(), True)
            return AutoDiffXd(value, gradient @ np.array([entry.derivatives() for entry in at]))

        program.AddCost(of, vars=u)
        program.SetInitialGuess(u, self.to_u(self.start))
        return program

    def scaled(
        self, u: np.ndarray, gradient: bool = True, *, step_s: float | None = None
    ) -> tuple[float, np.ndarray]:
        """The cost over its size at search coordinates u (P,), and its gradient (P,) by them, empty without."""
        found, size = self.evaluate(self.from_u(u), derivatives=gradient, step_s=step_s), self.combination.size
        return found.cost / size, found.gradient * (self.high - self.low) / size if gradient else np.zeros(0)


def _names(given: Sequence[str] | None, default: tuple[str, ...], where: str) -> tuple[str, ...]:
    if given is None:
        return default
    if isinstance(given, str) or len(given) != len(default) or not all(isinstance(name, str) for name in given):
        raise InputError(f"{given!r} does not name {len(default)} trials", where=where, right="Give one name a trial")
    return tuple(given)


def _walkers(trials: Sequence[Trial]) -> list[Walker]:
    """One walker for each person with a device: several trials share it."""
    known: list[Walker] = []
    found = []
    for trial in trials:
        own = next((w for w in known if w.subject == trial.subject and w.model == trial.model), None)
        if own is None:
            own = Walker(trial.subject, trial.model)
            known.append(own)
        found.append(own)
    return found


# Whether trials can bear a tuning and its cost.


OUT_OF_PLANE = ("adduction", "rotation")
_ZERO = "taken as zero"
"""What the note on a coordinate says that the recording does not hold."""


def check_cost(cost: str) -> str:
    """Returns the name of a cost. Raises InputError if there is none of that name."""
    known = (*COSTS, WEIGHTED)
    if cost not in known:
        raise InputError(f"there is no cost {cost!r}", where="cost", right=f"There are: {', '.join(known)}")
    return cost


def check_trials(trials: Sequence[Trial]) -> None:
    """Raises InputError unless these are trials, at least one, of prostheses on one side."""
    if isinstance(trials, (Trial, str, bytes)) or not all(isinstance(trial, Trial) for trial in trials):
        raise InputError("is no list of trials", where="trials", right="Give a list of what load_trial returns")
    if not trials:
        raise InputError("there is no trial to tune to", where="trials")
    first = trials[0]
    for trial in trials:
        if trial.subject.prosthetic_side != first.subject.prosthetic_side:
            raise InputError(
                f"its prosthesis is on the {trial.subject.prosthetic_side}, that of {first.path} on the "
                f"{first.subject.prosthetic_side}", file=trial.path, where="subject", right="Tune one person at a time")


def check_support(cost: str, trials: Sequence[Trial], options: TuningOptions) -> None:
    """Whether the data support `cost`.

    Raises:
        InputError: moments out of the sagittal plane are asked for where the recording has no such motion; a force is
            to be tracked that no plate measured, or of which one component is missing.
    """
    named = tuple(name for name, weight in options.weights.items() if weight > 0.0) if cost == WEIGHTED else (cost,)
    for trial in trials:
        if {"joint_load", "metabolic"} & set(named):
            _check_planes(trial, options)
        if TRACKING in named:
            _check_plate(trial)


def _check_planes(trial: Trial, options: TuningOptions) -> None:
    side = trial.subject.prosthetic_side[0]
    for joint in options.joints:
        name = f"{joint}_{side}"
        if any(part in joint for part in OUT_OF_PLANE) and _unmeasured(trial, name):
            planar = [other for other in options.joints if not any(part in other for part in OUT_OF_PLANE)]
            raise InputError(
                f"the recording has no {name}, so that no moment about that axis can be told", file=trial.path,
                where="kinematics", right=f"Give joints={tuple(planar) or ('hip_flexion', 'knee_angle')}, or a "
                                          "recording in three dimensions")


def _unmeasured(trial: Trial, name: str) -> bool:
    said = any(_ZERO in note and name in note.replace(",", " ").replace(".", " ").split() for note in trial.notes)
    column = trial.trajectory.names.index(name) if name in trial.trajectory.names else None
    return said or column is None or bool(np.ptp(trial.trajectory.values[:, column]) == 0.0)


def _check_plate(trial: Trial) -> None:
    side = trial.subject.prosthetic_side
    plate = trial.plates.get(side)
    if plate is None or not np.any(plate.force_W[:, 2] > 0.0):
        raise InputError(f"no plate measured the force on the {side} (prosthetic) foot, which is to be tracked",
                         file=trial.path, where="forces", right="Choose another cost, or a trial with forces")
    for i, axis in enumerate(("fore-aft", "lateral")):
        if not np.any(plate.force_W[:, i]):
            raise InputError(f"its plate has no {axis} force (zero throughout), and all components are tracked",
                             file=trial.path, where="forces",
                             right="Choose another cost, or a trial with all components of the force")
