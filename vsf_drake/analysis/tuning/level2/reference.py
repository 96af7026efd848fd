"""The recorded stride on the instants of a grid: what a solution is compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.collocation.grid import Grid
from vsf_drake.analysis.tuning.level2.options import StrideOptions
from vsf_drake.analysis.tuning.recorded_stride import RecordedStride

SWING_MIDDLE = (0.3, 0.7)
"""Share of a swing in which the foot must clear the ground."""
FEET = ("prosthetic", "intact")


@dataclass(frozen=True, eq=False)
class StrideReference:
    """N instants of a recorded stride, sagittal; SI.

    Attributes:
        q, v, a: (N, 8). force: by foot (N, 2) fx, fz in N. cop_x: by foot (N,) m, 0 where there is no load.
        known: by foot (N,) bool, whether the force was measured.
        stance: by foot (N,) bool. late: (N,) bool, late prosthetic stance. clear: by foot (N,) bool, middle of swing.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: dict[str, np.ndarray]
    cop_x: dict[str, np.ndarray]
    known: dict[str, np.ndarray]
    stance: dict[str, np.ndarray]
    late: np.ndarray
    clear: dict[str, np.ndarray]


def stride_reference(recorded: RecordedStride, grid: Grid, options: StrideOptions) -> StrideReference:
    """The recorded stride at the grid's instants."""
    times, period = grid.times_s, recorded.period_s
    q, v, a = recorded.sample(times)
    grf, cop, known = recorded.grf(times), recorded.cop(times), recorded.known(times)
    spans = {"prosthetic": recorded.prosthetic_stance, "intact": recorded.intact_stance}
    stance, clear = {}, {}
    for foot, span in spans.items():
        if span is None:
            stance[foot] = clear[foot] = np.zeros(len(times), dtype=bool)
            continue
        stance[foot] = ~np.isnan(_share(times, *span, period))
        swing = _share(times, span[1], span[0] + period, period)
        clear[foot] = (swing >= SWING_MIDDLE[0]) & (swing <= SWING_MIDDLE[1])
    late = _share(times, *recorded.prosthetic_stance, period) >= options.late_share
    return StrideReference(
        q=q, v=v, a=a, known=known, stance=stance, late=late, clear=clear,
        force={foot: np.nan_to_num(grf[foot][:, :2]) if foot in grf else np.zeros((len(times), 2)) for foot in FEET},
        cop_x={foot: np.nan_to_num(cop[foot]) if foot in cop else np.zeros(len(times)) for foot in FEET})


def _share(times_s: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(N,) share of the way from start to end at times that count modulo the period, NaN outside of it."""
    share = np.mod(times_s - start, period_s) / (end - start)
    return np.where(share <= 1.0, share, np.nan)
