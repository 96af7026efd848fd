"""The virtual prosthesis below a prescribed residual shank.

    p = Prosthesis(subject, 0.108)
    reaction = p.walk(time_s, R_WS, p_WS)

Frame S: origin at the knee, z up the shank, x forward, y left, as the model's shank. World W: x forward,
y left, z up, ground z = 0.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from virtual_laboratory.design import Design
from virtual_laboratory.device import Device, State, make_device, new_state
from virtual_laboratory.dynamics import chain
from virtual_laboratory.reaction import LOADED_ABOVE_N, Reaction
from virtual_laboratory.stepping import measure, place, run, step
from vsf_drake.parameters import SIDES, FootParameters, SocketParameters, Subject
from vsf_drake.plants.anthropometry import FootPlacement, scale_body

STEP_S = 5e-4
"""Largest step: half of it changes the 40 Hz force by less than 0.2 % of body weight."""
_SETTLING_STEPS, _SETTLING_STEP_S = 60, 0.02
"""A start is lowered in so many static steps and held for as many."""


class Prosthesis:
    """`subject`'s prosthesis with the fulcrum at `fulcrum_m` from A (m); symmetric, so `side` is only a name.

    Attributes:
        residual_length, pylon_length: m, knee to the end of the residual limb, and on to the foot's mount.
        sole_below_knee: m, knee to the lowest point of the unloaded sole with the shank upright.
        mass_kg: of everything below the residual limb.
        device: the compiled step's constants.
        state: the present state of `reset` and `step`.
        step_s: time between two calls of `step`.
        force, cop, free_moment, socket_load: after the last `step`, as in `Reaction`.
        unconverged: steps since `reset` that were not solved to tolerance.
    """

    def __init__(
        self, subject: Subject, fulcrum_m: float, side: str = "right", *, design: Design | None = None,
        step_s: float = STEP_S,
    ) -> None:
        if side not in SIDES:
            raise ValueError(f"side {side!r} is none of {SIDES}")
        foot = FootParameters()
        if not foot.fulcrum.rearmost_m <= fulcrum_m <= foot.fulcrum.foremost_m:
            raise ValueError(f"the fulcrum reaches {foot.fulcrum.rearmost_m} to {foot.fulcrum.foremost_m} m, "
                             f"not {fulcrum_m:g} m")
        body = scale_body(subject, foot, SocketParameters())
        if body.placement != FootPlacement():
            raise ValueError("the virtual foot sits in its standard place under the pylon; the subject's does not")
        self.side = side
        self.step_s = step_s
        self.residual_length, self.pylon_length = body.residual_length, body.pylon_length
        self.sole_below_knee = body.residual_length + body.pylon_length + foot.build_height_m
        self.device: Device = make_device(
            design or Design(), foot, fulcrum=fulcrum_m, residual_length=body.residual_length,
            pylon_length=body.pylon_length)
        self.mass_kg = float(np.sum(self.device.masses) + np.sum(self.device.node_masses))
        self.state: State = new_state(self.device)
        self.force, self.cop, self.socket_load = np.zeros(3), np.full(3, np.nan), np.zeros(6)
        self.free_moment = float("nan")
        self.unconverged = 0
        self._forces = np.zeros((len(self.device.bodies), 3))

    def walk(self, time_s: np.ndarray, R_WS: np.ndarray, p_WS: np.ndarray) -> Reaction:
        """Reaction at the instants `time_s` (n, evenly spaced) to the shank's poses R_WS (n, 3, 3), p_WS (n, 3).

        Between samples the shank follows a spline; the prosthesis starts settled, moving with the shank.
        """
        time = np.asarray(time_s, dtype=float)
        spacing = np.diff(time)
        if len(time) < 4 or not np.allclose(spacing, spacing[0], rtol=1e-3):
            raise ValueError("time_s must hold at least 4 evenly spaced instants")
        every = max(1, math.ceil(float(spacing[0]) / self.step_s - 1e-6))
        count = (len(time) - 1) * every
        fine = np.linspace(time[0], time[-1], count + 1)
        h = float(fine[1] - fine[0])
        turn, path = RotationSpline(time, Rotation.from_matrix(R_WS)), CubicSpline(time, p_WS)
        R, p = turn(fine).as_matrix(), path(fine)
        self.reset(R[0], p[0], velocity=path(fine[0], 1), angular_velocity=R[0] @ turn(fine[0], 1), step_s=h)
        measured, load = np.zeros((len(time), 8)), np.zeros((len(time), 6))
        measured[0], load[0] = self._last, self.socket_load
        unconverged = run(self.device, self.state, np.ascontiguousarray(R[1:]), np.ascontiguousarray(p[1:]), h, every,
                          measured[1:], load[1:])
        cop, free_moment = centre_of_pressure(measured[:, :3], measured[:, 3:6])
        return Reaction(
            time_s=time.copy(), force=measured[:, :3].copy(), cop=cop, free_moment=free_moment,
            slip_speed=measured[:, 7].copy(), socket_load=load, clearance=measured[:, 6].copy(),
            unconverged=int(unconverged))

    def reset(
        self, R_WS: np.ndarray, p_WS: np.ndarray, *, velocity: np.ndarray | None = None,
        angular_velocity: np.ndarray | None = None, step_s: float | None = None,
    ) -> None:
        """Lowers the prosthesis onto the ground with the shank turned like this, settles it, then lets it move along.

        Args:
            velocity, angular_velocity: (3,) in W of the knee and the shank, at rest where None.
        """
        device, state = self.device, new_state(self.device)
        R, p = np.array(R_WS, dtype=float), np.array(p_WS, dtype=float)
        state.R[:], state.p[:] = R, p - device.residual_length * R[:, 2]
        self._place(state)
        sunk = max(0.0, -float(np.min(state.cell_x[:, 2])))
        state.p[2] += sunk
        self._place(state)
        for i in range(1, 2 * _SETTLING_STEPS + 1):
            state.mass_v[:] = 0.0
            before, shear = state.cell_x.copy(), state.shear.copy()
            height = np.array([0.0, 0.0, sunk * max(0.0, 1.0 - i / _SETTLING_STEPS)])
            unsolved = step(device, state, R, p + height, _SETTLING_STEP_S, self._forces, self.socket_load)
        self.unconverged = int(unsolved)
        h = self.step_s if step_s is None else step_s
        self._last = np.zeros(8)
        measure(device, state, before, shear, self._forces, _SETTLING_STEP_S, self._last)
        v = np.zeros(3) if velocity is None else np.asarray(velocity, dtype=float)
        w = np.zeros(3) if angular_velocity is None else np.asarray(angular_velocity, dtype=float)
        state.mass_v[:] = v + np.cross(w, state.mass_x - p)
        state.increment[:] = 0.0
        state.increment[:3] = h * (state.R.T @ w)
        state.increment[3:6] = h * (state.R.T @ (v + np.cross(w, state.p - p)))
        self.state = state
        self._read(self._last)

    def bench(self) -> dict[str, float]:
        """Stiffness (N/mm) on the testing machine; see `virtual_laboratory.bench`."""
        from virtual_laboratory.bench import forefoot_stiffness, heel_stiffness  # noqa: PLC0415 (it tunes this class)

        return {"forefoot_n_per_mm": 1e-3 * forefoot_stiffness(self.device),
                "heel_n_per_mm": 1e-3 * heel_stiffness(self.device)}

    def _read(self, measured: np.ndarray) -> None:
        self.force = measured[:3].copy()
        cop, free_moment = centre_of_pressure(measured[None, :3], measured[None, 3:6])
        self.cop, self.free_moment = cop[0], float(free_moment[0])

    def _place(self, state: State) -> None:
        """Positions that follow from the pose of an undeformed prosthesis."""
        device = self.device
        hinges, angles = np.empty((len(device.lengths) + 1, 2)), np.empty(len(device.lengths))
        chain(device, state.q, hinges, angles)
        nodes = np.column_stack([hinges[1:, 0], np.full(len(angles), device.anchor[1]), hinges[1:, 1]])
        state.mass_x[:] = state.p + np.vstack([device.mass_points, nodes]) @ state.R.T
        place(device, state.R, state.p, hinges, angles, state.cell_x)


def centre_of_pressure(force: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of pressure (n, 3) on z = 0 and free moment (n,) from force and moment (n, 3) about W's origin.

    NaN where the vertical force is below 20 N.
    """
    loaded = force[:, 2] >= LOADED_ABOVE_N
    vertical = np.where(loaded, force[:, 2], np.nan)
    cop = np.column_stack([-moment[:, 1] / vertical, moment[:, 0] / vertical, np.where(loaded, 0.0, np.nan)])
    return cop, moment[:, 2] - (cop[:, 0] * force[:, 1] - cop[:, 1] * force[:, 0])
