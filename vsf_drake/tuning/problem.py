"""The tuning of a foot's stiffness to recorded motion, as a mathematical program.

    minimise    J(x) = mean over trials of sum over costs of factor * cost(walk of the trial at x)
    subject to  low <= x <= high

over x, the fulcrum position and what else of the device is tuned (`options`), searched in u = (x -
low) / (high - low). The motion is the recorded one at every x. Derivatives are the walks' own,
exact for the numerical solution (`Walker.walk`, `with_respect_to`).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import SimulationError, require
from vsf_drake.base.threads import side_by_side
from vsf_drake.motion.events import within
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walk, Walker, trial_request
from vsf_drake.tuning import costs
from vsf_drake.tuning.common import WEIGHTED, check_cost
from vsf_drake.tuning.options import DesignVariable, TuningOptions, design_variables, walk_setting
from vsf_drake.walks.recorded_walk import labels_of


@dataclass(frozen=True, eq=False)
class SettingOutcome:
    """One walk of a trial at one setting."""

    terms: dict[str, costs.Terms]
    walk: Walk
    loads: costs.WalkLoads
    frame: costs.StanceFrame


class TrialTuning:
    """One trial of a tuning: walks it at any setting of `design`, the fulcrum first, and takes the
    walk's costs."""

    def __init__(
        self,
        walker: Walker,
        trial: Trial,
        label: str,
        design: tuple[DesignVariable, ...],
        options: TuningOptions,
    ) -> None:
        self.walker = walker
        self.trial = trial
        self.label = label
        self.design = design
        self.options = options
        self.joints = tuple(f"{name}_{trial.subject.prosthetic_side[0]}" for name in options.joints)
        keel = gait_mechanism(walker.gait, walker.context).keel_starts
        self.support_width_m = min(options.support_width_m, 0.5 * float(np.diff(keel).min()))
        # (P,) where its fulcrum stood, the device as it is.
        self.own = np.array([1e3 * trial.fulcrum_m, *(variable.default for variable in design[1:])])
        self._frames: dict[tuple[object, ...], costs.StanceFrame] = {}

    def frame(self, step_s: float, base: Mapping[str, float] | None = None) -> costs.StanceFrame:
        """What no setting changes, on the instants of walks in steps of `step_s`; `base` as of
        `at`."""
        key = (step_s, *(base or {}).items())
        if key not in self._frames:
            walk, own = self._walk(self.own, step_s, base or {})
            self._frames[key] = costs.stance_frame(
                self.walker, self.trial, walk, own, self.joints, self.options
            )
        return self._frames[key]

    def at(
        self,
        x: np.ndarray,
        *,
        step_s: float,
        derivatives: bool = False,
        base: Mapping[str, float] | None = None,
    ) -> SettingOutcome:
        """Walks at x (P,), with values of its variables in `base` instead of the model's; or
        SimulationError."""
        frame = self.frame(step_s, base)
        walk, loads = self._walk(x, step_s, base or {}, derivatives=derivatives)
        return SettingOutcome(costs.walk_terms(frame, loads, self.options), walk, loads, frame)

    def at_each(
        self,
        settings: np.ndarray,
        *,
        step_s: float,
        base: Mapping[str, float] | None = None,
        sites: bool = False,
    ) -> Iterator[SettingOutcome | SimulationError]:
        """`at` each of the settings (m, P), without derivatives, or why it fails; `sites` as of
        `Walker.walk_many`."""
        frame = self.frame(step_s, base)
        requests = [self._request(x, step_s, base or {})[0] for x in settings]
        for walk in self.walker.walk_each(requests, sites=sites):
            if isinstance(walk, Walk):
                loads = self.loads(walk, None)
                terms = costs.walk_terms(frame, loads, self.options)
                yield SettingOutcome(terms, walk, loads, frame)
            elif isinstance(walk, SimulationError):
                yield walk
            else:
                raise walk

    def _walk(
        self, x: np.ndarray, step_s: float, base: Mapping[str, float], *, derivatives: bool = False
    ) -> tuple[Walk, costs.WalkLoads]:
        request, by = self._request(x, step_s, base)
        walk = self.walker.walk(
            **request,
            with_respect_to=tuple(by) if derivatives else (),
            with_loads=derivatives,
        )
        return walk, self.loads(walk, np.array([*by.values()]) if derivatives else None)

    def _request(
        self, x: np.ndarray, step_s: float, base: Mapping[str, float]
    ) -> tuple[dict[str, Any], Mapping[str, np.ndarray]]:
        """What `Walker.walk` takes at x, and the derivatives of its values by x."""
        trial = self.trial
        values, by = walk_setting(self.design, x, self.walker.variables, trial.model.foot, base)
        return trial_request(
            trial,
            fulcrum_m=1e-3 * x[0],
            step_s=step_s,
            values=values,
            support_width_m=self.support_width_m,
        ), by

    def loads(self, walk: Walk, by: np.ndarray | None = None) -> costs.WalkLoads:
        """Of a walk of the trial; `by` as of `costs.walk_loads`."""
        return costs.walk_loads(self.walker, walk, by, self.joints, self.options.cutoff_hz)


