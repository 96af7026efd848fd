"""What OpenSim answers of the foot's .osim files. Nothing but OpenSim, numpy and what is asked is
imported, so that any interpreter that has OpenSim can run it:

python -m vsf_drake.engines.certificate.in_opensim FOLDER
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import opensim

from vsf_drake.engines.certificate.asked import ELASTIC, NOMINAL, Asked, foot_file

FILE = "opensim.npz"
MOUNT = ("vsf_mount_tx", "vsf_mount_ty", "vsf_mount_pitch")
UP_ON_SPHERE = 7
"""Of what a force between two points records: forces and points, xyz each, of body 1 and body 2."""
AT_REST_NM = 1e-10
"""Moment that may be left over in a hinge."""
ITERATIONS = 30
NUDGE_RAD = 1e-6
LONGEST_STEP_RAD = 0.1
ACCURACY = 1e-6
"""Relative, of the integrator."""


class Foot:
    """The model of a file, and a state of it from `begin` on, the mount where the file has it."""

    def __init__(self, file: Path, hinges: np.ndarray, *, weight: bool) -> None:
        self.model = opensim.Model(str(file))
        if not weight:
            self.model.setGravity(opensim.Vec3(0.0))
        forces = self.model.updForceSet()
        self.forces = [forces.get(i) for i in range(forces.getSize())]
        self.spheres = [force for force in self.forces if force.getName().startswith("foam_")]
        coordinates = self.model.updCoordinateSet()
        self.hinges = [coordinates.get(str(name)) for name in hinges]

    def begin(self) -> None:
        """Makes the state, after the last change of the model."""
        self.state = self.model.initSystem()
        self.dynamics = opensim.InverseDynamicsSolver(self.model)
        rows = []
        for hinge in self.hinges:
            hinge.setSpeedValue(self.state, 1.0)
            rows.append(int(np.argmax(self.state.getU().to_numpy())))
            hinge.setSpeedValue(self.state, 0.0)
        self.rows = np.array(rows)

    def moments(self, q: np.ndarray) -> np.ndarray:
        """(B,) N m in the hinges that would keep them at rest at `q` (B,) rad, where it leaves
        them."""
        for hinge, angle in zip(self.hinges, q, strict=True):
            hinge.setValue(self.state, float(angle), False)
        self.model.realizeVelocity(self.state)
        return np.asarray(self.dynamics.solve(self.state).to_numpy()[self.rows])

    def rest(self, q: np.ndarray) -> np.ndarray:
        """(B,) rad where no moment is needed, by Newton's method from `q`; RuntimeError where that
        ends nowhere."""
        for _ in range(ITERATIONS):
            left = self.moments(q)
            if np.abs(left).max() <= AT_REST_NM:
                return q
            slopes = [
                (self.moments(q + nudge) - self.moments(q - nudge)) / (2.0 * NUDGE_RAD)
                for nudge in NUDGE_RAD * np.eye(len(q))
            ]
            step = -np.linalg.solve(np.array(slopes).T, left)
            q = q + step * min(1.0, LONGEST_STEP_RAD / np.abs(step).max())
        raise RuntimeError(f"{np.abs(left).max():g} N m are left over in a hinge")


def shapes(asked: Asked, folder: Path, fulcrum_mm: float) -> np.ndarray:
    """(L, P, 2) m, x and z in K of the keel's hinges before the load point C, and of C, under each
    load, without weight and ground."""
    foot = Foot(foot_file(folder, NOMINAL, fulcrum_mm, "osim"), asked.hinges, weight=False)
    for sphere in foot.spheres:
        sphere.set_appliesForce(False)
    p_BC = asked.p_BC.tolist()
    bodies = foot.model.getBodySet()
    pressed = [bodies.get(str(name)) for name in asked.bodies[: asked.carrier + 1]]
    loaded = pressed[-1]
    points = [(body, (0.0, 0.0, 0.0)) for body in pressed] + [(loaded, p_BC)]
    load = opensim.PrescribedForce("load", loaded)
    load.setPointIsInGlobalFrame(False)
    load.setForceIsInGlobalFrame(True)
    load.setPointFunctions(*map(opensim.Constant, p_BC))
    # its newtons are the state's seconds
    newtons = opensim.LinearFunction(1.0, 0.0)
    load.setForceFunctions(opensim.Constant(0.0), newtons, opensim.Constant(0.0))
    foot.model.addForce(load)
    foot.begin()
    q = np.zeros(len(foot.hinges))
    found = []
    for load_n in asked.load_n:
        foot.state.setTime(float(load_n))
        q = foot.rest(q)
        p_K = [
            body.findStationLocationInAnotherFrame(
                foot.state, opensim.Vec3(*point), bodies.get("vsf_frame")
            ).to_numpy()
            for body, point in points
        ]
        found.append(p_K)
    return np.array(found)[:, :, :2]


def mass_and_gravity(asked: Asked, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, B, B) kg m^2 mass matrices of the hinges and (P, B) N m that gravity exerts on them, the
    mount held."""
    file = foot_file(folder, NOMINAL, asked.roll_fulcrum_mm, "osim")
    foot = Foot(file, asked.hinges, weight=True)
    for force in foot.forces:
        force.set_appliesForce(False)
    foot.begin()
    full = opensim.Matrix()
    masses = []
    torques = []
    for pose in asked.poses_rad:
        torques.append(-foot.moments(pose))
        foot.model.getMatterSubsystem().calcM(foot.state, full)
        masses.append(full.to_numpy()[np.ix_(foot.rows, foot.rows)])
    return np.array(masses), np.array(torques)


def roll_over(asked: Asked, folder: Path, law: str) -> np.ndarray:
    """(T,) N that the ground exerts upwards on all spheres along the path of the mount, without
    weight."""
    file = foot_file(folder, law, asked.roll_fulcrum_mm, "osim")
    foot = Foot(file, asked.hinges, weight=False)
    return np.array(
        [
            sum(sphere.getRecordValues(state).get(UP_ON_SPHERE) for sphere in foot.spheres)
            for state in along_path(foot.model, asked)
        ]
    )


def along_path(model: Any, asked: Asked) -> Iterator[Any]:
    """The states of a foot's model at the instants that are asked, its mount led along the path:
    integrated, and realized to its forces."""
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
    for i, time_s in enumerate(asked.time_s):
        if i:
            state = manager.integrate(float(time_s))
        model.realizeDynamics(state)
        yield state


def answer(folder: Path) -> None:
    """Reads what is asked in `folder` and writes `FILE` there."""
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    asked = Asked.read(folder)
    masses, torques = mass_and_gravity(asked, folder)
    np.savez(
        folder / FILE,
        rise_m=[shapes(asked, folder, mm)[:, -1, 1] for mm in asked.fulcrum_mm],
        mass_matrix_kg_m2=masses,
        gravity_torque_nm=torques,
        roll_elastic_n=roll_over(asked, folder, ELASTIC),
        roll_nominal_n=roll_over(asked, folder, NOMINAL),
        version=opensim.GetVersion(),
    )


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
