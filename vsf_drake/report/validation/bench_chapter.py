"""The bench chapter of the validation's report: the foot in the testing machine, experiment beside simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.bench_figures import (
    bench_agreement_figure,
    bench_curves_figure,
    bench_energy_figure,
    bench_load_point_figure,
    bench_shape_figure,
    forefoot,
    position,
    value,
)

_ERRORS = (" Middle: error of stiffness, with the 95 % confidence band of the regression of simulated on measured "
           "stiffness, less identity. Right: offset of the mid-range displacement.")


def bench_chapter(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Chapter:
    """The chapter; `table` and `arrays` of the saved bench section."""
    judged = bool(table["n"])
    pieces: list[Piece] = [
        Text(source_text(table)),
        Bullets([text for text in (result_text(table), coarseness_text(table), fit_text(table),
                                   calibration_text(table), heel_text(table)) if text])]
    if table["unconverged_steps"]:
        pieces.append(Missing(f"{table['unconverged_steps']} steps of the simulated bench did not converge: do not "
                              "trust this chapter."))
    if judged:
        pieces.append(comparison_grid(table))
    pieces += [
        Picture(name="bench_curves", figure=bench_curves_figure(table, arrays), alt=curves_alt(table), caption=(
            "Load over displacement. Solid: measured, or the published slope where there is no curve. Dashed: "
            "simulated. Dotted: the nominal model. Band around the measurement, where passes were repeated: 95 % "
            "confidence of their mean. Dotted line across: 200 N, above which stiffness is the mean slope.")),
        settings_grid(table),
        Picture(name="bench_agreement", figure=bench_agreement_figure(table, arrays), alt=agreement_alt(table),
                caption="Left: stiffness by position, filled measured, open simulated." + (_ERRORS if judged else "")),
        Heading("Linear and curvilinear"), Text(shape_text(table)),
        Picture(name="bench_shape", figure=bench_shape_figure(table, arrays), alt=shape_alt(table), caption=(
            "Left: slope of the curves. Right: the curve's largest distance from the straight line between its ends, "
            "along the displacement.")),
        shape_grid(table)]
    if table["rates"]:
        pieces += [
            Heading("Other speeds, and the way back"), Text(energy_text(table)),
            Picture(name="bench_energy", figure=bench_energy_figure(table, arrays), alt=energy_alt(table), caption=(
                "Simulated. Left: loops at the highest speed. Middle: what is lost of the stored energy. Right: energy "
                "stored at 600 N, beside that of a linear spring and, where a curve was measured, its own.")),
            rates_grid(table)]
    if table["load_points"]:
        pieces += [
            Heading("Other points of the load"), Text(load_point_text(table)),
            Picture(name="bench_load_point", figure=bench_load_point_figure(table), alt=load_point_alt(table),
                    caption="Simulated stiffness by load point, beside the closed form of the overhung beam with the "
                            "same compliances of fulcrum and foam."),
            load_point_grid(table)]
    return Chapter(name="bench", title="Bench", pieces=tuple(pieces))


# The tables of the bench chapter.


_STATISTICS = (("stiffness_r2", "R² of stiffness", "{:.4f}"),
               ("stiffness_rmse_n_per_mm", "RMSE of stiffness (N/mm)", "{:.2f}"),
               ("mid_range_rmse_mm", "RMSE of mid-range displacement (mm)", "{:.2f}"))
_MORE = (("stiffness_correlation2", "squared correlation", "{:.4f}"),
         ("stiffness_bias_n_per_mm", "mean error of stiffness (N/mm)", "{:+.2f}"),
         ("stiffness_bias_half_width_n_per_mm", "± 95 % (N/mm)", "{:.2f}"),
         ("mid_range_bias_mm", "mean offset Δ_D (mm)", "{:+.2f}"),
         ("mid_range_bias_half_width_mm", "± 95 % (mm)", "{:.2f}"),
         ("curve_rmse_mm", "RMSE of the curves at equal load (mm)", "{:.2f}"),
         ("curve_rmse_n", "at equal displacement (N)", "{:.1f}"))


def comparison_grid(table: Mapping[str, Any]) -> Grid:
    """Each model's statistics beside the paper's; for a table with measured curves."""
    rows: list[dict[str, Any]] = []
    for line in table["lines"]:
        for key, name in (("statistics", line["name"]), ("held_out", f"{line['name']}: the settings it did not see")):
            if line.get(key):
                rows.append({"of": name, **line[key]})
    rows.append({"of": "paper, its model on its bench", "n": 5, **table["limits"]})
    return Grid(name="bench_comparison", rows=rows, columns=(
        Column(key="of", heading="model"), Column(key="n", heading="settings", form="{:.0f}"),
        *(Column(key=key, heading=heading, form=form) for key, heading, form in (*_STATISTICS, *_MORE))),
        caption="Agreement over the forefoot's settings. R² is the coefficient of determination 1 - SSE/SST, which "
                "a wrong scale or offset lowers; the squared correlation forgives both. Intervals: Student's t over "
                "the settings.")


def settings_grid(table: Mapping[str, Any]) -> Grid:
    """Stiffness and mid-range displacement at every setting, measured, published and of every model."""
    columns = [Column(key="setting", heading="fulcrum"), Column(key="max_load_n", heading="up to (N)", form="{:.0f}"),
               Column(key="published_n_per_mm", heading="published stiffness (N/mm)", form="{:.1f}")]
    if table["measured"]:
        columns += [Column(key="repeats", heading="passes", form="{:.0f}"),
                    Column(key="measured_n_per_mm", heading="measured stiffness (N/mm)", form="{:.2f}"),
                    Column(key="measured_half_width_n_per_mm", heading="± 95 % (N/mm)", form="{:.2f}"),
                    Column(key="measured_mid_range_mm", heading="measured mid-range displacement (mm)", form="{:.2f}"),
                    Column(key="measured_mid_range_half_width_mm", heading="± 95 % (mm)", form="{:.2f}")]
    for line in table["lines"]:
        key, name = line["key"], line["name"]
        columns.append(Column(key=f"{key}_n_per_mm", heading=f"{name}: stiffness (N/mm)", form="{:.2f}"))
        if table["measured"]:
            columns += [Column(key=f"{key}_offset_mm", heading=f"{name}: offset Δ_D (mm)", form="{:+.2f}"),
                        Column(key=f"{key}_curve_rmse_mm", heading=f"{name}: curve RMSE (mm)", form="{:.2f}")]
        else:
            columns.append(Column(key=f"{key}_mid_range_mm", heading=f"{name}: mid-range displacement (mm)",
                                  form="{:.2f}"))
    rows = []
    for row in table["settings"]:
        shown = {"setting": position(row["fulcrum_mm"]), "max_load_n": row["max_load_n"],
                 "published_n_per_mm": row["published_n_per_mm"], "repeats": row["repeats"] or None,
                 "measured_n_per_mm": value(row, "measured", "stiffness_n_per_mm"),
                 "measured_half_width_n_per_mm": value(row, "measured", "stiffness_n_per_mm_half_width"),
                 "measured_mid_range_mm": value(row, "measured", "mid_range_mm"),
                 "measured_mid_range_half_width_mm": value(row, "measured", "mid_range_mm_half_width")}
        for line in table["lines"]:
            key = line["key"]
            shown |= {f"{key}_n_per_mm": value(row, key, "stiffness_n_per_mm"),
                      f"{key}_offset_mm": value(row, key, "mid_range_offset_mm"),
                      f"{key}_mid_range_mm": value(row, key, "mid_range_mm"),
                      f"{key}_curve_rmse_mm": value(row, key, "curve_rmse_mm")}
        rows.append(shown)
    return Grid(name="bench_settings", rows=rows, columns=columns, caption=(
        "Setting by setting. Stiffness: mean slope above 200 N (eq. 3 of the paper). Mid-range displacement: at half "
        "of the largest load. Offset Δ_D: the simulation's less the measurement's. The heel is in no statistic above."))


def shape_grid(table: Mapping[str, Any]) -> Grid:
    """How straight each curve is."""
    columns = [Column(key="setting", heading="fulcrum"), Column(key="of", heading="curve"),
               Column(key="line_r2", heading="R² of a line, all", form="{:.4f}"),
               Column(key="line_r2_above", heading="above 200 N", form="{:.4f}"),
               Column(key="curvature_share", heading="largest distance from the chord (% of travel)", form="{:.1f}",
                      scale=100.0),
               Column(key="first_slope_ratio", heading="slope up to 50 N / above 200 N", form="{:.2f}"),
               Column(key="toe", heading="toe (mm)", form="{:.2f}"),
               Column(key="toe_share", heading="toe (% of travel)", form="{:.1f}", scale=100.0)]
    names = {"measured": "measured"} | {line["key"]: line["name"] for line in table["lines"]}
    rows = [{"setting": position(row["fulcrum_mm"]), "of": name, **row[key]["shape"]}
            for row in table["settings"] for key, name in names.items() if value(row, key, "shape")]
    return Grid(name="bench_shape", columns=columns, rows=rows, caption=(
        "Linear and curvilinear. Line: a straight line of load over displacement, over the whole travel and over that "
        "above 200 N. Toe: displacement by which the curve up to 200 N exceeds the line with the slope above it; "
        "large deflection of the keel counts into it as the foam does."))


def rates_grid(table: Mapping[str, Any]) -> Grid:
    """Loading and unloading by speed."""
    rows = [row | {"setting": position(row["fulcrum_mm"]), "lost_share": 1.0 - row["return_ratio"]}
            for row in table["rates"]]
    return Grid(name="bench_rates", rows=rows, columns=(
        Column(key="setting", heading="fulcrum"), Column(key="speed_mm_per_min", heading="speed (mm/min)", form="{:g}"),
        Column(key="loading_s", heading="loading takes (s)", form="{:.3g}"),
        Column(key="stiffness_n_per_mm", heading="stiffness (N/mm)", form="{:.2f}"),
        Column(key="stored_j", heading="stored (J)", form="{:.2f}"),
        Column(key="linear_spring_j", heading="F²/2k (J)", form="{:.2f}"),
        Column(key="returned_j", heading="returned (J)", form="{:.2f}"),
        Column(key="lost_j", heading="lost (J)", form="{:.2g}"),
        Column(key="lost_share", heading="lost (%)", form="{:.2g}", scale=100.0)), caption=(
            "Simulated loading to 600 N and unloading at the same speed. Stored: work of the platen while it loads; "
            "returned: work of the foot on it while it unloads. F²/2k: a linear spring of that stiffness."))


def load_point_grid(table: Mapping[str, Any]) -> Grid:
    """Stiffness by load point."""
    return Grid(name="bench_load_point", rows=table["load_points"], columns=(
        Column(key="load_point_mm", heading="load at (mm)", form="{:g}"),
        Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:g}"),
        Column(key="stiffness_n_per_mm", heading="simulated (N/mm)", form="{:.2f}"),
        Column(key="chain_n_per_mm", heading="chain, small deflection (N/mm)", form="{:.2f}"),
        Column(key="closed_form_n_per_mm", heading="overhung beam, small deflection (N/mm)", form="{:.2f}")), caption=(
            "Stiffness above 200 N with the load elsewhere; all from the keel's posterior end. From the beam to the "
            "chain: the coarseness of the 16 pieces; from the chain to the simulation: large deflection."))


# What the bench chapter says in words: sentences made of the section's numbers, for the text and for the figures.


def source_text(table: Mapping[str, Any]) -> str:
    """What is compared with what."""
    text = (f"The foot is pressed at {table['speed_mm_per_min']:g} mm/min on the forefoot, at each position of the "
            "fulcrum, and on the heel, as in the paper's bench test (its Table 2 and Figure 4). ")
    if not table["measured"]:
        return text + ("No curve was given: the simulation stands beside the published end points (10 and 32 N/mm at "
                       "66 and 151 mm, heel 65 N/mm). Glanzer and Adamczyk 2018, PMC6289620; McGeehan 2021.")
    kind = "SYNTHETIC curves, of a virtual foot that is another model" if table["measured_synthetic"] else "curves"
    text += f"It is compared with {kind}: {table['measured_name']}."
    moved = table["touch_down_extrapolated"]
    return text + (f" {moved} passes begin under load; where they touched down is extrapolated." if moved else "")


def result_text(table: Mapping[str, Any]) -> str:
    """The figures of the study's model beside the paper's."""
    if not table["n"]:
        ends = _end_points(table["lines"][0])
        return f"Simulated less published: {ends}." if ends else ""
    found, asked, within = table["lines"][0]["statistics"], table["limits"], table["within_limits"]
    parts = []
    for key, name, unit in (("stiffness_r2", "R² of stiffness", ""), ("stiffness_rmse_n_per_mm", "RMSE", " N/mm"),
                            ("mid_range_rmse_mm", "RMSE of mid-range displacement", " mm")):
        if found[key] is not None:
            form = "{:.4f}" if key.endswith("r2") else "{:.2f}"
            parts.append(f"{name} {form.format(found[key])}{unit} (paper {asked[key]:g}: {_verdict(within[key])})")
    offsets = [(abs(offset), row) for row in forefoot(table)
               if (offset := value(row, "model", "mid_range_offset_mm")) is not None]
    worst = max(offsets, key=lambda pair: pair[0])[1]
    return (f"{_capital(table['lines'][0]['name'])}, {found['n']} settings of the forefoot: {', '.join(parts)}. The "
            f"largest offset Δ_D is {worst['model']['mid_range_offset_mm']:+.2f} mm of "
            f"{worst['measured']['mid_range_mm']:.1f} mm, at {position(worst['fulcrum_mm'])}.")


def fit_text(table: Mapping[str, Any]) -> str:
    """What of it was fitted, and what is prediction."""
    nominal = [line for line in table["lines"] if line["key"] == "nominal" or line["name"] == "nominal"]
    parts = []
    if table["contact_on_bench"] is not None:
        said = " ".join(table["contact_on_bench"])
        unseen = ("Stiffness and mid-range displacement are then fitted, not predicted; the course of the curves is "
                  "predicted." if "displacement" in said else "A fit to stiffness alone knows nothing of mid-range "
                  "displacement and of the course of the curves: these are predicted.")
        parts.append(f"Of the bench the contact file says: “{said}” {unseen}" if said else
                     "The contact file does not say that it was fitted to a bench.")
    if nominal:
        parts.append("The nominal model is calibrated to the published end points 10 and 32 N/mm and to the heel's 65 "
                     "N/mm and has seen no curve: its foam is linear, so its mid-range displacement carries no toe.")
        found = nominal[0].get("statistics")
        if found and nominal[0] is not table["lines"][0]:
            parts.append(f"Its RMSE: {found['stiffness_rmse_n_per_mm']:.2f} N/mm and "
                         f"{found['mid_range_rmse_mm']:.2f} mm.")
    return " ".join(parts)


def calibration_text(table: Mapping[str, Any]) -> str:
    """The line that was calibrated as the paper's model was."""
    lines = [line for line in table["lines"] if line["key"] == "calibrated"]
    if not lines or not lines[0]["statistics"]:
        return ""
    line, found, held = lines[0], lines[0]["statistics"], lines[0].get("held_out")
    text = ("The joints of the authors' public model are tuned on the bench, setting by setting. For the like, three "
            "numbers (stiffness of the fulcrum, stiffness and exponent of the foam) were calibrated here to the curves "
            f"at {line['fitted_mm'][0]:g} and "
            f"{line['fitted_mm'][1]:g} mm: over all settings RMSE {found['stiffness_rmse_n_per_mm']:.2f} N/mm and "
            f"{found['mid_range_rmse_mm']:.2f} mm")
    if held:
        text += (f", at the {held['n']} other{'s' * (held['n'] > 1)}, which it did not see, "
                 f"{held['stiffness_rmse_n_per_mm']:.2f} N/mm and "
                 f"{held['mid_range_rmse_mm']:.2f} mm")
    text += ". This foot is shown for the bench only; it walks nowhere in this report."
    if line["at_bound"]:
        text += f" At a bound of its search: {', '.join(line['at_bound'])}."
    return text


