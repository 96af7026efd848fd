"""The bench of the validation, setting by setting: the measured curves, and what each model does
there."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.special import stdtrit

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import flat
from vsf_drake.device.bench_metrics import LOAD_N, at_loads, mean_slope
from vsf_drake.model.bench_curves import (
    STIFFNESS_ABOVE_N,
    BenchCurves,
    BenchMeasurement,
    bench_doubts,
    load_bench_curves,
    load_bench_file,
)
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, STEPS_PER_MM, Bench
from vsf_drake.walks.comparison import r_squared, rmse
from vsf_drake.walks.numbers import finite

LEAST_LOAD_N = 1.25 * STIFFNESS_ABOVE_N
"""Largest load from which a pass has a stiffness: less leaves too little of it above 200 N."""
MOST_LOAD_N = 5000.0
"""What the simulated machine presses with at most."""
GRID = 201
"""Loads, evenly from 0, at which a setting's curves are compared."""
LEVEL = 0.95
CURVES = ".csv"
MEASURED = "measured"
"""Of the lines of a setting the one that a machine recorded; the others are models."""

Curve = tuple[np.ndarray, np.ndarray]
"""(n,) displacement (mm) and load (N) from (0, 0), rising."""


@dataclass(frozen=True, kw_only=True)
class CurveValues:
    """One rising curve; of a model where there is a measured one also by what it differs."""

    stiffness_n_per_mm: float | None  # mean slope above 200 N; None without 250 N
    stiffness_n_per_mm_half_width: float | None = None
    """of the 95 % confidence interval of the mean over passes"""
    mid_range_mm: float  # at half of the largest load
    max_displacement_mm: float
    curvature_share: float
    """largest distance of the curve from its chord, along the displacement, over the travel"""
    mid_range_offset_mm: float | None = None
    curve_rmse_mm: float | None = None  # at equal loads


@dataclass(frozen=True, kw_only=True)
class SettingRow:
    """One position of the fulcrum (mm from A; None for the heel): what was measured, and what each
    model does."""

    fulcrum_mm: float | None
    max_load_n: float
    repeats: int
    published_n_per_mm: float | None
    tuned_joints_n_per_mm: float | None  # of the authors' public model, derived from its scripts
    lines: Mapping[str, CurveValues | None] = flat()
    """MEASURED and the models' keys; None where there is none"""


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """Agreement of a model with the measured curves over the forefoot's settings that both have a
    stiffness at."""

    n: int
    stiffness_r2: float | None
    stiffness_rmse_n_per_mm: float
    mid_range_rmse_mm: float
    curve_rmse_mm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SettingLines:
    """One position of the fulcrum (m from A; None for the heel) with its measured passes, up to one
    load (N)."""

    fulcrum_m: float | None
    load_n: float
    passes: tuple[Curve, ...] = ()

    @property
    def where(self) -> str:
        """What it is called in messages."""
        return where_of(self.fulcrum_m)

    @property
    def curve(self) -> Curve | None:
        """The measured curve: the only pass, or the mean displacement of all at equal loads; None
        without one."""
        if len(self.passes) < 2:
            return self.passes[0] if self.passes else None
        loads = np.linspace(0.0, self.load_n, GRID)
        return np.mean([at_loads(*one, loads) for one in self.passes], axis=0), loads

    @property
    def judged(self) -> bool:
        """Whether its measured stiffness can be compared."""
        return bool(self.passes) and self.load_n >= LEAST_LOAD_N

    def measured(self) -> CurveValues | None:
        """What the machine measured, stiffness as the mean over the passes; None without a pass."""
        if self.curve is None:
            return None
        values = curve_values(self.curve)
        if not self.judged:
            return values
        mean, half = mean_and_half_width(np.array([mean_slope(*one) for one in self.passes]))
        return dataclasses.replace(
            values,
            stiffness_n_per_mm=float(mean),
            stiffness_n_per_mm_half_width=finite(float(half)),
        )


def where_of(fulcrum_m: float | None) -> str:
    """What a position (m from A; None for the heel) is called in messages."""
    return "heel" if fulcrum_m is None else f"fulcrum at {1e3 * fulcrum_m:g} mm"


def in_mm(fulcrum_m: float | None) -> float | None:
    """A position as tables have it."""
    return None if fulcrum_m is None else round(1e3 * fulcrum_m, 6)


