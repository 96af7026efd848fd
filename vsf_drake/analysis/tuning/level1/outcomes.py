"""What a person and a device would notice of a setting: numbers of one walk, averaged over its stances.

Peaks are those of the forces low-passed as for the costs, over stance with its margins. The loading rate is the mean
slope of the vertical force from 20 to 80 % of its first peak, the largest of the first half of stance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.costs import (
    StanceFrame,
    Terms,
    WalkLoads,
    stance_frame,
    walk_loads,
    walk_terms,
)
from vsf_drake.analysis.tuning.level1.options import DesignVariable, TuningOptions, WalkSetting, walk_setting
from vsf_drake.analysis.validation.energy_same_load import prosthesis_energy
from vsf_drake.analysis.validation.energy_section import stance_energy
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walk, Walker

RISE = (0.2, 0.8)


@dataclass(frozen=True)
class OutcomeKind:
    """One number of a walk: its name, what it is, its unit."""

    name: str
    label: str
    unit: str


KINDS = (
    OutcomeKind("stored_energy", "energy stored in keel, foam and support", "J"),
    OutcomeKind("returned_energy", "energy returned by toe-off", "J"),
    OutcomeKind("push_off_work", "push-off work on the shank", "J/kg"),
    OutcomeKind("joint_work_energy", "joint-work estimate of metabolic energy", "J/kg"),
    OutcomeKind("hip_moment", "peak prosthetic hip flexion moment, either sign", "N m/kg"),
    OutcomeKind("knee_moment", "peak prosthetic knee flexion moment, either sign", "N m/kg"),
    OutcomeKind("first_peak", "first peak of the vertical force", "BW"),
    OutcomeKind("second_peak", "second peak of the vertical force", "BW"),
    OutcomeKind("loading_rate", "loading rate of the vertical force", "BW/s"),
    OutcomeKind("socket_force", "peak force on the residual limb", "BW"),
    OutcomeKind("socket_moment", "peak moment on the residual limb", "N m/kg"),
    OutcomeKind("force_change", "change of the ground reaction force from the recorded setting, RMS", "BW"),
    OutcomeKind("pelvis_residual", "force at the pelvis that no leg makes, RMS over stance", "BW"))
ENERGIES = ("stored_energy", "returned_energy")
NAMES = tuple(kind.name for kind in KINDS)


def outcomes(part: TrialTuning, found: WalkOutcome, *, energies: bool = True) -> dict[str, float]:
    """KINDS of one walk; NaN for stored and returned energy where the foot has no whole stance.

    Args:
        energies: whether to work these two out, which takes a third of a walk's time; they are NaN else.
    """
    frame, loads = found.frame, found.loads
    inside = frame.inside > 0.0
    vertical = loads.grf.value[:, 2] / frame.weight_n
    joints = dict(zip(part.options.joints, np.abs(loads.joints.value[inside] / frame.mass_kg).T, strict=True))
    socket = loads.socket.value[inside]
    residual = np.sum(loads.pelvis**2, axis=1) @ frame.inside / frame.inside.sum()
    numbers = {
        **(_energies(part, found) if energies else dict.fromkeys(ENERGIES, float("nan"))),
        "push_off_work": -sum(term.value for term in found.terms["push_off"]),
        "joint_work_energy": sum(term.value for term in found.terms["metabolic"]),
        "hip_moment": _largest(joints.get("hip_flexion")), "knee_moment": _largest(joints.get("knee_angle")),
        **_vertical(frame, vertical),
        "socket_force": float(np.linalg.norm(socket[:, :3], axis=1).max() / frame.weight_n),
        "socket_moment": float(np.linalg.norm(socket[:, 3:], axis=1).max() / frame.mass_kg),
        "force_change": float(np.sqrt(sum(term.value for term in found.terms["consistency"]))),
        "pelvis_residual": float(np.sqrt(residual) / frame.weight_n)}
    return {name: numbers[name] for name in NAMES}


def _largest(history: np.ndarray | None) -> float:
    return float("nan") if history is None else float(history.max())


def _energies(part: TrialTuning, found: WalkOutcome) -> dict[str, float]:
    energy = prosthesis_energy(part.walker, found.walk)
    stances = [s for s in find_stances(energy.time_s, energy.vertical_n) if s.complete]
    rows = [stance_energy(energy, stance, foot=part.trial.model.foot, fulcrum_m=float(found.walk.fulcrum_m[0])).row
            for stance in stances]
    return {name: float(np.mean([row[name.replace("energy", "j")] for row in rows])) if rows else float("nan")
            for name in ENERGIES}


def _vertical(frame: StanceFrame, vertical: np.ndarray) -> dict[str, float]:
    time, found = frame.time_s, []
    margin = 0.5 * (frame.inside.sum() - frame.duration_s) / frame.count
    for stance in frame.stances:
        middle = 0.5 * (stance.start_s + stance.end_s)
        early = (time >= stance.start_s - margin) & (time <= middle)
        late = (time >= middle) & (time <= stance.end_s + margin)
        first, second = float(vertical[early].max()), float(vertical[late].max())
        rising, t = vertical[early][: int(vertical[early].argmax()) + 1], time[early]
        at = [float(np.interp(share * first, np.maximum.accumulate(rising), t[: len(rising)])) for share in RISE]
        found.append((first, second, (RISE[1] - RISE[0]) * first / max(at[1] - at[0], frame.step_s)))
    means = np.mean(found, axis=0)
    return dict(zip(("first_peak", "second_peak", "loading_rate"), map(float, means), strict=True))


# One trial of a tuning: walks it at any setting and takes the costs of the walk.


@dataclass(frozen=True, eq=False)
class WalkOutcome:
    """One walk of a trial at one setting.

    Attributes:
        terms: of all costs. walk, loads: what they were made of. frame: the trial's.
    """

    terms: Terms
    walk: Walk
    loads: WalkLoads
    frame: StanceFrame


class TrialTuning:
    """One trial of a tuning.

    Args:
        walker: of the trial's person and device; trials may share it.
        label: of the trial.
        design: what is tuned, the fulcrum first.

    Attributes:
        joints: the options', with the side. support_width_m: the options', or what the keel's joints leave room for.
    """

    def __init__(
        self, walker: Walker, trial: Trial, label: str, design: tuple[DesignVariable, ...], options: TuningOptions
    ) -> None:
        self.walker, self.trial, self.label, self.design, self.options = walker, trial, label, design, options
        side = trial.subject.prosthetic_side[0]
        self.joints = tuple(f"{name}_{side}" for name in options.joints)
        keel = gait_mechanism(walker.gait, walker.context).keel_starts
        self.support_width_m = min(options.support_width_m, 0.5 * float(np.diff(keel).min()))
        self._frames: dict[tuple, StanceFrame] = {}

    @property
    def own(self) -> np.ndarray:
        """(P,) the trial's own setting: where its fulcrum stood, the device as it is."""
        return np.array([1e3 * self.trial.fulcrum_m, *(variable.default for variable in self.design[1:])])

    def frame(self, step_s: float, base: Mapping[str, float] | None = None) -> StanceFrame:
        """What no setting changes, on the instants of walks in steps of `step_s`.

        Args:
            base: see `at`; forces at the trial's own setting are those with these values.

        Raises:
            InputError: the trial has no whole stance of the prosthetic foot. SimulationError: its walk diverges.
        """
        key = (step_s, *(base or {}).items())
        if key not in self._frames:
            walk = self._walk(self.own, step_s, base or {})
            own = walk_loads(self.walker, walk, None, joints=self.joints, cutoff_hz=self.options.cutoff_hz)
            self._frames[key] = stance_frame(
                self.walker, self.trial, walk, own, joints=self.joints, late_share=self.options.late_share,
                margin_s=self.options.margin_s, cutoff_hz=self.options.cutoff_hz)
        return self._frames[key]

    def at(
        self, x: np.ndarray, *, step_s: float, derivatives: bool = False, base: Mapping[str, float] | None = None
    ) -> WalkOutcome:
        """Walks at x (P,), values of the design in its units.

        Args:
            base: values of the walk's variables in place of the model's.

        Raises:
            SimulationError: the walk diverges.
        """
        frame = self.frame(step_s, base)
        walk, by = self._walk(x, step_s, base or {}, derivatives=derivatives), None
        if derivatives:
            by = self._setting(x, base or {}).by
        loads = walk_loads(self.walker, walk, by, joints=self.joints, cutoff_hz=self.options.cutoff_hz)
        return WalkOutcome(walk_terms(frame, loads, self.options), walk, loads, frame)

    def own_terms(self, step_s: float) -> Terms:
        """Costs at the trial's own setting."""
        frame = self.frame(step_s)
        return walk_terms(frame, frame.own, self.options)

    def _setting(self, x: np.ndarray, base: Mapping[str, float]) -> WalkSetting:
        return walk_setting(self.design, x, self.walker.variables, self.trial.model.foot, base)

    def _walk(self, x: np.ndarray, step_s: float, base: Mapping[str, float], *, derivatives: bool = False) -> Walk:
        setting, trial = self._setting(x, base), self.trial
        return self.walker.walk(
            trial.trajectory, fulcrum_m=setting.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s, step_s=step_s,
            offsets=trial.offsets, values=setting.values, with_respect_to=setting.names if derivatives else (),
            with_loads=derivatives,
            support_width_m=self.support_width_m)
