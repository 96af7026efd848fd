"""The virtual prosthesis below a prescribed residual shank.

    p = prosthesis_of(subject, 0.108)
    reaction = p.walk(time_s, R_WS, p_WS)

Frame S: origin at the knee, z up the shank, x forward, y left, as the model's shank. World W: x
forward, y left, z up, ground z = 0.
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
from virtual_laboratory.stepping import measure, moving, place, run, step
from vsf_drake.model.parameters import FootParameters, SocketParameters, Subject
from vsf_drake.plants.anthropometry import FootPlacement, scale_body

STEP_S = 5e-4
"""Largest step: half of it changes the 40 Hz force by 0.1 to 0.2 % of body weight."""
_SETTLING_STEPS, _SETTLING_STEP_S = 60, 0.02
"""A start is lowered in so many static steps and held for as many."""


class Prosthesis:
    """A right leg's prosthesis of `design`, with the fulcrum at `fulcrum_m` from A (m), None where
    it has none.

    Attributes:
        residual_length: m, knee to the end of the residual limb.
        sole_below_knee: m, knee to the plane of the unloaded sole down the shank's axis.
        mass_kg: of everything below the residual limb.
        device: the compiled step's constants.
        state: the present state.
        step_s: largest time step of `walk`.
        force, cop, free_moment, socket_load: after `reset`, as in `Reaction`.
        unconverged: 1 where the last step of `reset` was not solved to tolerance.
    """

    def __init__(
        self,
        design: Design,
        *,
        fulcrum_m: float | None,
        residual_length: float,
        pylon_length: float,
        placement: FootPlacement | None = None,
        step_s: float = STEP_S,
    ) -> None:
        self.step_s = step_s
        self.residual_length = residual_length
        below = (placement or FootPlacement()).sole_below(design.frame.build_height_m)
        self.sole_below_knee = residual_length + pylon_length + below
        self.device: Device = make_device(
            design,
            fulcrum=fulcrum_m,
            residual_length=residual_length,
            pylon_length=pylon_length,
            placement=placement,
        )
        self.mass_kg = float(np.sum(self.device.masses) + np.sum(self.device.node_masses))
        self.state: State = new_state(self.device)
        self.force, self.cop, self.socket_load = np.zeros(3), np.full(3, np.nan), np.zeros(6)
        self.free_moment = float("nan")
        self.unconverged = 0
        self._forces = np.zeros((len(self.device.bodies), 3))

    def walk(self, time_s: np.ndarray, R_WS: np.ndarray, p_WS: np.ndarray) -> Reaction:
        """Reaction at the instants `time_s` (n, evenly spaced) to the shank's poses R_WS (n, 3, 3),
        p_WS (n, 3).

        Between samples the shank follows a spline; the prosthesis starts settled, moving with the
        shank.
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
        self.reset(
            R[0],
            p[0],
            velocity=path(fine[0], 1),
            angular_velocity=R[0] @ turn(fine[0], 1),
            step_s=h,
        )
        measured, load, momentum = (
            np.zeros((len(time), 8)),
            np.zeros((len(time), 6)),
            np.zeros((len(time), 9)),
        )
        measured[0], load[0] = self._last, self.socket_load
        moving(self.device, self.state, momentum[0])
        unconverged = run(
            self.device,
            self.state,
            np.ascontiguousarray(R[1:]),
            np.ascontiguousarray(p[1:]),
            h,
            every,
            measured[1:],
            load[1:],
            momentum[1:],
        )
        cop, free_moment = centre_of_pressure(measured[:, :3], measured[:, 3:6])
        return Reaction(
            time_s=time.copy(),
            force=measured[:, :3].copy(),
            cop=cop,
            free_moment=free_moment,
            moment=measured[:, 3:6].copy(),
            slip_speed=measured[:, 7].copy(),
            socket_load=load,
            clearance=measured[:, 6].copy(),
            mass_kg=self.mass_kg,
            com=momentum[:, 6:].copy(),
            linear_momentum=momentum[:, :3].copy(),
            angular_momentum=momentum[:, 3:6].copy(),
            unconverged=int(unconverged),
        )

    def reset(
        self,
        R_WS: np.ndarray,
        p_WS: np.ndarray,
        *,
        velocity: np.ndarray | None = None,
        angular_velocity: np.ndarray | None = None,
        step_s: float | None = None,
    ) -> None:
        """Lowers the prosthesis onto the ground with the shank turned like this, settles it, then
        lets it move along.

        Args:
            velocity, angular_velocity: (3,) in W of the knee and the shank, at rest where None.
        """
        device, state = self.device, new_state(self.device)
        R, p = np.array(R_WS, dtype=float), np.array(p_WS, dtype=float)
        state.R[:], state.p[:] = R @ device.R_EP, p - device.residual_length * R[:, 2]
        self._place(state)
        sunk = max(0.0, -float(np.min(state.cell_x[:, 2])))
        state.p[2] += sunk
        self._place(state)
        for i in range(1, 2 * _SETTLING_STEPS + 1):
            state.mass_v[:] = 0.0
            before, shear = state.cell_x.copy(), state.shear.copy()
            height = np.array([0.0, 0.0, sunk * max(0.0, 1.0 - i / _SETTLING_STEPS)])
            unsolved = step(
                device, state, R, p + height, _SETTLING_STEP_S, self._forces, self.socket_load
            )
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
        state.before[:] = state.increment
        self.state = state
        self._read(self._last)

    def _read(self, measured: np.ndarray) -> None:
        self.force = measured[:3].copy()
        cop, free_moment = centre_of_pressure(measured[None, :3], measured[None, 3:6])
        self.cop, self.free_moment = cop[0], float(free_moment[0])

    def _place(self, state: State) -> None:
        """Positions that follow from the pose of an undeformed prosthesis."""
        device = self.device
        count = len(device.lengths)
        hinges, bars, axes = (
            np.empty((count + 1, 3)),
            np.empty((count, 3, 3)),
            np.empty((len(state.q), 3)),
        )
        chain(device, state.q, hinges, bars, axes)
        state.mass_x[:] = state.p + np.vstack([device.mass_points, hinges[1:]]) @ state.R.T
        place(device, state.R, state.p, hinges, bars, state.cell_x)


