"""How well a simulated walk agrees with its force plate: the numbers of `metrics.json`.

Definitions (McGeehan 2021 where it states one, doi 10.1115/1.4050456):

- BW is the subject's mass times 9.81 m/s²; FL is the length of the model's prosthetic foot, for
  both directions of the centre of pressure (of its shell, where the manifest states that).
- Forces are compared over every measured stance ± 0.25 s, clipped to the simulated time and, of a
  stance in which this starts, to what is later than 0.2 s, time-locked, both low-passed at 40 Hz.
  The resultant is the Euclidean norm of the filtered force.
- Impulse: the integral of the resultant from the start of the measured stance, or of the simulated
  time, on.
- Centre of pressure: both low-passed at 6 Hz, at 101 points of the measured stance, where both
  carry more than 20 N.
- R² is 1 - SSE / SST, of the centre of pressure about the mean of each footprint.
- Differences of times are model minus measured: positive is late.

What cannot be known from a recording, such as a lateral force that nobody measured, is None.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Stance, find_scuffs, known_stances, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.simulation.results import WalkResult, coordinate_unit
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    MARGIN_S,
    PERCENT,
    Comparison,
    StanceComparison,
    compare,
    cumulative_integral,
    percent_instants,
    rmse,
    row_r_squared,
    row_rmse,
    row_sums,
)
from vsf_drake.walks.null_model import KnownCurve, NullErrors, null_errors
from vsf_drake.walks.quantities import Judged, known, mean

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial
    from vsf_drake.walks.offsets import OffsetFit


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Extremes of the force in one stance (BW), as far as it is simulated; None where no instant of
    it is."""

    vertical_first_half: float | None
    vertical_second_half: float | None
    braking: float | None  # least fore-aft force
    propulsion: float | None  # largest fore-aft force


@dataclass(frozen=True, kw_only=True)
class StanceMetrics:
    """One measured stance; times in s on the recording's clock. Without a plate one of the model,
    and nothing measured."""

    measured_start_s: float | None
    measured_end_s: float | None
    model_start_s: float | None
    model_end_s: float | None
    complete: bool  # the stance lies inside the simulated time as a whole
    model_peaks_bw: Peaks
    measured_peaks_bw: Peaks


@dataclass(frozen=True, kw_only=True)
class Agreement(Judged):
    """How far a walk agrees with its plate, by the definitions above and in `quantities`; None for
    what cannot be known."""

    grf_rmse_bw: float | None
    grf_r2: float | None
    vertical_rmse_bw: float | None
    fore_aft_rmse_bw: float | None
    medio_lateral_rmse_bw: float | None
    vertical_impulse_error: float | None
    impulse_rmse_bws: float | None
    impulse_r2: float | None
    cop_rmse_fl: float | None
    cop_ml_rmse_fl: float | None
    cop_r2: float | None
    cop_points: int
    stance_measured_s: float | None
    stance_model_s: float | None
    heel_strike_error_s: float | None
    toe_off_error_s: float | None
    stances: tuple[StanceMetrics, ...]
    extra_model_stances: int | None
    scored_window_s: tuple[tuple[float, float], ...]
    coverage: float | None
    heading_deg: float
    body_weight_n: float
    foot_length_m: float

    @property
    def stance_error_s(self) -> float | None:
        """How much longer the model's stance lasts."""
        model = self.stance_model_s
        measured = self.stance_measured_s
        return None if model is None or measured is None else model - measured

    @property
    def peak_vertical_bw(self) -> float | None:
        """Largest vertical force of the model, of all stances."""
        return _largest(stance.model_peaks_bw for stance in self.stances)

    @property
    def measured_peak_vertical_bw(self) -> float | None:
        """The same as measured."""
        return _largest(stance.measured_peaks_bw for stance in self.stances)


@dataclass(frozen=True, kw_only=True)
class WalkMetrics(NullErrors, Agreement):
    """What `metrics.json` holds of a walk."""

    angle_rmse_deg: float | None
    trial: str
    simulated_s: float
    wall_s: float
    compile_s: float
    step_s: float
    unconverged_steps: int
    refined_steps: int
    converged: bool
    synthetic: bool

    @property
    def beats_null(self) -> bool | None:
        """Whether the model is nearer to the plate than the null model; None where either error is
        unknown."""
        error = self.error_bw
        null = self.null_bw
        return None if error is None or null is None else error < null


