"""The report's chapter on rolling over: walking, the ISO 22675 profile, and inclined loading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter, Column, Grid, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.style import (
    HEEL_COLOUR,
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    condition_label,
    label,
    new_figure,
    style,
)


def roll_over_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """The chapter of a saved section (`analysis.validation.roll_over_section`)."""
    return Chapter(name="roll-over", title="Roll-over and inclined loading", pieces=(
        *_walking(table, arrays), *_iso(table["iso"], arrays), *_inclined(table["inclined"], arrays)))


def _walking(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> list[Piece]:
    pieces: list[Piece] = [Heading("Roll-over shape in walking"), Text(
        "The roll-over shape is the centre of pressure seen from the shank, from heel strike to opposite heel strike; "
        "where the other foot's force is not recorded it ends at toe-off. A prosthesis has no ankle: the origin is the "
        "pylon's lower end, where the foot is mounted, and up is along the pylon to the knee. Plate and model are seen "
        "from the same frame, the recorded residual shank's, so that the socket's give is part of both shapes; "
        "\"foot alone\" is the model seen from the pylon. The radius is that of the circle nearest to the shape. "
        "Effective foot length is from the heel, the rear end of the sole "
        f"{1e3 * table['heel_behind_pylon_m']:.0f} mm behind the pylon's axis before any fitted offset, to the front "
        f"end of the shape, and its ratio is to the {1e3 * table['foot_length_m']:.0f} mm from there to the toe. The "
        "mean moment arm is the impulse of the ground force's moment about the origin, toe up positive, over the "
        "impulse of the vertical force, in the whole of stance; the dynamic mean ankle moment arm of Adamczyk 2020 is, "
        "by its abstract, the ratio of these impulses, and we take the vertical force. The definitions of arc and "
        "effective foot length were not read at their source.")]
    if not table["walks"]:
        return [*pieces, Missing("No footfall is recorded and simulated as a whole: there is no roll-over shape.")]
    finding = _walking_finding(table["conditions"])
    pieces += [
        Text(finding + " Able-bodied walking is quoted, second-hand, with a radius of about 0.30 leg lengths (Hansen, "
             "Childress & Knox 2004); the leg length here is the prosthetic leg's, hip centre to sole."),
        Picture(name="roll_over_shapes", figure=roll_over_shape_figure(table, arrays), alt=finding,
                caption="Plate solid, model dashed; below, every footfall (plate filled, model open)."
                + (" Walking data are synthetic." if table["synthetic"] else "")),
        conditions_grid(table), walks_grid(table)]
    return pieces


def _walking_finding(conditions: Sequence[Mapping[str, Any]]) -> str:
    parts = []
    for row in conditions:
        sides = []
        for side, words in (("measured", "plate"), ("model", "model")):
            radius, ratio, arm = (row[side][name]["mean"] for name in (
                "radius_m", "effective_foot_length_ratio", "mean_moment_arm_m"))
            if ratio is None:
                sides.append(f"{words} not known")
                continue
            shown = "no radius" if radius is None else f"radius {1e3 * radius:.0f} mm"
            arm_shown = "" if arm is None else f", mean moment arm {1e3 * arm:.0f} mm"
            sides.append(f"{words} {shown}, effective foot length ratio {ratio:.2f}{arm_shown}")
        parts.append(f"fulcrum {row['fulcrum_mm']:g} mm: {'; '.join(sides)}")
    return "Roll-over in walking. " + ". ".join(part[0].upper() + part[1:] for part in parts) + "."


def _iso(iso: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> list[Piece]:
    level = {
        "given": f"The first peak of the force is {iso['force_n']:.0f} N, as given.",
        "weight": f"The first peak of the force is {iso['force_n']:.0f} N, the subject's weight. That is no load level "
                  "of the standard: give the level's force to have its numbers.",
    }[iso["force_from"]]
    pieces: list[Piece] = [Heading("ISO 22675 loading profile"), Text(
        "Force and tilt follow the standard's profile over 600 ms, by polynomials that came to us second-hand and were "
        f"checked against the profile's peaks and valley only. {level} The pylon stays on a fixed line and the "
        "platform turns; here, which is the same seen from the platform, the foot's mount turns over level ground, "
        "toes up by minus the tilt. The force is the ground's component along the fixed line, and the mount's height "
        "is found so that it follows the profile. Idealised: the platform has no friction, so that the line's guide "
        "bears what is sideways and the place of the tilt axis has no part in the forces; the pylon cannot turn about "
        "a joint at its top; inertia in the turning frame is left out. The shape ends at the second force peak, "
        "447.5 ms; later the load only leaves the toe (dotted). Energy taken in and given back is that of keel, "
        "fulcrum and foam together: what the heel returns while the forefoot takes it up cancels. The mean moment arm "
        "is here over the impulse of the force along the line.")]
    rows = iso["positions"]
    if not rows:
        return [*pieces, Missing("The profile could be followed at no fulcrum position.")]
    soft, hard = rows[0], rows[-1]
    finding = (
        f"The force follows the profile within {max(row['residual_n'] for row in rows):.1f} N. " if iso["follows"] else
        "THE FORCE DOES NOT FOLLOW THE PROFILE at every position. ") + ". ".join(
        f"At {row['fulcrum_mm']:g} mm the forefoot deflects by {row['deflection_forefoot_mm']:.0f} mm, stores up to "
        f"{row['stored_forefoot_j']:.1f} J and gives back {100 * row['return_ratio']:.0f} % of what it takes in"
        for row in ((soft, hard) if len(rows) > 1 else (soft,))) + "."
    return [*pieces, Text(finding), Picture(
        name="iso_22675_profile", figure=iso_profile_figure(iso, arrays), alt=f"ISO 22675 profile. {finding}",
        caption="Solid grey: the profile. Dashed: simulated, by fulcrum position."), iso_grid(iso), *_friction(iso)]


def _friction(iso: Mapping[str, Any]) -> list[Piece]:
    """What the frictionless platform hides."""
    pairs = [(row, other) for row in iso["positions"] for other in iso["with_friction"]
             if row["fulcrum_mm"] == other["fulcrum_mm"]]
    if not pairs:
        return []

    def change(name: str) -> str:
        shares = [100.0 * (other[name] / row[name] - 1.0) for row, other in pairs
                  if row[name] is not None and other[name] is not None]
        return f"{min(shares):+.0f} to {max(shares):+.0f} %" if shares else "not known"

    sliding = [other["lost_by_sliding_j"] for _, other in pairs]
    return [Text(
        "How much hangs on that: with the foot's own friction, and the tilt axis in the platform's surface under the "
        "pylon (a choice), the foot is dragged over the platform by a line that cannot give way. The forefoot's "
        f"deflection then changes by {change('deflection_forefoot_mm')}, the radius by {change('radius_m')}, the "
        f"largest moment toe up by {change('dorsiflexing_moment_nm')}, and sliding costs {min(sliding):.1f} to "
        f"{max(sliding):.1f} J. Where these changes are small, the numbers above hold for a platform with friction "
        "too; the others hold for the frictionless one only."), friction_grid(iso)]


def _inclined(rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray]) -> list[Piece]:
    pieces: list[Piece] = [Heading("Inclined loading"), Text(
        "The foot is pressed at -15° (heel) and +20° (forefoot), the angles of the profile's force peaks, to 600 N and "
        "back at 50 mm/min. The platen is level and frictionless, the foot pitched; load and displacement are along "
        "the platen's normal. A test that moves the pylon along its own axis has the same energy; its displacement is "
        "this divided by the angle's cosine, its force this times the cosine. Stiffness is the mean slope above 200 N. "
        "The model loses energy by viscous damping only, which at this speed is next to nothing: the return ratio "
        "here says nothing about a real foot's hysteresis. The platen is an infinite plane, so that a soft forefoot is "
        "pressed flat until the midfoot bears too.")]
    if not rows:
        return [*pieces, Missing("The foot could be pressed at no angle.")]
    parts = []
    for angle, words in ((-15.0, "heel"), (20.0, "forefoot")):
        own = [row for row in rows if row["angle_deg"] == angle]
        if own:
            low, high = own[0], own[-1]
            parts.append(f"{words} at {angle:+g}°: {low['stiffness_n_per_mm']:.1f} N/mm and "
                         f"{low['energy_stored_j']:.1f} J stored with the fulcrum at {low['fulcrum_mm']:g} mm, "
                         f"{high['stiffness_n_per_mm']:.1f} N/mm and {high['energy_stored_j']:.1f} J at "
                         f"{high['fulcrum_mm']:g} mm")
    finding = "Inclined loading to 600 N, " + "; ".join(parts) + "."
    return [*pieces, Text(finding), Picture(
        name="inclined_loading", figure=inclined_loading_figure(rows, arrays), alt=finding,
        caption="All simulated. At the heel the curves lie on each other: its spheres sit on the rigid frame, and the "
        "fulcrum has no part."), inclined_grid(rows)]


# Load and displacement of the foot pressed at an angle, and stiffness and energy by fulcrum position.


def inclined_loading_figure(rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's rows `inclined` (`analysis.validation.roll_over_section`)."""
    with style():
        figure = new_figure(10.5, 3.9)
        panels = figure.subplots(1, 3, width_ratios=(1.0, 1.3, 1.0))
        for axes, sign, title in ((panels[0], -1.0, "Heel, -15°"), (panels[1], 1.0, "Forefoot, +20°")):
            _curves(axes, [row for row in rows if sign * row["angle_deg"] > 0.0], arrays)
            label(axes, x="displacement (mm)", y="load (N)", title=title)
        _energy(panels[2], rows)
        figure.draw_without_rendering()
    return figure


