"""The tables of the chapter "Can two settings be told apart?"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Column, Grid

DESIGNS = {"same_recording": "same recording", "same_session": "one session", "two_sessions": "two sessions"}


def outcome_grid(table: Mapping[str, Any]) -> Grid:
    """What is detectable, by outcome; where the model's error is unknown, by the noise alone."""
    columns = [Column(key="title", heading="outcome"), Column(key="unit", heading="unit"),
               Column(key="effect", heading="effect of 42 mm", form="{:+.3f}"),
               Column(key="model_error_sd", heading="model error, SD", form="{:.3f}"),
               Column(key="model_error_n", heading="walks", form="{:.0f}")]
    for design, title in DESIGNS.items():
        columns += [Column(key=f"noise_sdd_{design}", heading=f"{title}: noise alone", form="{:.3f}"),
                    Column(key=f"sdd_{design}", heading=f"{title}: with model error", form="{:.3f}"),
                    Column(key=f"noise_sdd_error_{design}", heading=f"{title}: MC error", form="{:.3f}")]
    return Grid(name="settings_outcomes", columns=columns, rows=table["outcomes"], caption=(
        "Smallest detectable difference (95 %, one walk at each position) for positions 42 mm apart around the middle: "
        "by the noise of kinematics alone, and with the model's error; MC error: Monte Carlo standard error of the "
        "former. Model error: over held-out walks."))


def travel_grid(table: Mapping[str, Any]) -> Grid:
    """The smallest detectable travel, in mm and in N/mm."""
    columns = [Column(key="title", heading="outcome")]
    for design, title in DESIGNS.items():
        columns += [Column(key=f"smallest_travel_mm_{design}", heading=f"{title} (mm)", form="{:.0f}"),
                    Column(key=f"smallest_change_n_per_mm_{design}", heading=f"{title} (N/mm)", form="{:.1f}")]
        if design != "same_recording":
            columns.append(Column(key=f"noise_travel_mm_{design}", heading=f"{title}, noise alone (mm)", form="{:.0f}"))
    return Grid(name="settings_travel", columns=columns, rows=table["outcomes"], caption=(
        "Smallest detectable travel of the fulcrum around the middle of its range, and what it changes the foot's "
        "stiffness by; with the model's error unless noise alone is said. An en dash: more than the range, or not "
        "known. By the noise alone the same recording has no smallest travel: effect and noise vanish together."))


def pair_grid(table: Mapping[str, Any]) -> Grid:
    """Whole curves: how far two positions are apart over the stance."""
    columns = [Column(key="from_mm", heading="from (mm)", form="{:g}"),
               Column(key="to_mm", heading="to (mm)", form="{:g}"),
               Column(key="curve", heading="curve"),
               Column(key="unit", heading="unit"),
               Column(key="rms_difference", heading="difference, RMS", form="{:.3f}")]
    for design, title in DESIGNS.items():
        columns += [Column(key=f"rms_noise_{design}", heading=f"{title}: noise", form="{:.3f}"),
                    Column(key=f"share_{design}", heading=f"{title}: stance (%)", form="{:.0f}", scale=100.0)]
    return Grid(name="settings_curves", columns=columns, rows=table["curves"], caption=(
        "Whole curves with the motion held: root mean square over stance of the mean difference between two positions, "
        "the noise of kinematics in it, and the share of stance in which the difference exceeds its 95 % limit (each "
        "percent of stance for itself, noise alone)."))


def walked_grid(table: Mapping[str, Any]) -> Grid:
    """Settings as they were walked, each with its own motion."""
    titles = {row["name"]: f"{row['title']} ({row['unit']})" for row in table["outcomes"]}
    said = {True: "yes", False: "no", None: None}
    rows = [row | {"title": titles[row["outcome"]], "told": said[row["told_apart"]],
                   "strides": said[row["beyond_strides"]]} for row in table["as_walked"]]
    return Grid(name="settings_as_walked", rows=rows, columns=[
        Column(key="title", heading="outcome"), Column(key="from_mm", heading="from (mm)", form="{:g}"),
        Column(key="to_mm", heading="to (mm)", form="{:g}"),
        Column(key="trials_from", heading="trials from", form="{:.0f}"),
        Column(key="trials_to", heading="trials to", form="{:.0f}"),
        Column(key="measured", heading="measured", form="{:+.3f}"),
        Column(key="simulated", heading="simulated", form="{:+.3f}"),
        Column(key="error", heading="error", form="{:+.3f}"),
        Column(key="error_half_width", heading="error, half width", form="{:.3f}"),
        Column(key="told", heading="told apart"),
        Column(key="stride_half_width", heading="strides, half width", form="{:.3f}"),
        Column(key="strides", heading="beyond strides")],
        caption="Difference of the settings' means over trials (to less from), on the plates and in the model, each "
                "setting with its own motion. Told apart: both exceed both half widths, of the model's error and of "
                "the strides, with the same sign; by chance at most one of twenty such comparisons would. Trials that "
                "the fit has seen are left out where there are others.")


def inverse_grid(table: Mapping[str, Any]) -> Grid:
    """Estimates of the fulcrum's position, trial by trial."""
    return Grid(name="settings_fulcrum", rows=table["inverse"]["rows"], columns=[
        Column(key="label", heading="trial"), Column(key="role", heading="role"),
        Column(key="fulcrum_mm", heading="true (mm)", form="{:g}"),
        Column(key="estimate_mm", heading="estimate (mm)", form="{:.1f}"),
        Column(key="mean_mm", heading="with noise: mean (mm)", form="{:.1f}"),
        Column(key="sd_mm", heading="SD, sessions (mm)", form="{:.1f}"),
        Column(key="sd_recording_mm", heading="SD, recordings (mm)", form="{:.1f}"),
        Column(key="edge_share", heading="at an end (%)", form="{:.0f}", scale=100.0),
        Column(key="model_sd_mm", heading="model's own walk: SD, sessions (mm)", form="{:.1f}"),
        Column(key="model_sd_recording_mm", heading="model's own walk: SD, recordings (mm)", form="{:.1f}")],
        caption="Position of the fulcrum with the least RMS error of the resultant against the measured plate, without "
                "and with noise of kinematics; and against the model's own walk at "
                f"{table['inverse']['middle_mm']:g} mm. At an end of the range an estimate can err to one side only.")
