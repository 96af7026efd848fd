"""The report's chapter on standing: a function of the saved section."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Bullets, Chapter, Column, Grid, Picture, Piece, Text
from vsf_drake.report.validation.standing_figure import standing_mass_figure

_COLUMNS = (
    Column(key="fulcrum_mm", heading="fulcrum, mm", form="{:g}"),
    Column(key="mass_known_kg", heading="mass known, kg", form="{:.2f}"),
    Column(key="mass_predicted_kg", heading="mass predicted, kg", form="{:.2f}"),
    Column(key="mass_error", heading="error, %", form="{:+.3f}", scale=100.0),
    Column(key="paper_mass_error", heading="paper, %", form="{:+.1f}", scale=100.0),
    Column(key="prosthetic_share", heading="on the prosthetic foot, %", form="{:.0f}", scale=100.0),
    Column(key="drift_mm", heading="pelvis moves, mm", form="{:.2f}"),
    Column(key="turn_deg", heading="and turns, °", form="{:.3f}"),
    Column(key="held", heading="held by"),
    Column(key="stands", heading="stands still"))

LEAST_TOLD = 1e-4
"""Share of the mass below which an error has no number in a sentence."""


def standing_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Mass predicted against mass known, per fulcrum position."""
    rows = [{**row, "paper_mass_error": table["paper_mass_error"], "held": _held(row)} for row in table["rows"]]
    pieces: list[Piece] = [
        Text(_finding(table)),
        Text(f"The person stands on both feet for {table['duration_s']:g} s, joints at their anatomical zero, and is "
             "let go a little off rest. Predicted is the mean vertical force of the ground over 9.81 m/s². Who stands "
             "still must be carried with the whole weight: this shows that no mass is lost and that the feet carry the "
             "person without creeping, not that the contact is right. How the two feet share the weight does depend on "
             "the contact, and nobody measured it here."),
        Grid(name="standing", caption="Standing, by fulcrum position. The paper gives one number for its static trial. "
             "Held by: what it took to hold the attitude of the pelvis that the feet alone do not keep.",
             columns=_COLUMNS, rows=rows)]
    stood = [row for row in rows if row["failure"] is None]
    if stood:
        pieces.append(Picture(
            name="standing", figure=standing_mass_figure(table, arrays), alt=_alt(stood),
            caption="Left: force of the ground on both feet (broken lines, one a fulcrum position) and the weight "
            "(grey). Right: mean force on the prosthetic (dark) and the intact foot (hatched)."))
    notes = [f"Fulcrum at {row['fulcrum_mm']:g} mm: {note}" for row in stood for note in row["notes"]]
    if notes:
        pieces.append(Bullets(notes))
    return Chapter(name="standing", title="Standing", pieces=tuple(pieces))


def _finding(table: Mapping[str, Any]) -> str:
    worst = table["worst_mass_error"]
    if worst is None:
        return "No standing could be simulated."
    ends = "" if table["all_stand"] else " Not everybody stands still: see the last column."
    count = sum(row["failure"] is None for row in table["rows"])
    size = f"at most {abs(100.0 * worst):.2f} %" if abs(worst) >= LEAST_TOLD else f"less than {100.0 * LEAST_TOLD:g} %"
    return (f"The mass predicted from standing differs from the known one by {size} ({count} fulcrum "
            f"position{'s' * (count != 1)}); the paper reports {100.0 * table['paper_mass_error']:.1f} %.{ends}")


def _held(row: Mapping[str, Any]) -> str | None:
    if row["held_nm"] is None:
        return None
    return ", ".join(f"{name.removeprefix('pelvis_')} {value:+.1f} N m"
                     for name, value in row["held_nm"].items()) or "nothing"


def _alt(rows: list[dict[str, Any]]) -> str:
    parts = [f"fulcrum {row['fulcrum_mm']:g} mm: {row['mean_vertical_n']:.1f} N carried, of which "
             f"{row['prosthetic_share']:.0%} by the prosthetic foot" for row in rows]
    return f"Standing force against the weight of {rows[0]['weight_n']:.1f} N; " + "; ".join(parts) + "."