def curve_name(row: Mapping[str, Any]) -> str:
    """Start of the names of the arrays that hold a row's curves."""
    angle = row["angle_deg"]
    return f"inclined_{'minus' if angle < 0 else 'plus'}{abs(angle):.0f}_{row['fulcrum_mm']:.0f}"


def _curves(axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray]) -> None:
    for i, row in enumerate(rows):
        name, fulcrum = curve_name(row), 1e-3 * row["fulcrum_mm"]
        load = np.asarray(arrays[f"{name}_load_n"])
        loading = slice(0, int(np.argmax(load)) + 1)
        axes.plot(1e3 * np.asarray(arrays[f"{name}_displacement_m"])[loading], load[loading],
                  color=condition_colour(fulcrum), label=condition_label(fulcrum), marker=MARKERS[i % len(MARKERS)],
                  markersize=4, markevery=(8 + 4 * i, 22), **SIMULATED)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    if rows:
        axes.legend(loc="lower right" if rows[0]["angle_deg"] > 0.0 else "upper left")


def _energy(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    for sign, marker, words in ((-1.0, "s", "heel, -15°"), (1.0, "o", "forefoot, +20°")):
        own = [row for row in rows if sign * row["angle_deg"] > 0.0]
        if not own:
            continue
        axes.plot([row["fulcrum_mm"] for row in own], [row["energy_stored_j"] for row in own], color=HEEL_COLOUR,
                  linewidth=0.8, linestyle=":")
        for row in own:
            axes.plot(row["fulcrum_mm"], row["energy_stored_j"], marker, markersize=6,
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
        axes.plot([], [], marker, color=HEEL_COLOUR, label=words)
    if rows:
        axes.legend(loc="best")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.12)
    label(axes, x="fulcrum position (mm)", y="energy stored at 600 N (J)", title="Energy stored")


# The foot under the ISO 22675 loading profile: what is prescribed, and how the foot answers at each position.


def iso_profile_figure(iso: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's table `iso` (`analysis.validation.roll_over_section`)."""
    with style():
        figure = new_figure(10.5, 6.4)
        panels = figure.subplots(2, 3)
        time = 1e3 * np.asarray(arrays["iso_time_s"])
        _force(panels[0, 0], iso["positions"], arrays, time)
        tilt = panels[0, 1]
        tilt.plot(time, arrays["iso_tilt_deg"], color=NEUTRAL, linewidth=1.8)
        tilt.axhline(0.0, color=NEUTRAL, linewidth=0.6)
        label(tilt, x="time (ms)", y="tilt of the platform (deg)", title="Tilt (below zero: heel)")
        for axes, name, words, title in (
                (panels[0, 2], "deflection_mm", "deflection (mm)", "Deflection along the line of force"),
                (panels[1, 1], "moment_nm", "moment at the pylon's end (N m)", "Moment (positive: toe up)"),
                (panels[1, 2], "strain_j", "stored energy (J)", "Energy stored in keel and foam")):
            for x, y, look in _iso_curves(iso["positions"], arrays, name):
                axes.plot(time if x is None else x, y, **look)
            label(axes, x="time (ms)", y=words, title=title)
        _shape(panels[1, 0], iso["positions"], arrays, time)
        handles, names = panels[0, 2].get_legend_handles_labels()
        panels[0, 2].legend(handles, names, loc="upper left")
        figure.draw_without_rendering()
    return figure


def _iso_curves(
    rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], name: str
) -> list[tuple[None, np.ndarray, dict[str, Any]]]:
    found = []
    for i, row in enumerate(rows):
        fulcrum = row["fulcrum_mm"]
        look = {**SIMULATED, "color": condition_colour(1e-3 * fulcrum), "label": condition_label(1e-3 * fulcrum),
                "marker": MARKERS[i % len(MARKERS)], "markersize": 4, "markevery": (12 * (i + 1), 60)}
        found.append((None, np.asarray(arrays[f"iso_{fulcrum:.0f}_{name}"]), look))
    return found


def _force(
    axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], time: np.ndarray
) -> None:
    axes.plot(time, arrays["iso_wanted_n"], color=NEUTRAL, label="profile", **MEASURED)
    for i, (_, force, look) in enumerate(_iso_curves(rows, arrays, "force_n")):
        axes.plot(time, force, **(look | {"label": "foot" if i == 0 else None}))
    axes.legend(loc="lower center")
    label(axes, x="time (ms)", y="force along the fixed line (N)", title="Force: profile, and what the foot bears")


