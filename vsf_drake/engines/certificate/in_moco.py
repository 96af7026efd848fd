"""What the ground that Moco's users take does in a roll-over: the condensed foot on OpenSim's
MeyerFregly2016Force, integrated by OpenSim. Nothing but OpenSim, numpy and what is asked is
imported, so that any interpreter that has OpenSim can run it:

python -m vsf_drake.engines.certificate.in_moco FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import opensim

from vsf_drake.engines.certificate.asked import CONDENSED, Asked, foot_file

FILE = "moco.npz"
MOUNT = ("vsf_mount_tx", "vsf_mount_ty", "vsf_mount_pitch")
ACCURACY = 1e-6
"""Relative, of the integrator."""


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
    for name, values in zip(MOUNT, asked.mount.T, strict=True):
        # of degree 3 and without a variance it is the natural spline, which SimmSpline is not
        path = opensim.GCVSpline()
        path.setDegree(3)
        for time_s, value in zip(asked.time_s, values, strict=True):
            path.addPoint(float(time_s), float(value))
        coordinate = model.updCoordinateSet().get(name)
        coordinate.setPrescribedFunction(path)
        coordinate.setDefaultIsPrescribed(True)
    state = model.initSystem()
    state.setTime(float(asked.time_s[0]))
    model.assemble(state)
    manager = opensim.Manager(model)
    manager.setIntegratorMethod(opensim.Manager.IntegratorMethod_CPodes)
    manager.setIntegratorAccuracy(ACCURACY)
    manager.setWriteToStorage(False)
    manager.initialize(state)
    found = []
    for i, time_s in enumerate(asked.time_s):
        if i:
            state = manager.integrate(float(time_s))
        model.realizeDynamics(state)
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
