"""The roll-over shape of each walk of a study, from the model's centre of pressure and from the plate's.

Both are seen from the same frame, which owes the simulation nothing: the recorded residual shank's. Its origin stands
for the ankle, which the prosthesis does not have: the pylon's lower end, where the foot's mount is, with the socket
unloaded; up is along the pylon to the knee, forward the shank's own. What the socket gives under load is thus part of
the shape. The pylon's own frame, which moves with the socket, shows what the foot does alone; it needs the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import (
    COP_CUTOFF_HZ,
    FORCE_CUTOFF_HZ,
    PERCENT,
    THRESHOLD_N,
    StanceComparison,
    filtered_while_loaded,
)
from vsf_drake.analysis.validation.roll_over.shape import mean_moment_arm, shape_numbers
from vsf_drake.analysis.validation.study import StudyWalk
from vsf_drake.motion.events import find_stances
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.gait import make_gait

OPPOSITE_STRIKE, TOE_OFF = "opposite heel strike", "toe-off"


@dataclass(frozen=True, eq=False)
class Frames:
    """Poses in W over n instants: origins (n, 3) m, and forward, left and up axes as the columns of (n, 3, 3)."""

    time_s: np.ndarray
    origin: np.ndarray
    axes: np.ndarray

    def at(self, time_s: np.ndarray) -> Frames:
        """The same at other times, on straight lines between the known ones."""
        flat = np.column_stack([self.origin, self.axes.reshape(-1, 9)])
        found = np.column_stack([np.interp(time_s, self.time_s, column) for column in flat.T])
        return Frames(np.asarray(time_s), found[:, :3], found[:, 3:].reshape(-1, 3, 3))

    def seen(self, points_W: np.ndarray) -> np.ndarray:
        """(n, 2) forward and up of points (n, 3) in W, one for each instant."""
        return np.einsum("nij,ni->nj", self.axes, points_W - self.origin)[:, [0, 2]]


@dataclass(frozen=True, eq=False)
class WalkedShape:
    """One footfall: `row` of the table, and curves (101, 2) over the measured stance, NaN outside the shape."""

    row: dict[str, Any]
    model: np.ndarray
    measured: np.ndarray
    foot_alone: np.ndarray


def walked_shapes(walk: StudyWalk) -> tuple[list[WalkedShape], list[str]]:
    """The shape of every footfall that is recorded and simulated as a whole, and sentences on what is not there."""
    plate, result = walk.recorded.prosthetic_plate, walk.result
    whole = [item for item in walk.comparison.stances if item.inside]
    missing = []
    if not whole:
        return [], [f"{walk.label}: no stance is recorded and simulated as a whole; it has no roll-over shape."]
    if not plate.has_cop:
        missing.append(f"{walk.label}: the plate has no centre of pressure; its roll-over shape is the model's only.")
    shank, pylon, heel, leg = _frames(walk)
    shapes = []
    for item in whole:
        end, kind = _end(walk, item)
        if kind == TOE_OFF:
            missing.append(f"{walk.label}: opposite heel strike is not recorded; the shape ends at toe-off.")
        instants = item.measured.start_s + PERCENT / 100.0 * item.measured.duration_s
        rolled = instants <= end + 1e-9
        curves, sides = {}, {}
        for name, time, force, cop, free in (
                ("model", result.time_s, result.grf_W, result.cop_W, result.free_moment_nm),
                ("measured", plate.time_s, plate.force_W, plate.cop_W, plate.free_moment_nm)):
            smooth = filtered_while_loaded(
                cop[:, :2], time, force[:, 2], cop, instants, threshold_n=THRESHOLD_N,
                force_cutoff_hz=FORCE_CUTOFF_HZ, cutoff_hz=COP_CUTOFF_HZ)
            smooth[~rolled] = np.nan
            at = np.column_stack([smooth, np.zeros(len(smooth))])
            curves[name] = at
            arm = _arm(shank, item, time, force, cop, free)
            sides[name] = shape_numbers(shank.at(instants).seen(at), heel_m=heel, foot_length_m=result.foot_length_m)
            sides[name] |= {"mean_moment_arm_m": arm,
                            "radius_leg_lengths": _over(sides[name]["radius_m"], leg)}
        alone = pylon.at(instants).seen(curves["model"])
        row = {
            "label": walk.label, "fulcrum_mm": walk.fulcrum_mm, "ends_at": kind,
            "end_percent": 100.0 * (end - item.measured.start_s) / item.measured.duration_s,
            "leg_length_m": leg, "heel_m": heel, **sides,
            "foot_alone": shape_numbers(alone, heel_m=heel, foot_length_m=result.foot_length_m),
        }
        shapes.append(WalkedShape(
            row, shank.at(instants).seen(curves["model"]), shank.at(instants).seen(curves["measured"]), alone))
    return shapes, missing


def _frames(walk: StudyWalk) -> tuple[Frames, Frames, float, float]:
    """Shank and pylon over the walk; where the heel is on the forward axis (m); the prosthetic leg's length (m)."""
    trial, result = walk.trial, walk.result
    gait = make_gait(trial.subject, trial.model)
    person, plant = gait.person, gait.plant
    context = plant.CreateDefaultContext()
    offsets = trial.offsets
    set_mount(context, person.foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
              alignment=offsets.alignment_rad)
    ankle = np.array([0.0, 0.0, -person.body.residual_length - person.body.pylon_length])
    shank = person.segments[f"shank_{trial.subject.prosthetic_side}"]
    p_KHeel = [trial.model.foot.heel_x_m, 0.0, sole_height(trial.model.foot)]
    heel = float((plant.CalcRelativeTransform(
        context, person.socket.distal, person.foot.frame.body_frame()) @ p_KHeel)[0])
    poses: list[list[np.ndarray]] = [[], [], [], []]
    for q in result.q:
        plant.SetPositions(context, q)
        X_WS, X_WP = shank.EvalPoseInWorld(context), person.socket.distal.CalcPoseInWorld(context)
        for column, value in zip(poses, (X_WS @ ankle, X_WS.rotation().matrix(), X_WP.translation(),
                                         X_WP.rotation().matrix()), strict=True):
            column.append(value)
    arrays = [np.array(column) for column in poses]
    return (Frames(result.time_s, arrays[0], arrays[1]), Frames(result.time_s, arrays[2], arrays[3]), heel,
            person.body.prosthetic_leg_length)