def walk_metrics(
    result: WalkResult,
    plate: PlateRecording | None,
    *,
    others: Sequence[KnownCurve] = (),
    comparison: Comparison | None = None,
) -> WalkMetrics:
    """The numbers of `metrics.json` (definitions above).

    Args:
        plate: under the prosthetic foot; None where no force was measured (`Trial.plate`): errors
            are None.
        others: measured curves of *other* trials (`known_curves`), of which the null model is made.
        comparison: `compare(result, plate)`, where it was made before.

    Raises:
        InputError: what is given is something else.
    """
    require(
        hasattr(result, "grf_W") and isinstance(plate, PlateRecording | None),
        f"takes no {type(result).__name__} with a {type(plate).__name__}",
        "walk_metrics",
        "Give it what simulate_trial returned, and the trial's plate",
    )
    c = compare(result, plate) if comparison is None else comparison
    weight = result.subject_mass_kg * GRAVITY
    shared = agreement(c, plate, body_weight_n=weight, foot_length_m=result.foot_length_m)
    null = null_errors(c, weight, others, float(result.fulcrum_m.mean()))
    return WalkMetrics(
        **vars(shared),
        **vars(null),
        angle_rmse_deg=_angle_rmse_deg(result),
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
    c: Comparison, plate: PlateRecording | None, *, body_weight_n: float, foot_length_m: float
) -> Agreement:
    """The numbers that a comparison with `plate` gives by itself."""
    return agreements([c], plate, body_weight_n=body_weight_n, foot_length_m=foot_length_m)[0]


def agreements(
    comparisons: Sequence[Comparison],
    plate: PlateRecording | None,
    *,
    body_weight_n: float,
    foot_length_m: float,
) -> list[Agreement]:
    """`agreement` of each of what `compare_all` gave of some walks and `plate`."""
    c = comparisons[0]
    shared = all(other.measured is c.measured for other in comparisons)
    rows = c.measured_rows()
    # (walks, n, 3) BW; one row of what is measured if it is the same for all
    model = np.stack([each.model for each in comparisons]) / body_weight_n
    measured = (
        np.stack([each.measured for each in (comparisons[:1] if shared else comparisons)])
        / body_weight_n
    )
    scored = model[:, c.scored]
    wanted = measured[:, c.scored]
    both = [np.linalg.norm(force, axis=2) for force in (model, measured)]
    resultants = [force[:, c.scored] for force in both]
    impulses = [
        np.concatenate(
            [
                np.empty((len(force), 0)),
                *(cumulative_integral(force[:, own], c.step_s) for own in rows),
            ],
            axis=1,
        )
        for force in both
    ]
    loads = [row_sums(force[:, :, 2]) for force in (scored, wanted)]
    axes_rmse = [row_rmse(scored[:, :, i] - wanted[:, :, i]) for i in range(3)]

    # centre of pressure (m) where both have one, (walks, percents of all stances, 2)
    of_model, of_plate = (
        np.stack([np.concatenate([np.empty((0, 2)), *cops]) for cops in of_walks])
        for of_walks in (
            [[item.model_cop for item in each.stances] for each in comparisons],
            [[item.measured_cop for item in each.stances] for each in comparisons],
        )
    )
    seen = np.isfinite(of_model[:, :, 0])
    footprint = np.repeat(np.arange(len(c.stances)), len(PERCENT))
    apart = of_model - of_plate
    numbers = {
        "grf_rmse_bw": row_rmse(resultants[0] - resultants[1]),
        "grf_r2": row_r_squared(*resultants),
        "vertical_rmse_bw": axes_rmse[2],
        "fore_aft_rmse_bw": axes_rmse[0],
        "medio_lateral_rmse_bw": axes_rmse[1]
        if plate is not None and np.any(plate.force_W[:, 1])
        else np.full(len(model), np.nan),
        "impulse_rmse_bws": row_rmse(impulses[0] - impulses[1]),
        "impulse_r2": row_r_squared(*impulses),
        "cop_rmse_fl": row_rmse(apart[:, :, 0], seen) / foot_length_m,
        "cop_ml_rmse_fl": row_rmse(apart[:, :, 1], seen) / foot_length_m,
        "cop_r2": row_r_squared(
            of_model[:, :, 0], of_plate[:, :, 0], groups=footprint, counted=seen
        ),
    }
    peaks = [_peaks(c, [item.measured for item in c.stances], force) for force in (model, measured)]
    whole = [i for i, item in enumerate(c.stances) if item.inside]
    margins_s = sum(item.measured.duration_s + 2 * MARGIN_S for item in c.stances)
    of_plate_s = mean(
        c.stances[i].measured.duration_s for i in whole if c.stances[i].measured.complete
    )
    windows = tuple(
        (float(c.time_s[start]), float(c.time_s[stop - 1])) for start, stop in runs(c.scored)
    )
    coverage = (
        sum(item.span[1] - item.span[0] for item in c.stances) / margins_s if margins_s else None
    )
    found = []
    for w, each in enumerate(comparisons):
        m = 0 if shared else w
        own = [each.stances[i].model for i in whole] if plate else each.laid_on
        found.append(
            Agreement(
                **{name: _known(values[w]) for name, values in numbers.items()},
                vertical_impulse_error=float(loads[0][w] / loads[1][m]) - 1.0
                if loads[1][m]
                else None,
                cop_points=int(np.count_nonzero(seen[w])),
                stance_measured_s=of_plate_s,
                stance_model_s=mean(one.duration_s for one in own if one and one.complete),
                heel_strike_error_s=mean(item.strike_error_s for item in each.stances),
                toe_off_error_s=mean(item.lift_off_error_s for item in each.stances),
                stances=_predicted_stances(each, model[w : w + 1])
                if plate is None
                else tuple(
                    _stance(item, peaks[0][i][w], peaks[1][i][m])
                    for i, item in enumerate(each.stances)
                ),
                extra_model_stances=each.extra_model_stances,
                scored_window_s=windows,
                coverage=coverage,
                heading_deg=float(np.degrees(np.arctan2(each.heading[1], each.heading[0]))),
                body_weight_n=body_weight_n,
                foot_length_m=foot_length_m,
            )
        )
    return found


