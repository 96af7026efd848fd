"""The virtual laboratory's walking person obeys Newton and Euler: closed forms, and a walk made
coarsely."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from make_reference_subject import SEED, STEPS, walk_trial
from scipy.spatial.transform import Rotation
from virtual_laboratory.balance import Wrench, triangle_mean
from virtual_laboratory.body import HAT, PELVIS, SEGMENTS, MassPoints, body_points
from virtual_laboratory.closing import Trunk, close, missing
from virtual_laboratory.figures import against_bands, trial_figures
from virtual_laboratory.motion import Person
from virtual_laboratory.placing import MARGIN_S
from virtual_laboratory.prosthesis import prosthesis_of
from virtual_laboratory.reaction import Reaction
from virtual_laboratory.recording import Recorded
from virtual_laboratory.targets import (
    RISE_M,
    draw_trials,
    harmonics,
    intact_force,
    lifted,
    prosthetic_force,
)

from vsf_drake.model.parameters import GRAVITY, Subject
from vsf_drake.motion.trial import default_model

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
WEIGHT_N = SUBJECT.mass_kg * GRAVITY
TIME = np.arange(0.0, 1.0, 1e-3)


@pytest.fixture(scope="module")
def person():
    return Person(SUBJECT, default_model())


@pytest.fixture(scope="module")
def walked(person):
    return walk_at(person, None, 0, 2)


def walk_at(person: Person, speed: float | None, number: int, steps: int) -> Recorded:
    draw = draw_trials(SEED, speed)[number]
    return walk_trial(person, prosthesis_of(SUBJECT, draw.fulcrum_m), draw, steps)


def points(mass: float, radii: tuple[float, float, float]) -> MassPoints:
    """Two on each axis, `radii` (m) from the origin, of the trunk, and an almost massless
    pelvis."""
    p_B = np.concatenate([np.diag(radii), -np.diag(radii), np.zeros((1, 3))])
    return MassPoints(np.array([HAT] * 6 + [PELVIS]), p_B, np.array([mass / 6] * 6 + [1e-9]))


def at_rest(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.tile(np.eye(3), (len(time_s), HAT, 1, 1)), np.zeros((len(time_s), HAT, 3))


def nothing(time_s: np.ndarray) -> Wrench:
    return Wrench(np.zeros((len(time_s), 3)), np.zeros((len(time_s), 3)))


def test_a_thrown_trunk_falls_on_a_parabola_and_a_symmetric_one_precesses_as_a_free_top():
    """Free top, transverse moment A, axial C: its axis goes round the angular momentum L at L /
    A."""
    body = points(6.0, (0.3, 0.3, 0.1))
    squares = np.square([0.3, 0.3, 0.1])
    across, axial = 2.0 * (squares[1] + squares[2]), 2.0 * (squares[0] + squares[1])
    tilt, spin = 0.2, 3.0
    momentum = axial * spin / np.cos(tilt)
    turn = momentum / across
    own = (1.0 - axial / across) * momentum * np.cos(tilt) / axial
    truth = (
        Rotation.from_rotvec(np.outer(turn * TIME, [0.0, 0.0, 1.0]))
        * Rotation.from_rotvec([tilt, 0.0, 0.0])
        * Rotation.from_rotvec(np.outer(own * TIME, [0.0, 0.0, 1.0]))
    )
    place = (
        np.array([1.0, 2.0, 3.0])
        + np.outer(TIME, [1.0, -0.5, 4.0])
        - np.outer(TIME**2, [0, 0, 0.5 * GRAVITY])
    )
    found = close(TIME, body, *at_rest(TIME), nothing(TIME), Trunk(truth.as_matrix(), place))
    np.testing.assert_allclose(found.p_WL, place, atol=1e-8)
    assert np.max((Rotation.from_matrix(found.R_WH) * truth.inv()).magnitude()) < 1e-5


def test_the_trunk_answers_moving_legs_and_a_moment_as_newton_and_euler_say():
    """A leg of mass m swings by x(t), so without forces the trunk of mass M goes by -m x / M; a
    constant moment T about its axis turns it by T t^2 / (2 I)."""
    body = points(40.0, (0.2, 0.2, 0.2))
    leg = MassPoints(np.array([1]), np.zeros((1, 3)), np.array([10.0]))
    legs, swing = at_rest(TIME), 0.1 * np.sin(6.0 * TIME)
    legs[1][:, 1, 2] = swing  # along the vertical through the trunk's centre: no lever
    up = np.array([0.0, 0.0, 50.0 * GRAVITY])
    moment = np.tile([0.0, 0.0, 0.5], (len(TIME), 1))
    near = Trunk(np.tile(np.eye(3), (len(TIME), 1, 1)), np.zeros((len(TIME), 3)))
    found = close(
        TIME, body.together(leg), *legs, Wrench(np.tile(up, (len(TIME), 1)), moment), near
    )
    straight = np.polynomial.Polynomial.fit(TIME, found.p_WL[:, 2] + 0.25 * swing, 1)
    np.testing.assert_allclose(found.p_WL[:, 2] + 0.25 * swing, straight(TIME), atol=1e-7)
    angle = np.unwrap(Rotation.from_matrix(found.R_WH).as_rotvec()[:, 2])
    inertia = 40.0 / 6.0 * 4 * 0.2**2
    assert 2.0 * np.polyfit(TIME, angle, 2)[0] == pytest.approx(0.5 / inertia, rel=1e-4)


def test_missing_force_and_moment_of_a_known_motion():
    """A body carried round a circle needs m r w^2 inward; one that is only held needs its weight,
    under its centre."""
    body, w, r = points(30.0, (0.2, 0.2, 0.2)), 4.0, 0.3
    R, p = (
        np.tile(np.eye(3), (len(TIME), len(SEGMENTS), 1, 1)),
        np.zeros((len(TIME), len(SEGMENTS), 3)),
    )
    p[:, HAT, :2] = r * np.column_stack([np.cos(w * TIME), np.sin(w * TIME)])
    zeros = np.zeros((len(TIME), 3))
    none = Reaction(TIME, zeros, zeros, TIME, zeros, TIME, zeros, TIME, 0.0, zeros, zeros, zeros, 0)
    held = np.tile([0.0, 0.0, 30.0 * GRAVITY], (len(TIME), 1))
    left = missing(none, Wrench(held, np.cross([0.1, 0.0, 0.0], held)), body, R, p)
    inward = -30.0 * r * w**2 * np.column_stack([np.cos(w * TIME), np.sin(w * TIME)])
    np.testing.assert_allclose(left.force[1:-1, :2], inward[1:-1], atol=2e-3)
    np.testing.assert_allclose(left.force[1:-1, 2], 0.0, atol=1e-6)
    # the support at x = 0.1 m turns the body, which does not turn: weight x (lever) is missing
    x = 0.5 * (p[1:, HAT, 0] + p[:-1, HAT, 0])
    np.testing.assert_allclose(left.moment[1:-1, 1], -30.0 * GRAVITY * (x[1:] - 0.1), atol=0.5)


def test_a_triangles_mean_of_the_force_is_the_second_difference_of_the_place():
    """A unit mass under forces that are constant over each ms: places by exact integration, every
    fifth of them."""
    force = np.random.default_rng(1).normal(size=(len(TIME), 1))
    force[0] = 0.0
    speed = np.cumsum(force, axis=0) * 1e-3
    place = np.cumsum(np.vstack([[[0.0]], 0.5 * (speed[1:] + speed[:-1])]), axis=0) * 1e-3
    coarse = place[::5]
    second = (coarse[2:] - 2.0 * coarse[1:-1] + coarse[:-2]) / 5e-3**2
    np.testing.assert_allclose(triangle_mean(force, 5)[1:-1], second, atol=1e-8)


def test_mass_points_have_the_subjects_mass_and_winters_centre_of_head_arms_and_trunk(person):
    body = body_points(person.handles, person.model.intact_foot, 2.0)
    assert body.mass.sum() + 2.0 == pytest.approx(78.0)
    upper = np.isin(body.segment, (PELVIS, HAT))
    lumbar, hips = (
        person.p_PL,
        np.array([person.handles.body.hip_forward, 0.0, person.handles.body.hip_up]),
    )
    p_P = body.p_B[upper] + np.where(body.segment[upper, None] == HAT, lumbar, 0.0)
    share = (
        body.mass[upper] @ (p_P - hips)[:, 2] / body.mass[upper].sum() / (0.288 * SUBJECT.stature_m)
    )
    assert share == pytest.approx(0.626, abs=0.03)  # Winter, of the way from hip to shoulder


@pytest.mark.slow
def test_both_plates_and_weight_explain_the_motion_of_all_segments_at_every_instant(walked):
    assert np.abs(walked.truth.missing.force).max() < 0.005 * WEIGHT_N
    assert np.abs(walked.truth.missing.moment).max() < 0.005 * WEIGHT_N
    lumped = np.abs(walked.truth.lumped.force).max(axis=0)
    assert (lumped > 0.02 * WEIGHT_N).all()  # the check would see a trunk that does not move


@pytest.mark.slow
def test_both_feet_together_carry_the_body_through_a_stride_and_make_it_neither_faster_nor_slower(
    walked,
):
    """The impulse of both plates over a stride is the weight's, within 5 mm/s of the body's speed:
    a walk goes on."""
    time = walked.force_time_s - MARGIN_S
    total = walked.right.force + walked.left.force - WEIGHT_N * np.array([0.0, 0.0, 1.0])
    for begun in (0.0, 0.1):
        stride = (time >= begun) & (time < begun + walked.draw.stride_s)
        assert np.abs(total[stride].sum(axis=0)).max() * 1e-3 / SUBJECT.mass_kg < 0.005


@pytest.mark.slow
def test_the_intact_plate_is_one_that_a_foot_can_have(walked):
    force, loaded = walked.left.force, walked.left.force[:, 2] > 20.0
    assert (force[~loaded] == 0.0).any(axis=0).all() and force[:, 2].min() >= 0.0
    assert (np.hypot(*force[loaded, :2].T) < 0.6 * force[loaded, 2]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "number"), [(0.9, 7), (1.1, 4), (1.4, 8)])
def test_a_walk_at_each_speed_lies_in_the_published_bands_on_both_sides(person, speed, number):
    found = trial_figures(walk_at(person, speed, number, STEPS), person)
    assert found["residual_force_bw"] < 0.005 and found["residual_moment_bwm"] < 0.005
    assert found["speed_m_per_s"] == pytest.approx(speed, abs=0.06)
    for name, (value, low, high) in against_bands(found, speed).items():
        assert low <= value < high, name
    assert min(found["swing_clearance_mm"], found["intact_clearance_mm"]) > 5.0
    for prefix in ("", "intact_"):
        assert found[f"{prefix}cop_travel_mm"] > 180.0
        assert found[f"{prefix}trough_bw"] < min(
            found[f"{prefix}first_peak_bw"], found[f"{prefix}second_peak_bw"]
        )
    # the next stride is like this one: within what people's strides differ by, 2 % of the speed and
    # 2 degrees
    assert abs(found["gain_m_per_s"]) < 0.02 * speed and found["stride_ends_deg"] < 2.0
    assert found["trunk_shift_rms_mm"] < 10.0  # head, arms and trunk stay on the pelvis


def test_forces_of_a_draw_lift_the_body_as_its_legs_do():
    """The centre of mass's path by integrating the forces twice in steps of 0.1 ms."""
    rise = np.array([0.003 - 0.002j, -0.016 + 0.006j, 0.0])
    for drawn in draw_trials(SEED)[::4]:
        off = []
        for draw in (drawn, lifted(drawn, rise)):
            time = np.arange(round(draw.stride_s / 1e-4)) * 1e-4
            up = (prosthetic_force(draw, time) + intact_force(draw, time))[:, 2] - 1.0
            assert abs(up.mean()) < 1e-4  # the weight is carried
            speed = np.cumsum(up - up.mean()) * GRAVITY * 1e-4
            height = np.cumsum(speed - speed.mean()) * 1e-4
            off.append(np.abs(harmonics(height, 2) - rise[:2]))
        assert off[1][0] < RISE_M[0] and off[1][1] < off[0][1]
        assert (draw.step_width_m, draw.speed_m_per_s) == (drawn.step_width_m, drawn.speed_m_per_s)


