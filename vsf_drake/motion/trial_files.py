"""A trial written as OpenSim files: joint angles and ground reaction forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.formats.writers import write_forces_mot
from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS
from vsf_drake.motion.plates import SIDES
from vsf_drake.motion.storage import write_storage
from vsf_drake.motion.trial_record import Trial


def write_trial_files(trial: Trial, folder: str | Path, stem: str) -> tuple[str, str]:
    """Writes `<stem>_ik.mot` and `<stem>_grf.mot`, which a manifest takes as `kinematics` and `forces`.

    Both are in OpenSim's frame (x forward, y up, z right). Angles are in degrees, with both ankles where the trial
    comes from markers. Forces are ground_force_r_vx, ... with the centre of pressure on the floor, ground_force_r_px,
    ..., and the free moment as the vertical torque, ground_torque_r_y; all zero where a foot is not loaded. What the
    trial's belt carried stays carried: the files are those of a floor at rest.

    Returns:
        The names of the two files.

    Raises:
        InputError: a file cannot be written.
    """
    folder = Path(folder)
    names, values = list(trial.trajectory.names), trial.trajectory.values
    if trial.tracked is not None:
        more = [name for name in trial.tracked.names if name not in names]
        extra = trial.tracked.values[:, [trial.tracked.names.index(name) for name in more]]
        names, values = names + more, np.column_stack([values, extra])
    shown = np.column_stack([column if name in PELVIS_TRANSLATIONS else np.degrees(column)
                             for name, column in zip(names, values.T, strict=True)])
    kinematics, forces = f"{stem}_ik.mot", f"{stem}_grf.mot"
    label = "synthetic" if trial.synthetic else "from a recording"
    write_storage(folder / kinematics, time_s=trial.trajectory.time_s, names=names, values=shown, in_degrees=True,
                  title=f"{stem} joint angles, {label}")
    plates = {side[0]: Plate(side, plate.force_W, plate.cop_W, plate.free_moment_nm)
              for side in SIDES if (plate := trial.plates.get(side)) is not None}
    write_forces_mot(folder / forces, time_s=next(iter(trial.plates.values())).time_s, plates=plates,
                     title=f"{stem} ground reaction forces, {label}")
    return kinematics, forces
