"""What a validation, and a comparison with published effects, leave on disk, all of it or nothing;
their pages."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from vsf_drake.base.files import plain, record, write_json, write_text
from vsf_drake.base.sentences import say
from vsf_drake.optimal_control.outcomes import MEASURES, SIGNS_OF
from vsf_drake.report.figures import walk_figure
from vsf_drake.report.page import Chapter
from vsf_drake.report.replay import walk_replay
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import Arrays, save_figure
from vsf_drake.report.validation.chapters import Content, make_chapters
from vsf_drake.simulation.results import save_walk
from vsf_drake.validation.moved_section import moved_walks
from vsf_drake.validation.published_trends import FORMAT as TREND_FORMAT
from vsf_drake.validation.published_trends import TrendTable
from vsf_drake.validation.run import NAMES, Validation, is_kept, tables
from vsf_drake.validation.study import Study, StudyWalk
from vsf_drake.walks.published import CANNOT_SAY, CONTRADICTED, REPRODUCED

FORMAT = 2
WALKS = "walks"
REPLAY = "replay.html"
UNFINISHED = "unfinished"


def _show(table: Content, arrays: Arrays, *, folder: Path, lenient: bool) -> dict[str, Any]:
    """What `page.chapter_page` is to be given; notes of what this version finds wrong come with
    it."""
    notes = list(table["notes"]) if isinstance(table.get("notes"), list) else []
    if table.get("format") != FORMAT:
        notes += say("validation", "other_format", found=table.get("format", "unknown"), own=FORMAT)
    replayed = bool(table.get("replay")) and (folder / REPLAY).is_file()
    if table.get("replay") and not replayed:
        notes += say("validation", "no_replay", file=REPLAY)
    content = {**table, "notes": notes, "replay_file": REPLAY if replayed else None}
    return {
        "chapters": make_chapters(content, arrays, tables(), lenient=lenient),
        "alarm": say("validation", "unfinished", to_come=table["to_come"])[0]
        if table.get("to_come")
        else "",
        "title": str(table.get("title") or "Validation"),
        "first_line": str(table.get("first_line") or say("validation", "no_first_line")[0]),
        "synthetic": bool(table.get("synthetic", True)),
    }


def _holds_unfinished(out: Path) -> bool:
    """Whether it has a folder of finished sections, and of nothing else that would have to stay."""
    folder = out / UNFINISHED
    return folder.is_dir() and all(is_kept(path, NAMES) for path in folder.iterdir())


def _check(table: Content, path: Path) -> None:
    if not isinstance(table.get("sections"), dict):
        raise ValueError("it has no sections")


VALIDATION = ResultsFolder(
    kind="validation",
    command="validate",
    table="validation.json",
    arrays="validation.npz",
    show=_show,
    valid=_check,
    known=lambda table: table.get("kind") == "validation",
    unfinished=_holds_unfinished,
    layered=True,
    names=(REPLAY, f"{WALKS}/*"),
    stale=(f"{WALKS}/*/result.*",),
)


def write_validation(
    content: Validation, arrays: Arrays, out: Path, *, study: Study | None = None
) -> dict[str, Any]:
    """Writes a validation, and arrays by "section/name"; see `ResultsFolder.write`. With the study
    that they were computed from also its walks, a folder each, and the replay of one."""
    more = {} if study is None else {"more": partial(_write_walks, study)}
    return VALIDATION.write(
        out, {**plain(content), "kind": "validation", "format": FORMAT}, arrays, **more
    )


def write_unfinished(
    content: Validation, arrays: Arrays, out: Path, *, study: Study, to_come: Sequence[str]
) -> Path:
    """Writes the pages of a validation of which sections are still to come, marked as such, and the
    replay; returns the path of the story."""
    return VALIDATION.write_unfinished(
        out,
        {
            **plain(content),
            "format": FORMAT,
            "to_come": [name.replace("_", " ") for name in to_come],
        },
        arrays,
        more=partial(_write_replay, study),
    )


def _write_walks(study: Study, folder: Path, table: dict[str, Any]) -> None:
    """Result, metrics and figure of each walk, and the replay of the study's shown one."""
    taken: list[str] = []
    for walk in study.walks:
        # which folders may tell trials of one name apart
        name = walk.label.replace("/", "_").replace("..", "_")
        while name in taken:
            name += "_"
        taken.append(name)
        own = folder / WALKS / name
        own.mkdir(parents=True)
        save_walk(walk.result, own)
        save_figure(
            walk_figure(
                walk.result, walk.recorded.plate, walk.metrics, setting=walk.recorded.setting
            ),
            own / "walk",
            svg=False,
        )
        write_json(
            own / "metrics.json",
            {
                **plain(walk.metrics),
                "role": walk.role,
                "warnings": walk.warnings,
                "notes": walk.result.notes,
            },
        )
    _write_replay(study, folder, table)


def _write_replay(study: Study, folder: Path, table: dict[str, Any]) -> None:
    """Of the study's shown walk, at each setting that it was walked at; made once for a page that
    grows."""
    write_text(folder / REPLAY, _replay(study.shown))
    table["replay"] = study.shown.label


@lru_cache(maxsize=1)
def _replay(walk: StudyWalk) -> str:
    return walk_replay(
        walk.result,
        plate=walk.recorded.plate,
        intact_plate=walk.recorded.intact_plate,
        settings=moved_walks(walk),
        frame_rate_hz=50.0,
    )


# The model held against published effects.


def _show_published(
    saved: Content, arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    table = record(TrendTable, saved)
    facts = {
        "t": table,
        "measures": [
            {
                **vars(one),
                "met": one.verdict != CONTRADICTED,
                "by": ", ".join(one.by),
                "verdict": one.verdict.replace("_", " "),
            }
            for one in table.measures
        ],
        "rows": [
            {**vars(row), "met": row.verdict != CONTRADICTED or bool(row.aside)}
            for row in table.rows
        ],
        "of": len(MEASURES),
        "signs_of": SIGNS_OF,
        "verdicts": (CONTRADICTED, REPRODUCED, CANNOT_SAY),
    }
    return {
        "title": "Against published effects of stiffness",
        "synthetic": table.synthetic,
        "first_line": say("validation", "against_published", synthetic=table.synthetic)[0],
        "chapters": [
            Chapter(
                name="published", title="", template="validation/published.html.j2", facts=facts
            )
        ],
    }


def _check_published(table: Content, path: Path) -> None:
    record(TrendTable, table)


PUBLISHED = ResultsFolder(
    kind="comparison with published effects",
    command="validate --against published",
    table="published_trends.json",
    show=_show_published,
    known=lambda table: table.get("format") == TREND_FORMAT,
    valid=_check_published,
)


def write_published(out: str | Path, table: TrendTable) -> None:
    """Writes the table, its page and CSV files; see `ResultsFolder.write`."""
    PUBLISHED.write(out, plain(table))