def _shape(
    axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], time: np.ndarray
) -> None:
    for (_, forward, look), (_, up, _) in zip(
            _iso_curves(rows, arrays, "cop_forward_m"), _iso_curves(rows, arrays, "cop_up_m"), strict=True):
        rolled = time <= 447.5
        axes.plot(1e3 * forward[rolled], 1e3 * up[rolled], **look)
        axes.plot(1e3 * forward[~rolled], 1e3 * up[~rolled], color=look["color"], linewidth=0.7, linestyle=":")
    axes.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=9)
    axes.set_aspect("equal", adjustable="datalim")
    label(axes, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
          title="Centre of pressure seen from the pylon")


# Roll-over shapes in walking, plate beside model, and what describes them by fulcrum position.


PANELS = (("radius_m", 1e3, "arc radius (mm)"), ("effective_foot_length_ratio", 1.0, "effective / foot length (1)"),
          ("mean_moment_arm_m", 1e3, "mean moment arm (mm)"))


def roll_over_shape_figure(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's walks (`analysis.validation.roll_over_section`)."""
    with style():
        figure = new_figure(10.5, 6.6)
        grid = figure.add_gridspec(2, 3, height_ratios=(1.25, 1.0))
        _shapes(figure.add_subplot(grid[0, :]), table, arrays)
        for i, (name, scale, words) in enumerate(PANELS):
            _numbers(figure.add_subplot(grid[1, i]), table, name, scale, words, legend=i == 0)
        figure.draw_without_rendering()
    return figure


def mean_curve(curves: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) mean of the curves (n,) where all are known, else NaN."""
    return np.asarray(np.mean(np.array(curves, dtype=float), axis=0))


def _shapes(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    for i, condition in enumerate(table["conditions"]):
        fulcrum = condition["fulcrum_mm"]
        own = [row["curves"] for row in table["walks"] if row["fulcrum_mm"] == fulcrum]
        for side, look in (("measured", MEASURED), ("model", SIMULATED)):
            forward, up = (1e3 * mean_curve([arrays[f"{name}_{side}_{axis}_m"] for name in own])
                           for axis in ("forward", "up"))
            if np.isfinite(forward).any():
                axes.plot(forward, up, color=condition_colour(1e-3 * fulcrum), marker=MARKERS[i % len(MARKERS)],
                          markersize=4.5, markevery=(3 + 2 * i, 9), **look,
                          label=f"{condition_label(1e-3 * fulcrum)}, {'plate' if side == 'measured' else 'model'}")
    axes.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=10, label="end of the pylon")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="upper right", ncols=2)
    label(axes, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
          title="Centre of pressure seen from the shank, mean of the footfalls, heel strike to the end of the shape")


def _numbers(axes: Axes, table: Mapping[str, Any], name: str, scale: float, words: str, *, legend: bool) -> None:
    looks = {"measured": ("o", True, "plate"), "model": ("D", False, "model")}
    for side, (marker, filled, said) in looks.items():
        shift = 2.0 if filled else -2.0
        known = [(row["fulcrum_mm"], scale * row[side][name]) for row in table["walks"] if row[side][name] is not None]
        for fulcrum, value in known:
            colour = condition_colour(1e-3 * fulcrum)
            axes.plot(fulcrum + shift, value, marker, markersize=6, color=colour,
                      markerfacecolor=colour if filled else "white")
        axes.plot([], [], marker, color=NEUTRAL, markerfacecolor=NEUTRAL if filled else "white", label=said)
    axes.margins(x=0.12, y=0.15)
    if legend:
        axes.legend(loc="best")
    label(axes, x="fulcrum position (mm)", y=words)


# The tables of the chapter on rolling over.


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
