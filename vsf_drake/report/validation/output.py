"""What a validation leaves on disk, all of it or nothing, and the page made again of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.run import NAMES, is_kept
from vsf_drake.analysis.validation.study import HELD_OUT, Study, StudyWalk
from vsf_drake.files import replaced, sha256
from vsf_drake.json_file import plain, write_json
from vsf_drake.report.chapter_files import (
    CHAPTERS,
    FIGURES,
    TABLES,
    check_report_folder,
    read_arrays,
    read_table,
    tidy_chapters,
    write_chapters,
    writing,
)
from vsf_drake.report.replay import write_replay
from vsf_drake.report.style import save_figure
from vsf_drake.report.validation.chapters import make_chapters
from vsf_drake.report.walk_figure import walk_figure
from vsf_drake.simulation.archive import result_folder
from vsf_drake.simulation.results import save_walk

# The walks of a study on disk: a folder each, and the replay of one.


WALKS, REPLAY = "walks", "replay.html"


def write_walks(study: Study, out: Path) -> None:
    """`walks/LABEL/` in the existing folder `out` for each walk: its saved result, metrics.json and figure.

    Raises:
        InputError: `out` cannot be written.
    """
    names = _folders(study)
    for walk in study.walks:
        metrics = {**walk.metrics, "role": walk.role, "doubts": list(walk.doubts), "notes": list(walk.result.notes)}
        folder = out / WALKS / names[walk.label]
        folder.mkdir(parents=True)
        save_walk(walk.result, folder)
        save_figure(walk_figure(walk.result, walk.recorded.prosthetic_plate, metrics), folder / "walk")
        write_json(folder / "metrics.json", metrics)


def write_replay_of(study: Study, out: Path) -> str:
    """Writes the replay of one walk, a held-out one of the middle condition where there is one; returns its label.

    Raises:
        InputError: `out` cannot be written.
    """
    walk = _shown(study)
    write_replay(walk.result, out / REPLAY, plate=walk.recorded.prosthetic_plate)
    return walk.label


def _folders(study: Study) -> dict[str, str]:
    """The folder's name of each walk by its label, in which folders may tell trials of one name apart."""
    names: dict[str, str] = {}
    for walk in study.walks:
        name = walk.label.replace("/", "_").replace("..", "_")
        while name in names.values():
            name += "_"
        names[walk.label] = name
    return names


def _shown(study: Study) -> StudyWalk:
    conditions = [*study.conditions().values()]
    middle = conditions[len(conditions) // 2]
    return next((walk for walk in middle if walk.role == HELD_OUT), middle[0])


VALIDATION, FORMAT = "validation", 1
TABLE, ARRAYS, PAGE, UNFINISHED = "validation.json", "validation.npz", "report.html", "unfinished"
_COMMAND, _FILES, _FOLDERS = "validate", (ARRAYS, PAGE, REPLAY), (FIGURES, TABLES, WALKS)
NO_FIRST_LINE = "These results do not say whether their data are measured or synthetic."


def check_validation_folder(out: Path) -> None:
    """Whether a validation can go to `out`: a new or empty folder, or that of an earlier validation.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_report_folder(out, VALIDATION, table=TABLE, files=_FILES, folders=_FOLDERS, known=_is_validation,
                        unfinished=lambda out: _holds_unfinished(out / UNFINISHED))


def write_validation(
    content: Mapping[str, Any], arrays: Mapping[str, np.ndarray], out: Path, *, study: Study | None = None
) -> dict[str, Any]:
    """Writes validation.json, validation.npz, report.html, and a file for every figure and table.

    Args:
        content: everything but arrays, plain values. arrays: by "section/name".
        study: what they were computed from; then also its walks, a folder each, and the replay of one.

    Returns:
        What validation.json holds.

    Raises:
        InputError: `out` cannot be written.
    """
    written: dict[str, Any] = plain({**content, "kind": VALIDATION, "format": FORMAT})
    with writing(out), result_folder(out, VALIDATION, stale=(*CHAPTERS, f"{WALKS}/*/result.*")) as folder:
        with replaced(folder / ARRAYS, "wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **{k.replace("/", "__", 1): v for k, v in arrays.items()})
        written["arrays_sha256"] = sha256(folder / ARRAYS)
        if study is not None:
            write_walks(study, folder)
            written["replay"] = write_replay_of(study, folder)
        _write_pages(written, arrays, folder, lenient=False)
        write_json(folder / TABLE, written, sort=False)
    return written


def read_validation(folder: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What `write_validation` left: content, and arrays by "section/name".

    Raises:
        InputError: a file is missing or damaged, or the two do not belong together.
    """
    content = read_table(Path(folder) / TABLE, lambda table: _is_validation(table) and isinstance(
        table.get("sections"), dict), kind=VALIDATION, command=_COMMAND)
    arrays = read_arrays(Path(folder) / ARRAYS, content, named=TABLE, command=_COMMAND)
    return content, {name.replace("__", "/", 1): values for name, values in arrays.items()}


def remake_report(folder: str | Path) -> list[str]:
    """Makes page, figures and tables again of what is saved in `folder`, without simulating.

    Returns:
        What could not be shown, in sentences; empty if everything was.

    Raises:
        InputError: see `read_validation`; or the folder cannot be written.
    """
    folder = Path(folder)
    content, arrays = read_validation(folder)
    notes = content["notes"] if isinstance(content.get("notes"), list) else []
    if content.get("format") != FORMAT:
        notes = [*notes, f"These results have format {content.get('format', 'unknown')}; this version writes format "
                         f"{FORMAT} and shows of them what it can."]
    if content.get("replay") and not (folder / REPLAY).is_file():
        content["replay"] = None
        notes = [*notes, f"{REPLAY} is not there any more; making it again needs the walks: `vsf-drake validate`."]
    content["notes"] = notes
    with writing(folder), result_folder(folder, VALIDATION, add=True) as temporary:
        files, missing = _write_pages(content, arrays, temporary, lenient=True)
    tidy_chapters(folder, files)
    return missing


def _is_validation(table: Mapping[str, Any]) -> bool:
    return table.get("kind") == VALIDATION


def _holds_unfinished(folder: Path) -> bool:
    """Whether this is a folder of finished sections, and of nothing else that would have to stay."""
    return folder.is_dir() and all(is_kept(path, NAMES) for path in folder.iterdir())


def _write_pages(
    content: Mapping[str, Any], arrays: Mapping[str, np.ndarray], folder: Path, *, lenient: bool
) -> tuple[set[Path], list[str]]:
    """Page, figures and tables into `folder`; their paths in it, and what is missing in sentences."""
    chapters = make_chapters(content, arrays, lenient=lenient)
    links = {"replay of one trial (opens in a browser, needs no network)": REPLAY} if content.get("replay") else {}
    return write_chapters(
        chapters, folder, PAGE, title=str(content.get("title") or "Validation"), links=links, lenient=lenient,
        first_line=str(content.get("first_line") or NO_FIRST_LINE), synthetic=bool(content.get("synthetic", True)))
