"""The report's chapter on walking: a function of the saved section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.report.fit_sweep_figure import fit_sweep_figure
from vsf_drake.report.pieces import Bullets, Chapter, Heading, Picture, Piece, Text
from vsf_drake.report.validation.walking import text as say
from vsf_drake.report.validation.walking.difference_figure import difference_figure, main_group
from vsf_drake.report.validation.walking.ensemble_figure import NAMES, ensemble_figure, has_curves, heading
from vsf_drake.report.validation.walking.errors_figure import walk_errors_figure
from vsf_drake.report.validation.walking.grids import (
    angle_grid,
    component_grid,
    region_grid,
    table_3,
    walk_grid,
    walk_part_grid,
)

_ACROSS = 3
_FORCES = ("vertical", "fore_aft", "medio_lateral", "resultant")
_PATHS = ("cop", "impulse", "free_moment")


def walking_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Table 3, Figures 5 to 7, null model, sweep, and where the curves differ."""
    pieces: list[Piece] = [Text(sentence) for sentence in say.findings(table)]
    if table["synthetic"]:
        pieces.append(Text("The walks are synthetic and the paper's are recorded from a person: its errors stand "
                           "beside ours for scale, and smaller ones here do not make a better model."))
    pieces += [table_3(table), *_errors_picture(table), walk_grid(table), Bullets(say.DEFINITIONS)]
    if times := say.times(table):
        pieces.append(Text(times))
    pieces.append(Heading("Forces, centre of pressure and impulse over stance"))
    pieces += [*_ensembles(table, arrays, "walking_forces", _FORCES),
               *_ensembles(table, arrays, "walking_paths", _PATHS), component_grid(table), walk_part_grid(table)]
    pieces += [Heading("Where on the curve model and measurement differ"), *_differences(table, arrays)]
    pieces += [Heading("Would another fulcrum position fit better?"), *_sweep(table)]
    pieces += [Heading("Joint angles"), Text(say.angles(table)), angle_grid(table)]
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
    found: list[Piece] = [Bullets(lines)] if (lines := say.differences(table)) else [
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
    test = "the band leaves out zero" if table["difference_method"] == say.POINTWISE else (
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
    return [Text(say.sweep(table)), Picture(
        name="walking_sweep", figure=fit_sweep_figure({"trials": rows}), alt=f"Fulcrum sweep: {best}.",
        caption="RMS error of the resultant over the fulcrum's position, a curve a walk; grey where the fulcrum stood, "
        "star where the error is least.")]
