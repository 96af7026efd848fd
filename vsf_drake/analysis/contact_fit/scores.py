"""What `assessment` finds about a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.series import rmse


@dataclass(frozen=True, kw_only=True)
class FulcrumSweep:
    """Error over the fulcrum's position.

    Attributes:
        fulcrum_m: (n,) m. grf_rmse_bw: (n,) resultant, BW; NaN where the walk fails.
        true_m: where it stood. best_m: where the error is lowest, by the parabola through the three lowest points.
        at_end: whether it stood at an end of its range, so that an error outwards could not show.
        right: whether best_m is within `fulcrum_sweep.RIGHT_WITHIN_M` of it.
    """

    fulcrum_m: tuple[float, ...]
    grf_rmse_bw: tuple[float, ...]
    true_m: float
    best_m: float
    at_end: bool
    right: bool


@dataclass(frozen=True, kw_only=True)
class TrialScore:
    """One trial under a fit.

    Attributes:
        role: "fitted" or "held out".
        metrics: of `analysis.metrics.walk_metrics`, the null model among them (None without another fitted trial).
        curves: time_s, model_bw and measured_bw (n, 3), cop_measured_fl and cop_model_fl (101,) of the first stance.
        floor_grf_rmse_bw: what the true foot would be left with on this recording's motion, where that is known.
    """

    label: str
    role: str
    fulcrum_m: float
    metrics: Mapping[str, Any]
    curves: Mapping[str, np.ndarray]
    sweep: FulcrumSweep | None
    floor_grf_rmse_bw: float | None = None


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A fit without some of its trials, judged by them.

    Attributes:
        kind: "trial" or "stiffness". left_out: labels. failed: why there is no score, or "".
        grf_rmse_bw, cop_rmse_fl: means over them; None if the fit failed or nothing is left to fit.
    """

    kind: str
    left_out: tuple[str, ...]
    grf_rmse_bw: float | None
    cop_rmse_fl: float | None
    failed: str = ""


@dataclass(frozen=True, kw_only=True)
class MidRangeScore:
    """Mid-range displacement of model and measurement on the bench, mm; the heel's apart, None if not measured."""

    measured_mm: tuple[float, ...]
    model_mm: tuple[float, ...]
    heel_measured_mm: float | None
    heel_model_mm: float | None

    @property
    def rmse_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_mm), np.array(self.measured_mm))


@dataclass(frozen=True, kw_only=True)
class BenchScore:
    """Model and measurement on the bench, N/mm; the heel's apart, None where it was not measured. `mid_range`: None
    where no displacement was measured."""

    fulcrum_mm: tuple[float, ...]
    measured_n_per_mm: tuple[float, ...]
    model_n_per_mm: tuple[float, ...]
    heel_measured_n_per_mm: float | None
    heel_model_n_per_mm: float | None
    mid_range: MidRangeScore | None = None

    @property
    def rmse_n_per_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_n_per_mm), np.array(self.measured_n_per_mm))


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that speaks for and against a fit."""

    scores: tuple[TrialScore, ...]
    left_out: tuple[LeftOut, ...]
    bench: BenchScore | None

    def mean(self, role: str, key: str) -> float | None:
        """Mean of a metric over the trials of a role; None where there is none."""
        values = [s.metrics[key] for s in self.scores if s.role == role and s.metrics[key] is not None]
        return float(np.mean(values)) if values else None
