"""What Drake answers of the foot's .sdf files, read by its own parser: Drake's multibody dynamics,
springs and integrator, and none of this package's forces.

python -m vsf_drake.engines.certificate.in_drake FOLDER
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, MultibodyForces, PlanarJoint
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, ContinuousState, LeafSystem
from scipy.interpolate import CubicSpline

from vsf_drake.engines.certificate.asked import CONTINUOUS, NOMINAL, Asked, foot_file

FILE = "drake.npz"
FRAME = "vsf_frame"
MOUNT = "vsf_mount"
STEP_S = 1e-3
"""Of the plants of the static rows, which take no step."""
FLAT = RotationMatrix(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
"""Turns a planar joint into the vertical plane: x forward, y up, and theta lifts the toe."""
AT_REST_RAD = 1e-11
"""A few times what rounding of the support's long spring, 1e-13 m, turns the rear piece by."""
ITERATIONS = 30
NUDGE_RAD = 1e-6
LONGEST_STEP_RAD = 0.1
ACCURACY = 1e-3
"""Relative, of the integrator (Radau, order 3); ten times less changes the force by 4e-6 of its
peak."""


class Foot:
    """A file in a plant without weight, the frame held or on a planar joint at the mount."""

    def __init__(self, file: Path, asked: Asked, *, held: bool, gravity: float = 0.0) -> None:
        self.plant = MultibodyPlant(STEP_S if held else 0.0)
        Parser(self.plant).AddModels(file)
        self.plant.mutable_gravity_field().set_gravity_vector(np.array([0.0, 0.0, -gravity]))
        if held:
            self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName(FRAME))
        else:
            turned = RigidTransform(FLAT, np.zeros(3))
            ground = FixedOffsetFrame("flat", self.plant.world_frame(), turned)
            mount = FixedOffsetFrame("turned", self.plant.GetFrameByName(MOUNT), turned)
            self.plant.AddJoint(
                PlanarJoint("path", self.plant.AddFrame(ground), self.plant.AddFrame(mount))
            )
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.forces = MultibodyForces(self.plant)
        self.rows = np.array(
            [self.plant.GetJointByName(str(name)).velocity_start() for name in asked.hinges]
        )

    def place(self, q: np.ndarray) -> None:
        """Puts the hinges at `q` (B,) rad."""
        positions = self.plant.GetPositions(self.context)
        positions[self.rows] = q
        self.plant.SetPositions(self.context, positions)


class Pressed(Foot):
    """A foot that is held, with a vertical load on C."""

    def __init__(self, file: Path, asked: Asked) -> None:
        super().__init__(file, asked, held=True)
        bodies = [self.plant.GetBodyByName(str(name)) for name in asked.bodies]
        self.pressed = bodies[: asked.carrier + 1]
        self.loaded = bodies[asked.carrier]
        self.p_BC = asked.p_BC

    def moments(self, q: np.ndarray, load_n: float) -> np.ndarray:
        """(B,) N m in the hinges that would keep them at rest at `q`, where it leaves them."""
        self.place(q)
        self.plant.CalcForceElementsContribution(self.context, self.forces)
        self.loaded.AddInForce(
            self.context,
            self.loaded.EvalPoseInWorld(self.context).rotation() @ self.p_BC,
            SpatialForce(np.zeros(3), np.array([0.0, 0.0, load_n])),
            self.plant.world_frame(),
            self.forces,
        )
        still = np.zeros(self.plant.num_velocities())
        needed = self.plant.CalcInverseDynamics(self.context, still, self.forces)
        return np.asarray(needed[self.rows])

    def rest(self, q: np.ndarray, load_n: float) -> np.ndarray:
        """(B,) rad where no moment is needed, by Newton's method from `q`; RuntimeError where that
        ends nowhere."""
        for _ in range(ITERATIONS):
            slopes = [
                (self.moments(q + nudge, load_n) - self.moments(q - nudge, load_n))
                / (2.0 * NUDGE_RAD)
                for nudge in NUDGE_RAD * np.eye(len(q))
            ]
            step = -np.linalg.solve(np.array(slopes).T, self.moments(q, load_n))
            longest = np.abs(step).max()
            q = q + step * min(1.0, LONGEST_STEP_RAD / longest)
            if longest <= AT_REST_RAD:
                return q
        raise RuntimeError(
            f"the keel finds no rest under {load_n:g} N: {longest:g} rad are missing"
        )


def shapes(asked: Asked, folder: Path, fulcrum_mm: float) -> np.ndarray:
    """(L, P, 2) m, x and z in K of the keel's hinges before the load point C, and of C, under each
    load, without weight and ground."""
    foot = Pressed(foot_file(folder, NOMINAL, fulcrum_mm, "sdf"), asked)
    q = np.zeros(len(asked.hinges))
    found = []
    for load_n in asked.load_n:
        q = foot.rest(q, float(load_n))
        foot.place(q)
        hinges = [body.EvalPoseInWorld(foot.context).translation() for body in foot.pressed]
        found.append([*hinges, foot.loaded.EvalPoseInWorld(foot.context) @ foot.p_BC])
    return np.array(found)[:, :, [0, 2]]


