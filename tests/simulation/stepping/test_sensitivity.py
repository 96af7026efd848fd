"""Sensitivities are the derivatives of the run: central differences, identities that hold exactly, and refusals.

Two runs on both sides of a value have a force on different branches of its law where a sphere touches down or
lifts off, begins to slip or to come up: an event. Only there may a difference be anything else than the derivative.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker
from differences import central, errors, exact_series, size

from vsf_drake.errors import InputError
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.stepping.sensitivity import rest_sensitivity
from vsf_drake.simulation.walk import Walker

END_S, STRIKE_S, MID_STANCE_S = 0.94, 0.1, 0.4
VALUES = {"offset.height": 2e-3, "offset.fore_aft": 4e-3, "offset.alignment": 0.02, "contact.forefoot.rise": 1e-3,
          "coordinate.pelvis_list": 0.01, "fulcrum.shift": 0.004, "fulcrum.stiffness": 8e4}
"""Away from the defaults, so that nothing is right at zero only."""


def moving(time):
    return 0.09 + 0.05 * time


CASES = {
    "whole stance, 1 ms": ("right", {"fulcrum_m": 0.108, "start_s": 0.0, "step_s": 1e-3}),
    "soft setting, 2 ms": ("right", {"fulcrum_m": 0.066, "start_s": STRIKE_S, "step_s": 2e-3}),
    "stiff setting, 2 ms": ("left", {"fulcrum_m": 0.146, "start_s": STRIKE_S, "step_s": 2e-3}),
    "fulcrum moving, from loaded rest": ("left", {"fulcrum_m": moving, "start_s": MID_STANCE_S, "step_s": 2e-3}),
    "from loaded rest, 1 ms": ("right", {"fulcrum_m": 0.108, "start_s": MID_STANCE_S, "step_s": 1e-3}),
}
FAMILIES = ("contact", "friction", "keel", "fulcrum", "socket", "offset", "coordinate")


def case(walker, motion, name):
    """The person, the motion and the arguments of a case; exponents above their least, to have two sides."""
    side, span = CASES[name]
    person = walker(side)
    exponents = {n: 1.05 for n in person.variables if n.endswith(".exponent")}
    return person, motion(side), {"end_s": END_S, "values": VALUES | exponents} | span


def family(person, prefix):
    """Names of it, of coordinates those on which the force on the prosthetic foot depends."""
    other = "_l" if person.subject.prosthetic_side == "right" else "_r"
    return [name for name in person.variables if name.startswith(prefix) and not name.endswith(("_tx", "_tz", other))]


@pytest.mark.parametrize("prefix", FAMILIES)
@pytest.mark.parametrize("name", CASES)
def test_central_differences_lead_to_the_sensitivity(walker, motion, name, prefix):
    """Changes by 3e-6 pass no event. What is left is the tolerance of Newton's method; at a start in equilibrium also
    what settling leaves, some 1e-9 m/s for some 0.1 s: 1e-10 m beside a change of the pose by as little as 3e-8 m."""
    person, recording, options = case(walker, motion, name)
    names = family(person, prefix)
    sensitivity = person.walk(recording, with_respect_to=names, **options).sensitivity
    for variable in names:
        by = central(person, recording, variable, 3e-6 * size(person.variables[variable]), **options)
        assert by.alike.all(), variable
        for key, error in errors(person, sensitivity, variable, by):
            assert error.max() < (5e-3 if options["start_s"] == MID_STANCE_S else 1e-3), (variable, key)
            assert np.median(error) < 1e-6, (variable, key)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES][::3])
def test_noticeable_changes_agree_within_a_percent_away_from_events(walker, motion, name):
    """Changes by 2e-4. After an event the foot creeps on the ground against its socket, with a time constant of
    mu F_n / v_s over the socket's stiffness, 0.05 s at half the weight: out of sight after three of them."""
    person, recording, options = case(walker, motion, name)
    names = [variable for prefix in FAMILIES for variable in family(person, prefix)]
    sensitivity = person.walk(recording, with_respect_to=names, **options).sensitivity
    events, seen = 0, 0.0
    for variable in names:
        by = central(person, recording, variable, 2e-4 * size(person.variables[variable]), **options)
        window = np.ones(round(0.15 / options["step_s"]))
        near = np.convolve(~by.alike, window)[: len(by.alike)] > 0.5
        events, seen = events + np.count_nonzero(~by.alike), seen + np.mean(~near)
        for key, error in errors(person, sensitivity, variable, by):
            assert error[~near].max() < 0.01, (variable, key)
            assert np.median(error) < 1e-4, (variable, key)
    assert events > 5 and seen > 0.75 * len(names)


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_steps_that_are_cut_carry_sensitivities_through_their_pieces(name):
    setting, values, step_s = SETTINGS[name]
    person, trial = hard_walker(setting)
    options = {"values": values, "fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s,
               "step_s": step_s}
    names = ("offset.height", "contact.forefoot.stiffness", "friction.mu_static", "socket.ty.stiffness")
    walk = person.walk(trial.trajectory, with_respect_to=names, **options)
    assert walk.record.parts.max() > 1 and walk.record.converged.all()
    np.testing.assert_array_equal(walk.record.q, cut_walk(name).record.q)
    for variable in names:
        by = central(person, trial.trajectory, variable, 1e-6 * size(person.variables[variable]), **options)
        same = np.logical_and.accumulate(by.alike)
        assert same[np.flatnonzero(walk.record.parts > 1)[0]], variable
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert error[same].max() < 3e-3, (variable, key)
            assert np.median(error) < 1e-4, (variable, key)


