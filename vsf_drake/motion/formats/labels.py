"""Labels of markers: a subject's prefix taken away, each label once; lists short enough to read."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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


def first_of_each(labels: list[str], notes: list[str], *, what: str = "label",
                  empty: Callable[[int], bool] = lambda i: False) -> list[int]:
    """Which of the labels to read: each once, the first that is not `empty`, and a note on what was left out."""
    kept: dict[str, int] = {}
    doubled: dict[str, int] = {}
    for i, label in enumerate(labels):
        if label in kept:
            doubled[label] = doubled.get(label, 1) + 1
        if label not in kept or (empty(kept[label]) and not empty(i)):
            kept[label] = i
    notes += [f"The {what} {label} stands {'twice' if times == 2 else f'{times} times'}: the first that holds anything "
              f"was used (column {kept[label] + 1} of {len(labels)})." for label, times in doubled.items()]
    return sorted(kept.values())