def stance_curve(plate: PlateRecording, *, subject_mass_kg: float) -> np.ndarray | None:
    """(101,) measured resultant in BW over 0-100 % of stance, mean of the complete stances; None
    without one."""
    rate = 1.0 / float(np.median(np.diff(plate.time_s)))
    force = low_pass(plate.force_W, rate_hz=rate, cutoff_hz=min(FORCE_CUTOFF_HZ, 0.45 * rate))
    resultant = np.linalg.norm(force, axis=1) / (subject_mass_kg * GRAVITY)
    stances = [stance for stance in known_stances(plate) if stance.complete]
    curves = [np.interp(percent_instants(s), plate.time_s, resultant) for s in stances]
    return np.mean(curves, axis=0) if curves else None


def known_curves(trials: Sequence[Trial]) -> list[KnownCurve]:
    """The measured curves of trials; of those without a plate or a complete stance there is
    none."""
    curves = [
        (trial, stance_curve(trial.plate, subject_mass_kg=trial.subject.mass_kg))
        for trial in trials
        if trial.plate is not None
    ]
    return [KnownCurve(trial.fulcrum_m, curve) for trial, curve in curves if curve is not None]


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


def _peaks(c: Comparison, stances: Iterable[Stance], force: np.ndarray) -> list[list[Peaks]]:
    """Of each stance the peaks in each of the forces (w, n, 3), in BW."""
    found = []
    for stance in stances:
        start, middle, end = np.linspace(stance.start_s, stance.end_s, 3)
        vertical = force[:, :, 2]
        along = force[:, c.within(start, end), 0]
        found.append(
            [
                Peaks(
                    vertical_first_half=_known(first),
                    vertical_second_half=_known(second),
                    braking=_known(least),
                    propulsion=_known(most),
                )
                for first, second, least, most in zip(
                    vertical[:, c.within(start, middle)].max(axis=1, initial=-np.inf),
                    vertical[:, c.within(middle, end)].max(axis=1, initial=-np.inf),
                    along.min(axis=1, initial=np.inf),
                    along.max(axis=1, initial=-np.inf),
                    strict=True,
                )
            ]
        )
    return found


