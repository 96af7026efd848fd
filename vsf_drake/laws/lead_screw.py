"""A lead screw turned by a geared direct-current motor: efficiencies, self-locking, acceleration.

Screw (Mott, Machine Elements in Mechanical Design, 4th ed., eqs. 17-7, 17-10 and 17-11, divided by
the cosine of the flank angle; friction of a collar is left out). The thread of lead p and mean
diameter d_m climbs at the lead angle lambda, tan(lambda) = p / (pi d_m). With u = mu / cos(flank
angle), what friction is on an inclined flank, the torque that moves an axial load F is

    against the load     T = F d_m/2 · (tan(lambda) + u) / (1 - u tan(lambda)),
    with the load        T = F d_m/2 · (u - tan(lambda)) / (1 + u tan(lambda)),     needed when u >
                                                                                    tan(lambda):

then the screw locks itself, and no load, however large, turns it. Without friction T = F p / (2
pi).

Motor (a text-book line): current i = (V - k ω) / R, torque k i - friction; the winding's inductance
is left out, some tenths of a millisecond against the milliseconds in which the carriage gets under
way.

Friction opposes motion by the factor tanh(v / creep speed) instead of sign(v): what a locked screw
holds, it holds by creeping. SI units throughout; x along the keel to the toe, forces on the
carriage along +x.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsf_drake.laws._elementwise import Values


def thread(
    lead: Values, mean_diameter: Values, friction: Values, flank_angle: Values
) -> tuple[Values, Values]:
    """tan(lambda) = lead / (pi · mean diameter), and u = friction / cos(flank angle), of a flank
    inclined by the angle (rad). For tan(lambda) < u no axial load can turn the screw."""
    return lead / (math.pi * mean_diameter), friction / np.cos(flank_angle)


def driving_efficiency(tangent: Values, friction: Values) -> Values:
    """Work on the load / work of the torque while the screw moves against the load, 1 without
    friction; ValueError for u tan(lambda) >= 1."""
    if not friction * tangent < 1.0:
        raise ValueError(
            f"friction {friction} times the tangent {tangent} of the lead angle is 1 or more: "
            "no torque turns this screw; take a smaller lead or less friction"
        )
    return tangent * (1.0 - friction * tangent) / (tangent + friction)


def returning_efficiency(tangent: Values, friction: Values) -> Values:
    """Work that the load gives to the shaft / work of the load, while the load drives; negative if
    it cannot."""
    return (tangent - friction) / (tangent * (1.0 + friction * tangent))


def servo_voltage(error: Values, *, limit: Values, band: Values, tolerance: Values) -> Values:
    """Voltage limit · tanh(e / band), e the error (m) beyond the tolerance, zero within it."""
    beyond = (
        error - tolerance
        if error > tolerance
        else error + tolerance
        if error < -tolerance
        else 0.0 * error
    )
    return limit * np.tanh(beyond / band)


def limited_voltage(
    supply: Values,
    speed_limit: Values,
    *,
    lead: Values,
    gear_ratio: Values,
    torque_constant: Values,
) -> Values:
    """The supply's voltage, or that whose motor without any load moves the carriage at
    `speed_limit` (m/s), if less."""
    limit = torque_constant * gear_ratio * speed_limit * (2.0 * math.pi) / lead
    return limit if limit < supply else supply


def stop_force(
    position: Values,
    velocity: Values,
    *,
    low: Values,
    high: Values,
    stiffness: Values,
    dissipation: Values,
) -> Values:
    """Force (N) of the stops at the ends of travel, stiffness · depth · (1 + dissipation · rate of
    the depth), pushing only (Hunt & Crossley 1975, exponent 1)."""
    if position < low:
        depth = low - position
        rate = -velocity
        sign = 1.0
    elif position > high:
        depth = position - high
        rate = velocity
        sign = -1.0
    else:
        return 0.0 * position
    factor = 1.0 + dissipation * rate
    return sign * stiffness * depth * factor if factor > 0.0 else 0.0 * position


class CarriageMotion(NamedTuple):
    """What `carriage_motion` finds."""

    acceleration: Values  # of the carriage (m/s²)
    nut_force: Values  # of the screw on the carriage (N)
    thread_loss: Values  # force lost in the thread (N), in the direction of motion


def carriage_motion(
    drive: Values,
    resistance: Values,
    sense: Values,
    *,
    rotor_mass: Values,
    carriage_mass: Values,
    tangent: Values,
    friction: Values,
) -> CarriageMotion:
    """The screw's and the carriage's equations of motion,

        rotor_mass · a = drive - F - D(F),     carriage_mass · a = F - resistance,

    with F the nut's force on the carriage and D = sense · |F| · (1 / driving efficiency - 1) where
    F acts in the direction of motion, sense · |F| · (1 - returning efficiency) where it acts
    against it. Derived from the torques above; each branch is linear in a, and the one that holds
    follows from the sign of F.

    Args:
        drive: the motor's torque as a force at the carriage, torque · gear ratio · 2 pi / lead (N).
        resistance: all else that holds the carriage back: rail friction, stops, axial load (N,
            along -x).
        sense: direction of motion, tanh(speed / creep speed).
        rotor_mass: inertia of rotor and screw as a mass at the carriage (kg).
        carriage_mass: kg, > 0.
    """
    # the sign of F, from the equations without D
    forward = drive * carriage_mass + rotor_mass * resistance >= 0.0
    along = 1.0 / driving_efficiency(tangent, friction) - 1.0
    against = 1.0 - returning_efficiency(tangent, friction)
    factor = along if (sense >= 0.0) == bool(forward) else against
    transmitted = 1.0 + sense * factor if forward else 1.0 - sense * factor
    acceleration = (drive - resistance * transmitted) / (rotor_mass + carriage_mass * transmitted)
    nut_force = carriage_mass * acceleration + resistance
    return CarriageMotion(acceleration, nut_force, nut_force * (transmitted - 1.0))
