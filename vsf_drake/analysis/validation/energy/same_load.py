"""A trial walked with the fulcrum elsewhere and the load on the foot kept: the pelvis rises and sinks as that takes.

The recorded motion prescribes where the limb goes, so that a stiffer foot under the same motion is pressed as far and
bears more. A person carries the same weight on either. Here the motion is changed by a course of the pelvis' height
until the vertical force on the prosthetic foot is that of the walk at the trial's own position; everything else of
the motion stays. The course is found by Newton's method instant by instant, with how the force depends on the height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.courses import Course
from vsf_drake.simulation.walk import Walker
from vsf_drake.simulation.walk_run import Walk

HEIGHT = "pelvis_ty"
MOST_WALKS = 8
CLOSE_ENOUGH = 0.002
"""Of body weight: root mean square over stance of what the forces differ by, at which the search ends."""
USABLE = 0.01
"""The same, beyond which the load does not count as kept."""
FORCE_CUTOFF_HZ, HEIGHT_CUTOFF_HZ = 20.0, 12.0
"""Of the forces that are compared and of the change of height (choices)."""
LEAST_N_PER_M = 8e3
"""Least stiffness in a Newton step, where the foot hardly bears (a choice)."""


@dataclass(frozen=True, eq=False)
class SameLoad:
    """A walk with the load of another.

    Attributes:
        walk: with the changed height, in the finer step.
        off_bw: root mean square over stance of what the low-passed vertical forces differ by, over body weight.
        height_mm: largest change of the pelvis' height.
    """

    walk: Walk
    off_bw: float
    height_mm: float

    @property
    def kept(self) -> bool:
        """Whether the load is that of the other walk."""
        return self.off_bw <= USABLE


def walk_with_same_load(
    walker: Walker, trial: Trial, *, fulcrum_m: float, search_step_s: float, step_s: float
) -> SameLoad:
    """Walks `trial` with the fulcrum at `fulcrum_m` (m from A) under the load that it has with its own.

    Args:
        search_step_s: of the walks that look for the height. step_s: of the one that is returned.

    Raises:
        InputError, SimulationError: see `Walker.walk`.
    """
    weight = walker.subject.mass_kg * float(np.linalg.norm(walker.gait.plant.gravity_field().gravity_vector()))
    own = _walk(walker, trial, trial.fulcrum_m, search_step_s)
    time, wanted = own.record.time_s, _vertical(own)
    stances = find_stances(time, own.prosthetic.grf_W[:, 2])
    grid = np.concatenate([[trial.start_s], time])
    height = np.zeros(len(grid))
    for _ in range(MOST_WALKS):
        walk = _walk(walker, trial, fulcrum_m, search_step_s, course=_course(grid, height), differentiated=True)
        too_much = _vertical(walk) - wanted
        if _rms(too_much, time, stances) <= CLOSE_ENOUGH * weight:
            break
        assert walk.sensitivity is not None
        falling = _smooth(-walk.sensitivity.grf_W[:, 2, 0], search_step_s, HEIGHT_CUTOFF_HZ)
        raised = _smooth(too_much / np.maximum(falling, LEAST_N_PER_M), search_step_s, HEIGHT_CUTOFF_HZ)
        height = height + np.concatenate([[0.0], raised])
    final = _walk(walker, trial, fulcrum_m, step_s, course=_course(grid, height))
    off = np.interp(time, final.record.time_s, _vertical(final)) - wanted
    return SameLoad(walk=final, off_bw=_rms(off, time, stances) / weight, height_mm=float(1e3 * np.abs(height).max()))


def _course(grid: np.ndarray, height: np.ndarray) -> Course:
    return Course(name="height", coordinate=HEIGHT, shape=make_interp_spline(grid, height, k=3))


def _walk(walker: Walker, trial: Trial, fulcrum_m: float, step_s: float, *, course: Course | None = None,
          differentiated: bool = False) -> Walk:
    return walker.walk(
        trial.trajectory, fulcrum_m=fulcrum_m, start_s=trial.start_s, end_s=trial.end_s, step_s=step_s,
        offsets=trial.offsets, courses=[] if course is None else [course],
        values={} if course is None else {f"course.{course.name}": 1.0},
        with_respect_to=(f"coordinate.{HEIGHT}",) if differentiated else ())


def _vertical(walk: Walk) -> np.ndarray:
    return _smooth(walk.prosthetic.grf_W[:, 2], walk.step_s, FORCE_CUTOFF_HZ)


def _smooth(values: np.ndarray, step_s: float, cutoff_hz: float) -> np.ndarray:
    return low_pass(values, rate_hz=1.0 / step_s, cutoff_hz=cutoff_hz)


def _rms(values: np.ndarray, time: np.ndarray, stances: list[Stance]) -> float:
    inside = np.zeros(len(time), dtype=bool)
    for stance in stances:
        inside |= (time >= stance.start_s) & (time <= stance.end_s)
    return float(np.sqrt(np.mean(values[inside] ** 2))) if inside.any() else 0.0
