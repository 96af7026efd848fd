"""The answer in words, made of the section's table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any


def answer(table: Mapping[str, Any]) -> str:
    """Two sentences: with the motion held, and as the settings were walked."""
    prefix, error = limits_of(table)
    low, high = table["positions_mm"][0], table["positions_mm"][-1]
    key = f"{prefix}told_apart_same_recording"
    ends, neighbours = told(table, [(low, high)], key), told(table, steps(table), key)
    words = ("With the same motion, " + ("as far as noise alone goes, " if prefix else "")
             + ("yes: " if ends[0] else "no: ")
             + f"the model's walks at {low:g} and {high:g} mm differ by more than {error} in {ends[0]} of {ends[1]} "
             f"outcomes, neighbouring positions in {neighbours[0]} of {neighbours[1]} comparisons")
    sharpest = best(table, "same_recording" if prefix == "" else "same_session", prefix)
    if sharpest is not None:
        words += f"; the smallest detectable travel is {sharpest[1]:.0f} mm{_change(sharpest[0], prefix)}, told by " \
                 f"the {sharpest[0]['title']}, the best of the outcomes"
    apart = best(table, "two_sessions", prefix)
    words += "; between two sessions without refitting it is " + (
        f"{apart[1]:.0f} mm." if apart else "more than the range.")
    return words + _as_walked(table)


def limits_of(table: Mapping[str, Any]) -> tuple[str, str]:
    """Prefix of the keys that hold the limits: with the model's error where it is known, else of the noise alone."""
    known = any(row["sdd_same_recording"] is not None for row in table["outcomes"])
    return ("", "its error and the noise of kinematics together") if known else (
        "noise_", "the noise of kinematics alone (the model's error is not known)")


def steps(table: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Pairs of neighbouring positions."""
    at = table["positions_mm"]
    return list(pairwise(at))


def told(table: Mapping[str, Any], pairs: Sequence[tuple[float, float]], key: str) -> tuple[int, int]:
    """How many rows of these pairs are told apart by `key`, and in how many it is known."""
    known = [row[key] for row in table["pairs"] if (row["from_mm"], row["to_mm"]) in pairs and row[key] is not None]
    return sum(known), len(known)


def best(table: Mapping[str, Any], design: str, prefix: str) -> tuple[Mapping[str, Any], float] | None:
    """The outcome with the smallest detectable travel, and that travel (mm)."""
    key = f"{'noise' if prefix else 'smallest'}_travel_mm_{design}"
    rows = [(row, row[key]) for row in table["outcomes"] if row[key] is not None]
    return min(rows, key=lambda item: item[1], default=None)


def far_pair(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Rows of the two recorded settings that lie farthest apart; none where one setting was recorded."""
    rows = table["as_walked"]
    far = max((row["to_mm"] - row["from_mm"] for row in rows), default=0.0)
    return [row for row in rows if row["to_mm"] - row["from_mm"] == far]


def _as_walked(table: Mapping[str, Any]) -> str:
    rows = far_pair(table)
    known = [row for row in rows if row["told_apart"] is not None]
    if not known:
        return ""
    titles = {row["name"]: row["title"] for row in table["outcomes"]}
    names = [titles[row["outcome"]] for row in known if row["told_apart"]]
    energy = [titles[row["outcome"]] for row in rows if row["told_apart"] is None and row["beyond_strides"]]
    words = (f" As they were walked, each with its own motion, {known[0]['from_mm']:g} and {known[0]['to_mm']:g} mm "
             f"are told apart in {len(names)} of {len(known)}" + (f" ({'; '.join(names)})" if names else ""))
    return words + (f", and differ by more than strides do in {' and '.join(energy)}." if energy else ".")


def _change(row: Mapping[str, Any], prefix: str) -> str:
    change = row["smallest_change_n_per_mm_same_recording"]
    return "" if prefix or change is None else f" ({change:.1f} N/mm) around the middle of the range"
