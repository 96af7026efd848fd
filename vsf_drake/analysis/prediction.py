"""A prediction in three layers, of a walk whose plate was not used.

*Physics*: the fitted foot under the recorded motion.

*Momentum*: while the intact foot swings, the prosthesis alone carries the person:

    F = m (a_com - g) = F_foot + F_held,        F_held the loads that hold the pelvis's prescribed translations.

The walk has F_held for free. Height, hip, knee and alignment of this one trial are corrected by Gauss-Newton so that
the foot gives what momentum needs, by Legendre coefficients 0, 1, 2 over each window,

    minimise over c    |(L needed - bias - L foot(c)) / sigma|^2 + |c / prior|^2,

with bias the mean over the fitted trials of L (needed - plate): what the recorded motion misses of the person's own
momentum. The derivative of the foot's force is exact; that of m a_com, some hundredths of a percent of body weight per
degree, is left out of the Jacobian, not of the residual.

*Discrepancy*: plate less corrected model of the fitted trials over 101 points of the model's stance, added where it was
earned. For each force component it is a Gaussian process over the fulcrum, of mean zero, between trials i and j

    cov = shared exp(-(l_i - l_j)^2 / 2 SMOOTH^2) + own exp(-(l_i - l_j)^2 / 2 SETTING^2) + (1 - shared - own) [i = j]

What settings share has to predict each setting that is left out, what a setting has to itself each trial that is left
out; noise earns nothing. Where no setting was fitted twice, the latter cannot be tried and is UNTRIED. The model is
Kennedy & O'Hagan 2001 (Bayesian calibration of computer models, J. R. Stat. Soc. B 63, 425-464,
doi 10.1111/1467-9868.00294): observation = code + discrepancy + error, the discrepancy a Gaussian process that is
independent of the code. Of the paper its summary was read, of that model the account in Learning from Data for
Physicists (nucleartalent.github.io/LFD_for_Physicists, "The KOH and BOH frameworks"). Their scale factor of the code is
1 here, their posterior is replaced by what is left out.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.stats import chi2

from vsf_drake.analysis.comparison import (
    PERCENT,
    Comparison,
    compare,
    percent_instants,
    walk_axes,
    walking_direction,
)
from vsf_drake.analysis.metrics import agreement, null_model_rmse, stance_curve
from vsf_drake.contact_file import Discrepancy, DiscrepancyCurve, FittedContact, MomentumBias
from vsf_drake.errors import SimulationError
from vsf_drake.motion.events import runs
from vsf_drake.motion.fitted_trial import fingerprint, trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.sentences import say
from vsf_drake.simulation.reactions import LOADED_N, follow
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walk, Walker

PHYSICS, MOMENTUM, DISCREPANCY = LAYERS = ("physics", "momentum", "discrepancy")
COMPONENTS = ("fore_aft_bw", "lateral_bw", "vertical_bw")
SIGMA_BW = np.array([1.6, 3.0, 3.0, 2.0, 2.4, 3.0]) / 100.0
"""Error of what momentum needs, fore-aft then vertical, coefficients 0, 1, 2 each."""
PRIOR = np.array([1e-3, *np.radians([0.5, 0.5, 0.5])])
"""Standard deviations (m, rad) of what height, hip, knee and alignment of one trial are off."""
MOST_STEPS, ENOUGH = 4, 0.02  # of Gauss-Newton; it ends when no correction moves by this share of its prior
FIT_STEP_S = 2e-3
SWINGING_M_PER_S, TRIMMED_S, SHORTEST_S = 0.75, 0.02, 0.2
"""A window: the intact foot's slowest sphere is faster than this, less so much at both ends, and as long as this."""
UNLIKELY = 0.99
"""Share of its chi-squared distribution beyond which the bias differs too much between the fitted trials, or a trial's
momentum from its foot, to be believed."""
SMOOTH_M, SETTING_M = 0.085, 0.01
"""Over which discrepancies of different settings resemble each other (the carriage's way), and those of one setting."""
UNTRIED = 0.6
"""Share of a discrepancy that another trial of the same setting has too, where no setting was fitted twice: a choice,
made on two synthetic persons, of whom 0.8 to 1 would have been best in most components."""
SHARES = np.linspace(0.0, 1.0, 11)


