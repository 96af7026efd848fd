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
