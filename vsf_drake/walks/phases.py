"""Where in stance, and in which component, a prediction is off: beside the null model there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.walks.comparison import Comparison, resample, rmse
from vsf_drake.walks.null_model import stretched
from vsf_drake.walks.person_curve import SPREADS, PersonForce, with_resultant
from vsf_drake.walks.quantities import mean

PHASES = {"loading": (0.0, 20.0), "single support": (20.0, 80.0), "push-off": (80.0, 100.0)}
"""Percent of the measured stance: response to loading and pre-swing are each a sixth of the gait
cycle or less, stance three fifths of it (rounded)."""


@dataclass(frozen=True, kw_only=True)
class PhaseErrors:
    """Root mean square errors (BW) of one component in one phase of stance: of the prediction by
    the person's own curve, and of the null model with the measured times of stance and with those
    that the physics predicts. None where nothing is known."""

    phase: str  # of PHASES
    component: str  # of SPREADS
    person_bw: float | None
    null_bw: float | None
    null_predicted_times_bw: float | None
    in_interval: float | None  # share of the instants in the 80 % interval; None without one

    @property
    def harder_null_bw(self) -> float | None:
        """The lesser of the two nulls' errors."""
        nulls = [one for one in (self.null_bw, self.null_predicted_times_bw) if one is not None]
        return min(nulls, default=None)


def phase_errors(
    physics: Comparison,
    person: Comparison,
    predicted: PersonForce,
    null_bw: np.ndarray | None,
    weight_n: float,
) -> tuple[PhaseErrors, ...]:
    """Of a walk compared in two layers; `null_bw` (101, 3) the null model's curve over stance, None
    without one."""
    plate = person.measured / weight_n
    off = with_resultant(person.model / weight_n, plate)
    nulls = [
        None
        if null_bw is None
        else with_resultant(stretched(physics, null_bw, predicted=late), plate)
        for late in (False, True)
    ]
    half = (
        None
        if predicted.half_width_n is None
        else resample(person.time_s, predicted.time_s, predicted.half_width_n) / weight_n
    )
    found = []
    for phase, (low, high) in PHASES.items():
        rows = np.zeros(len(person.time_s), dtype=bool)
        for item in person.stances:
            start = item.measured.start_s
            share_s = 0.01 * item.measured.duration_s
            rows |= person.within(start + low * share_s, start + high * share_s)
        rows &= person.scored
        for k, component in enumerate(SPREADS):
            held = None if half is None else np.abs(off[rows, k]) <= half[rows, k]
            found.append(
                PhaseErrors(
                    phase=phase,
                    component=component,
                    person_bw=_rms(off[rows, k]),
                    null_bw=None if nulls[0] is None else _rms(nulls[0][rows, k]),
                    null_predicted_times_bw=None if nulls[1] is None else _rms(nulls[1][rows, k]),
                    in_interval=None if held is None or not held.size else float(held.mean()),
                )
            )
    return tuple(found)


def mean_phases(walks: Iterable[Sequence[PhaseErrors]]) -> tuple[PhaseErrors, ...]:
    """By phase and component over several walks; none of none."""
    by_place: dict[tuple[str, str], list[PhaseErrors]] = {}
    for one in (one for walk in walks for one in walk):
        by_place.setdefault((one.phase, one.component), []).append(one)
    return tuple(
        PhaseErrors(
            phase=phase,
            component=component,
            person_bw=mean(one.person_bw for one in own),
            null_bw=mean(one.null_bw for one in own),
            null_predicted_times_bw=mean(one.null_predicted_times_bw for one in own),
            in_interval=mean(one.in_interval for one in own),
        )
        for (phase, component), own in by_place.items()
    )


def _rms(errors: np.ndarray) -> float | None:
    own = errors[np.isfinite(errors)]
    return float(rmse(own, np.zeros(len(own)))) if own.size else None
