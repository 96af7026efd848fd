"""How well a simulated walk agrees with its force plate: the numbers of `metrics.json`.

Definitions (McGeehan 2021 where it states one, doi 10.1115/1.4050456):

- BW is the subject's mass times 9.81 m/s²; FL is the length of the model's prosthetic foot, for both directions of the
  centre of pressure (it is the recorded foot's where `import --scale-prosthesis` made it so).
- Forces are compared over every measured stance ± 0.25 s, clipped to the simulated time, time-locked, both low-passed
  at 40 Hz. The resultant is the Euclidean norm of the filtered force.
- Impulse: the integral of the resultant from the start of the measured stance, or of the simulated time, on.
- Centre of pressure: both low-passed at 6 Hz, at 101 points of the measured stance, where both carry more than 20 N.
- R² is 1 - SSE / SST, of the centre of pressure about the mean of each footprint.
- Differences of times are model minus measured: positive is late.

What cannot be known from a recording, such as a lateral force that nobody measured, is None.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vsf_drake.analysis.comparison import (
    FORCE_CUTOFF_HZ,
    MARGIN_S,
    THRESHOLD_N,
    Comparison,
    StanceComparison,
    compare,
    cumulative_integral,
    percent_instants,
    r_squared,
    rmse,
)
from vsf_drake.motion.events import find_scuffs, find_stances, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.parameters import GRAVITY
from vsf_drake.sentences import say
from vsf_drake.simulation.results import WalkResult, coordinate_unit

if TYPE_CHECKING:
    from vsf_drake.analysis.offsets import OffsetFit
    from vsf_drake.motion.trial import Trial


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Extremes of the force in one stance (BW), as far as it is simulated; None where no instant of it is."""

    vertical_first_half: float | None
    vertical_second_half: float | None
    braking: float | None  # least fore-aft force
    propulsion: float | None  # largest fore-aft force


@dataclass(frozen=True, kw_only=True)
class StanceMetrics:
    """One measured stance; times in s on the recording's clock."""

    measured_start_s: float
    measured_end_s: float
    model_start_s: float | None
    model_end_s: float | None
    complete: bool  # the measured stance lies inside the simulated time as a whole
    model_peaks_bw: Peaks
    measured_peaks_bw: Peaks


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far a walk agrees with its plate, by the definitions above; None for what cannot be known."""

    grf_rmse_bw: float | None
    grf_r2: float | None
    vertical_rmse_bw: float | None
    fore_aft_rmse_bw: float | None
    medio_lateral_rmse_bw: float | None
    vertical_impulse_error: float | None  # model over plate, minus one
    impulse_rmse_bws: float | None
    impulse_r2: float | None
    cop_rmse_fl: float | None  # fore-aft
    cop_ml_rmse_fl: float | None  # lateral
    cop_r2: float | None
    cop_points: int
    stance_measured_s: float | None  # mean of the stances that are simulated as a whole
    stance_model_s: float | None
    heel_strike_error_s: float | None  # positive: the model is late
    toe_off_error_s: float | None
    stances: tuple[StanceMetrics, ...]
    extra_model_stances: int
    scored_window_s: tuple[tuple[float, float], ...]
    coverage: float | None  # share of the stances and their margins that is simulated
    heading_deg: float  # of the walk from W's x axis to its y axis
    body_weight_n: float
    foot_length_m: float  # FL: of the model's prosthetic foot

    @property
    def stance_error_s(self) -> float | None:
        """How much longer the model's stance lasts."""
        model, measured = self.stance_model_s, self.stance_measured_s
        return None if model is None or measured is None else model - measured

    def peak_vertical_bw(self, side: str) -> float | None:
        """Largest vertical force (BW) of the "model" or as "measured", of all stances."""
        peaks = [
            stance.model_peaks_bw if side == "model" else stance.measured_peaks_bw
            for stance in self.stances
        ]
        halves = [
            half for peak in peaks for half in (peak.vertical_first_half, peak.vertical_second_half)
        ]
        return max((half for half in halves if half is not None), default=None)


