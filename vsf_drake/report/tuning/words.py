"""A tuning in words: what was found, how much it is worth, and what it may not be taken for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

NOT_OPTIMAL, HARDLY = "NOT OPTIMAL", "THE SETTING HARDLY MATTERS"
_NEAR_MM = 0.05
"""Positions that are nearer than this are one."""
MODELS = {
    1: "The motion is the recorded one at every setting: only the foot's force follows the fulcrum. How the person "
       "would adapt the gait is not in these figures (level 1).",
    2: "The motion adapts: a sagittal model of the person, driven by joint torques, whose gait is optimised together "
       "with the setting (level 2). It has no muscles, no trunk and no motion in the frontal plane."}


def title_of(table: Mapping[str, Any]) -> str:
    """Of page and figures; that there is no optimum comes first."""
    words = f"Stiffness tuned: {table['cost_label']}"
    return words if table["optimal"] else f"{NOT_OPTIMAL}: {words[0].lower()}{words[1:]}"


def alarm_of(table: Mapping[str, Any]) -> str:
    """What stands in red above a result that is none; nothing above an optimum."""
    if table["optimal"]:
        return ""
    return (f"{NOT_OPTIMAL}: {_sentence(table['status'])} What is shown is where the solver stood when it ended. It is "
            "no recommendation; do not set a foot by it.")


def first_line(table: Mapping[str, Any]) -> str:
    """Whose data these are, and what the model is."""
    data = f"Data are SYNTHETIC, not recorded: {_listed(table['trials'])}." if table["synthetic"] else \
        f"Recorded trials: {_listed(table['trials'])}."
    return f"{data} {MODELS[table['level']]}"


def answer(table: Mapping[str, Any]) -> list[str]:
    """Which setting, how much better than others, and whether that is more than the uncertainty; sentence by sentence.

    Where nothing is to be gained, that comes first. Of a tuning that is not optimal, only where it stood.
    """
    if not table["optimal"]:
        if table["fulcrum_mm"] is None:
            return ["The tuning ended before it had a setting at all."]
        worth = "" if table["cost"] is None else f", at a cost of {quantity(table['cost'], table['cost_unit'])}"
        return [f"The solver's last iterate has the fulcrum at {millimetres(table['fulcrum_mm'])}{worth}. This is not "
                "the best setting, and nothing here says how far from it."]
    said = worth_words(table)
    first, last = (said[:1], said[1:]) if said and said[0].startswith(HARDLY) else ([], said)
    return [*first, setting_words(table), *_better_words(table), *last, *_bound_words(table)]


def setting_words(table: Mapping[str, Any]) -> str:
    """The setting, its cost and its interval."""
    x, _ = swept(table)
    span = f" between {x[0]:g} and {x[-1]:g} mm" if len(x) else ""
    words = (f"Of all settings{span}, the fulcrum at {millimetres(table['fulcrum_mm'])} has the least cost: "
             f"{quantity(table['cost'], table['cost_unit'])} ({table['cost_label']}).")
    interval = table["fulcrum_interval_mm"]
    if interval is not None:
        words += f" Its interval is {interval[0]:.0f} to {interval[1]:.0f} mm" + (
            f": {_sentence(table['interval_meaning'])}" if table["interval_meaning"] else ".")
    return words


def worth_words(table: Mapping[str, Any]) -> list[str]:
    """Whether the setting matters, by the cost's own uncertainty and by what else was looked at."""
    row, (_, costs) = cost_outcome(table), swept(table)
    said = []
    if row is not None and row["matters"] is not None and len(costs):
        size = quantity(float(costs.max() - costs.min()), table["cost_unit"])
        known = "" if row["uncertainty"] is None else f" (± {quantity(row['uncertainty'], table['cost_unit'])})"
        if not row["matters"]:
            said.append(f"{HARDLY} for this cost: over the whole range it changes by {size}, which is too little to be "
                        f"told from its uncertainty{known} or from nothing.")
        elif not row["sentence"]:
            said.append(f"Over the whole range the cost changes by {size}, more than its uncertainty{known}.")
    if row is not None and row["sentence"]:
        said.append(row["sentence"])
    others = [other for other in table["outcomes"] if other is not row]
    names = {kind: [other["label"] for other in others if other["matters"] is kind] for kind in (True, False, None)}
    if row is None and others and not names[True] and not names[None]:
        said.append(f"{HARDLY}: none of the outcomes changes by more than its uncertainty.")
        return said
    if len(names[True]) > max(1, len(others) - 1):
        said.append("All other outcomes change by more than their uncertainty over the range.")
    elif names[True]:
        said.append(f"Other outcomes that change by more than their uncertainty: {'; '.join(names[True])}.")
    if names[False]:
        said.append(f"Outcomes that change by no more than their uncertainty: {'; '.join(names[False])}.")
    if (row is None or row["matters"] is None) and not names[True] and not names[False]:
        said.append("Whether that is more than the uncertainty is not known.")
    return said