@dataclass(frozen=True, kw_only=True)
class MomentumCorrection:
    """What the momentum layer did to one trial.

    Attributes:
        believed: whether it did anything. why_not: "bias" if the file has none, "spread" if the fitted trials' biases
            differ too much, "window" if the intact foot was not seen to swing, "surprise" if foot and momentum are
            farther apart than their errors explain, "walk" if a walk failed.
        height_m, hip_flexion_rad, knee_angle_rad, alignment_rad: added to the trial.
        surprise: squared distance of foot and momentum before, over the most that is believed; None if not known.
        missing_bw: what the foot's force lacked before and after, as SIGMA_BW.
    """

    believed: bool
    why_not: str = ""
    height_m: float = 0.0
    hip_flexion_rad: float = 0.0
    knee_angle_rad: float = 0.0
    alignment_rad: float = 0.0
    surprise: float | None = None
    missing_bw: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    windows_s: tuple[tuple[float, float], ...] = ()
    wall_s: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredWalk:
    """A trial's walk in layers; each comparison holds the model of its layer."""

    comparisons: Mapping[str, Comparison]
    results: Mapping[str, WalkResult]  # the discrepancy has that of the momentum: it moves no centre of pressure
    correction: MomentumCorrection
    added_bw: np.ndarray  # (101, 3) discrepancy that was added over the model's stance; zeros where none was earned


@dataclass(frozen=True, kw_only=True)
class LayerScore:
    """How far one layer is off the plate (`metrics.Agreement`)."""

    grf_rmse_bw: float | None
    vertical_rmse_bw: float | None
    fore_aft_rmse_bw: float | None
    medio_lateral_rmse_bw: float | None
    cop_rmse_fl: float | None
    cop_ml_rmse_fl: float | None


@dataclass(frozen=True, kw_only=True)
class TrialLayers:
    """One trial in layers, and the null model's error (BW) with the measured times of stance and with those that the
    physics predicts; None where the file has no curve of another trial."""

    label: str
    fitted: bool
    fulcrum_mm: float
    layers: Mapping[str, LayerScore]
    null_model_grf_rmse_bw: float | None
    null_model_predicted_times_grf_rmse_bw: float | None
    correction: MomentumCorrection
    added_rms_bw: float  # root mean square of the discrepancy that was added


@dataclass(frozen=True, kw_only=True)
class LayerTable:
    """A fit's predictions in layers, and what its plates taught; `untried` where no setting was fitted twice."""

    trials: tuple[TrialLayers, ...]
    momentum: MomentumBias | None
    discrepancy: Discrepancy | None
    untried: bool

    def mean(self, layer: str, key: str, *, fitted: bool = False) -> float | None:
        """Mean of a layer's score over the held-out trials, or the fitted ones; None without one."""
        known = [value for row in self.trials
                 if row.fitted == fitted and (value := getattr(row.layers[layer], key)) is not None]
        return float(np.mean(known)) if known else None

    @property
    def earned(self) -> str | None:
        """The layer that is nearest to the held-out trials' plates, of equals the lower one; None without one."""
        errors = {layer: error for layer in LAYERS if (error := self.mean(layer, "grf_rmse_bw")) is not None}
        return min(errors, key=lambda layer: errors[layer], default=None)

    def teach(self, contact: FittedContact) -> FittedContact:
        """The contact with what the plates taught."""
        return replace(contact, momentum=self.momentum, discrepancy=self.discrepancy)


def variables_of(trial: Trial) -> tuple[str, ...]:
    """Variables of a walk that the momentum layer corrects, in the order of PRIOR."""
    side = trial.subject.prosthetic_side[0]
    return ("offset.height", f"coordinate.hip_flexion_{side}", f"coordinate.knee_angle_{side}", "offset.alignment")


