"""A recorded trial as the 3-D model shows it, and seen from the side of its way of walking."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsf_drake.analysis.tuning.recorded_chain import (
    TILT,
    TX,
    SagittalChain,
    sagittal_chain,
    targets,
)
from vsf_drake.analysis.tuning.recorded_events import heading
from vsf_drake.analysis.tuning.recorded_points import BodyPoints, body_points
from vsf_drake.analysis.tuning.recorded_projection import Misfit, Nearness, make_misfit
from vsf_drake.errors import InputError
from vsf_drake.motion.kinematics import PELVIS_ROTATIONS
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker

MOST_HZ = 200.0
"""Faster recordings are thinned to about this rate: a stride's curves hold nothing above 20 Hz."""


@dataclass(frozen=True, eq=False)
class View:
    """The recorded instants of a trial, n of them.

    Attributes:
        points: in 3-D. zero: the same with every coordinate at zero. chain: the sagittal model.
        names: its coordinates. recorded: (n, 8) their values in the 3-D motion; pelvis_tx and pelvis_tilt as they
            would be called in a laboratory whose x axis is the way of walking.
        pelvis: (n, 3) tilt, list and rotation of the pelvis in the laboratory, rad.
        forward: (2,) the way of walking. ground: z of the floor, m.
    """

    time_s: np.ndarray
    points: BodyPoints
    zero: BodyPoints
    chain: SagittalChain
    names: tuple[str, ...]
    recorded: np.ndarray
    pelvis: np.ndarray
    forward: np.ndarray
    ground: float

    @property
    def wanted(self) -> np.ndarray:
        """(n, k) complex, m: the chain's points seen from the side."""
        return targets(self.chain, self.points, self.forward)

    def turned(self, forward: np.ndarray) -> View:
        """The same along another way of walking."""
        recorded = self.recorded.copy()
        # tilt about -y, then list about x, then rotation about z, each in the axes that the former have turned
        turned = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0]))
        turned = turned * Rotation.from_euler("YXZ", self.pelvis * [-1.0, 1.0, 1.0])
        recorded[:, TILT] = -turned.as_euler("YXZ")[:, 0]
        recorded[:, TX] = self.points.pelvis[:, :2] @ forward
        return dataclasses.replace(self, forward=forward, recorded=recorded)

    def at(self, rows: np.ndarray) -> View:
        """The same at some of the instants only; rows: (n,) bool."""
        return dataclasses.replace(self, time_s=self.time_s[rows], points=self.points.at(rows),
                                   recorded=self.recorded[rows], pelvis=self.pelvis[rows])

    def misfit(self, nearness: Nearness | None) -> Misfit:
        """What is to be small for a sagittal motion to be near."""
        return make_misfit(self.chain, self.wanted, self.recorded, ground=self.ground, nearness=nearness)


def view(trial: Trial, walker: Walker | None) -> View:
    """What the model shows of a trial, along the pelvis's way over the whole recording.

    Raises:
        InputError: the walker is another person; the pelvis hardly travels.
    """
    walker = walker or Walker(trial.subject, trial.model)
    if walker.subject.prosthetic_side != trial.subject.prosthetic_side:
        raise InputError(f"the walker's prosthesis is on the {walker.subject.prosthetic_side}, the trial's on the "
                         f"{trial.subject.prosthetic_side}", file=trial.path, where="subject.prosthetic_side")
    motion = trial.trajectory
    rate = (len(motion.time_s) - 1) / (motion.end_s - motion.start_s)
    rows = slice(None, None, max(1, round(rate / MOST_HZ)))
    time, values = motion.time_s[rows], motion.values[rows]
    place = {"fulcrum_m": trial.fulcrum_m}
    points = body_points(walker, trial.offsets, motion.names, values, **place)
    names = sagittal_coordinates(trial.subject.prosthetic_side)
    forward = heading(points, file=trial.path)
    found = View(
        time_s=time, points=points, names=names, recorded=motion.ordered(names).values[rows], forward=forward,
        pelvis=motion.ordered(PELVIS_ROTATIONS).values[rows],
        zero=body_points(walker, trial.offsets, (), np.zeros((1, 0)), **place),
        chain=sagittal_chain(walker, trial.offsets, **place), ground=points.ground)
    return found.turned(forward)


def stride_heading(seen: View, period_s: float) -> np.ndarray:
    """(2,) the mean way of the pelvis over a stride, in which its sway from side to side has no part."""
    time = seen.time_s
    early = time[time + period_s <= time[-1]]
    if not early.size:
        return seen.forward
    way = [np.mean(np.interp(early + period_s, time, column) - column[: len(early)])
           for column in seen.points.pelvis[:, :2].T]
    return np.array(way) / np.hypot(*way)
