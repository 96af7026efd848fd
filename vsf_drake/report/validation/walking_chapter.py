"""The report's chapter on walking: a function of the saved section."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.report.fit_figures import fit_sweep_figure
from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Picture, Piece, Text
from vsf_drake.report.validation.walking_figures import (
    NAMES,
    difference_figure,
    ensemble_figure,
    has_curves,
    heading,
    main_group,
    walk_errors_figure,
)

_ACROSS = 3
_FORCES = ("vertical", "fore_aft", "medio_lateral", "resultant")
_PATHS = ("cop", "impulse", "free_moment")


def walking_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Table 3, Figures 5 to 7, null model, sweep, and where the curves differ."""
    pieces: list[Piece] = [Text(sentence) for sentence in findings(table)]
    if table["synthetic"]:
        pieces.append(Text("The walks are synthetic and the paper's are recorded from a person: its errors stand "
                           "beside ours for scale, and smaller ones here do not make a better model."))
    pieces += [table_3(table), *_errors_picture(table), walk_grid(table), Bullets(DEFINITIONS)]
    if when := times(table):
        pieces.append(Text(when))
    pieces.append(Heading("Forces, centre of pressure and impulse over stance"))
    pieces += [*_ensembles(table, arrays, "walking_forces", _FORCES),
               *_ensembles(table, arrays, "walking_paths", _PATHS), component_grid(table), walk_part_grid(table)]
    pieces += [Heading("Where on the curve model and measurement differ"), *_differences(table, arrays)]
    pieces += [Heading("Would another fulcrum position fit better?"), *_sweep(table)]
    pieces += [Heading("Joint angles"), Text(angles(table)), angle_grid(table)]
    return Chapter(name="walking", title="Walking", pieces=tuple(pieces))


def _errors_picture(table: Mapping[str, Any]) -> list[Piece]:
    parts = [f"{row['label']} ({row['role']}) {100.0 * row['grf_rmse_bw']:.1f} % BW" + (
        "" if row["null_model_grf_rmse_bw"] is None else f", null model {100.0 * row['null_model_grf_rmse_bw']:.1f}")
        for row in table["rows"] if row["grf_rmse_bw"] is not None]
    return [Picture(
        name="walking_errors", figure=walk_errors_figure(table),
        alt=f"Errors of every walk. Resultant force: {'; '.join(parts) or 'not known'}.",
        caption="Errors of every walk, by fulcrum position (colour); open marks are walks that no fit has seen. "
        "Crosses: the null model. Grey: the paper's errors, of a person's recorded walks; of the impulse's the range.")]


def _ensembles(
    table: Mapping[str, Any], arrays: Mapping[str, np.ndarray], name: str, quantities: Sequence[str]
) -> list[Piece]:
    """Pictures of up to three conditions each; none where nothing was measured."""
    conditions = [i for i in range(len(table["conditions"])) if any(has_curves(arrays, i, q) for q in quantities)]
    found: list[Piece] = []
    for part in range(0, len(conditions), _ACROSS):
        own = conditions[part : part + _ACROSS]
        shown = [q for q in quantities if any(has_curves(arrays, i, q) for i in own)]
        found.append(Picture(
            name=f"{name}_{part // _ACROSS + 1}" if len(conditions) > _ACROSS else name,
            figure=ensemble_figure(table, arrays, shown, own),
            alt="Mean curves over stance, plate against model. " + " ".join(
                _curve_alt(table, arrays, i, q) for i in own for q in shown if has_curves(arrays, i, q)),
            caption="Mean ± SD over the walks of a condition on 101 points of the measured stance: plate solid with a "
            "band, simulation dashed between dotted lines. A walk counts once."))
    return found