@dataclass(frozen=True, kw_only=True)
class WalkMetrics(Agreement):
    """What `metrics.json` holds of a walk."""

    angle_rmse_deg: float | None  # followed against commanded rotations
    null_model_grf_rmse_bw: float | None = None  # None without another trial
    trial: str
    simulated_s: float
    wall_s: float
    compile_s: float
    step_s: float
    unconverged_steps: int
    refined_steps: int
    converged: bool
    synthetic: bool


def walk_metrics(
    result: WalkResult,
    plate: PlateRecording,
    *,
    null_curve: np.ndarray | None = None,
    comparison: Comparison | None = None,
) -> WalkMetrics:
    """The numbers of `metrics.json` (definitions above).

    Args:
        plate: under the prosthetic foot.
        null_curve: (k,) resultant of *another* trial in BW, evenly spaced over its stance
            (`stance_curve`); stretched to the measured stances it is the null model.
        comparison: `compare(result, plate)`, where it was made before.
    """
    c = compare(result, plate) if comparison is None else comparison
    weight = result.subject_mass_kg * GRAVITY
    shared = agreement(c, plate, body_weight_n=weight, foot_length_m=result.foot_length_m)
    return WalkMetrics(
        **vars(shared),
        angle_rmse_deg=_angle_rmse_deg(result),
        null_model_grf_rmse_bw=None
        if null_curve is None
        else null_model_rmse(c, weight, null_curve),
        trial=result.trial_name,
        simulated_s=result.simulated_s,
        wall_s=result.wall_s,
        compile_s=result.compile_s,
        step_s=result.step_s,
        unconverged_steps=result.unconverged_steps,
        refined_steps=result.refined_steps,
        converged=result.converged,
        synthetic=result.synthetic,
    )


def agreement(
    c: Comparison, plate: PlateRecording, *, body_weight_n: float, foot_length_m: float
) -> Agreement:
    """The numbers that a comparison with `plate` gives by itself."""
    model, measured = c.model / body_weight_n, c.measured / body_weight_n
    resultant, measured_resultant = np.linalg.norm(model, axis=1), np.linalg.norm(measured, axis=1)
    s, wanted = c.scored, sum(item.measured.duration_s + 2 * MARGIN_S for item in c.stances)
    load, measured_load = float(np.sum(model[s, 2])), float(np.sum(measured[s, 2]))

    # cumulative impulse (BW s) over each stance
    rows = [c.within(item.measured.start_s, item.measured.end_s) for item in c.stances]
    impulse, measured_impulse = (
        _joined([cumulative_integral(series[own], c.step_s) for own in rows])
        for series in (resultant, measured_resultant)
    )

    # centre of pressure (m) where both have one
    seen = [np.isfinite(item.model_cop[:, 0]) for item in c.stances]
    cop = _joined([item.model_cop[own] for item, own in zip(c.stances, seen, strict=True)], width=2)
    measured_cop = _joined(
        [item.measured_cop[own] for item, own in zip(c.stances, seen, strict=True)], width=2
    )
    footprint = np.repeat(np.arange(len(seen)), [np.count_nonzero(own) for own in seen])

    whole = [item for item in c.stances if item.inside]
    both = [(item.model, item.measured) for item in c.stances if item.model is not None]
    return Agreement(
        grf_rmse_bw=_known(rmse(resultant[s], measured_resultant[s])),
        grf_r2=_known(r_squared(resultant[s], measured_resultant[s])),
        vertical_rmse_bw=_known(rmse(model[s, 2], measured[s, 2])),
        fore_aft_rmse_bw=_known(rmse(model[s, 0], measured[s, 0])),
        medio_lateral_rmse_bw=_known(rmse(model[s, 1], measured[s, 1]))
        if np.any(plate.force_W[:, 1])
        else None,
        vertical_impulse_error=load / measured_load - 1.0 if measured_load else None,
        impulse_rmse_bws=_known(rmse(impulse, measured_impulse)),
        impulse_r2=_known(r_squared(impulse, measured_impulse)),
        cop_rmse_fl=_known(rmse(cop[:, 0], measured_cop[:, 0]) / foot_length_m),
        cop_ml_rmse_fl=_known(rmse(cop[:, 1], measured_cop[:, 1]) / foot_length_m),
        cop_r2=_known(r_squared(cop[:, 0], measured_cop[:, 0], groups=footprint)),
        cop_points=len(cop),
        stance_measured_s=_mean([item.measured.duration_s for item in whole]),
        stance_model_s=_mean(
            [s.model.duration_s for s in whole if s.model is not None and s.model.complete]
        ),
        heel_strike_error_s=_mean(
            [
                own.start_s - real.start_s
                for own, real in both
                if own.start_seen and real.start_seen and real.start_s >= c.time_s[0]
            ]
        ),
        toe_off_error_s=_mean(
            [
                own.end_s - real.end_s
                for own, real in both
                if own.end_seen and real.end_seen and real.end_s <= c.time_s[-1]
            ]
        ),
        stances=tuple(_stance(c, item, model, measured) for item in c.stances),
        extra_model_stances=c.extra_model_stances,
        scored_window_s=tuple(
            (float(c.time_s[start]), float(c.time_s[stop - 1])) for start, stop in runs(s)
        ),
        coverage=sum(item.span[1] - item.span[0] for item in c.stances) / wanted
        if wanted
        else None,
        heading_deg=float(np.degrees(np.arctan2(c.heading[1], c.heading[0]))),
        body_weight_n=body_weight_n,
        foot_length_m=foot_length_m,
    )


