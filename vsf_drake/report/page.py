"""Pages of results: Jinja2 templates in `report/templates`, filled with numbers and decisions.

`render` fills any template. A page of chapters has a template for each `Chapter`, and leaves a CSV
file for every table and a PNG, on request an SVG too, for every figure that its templates show.
"""

from __future__ import annotations

import base64
import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from vsf_drake.base.errors import InputError, raise_if_interrupted
from vsf_drake.base.files import csv_cells, replaced
from vsf_drake.model.setting import setting_column
from vsf_drake.report.style import png, save_figure
from vsf_drake.walks import quantities

# folders of the files of chapters
FIGURES = "figures"
TABLES = "tables"
UNKNOWN = "–"
_PAPER_PT, _LETTER_EM, _BETWEEN_EM, _LARGEST_PT = 530.0, 0.62, 0.8, 7.5
"""Width of A4 or letter within a browser's margins, of a bold digit, between columns; the largest
size of a table."""
_SENTENCES = re.compile(r"<(p|li)[ >].*?</\1>", re.DOTALL)  # what templates may break into lines
_NUMBER = r"[+-]?[0-9.]+(e[+-]?[0-9]+)?"


def render(template: str, /, **context: Any) -> Markup:
    """The template filled in; texts are escaped where they are shown, and a name that is not given
    is an error.

    Besides Jinja2's own, templates have the filters `number`, `column`, `shown`, `said`, `listed`,
    `joint`, `span`, `data_uri` of this module, the macros of macros.html.j2 and the module
    `quantities`.
    """
    text = _PAGES.get_template(template).render(context)
    return Markup(_SENTENCES.sub(lambda match: " ".join(match[0].split()), text))


def number(value: Any, form: str = "{}", factor: float = 1.0) -> str:
    """`value` times `factor` in this format, a zero without sign; a text as it is, None as a
    dash."""
    if value is None or isinstance(value, (str, bool)):
        return said(value)
    text = form.format(value if factor == 1.0 else factor * value)
    return text.lstrip("+-") if not text.strip("+-0.") else text