def quantity(value: float, unit: str) -> str:
    """A number with its unit, in four digits."""
    return f"{value:.4g} {unit}".rstrip() if unit not in ("1", "") else f"{value:.4g}"


def millimetres(value: float) -> str:
    """A position, to a tenth."""
    return f"{value:.1f} mm"


def _better_words(table: Mapping[str, Any]) -> list[str]:
    """Against the ends and the recorded settings: the whole cost, and without what only holds to the recording."""
    whole = _compared(table, lambda mm: cost_at(table, mm), table["cost"])
    holding = holding_terms(table)
    if not whole or not holding:
        return whole
    own = table["cost"] - sum(row["value"] for row in holding)
    names = " and ".join(f"\"{row['label']}\"" for row in holding)
    without = _compared(table, lambda mm: rest_at(table, mm), own)[-1].removeprefix("That is ")
    return [*whole, f"Without {names}, the part of the cost that only holds to the recording, it is {without}"]


def _compared(table: Mapping[str, Any], cost: Callable[[float], float | None], own: float) -> list[str]:
    """`own`, a cost at the optimum, against that at the ends and at recorded settings."""
    x, _ = swept(table)
    if not len(x):
        return []
    recorded = recorded_positions(table)
    places = [("the softest setting", float(x[0])), ("the stiffest", float(x[-1])),
              *(("the recorded setting" if len(recorded) == 1 else "another recorded one", mm) for mm in recorded
                if x[0] < mm < x[-1])]
    parts, same = [], []
    for name, mm in places:
        there = cost(mm)
        if abs(mm - table["fulcrum_mm"]) < _NEAR_MM:
            same.append(f"It is {name} itself.")
        elif there is not None:
            where = f"{mm:g} mm, also recorded" if mm in recorded and "recorded" not in name else f"{mm:g} mm"
            parts.append(f"{_less(there, own, table['cost_unit'])} than at {name} ({where})")
    return [*same, *([f"That is {_listed(parts)}."] if parts else [])]


def _less(there: float, own: float, unit: str) -> str:
    saved = there - own
    word = "less" if saved >= 0.0 else "MORE"
    if there > 0.0 and own > 0.0:
        return f"{100.0 * abs(saved) / there:.1f} % {word}"
    return f"{quantity(abs(saved), unit)} {word}"


def _bound_words(table: Mapping[str, Any]) -> list[str]:
    if not table["at_bound"]:
        return []
    return [f"On a bound of its range: {_listed(table['at_bound'])}. The cost may fall further beyond it."]


def _listed(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else "none"


def _sentence(text: str) -> str:
    text = text.strip() or "the solver did not say why"
    return text if text.endswith(".") else f"{text}."


# The table of a tuning, as tuning.json holds it: which keys there are, and what is read off it everywhere.
#
# Costs and outcomes are in the units that the table names; positions of the fulcrum in mm from the keel's posterior
# end.


HOLDING = ("consistency", "deviation")
"""Terms of a cost that only hold it to the recording, by name: what they add says nothing of the person's gain."""
COST = "cost"
"""Name of the outcome that is the cost itself, where a backend tells its uncertainty."""


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
