"""A trial with all that was found about it. Schema only; `examine` makes it."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.analysis.recording.check import Check, overall
from vsf_drake.analysis.recording.foot import FootMotion
from vsf_drake.motion.contacts import Contact
from vsf_drake.motion.events import Stance
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.schema import Calibration, TrackedMotion
from vsf_drake.motion.trial import Trial


@dataclass(frozen=True, eq=False)
class MarkerEvidence:
    """What a trial made from markers leaves to check.

    Attributes:
        tracked: the motion. calibration: the standing person. recording: the walk as read.
        cutoff_hz: of the filter; None where the recording was taken as filtered already.
        contacts: which plate is which foot.
    """

    tracked: TrackedMotion
    calibration: Calibration
    recording: Recording
    cutoff_hz: float | None
    contacts: tuple[Contact, ...] = ()


@dataclass(frozen=True, eq=False)
class Examined:
    """A trial with all that was found about it.

    Attributes:
        checks: in the order of the report. notes: the trial's, and the tracking's.
        feet: the feet that were judged, as markers saw them where there are any. model_feet: the model's.
        measured, stances: by side, the stances that plates saw, and all of them.
    """

    trial: Trial
    markers: MarkerEvidence | None
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    feet: dict[str, FootMotion]
    model_feet: dict[str, FootMotion]
    measured: dict[str, list[Stance]]
    stances: dict[str, list[Stance]]

    @property
    def mark(self) -> str:
        """Of its expected error, unless a fault makes it unusable."""
        return overall(self.checks)
