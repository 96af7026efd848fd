"""The bench of the validation, setting by setting: the measured curves, and what each model does there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.stats import linregress
from scipy.stats import t as student

from vsf_drake.analysis.bench_metrics import mid_range_displacement, published_stiffness, stiffness
from vsf_drake.analysis.comparison import r_squared, rmse
from vsf_drake.analysis.validation.study import finite
from vsf_drake.bench_curves import (
    STIFFNESS_ABOVE_N,
    BenchCurves,
    BenchMeasurement,
    load_bench_curves,
    load_bench_file,
)
from vsf_drake.errors import InputError
from vsf_drake.files import flat
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, STEPS_PER_MM, Bench

LEAST_LOAD_N = 1.25 * STIFFNESS_ABOVE_N
"""Largest load from which a pass has a stiffness: less leaves too little of it above 200 N."""
MOST_LOAD_N = 5000.0
"""What the simulated machine presses with at most."""
LOAD_N = 600.0
"""Largest load of a pass, where no measured curve says another."""
GRID = 201
"""Loads, evenly from 0, at which a setting's curves are compared."""
LEVEL = 0.95

Curve = tuple[np.ndarray, np.ndarray]
"""(n,) displacement (mm) and load (N) from (0, 0), rising."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """How straight a rising curve from (0, 0) to beyond 200 N is; see `shape`."""

    line_r2: float  # share of the load's variance that a straight line explains, over the whole travel
    line_r2_above: float  # and over that above 200 N
    curvature_share: float  # largest distance of the curve from its chord, along the displacement, over the travel
    first_slope_ratio: float  # slope up to 50 N over that above 200 N
    toe: float  # displacement by which the curve up to 200 N exceeds the line with the slope above it, through no load
    toe_share: float  # of the travel; positive where the foot stiffens


@dataclass(frozen=True, kw_only=True)
class CurveValues:
    """One rising curve; stiffness and shape are None without 250 N."""

    stiffness_n_per_mm: float | None  # mean slope above 200 N
    mid_range_mm: float  # at half of the largest load
    max_displacement_mm: float
    stored_j: float
    shape: Shape | None


@dataclass(frozen=True, kw_only=True)
class MeasuredValues(CurveValues):
    """The mean over the passes at a setting; half of the 95 % confidence intervals, None for one pass."""

    stiffness_n_per_mm_half_width: float | None
    mid_range_mm_half_width: float | None
    stored_j_half_width: float | None


@dataclass(frozen=True, kw_only=True)
class ComparedValues(CurveValues):
    """A model where there is a measured curve: by what it differs."""

    stiffness_error_n_per_mm: float | None
    mid_range_offset_mm: float
    stored_error_j: float
    curve_rmse_mm: float  # at equal loads
    curve_rmse_n: float  # at equal displacements


ModelValues = ComparedValues | CurveValues
"""Of a model, with and without a measured curve."""


@dataclass(frozen=True, kw_only=True)
class SettingRow:
    """One position of the fulcrum (mm from A; None for the heel): what was measured, and what each model does."""

    fulcrum_mm: float | None
    max_load_n: float
    repeats: int
    published_n_per_mm: float | None
    measured: MeasuredValues | None
    lines: Mapping[str, ModelValues | None] = flat()  # by the models' keys; None where one was not pressed


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """Agreement of a model with the measured curves over the forefoot's settings that both have a stiffness at."""

    n: int
    stiffness_r2: float | None
    stiffness_correlation2: float | None
    stiffness_rmse_n_per_mm: float
    stiffness_bias_n_per_mm: float
    stiffness_bias_half_width_n_per_mm: float | None
    mid_range_rmse_mm: float
    mid_range_bias_mm: float
    mid_range_bias_half_width_mm: float | None
    curve_rmse_mm: float
    curve_rmse_n: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SettingLines:
    """One position of the fulcrum (m from A; None for the heel) with its measured passes, up to one load (N)."""

    fulcrum_m: float | None
    load_n: float
    passes: tuple[Curve, ...] = ()

    @property
    def where(self) -> str:
        """What it is called in messages."""
        return where_of(self.fulcrum_m)

    @property
    def fulcrum_mm(self) -> float | None:
        """Its position as tables have it."""
        return None if self.fulcrum_m is None else round(1e3 * self.fulcrum_m, 6)

    @property
    def published_n_per_mm(self) -> float | None:
        """The published stiffness there."""
        published = published_stiffness(self.fulcrum_m)
        return None if published is None else 1e-3 * published

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

    def measured(self) -> MeasuredValues | None:
        """What the machine measured; None without a pass."""
        if self.curve is None:
            return None
        passes = [curve_values(one, self.where) for one in self.passes]
        values = dict(vars(curve_values(self.curve, self.where)))
        for key in ("stiffness_n_per_mm", "mid_range_mm", "stored_j"):
            each = [getattr(one, key) for one in passes]
            mean, half = (np.nan, np.nan) if None in each else map(float, mean_and_half_width(np.array(each)))
            values |= {key: finite(mean), f"{key}_half_width": finite(half)}
        return MeasuredValues(**values)