def coarseness_text(table: Mapping[str, Any]) -> str:
    """What the coarse keel does to the bench."""
    line = next((line for line in table["lines"] if line["key"] == "refined"), None)
    if line is None or not line["statistics"]:
        return ""
    found, own = line["statistics"], table["lines"][0]["statistics"]
    return (f"With its keel in {line['elements']} elements and nothing else changed, the same foot has RMSE "
            f"{found['stiffness_rmse_n_per_mm']:.2f} N/mm and {found['mid_range_rmse_mm']:.2f} mm (paper "
            f"{table['limits']['mid_range_rmse_mm']:g} mm: {_verdict(line['within_limits']['mid_range_rmse_mm'])}), "
            f"against {own['stiffness_rmse_n_per_mm']:.2f} N/mm and {own['mid_range_rmse_mm']:.2f} mm. They differ by "
            f"the coarseness of a keel of {line['coarse_elements']} elements, felt most where the fulcrum stands far "
            "back: in the paper's layout the posterior 66 mm are one element."
            + (" A fit of the coarse keel takes some of that up in its other numbers."
               if table["contact_on_bench"] else ""))


def heel_text(table: Mapping[str, Any]) -> str:
    """How the heel does."""
    rows = [row for row in table["settings"] if row["fulcrum_mm"] is None]
    k = value(rows[0], "model", "stiffness_n_per_mm") if rows else None
    if k is None:
        return ""
    text = f"Heel: {k:.1f} N/mm simulated, published 65 N/mm"
    offset, measured = value(rows[0], "model", "mid_range_offset_mm"), value(rows[0], "measured", "mid_range_mm")
    if offset is None or measured is None:
        return text + "."
    return text + (f", measured {rows[0]['measured']['stiffness_n_per_mm']:.1f} N/mm; its mid-range displacement is "
                   f"{offset:+.2f} mm off of {measured:.2f} mm. It is in none of the statistics over settings.")


