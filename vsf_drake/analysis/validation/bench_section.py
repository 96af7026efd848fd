"""The sections on the foot at rest: in the testing machine, experiment beside simulation, and under a standing person.

After Table 2 and Figure 4 of McGeehan 2021 (doi 10.1115/1.4050456), and beyond: speeds from 5 to 5000 mm/min, the way
back with its energy, other points of the load. Statistics are over the forefoot's positions; the heel stands apart.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from vsf_drake.analysis.bench_metrics import stiffness
from vsf_drake.analysis.validation.bench_lines import (
    LEAST_LOAD_N,
    LOAD_N,
    Curve,
    Machine,
    Regression,
    SettingLines,
    SettingRow,
    Statistics,
    at_loads,
    compared,
    curve_arrays,
    judged_pairs,
    regression,
    rising,
    settings_of,
    statistics,
    up_to,
    where_of,
)
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import flat, resource
from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness, section_inertia
from vsf_drake.model_file import check_fulcrum, load_model, secant_stiffness
from vsf_drake.parameters import GRAVITY, FootParameters, ModelParameters
from vsf_drake.plants.foot import with_elements
from vsf_drake.sentences import say
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, PUBLISHED_SPEED_M_PER_S, STEPS_PER_MM
from vsf_drake.simulation.results import LegLengths, standing_table
from vsf_drake.simulation.standing import simulate_standing

PAPER = {"stiffness_r2": 0.98, "stiffness_rmse_n_per_mm": 1.37, "mid_range_rmse_mm": 0.45}
"""Of the paper's model against its own bench (McGeehan 2021, Table 2)."""
FINER = 4
"""Parts into which each keel element is cut for the line that tells the coarseness of the keel from the rest."""
QUICK_FULCRUMS, QUICK_SPEEDS_MM_PER_MIN = 3, (50.0, 5000.0)
LINE_POINTS = 51
"""Of the regression's line."""


@dataclass(frozen=True, kw_only=True)
class EndPoint:
    """A model at a position (mm; None for the heel) whose stiffness is published: by what it differs."""

    fulcrum_mm: float | None
    published_n_per_mm: float
    error_n_per_mm: float


