"""What `validate --against published` leaves on disk, and its page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.analysis.published import CANNOT_SAY, CONTRADICTED, REPRODUCED
from vsf_drake.analysis.validation.published_trends import FORMAT, TrendTable
from vsf_drake.files import plain, record
from vsf_drake.report.page import Chapter
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import Arrays


def published_page(saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of published_trends.json."""
    table = record(TrendTable, saved)
    rows = [{**vars(row), "verdict_said": row.verdict.replace("_", " "), "met": row.verdict != CONTRADICTED}
            for row in table.rows]
    facts = {"t": table, "groups": [(title, [row for row in rows if row["verdict"] == verdict]) for verdict, title in (
        (CONTRADICTED, "contradicted"), (REPRODUCED, "reproduced"), (CANNOT_SAY, "cannot say"))]}
    first = ("The walks are SYNTHETIC: nobody walked them, and their own motion is no adaptation of a person."
             if table.synthetic else "The walks are recorded; published effects are of other people and feet.")
    return {"title": "Against published effects of stiffness", "first_line": first, "synthetic": table.synthetic,
            "chapters": [Chapter(name="published", title="", template="validation/published.html.j2", facts=facts)]}


def _check(table: Mapping[str, Any], path: Path) -> None:
    record(TrendTable, table)


PUBLISHED = ResultsFolder(
    kind="comparison with published effects", command="validate --against published", table="published_trends.json",
    show=published_page, known=lambda table: table.get("format") == FORMAT, valid=_check)


def write_published(out: str | Path, table: TrendTable) -> None:
    """Writes the table, its page and CSV files; see `ResultsFolder.write`."""
    PUBLISHED.write(out, plain(table))
