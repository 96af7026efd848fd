"""Lets the fulcrum move in swing only, told by the shank's angle, and records every adjustment."""

from __future__ import annotations

import math
from typing import Any, SupportsInt

import numpy as np
from pydrake.math import arctan2
from pydrake.systems.framework import BasicVector_, Context, DiscreteValues

from vsf_drake.base.errors import require
from vsf_drake.systems._system import FARTHEST_M, System, cross, system_template

SIGNALS = ("contact", "shank", "both")
"""What tells the controller of swing: the ground's force, the shank's angle and rate, or both at
once."""
STANCE, UNCONFIRMED, SWING = 0.0, 1.0, 2.0
"""Values of the output `phase`."""


@system_template()
class SwingController(System):
    """Enables the fulcrum's motor in swing and holds, from the onset of each swing, the position to
    go to.

    Sampled at a fixed period, as a microcontroller. What says that the foot is in the air:

    - contact: the vertical force on the foot falls below unload_force; stance again above
      load_force.
    - shank: its angle falls faster than swing_rate from a lean of at least least_lean, which keeps
      a person who rocks back from the motor; stance again once it falls slower than stop_rate. In
      walking the shank's rate changes sign after toe-off and again at or just before initial
      contact (PMC6545278, Figure 3; Catalfamo 2010, doi 10.3390/s100605683). The first sixth or so
      of swing, in which the shank still leans further, is not used.
    - both: swing needs both; either ends it.

    The sign must last for the debounce time before the phase is swing; stance follows at the next
    sample and lasts for least_stance, for a heel may bounce. A signal that is not a number counts
    as stance. All thresholds are choices.

    Inputs: desired_position (1,) m from A, read at the onset of swing; grf (3,) N on the foot, z_W
    up; shank_angle (2,) rad and rad/s, leaning forward positive, of `ShankAngle`. Of grf and
    shank_angle only those that the signal needs are read. Outputs: enabled (1,), 1 in swing, else
    0; phase (1,), 0 stance, 1 unloaded but not confirmed, 2 swing; commanded_position (1,) m from
    A. They are discrete states, without feedthrough: phase; time (s) for which stance or the sign
    of swing has lasted; commanded position. Derivatives by the thresholds are zero, as the phase
    is.

    Args:
        signal: one of SIGNALS.
        initial_position: commanded until the first swing (m from A).
        period: s.

    Parameters in the Context: unload_force, load_force (N); swing_rate, stop_rate (rad/s, of the
    angle's fall); least_lean (rad); debounce, least_stance (s).

    Raises:
        InputError: the signal is unknown, or the thresholds leave no hysteresis; while it runs, the
            desired position is not a number at the onset of a swing, or in mm.
    """

    def __init__(
        self,
        *,
        signal: str = "contact",
        initial_position: float = 0.108,
        period: float = 5e-3,
        unload_force: float = 20.0,
        load_force: float = 30.0,
        swing_rate: float = 1.0,
        stop_rate: float = 0.3,
        least_lean: float = math.radians(20.0),
        debounce: float = 0.02,
        least_stance: float = 0.2,
    ) -> None:
        constants = {
            "unload_force": unload_force,
            "load_force": load_force,
            "swing_rate": swing_rate,
            "stop_rate": stop_rate,
            "least_lean": least_lean,
            "debounce": debounce,
            "least_stance": least_stance,
        }
        require(
            signal in SIGNALS,
            f"{signal!r} is not known",
            "signal",
            f"Known are: {', '.join(SIGNALS)}",
        )
        require(period > 0.0, f"{period} s is no sampling period", "period", "It must be above 0 s")
        for low, high in (("unload_force", "load_force"), ("stop_rate", "swing_rate")):
            require(
                constants[low] < constants[high],
                f"{constants[high]:g} leaves no hysteresis above the {constants[low]:g} of {low}",
                high,
                f"It must be above {low}",
            )
        self._signal = signal
        self._period = float(period)
        self._declare_inputs(desired_position=1, grf=3, shank_angle=2)
        self._declare_parameters(**{name: (value, ()) for name, value in constants.items()})
        self.DeclareDiscreteState(
            BasicVector_[self._T](np.array([STANCE, least_stance, initial_position]))
        )
        self._declare_periodic(self._period, self._update)
        state = self.xd_ticket()
        scalar = self._T
        self._declare_output(
            "enabled", 1, lambda context: [scalar(_state(context)[0] == SWING)], state
        )
        self._declare_part("phase", 1, _state, slice(1), state)
        self._declare_part("commanded_position", 1, _state, slice(2, None), state)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        phase, held, commanded = _state(context)
        begins, ends = self._sign(context)
        c = self._constants(context)
        held = held + self._period
        if phase == SWING and ends:
            phase = self._T(STANCE)
            held = self._T(0.0)
        elif phase == STANCE and begins and held > c["least_stance"] - 1e-9:
            phase = self._T(UNCONFIRMED)
            held = self._T(0.0)
        elif phase == UNCONFIRMED and not begins:
            phase = self._T(STANCE)
            held = self._T(c["least_stance"])
        if phase == UNCONFIRMED and held > c["debounce"] - 1e-9:
            phase = self._T(SWING)
            held = self._T(0.0)
            commanded = self._value(context, "desired_position")[0]
            require(
                abs(commanded) <= FARTHEST_M,
                f"is {commanded} at {context.get_time()} s",
                "desired_position",
                "It must be a position in m from A",
            )
        discrete.set_value(np.array([phase, held, commanded]))

    def _sign(self, context: Context) -> tuple[bool, bool]:
        """Whether a swing would begin, and whether one would end, at what the inputs are now."""
        c = self._constants(context)
        begins = []
        ends = []
        if self._signal != "shank":
            load = self._value(context, "grf")[2]
            begins.append(bool(load < c["unload_force"]))
            ends.append(not bool(load <= c["load_force"]))
        if self._signal != "contact":
            angle, rate = self._value(context, "shank_angle")
            begins.append(bool(-rate > c["swing_rate"]) and bool(angle > c["least_lean"]))
            ends.append(not bool(-rate >= c["stop_rate"]))
        return all(begins), any(ends)


