"""Chapters on disk: a page, a file for every figure and every table; and what an earlier report left, removed."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import errno
import html
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError, raise_if_interrupted
from vsf_drake.files import csv_cells, replaced, sha256
from vsf_drake.json_file import read_json
from vsf_drake.npz_file import read_npz
from vsf_drake.report.page import (
    Bullets,
    Chapter,
    Column,
    Grid,
    Heading,
    Missing,
    Picture,
    Piece,
    Text,
    bullets,
    document,
    embedded,
    picture,
)
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.archive import check_target

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


# A page of chapters: one HTML file that needs no network, reads on a telephone and prints.


_STYLE = """
img,tr{break-inside:avoid}h2,h3,figcaption{break-after:avoid}figure{margin:1rem 0}
figcaption{color:#555;font-size:.88rem}.unmet td{background:#fdecea;font-weight:600}
.wide{overflow-x:auto;margin:.2rem 0 .6rem}.wide table{font-size:.88rem}th.number{text-align:right}
thead th{border-bottom:2px solid #bbb}.missing{border-left:4px solid #b26a00;padding:.2rem .8rem;background:#fbf4e8}
.alarm{background:#b3261e;color:#fff;font-weight:600;padding:.5rem .9rem;border-radius:4px}
nav a{margin-right:1rem;white-space:nowrap;display:inline-block}h1,h2,h3,p,li,figcaption{overflow-wrap:anywhere}
@media(max-width:600px){body{padding:.8rem;font-size:14px}.wide img{max-width:none;width:720px}}
@media print{nav{display:none}body{max-width:none;padding:0;font-size:9pt}.wide{overflow-x:visible}
.wide table{font-size:var(--print)}.wide td,.wide th{padding-right:.8em}figcaption{font-size:8.5pt}}
"""
_PAPER_PT, _LETTER_EM, _BETWEEN_EM, _LARGEST_PT = 530.0, 0.62, 0.8, 7.5
"""Width of A4 or letter within a browser's margins, of a bold digit, between columns; the largest size of a table."""


def chapter_page(
    title: str, first_line: str, chapters: Sequence[Chapter], *, synthetic: bool, links: Mapping[str, str],
    drawings: Mapping[str, bytes] | None = None, alarm: str = ""
) -> str:
    """The page as HTML.

    Args:
        first_line: what is measured and what is not, in plain text; the first thing that one reads.
        alarm: why nothing on the page may be taken for a result; red, above everything else.
        links: file beside the page by what it is called.
        drawings: SVG of pictures that are drawn already, by their name.
    """
    mark = ' class="synthetic"' if synthetic else ""
    parts = [f'<p class="alarm" role="alert">{html.escape(alarm)}</p>'] if alarm else []
    parts += [f"<p{mark}>{html.escape(first_line)}</p>", f"<h1>{html.escape(title)}</h1>"]
    if links:
        beside = ", ".join(f'<a href="{html.escape(file)}">{html.escape(name)}</a>' for name, file in links.items())
        parts.append(f"<p>Beside this page: {beside}.</p>")
    anchors = "".join(f'<a href="#{chapter.name}">{html.escape(chapter.title)}</a> ' for chapter in chapters)
    parts.append(f"<nav>{anchors}</nav>")
    for chapter in chapters:
        parts.append(f'<section id="{chapter.name}"><h2>{html.escape(chapter.title)}</h2>')
        parts += [piece_html(piece, drawings) for piece in chapter.pieces]
        parts.append("</section>")
    return document(title, parts, more_style=_STYLE)


def cell(column: Column, value: Any) -> str:
    """A value as the page shows it; an unknown one as an en dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str) or not column.form:
        return str(value)
    return column.form.format(value * column.scale)


def piece_html(piece: Piece, drawings: Mapping[str, bytes] | None = None) -> str:
    """A piece as the page shows it; `drawings` as in `chapter_page`."""
    match piece:
        case Text(text):
            return f"<p>{html.escape(text)}</p>"
        case Missing(text):
            return f'<p class="missing">{html.escape(text)}</p>'
        case Heading(text):
            return f"<h3>{html.escape(text)}</h3>"
        case Bullets(lines):
            return bullets(lines)
        case Grid():
            return _grid(piece)
        case Picture():
            drawn = (drawings or {}).get(piece.name)
            image = picture(piece.figure, name=piece.alt) if drawn is None else embedded(drawn, name=piece.alt)
            return (f'<figure><div class="wide" tabindex="0">{image}</div>'
                    f"<figcaption>{html.escape(piece.caption)}</figcaption></figure>")


def _grid(grid: Grid) -> str:
    marks = [' class="number"' if column.form else "" for column in grid.columns]
    head = "".join(f'<th scope="col"{mark}>{html.escape(column.heading)}</th>'
                   for column, mark in zip(grid.columns, marks, strict=True))
    rows = "".join(_row(grid, row, marks) for row in grid.rows)
    return (f'<figure><figcaption>{html.escape(grid.caption)}</figcaption>'
            f'<div class="wide" tabindex="0" style="--print:{_print_size_pt(grid):.1f}pt"><table>'
            f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></figure>")


def _print_size_pt(grid: Grid) -> float:
    """The size at which the table is as wide as the paper, words unbroken, or the largest."""
    letters = sum(max(len(word) for text in (column.heading, *(cell(column, row.get(column.key)) for row in grid.rows))
                      for word in (text.split() or [""])) for column in grid.columns)
    return min(_LARGEST_PT, _PAPER_PT / max(_LETTER_EM * letters + _BETWEEN_EM * len(grid.columns), 1.0))


def _row(grid: Grid, row: Mapping[str, Any], marks: Sequence[str]) -> str:
    cells = "".join(f"<td{mark}>{html.escape(cell(column, row.get(column.key)))}</td>"
                    for column, mark in zip(grid.columns, marks, strict=True))
    return f'<tr class="unmet">{cells}</tr>' if row.get("met") is False else f"<tr>{cells}</tr>"


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