@dataclass(frozen=True, eq=False)
class TuningEvaluation:
    """The cost at one setting x (P,)."""

    x: np.ndarray
    step_s: float
    terms: costs.Terms  # means over trials
    walks: tuple[SettingOutcome, ...]  # of each trial

    @property
    def cost(self) -> float:
        return costs.value_of(self.terms)

    @property
    def gradient(self) -> np.ndarray:
        """(P,) of J, per unit of each design variable; empty without derivatives."""
        return np.asarray(np.sum([*self.terms.values()], axis=0)[1:])

    @property
    def unconverged(self) -> int:
        return int(sum(np.sum(~walk.walk.record.converged) for walk in self.walks))


class StiffnessTuning:
    """One person's trials, and the cost by which the foot is to be tuned to them.

    Args:
        trials: one or more, with the contact that was fitted to them
            (`motion.fitted_trial.trial_with`).
        cost: "joint_load", "metabolic", "push_off", "tracking" or "weighted"; see `costs`.
        walkers: of the trials, built before; made here if None.

    InputError: the trials do not belong together or do not support the cost; bounds are out of
    reach; a trial has no whole stance of the prosthetic foot. SimulationError: a trial cannot be
    walked at its own setting.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        *,
        cost: str = "joint_load",
        options: TuningOptions | None = None,
        labels: Sequence[str] | None = None,
        walkers: Sequence[Walker] | None = None,
    ) -> None:
        self.options = options or TuningOptions()
        self.cost_name = check_cost(cost)
        needed = self.options.weighed if cost == WEIGHTED else (cost,)
        _check_trials(trials, needed, self.options)
        self.trials = tuple(trials)
        self.synthetic = any(trial.synthetic for trial in trials)
        self.labels = _names(labels, labels_of(trials), "labels")
        # the fulcrum first
        self.design = design_variables(self.options, [trial.model.foot for trial in trials])
        self.low, self.high = (
            np.array([getattr(v, end) for v in self.design]) for end in ("low", "high")
        )
        self.parts = tuple(
            TrialTuning(walker, trial, label, self.design, self.options)
            for walker, trial, label in zip(
                walkers or _walkers(trials), trials, self.labels, strict=True
            )
        )
        frames = [part.frame(self.options.step_s) for part in self.parts]
        # Costs at the trials' own settings.
        self.own = [costs.walk_terms(frame, frame.own, self.options) for frame in frames]
        self.size = costs.sizes(self.own)
        require(
            not any(name not in self.size for name in needed),
            "the force of a trial's plate does not cover its window",
            "trials",
            "Choose a window that the plate covers, or another cost",
        )
        self.combination = costs.combine(cost, self.size, self.options)
        self.own_cost = float(
            np.mean([costs.value_of(self.combination.terms(own)) for own in self.own])
        )
        # (P,)
        self.start = np.clip(
            np.mean([part.own for part in self.parts], axis=0), self.low, self.high
        )
        # Where the fulcrum stood (mm): trials of one position repeat each other.
        self.groups = tuple(round(float(part.own[0]), 1) for part in self.parts)
        self.workers = self.options.workers or os.cpu_count() or 1
        self.evaluations = 0
        self._last: TuningEvaluation | None = None

    def without_smoothing(self) -> StiffnessTuning:
        """The same problem with a support that passes a keel joint at once."""
        return StiffnessTuning(
            self.trials,
            cost=self.cost_name,
            labels=self.labels,
            options=dataclasses.replace(self.options, support_width_m=0.0),
            walkers=[part.walker for part in self.parts],
        )

    def from_u(self, u: np.ndarray) -> np.ndarray:
        x: np.ndarray = np.clip(
            self.low + np.asarray(u) * (self.high - self.low), self.low, self.high
        )
        return x

    def to_u(self, x: np.ndarray) -> np.ndarray:
        return np.asarray((x - self.low) / (self.high - self.low))

    def evaluate(
        self, x: np.ndarray, *, derivatives: bool = True, step_s: float | None = None
    ) -> TuningEvaluation:
        """The cost at x (P,), in the options' step or another; SimulationError where a walk
        fails."""
        x = np.array(x, dtype=float)
        step = step_s or self.options.step_s
        last = self._last
        if (
            last is not None
            and last.step_s == step
            and np.array_equal(last.x, x)
            and (not derivatives or last.gradient.shape == x.shape)
        ):
            return last
        self.evaluations += 1
        with side_by_side(min(len(self.parts), self.workers)) as pool:
            walks = tuple(
                pool.map(lambda part: part.at(x, step_s=step, derivatives=derivatives), self.parts)
            )
        each = [self.combination.terms(walk.terms) for walk in walks]
        means = {name: np.mean([terms[name] for terms in each], axis=0) for name in each[0]}
        self._last = TuningEvaluation(x=x, step_s=step, terms=means, walks=walks)
        return self._last


def _names(given: Sequence[str] | None, default: tuple[str, ...], where: str) -> tuple[str, ...]:
    if given is None:
        return default
    require(
        not isinstance(given, str)
        and len(given) == len(default)
        and all(isinstance(name, str) for name in given),
        f"{given!r} does not name {len(default)} trials",
        where,
        "Give one name a trial",
    )
    return tuple(given)


def _walkers(trials: Sequence[Trial]) -> list[Walker]:
    walkers: list[Walker] = []
    for trial in trials:
        same = (
            walker
            for walker in walkers
            if (walker.subject, walker.model) == (trial.subject, trial.model)
        )
        walkers.append(next(same, None) or Walker(trial.subject, trial.model))
    return walkers


def _check_trials(trials: Sequence[Trial], needed: Sequence[str], options: TuningOptions) -> None:
    require(
        not isinstance(trials, (Trial, str, bytes))
        and all(isinstance(trial, Trial) for trial in trials),
        "is no list of trials",
        "trials",
        "Give a list of what load_trial returns",
    )
    require(trials, "there is no trial to tune to", "trials")
    first = trials[0]
    for trial in trials:
        side = trial.subject.prosthetic_side
        require(
            side == first.subject.prosthetic_side,
            f"its prosthesis is on the {side}, that of {first.path} on the "
            f"{first.subject.prosthetic_side}",
            "subject",
            "Tune one person at a time",
            file=trial.path,
        )
        if {"joint_load", "metabolic"} & set(needed):
            _check_planes(trial, options.joints)
        if costs.TRACKING not in needed:
            continue
        right = "Choose another cost, or a trial with "
        plate = trial.plates.get(side)
        known = np.zeros((0, 3))
        if plate is not None:
            known = plate.force_W[~within(plate.time_s, trial.unmeasured.get(side, ()))]
        require(
            np.any(known[:, 2] > 0.0),
            f"no plate measured the force on the {side} (prosthetic) foot, which is to be tracked",
            "forces",
            f"{right}forces",
            file=trial.path,
        )
        for i, axis in enumerate(("fore-aft", "lateral")):
            require(
                np.any(known[:, i]),
                f"its plate has no {axis} force (zero throughout), and all components are tracked",
                "forces",
                f"{right}all components of the force",
                file=trial.path,
            )


def _check_planes(trial: Trial, joints: Sequence[str]) -> None:
    """Raises InputError for moments out of the sagittal plane where the recording has no such
    motion."""
    planar = [joint for joint in joints if not joint.endswith(("adduction", "rotation"))]
    names = trial.trajectory.names
    for joint in (joint for joint in joints if joint not in planar):
        name = f"{joint}_{trial.subject.prosthetic_side[0]}"
        noted = any(
            "taken as zero" in note and name in note.replace(",", " ").replace(".", " ").split()
            for note in trial.notes
        )
        require(
            not noted
            and name in names
            and np.ptp(trial.trajectory.values[:, names.index(name)]) != 0.0,
            f"the recording has no {name}, so that no moment about that axis can be told",
            "kinematics",
            f"Give joints={tuple(planar) or ('hip_flexion', 'knee_angle')}, or a "
            "recording in three dimensions",
            file=trial.path,
        )
