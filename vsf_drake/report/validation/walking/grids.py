"""Tables of the walking chapter: Table 3 with the paper's numbers, every walk, every rotation, regions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vsf_drake.report.pieces import Column, Grid
from vsf_drake.report.validation.walking.ensemble_figure import NAMES, heading

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
