"""Can two settings of the fulcrum be told apart, given the model's error and the noise of kinematics?

Every motion is walked at every position with all else equal (`settings_walks`); the difference that the model then
predicts is held against what is detectable. The motion is held: somebody who walks at another setting moves otherwise
and keeps the forces more alike. So the settings are also compared as they were walked, each with its own motion
(`walked_rows`). As an independent route the fulcrum is estimated from the force alone.

No offset is fitted again after a draw. A laboratory that fits them in each session leaves less noise than stands here
for two sessions; but offsets that are fitted to the very plates that shall tell the setting can take up the fulcrum's
effect as well.

What is detectable. Let y(x) be an outcome of a walk with the fulcrum at x. What is compared is y(x2) - y(x1). Its error
has two independent parts, and what is drawn of the first is never fitted away:

1. Kinematic noise, by Monte Carlo. Draw d of trial t is a session with recordings r = 1, 2 of the same stride; the
   variance of the difference over the draws, pooled over trials, depends on the design:

       same_recording   y_dr(x2) - y_dr(x1)             one recording, the fulcrum is moved in the model alone
       same_session     y_d2(x2) - y_d1(x1)             two recordings; the session's error is common
       two_sessions     var y_dr(x2) + var y_dr(x1)     two recordings that share nothing

   Each variance is the mean over trials and recordings of the unbiased variance over the D draws. Its Monte Carlo
   standard error is that of the mean of the squared deviations, one a trial and draw.

2. Error of the model: e = simulated - measured of n held-out walks. Its mean is common to all settings and cancels. Its
   standard deviation s does not: the difference of two walks has 2 s^2. In the same recording, whatever the model gets
   wrong of this motion at both positions cancels as well; no trial was recorded at two positions, so that nobody can
   tell how much, and 2 s^2 is an upper bound there. s contains the noise of the study's own recordings, which is
   thus counted twice: the sum errs to the safe side.

The smallest detectable difference of two single walks is the root of the sum of two squares: of
t(0.975, T (D - 1)) sqrt(v), with the noise's variance v, and of t(0.975, n - 1) sqrt(2) s. Each part has its own t for
the few numbers that it comes from; that is on the safe side of one t with Welch's degrees of freedom and, unlike it,
never falls when noise is added. With fewer than FEWEST held-out walks s is unknown, and so is the sum. Without any true
difference one case of twenty exceeds it; a true difference of just its size is found half of the time, one 1.4 times as
large in four cases of five.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.stats import t as student

from vsf_drake.analysis.validation.settings_walks import (
    NAMES,
    OUTCOMES,
    RECORDINGS,
    Base,
    NoiseSizes,
    SettingWalk,
    base_of,
    walk_all,
)
from vsf_drake.analysis.validation.study import (
    FITTED,
    HELD_OUT,
    OFFSETS_FITTED,
    Progress,
    Section,
    Study,
    finite,
    reached,
    rms,
    spread,
)
from vsf_drake.errors import InputError
from vsf_drake.files import flat
from vsf_drake.parameters import FootParameters
from vsf_drake.sentences import say
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.bench_stiffness import BenchStiffness

NOISY_WALKS, QUICK_NOISY_WALKS = 2700, 108
MOST_DRAWS, FEWEST_DRAWS = 60, 3
MOST_A_SETTING, QUICK_A_SETTING, MOST_TRIALS = 3, 1, 12
CONFIDENCE = 0.95
FEWEST = 3
"""Held-out walks for a standard deviation."""
DESIGNS = ("same_recording", "same_session", "two_sessions")
REFERENCE_MM = 42.0
"""Distance of the two positions, one on each side of the middle, that an outcome's own row is about: 87 and 129 mm."""
CURVES = {"resultant": "BW", "cop": "FL"}


