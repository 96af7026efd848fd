"""What a chapter of a report is made of: text, tables and figures, before they are written anywhere.

A chapter is a function of saved results: `chapter(table, arrays) -> Chapter`. It never simulates. The page shows
its pieces in order; every `Grid` also becomes a CSV file, every `Picture` a PNG and an SVG.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure


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