def predict(
    trial: Trial, contact: FittedContact, *, walker: Walker, step_s: float, errors: Mapping[str, float] | None = None
) -> LayeredWalk:
    """A trial that has the fitted contact (`trial_with`) in layers; `walker` is of its subject and model. `errors` are
    further variables of its walk, by name, of which the layers know nothing.

    Raises:
        SimulationError: the walk of the physics fails.
    """
    errors, bias = errors or {}, contact.momentum
    physics, result = _compared(walker, trial, errors, step_s)
    correction = MomentumCorrection(believed=False, why_not="bias") if bias is None else corrected(
        walker, trial, bias, heading=physics.heading, errors=errors)
    second = physics, result
    if correction.believed:
        c = correction.height_m, correction.hip_flexion_rad, correction.knee_angle_rad, correction.alignment_rad
        second = _compared(walker, trial, _with(errors, trial, np.array(c)), step_s)
    added = np.zeros((len(PERCENT), 3))
    if contact.discrepancy is not None:
        added = interpolated(contact.discrepancy, trial.fulcrum_m)
    third = replace(second[0], model=second[0].model + trial.subject.mass_kg * GRAVITY * over_stances(
        second[0], added))
    return LayeredWalk(
        comparisons=dict(zip(LAYERS, (physics, second[0], third), strict=True)), correction=correction, added_bw=added,
        results=dict(zip(LAYERS, (result, second[1], second[1]), strict=True)))


def learned(contact: FittedContact, trials: Sequence[Trial], *, walker: Walker, step_s: float) -> FittedContact:
    """The contact with what the plates of the trials that it was fitted to, as recorded, teach the other two layers."""
    applied = [trial_with(trial, contact) for trial in trials]
    prints = [fingerprint(trial) for trial in trials]
    biases = {text: own for trial, text in zip(applied, prints, strict=True)
              if (own := missed(walker, trial)) is not None}
    contact = replace(contact, momentum=None, discrepancy=None)
    if biases:
        every = np.array([*biases.values()])
        mean, sd = every.mean(axis=0), every.std(axis=0, ddof=1) if len(every) > 1 else None
        contact = replace(contact, momentum=MomentumBias(
            fore_aft_bw=_numbers(mean[:3]), vertical_bw=_numbers(mean[3:]), trials=tuple(biases),
            fore_aft_sd_bw=None if sd is None else _numbers(sd[:3]),
            vertical_sd_bw=None if sd is None else _numbers(sd[3:])))
    curves = []
    for trial, text in zip(applied, prints, strict=True):
        walk = predict(trial, contact, walker=walker, step_s=step_s)
        delta = remaining(walk.comparisons[MOMENTUM], trial.subject.mass_kg * GRAVITY)
        measured = stance_curve(trial.prosthetic_plate, subject_mass_kg=trial.subject.mass_kg)
        if delta is not None and measured is not None:
            curves.append(DiscrepancyCurve(
                fingerprint=text, fulcrum_m=trial.fulcrum_m, measured_bw=_numbers(measured),
                **{name: _numbers(column) for name, column in zip(COMPONENTS, delta.T, strict=True)}))
    return replace(contact, discrepancy=earned(curves)) if curves else contact


def layers_of(trial: Trial, label: str, contact: FittedContact, *, walker: Walker, step_s: float) -> TrialLayers:
    """A recorded trial in layers, beside its plate and the null model; raises what `predict` does."""
    own, weight, learned_of = fingerprint(trial), trial.subject.mass_kg * GRAVITY, contact.discrepancy
    walk = predict(trial_with(trial, contact), contact, walker=walker, step_s=step_s)
    scores = {}
    for layer in LAYERS:
        found = agreement(walk.comparisons[layer], trial.prosthetic_plate, body_weight_n=weight,
                          foot_length_m=walk.results[layer].foot_length_m)
        scores[layer] = LayerScore(**{field.name: getattr(found, field.name) for field in fields(LayerScore)})
    measured = [np.array(curve.measured_bw) for curve in learned_of.curves if curve.fingerprint != own
                ] if learned_of else []
    nulls = [[error for curve in measured if (error := null_model_rmse(
        walk.comparisons[PHYSICS], weight, curve, predicted=predicted)) is not None] for predicted in (False, True)]
    return TrialLayers(
        label=label, fitted=own in {one.fingerprint for one in contact.trials}, fulcrum_mm=1e3 * trial.fulcrum_m,
        layers=scores, correction=walk.correction, null_model_grf_rmse_bw=min(nulls[0], default=None),
        null_model_predicted_times_grf_rmse_bw=min(nulls[1], default=None),
        added_rms_bw=float(np.sqrt(np.mean(np.sum(walk.added_bw**2, axis=1)))))


