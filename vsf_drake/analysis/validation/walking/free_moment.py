"""The free moment, model beside plate: the couple about the vertical that is left at the centre of pressure.

About the vertical up through each one's own centre of pressure, acting on the person (Winter 2009; a plate's own
definition). Both are low-passed at 6 Hz inside each loaded interval and taken at 101 points of the measured stance, as
the centre of pressure is, and where that can be compared. It needs a centre of pressure: about another point the moment
is another quantity.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import (
    COP_CUTOFF_HZ,
    FORCE_CUTOFF_HZ,
    THRESHOLD_N,
    Comparison,
    StanceComparison,
    filtered_while_loaded,
    percent_instants,
)
from vsf_drake.analysis.series import r_squared, rmse
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.results import WalkResult


def has_free_moment(plate: PlateRecording) -> bool:
    """Whether the plate measured one: it has a centre of pressure, and the moment is not zero throughout."""
    return bool(plate.has_cop and np.any(plate.free_moment_nm))


def stance_free_moments(
    result: WalkResult, plate: PlateRecording, stance: StanceComparison
) -> tuple[np.ndarray, np.ndarray]:
    """(101,) measured and (101,) model's, N m, at 0-100 % of a measured stance; NaN where there is nothing."""
    instants = percent_instants(stance.measured)
    measured, model = (
        filtered_while_loaded(moment[:, None], time, force, cop, instants, threshold_n=THRESHOLD_N,
                              force_cutoff_hz=FORCE_CUTOFF_HZ, cutoff_hz=COP_CUTOFF_HZ)[:, 0]
        for time, force, cop, moment in (
            (plate.time_s, plate.force_W[:, 2], plate.cop_W, plate.free_moment_nm),
            (result.time_s, result.grf_W[:, 2], result.cop_W, result.free_moment_nm)))
    model[np.isnan(stance.model_cop[:, 0])] = np.nan
    return measured, model


def free_moment_scores(result: WalkResult, plate: PlateRecording, comparison: Comparison) -> dict[str, Any]:
    """Error over all stances: N m, relative to body weight times foot length, R², and the measured extreme.

    All None where the plate has no centre of pressure or no free moment.
    """
    unknown = dict.fromkeys(("free_moment_rmse_nm", "free_moment_rmse_bwfl", "free_moment_r2",
                             "free_moment_measured_peak_nm"))
    if not has_free_moment(plate) or not comparison.stances:
        return unknown
    pairs = [stance_free_moments(result, plate, stance) for stance in comparison.stances]
    measured, model = (np.concatenate(side) for side in zip(*pairs, strict=True))
    both = np.isfinite(measured) & np.isfinite(model)
    if not both.any():
        return unknown
    error = rmse(model[both], measured[both])
    r2 = r_squared(model[both], measured[both])
    return {
        "free_moment_rmse_nm": error,
        "free_moment_rmse_bwfl": error / (result.subject_mass_kg * GRAVITY * result.foot_length_m),
        "free_moment_r2": r2 if np.isfinite(r2) else None,
        "free_moment_measured_peak_nm": float(measured[both][np.argmax(np.abs(measured[both]))])}
