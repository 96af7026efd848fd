"""Sagittal motions of the embedded person, as solutions to re-simulate: a recorded stride made
periodic.

Its loads and ground reaction are those of the walk that follows it, so that it satisfies the full
model's equations except that the pelvis is held by what no leg gives.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np

from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.optimal_control.recorded_stride import RecordedStride, recorded_stride
from vsf_drake.optimal_control.trajectory import SagittalTrajectory, SolutionMotion, whole_motion
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.embedded import embedded_contact, embedded_trials


@cache
def embedded_trial() -> Trial:
    """Medium setting, exact, with the contact that was fitted."""
    return trial_with(
        load_trial(embedded_trials("exact", quick=True)[1]), load_contact(embedded_contact("exact"))
    )


@cache
def embedded_walker() -> Walker:
    """The embedded person. Leave its Context as you found it."""
    trial = embedded_trial()
    return Walker(trial.subject, trial.model)


@cache
def _stride() -> RecordedStride:
    return recorded_stride(embedded_trial(), embedded_walker())


@cache
def periodic_motion(count: int) -> SagittalTrajectory:
    """The stride at `count` intervals; torques and forces are zero."""
    stride, trial = _stride(), embedded_trial()
    time = stride.period_s * np.linspace(0.0, 1.0, count + 1)
    q, v, a = stride.sample(time)
    zero = np.zeros((count + 1, 2))
    return SagittalTrajectory(
        time_s=time,
        names=stride.names,
        q=q,
        v=v,
        a=a,
        torque=np.zeros((count + 1, 5)),
        advance=q[-1] - q[0],
        grf={"prosthetic": zero, "intact": zero},
        fulcrum_m=trial.fulcrum_m,
        offsets=trial.offsets,
    )


@cache
def loaded_motion(count: int) -> SagittalTrajectory:
    """The same with the loads and the ground reaction of the walk that follows it."""
    motion = periodic_motion(count)
    walk = walked(motion, motion.start_s - 0.3 * motion.period_s, motion.end_s + 0.05)
    columns = [walk.mechanism.tree.index(name) for name in motion.names]

    def at_instants(values: np.ndarray) -> np.ndarray:
        found = np.column_stack(
            [np.interp(motion.time_s, walk.record.time_s, column) for column in values.T]
        )
        found[0] = found[-1]
        return found

    load = at_instants(walk.record.load[:, columns])
    return dataclasses.replace(
        motion,
        torque=load[:, 3:],
        pelvis_load=load[:, :3],
        grf={
            "prosthetic": at_instants(walk.prosthetic.grf_W[:, [0, 2]]),
            "intact": at_instants(walk.intact.grf_W[:, [0, 2]]),
        },
    )


def walked(motion: SagittalTrajectory, start_s: float, end_s: float) -> Walk:
    """The walk along it, by the walker's own means."""
    walker = embedded_walker()
    return walker.walk(
        whole_motion(SolutionMotion(motion), walker.gait.prescribed, start_s, end_s),
        fulcrum_m=motion.fulcrum_m,
        offsets=motion.offsets,
        start_s=start_s,
        end_s=end_s,
    )
