"""When the force on a foot is known: on a plate, or in swing. And when it is not: on ground that no plate measures."""

from __future__ import annotations

from collections.abc import Sequence

from vsf_drake.motion.contact_search import Found
from vsf_drake.motion.events import Stance
from vsf_drake.motion.plates import SIDES

Span = tuple[float, float]
TOLERANCE_S = 0.12
"""A stance may begin before its load and end after it by this much: three times the error of kinematic events."""
WIDEN_S = 0.05
"""What is called unmeasured is wider by this, for the same reason."""


def unmeasured_spans(found: Sequence[Found], stances: dict[str, tuple[Stance, ...]],
                     record: Span) -> tuple[dict[str, tuple[Span, ...]], dict[int, str]]:
    """Stances that the plates miss, by side, and doubts about the loads that cover them in part, by index in `found`.

    A stance of which more than 0.12 s is on no plate is unmeasured as a whole: half of it cannot be compared.

    Args:
        found: all loads with their feet.
        stances: of each foot, from its motion.
        record: where both forces and feet are known, s.
    """
    missing: dict[str, tuple[Span, ...]] = {}
    doubts: dict[int, str] = {}
    for side in SIDES:
        own = [(i, item.load.start_s, item.load.end_s) for i, item in enumerate(found)
               if item.side == side and not item.scuff]
        spans = [(item.load.start_s, item.load.end_s) for item in found
                 if item.shared and any(_overlap((item.load.start_s, item.load.end_s), (s.start_s, s.end_s)) > 0.0
                                        for s in stances[side])]
        for stance in stances[side]:
            start, end = max(stance.start_s, record[0]), min(stance.end_s, record[1])
            covering = [(i, a, b) for i, a, b in own if _overlap((a, b), (start, end)) > 0.0]
            gap = _longest_gap((start, end), [(a, b) for _, a, b in covering])
            if gap <= min(TOLERANCE_S, 0.5 * (end - start)):
                continue
            spans.append((min([start, *(a for _, a, _ in covering)]), max([end, *(b for *_, b in covering)])))
            for i, _, _ in covering:
                doubts[i] = f"the foot stands on no plate for {gap:.2f} s of this stance, or the clocks differ"
        missing[side] = _merged([(max(a - WIDEN_S, record[0]), min(b + WIDEN_S, record[1])) for a, b in spans])
    return missing, doubts


def _longest_gap(span: Span, parts: Sequence[Span]) -> float:
    """Longest stretch (s) of the span that no part covers."""
    at, longest = span[0], 0.0
    for start, end in sorted(parts):
        longest, at = max(longest, start - at), max(at, end)
    return max(longest, span[1] - at)


def _merged(spans: Sequence[Span]) -> tuple[Span, ...]:
    merged: list[Span] = []
    for start, end in sorted(span for span in spans if span[1] > span[0]):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return tuple(merged)


def _overlap(a: Span, b: Span) -> float:
    return min(a[1], b[1]) - max(a[0], b[0])
