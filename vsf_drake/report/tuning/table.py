"""The table of a tuning, as tuning.json holds it: which keys there are, and what is read off it everywhere.

Costs and outcomes are in the units that the table names; positions of the fulcrum in mm from the keel's posterior end.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

FORMAT = "vsf_drake tuning 1"
KEYS = (
    "format", "level", "cost_name", "cost_label", "cost_unit", "optimal", "status", "fulcrum_mm", "cost", "at_bound",
    "fulcrum_interval_mm", "interval_meaning", "design", "terms", "sweep", "outcomes", "solver", "confirmed_by",
    "starts", "checks", "tasks", "common_fulcrum_mm", "pareto", "pareto_names", "robustness", "trials", "synthetic",
    "notes", "wall_s", "provenance")
"""All of them are always there."""
HOLDING = ("consistency", "deviation")
"""Terms of a cost that only hold it to the recording, by name: what they add says nothing of the person's gain."""
COST = "cost"
"""Name of the outcome that is the cost itself, where a backend tells its uncertainty."""


def check_tuning_table(table: Mapping[str, Any]) -> None:
    """Raises ValueError for a table that lacks a key, has another format or claims an optimum without a position."""
    missing = [key for key in KEYS if key not in table]
    if missing:
        raise ValueError(f"the table of a tuning lacks {', '.join(missing)}")
    if table["format"] != FORMAT:
        raise ValueError(f"the table's format is {table['format']!r}, not {FORMAT!r}")
    if table["level"] not in (1, 2):
        raise ValueError(f"{table['level']!r} is no level of a tuning")
    if table["optimal"] and (table["fulcrum_mm"] is None or table["cost"] is None):
        raise ValueError("an optimum has a position and a cost")


def cost_outcome(table: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The row of the outcomes that is the cost itself; None where there is none."""
    return next((row for row in table["outcomes"] if row["name"] in (COST, table["cost_name"])), None)


def swept(table: Mapping[str, Any], key: str = "cost") -> tuple[np.ndarray, np.ndarray]:
    """Positions (s,) in mm, rising, and the cost (s,) at each, of the points of the sweep where it is known."""
    return _known([(row["fulcrum_mm"], row[key]) for row in table["sweep"]])


def swept_part(table: Mapping[str, Any], part: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """As `swept`, of one of the `terms` or `outcomes` (`part`)."""
    return _known([(row["fulcrum_mm"], (row[part] or {}).get(name)) for row in table["sweep"]])


def cost_at(table: Mapping[str, Any], fulcrum_mm: float) -> float | None:
    """The cost at a position, by straight lines between the points of the sweep; None outside of them."""
    x, y = swept(table)
    if not len(x) or not x[0] <= fulcrum_mm <= x[-1]:
        return None
    return float(np.interp(fulcrum_mm, x, y))


def holding_terms(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The terms of HOLDING, if the cost has others besides and both are known over the range; else none."""
    found = [row for row in table["terms"] if row["name"] in HOLDING and row["value"] is not None]
    count = len(swept(table)[0])
    known = all(len(swept_part(table, "terms", row["name"])[0]) == count for row in found)
    return found if count and known and len(found) < len(table["terms"]) else []


def rest_at(table: Mapping[str, Any], fulcrum_mm: float) -> float | None:
    """The cost without `holding_terms` at a position, as `cost_at`; None without such terms."""
    there, holding = cost_at(table, fulcrum_mm), holding_terms(table)
    if there is None or not holding:
        return None
    return there - sum(float(np.interp(fulcrum_mm, *swept_part(table, "terms", row["name"]))) for row in holding)


def recorded_positions(table: Mapping[str, Any]) -> list[float]:
    """Where the fulcrum stood in the trials (mm), each position once, rising; empty if the table does not say."""
    return sorted({float(x) for x in table.get("recorded_mm") or ()})


def is_flat(table: Mapping[str, Any]) -> bool:
    """Whether the cost is known to change by no more than its uncertainty over the whole range."""
    row = cost_outcome(table)
    return row is not None and row["matters"] is False


def _known(pairs: list[tuple[Any, Any]]) -> tuple[np.ndarray, np.ndarray]:
    kept = sorted((float(x), float(y)) for x, y in pairs if x is not None and y is not None)
    found = np.array(kept, dtype=float).reshape(-1, 2)
    return found[:, 0], found[:, 1]
