"""The bench of the validation, setting by setting: the measured curves, and what each model does there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.bench_metrics import published_stiffness
from vsf_drake.analysis.validation.bench.passes import LOAD_N, Machine, mid_range_mm, stiffness_n_per_mm
from vsf_drake.analysis.validation.bench.shape import energy, shape, tangent
from vsf_drake.analysis.validation.bench.statistics import (
    GRID,
    agreement,
    at_loads,
    curve_errors,
    mean_and_half_width,
    rising,
    up_to,
)
from vsf_drake.bench_curves import BenchCurves, MeasuredCurve
from vsf_drake.bench_file import STIFFNESS_ABOVE_N
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.parameters import FootParameters

LEAST_LOAD_N = 1.25 * STIFFNESS_ABOVE_N
"""Largest load from which a pass has a stiffness: less leaves too little of it above 200 N."""
MOST_LOAD_N = 5000.0
"""What the simulated machine presses with at most."""

Curve = tuple[np.ndarray, np.ndarray]
"""Displacement (mm) and load (N) from (0, 0), rising."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """One position of the fulcrum (m from A; None for the heel) with its measured passes, up to one load (N)."""

    fulcrum_m: float | None
    load_n: float
    passes: tuple[Curve, ...] = ()

    @property
    def where(self) -> str:
        """What it is called in messages."""
        return "heel" if self.fulcrum_m is None else f"fulcrum at {1e3 * self.fulcrum_m:g} mm"

    @property
    def curve(self) -> Curve | None:
        """The measured curve: the only pass, or the mean displacement of all at equal loads; None without one."""
        if len(self.passes) < 2:
            return self.passes[0] if self.passes else None
        loads = np.linspace(0.0, self.load_n, GRID)
        return np.mean([at_loads(*one, loads) for one in self.passes], axis=0), loads

    @property
    def judged(self) -> bool:
        """Whether its measured stiffness can be compared."""
        return bool(self.passes) and self.load_n >= LEAST_LOAD_N

    def row(self) -> dict[str, Any]:
        """What is known of it without a model."""
        published = published_stiffness(self.fulcrum_m)
        return {"fulcrum_mm": None if self.fulcrum_m is None else round(1e3 * self.fulcrum_m, 6),
                "max_load_n": self.load_n, "repeats": len(self.passes),
                "published_n_per_mm": None if published is None else 1e-3 * published, "measured": self._measured()}

    def _measured(self) -> dict[str, Any] | None:
        if self.curve is None:
            return None
        values = [described(one, self.where) for one in self.passes]
        found: dict[str, float | None] = {}
        for key in ("stiffness_n_per_mm", "mid_range_mm", "stored_j"):
            if values[0][key] is not None:
                mean, half = mean_and_half_width(np.array([value[key] for value in values]))
                found |= {key: float(mean), f"{key}_half_width": float(half) if math.isfinite(half) else None}
            else:
                found |= {key: None, f"{key}_half_width": None}
        return described(self.curve, self.where) | found


def settings_of(bench: BenchCurves | None, fulcrums_m: Sequence[float]) -> list[Setting]:
    """The measured settings, or `fulcrums_m` where none was measured, and the heel in any case, last."""
    found: dict[float | None, list[MeasuredCurve]] = {}
    for curve in bench.curves if bench is not None else ():
        found.setdefault(curve.fulcrum_m, []).append(curve)
    positions = sorted(x for x in found if x is not None) or list(fulcrums_m)
    settings = []
    for position in [*positions, None]:
        curves = [rising(1e3 * curve.displacement_m, curve.load_n) for curve in found.get(position, ())]
        largest = min([float(load[-1]) for _, load in curves], default=LOAD_N)
        largest = min(largest, MOST_LOAD_N)
        settings.append(Setting(fulcrum_m=position, load_n=largest,
                                passes=tuple(up_to(*curve, largest) for curve in curves)))
    return settings


def described(curve: Curve, where: str) -> dict[str, Any]:
    """Stiffness, mid-range displacement, stored energy and shape of one rising curve; None without 250 N."""
    x, load = curve
    enough = load[-1] >= LEAST_LOAD_N * (1.0 - 1e-9)
    return {"stiffness_n_per_mm": stiffness_n_per_mm(x, load, where) if enough else None,
            "mid_range_mm": mid_range_mm(x, load, where), "max_displacement_mm": float(x[-1]),
            "stored_j": 1e-3 * energy(x, load), "shape": shape(x, load) if enough else None}


def pressed(
    foot: FootParameters, settings: Sequence[Setting], *, heel: bool = True
) -> tuple[list[Curve | None], int, list[str]]:
    """The foot's curve at every setting up to its load, unconverged steps, and what could not be done.

    Without `heel` there is None at the heel.
    """
    machine, missing, unconverged = Machine(foot), [], 0
    curves: list[Curve | None] = []
    for setting in settings:
        if setting.fulcrum_m is None and not heel:
            curves.append(None)
            continue
        try:
            x, load, failed = machine.press(setting.fulcrum_m, max(setting.load_n, LEAST_LOAD_N))
            curves.append(up_to(*rising(x, load), setting.load_n))
            unconverged += failed
        except (InputError, SimulationError) as error:
            curves.append(None)
            missing.append(f"{setting.where}: {error}.")
    return curves, unconverged, missing


def compared(setting: Setting, curve: Curve | None) -> dict[str, Any] | None:
    """A model's values at one setting, and by what they differ from the measured ones."""
    if curve is None:
        return None
    own, measured = described(curve, setting.where), setting.row()["measured"]
    if measured is None or setting.curve is None:
        return own
    errors = curve_errors(*curve, *setting.curve)
    k, k_measured = own["stiffness_n_per_mm"], measured["stiffness_n_per_mm"]
    return own | {
        "stiffness_error_n_per_mm": None if k is None or k_measured is None else k - k_measured,
        "mid_range_offset_mm": own["mid_range_mm"] - measured["mid_range_mm"],
        "stored_error_j": own["stored_j"] - measured["stored_j"],
        "curve_rmse_mm": errors["displacement"], "curve_rmse_n": errors["load"]}


