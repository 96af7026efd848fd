"""One trial of a tuning: walks it at any setting and takes the costs of the walk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.combination import Terms, walk_terms
from vsf_drake.analysis.tuning.level1.frame import StanceFrame, stance_frame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads, walk_loads
from vsf_drake.analysis.tuning.level1.options import TuningOptions
from vsf_drake.analysis.tuning.level1.variables import DesignVariable, WalkSetting, walk_setting
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walker
from vsf_drake.simulation.walk_run import Walk


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
