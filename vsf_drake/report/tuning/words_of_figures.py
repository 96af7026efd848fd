"""What the figures of a tuning show, in words and numbers: for who cannot see them, and above them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.report.tuning.choices_figure import excess
from vsf_drake.report.tuning.outcomes_figure import shown_outcomes
from vsf_drake.report.tuning.table import holding_terms, swept, swept_part
from vsf_drake.report.tuning.words import NOT_OPTIMAL, quantity


def cost_alt(table: Mapping[str, Any]) -> str:
    """Of the cost's curve."""
    x, y = swept(table)
    low, high = int(np.argmin(y)), int(np.argmax(y))
    end = "" if table["fulcrum_mm"] is None else (
        f" The optimum is at {table['fulcrum_mm']:.1f} mm." if table["optimal"] else
        f" {NOT_OPTIMAL}: the last iterate is at {table['fulcrum_mm']:.1f} mm.")
    return (f"Cost, {table['cost_label']}, over the fulcrum from {x[0]:g} to {x[-1]:g} mm: least "
            f"{quantity(y[low], table['cost_unit'])} near {x[low]:g} mm, most {quantity(y[high], table['cost_unit'])} "
            f"at {x[high]:g} mm.{end}")


def outcomes_alt(table: Mapping[str, Any]) -> str:
    """Of the small panels."""
    parts = []
    for row in shown_outcomes(table):
        x, y = swept_part(table, "outcomes", row["name"])
        parts.append(f"{row['label']} from {quantity(y[0], row['unit'])} at {x[0]:g} mm to "
                     f"{quantity(y[-1], row['unit'])} at {x[-1]:g} mm")
    return f"Outcomes over the range of the fulcrum: {'; '.join(parts)}."


def tasks_words(table: Mapping[str, Any]) -> str:
    """What adaptability buys."""
    lost = [value for row in table["tasks"] if (value := excess(row)) is not None]
    settings = [row["fulcrum_mm"] for row in table["tasks"] if row["fulcrum_mm"] is not None]
    if not lost or not settings or table["common_fulcrum_mm"] is None:
        return "What one setting for all would cost is not known."
    relative = all(row["cost"] is not None and row["cost"] > 0.0 for row in table["tasks"])
    unit = "%" if relative else table["cost_unit"]
    return (f"The tasks' own settings lie between {min(settings):.1f} and {max(settings):.1f} mm. One setting for all "
            f"({table['common_fulcrum_mm']:.1f} mm) costs {quantity(float(np.mean(lost)), unit)} more on average and "
            f"{quantity(max(lost), unit)} at most: this is all that changing the setting from task to task can buy "
            f"here.{_rest_words(table)}")


def _rest_words(table: Mapping[str, Any]) -> str:
    """What of it is no gain of the person, because a term of the cost only holds to the recording."""
    pairs = [(row["rest"], row["rest_common"]) for row in table["tasks"]
             if row.get("rest") is not None and row.get("rest_common") is not None]
    if pairs:
        more = float(np.mean([common - own for own, common in pairs]))
        size = float(np.mean([abs(own) for own, _ in pairs])) or 1.0
        return (f" Without the part of the cost that only holds to the recording, one setting for all costs "
                f"{quantity(abs(more), table['cost_unit'])} {'more' if more >= 0.0 else 'LESS'} on average "
                f"({100.0 * abs(more) / size:.2g} %).")
    if holding_terms({"terms": [], "sweep": [], **table}):
        return " That counts the part of the cost that only holds to the recording, which is no gain of the person."
    return ""


def tasks_alt(table: Mapping[str, Any]) -> str:
    """Of the tasks' figure."""
    parts = [f"{row['label']} {row['fulcrum_mm']:.1f} mm" for row in table["tasks"] if row["fulcrum_mm"] is not None]
    return f"Own settings of the tasks: {', '.join(parts) or 'none is known'}. {tasks_words(table)}"


def pareto_words(table: Mapping[str, Any]) -> str:
    """How far the setting moves along the front, and what is gained and lost."""
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    if len(rows) < 2:
        return "The front has fewer than two points."
    first, second = (name.replace("_", " ") for name in table["pareto_names"])
    settings = [row["fulcrum_mm"] for row in rows]
    return (f"From one end of the front to the other the fulcrum moves between {min(settings):.1f} and "
            f"{max(settings):.1f} mm; {first} lies between {_span(rows, 'first')} and {second} between "
            f"{_span(rows, 'second')}.")


def pareto_alt(table: Mapping[str, Any]) -> str:
    """Of the front."""
    return f"Pareto front of {' and '.join(name.replace('_', ' ') for name in table['pareto_names'])}. " \
        + pareto_words(table)


def robustness_words(table: Mapping[str, Any]) -> str:
    """How far the optimum moves."""
    found = [row["fulcrum_mm"] for row in table["robustness"] if row["fulcrum_mm"] is not None]
    if not found:
        return "No changed problem could be solved."
    return (f"With each of {len(found)} changes the optimum lies between {min(found):.1f} and {max(found):.1f} mm.")


def robustness_alt(table: Mapping[str, Any]) -> str:
    """Of its figure."""
    parts = [f"{row['what']} {row['fulcrum_mm']:.1f} mm" for row in table["robustness"]
             if row["fulcrum_mm"] is not None]
    return f"Where the optimum lies when something is changed: {', '.join(parts)}."


def spans(values: Any, names: Sequence[str]) -> str:
    """Ranges of the coordinates, in degrees and mm."""
    parts = []
    for name, column in zip(names, np.asarray(values).T, strict=True):
        scale, unit = (1e3, " mm") if name in ("pelvis_tx", "pelvis_ty") else (180.0 / np.pi, "°")
        parts.append(f"{name.replace('_', ' ')} {scale * column.min():.0f} to {scale * column.max():.0f}{unit}")
    return ", ".join(parts)


def _span(rows: Sequence[Mapping[str, Any]], key: str) -> str:
    values = [row[key] for row in rows]
    return f"{min(values):.4g} and {max(values):.4g}"
