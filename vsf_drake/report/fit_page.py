"""The page of a contact fit, and numbers of its table as text: in the units that people use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.report.fit_figures import is_smooth, trial_name
from vsf_drake.report.page import UNKNOWN, number, render, said

_SHOWN = {"m": ("mm", 1e3), "s": ("ms", 1e3), "rad": ("°", 180.0 / math.pi), "N/m": ("N/mm", 1e-3),
          "Pa": ("GPa", 1e-9), "1": ("", 1.0)}
_HEADINGS = (("trial",), ("role",), ("fulcrum", "mm"), ("GRF", "% BW"), ("R²",), ("fore-aft", "% BW"), ("CoP", "% FL"),
             ("impulse", "BW s"), ("stance", "error s"), ("null", "model", "% BW"), ("floor", "% BW"),
             ("sweep:", "best mm"), ("right",))


def fit_page(table: Mapping[str, Any], figures: Mapping[str, Figure]) -> str:
    """The page as HTML; figures as `fit_figures` makes them of the same table."""
    trials, bench, joint = table["trials"], table["bench"] or {}, table["strategy"] == "joint"
    judged = [trial for trial in trials if trial["metrics"] is not None]
    kept = told_columns(judged) if judged else [0, 1, 2]
    kind = "contact fit" if joint else "contact fit by the paper's procedure"
    title = f"{kind}, {table['subject']['name']}{' (SYNTHETIC)' if table['synthetic'] else ''}"
    own = own_parameters(table)
    options = sorted(table["options"].items())
    if "seed" not in table["options"]:
        options.append(("seed", table["seed"]))
    mid_range = bench.get("mid_range") or {}
    return str(render(
        "fit.html.j2", fit={"correlations": None, **table}, figures=figures, synthetic=synthetic_of(table),
        title=title[0].upper() + title[1:] if table["success"] else f"FAILED: {title}", judged=judged,
        trial_headings=[trial_headings()[i] for i in kept],
        trial_rows=[[trial_cells(trial)[i] for i in kept] for trial in judged or trials],
        known=[key for key in ("null_model_grf_rmse_bw", "floor_grf_rmse_bw", "sweep")
               if any(trial[key] is not None for trial in judged)],
        curves=[name for i, trial in enumerate(trials) if (name := trial_name(i, trial)) in figures],
        bench_rows=_bench_rows(bench, bench, "n_per_mm"), mid_range_rows=_bench_rows(bench, mid_range, "mm"),
        own_rows=[_parameter(row, table) if joint else
                  (row["name"], value_of(row, "value"), value_of(row, "start"), unit_of(row))
                  for row in (own if joint else table["parameters"])],
        rest_rows=[_parameter(row, table) for row in table["parameters"] if not row["frozen"] and row not in own],
        frozen_rows=[(row["name"], value_of(row, "value"), unit_of(row))
                     for row in table["parameters"] if row["frozen"]],
        reference_depth_mm=1e3 * REFERENCE_DEPTH_M, smooth=smooth_errors(table),
        direction_rows=[(f"{row['singular_value']:.3g}", ", ".join(
            f"{part['name']} {part['share']:+.2f}" for part in row["made_of"]))
            for row in reversed(table.get("weakest", ())) if row["made_of"]],
        noise_rows=[(row["trial"], row["series"], f"{row['ratio']:.2f}")
                    for row in table.get("noise", {"ratios": ()})["ratios"]],
        left_out_rows=[(row["kind"], ", ".join(row["left_out"]), *(
            (f"failed: {row['failed']}", "") if row["failed"] else
            (number(row["grf_rmse_bw"], "{:.1f}", 100.0), number(row["cop_rmse_fl"], "{:.1f}", 100.0))))
            for row in table["left_out"]],
        search_rows=[(str(i), number(s["start_cost"], "{:.1f}"), number(s["cost"], "{:.1f}"), str(s["evaluations"]),
                      str(s["failed"]), "yes" if s["success"] else "NO", s["message"])
                     for i, s in enumerate(table["searches"], start=1)],
        option_rows=[*((name, _option(value)) for name, value in options),
                     ("wall time (s)", number(table["wall_s"], "{:.1f}"))]))


def _option(value: Any) -> str:
    return said(dict(sorted(value.items())) if isinstance(value, Mapping) else value)


def _bench_rows(bench: Mapping[str, Any], of: Mapping[str, Any], unit: str) -> list[tuple[str, ...]]:
    """Measured, fitted and difference at each position and the heel; none where nothing was judged."""
    if of.get(f"model_{unit}") is None:
        return []
    rows = [(f"{x:g}", k, fitted) for x, k, fitted in
            zip(bench["fulcrum_mm"], of[f"measured_{unit}"], of[f"model_{unit}"], strict=True)]
    if of[f"heel_measured_{unit}"] is not None:
        rows.append(("heel", of[f"heel_measured_{unit}"], of[f"heel_model_{unit}"]))
    return [(x, f"{k:.2f}", f"{fitted:.2f}", number(fitted - k, "{:+.2f}")) for x, k, fitted in rows]


def _parameter(row: Mapping[str, Any], table: Mapping[str, Any]) -> tuple[str, ...]:
    doubts = [*(["at a bound"] if row["at_bound"] else []),
              *(["not identified"] if row["name"] in table.get("unidentified", ()) else [])]
    return (row["name"], value_of(row, "value"), interval_of(row), unit_of(row),
            number(row["share_of_prior"], "{:.0f}", 100.0), value_of(row, "spread_over_starts"), ", ".join(doubts))


def unit_of(row: Mapping[str, Any]) -> str:
    """In which a parameter is shown."""
    unit: str = row["unit"]
    return _SHOWN.get(unit, (unit, 1.0))[0]


def value_of(row: Mapping[str, Any], key: str) -> str:
    """A number of a parameter in `unit_of`."""
    return number(row[key], "{:.3g}", _SHOWN.get(row["unit"], ("", 1.0))[1])


def interval_of(row: Mapping[str, Any]) -> str:
    """Its 95 % interval in `unit_of`."""
    if row["interval_95"] is None or None in row["interval_95"]:
        return UNKNOWN
    factor = _SHOWN.get(row["unit"], ("", 1.0))[1]
    low, high = (factor * end for end in row["interval_95"])
    return f"{low:.3g} to {high:.3g}"


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


def trial_headings(*, between: str = " ") -> tuple[str, ...]:
    """Of the cells of `trial_cells`, each with its unit; `between` stands where a heading may be broken."""
    return tuple(between.join(words) for words in _HEADINGS)


def trial_cells(trial: Mapping[str, Any]) -> tuple[str, ...]:
    """One trial of a fit as text; of one that was not judged, what it is."""
    m, sweep = trial["metrics"], trial["sweep"]
    first = (trial["label"], trial["role"], f"{trial['fulcrum_mm']:g}")
    if m is None:
        return first
    return (first[0], first[1].replace(" ", "\u00a0"), first[2],
            number(m["grf_rmse_bw"], "{:.1f}", 100.0), number(m["grf_r2"], "{:.3f}"),
            number(m["fore_aft_rmse_bw"], "{:.1f}", 100.0), number(m["cop_rmse_fl"], "{:.1f}", 100.0),
            number(m["impulse_rmse_bws"], "{:.3f}"),
            number(trial["stance_error_s"], "{:+.3f}"), number(trial["null_model_grf_rmse_bw"], "{:.1f}", 100.0),
            number(trial["floor_grf_rmse_bw"], "{:.1f}", 100.0),
            number(sweep["best_mm"] if sweep else None, "{:.0f}"),
            UNKNOWN if sweep is None else "yes" if sweep["right"] else "NO")


def told_columns(trials: Sequence[Mapping[str, Any]]) -> list[int]:
    """Columns of `trial_cells` in which any of these judged trials has something to tell."""
    rows = [trial_cells(trial) for trial in trials]
    return [i for i in range(len(_HEADINGS)) if any(row[i] != UNKNOWN for row in rows)]
