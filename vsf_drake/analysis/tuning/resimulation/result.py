"""What a re-simulation leaves, and what it says about the solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.resimulation.differences import STRIDE, ForceDifference
from vsf_drake.analysis.tuning.resimulation.feedback_use import FeedbackUse
from vsf_drake.errors import SimulationError

PRESCRIBED, FEEDBACK = "prescribed", "feedback"
TARGET_PERCENT_BW = {PRESCRIBED: 3.0, FEEDBACK: 5.0}
"""What a re-simulation may differ by (a choice): root mean square of a foot's resultant over the stride, 40 Hz."""
LABEL = {PRESCRIBED: "re-simulation with the motion prescribed", FEEDBACK: "re-simulation with torques and feedback"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Resimulation:
    """A solution carried out by the stepper with the full model.

    Attributes:
        kind: "prescribed" or "feedback".
        fell: the run ended before the solution did, or the person was down. Reading a difference of such a one raises
            SimulationError. fell_after_s, why: when, from the run's start, and how; None and "" otherwise.
        time_s: (n,) s, the solution's instants. counted: (n,) bool, those that are compared: not the transient of
            the start, nothing after a fall.
        solution_grf: by foot (n, 2) N, of the solution. grf, filtered_grf: the same of the re-simulation, as the
            stepper gives it and low-passed at 40 Hz; NaN where not `counted`.
        forces: the differences of both feet, as they are and filtered.
        motion_rms: by coordinate, root mean square deviation from the solution, deg or mm; {} if prescribed.
        lateral_percent_bw: largest lateral force on a foot; the solution knows none.
        unconverged_steps: of the run, accepted without convergence.
        feedback: what the torques did beyond the solution's; None if prescribed.
        walk_time_s, walk_q, walk_grf, walk_filtered_grf: the re-simulation at its own steps over the compared time,
            (m,) s, (m, 8), and by foot (m, 2) N.
        notes: what else to know of the run.
    """

    kind: str
    fell: bool
    fell_after_s: float | None
    why: str
    time_s: np.ndarray
    counted: np.ndarray
    solution_grf: Mapping[str, np.ndarray]
    grf: Mapping[str, np.ndarray]
    filtered_grf: Mapping[str, np.ndarray]
    forces: tuple[ForceDifference, ...]
    motion_rms: Mapping[str, float]
    lateral_percent_bw: float
    unconverged_steps: int
    feedback: FeedbackUse | None
    walk_time_s: np.ndarray
    walk_q: np.ndarray
    walk_grf: Mapping[str, np.ndarray]
    walk_filtered_grf: Mapping[str, np.ndarray]
    notes: tuple[str, ...] = ()

    def check(self) -> None:
        """Raises SimulationError if the person fell."""
        if self.fell:
            raise SimulationError(f"the {LABEL[self.kind]} fell: {self.why}",
                                  time_s=float("nan") if self.fell_after_s is None else self.fell_after_s)

    def difference(self, foot: str, *, over: str = STRIDE, filtered: bool = True) -> ForceDifference:
        """One of `forces`; raises SimulationError if the person fell."""
        self.check()
        return next(d for d in self.forces if (d.foot, d.over, d.filtered) == (foot, over, filtered))

    @property
    def percent_bw(self) -> float:
        """The number to judge by: the larger of both feet's differences of the resultant over the stride, 40 Hz.

        Raises:
            SimulationError: the person fell.
        """
        self.check()
        return max(d.resultant for d in self.forces if d.over == STRIDE and d.filtered)

    @property
    def met(self) -> bool:
        """Whether it stayed up and within its target, without a hand's help."""
        helped = self.feedback is not None and self.feedback.hand_percent_bw > 0.0
        return not self.fell and not helped and self.percent_bw <= TARGET_PERCENT_BW[self.kind]

    def check_row(self) -> dict[str, Any]:
        """As one of the checks that a tuning leaves."""
        target = TARGET_PERCENT_BW[self.kind]
        return {"name": f"resimulation_{self.kind}", "label": LABEL[self.kind],
                "value": None if self.fell else self.percent_bw, "unit": "% body weight", "target": f"{target:g}",
                "met": self.met, "sentence": " ".join(self.sentences())}

    def arrays(self) -> dict[str, np.ndarray]:
        """What a figure of the solution shows of it, on the solution's instants: the ground reaction at 40 Hz."""
        return {f"grf_{foot}_resimulated_{self.kind}": np.array(force) for foot, force in self.filtered_grf.items()}

    def sentences(self) -> tuple[str, ...]:
        """What it found, in words."""
        if self.fell:
            return (f"The {LABEL[self.kind]} fell after {self.fell_after_s:.2f} s: {self.why}.", *self._helped())
        raw = max(d.resultant for d in self.forces if d.over == STRIDE and not d.filtered)
        stance = max(d.resultant for d in self.forces if d.over != STRIDE and d.filtered)
        parts = max(max(d.fore_aft, d.vertical) for d in self.forces if d.over == STRIDE and d.filtered)
        said = [f"The {LABEL[self.kind]} differs from the solution's ground reaction by {self.percent_bw:.1f} % of "
                f"body weight (root mean square of the resultant over the stride, the worse foot, low-passed at 40 Hz; "
                f"{raw:.1f} unfiltered, {stance:.1f} over stance, {parts:.1f} in the worse component)."]
        if self.motion_rms:
            angle = max((rms, name) for name, rms in self.motion_rms.items() if not name.endswith(("_tx", "_ty")))
            said.append(f"The motion deviates by at most {angle[0]:.1f} deg ({angle[1]}, root mean square), the pelvis "
                        f"by {self.motion_rms['pelvis_tx']:.0f} mm fore-aft and {self.motion_rms['pelvis_ty']:.0f} mm "
                        "vertically.")
        if self.lateral_percent_bw > 1.0:
            said.append(f"The full model also presses sideways, by up to {self.lateral_percent_bw:.1f} % of body "
                        "weight, which a sagittal solution cannot know.")
        if self.unconverged_steps:
            said.append(f"{self.unconverged_steps} steps did not converge.")
        return (*said, *self._helped(), *self.notes)

    def _helped(self) -> tuple[str, ...]:
        return () if self.feedback is None else self.feedback.sentences()