@dataclass(frozen=True, kw_only=True)
class OutcomeRow:
    """One outcome around the middle of the range, in its unit; None for what is not known.

    `limits` by design D, with "noise_" before those of the noise alone: the smallest detectable difference `sdd_D`,
    its Monte Carlo standard error `sdd_error_D`; the smallest travel of the fulcrum, `smallest_travel_mm_D` and by the
    noise `noise_travel_mm_D`, and what the former changes the stiffness by, `smallest_change_n_per_mm_D`.
    """

    name: str
    title: str
    unit: str
    effect: float | None  # of REFERENCE_MM
    effect_ends: float | None  # of the whole range
    effect_ends_sd: float | None
    model_error_mean: float | None
    model_error_sd: float | None
    model_error_n: int
    limits: Mapping[str, float | None] = flat()


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """One outcome and pair of positions with the motion held; `limits` are `sdd_D` and `told_apart_D` by design, with
    "noise_" before those of the noise alone."""

    outcome: str
    from_mm: float
    to_mm: float
    effect: float | None
    effect_sd: float | None
    limits: Mapping[str, float | bool | None] = flat()


@dataclass(frozen=True, kw_only=True)
class CurveDifferenceRow:
    """One curve and pair: root mean square over stance of the difference; `noise` by design is that of the noise in it
    (standard deviation), `rms_noise_D`, and the share of stance in which the difference exceeds t times it, `share_D`.
    """

    curve: str
    unit: str
    from_mm: float
    to_mm: float
    rms_difference: float | None
    noise: Mapping[str, float | None] = flat()


@dataclass(frozen=True, kw_only=True)
class WalkedPair:
    """One outcome and pair of recorded settings, each walked with its own motion: differences of their means."""

    outcome: str
    from_mm: float
    to_mm: float
    trials_from: int
    trials_to: int
    simulated: float | None
    measured: float | None
    error: float | None
    error_half_width: float | None  # t times the standard error of what the model errs by in it
    told_apart: bool | None
    stride_half_width: float | None  # the same of the strides' own scatter
    beyond_strides: bool | None


@dataclass(frozen=True, kw_only=True)
class WalkedCurve:
    """Root mean square over stance between the mean resultants of two recorded settings."""

    from_mm: float
    to_mm: float
    measured_bw: float | None
    simulated_bw: float | None


@dataclass(frozen=True, kw_only=True)
class InverseRow:
    """Where one trial's fulcrum (mm) seems to be: without noise, and of the noisy estimates. `sd_mm` is over sessions
    and recordings, `sd_recording_mm` over recordings alone; `model_...` are with the model's own walk as target."""

    label: str
    role: str
    fulcrum_mm: float
    interior: bool
    estimate_mm: float | None
    mean_mm: float | None
    sd_mm: float | None
    sd_recording_mm: float | None
    edge_share: float  # at an end of the range
    model_mean_mm: float | None
    model_sd_mm: float | None
    model_sd_recording_mm: float | None


@dataclass(frozen=True, kw_only=True)
class Inverse:
    """The estimates of all trials; pooled are the first three over the interior ones, the model's over all."""

    rows: tuple[InverseRow, ...]
    middle_mm: float
    draws: int
    trials_interior: int
    sd_mm: float | None
    sd_recording_mm: float | None
    bias_rms_mm: float | None
    model_sd_mm: float | None
    model_sd_recording_mm: float | None


@dataclass(frozen=True, kw_only=True)
class TrialOf:
    """A trial, the position it was recorded at, and what the fit has seen of it."""

    label: str
    fulcrum_mm: float
    role: str


@dataclass(frozen=True, kw_only=True)
class SettingsTable:
    """The section "Can two settings be told apart?"; with the first six alone if nothing could be walked."""

    answer: str
    outcomes: tuple[OutcomeRow, ...]
    pairs: tuple[PairRow, ...]
    draws: int  # sessions a trial
    seed: int
    fulcrum_estimate_sd_mm: float | None
    confidence: float = CONFIDENCE
    positions_mm: tuple[float, ...] = ()
    stiffness_n_per_mm: tuple[float, ...] = ()
    recordings_a_draw: int = RECORDINGS
    walks: int = 0
    failed_walks: int = 0
    synthetic: bool = True
    noise: NoiseSizes = field(default_factory=NoiseSizes)
    quick: bool = False
    held_out_trials: int = 0
    held_out_rmse_bw: float | None = None
    trials: tuple[TrialOf, ...] = ()
    names: tuple[str, ...] = NAMES
    curves: tuple[CurveDifferenceRow, ...] = ()
    as_walked: tuple[WalkedPair, ...] = ()
    as_walked_curves: tuple[WalkedCurve, ...] = ()
    inverse: Inverse | None = None