def _state(context: Context) -> Any:
    return context.get_discrete_state_vector().CopyToVector()


@system_template()
class ShankAngle(System):
    """An inertial sensor: sagittal inclination of a body B against the vertical, and its rate,
    without noise.

    With the vertical z_W in B, g = R_WB^T z_W, the angle is atan2(-g_x, g_z): zero with the shank
    upright, positive with its top ahead of its bottom (+y, to the left, is the axis), whatever the
    heading; in level walking straight ahead its rate is the gyroscope's signal about y_B. B has x
    forward, y left and z up along the shank. Not defined with B's x-z plane level (a shank lying on
    its side).

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant. Outputs: shank_angle
    (2,), angle in rad within (-pi, pi] and rate in rad/s, for `SwingController`.

    Args:
        body_index: the body B that bears the sensor.
    """

    def __init__(self, *, body_index: SupportsInt) -> None:
        self._body = int(body_index)
        self._declare_kinematics()
        self._declare_output("shank_angle", 2, self._angle)

    def _angle(self, context: Context) -> np.ndarray:
        R_WB = self._value(context, "body_poses")[self._body].GetAsMatrix34()[:, :3]
        w_WB_W = self._value(context, "body_spatial_velocities")[self._body].get_coeffs()[:3]
        g_B = R_WB[2]
        rate_B = -cross(R_WB.T @ w_WB_W, g_B)
        x = g_B[0]
        z = g_B[2]
        rate = (x * rate_B[2] - z * rate_B[0]) / (x * x + z * z)
        return np.array([arctan2(-x, z), rate])


@system_template()
class AdjustmentRecorder(System):
    """Counts the adjustments of the fulcrum, and the swings and the energy that each of them took.

    An adjustment begins when the motor is enabled with an error above `reached` and ends when it is
    off again with an error within: it may take several swings, and a new desired position in
    between prolongs it. Its energy is what the supply gave, from the sample before the one that
    first sees the motor enabled: the inrush is in it.

    Inputs: enabled (1,) 0 or 1, of `SwingController`; energy (1,) J, of `FulcrumActuator`;
    position_error (1,) m, of the same. Outputs: adjustments (1,), how many have ended;
    adjustment_energy (1,) J, of the last that ended; adjustment_swings (1,), of the same, zero
    before the first. Sampled at a fixed period, without feedthrough.

    Args:
        period: s; at most that of the controller, above 0.

    Parameters in the Context: reached (m), above 0, the error within which the fulcrum is where it
    should be.
    """

    def __init__(self, *, period: float = 5e-3, reached: float = 1e-3) -> None:
        for name, value in (("period", period), ("reached", reached)):
            require(value > 0.0, f"is {value}", name, "It must be above 0")
        self._declare_inputs(enabled=1, energy=1, position_error=1)
        self._declare_parameters(reached=(reached, ()))
        # ended, energy and swings of the last; energy at the start and swings of the present (0:
        # none); enabled and energy at the sample before
        self.DeclareDiscreteState(BasicVector_[self._T](np.zeros(7)))
        self._declare_periodic(period, self._update)
        for i, name in enumerate(("adjustments", "adjustment_energy", "adjustment_swings")):
            self._declare_part(name, 1, _state, slice(i, i + 1), self.xd_ticket())

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        ended, last_energy, last_swings, start, swings, before, energy_before = _state(context)
        enabled, energy, error = (
            self._value(context, name)[0] for name in ("enabled", "energy", "position_error")
        )
        reached = abs(error) <= self._constants(context)["reached"]
        if enabled > 0.5 and swings == 0.0 and not reached:
            start = energy_before
            swings = self._T(1.0)
        elif enabled > 0.5 and swings > 0.0 and before < 0.5:
            swings = swings + 1.0
        elif enabled < 0.5 and swings > 0.0 and reached:
            ended = ended + 1.0
            last_energy = energy - start
            last_swings = swings
            swings = self._T(0.0)
        discrete.set_value(
            np.array([ended, last_energy, last_swings, start, swings, enabled, energy])
        )


SwingController_ = SwingController.template
ShankAngle_ = ShankAngle.template
AdjustmentRecorder_ = AdjustmentRecorder.template
