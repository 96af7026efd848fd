"""The bench section of the validation: the foot in the testing machine, experiment beside simulation.

After Table 2 and Figure 4 of McGeehan 2021 (doi 10.1115/1.4050456), and beyond: speeds from 5 to 5000 mm/min, the way
back with its energy, other points of the load. Statistics are over the forefoot's positions; the heel stands apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.validation.bench.calibration import Calibration, calibrated
from vsf_drake.analysis.validation.bench.lines import (
    Setting,
    compared,
    curve_arrays,
    pressed,
    settings_of,
    statistics,
)
from vsf_drake.analysis.validation.bench.passes import Machine
from vsf_drake.analysis.validation.bench.rates import SPEEDS_MM_PER_MIN, load_points, rates
from vsf_drake.analysis.validation.bench.statistics import regression
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.json_file import plain
from vsf_drake.model_file import check_fulcrum, load_model
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.plants.refined_foot import with_elements
from vsf_drake.resources import resource
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, PUBLISHED_SPEED_M_PER_S

PAPER = {"stiffness_r2": 0.98, "stiffness_rmse_n_per_mm": 1.37, "mid_range_rmse_mm": 0.45}
"""Of the paper's model against its own bench (McGeehan 2021, Table 2)."""
FINER = 4
"""Parts into which each keel element is cut for the line that tells the coarseness of the keel from the rest."""
QUICK_FULCRUMS, QUICK_SPEEDS_MM_PER_MIN = 3, (50.0, 5000.0)
LINE_POINTS = 51
"""Of the regression's line."""


def bench_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Presses the study's foot, the nominal one, the study's with a finer keel and one calibrated to two of the curves.

    Returns:
        A table with `stiffness_r2`, `stiffness_rmse_n_per_mm` and `mid_range_rmse_mm` of the study's model (None
        without measured curves) and their limits; `lines`, one a model with its `statistics` and, where it was
        calibrated, those of the settings `held_out` from that; `settings`, one a position with measured and simulated
        values; `rates`; `load_points`. Arrays: see `curve_arrays`, `rates.rates`.
    """

    def show(what: str, fraction: float) -> None:
        if progress:
            progress(f"bench: {what}", fraction)

    settings = settings_of(study.bench, PUBLISHED_FULCRUMS_M)
    outside = _out_of_reach(study.model.foot, settings)
    missing = [*_missing_inputs(study, settings), *outside.values()]
    lines, found, unconverged, failures = _lines(study, settings, show)
    missing += [text for text in failures if not any(f", {where}: " in text for where in outside)]
    measured = [setting for setting in settings if setting.judged and setting.fulcrum_m is not None]
    rows = [setting.row() for setting in settings]
    for line in lines:
        of_line = [compared(setting, curve) for setting, curve in zip(settings, found[line["key"]], strict=True)]
        for row, values in zip(rows, of_line, strict=True):
            row[line["key"]] = values
        line["statistics"] = statistics(settings, of_line)
        line["within_limits"] = _within(line["statistics"])
        if line["fitted_mm"]:
            held = [i for i, row in enumerate(rows) if row["fulcrum_mm"] not in line["fitted_mm"]]
            line["held_out"] = statistics([settings[i] for i in held], [of_line[i] for i in held])
        line["end_points"] = _end_points(rows, line["key"])
    arrays = curve_arrays(settings, found)
    own = lines[0]["statistics"] or dict.fromkeys(PAPER)
    trend = _regression(rows) if measured else None
    if trend is not None:
        arrays |= {f"regression_{key}": trend.pop(key) for key in ("measured_n_per_mm", "line", "low", "high")}
    elif measured:
        missing.append("Fewer than three measured positions: no regression of simulated on measured stiffness.")
    show("speeds", 0.5)
    quick = study.options.quick
    fulcrums = [setting.fulcrum_m for setting in settings
                if setting.fulcrum_m is not None and setting.where not in outside]
    if quick and len(fulcrums) > QUICK_FULCRUMS:
        fulcrums = [fulcrums[0], fulcrums[len(fulcrums) // 2], fulcrums[-1]]
    speeds = QUICK_SPEEDS_MM_PER_MIN if quick else SPEEDS_MM_PER_MIN
    loops, loop_arrays, failures = rates(
        Machine(study.model.foot), (*fulcrums, None), speeds, progress=lambda f: show("speeds", 0.5 + 0.4 * f))
    missing += failures
    points, failures = load_points(study.model, fulcrums, lambda f: show("load points", 0.9 + 0.1 * f))
    missing += failures
    loop_positions = [None if x is None else round(1e3 * x, 6) for x in (*fulcrums, None)]
    table = {
        **{key: own[key] for key in PAPER}, "limits": PAPER, "within_limits": lines[0]["within_limits"],
        "n": lines[0]["statistics"]["n"] if lines[0]["statistics"] else 0,
        "measured": study.bench is not None, "measured_name": study.bench.name if study.bench else None,
        "measured_synthetic": study.bench.synthetic if study.bench else None,
        "touch_down_extrapolated": sum(curve.first_load_n > 0.0 for curve in study.bench.curves) if study.bench else 0,
        "speed_mm_per_min": 60e3 * PUBLISHED_SPEED_M_PER_S, "contact_name": study.contact_name or None,
        "contact_on_bench": [text for text in study.contact.verdict if "bench" in text] if study.contact else None,
        "lines": lines, "settings": rows, "regression": trend, "rates": loops, "rate_settings_mm": loop_positions,
        "rate_speeds_mm_per_min": list(speeds), "load_points": points,
        "unconverged_steps": unconverged + sum(row["unconverged_steps"] for row in loops)}
    return Section(table=plain(table), arrays=arrays | loop_arrays, missing=tuple(missing))


def _out_of_reach(foot: FootParameters, settings: list[Setting]) -> dict[str, str]:
    """A sentence for each measured position that this foot's carriage cannot take, by `Setting.where`."""
    found = {}
    for setting in settings:
        try:
            if setting.fulcrum_m is not None:
                check_fulcrum(setting.fulcrum_m, foot)
        except InputError as error:
            found[setting.where] = f"Not simulated: {error.what}. {error.right}."
    return found


