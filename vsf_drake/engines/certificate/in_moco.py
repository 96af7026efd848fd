"""What the ground that Moco's users take does in a roll-over: the condensed foot on OpenSim's
MeyerFregly2016Force, integrated by OpenSim. Any interpreter that has OpenSim can run it, as
`in_opensim`:

python -m vsf_drake.engines.certificate.in_moco FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import opensim

from vsf_drake.engines.certificate.asked import CONDENSED, Asked, foot_file
from vsf_drake.engines.certificate.in_opensim import along_path

FILE = "moco.npz"


def roll_over(asked: Asked, folder: Path) -> np.ndarray:
    """(T, 2) N forward and up that the ground exerts on all stations along the path of the mount,
    without weight."""
    file = foot_file(folder, CONDENSED, asked.roll_fulcrum_mm, "osim")
    model = opensim.Model(str(file))
    model.setGravity(opensim.Vec3(0.0))
    forces = model.getForceSet()
    ground = [
        force
        for force in (forces.get(i) for i in range(forces.getSize()))
        if force.getConcreteClassName() == "MeyerFregly2016Force"
    ]
    found = []
    for state in along_path(model, asked):
        on_stations = [force.getRecordValues(state) for force in ground]
        found.append([sum(values.get(axis) for values in on_stations) for axis in (0, 1)])
    return np.array(found)


def answer(folder: Path) -> None:
    """Reads what is asked in `folder` and writes `FILE` there."""
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    asked = Asked.read(folder)
    fore_aft, vertical = roll_over(asked, folder).T
    np.savez(
        folder / FILE,
        roll_own_n=vertical,
        roll_own_fore_aft_n=fore_aft,
        version=opensim.GetVersion(),
    )


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