def settings_of(bench: BenchCurves | None, fulcrums_m: Sequence[float]) -> list[SettingLines]:
    """The measured settings, or `fulcrums_m` where none was measured, and the heel in any case,
    last."""
    measured: dict[float | None, list[Curve]] = {}
    for curve in bench.curves if bench is not None else ():
        measured.setdefault(curve.fulcrum_m, []).append(
            rising(1e3 * curve.displacement_m, curve.load_n)
        )
    settings = []
    for position in [*(sorted(x for x in measured if x is not None) or fulcrums_m), None]:
        passes = measured.get(position, [])
        largest = min([MOST_LOAD_N, *(float(load[-1]) for _, load in passes)]) if passes else LOAD_N
        settings.append(
            SettingLines(
                fulcrum_m=position,
                load_n=largest,
                passes=tuple(up_to(*one, largest) for one in passes),
            )
        )
    return settings


def curve_values(curve: Curve, measured: Curve | None = None) -> CurveValues:
    """What one rising curve comes to, and by what it differs from a measured one."""
    x, load = curve
    middle = float(at_loads(x, load, 0.5 * load[-1]))
    values = CurveValues(
        stiffness_n_per_mm=mean_slope(x, load) if load[-1] >= LEAST_LOAD_N * (1.0 - 1e-9) else None,
        mid_range_mm=middle,
        max_displacement_mm=float(x[-1]),
        curvature_share=float(np.max(np.abs(x / x[-1] - load / load[-1]))),
    )
    if measured is None:
        return values
    loads = np.linspace(0.0, min(load[-1], measured[1][-1]), GRID)[1:]
    return dataclasses.replace(
        values,
        mid_range_offset_mm=middle - float(at_loads(*measured, 0.5 * measured[1][-1])),
        curve_rmse_mm=rmse(at_loads(x, load, loads), at_loads(*measured, loads)),
    )


def judged_pairs(rows: Sequence[SettingRow], line: str) -> list[tuple[CurveValues, CurveValues]]:
    """A line's values and the measured ones at the forefoot's settings where both have a
    stiffness."""
    pairs = [(row.lines[line], row.lines[MEASURED]) for row in rows if row.fulcrum_mm is not None]
    return [
        (own, measured)
        for own, measured in pairs
        if own is not None
        and measured is not None
        and own.stiffness_n_per_mm is not None
        and measured.stiffness_n_per_mm is not None
    ]


def statistics(rows: Sequence[SettingRow], line: str) -> Statistics | None:
    """Agreement of a line over the forefoot's judged settings; None where there is none."""
    pairs = judged_pairs(rows, line)
    if not pairs:
        return None
    k, mid = (
        np.array([[getattr(values, key) for values in pair] for pair in pairs], dtype=float).T
        for key in ("stiffness_n_per_mm", "mid_range_mm")
    )
    return Statistics(
        n=len(pairs),
        stiffness_r2=finite(r_squared(*k)),
        stiffness_rmse_n_per_mm=rmse(*k),
        mid_range_rmse_mm=rmse(*mid),
        curve_rmse_mm=float(
            np.sqrt(np.mean([(own.curve_rmse_mm or 0.0) ** 2 for own, _ in pairs]))
        ),
    )


def curve_arrays(
    settings: Sequence[SettingLines], by_line: dict[str, list[Curve | None]]
) -> dict[str, np.ndarray]:
    """Curves on shared loads, (settings, 201): `load_n`, `measured_mm` with
    `measured_half_width_mm` (95 %), and for each line `<key>_mm`."""
    loads = np.array([np.linspace(0.0, setting.load_n, GRID) for setting in settings])
    arrays = {"load_n": loads, "measured_half_width_mm": np.full(loads.shape, np.nan)}
    for i, setting in enumerate(settings):
        if setting.passes:
            arrays["measured_half_width_mm"][i] = mean_and_half_width(
                np.array([at_loads(*one, loads[i]) for one in setting.passes])
            )[1]
    for key, curves in ({MEASURED: [setting.curve for setting in settings]} | by_line).items():
        arrays[f"{key}_mm"] = np.array(
            [
                np.full(GRID, np.nan) if curve is None else at_loads(*curve, loads[i])
                for i, curve in enumerate(curves)
            ]
        )
    return arrays


