"""Labels of markers: a subject's prefix taken away, no label twice; lists short enough to read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vsf_drake.errors import InputError

MOST_LISTED = 20
"""A message that names more labels is not read."""


def listed(labels: Sequence[str], *, most: int = MOST_LISTED) -> str:
    """The labels, or the first of them and how many there are more; "none" without any."""
    if len(labels) <= most:
        return ", ".join(labels) or "none"
    return f"{', '.join(labels[:most])} and {len(labels) - most} more"


def without_prefix(labels: list[str]) -> tuple[list[str], list[str]]:
    """The labels without the one subject name ("Anna:LASI") that they share, and a note where there was one."""
    named = [label.split(":", 1) for label in labels if ":" in label]
    prefixes = {prefix for prefix, _ in named}
    if len(prefixes) != 1 or any(not rest.strip() for _, rest in named):
        return labels, []
    prefix = prefixes.pop()
    short = [label.removeprefix(f"{prefix}:") for label in labels]
    if len(set(short)) != len(set(labels)):
        return labels, []
    return short, [f"The labels' prefix {prefix}: was taken away."]


def refuse_doubled(labels: list[str], path: Path, where: str) -> None:
    """Raises:
    InputError: a label stands twice; the message names both places.
    """
    seen: dict[str, int] = {}
    for i, label in enumerate(labels, start=1):
        if label in seen:
            raise InputError(f"the label {label} stands twice, as markers {seen[label]} and {i}", file=path,
                             where=where, right="Give each marker a label of its own")
        seen[label] = i
