"""The walks behind the question whether two settings can be told apart: each motion at each
position, with noise.

Every base trial is walked at all positions of the fulcrum, first as it was recorded and then with
errors of its kinematics. One draw is a session with two recordings of the same stride: its errors
are those of the session plus those of the recording. Only one stance of each trial is walked (the
complete one nearest the middle of its window) with MARGIN_S around. Every draw has its own stream
of random numbers, told by the seed, the trial and its number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.progress import Progress
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.fitted_trial import gait_phase
from vsf_drake.motion.trajectory import low_pass, periodic_bsplines
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.batch import SweepProgress, WalkCase, WalkOutcome, simulate_batch
from vsf_drake.simulation.batch.processes import chosen
from vsf_drake.validation.settings_section import NoiseSizes
from vsf_drake.validation.study import StudyWalk
from vsf_drake.walks.angle_errors import LIMB_ANGLES
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    MARGIN_S,
    PERCENT,
    THRESHOLD_N,
    cumulative_integral,
    filtered_while_loaded,
    partner,
    percent_instants,
    resample,
    uniform_grid,
    walk_axes,
)
from vsf_drake.walks.recorded_walk import STEP_S

RECORDINGS = 2
KEEP = ("time_s", "grf_W", "cop_W", "energy_j")  # of a walk
_STREAM = 6


@dataclass(frozen=True, eq=False)
class Base:
    """One trial and the stance of it that is walked, with its outcomes on the plate and in the
    study's own walk."""

    walk: StudyWalk
    trial: Trial  # cut to the stance ± MARGIN_S
    stance: Stance
    noise: KinematicNoise
    measured: StanceRecord
    simulated: StanceRecord

    def record(self, outcome: WalkOutcome) -> StanceRecord | None:
        """What one of its walks says; None if the walk failed or the foot of the model has no whole
        stance."""
        if not outcome.ok:
            return None
        time, grf, cop, energy = (outcome.arrays[name] for name in KEEP)
        return stance_record(
            time,
            grf,
            cop,
            near=self.stance,
            **_units(self.walk),
            energy=dict(zip(outcome.columns["energy_j"], energy.T, strict=True)),
        )


@dataclass(frozen=True, eq=False)
class SettingWalk:
    """Walks of one base trial at P positions, without noise and with D draws of R = 2 recordings;
    NaN where one failed.
    """

    resultant: np.ndarray  # (P, 101) BW over the own stance, without noise
    alone: np.ndarray  # (P, O) outcomes in the order of NAMES, without noise
    noisy: np.ndarray  # (D, R, P, O)
    failed: int  # walks that failed or have no whole stance


def base_of(walk: StudyWalk, sizes: NoiseSizes | None = None) -> Base:
    """The stance of `walk` nearest its middle; InputError if plate and model show none as a
    whole."""
    trial = walk.trial
    plate = walk.trial.prosthetic_plate
    result = walk.result
    middle = 0.5 * (trial.start_s + trial.end_s)
    whole = [item.measured for item in walk.comparison.stances if item.inside]
    for stance in sorted(whole, key=lambda s: abs(0.5 * (s.start_s + s.end_s) - middle)):
        near = (plate.time_s > stance.start_s - 4 * MARGIN_S) & (
            plate.time_s < stance.end_s + 4 * MARGIN_S
        )
        measured = stance_record(
            plate.time_s[near],
            plate.force_W[near],
            plate.cop_W[near] if plate.has_cop else None,
            near=stance,
            **_units(walk),
        )
        simulated = stance_record(
            result.time_s,
            result.grf_W,
            result.cop_W,
            near=stance,
            **_units(walk),
            energy=dict(zip(result.energy_names, result.energy_j.T, strict=True)),
        )
        if measured is not None and simulated is not None:
            window = dataclasses.replace(
                trial,
                start_s=max(trial.start_s, stance.start_s - MARGIN_S),
                end_s=min(trial.end_s, stance.end_s + MARGIN_S),
            )
            return Base(walk, window, stance, KinematicNoise(window, sizes), measured, simulated)
    raise InputError("has no stance that both plate and model show as a whole", where=walk.label)