def _missing_inputs(study: Study, settings: list[Setting]) -> list[str]:
    if study.bench is None:
        return ["Without measured load-displacement curves there is no R², RMSE, offset or 95 % band: stiffness "
                "stands beside the published end points only (66 mm, 151 mm and the heel)."]
    missing = [f"Measured, {s.where}: at most {s.load_n:.4g} N, too little for a stiffness above 200 N."
               for s in settings if s.passes and not s.judged]
    if all(s.fulcrum_m is None or not s.passes for s in settings):
        missing.append("The bench file holds the heel only: nothing is compared at the forefoot.")
    if not settings[-1].passes:
        missing.append("The heel was not measured.")
    if all(len(setting.passes) < 2 for setting in settings):
        missing.append("One measured pass a setting: the repeatability of the measurement is not known, so its curves "
                       "have no band.")
    return missing


def _lines(
    study: Study, settings: list[Setting], show: Progress
) -> tuple[list[dict[str, Any]], dict[str, list], int, list[str]]:
    """The models that are pressed, their curves by key, unconverged steps, and what could not be done."""
    nominal = load_model(resource("models/nominal.yaml"))
    same = nominal.foot == study.model.foot
    own = "fitted contact" if study.contact else "nominal" if same else "study's model"
    feet: dict[str, FootParameters] = {"model": study.model.foot}
    lines: list[dict[str, Any]] = [{"key": "model", "name": own, "fitted_mm": None}]
    if not same:
        feet["nominal"] = nominal.foot
        lines.append({"key": "nominal", "name": "nominal", "fitted_mm": None})
    coarse = len(study.model.foot.keel.element_lengths_m)
    finer = FINER * coarse
    feet["refined"] = with_elements(study.model.foot, finer)
    lines.append({"key": "refined", "name": f"{own}, {finer} elements", "fitted_mm": None, "elements": finer,
                  "coarse_elements": coarse})
    missing = []
    show("calibration", 0.1)
    calibration, problem = _calibration(study.model, settings)
    if calibration is not None:
        foot = feet["calibrated"] = calibration.foot
        lines.append({
            "key": "calibrated", "name": "calibrated to two curves",
            "fitted_mm": [round(1e3 * x, 6) for x in calibration.fulcrums_m], "at_bound": list(calibration.at_bound),
            "fulcrum_stiffness_n_per_m": foot.fulcrum.stiffness_n_per_m,
            "series_stiffness": foot.series_stiffness_n_per_m, "series_exponent": foot.series_exponent})
    elif problem:
        missing.append(problem)
    found, unconverged = {}, 0
    for i, (key, foot) in enumerate(feet.items()):
        show("pressing", 0.2 + 0.07 * i)
        # finer keel and calibration are the forefoot's: at the heel those feet are the study's
        found[key], failed, failures = pressed(foot, settings, heel=key not in ("calibrated", "refined"))
        unconverged += failed
        missing += [f"Bench, {lines[i]['name']}, {failure}" for failure in failures]
    return lines, found, unconverged, missing


def _calibration(model: ModelParameters, settings: list[Setting]) -> tuple[Calibration | None, str | None]:
    low, high = model.foot.fulcrum.rearmost_m, model.foot.fulcrum.foremost_m
    curves = {s.fulcrum_m: s.curve for s in settings
              if s.fulcrum_m is not None and s.judged and s.curve is not None and low <= s.fulcrum_m <= high}
    if not curves:
        return None, None
    if len(curves) < 3:
        return None, "Fewer than three usable measured positions: no foot is calibrated to two of them."
    try:
        return calibrated(model.foot, curves), None
    except (InputError, SimulationError) as error:
        return None, f"The foot could not be calibrated to the measured curves: {error}."


def _end_points(rows: list[dict[str, Any]], key: str) -> list[dict[str, Any]]:
    """Stiffness less the published one where there is one."""
    return [{"fulcrum_mm": row["fulcrum_mm"], "published_n_per_mm": row["published_n_per_mm"],
             "error_n_per_mm": row[key]["stiffness_n_per_mm"] - row["published_n_per_mm"]}
            for row in rows
            if row["published_n_per_mm"] is not None and row[key] and row[key]["stiffness_n_per_mm"] is not None]


def _regression(rows: list[dict[str, Any]]) -> dict[str, Any] | None:
    pairs = np.array([[row["measured"]["stiffness_n_per_mm"], row["model"]["stiffness_n_per_mm"]] for row in rows
                      if row["fulcrum_mm"] is not None and row["measured"] and row["model"]
                      and None not in (row["measured"]["stiffness_n_per_mm"], row["model"]["stiffness_n_per_mm"])])
    if len(pairs) < 3:
        return None
    at = np.linspace(pairs[:, 0].min(), pairs[:, 0].max(), LINE_POINTS)
    found = regression(pairs[:, 0], pairs[:, 1], at)
    return None if found is None else found | {"measured_n_per_mm": at}


def _within(found: dict[str, Any] | None) -> dict[str, bool | None]:
    """Whether each of the paper's figures is reached; None where it is not known."""
    own: dict[str, Any] = found or dict.fromkeys(PAPER)
    return {key: None if (value := own[key]) is None else bool(value >= limit if key.endswith("r2") else value <= limit)
            for key, limit in PAPER.items()}
