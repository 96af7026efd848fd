"""What a tuning leaves on disk, all of it or nothing, and the page made again of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import FORMAT, check_tuning_table
from vsf_drake.errors import InputError
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
from vsf_drake.report.tuning.chapters import tuning_chapters
from vsf_drake.report.tuning.words import alarm_of, first_line, title_of
from vsf_drake.simulation.archive import result_folder

TUNING = "tuning"
TABLE, ARRAYS, PAGE = "tuning.json", "tuning.npz", "report.html"
_BEGINS = FORMAT.rpartition(" ")[0]


def check_tuning_folder(out: Path) -> None:
    """Whether a tuning can go to `out`: a new or empty folder, or that of an earlier tuning.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_report_folder(out, TUNING, table=TABLE, files=(ARRAYS, PAGE), folders=(FIGURES, TABLES), known=_is_tuning)


def write_tuning(
    folder: str | Path, table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """Writes tuning.json, tuning.npz, report.html, and a file for every figure and table.

    Args:
        table: see `common.KEYS`; besides, where known, `recorded_mm`, where the fulcrum stood in each trial.
        arrays: any of level 1: `sweep_mm` (s,), `sweep_cost_trials` (s, trials), and for trial K from 0 `trial_K_time`
            (n,) s, `trial_K_softest`, `trial_K_optimum`, `trial_K_stiffest`, `trial_K_recorded` (n, 3) N in W, or of
            one trial `grf_time`, `grf_softest` and so on; of level 2: `phase` (n,) 0 to 1, `names` (8,),
            `q`, `q_recorded` (n, 8) rad and m, `torque`, `torque_recorded` (n, 5) N m, `grf_prosthetic`, `grf_intact`
            (n, 2) N (forward, up), and these two with `_recorded`, `_resimulated_prescribed`, `_resimulated_feedback`.
            Others are kept, and not shown.

    Returns:
        What tuning.json holds.

    Raises:
        InputError: the folder cannot be written.
        ValueError: the table lacks a key.
    """
    out = Path(folder)
    check_tuning_table(table)
    written: dict[str, Any] = plain(dict(table))
    with writing(out), result_folder(out, TUNING, stale=CHAPTERS) as temporary:
        with replaced(temporary / ARRAYS, "wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **{name: np.asarray(a) for name, a in arrays.items()})
        written["arrays_sha256"] = sha256(temporary / ARRAYS)
        _write_page(written, arrays, temporary, lenient=False)
        write_json(temporary / TABLE, written, sort=False)
    return written


def read_tuning(folder: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Table and arrays that `write_tuning` left in `folder`.

    Raises:
        InputError: a file is missing or damaged, or the two do not belong together.
    """
    path = Path(folder) / TABLE
    table = read_table(path, _is_tuning, kind=TUNING, command="tune")
    try:
        check_tuning_table(table)
    except ValueError as error:
        raise InputError(f"cannot be used: {error}", file=path, right="Run `vsf-drake tune` again") from None
    return table, read_arrays(Path(folder) / ARRAYS, table, named=TABLE, command="tune")


def remake_tuning(folder: str | Path) -> list[str]:
    """Makes page, figures and tables again of what is saved in `folder`; what could not be shown, in sentences.

    Raises:
        InputError: see `read_tuning`; or the folder cannot be written.
    """
    out = Path(folder)
    table, arrays = read_tuning(out)
    with writing(out), result_folder(out, TUNING, add=True) as temporary:
        files, missing = _write_page(table, arrays, temporary, lenient=True)
    tidy_chapters(out, files)
    return missing


def _is_tuning(table: Mapping[str, Any]) -> bool:
    return str(table.get("format")).startswith(_BEGINS)


def _write_page(
    table: Mapping[str, Any], arrays: Mapping[str, np.ndarray], folder: Path, *, lenient: bool
) -> tuple[set[Path], list[str]]:
    chapters = tuning_chapters(table, arrays, lenient=lenient)
    return write_chapters(chapters, folder, PAGE, title=title_of(table), first_line=first_line(table), links={},
                          synthetic=bool(table["synthetic"]), lenient=lenient, alarm=alarm_of(table))
