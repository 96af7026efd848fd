"""What long work tells of itself."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with what is being done and the finished fraction of it."""


def part_of(
    progress: Progress | None, start: float = 0.0, share: float = 1.0, *, name: str = ""
) -> Progress:
    """What a part of the work tells: it begins at the fraction `start` and takes `share` of the
    whole; `name` stands before its words. Without a `progress` nobody is told."""

    def show(what: str, fraction: float) -> None:
        if progress:
            progress(name + what, start + share * fraction)

    return show
