"""Can two settings of the fulcrum be told apart, given the model's error and the noise of kinematics?

Every motion is walked at every position with all else equal; the difference that the model then predicts is held
against what is detectable (`detectable` has the statistics, `kinematic_noise` the sizes of the noise, `settings_walks`
the walks, `settings_outcomes` the measures). The motion is held: somebody who walks at another setting moves otherwise
and keeps the forces more alike. So the settings are also compared as they were walked, each with its own motion
(`tables.walked_rows`). As an independent route the fulcrum is estimated from the force alone
(`settings_inverse`).

No offset is fitted again after a draw. A laboratory that fits them in each session leaves less noise than stands here
for two sessions; but offsets that are fitted to the very plates that shall tell the setting can take up the fulcrum's
effect as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.analysis.validation.settings.answer import answer
from vsf_drake.analysis.validation.settings.detectable import CONFIDENCE, FEWEST
from vsf_drake.analysis.validation.settings.inverse import inverse_table
from vsf_drake.analysis.validation.settings.kinematic_noise import NoiseSizes
from vsf_drake.analysis.validation.settings.outcomes import NAMES
from vsf_drake.analysis.validation.settings.tables import (
    curve_rows,
    held_out_error,
    outcome_rows,
    pair_rows,
    walked_rows,
)
from vsf_drake.analysis.validation.settings.walks import RECORDINGS, Base, Walked, base_of, walk_all
from vsf_drake.analysis.validation.study import HELD_OUT, OFFSETS_FITTED, Progress, Section, Study, StudyWalk
from vsf_drake.errors import InputError
from vsf_drake.json_file import plain
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.bench_stiffness import BenchStiffness

NOISY_WALKS, QUICK_NOISY_WALKS = 2700, 108
MOST_DRAWS, FEWEST_DRAWS = 60, 3
MOST_A_SETTING, QUICK_A_SETTING, MOST_TRIALS = 3, 1, 12


def settings_section(study: Study, *, progress: Progress | None = None) -> Section:
    """The section "Can two settings be told apart?".

    Returns:
        `table`: `answer`; `outcomes`, `pairs`, `curves`, `as_walked` (rows, see `settings_tables`); `inverse` (see
        `settings_inverse`) with its `fulcrum_estimate_sd_mm` beside it; `noise`, `draws` (sessions a trial), `walks`,
        `seed`, `trials`, `positions_mm`, `stiffness_n_per_mm`. `arrays`: `effects` (T, P, O) without noise.
    """
    missing: list[str] = []
    bases = _bases(study, missing)
    if not bases:
        return Section(table={"answer": "No walk of this study can tell.", "outcomes": [], "pairs": [], "draws": 0,
                              "seed": study.options.seed, "fulcrum_estimate_sd_mm": None}, missing=tuple(missing))
    positions = _positions(study.model.foot, quick=study.options.quick)
    positions_mm = np.round(1e3 * positions, 6)
    draws = _draws(len(bases) * len(positions), quick=study.options.quick)
    walked = walk_all(bases, positions.tolist(), draws=draws, seed=study.options.seed, workers=study.options.workers,
                      progress=progress)
    model, (stiffness, at_positions) = held_out_error(bases), _stiffness(study.model.foot, positions)
    inverse = inverse_table(positions_mm, walked)
    table: dict[str, Any] = {
        "confidence": CONFIDENCE, "positions_mm": positions_mm, "stiffness_n_per_mm": at_positions,
        "draws": draws, "recordings_a_draw": RECORDINGS, "seed": study.options.seed,
        "walks": len(bases) * len(positions) * (1 + RECORDINGS * draws), "failed_walks": sum(w.failed for w in walked),
        "synthetic": study.synthetic, "noise": dataclasses.asdict(NoiseSizes()), "quick": study.options.quick,
        "held_out_trials": sum(base.walk.role == HELD_OUT for base in bases),
        "held_out_rmse_bw": _mean([b.walk.metrics["grf_rmse_bw"] for b in bases if b.walk.role == HELD_OUT]),
        "trials": [{"label": b.label, "fulcrum_mm": b.walk.fulcrum_mm, "role": b.walk.role} for b in bases],
        "outcomes": outcome_rows(positions_mm, walked, model, stiffness), "names": NAMES,
        "pairs": pair_rows(positions_mm, walked, model), "curves": curve_rows(positions_mm, walked),
        "as_walked": walked_rows(bases), "as_walked_curves": _walked_curves(bases), "inverse": inverse,
        "fulcrum_estimate_sd_mm": inverse["sd_mm"]}
    _say_what_is_missing(study, bases, walked, inverse, missing)
    table = plain(table)
    table["answer"] = answer(table)
    return Section(table=table, missing=tuple(missing),
                   arrays={"effects": np.array([w.base_values for w in walked])})


def _bases(study: Study, missing: list[str]) -> list[Base]:
    """Trials that are walked, by setting and name: held-out ones first where there are too many of a setting."""
    most = QUICK_A_SETTING if study.options.quick else MOST_A_SETTING
    found: list[Base] = []
    left_out: list[StudyWalk] = []
    for walks in study.conditions().values():
        own: list[Base] = []
        for walk in sorted(walks, key=lambda w: w.role != HELD_OUT):
            if len(own) == most or len(found) + len(own) == MOST_TRIALS:
                left_out.append(walk)
                continue
            try:
                own.append(base_of(walk))
            except InputError as error:
                missing.append(f"{walk.label} is not used: {error.what}.")
        found += own
    if left_out:
        missing.append(f"To keep the number of walks down, {len(left_out)} trials are not used: "
                       + ", ".join(walk.label for walk in left_out) + ".")
    return sorted(found, key=lambda base: (base.walk.fulcrum_mm, base.label))


def _positions(foot: FootParameters, *, quick: bool) -> np.ndarray:
    """(P,) m: the published positions that the carriage reaches; if that is not all of them, five over its reach."""
    low, high = foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m
    published = np.array(PUBLISHED_FULCRUMS_M)
    if (published < low - 1e-9).any() or (published > high + 1e-9).any():
        published = np.linspace(low, high, len(published))
    return published[[0, 2, 4]] if quick else published


def _draws(trials_by_positions: int, *, quick: bool) -> int:
    wished = round((QUICK_NOISY_WALKS if quick else NOISY_WALKS) / (RECORDINGS * trials_by_positions))
    return min(max(wished, FEWEST_DRAWS), MOST_DRAWS)


def _stiffness(foot: FootParameters, positions: np.ndarray) -> tuple[Callable[[float], float], np.ndarray]:
    """Stiffness of the model's foot on the bench (N/mm, mean slope from 200 to 600 N) at a position (mm)."""
    dense = np.linspace(positions[0], positions[-1], 9)
    both = np.concatenate([dense, positions])
    found = 1e-3 * BenchStiffness(foot, fulcrums_m=tuple(both), heel=False).evaluate({})[0]
    curve = PchipInterpolator(1e3 * dense, found[:len(dense)])
    return lambda at: float(curve(at)), found[len(dense):]


