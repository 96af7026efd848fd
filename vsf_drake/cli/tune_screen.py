"""A tuning, and a schedule, on the screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import console


def print_tuning(table: Mapping[str, Any]) -> None:
    """The answer in words, the outcomes, what is not met and what one should know."""
    from vsf_drake.report.tuning.words import answer, first_line

    say(first_line(table))
    for sentence in answer(table):
        say(f"- {sentence}")
    if table["outcomes"]:
        grid = Table("outcome", "unit", "softest", "optimum", "stiffest", "matters", box=None, pad_edge=False)
        for row in table["outcomes"]:
            numbers = ("–" if row[key] is None else f"{row[key]:.4g}" for key in ("softest", "optimum", "stiffest"))
            grid.add_row(*map(Text, (row["label"], row["unit"], *numbers,
                                     {True: "yes", False: "NO", None: "–"}[row["matters"]])))
        console.print(grid)
    for check in table["checks"]:
        if check["met"] is False:
            warn(f"not met: {check['label']}. {check['sentence']}")
    for note in table["notes"]:
        say(f"  {note}")


def say(line: str) -> None:
    """A line as it is."""
    console.print(line, highlight=False, markup=False, soft_wrap=True)


def warn(line: str) -> None:
    """A line that stands out."""
    console.print(f"! {line}", style="bold yellow", highlight=False, markup=False, soft_wrap=True)