def stance_curve(plate: PlateRecording, *, subject_mass_kg: float) -> np.ndarray | None:
    """(101,) measured resultant in BW over 0-100 % of stance, mean of the complete stances; None without one."""
    rate = 1.0 / float(np.median(np.diff(plate.time_s)))
    force = low_pass(plate.force_W, rate_hz=rate, cutoff_hz=min(FORCE_CUTOFF_HZ, 0.45 * rate))
    resultant = np.linalg.norm(force, axis=1) / (subject_mass_kg * GRAVITY)
    stances = [
        s
        for s in find_stances(plate.time_s, plate.force_W[:, 2], threshold_n=THRESHOLD_N)
        if s.complete
    ]
    curves = [np.interp(percent_instants(s), plate.time_s, resultant) for s in stances]
    return np.mean(curves, axis=0) if curves else None


def _angle_rmse_deg(result: WalkResult) -> float | None:
    """Followed against commanded rotations, pooled over coordinates and instants."""
    rotations = [
        (i, name)
        for i, name in enumerate(result.prescribed_names)
        if coordinate_unit(name) == "rad"
    ]
    if not rotations:
        return None
    followed = np.column_stack([result.column(name) for _, name in rotations])
    return float(np.degrees(rmse(followed, result.prescribed_q[:, [i for i, _ in rotations]])))


def null_model_rmse(
    c: Comparison, body_weight_n: float, curve: np.ndarray, *, predicted: bool = False
) -> float | None:
    """Error (BW) of a curve (k,) BW that is stretched to each stance as measured, or as `predicted` by the model, and
    zero between them; incomplete stances are left out."""
    null = np.zeros(len(c.time_s))
    percent = np.linspace(0.0, 100.0, len(curve))
    for item in c.stances:
        stance = item.model if predicted and item.model is not None else item.measured
        start, end = stance.start_s, stance.end_s
        rows = c.within(start, end)
        stretched = np.interp(100.0 * (c.time_s[rows] - start) / (end - start), percent, curve)
        null[rows] = stretched if stance.complete else np.nan
    rows = c.scored & np.isfinite(null)
    return _known(rmse(null[rows], np.linalg.norm(c.measured[rows] / body_weight_n, axis=1)))


