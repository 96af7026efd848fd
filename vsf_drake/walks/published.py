"""Published effects of a foot's stiffness (data/published/stiffness_effects.csv), and what the
model says of each.

An effect is a sign: what a measure does from the softer to the stiffer foot; of some its size is
known, and of some feet the mean of a group. The model has a sign if its means move that way from
every setting to the next stiffer one, and further in all than repetitions scatter. What a foot does
under one load, in walks of their own motion at each setting, or in strides that adapt to it, may be
held against people; the same motion at every setting may not: a stiffer spring that is pressed as
far stores more, and nobody walks so.

A measure has one verdict, however many papers, ways and feet tell of it. Shown, but never counted
(`Trend.aside`):

- a walk that was made rather than recorded: its forces know nothing of how a person answers a
  setting;
- a sign of strides that adapt which the foot has under an equal load with nobody on it: that load
  is their null;
- what stands for a person's measure where there is no person: it is a null only.

A mean and its spread between persons says nothing where another foot's mean lies within that spread
too.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from vsf_drake.base.files import MOST_JSON_BYTES, read_text, resource

TABLE = "data/published/stiffness_effects.csv"
LEG_M = 0.93  # that turns a radius in m/m into m (a choice: what it was divided by was not read)
LOAD = "load"
OWN_MOTION = "own motion"
LEVEL_2 = "level 2"
REPRODUCED = "reproduced"
CONTRADICTED = "contradicted"
CANNOT_SAY = "cannot_say"
LEAST_CHANGE = 0.01  # share of the larger end below which a change is none (a choice)
# standard errors of the ends' difference below which it is none, where settings are repeated (a
# choice)
ERRORS = 2.0
SDS = 2.0  # standard deviations about a published mean within which the model is inside
NO_MORE_THAN_THE_LOAD = "the foot has this sign under an equal load, with nobody on it"
OF_STIFFER = "% of stiffer"


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One row: a sign, with its size where one was read, or the mean and standard deviation of a
    group on one foot."""

    source: str
    doi_or_url: str
    design: str
    persons: int | None
    softer: str
    stiffer: str
    measure: str
    effect: str  # of the stiffer against the softer: "+", "-", "0"; "" for a mean
    condition: str  # the foot of a mean, or when an effect has its size
    size: float | None  # of an effect, in `unit`: the stiffer less the softer, but for OF_STIFFER
    mean: float | None
    sd: float | None
    unit: str
    per: float | None  # N m/(deg kg), the difference of ankle stiffness that the size goes with
    where_read: str


