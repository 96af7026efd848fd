"""The report's chapter on rolling over: walking, the ISO 22675 profile, and inclined loading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Chapter, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.roll_over.grids import (
    conditions_grid,
    friction_grid,
    inclined_grid,
    iso_grid,
    walks_grid,
)
from vsf_drake.report.validation.roll_over.inclined_loading_figure import inclined_loading_figure
from vsf_drake.report.validation.roll_over.iso_profile_figure import iso_profile_figure
from vsf_drake.report.validation.roll_over.shape_figure import roll_over_shape_figure


def roll_over_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """The chapter of a saved section (`analysis.validation.roll_over.section`)."""
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