def _end(walk: StudyWalk, item: StanceComparison) -> tuple[float, str]:
    """When the shape ends (s), and by what."""
    other = "left" if walk.recorded.subject.prosthetic_side == "right" else "right"
    plate = walk.recorded.plates.get(other)
    if plate is not None:
        for stance in find_stances(plate.time_s, plate.force_W[:, 2], threshold_n=THRESHOLD_N):
            if stance.start_seen and item.measured.start_s < stance.start_s < item.measured.end_s:
                return stance.start_s, OPPOSITE_STRIKE
    return item.measured.end_s, TOE_OFF


def _arm(
    shank: Frames, item: StanceComparison, time: np.ndarray, force: np.ndarray, cop: np.ndarray, free: np.ndarray
) -> float | None:
    """Mean moment arm (m) over the measured stance: moment of the ground's force about the ankle, toe up."""
    rows = (time >= item.measured.start_s) & (time <= item.measured.end_s)
    frames = shank.at(time[rows])
    moment = np.cross(cop[rows] - frames.origin, force[rows])
    moment[:, 2] += free[rows]
    return mean_moment_arm(time[rows], -np.einsum("ni,ni->n", moment, frames.axes[:, :, 1]), force[rows, 2])


def _over(value: float | None, by: float) -> float | None:
    return None if value is None else value / by