def _stance(
    c: Comparison, item: StanceComparison, model: np.ndarray, measured: np.ndarray
) -> StanceMetrics:
    start, middle, end = np.linspace(item.measured.start_s, item.measured.end_s, 3)
    first, second, whole = c.within(start, middle), c.within(middle, end), c.within(start, end)

    def peaks(force: np.ndarray) -> Peaks:
        return Peaks(
            vertical_first_half=_known(np.max(force[first, 2], initial=-np.inf)),
            vertical_second_half=_known(np.max(force[second, 2], initial=-np.inf)),
            braking=_known(np.min(force[whole, 0], initial=np.inf)),
            propulsion=_known(np.max(force[whole, 0], initial=-np.inf)),
        )

    return StanceMetrics(
        measured_start_s=item.measured.start_s,
        measured_end_s=item.measured.end_s,
        model_start_s=item.model.start_s if item.model and item.model.start_seen else None,
        model_end_s=item.model.end_s if item.model and item.model.end_seen else None,
        complete=item.inside,
        model_peaks_bw=peaks(model),
        measured_peaks_bw=peaks(measured),
    )


def _joined(parts: Sequence[np.ndarray], width: int = 1) -> np.ndarray:
    """(n, width) or, of width 1, (n,) parts one after the other; also of none."""
    return np.concatenate([np.empty((0, width) if width > 1 else 0), *parts])


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None


# What should make the reader of a walk doubt it.


USUAL_PEAK_BW = (0.8, 1.8)
"""Range of the measured peak resultant in walking (body weights); outside it the mass is the first suspect."""
FAR_COP_FL = 1.0  # distance between the two centres of pressure (foot lengths) at which they are not of the same foot
SCUFF_BW = 0.05  # contact of the swinging foot (body weights) that is worth a sentence
UNFITTED = "UNFITTED"  # how the note of a walk begins whose foot was fitted to nobody
UNFITTED_BW, OFFSETS_BW = (0.14, 0.48), (0.14, 0.21)
"""Least and largest RMS error of the resultant force of the nominal foot under recorded walks of people, as they are
and with the offsets fitted to the same plate: six predictions (tests/test_real_walks.py) of two people without a
prosthesis, either of whose ankles the foot replaces. Synthetic persons (data/sessions): 0.23 to 0.44, 0.04 to 0.08."""


def unfitted_note(trial: Trial, *, offsets_fitted: bool) -> str:
    """What a walk of `trial` is worth whose foot was fitted to nobody, and the commands that do better; its words begin
    with UNFITTED."""
    [note] = say(
        "unfitted",
        begins=UNFITTED,
        trial=shlex.quote(str(trial.path)),
        offsets_fitted=offsets_fitted,
        worth_bw=UNFITTED_BW,
        offsets_bw=OFFSETS_BW,
    )
    return note


def warnings(
    result: WalkResult, comparison: Comparison, metrics: WalkMetrics, fit: OffsetFit | None
) -> list[str]:
    """What in `comparison` and its `walk_metrics` does not look like one person walking over one plate.

    Sentences, each with the likely cause; `fit` is that of the offsets, if there was one.
    """
    weight, time, vertical = metrics.body_weight_n, result.time_s, result.grf_W[:, 2]
    peaks = [
        np.linalg.norm(
            comparison.measured[comparison.within(s.measured.start_s, s.measured.end_s)], axis=1
        ).max()
        for s in comparison.stances
        if s.inside
    ]
    apart = np.concatenate(
        [np.linalg.norm(s.model_cop - s.measured_cop, axis=1) for s in comparison.stances] or [[]]
    )
    apart = apart[np.isfinite(apart)]
    scuffs = [
        {
            "start_s": scuff.start_s,
            "peak_bw": vertical[(time >= scuff.start_s) & (time <= scuff.end_s)].max(initial=0.0)
            / weight,
        }
        for scuff in find_scuffs(time, vertical)
        if scuff.complete
    ]
    return say(
        "warnings",
        peak_bw=float(np.mean(peaks)) / weight if peaks else None,
        usual_bw=USUAL_PEAK_BW,
        heading_deg=metrics.heading_deg,
        apart_m=np.median(apart) if apart.size else None,
        far_m=FAR_COP_FL * result.foot_length_m,
        r2=metrics.grf_r2,
        fit=fit,
        scuffs=[scuff for scuff in scuffs if scuff["peak_bw"] > SCUFF_BW],
    )
