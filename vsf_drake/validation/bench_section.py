"""The sections on the foot at rest: in the testing machine, experiment beside simulation, and under
a standing person.

After Table 2 and Figure 4 of McGeehan 2021 (doi 10.1115/1.4050456), and beyond: speeds from 5 to
5000 mm/min, the way back with its energy, other points of the load. Statistics are over the
forefoot's positions; the heel stands apart.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import least_squares

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import resource
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.schema import to_plain
from vsf_drake.base.sentences import say
from vsf_drake.device import bench_lines as lines
from vsf_drake.device.bench_lines import Curve, Machine, SettingLines, SettingRow, Statistics, in_mm
from vsf_drake.device.bench_metrics import (
    at_loads,
    closed_form_stiffness,
    in_n_per_mm,
    mean_slope,
    published_stiffness,
    tuned_joints_stiffness,
)
from vsf_drake.model.model_file import load_model, secant_stiffness
from vsf_drake.model.parameters import GRAVITY, FootParameters, ModelParameters
from vsf_drake.model.setting import AtSetting
from vsf_drake.plants.foot import with_elements
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, STEPS_PER_MM
from vsf_drake.simulation.results import standing_table
from vsf_drake.simulation.standing import simulate_standing
from vsf_drake.validation.study import Section, Study, told
from vsf_drake.walks.recorded_walk import reached

PAPER = {"stiffness_r2": 0.98, "stiffness_rmse_n_per_mm": 1.37, "mid_range_rmse_mm": 0.45}
"""Of the paper's model against its own bench (McGeehan 2021, Table 2)."""
FINER = 4
"""Parts into which each keel element is cut for the line that tells the coarseness of the keel from
the rest."""
_OTHER_MODELS = {"nominal": "nominal", "soft_support": "laminate on a soft support"}
QUICK_FULCRUMS = 3
QUICK_SPEEDS_MM_PER_MIN = (50.0, 5000.0)


@dataclass(frozen=True, kw_only=True)
class PressedModel:
    """One model that is pressed at every setting."""

    key: str  # "model", "nominal", "soft_support", "refined" or "calibrated"
    name: str
    statistics: Statistics | None = None
    fitted_mm: tuple[float, float] | None = None  # positions whose curves it was calibrated to
    at_bound: tuple[str, ...] = ()  # which of its numbers then ended at a bound of the search
    held_out: Statistics | None = None  # of the settings that the calibration did not see


@dataclass(frozen=True, kw_only=True)
class LoopRow:
    """Loading to 600 N and unloading at one speed, at one position (mm; None for the heel)."""

    fulcrum_mm: float | None
    speed_mm_per_min: float
    stiffness_n_per_mm: float
    stored_j: float  # work of the platen while it loads
    lost_j: float  # what of it does not come back
    return_ratio: float
    unconverged_steps: int


@dataclass(frozen=True, kw_only=True)
class LoadPoint:
    """Stiffness above 200 N with the load at one place on the keel, both positions in mm from A."""

    load_point_mm: float
    fulcrum_mm: float
    stiffness_n_per_mm: float
    closed_form_n_per_mm: float

    @property
    def closed_form_off(self) -> float:
        """Share by which the closed form misses it."""
        return abs(self.closed_form_n_per_mm / self.stiffness_n_per_mm - 1.0)


@dataclass(frozen=True, kw_only=True)
class BenchSectionTable:
    """The bench section; the first three numbers are of the study's model, None without measured
    curves."""

    stiffness_r2: float | None
    stiffness_rmse_n_per_mm: float | None
    mid_range_rmse_mm: float | None
    limits: Mapping[str, float]  # PAPER
    within_limits: Mapping[str, bool | None]
    measured_name: str | None  # None without curves
    measured_synthetic: bool | None
    touch_down_extrapolated: int  # passes that begin under load
    contact_on_bench: tuple[str, ...] | None
    """what the contact file says of a bench; None without one"""
    lines: tuple[PressedModel, ...]  # the study's model first
    settings: tuple[SettingRow, ...]  # softest first, the heel last
    rates: tuple[LoopRow, ...]
    load_points: tuple[LoadPoint, ...]
    unconverged_steps: int


