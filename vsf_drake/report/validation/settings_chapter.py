"""The chapter "Can two settings be distinguished?": a function of its saved section."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.base.files import plain
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import FULCRUM, PANEL, Arrays, colour_of, drawing, label, say_synthetic

if TYPE_CHECKING:
    from vsf_drake.validation.settings_section import (
        CurveDifference,
        OutcomeRow,
        PairRow,
        SettingsTable,
        WalkedPair,
    )

    _Pair = TypeVar("_Pair", PairRow, CurveDifference, WalkedPair)

TITLE = "Can two settings be distinguished?"
DESIGNS = {
    "same_recording": "same recording",
    "same_session": "two recordings, one session",
    "two_sessions": "two sessions",
}
_MARKS: dict[str, dict[str, Any]] = {
    design: {
        "marker": marker,
        "markerfacecolor": face,
        "markersize": size,
        "color": "0.1",
        "linestyle": "",
    }
    for design, marker, face, size in (
        ("same_recording", "o", "0.1", 10),
        ("same_session", "s", "white", 5),
        ("two_sessions", "^", "0.75", 7),
    )
}
_MEAN: dict[str, Any] = {"color": "black", "linewidth": 2.2, "marker": "o", "markersize": 4.5}
_BAND = "same_session"
"""The design whose limit is drawn about the changes of one outcome."""


def settings_chapter(table: SettingsTable, arrays: Arrays) -> Chapter:
    """The answer, what the model predicts against what is detectable, and how that was found."""
    facts = dict(vars(table))
    figures = {}
    if table.outcomes:
        facts |= _facts(table)
        figures = {
            "settings_apart": _apart_figure(table),
            "settings_change": _change_figure(table, arrays),
        }
    return Chapter(
        name="settings",
        title=TITLE,
        template="validation/settings.html.j2",
        facts=facts,
        figures=figures,
    )


def _facts(table: SettingsTable) -> dict[str, Any]:
    """What the chapter's sentences and tables need besides the table."""
    outcomes = table.outcomes
    known = any(map(_limited, outcomes))
    ends = _ends(table)
    judged = [ends[row.name] for row in outcomes if row.name in ends and _limited(row) == known]
    over = [(row.title, _over(ends.get(row.name), "same_recording")) for row in outcomes]
    curves = [row for row in table.curves if row.rms_bw is not None]
    neighbours = set(pairwise(table.positions_mm))
    walked = _widest(table.as_walked)
    return {
        "outcomes": plain(outcomes),
        "ends": next(iter(_widest(curves)), None),
        "neighbours_percent": [
            100.0 * (row.rms_bw or 0.0) for row in curves if (row.from_mm, row.to_mm) in neighbours
        ],
        "walked_percent": [100.0 * apart_bw for apart_bw in table.as_walked_apart_bw],
        "designs": tuple(DESIGNS.items()),
        "apart": {design: _count(judged, design) for design in DESIGNS},
        "ratios": [(title, ratio) for title, ratio in over if ratio is not None],
        "best": _best(table),
        "known": known,
        "reached": _reached(outcomes, "smallest" if known else "noise"),
        "poor_judge": poor_judge(table.pairs),
        "pair_rows": _pair_rows(table.pairs),
        "outcome_rows": [_outcome_row(row) for row in outcomes],
        "walked_ends": walked[:1],
        "walked_apart": [row.told_apart for row in walked if row.told_apart is not None],
        "walked_rows": _walked_rows(table),
    }


def _reached(outcomes: Sequence[OutcomeRow], limit: str) -> list[tuple[str, float, str, int]]:
    """By design with any: the smallest detectable travel, of which outcome, and how many have
    one."""
    reached = []
    for design, title in DESIGNS.items():
        travels = [(row.limits[f"{limit}_travel_mm_{design}"], row.title) for row in outcomes]
        known = [(travel, name) for travel, name in travels if travel is not None]
        if known:
            reached.append((title, *min(known), len(known)))
    return reached


def _pair_rows(pairs: Sequence[PairRow]) -> list[dict[str, object]]:
    """By pair of positions: in how many outcomes it is distinguishable."""
    by_place: dict[tuple[float, float], list[PairRow]] = {}
    for row in pairs:
        by_place.setdefault((row.from_mm, row.to_mm), []).append(row)
    return [
        {"from_mm": low, "to_mm": high}
        | {design: "{} of {}".format(*_count(rows, design)) for design in DESIGNS}
        for (low, high), rows in by_place.items()
    ]


def _outcome_row(row: OutcomeRow) -> dict[str, object]:
    """An outcome with its limits: of noise alone where the model's error is not known."""
    basis, limit = ("model and noise", "sdd_") if _limited(row) else ("noise alone", "noise_sdd_")
    detectable = {design: row.limits[limit + design] for design in DESIGNS}
    return {**vars(row), **row.limits, "basis": basis, **detectable}


def _walked_rows(table: SettingsTable) -> list[dict[str, object]]:
    titles = {row.name: f"{row.title} ({row.unit})" for row in table.outcomes}
    words = {True: "yes", False: "no", None: None}
    return [
        {
            **vars(row),
            "title": titles[row.outcome],
            "told": words[row.told_apart],
            "strides": words[row.beyond_strides],
        }
        for row in table.as_walked
    ]


def _widest(rows: Sequence[_Pair]) -> list[_Pair]:
    """Those of the two positions furthest apart."""
    reach = max((row.to_mm - row.from_mm for row in rows), default=0.0)
    return [row for row in rows if row.to_mm - row.from_mm == reach]


