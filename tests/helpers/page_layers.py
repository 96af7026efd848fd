"""A page of two layers as one text."""

from __future__ import annotations

from pathlib import Path


def both_layers(folder: Path) -> str:
    """The story and its appendix, one after the other."""
    return "".join(
        (folder / name).read_text(encoding="utf-8") for name in ("report.html", "appendix.html")
    )
