"""Sagittal motions of the embedded person, as solutions to re-simulate: a recording without its third dimension.

The stride is the recorded one made periodic; its loads and ground reaction are those of the walk that follows it, so
that it satisfies the full model's equations except that the pelvis is held by what no leg gives.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np

from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory, SolutionMotion, whole_motion
from vsf_drake.analysis.validation.study import embedded_contact, embedded_trials
from vsf_drake.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walk, Walker

HARMONICS = 8
"""Of the periodic stride; walking has little above the sixth (Winter 2009)."""


@cache
def embedded_trial() -> Trial:
    """Medium setting, exact, with the contact that was fitted."""
    return trial_with(load_trial(embedded_trials("exact", quick=True)[1]), load_contact(embedded_contact("exact")))


@cache
def embedded_walker(free: tuple[str, ...] = ()) -> Walker:
    """The embedded person. Leave its Context as you found it."""
    trial = embedded_trial()
    return Walker(trial.subject, trial.model, free=free)


def sagittal() -> tuple[str, ...]:
    """The coordinates."""
    return sagittal_coordinates(embedded_trial().subject.prosthetic_side)


@cache
def periodic_motion(count: int) -> SagittalTrajectory:
    """The recorded stride as a Fourier series, at `count` intervals, at the height at which the feet carry the
    weight on average; torques and forces are zero."""
    low, high = 0.0, 0.04
    for _ in range(8):
        middle = 0.5 * (low + high)
        motion = _raised(count, middle)
        low, high = (middle, high) if _mean_load(motion) > 1.0 else (low, middle)
    return _raised(count, 0.5 * (low + high))


@cache
def loaded_motion(count: int) -> SagittalTrajectory:
    """The same with the loads and the ground reaction of the walk that follows it."""
    motion = periodic_motion(count)
    walk = walked(motion, motion.start_s - 0.3 * motion.period_s, motion.end_s + 0.05)
    columns = [walk.mechanism.tree.index(name) for name in motion.names]

    def at_instants(values: np.ndarray) -> np.ndarray:
        found = np.column_stack([np.interp(motion.time_s, walk.record.time_s, column) for column in values.T])
        found[0] = found[-1]
        return found

    load = at_instants(walk.record.load[:, columns])
    return dataclasses.replace(
        motion, torque=load[:, 3:], pelvis_load=load[:, :3],
        grf={"prosthetic": at_instants(walk.prosthetic.grf_W[:, [0, 2]]),
             "intact": at_instants(walk.intact.grf_W[:, [0, 2]])})


def _mean_load(motion: SagittalTrajectory) -> float:
    walk = walked(motion, motion.start_s - 0.1, motion.end_s)
    counts = walk.record.time_s > motion.start_s
    weight = embedded_trial().subject.mass_kg * GRAVITY
    return float(np.mean((walk.prosthetic.grf_W + walk.intact.grf_W)[counts, 2])) / weight


def _raised(count: int, raised_m: float) -> SagittalTrajectory:
    names, recorded = sagittal(), embedded_trial().trajectory.ordered(sagittal())
    period = _period(recorded)
    start = 0.5 * (embedded_trial().start_s + embedded_trial().end_s - period)
    t = start + period * np.arange(256) / 256
    q = recorded.sample(t)[0]
    advance = np.zeros(8)
    advance[1] = np.mean(np.diff(recorded.sample(np.array([start, start + period]))[0][:, 1]))
    drift = np.outer((t - start) / period, advance)
    spectrum = np.fft.rfft(q - drift, axis=0) / 256
    instants = start + period * np.linspace(0.0, 1.0, count + 1)
    k = np.arange(HARMONICS + 1)
    phase = np.exp(2j * np.pi * np.outer((instants - start) / period, k))
    weight = np.where(k == 0, 1.0, 2.0)[:, None] * spectrum[: HARMONICS + 1]
    rate = (2j * np.pi * k / period)[:, None]
    found = [(phase @ (weight * rate**d)).real for d in range(3)]
    found[0] += np.outer((instants - start) / period, advance)
    found[1] += advance / period
    found[0][:, 2] += raised_m
    zero = np.zeros((count + 1, 2))
    return SagittalTrajectory(
        time_s=instants, names=names, q=found[0], v=found[1], a=found[2], torque=np.zeros((count + 1, 5)),
        grf={"prosthetic": zero, "intact": zero}, fulcrum_m=embedded_trial().fulcrum_m,
        advance=advance)


def walked(motion: SagittalTrajectory, start_s: float, end_s: float) -> Walk:
    """The walk along it, by the walker's own means."""
    walker = embedded_walker()
    return walker.walk(whole_motion(SolutionMotion(motion), walker.gait.prescribed, start_s, end_s),
                       fulcrum_m=motion.fulcrum_m, start_s=start_s, end_s=end_s)


def _period(recorded) -> float:
    """The shift in time by which the motion is most like itself."""
    trial = embedded_trial()
    rotations = [0, 3, 4, 5, 6, 7]

    def gap(period: float) -> float:
        t = np.arange(trial.start_s, trial.end_s - period, 0.01)
        return float(np.mean((recorded.sample(t)[0] - recorded.sample(t + period)[0])[:, rotations] ** 2))

    candidates = np.arange(1.0, 1.5, 0.002)
    return float(candidates[np.argmin([gap(period) for period in candidates])])
