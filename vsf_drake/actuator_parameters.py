"""The drive that moves the fulcrum's carriage: motor, gear, lead screw and rail.

Schema only, as in `parameters`, which re-exports it; sources are abbreviated as there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsf_drake.schema import quantity

_CHOICE = "choice, not measured"


@dataclass(frozen=True, kw_only=True)
class ActuatorParameters:
    """Motor, gear, lead screw and rail that move the fulcrum's carriage; its mass and travel are the fulcrum's.

    Glanzer 2018 moves the fulcrum in swing, through its whole range within three strides; its motor and screw were
    not available to us. All else is a choice, sized so that three times 0.3 s suffice, of swings of 0.4 s.
    """

    screw_lead_m: float = quantity(2e-3, unit="m", low=1e-5, high=0.1, source=f"{_CHOICE}: travel a turn")
    screw_mean_diameter_m: float = quantity(7e-3, unit="m", low=1e-4, high=0.1, source=f"{_CHOICE}: as of a Tr 8 x 2")
    thread_flank_angle_rad: float = quantity(
        math.radians(15.0), unit="rad", low=0.0, high=1.0, source=f"{_CHOICE}: half the angle of a trapezoidal thread")
    thread_friction: float = quantity(0.15, unit="1", low=0.0, high=1.0, source=f"{_CHOICE}: keeps the screw locked")
    screw_inertia_kg_m2: float = quantity(3e-7, unit="kg m^2", low=0.0, high=1e-2, source=f"{_CHOICE}: steel, 0.1 m")
    rail_friction: float = quantity(0.1, unit="1", low=0.0, high=2.0, source=f"{_CHOICE}: drag / support force")
    rail_drag_n: float = quantity(5.0, unit="N", low=0.0, high=1e3, source=f"{_CHOICE}: drag without load")
    gear_ratio: float = quantity(3.0, unit="1", low=0.01, high=1e4, source=f"{_CHOICE}: motor turns a screw turn")
    torque_constant_n_m_per_a: float = quantity(6e-3, unit="N m/A", low=1e-5, high=10.0, source=_CHOICE)
    winding_resistance_ohm: float = quantity(3.0, unit="ohm", low=1e-3, high=1e4, source=_CHOICE)
    rotor_inertia_kg_m2: float = quantity(1e-7, unit="kg m^2", low=0.0, high=1e-2, source=_CHOICE)
    motor_friction_n_m: float = quantity(4e-4, unit="N m", low=0.0, high=1.0, source=f"{_CHOICE}: brushes and gear")
    supply_voltage_v: float = quantity(7.4, unit="V", low=0.1, high=100.0, source=f"{_CHOICE}: two lithium cells")
    speed_limit_m_per_s: float = quantity(0.13, unit="m/s", low=1e-4, high=10.0, source=f"{_CHOICE}: driver's limit")
    servo_band_m: float = quantity(
        2e-3, unit="m", low=1e-6, high=0.1, source=f"{_CHOICE}: error from which on the voltage is close to full")
    tolerance_m: float = quantity(1e-4, unit="m", low=0.0, high=0.01, source=f"{_CHOICE}: error without voltage")
    creep_speed_m_per_s: float = quantity(
        2e-4, unit="m/s", low=1e-6, high=0.1, source=f"{_CHOICE}: regularises friction, 76 % of which acts there")
    stop_stiffness_n_per_m: float = quantity(1e5, unit="N/m", low=1e2, high=1e9, source=f"{_CHOICE}: ends of travel")
    stop_dissipation_s_per_m: float = quantity(10.0, unit="s/m", low=0.0, high=1e3, source=f"{_CHOICE}: of the stops")
