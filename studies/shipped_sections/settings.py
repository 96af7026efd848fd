"""Can two settings of the fulcrum be told apart, given the model's error and the noise of
kinematics?

Every motion is walked at every position with all else equal (`settings_walks`); the difference of
an outcome y that the model then predicts, y(x2) - y(x1), is held against what is detectable.
Somebody who walks at another setting moves otherwise, so the settings are also compared as they
were walked (`walked_rows`). The error of a difference has two independent parts:

1. Kinematic noise, by Monte Carlo. Draw d of trial t is a session with recordings r = 1, 2 of the
   same stride:

       same_recording   var [y_dr(x2) - y_dr(x1)]      one recording: the model's fulcrum moves
       same_session     var [y_d2(x2) - y_d1(x1)]      two: the session's error is common
       two_sessions     var y_dr(x2) + var y_dr(x1)    two recordings that share nothing

   each the mean over trials and recordings of the unbiased variance over the D draws.

2. Error of the model, simulated - measured, of n held-out walks: its mean cancels, its standard
   deviation s does not, and the difference of two walks has 2 s^2 (in the same recording an upper
   bound, for what the model gets wrong at both positions cancels). s contains the noise of the
   study's own recordings: the sum errs to the safe side.

The smallest detectable difference is the root of the sum of squares of t(0.975, T (D - 1)) times
the noise's standard deviation and of t(0.975, n - 1) sqrt(2) s; each part has its own t, so that it
never falls when noise is added. With fewer than FEWEST held-out walks s, and the sum, are unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.stats import t as student

from shipped_sections.settings_walks import (
    NAMES,
    OUTCOMES,
    RECORDINGS,
    Base,
    SettingWalk,
    base_of,
    walk_all,
)
from vsf_drake.base.errors import InputError
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.validation.settings_section import (
    CurveDifference,
    OutcomeRow,
    PairRow,
    SettingsTable,
    WalkedPair,
)
from vsf_drake.validation.study import FITTED, HELD_OUT, OFFSETS_FITTED, Section, Study
from vsf_drake.walks.numbers import finite, rms, spread
from vsf_drake.walks.recorded_walk import reached

NOISY_WALKS = 2700
QUICK_NOISY_WALKS = 108
MOST_DRAWS = 60
FEWEST_DRAWS = 3
MOST_A_SETTING = 3
QUICK_A_SETTING = 1
MOST_TRIALS = 12
FEWEST = 3
"""Held-out walks for a standard deviation."""
DESIGNS = ("same_recording", "same_session", "two_sessions")
REFERENCE_MM = 42.0
"""Distance of the two positions, one on each side of the middle, that an outcome's own row is
about: 87 and 129 mm."""


def settings_section(study: Study, *, progress: Progress | None = None) -> Section[SettingsTable]:
    """The section "Can two settings be told apart?". Arrays: `effects` (T, P, O) without noise."""
    quick = study.options.quick
    seed = study.options.seed
    bases, unusable, left_out = bases_of(study)
    unused = say("settings", "unused", unusable=unusable, left_out=left_out)
    if not bases:
        return Section(
            table=SettingsTable(answer="No walk of this study can tell."), missing=tuple(unused)
        )
    positions = np.array(PUBLISHED_FULCRUMS_M)
    foot = study.model.foot
    if len(reached(foot, positions)) < len(positions):  # then as many over the carriage's reach
        positions = np.linspace(foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m, len(positions))
    positions = positions[[0, 2, 4]] if quick else positions
    positions_mm = np.round(1e3 * positions, 6)
    clean = len(bases) * len(positions)
    requested = round((QUICK_NOISY_WALKS if quick else NOISY_WALKS) / (RECORDINGS * clean))
    draws = min(max(requested, FEWEST_DRAWS), MOST_DRAWS)
    walked = walk_all(
        bases,
        positions.tolist(),
        draws=draws,
        seed=seed,
        workers=study.options.workers,
        progress=progress,
    )
    held_out = [base for base in bases if base.walk.role == HELD_OUT]
    model = model_error(
        np.array([base.simulated.values - base.measured.values for base in held_out]).reshape(
            -1, len(NAMES)
        )
    )
    stiffness, at_positions = _stiffness(foot, positions)
    outcomes = outcome_rows(positions_mm, walked, model, stiffness)
    pairs = pair_rows(positions_mm, walked, model)
    as_walked = walked_rows(bases)
    table = SettingsTable(
        answer=answer(positions_mm.tolist(), outcomes, pairs, as_walked),
        outcomes=tuple(outcomes),
        pairs=tuple(pairs),
        draws=draws,
        seed=seed,
        positions_mm=tuple(positions_mm.tolist()),
        stiffness_n_per_mm=tuple(at_positions.tolist()),
        walks=clean * (1 + RECORDINGS * draws),
        failed_walks=sum(w.failed for w in walked),
        synthetic=study.synthetic,
        held_out_trials=len(held_out),
        held_out_rmse_bw=spread(base.walk.metrics.error_bw for base in held_out).mean,
        trials_mm=tuple(base.walk.fulcrum_mm for base in bases),
        curves=tuple(curve_rows(positions_mm, walked)),
        as_walked=tuple(as_walked),
        as_walked_apart_bw=tuple(_walked_apart(bases)),
    )
    return Section(
        table=table,
        arrays={"effects": _both(walked)[0]},
        missing=tuple(
            unused
            + say(
                "settings",
                "missing",
                held_out=len(held_out),
                fewest=FEWEST,
                conditions=len(study.conditions()),
                own_plates=any(base.walk.role == OFFSETS_FITTED for base in bases),
                has_cop=any(base.walk.trial.prosthetic_plate.has_cop for base in bases),
                failed=table.failed_walks,
                quick=quick,
            )
        ),
    )


def bases_of(study: Study) -> tuple[list[Base], list[tuple[str, str]], list[str]]:
    """Trials that are walked, by setting and name (held-out ones first where there are too many of
    a setting); those that cannot be, and why; those that are left out."""
    most = QUICK_A_SETTING if study.options.quick else MOST_A_SETTING
    bases: list[Base] = []
    unusable = []
    left_out = []
    for walks in study.conditions().values():
        before = len(bases)
        for walk in sorted(walks, key=lambda w: w.role != HELD_OUT):
            if len(bases) - before == most or len(bases) == MOST_TRIALS:
                left_out.append(walk.label)
                continue
            try:
                bases.append(base_of(walk))
            except InputError as error:
                unusable.append((walk.label, error.what))
    return (
        sorted(bases, key=lambda base: (base.walk.fulcrum_mm, base.walk.label)),
        unusable,
        left_out,
    )


def _stiffness(
    foot: FootParameters, positions: np.ndarray
) -> tuple[Callable[[float], float], np.ndarray]:
    """Stiffness of the model's foot on the bench (N/mm, mean slope from 200 to 600 N) at any
    position (mm), and at `positions` (m)."""
    dense = np.linspace(positions[0], positions[-1], 9)
    both = np.concatenate([dense, positions])
    stiffness = 1e-3 * BenchStiffness(foot, fulcrums_m=tuple(both), heel=False).evaluate({})[0]
    curve = PchipInterpolator(1e3 * dense, stiffness[: len(dense)])
    return lambda at: float(curve(at)), stiffness[len(dense) :]


def answer(
    at: Sequence[float],
    outcomes: Sequence[OutcomeRow],
    pairs: Sequence[PairRow],
    as_walked: Sequence[WalkedPair],
) -> str:
    """Two sentences: with the motion held at positions `at` (mm), and as the settings were
    walked."""
    unsure = [row.name for row in outcomes if row.limits["sdd_same_recording"] is None]
    known = len(unsure) < len(outcomes)
    travel = "smallest" if known else "noise"  # of keys: with the model's error, or without

    def counts(wanted: Sequence[tuple[float, float]]) -> tuple[int, int]:
        """How many are told apart, of how many that are known."""
        verdicts = [
            _exceeds(row.effect, row.limits["limit_same_recording"])
            for row in pairs
            if (row.from_mm, row.to_mm) in wanted and not (known and row.outcome in unsure)
        ]
        return verdicts.count(True), len(verdicts) - verdicts.count(None)

    def best(design: str) -> tuple[float, str, float | None] | None:
        """The smallest travel (mm), of which outcome, and its change of stiffness in the same
        recording."""
        rows = [
            (mm, row.title, row.limits["smallest_change_n_per_mm_same_recording"])
            for row in outcomes
            if (mm := row.limits[f"{travel}_travel_mm_{design}"]) is not None
        ]
        return min(rows, key=lambda row: row[0], default=None)

    sharpest = best("same_recording" if known else "same_session")
    apart = best("two_sessions")
    far = [
        row
        for row in as_walked
        if row.to_mm - row.from_mm == max(other.to_mm - other.from_mm for other in as_walked)
    ]
    judged = [row for row in far if row.told_apart is not None]
    titles = {row.name: row.title for row in outcomes}
    return say(
        "settings",
        "answer",
        low=at[0],
        high=at[-1],
        ends=counts([(at[0], at[-1])]),
        neighbours=counts(list(pairwise(at))),
        with_error=known,
        sharpest=sharpest and sharpest[:2],
        change=sharpest[2] if sharpest and known else None,
        apart_mm=apart and apart[0],
        walked=judged
        and {"from_mm": judged[0].from_mm, "to_mm": judged[0].to_mm, "known": len(judged)},
        walked_names=[titles[row.outcome] for row in judged if row.told_apart],
        energy_names=[
            titles[row.outcome] for row in far if row.told_apart is None and row.beyond_strides
        ],
    )[0]


# The statistics. What is not known is NaN; means, deviations and counts are of what is known.


@dataclass(frozen=True, eq=False)
class NoiseVariance:
    """Variance of a difference by kinematic noise, of outcomes (...)."""

    value: np.ndarray  # (...), outcome's unit squared
    freedom: float


@dataclass(frozen=True, eq=False)
class ModelError:
    """Simulated minus measured over held-out walks, of O outcomes; NaN where there are fewer than
    needed."""

    sd: np.ndarray
    count: np.ndarray  # (O,) walks


def noise_variance(design: str, first: np.ndarray, second: np.ndarray) -> NoiseVariance:
    """Variance of second - first, both (T, D, 2, ...) an outcome at two positions with the same
    noise."""
    if design == "two_sessions":
        squares = _squares(first) + _squares(second)
    else:
        squares = _squares(second - (first if design == "same_recording" else first[:, :, ::-1]))
    return NoiseVariance(
        _mean(squares.reshape(-1, *squares.shape[2:]), fewest=2),
        float(first.shape[0] * (first.shape[1] - 1)),
    )


def model_error(errors: np.ndarray) -> ModelError:
    """Of (n, O) errors, NaN where a walk does not tell."""
    known = np.ma.masked_invalid(errors)
    count = known.count(axis=0)
    return ModelError(
        np.where(count >= FEWEST, known.std(axis=0, ddof=1).filled(np.nan), np.nan), count
    )


def detectable(noise: NoiseVariance, model: ModelError | None = None) -> np.ndarray:
    """(..., O) the smallest detectable difference: with the model's error, or by the noise alone
    without `model`."""
    alone = quantile(noise.freedom) * np.sqrt(noise.value)
    return np.asarray(
        alone
        if model is None
        else np.hypot(alone, quantile(model.count - 1) * np.sqrt(2.0) * model.sd)
    )


def quantile(freedom: float | np.ndarray) -> np.ndarray:
    """t(0.975) for these degrees of freedom; NaN where there are none."""
    freedom = np.asarray(freedom, dtype=float)
    return np.where(freedom >= 1.0, student.ppf(0.975, np.maximum(freedom, 1.0)), np.nan)


def smallest_travel(travel: np.ndarray, effect: np.ndarray, limit: np.ndarray) -> float:
    """The least travel from which on the effect exceeds the limit, as far as `travel` (k,), rising,
    goes; NaN if it does not. Straight lines in between."""
    beyond = np.abs(effect) - limit
    if not np.isfinite(beyond).all() or beyond[-1] < 0.0:
        return float("nan")
    below = np.flatnonzero(beyond < 0.0)
    if not below.size:
        return float(travel[0])
    i = int(below[-1])
    return float(travel[i] + (travel[i + 1] - travel[i]) * -beyond[i] / (beyond[i + 1] - beyond[i]))


def _squares(x: np.ndarray) -> np.ndarray:
    """(T, D, ...) squared deviations from the mean over the draws, whose mean is the unbiased
    variance."""
    known = np.ma.masked_invalid(x)
    count = known.count(axis=1, keepdims=True)
    squares = (known - known.mean(axis=1, keepdims=True)) ** 2 * np.ma.divide(count, count - 1)
    return np.asarray(squares.mean(axis=2).filled(np.nan))


def _mean(values: np.ndarray, fewest: int = 1) -> np.ndarray:
    """Over the first axis, of what is known; NaN of fewer than `fewest`."""
    known = np.ma.masked_invalid(values)
    return np.where(known.count(axis=0) >= fewest, known.mean(axis=0).filled(np.nan), np.nan)


# Tables on which settings can be told apart: by outcome, by pair of positions, for curves, and as
# they were walked.


def outcome_rows(
    positions_mm: np.ndarray,
    walked: Sequence[SettingWalk],
    model: ModelError,
    stiffness: Callable[[float], float],
) -> list[OutcomeRow]:
    """What is detectable around the middle of the range; `stiffness` (N/mm) is that of the foot on
    the bench with the fulcrum at a position (mm)."""
    middle = 0.5 * (positions_mm[0] + positions_mm[-1])
    reach = positions_mm[-1] - positions_mm[0]
    apart = np.unique(np.append(np.arange(1.0, reach, 1.0), [min(REFERENCE_MM, reach), reach]))
    reference = int(np.flatnonzero(apart == min(REFERENCE_MM, reach))[0])
    ends = [
        [_between(positions_mm, values, middle + sign * apart / 2) for sign in (-1.0, 1.0)]
        for values in _both(walked)
    ]
    effect = _mean(ends[0][1] - ends[0][0])
    noises = {design: noise_variance(design, *ends[1]) for design in DESIGNS}
    rows = []
    for o, name in enumerate(NAMES):
        limits: dict[str, float | None] = {}
        for design, noise in noises.items():
            for prefix, way, error in (("", "smallest", model), ("noise_", "noise", None)):
                limit = detectable(noise, error)[:, o]
                # in the same recording effect and noise vanish together: no travel is too small
                travel = (
                    np.nan
                    if (way, design) == ("noise", "same_recording")
                    else smallest_travel(apart, effect[:, o], limit)
                )
                limits |= {
                    f"{prefix}sdd_{design}": finite(limit[reference]),
                    f"{way}_travel_mm_{design}": finite(travel),
                }
                if way == "smallest":
                    limits[f"smallest_change_n_per_mm_{design}"] = (
                        None
                        if np.isnan(travel)
                        else (stiffness(middle + travel / 2) - stiffness(middle - travel / 2))
                    )
        rows.append(
            OutcomeRow(
                name=name,
                title=OUTCOMES[name][0],
                unit=OUTCOMES[name][1],
                effect=finite(effect[reference, o]),
                effect_ends=finite(effect[-1, o]),
                model_error_sd=finite(model.sd[o]),
                model_error_n=int(model.count[o]),
                limits=limits,
            )
        )
    return rows


def pair_rows(
    positions_mm: np.ndarray, walked: Sequence[SettingWalk], model: ModelError
) -> list[PairRow]:
    """The effect of each pair of positions with the motion held, and what is detectable."""
    base, noisy = _both(walked)
    rows = []
    for i, j in combinations(range(len(positions_mm)), 2):
        effect = _mean(base[:, j] - base[:, i])
        limits = {}
        for design in DESIGNS:
            noise = noise_variance(design, noisy[..., i, :], noisy[..., j, :])
            limits[design] = np.where(
                np.isfinite(model.sd), detectable(noise, model), detectable(noise)
            )
        rows += [
            PairRow(
                outcome=name,
                from_mm=float(positions_mm[i]),
                to_mm=float(positions_mm[j]),
                effect=finite(effect[o]),
                limits={f"limit_{design}": finite(limit[o]) for design, limit in limits.items()},
            )
            for o, name in enumerate(NAMES)
        ]
    return rows


def curve_rows(positions_mm: np.ndarray, walked: Sequence[SettingWalk]) -> list[CurveDifference]:
    """The difference of whole curves for each pair of positions."""
    curves = np.array([w.resultant for w in walked])
    return [
        CurveDifference(
            from_mm=float(positions_mm[i]),
            to_mm=float(positions_mm[j]),
            rms_bw=finite(rms(_mean(curves[:, j] - curves[:, i]))),
        )
        for i, j in combinations(range(len(positions_mm)), 2)
    ]


def walked_rows(bases: Sequence[Base]) -> list[WalkedPair]:
    """What plates and model say of recorded settings, each walked with its own motion.

    Told apart if both differences exceed t times both standard errors, of what the model errs by
    and of the strides' own scatter, with the same sign: strides differ from one to the next at one
    setting too, and a model that follows each of them well tells the strides apart, not the
    settings.

    The walks that the fit has seen are left out if two settings have others; what the model errs by
    is told by held-out walks alone.
    """
    used = [base for base in bases if base.walk.role != FITTED]
    if len({base.walk.fulcrum_mm for base in used}) < 2:
        used = list(bases)
    settings = sorted({base.walk.fulcrum_mm for base in used})
    measured, simulated = (
        np.array([getattr(base, kind).values for base in used])
        for kind in ("measured", "simulated")
    )
    member = [np.array([base.walk.fulcrum_mm == x for base in used]) for x in settings]
    freedom = len(used) - len(settings)
    error_sd = _pooled(simulated - measured, member)
    stride_sd = _pooled(simulated, member)
    if any(base.walk.role != HELD_OUT for base in used):
        error_sd = np.full_like(error_sd, np.nan)
    rows = []
    for i, j in combinations(range(len(settings)), 2):
        of_model, of_plate = (
            _mean(x[member[j]]) - _mean(x[member[i]]) for x in (simulated, measured)
        )
        width = quantile(freedom) * np.sqrt(1.0 / member[i].sum() + 1.0 / member[j].sum())
        for o, name in enumerate(NAMES):
            limit = width * np.maximum(error_sd, stride_sd)[o]
            verdicts = _exceeds(of_model[o], limit), _exceeds(of_plate[o], limit)
            rows.append(
                WalkedPair(
                    outcome=name,
                    from_mm=settings[i],
                    to_mm=settings[j],
                    simulated=finite(of_model[o]),
                    measured=finite(of_plate[o]),
                    error_half_width=finite(width * error_sd[o]),
                    told_apart=None
                    if None in verdicts
                    else bool(all(verdicts) and of_model[o] * of_plate[o] > 0.0),
                    stride_half_width=finite(width * stride_sd[o]),
                    beyond_strides=_exceeds(of_model[o], width * stride_sd[o]),
                )
            )
    return rows


def _walked_apart(bases: Sequence[Base]) -> list[float]:
    means = [
        np.mean([base.measured.resultant for base in bases if base.walk.fulcrum_mm == x], axis=0)
        for x in sorted({base.walk.fulcrum_mm for base in bases})
    ]
    return [rms(b - a) for a, b in combinations(means, 2)]


def _both(walked: Sequence[SettingWalk]) -> tuple[np.ndarray, np.ndarray]:
    """(T, ...) outcomes of all trials: without noise, and with it."""
    return np.array([w.alone for w in walked]), np.array([w.noisy for w in walked])


def _between(positions: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Monotone cubics along the last axis but one, which is of positions; NaN where any position is
    missing."""
    whole = np.isfinite(values).all(axis=-2, keepdims=True)
    between = PchipInterpolator(positions, np.where(whole, values, 0.0), axis=-2)(at)
    return np.asarray(np.where(whole, between, np.nan))


def _pooled(values: np.ndarray, member: Sequence[np.ndarray]) -> np.ndarray:
    """(O,) standard deviation within settings; NaN without a setting that has two trials."""
    squares = sum(((values[m] - values[m].mean(axis=0)) ** 2).sum(axis=0) for m in member)
    freedom = len(values) - len(member)
    return np.asarray(
        np.sqrt(squares / freedom) if freedom > 0 else np.full(values.shape[1], np.nan)
    )


def _exceeds(effect: float | None, limit: float | None) -> bool | None:
    if effect is None or limit is None or not np.isfinite([effect, limit]).all():
        return None
    return bool(abs(effect) > limit)
