"""The section "roll-over": inclined loading, the ISO 22675 loading profile, and roll-over shapes in walking."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.roll_over.inclined_loading import inclined_loading
from vsf_drake.analysis.validation.roll_over.iso_roll_over import iso_roll_over
from vsf_drake.analysis.validation.roll_over.walked import OPPOSITE_STRIKE, walked_shapes
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.errors import InputError
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M

WALKED = ("radius_m", "radius_leg_lengths", "effective_foot_length_m", "effective_foot_length_ratio",
          "mean_moment_arm_m", "arc_rms_m", "centre_forward_m", "centre_up_m")
LEAST_FORCE_N, MOST_FORCE_N = 50.0, 5000.0
STEPS_PER_MM, ISO_STEPS = 160.0, 1200
QUICK_STEPS_PER_MM, QUICK_ISO_STEPS, QUICK_POSITIONS_M = 40.0, 600, (0.066, 0.108, 0.151)


def roll_over_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Everything about rolling over.

    Table: `inclined` (rows by angle and fulcrum position), `iso` (`force_n`, `force_from`, `follows`, `positions`, and
    for comparison `with_friction`), `walks` (a row a footfall) and `conditions` (by fulcrum position, mean, SD and
    count of `model`, `measured`, and of the model's `foot_alone` in the pylon's frame).

    Raises:
        InputError: the force of the profile is no force to test a foot with.
    """
    force, source = _force(study)
    quick, foot = study.options.quick, study.model.foot
    fulcrums, missing = _positions(foot, QUICK_POSITIONS_M if quick else PUBLISHED_FULCRUMS_M)

    def show(what: str, fraction: float) -> None:
        if progress:
            progress(what, fraction)

    inclined, curves, failed = inclined_loading(
        foot, fulcrums, steps_per_mm=QUICK_STEPS_PER_MM if quick else STEPS_PER_MM,
        progress=lambda what, f: show(what, 0.3 * f))
    rolled, more, failed_rolls = iso_roll_over(
        foot, fulcrums, force_n=force, steps=QUICK_ISO_STEPS if quick else ISO_STEPS,
        progress=lambda what, f: show(what, 0.3 + 0.4 * f))
    rough, _, failed_rough = iso_roll_over(
        foot, fulcrums, force_n=force, steps=QUICK_ISO_STEPS, friction=True,
        progress=lambda what, f: show(f"{what} with friction", 0.7 + 0.1 * f))
    missing += failed + failed_rolls + failed_rough
    rows: list[dict[str, Any]] = []
    for i, walk in enumerate(study.walks):
        show("roll-over shapes", 0.8 + 0.2 * i / len(study.walks))
        shapes, unknown = walked_shapes(walk)
        missing += unknown
        for j, shape in enumerate(shapes):
            name = f"walk_{len(rows)}"
            rows.append({**shape.row, "footfall": j + 1, "curves": name})
            for kind, points in (("model", shape.model), ("measured", shape.measured), ("alone", shape.foot_alone)):
                curves |= {f"{name}_{kind}_forward_m": points[:, 0], f"{name}_{kind}_up_m": points[:, 1]}
    return Section(
        table={
            "inclined": inclined,
            "iso": {"force_n": force, "force_from": source, "foot_length_m": foot.length_m,
                    "follows": bool(rolled) and all(row["follows"] for row in rolled), "positions": rolled,
                    "with_friction": rough},
            "walks": rows, "conditions": _conditions(rows), "foot_length_m": foot.length_m,
            "heel_behind_pylon_m": foot.pylon_x_m - foot.heel_x_m, "synthetic": study.synthetic, "quick": quick},
        arrays={**curves, **more}, missing=tuple(missing))


def _force(study: Study) -> tuple[float, str]:
    """Largest force of the profile (N), and where it comes from: "given" or "weight"."""
    given = study.options.iso_force_n
    if given is None:
        return float(study.walks[0].recorded.subject.mass_kg * GRAVITY), "weight"
    if not LEAST_FORCE_N <= given <= MOST_FORCE_N:
        raise InputError(f"{given:g} N is no force to roll a foot over with", where="iso_force_n",
                         right=f"Give the level's largest force, {LEAST_FORCE_N:g} to {MOST_FORCE_N:g} N")
    return float(given), "given"


def _positions(foot: FootParameters, wanted: tuple[float, ...]) -> tuple[tuple[float, ...], list[str]]:
    """The `wanted` positions (m) that the foot's carriage reaches, and a sentence on the others."""
    low, high = foot.fulcrum.rearmost_m - 1e-9, foot.fulcrum.foremost_m + 1e-9
    reached = tuple(x for x in wanted if low <= x <= high)
    left = [f"{1e3 * x:g}" for x in wanted if x not in reached]
    return reached, [f"Not loaded: fulcrum at {', '.join(left)} mm, which this foot does not reach."] if left else []


def _conditions(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean, SD (None for fewer than two) and count by fulcrum position, softest first."""
    found = []
    for fulcrum in sorted({row["fulcrum_mm"] for row in rows}):
        own = [row for row in rows if row["fulcrum_mm"] == fulcrum]
        found.append({
            "fulcrum_mm": fulcrum, "footfalls": len(own),
            "until_opposite_strike": sum(row["ends_at"] == OPPOSITE_STRIKE for row in own),
            **{side: {name: _statistics([row[side].get(name) for row in own]) for name in WALKED
                      if name in own[0][side]} for side in ("model", "measured", "foot_alone")}})
    return found


def _statistics(values: Sequence[float | None]) -> dict[str, Any]:
    known = [value for value in values if value is not None]
    return {"mean": float(np.mean(known)) if known else None,
            "sd": float(np.std(known, ddof=1)) if len(known) > 1 else None, "count": len(known)}