def layer_table(
    contact: FittedContact, fitted: Sequence[Trial], held_out: Sequence[Trial], labels: Sequence[str], *, step_s: float
) -> LayerTable:
    """What the trials that a contact was fitted to teach, and all trials, as recorded, in layers; labels of both."""
    applied = trial_with(fitted[0], contact)
    walker = Walker(applied.subject, applied.model)
    contact = learned(contact, fitted, walker=walker, step_s=step_s)
    rows = tuple(layers_of(trial, label, contact, walker=walker, step_s=step_s)
                 for trial, label in zip([*fitted, *held_out], labels, strict=True))
    curves = contact.discrepancy.curves if contact.discrepancy else ()
    return LayerTable(trials=rows, momentum=contact.momentum, discrepancy=contact.discrepancy,
                      untried=not _alike_settings(np.array([curve.fulcrum_m for curve in curves]))[1].any())


def layer_sentences(table: LayerTable) -> list[str]:
    """Which layer the held-out trials earn, and what keeps the others from it."""
    rows = [row for row in table.trials if not row.fitted] or [*table.trials]
    nulls = [[error for row in rows if (error := getattr(row, f"null_model_{name}grf_rmse_bw")) is not None]
             for name in ("", "predicted_times_")]
    known = table.discrepancy
    return say(
        "prediction", earned=table.earned, **{layer: table.mean(layer, "grf_rmse_bw") for layer in LAYERS},
        null=float(np.mean(nulls[0])) if nulls[0] else None, untried=table.untried, untried_share=UNTRIED,
        null_predicted=float(np.mean(nulls[1])) if nulls[1] else None,
        refused=[row for row in rows if not row.correction.believed],
        believed=[row for row in rows if row.correction.believed],
        shares=known and [100.0 * share for share in known.shared],
        own=known and [100.0 * (a + b) for a, b in zip(known.shared, known.own, strict=True)])


def _compared(
    walker: Walker, trial: Trial, values: Mapping[str, float], step_s: float
) -> tuple[Comparison, WalkResult]:
    result = walker.result(_walk(walker, trial, values, step_s), trial, trial.offsets, energy=False)
    return compare(result, trial.prosthetic_plate), result


def _walk(
    walker: Walker, trial: Trial, values: Mapping[str, float], step_s: float, with_respect_to: Sequence[str] = ()
) -> Walk:
    return walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                       step_s=step_s, offsets=trial.offsets, values=values, with_respect_to=with_respect_to)


def _with(errors: Mapping[str, float], trial: Trial, c: np.ndarray) -> dict[str, float]:
    """Values of the trial's walk with its errors and the corrections c (4,)."""
    return {**errors, **{name: errors.get(name, 0.0) + float(own)
                         for name, own in zip(variables_of(trial), c, strict=True)}}


def _numbers(values: np.ndarray) -> tuple[float, ...]:
    return tuple(map(float, values))


# Momentum.


def corrected(
    walker: Walker, trial: Trial, bias: MomentumBias, *, heading: np.ndarray, errors: Mapping[str, float]
) -> MomentumCorrection:
    """What momentum makes of a trial that has the fitted contact; heading (2,) of its walk, `errors` as `predict`'s."""
    began = time.perf_counter()
    if not alike(bias):
        return MomentumCorrection(believed=False, why_not="spread")
    bias_bw, c = np.array([*bias.fore_aft_bw, *bias.vertical_bw]), np.zeros(len(PRIOR))
    before: np.ndarray | None = None
    surprise, windows = 0.0, tuple[slice, ...]()
    for _ in range(MOST_STEPS):
        try:
            walk = _walk(walker, trial, _with(errors, trial, c), FIT_STEP_S, variables_of(trial))
        except SimulationError:
            return MomentumCorrection(believed=False, why_not="walk", surprise=surprise)
        windows = windows or swings(walk)
        if not windows:
            return MomentumCorrection(believed=False, why_not="window")
        assert walk.sensitivity is not None
        lacking = needed_force(walk) - walk.prosthetic.grf_W
        missing = coefficients(walk, windows, lacking, trial, heading) - bias_bw
        by = np.stack([coefficients(walk, windows, walk.sensitivity.grf_W[:, :, p], trial, heading)
                       for p in range(len(c))], axis=1)
        # In units of sigma and prior a Gauss-Newton step is ridge regression on what would be missing without c.
        r, J = (missing + by @ c) / SIGMA_BW, by * PRIOR / SIGMA_BW[:, None]
        if before is None:
            # How far foot and momentum are apart, for errors of SIGMA_BW and PRIOR together.
            before = missing
            surprise = float(r @ np.linalg.solve(np.eye(len(r)) + J @ J.T, r) / chi2.ppf(UNLIKELY, len(r)))
            if surprise > 1.0:
                return MomentumCorrection(believed=False, why_not="surprise", surprise=surprise)
        new = PRIOR * np.linalg.solve(J.T @ J + np.eye(len(c)), J.T @ r)
        after, moved, c = missing - by @ (new - c), np.abs(new - c) / PRIOR, new
        if moved.max() < ENOUGH:
            break
    assert before is not None
    height, hip, knee, alignment = map(float, c)
    return MomentumCorrection(
        believed=True, height_m=height, hip_flexion_rad=hip, knee_angle_rad=knee, alignment_rad=alignment,
        surprise=surprise, missing_bw=(_numbers(before), _numbers(after)), wall_s=time.perf_counter() - began,
        windows_s=tuple((float(walk.record.time_s[w][0]), float(walk.record.time_s[w][-1])) for w in windows))