def settings_section(study: Study, *, progress: Progress | None = None) -> Section[SettingsTable]:
    """The section "Can two settings be told apart?". Arrays: `effects` (T, P, O) without noise."""
    quick, seed = study.options.quick, study.options.seed
    bases, unusable, left_out = _bases(study)
    unused = say("settings", "unused", unusable=unusable, left_out=left_out)
    if not bases:
        return Section(table=SettingsTable(answer="No walk of this study can tell.", outcomes=(), pairs=(), draws=0,
                                           seed=seed, fulcrum_estimate_sd_mm=None), missing=tuple(unused))
    positions, foot = np.array(PUBLISHED_FULCRUMS_M), study.model.foot
    if len(reached(foot, positions)) < len(positions):  # then as many over the carriage's reach
        positions = np.linspace(foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m, len(positions))
    positions = positions[[0, 2, 4]] if quick else positions
    positions_mm = np.round(1e3 * positions, 6)
    clean = len(bases) * len(positions)
    requested = round((QUICK_NOISY_WALKS if quick else NOISY_WALKS) / (RECORDINGS * clean))
    draws = min(max(requested, FEWEST_DRAWS), MOST_DRAWS)
    walked = walk_all(bases, positions.tolist(), draws=draws, seed=seed, workers=study.options.workers,
                      progress=progress)
    held_out = [base for base in bases if base.walk.role == HELD_OUT]
    model = model_error(np.array([base.simulated.values - base.measured.values for base in held_out]
                                 ).reshape(-1, len(NAMES)))
    stiffness, at_positions = _stiffness(foot, positions)
    inverse = inverse_table(positions_mm, walked)
    outcomes, pairs = outcome_rows(positions_mm, walked, model, stiffness), pair_rows(positions_mm, walked, model)
    as_walked = walked_rows(bases)
    table = SettingsTable(
        answer=answer(positions_mm.tolist(), outcomes, pairs, as_walked), outcomes=tuple(outcomes), pairs=tuple(pairs),
        draws=draws, seed=seed, fulcrum_estimate_sd_mm=inverse.sd_mm, positions_mm=tuple(positions_mm.tolist()),
        stiffness_n_per_mm=tuple(at_positions.tolist()), walks=clean * (1 + RECORDINGS * draws),
        failed_walks=sum(w.failed for w in walked), synthetic=study.synthetic, quick=quick,
        held_out_trials=len(held_out),
        held_out_rmse_bw=spread(base.walk.metrics.grf_rmse_bw for base in held_out).mean,
        trials=tuple(TrialOf(label=b.walk.label, fulcrum_mm=b.walk.fulcrum_mm, role=b.walk.role) for b in bases),
        curves=tuple(curve_rows(positions_mm, walked)), as_walked=tuple(as_walked),
        as_walked_curves=tuple(_walked_curves(bases)), inverse=inverse)
    return Section(table=table, arrays={"effects": np.array([w.alone["values"] for w in walked])},
                   missing=tuple(unused + say(
        "settings", "missing", held_out=len(held_out), fewest=FEWEST, conditions=len(study.conditions()),
        own_plates=any(base.walk.role == OFFSETS_FITTED for base in bases),
        has_cop=any(base.walk.trial.prosthetic_plate.has_cop for base in bases),
        interior=inverse.sd_mm is not None, failed=table.failed_walks, quick=quick)))


def _bases(study: Study) -> tuple[list[Base], list[tuple[str, str]], list[str]]:
    """Trials that are walked, by setting and name (held-out ones first where there are too many of a setting); those
    that cannot be, and why; those that are left out."""
    most = QUICK_A_SETTING if study.options.quick else MOST_A_SETTING
    bases: list[Base] = []
    unusable, left_out = [], []
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
    return sorted(bases, key=lambda base: (base.walk.fulcrum_mm, base.walk.label)), unusable, left_out


