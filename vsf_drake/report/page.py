"""What pages of results share: one HTML file with its style and figures inside, which needs no network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from vsf_drake.report.style import style

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1120px;margin:0 auto;padding:1.5rem}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.2rem;margin:2.2rem 0 .4rem;border-bottom:1px solid #ddd}
h3{font-size:1rem;margin:1.2rem 0 .3rem}table{border-collapse:collapse;margin:.5rem 0}
td,th{padding:.22rem .7rem .22rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #eee}
td.number{white-space:nowrap;text-align:right;font-variant-numeric:tabular-nums}
.mark{color:#fff;border-radius:3px;padding:0 .45rem;font-size:.85rem;white-space:nowrap}
.synthetic{background:#fff3cd;padding:.4rem .8rem;border-radius:4px}ul{margin:.3rem 0;padding-left:1.2rem}
img{max-width:100%;margin:.4rem 0}.error{color:#b3261e}summary{cursor:pointer}.quiet{color:#666}
@media print{details{display:block}}
"""


def document(title: str, parts: Iterable[str], *, more_style: str = "") -> str:
    """The whole page around its parts, which are HTML; `title` is plain text."""
    return (f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
            f'<meta name="viewport" content="width=device-width"><style>{_STYLE}{more_style}</style></head><body>\n'
            + "\n".join(parts) + "\n</body></html>\n")


def bullets(lines: Sequence[str]) -> str:
    """Plain lines as a list."""
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>"


def picture(figure: Figure, *, name: str = "") -> str:
    """The figure as SVG within the page; letters are drawn as paths, so that no font is needed."""
    stream = io.BytesIO()
    with style(), rc_context({"svg.fonttype": "path"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return embedded(stream.getvalue(), name=name)


def embedded(svg: bytes, *, name: str = "") -> str:
    """A drawing within the page; `name` is what it shows, in words."""
    data = base64.b64encode(svg).decode("ascii")
    return f'<img alt="{html.escape(name)}" src="data:image/svg+xml;base64,{data}">'


# What a chapter of a report is made of: text, tables and figures, before they are written anywhere.
#
# A chapter is a function of saved results: `chapter(table, arrays) -> Chapter`. It never simulates. The page shows
# its pieces in order; every `Grid` also becomes a CSV file, every `Picture` a PNG and an SVG.


@dataclass(frozen=True)
class Text:
    """A paragraph in plain text."""

    text: str


@dataclass(frozen=True)
class Missing:
    """What is not in the report, and why; set apart from the rest."""

    text: str


@dataclass(frozen=True)
class Heading:
    """A heading within the chapter."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    lines: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a grid.

    Attributes:
        key: of the row's value, with its unit at the end; the CSV's heading.
        heading: with its unit, as the page shows it.
        form: how a number is shown (the column is then set to the right), "" for text; a string shows as it is, None as
            an en dash.
        scale: what the page multiplies the value by (the CSV keeps it as it is).
    """

    key: str
    heading: str
    form: str = ""
    scale: float = 1.0

    def __post_init__(self) -> None:
        if self.form and "{" not in self.form:
            raise ValueError(f"{self.form!r} would show itself, not a number: write {{:{self.form}}}")


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A table.

    Attributes:
        name: stem of its CSV file, unlike that of any other grid of the report.
        caption: a sentence: what it shows, in which units.
        rows: values by column key.
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A figure.

    Attributes:
        name: stem of its files, unlike that of any other figure of the report.
        alt: what it shows, for who cannot see it: the finding in words and numbers, not "a plot".
        caption: what is drawn and how to read it.
    """

    name: str
    figure: Figure
    alt: str
    caption: str


Piece = Text | Missing | Heading | Bullets | Grid | Picture


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """One chapter: `name` (an HTML anchor), `title`, and its pieces in order."""

    name: str
    title: str
    pieces: tuple[Piece, ...]