def test_a_body_that_rises_far_is_given_no_peak_that_the_curve_overshoots():
    """28 mm once a step at 1.4 m/s, as the legs of a heavy man on a soft forefoot would have it;
    1.37 BW unbounded."""
    lift = np.array([0.016, -0.028 + 0.004j, 0.006])
    draws = [lifted(drawn, lift) for drawn in draw_trials(SEED, 1.4)]
    assert (
        max(
            prosthetic_force(draw, np.linspace(0.0, draw.stance_s, 500))[:, 2].max()
            for draw in draws
        )
        < 1.3
    )


def test_faster_people_step_oftener_load_and_push_more():
    """Signs of Schwartz 2008 between slow and free; the same random numbers at each speed."""
    slow, fast = (draw_trials(SEED, speed) for speed in (0.9, 1.4))
    for one, other in zip(slow, fast, strict=True):
        assert (
            other.stride_s < one.stride_s
            and other.stance_s / other.stride_s < one.stance_s / one.stride_s
        )
        assert other.first_peak_bw > one.first_peak_bw and other.trough_bw < one.trough_bw
        assert other.braking_bw > one.braking_bw and other.propulsion_bw > one.propulsion_bw
        assert other.speed_m_per_s * other.stride_s > one.speed_m_per_s * one.stride_s
        assert other.knee_loading_deg > one.knee_loading_deg
    short = draw_trials(SEED, 1.1, leg_m=0.83)[0]
    assert short.stride_s < draw_trials(SEED, 1.1)[0].stride_s


@pytest.mark.slow
def test_figures_of_a_walk_change_with_what_they_measure(person, walked):
    figures = trial_figures(walked, person)
    pushed = dataclasses.replace(
        walked.truth.missing, force=walked.truth.missing.force + np.array([0.0, 0.0, 3.0])
    )
    other = dataclasses.replace(walked, truth=dataclasses.replace(walked.truth, missing=pushed))
    assert trial_figures(other, person)["residual_force_bw"] == pytest.approx(
        3.0 / WEIGHT_N, rel=1e-3
    )
    assert figures["residual_force_bw"] < 1e-5