class Machine:
    """One foot in the simulated testing machine, in mm and N; forefoot and heel are built when
    first pressed."""

    def __init__(self, foot: FootParameters) -> None:
        self.foot = foot
        self._bench = functools.cache(lambda heel: Bench(foot, heel=heel))

    def press(
        self,
        fulcrum_m: float | None,
        load_n: float = LOAD_N,
        speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S,
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Displacement (mm) and load (N) from (0, 0) to exactly `load_n` with the fulcrum there (m
        from A; None for the heel), and how many steps did not converge; raises what `Bench.press`
        does."""
        setting = self._bench(fulcrum_m is None).press(
            fulcrum_m=self._carriage_m(fulcrum_m), max_load_n=load_n, speed_m_per_s=speed_m_per_s
        )
        x = np.append(0.0, 1e3 * setting.platen_m)
        load = np.append(0.0, setting.load_n)
        return *up_to(x, load, load_n), setting.unconverged_steps

    def loop(
        self, fulcrum_m: float | None, speed_m_per_s: float, *, steps_per_mm: float = STEPS_PER_MM
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """As `press`, up to where 600 N are reached at this speed and in as many steps down to
        touch-down again.

        The platen's speed jumps at the top and viscous forces with it: the loading's last load is
        extrapolated from the two steps before.
        """
        top = 1e-3 * float(self.press(fulcrum_m, LOAD_N, speed_m_per_s)[0][-1])
        steps = int(np.ceil(top * 1e3 * steps_per_mm))
        way = np.linspace(0.0, top, steps + 1)
        setting = self._bench(fulcrum_m is None).follow(
            fulcrum_m=self._carriage_m(fulcrum_m),
            platen_m=np.concatenate((way, way[-2::-1])),
            time_s=np.linspace(0.0, 2.0 * top / speed_m_per_s, 2 * steps + 1),
        )
        x = np.append(0.0, 1e3 * setting.platen_m)
        load = np.append(0.0, setting.load_n)
        load[steps] = 2.0 * load[steps - 1] - load[steps - 2]
        return x, load, setting.unconverged_steps

    def _carriage_m(self, fulcrum_m: float | None) -> float:
        return self.foot.fulcrum.rearmost_m if fulcrum_m is None else fulcrum_m


def rising(x: np.ndarray, load: np.ndarray) -> Curve:
    """The curve with the nearest load (least squares) that never falls; the same where it rises
    already."""
    return x, np.asarray(isotonic_regression(load).x) if np.any(np.diff(load) < 0.0) else load


def up_to(x: np.ndarray, load: np.ndarray, largest: float) -> Curve:
    """The part of a rising curve up to the load `largest`, whose displacement is interpolated."""
    if load[-1] <= largest:
        return x, load
    before = load < largest
    return np.append(x[before], at_loads(x, load, largest)), np.append(load[before], largest)


def mean_and_half_width(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the first axis and half the width of its 95 % confidence interval (Student's t);
    NaN for one row."""
    count = len(values)
    mean = values.mean(axis=0)
    if count < 2:
        return mean, np.full_like(mean, np.nan)
    quantile = stdtrit(count - 1, 0.5 + 0.5 * LEVEL)
    return mean, quantile * values.std(axis=0, ddof=1) / math.sqrt(count)


def load_measured_bench(path: str | Path) -> BenchMeasurement:
    """The measured bench that a fit takes: of curves where the file's name ends in .csv, of a bench
    file else.

    Of curves, each setting's stiffness above 200 N and mid-range displacement, as the mean over its
    passes; all passes are cut to the smallest of their largest loads. They need the forefoot, and
    every setting pressed far enough.
    """
    path = Path(path)
    if path.suffix.lower() != CURVES:
        return load_bench_file(path)
    curves = load_bench_curves(path)
    settings = [setting for setting in settings_of(curves, ()) if setting.passes]
    if all(setting.fulcrum_m is None for setting in settings):
        raise InputError(
            "holds the heel only",
            file=path,
            where="column fulcrum",
            right="A fit needs the forefoot at one position or more",
        )
    for setting in settings:
        if not setting.judged:
            raise InputError(
                f"is pressed to {setting.load_n:.4g} N, too little for a stiffness above "
                f"{STIFFNESS_ABOVE_N:g} N",
                file=path,
                where=f"{setting.where}, column load",
                right=" ".join(bench_doubts(curves))
                or "Press further, or leave this setting out of the file",
            )
    load = min(setting.load_n for setting in settings)
    at_setting = dict[float | None, tuple[float, float]]()
    for setting in settings:
        cut = dataclasses.replace(
            setting, load_n=load, passes=tuple(up_to(*one, load) for one in setting.passes)
        )
        measured = cut.measured()
        # it has passes, and is judged
        assert measured is not None and measured.stiffness_n_per_mm is not None
        at_setting[setting.fulcrum_m] = (
            1e3 * measured.stiffness_n_per_mm,
            1e-3 * measured.mid_range_mm,
        )
    heel = at_setting.pop(None, (None, None))
    return BenchMeasurement(
        name=curves.name,
        synthetic=curves.synthetic,
        fulcrum_m=tuple(x for x in at_setting if x is not None),
        stiffness_n_per_m=tuple(stiffness for stiffness, _ in at_setting.values()),
        heel_stiffness_n_per_m=heel[0],
        uncertainty_n_per_m=curves.stiffness_sd_n_per_m,
        max_load_n=load,
        mid_range_m=tuple(displacement for _, displacement in at_setting.values()),
        heel_mid_range_m=heel[1],
        mid_range_uncertainty_m=curves.displacement_sd_m,
    )
