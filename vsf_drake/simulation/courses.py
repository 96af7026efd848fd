"""Courses: changes of the recorded motion that vary with time, each a value times a given function.

A walk follows q(t) = trajectory + coordinate shifts + sum of value * shape(t). Between the instants of its steps it
knows nothing of a shape: there the coordinate goes straight, as it does along the recording. The velocity before the
first step has the rate of the shape at the start, the derivative of the quartic through five instants a tenth of a
millisecond apart from there on: nothing is asked outside of the walk's time.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.stepping.ways import Edit
from vsf_drake.simulation.variables import Variable, shift_variable

RATE_STEP_S = 1e-4
"""Between the instants from which a rate at the start is taken, in longer walks."""
_RATE = np.array([48.0, -36.0, 16.0, -3.0]) / 12.0
"""Of the first of five values at equal steps, from what the others differ from it."""


@dataclass(frozen=True, eq=False)
class Course:
    """A way in which a prescribed coordinate is changed in the course of a walk.

    Attributes:
        name: its variable is "course.NAME", in m or rad, 0 unless a walk's `values` say otherwise.
        coordinate: name of the prescribed coordinate; several courses may change the same.
        shape: times (n,) of the recording (s) -> (n,) what the value is times; smooth (twice differentiable), without
            dimension.
    """

    name: str
    coordinate: str
    shape: Callable[[np.ndarray], np.ndarray]


def course_variables(
    courses: Sequence[Course], prescribed: Sequence[str], moments: np.ndarray
) -> dict[str, Variable]:
    """The variables of a walk with these courses at the moments (n + 1,), by name.

    Raises:
        InputError: one is no course or has the name of another, its coordinate is not prescribed, or its shape does not
            give a finite number for each time.
    """
    if isinstance(courses, (Course, str, Mapping)) or not isinstance(courses, Sequence):
        raise InputError(f"is a {type(courses).__name__}, no list of courses", where="courses",
                         right="Give a list, also for one course")
    found: dict[str, Variable] = {}
    for i, course in enumerate(courses):
        if not isinstance(course, Course):
            raise InputError(f"is a {type(course).__name__}, no Course", where=f"courses[{i}]")
        if not isinstance(course.name, str) or not course.name.strip():
            raise InputError(f"{course.name!r} is no name", where=f"courses[{i}].name")
        name = f"course.{course.name}"
        if name in found:
            raise InputError("two courses have this name", where=name)
        found[name] = shift_variable(name, _edit(course, prescribed, moments))
    return found


def course_motion(
    variables: Mapping[str, Variable], values: Mapping[str, float], prescribed: Sequence[str], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """What the courses among `values` add to the prescribed coordinates at `count` moments.

    Returns:
        (count, p) in m or rad, and (p,) the rate at the first moment.
    """
    motion, rate = np.zeros((count, len(prescribed))), np.zeros(len(prescribed))
    for name, value in values.items():
        edit = variables[name].edit
        if edit.course is not None:
            column = prescribed.index(edit.coordinate)
            motion[:, column] += value * edit.course
            rate[column] += value * edit.course_rate
    return motion, rate


def _edit(course: Course, prescribed: Sequence[str], moments: np.ndarray) -> Edit:
    where = f"course.{course.name}"
    if course.coordinate not in prescribed:
        near = difflib.get_close_matches(str(course.coordinate), prescribed, n=1)
        raise InputError(f"{course.coordinate!r} is not a prescribed coordinate", where=where,
                         right=f"Did you mean {near[0]}?" if near else f"Prescribed are: {', '.join(prescribed)}")
    if not callable(course.shape):
        raise InputError(f"its shape is a {type(course.shape).__name__}, no function of time", where=where)
    step = min(RATE_STEP_S, (moments[-1] - moments[0]) / 4.0)
    early = _sampled(course.shape, moments[0] + step * np.arange(5), where)
    return Edit(coordinate=course.coordinate, course=_sampled(course.shape, moments, where),
                course_rate=float(_RATE @ (early[1:] - early[0])) / step)


def _sampled(shape: Callable[[np.ndarray], np.ndarray], times: np.ndarray, where: str) -> np.ndarray:
    """Values (n,) at the times (n,), which the shape gets as a copy of its own."""
    given = np.asarray(shape(times.copy()))
    if given.dtype.kind not in "iuf" or given.shape != times.shape:
        raise InputError(f"its shape gives {given.dtype} numbers of shape {given.shape} for {len(times)} times",
                         where=where, right="It must give one real number for each time")
    if not np.isfinite(given).all():
        raise InputError(f"its shape is {given[~np.isfinite(given)][0]} at {times[~np.isfinite(given)][0]:g} s",
                         where=where, right="It must be finite from the start of the walk to its end")
    return np.array(given, dtype=float)
