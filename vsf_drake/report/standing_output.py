"""What standing leaves on disk: numbers and a figure. All of it or nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vsf_drake.analysis.sweep_table import standing_table
from vsf_drake.json_file import write_json
from vsf_drake.report.standing_figure import standing_figure
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.results import result_folder
from vsf_drake.simulation.standing_result import Standing


def write_standing(standing: Standing, out: str | Path) -> dict[str, Any]:
    """Writes standing.json, standing.png and standing.svg to the folder `out`; returns the table.

    Raises:
        InputError: `out` cannot be written.
    """
    table = standing_table(standing)
    with result_folder(out, "standing") as folder:
        save_figure(standing_figure(table), folder / "standing")
        write_json(folder / "standing.json", table)
    return table