def walk_all(
    bases: Sequence[Base],
    positions_m: Sequence[float],
    *,
    draws: int,
    seed: int,
    workers: int | None,
    progress: Progress | None = None,
) -> list[SettingWalk]:
    """Walks every base at every position, without noise and with `draws` sessions of two
    recordings."""
    each = len(positions_m) * (1 + RECORDINGS * draws)
    every = []
    with chosen(workers, None, each * len(bases)) as (pool, _, count):
        for i, base in enumerate(bases):
            trials = [base.trial]
            for draw in range(draws):
                random = np.random.default_rng([seed, _STREAM, i, draw])
                session = base.noise.session(random)
                trials += [
                    base.noise.perturbed(session + base.noise.recording(random))
                    for _ in range(RECORDINGS)
                ]
            cases = [
                WalkCase(trial=trial, fulcrum_m=x, step_s=STEP_S)
                for trial in trials
                for x in positions_m
            ]

            def show(state: SweepProgress, i: int = i, base: Base = base) -> None:
                if progress:
                    progress(
                        f"{base.walk.label} at {len(positions_m)} positions, with errors of its "
                        "kinematics",
                        (i + state.done / each) / len(bases),
                    )

            records = [
                base.record(outcome)
                for outcome in simulate_batch(
                    cases, keep=KEEP, executor=pool, workers=count, progress=show
                )
            ]
            values = _known(records, "values", len(NAMES)).reshape(
                1 + RECORDINGS * draws, len(positions_m), len(NAMES)
            )
            every.append(
                SettingWalk(
                    _known(records[: len(positions_m)], "resultant", len(PERCENT)),
                    values[0],
                    values[1:].reshape(draws, RECORDINGS, *values.shape[1:]),
                    records.count(None),
                )
            )
    return every


def _known(records: Sequence[StanceRecord | None], name: str, size: int) -> np.ndarray:
    return np.array(
        [np.full(size, np.nan) if one is None else getattr(one, name) for one in records]
    )


def _units(walk: StudyWalk) -> dict[str, Any]:
    """In what the outcomes of a walk are told."""
    return {
        "heading": walk.comparison.heading,
        "weight_n": walk.result.subject_mass_kg * GRAVITY,
        "foot_length_m": walk.result.foot_length_m,
    }


# Outcome measures of one stance, the same for a simulated walk and for a force plate.
#
# Of the force, low-passed at 40 Hz, over the foot's own stance (20 N), in body weights (BW):
#
#     resultant_first, resultant_second   largest resultant in the first and in the second half of
#                                         stance
#     vertical_first, vertical_second     largest vertical force in these halves
#     vertical_trough                     smallest vertical force between these two
#     propulsion                          largest fore-aft force (forward positive) in the second
#                                         half
#     propulsion_impulse                  integral of the fore-aft force over where it is positive
#                                         (BW s)
#     resultant_rms                       root mean square of the resultant over stance
#
# Of the centre of pressure, low-passed at 6 Hz, along the walking direction, in lengths of the
# prosthetic foot (FL): its excursion (foremost less rearmost) and where it is at half of stance,
# ahead of its rearmost place in that stance. Both are told by the force record alone: where the
# foot stands in the laboratory does not enter.
#
# Of the keel's strain energy (J), which no plate measures: stored, its maximum in stance less its
# value at touch-down; returned, that maximum less its value at lift-off and less what the keel's
# damping takes in between.