def _stiffness(foot: FootParameters, positions: np.ndarray) -> tuple[Callable[[float], float], np.ndarray]:
    """Stiffness of the model's foot on the bench (N/mm, mean slope from 200 to 600 N) at any position (mm), and at
    `positions` (m)."""
    dense = np.linspace(positions[0], positions[-1], 9)
    both = np.concatenate([dense, positions])
    stiffness = 1e-3 * BenchStiffness(foot, fulcrums_m=tuple(both), heel=False).evaluate({})[0]
    curve = PchipInterpolator(1e3 * dense, stiffness[:len(dense)])
    return lambda at: float(curve(at)), stiffness[len(dense):]


def answer(
    at: Sequence[float], outcomes: Sequence[OutcomeRow], pairs: Sequence[PairRow], as_walked: Sequence[WalkedPair]
) -> str:
    """Two sentences: with the motion held at positions `at` (mm), and as the settings were walked."""
    known = any(row.limits["sdd_same_recording"] is not None for row in outcomes)
    prefix, travel = ("", "smallest") if known else ("noise_", "noise")  # of keys: with the model's error, or without

    def counts(wanted: Sequence[tuple[float, float]]) -> tuple[int, int]:
        """How many are told apart, of how many that are known."""
        verdicts = [row.limits[f"{prefix}told_apart_same_recording"] for row in pairs
                    if (row.from_mm, row.to_mm) in wanted]
        return verdicts.count(True), len(verdicts) - verdicts.count(None)

    def best(design: str) -> tuple[float, str, float | None] | None:
        """The smallest travel (mm), of which outcome, and its change of stiffness in the same recording."""
        rows = [(mm, row.title, row.limits["smallest_change_n_per_mm_same_recording"]) for row in outcomes
                if (mm := row.limits[f"{travel}_travel_mm_{design}"]) is not None]
        return min(rows, key=lambda row: row[0], default=None)

    sharpest, apart = best("same_recording" if known else "same_session"), best("two_sessions")
    far = [row for row in as_walked
           if row.to_mm - row.from_mm == max(other.to_mm - other.from_mm for other in as_walked)]
    judged = [row for row in far if row.told_apart is not None]
    titles = {row.name: row.title for row in outcomes}
    return say(
        "settings", "answer", low=at[0], high=at[-1], ends=counts([(at[0], at[-1])]),
        neighbours=counts(list(pairwise(at))), with_error=known, sharpest=sharpest and sharpest[:2],
        change=sharpest[2] if sharpest and known else None, apart_mm=apart and apart[0],
        walked=judged and {"from_mm": judged[0].from_mm, "to_mm": judged[0].to_mm, "known": len(judged)},
        walked_names=[titles[row.outcome] for row in judged if row.told_apart],
        energy_names=[titles[row.outcome] for row in far if row.told_apart is None and row.beyond_strides])[0]


# The statistics. What is not known is NaN; means, deviations and counts are of what is known.


@dataclass(frozen=True, eq=False)
class NoiseVariance:
    """Variance of a difference by kinematic noise, of outcomes (...)."""

    value: np.ndarray  # (...), outcome's unit squared
    error: np.ndarray  # (...), its Monte Carlo standard error
    freedom: float


@dataclass(frozen=True, eq=False)
class ModelError:
    """Simulated minus measured over held-out walks, of O outcomes; NaN where there are fewer than needed."""

    mean: np.ndarray
    sd: np.ndarray
    count: np.ndarray  # (O,) walks


def noise_variance(design: str, first: np.ndarray, second: np.ndarray) -> NoiseVariance:
    """Variance of second - first, both (T, D, 2, ...) an outcome at two positions with the same noise."""
    if design == "two_sessions":
        squares = _squares(first) + _squares(second)
    else:
        squares = _squares(second - (first if design == "same_recording" else first[:, :, ::-1]))
    squares = np.ma.masked_invalid(squares)
    count = squares.count(axis=(0, 1))
    error = squares.std(axis=(0, 1), ddof=1) / np.sqrt(np.maximum(count, 1))
    return NoiseVariance(np.where(count > 1, squares.mean(axis=(0, 1)).filled(np.nan), np.nan), error.filled(np.nan),
                         float(first.shape[0] * (first.shape[1] - 1)))


