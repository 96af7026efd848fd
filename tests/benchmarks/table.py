"""One row a measurement, and the table that is printed of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

YARDSTICK = "person, stepper at 1 ms"
"""The row whose speed the others are compared with."""


class Row(NamedTuple):
    """One measurement.

    Attributes:
        name: what was run.
        simulated_s, wall_s: seconds; None where there are none, or where it did not run.
        accuracy: how right it was and against what, or why it did not run.
    """

    name: str
    simulated_s: float | None
    wall_s: float | None
    accuracy: str

    @property
    def faster(self) -> float | None:
        """How many times faster than real time."""
        return (
            None
            if self.simulated_s is None or self.wall_s is None
            else self.simulated_s / self.wall_s
        )


def format_table(rows: Sequence[Row]) -> str:
    """The rows under a heading; the last ratio is the row's speed over that of YARDSTICK, where
    that is among them."""
    width = max((len(row.name) for row in rows), default=0)
    yardstick = next((row.faster for row in rows if row.name == YARDSTICK), None)
    lines = [
        (
            f"{'':{width}} {'simulated':>11} {'wall':>11} {'faster than':>11} {'stepper':>9}   "
            "accuracy"
        ),
        f"{'':{width}} {'s':>11} {'s':>11} {'real time':>11} {'1 ms = 1':>9}",
    ]
    for row in rows:
        relative = row.faster / yardstick if row.faster is not None and yardstick else None
        lines.append(
            f"{row.name:{width}} {_number(row.simulated_s):>11} {_number(row.wall_s):>11} "
            f"{_number(row.faster):>11} {_number(relative):>9}   {row.accuracy}"
        )
    return "\n".join(lines)


def _number(value: float | None) -> str:
    """Three significant digits, without exponent, or nothing."""
    if value is None:
        return ""
    return (
        f"{value:.0f}"
        if abs(value) >= 99.95
        else f"{value:#.3g}"
        if abs(value) >= 1e-3
        else f"{value:.1g}"
    )