OUTCOMES: dict[str, tuple[str, str]] = {
    "resultant_first_bw": ("first peak of the resultant", "BW"),
    "resultant_second_bw": ("second peak of the resultant", "BW"),
    "vertical_first_bw": ("first peak of the vertical force", "BW"),
    "vertical_trough_bw": ("trough of the vertical force", "BW"),
    "vertical_second_bw": ("second peak of the vertical force", "BW"),
    "propulsion_bw": ("peak of the propulsive force", "BW"),
    "propulsion_impulse_bws": ("propulsive impulse", "BW s"),
    "resultant_rms_bw": ("RMS of the resultant over stance", "BW"),
    "cop_excursion_fl": ("CoP excursion", "FL"),
    "cop_mid_stance_fl": ("CoP at mid-stance", "FL"),
    "energy_stored_j": ("keel energy stored", "J"),
    "energy_returned_j": ("keel energy returned", "J"),
}
"""Name: (what it is, unit)."""
NAMES = tuple(OUTCOMES)


@dataclass(frozen=True, eq=False)
class StanceRecord:
    """One stance in numbers."""

    values: np.ndarray
    """(12,) outcomes in the order of NAMES; NaN for what the record does not tell"""
    resultant: np.ndarray  # (101,) BW at 0-100 % of the own stance