@dataclass(frozen=True, kw_only=True)
class PressedModel:
    """One model that is pressed at every setting."""

    key: str  # "model", "nominal", "refined" or "calibrated"
    name: str
    fitted_mm: tuple[float, float] | None = None  # positions whose curves it was calibrated to
    statistics: Statistics | None = None
    within_limits: Mapping[str, bool | None] = field(default_factory=dict)  # of PAPER
    end_points: tuple[EndPoint, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RefinedLine(PressedModel):
    """The study's foot with a keel of more elements."""

    elements: int
    coarse_elements: int


@dataclass(frozen=True, kw_only=True)
class CalibratedLine(PressedModel):
    """The study's foot calibrated to the curves at two positions."""

    at_bound: tuple[str, ...]  # which of its numbers ended at a bound of the search
    fulcrum_stiffness_n_per_m: float
    series_stiffness: float
    series_exponent: float
    held_out: Statistics | None = None  # of the settings that it did not see


@dataclass(frozen=True, kw_only=True)
class LoopRow:
    """Loading to 600 N and unloading at one speed, at one position (mm; None for the heel)."""

    fulcrum_mm: float | None
    speed_mm_per_min: float
    stiffness_n_per_mm: float
    max_load_n: float
    max_displacement_mm: float
    loading_s: float
    stored_j: float
    returned_j: float
    lost_j: float
    lost_step_error_j: float
    return_ratio: float
    linear_spring_j: float  # F²/2k
    unconverged_steps: int


@dataclass(frozen=True, kw_only=True)
class LoadPoint:
    """Stiffness above 200 N with the load at one place on the keel, both positions in mm from A."""

    load_point_mm: float
    fulcrum_mm: float
    stiffness_n_per_mm: float
    closed_form_n_per_mm: float
    chain_n_per_mm: float
    own_point: bool  # whether it is the model's own


@dataclass(frozen=True, kw_only=True)
class BenchSectionTable:
    """The bench section; the first three numbers are of the study's model, None without measured curves."""

    stiffness_r2: float | None
    stiffness_rmse_n_per_mm: float | None
    mid_range_rmse_mm: float | None
    limits: Mapping[str, float]  # PAPER
    within_limits: Mapping[str, bool | None]
    n: int
    measured: bool
    measured_name: str | None
    measured_synthetic: bool | None
    touch_down_extrapolated: int  # passes that begin under load
    speed_mm_per_min: float
    contact_name: str | None
    contact_on_bench: tuple[str, ...] | None  # what the contact file says of a bench; None without one
    lines: tuple[CalibratedLine | RefinedLine | PressedModel, ...]  # the study's model first
    settings: tuple[SettingRow, ...]  # softest first, the heel last
    regression: Regression | None  # of the study's model on the measured stiffness
    rates: tuple[LoopRow, ...]
    rate_settings_mm: tuple[float | None, ...]
    rate_speeds_mm_per_min: tuple[float, ...]
    load_points: tuple[LoadPoint, ...]
    unconverged_steps: int


def bench_section(study: Study, *, progress: Progress | None = None) -> Section[BenchSectionTable]:
    """Presses the study's foot, the nominal one, the study's with a finer keel and one calibrated to two of the curves.

    Arrays: see `curve_arrays`, `rates`, and of the regression `regression_measured_n_per_mm`, `_line`, `_low`, `_high`.
    """

    def show(what: str, fraction: float) -> None:
        if progress:
            progress(f"bench: {what}", fraction)

    foot, bench, quick = study.model.foot, study.bench, study.options.quick
    settings = settings_of(bench, PUBLISHED_FULCRUMS_M)
    missing = say("bench", "inputs", given=bench, weak=[s for s in settings if s.passes and not s.judged],
                  forefoot=any(s.passes for s in settings[:-1]), heel=settings[-1].passes,
                  repeated=any(len(s.passes) > 1 for s in settings))
    outside = set()
    for position in (setting.fulcrum_m for setting in settings if setting.fulcrum_m is not None):
        try:
            check_fulcrum(position, foot)
        except InputError as error:
            outside.add(position)
            missing.append(f"Not simulated: {error.what}. {error.right}.")
    feet, uncalibrated = _lines(study, settings, show)
    missing += uncalibrated
    measured = [setting.measured() for setting in settings]
    curves: dict[str, list[Curve | None]] = {}
    unconverged = 0
    for i, (line, own_foot) in enumerate(feet):
        show("pressing", 0.2 + 0.07 * i)
        curves[line.key], steps, failures = _press(line, own_foot, settings, outside)
        unconverged += steps
        missing += failures
    rows = tuple(SettingRow(
        fulcrum_mm=setting.fulcrum_mm, max_load_n=setting.load_n, repeats=len(setting.passes),
        published_n_per_mm=setting.published_n_per_mm, measured=measured[i],
        lines={key: None if (curve := own[i]) is None else compared(setting, measured[i], curve)
               for key, own in curves.items()}) for i, setting in enumerate(settings))
    lines = tuple(_judged(line, rows) for line, _ in feet)
    arrays = curve_arrays(settings, curves)
    pairs = np.array([[values.stiffness_n_per_mm for values in pair] for pair in judged_pairs(rows, "model")])
    trend = None
    if len(pairs) > 2:
        at = np.linspace(pairs[:, 1].min(), pairs[:, 1].max(), LINE_POINTS)
        trend = regression(pairs[:, 1], pairs[:, 0], at)
    if trend is not None:
        arrays |= {"regression_measured_n_per_mm": at} | {f"regression_{key}": band for key, band in trend[1].items()}
    elif any(setting.judged for setting in settings[:-1]):
        missing += say("bench", "no_trend")
    show("speeds", 0.5)
    fulcrums = [x for setting in settings if (x := setting.fulcrum_m) is not None and x not in outside]
    if quick and len(fulcrums) > QUICK_FULCRUMS:
        fulcrums = [fulcrums[0], fulcrums[len(fulcrums) // 2], fulcrums[-1]]
    speeds = QUICK_SPEEDS_MM_PER_MIN if quick else SPEEDS_MM_PER_MIN
    loops, loop_arrays, failed_loops = rates(
        Machine(foot), (*fulcrums, None), speeds, progress=lambda f: show("speeds", 0.5 + 0.4 * f))
    points, failed_points = load_points(study.model, fulcrums, lambda f: show("load points", 0.9 + 0.1 * f))
    own = lines[0].statistics
    table = BenchSectionTable(
        stiffness_r2=own.stiffness_r2 if own else None,
        stiffness_rmse_n_per_mm=own.stiffness_rmse_n_per_mm if own else None,
        mid_range_rmse_mm=own.mid_range_rmse_mm if own else None, limits=PAPER, within_limits=lines[0].within_limits,
        n=own.n if own else 0, measured=bench is not None, measured_name=bench.name if bench else None,
        measured_synthetic=bench.synthetic if bench else None,
        touch_down_extrapolated=sum(curve.first_load_n > 0.0 for curve in bench.curves) if bench else 0,
        speed_mm_per_min=60e3 * PUBLISHED_SPEED_M_PER_S, contact_name=study.contact_name or None,
        contact_on_bench=tuple(text for text in study.contact.verdict if "bench" in text) if study.contact else None,
        lines=lines, settings=rows, regression=trend and trend[0], rates=tuple(loops),
        rate_settings_mm=(*(round(1e3 * x, 6) for x in fulcrums), None), rate_speeds_mm_per_min=speeds,
        load_points=tuple(points), unconverged_steps=unconverged + sum(row.unconverged_steps for row in loops))
    return Section(table=table, arrays=arrays | loop_arrays, missing=(*missing, *failed_loops, *failed_points))


def _lines(
    study: Study, settings: list[SettingLines], show: Progress
) -> tuple[list[tuple[PressedModel, FootParameters]], list[str]]:
    """The models that are to be pressed, each with its foot, and why none of them is calibrated."""
    foot, nominal = study.model.foot, load_model(resource("models/nominal.yaml")).foot
    own = "fitted contact" if study.contact else "nominal" if nominal == foot else "study's model"
    coarse = len(foot.keel.element_lengths_m)
    lines: list[tuple[PressedModel, FootParameters]] = [(PressedModel(key="model", name=own), foot)]
    if nominal != foot:
        lines.append((PressedModel(key="nominal", name="nominal"), nominal))
    lines.append((RefinedLine(key="refined", name=f"{own}, {FINER * coarse} elements", elements=FINER * coarse,
                              coarse_elements=coarse), with_elements(foot, FINER * coarse)))
    show("calibration", 0.1)
    low, high = foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m
    curves = {s.fulcrum_m: s.curve for s in settings
              if s.fulcrum_m is not None and s.judged and s.curve is not None and low <= s.fulcrum_m <= high}
    if len(curves) < 3:
        return lines, say("bench", "uncalibrated", error=None) if curves else []
    try:
        tuned, at_bound = calibrated(foot, curves)
    except (InputError, SimulationError) as error:
        return lines, say("bench", "uncalibrated", error=error)
    lines.append((CalibratedLine(
        key="calibrated", name="calibrated to two curves",
        fitted_mm=(round(1e3 * min(curves), 6), round(1e3 * max(curves), 6)), at_bound=tuple(at_bound),
        fulcrum_stiffness_n_per_m=tuned.fulcrum.stiffness_n_per_m, series_stiffness=tuned.series_stiffness_n_per_m,
        series_exponent=tuned.series_exponent), tuned))
    return lines, []


def _press(
    line: PressedModel, foot: FootParameters, settings: Sequence[SettingLines], outside: Container[float | None]
) -> tuple[list[Curve | None], int, list[str]]:
    """The foot's curves by setting, its unconverged steps, and what could not be done."""
    machine, curves, unconverged, missing = Machine(foot), list[Curve | None](), 0, []
    for setting in settings:
        curve = None
        # finer keel and calibration are the forefoot's: at the heel those feet are the study's
        if setting.fulcrum_m not in outside and (setting.fulcrum_m is not None or line.key in ("model", "nominal")):
            try:
                x, load, steps = machine.press(setting.fulcrum_m, max(setting.load_n, LEAST_LOAD_N))
                curve = up_to(*rising(x, load), setting.load_n)
                unconverged += steps
            except (InputError, SimulationError) as error:
                missing.append(f"Bench, {line.name}, {setting.where}: {error}.")
        curves.append(curve)
    return curves, unconverged, missing


def _judged(line: PressedModel, rows: Sequence[SettingRow]) -> PressedModel:
    """The line with what its curves come to."""
    own = statistics(rows, line.key)
    values = {name: getattr(own, name) if own else None for name in PAPER}
    line = dataclasses.replace(
        line, statistics=own, within_limits={
            name: None if (value := values[name]) is None else
            bool(value >= limit if name == "stiffness_r2" else value <= limit) for name, limit in PAPER.items()},
        end_points=tuple(
            EndPoint(fulcrum_mm=row.fulcrum_mm, published_n_per_mm=row.published_n_per_mm,
                     error_n_per_mm=pressed.stiffness_n_per_mm - row.published_n_per_mm)
            for row in rows if row.published_n_per_mm is not None and (pressed := row.lines[line.key]) is not None
            and pressed.stiffness_n_per_mm is not None))
    if isinstance(line, CalibratedLine) and line.fitted_mm:
        seen = line.fitted_mm
        line = dataclasses.replace(
            line, held_out=statistics([row for row in rows if row.fulcrum_mm not in seen], line.key))
    return line


# The foot calibrated to measured curves of its softest and its stiffest setting: the others are then predicted.
#
# The paper's joints were tuned on the bench; this is the like. Three numbers move, the fulcrum's stiffness and the two
# of the foam between load and keel, and minimise the difference of displacement at equal loads, each curve in parts of
# its own largest displacement. The keel's modulus stays the material's.

SAMPLES = 20
"""Loads a curve, evenly up to its largest."""
MIDDLE_N = 300.0
"""Load at which the foam's depth is one of the unknowns: nearly independent of its exponent."""
_LOW, _HIGH = (math.log(1e4), math.log(1e-4), 1.0), (math.log(1e7), math.log(3e-2), 6.0)
"""log fulcrum stiffness (N/m), log foam depth (m) at 300 N, exponent."""
_EVALUATIONS = 60
_STEP = 1e-3


def calibrated(
    foot: FootParameters, curves: Mapping[float, tuple[np.ndarray, np.ndarray]]
) -> tuple[FootParameters, list[str]]:
    """`foot` calibrated to the rising curves (mm, N) of the rearmost and the foremost of the fulcrum positions (m), and
    which of its numbers ended at a bound; raises if a trial foot cannot be pressed or the search does not end."""
    ends = min(curves), max(curves)
    loads = {x: np.linspace(0.0, float(curves[x][1][-1]), SAMPLES + 1)[1:] for x in ends}
    measured = {x: at_loads(*curves[x], loads[x]) for x in ends}

    def trial(values: np.ndarray) -> FootParameters:
        exponent, depth = float(values[2]), math.exp(values[1])
        return dataclasses.replace(
            foot, fulcrum=dataclasses.replace(foot.fulcrum, stiffness_n_per_m=math.exp(values[0])),
            series_stiffness_n_per_m=MIDDLE_N / depth**exponent, series_exponent=exponent)

    def residuals(values: np.ndarray) -> np.ndarray:
        machine = Machine(trial(values))
        pressed = {x: at_loads(*machine.press(x, float(loads[x][-1]))[:2], loads[x]) for x in ends}
        return np.concatenate([(pressed[x] - measured[x]) / measured[x][-1] for x in ends])

    k, n = foot.series_stiffness_n_per_m, foot.series_exponent
    start = np.array([math.log(foot.fulcrum.stiffness_n_per_m),
                      math.log(MIDDLE_N / secant_stiffness(k, n, MIDDLE_N)), max(n, 1.0 + 10 * _STEP)])
    start = np.clip(start, np.array(_LOW) + 10 * _STEP, np.array(_HIGH) - 10 * _STEP)
    fit = least_squares(residuals, start, bounds=(_LOW, _HIGH), diff_step=_STEP, xtol=1e-5, ftol=1e-6,
                        max_nfev=_EVALUATIONS)
    if not fit.success:
        raise InputError(f"the calibration to the measured curves found no end: {fit.message}")
    return trial(fit.x), [name for name, state in zip((
        "fulcrum stiffness", "foam stiffness", "foam exponent"), fit.active_mask, strict=True) if state]


# What the paper's bench did not do: other speeds, the way back with its energy, other points of the load.

SPEEDS_MM_PER_MIN = (5.0, 50.0, 500.0, 5000.0)
LOAD_POINT_SHIFTS_M = (-0.020, -0.010, 0.0, 0.010)
"""Of the load point from the model's own: 179, 189, 199 and 209 mm from A for the published foot."""
LOOP_SAMPLES = 101
"""Of each half of a loop, evenly in displacement."""


def rates(
    machine: Machine, fulcrums_m: Sequence[float | None], speeds_mm_per_min: Sequence[float],
    *, progress: Callable[[float], None] | None = None
) -> tuple[list[LoopRow], dict[str, np.ndarray], list[str]]:
    """Loading to 600 N and unloading at the same speed, at every position and speed.

    What is lost is the small difference of two large energies, and the steps leave an error in it in proportion to
    their size. So every loop is followed twice, with steps twice as long too, and the loss is extrapolated to none.
    Returned are one row each; the loops at the highest speed, `loop_mm` and `loop_n` (settings, 2, 101) with loading
    first; what could not be done.
    """
    rows: list[LoopRow] = []
    missing: list[str] = []
    cases = [(i, fulcrum, speed) for i, fulcrum in enumerate(fulcrums_m) for speed in speeds_mm_per_min]
    loops = {name: np.full((len(fulcrums_m), 2, LOOP_SAMPLES), np.nan) for name in ("loop_mm", "loop_n")}
    for j, (i, fulcrum, speed) in enumerate(cases, start=1):
        where = where_of(fulcrum)
        try:
            loop, coarse = (machine.loop(fulcrum, LOAD_N, 1e-3 * speed / 60.0, steps_per_mm=share * STEPS_PER_MM)
                            for share in (1.0, 0.5))
            # at high speed the keel rings at first touch
            x, load = rising(loop.mm[: loop.top + 1], loop.n[: loop.top + 1])
            k = 1e-3 * stiffness(1e-3 * x, load, where=where)
        except (InputError, SimulationError) as error:
            missing.append(f"Loading and unloading at {speed:g} mm/min, {where}: {error}.")
            continue
        stored, top = loop.stored_j, float(loop.n[loop.top])
        # of first order in the step: Richardson's extrapolation to none, 2 L(h) - L(2 h)
        lost = 2.0 * loop.lost_j - coarse.lost_j
        rows.append(LoopRow(
            fulcrum_mm=None if fulcrum is None else round(1e3 * fulcrum, 6), speed_mm_per_min=speed,
            stiffness_n_per_mm=k, max_load_n=top, max_displacement_mm=float(loop.mm[loop.top]),
            loading_s=loop.loading_s, stored_j=stored, returned_j=stored - lost, lost_j=lost,
            lost_step_error_j=abs(loop.lost_j - coarse.lost_j), return_ratio=1.0 - lost / stored,
            linear_spring_j=1e-3 * top**2 / (2.0 * k),
            unconverged_steps=loop.unconverged_steps + coarse.unconverged_steps))
        if speed == max(speeds_mm_per_min):
            up, steps = np.linspace(0.0, loop.mm[loop.top], LOOP_SAMPLES), loop.top + 1
            loops["loop_mm"][i] = up, up[::-1]
            loops["loop_n"][i] = (np.interp(up, loop.mm[:steps], loop.n[:steps]),
                                  np.interp(up, loop.mm[: loop.top - 1 : -1], loop.n[: loop.top - 1 : -1])[::-1])
        if progress:
            progress(j / len(cases))
    return rows, loops, missing


def load_points(
    model: ModelParameters, fulcrums_m: Sequence[float], progress: Callable[[float], None] | None = None
) -> tuple[list[LoadPoint], list[str]]:
    """Stiffness above 200 N with the load elsewhere on the keel, beside the closed form of the overhung beam: one row
    for every load point and fulcrum position, and what could not be done."""
    rows: list[LoadPoint] = []
    missing: list[str] = []
    for i, shift in enumerate(LOAD_POINT_SHIFTS_M):
        point = round(model.foot.load_point_m + shift, 9)
        foot = dataclasses.replace(model.foot, load_point_m=point)
        if not foot.fulcrum.foremost_m < point <= sum(foot.keel.element_lengths_m) + 1e-12:
            missing.append(f"A load at {1e3 * point:g} mm from the keel's end is not on the free part of this keel.")
            continue
        machine = Machine(foot)
        for fulcrum in fulcrums_m:
            where = f"load at {1e3 * point:g} mm, fulcrum at {1e3 * fulcrum:g} mm"
            try:
                x, load, _ = machine.press(fulcrum)
            except (InputError, SimulationError) as error:
                missing.append(f"Stiffness with the {where}: {error}.")
                continue
            rows.append(LoadPoint(
                load_point_mm=round(1e3 * point, 6), fulcrum_mm=round(1e3 * fulcrum, 6),
                stiffness_n_per_mm=1e-3 * stiffness(1e-3 * x, load, where=where),
                closed_form_n_per_mm=1e-3 * small_load_stiffness(foot, fulcrum),
                chain_n_per_mm=1e-3 * small_load_stiffness(foot, fulcrum, chain=True), own_point=shift == 0.0))
        if progress:
            progress((i + 1) / len(LOAD_POINT_SHIFTS_M))
    return rows, missing


def small_load_stiffness(foot: FootParameters, fulcrum_m: float, *, chain: bool = False) -> float:
    """Stiffness (N/m) of the keel on its fulcrum while it is hardly bent, the foam's in series.

    The foam's is its mean slope between the two loads of the bench. The keel is a continuous overhung beam
    (`laws.beam.combined_stiffness`), or the model's chain of sprung joints (`laws.beam.lumped_stiffness`): what the
    two differ by is the chain's coarseness, and by what the simulation then exceeds the chain is large deflection.
    """
    k, n = foot.series_stiffness_n_per_m, foot.series_exponent
    low, high = ((load / k) ** (1.0 / n) for load in (STIFFNESS_ABOVE_N, LOAD_N))
    keel = foot.keel
    given = {
        "bending_stiffness": keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        "support": fulcrum_m, "load_point": foot.load_point_m, "fulcrum_stiffness": foot.fulcrum.stiffness_n_per_m,
        "series_stiffness": (LOAD_N - STIFFNESS_ABOVE_N) / (high - low)}
    if chain:
        return lumped_stiffness(element_lengths=keel.element_lengths_m, **given)
    return float(combined_stiffness(**given))


# Standing: the mass that the ground carries against the mass that is known, at every fulcrum position walked on.

DURATION_S, QUICK_DURATION_S = 10.0, 2.0
PAPER_MASS_ERROR = -0.026
"""McGeehan 2021 (doi 10.1115/1.4050456): mass predicted from standing against mass known."""


@dataclass(frozen=True, kw_only=True)
class StoodRow:
    """A person who stood at one position of the fulcrum; what has no comment here is as `standing_table` has it."""

    fulcrum_mm: float
    mass_known_kg: float
    mass_predicted_kg: float  # mean force of both feet over 9.81 m/s²
    mass_error: float  # share of the known mass
    failure: None = None
    weight_n: float
    mean_vertical_n: float
    weight_error: float
    mean_prosthetic_n: float
    mean_intact_n: float
    prosthetic_share: float
    drift_mm: float
    turn_deg: float
    pelvis_deg: Mapping[str, float]
    free: tuple[str, ...]
    held_nm: Mapping[str, float]
    leg_length_mm: LegLengths
    centre_of_mass_height_mm: float
    unconverged_steps: int
    refined_steps: int
    converged: bool
    stands: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class FallenRow:
    """A position at which nobody could stand, and why; the rest is unknown."""

    fulcrum_mm: float
    mass_known_kg: float
    failure: str
    unknown: Mapping[str, None] = flat()


_TAKEN = [one.name for one in dataclasses.fields(StoodRow)][5:]


@dataclass(frozen=True, kw_only=True)
class StoodTable:
    """The standing section; rows are softest first."""

    rows: tuple[StoodRow | FallenRow, ...]
    worst_mass_error: float | None
    paper_mass_error: float
    duration_s: float
    all_stand: bool | None


def standing_section(study: Study, *, progress: Progress | None = None) -> Section[StoodTable]:
    """Stands the study's subject on its foot, at each fulcrum position.

    Joints are at their anatomical zero and the foot is mounted as the model file says: what a fit found of offsets and
    joint angles belongs to recordings of walking. Arrays of row I, 50 Hz: `standing_I_time_s`,
    `standing_I_prosthetic_n`, `standing_I_intact_n`, `standing_I_drift_mm`.
    """
    duration = QUICK_DURATION_S if study.options.quick else DURATION_S
    rows: list[StoodRow | FallenRow] = []
    arrays: dict[str, np.ndarray] = {}
    missing = []
    conditions = study.conditions()
    for i, (fulcrum, (walk, *_)) in enumerate(conditions.items()):
        def show(fraction: float, i: int = i, fulcrum: float = fulcrum) -> None:
            if progress:
                progress(f"standing, fulcrum at {fulcrum:g} mm", (i + fraction) / len(conditions))

        subject = walk.trial.subject
        try:
            stood = standing_table(simulate_standing(
                subject, study.model, fulcrum_m=walk.trial.fulcrum_m, duration_s=duration, progress=show))
        except (InputError, SimulationError) as error:
            rows.append(FallenRow(
                fulcrum_mm=fulcrum, mass_known_kg=subject.mass_kg, failure=str(error),
                unknown=dict.fromkeys(("mass_predicted_kg", "mass_error", *_TAKEN))))
            missing.append(f"Standing with the fulcrum at {fulcrum:g} mm failed: {error}")
            continue
        arrays |= {f"standing_{i}_{name}": getattr(stood.series, name)
                   for name in ("time_s", "prosthetic_n", "intact_n", "drift_mm")}
        predicted = stood.mean_vertical_n / GRAVITY
        rows.append(StoodRow(
            fulcrum_mm=fulcrum, mass_known_kg=subject.mass_kg, mass_predicted_kg=predicted,
            mass_error=predicted / subject.mass_kg - 1.0, **{key: getattr(stood, key) for key in _TAKEN}))
    if study.options.quick:
        missing.append(f"The short form stands for {QUICK_DURATION_S:g} s, not {DURATION_S:g} s.")
    standing = [row for row in rows if isinstance(row, StoodRow)]
    table = StoodTable(
        rows=tuple(rows), worst_mass_error=max((row.mass_error for row in standing), key=abs, default=None),
        paper_mass_error=PAPER_MASS_ERROR, duration_s=duration,
        all_stand=len(standing) == len(rows) and all(row.stands for row in standing) if standing else None)
    return Section(table=table, arrays=arrays, missing=tuple(missing))
