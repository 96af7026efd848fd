"""The walks behind the question whether two settings can be told apart: each motion at each position, with noise.

Every base trial is walked at all positions of the fulcrum, first as it was recorded and then with errors of its
kinematics. One draw is a session with two recordings of the same stride: its errors are those of the session plus those
of the recording. Both are walked at all positions, so that every way of comparing two positions is among them:

    same recording   recording 1 at both positions
    same session     recording 1 at one position, recording 2 at the other
    two sessions     recordings of different draws

Only one stance of each trial is walked (the complete one nearest the middle of its window) with MARGIN_S around.
Every draw has its own stream of random numbers, told by the seed, the trial and the number of the draw.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import MARGIN_S
from vsf_drake.analysis.validation.settings.kinematic_noise import KinematicNoise, NoiseSizes
from vsf_drake.analysis.validation.settings.outcomes import NAMES, StanceRecord, stance_record
from vsf_drake.analysis.validation.study import Progress, StudyWalk
from vsf_drake.errors import InputError
from vsf_drake.motion.events import Stance
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.many import WalkCase, WalkOutcome, simulate_many
from vsf_drake.simulation.many.executors import chosen

STEP_S = 2e-3
KEEP = ("time_s", "grf_W", "cop_W", "energy_j")
RECORDINGS = 2
_STREAM = 6


@dataclass(frozen=True, eq=False)
class Base:
    """One trial and the stance of it that is walked.

    Attributes:
        trial: cut to the stance ± MARGIN_S.
        measured: its outcomes on the plate, None for what the plate does not tell; `simulated` of the study's walk.
    """

    walk: StudyWalk
    trial: Trial
    stance: Stance
    noise: KinematicNoise
    measured: StanceRecord
    simulated: StanceRecord

    @property
    def label(self) -> str:
        return self.walk.label

    def record(self, outcome: WalkOutcome) -> StanceRecord | None:
        """What one of its walks says; None if the walk failed or the foot of the model has no whole stance."""
        if not outcome.ok:
            return None
        arrays = outcome.arrays
        ledger = dict(zip(outcome.columns["energy_j"], arrays["energy_j"].T, strict=True))
        return _record(self.walk, self.stance, arrays["time_s"], arrays["grf_W"], arrays["cop_W"], ledger)


@dataclass(frozen=True, eq=False)
class Walked:
    """Walks of one base trial at P positions, without noise and with D draws of R = 2 recordings; NaN where one failed.

    Attributes:
        base_values: (P, O) outcomes in the order of NAMES. values: (D, R, P, O).
        base_resultant, base_cop: (P, 101) BW and FL over the own stance. resultant, cop: (D, R, P, 101).
        time_s: (n,) instants. base_locked: (P, n) BW, the resultant there. locked: (D, R, P, n).
        failed: walks that failed or have no whole stance.
    """

    base: Base
    base_values: np.ndarray
    values: np.ndarray
    base_resultant: np.ndarray
    resultant: np.ndarray
    base_cop: np.ndarray
    cop: np.ndarray
    time_s: np.ndarray
    base_locked: np.ndarray
    locked: np.ndarray
    failed: int


def base_of(walk: StudyWalk, sizes: NoiseSizes | None = None) -> Base:
    """The stance of `walk` that is used.

    Raises:
        InputError: there is no stance that the plate and the model both show as a whole.
    """
    trial, middle = walk.trial, 0.5 * (walk.trial.start_s + walk.trial.end_s)
    whole = [item.measured for item in walk.comparison.stances if item.inside]
    for stance in sorted(whole, key=lambda s: abs(0.5 * (s.start_s + s.end_s) - middle)):
        plate, result = trial.prosthetic_plate, walk.result
        near = (plate.time_s > stance.start_s - 4 * MARGIN_S) & (plate.time_s < stance.end_s + 4 * MARGIN_S)
        measured = _record(walk, stance, plate.time_s[near], plate.force_W[near],
                           plate.cop_W[near] if plate.has_cop else None)
        ledger = dict(zip(result.energy_names, result.energy_j.T, strict=True))
        simulated = _record(walk, stance, result.time_s, result.grf_W, result.cop_W, ledger)
        if measured is not None and simulated is not None:
            window = dataclasses.replace(trial, start_s=max(trial.start_s, stance.start_s - MARGIN_S),
                                         end_s=min(trial.end_s, stance.end_s + MARGIN_S))
            return Base(walk, window, stance, KinematicNoise(window, sizes), measured, simulated)
    raise InputError("has no stance that both plate and model show as a whole", where=walk.label)


def walk_all(
    bases: Sequence[Base], positions_m: Sequence[float], *, draws: int, seed: int, workers: int | None,
    progress: Progress | None = None
) -> list[Walked]:
    """Walks every base at every position, without noise and with `draws` sessions of two recordings."""
    each = len(positions_m) * (1 + RECORDINGS * draws)
    found = []
    with chosen(workers, None, each * len(bases)) as (pool, most):
        for i, base in enumerate(bases):
            trials = [base.trial, *(trial for d in range(draws) for trial in _drawn(base, seed, i, d))]
            cases = [WalkCase(trial=trial, fulcrum_m=x, step_s=STEP_S) for trial in trials for x in positions_m]

            def show(state: object, i: int = i, base: Base = base) -> None:
                if progress:
                    progress(f"{base.label} at {len(positions_m)} positions, with errors of its kinematics",
                             (i + getattr(state, "done", 0) / each) / len(bases))
            outcomes = simulate_many(cases, keep=KEEP, executor=pool, workers=max(1, most // 2), progress=show)
            found.append(_walked(base, outcomes, len(positions_m), draws))
    return found


def _drawn(base: Base, seed: int, trial: int, draw: int) -> list[Trial]:
    random = np.random.default_rng([seed, _STREAM, trial, draw])
    session = base.noise.session(random)
    return [base.noise.perturbed(session + base.noise.recording(random)) for _ in range(RECORDINGS)]


def _walked(base: Base, outcomes: Sequence[WalkOutcome], positions: int, draws: int) -> Walked:
    records = [base.record(outcome) for outcome in outcomes]
    time = next((record.time_s for record in records if record is not None), np.empty(0))
    shape = (1 + RECORDINGS * draws, positions)

    def stacked(name: str, size: int) -> tuple[np.ndarray, np.ndarray]:
        rows = [np.full(size, np.nan) if record is None else getattr(record, name) for record in records]
        every = np.array(rows).reshape(*shape, size)
        return every[0], every[1:].reshape(draws, RECORDINGS, positions, size)

    base_values, values = stacked("values", len(NAMES))
    base_resultant, resultant = stacked("resultant", 101)
    base_cop, cop = stacked("cop", 101)
    base_locked, locked = stacked("locked", len(time))
    return Walked(base, base_values, values, base_resultant, resultant, base_cop, cop, time, base_locked, locked,
                  sum(record is None for record in records))


def _record(
    walk: StudyWalk, near: Stance, time_s: np.ndarray, grf_W: np.ndarray, cop_W: np.ndarray | None,
    energy: dict[str, np.ndarray] | None = None
) -> StanceRecord | None:
    return stance_record(time_s, grf_W, cop_W, near=near, heading=walk.comparison.heading,
                         weight_n=walk.result.subject_mass_kg * GRAVITY, foot_length_m=walk.result.foot_length_m,
                         energy=energy)