def stance_record(
    time_s: np.ndarray,
    grf_W: np.ndarray,
    cop_W: np.ndarray | None,
    *,
    near: Stance,
    heading: np.ndarray,
    weight_n: float,
    foot_length_m: float,
    energy: Mapping[str, np.ndarray] | None = None,
) -> StanceRecord | None:
    """Outcomes of the stance that overlaps `near` most; None if there is none as a whole.

    `time_s` (n,), `grf_W` (n, 3) N on the foot, `cop_W` (n, 3) m, NaN unloaded, None where nobody
    measured it; `heading` (2,) unit vector of progression in W; `energy` (n,) J by name:
    `keel_strain` and `keel_loss`.
    """
    whole = [
        one for one in find_stances(time_s, grf_W[:, 2], threshold_n=THRESHOLD_N) if one.complete
    ]
    stance = partner(near, whole)
    axes = walk_axes(heading)
    if stance is None:
        return None
    grid = uniform_grid(time_s)
    step = float(grid[1] - grid[0])
    cutoff = min(FORCE_CUTOFF_HZ, 0.45 / step)
    force = (
        low_pass(resample(grid, time_s, grf_W @ axes.T), rate_hz=1.0 / step, cutoff_hz=cutoff)
        / weight_n
    )
    resultant = np.linalg.norm(force, axis=1)
    inside = (grid >= stance.start_s) & (grid <= stance.end_s)
    first = inside & (grid <= stance.start_s + 0.5 * stance.duration_s)
    second = inside & ~first
    along = force[:, 0]
    up = force[:, 2]
    peaks = [int(np.argmax(np.where(half, up, -np.inf))) for half in (first, second)]
    values = dict.fromkeys(NAMES, np.nan)
    values |= {
        "resultant_first_bw": resultant[first].max(),
        "resultant_second_bw": resultant[second].max(),
        "vertical_first_bw": up[peaks[0]],
        "vertical_second_bw": up[peaks[1]],
        "vertical_trough_bw": up[peaks[0] : peaks[1] + 1].min(),
        "propulsion_bw": along[second].max(),
        "propulsion_impulse_bws": cumulative_integral(np.maximum(along[inside], 0.0), step)[-1],
        "resultant_rms_bw": np.sqrt(np.mean(resultant[inside] ** 2)),
    }
    instants = percent_instants(stance)
    if cop_W is not None:
        path = filtered_while_loaded((cop_W @ axes.T)[:, :1], time_s, grf_W[:, 2], cop_W, instants)[
            :, 0
        ]
        path /= foot_length_m
        if np.isfinite(path).any():
            cop = path - np.nanmin(path)
            values |= {
                "cop_excursion_fl": np.nanmax(cop),
                "cop_mid_stance_fl": cop[len(PERCENT) // 2],
            }
    if energy is not None:
        strain = energy["keel_strain"]
        loss = energy["keel_loss"]
        rows = np.flatnonzero((time_s >= stance.start_s) & (time_s <= stance.end_s))
        top = rows[np.argmax(strain[rows])]
        start, end = np.interp([stance.start_s, stance.end_s], time_s, strain)
        lost = np.interp(stance.end_s, time_s, loss) - loss[top]
        values |= {
            "energy_stored_j": strain[top] - start,
            "energy_returned_j": strain[top] - end - lost,
        }
    return StanceRecord(
        values=np.array([values[name] for name in NAMES]),
        resultant=np.interp(instants, grid, resultant),
    )


# Errors that a gait laboratory makes in joint angles, drawn at random and added to a recording.
#
# Their sizes are a choice: those with which the embedded laboratory tier was made
# (data/reference_subject/README.md), which are of the order that laboratories report for placing
# markers anew and for repeating a trial with the markers left on. They come in two parts:
#
# - of the session, the same in all its recordings: a constant error of each hip and knee angle of
#   the prosthetic side (misplaced markers) and a smooth one over the gait cycle (sliding skin,
#   crosstalk), a periodic cubic spline with SPLINES coefficients whose mean over the cycle is zero;
# - of the recording: a constant error of each of these angles and of the pelvis's, and of the
#   pelvis's place.
#
# Angles of the other leg do not move the prosthetic foot and stay as they are. All draws are
# independent and normal. Nothing is calibrated away afterwards: a laboratory that fits offsets in
# each session leaves less.

SPLINES = 8
PELVIS_ANGLES = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PELVIS_PLACE = ("pelvis_tx", "pelvis_ty", "pelvis_tz")


class KinematicNoise:
    """Noise of the recordings of a trial; InputError if it has no whole stance, so that its gait
    cycle is unknown."""

    def __init__(self, trial: Trial, sizes: NoiseSizes | None = None) -> None:
        self.trial = trial
        self.sizes = sizes or NoiseSizes()
        names = trial.trajectory.names
        limb = [f"{joint}_{trial.subject.prosthetic_side[0]}" for joint in LIMB_ANGLES]
        self.limb, pelvis, self.place = (
            [names.index(name) for name in wanted if name in names]
            for wanted in (limb, PELVIS_ANGLES, PELVIS_PLACE)
        )
        self.angles = self.limb + pelvis
        self._smooth = smooth_basis(gait_phase(trial)(trial.trajectory.time_s))

    def session(self, random: np.random.Generator) -> np.ndarray:
        """(n, m) rad: one session's error of every sample, as all recordings of this motion would
        have it."""
        constant = np.radians(self.sizes.session_deg) * random.standard_normal(len(self.limb))
        waves = np.radians(self.sizes.session_smooth_deg) * random.standard_normal(
            (SPLINES, len(self.limb))
        )
        error = np.zeros(self.trial.trajectory.values.shape)
        error[:, self.limb] = constant + self._smooth @ waves
        return error

    def recording(self, random: np.random.Generator) -> np.ndarray:
        """(m,) rad and m: one recording's own error."""
        error = np.zeros(self.trial.trajectory.values.shape[1])
        error[self.angles] = np.radians(self.sizes.recording_deg) * random.standard_normal(
            len(self.angles)
        )
        error[self.place] = 1e-3 * self.sizes.recording_mm * random.standard_normal(len(self.place))
        return error

    def perturbed(self, error: np.ndarray) -> Trial:
        """The trial with an error, (n, m) or (m,), added to its samples."""
        motion = self.trial.trajectory
        return dataclasses.replace(self.trial, trajectory=motion.with_values(motion.values + error))


def smooth_basis(phase: np.ndarray) -> np.ndarray:
    """(n, SPLINES): times independent standard normal coefficients it is a periodic curve with mean
    zero over the cycle whose mean square over a cycle is 1, expected."""
    basis = periodic_bsplines(SPLINES)
    cycle = basis(np.linspace(0.0, 1.0, 801)[:-1])
    centred = cycle - cycle.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(np.sum(centred**2, axis=1)))
    own = basis(phase)
    return np.asarray((own - own.mean(axis=1, keepdims=True)) / size)
