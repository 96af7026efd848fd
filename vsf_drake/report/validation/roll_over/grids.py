"""The tables of the chapter on rolling over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vsf_drake.report.pieces import Column, Grid

_SIDES = (("measured", "plate"), ("model", "model"), ("foot_alone", "model, foot alone"))
_FULCRUM = Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:.0f}")


def conditions_grid(table: Mapping[str, Any]) -> Grid:
    """Mean and SD by fulcrum position and source."""
    names = ("radius_m", "radius_leg_lengths", "effective_foot_length_ratio", "mean_moment_arm_m", "arc_rms_m")
    none = {"mean": None, "sd": None, "count": 0}
    rows = []
    for condition in table["conditions"]:
        for side, words in _SIDES:
            numbers = {name: condition[side].get(name, none) for name in names}
            rows.append({"fulcrum_mm": condition["fulcrum_mm"], "source": words,
                         "footfalls": numbers["radius_m"]["count"],
                         **{f"{name}_{what}": numbers[name][what] for name in names for what in ("mean", "sd")}})
    return Grid(
        name="roll_over_conditions", rows=rows,
        caption="Roll-over in walking, mean and SD over the footfalls of a condition (no SD of a single one).",
        columns=(
            _FULCRUM, Column(key="source", heading="source"),
            Column(key="footfalls", heading="footfalls with a radius", form="{:.0f}"),
            Column(key="radius_m_mean", heading="radius (mm)", form="{:.0f}", scale=1e3),
            Column(key="radius_m_sd", heading="SD (mm)", form="{:.0f}", scale=1e3),
            Column(key="radius_leg_lengths_mean", heading="radius (leg lengths)", form="{:.2f}"),
            Column(key="effective_foot_length_ratio_mean", heading="effective / foot length", form="{:.3f}"),
            Column(key="effective_foot_length_ratio_sd", heading="SD", form="{:.3f}"),
            Column(key="mean_moment_arm_m_mean", heading="mean moment arm (mm)", form="{:.1f}", scale=1e3),
            Column(key="mean_moment_arm_m_sd", heading="SD (mm)", form="{:.1f}", scale=1e3),
            Column(key="arc_rms_m_mean", heading="distance from the arc, RMS (mm)", form="{:.1f}", scale=1e3)))


def walks_grid(table: Mapping[str, Any]) -> Grid:
    """Every footfall."""
    rows = [{"label": row["label"], "fulcrum_mm": row["fulcrum_mm"], "ends_at": row["ends_at"],
             "end_percent": row["end_percent"],
             **{f"{side}_{name}": row[side][name] for side in ("measured", "model")
                for name in ("radius_m", "effective_foot_length_ratio", "mean_moment_arm_m")}}
            for row in table["walks"]]
    columns = [Column(key="label", heading="trial"), _FULCRUM, Column(key="ends_at", heading="shape ends at"),
               Column(key="end_percent", heading="which is (% of stance)", form="{:.0f}")]
    for name, words, form, scale in (("radius_m", "radius (mm)", "{:.0f}", 1e3),
                                     ("effective_foot_length_ratio", "effective / foot length", "{:.3f}", 1.0),
                                     ("mean_moment_arm_m", "mean moment arm (mm)", "{:.1f}", 1e3)):
        columns += [Column(key=f"{side}_{name}", heading=f"{said}: {words}", form=form, scale=scale)
                    for side, said in (("measured", "plate"), ("model", "model"))]
    return Grid(name="roll_over_walks", rows=rows, columns=columns, caption="Roll-over in walking, every footfall.")


def iso_grid(iso: Mapping[str, Any]) -> Grid:
    """The answer to the ISO 22675 profile by fulcrum position."""
    rows = [{**row, "follows": "yes" if row["follows"] else "NO"} for row in iso["positions"]]
    return Grid(
        name="iso_22675_profile", rows=rows,
        caption=f"ISO 22675 loading profile, first peak {iso['force_n']:.0f} N: radius and effective length up to the "
        "second force peak, energies over the whole of it. All simulated.",
        columns=(
            _FULCRUM, Column(key="follows", heading="follows within 1 %"),
            Column(key="residual_n", heading="force off by up to (N)", form="{:.1f}"),
            Column(key="deflection_heel_mm", heading="heel deflection (mm)", form="{:.1f}"),
            Column(key="deflection_forefoot_mm", heading="forefoot deflection (mm)", form="{:.1f}"),
            Column(key="plantarflexing_moment_nm", heading="largest moment toe down (N m)", form="{:.1f}"),
            Column(key="dorsiflexing_moment_nm", heading="toe up (N m)", form="{:.1f}"),
            Column(key="radius_m", heading="radius (mm)", form="{:.0f}", scale=1e3),
            Column(key="effective_foot_length_ratio", heading="effective / foot length", form="{:.3f}"),
            Column(key="mean_moment_arm_m", heading="mean moment arm (mm)", form="{:.1f}", scale=1e3),
            Column(key="stored_heel_j", heading="stored, heel (J)", form="{:.2f}"),
            Column(key="stored_forefoot_j", heading="stored, forefoot (J)", form="{:.2f}"),
            Column(key="energy_in_j", heading="taken in (J)", form="{:.2f}"),
            Column(key="energy_out_j", heading="given back (J)", form="{:.2f}"),
            Column(key="return_ratio", heading="given back (%)", form="{:.1f}", scale=100.0)))


def friction_grid(iso: Mapping[str, Any]) -> Grid:
    """The same with the foot's own friction, for comparison."""
    rows = [{**row, "follows": "yes" if row["follows"] else "NO"} for row in iso["with_friction"]]
    return Grid(
        name="iso_22675_with_friction", rows=rows,
        caption="The same profile with friction, for comparison: where it is not followed within 1 % the numbers are "
        "near those of the profile only.",
        columns=(
            _FULCRUM, Column(key="follows", heading="follows within 1 %"),
            Column(key="residual_n", heading="force off by up to (N)", form="{:.1f}"),
            Column(key="deflection_forefoot_mm", heading="forefoot deflection (mm)", form="{:.1f}"),
            Column(key="dorsiflexing_moment_nm", heading="largest moment toe up (N m)", form="{:.1f}"),
            Column(key="radius_m", heading="radius (mm)", form="{:.0f}", scale=1e3),
            Column(key="effective_foot_length_ratio", heading="effective / foot length", form="{:.3f}"),
            Column(key="stored_forefoot_j", heading="stored, forefoot (J)", form="{:.2f}"),
            Column(key="lost_by_sliding_j", heading="lost by sliding (J)", form="{:.2f}"),
            Column(key="return_ratio", heading="given back (%)", form="{:.1f}", scale=100.0)))


def inclined_grid(rows: Sequence[Mapping[str, Any]]) -> Grid:
    """The foot pressed at an angle."""
    shown = [{**row, "zones": ", ".join(row["zones_loaded"]).replace("_", " ")} for row in rows]
    return Grid(
        name="inclined_loading", rows=shown,
        caption="The foot pressed at an angle to 600 N and back. Centre of pressure ahead of the pylon's axis, and the "
        "contact zones that bear, at the largest load. All simulated.",
        columns=(
            Column(key="angle_deg", heading="angle (deg)", form="{:+.0f}"), _FULCRUM,
            Column(key="displacement_mm", heading="displacement at 600 N (mm)", form="{:.1f}"),
            Column(key="stiffness_n_per_mm", heading="stiffness above 200 N (N/mm)", form="{:.1f}"),
            Column(key="energy_stored_j", heading="stored (J)", form="{:.2f}"),
            Column(key="energy_returned_j", heading="returned (J)", form="{:.2f}"),
            Column(key="cop_forward_mm", heading="centre of pressure (mm)", form="{:.0f}"),
            Column(key="zones", heading="zones that bear")))
