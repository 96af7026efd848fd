"""A course changes the recorded motion as it says and nothing else; what is no course is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.variables import Course, course_variables
from vsf_drake.simulation.walk import Walker

FULCRUM_M, START_S = 0.108, 0.4
SPAN = {"fulcrum_m": FULCRUM_M, "start_s": 0.1, "end_s": 0.4, "step_s": 2e-3}
"""Touch-down and the first half of stance."""


def wave(time):
    return 0.3 + np.sin(7.0 * time)


def one(time):
    return np.ones_like(time)


def assert_same_walk(found, wanted, tolerance=0.0):
    for name in ("q0", "v0", "q", "v", "load", "sites"):
        a, b = getattr(found.record, name), getattr(wanted.record, name)
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * np.abs(b).max(), err_msg=name)
    assert found.prosthetic.grf_W[:, 2].max() > 100.0


@pytest.mark.parametrize(("name", "value"), [
    ("pelvis_tx", 0.02), ("pelvis_ty", 0.003), ("hip_flexion_r", 0.02), ("knee_angle_r", 0.03)])
def test_walk_with_a_course_is_the_walk_of_a_trajectory_changed_by_it(walker, motion, name, value):
    """Its samples lie 10 ms apart; the quintic spline through them leaves 1e-9 of a wave of nearly a second."""
    curve = motion("right")
    values = curve.values.copy()
    values[:, curve.names.index(name)] += value * wave(curve.time_s)
    wanted = walker("right").walk(CoordinateTrajectory(curve.time_s, values, curve.names), **SPAN)
    found = walker("right").walk(curve, courses=[Course("a", name, wave)], values={"course.a": value}, **SPAN)
    column = walker("right").gait.prescribed.index(name)
    np.testing.assert_allclose(found.commanded[:, column], wanted.commanded[:, column], atol=1e-8 * abs(value))
    assert_same_walk(found, wanted, 1e-5)
    np.testing.assert_allclose(found.prosthetic.grf_W, wanted.prosthetic.grf_W, atol=0.01)


@pytest.mark.parametrize("name", ["pelvis_ty", "knee_angle_r"])
def test_constant_shape_is_a_shift_of_the_coordinate(walker, motion, name):
    shift = f"coordinate.{name}"
    options = SPAN | {"courses": [Course("a", name, one)], "with_respect_to": [shift, "course.a"]}
    found = walker("right").walk(motion("right"), values={"course.a": 0.004}, **options)
    wanted = walker("right").walk(motion("right"), values={shift: 0.004}, **options)
    assert_same_walk(found, wanted, 1e-12)
    for by in (found.sensitivity, wanted.sensitivity):
        for series in (by.grf_W, by.cop_W, by.free_moment_nm):
            scale = np.nanmax(np.abs(series[..., 0]))
            assert scale > 0.0
            np.testing.assert_allclose(series[..., 1], series[..., 0], rtol=0.0, atol=1e-10 * scale)


def test_courses_of_one_coordinate_and_its_shift_add_up(walker, motion):
    courses = [Course("a", "hip_flexion_r", wave), Course("b", "hip_flexion_r", one), Course("c", "pelvis_tx", wave)]
    values = {"course.a": 0.01, "course.b": 0.002, "coordinate.hip_flexion_r": 0.001, "course.c": 0.004}
    found = walker("right").walk(motion("right"), courses=courses, values=values, **SPAN)
    together = [Course("hip", "hip_flexion_r", lambda t: 0.01 * wave(t) + 0.003), Course("c", "pelvis_tx", wave)]
    wanted = walker("right").walk(motion("right"), courses=together, values={"course.hip": 1.0, "course.c": 0.004},
                                  **SPAN)
    assert_same_walk(found, wanted, 1e-9)


@pytest.mark.parametrize("values", [None, {"course.a": 0.0}])
def test_course_without_a_value_changes_nothing(walker, motion, values):
    found = walker("right").walk(motion("right"), courses=[Course("a", "pelvis_ty", wave)], values=values, **SPAN)
    assert_same_walk(found, walker("right").walk(motion("right"), **SPAN))


def test_start_has_the_rate_of_the_shape(walker, motion):
    """On the ground, where all else is at rest: of a sine to 1e-11, of what begins flat none at all."""
    span = SPAN | {"start_s": START_S, "end_s": START_S + 0.01}
    courses = [Course("steep", "pelvis_tx", lambda t: np.sin(9.0 * t)),
               Course("flat", "knee_angle_r", lambda t: (t - START_S) ** 3)]
    values = {"course.steep": 0.01, "course.flat": 0.02}
    found = walker("right").walk(motion("right"), courses=courses, values=values, **span)
    change = found.record.v0 - walker("right").walk(motion("right"), **span).record.v0
    tree = found.mechanism.tree
    assert change[tree.index("pelvis_tx")] == pytest.approx(0.09 * math.cos(9.0 * START_S), abs=1e-10)
    change[tree.index("pelvis_tx")] = 0.0
    assert np.abs(change).max() < 1e-10


def test_shape_is_asked_within_the_walk_only_and_cannot_spoil_its_times(walker, motion):
    def shape(time):
        assert time.min() >= SPAN["start_s"] and time.max() <= SPAN["end_s"] + 1e-12
        time *= 2.0
        return time

    found = walker("right").walk(motion("right"), courses=[Course("a", "pelvis_tx", shape)], values={"course.a": 0.01},
                                 **SPAN)
    wanted = walker("right").walk(motion("right"), courses=[Course("a", "pelvis_tx", lambda t: 2.0 * t)],
                                  values={"course.a": 0.01}, **SPAN)
    assert_same_walk(found, wanted)


@pytest.mark.parametrize("steps", [1, 2])
def test_shortest_walks_have_courses_too(walker, motion, steps):
    span = SPAN | {"start_s": START_S, "end_s": START_S + steps * 1e-4, "step_s": 1e-4}
    walk = walker("right").walk(motion("right"), courses=[Course("a", "pelvis_ty", wave)], values={"course.a": 1e-4},
                                with_respect_to=["course.a"], **span)
    assert walk.sensitivity.grf_W.shape == (steps, 3, 1) and np.isfinite(walk.sensitivity.grf_W).all()


def test_units_and_bounds_are_those_of_a_shift(walker):
    person = walker("right")
    courses = [Course("length", "pelvis_ty", one), Course("angle", "hip_flexion_r", one)]
    found = course_variables(courses, person.gait.prescribed, np.array([0.0, 1.0]))
    assert [(name, variable.unit) for name, variable in found.items()] == [("course.length", "m"),
                                                                           ("course.angle", "rad")]
    for variable, other in zip(found.values(), ("coordinate.pelvis_ty", "coordinate.hip_flexion_r"), strict=True):
        like = person.variables[other]
        for key in ("unit", "default", "low", "high", "minimum", "maximum", "added"):
            assert getattr(variable, key) == getattr(like, key), key


def test_courses_are_of_one_walk(walker, motion):
    person, known = walker("right"), list(walker("right").variables)
    person.walk(motion("right"), courses=[Course("a", "pelvis_ty", wave)], values={"course.a": 1e-3}, **SPAN)
    assert list(person.variables) == known
    with pytest.raises(InputError, match=r"no variable 'course\.a'"):
        person.walk(motion("right"), values={"course.a": 1e-3}, **SPAN)


def test_result_tells_which_coordinate_a_course_changed(walker, motion, trial_files):
    person = walker("right")
    walk = person.walk(motion("right"), courses=[Course("a", "pelvis_ty", wave)], values={"course.a": 1e-3}, **SPAN)
    found = person.result(walk, load_trial(trial_files.write()), GeometricOffsets(), energy=False).parameters
    assert found["values"] == {"course.a": 1e-3} and found["courses"] == {"course.a": "pelvis_ty"}


def nan_late(time):
    return np.where(time > 0.301, np.nan, 1.0)


A = Course("a", "pelvis_ty", one)
REFUSED = {
    "unknown coordinate": ([Course("a", "pelvis_tyy", one)], "'pelvis_tyy' is not a pres.*Did you mean pelvis_ty"),
    "no coordinate at all": ([Course("a", None, one)], "None is not a prescribed"),
    "coordinate of a spring": ([Course("a", "socket_tx", one)], "'socket_tx' is not a prescribed"),
    "coordinate with its own input": ([Course("a", "fulcrum", one)], "'fulcrum' is not a prescribed"),
    "one name twice": ([A, Course("a", "pelvis_tx", one)], "two courses have this name"),
    "no name": ([Course("", "pelvis_ty", one)], "is no name"),
    "a number for a name": ([Course(3, "pelvis_ty", one)], "3 is no name"),
    "one course without a list": (A, "no list of courses"),
    "functions by name": ({"a": one}, "no list of courses"),
    "function in place of a course": ([one], r"courses\[0\].*no Course"),
    "number for a shape": ([Course("a", "pelvis_ty", 1.0)], "is a float, no function"),
    "one number for all times": ([Course("a", "pelvis_ty", lambda t: 1.0)], r"shape \(\) for"),
    "a column": ([Course("a", "pelvis_ty", lambda t: t[:, None])], r"shape \(\d+, 1\) for"),
    "a number less": ([Course("a", "pelvis_ty", lambda t: t[1:])], "one real number for each time"),
    "not a number": ([Course("a", "pelvis_ty", lambda t: t * np.nan)], "is nan at"),
    "not a number at the end": ([Course("a", "pelvis_ty", nan_late)], r"is nan at 0\.302 s"),
    "infinite": ([Course("a", "pelvis_ty", lambda t: np.full(len(t), np.inf))], "is inf at"),
    "complex": ([Course("a", "pelvis_ty", lambda t: t + 0j)], "complex"),
    "words": ([Course("a", "pelvis_ty", lambda t: np.array(["1"] * len(t)))], "one real number"),
    "none": ([Course("a", "pelvis_ty", lambda t: None)], "one real number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_course_is_refused(walker, motion, name):
    courses, match = REFUSED[name]
    with pytest.raises(InputError, match=match) as caught:
        walker("right").walk(motion("right"), courses=courses, **SPAN)
    assert "course" in str(caught.value)


@pytest.mark.parametrize("value", [math.nan, math.inf, 5.0, "0.01", None])
def test_value_without_meaning_is_refused(walker, motion, value):
    with pytest.raises(InputError, match="is not usable") as caught:
        walker("right").walk(motion("right"), courses=[A], values={"course.a": value}, **SPAN)
    assert "course.a" in str(caught.value)


def test_free_coordinate_takes_no_course(motion):
    person = Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), ModelParameters(),
                    free=("pelvis_ty",))
    with pytest.raises(InputError, match="'pelvis_ty' is not a prescribed coordinate"):
        person.walk(motion("right"), courses=[A], **SPAN)
