"""Sensitivities to courses are the derivatives of the run: central differences, and identities that hold exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from cut_walks import SETTINGS, hard_walker
from differences import central, errors, exact_series, size
from scipy.interpolate import BSpline

from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.stepping.assembly import split_coordinates
from vsf_drake.simulation.stepping.sensitivity import Carried
from vsf_drake.simulation.stepping.ways import make_ways
from vsf_drake.simulation.variables import Course, course_variables
from vsf_drake.simulation.walk import Walker

END_S, STRIKE_S, MID_STANCE_S = 0.94, 0.1, 0.4
GRID = np.array([0.0, 0.5, 1.0])
COORDINATES = ("pelvis_tx", "pelvis_ty", "hip_flexion_{}", "knee_angle_{}")


@dataclass(frozen=True)
class Coursed:
    """A person whose walks all have these courses, for helpers that know a walker."""

    person: Walker
    courses: tuple[Course, ...]

    @property
    def variables(self):
        return self.person.variables | course_variables(self.courses, self.person.gait.prescribed, GRID)

    def walk(self, motion, **options):
        return self.person.walk(motion, courses=self.courses, **options)


def wave(time):
    """With a rate wherever a walk begins."""
    return 0.3 + np.sin(7.0 * time)


def coursed(person, shape=wave):
    """The person with a course on each of COORDINATES, on the prosthetic side."""
    names = [name.format(person.subject.prosthetic_side[0]) for name in COORDINATES]
    return Coursed(person, tuple(Course(name, name, shape) for name in names))


def names_of(person):
    return [f"course.{course.name}" for course in person.courses]


def away(person):
    """Values that are not zero, so that nothing is right there only."""
    return dict(zip(names_of(person), (4e-3, 5e-4, 0.01, -0.01), strict=True))


def moving(time):
    return 0.09 + 0.05 * time


CASES = {
    "whole stance, 1 ms": ("right", {"fulcrum_m": 0.108, "start_s": 0.0, "step_s": 1e-3}),
    "soft setting, 2 ms": ("left", {"fulcrum_m": 0.066, "start_s": STRIKE_S, "step_s": 2e-3}),
    "fulcrum moving, from loaded rest": ("left", {"fulcrum_m": moving, "start_s": MID_STANCE_S, "step_s": 2e-3}),
    "from loaded rest, 1 ms": ("right", {"fulcrum_m": 0.108, "start_s": MID_STANCE_S, "step_s": 1e-3}),
}


def assert_central_differences_agree(person, recording, names, options, *, change, largest, median):
    walk = person.walk(recording, with_respect_to=names, **options)
    for variable in names:
        by = central(person, recording, variable, change * size(person.variables[variable]), **options)
        assert by.alike.all(), variable
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert error.max() < largest, (variable, key)
            assert np.median(error) < median, (variable, key)
    return walk


@pytest.mark.parametrize("name", CASES)
def test_central_differences_lead_to_the_sensitivity(walker, motion, name):
    """As for other variables: what is left is the tolerance of Newton's method and of settling."""
    side, span = CASES[name]
    person = coursed(walker(side))
    options = {"end_s": END_S, "values": away(person)} | span
    walk = assert_central_differences_agree(
        person, motion(side), [*names_of(person), "coordinate.pelvis_ty"], options, change=3e-6,
        largest=5e-3 if options["start_s"] == MID_STANCE_S else 1e-3, median=1e-6)
    for variable in names_of(person):
        assert np.abs(exact_series(walk.sensitivity, variable)["force"]).max() > 1e3, variable


@pytest.mark.parametrize("setting", [0, 2])
def test_central_differences_lead_to_the_sensitivity_on_the_reference_subject(setting):
    walker, trial = hard_walker(setting)
    person = coursed(walker)
    options = {"fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s, "step_s": 2e-3,
               "values": away(person)}
    assert_central_differences_agree(person, trial.trajectory, names_of(person), options, change=1e-6, largest=1e-4,
                                     median=1e-7)


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_steps_that_are_cut_carry_sensitivities_through_their_pieces(name):
    """Courses without a value, so that the walk is the one that is cut."""
    setting, values, step_s = SETTINGS[name]
    walker, trial = hard_walker(setting)
    person = coursed(walker)
    options = {"values": values, "fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s,
               "step_s": step_s}
    walk = person.walk(trial.trajectory, with_respect_to=names_of(person), **options)
    assert walk.record.parts.max() > 1 and walk.record.converged.all()
    first = np.flatnonzero(walk.record.parts > 1)[0]
    for variable in names_of(person):
        by = central(person, trial.trajectory, variable, 1e-6 * size(person.variables[variable]), **options)
        same = np.logical_and.accumulate(by.alike)
        assert same[first], variable
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert error[same].max() < 3e-3, (variable, key)
            assert np.median(error) < 1e-4, (variable, key)


@pytest.mark.parametrize(("free", "settles"), [
    (("pelvis_ty", "knee_angle_l"), ()), (("hip_rotation_r", "pelvis_list"), ()), (("pelvis_ty",), ("pelvis_ty",))])
