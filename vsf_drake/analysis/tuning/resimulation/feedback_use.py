"""How much a torque-driven re-simulation needed beyond the solution's torques."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class FeedbackUse:
    """Torques over the compared time.

    Attributes:
        feedforward_rms, feedforward_peak, feedback_rms, feedback_peak: by joint, N m.
        multiplier: largest magnitude among the eigenvalues of the linearised stride with the feedback (Floquet):
            below 1, a small disturbance dies out. None where the solution is not periodic.
        open_multiplier: the same without feedback.
        hand_percent_bw: root mean square of the force of a hand at the pelvis, % of body weight; 0 without a hand.
        hand_moment_nm: the same of its moment, N m.
        weights: what the feedback was laid out for, by name (`RegulatorWeights`).
    """

    feedforward_rms: Mapping[str, float]
    feedforward_peak: Mapping[str, float]
    feedback_rms: Mapping[str, float]
    feedback_peak: Mapping[str, float]
    multiplier: float | None = None
    open_multiplier: float | None = None
    hand_percent_bw: float = 0.0
    hand_moment_nm: float = 0.0
    weights: Mapping[str, float] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Root mean square of the feedback over that of the feedforward, all joints together."""
        def total(of: Mapping[str, float]) -> float:
            return sum(value**2 for value in of.values()) ** 0.5

        forward = total(self.feedforward_rms)
        return total(self.feedback_rms) / forward if forward else float("inf")

    def sentences(self) -> tuple[str, ...]:
        """What it took, in words."""
        if not any(self.feedback_peak.values()) and not self.hand_percent_bw:
            grows = "" if self.open_multiplier is None else (
                f": a small disturbance is multiplied by {self.open_multiplier:.2g} from stride to stride (linearised)")
            return (f"The solution's torques ran without feedback{grows}.",)
        name = max(self.feedback_peak, key=lambda joint: self.feedback_peak[joint])
        said = [f"Beyond the solution's torques the feedback used {100.0 * self.share:.1f} % of them (root mean "
                f"square), at most {self.feedback_peak[name]:.0f} N m ({name})."]
        if self.multiplier is not None and self.open_multiplier is not None:
            said.append(f"From stride to stride a small disturbance is multiplied by {self.multiplier:.2g} with the "
                        f"feedback and by {self.open_multiplier:.2g} without (linearised).")
        if self.hand_percent_bw > 0.0:
            said.append(f"A HAND HELD THE PELVIS, with {self.hand_percent_bw:.2f} % of body weight and "
                        f"{self.hand_moment_nm:.1f} N m (root mean square): not a person who walks alone.")
        return tuple(said)
