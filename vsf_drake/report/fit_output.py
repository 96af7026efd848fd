"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.contact_file import FittedContact, save_contact
from vsf_drake.errors import InputError
from vsf_drake.files import write_text
from vsf_drake.report.fit_figures import fit_figures, is_smooth, trial_name
from vsf_drake.report.page import UNKNOWN, number, render, said
from vsf_drake.report.results_folder import PAGE, ResultsFolder
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.archive import remove_result

CONTACT, CHECKPOINT = "contact.yaml", "checkpoint.json"
FIT = ResultsFolder(
    kind="fit", command="fit", table="fit.json", arrays="fit.npz", known=lambda table: table.get("kind") == "fit",
    damaged_too=False, names=(CONTACT, PAGE, CHECKPOINT), stale=(CONTACT,),
    unfinished=lambda out: (out / CHECKPOINT).exists())
_SHOWN = {"m": ("mm", 1e3), "s": ("ms", 1e3), "rad": ("°", 180.0 / math.pi), "N/m": ("N/mm", 1e-3),
          "Pa": ("GPa", 1e-9), "1": ("", 1.0)}
_FIRST = (("trial",), ("role",), ("fulcrum", "mm"))
_SCORES = (
    (("GRF", "% BW"), ("metrics", "grf_rmse_bw"), "{:.1f}", 100.0),
    (("R²",), ("metrics", "grf_r2"), "{:.3f}", 1.0),
    (("fore-aft", "% BW"), ("metrics", "fore_aft_rmse_bw"), "{:.1f}", 100.0),
    (("CoP", "% FL"), ("metrics", "cop_rmse_fl"), "{:.1f}", 100.0),
    (("impulse", "BW s"), ("metrics", "impulse_rmse_bws"), "{:.3f}", 1.0),
    (("stance", "error s"), ("stance_error_s",), "{:+.3f}", 1.0),
    (("null", "model", "% BW"), ("null_model_grf_rmse_bw",), "{:.1f}", 100.0),
    (("floor", "% BW"), ("floor_grf_rmse_bw",), "{:.1f}", 100.0),
    (("sweep:", "best mm"), ("sweep", "best_mm"), "{:.0f}", 1.0))
"""Columns of the table of trials: heading, place of the number in a trial's row, form and factor."""


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of others stay."""
    try:
        remove_result(out, FIT.kind, (CONTACT,))
        if checkpoint:
            (out / CHECKPOINT).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None


def write_fit(
    table: Mapping[str, Any], curves: Mapping[str, np.ndarray], out: Path, *, contact: FittedContact | None = None
) -> dict[str, Any]:
    """Writes everything of a fit to `out`, and returns what fit.json holds; what an earlier fit left there goes, and so
    does the checkpoint.

    Args:
        table, curves: of `analysis.contact_fit.assessment`. contact: what was fitted; not for a fit that failed.

    Raises:
        InputError: `out` cannot be written. ValueError: a contact is given with the table of a fit that failed.
    """
    if contact is not None and not table["success"]:
        raise ValueError("a fit that failed leaves no contact")
    figures = fit_figures(table, curves)
    files = [FIT.table, PAGE, *(f"{name}{suffix}" for name in figures for suffix in (".png", ".svg")),
             *([FIT.arrays] if curves else []), *([CONTACT] if contact is not None else [])]

    def more(folder: Path, written: dict[str, Any]) -> None:
        write_text(folder / PAGE, fit_page(written, figures))
        for name, figure in figures.items():
            save_figure(figure, folder / name)
        if contact is not None:
            save_contact(contact, folder / CONTACT)

    written = FIT.write(out, {**table, "files": sorted(files)}, curves or None, more=more)
    (out / CHECKPOINT).unlink(missing_ok=True)
    return written


# The page, and numbers of the table as text: in the units that people use.


def fit_page(table: Mapping[str, Any], figures: Mapping[str, Figure]) -> str:
    """The page as HTML; figures as `fit_figures` makes them of the same table."""
    trials, bench, joint = table["trials"], table["bench"] or {}, table["strategy"] == "joint"
    judged = [trial for trial in trials if trial["metrics"] is not None]
    kept = told_columns(judged) if judged else [0, 1, 2]
    kind = "contact fit" if joint else "contact fit by the paper's procedure"
    title = f"{kind}, {table['subject']['name']}{' (SYNTHETIC)' if table['synthetic'] else ''}"
    own = own_parameters(table)
    options = dict(sorted(table["options"].items()))
    options.setdefault("seed", table["seed"])
    return str(render(
        "fit.html.j2", fit={"correlations": None, **table}, figures=figures, synthetic=synthetic_of(table),
        title=title[0].upper() + title[1:] if table["success"] else f"FAILED: {title}", judged=judged,
        trial_headings=[trial_headings()[i] for i in kept],
        trial_rows=[[trial_cells(trial)[i] for i in kept] for trial in judged or trials],
        known=[key for key in ("null_model_grf_rmse_bw", "floor_grf_rmse_bw", "sweep")
               if any(trial[key] is not None for trial in judged)],
        curves=[name for i, trial in enumerate(trials) if (name := trial_name(i, trial)) in figures],
        bench_rows=_bench_rows(bench, bench, "n_per_mm"),
        mid_range_rows=_bench_rows(bench, bench.get("mid_range", {}), "mm"),
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
        option_rows=[*((name, said(dict(sorted(value.items())) if isinstance(value, Mapping) else value))
                       for name, value in options.items()), ("wall time (s)", number(table["wall_s"], "{:.1f}"))]))


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
    return str(_SHOWN.get(row["unit"], (row["unit"], 1.0))[0])


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
    return tuple(between.join(words) for words in (*_FIRST, *(heading for heading, *_ in _SCORES), ("right",)))


def trial_cells(trial: Mapping[str, Any]) -> tuple[str, ...]:
    """One trial of a fit as text; of one that was not judged, what it is."""
    first = (trial["label"], trial["role"], f"{trial['fulcrum_mm']:g}")
    if trial["metrics"] is None:
        return first
    cells = []
    for _, place, form, factor in _SCORES:
        value = trial[place[0]]
        cells.append(number(value[place[1]] if value is not None and len(place) > 1 else value, form, factor))
    right = UNKNOWN if trial["sweep"] is None else "yes" if trial["sweep"]["right"] else "NO"
    return (first[0], first[1].replace(" ", "\u00a0"), first[2], *cells, right)


def told_columns(trials: Sequence[Mapping[str, Any]]) -> list[int]:
    """Columns of `trial_cells` in which any of these judged trials has something to tell."""
    return [i for i, column in enumerate(zip(*map(trial_cells, trials), strict=True)) if {*column} != {UNKNOWN}]
