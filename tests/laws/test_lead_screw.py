"""The lead screw and its motor: a published example, closed forms, and the equations of motion they
must satisfy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsf_drake.laws import lead_screw as law

POUND_N, INCH_M = 4.4482216, 0.0254
LEAD, TANGENT, FRICTION = 2e-3, 2.0 / (7.0 * math.pi), 0.155
CREEP = 2e-4


def screw_torque(force, *, lead, tangent, friction, against):
    """Torque (N m) in the direction of motion that moves an axial load `force` >= 0 (N), which
    opposes it or not."""
    if against:
        return force * lead / (2.0 * math.pi) / law.driving_efficiency(tangent, friction)
    return -force * lead / (2.0 * math.pi) * law.returning_efficiency(tangent, friction)


def test_torque_and_efficiency_of_a_published_example():
    """Mott, Machine Elements in Mechanical Design, 4th ed., example 17-1: 1809 lb in to raise 12500
    lb.

    The book rounds: its own numbers, cosine 0.968 and tangent 0.0592, give 1814 in the equation it
    prints.
    """
    lead = 0.25 * INCH_M
    tangent, friction = law.thread(lead, 1.3429 * INCH_M, 0.15, math.radians(14.5))
    torque = screw_torque(
        12500.0 * POUND_N, lead=lead, tangent=tangent, friction=friction, against=True
    )
    assert torque / (POUND_N * INCH_M) == pytest.approx(1809.0, rel=4e-3)
    assert math.degrees(math.atan(tangent)) == pytest.approx(3.39, abs=5e-3)


def test_without_friction_the_torque_is_the_work_of_a_turn_over_two_pi_both_ways():
    up, down = (
        screw_torque(300.0, lead=LEAD, tangent=TANGENT, friction=0.0, against=way)
        for way in (True, False)
    )
    assert up == pytest.approx(300.0 * LEAD / (2 * math.pi), rel=1e-14)
    assert down == pytest.approx(-up, rel=1e-14)


def test_a_screw_that_locks_itself_is_less_than_half_efficient_and_must_be_driven_both_ways():
    rng = np.random.default_rng(1)
    for tangent, friction in rng.uniform(0.01, 0.6, (200, 2)):
        locks = tangent < friction
        assert locks == (law.returning_efficiency(tangent, friction) < 0.0)
        assert not locks or law.driving_efficiency(tangent, friction) < 0.5
    with pytest.raises(ValueError, match="no torque turns this screw"):
        law.driving_efficiency(2.0, 0.6)


def test_limited_voltage_is_that_of_the_speed_limit_without_load_or_the_supplys():
    motor = {"lead": LEAD, "gear_ratio": 3.0, "torque_constant": 7e-3}
    # rad/s at the limit: three turns of it make one of the screw
    rotor = 3.0 * 2.0 * math.pi / LEAD * 0.05
    assert law.limited_voltage(100.0, 0.05, **motor) == pytest.approx(7e-3 * rotor, rel=1e-12)
    assert law.limited_voltage(2.0, 0.05, **motor) == 2.0


def test_motion_satisfies_both_equations_and_friction_takes_energy():
    rng = np.random.default_rng(2)
    seen = set()
    for _ in range(400):
        drive, resistance = rng.normal(scale=40.0, size=2)
        velocity = rng.normal(scale=3 * CREEP)
        rotor, mass = rng.uniform(5.0, 20.0), rng.uniform(0.05, 1.0)
        sense = math.tanh(velocity / CREEP)
        a, nut, loss = law.carriage_motion(
            drive,
            resistance,
            sense,
            rotor_mass=rotor,
            carriage_mass=mass,
            tangent=TANGENT,
            friction=FRICTION,
        )
        assert mass * a == pytest.approx(nut - resistance, abs=1e-9)
        assert rotor * a == pytest.approx(drive - nut - loss, abs=1e-9)
        with_motion = nut * sense >= 0.0
        torque = screw_torque(
            abs(nut), lead=LEAD, tangent=TANGENT, friction=FRICTION, against=with_motion
        )
        ideal = abs(nut) * LEAD / (2 * math.pi)
        # thread loss at sense 1
        full = (torque - ideal if with_motion else torque + ideal) * 2 * math.pi / LEAD
        assert loss == pytest.approx(sense * full, abs=1e-9)
        assert loss * velocity >= 0.0
        seen.add((nut > 0, sense > 0))
    assert len(seen) == 4


def test_no_axial_load_accelerates_a_locked_screw_beyond_a_share_of_its_creep_speed():
    # where friction is all that the load gives
    sense = 1.0 / (1.0 - law.returning_efficiency(TANGENT, FRICTION))
    assert 0.0 < sense < 1.0
    body = {"rotor_mass": 12.0, "carriage_mass": 0.1, "tangent": TANGENT}
    for load in (1.0, 1e4, 1e6):
        at_bound = law.carriage_motion(0.0, -load, sense, **body, friction=FRICTION)
        assert at_bound.acceleration == pytest.approx(0.0, abs=1e-9 * load)
        assert (
            law.carriage_motion(0.0, -load, 1.0, **body, friction=0.5 * TANGENT).acceleration > 0.0
        )


def test_stops_push_inwards_only_and_begin_without_a_jump():
    stop = {"low": 0.066, "high": 0.151, "stiffness": 1e5, "dissipation": 10.0}
    assert law.stop_force(0.1, 0.3, **stop) == 0.0
    for beyond, outwards in ((0.152, 1.0), (0.065, -1.0)):
        assert law.stop_force(beyond, 0.0, **stop) == pytest.approx(-100.0 * outwards)
        assert law.stop_force(beyond, 0.05 * outwards, **stop) == pytest.approx(-150.0 * outwards)
        # leaving fast: it does not pull
        assert law.stop_force(beyond, -1.0 * outwards, **stop) == 0.0
    assert abs(law.stop_force(0.151 + 1e-12, 1.0, **stop)) < 1e-5
