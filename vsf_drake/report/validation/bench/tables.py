"""The tables of the bench chapter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Column, Grid
from vsf_drake.report.validation.bench.words import position, value

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
