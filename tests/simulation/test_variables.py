"""Variables and perturbations do what changing the thing they name does; what has no meaning is
refused; nothing is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.variables import SOCKET_AXES, MotionPerturbation
from vsf_drake.simulation.walk import Walker

FULCRUM_M, START_S = 0.108, 0.4
SPAN = {"fulcrum_m": FULCRUM_M, "start_s": 0.1, "end_s": START_S, "step_s": 2e-3}
"""Touch-down and the first half of stance."""
LAW = ("stiffness", "exponent", "damping", "full_damping_depth")
FRICTION = ("mu_static", "mu_kinetic", "threshold_velocity")
FOOT = ModelParameters().foot


@pytest.fixture(scope="module")
def person():
    return with_foot()


def with_foot(**changes):
    model = ModelParameters()
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
    return Walker(subject, replace(model, foot=replace(model.foot, **changes)))


def walked(walker, motion, **options):
    return walker.walk(motion("right"), **(SPAN | options))


def assert_same_walk(walk, wanted, tolerance=0.0):
    for name in ("q0", "v0", "q", "v", "load", "sites"):
        a, b = getattr(walk.record, name), getattr(wanted.record, name)
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * np.abs(b).max(), err_msg=name)
    assert walk.prosthetic.grf_W[:, 2].max() > 100.0


@pytest.mark.parametrize(
    "name",
    [
        *(f"contact.forefoot.{key}" for key in LAW),
        "contact.heel.stiffness",
        *(f"friction.{key}" for key in FRICTION),
        *(f"socket.{axis}.stiffness" for axis in SOCKET_AXES),
    ],
)
def test_variable_is_that_parameter_in_its_systems_context(person, motion, name):
    """Of the socket both signs keep their ratio, and the damping stays."""
    value = 0.8 * person.variables[name].default + 0.3 * name.endswith("exponent")
    kind, *middle, key = name.split(".")
    gait, rows = person.gait, ...
    changes = [(key, value)]
    if kind == "contact":
        sites = gait.person.foot.sites
        rows = np.flatnonzero(sites.zone == sites.zone_names.index(middle[0]))
    elif kind == "socket":
        rows, bushing = SOCKET_AXES.index(middle[0]), gait.bushing
        own = bushing.GetMyContextFromRoot(person.context)
        positive, negative = (
            bushing.GetParameter(own, sign)[rows] for sign in ("stiffness", "stiffness_negative")
        )
        changes.append(("stiffness_negative", value * negative / positive))
    walk = walked(person, motion, values={name: value})
    system, before = (
        gait.bushing if kind == "socket" else gait.forces["prosthetic"],
        person.context.Clone(),
    )
    own = system.GetMyMutableContextFromRoot(person.context)
    for parameter, number in changes:
        changed = system.GetParameter(own, parameter)
        changed[rows] = number
        system.SetParameters(own, **{parameter: changed})
    wanted = walked(person, motion)
    person.context.SetTimeStateAndParametersFrom(before)
    assert_same_walk(walk, wanted, 1e-9 if kind == "socket" else 0.0)
    assert np.abs(walk.record.q - walked(person, motion).record.q).max() > 0.0


@pytest.mark.parametrize(
    ("name", "value", "foot"),
    [
        ("keel.flexural_modulus", 12e9, {"keel": replace(FOOT.keel, flexural_modulus_pa=12e9)}),
        ("fulcrum.stiffness", 5e4, {"fulcrum": replace(FOOT.fulcrum, stiffness_n_per_m=5e4)}),
        (
            "contact.forefoot.rise",
            2e-3,
            {
                "zones": tuple(
                    replace(
                        zone,
                        rise_mm=tuple(
                            rise + 2.0 * (zone.name == "forefoot") for rise in zone.rise_mm
                        ),
                    )
                    for zone in FOOT.zones
                )
            },
        ),
    ],
)
def test_variable_is_that_number_of_a_foot_built_with_it(person, motion, name, value, foot):
    """Damping of keel and support comes with their stiffness, as in the model: a time constant."""
    assert_same_walk(
        walked(person, motion, values={name: value}), walked(with_foot(**foot), motion), 1e-9
    )


def test_offsets_are_those_of_a_manifest_and_add_to_them(person, motion):
    values = {
        "offset.height": 0.003,
        "offset.fore_aft": -0.004,
        "offset.alignment": 0.02,
        "offset.inversion": 0.05,
        "offset.toe_out": -0.04,
    }
    both = walked(
        person,
        motion,
        values=values,
        offsets=GeometricOffsets(
            height_m=0.001,
            fore_aft_m=0.002,
            alignment_rad=0.003,
            inversion_rad=0.01,
            toe_out_rad=0.02,
        ),
    )
    assert_same_walk(
        both,
        walked(
            person,
            motion,
            offsets=GeometricOffsets(
                height_m=0.004,
                fore_aft_m=-0.002,
                alignment_rad=0.023,
                inversion_rad=0.06,
                toe_out_rad=-0.02,
            ),
        ),
        1e-9,
    )


def test_coordinate_is_a_shift_of_the_whole_recorded_curve(person, motion):
    curve = motion("right")
    values = curve.values + 0.005 * (np.array(curve.names) == "hip_flexion_r")
    shifted = person.walk(CoordinateTrajectory(curve.time_s, values, curve.names), **SPAN)
    assert_same_walk(
        walked(person, motion, values={"coordinate.hip_flexion_r": 0.005}), shifted, 1e-6
    )


def test_shift_of_the_fulcrum_is_another_position_constant_or_moving(person, motion):
    shift = {"fulcrum.shift": -0.02}
    assert_same_walk(
        walked(person, motion, values=shift),
        walked(person, motion, fulcrum_m=FULCRUM_M - 0.02),
        1e-12,
    )
    moving = walked(person, motion, values=shift, fulcrum_m=lambda t: 0.1 + 0.05 * t)
    assert_same_walk(moving, walked(person, motion, fulcrum_m=lambda t: 0.08 + 0.05 * t), 1e-12)


def test_values_hold_for_one_walk_only_also_if_it_fails(person, motion):
    before, mechanism = walked(person, motion), gait_mechanism(person.gait, person.context)
    defaults = {name: variable.default for name, variable in person.variables.items()}
    assert_same_walk(walked(person, motion, values=defaults), before, 1e-9)
    walked(
        person,
        motion,
        values={
            name: 0.7 * variable.default + 0.002 * variable.added
            for name, variable in person.variables.items()
            if "exponent" not in name
        },
    )
    for wrong in (
        {"contact.forefoot.stiffness": 1.0, "offset.height": 0.01, "no.such": 1.0},
        {"offset.height": 0.01, "fulcrum.shift": 1.0},
    ):
        with pytest.raises(InputError):
            walked(person, motion, values=wrong)
    assert_same_walk(walked(person, motion), before)
    after = gait_mechanism(person.gait, person.context)
    for name in ("sites", "springs", "fulcrum"):
        np.testing.assert_array_equal(getattr(after, name), getattr(mechanism, name))


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"contact.forfoot.stiffness": 1.0}, "Did you mean contact.forefoot.stiffness"),
        ({"qqqq": 1.0}, r"There are: contact\."),
        *(
            ({name: value}, "is not usable")
            for name, value in (
                ("contact.forefoot.stiffness", float("nan")),
                ("contact.forefoot.stiffness", 0.0),
                ("contact.forefoot.stiffness", "5000"),
                ("contact.forefoot.stiffness", True),
                ("fulcrum.shift", 1j),
                ("contact.forefoot.stiffness", np.array([1.0, 2.0])),
                ("contact.forefoot.exponent", 0.9),
                ("friction.mu_static", -0.1),
                ("coordinate.pelvis_ty", float("-inf")),
            )
        ),
    ],
)
def test_name_or_value_without_meaning_is_refused(person, motion, values, match):
    with pytest.raises(InputError, match=match) as error:
        walked(person, motion, values=values)
    assert next(iter(values)) in str(error.value)


# Courses


def wave(time):
    return 0.3 + np.sin(7.0 * time)


def one(time):
    return np.ones_like(time)


@pytest.mark.parametrize(("name", "value"), [("pelvis_ty", 0.003), ("hip_flexion_r", 0.02)])
def test_walk_with_a_course_is_the_walk_of_a_trajectory_changed_by_it(person, motion, name, value):
    """Its samples lie 10 ms apart; the quintic spline through them leaves 1e-9 of a wave of nearly
    a second."""
    curve = motion("right")
    values = curve.values + np.outer(value * wave(curve.time_s), np.array(curve.names) == name)
    wanted = person.walk(CoordinateTrajectory(curve.time_s, values, curve.names), **SPAN)
    walk = walked(
        person,
        motion,
        perturbations=[MotionPerturbation("a", name, wave)],
        values={"perturbation.a": value},
    )
    np.testing.assert_allclose(walk.commanded, wanted.commanded, atol=1e-8 * abs(value))
    assert_same_walk(walk, wanted, 1e-5)


def test_shortest_walk_has_courses_too_and_the_result_tells_of_them(person, motion, trial_files):
    span = {"start_s": START_S, "end_s": START_S + 1e-4, "step_s": 1e-4}
    walk = walked(
        person,
        motion,
        perturbations=[MotionPerturbation("a", "pelvis_ty", wave)],
        values={"perturbation.a": 1e-4},
        with_respect_to=["perturbation.a"],
        **span,
    )
    assert walk.sensitivity.grf_W.shape == (1, 3, 1) and np.isfinite(walk.sensitivity.grf_W).all()
    table = person.result(
        walk, load_trial(trial_files.write()), GeometricOffsets(), energy=False
    ).parameters
    assert table["values"] == {"perturbation.a": 1e-4} and table["perturbations"] == {
        "perturbation.a": "pelvis_ty"
    }


A = MotionPerturbation("a", "pelvis_ty", one)


@pytest.mark.parametrize(
    ("perturbations", "match"),
    [
        (
            [MotionPerturbation("a", "pelvis_tyy", one)],
            "'pelvis_tyy' is not a pres.*Did you mean pelvis_ty",
        ),
        ([MotionPerturbation("a", "socket_tx", one)], "'socket_tx' is not a prescribed"),
        ([A, MotionPerturbation("a", "pelvis_tx", one)], "two perturbations have this name"),
        ([MotionPerturbation("", "pelvis_ty", one)], "is no name"),
        (A, "no list of perturbations"),
        ([one], r"perturbations\[0\].*no MotionPerturbation"),
        ([MotionPerturbation("a", "pelvis_ty", 1.0)], "is a float, no function"),
        ([MotionPerturbation("a", "pelvis_ty", lambda t: 1.0)], r"shape \(\) for"),
        (
            [MotionPerturbation("a", "pelvis_ty", lambda t: np.where(t > 0.301, np.nan, 1.0))],
            r"is nan at 0\.302 s",
        ),
        ([MotionPerturbation("a", "pelvis_ty", lambda t: t + 0j)], "complex"),
    ],
)
def test_what_is_no_course_is_refused(person, motion, perturbations, match):
    with pytest.raises(InputError, match=match) as caught:
        walked(person, motion, perturbations=perturbations)
    assert "perturbation" in str(caught.value)