def said(value: Any, none: str = UNKNOWN) -> str:
    """Any plain value, such as that of an option, in words; `none` for None and for what is
    empty."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {said(item, none)}" for name, item in value.items()) or none
    if isinstance(value, (list, tuple)):
        return ", ".join(said(item, none) for item in value) or none
    if isinstance(value, bool):
        return "yes" if value else "no"
    return none if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def listed(names: Iterable[Any], last: str = " and ") -> str:
    """`names` with commas between them, and `last` before the last one."""
    *first, end = [str(name) for name in names] or [UNKNOWN]
    return f"{', '.join(first)}{last}{end}" if first else end


def joint(loop: Any, between: str = ", ", last: str = " and ") -> str:
    """What stands before an item of a `for` of a template, so that the items are listed."""
    return "" if loop.first else last if loop.last else between


def span(values: Iterable[float | None], form: str) -> str:
    """From the least to the largest of the values that are known, once if both look the same."""
    known = [value for value in values if value is not None]
    low = form.format(min(known))
    high = form.format(max(known))
    return low if low == high else f"{low} to {high}"


def data_uri(figure: Figure | bytes) -> str:
    """A figure, or its PNG, as an image within the page."""
    figure = png(figure) if isinstance(figure, Figure) else figure
    return f"data:image/png;base64,{base64.b64encode(figure).decode('ascii')}"


@dataclass(frozen=True)
class Column:
    """A column of a table; the CSV has its values as they are, and None and text show as
    themselves."""

    key: str  # of the row's value, with its unit at the end; the CSV's heading
    heading: str  # with its unit, as the page shows it
    form: str = ""  # how a number is shown (the column is then set to the right), "" for text
    scale: float = 1.0  # what the page multiplies the value by

    def __post_init__(self) -> None:
        if self.form and "{" not in self.form:
            raise ValueError(
                f"{self.form!r} would show itself, not a number: write {{:{self.form}}}"
            )


def column(name: str, heading: str = "", form: str = "") -> tuple[str, str, str, float]:
    """As `Column` has it, a number of a compared walk; what is not given is as `quantities` has
    it."""
    own = quantities.quantity(name)
    return name, heading or own.heading, form or own.form, own.scale


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """A chapter of a page, made of saved results.

    Its template shows what it is given with `{% call table("errors", rows, (("error_n", "error
    (N)", "{:.1f}"), ...)) %}caption{% endcall %}`: the stem of the table's CSV file, its rows,
    records or mappings (one whose `met` is False is marked), and each column as `Column` has it
    or, of a number of a compared walk, as the filter `column` makes it of its name,
    `{% call figure("force", title="the finding", alt="it with its numbers") %}caption{% endcall %}`
    and `{% call missing() %}what is not there, and why{% endcall %}`. It opens with the finding, a
    figure and at most a small table; the rest stands in `details` of macros.html.j2.
    """

    name: str  # HTML anchor
    title: str  # "" for what stands above the list of chapters, on the first screen
    template: str = ""  # "" for none
    facts: Mapping[str, Any] = field(default_factory=dict)
    """numbers and decisions, as the template calls them"""
    figures: Mapping[str, Figure] = field(default_factory=dict)
    """by the stem of their files, their own in the page"""
    missing: Sequence[str] = ()  # what is not there, and why, above the rest


def made_chapter(name: str, title: str, make: Callable[[], Chapter], lenient: bool) -> Chapter:
    """What `make` makes; if `lenient` and it cannot, a chapter of that name that says so."""
    try:
        return make()
    except Exception as error:  # whatever another version or an editor left there
        raise_if_interrupted()
        if not lenient:
            raise
        return Chapter(
            name=name, title=title, missing=(_unshown("what the results hold of it", error),)
        )


class ShownChapter:
    """A chapter in HTML, the paths of its figures and tables within `folder`, and what is not
    there, in sentences."""

    def __init__(self, chapter: Chapter, folder: Path | None, *, lenient: bool, svg: bool) -> None:
        self.name = chapter.name
        self.title = chapter.title
        self.files = set[Path]()
        self.missing = list[str]()
        self._chapter = chapter
        self._folder = folder
        self._lenient = lenient
        self._svg = svg
        above = Markup("").join(map(self._missing, chapter.missing))
        given = {
            **chapter.facts,
            "table": self._table,
            "figure": self._figure,
            "missing": self._missing,
        }
        self.html = above + (
            self._tried("what the results hold of it", lambda: render(chapter.template, **given))
            if chapter.template
            else Markup("")
        )

    def _tried(self, what: str, make: Callable[[], Markup]) -> Markup:
        """What `make` makes; a sentence if it cannot, if that may be: of another version, or what
        an editor left."""
        try:
            return make()
        except (InputError, OSError):
            raise
        except Exception as error:
            raise_if_interrupted()
            if not self._lenient:
                raise
            return self._missing(_unshown(what, error))

    def _missing(self, text: str = "", caller: Callable[[], str] | None = None) -> Markup:
        """What is not there: also told to who made the page."""
        text = _one_line(text, caller)
        self.missing.append(text.striptags() if isinstance(text, Markup) else text)
        absent: Markup = _macros().absent(text)
        return absent

    def _table(
        self,
        name: str,
        rows: Sequence[object],
        columns: Iterable[Sequence[Any]],
        grouped: str = "",
        caller: Callable[[], str] | None = None,
    ) -> Markup:
        """`grouped` is a column that the page leaves empty where it is as in the row above."""
        shown_columns = [Column(*column) for column in columns]

        def make() -> Markup:
            values = [[_value(row, column.key) for column in shown_columns] for row in rows]
            known = [
                (i, column)
                for i, column in enumerate(shown_columns)
                if not values or any(row[i] is not None for row in values)
            ]
            cells = [
                [
                    ""
                    if column.key == grouped and above is not None and above[i] == row[i]
                    else cell(column, row[i])
                    for i, column in known
                ]
                for above, row in zip([None, *values], values, strict=False)
            ]
            table: Markup = _macros().table(
                [column.heading for _, column in known],
                cells,
                _one_line("", caller),
                right=[bool(column.form) for _, column in known],
                unmet=[i for i, row in enumerate(rows) if _value(row, "met") is False],
            )
            if self._folder is not None:
                path = Path(TABLES) / f"{name}.csv"
                self.files.add(path)
                (self._folder / TABLES).mkdir(exist_ok=True)
                write_csv(self._folder / path, [column.key for column in shown_columns], values)
            return table

        return self._tried(f"the table {name}", make)

    def _figure(
        self, name: str, alt: str, title: str = "", caller: Callable[[], str] | None = None
    ) -> Markup:
        def make() -> Markup:
            figure: Figure | bytes = self._chapter.figures[name]
            if self._folder is not None:
                (self._folder / FIGURES).mkdir(exist_ok=True)
                paths = save_figure(
                    self._chapter.figures[name],
                    self._folder / FIGURES / name,
                    svg=self._svg,
                    letters="path",
                )
                self.files |= {path.relative_to(self._folder) for path in paths}
                figure = paths[0].read_bytes()
            shown: Markup = _macros().figure(
                figure, _one_line(alt), _one_line("", caller), _one_line(title)
            )
            return shown

        return self._tried(f"the figure {name}", make)


def chapter_page(
    chapters: Sequence[Chapter],
    *,
    title: str,
    first_line: str,
    synthetic: bool,
    alarm: str = "",
    folder: Path | None = None,
    lenient: bool = False,
    svg: bool = False,
    layers: Sequence[str] = ("",),
) -> tuple[list[Markup], list[ShownChapter]]:
    """The page, of two layers both, and its chapters as they are shown.

    Args:
        first_line: what is measured and what is not, in plain text.
        alarm: why nothing on the page may be taken for a result; red, above everything else.
        folder: an existing one, for the files of figures and tables.
        svg: whether figures lie there as SVG too.
        lenient: whether what cannot be shown is named in its place instead of raising: of another
            version, or edited.
        layers: the file of the page; two, and the chapters with a title stand in the second, its
            appendix.
    """
    shown = [ShownChapter(chapter, folder, lenient=lenient, svg=svg) for chapter in chapters]
    return [
        render(
            "chapters.html.j2",
            title=title,
            first_line=first_line,
            synthetic=synthetic,
            alarm=alarm,
            chapters=shown,
            appendix="" if file == layers[-1] else layers[-1],
            story="" if file == layers[0] else layers[0],
        )
        for file in layers
    ], shown


def write_csv(path: Path, headings: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Values as they are, in full precision; nothing for what is unknown."""
    with replaced(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(headings)
        writer.writerows(csv_cells(row) for row in rows)


def cell(column: Column, value: Any) -> str:
    """A value of a table as the page shows it."""
    return (
        number(value, column.form, column.scale)
        if column.form
        else UNKNOWN
        if value is None
        else (said(value) if isinstance(value, bool) else str(value))
    )


def shown(row: object, name: str) -> str:
    """A number of a compared walk as `quantities` has it."""
    return number(_value(row, name), *column(name)[2:])


def _value(row: object, key: str) -> Any:
    """What a row, a record or a mapping, has under this name; None if it has not."""
    if isinstance(row, Mapping):
        return row.get(key)
    return row.number(key) if isinstance(row, quantities.Judged) else getattr(row, key, None)


def _one_line(text: str, caller: Callable[[], str] | None = None) -> str:
    """A text of a template, which may be broken into lines there; it stays Markup if it is."""
    text = caller() if caller else text
    return type(text)(" ".join(text.split()))


def _unshown(what: str, error: Exception) -> str:
    return f"This version cannot show {what} ({type(error).__name__}: {error})."


def _print_size_pt(rows: Sequence[Sequence[str]], headings: Sequence[str]) -> float:
    """The size at which a table is as wide as the paper, words unbroken, or the largest."""
    letters = sum(
        max(len(word) for text in column for word in (str(text).split() or [""]))
        for column in zip(headings, *rows, strict=True)
    )
    return min(
        _LARGEST_PT, _PAPER_PT / max(_LETTER_EM * letters + _BETWEEN_EM * len(headings), 1.0)
    )


def _is_numeral(text: str) -> bool:
    return text == UNKNOWN or re.fullmatch(rf"{_NUMBER}( to {_NUMBER})?", text) is not None


def _environment() -> Environment:
    pages = Environment(
        loader=PackageLoader("vsf_drake.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        # A name may hold anything and ends no cell of `records`; what is marked up is a template's.
        finalize=lambda value: value.replace("│", "|") if type(value) is str else value,
    )
    pages.filters |= {
        "number": number,
        "column": column,
        "shown": shown,
        "said": said,
        "listed": listed,
        "joint": joint,
        "span": span,
        "coded": lambda text: Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))),
        "data_uri": data_uri,
        "print_size_pt": _print_size_pt,
        "number_columns": lambda rows, count: [
            bool(rows) and all(_is_numeral(row[i]) for row in rows) for i in range(count)
        ],
        "number_class": lambda right: Markup(' class="number"') if right else "",
    }
    pages.globals["quantities"] = quantities
    pages.globals["setting_column"] = setting_column
    pages.tests["numeral"] = _is_numeral
    return pages


@cache
def _macros() -> Any:
    return _PAGES.get_template("macros.html.j2").module


_PAGES = _environment()
