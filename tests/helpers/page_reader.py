"""Reads a page as a browser would, and fails on tags that are out of turn."""

from __future__ import annotations

import html.parser

VOID = {"meta", "img", "br"}


class Balanced(html.parser.HTMLParser):
    """Collects tags and fails on one that closes out of turn."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict]] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


class Unfolded(html.parser.HTMLParser):
    """Counts the words that stand there before anything is unfolded."""

    def __init__(self) -> None:
        super().__init__()
        self.hidden, self.words = 0, 0

    def handle_starttag(self, tag, attrs):
        self.hidden += tag in ("details", "script", "style", "title")

    def handle_endtag(self, tag):
        self.hidden -= tag in ("details", "script", "style", "title")

    def handle_data(self, data):
        self.words += 0 if self.hidden else len(data.split())


def open_words(page: str) -> int:
    """Words of a page that are not folded away."""
    reader = Unfolded()
    reader.feed(page)
    return reader.words
