"""Chapters on disk: a page, a file for every figure and every table; and what an earlier report left, removed."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from vsf_drake.errors import InputError, raise_if_interrupted
from vsf_drake.files import csv_cells, replaced
from vsf_drake.report.chapter_page import chapter_page, piece_html
from vsf_drake.report.pieces import Chapter, Grid, Missing, Picture, Piece
from vsf_drake.report.style import save_figure

FIGURES, TABLES = "figures", "tables"
_KINDS = (".csv", ".png", ".svg")
CHAPTERS = tuple(f"{folder}/*{kind}" for folder in (FIGURES, TABLES) for kind in _KINDS)
"""Patterns of the names of all figures and tables."""


def write_chapters(
    chapters: Sequence[Chapter], folder: Path, page: str, *, title: str, first_line: str, synthetic: bool,
    links: Mapping[str, str], lenient: bool, alarm: str = ""
) -> tuple[set[Path], list[str]]:
    """Page, figures and tables into the existing `folder`.

    Args:
        page: name of the page's file. title, first_line, synthetic, links, alarm: see `chapter_page`.
        lenient: whether what cannot be shown is named in its place instead of raising, as for results that another
            version wrote or somebody edited.

    Returns:
        Paths of figures and tables within `folder`, and what is missing in sentences.
    """
    for name in (FIGURES, TABLES):
        (folder / name).mkdir()
    files: set[Path] = set()
    shown = [dataclasses.replace(chapter, pieces=tuple(
        _written(piece, folder, files, lenient=lenient) for piece in chapter.pieces)) for chapter in chapters]
    drawings = {path.stem: (folder / path).read_bytes() for path in files if path.suffix == ".svg"}
    with replaced(folder / page) as stream:
        stream.write(chapter_page(title, first_line, shown, synthetic=synthetic, links=links, drawings=drawings,
                                  alarm=alarm))
    return files, [f"{chapter.title}: {piece.text}" for chapter in shown for piece in chapter.pieces
                   if isinstance(piece, Missing)]


def tidy_chapters(out: Path, files: set[Path]) -> None:
    """Removes figures and tables of an earlier report in `out` that are not among `files`, paths within it.

    Raises:
        InputError: one cannot be removed.
    """
    with writing(out):
        for path in (path for name in (FIGURES, TABLES) for path in (out / name).iterdir()):
            if path.suffix in _KINDS and path.relative_to(out) not in files:
                path.unlink()


def unshown(what: str, error: Exception) -> str:
    """Says that this version cannot show something of saved results."""
    return f"This version cannot show {what} ({type(error).__name__}: {error})."


def made_chapter(name: str, title: str, make: Callable[[], Chapter], lenient: bool) -> Chapter:
    """What `make` makes; if `lenient` and it cannot, a chapter of that name that says so."""
    try:
        return make()
    except Exception as error:  # whatever another version or an editor left there
        raise_if_interrupted()
        if not lenient:
            raise
        return absent_chapter(name, title, unshown("what the results hold of it", error))


def absent_chapter(name: str, title: str, why: str) -> Chapter:
    """A chapter that only says why it is empty."""
    return Chapter(name=name, title=title, pieces=(Missing(why),))


@contextlib.contextmanager
def writing(out: Path) -> Iterator[None]:
    """Faults of the file system as InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out) from None


def _written(piece: Piece, folder: Path, files: set[Path], *, lenient: bool) -> Piece:
    """The piece, its files written and noted; if `lenient` and it cannot be shown, what says so in its place."""
    own: tuple[Path, ...]
    try:
        if isinstance(piece, Picture):
            own = save_figure(piece.figure, folder / FIGURES / piece.name, letters="path")
        else:
            piece_html(piece)
            own = (_write_csv(piece, folder / TABLES / f"{piece.name}.csv"),) if isinstance(piece, Grid) else ()
    except (InputError, OSError):
        raise
    except Exception as error:  # whatever another version or an editor left there
        raise_if_interrupted()
        if not lenient:
            raise
        what = {Grid: "the table ", Picture: "the figure "}.get(type(piece), "a text")
        return Missing(unshown(f"{what}{getattr(piece, 'name', '')}", error))
    files |= {path.relative_to(folder) for path in own}
    return piece


def _write_csv(grid: Grid, path: Path) -> Path:
    """Values as they are, in full precision; nothing for what is unknown."""
    with replaced(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.key for column in grid.columns])
        writer.writerows(csv_cells(row.get(column.key) for column in grid.columns) for row in grid.rows)
    return path