def statistics(settings: Sequence[Setting], rows: Sequence[dict[str, Any] | None]) -> dict[str, Any] | None:
    """Agreement over the forefoot's judged settings; None where there is none. `rows` are those of `compared`."""
    pairs = [(setting.row()["measured"], row) for setting, row in zip(settings, rows, strict=True)
             if setting.fulcrum_m is not None and setting.judged and row is not None]
    if not pairs:
        return None
    values = {key: np.array([[row[key], measured[key]] for measured, row in pairs]).T
              for key in ("stiffness_n_per_mm", "mid_range_mm")}
    k, mid = (agreement(*values[key]) for key in ("stiffness_n_per_mm", "mid_range_mm"))
    return {
        "n": k["n"], "stiffness_r2": k["r2"], "stiffness_correlation2": k["correlation2"],
        "stiffness_rmse_n_per_mm": k["rmse"], "stiffness_bias_n_per_mm": k["bias"],
        "stiffness_bias_half_width_n_per_mm": k["bias_half_width"], "mid_range_rmse_mm": mid["rmse"],
        "mid_range_bias_mm": mid["bias"], "mid_range_bias_half_width_mm": mid["bias_half_width"],
        "curve_rmse_mm": float(np.sqrt(np.mean([row["curve_rmse_mm"] ** 2 for _, row in pairs]))),
        "curve_rmse_n": float(np.sqrt(np.mean([row["curve_rmse_n"] ** 2 for _, row in pairs])))}


def curve_arrays(settings: Sequence[Setting], by_line: dict[str, list[Curve | None]]) -> dict[str, np.ndarray]:
    """Curves on shared loads, (settings, 201): `load_n`, `measured_mm` with `measured_half_width_mm` (95 %), and for
    each line `<key>_mm`; the slopes dF/dx likewise as `measured_tangent_n_per_mm`, `<key>_tangent_n_per_mm`."""
    loads = np.array([np.linspace(0.0, setting.load_n, GRID) for setting in settings])
    arrays = {"load_n": loads, "measured_half_width_mm": np.full(loads.shape, np.nan)}
    for i, setting in enumerate(settings):
        if len(setting.passes) > 1:
            arrays["measured_half_width_mm"][i] = mean_and_half_width(
                np.array([at_loads(*one, loads[i]) for one in setting.passes]))[1]
    for key, curves in ({"measured": [setting.curve for setting in settings]} | by_line).items():
        arrays[f"{key}_mm"], arrays[f"{key}_tangent_n_per_mm"] = np.full((2, *loads.shape), np.nan)
        for i, curve in enumerate(curves):
            if curve is not None:
                arrays[f"{key}_mm"][i] = at_loads(*curve, loads[i])
                arrays[f"{key}_tangent_n_per_mm"][i] = tangent(*curve, loads[i])
    return arrays
