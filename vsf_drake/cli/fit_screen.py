"""A fit on the screen: trials, bench, parameters, verdict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import console

_WORDS = 2
"""Columns of the table of trials that hold words; the others hold numbers."""


def print_fit(table: Mapping[str, Any]) -> None:
    """The table of a fit that succeeded, in short."""
    from vsf_drake.report.fit_text import smooth_errors, synthetic_of

    synthetic = " (SYNTHETIC)" if synthetic_of(table) else ""
    _say(f"Trials{synthetic}; root mean square differences; BW: body weight, FL: foot length")
    _print_trials(table)
    bench = table["bench"]
    if bench is not None:
        heel = "" if bench["heel_model_n_per_mm"] is None else (
            f", heel {bench['heel_model_n_per_mm']:.1f} (measured {bench['heel_measured_n_per_mm']:.1f})")
        pairs = ", ".join(f"{model:.1f} ({measured:.1f})" for model, measured in
                          zip(bench["model_n_per_mm"], bench["measured_n_per_mm"], strict=True))
        kind = " (SYNTHETIC)" if bench["synthetic"] else ""
        _say(f"Bench{kind}, N/mm, fitted (measured): {pairs}{heel}; forefoot {bench['rmse_n_per_mm']:.2f} off")
        _print_mid_range(bench.get("mid_range"))
    _print_parameters(table)
    if smooth_errors(table):
        _say(smooth_errors(table))
    for sentence in table["verdict"]:
        _say(f"- {sentence}")


def _print_mid_range(found: Mapping[str, Any] | None) -> None:
    if found is None:
        return
    pairs = ", ".join(f"{model:.2f} ({measured:.2f})" for model, measured in
                      zip(found["model_mm"], found["measured_mm"], strict=True))
    heel = "" if found["heel_model_mm"] is None else (
        f", heel {found['heel_model_mm']:.2f} (measured {found['heel_measured_mm']:.2f})")
    _say(f"Mid-range displacement, mm, fitted (measured): {pairs}{heel}; forefoot {found['rmse_mm']:.2f} off")


def _print_trials(table: Mapping[str, Any]) -> None:
    """One line a trial, in columns that no narrow screen cuts; where the sweep is wrong, its best position says so."""
    from vsf_drake.report.fit_text import told_columns, trial_cells, trial_headings

    headings = [heading.split("\n") for heading in trial_headings(between="\n")[:-1]]
    kept = [i for i in told_columns(table["trials"]) if i < len(headings)]
    rows = []
    for trial in table["trials"]:
        *cells, right = trial_cells(trial)
        cells[-1] += " NO" if right == "NO" else ""
        rows.append([cells[i] for i in kept])
    tall = max(len(headings[i]) for i in kept)
    head = [[([""] * tall + headings[i])[-tall + line] for i in kept] for line in range(tall)]
    wide = [max(len(row[c]) for row in (*head, *rows)) for c in range(len(kept))]
    for row in (*head, *rows):
        cells = [text.ljust(size) if i < _WORDS else text.rjust(size) for i, text, size in
                 zip(kept, row, wide, strict=True)]
        console.print(Text(" ".join(cells).rstrip(), style="bold yellow" if row[-1].endswith(" NO") else ""),
                      soft_wrap=True)


def _print_parameters(table: Mapping[str, Any]) -> None:
    from vsf_drake.report.fit_text import interval_of, own_parameters, shown, unit_of, value_of

    joint = table["strategy"] == "joint"
    grid = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    grid.add_column("parameter", overflow="fold")
    grid.add_column("value", justify="right")
    if joint:
        grid.add_column("95 % interval", justify="right")
    grid.add_column("unit")
    if joint:
        grid.add_column("share of prior", justify="right")
    for row in own_parameters(table):
        more = (interval_of(row),) if joint else ()
        last = (shown(row["share_of_prior"], "{:.0f} %", 100.0) + (" AT A BOUND" if row["at_bound"] else ""),) \
            if joint else ()
        grid.add_row(*map(Text, (row["name"], value_of(row, "value"), *more, unit_of(row), *last)))
    console.print(grid)


def _say(line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)