@cache
def published_effects() -> tuple[Effect, ...]:
    """Every row of the table."""
    lines = [
        line
        for line in read_text(resource(TABLE), most=MOST_JSON_BYTES).splitlines()
        if not line.startswith("#")
    ]
    same = (
        "source",
        "doi_or_url",
        "design",
        "softer",
        "stiffer",
        "measure",
        "effect",
        "condition",
        "unit",
        "where_read",
    )

    def number(cell: str) -> float | None:
        return float(cell) if cell else None

    return tuple(
        Effect(
            **{name: row[name] for name in same},
            persons=int(row["n"]) if row["n"] else None,
            size=number(row["value"]) if row["effect"] else None,
            mean=None if row["effect"] else number(row["value"]),
            sd=number(row["sd"]),
            per=number(row["per"]),
        )
        for row in csv.DictReader(lines)
    )


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the model has of a measure, in one way."""

    measure: str  # as the published table calls it
    way: str  # LOAD, OWN_MOTION or LEVEL_2
    unit: str
    stands: str  # what the model's number is
    values: tuple[tuple[float, ...], ...]  # for each setting, softest first, one a repetition
    same: bool = True  # as what was published: else its sign may be compared, not its mean
    aside: str = ""  # why it is never counted, see above; "" where it is


@dataclass(frozen=True, kw_only=True)
class Trend:
    """One published row beside the model, in one way."""

    source: str
    doi_or_url: str
    measure: str
    published: str
    model: str
    way: str
    verdict: str
    reason: str  # what the model's number stands for, or why it cannot say
    aside: str = ""  # why it is never counted
    values: tuple[float | None, ...] = ()
    """means at the settings, softest first; None where one is not known"""
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class MeasureVerdict:
    """What is known of one measure: signs from the softer to the stiffer, "" where there is
    none."""

    measure: str
    verdict: str
    published: str  # "+", "-", "0", or "+ and -" where papers disagree
    by: tuple[str, ...]  # the ways that are counted and decide it
    load: str  # the sign under an equal load, nobody on the foot
    own_motion: str
    level_2: str
    reason: str
    sources: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Size:
    """How large a published change is, and the model's from its softest to its stiffest setting, in
    the same unit."""

    source: str
    measure: str
    condition: str
    unit: str
    published: float
    per: float | None  # N m/(deg kg); None: over whatever separates the feet that were compared
    load: float | None  # under an equal load; None where there is no such number
    level_2: float | None


def direction(values: Sequence[Sequence[float]]) -> str:
    """ "+" or "-" as means over the repetitions of each setting rise or fall from every one to the
    next; "" if they do neither, or by no more than they scatter."""
    if len(values) < 2 or not all(len(own) and np.isfinite(own).all() for own in values):
        return ""
    means = [float(np.mean(own)) for own in values]
    steps = [after - before for before, after in pairwise(means)]
    change = means[-1] - means[0]
    if abs(change) <= LEAST_CHANGE * max(abs(means[0]), abs(means[-1])):
        return ""
    if not (all(step > 0.0 for step in steps) or all(step < 0.0 for step in steps)):
        return ""
    freedoms = sum(len(own) - 1 for own in values)
    if freedoms:
        variance = (
            sum(float(np.sum((np.array(own) - np.mean(own)) ** 2)) for own in values) / freedoms
        )
        if abs(change) <= ERRORS * np.sqrt(
            variance * (1.0 / len(values[0]) + 1.0 / len(values[-1]))
        ):
            return ""
    return "+" if change > 0.0 else "-"


def trends(
    evidence: Sequence[Evidence], effects: Sequence[Effect], *, why_not: Mapping[str, str]
) -> list[Trend]:
    """Every published row, once for each way that the model has evidence in; `why_not` says by
    measure why it has none.
    """
    rows = []
    for effect in effects:
        own = [one for one in evidence if one.measure == effect.measure]
        if not own:
            rows.append(
                Trend(
                    source=effect.source,
                    doi_or_url=effect.doi_or_url,
                    measure=effect.measure,
                    published=_said(effect),
                    model="",
                    way=LEVEL_2,
                    verdict=CANNOT_SAY,
                    reason=why_not.get(effect.measure, "nothing in the model is this measure"),
                )
            )
        under_load = next((direction(one.values) for one in own if one.way == LOAD), "")
        rows += [_trend(effect, one, effects, under_load) for one in own]
    return rows


def _said(effect: Effect) -> str:
    """An effect or a mean in words."""
    if effect.mean is not None:
        return f"{effect.mean:g} ± {effect.sd:g} {effect.unit} ({effect.condition})"
    if effect.size is None:
        return effect.effect
    per = "" if effect.per is None else f" for {effect.per:g} N m/(deg kg)"
    return f"{effect.effect} ({effect.size:g} {effect.unit}{per})"


def _trend(effect: Effect, one: Evidence, effects: Sequence[Effect], under_load: str) -> Trend:
    means = tuple(float(np.mean(values)) if values else float("nan") for values in one.values)
    aside = one.aside
    if effect.mean is None:
        found = direction(one.values)
        verdict = (
            CANNOT_SAY if not found else REPRODUCED if found == effect.effect else CONTRADICTED
        )
        reason = one.stands + (
            "" if found else "; no direction at every step and beyond its scatter"
        )
        if one.way == LEVEL_2 and verdict == REPRODUCED and under_load == found:
            aside = NO_MORE_THAN_THE_LOAD
    else:
        found, verdict, reason = "", *_inside(effect, one, means, effects)
    shown = ", ".join(f"{mean:.3g}" for mean in means) + f" {one.unit}"
    return Trend(
        source=effect.source,
        doi_or_url=effect.doi_or_url,
        measure=effect.measure,
        published=_said(effect),
        way=one.way,
        verdict=verdict,
        reason=reason,
        aside=aside,
        unit=one.unit,
        model=f"{found}: {shown}" if found else shown,
        values=tuple(mean if np.isfinite(mean) else None for mean in means),
    )


def _inside(
    effect: Effect, one: Evidence, means: Sequence[float], effects: Sequence[Effect]
) -> tuple[str, str]:
    """Whether the model's settings lie within the published mean's spread. None does: contradicted;
    all do: reproduced, if the spread tells this foot from the others of its source; else it cannot
    say."""
    assert effect.mean is not None
    assert effect.sd is not None
    spread = SDS * effect.sd
    if effect.unit != one.unit:
        return (
            CANNOT_SAY,
            f"{one.stands}; published in {effect.unit}, and what it was divided by was not read",
        )
    if not one.same:
        return CANNOT_SAY, f"{one.stands}: what stands for a measure has its sign, not its size"
    inside = [abs(mean - effect.mean) <= spread for mean in means]
    reason = f"{one.stands}; {sum(inside)} of {len(inside)} settings within {SDS:g} SD"
    others = [
        row.condition
        for row in effects
        if row.mean is not None
        and row.condition != effect.condition
        and (row.source, row.measure) == (effect.source, effect.measure)
        and abs(row.mean - effect.mean) <= spread
    ]
    if not any(inside):
        return CONTRADICTED, reason
    if all(inside) and not others:
        return REPRODUCED, reason
    return CANNOT_SAY, reason + (f", as is the mean of {' and of '.join(others)}" if others else "")


def verdicts(
    rows: Sequence[Trend], effects: Sequence[Effect], evidence: Sequence[Evidence]
) -> list[MeasureVerdict]:
    """One for each measure, from the rows that count: contradicted by any, else reproduced by any,
    else unknown; and unknown where the published signs disagree."""
    found = []
    for measure in dict.fromkeys(effect.measure for effect in effects):
        own = [row for row in rows if row.measure == measure]
        counted = [row for row in own if not row.aside]
        said = {row.verdict for row in counted}
        published = sorted(
            {effect.effect for effect in effects if effect.measure == measure and effect.effect}
        )
        verdict = (
            CONTRADICTED
            if CONTRADICTED in said
            else REPRODUCED
            if REPRODUCED in said
            else CANNOT_SAY
        )
        if len(published) > 1:
            verdict = CANNOT_SAY
        decide = dict.fromkeys(row.way for row in counted if row.verdict == verdict != CANNOT_SAY)
        if decide:
            reasons = {row.reason for row in counted if row.verdict == verdict}
        elif len(published) > 1:
            reasons = {"the published signs disagree"}
        else:
            reasons = {row.aside for row in own if row.aside} | {
                row.reason for row in own if not row.values
            }
        signs = {one.way: direction(one.values) for one in evidence if one.measure == measure}
        found.append(
            MeasureVerdict(
                measure=measure,
                verdict=verdict,
                published=" and ".join(published),
                by=tuple(decide),
                load=signs.get(LOAD, ""),
                own_motion=signs.get(OWN_MOTION, ""),
                level_2=signs.get(LEVEL_2, ""),
                reason="; ".join(sorted(reasons))
                or "no way has a direction at every step and beyond its scatter",
                sources=tuple(dict.fromkeys(row.source for row in own)),
            )
        )
    return found


def sizes(
    evidence: Sequence[Evidence],
    effects: Sequence[Effect],
    *,
    stiffness: Mapping[str, Sequence[float]],
) -> list[Size]:
    """Of every effect whose size was read, and of every two feet whose means were, in percent of
    the softer one's.

    `stiffness`: by way, of the foot at its softest and its stiffest setting, N m/(deg kg): where a
    size was read with a difference of stiffness, the model's is given for the same difference, on a
    straight line.
    """
    means = {
        (row.source, row.measure, row.condition): row.mean
        for row in effects
        if row.mean is not None
    }
    rows = []
    for effect in effects:
        if not effect.effect:
            continue
        published = effect.size
        unit = effect.unit
        condition = effect.condition
        softer, stiffer = (
            means.get((effect.source, effect.measure, foot))
            for foot in (effect.softer, effect.stiffer)
        )
        if published is None and softer is not None and stiffer is not None:
            published = 100.0 * (stiffer - softer) / softer
            unit = "%"
            condition = f"{effect.softer}, {effect.stiffer}"
        if published is None:
            continue
        changes = {one.way: _change(one, unit) for one in evidence if one.measure == effect.measure}
        for way, change in changes.items():
            if effect.per is not None and change is not None:
                known = stiffness.get(way, ())
                apart = known[-1] - known[0] if len(known) > 1 else np.nan
                changes[way] = change * effect.per / apart if np.isfinite(apart) else None
        rows.append(
            Size(
                source=effect.source,
                measure=effect.measure,
                condition=condition,
                unit=unit,
                published=published,
                per=effect.per,
                load=changes.get(LOAD),
                level_2=changes.get(LEVEL_2),
            )
        )
    return rows


def _change(one: Evidence, unit: str) -> float | None:
    """From the softest to the stiffest setting, in a unit of `Effect.size`; None where it is
    another's."""
    if not one.values or not one.values[0] or not one.values[-1]:
        return None
    first, last = (float(np.mean(one.values[i])) for i in (0, -1))
    if unit == OF_STIFFER:
        return 100.0 * (first - last) / abs(last)
    if unit == "%":
        return 100.0 * (last - first) / abs(first)
    return last - first if unit == one.unit else None
