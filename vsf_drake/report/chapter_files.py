"""Chapters on disk: a page, a file for every figure and every table; and what an earlier report left, removed."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256
from vsf_drake.json_file import read_json
from vsf_drake.npz_file import read_npz
from vsf_drake.report.page import FIGURES, TABLES, Chapter, chapter_page
from vsf_drake.simulation.archive import check_target

_KINDS = (".csv", ".png", ".svg")
CHAPTERS = tuple(f"{folder}/*{kind}" for folder in (FIGURES, TABLES) for kind in _KINDS)
"""Patterns of the names of all figures and tables."""


def write_chapters(
    chapters: Sequence[Chapter], folder: Path, page: str, *, title: str, first_line: str, synthetic: bool,
    links: Mapping[str, str], lenient: bool, alarm: str = ""
) -> tuple[set[Path], list[str]]:
    """Page, figures and tables into the existing `folder`; for `page` the name of a file, for others `chapter_page`.

    Returns:
        Paths of figures and tables within `folder`, and what is missing in sentences.
    """
    text, shown = chapter_page(chapters, title=title, first_line=first_line, synthetic=synthetic, links=links,
                               alarm=alarm, folder=folder, lenient=lenient)
    with replaced(folder / page) as stream:
        stream.write(text)
    return (set().union(*(chapter.files for chapter in shown)),
            [f"{chapter.title}: {sentence}" for chapter in shown for sentence in chapter.missing])


def tidy_chapters(out: Path, files: set[Path]) -> None:
    """Removes figures and tables of an earlier report in `out` that are not among `files`, paths within it.

    Raises:
        InputError: one cannot be removed.
    """
    with writing(out):
        for path in (path for name in (FIGURES, TABLES) for path in (out / name).iterdir()):
            if path.suffix in _KINDS and path.relative_to(out) not in files:
                path.unlink()


@contextlib.contextmanager
def writing(out: Path) -> Iterator[None]:
    """Faults of the file system as InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out) from None


# A folder of results with a page: whether it may be written to, and its table and arrays read back.


Known = Callable[[Mapping[str, Any]], bool]
"""Whether a JSON table is one of these results."""


def check_report_folder(
    out: Path, kind: str, *, table: str, files: Iterable[str], folders: Iterable[str], known: Known,
    unfinished: Callable[[Path], bool] = lambda out: False
) -> None:
    """Whether results of this `kind` can go to `out`: a new or empty folder, or that of earlier ones.

    Args:
        table: name of their JSON file. files, folders: what else they write.
        unfinished: whether a folder without a table is that of an interrupted run.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_target(out, kind, lambda out: holds(out / table, known) or unfinished(out),
                 names=(table, *files, *(f"{folder}/*" for folder in folders)))
    if out.is_dir() and not os.access(out, os.W_OK | os.X_OK):
        raise InputError(f"cannot be written ({os.strerror(errno.EACCES)})", file=out, right="Choose another folder")


def holds(path: Path, known: Known) -> bool:
    """Whether there is such a table, be it damaged."""
    try:
        return known(read_json(path))
    except InputError:
        return path.is_file()


def read_table(path: Path, known: Known, *, kind: str, command: str) -> dict[str, Any]:
    """The JSON table of a `kind` of results, which `vsf-drake COMMAND --out` wrote.

    Raises:
        InputError: it is missing, damaged, or another table.
    """
    right = f"Name the folder that `vsf-drake {command} --out` wrote"
    table = read_json(path, right=right, damaged=f"Run `vsf-drake {command}` again")
    if not known(table):
        raise InputError(f"is not the table of a {kind}", file=path, right=right)
    return table


def read_arrays(path: Path, table: Mapping[str, Any], *, named: str, command: str) -> dict[str, np.ndarray]:
    """The arrays that belong to a table: those whose SHA-256 it has; `named` is its file.

    Raises:
        InputError: the file is missing or damaged, or another than the table describes.
    """
    right = f"Run `vsf-drake {command}` again"
    if sha256(path) != table.get("arrays_sha256"):
        raise InputError(f"is not the file that {named} describes (its SHA-256 differs)", file=path, right=right)
    return read_npz(path, right=right)