def where_of(fulcrum_m: float | None) -> str:
    """What a position (m from A; None for the heel) is called in messages."""
    return "heel" if fulcrum_m is None else f"fulcrum at {1e3 * fulcrum_m:g} mm"


def settings_of(bench: BenchCurves | None, fulcrums_m: Sequence[float]) -> list[SettingLines]:
    """The measured settings, or `fulcrums_m` where none was measured, and the heel in any case, last."""
    measured: dict[float | None, list[Curve]] = {}
    for curve in bench.curves if bench is not None else ():
        measured.setdefault(curve.fulcrum_m, []).append(rising(1e3 * curve.displacement_m, curve.load_n))
    settings = []
    for position in [*(sorted(x for x in measured if x is not None) or fulcrums_m), None]:
        passes = measured.get(position, [])
        largest = min([MOST_LOAD_N, *(float(load[-1]) for _, load in passes)]) if passes else LOAD_N
        settings.append(SettingLines(fulcrum_m=position, load_n=largest,
                                     passes=tuple(up_to(*one, largest) for one in passes)))
    return settings


def curve_values(curve: Curve, where: str) -> CurveValues:
    """Stiffness, mid-range displacement, stored energy and shape of one rising curve; `where` is for messages."""
    x, load = curve
    enough = load[-1] >= LEAST_LOAD_N * (1.0 - 1e-9)
    return CurveValues(
        stiffness_n_per_mm=1e-3 * stiffness(1e-3 * x, load, where=where) if enough else None,
        mid_range_mm=1e3 * mid_range_displacement(1e-3 * x, load, where=where), max_displacement_mm=float(x[-1]),
        stored_j=1e-3 * float(np.trapezoid(load, x)), shape=shape(x, load) if enough else None)


def compared(setting: SettingLines, measured: MeasuredValues | None, curve: Curve) -> ModelValues:
    """A model's values at one setting, and by what they differ from the measured ones."""
    own = curve_values(curve, setting.where)
    if measured is None or setting.curve is None:
        return own
    errors, k, k_measured = curve_errors(*curve, *setting.curve), own.stiffness_n_per_mm, measured.stiffness_n_per_mm
    return ComparedValues(
        **vars(own), stiffness_error_n_per_mm=None if k is None or k_measured is None else k - k_measured,
        mid_range_offset_mm=own.mid_range_mm - measured.mid_range_mm, stored_error_j=own.stored_j - measured.stored_j,
        curve_rmse_mm=errors["displacement"], curve_rmse_n=errors["load"])


def judged_pairs(rows: Sequence[SettingRow], line: str) -> list[tuple[ComparedValues, MeasuredValues]]:
    """A line's values and the measured ones at the forefoot's settings where both have a stiffness."""
    return [(own, row.measured) for row in rows if row.fulcrum_mm is not None
            and isinstance(own := row.lines[line], ComparedValues) and own.stiffness_n_per_mm is not None
            and row.measured is not None and row.measured.stiffness_n_per_mm is not None]


def statistics(rows: Sequence[SettingRow], line: str) -> Statistics | None:
    """Agreement of a line over the forefoot's judged settings; None where there is none."""
    pairs = judged_pairs(rows, line)
    if not pairs:
        return None
    k, mid = (agreement(*np.array([[getattr(values, key) for values in pair] for pair in pairs]).T)
              for key in ("stiffness_n_per_mm", "mid_range_mm"))
    return Statistics(
        n=k.n, stiffness_r2=k.r2, stiffness_correlation2=k.correlation2, stiffness_rmse_n_per_mm=k.rmse,
        stiffness_bias_n_per_mm=k.bias, stiffness_bias_half_width_n_per_mm=k.bias_half_width,
        mid_range_rmse_mm=mid.rmse, mid_range_bias_mm=mid.bias, mid_range_bias_half_width_mm=mid.bias_half_width,
        curve_rmse_mm=float(np.sqrt(np.mean([own.curve_rmse_mm**2 for own, _ in pairs]))),
        curve_rmse_n=float(np.sqrt(np.mean([own.curve_rmse_n**2 for own, _ in pairs]))))