def alike(bias: MomentumBias) -> bool:
    """Whether the fitted trials' biases differ by no more than SIGMA_BW explains; one trial cannot differ."""
    if bias.fore_aft_sd_bw is None or bias.vertical_sd_bw is None:
        return True
    ratio, freedom = np.array([*bias.fore_aft_sd_bw, *bias.vertical_sd_bw]) / SIGMA_BW, len(bias.trials) - 1
    return bool(freedom * np.sum(ratio**2) <= chi2.ppf(UNLIKELY, freedom * len(ratio)))


def needed_force(walk: Walk) -> np.ndarray:
    """(n, 3) N that the ground must give all in all, m (a_com - g): what it gives in the walk, and what holds the
    pelvis's translations, which are along OpenSim's axes (forward, up, right)."""
    forward, up, right = (walk.record.load[:, walk.mechanism.tree.index(name)]
                          for name in ("pelvis_tx", "pelvis_ty", "pelvis_tz"))
    return np.asarray(np.column_stack([forward, -right, up]) + walk.prosthetic.grf_W + walk.intact.grf_W)


def swings(walk: Walk) -> tuple[slice, ...]:
    """Rows of the walk's record in which the intact foot swings, without the ends of the swing; those that the walk
    cuts are left out. Of the kinematics alone."""
    mechanism, record = walk.mechanism, walk.record
    spheres = np.flatnonzero(mechanism.site_bodies == mechanism.site_bodies[-1])  # the intact foot's stand last
    motion = follow(mechanism.tree, record.q, record.v, bodies=(int(mechanism.site_bodies[-1]),), coordinates=(),
                    inside=np.zeros(len(mechanism.tree.body_names), dtype=bool))
    p_WS = motion.p_WB[:, None] + np.einsum("nij,sj->nsi", motion.R_WB, mechanism.sites[spheres, :3])
    v_WS = motion.twist[:, :, 3:] + np.cross(motion.twist[:, :, :3], p_WS)
    fast = np.linalg.norm(v_WS, axis=2).min(axis=1) > SWINGING_M_PER_S
    trim = round(TRIMMED_S / walk.step_s)
    return tuple(slice(start + trim, stop - trim) for start, stop in runs(fast)
                 if start > 0 and stop < len(fast) and (stop - start - 2 * trim) * walk.step_s >= SHORTEST_S)


def coefficients(
    walk: Walk, windows: Sequence[slice], force_W: np.ndarray, trial: Trial, heading: np.ndarray
) -> np.ndarray:
    """(6,) BW, in the order of SIGMA_BW, of a force (n, 3) N over the record; means over the windows."""
    along = force_W @ walk_axes(heading)[[0, 2]].T / (trial.subject.mass_kg * GRAVITY)
    return np.asarray(np.mean([
        (np.linalg.pinv(legvander(np.linspace(-1.0, 1.0, window.stop - window.start), 2)) @ along[window]).T.ravel()
        for window in windows], axis=0))