def prosthesis_of(
    subject: Subject,
    fulcrum_m: float | None,
    *,
    design: Design | None = None,
    residual_length: float | None = None,
    step_s: float = STEP_S,
) -> Prosthesis:
    """The prosthesis of `subject`, right-sided, as long and with the foot placed as the subject
    says.

    Args:
        design: the reference subject's where None.
        residual_length: m, knee to the end of the residual limb; as the model under test has it
            where None.
    """
    design = design or Design()
    body = scale_body(subject, FootParameters(), SocketParameters())
    residual = body.residual_length if residual_length is None else residual_length
    pylon = (
        body.prosthesis_length - residual - body.placement.sole_below(design.frame.build_height_m)
    )
    return Prosthesis(
        design,
        fulcrum_m=fulcrum_m,
        residual_length=residual,
        pylon_length=pylon,
        placement=body.placement,
        step_s=step_s,
    )


def centre_of_pressure(force: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of pressure (n, 3) on z = 0 and free moment (n,) from force and moment (n, 3) about
    W's origin.

    NaN where the vertical force is below 20 N.
    """
    loaded = force[:, 2] >= LOADED_ABOVE_N
    vertical = np.where(loaded, force[:, 2], np.nan)
    cop = np.column_stack(
        [-moment[:, 1] / vertical, moment[:, 0] / vertical, np.where(loaded, 0.0, np.nan)]
    )
    return cop, moment[:, 2] - (cop[:, 0] * force[:, 1] - cop[:, 1] * force[:, 0])