@pytest.mark.parametrize("start_s", [0.0, MID_STANCE_S])
def test_person_who_walks_elsewhere_loads_the_ground_there_and_not_otherwise(walker, motion, start_s):
    """Shifted by a metre forward or to the right: the same force, a metre away (y_W is to the left)."""
    walk = walker("right").walk(motion("right"), fulcrum_m=0.108, start_s=start_s, end_s=END_S, step_s=2e-3,
                                with_respect_to=("coordinate.pelvis_tx", "coordinate.pelvis_tz"))
    by, loaded = walk.sensitivity, ~np.isnan(walk.prosthetic.cop_W[:, 0])
    assert np.count_nonzero(loaded) > 200
    assert np.abs(by.grf_W).max() < 1e-8
    np.testing.assert_allclose(by.cop_W[loaded], np.tile([[1.0, 0.0], [0.0, -1.0]], (loaded.sum(), 1, 1)), atol=1e-9)
    assert np.isnan(by.cop_W[~loaded]).all()
    assert np.abs(by.free_moment_nm).max() < 1e-8


def test_left_prosthesis_depends_on_everything_as_the_right_one_does_in_a_mirror(walker, motion):
    def by(side):
        person = walker(side)
        names = [variable for prefix in FAMILIES for variable in family(person, prefix)]
        return names, person.walk(motion(side), fulcrum_m=0.108, start_s=STRIKE_S, end_s=END_S, step_s=2e-3,
                                  with_respect_to=names).sensitivity

    (names, right), (_, left) = by("right"), by("left")
    for i, name in enumerate(names):
        sign = -1.0 if name in ("coordinate.pelvis_list", "coordinate.pelvis_rotation") else 1.0
        for a, b in ((right.grf_W[..., i], left.grf_W[..., i] * [sign, -sign, sign]),
                     (right.cop_W[..., i], left.cop_W[..., i] * [sign, -sign]),
                     (right.free_moment_nm[:, i], -sign * left.free_moment_nm[:, i])):
            np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-6 * max(np.nanmax(np.abs(a)), 1e-6), err_msg=name)


def test_nothing_depends_on_anything_before_touch_down_nor_on_the_other_leg(walker, motion):
    person = walker("right")
    names = tuple(person.variables)
    walk = person.walk(motion("right"), fulcrum_m=0.108, start_s=0.0, end_s=0.5, step_s=2e-3, with_respect_to=names)
    before = walk.prosthetic.grf_W[:, 2] == 0.0
    assert np.count_nonzero(before) > 20
    assert not walk.sensitivity.grf_W[before].any()
    other = [i for i, name in enumerate(names) if name.startswith("coordinate") and name.endswith("_l")]
    assert len(other) == 9
    assert not walk.sensitivity.grf_W[:, :, other].any()