def model_error(errors: np.ndarray) -> ModelError:
    """Of (n, O) errors, NaN where a walk does not tell."""
    known = np.ma.masked_invalid(errors)
    count = known.count(axis=0)
    return ModelError(_mean(errors), np.where(count >= FEWEST, known.std(axis=0, ddof=1).filled(np.nan), np.nan), count)


def detectable(noise: NoiseVariance, model: ModelError | None = None) -> np.ndarray:
    """(..., O) the smallest detectable difference: with the model's error, or by the noise alone without `model`."""
    alone = quantile(noise.freedom) * np.sqrt(noise.value)
    return np.asarray(alone if model is None else np.hypot(
        alone, quantile(model.count - 1) * np.sqrt(2.0) * model.sd))


def detectable_error(noise: NoiseVariance, model: ModelError | None = None) -> np.ndarray:
    """(..., O) Monte Carlo standard error of `detectable`: that of the noise's variance, to first order."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(0.5 * quantile(noise.freedom) ** 2 * noise.error / detectable(noise, model))


def quantile(freedom: float | np.ndarray) -> np.ndarray:
    """t(0.975) for these degrees of freedom; NaN where there are none."""
    freedom = np.asarray(freedom, dtype=float)
    return np.where(freedom >= 1.0, student.ppf(0.5 + 0.5 * CONFIDENCE, np.maximum(freedom, 1.0)), np.nan)


def smallest_travel(travel: np.ndarray, effect: np.ndarray, limit: np.ndarray) -> float:
    """The least travel from which on the effect exceeds the limit, as far as `travel` (k,), rising, goes; NaN if it
    does not. Straight lines in between."""
    beyond = np.abs(effect) - limit
    if not np.isfinite(beyond).all() or beyond[-1] < 0.0:
        return float("nan")
    below = np.flatnonzero(beyond < 0.0)
    if not below.size:
        return float(travel[0])
    i = int(below[-1])
    return float(travel[i] + (travel[i + 1] - travel[i]) * -beyond[i] / (beyond[i + 1] - beyond[i]))


def _squares(x: np.ndarray) -> np.ndarray:
    """(T, D, ...) squared deviations from the mean over the draws, whose mean is the unbiased variance."""
    known = np.ma.masked_invalid(x)
    count = known.count(axis=1, keepdims=True)
    squares = (known - known.mean(axis=1, keepdims=True)) ** 2 * np.ma.divide(count, count - 1)
    return np.asarray(squares.mean(axis=2).filled(np.nan))


def _mean(values: np.ndarray) -> np.ndarray:
    """Over the first axis, of what is known."""
    return np.asarray(np.ma.masked_invalid(values).mean(axis=0).filled(np.nan))


# Tables on which settings can be told apart: by outcome, by pair of positions, for curves, and as they were walked.


def outcome_rows(
    positions_mm: np.ndarray, walked: Sequence[SettingWalk], model: ModelError, stiffness: Callable[[float], float]
) -> list[OutcomeRow]:
    """What is detectable around the middle of the range; `stiffness` (N/mm) is that of the foot on the bench with the
    fulcrum at a position (mm)."""
    middle, reach = 0.5 * (positions_mm[0] + positions_mm[-1]), positions_mm[-1] - positions_mm[0]
    apart = np.unique(np.append(np.arange(1.0, reach, 1.0), [min(REFERENCE_MM, reach), reach]))
    reference = int(np.flatnonzero(apart == min(REFERENCE_MM, reach))[0])
    ends = [[_between(positions_mm, values, middle + sign * apart / 2) for sign in (-1.0, 1.0)]
            for values in _both(walked, "values")]
    effects = ends[0][1] - ends[0][0]
    effect = _mean(effects)
    noises = {design: noise_variance(design, *ends[1]) for design in DESIGNS}
    rows = []
    for o, name in enumerate(NAMES):
        limits: dict[str, float | None] = {}
        for design, noise in noises.items():
            for prefix, way, error in (("", "smallest", model), ("noise_", "noise", None)):
                limit = detectable(noise, error)[:, o]
                # in the same recording effect and noise vanish together: no travel is too small
                travel = np.nan if (way, design) == ("noise", "same_recording") else smallest_travel(
                    apart, effect[:, o], limit)
                limits |= {f"{prefix}sdd_{design}": finite(limit[reference]),
                           f"{prefix}sdd_error_{design}": finite(detectable_error(noise, error)[reference, o]),
                           f"{way}_travel_mm_{design}": finite(travel)}
                if way == "smallest":
                    limits[f"smallest_change_n_per_mm_{design}"] = None if np.isnan(travel) else (
                        stiffness(middle + travel / 2) - stiffness(middle - travel / 2))
        rows.append(OutcomeRow(
            name=name, title=OUTCOMES[name][0], unit=OUTCOMES[name][1], effect=finite(effect[reference, o]),
            effect_ends=finite(effect[-1, o]), effect_ends_sd=spread(effects[:, -1, o]).sd,
            model_error_mean=finite(model.mean[o]), model_error_sd=finite(model.sd[o]),
            model_error_n=int(model.count[o]), limits=limits))
    return rows


def pair_rows(positions_mm: np.ndarray, walked: Sequence[SettingWalk], model: ModelError) -> list[PairRow]:
    """The effect of each pair of positions with the motion held, and whether it exceeds the error."""
    base, noisy = _both(walked, "values")
    rows = []
    for i, j in combinations(range(len(positions_mm)), 2):
        effects = base[:, j] - base[:, i]
        effect = _mean(effects)
        limits = {(design, prefix): detectable(noise_variance(design, noisy[..., i, :], noisy[..., j, :]), error)
                  for design in DESIGNS for prefix, error in (("", model), ("noise_", None))}
        for o, name in enumerate(NAMES):
            judged: dict[str, float | bool | None] = {}
            for (design, prefix), limit in limits.items():
                judged |= {f"{prefix}sdd_{design}": finite(limit[o]),
                           f"{prefix}told_apart_{design}": _exceeds(effect[o], limit[o])}
            rows.append(PairRow(outcome=name, from_mm=float(positions_mm[i]), to_mm=float(positions_mm[j]),
                                effect=finite(effect[o]), effect_sd=spread(effects[:, o]).sd, limits=judged))
    return rows


def curve_rows(positions_mm: np.ndarray, walked: Sequence[SettingWalk]) -> list[CurveDifferenceRow]:
    """The difference of whole curves for each pair of positions, each percent of stance for itself."""
    rows = []
    for name, unit in CURVES.items():
        base, noisy = _both(walked, name)
        for i, j in combinations(range(len(positions_mm)), 2):
            difference = _mean(base[:, j] - base[:, i])
            known, noise = np.isfinite(difference), dict[str, float | None]()
            for design in DESIGNS:
                own = noise_variance(design, noisy[..., i, :], noisy[..., j, :])
                beyond = np.abs(difference[known]) > detectable(own)[known]
                noise |= {f"rms_noise_{design}": finite(rms(np.sqrt(own.value[known]))),
                          f"share_{design}": float(beyond.mean()) if known.any() else None}
            rows.append(CurveDifferenceRow(curve=name, unit=unit, from_mm=float(positions_mm[i]),
                                           to_mm=float(positions_mm[j]),
                                           rms_difference=finite(rms(difference)), noise=noise))
    return rows


def walked_rows(bases: Sequence[Base]) -> list[WalkedPair]:
    """What plates and model say of recorded settings, each walked with its own motion.

    Told apart if both differences exceed t times both standard errors, of what the model errs by and of the strides'
    own scatter, with the same sign: strides differ from one to the next at one setting too, and a model that follows
    each of them well tells the strides apart, not the settings.

    The walks that the fit has seen are left out if two settings have others; what the model errs by is told by held-out
    walks alone.
    """
    used = [base for base in bases if base.walk.role != FITTED]
    if len({base.walk.fulcrum_mm for base in used}) < 2:
        used = list(bases)
    settings = sorted({base.walk.fulcrum_mm for base in used})
    measured, simulated = (np.array([getattr(base, kind).values for base in used])
                           for kind in ("measured", "simulated"))
    member = [np.array([base.walk.fulcrum_mm == x for base in used]) for x in settings]
    freedom = len(used) - len(settings)
    error_sd, stride_sd = _pooled(simulated - measured, member), _pooled(simulated, member)
    if any(base.walk.role != HELD_OUT for base in used):
        error_sd = np.full_like(error_sd, np.nan)
    rows = []
    for i, j in combinations(range(len(settings)), 2):
        of_model, of_plate = (_mean(x[member[j]]) - _mean(x[member[i]]) for x in (simulated, measured))
        width = quantile(freedom) * np.sqrt(1.0 / member[i].sum() + 1.0 / member[j].sum())
        for o, name in enumerate(NAMES):
            limit = width * np.maximum(error_sd, stride_sd)[o]
            verdicts = _exceeds(of_model[o], limit), _exceeds(of_plate[o], limit)
            rows.append(WalkedPair(
                outcome=name, from_mm=settings[i], to_mm=settings[j], trials_from=int(member[i].sum()),
                trials_to=int(member[j].sum()), simulated=finite(of_model[o]), measured=finite(of_plate[o]),
                error=finite(of_model[o] - of_plate[o]), error_half_width=finite(width * error_sd[o]),
                told_apart=None if None in verdicts else bool(all(verdicts) and of_model[o] * of_plate[o] > 0.0),
                stride_half_width=finite(width * stride_sd[o]),
                beyond_strides=_exceeds(of_model[o], width * stride_sd[o])))
    return rows


def _walked_curves(bases: Sequence[Base]) -> list[WalkedCurve]:
    settings = sorted({base.walk.fulcrum_mm for base in bases})
    means = {(kind, x): np.mean([getattr(b, kind).resultant for b in bases if b.walk.fulcrum_mm == x], axis=0)
             for kind in ("measured", "simulated") for x in settings}
    apart = {(kind, a, b): finite(np.sqrt(np.mean((means[kind, b] - means[kind, a]) ** 2)))
             for kind in ("measured", "simulated") for a, b in combinations(settings, 2)}
    return [WalkedCurve(from_mm=a, to_mm=b, measured_bw=apart["measured", a, b], simulated_bw=apart["simulated", a, b])
            for a, b in combinations(settings, 2)]


def _both(walked: Sequence[SettingWalk], name: str) -> tuple[np.ndarray, np.ndarray]:
    """(T, ...) of all trials: without noise, and with it."""
    return np.array([w.alone[name] for w in walked]), np.array([w.noisy[name] for w in walked])


def _between(positions: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Monotone cubics along the last axis but one, which is of positions; NaN where any position is missing."""
    whole = np.isfinite(values).all(axis=-2, keepdims=True)
    between = PchipInterpolator(positions, np.where(whole, values, 0.0), axis=-2)(at)
    return np.asarray(np.where(whole, between, np.nan))