def shape_text(table: Mapping[str, Any]) -> str:
    """Which curves are straight."""
    text = ("In the paper the curves of 66 and 87 mm were the most linear and those from 108 mm on curvilinear; its "
            "simulation was linear everywhere. ")
    for key, name in (("measured", "measured here"), ("model", f"simulated ({table['lines'][0]['name']})")):
        shares = [(position(row["fulcrum_mm"]), 100.0 * share) for row in forefoot(table)
                  if (share := value(row, key, "shape", "curvature_share")) is not None]
        if shares:
            text += (f"Largest distance from the chord, {name}: "
                     + ", ".join(f"{share:.1f} % at {where}" for where, share in shares) + ". ")
    return text + ("Two causes bend a curve the same way: the foam, whose part grows with the stiffness of the "
                   "setting, and the keel's large deflection, whose part falls with it.")


def energy_text(table: Mapping[str, Any]) -> str:
    """What is stored and returned."""
    low, high = min(table["rate_speeds_mm_per_min"]), max(table["rate_speeds_mm_per_min"])
    softest, stiffest = _ends(table["rates"])
    text = ""
    if softest and stiffest:
        at = {row["speed_mm_per_min"]: row for row in table["rates"] if row["fulcrum_mm"] == softest["fulcrum_mm"]}
        more = ", a softer setting more" if softest["stored_j"] > stiffest["stored_j"] else ""
        text = (f"At 600 N the foot stores {softest['stored_j']:.1f} J at {position(softest['fulcrum_mm'])} and "
                f"{stiffest['stored_j']:.1f} J at {position(stiffest['fulcrum_mm'])}{more}. At "
                f"{high:g} mm/min it returns {_ratio(table, softest, high)} and {_ratio(table, stiffest, high)} of it; "
                f"at {low:g} mm/min {_ratio(table, softest, low)} and {_ratio(table, stiffest, low)}. ")
        if low in at and high in at:
            change = at[high]["stiffness_n_per_mm"] - at[low]["stiffness_n_per_mm"]
            text += f"Stiffness at {position(softest['fulcrum_mm'])} changes by {change:+.2f} N/mm between the two. "
    return text + ("The model's losses are viscous: they grow in proportion to the speed and vanish in a slow test. "
                   "Foam and laminate of a real foot also lose energy at any speed; that part is not in this model, "
                   "and its size for this foot is not known here.")