def told_apart(row: PairRow, design: str) -> bool | None:
    """Whether the effect exceeds what is detectable; None where that is not known."""
    limit = row.limits[f"limit_{design}"]
    return None if row.effect is None or limit is None else abs(row.effect) > limit


def poor_judge(pairs: Sequence[PairRow]) -> PairRow | None:
    """Stored energy between the ends, if with the motion held it cannot tell them apart and is
    largest in between."""
    known = [row for row in pairs if row.outcome == "energy_stored_j" and row.effect is not None]
    if not known:
        return None
    ends = _widest(known)[0]
    effect = ends.effect or 0.0
    largest = max(abs(row.effect or 0.0) for row in known)
    highest = max(row.effect or 0.0 for row in known if row.from_mm == ends.from_mm)
    apart = abs(effect) > 0.5 * largest or told_apart(ends, "same_recording")
    return ends if highest > max(0.0, effect) and not apart else None


def _limited(outcome: OutcomeRow) -> bool:
    """Whether the model's error in it is known: else limits are of noise alone."""
    return outcome.limits["sdd_same_recording"] is not None


def _ends(table: SettingsTable) -> dict[str, PairRow]:
    """By outcome, the two positions furthest apart."""
    return {row.outcome: row for row in _widest(table.pairs)}


def _over(row: PairRow | None, design: str) -> float | None:
    """The predicted difference over the smallest detectable one."""
    limit = row and row.limits[f"limit_{design}"]
    return abs(row.effect) / limit if row and row.effect is not None and limit else None


def _count(rows: Iterable[PairRow], design: str) -> tuple[int, int]:
    """How many are distinguishable, of how many of which that is known."""
    verdicts = [told_apart(row, design) for row in rows]
    return verdicts.count(True), len(verdicts) - verdicts.count(None)


def _best(table: SettingsTable) -> OutcomeRow:
    """The outcome that tells the ends of the range apart best."""
    ends = _ends(table)
    return max(
        table.outcomes, key=lambda row: (_limited(row), _over(ends.get(row.name), _BAND) or 0.0)
    )


def _apart_figure(table: SettingsTable) -> Figure:
    """By outcome, the predicted difference of the ends of the range over the smallest detectable
    one."""
    rows = table.outcomes
    ends = _ends(table)
    with drawing(PANEL[0], 1.0 + 0.24 * len(rows)) as figure:
        axes = figure.subplots()
        for i, row in enumerate(rows):
            for design, look in _MARKS.items():
                axes.plot(_over(ends.get(row.name), design) or np.nan, i, clip_on=False, **look)
        axes.axvline(1.0, color="0.1", linewidth=1.2)
        axes.set_xlim(left=0.0)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_yticks(
            range(len(rows)), [row.title + ("" if _limited(row) else "*") for row in rows]
        )
        handles = [Line2D([], [], label=DESIGNS[design], **look) for design, look in _MARKS.items()]
        figure.legend(handles=handles, loc="lower center", ncols=2)
        label(axes, x="difference / detectable (1)", y="")
        say_synthetic(figure, table.synthetic, "trials")
    return figure


def _change_figure(table: SettingsTable, arrays: Arrays) -> Figure:
    """The best outcome over the fulcrum's position, as a difference from the middle one: every
    trial, and the mean."""
    positions = np.array(table.positions_mm, dtype=float)
    row = _best(table)
    middle = int(np.argmin(np.abs(positions - 0.5 * (positions[0] + positions[-1]))))
    effects = arrays["effects"][:, :, [one.name for one in table.outcomes].index(row.name)]
    change = effects - effects[:, middle : middle + 1]
    with drawing(*PANEL) as figure:
        axes = figure.subplots()
        _band(axes, [pair for pair in table.pairs if pair.outcome == row.name], positions[middle])
        for values, at in zip(change, table.trials_mm, strict=True):
            axes.plot(positions, values, color=colour_of(at), linewidth=1.0)
        axes.plot(positions, np.nanmean(change, axis=0), **_MEAN)
        axes.axhline(0.0, color="0.4", linewidth=0.8)
        axes.set_xticks(positions)
        handles: list[Any] = [
            Line2D([], [], label="mean of the trials", **_MEAN),
            Patch(facecolor="0.85", label="not distinguishable"),
        ]
        handles += [
            Line2D([], [], color=colour_of(x), label=f"recorded at {x:g} mm")
            for x in sorted(set(table.trials_mm))
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
        label(axes, x=FULCRUM, y=f"change from {positions[middle]:g} mm ({row.unit})")
        say_synthetic(figure, table.synthetic, "trials")
    return figure


def _band(axes: Axes, pairs: Sequence[PairRow], here: float) -> None:
    """What is not distinguishable from the position `here`, to both sides; next to it as at its
    neighbour."""
    limits = {
        row.to_mm if row.from_mm == here else row.from_mm: row.limits[f"limit_{_BAND}"]
        for row in pairs
        if here in (row.from_mm, row.to_mm)
    }
    if None in limits.values():
        return
    for own in (
        sorted((x for x in limits if x < here), reverse=True),
        sorted(x for x in limits if x > here),
    ):
        wide = np.array([limits[x] for x in (own[:1] + own)])
        axes.fill_between([here, *own], -wide, wide, color="0.85", linewidth=0.0, zorder=0)