def bench_section(study: Study, *, progress: Progress | None = None) -> Section[BenchSectionTable]:
    """Presses the study's foot, the nominal one, the one on a soft support, the study's with a
    finer keel and one calibrated to two of the curves.

    Arrays: see `curve_arrays`.
    """

    foot = study.model.foot
    bench = study.bench
    quick = study.options.quick
    show = part_of(progress, name="bench: ")
    settings = lines.settings_of(bench, PUBLISHED_FULCRUMS_M)
    missing = say("bench", "inputs", given=bench, settings=settings)
    positions = [x for setting in settings if (x := setting.fulcrum_m) is not None]
    fulcrums = reached(foot, positions)
    missing += say(
        "roll_over", "unreached", positions_m=[x for x in positions if x not in fulcrums]
    )
    show("calibration", 0.1)
    feet, uncalibrated = _feet(study, settings)
    missing += uncalibrated
    curves: dict[str, list[Curve | None]] = {}
    unconverged = 0
    for i, (line, own_foot) in enumerate(feet):
        show("pressing", 0.2 + 0.07 * i)
        curves[line.key], steps = _press(line, own_foot, settings, fulcrums, missing)
        unconverged += steps
    rows = tuple(
        SettingRow(
            fulcrum_mm=in_mm(setting.fulcrum_m),
            max_load_n=setting.load_n,
            repeats=len(setting.passes),
            published_n_per_mm=in_n_per_mm(published_stiffness(setting.fulcrum_m)),
            tuned_joints_n_per_mm=in_n_per_mm(tuned_joints_stiffness(setting.fulcrum_m)),
            lines={lines.MEASURED: setting.measured()}
            | {
                key: None if (curve := own[i]) is None else lines.curve_values(curve, setting.curve)
                for key, own in curves.items()
            },
        )
        for i, setting in enumerate(settings)
    )
    models = tuple(
        dataclasses.replace(
            line,
            statistics=lines.statistics(rows, line.key),
            held_out=None
            if line.fitted_mm is None
            else lines.statistics(
                [row for row in rows if row.fulcrum_mm not in line.fitted_mm], line.key
            ),
        )
        for line, _ in feet
    )
    show("speeds", 0.5)
    if quick and len(fulcrums) > QUICK_FULCRUMS:
        fulcrums = [fulcrums[0], fulcrums[len(fulcrums) // 2], fulcrums[-1]]
    loops, failed_loops = rates(
        Machine(foot),
        (*fulcrums, None),
        QUICK_SPEEDS_MM_PER_MIN if quick else SPEEDS_MM_PER_MIN,
        progress=lambda f: show("speeds", 0.5 + 0.4 * f),
    )
    points, failed_points = load_points(
        study.model, fulcrums, lambda f: show("load points", 0.9 + 0.1 * f)
    )
    found = {name: getattr(models[0].statistics, name, None) for name in PAPER}
    table = BenchSectionTable(
        **found,
        limits=PAPER,
        within_limits={name: _within(name, value) for name, value in found.items()},
        measured_name=bench.name if bench else None,
        measured_synthetic=bench.synthetic if bench else None,
        touch_down_extrapolated=sum(one.first_load_n > 0.0 for one in bench.curves) if bench else 0,
        contact_on_bench=tuple(text for text in study.contact.verdict if "bench" in text)
        if study.contact
        else None,
        lines=models,
        settings=rows,
        rates=tuple(loops),
        load_points=tuple(points),
        unconverged_steps=unconverged + sum(row.unconverged_steps for row in loops),
    )
    return Section(
        table=table,
        arrays=lines.curve_arrays(settings, curves),
        missing=(*missing, *failed_loops, *failed_points),
    )


def _within(name: str, value: float | None) -> bool | None:
    """Whether a number is as good as the paper's."""
    if value is None:
        return None
    return bool(value >= PAPER[name] if name == "stiffness_r2" else value <= PAPER[name])


def _feet(
    study: Study, settings: Sequence[SettingLines]
) -> tuple[list[tuple[PressedModel, FootParameters]], list[str]]:
    """The models that are to be pressed, each with its foot, and why none of them is calibrated."""
    foot = study.model.foot
    others = {
        name: load_model(resource(f"models/{file}.yaml")).foot
        for file, name in _OTHER_MODELS.items()
    }
    own = (
        "fitted contact"
        if study.contact
        else "nominal"
        if others["nominal"] == foot
        else "study's model"
    )
    elements = FINER * len(foot.keel.element_lengths_m)
    finer = PressedModel(key="refined", name=f"{own}, {elements} elements")
    feet = [
        (PressedModel(key="model", name=own), foot),
        *(
            (PressedModel(key=key, name=name), others[name])
            for key, name in _OTHER_MODELS.items()
            if others[name] != foot
        ),
        (finer, with_elements(foot, elements)),
    ]
    curves = {
        x: curve
        for s in settings
        if s.judged and (x := s.fulcrum_m) is not None and (curve := s.curve) and reached(foot, [x])
    }
    if len(curves) < 3:
        return feet, say("bench", "uncalibrated") if curves else []
    missing: list[str] = []
    with told(missing, "The foot could not be calibrated to the bench curves"):
        tuned, at_bound = calibrated(foot, curves)
        line = PressedModel(
            key="calibrated",
            name="calibrated to two curves",
            at_bound=tuple(at_bound),
            fitted_mm=(round(1e3 * min(curves), 6), round(1e3 * max(curves), 6)),
        )
        feet.append((line, tuned))
    return feet, missing


def _press(
    line: PressedModel,
    foot: FootParameters,
    settings: Sequence[SettingLines],
    fulcrums_m: Container[float],
    missing: list[str],
) -> tuple[list[Curve | None], int]:
    """The foot's curves by setting, and its unconverged steps; `missing` takes what could not be
    done."""
    machine = Machine(foot)
    curves = list[Curve | None]()
    unconverged = 0
    for setting in settings:
        fulcrum = setting.fulcrum_m
        curves.append(None)
        # finer keel and calibration are the forefoot's: at the heel those feet are the study's
        if line.key not in ("refined", "calibrated") if fulcrum is None else fulcrum in fulcrums_m:
            with told(missing, f"Bench, {line.name}, {setting.where}"):
                x, load, steps = machine.press(fulcrum, max(setting.load_n, lines.LEAST_LOAD_N))
                curves[-1] = lines.up_to(*lines.rising(x, load), setting.load_n)
                unconverged += steps
    return curves, unconverged


# The foot calibrated to measured curves of its softest and its stiffest setting: the others are
# then predicted.
#
# The paper's joints were tuned on the bench; this is the like. Three numbers move, the keel's
# modulus and the two of the foam between load and keel, and minimise the difference of displacement
# at equal loads, each curve in parts of its own largest displacement. The support's stiffness
# stays.

SAMPLES = 20
"""Loads a curve, evenly up to its largest."""
MIDDLE_N = 300.0
"""Load at which the foam's depth is one of the unknowns: nearly independent of its exponent."""
_BOUNDS = {
    "keel modulus": (math.log(1e9), math.log(1e11)),
    "foam stiffness": (math.log(1e-4), math.log(3e-2)),
    "foam exponent": (1.0, 6.0),
}
"""log flexural modulus (Pa), log foam depth (m) at 300 N, exponent."""
_EVALUATIONS = 60
_STEP = 1e-3


def calibrated(
    foot: FootParameters, curves: Mapping[float, tuple[np.ndarray, np.ndarray]]
) -> tuple[FootParameters, list[str]]:
    """`foot` calibrated to the rising curves (mm, N) of the rearmost and the foremost of the
    fulcrum positions (m), and which of its numbers ended at a bound; raises if a trial foot cannot
    be pressed or the search does not end."""
    ends = min(curves), max(curves)
    loads = {x: np.linspace(0.0, float(curves[x][1][-1]), SAMPLES + 1)[1:] for x in ends}
    measured = {x: at_loads(*curves[x], loads[x]) for x in ends}

    def trial(values: np.ndarray) -> FootParameters:
        exponent = float(values[2])
        depth = math.exp(values[1])
        return dataclasses.replace(
            foot,
            keel=dataclasses.replace(foot.keel, flexural_modulus_pa=math.exp(values[0])),
            series_stiffness_n_per_m=MIDDLE_N / depth**exponent,
            series_exponent=exponent,
        )

    def residuals(values: np.ndarray) -> np.ndarray:
        machine = Machine(trial(values))
        pressed = {x: at_loads(*machine.press(x, float(loads[x][-1]))[:2], loads[x]) for x in ends}
        return np.concatenate([(pressed[x] - measured[x]) / measured[x][-1] for x in ends])

    n = foot.series_exponent
    depth_m = MIDDLE_N / secant_stiffness(foot.series_stiffness_n_per_m, n, MIDDLE_N)
    start = np.array([math.log(foot.keel.flexural_modulus_pa), math.log(depth_m), n])
    low, high = np.array([*_BOUNDS.values()]).T
    fit = least_squares(
        residuals,
        np.clip(start, low + 10 * _STEP, high - 10 * _STEP),
        bounds=(low, high),
        diff_step=_STEP,
        xtol=1e-5,
        ftol=1e-6,
        max_nfev=_EVALUATIONS,
    )
    if not fit.success:
        raise InputError(f"the calibration to the measured curves found no end: {fit.message}")
    at_bound = zip(_BOUNDS, fit.active_mask, strict=True)
    return trial(fit.x), [name for name, state in at_bound if state]


# What the paper's bench did not do: other speeds, the way back with its energy, other points of the
# load.

SPEEDS_MM_PER_MIN = (5.0, 50.0, 500.0, 5000.0)
LOAD_POINT_SHIFTS_M = (-0.020, -0.010, 0.0, 0.010)
"""Of the load point from the model's own: 179, 189, 199 and 209 mm from A for the published
foot."""


def rates(
    machine: Machine,
    fulcrums_m: Sequence[float | None],
    speeds_mm_per_min: Sequence[float],
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[LoopRow], list[str]]:
    """Loading to 600 N and unloading at the same speed, at every position and speed.

    What is lost is the small difference of two large energies, and the steps leave an error in it
    in proportion to their size. So every loop is followed twice, with steps twice as long too, and
    the loss is extrapolated to none. Returned are one row each, and what could not be done.
    """
    rows: list[LoopRow] = []
    missing: list[str] = []
    cases = [*itertools.product(fulcrums_m, speeds_mm_per_min)]
    for i, (fulcrum, speed) in enumerate(cases, start=1):
        where = f"Loading and unloading at {speed:g} mm/min, {lines.where_of(fulcrum)}"
        with told(missing, where):
            (x, load, unconverged), (x_coarse, load_coarse, more) = (
                machine.loop(fulcrum, 1e-3 * speed / 60.0, steps_per_mm=share * STEPS_PER_MM)
                for share in (1.0, 0.5)
            )
            steps = len(x) // 2 + 1
            stored = 1e-3 * float(trapezoid(load[:steps], x[:steps]))
            # of first order in the step: Richardson's extrapolation to none, 2 L(h) - L(2 h)
            lost = 1e-3 * float(2.0 * trapezoid(load, x) - trapezoid(load_coarse, x_coarse))
            rows.append(
                LoopRow(
                    fulcrum_mm=in_mm(fulcrum),
                    speed_mm_per_min=speed,
                    stored_j=stored,
                    lost_j=lost,
                    return_ratio=1.0 - lost / stored,
                    unconverged_steps=unconverged + more,
                    # at high speed the keel rings at first touch
                    stiffness_n_per_mm=mean_slope(*lines.rising(x[:steps], load[:steps])),
                )
            )
        if progress:
            progress(i / len(cases))
    return rows, missing


def load_points(
    model: ModelParameters,
    fulcrums_m: Sequence[float],
    progress: Callable[[float], None] | None = None,
) -> tuple[list[LoadPoint], list[str]]:
    """Stiffness above 200 N with the load elsewhere on the keel, beside the closed form of the
    overhung beam: one row for every load point and fulcrum position, and what could not be done."""
    rows: list[LoadPoint] = []
    missing: list[str] = []
    for i, shift in enumerate(LOAD_POINT_SHIFTS_M, start=1):
        point = round(model.foot.load_point_m + shift, 9)
        foot = dataclasses.replace(model.foot, load_point_m=point)
        if not foot.fulcrum.foremost_m < point <= sum(foot.keel.element_lengths_m) + 1e-12:
            missing.append(
                f"A load at {1e3 * point:g} mm from the keel's end is not on the free part of "
                "this keel."
            )
            continue
        machine = Machine(foot)
        for fulcrum in fulcrums_m:
            where = f"Stiffness with the load at {1e3 * point:g} mm, {lines.where_of(fulcrum)}"
            with told(missing, where):
                x, load, _ = machine.press(fulcrum)
                rows.append(
                    LoadPoint(
                        load_point_mm=round(1e3 * point, 6),
                        fulcrum_mm=round(1e3 * fulcrum, 6),
                        stiffness_n_per_mm=mean_slope(x, load),
                        closed_form_n_per_mm=1e-3
                        * float(closed_form_stiffness(to_plain(foot), fulcrum)),
                    )
                )
        if progress:
            progress(i / len(LOAD_POINT_SHIFTS_M))
    return rows, missing


# Standing: the mass that the ground carries against the mass that is known, at every fulcrum
# position walked on.

DURATION_S = 10.0
QUICK_DURATION_S = 2.0
PAPER_MASS_ERROR = -0.026
"""McGeehan 2021 (doi 10.1115/1.4050456): mass predicted from standing against mass known."""


@dataclass(frozen=True, kw_only=True)
class StoodRow(AtSetting):
    """A person who stood at one setting; what has no comment here is as `standing_table` has it."""

    mass_known_kg: float
    mass_predicted_kg: float  # mean force of both feet over 9.81 m/s²
    mass_error: float  # share of the known mass
    failure: None = None
    weight_n: float
    mean_vertical_n: float
    prosthetic_share: float
    drift_mm: float
    turn_deg: float
    held_nm: Mapping[str, float]
    stands: bool
    notes: tuple[str, ...]


_STOOD = (
    "weight_n",
    "mean_vertical_n",
    "prosthetic_share",
    "drift_mm",
    "turn_deg",
    "held_nm",
    "stands",
    "notes",
)


@dataclass(frozen=True, kw_only=True)
class FallenRow(AtSetting):
    """A setting at which nobody could stand, and why."""

    mass_known_kg: float
    failure: str


@dataclass(frozen=True, kw_only=True)
class StoodTable:
    """The standing section; rows are softest first."""

    rows: tuple[StoodRow | FallenRow, ...]
    worst_mass_error: float | None
    paper_mass_error: float
    duration_s: float
    all_stand: bool | None


def standing_section(study: Study, *, progress: Progress | None = None) -> Section[StoodTable]:
    """Stands the study's subject on the foot of each setting.

    Joints are at their anatomical zero and the foot is mounted as the model file says: what a fit
    found of offsets and joint angles belongs to recordings of walking. Arrays of row I, 200 Hz:
    `standing_I_time_s`, `standing_I_prosthetic_n`, `standing_I_intact_n`.
    """
    duration = QUICK_DURATION_S if study.options.quick else DURATION_S
    rows: list[StoodRow | FallenRow] = []
    arrays: dict[str, np.ndarray] = {}
    missing = []
    conditions = study.conditions()
    for i, (setting, (walk, *_)) in enumerate(conditions.items()):
        show = part_of(progress, i / len(conditions), 1.0 / len(conditions))
        what = f"standing, {setting.setting_words}"
        subject = walk.trial.subject
        try:
            stood = standing_table(
                simulate_standing(
                    subject,
                    walk.trial.model,
                    fulcrum_m=walk.trial.fulcrum_m,
                    duration_s=duration,
                    progress=functools.partial(show, what),
                )
            )
        except (InputError, SimulationError) as error:
            rows.append(
                FallenRow(mass_known_kg=subject.mass_kg, failure=str(error), **vars(setting))
            )
            missing.append(f"Standing failed, {setting.setting_words}: {error}")
            continue
        arrays |= {
            f"standing_{i}_{name}": getattr(stood.series, name)
            for name in ("time_s", "prosthetic_n", "intact_n")
        }
        predicted = stood.mean_vertical_n / GRAVITY
        rows.append(
            StoodRow(
                **vars(setting),
                mass_known_kg=subject.mass_kg,
                mass_predicted_kg=predicted,
                mass_error=predicted / subject.mass_kg - 1.0,
                **{name: getattr(stood, name) for name in _STOOD},
            )
        )
    if study.options.quick:
        missing.append(f"The short form stands for {QUICK_DURATION_S:g} s, not {DURATION_S:g} s.")
    standing = [row for row in rows if isinstance(row, StoodRow)]
    table = StoodTable(
        rows=tuple(rows),
        worst_mass_error=max((row.mass_error for row in standing), key=abs, default=None),
        paper_mass_error=PAPER_MASS_ERROR,
        duration_s=duration,
        all_stand=all(isinstance(row, StoodRow) and row.stands for row in rows)
        if standing
        else None,
    )
    return Section(table=table, arrays=arrays, missing=tuple(missing))