def _walked_curves(bases: Sequence[Base]) -> list[dict[str, Any]]:
    """Root mean square over stance between the mean resultants of two recorded settings, measured and simulated."""
    settings = sorted({base.walk.fulcrum_mm for base in bases})
    means = {x: [np.mean([getattr(b, kind).resultant for b in bases if b.walk.fulcrum_mm == x], axis=0)
                 for kind in ("measured", "simulated")] for x in settings}
    return [{"from_mm": a, "to_mm": b,
             **{f"{kind}_bw": float(np.sqrt(np.mean((means[b][k] - means[a][k]) ** 2)))
                for k, kind in enumerate(("measured", "simulated"))}}
            for i, a in enumerate(settings) for b in settings[i + 1:]]


def _say_what_is_missing(
    study: Study, bases: Sequence[Base], walked: Sequence[Walked], inverse: dict[str, Any], missing: list[str]
) -> None:
    count = sum(base.walk.role == HELD_OUT for base in bases)
    if count < FEWEST:
        why = "the offsets of every walk were fitted to its own plate" if any(
            base.walk.role == OFFSETS_FITTED for base in bases) else f"of held-out walks there are {count}"
        missing.append(f"The model's error is not known ({why}; {FEWEST} held-out walks are needed): what is "
                       "detectable is given by the noise of kinematics alone, which is a lower bound.")
    if not any(base.walk.trial.prosthetic_plate.has_cop for base in bases):
        missing.append("No plate tells the centre of pressure: the model's error in it is not known.")
    missing.append("No plate measures the keel's energy: what of it is detectable is given by the noise of kinematics "
                   "alone.")
    if len(study.conditions()) < 2:
        missing.append("All trials were recorded at one setting: settings cannot be compared as they were walked.")
    if inverse["sd_mm"] is None:
        missing.append("No trial was recorded with the fulcrum between the ends of the range: how far an estimate from "
                       "its plate scatters is not known.")
    failed = sum(w.failed for w in walked)
    if failed:
        missing.append(f"{failed} of the walks failed or have no whole stance and are left out.")
    if study.options.quick:
        missing.append("This is the short form: few draws at three positions, so that the limits are rough.")


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