def _pooled(values: np.ndarray, member: Sequence[np.ndarray]) -> np.ndarray:
    """(O,) standard deviation within settings; NaN without a setting that has two trials."""
    squares = sum(((values[m] - values[m].mean(axis=0)) ** 2).sum(axis=0) for m in member)
    freedom = len(values) - len(member)
    return np.asarray(np.sqrt(squares / freedom) if freedom > 0 else np.full(values.shape[1], np.nan))


def _exceeds(effect: float, limit: float) -> bool | None:
    return bool(abs(effect) > limit) if np.isfinite(effect) and np.isfinite(limit) else None


# The inverse question: where does the fulcrum seem to be, told by the force alone?
#
# A walk whose kinematics carry noise is compared, at each position of the fulcrum, with a resultant force that has
# none: the position with the least root mean square difference (resultant low-passed at 40 Hz, time-locked, stance ±
# 0.25 s) is the estimate. Between the positions that were walked the resultant of every instant is interpolated by a
# monotone cubic; against walks every 8.5 mm this moves an estimate by less than 1 mm. Nothing else is fitted: offsets
# that a laboratory would fit anew in each session would take up part of the noise, and part of the fulcrum.
#
# The target is the measured plate, where the trial's own fulcrum stood between the ends of the range (at an end an
# estimate can err to one side only, which would flatter its spread); and, for every trial, the model's own walk without
# noise at the middle of the range, which leaves out the error of the model.

