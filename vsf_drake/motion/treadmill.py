"""A treadmill recording seen from its belt, where the ground stands still."""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.motion.plates import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], tuple[str, ...]]:
    """The same recording in a frame that moves with a belt of constant speed, and a note that says so.

    Only the pelvis's forward position and the centres of pressure change: by speed times time. Forces
    are the same in both frames, since neither accelerates.

    Args:
        speed_m_per_s: + when the belt runs backward (against W's x).
    """
    if speed_m_per_s == 0.0:
        return trajectory, plates, ()
    values = np.array(trajectory.values)
    values[:, trajectory.names.index("pelvis_tx")] += speed_m_per_s * trajectory.time_s
    moved = CoordinateTrajectory(trajectory.time_s, values, trajectory.names, source=trajectory.source)

    def carried(plate: PlateRecording) -> PlateRecording:
        cop = np.array(plate.cop_W)
        cop[:, 0] += speed_m_per_s * plate.time_s
        return dataclasses.replace(plate, cop_W=cop)

    note = f"Recorded on a treadmill: seen from its belt, which runs backward at {speed_m_per_s:g} m/s."
    return moved, {side: carried(plate) for side, plate in plates.items()}, (note,)