def _stance(item: StanceComparison, model: Peaks, measured: Peaks) -> StanceMetrics:
    return StanceMetrics(
        measured_start_s=item.measured.start_s,
        measured_end_s=item.measured.end_s,
        model_start_s=item.model.start_s if item.model and item.model.start_seen else None,
        model_end_s=item.model.end_s if item.model and item.model.end_seen else None,
        complete=item.inside,
        model_peaks_bw=model,
        measured_peaks_bw=measured,
    )


def _predicted_stances(c: Comparison, force: np.ndarray) -> tuple[StanceMetrics, ...]:
    """Those of the model (1, n, 3) BW, where nothing was measured."""
    nothing = Peaks(
        vertical_first_half=None, vertical_second_half=None, braking=None, propulsion=None
    )
    return tuple(
        StanceMetrics(
            measured_start_s=None,
            measured_end_s=None,
            model_start_s=stance.start_s if stance.start_seen else None,
            model_end_s=stance.end_s if stance.end_seen else None,
            complete=stance.whole,
            model_peaks_bw=peaks,
            measured_peaks_bw=nothing,
        )
        for stance, [peaks] in zip(c.model_stances, _peaks(c, c.model_stances, force), strict=True)
    )


def _largest(peaks: Iterable[Peaks]) -> float | None:
    both = ((peak.vertical_first_half, peak.vertical_second_half) for peak in peaks)
    return max(known(half for halves in both for half in halves), default=None)


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


# What should make the reader of a walk doubt it.


USUAL_PEAK_BW = (0.8, 1.8)
"""Range of the measured peak resultant in walking (body weights); outside it the mass is the first
suspect."""
# distance between the two centres of pressure (foot lengths) at which they are not of the same foot
FAR_COP_FL = 1.0
SCUFF_BW = 0.05  # contact of the swinging foot (body weights) that is worth a sentence
UNFITTED = "UNFITTED"  # how the note of a walk begins whose foot was fitted to nobody
UNFITTED_BW, OFFSETS_BW = (0.14, 0.48), (0.14, 0.21)
"""Least and largest RMS error of the resultant force of the nominal foot under recorded walks of
people, as they are and with the offsets fitted to the same plate: six predictions
(tests/test_real_walks.py) of two people without a prosthesis, either of whose ankles the foot
replaces. Synthetic persons (data/sessions): 0.23 to 0.44, 0.04 to 0.08."""


def unfitted_note(trial: Trial, *, offsets_fitted: bool) -> str:
    """What a walk of `trial` is worth whose foot was fitted to nobody, and the commands that do
    better; its words begin with UNFITTED."""
    [note] = say(
        "unfitted",
        begins=UNFITTED,
        trial=shlex.quote(str(trial.path)) if trial.plate else "TRIAL_WITH_FORCES.yaml",
        passive=trial.setting.fulcrum_mm is None,
        offsets_fitted=offsets_fitted,
        worth_bw=UNFITTED_BW,
        offsets_bw=OFFSETS_BW,
    )
    return note


def warnings(
    result: WalkResult, comparison: Comparison, metrics: WalkMetrics, fit: OffsetFit | None
) -> list[str]:
    """What in `comparison` and its `walk_metrics` does not look like one person walking over one
    plate.

    Sentences, each with the likely cause; `fit` is that of the offsets, if there was one.
    """
    weight = metrics.body_weight_n
    time = result.time_s
    vertical = result.grf_W[:, 2]
    peaks = [
        np.linalg.norm(comparison.measured[own], axis=1).max()
        for item, own in zip(comparison.stances, comparison.measured_rows(), strict=True)
        if item.inside
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
    doubts = [] if fit is None else fit.doubts
    return doubts + say(
        "warnings",
        peak_bw=float(np.mean(peaks)) / weight if peaks else None,
        usual_bw=USUAL_PEAK_BW,
        heading_deg=metrics.heading_deg,
        apart_m=np.median(apart) if apart.size else None,
        far_m=FAR_COP_FL * result.foot_length_m,
        r2=metrics.grf_r2,
        scuffs=[scuff for scuff in scuffs if scuff["peak_bw"] > SCUFF_BW],
    )
