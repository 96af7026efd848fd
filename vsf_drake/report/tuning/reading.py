"""What is read off the table of a tuning or a schedule, as tuning.json and policy.json hold it, everywhere.

Costs and outcomes are in the units that the table names; positions of the fulcrum in mm from the keel's posterior end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import SETTINGS

Table = Mapping[str, Any]
Arrays = Mapping[str, Any]
SHOWN = SETTINGS[:3]  # settings of a tuning beside the recorded one
FEET = {"prosthetic": "prosthetic foot", "intact": "intact foot"}
LENGTHS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")  # coordinates in metres, not radians
DESCRIPTORS = {"speed_m_per_s": "speed (m/s)", "slope_deg": "slope (°, uphill +)", "carried_kg": "carried load (kg)"}
HOLDING = ("consistency", "deviation")
"""Terms of a cost that only hold it to the recording, by name: what they add says nothing of the person's gain."""
_NEAR_MM = 0.05  # positions that are nearer than this are one


def swept(table: Table, part: str = "", name: str = "") -> tuple[np.ndarray, np.ndarray]:
    """Positions (s,) in mm, rising, and the cost (s,) at each, of the points of the sweep where it is known; or one of
    the `terms` or `outcomes` (`part`)."""
    pairs = [(row["fulcrum_mm"], (row[part] or {}).get(name) if part else row["cost"]) for row in table["sweep"]]
    found = np.array(sorted((x, y) for x, y in pairs if x is not None and y is not None), dtype=float).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def cost_at(table: Table, fulcrum_mm: float) -> float | None:
    """The cost at a position, by straight lines between the points of the sweep; None outside of them."""
    x, y = swept(table)
    return float(np.interp(fulcrum_mm, x, y)) if len(x) and x[0] <= fulcrum_mm <= x[-1] else None


def cost_outcome(table: Table) -> Table | None:
    """The row of the outcomes that is the cost itself; None where there is none."""
    return next((row for row in table["outcomes"] if row["name"] in ("cost", table["cost_name"])), None)


def holding_terms(table: Table) -> list[Table]:
    """The terms of HOLDING, if the cost has others besides and both are known over the range; else none."""
    found = [row for row in table["terms"] if row["name"] in HOLDING and row["value"] is not None]
    count = len(swept(table)[0])
    known = all(len(swept(table, "terms", row["name"])[0]) == count for row in found)
    return found if count and known and len(found) < len(table["terms"]) else []


def rest_at(table: Table, fulcrum_mm: float | None) -> float | None:
    """The cost without `holding_terms` at a position, as `cost_at`; None without such terms or position."""
    there, holding = None if fulcrum_mm is None else cost_at(table, fulcrum_mm), holding_terms(table)
    if fulcrum_mm is None or there is None or not holding:
        return None
    return there - sum(float(np.interp(fulcrum_mm, *swept(table, "terms", row["name"]))) for row in holding)


def recorded_positions(table: Table) -> list[float]:
    """Where the fulcrum stood in the trials (mm), each position once, rising; empty if the table does not say."""
    return sorted({float(x) for x in table.get("recorded_mm") or ()})


def excess(row: Table) -> float | None:
    """What a task's cost is worse by with one setting for all: in percent where costs are positive, else as it is."""
    if row["cost"] is None or row["cost_common"] is None:
        return None
    lost = float(row["cost_common"] - row["cost"])
    return 100.0 * lost / row["cost"] if row["cost"] > 0.0 else lost


def excess_unit(table: Table) -> str:
    """The unit of `excess` where it is told of all tasks together."""
    relative = all(row["cost"] is not None and row["cost"] > 0.0 for row in table["tasks"])
    return "%" if relative else str(table["cost_unit"])


def shown_outcomes(table: Table) -> list[Table]:
    """Outcomes that were followed over the range."""
    return [row for row in table["outcomes"] if len(swept(table, "outcomes", row["name"])[0]) > 1]


def compared(table: Table, cost: Callable[[float], float | None], own: float) -> list[dict[str, Any]]:
    """`own`, a cost at the optimum, against that at the ends and at recorded settings.

    Returns:
        For each its name, `mm`, whether it was `recorded` too, `saved` there in the cost's unit and in `percent` (None
        for costs that are not positive); `saved` is None at the optimum itself.
    """
    x, _ = swept(table)
    if not len(x):
        return []
    recorded = recorded_positions(table)
    inside = [mm for mm in recorded if x[0] < mm < x[-1]]
    names = ["the softest setting", "the stiffest",
             *["the recorded setting" if len(recorded) == 1 else "another recorded one"] * len(inside)]
    found: list[dict[str, Any]] = []
    for i, (name, mm) in enumerate(zip(names, [float(x[0]), float(x[-1]), *inside], strict=True)):
        there, place = cost(mm), {"name": name, "mm": mm, "recorded": i < 2 and mm in recorded}
        if abs(mm - table["fulcrum_mm"]) < _NEAR_MM:
            found.append(place | {"saved": None})
        elif there is not None:
            percent = 100.0 * (there - own) / there if there > 0.0 and own > 0.0 else None
            found.append(place | {"saved": there - own, "percent": percent})
    return found


def telling(table: Table) -> str | None:
    """The one descriptor in which a schedule's tasks differ; None if there is none, or several."""
    found = [name for name in DESCRIPTORS if len({row[name] for row in table["tasks"]}) > 1]
    known = all(row[name] is not None for name in found for row in table["tasks"])
    return found[0] if len(found) == 1 and known else None


def curved(table: Table) -> list[Table]:
    """Tasks of a schedule whose cost is known over the range."""
    return [row for row in table["tasks"] if len(row["sweep"]["fulcrum_mm"]) > 1]


def drawn_trials(table: Table, arrays: Arrays) -> dict[str, str]:
    """Up to three trials of a level 1 tuning whose forces there are: what their arrays begin with, by label."""
    found = {str(name): f"trial_{i}_" for i, name in enumerate(table["trials"])
             if any(f"trial_{i}_{setting}" in arrays for setting in SHOWN)}
    names = list(found)
    return {name: found[name] for name in (names[0], names[len(names) // 2], names[-1])} if found else {}


def root_mean_squares(arrays: Arrays, key: str, other: str = "_recorded") -> np.ndarray | None:
    """Of the differences of `key` and its recorded (or `other`) counterpart, column by column; None without one."""
    own, against = arrays.get(key), arrays.get(f"{key}{other}")
    if own is None or against is None or np.shape(own) != np.shape(against):
        return None
    return np.asarray(np.sqrt(np.mean((np.asarray(own) - np.asarray(against)) ** 2, axis=0)))
