"""Numbers of a contact fit as text: in the units that people use, with a word where there is no number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

UNKNOWN = "–"
_SHOWN = {"m": ("mm", 1e3), "s": ("ms", 1e3), "rad": ("°", 180.0 / math.pi), "N/m": ("N/mm", 1e-3),
          "Pa": ("GPa", 1e-9), "1": ("", 1.0)}


def shown(value: float | None, form: str, factor: float = 1.0) -> str:
    """`value` times `factor` in this format, or UNKNOWN; a zero has no sign."""
    if value is None:
        return UNKNOWN
    text = form.format(factor * value)
    return text.lstrip("+-") if not text.strip("+-0.") else text


def unit_of(row: Mapping[str, Any]) -> str:
    """In which a parameter is shown."""
    unit: str = row["unit"]
    return _SHOWN.get(unit, (unit, 1.0))[0]


def value_of(row: Mapping[str, Any], key: str) -> str:
    """A number of a parameter in `unit_of`."""
    return shown(row[key], "{:.3g}", _SHOWN.get(row["unit"], ("", 1.0))[1])


def interval_of(row: Mapping[str, Any]) -> str:
    """Its 95 % interval in `unit_of`."""
    if row["interval_95"] is None or None in row["interval_95"]:
        return UNKNOWN
    factor = _SHOWN.get(row["unit"], ("", 1.0))[1]
    low, high = (factor * end for end in row["interval_95"])
    return f"{low:.3g} to {high:.3g}"


def is_smooth(name: str) -> bool:
    """Whether a parameter is a coefficient of a smooth curve or path."""
    return name.startswith("curve.") or (name.startswith("trial.") and ".path." in name)


def own_parameters(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Rows of the fitted parameters of foot and person: without those of curves and of single trials."""
    return [row for row in table["parameters"] if not row["frozen"] and not is_smooth(row["name"])
            and not row["name"].startswith("trial.")]


def smooth_errors(table: Mapping[str, Any]) -> str:
    """The curves of joint angles in one sentence, "" if there are none or all were left at zero."""
    told = [f"{row['coordinate']} {row['largest_deg']:+.2f}°" for row in table.get("curves", ())
            if row["largest_deg"] != 0.0]
    return f"Smooth errors of joint angles over the gait cycle, at their largest: {', '.join(told)}." if told else ""


def synthetic_of(table: Mapping[str, Any]) -> list[str]:
    """What of a fit's data nobody measured."""
    names = [trial["label"] for trial in table["trials"] if trial["synthetic"]]
    return [*names, *(["the bench"] if table["bench"] and table["bench"]["synthetic"] else [])]


def title_of(table: Mapping[str, Any]) -> str:
    """Of a fit's page; that it failed comes first."""
    kind = "contact fit" if table["strategy"] == "joint" else "contact fit by the paper's procedure"
    words = f"{kind}, {table['subject']['name']}{' (SYNTHETIC)' if table['synthetic'] else ''}"
    return words[0].upper() + words[1:] if table["success"] else f"FAILED: {words}"


def trial_headings(*, between: str = " ") -> tuple[str, ...]:
    """Of the cells of `trial_cells`, each with its unit; `between` stands where a heading may be broken."""
    parts = (("trial",), ("role",), ("fulcrum", "mm"), ("GRF", "% BW"), ("R²",), ("fore-aft", "% BW"), ("CoP", "% FL"),
             ("impulse", "BW s"), ("stance", "error s"), ("null", "model", "% BW"), ("floor", "% BW"),
             ("sweep:", "best mm"), ("right",))
    return tuple(between.join(words) for words in parts)


def trial_cells(trial: Mapping[str, Any]) -> tuple[str, ...]:
    """One trial of a judged fit as text."""
    m, sweep = trial["metrics"], trial["sweep"]
    return (trial["label"], trial["role"].replace(" ", "\u00a0"), f"{trial['fulcrum_mm']:g}",
            shown(m["grf_rmse_bw"], "{:.1f}", 100.0), shown(m["grf_r2"], "{:.3f}"),
            shown(m["fore_aft_rmse_bw"], "{:.1f}", 100.0), shown(m["cop_rmse_fl"], "{:.1f}", 100.0),
            shown(m["impulse_rmse_bws"], "{:.3f}"),
            shown(trial["stance_error_s"], "{:+.3f}"), shown(trial["null_model_grf_rmse_bw"], "{:.1f}", 100.0),
            shown(trial["floor_grf_rmse_bw"], "{:.1f}", 100.0),
            shown(sweep["best_mm"] if sweep else None, "{:.0f}"),
            UNKNOWN if sweep is None else "yes" if sweep["right"] else "NO")


def told_columns(trials: Sequence[Mapping[str, Any]]) -> list[int]:
    """Columns of `trial_cells` in which any of these trials has something to tell."""
    rows = [trial_cells(trial) for trial in trials]
    return [i for i in range(len(trial_headings())) if any(row[i] != UNKNOWN for row in rows)]
