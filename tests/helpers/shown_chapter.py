"""A chapter as its template shows it: words, tables and what its figures say for who cannot see
them."""

from __future__ import annotations

import html
import re
from types import SimpleNamespace

from vsf_drake.report.page import Chapter, Column, ShownChapter


class Shown(ShownChapter):
    """Fills the template in; figures are given to it but not drawn."""

    def __init__(self, chapter: Chapter) -> None:
        self.grids: dict[str, SimpleNamespace] = {}
        self.alts: dict[str, str] = {}
        self.captions: dict[str, str] = {}
        self.titles: dict[str, str] = {}
        self.figures = dict(chapter.figures)
        super().__init__(chapter, None, lenient=False, svg=False)

    def _table(self, name, rows=(), columns=(), grouped="", caller=None):
        shown = super()._table(name, rows, columns, grouped, caller)
        assert name not in self.grids
        self.grids[name] = SimpleNamespace(
            name=name, columns=[Column(*column) for column in columns], rows=rows
        )
        self.captions[name] = _plain(
            re.search(r"<figcaption>(.*?)</figcaption>", shown, re.DOTALL)[1]
        )
        return shown

    def _figure(self, name, alt, title="", caller=None):
        assert name in self.figures and name not in self.alts
        self.alts[name], self.titles[name], self.captions[name] = (
            _plain(alt),
            _plain(title),
            _plain(caller()),
        )
        return ""

    @property
    def paragraphs(self) -> list[str]:
        """Texts, without what is missing."""
        return [_plain(text) for text in re.findall(r"<p>(.*?)</p>", self.html, re.DOTALL)]

    @property
    def items(self) -> list[str]:
        """Sentences of lists."""
        return [_plain(text) for text in re.findall(r"<li>(.*?)</li>", self.html, re.DOTALL)]

    @property
    def words(self) -> str:
        """All of the text, what is missing too."""
        return " ".join([*self.paragraphs, *self.items, *self.missing])


def _plain(text: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())