def load_point_text(table: Mapping[str, Any]) -> str:
    """How much the load point matters."""
    points = table["load_points"]
    fulcrums = sorted({row["fulcrum_mm"] for row in points})
    parts = []
    for fulcrum in (fulcrums[0], fulcrums[-1]):
        rows = [row for row in points if row["fulcrum_mm"] == fulcrum]
        parts.append(f"from {rows[0]['stiffness_n_per_mm']:.1f} to {rows[-1]['stiffness_n_per_mm']:.1f} N/mm at "
                     f"{position(fulcrum)}")
    span = sorted({row["load_point_mm"] for row in points})
    return (f"With the load moved from {span[0]:g} to {span[-1]:g} mm from the keel's posterior end, stiffness goes "
            f"{' and '.join(parts)}: where a machine presses must be stated with a stiffness. The foam under the load "
            "is kept the same. Inclined loads are in the chapter on roll-over.")


def curves_alt(table: Mapping[str, Any]) -> str:
    """The figure of the curves in words."""
    rows = [row for row in forefoot(table) if value(row, "model", "max_displacement_mm") is not None]
    travel = ", ".join(_travel(row) for row in rows)
    return f"Load over displacement. At the largest load the forefoot has moved by {travel}."


def _travel(row: Mapping[str, Any]) -> str:
    text = f"{row['model']['max_displacement_mm']:.1f} mm simulated"
    if row["measured"]:
        text += f" and {row['measured']['max_displacement_mm']:.1f} mm measured"
    return f"{text} at {position(row['fulcrum_mm'])}"