FINE_MM = 0.5


def fulcrum_estimates(positions_mm: np.ndarray, locked: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(...) mm, the position at which the resultants `locked` (..., P, n) at positions (P,), rising, fit `target` (n,)
    best; NaN where a walk is missing."""
    fine = np.append(np.arange(positions_mm[0], positions_mm[-1], FINE_MM), positions_mm[-1])
    walks = locked.reshape(-1, *locked.shape[-2:])
    estimates = np.full(len(walks), np.nan)
    for i, curves in enumerate(walks):
        if np.isfinite(curves).all():
            error = np.mean((PchipInterpolator(positions_mm, curves, axis=0)(fine) - target) ** 2, axis=1)
            estimates[i] = _lowest(fine, error)
    return estimates.reshape(locked.shape[:-2])


def inverse_table(positions_mm: np.ndarray, walked: Sequence[SettingWalk]) -> Inverse:
    """What the estimates say."""
    middle = 0.5 * (positions_mm[0] + positions_mm[-1])
    rows = []
    for w in walked:
        base, locked = w.base, w.alone["locked"]
        plate = np.interp(w.time_s, base.measured.time_s, base.measured.locked)
        own = PchipInterpolator(positions_mm, locked, axis=0)(middle) if np.isfinite(locked).all() \
            else np.full(len(w.time_s), np.nan)
        noisy, virtual = (fulcrum_estimates(positions_mm, w.noisy["locked"], target) for target in (plate, own))
        (mean, sd, sd_recording), (model_mean, model_sd, model_recording) = _spreads(noisy), _spreads(virtual)
        at = base.walk.fulcrum_mm
        edge = (noisy <= positions_mm[0]) | (noisy >= positions_mm[-1])
        rows.append(InverseRow(
            label=base.walk.label, role=base.walk.role, fulcrum_mm=at,
            interior=bool(positions_mm[0] + 1.0 < at < positions_mm[-1] - 1.0),
            estimate_mm=finite(float(fulcrum_estimates(positions_mm, locked, plate))), mean_mm=mean, sd_mm=sd,
            sd_recording_mm=sd_recording, edge_share=float(np.mean(edge)), model_mean_mm=model_mean,
            model_sd_mm=model_sd, model_sd_recording_mm=model_recording))
    interior = [row for row in rows if row.interior]
    return Inverse(
        rows=tuple(rows), middle_mm=float(middle), draws=sum(w.noisy["locked"].shape[0] for w in walked),
        trials_interior=len(interior), sd_mm=finite(rms(row.sd_mm for row in interior)),
        sd_recording_mm=finite(rms(row.sd_recording_mm for row in interior)),
        bias_rms_mm=finite(rms(row.estimate_mm - row.fulcrum_mm for row in interior if row.estimate_mm is not None)),
        model_sd_mm=finite(rms(row.model_sd_mm for row in rows)),
        model_sd_recording_mm=finite(rms(row.model_sd_recording_mm for row in rows)))


def _spreads(estimates: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Of (D, 2) estimates, two recordings a draw: mean, SD over the draws, SD over the recordings of a draw."""
    return (spread(estimates.ravel()).mean, finite(rms(spread(recording).sd for recording in estimates.T)),
            finite(np.sqrt(0.5) * rms(np.diff(estimates, axis=1).ravel())))  # the difference has twice the variance


def _lowest(x: np.ndarray, y: np.ndarray) -> float:
    """Where y is least, on the parabola through its lowest sample and the two beside it."""
    i = int(np.argmin(y))
    if not 0 < i < len(x) - 1:
        return float(x[i])
    before, after = x[i - 1] - x[i], x[i + 1] - x[i]
    left, right = (y[i - 1] - y[i]) / before, (y[i + 1] - y[i]) / after
    curvature = (right - left) / (after - before)
    return float(x[i] + np.clip(-0.5 * (left - curvature * before) / curvature, before, after)) if curvature > 0.0 \
        else float(x[i])
