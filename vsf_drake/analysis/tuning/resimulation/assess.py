"""Lays a run of the stepper beside the solution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.resimulation.differences import force_differences, weighted_rms
from vsf_drake.analysis.tuning.resimulation.feedback_use import FeedbackUse
from vsf_drake.analysis.tuning.resimulation.motion import SolutionMotion
from vsf_drake.analysis.tuning.resimulation.result import FEEDBACK, Resimulation
from vsf_drake.analysis.tuning.resimulation.trajectory import FEET, SagittalTrajectory
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.filters import low_pass
from vsf_drake.simulation.results import coordinate_unit
from vsf_drake.simulation.walk import Walk, Walker

CUTOFF_HZ = 40.0
"""As the project filters ground reactions (McGeehan 2021, doi 10.1115/1.4050456)."""
ALTERNATES = 0.3
"""Share of the torques above which they are not resolved by the instants (a choice; 0.1 on a stride of 80)."""


@dataclass(frozen=True, eq=False)
class Run:
    """A walk, or what there is of it, at m ends of steps.

    Attributes:
        time_s: (m,) s. q: (m, 8) of the solution's coordinates. grf_W: by foot (m, 3) N.
        shift_s: by how much its clock is ahead of the solution's where strides are repeated: a whole number of periods.
        first_s: from when on it counts, on its clock. fell_s: until when; None to its end.
    """

    time_s: np.ndarray
    q: np.ndarray
    grf_W: Mapping[str, np.ndarray]
    step_s: float
    unconverged_steps: int
    first_s: float
    shift_s: float = 0.0
    fell_s: float | None = None
    why: str = ""

    @classmethod
    def of(cls, walk: Walk, trajectory: SagittalTrajectory, first_s: float, walker: Walker, *, shift_s: float = 0.0,
           fell_s: float | None = None, why: str = "") -> Run:
        """The walk of a person along `trajectory`."""
        columns = [walk.mechanism.tree.index(name) for name in trajectory.names]
        return cls(time_s=walk.record.time_s, q=walk.record.q[:, columns],
                   grf_W={"prosthetic": walk.prosthetic.grf_W, "intact": walk.intact.grf_W}, step_s=walk.step_s,
                   unconverged_steps=int(np.sum(~walk.record.converged)), first_s=first_s, shift_s=shift_s,
                   fell_s=fell_s, why=why)


def assess(
    run: Run, trajectory: SagittalTrajectory, *, kind: str, body_weight_n: float, feedback: FeedbackUse | None = None
) -> Resimulation:
    """The run at the solution's instants, with the differences of ground reaction and motion."""
    instants = np.asarray(trajectory.time_s, dtype=float) + run.shift_s
    last = run.time_s[-1] if run.fell_s is None else min(run.fell_s, run.time_s[-1])
    counted = (instants >= max(run.first_s, run.time_s[0]) - 1e-9) & (instants <= last + 1e-9)
    sagittal = {foot: force[:, [0, 2]] for foot, force in run.grf_W.items()}
    smooth = {foot: low_pass(force, rate_hz=1.0 / run.step_s, cutoff_hz=CUTOFF_HZ) for foot, force in sagittal.items()}
    series = {filtered: {foot: _at(instants, run.time_s, forces[foot], counted) for foot in FEET}
              for filtered, forces in ((False, sagittal), (True, smooth))}
    differences = tuple(d for filtered in (False, True) for d in force_differences(
        trajectory.time_s, trajectory.grf, series[filtered], counted, filtered=filtered, body_weight_n=body_weight_n))
    shown = (run.time_s >= run.first_s - 1e-9) & (run.time_s <= min(instants[-1], last) + 1e-9)
    lateral = max(np.abs(force[shown, 1]).max(initial=0.0) for force in run.grf_W.values())
    return Resimulation(
        kind=kind, fell=run.fell_s is not None,
        fell_after_s=None if run.fell_s is None else run.fell_s - trajectory.start_s, why=run.why,
        time_s=np.array(trajectory.time_s), counted=counted,
        solution_grf={foot: np.array(trajectory.grf[foot]) for foot in FEET}, grf=series[False],
        filtered_grf=series[True], forces=differences,
        motion_rms=_motion_rms(run, trajectory, shown) if kind == FEEDBACK else {},
        lateral_percent_bw=100.0 * float(lateral) / body_weight_n, unconverged_steps=run.unconverged_steps,
        feedback=feedback, walk_time_s=run.time_s[shown] - run.shift_s, walk_q=run.q[shown],
        walk_grf={foot: force[shown] for foot, force in sagittal.items()},
        walk_filtered_grf={foot: force[shown] for foot, force in smooth.items()}, notes=tuple(_notes(trajectory)))


def _notes(trajectory: SagittalTrajectory) -> list[str]:
    notes = []
    if trajectory.alternation > ALTERNATES:
        notes.append(f"The solution's torques go up and down from instant to instant by "
                     f"{100.0 * trajectory.alternation:.0f} % of their size: its instants do not resolve them, and "
                     "what happens between them is not known.")
    standing = () if trajectory.periodic else (foot for foot in FEET if trajectory.grf[foot][0, 1] > THRESHOLD_N)
    notes += [f"The {foot} foot stood on the ground when the run began: how friction loads it fore-aft depends on "
              "what went before, which the run cannot know, and takes long to be forgotten." for foot in standing]
    return notes


def _at(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """(n, k) values at the instants, NaN where they do not count."""
    found = np.column_stack([np.interp(instants, time_s, column) for column in values.T])
    found[~counted] = np.nan
    return found


def _motion_rms(run: Run, trajectory: SagittalTrajectory, shown: np.ndarray) -> dict[str, float]:
    deviation = run.q[shown] - SolutionMotion(trajectory).sample(run.time_s[shown])[0]
    weights = np.ones(len(deviation))
    return {name: weighted_rms(deviation[:, i], weights) * (1e3 if coordinate_unit(name) == "m" else 180.0 / np.pi)
            for i, name in enumerate(trajectory.names)}