def mass_and_gravity(asked: Asked, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, B, B) kg m^2 mass matrices of the hinges and (P, B) N m that gravity exerts on them, the
    frame held."""
    file = foot_file(folder, NOMINAL, asked.roll_fulcrum_mm, "sdf")
    foot = Foot(file, asked, held=True, gravity=asked.gravity)
    square = np.ix_(foot.rows, foot.rows)
    masses = []
    torques = []
    for pose in asked.poses_rad:
        foot.place(pose)
        masses.append(foot.plant.CalcMassMatrix(foot.context)[square])
        torques.append(foot.plant.CalcGravityGeneralizedForces(foot.context)[foot.rows])
    return np.array(masses), np.array(torques)


class Keel(LeafSystem):
    """The keel's angles and their rates, while the mount is moved along the path: Drake's mass
    matrix and inverse dynamics at given accelerations of the mount, without friction."""

    def __init__(self, asked: Asked, folder: Path) -> None:
        super().__init__()
        file = foot_file(folder, CONTINUOUS, asked.roll_fulcrum_mm, "sdf")
        self.foot = Foot(file, asked, held=False)
        path = CubicSpline(asked.time_s, asked.mount, bc_type="natural")
        self.path = [path, path.derivative(), path.derivative(2)]
        joint = self.foot.plant.GetJointByName("path")
        self.driven = slice(joint.velocity_start(), joint.velocity_start() + 3)
        self.asked = asked
        names, self.carriers = np.unique(asked.sphere_bodies, return_inverse=True)
        self.bodies = [self.foot.plant.GetBodyByName(str(name)) for name in names]
        self.world = self.foot.plant.world_frame()
        hinges = len(asked.hinges)
        self.DeclareContinuousState(hinges, hinges, 0)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """The hinges' rates, and what their equations of motion leave for their accelerations."""
        foot = self.foot
        state = context.get_continuous_state_vector().CopyToVector()
        self.place(context.get_time(), state)
        foot.plant.CalcForceElementsContribution(foot.context, foot.forces)
        self.press(foot.forces)
        moved = np.zeros(foot.plant.num_velocities())
        moved[self.driven] = self.path[2](context.get_time())
        left = foot.plant.CalcInverseDynamics(foot.context, moved, foot.forces)[foot.rows]
        mass = foot.plant.CalcMassMatrix(foot.context)[np.ix_(foot.rows, foot.rows)]
        derivatives.get_mutable_vector().SetFromVector(
            np.concatenate([state[len(left) :], -np.linalg.solve(mass, left)])
        )

    def place(self, time_s: float, state: np.ndarray) -> None:
        """Puts mount and hinges where they are at that time, with their rates."""
        foot = self.foot
        positions = foot.plant.GetPositions(foot.context)
        velocities = foot.plant.GetVelocities(foot.context)
        positions[self.driven] = self.path[0](time_s)
        velocities[self.driven] = self.path[1](time_s)
        positions[foot.rows], velocities[foot.rows] = np.split(state, 2)
        foot.plant.SetPositions(foot.context, positions)
        foot.plant.SetVelocities(foot.context, velocities)

    def press(self, forces: MultibodyForces) -> float:
        """Adds what level ground at z = 0 exerts on the spheres; returns N, all of it."""
        asked = self.asked
        context = self.foot.context
        X_WB = np.array([body.EvalPoseInWorld(context).GetAsMatrix34() for body in self.bodies])
        V_WB = np.array(
            [body.EvalSpatialVelocityInWorld(context).get_coeffs() for body in self.bodies]
        )
        X_WS = X_WB[self.carriers]
        p_BoS_W = np.einsum("nij,nj->ni", X_WS[:, :, :3], asked.sphere_p_BS)
        w_x, w_y, _, _, _, rising = V_WB[self.carriers].T
        depth = np.maximum(asked.sphere_radius - X_WS[:, 2, 3] - p_BoS_W[:, 2], 0.0)
        sinking = np.maximum(w_y * p_BoS_W[:, 0] - w_x * p_BoS_W[:, 1] - rising, 0.0)
        u = np.minimum(depth / asked.sphere_full_damping_depth, 1.0)
        force = asked.sphere_stiffness * depth**asked.sphere_exponent
        force += asked.sphere_damping * sinking * u * u * (3.0 - 2.0 * u)
        for b in np.unique(self.carriers[force > 0.0]):
            own = self.carriers == b
            moment = np.array([p_BoS_W[own, 1] @ force[own], -p_BoS_W[own, 0] @ force[own], 0.0])
            F_Bo_W = SpatialForce(moment, np.array([0.0, 0.0, force[own].sum()]))
            self.bodies[b].AddInForce(context, np.zeros(3), F_Bo_W, self.world, forces)
        return float(force.sum())


def roll_over(asked: Asked, folder: Path) -> np.ndarray:
    """(T,) N that the ground exerts upwards on all spheres along the path of the mount, without
    weight."""
    keel = Keel(asked, folder)
    simulator = Simulator(keel)
    ResetIntegratorFromFlags(simulator, "radau3", float(asked.time_s[1] - asked.time_s[0]))
    simulator.get_mutable_integrator().set_target_accuracy(ACCURACY)
    simulator.Initialize()
    forces = []
    for time_s in asked.time_s:
        simulator.AdvanceTo(float(time_s))
        state: Any = simulator.get_context().get_continuous_state_vector()
        keel.place(float(time_s), state.CopyToVector())
        forces.append(keel.press(keel.foot.forces))
    return np.array(forces)


def answer(folder: Path) -> None:
    """Reads what is asked in `folder` and writes `FILE` there."""
    asked = Asked.read(folder)
    masses, torques = mass_and_gravity(asked, folder)
    np.savez(
        folder / FILE,
        rise_m=[shapes(asked, folder, mm)[:, -1, 1] for mm in asked.fulcrum_mm],
        mass_matrix_kg_m2=masses,
        gravity_torque_nm=torques,
        roll_nominal_n=roll_over(asked, folder),
        version=version("drake"),
    )


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