def missed(walker: Walker, trial: Trial) -> np.ndarray | None:
    """(6,) BW by which m (a_com - g) exceeds the plate in the windows that the plate saw loaded; None without one."""
    walk, plate = _walk(walker, trial, {}, FIT_STEP_S), trial.prosthetic_plate
    heading = walking_direction(walker.result(walk, trial, trial.offsets, energy=False))
    on_plate = np.column_stack([np.interp(walk.record.time_s, plate.time_s, column) for column in plate.force_W.T])
    windows = [window for window in swings(walk) if on_plate[window, 2].min() > LOADED_N]
    return coefficients(walk, windows, needed_force(walk) - on_plate, trial, heading) if windows else None


# Discrepancy.


def over_stances(comparison: Comparison, curve: np.ndarray) -> np.ndarray:
    """(n, 3) a curve (101, 3) laid over each of the model's stances; zero elsewhere."""
    laid = np.zeros_like(comparison.model)
    for stance in {item.model for item in comparison.stances if item.model is not None}:
        rows = comparison.within(stance.start_s, stance.end_s)
        share = 100.0 * (comparison.time_s[rows] - stance.start_s) / stance.duration_s
        laid[rows] = np.column_stack([np.interp(share, PERCENT, column) for column in curve.T])
    return laid


def remaining(comparison: Comparison, weight_n: float) -> np.ndarray | None:
    """(101, 3) BW plate less model over the model's stance, mean of those that were seen as a whole; None without."""
    error = (comparison.measured - comparison.model) / weight_n
    curves = [np.column_stack([np.interp(percent_instants(item.model), comparison.time_s, column)
                               for column in error.T])
              for item in comparison.stances if item.inside and item.model is not None and item.model.complete]
    return np.asarray(np.mean(curves, axis=0)) if curves else None


def interpolated(discrepancy: Discrepancy, fulcrum_m: float) -> np.ndarray:
    """(101, 3) BW at a fulcrum position, in the order of COMPONENTS."""
    positions = np.array([curve.fulcrum_m for curve in discrepancy.curves])
    return np.stack([
        _weights(positions, fulcrum_m, shared, own) @ np.array([getattr(curve, name) for curve in discrepancy.curves])
        for name, shared, own in zip(COMPONENTS, discrepancy.shared, discrepancy.own, strict=True)], axis=1)


def _weights(positions_m: np.ndarray, fulcrum_m: float, shared: float, own: float) -> np.ndarray:
    """(n,) by which the process's mean at a fulcrum position is made of curves at others (Rasmussen & Williams 2006,
    eq. 2.25)."""
    def covariance(a: np.ndarray) -> np.ndarray:
        apart = (a - positions_m) ** 2
        return np.asarray(shared * np.exp(-0.5 * apart / SMOOTH_M**2) + own * np.exp(-0.5 * apart / SETTING_M**2))

    noise = max(1.0 - shared - own, 1e-9)
    among = covariance(positions_m[:, None]) + noise * np.eye(len(positions_m))
    return np.asarray(np.linalg.solve(among, covariance(np.asarray(fulcrum_m))))


def _alike_settings(positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, n) whether two trials are of different settings, and (n,) whether another is of the same."""
    apart = np.abs(positions_m[:, None] - positions_m) > 0.5 * SETTING_M
    return apart, np.sum(~apart, axis=1) > 1


def earned(curves: Sequence[DiscrepancyCurve]) -> Discrepancy:
    """The discrepancy whose shares predict best what is left out: each trial of a setting that was fitted twice, from
    all others, and each setting from the other ones. Of equals the least share counts."""
    positions = np.array([curve.fulcrum_m for curve in curves])
    apart, twice = _alike_settings(positions)
    groups = [(np.arange(len(curves)) == i, np.arange(len(curves)) != i) for i in np.flatnonzero(twice)]
    groups += [(~row, row) for row in np.unique(apart, axis=0) if row.any()]
    pairs = [(float(shared), float(own)) for shared in SHARES for own in SHARES if shared + own <= 1.0 + 1e-9
             and (twice.any() or np.isclose(own, max(UNTRIED - shared, 0.0)))]
    found = []
    for name in COMPONENTS:
        values = np.array([getattr(curve, name) for curve in curves])
        error = {pair: sum(float(np.mean((values[out] - _weights(positions[left], positions[out].mean(), *pair)
                                          @ values[left]) ** 2)) for out, left in groups) for pair in pairs}
        found.append(min(pairs, key=lambda pair: (round(error[pair], 12), sum(pair), pair[0])))
    shared, own = zip(*found, strict=True)
    return Discrepancy(curves=tuple(curves), shared=shared, own=own)
