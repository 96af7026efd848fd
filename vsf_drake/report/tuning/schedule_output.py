"""What a schedule leaves on disk, all of it or nothing, and the page made again of it."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.analysis.tuning.schedule import POLICY_FORMAT, schedule_of
from vsf_drake.analysis.tuning.task_list import DESCRIPTORS
from vsf_drake.errors import InputError
from vsf_drake.files import csv_cells, replaced
from vsf_drake.json_file import plain, write_json
from vsf_drake.report.chapter_files import (
    CHAPTERS,
    FIGURES,
    TABLES,
    check_report_folder,
    read_table,
    tidy_chapters,
    write_chapters,
    writing,
)
from vsf_drake.report.tuning.chapters import (
    schedule_alarm,
    schedule_chapters,
    schedule_first_line,
    schedule_title,
)
from vsf_drake.simulation.archive import result_folder

SCHEDULE = "schedule"
TABLE, CSV, PAGE = "policy.json", "policy.csv", "report.html"
KEYS = ("cost_name", "cost_label", "cost_unit", "level", "synthetic", "notes", "wall_s", "provenance")
"""What the table has besides the policy itself (`analysis.tuning.schedule.policy_table`)."""
_BEGINS = POLICY_FORMAT.rpartition(" ")[0]
_COLUMNS = ("label", *DESCRIPTORS, "fulcrum_mm", "exact_mm", "interval_low_mm", "interval_high_mm", "cost",
            "cost_common", "matters", "optimal", "status")


def check_schedule_folder(out: Path) -> None:
    """Whether a schedule can go to `out`: a new or empty folder, or that of an earlier schedule.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_report_folder(out, SCHEDULE, table=TABLE, files=(CSV, PAGE), folders=(FIGURES, TABLES), known=_is_schedule)


def write_schedule(folder: str | Path, table: Mapping[str, Any]) -> dict[str, Any]:
    """Writes policy.json, policy.csv, report.html, and a file for every figure and table.

    Args:
        table: of `policy_table`, with KEYS, and for every task `trials` (labels), `sweep` (lists of `fulcrum_mm` and
            `cost`), and if known `rest`, `rest_common`: its cost at its own setting and at the one for all, without
            terms that only hold to the recording.

    Returns:
        What policy.json holds.

    Raises:
        InputError: the folder cannot be written.
        ValueError: the table lacks a key.
    """
    missing = [key for key in KEYS if key not in table]
    if missing:
        raise ValueError(f"the table of a schedule lacks {', '.join(missing)}")
    out, written = Path(folder), plain(dict(table))
    with writing(out), result_folder(out, SCHEDULE, stale=CHAPTERS) as temporary:
        _write_page(written, temporary, lenient=False)
        with replaced(temporary / CSV) as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(_COLUMNS)
            writer.writerows(_csv_row(row) for row in written["tasks"])
        write_json(temporary / TABLE, written, sort=False)
    return dict(written)


def read_schedule(folder: str | Path) -> dict[str, Any]:
    """The table that `write_schedule` left in `folder`; see `analysis.tuning.schedule.load_schedule` for looking up.

    Raises:
        InputError: it is missing or damaged.
    """
    path = Path(folder) / TABLE
    table = read_table(path, _is_schedule, kind=SCHEDULE, command=SCHEDULE)
    schedule_of(table, file=path)
    return table


def remake_schedule(folder: str | Path) -> list[str]:
    """Makes page, figures and tables again of what is saved in `folder`; what could not be shown, in sentences.

    Raises:
        InputError: see `read_schedule`; or the folder cannot be written.
    """
    out = Path(folder)
    table = read_schedule(out)
    with writing(out), result_folder(out, SCHEDULE, add=True) as temporary:
        try:
            files, missing = _write_page(table, temporary, lenient=True)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"is damaged ({type(error).__name__}: {error})", file=out / TABLE,
                             right=f"Run `vsf-drake {SCHEDULE}` again") from None
    tidy_chapters(out, files)
    return missing


def _is_schedule(table: Mapping[str, Any]) -> bool:
    return str(table.get("format")).startswith(_BEGINS)


def _csv_row(row: Mapping[str, Any]) -> list[Any]:
    low, high = row["interval_mm"] or (None, None)
    values = {**row, "interval_low_mm": low, "interval_high_mm": high}
    return csv_cells(values[name] for name in _COLUMNS)


def _write_page(table: Mapping[str, Any], folder: Path, *, lenient: bool) -> tuple[set[Path], list[str]]:
    return write_chapters(
        schedule_chapters(table, lenient=lenient), folder, PAGE, title=schedule_title(table), links={},
        first_line=schedule_first_line(table), synthetic=bool(table["synthetic"]), lenient=lenient,
        alarm=schedule_alarm(table))
