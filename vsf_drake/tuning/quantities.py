"""What tunings of both levels count, compare and check: label and unit of each, told here alone.

Costs, their terms, outcomes and checks by name, for tables, figures and sentences; 1 is no unit.
What stands in braces is filled in where a check is made.
"""

from __future__ import annotations

from typing import NamedTuple

from vsf_drake.base.files import table_of


class Quantity(NamedTuple):
    """How a number of a tuning is called."""

    label: str
    unit: str

    @property
    def heading(self) -> str:
        """The label with the unit."""
        return f"{self.label} ({self.unit})"


_TABLE = table_of("tuning/quantities.csv")


def _told(motion: str, of: str) -> dict[str, Quantity]:
    """By name, of tunings whose motion is given or free."""
    return {
        row["name"]: Quantity(row["label"], row["unit"])
        for row in _TABLE
        if row["motion"] == motion and row["of"] == of
    }


GIVEN_COSTS = _told("given", "costs")
GIVEN_TERMS = _told("given", "terms") | GIVEN_COSTS  # which are terms of a weighted one
GIVEN_OUTCOMES = _told("given", "outcomes")
SAME_LOAD = _told("given", "same_load")
GIVEN_CHECKS = _told("given", "checks")
FREE_TERMS = _told("free", "terms")
FREE_OUTCOMES = _told("free", "outcomes")
FREE_CHECKS = _told("free", "checks")
