"""Published effects of a foot's stiffness (data/published/stiffness_effects.csv), and what the model says of each.

An effect is a sign: what a measure does from the softer to the stiffer foot. The model has it if its means move that
way from every setting to the next stiffer one, and further in all than repetitions scatter. What a foot does under one
load, in walks of their own motion at each setting, or in strides that adapt to it, may be held against people; the same
motion at every setting may not: a stiffer spring that is pressed as far stores more, and nobody walks so.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from vsf_drake.files import MOST_JSON_BYTES, read_text, resource

TABLE = "data/published/stiffness_effects.csv"
LEG_M = 0.93  # that turns a radius in m/m into m (a choice: what it was divided by was not read)
LOAD, OWN_MOTION, LEVEL_2 = "load", "own motion", "level 2"
REPRODUCED, CONTRADICTED, CANNOT_SAY = "reproduced", "contradicted", "cannot_say"
LEAST_CHANGE = 0.01  # share of the larger end below which a change is none (a choice)
ERRORS = 2.0  # standard errors of the ends' difference below which it is none, where settings are repeated (a choice)
SDS = 2.0  # standard deviations about a published mean within which the model is inside


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One row: a sign, or the mean and standard deviation of a group on one foot."""

    source: str
    doi_or_url: str
    design: str
    persons: int | None
    softer: str
    stiffer: str
    measure: str
    effect: str  # of the stiffer against the softer: "+", "-", "0"; "" for a mean
    condition: str  # the foot of a mean
    mean: float | None
    sd: float | None
    unit: str
    where_read: str


@cache
def published_effects() -> tuple[Effect, ...]:
    """Every row of the table that was read."""
    path = resource(TABLE)
    lines = [
        line
        for line in read_text(path, most=MOST_JSON_BYTES).splitlines()
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
    return tuple(
        Effect(
            **{name: row[name] for name in same},
            persons=int(row["n"]) if row["n"] else None,
            mean=float(row["value"]) if row["value"] else None,
            sd=float(row["sd"]) if row["sd"] else None,
        )
        for row in csv.DictReader(lines)
        if row["read"] == "yes"
    )


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the model has of a measure, in one way."""

    measure: str  # as the published table calls it
    way: str  # LOAD, OWN_MOTION or LEVEL_2
    unit: str
    stands: str  # what the model's number is
    values: tuple[tuple[float, ...], ...]  # for each setting, softest first, one a repetition


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
    values: tuple[
        float | None, ...
    ] = ()  # means at the settings, softest first; None where one is not known
    unit: str = ""


def direction(values: Sequence[Sequence[float]]) -> str:
    """ "+" or "-" as means over the repetitions of each setting rise or fall from every one to the next; "" if they do
    neither, or by no more than they scatter."""
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
    """Every published row, once for each way that the model has evidence in; `why_not` says by measure why it has none."""
    rows = []
    for effect in effects:
        common: dict[str, Any] = {
            "source": effect.source,
            "doi_or_url": effect.doi_or_url,
            "measure": effect.measure,
        }
        published = (
            effect.effect
            if effect.mean is None
            else (f"{effect.mean:g} ± {effect.sd:g} {effect.unit} ({effect.condition})")
        )
        own = [one for one in evidence if one.measure == effect.measure]
        if not own:
            rows.append(
                Trend(
                    **common,
                    published=published,
                    model="",
                    way=LEVEL_2,
                    verdict=CANNOT_SAY,
                    reason=why_not.get(effect.measure, "nothing in the model is this measure"),
                )
            )
        for one in own:
            means = tuple(
                float(np.mean(values)) if values else float("nan") for values in one.values
            )
            if effect.mean is None:
                found = direction(one.values)
                verdict = (
                    CANNOT_SAY
                    if not found
                    else REPRODUCED
                    if found == effect.effect
                    else CONTRADICTED
                )
                reason = one.stands + ("" if found else "; no direction beyond its scatter")
            else:
                found, verdict, reason = "", *_inside(effect, one, means)
            shown = ", ".join(f"{mean:.3g}" for mean in means) + f" {one.unit}"
            rows.append(
                Trend(
                    **common,
                    published=published,
                    way=one.way,
                    verdict=verdict,
                    reason=reason,
                    unit=one.unit,
                    model=f"{found}: {shown}" if found else shown,
                    values=tuple(mean if np.isfinite(mean) else None for mean in means),
                )
            )
    return rows


def _inside(effect: Effect, one: Evidence, means: Sequence[float]) -> tuple[str, str]:
    """Whether the model's settings lie within the published mean's spread; all, some (it cannot say) or none."""
    assert effect.mean is not None
    assert effect.sd is not None
    if effect.unit != one.unit:
        return (
            CANNOT_SAY,
            f"{one.stands}; published in {effect.unit}, and what it was divided by was not read",
        )
    inside = [abs(mean - effect.mean) <= SDS * effect.sd for mean in means]
    verdict = REPRODUCED if all(inside) else CANNOT_SAY if any(inside) else CONTRADICTED
    return verdict, f"{one.stands}; {sum(inside)} of {len(inside)} settings within {SDS:g} SD"