def agreement_alt(table: Mapping[str, Any]) -> str:
    """The figure of the agreement in words."""
    rows = [row for row in forefoot(table) if value(row, "model", "stiffness_n_per_mm") is not None]
    text = "Stiffness by the fulcrum's position: " + ", ".join(
        f"{row['model']['stiffness_n_per_mm']:.1f} N/mm at {position(row['fulcrum_mm'])}" for row in rows) + "."
    return f"{text} {result_text(table)}" if table["n"] else text


def shape_alt(table: Mapping[str, Any]) -> str:
    """The figure of the shape in words."""
    return "Slope over load and distance from a straight line. " + shape_text(table)


def energy_alt(table: Mapping[str, Any]) -> str:
    """The figure of the energy in words."""
    return energy_text(table).split("The model's losses")[0].strip() + " Losses are proportional to the speed."


def load_point_alt(table: Mapping[str, Any]) -> str:
    """The figure of the load points in words."""
    apart = max(abs(row["closed_form_n_per_mm"] / row["stiffness_n_per_mm"] - 1.0) for row in table["load_points"])
    return (load_point_text(table).split(": where")[0]
            + f"; the overhung beam of small deflections is at most {100.0 * apart:.0f} % away.")


def _ends(rates: Sequence[Mapping[str, Any]]) -> tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]:
    """The slowest pass of the rearmost and of the foremost position."""
    rows = sorted((row for row in rates if row["fulcrum_mm"] is not None),
                  key=lambda row: (row["fulcrum_mm"], row["speed_mm_per_min"]))
    if not rows or rows[0]["fulcrum_mm"] == rows[-1]["fulcrum_mm"]:
        return None, None
    return rows[0], next(row for row in rows if row["fulcrum_mm"] == rows[-1]["fulcrum_mm"])


def _ratio(table: Mapping[str, Any], of: Mapping[str, Any], speed: float) -> str:
    rows = [row for row in table["rates"]
            if row["fulcrum_mm"] == of["fulcrum_mm"] and row["speed_mm_per_min"] == speed]
    return f"{100.0 * rows[0]['return_ratio']:.2f} %" if rows else "an unknown share"


def _end_points(line: Mapping[str, Any]) -> str:
    return ", ".join(f"{row['error_n_per_mm']:+.2f} N/mm of {row['published_n_per_mm']:g} at "
                     f"{'the heel' if row['fulcrum_mm'] is None else position(row['fulcrum_mm'])}"
                     for row in line["end_points"])


def _verdict(reached: bool) -> str:
    return "reached" if reached else "not reached"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
