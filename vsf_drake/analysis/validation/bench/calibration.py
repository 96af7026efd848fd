"""The foot calibrated to measured curves of its softest and its stiffest setting: the others are then predicted.

The paper's joints were tuned on the bench; this is the like. Three numbers move, the fulcrum's stiffness and the two of
the foam between load and keel, and minimise the difference of displacement at equal loads, each curve in parts of
its own largest displacement. The keel's modulus stays the material's.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from vsf_drake.analysis.validation.bench.passes import Machine
from vsf_drake.analysis.validation.bench.statistics import at_loads
from vsf_drake.errors import InputError
from vsf_drake.model_file import secant_stiffness
from vsf_drake.parameters import FootParameters

SAMPLES = 20
"""Loads a curve, evenly up to its largest."""
MIDDLE_N = 300.0
"""Load at which the foam's depth is one of the unknowns: nearly independent of its exponent."""
_LOW, _HIGH = (math.log(1e4), math.log(1e-4), 1.0), (math.log(1e7), math.log(3e-2), 6.0)
"""log fulcrum stiffness (N/m), log foam depth (m) at 300 N, exponent."""
_EVALUATIONS = 60
_STEP = 1e-3


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """The foot, what it was calibrated to (m from A), and which of its numbers ended at a bound."""

    foot: FootParameters
    fulcrums_m: tuple[float, float]
    at_bound: tuple[str, ...]


def calibrated(
    foot: FootParameters, curves: Mapping[float, tuple[np.ndarray, np.ndarray]]
) -> Calibration:
    """`foot` calibrated to the rising curves (mm, N) of the rearmost and the foremost of the fulcrum positions (m).

    Raises:
        InputError, SimulationError: a trial foot cannot be pressed, or the search does not end.
    """
    ends = min(curves), max(curves)
    loads = {x: np.linspace(0.0, float(curves[x][1][-1]), SAMPLES + 1)[1:] for x in ends}
    measured = {x: at_loads(*curves[x], loads[x]) for x in ends}

    def residuals(values: np.ndarray) -> np.ndarray:
        machine = Machine(_with(foot, values))
        parts = []
        for x in ends:
            found = at_loads(*machine.press(x, float(loads[x][-1]))[:2], loads[x])
            parts.append((found - measured[x]) / measured[x][-1])
        return np.concatenate(parts)

    k, n = foot.series_stiffness_n_per_m, foot.series_exponent
    start = np.array([math.log(foot.fulcrum.stiffness_n_per_m),
                      math.log(MIDDLE_N / secant_stiffness(k, n, MIDDLE_N)), max(n, 1.0 + 10 * _STEP)])
    start = np.clip(start, np.array(_LOW) + 10 * _STEP, np.array(_HIGH) - 10 * _STEP)
    found = least_squares(residuals, start, bounds=(_LOW, _HIGH), diff_step=_STEP, xtol=1e-5, ftol=1e-6,
                          max_nfev=_EVALUATIONS)
    if not found.success:
        raise InputError(f"the calibration to the measured curves found no end: {found.message}")
    names = ("fulcrum stiffness", "foam stiffness", "foam exponent")
    return Calibration(foot=_with(foot, found.x), fulcrums_m=ends,
                       at_bound=tuple(name for name, state in zip(names, found.active_mask, strict=True) if state))


def _with(foot: FootParameters, values: np.ndarray) -> FootParameters:
    exponent, depth = float(values[2]), math.exp(values[1])
    return dataclasses.replace(
        foot, fulcrum=dataclasses.replace(foot.fulcrum, stiffness_n_per_m=math.exp(values[0])),
        series_stiffness_n_per_m=MIDDLE_N / depth**exponent, series_exponent=exponent)