@pytest.mark.parametrize("name", [name for name, (_, span) in CASES.items() if span["start_s"] == MID_STANCE_S])
def test_rest_does_not_depend_on_what_acts_on_motion_only(walker, motion, name):
    """The start settles: damping and friction have no part in it, everything else has."""
    person, recording, options = case(walker, motion, name)
    walk = person.walk(recording, **options | {"end_s": MID_STANCE_S + options["step_s"]})
    tree = walk.mechanism.tree
    held = np.array([tree.index(name) for name in (*person.gait.prescribed, "fulcrum")])
    names = [name for prefix in FAMILIES for name in family(person, prefix)]
    by = rest_sensitivity(tree, walk.mechanism.forces, held, walk.record.q0,
                          tuple(person.variables[name].edit for name in names),
                          fulcrum=float(walk.fulcrum_m[0]), ground=walk.mechanism.ground_height)
    for i, variable in enumerate(names):
        motion_only = variable.startswith("friction") or variable.endswith(("damping", "damping_depth"))
        assert by[:, i].any() == (not motion_only), variable


@pytest.mark.parametrize("initial", [{}, {"pelvis_ty": 0.0}])
def test_free_coordinates_respond_too(motion, initial):
    """A pelvis that is free to rise and fall: as recorded at the start, or at rest on the prosthesis.

    That rest is not quite reached, since a sticking foot creeps: the same share of a percent at any change.
    """
    person = Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), ModelParameters(),
                    free=("pelvis_ty", "knee_angle_l"))
    recording = motion("right")
    if initial:
        height = recording.sample(MID_STANCE_S)[0][0, recording.names.index("pelvis_ty")]
        initial = {"pelvis_ty": float(height)}
    names = ("contact.forefoot.stiffness", "keel.flexural_modulus", "fulcrum.shift", "offset.height",
             "coordinate.hip_flexion_l", "coordinate.knee_angle_r", "socket.ty.stiffness")
    options = {"fulcrum_m": 0.108, "start_s": MID_STANCE_S, "end_s": 0.55, "step_s": 1e-3, "initial": initial}
    walk = person.walk(recording, with_respect_to=names, **options)
    for variable in names:
        by = central(person, recording, variable, 1e-5 * size(person.variables[variable]), **options)
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert np.abs(exact_series(walk.sensitivity, variable)[key]).max() > 0.0
            assert error.max() < (0.01 if initial else 3e-3), (variable, key)


def test_run_is_the_same_bit_for_bit_whatever_it_is_differentiated_by(walker, motion):
    person, options = walker("right"), {"fulcrum_m": 0.108, "start_s": STRIKE_S, "end_s": 0.5, "step_s": 1e-3}
    names = ("offset.height", "fulcrum.shift", "contact.heel.stiffness")
    plain = person.walk(motion("right"), **options)
    assert plain.sensitivity is None
    some, one = (person.walk(motion("right"), with_respect_to=n, **options) for n in (names, names[1:2]))
    assert some.sensitivity.names == names and one.sensitivity.names == names[1:2]
    for walk in (some, one):
        for key in ("q", "v", "load", "sites", "fulcrum", "iterations"):
            np.testing.assert_array_equal(getattr(walk.record, key), getattr(plain.record, key), err_msg=key)
    np.testing.assert_allclose(some.sensitivity.grf_W[:, :, 1:2], one.sensitivity.grf_W, rtol=1e-12)


@pytest.mark.parametrize(("names", "match"), [
    (("offset.hight",), r"no variable 'offset\.hight'"), (("offset.height", "offset.height"), "twice"),
    (("coordinate.fulcrum",), "no variable")])
def test_unknown_or_repeated_name_is_refused(walker, motion, names, match):
    with pytest.raises(InputError, match=match) as caught:
        walker("right").walk(motion("right"), fulcrum_m=0.108, start_s=0.0, end_s=0.1, with_respect_to=names)
    assert "with_respect_to" in str(caught.value)


def test_free_coordinate_has_no_shift_to_differentiate_by(motion):
    person = Walker(replace(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")),
                    ModelParameters(), free=("pelvis_ty",))
    assert "coordinate.pelvis_ty" not in person.variables
    with pytest.raises(InputError, match=r"no variable 'coordinate\.pelvis_ty'"):
        person.walk(motion("right"), fulcrum_m=0.108, start_s=0.0, end_s=0.1,
                    with_respect_to=("coordinate.pelvis_ty",))