def test_free_coordinates_above_and_below_a_course_respond(motion, free, settles):
    """As recorded at the start, or settled there (not quite: a sticking foot creeps, by the same share)."""
    person = Coursed(Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"),
                            ModelParameters(), free=free),
                     tuple(Course(name, name, wave) for name in ("hip_flexion_l", "pelvis_tx", "knee_angle_r")))
    start = dict(zip(motion("right").names, motion("right").sample(MID_STANCE_S)[0][0], strict=True))
    options = {"fulcrum_m": 0.108, "start_s": MID_STANCE_S, "end_s": 0.55, "step_s": 1e-3,
               "initial": {name: float(start[name]) for name in settles}}
    walk = person.walk(motion("right"), with_respect_to=names_of(person), **options)
    for variable in names_of(person):
        by = central(person, motion("right"), variable, 1e-5 * size(person.variables[variable]), **options)
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert np.abs(exact_series(walk.sensitivity, variable)[key]).max() > 0.0
            assert error.max() < (0.01 if settles else 3e-3), (variable, key)


def bumps(count):
    """Cubic B-splines over the walk: they add up to 1."""
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, count - 2), np.ones(3)])
    return [BSpline(knots, unit, 3) for unit in np.eye(count)]


@pytest.mark.parametrize("start_s", [0.0, MID_STANCE_S])
def test_sensitivities_to_courses_that_add_up_to_one_add_up_to_that_of_a_shift(walker, motion, start_s):
    names = ("pelvis_ty", "hip_flexion_r")
    person = Coursed(walker("right"), tuple(Course(f"{name}_{i}", name, bump) for name in names
                                            for i, bump in enumerate(bumps(8))))
    wanted = [f"coordinate.{name}" for name in names]
    by = person.walk(motion("right"), fulcrum_m=0.108, start_s=start_s, end_s=END_S, step_s=2e-3,
                     with_respect_to=[*names_of(person), *wanted]).sensitivity
    for series in (by.grf_W, by.cop_W, by.free_moment_nm):
        for i in range(2):
            whole = series[..., 16 + i]
            np.testing.assert_allclose(series[..., 8 * i : 8 * i + 8].sum(axis=-1), whole, rtol=0.0,
                                       atol=1e-9 * np.nanmax(np.abs(series)))


def test_future_of_a_course_does_not_show(walker, motion):
    """A course that begins in mid-stance changes nothing before."""
    later = Course("later", "knee_angle_r", lambda t: np.maximum(t - MID_STANCE_S, 0.0) ** 3)
    walk = walker("right").walk(motion("right"), courses=[later], fulcrum_m=0.108, start_s=STRIKE_S, end_s=0.6,
                                step_s=2e-3, with_respect_to=["course.later"])
    before = walk.record.time_s < MID_STANCE_S + 1e-9
    assert not walk.sensitivity.grf_W[before].any()
    assert walk.sensitivity.grf_W[~before].any(axis=(1, 2)).all()


def test_other_sensitivities_are_the_same_beside_courses(walker, motion):
    person = coursed(walker("right"))
    names = ["offset.height", "coordinate.pelvis_ty", "coordinate.knee_angle_r", "contact.forefoot.stiffness"]
    options = {"fulcrum_m": 0.108, "start_s": STRIKE_S, "end_s": 0.5, "step_s": 1e-3}
    alone = person.person.walk(motion("right"), with_respect_to=names, **options)
    beside = person.walk(motion("right"), with_respect_to=[*names_of(person), *names], **options)
    np.testing.assert_array_equal(beside.record.q, alone.record.q)
    np.testing.assert_allclose(beside.sensitivity.grf_W[:, :, 4:], alone.sensitivity.grf_W, rtol=1e-12, atol=1e-9)


def test_parameters_that_move_the_same_coordinate_share_its_way(walker):
    person = walker("right")
    mechanism = gait_mechanism(person.gait, person.context)
    tree = mechanism.tree
    names = ("pelvis_ty", "hip_flexion_r")
    courses = [Course(f"{name}_{i}", name, bump) for i, bump in enumerate(bumps(8)) for name in names]
    found = course_variables(courses, person.gait.prescribed, GRID)
    edits = [variable.edit for variable in found.values()]
    edits += [person.variables[f"coordinate.{name}"].edit for name in (*names, "knee_angle_r")]
    held = np.array([tree.index(name) for name in (*person.gait.prescribed, "fulcrum")])
    split = split_coordinates(tree, mechanism.forces, held)
    ways = make_ways(tree, mechanism.forces, split, edits, measured=np.zeros(len(mechanism.sites), dtype=bool))
    assert [tree.coordinate_names[c] for c in ways.coordinate[len(split.free):]] == [*names, "knee_angle_r"]
    assert set(ways.course_way) == {len(split.free), len(split.free) + 1}
    assert ways.path.shape == (len(GRID), 16)


def test_course_on_another_grid_than_the_run_is_refused(walker):
    person = walker("right")
    mechanism = gait_mechanism(person.gait, person.context)
    edits = tuple(v.edit for v in course_variables([Course("a", "pelvis_ty", wave)], person.gait.prescribed,
                                                   GRID).values())
    carried = Carried(edits=edits, measured=np.zeros(len(mechanism.sites), dtype=bool), q0=np.zeros((1, 1)))
    with pytest.raises(ValueError, match="3 instants, the run 11"):
        carried.prepare(mechanism.tree, mechanism.forces, None, 10)