def _curve_alt(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray], group: int, quantity: str) -> str:
    """The extreme of the measured curve, and where the two are furthest apart."""
    unit = table["units"][quantity]
    measured, model = (np.asarray(arrays[f"group_{group}_{quantity}_{side}_mean"], dtype=float)
                       for side in ("measured", "model"))
    known = np.flatnonzero(np.isfinite(measured) & np.isfinite(model))
    if not len(known):
        return ""
    peak = measured[known][np.argmax(np.abs(measured[known]))]
    at = int(known[np.argmax(np.abs(model - measured)[known])])
    return (f"{heading(table['conditions'][group])}, {NAMES[quantity][0]}: extreme {peak:.3g} {unit}, largest "
            f"difference {model[at] - measured[at]:+.2g} {unit} at {at} % of stance.")


def _differences(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> list[Piece]:
    group = main_group(table)
    found: list[Piece] = [Bullets(lines)] if (lines := differences(table)) else [
        Text("Not tested: there are too few walks.")]
    if not any(has_curves(arrays, group, quantity) for quantity in NAMES):
        return found
    own = [d for d in table["differences"] if d["group"] == group and d["largest_difference"] is not None]
    found.append(Picture(
        name="walking_differences", figure=difference_figure(table, arrays),
        alt=f"Mean difference over stance, model less plate. Largest: {'; '.join(map(_largest, own))}.",
        caption=_difference_caption(table)))
    if (grid := region_grid(table)) is not None:
        found.append(grid)
    return found


def _difference_caption(table: Mapping[str, Any]) -> str:
    """What is drawn; a percentile bootstrap covers less than it says where the walks are few."""
    if not any(d["method"] for d in table["differences"]):
        return "Model less plate, mean over all walks (black) and over those of each condition (colour)."
    test = "the band leaves out zero" if table["difference_method"] == POINTWISE else (
        "the test, which is for the whole curve, finds a difference")
    return ("Model less plate, mean over all walks (black) with its pointwise 95 % bootstrap band, and over those of "
            "each condition (colour). Of few walks such a band holds the true mean less often than it says: of nine "
            "in nine cases of ten, of three in three of four, if their differences are normal. Bars and shades: where "
            f"{test}.")


def _largest(found: Mapping[str, Any]) -> str:
    share = "" if found["share"] is None else ", no region differs" if not found["regions"] else (
        f", different over {found['share']:.0%} of the curve")
    return f"{NAMES[found['quantity']][0]} {found['largest_difference']:+.3g} {found['unit']}{share}"


def _sweep(table: Mapping[str, Any]) -> list[Piece]:
    rows = [row for row in table["rows"] if row["sweep"]]
    if not any(error is not None for row in rows for error in row["sweep"]["grf_rmse_bw"]):
        return [Text("No walk could be scored with the fulcrum elsewhere.")]
    best = "; ".join(f"{row['label']} stood at {row['sweep']['true_mm']:.0f} mm, least error at "
                     f"{row['sweep']['best_mm']:.0f} mm" for row in rows if row["sweep"]["best_mm"] is not None)
    return [Text(sweep(table)), Picture(
        name="walking_sweep", figure=fit_sweep_figure({"trials": rows}), alt=f"Fulcrum sweep: {best}.",
        caption="RMS error of the resultant over the fulcrum's position, a curve a walk; grey where the fulcrum stood, "
        "star where the error is least.")]


# The chapter on the embedded walks without errors of measurement: what of an error is the model's own.


def exact_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Table 3 and every walk of the tier whose motion and force belong together; `walking_section` made both."""
    grids = [dataclasses.replace(grid, name=grid.name.replace("walking", "exact"))
             for grid in (table_3(table), walk_grid(table))]
    return Chapter(name="walking_exact", title="Walking without errors of measurement", pieces=(
        Text("The same synthetic walks with the very motion that made the force, and with a contact fitted to two of "
             "them. Here nothing is wrong but the model, so what is left is its own; the walks above also have errors "
             "of measurement, and a contact that was fitted with these."),
        *(Text(sentence) for sentence in findings(table)), *grids))


# Tables of the walking chapter: Table 3 with the paper's numbers, every walk, every rotation, regions.


_GRF = Column(key="grf_rmse_bw", heading="GRF, % BW", form="{:.1f}", scale=100.0)
_GRF_R2 = Column(key="grf_r2", heading="R²", form="{:.3f}")
_IMPULSE = Column(key="impulse_rmse_bws", heading="impulse, BW s", form="{:.4f}")
_IMPULSE_R2 = Column(key="impulse_r2", heading="R²", form="{:.3f}")
_COP = Column(key="cop_rmse_fl", heading="CoP, % FL", form="{:.1f}", scale=100.0)
_COP_R2 = Column(key="cop_r2", heading="R²", form="{:.3f}")
_PLATE = Column(key="stance_measured_s", heading="stance, plate, s", form="{:.3f}")
_MODEL = Column(key="stance_model_s", heading="model, s", form="{:.3f}")
_PARTS = (
    Column(key="vertical_rmse_bw", heading="vertical, % BW", form="{:.1f}", scale=100.0),
    Column(key="fore_aft_rmse_bw", heading="fore-aft, % BW", form="{:.1f}", scale=100.0),
    Column(key="medio_lateral_rmse_bw", heading="medio-lateral, % BW", form="{:.1f}", scale=100.0),
    Column(key="cop_ml_rmse_fl", heading="CoP medio-lateral, % FL", form="{:.1f}", scale=100.0),
    Column(key="free_moment_rmse_nm", heading="free moment, N m", form="{:.2f}"),
    Column(key="free_moment_rmse_bwfl", heading="% BW·FL", form="{:.2f}", scale=100.0),
    Column(key="heel_strike_error_s", heading="heel strike, ms", form="{:+.1f}", scale=1e3),
    Column(key="toe_off_error_s", heading="toe-off, ms", form="{:+.1f}", scale=1e3))
_FIRST = (Column(key="setting", heading="condition"), Column(key="source", heading="walks"),
          Column(key="n", heading="n", form="{:.0f}"))
_FREE_R2 = Column(key="free_moment_r2", heading="R²", form="{:.2f}")


def table_3(table: Mapping[str, Any]) -> Grid:
    """The paper's Table 3: a condition in up to four rows, the last the paper's."""
    spread = _with_spread((_GRF, _GRF_R2, _IMPULSE, _IMPULSE_R2, _COP, _COP_R2, _PLATE, _MODEL))
    low, high = table["paper"]["impulse_rmse_bws"]
    return Grid(
        name="walking_table_3", columns=(*_FIRST, *spread), rows=list(_condition_rows(table)),
        caption="Table 3: RMS errors and R² by fulcrum position, mean and sample standard deviation (SD) over walks; "
        "all walks, then by what the fit has seen. BW: body weight. FL: foot length. Rows \"paper\": what is published "
        f"of McGeehan 2021 and known here; its impulse errors are {low:g} to {high:g} BW s over all settings, its "
        f"resultant error is {100.0 * table['paper']['fitted_grf_rmse_bw']:g} % BW on the walk that was fitted, of "
        "which the setting is not known here. \"–\": not known.")


def component_grid(table: Mapping[str, Any]) -> Grid:
    """Components, medio-lateral centre of pressure, free moment and times by condition."""
    return Grid(
        name="walking_components", columns=(*_FIRST, *_with_spread(_PARTS)),
        rows=[row for row in _condition_rows(table) if row["source"] != "paper"],
        caption="Components of the force, medio-lateral centre of pressure, free moment (RMS errors) and instants "
        "(model less plate: late is positive) by fulcrum position, mean and SD over walks. What the paper gives of "
        "them is not known here.")


def walk_grid(table: Mapping[str, Any]) -> Grid:
    """A row a walk: what the paper scores, the null model and the sweep."""
    columns = (*_WALK, _GRF, _GRF_R2,
               Column(key="null_model_grf_rmse_bw", heading="null model, % BW", form="{:.1f}", scale=100.0),
               Column(key="beats_null", heading="beats it"), _IMPULSE, _IMPULSE_R2, _COP, _COP_R2, _PLATE, _MODEL,
               Column(key="sweep_best_mm", heading="least error at, mm", form="{:.0f}"),
               Column(key="sweep_right", heading="right"))
    rows = [{**row, "sweep_best_mm": row["sweep"] and row["sweep"]["best_mm"],
             "sweep_right": row["sweep"] and row["sweep"]["right"]} for row in table["rows"]]
    return Grid(name="walking_trials", columns=columns, rows=rows, caption="Every walk. Null model: the measured curve "
                "of another walk, stretched to this one's stance. Least error at: where the fulcrum sweep is lowest.")


def walk_part_grid(table: Mapping[str, Any]) -> Grid:
    """A row a walk: components, times, free moment, angles."""
    parts = (*_PARTS[:5], _FREE_R2, *_PARTS[5:])
    columns = (*_WALK, *parts, Column(key="angle_rmse_deg", heading="angles, °", form="{:.2g}"),
               Column(key="angle_lag_ms", heading="lag, ms", form="{:.2f}"))
    return Grid(name="walking_trial_components", columns=columns, rows=list(table["rows"]),
                caption="Every walk: components, times, free moment, and how the joint angles follow the command.")


_WALK = (Column(key="label", heading="walk"), Column(key="role", heading="role"),
         Column(key="fulcrum_mm", heading="fulcrum, mm", form="{:g}"))


def angle_grid(table: Mapping[str, Any]) -> Grid:
    """A row a rotation."""
    columns = (Column(key="rotation", heading="rotation"), Column(key="n", heading="walks", form="{:.0f}"),
               Column(key="rmse_deg", heading="RMS error, °", form="{:.2g}"),
               Column(key="r2", heading="R²", form="{:.6g}"), Column(key="lag_ms", heading="lag, ms", form="{:.3f}"),
               Column(key="range_deg", heading="range, °", form="{:.1f}"),
               Column(key="recording_rmse_deg", heading="from the recording, °", form="{:.2f}"))
    return Grid(name="walking_angles", columns=columns, rows=list(table["angles"]), caption="Joint angles, followed "
                "against commanded, over all walks: RMS error, least R², largest lag. Last column: followed against "
                "the recording, which is what the fit corrected.")


def region_grid(table: Mapping[str, Any]) -> Grid | None:
    """A row a region in which model and plate differ; None where there is none."""
    rows = [{"group": _group(table, found["group"]), "quantity": NAMES[found["quantity"]][0], "unit": found["unit"],
             "n": found["n"], **region, "p": _p(region["p"])}
            for found in table["differences"] for region in found["regions"]]
    if not rows:
        return None
    columns = (Column(key="group", heading="walks"), Column(key="quantity", heading="curve"),
               Column(key="n", heading="n", form="{:.0f}"),
               Column(key="start_percent", heading="from, % stance", form="{:.0f}"),
               Column(key="end_percent", heading="to, % stance", form="{:.0f}"),
               Column(key="mean_difference", heading="mean difference", form="{:+.3g}"),
               Column(key="unit", heading="unit"), Column(key="p", heading="p"))
    return Grid(name="walking_regions", columns=columns, rows=rows, caption="Where on the curve model and plate "
                f"differ: model less plate, mean over region and walks, by {table['difference_method']}.")


def _condition_rows(table: Mapping[str, Any]) -> Iterable[dict[str, Any]]:
    for condition in table["conditions"]:
        name = heading(condition)
        roles = {role: own for role, own in condition["by_role"].items() if own}
        sources = {"all": condition["all"]} if len(roles) > 1 else {}
        for source, own in (sources | roles).items():
            row: dict[str, Any] = {"setting": name, "source": source, "n": own["n"]}
            for key, found in own.items():
                if key != "n":
                    row |= {key: found["mean"], f"{key}_sd": found["sd"]}
            yield row
        if condition["paper"]:
            yield {"setting": name, "source": "paper", "n": None, **condition["paper"]}


def _with_spread(columns: Sequence[Column]) -> list[Column]:
    """Each column followed by that of its standard deviation."""
    return [one for own in columns for one in (own, Column(
        key=f"{own.key}_sd", heading="SD", form=own.form.replace("+", ""), scale=own.scale))]


def _p(p: float | None) -> str | None:
    return None if p is None else "< 0.001" if p < 1e-3 else f"{p:.3f}"


def _group(table: Mapping[str, Any], group: int | str) -> str:
    return "all" if group == "all" else heading(table["conditions"][int(group)])


# Sentences of the walking chapter; every number is from the saved section.


ROLES = {
    "held_out": ("held out", "What the fit has not seen"), "fitted": ("fitted", "What it was fitted to"),
    "offsets_fitted": ("offsets fitted", "With offsets fitted to each walk's own plate, which is no prediction")}
POINTWISE = "pointwise bootstrap"
"""The method of a section that was made without spm1d, as it is saved."""
DEFINITIONS = (
    "Forces: both low-passed at 40 Hz, time-locked, over each measured stance ± 0.25 s; along and across the direction "
    "of walking. The resultant is the length of the filtered force.",
    "Impulse: running integral of the resultant from the plate's heel strike.",
    "Centre of pressure (CoP): both low-passed at 6 Hz, at 101 points of the measured stance, where model and plate "
    "both carry more than 20 N. Free moment: about the vertical (up +) through each one's own centre of pressure, "
    "filtered and taken at the same points.",
    "Times: the vertical force passes 20 N; model less plate, late is positive.",
    "R² is 1 - SSE/SST, not a squared correlation.",
    "Null model: the measured resultant of another walk, one that the fit has seen if any is here, stretched to this "
    "walk's measured stance; of several the best. It knows the measured times, which the model does not.")


def findings(table: Mapping[str, Any]) -> list[str]:
    """A sentence a role, the softest claims last."""
    return [f"{opening} ({own['n']} walk{'s' * (own['n'] != 1)}): {_errors(own)}"
            for key, (_, opening) in ROLES.items() if (own := table[key])]


def times(table: Mapping[str, Any]) -> str:
    """Stance times, strikes and lifts over all walks; "" where none is known."""
    rows = table["rows"]
    parts = [f"{name} {_mean(rows, key, 1e3):+.1f} ms" for name, key in (
        ("heel strike", "heel_strike_error_s"), ("toe-off", "toe_off_error_s"), ("stance", "stance_error_s"))
        if any(row[key] is not None for row in rows)]
    if not parts:
        return ""
    r = "" if table["stance_r"] is None else (
        f" Stance times of model and plate correlate with r = {table['stance_r']:.4f} over {table['stance_n']} walks; "
        "a correlation does not see a constant error.")
    return f"Model less plate, mean over walks: {', '.join(parts)}.{r}"


def angles(table: Mapping[str, Any]) -> str:
    """How the joints follow, and what the fit changed."""
    paper = table["paper"]
    if table["angle_rmse_deg"] is None:
        return "No rotation was prescribed."
    lag = "not known" if table["angle_lag_ms"] is None else f"{abs(table['angle_lag_ms']):.3f} ms at most"
    r2 = "not known" if table["angle_r2"] is None else f"{table['angle_r2']:.4f}"
    changed = table["angle_recording_rmse_deg"]
    fit = "" if not changed else (
        f" Against the recording itself the difference is {changed:.2f}° RMS: that is what the fit corrected of the "
        "recorded angles, not a tracking error.")
    return (f"Joint angles follow what they are told with an RMS error of {table['angle_rmse_deg']:.2g}° (paper "
            f"{paper['angle_rmse_deg']:g}°), R² {r2} (paper {paper['angle_r2']:g}) and a lag of {lag}. This is so by "
            f"construction: the joints are prescribed, nothing filters them on the way.{fit}")


def sweep(table: Mapping[str, Any]) -> str:
    """What the fulcrum sweep says."""
    swept = [row for row in table["rows"] if row["sweep"] and row["sweep"]["right"] is not None]
    unknown = [row["label"] for row in table["rows"] if row["sweep"] and row["sweep"]["right"] is None]
    ends = sum(row["sweep"]["at_end"] for row in swept)
    inner = [abs(row["sweep"]["off_mm"]) for row in swept
             if not row["sweep"]["at_end"] and row["sweep"]["off_mm"] is not None]
    end = f" In {ends} of them it stood at an end of the carriage, where an error outwards cannot show." if ends else ""
    far = f" {'Elsewhere it' if ends else 'It'} is at most {max(inner):.1f} mm off." if inner else ""
    tuned = " Offsets were fitted with the fulcrum where it stood, which favours that place." if table[
        "offsets_fitted"] else ""
    open_ = f" Where it is least is not known of {', '.join(unknown)}: walks of the sweep failed." if unknown else ""
    made = "The fulcrum is moved over its carriage and each walk made again, all else as fitted."
    if not swept:
        return f"{made}{open_}"
    return (f"{made} The error is least within half a setting (10.5 mm) of where the fulcrum stood in "
            f"{table['sweeps_right']} of {table['sweeps']} walk{'s' * (table['sweeps'] != 1)}.{end}{far}{tuned}{open_}")


def differences(table: Mapping[str, Any]) -> list[str]:
    """How it was tested where the curves differ, and what came out over all walks."""
    method, own = table["difference_method"], [d for d in table["differences"] if d["group"] == main_group(table)]
    if method is None:
        return []
    tests = sum(d["method"] is not None for d in table["differences"])
    if method == POINTWISE:
        how = ("Method: pointwise bootstrap bands (95 %, percentile, over walks, seeded); they are pointwise and not "
               "corrected for how many points there are, and with three walks they are no more than the range of the "
               "three, which leaves out the true mean in one case of four. spm1d, which would do better, is not "
               "installed.")
    else:
        how = (f"Method: statistical parametric mapping (spm1d {table['spm1d']}), paired t-test, two-tailed, alpha "
               "0.05 for a whole curve.")
    limits = [(d["n"], d["threshold"]) for d in table["differences"] if d["threshold"] is not None]
    few = f" With {min(limits)[0]} walks |t| must exceed {max(limits, key=lambda p: p[1])[1]:.0f}." if limits else ""
    found = [f"{how} {tests} curves were tested, without correction for their number.{few} That no region is marked is "
             "not agreement: the walks are few."]
    fitted = sum(row["role"] != "held out" for row in table["rows"])
    if fitted:
        found.append(f"{fitted} of the {len(table['rows'])} walks, or their offsets, were fitted; they pull the mean "
                     "difference to zero.")
    for d in own:
        if d["method"] is None:
            continue
        spans = ", ".join(f"{r['start_percent']:.0f}-{r['end_percent']:.0f} % ({r['mean_difference']:+.3g})"
                          for r in d["regions"])
        found.append(f"{NAMES[d['quantity']][0].capitalize()} ({d['n']} walks, {d['unit']}): "
                     f"{spans if spans else 'no region'}; largest mean difference {d['largest_difference']:+.3g}.")
    return found


def _errors(own: Mapping[str, Any]) -> str:
    several = own["n"] > 1
    parts = []
    for key, name, scale, unit, form in (("grf_rmse_bw", "resultant force", 100.0, "% BW", ".1f"),
                                         ("cop_rmse_fl", "centre of pressure", 100.0, "% foot length", ".1f"),
                                         ("impulse_rmse_bws", "impulse", 1.0, "BW s", ".3f")):
        if own[key] is not None:
            worst = own[f"{key}_worst"]
            at = f" (worst {scale * worst:{form}}, {own[f'{key}_worst_trial']})" if several else ""
            parts.append(f"{name} {scale * own[key]:{form}} {unit}{at}")
    text = "RMS error " + ", ".join(parts) + "." if parts else "no error is known."
    if own["beats_null_of"]:
        text += (f" {own['beats_null']} of {own['beats_null_of']} beat the null model"
                 + (f", whose mean is {100.0 * own['null_model_grf_rmse_bw']:.1f} % BW."))
    return text


def _mean(rows: Sequence[Mapping[str, Any]], key: str, scale: float) -> float:
    values = [row[key] for row in rows if row[key] is not None]
    return scale * float(sum(values)) / len(values)
