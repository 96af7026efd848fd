"""How well a simulated walk agrees with its force plate: the numbers of `metrics.json`.

Definitions (McGeehan 2021 where it states one, doi 10.1115/1.4050456):

- BW is the subject's mass times 9.81 m/s²; FL is the length of the model's prosthetic foot, for
  both directions of the centre of pressure (it is the recorded foot's where `import
  --scale-prosthesis` made it so).
- Forces are compared over every measured stance ± 0.25 s, clipped to the simulated time,
  time-locked, both low-passed at 40 Hz. The resultant is the Euclidean norm of the filtered force.
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
from vsf_drake.motion.events import find_scuffs, known_stances, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.simulation.results import WalkResult, coordinate_unit
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    MARGIN_S,
    Comparison,
    StanceComparison,
    compare,
    cumulative_integral,
    percent_instants,
    r_squared,
    rmse,
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
    """One measured stance; times in s on the recording's clock."""

    measured_start_s: float
    measured_end_s: float
    model_start_s: float | None
    model_end_s: float | None
    complete: bool  # the measured stance lies inside the simulated time as a whole
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
    extra_model_stances: int
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
    plate: PlateRecording,
    *,
    others: Sequence[KnownCurve] = (),
    comparison: Comparison | None = None,
) -> WalkMetrics:
    """The numbers of `metrics.json` (definitions above).

    Args:
        plate: under the prosthetic foot.
        others: measured curves of *other* trials (`known_curves`), of which the null model is made.
        comparison: `compare(result, plate)`, where it was made before.

    Raises:
        InputError: what is given is something else.
    """
    require(
        hasattr(result, "grf_W") and isinstance(plate, PlateRecording),
        f"takes no {type(result).__name__} with a {type(plate).__name__}",
        "walk_metrics",
        "Give it what simulate_trial returned, and the trial's prosthetic_plate",
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
    c: Comparison, plate: PlateRecording, *, body_weight_n: float, foot_length_m: float
) -> Agreement:
    """The numbers that a comparison with `plate` gives by itself."""
    model = c.model / body_weight_n
    measured = c.measured / body_weight_n
    scored = model[c.scored]
    wanted = measured[c.scored]
    both = [np.linalg.norm(force, axis=1) for force in (model, measured)]
    resultants = [force[c.scored] for force in both]
    impulses = [
        _joined([cumulative_integral(force[own], c.step_s) for own in c.measured_rows()])
        for force in both
    ]

    # centre of pressure (m) where both have one
    seen = [np.isfinite(item.model_cop[:, 0]) for item in c.stances]
    centres = [
        _joined([cop[own] for cop, own in zip(of_stances, seen, strict=True)], width=2)
        for of_stances in (
            [item.model_cop for item in c.stances],
            [item.measured_cop for item in c.stances],
        )
    ]
    fore_aft, lateral = zip(*(cop.T for cop in centres), strict=True)
    footprint = np.repeat(np.arange(len(seen)), [np.count_nonzero(own) for own in seen])

    whole = [item for item in c.stances if item.inside]
    of_model = [item.model for item in whole if item.model and item.model.complete]
    load = float(np.sum(scored[:, 2]))
    measured_load = float(np.sum(wanted[:, 2]))
    margins_s = sum(item.measured.duration_s + 2 * MARGIN_S for item in c.stances)
    return Agreement(
        grf_rmse_bw=_known(rmse(*resultants)),
        grf_r2=_known(r_squared(*resultants)),
        vertical_rmse_bw=_known(rmse(scored[:, 2], wanted[:, 2])),
        fore_aft_rmse_bw=_known(rmse(scored[:, 0], wanted[:, 0])),
        medio_lateral_rmse_bw=_known(rmse(scored[:, 1], wanted[:, 1]))
        if np.any(plate.force_W[:, 1])
        else None,
        vertical_impulse_error=load / measured_load - 1.0 if measured_load else None,
        impulse_rmse_bws=_known(rmse(*impulses)),
        impulse_r2=_known(r_squared(*impulses)),
        cop_rmse_fl=_known(rmse(*fore_aft) / foot_length_m),
        cop_ml_rmse_fl=_known(rmse(*lateral) / foot_length_m),
        cop_r2=_known(r_squared(*fore_aft, groups=footprint)),
        cop_points=len(footprint),
        stance_measured_s=mean(item.measured.duration_s for item in whole),
        stance_model_s=mean(stance.duration_s for stance in of_model),
        heel_strike_error_s=mean(item.strike_error_s for item in c.stances),
        toe_off_error_s=mean(item.lift_off_error_s for item in c.stances),
        stances=tuple(_stance(c, item, model, measured) for item in c.stances),
        extra_model_stances=c.extra_model_stances,
        scored_window_s=tuple(
            (float(c.time_s[start]), float(c.time_s[stop - 1])) for start, stop in runs(c.scored)
        ),
        coverage=sum(item.span[1] - item.span[0] for item in c.stances) / margins_s
        if margins_s
        else None,
        heading_deg=float(np.degrees(np.arctan2(c.heading[1], c.heading[0]))),
        body_weight_n=body_weight_n,
        foot_length_m=foot_length_m,
    )


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
    """The measured curves of trials; of those without a complete stance there is none."""
    curves = [
        (trial, stance_curve(trial.prosthetic_plate, subject_mass_kg=trial.subject.mass_kg))
        for trial in trials
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


def _largest(peaks: Iterable[Peaks]) -> float | None:
    both = ((peak.vertical_first_half, peak.vertical_second_half) for peak in peaks)
    return max(known(half for halves in both for half in halves), default=None)


def _joined(parts: Sequence[np.ndarray], width: int = 1) -> np.ndarray:
    """(n, width) or, of width 1, (n,) parts one after the other; also of none."""
    return np.concatenate([np.empty((0, width) if width > 1 else 0), *parts])


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
        trial=shlex.quote(str(trial.path)),
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