def curve_arrays(settings: Sequence[SettingLines], by_line: dict[str, list[Curve | None]]) -> dict[str, np.ndarray]:
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


# The simulated testing machine as the validation uses it: pass by pass, in mm and N, loading or there and back.


class Loop(NamedTuple):
    """The platen up to a load and down again at one speed."""

    mm: np.ndarray  # (n,) from (0, 0)
    n: np.ndarray
    top: int  # the instant at which it turns
    loading_s: float
    unconverged_steps: int  # accepted without convergence; the energies are then doubtful

    @property
    def stored_j(self) -> float:
        """Work of the platen on the foot while it loads."""
        return 1e-3 * float(np.trapezoid(self.n[: self.top + 1], self.mm[: self.top + 1]))

    @property
    def lost_j(self) -> float:
        """What of it the foot does not give back while it unloads."""
        return 1e-3 * float(np.trapezoid(self.n, self.mm))


class Machine:
    """One foot in the testing machine; forefoot and heel are built when they are first pressed."""

    def __init__(self, foot: FootParameters) -> None:
        self.foot = foot
        self._benches: dict[bool, Bench] = {}

    def press(
        self, fulcrum_m: float | None, load_n: float = LOAD_N, speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Displacement (mm) and load (N) from (0, 0) to exactly `load_n` with the fulcrum there (m from A; None for
        the heel), and how many steps did not converge; raises what `Bench.press` does."""
        bench, fulcrum = self._bench(fulcrum_m)
        setting = bench.press(fulcrum_m=fulcrum, max_load_n=load_n, speed_m_per_s=speed_m_per_s)
        x, load = np.append(0.0, 1e3 * setting.platen_m), np.append(0.0, setting.load_n)
        return *up_to(x, load, load_n), setting.unconverged_steps

    def loop(
        self, fulcrum_m: float | None, load_n: float, speed_m_per_s: float, *, steps_per_mm: float = STEPS_PER_MM
    ) -> Loop:
        """Up to where the load is reached at this speed, and down to touch-down at the same.

        The platen's speed jumps at the top and viscous forces with it: the loading's last load is extrapolated from
        the two steps before.
        """
        top = 1e-3 * float(self.press(fulcrum_m, load_n, speed_m_per_s)[0][-1])
        steps = int(np.ceil(top * 1e3 * steps_per_mm))
        way = np.linspace(0.0, top, steps + 1)
        bench, fulcrum = self._bench(fulcrum_m)
        setting = bench.follow(
            fulcrum_m=fulcrum, time_s=np.linspace(0.0, 2.0 * top / speed_m_per_s, 2 * steps + 1),
            platen_m=np.concatenate((way, way[-2::-1])))
        x, load = np.append(0.0, 1e3 * setting.platen_m), np.append(0.0, setting.load_n)
        load[steps] = 2.0 * load[steps - 1] - load[steps - 2]
        return Loop(x, load, steps, top / speed_m_per_s, setting.unconverged_steps)

    def _bench(self, fulcrum_m: float | None) -> tuple[Bench, float]:
        """The bench of forefoot or heel, and where the carriage stands in it (m)."""
        heel = fulcrum_m is None
        if heel not in self._benches:
            self._benches[heel] = Bench(self.foot, heel=heel)
        return self._benches[heel], self.foot.fulcrum.rearmost_m if fulcrum_m is None else fulcrum_m


# How straight a load-displacement curve is: the linear part and the curvilinear one, told apart.
#
# McGeehan 2021 (doi 10.1115/1.4050456) takes the first 200 N for the foam and the rest for the keel: measured curves
# were most linear at 66 and 87 mm and curvilinear from 108 mm on. Here that becomes numbers. Pure functions of arrays;
# units are the caller's.

TOE_N = 50.0
"""Load up to which the first slope is taken."""
WINDOW_N = 20.0
"""To both sides of a load, over which the slope there is taken."""


def shape(x: np.ndarray, load: np.ndarray) -> Shape:
    """Of a rising curve from (0, 0) to beyond 200 N."""
    end, travel = float(load[-1]), float(x[-1])
    at_above, at_toe = at_loads(x, load, np.array([STIFFNESS_ABOVE_N, TOE_N]))
    k = (end - STIFFNESS_ABOVE_N) / (travel - at_above)
    from_chord = x - load * travel / end
    # the line of slope k through (x(200 N), 200 N) meets the axis of displacement at the toe
    toe = float(at_above - STIFFNESS_ABOVE_N / k)
    return Shape(line_r2=_line_r2(x, load, 0.0), line_r2_above=_line_r2(x, load, float(at_above)),
                 curvature_share=float(np.max(np.abs(from_chord)) / travel),
                 first_slope_ratio=float(TOE_N / at_toe / k), toe=toe, toe_share=toe / travel)


def tangent(x: np.ndarray, load: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Slope dF/dx at `loads` (N), from 20 N less to 20 N more of each; NaN where the curve lacks them."""
    low, high = loads - WINDOW_N, loads + WINDOW_N
    inside = (low >= 0.0) & (high <= load[-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (high - low) / (at_loads(x, load, high) - at_loads(x, load, np.maximum(low, 0.0)))
    return np.where(inside, slope, np.nan)


def _line_r2(x: np.ndarray, load: np.ndarray, start: float) -> float:
    """R² of a straight line of load over displacement, samples evenly along the displacement."""
    places = np.linspace(start, float(x[-1]), GRID)
    values = np.interp(places, x, load)
    left = values - np.polyval(np.polyfit(places, values, 1), places)
    return float(1.0 - np.sum(left**2) / np.sum((values - values.mean()) ** 2))


# How two sets of load-displacement curves agree: statistics over the settings, and over repeats of one setting.
#
# Pure functions of arrays; results are in the caller's units.


def rising(x: np.ndarray, load: np.ndarray) -> Curve:
    """The curve with the nearest load (least squares) that never falls; the same where it rises already."""
    return x, np.asarray(isotonic_regression(load).x) if np.any(np.diff(load) < 0.0) else load


def up_to(x: np.ndarray, load: np.ndarray, largest: float) -> Curve:
    """The part of a rising curve up to the load `largest`, whose displacement is interpolated."""
    if load[-1] <= largest:
        return x, load
    row = int(np.argmax(load >= largest))
    share = (largest - load[row - 1]) / (load[row] - load[row - 1])
    return np.append(x[:row], x[row - 1] + share * (x[row] - x[row - 1])), np.append(load[:row], largest)


def at_loads(x: np.ndarray, load: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Displacement at which a rising curve first bears each of `loads`; NaN beyond its largest."""
    steps = np.concatenate(([True], np.diff(load) > 0.0))
    return np.asarray(np.interp(loads, load[steps], x[steps], right=math.nan))


def curve_errors(x: np.ndarray, load: np.ndarray, x_other: np.ndarray, load_other: np.ndarray) -> dict[str, float]:
    """Root mean square differences of two rising curves over the range of load, and of displacement, that both have.

    `displacement` at equal loads, `load` at equal displacements.
    """
    loads = np.linspace(0.0, min(load[-1], load_other[-1]), GRID)[1:]
    places = np.linspace(0.0, min(x[-1], x_other[-1]), GRID)[1:]
    return {"displacement": rmse(at_loads(x, load, loads), at_loads(x_other, load_other, loads)),
            "load": rmse(np.interp(places, x, load), np.interp(places, x_other, load_other))}


def mean_and_half_width(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the first axis and half the width of its 95 % confidence interval (Student's t); NaN for one row."""
    count, mean = len(values), values.mean(axis=0)
    if count < 2:
        return mean, np.full_like(mean, np.nan)
    return mean, student.ppf(0.5 + 0.5 * LEVEL, count - 1) * values.std(axis=0, ddof=1) / math.sqrt(count)


class ErrorStatistics(NamedTuple):
    """Of one number a setting, model against measurement; None where there are too few."""

    n: int
    r2: float | None  # the coefficient of determination 1 - SSE / SST
    correlation2: float | None  # the square of Pearson's correlation, which forgives a wrong scale and offset
    rmse: float
    bias: float  # mean of model less measured
    bias_half_width: float | None  # of its 95 % confidence interval (Student's t)


def agreement(model: np.ndarray, measured: np.ndarray) -> ErrorStatistics:
    """Of (n,) values both, n > 0."""
    count = len(model)
    varied = count > 1 and np.ptp(measured) > 0.0 and np.ptp(model) > 0.0
    bias, half = mean_and_half_width(model - measured)
    return ErrorStatistics(
        count, r_squared(model, measured) if varied else None,
        float(np.corrcoef(model, measured)[0, 1] ** 2) if varied and count > 2 else None,
        rmse(model, measured), float(bias), float(half) if count > 1 else None)


@dataclass(frozen=True, kw_only=True)
class Regression:
    """Straight line of the simulated on the measured values by least squares; half-widths of 95 % intervals."""

    n: int
    slope: float
    slope_half_width: float
    intercept: float
    intercept_half_width: float


def regression(
    measured: np.ndarray, simulated: np.ndarray, at: np.ndarray
) -> tuple[Regression, dict[str, np.ndarray]] | None:
    """The line, and (m,) `line`, `low` and `high` of it with its 95 % confidence band at the measured values `at`.

    The band is that of the mean response, t(n - 2) s sqrt(1 / n + (x - mean)^2 / Sxx) to both sides of the line. None
    for fewer than three points or measured values that do not differ.
    """
    count = len(measured)
    if count < 3 or np.ptp(measured) == 0.0:
        return None
    fit, quantile = linregress(measured, simulated), float(student.ppf(0.5 + 0.5 * LEVEL, count - 2))
    line = fit.intercept + fit.slope * at
    # the standard error of the slope is s / sqrt(Sxx), and Sxx = n var: in the middle of the data s / sqrt(n) is left
    in_middle = fit.stderr * np.std(measured)
    half = quantile * np.hypot(in_middle, fit.stderr * (at - np.mean(measured)))
    return Regression(
        n=count, slope=float(fit.slope), slope_half_width=quantile * float(fit.stderr), intercept=float(fit.intercept),
        intercept_half_width=quantile * float(fit.intercept_stderr)), {
            "line": line, "low": line - half, "high": line + half}


# The measured bench that a fit takes, from either file: what was made of the curves, or the curves themselves, which
# tell of each setting, as the mean over its passes, the stiffness above 200 N and the mid-range displacement. All
# passes are cut to the smallest of their largest loads, so that there is one largest load and one half of it.


CURVES = ".csv"


def load_measured_bench(path: str | Path) -> BenchMeasurement:
    """Reads curves where the file's name ends in .csv, a bench file (`bench_curves`) else.

    Curves need the forefoot, and every setting pressed far enough for a stiffness above 200 N.
    """
    path = Path(path)
    if path.suffix.lower() != CURVES:
        return load_bench_file(path)
    curves = load_bench_curves(path)
    settings = [setting for setting in settings_of(curves, ()) if setting.passes]
    if all(setting.fulcrum_m is None for setting in settings):
        raise InputError("holds the heel only", file=path, where="column fulcrum",
                         right="A fit needs the forefoot at one position or more")
    for setting in settings:
        if not setting.judged:
            raise InputError(f"is pressed to {setting.load_n:.4g} N, too little for a stiffness above "
                             f"{STIFFNESS_ABOVE_N:g} N", file=path, where=f"{setting.where}, column load",
                             right="Press further, or leave this setting out of the file")
    load, at_setting = min(setting.load_n for setting in settings), dict[float | None, tuple[float, float]]()
    for setting in settings:
        cut = dataclasses.replace(setting, load_n=load, passes=tuple(up_to(*one, load) for one in setting.passes))
        try:
            measured = cut.measured()
        except InputError as error:
            raise InputError(error.what, file=path, where=setting.where, right=error.right) from None
        assert measured is not None and measured.stiffness_n_per_mm is not None  # it has passes, and is judged
        at_setting[setting.fulcrum_m] = 1e3 * measured.stiffness_n_per_mm, 1e-3 * measured.mid_range_mm
    heel = at_setting.pop(None, (None, None))
    return BenchMeasurement(
        name=curves.name, synthetic=curves.synthetic, fulcrum_m=tuple(x for x in at_setting if x is not None),
        stiffness_n_per_m=tuple(stiffness for stiffness, _ in at_setting.values()), heel_stiffness_n_per_m=heel[0],
        uncertainty_n_per_m=curves.stiffness_sd_n_per_m, max_load_n=load,
        mid_range_m=tuple(displacement for _, displacement in at_setting.values()), heel_mid_range_m=heel[1],
        mid_range_uncertainty_m=curves.displacement_sd_m)
