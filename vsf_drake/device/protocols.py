"""The clauses of published tests of feet, as far as they can be read in public (protocols.csv, with
protocol_quantities.csv and protocol_notes.csv): what is asked, how it is answered here, and why not
where it is not.

The tests' own texts are sold or unpublished, and were not read. No Drake, so that a command has the
names before it loads.
"""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.base.errors import require
from vsf_drake.base.files import table_of

PROTOCOLS = {
    "iso16955": "ISO/TS 16955:2016, physical parameters of ankle-foot devices",
    "iso22675": "ISO 22675:2016, testing of ankle-foot devices",
    "aopa": "AOPA Prosthetic Foot Project, 2010",
}
"""Titles by the names that commands have."""
PRESS = "press"
ROLL = "roll"


@dataclass(frozen=True, kw_only=True)
class Clause:
    """What one clause asks of a foot."""

    clause: str  # number or name
    test: str
    part: str  # heel, mid-foot or toe that is pressed; "stance" of a roll-over
    quantity: str  # "" where nothing is computed, and then all up to `method`
    label: str
    unit: str  # "1" for none
    form: str  # of the number in that unit
    method: str  # PRESS or ROLL
    angle_deg: float | None
    """of the platen against the plane across the pylon, its front turned up positive; None of what
    is not pressed"""
    axis: str  # its name in the radar picture, "" where it is not in it
    axis_end: float | None  # value at the picture's rim, doubled until all values fit (a choice)
    conditions: str  # where angle, load and motion come from
    source: str  # of the clause
    follows: str  # limit or code, where it is public
    why_not: str  # why nothing is computed, "" where it is


def clauses_of(protocol: str) -> tuple[Clause, ...]:
    """All clauses of a protocol in its order; InputError for an unknown name."""
    require(
        protocol in PROTOCOLS,
        f"there is no protocol {protocol!r}",
        "protocol",
        f"Choose one of {', '.join(PROTOCOLS)}",
    )
    quantities = {row["name"]: row for row in table_of("device/protocol_quantities.csv")}
    notes = {row["name"]: row["text"] for row in table_of("device/protocol_notes.csv")}
    quantities[""] = dict.fromkeys(("label", "unit", "form", "method"), "")
    notes[""] = ""
    clauses = []
    for row in table_of("device/protocols.csv"):
        if row["protocol"] != protocol:
            continue
        told = quantities[row["quantity"]]
        clauses.append(
            Clause(
                **{name: row[name] for name in _AS_THEY_ARE},
                **{name: told[name] for name in ("label", "unit", "form", "method")},
                angle_deg=_number(row["angle_deg"]),
                axis_end=_number(row["axis_end"]),
                conditions=notes[row["conditions"]],
                source=notes[row["source"]],
            )
        )
    return tuple(clauses)


_AS_THEY_ARE = ("clause", "test", "part", "quantity", "axis", "follows", "why_not")


def _number(cell: str) -> float | None:
    return float(cell) if cell else None
