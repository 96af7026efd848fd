"""Loads of joints and socket, and the state, differentiated: central differences, and what mechanics says of them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from cut_walks import SETTINGS, hard_walker
from differences import branches, size

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation import walk as walk_module
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.variables import Course
from vsf_drake.simulation.walk import AppliedTorques, Walker

NAMES = ("fulcrum.shift", "fulcrum.stiffness", "keel.flexural_modulus", "contact.forefoot.stiffness",
         "contact.heel.stiffness", "contact.heel.damping", "contact.forefoot.rise", "friction.mu_static",
         "friction.threshold_velocity", "socket.tz.stiffness", "socket.flexion.stiffness", "socket.tx.stiffness",
         "offset.alignment", "offset.height", "offset.fore_aft")
OPTIONS = {"fulcrum_m": 0.1, "start_s": 0.1, "end_s": 0.8, "step_s": 1e-3, "support_width_m": 6e-3}
"""From just before touch-down to toe-off, the support on two pieces of the keel."""
SIDES = {"right": "_r", "left": "_l"}


@pytest.fixture(autouse=True)
def exact_steps(monkeypatch):
    """Newton's method to the last digits: a difference of loads sees what it leaves, over the step's square."""
    monkeypatch.setattr(walk_module, "Stepper", partial(Stepper, tolerance=1e-12))


def series(walk):
    """name -> (n, k) what a `LoadSensitivity` differentiates."""
    return {"load": walk.record.load, "socket": walk.socket_wrench, "q": walk.record.q, "v": walk.record.v}


def driven(person, walk):
    """Coordinates that have a load."""
    names = (*person.gait.prescribed, "fulcrum", *walk.applied_names)
    return [walk.mechanism.tree.index(name) for name in names]


def assert_differences_agree(person, recording, names, options, *, change=3e-6):
    """Each column within 1e-5 of its largest, where both ends are on the same branches of all laws.

    A column that hardly depends on the variable, by less than a 1e-3rd of the one that does most (of the state, a
    1e-2nd), is held against that: differences end at what two runs leave of sixteen digits.
    """
    base = person.walk(recording, with_respect_to=names, with_loads=True, **options)
    found = base.load_sensitivity
    assert found.names == tuple(names)
    loaded = np.isin(np.arange(base.record.q.shape[1]), driven(person, base))
    assert not found.load[:, ~loaded].any()
    for p, name in enumerate(names):
        step = change * size(person.variables[name])
        ends = [person.walk(recording, values={name: person.variables[name].default + sign * step}, **options)
                for sign in (-1.0, 1.0)]
        alike = np.all(branches(ends[0]) == branches(ends[1]), axis=1)
        assert alike.mean() > 0.9, name
        low, high = (series(walk) for walk in ends)
        for key, one in low.items():
            by = ((high[key] - one) / (2.0 * step))[alike]
            exact = getattr(found, key)[alike, :, p]
            if key == "load":
                by, exact = by[:, loaded], exact[:, loaded]
            largest = np.abs(exact).max(axis=0)
            assert largest.max() > 0.0, (name, key)
            scale = np.maximum(largest, (1e-2 if key in "qv" else 1e-3) * largest.max())
            assert (np.abs(exact - by) / scale).max() < 1e-5, (name, key)
    return base


@pytest.mark.parametrize("side", SIDES)
def test_differences_of_walks_lead_to_the_derivatives(walker, motion, side):
    walk = assert_differences_agree(walker(side), motion(side), NAMES, OPTIONS)
    assert walk.prosthetic.grf_W[:, 2].max() > 500.0
    knee = walk.mechanism.tree.index(f"knee_angle{SIDES[side]}")
    other = walk.mechanism.tree.index(f"knee_angle{SIDES['left' if side == 'right' else 'right']}")
    assert np.abs(walk.load_sensitivity.load[:, knee, 0]).max() > 100.0
    assert not walk.load_sensitivity.load[:, other].any()


def test_rows_that_free_coordinates_move_and_torques_with_feedback_too(motion):
    """A pelvis that rises and falls and swings, and a prosthetic knee that follows the recording by feedback."""
    free = ("pelvis_tilt", "pelvis_ty", "knee_angle_r")
    person = Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), ModelParameters(),
                    free=free)
    recording = motion("right").ordered(free)
    gain = np.hstack([np.diag([3000.0, 3e4, 3000.0])[2:], np.diag([100.0, 1e3, 60.0])[2:]])
    applied = AppliedTorques(("knee_angle_r",), lambda t: np.zeros((len(t), 1)),
                             gain=lambda t: np.tile(gain, (len(t), 1, 1)),
                             reference=lambda t: np.hstack(recording.sample(t)[:2]))
    options = OPTIONS | {"end_s": 0.5, "applied": applied}
    walk = assert_differences_agree(person, motion("right"), NAMES, options, change=1e-5)
    rows = [walk.mechanism.tree.index(name) for name in ("hip_flexion_l", "ankle_angle_l", "knee_angle_r")]
    assert np.all(np.abs(walk.load_sensitivity.load[:, rows]).max(axis=(0, 2)) > 0.0)


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_load_of_a_step_that_was_cut_is_the_mean_of_its_pieces_derivatives_too(name):
    setting, values, step_s = SETTINGS[name]
    person, trial = hard_walker(setting)
    options = {"values": values, "fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s,
               "step_s": step_s}
    variable, change = "socket.ty.stiffness", 1e-6 * person.variables["socket.ty.stiffness"].default
    walk = person.walk(trial.trajectory, with_respect_to=(variable,), with_loads=True, **options)
    at = values.get(variable, person.variables[variable].default)
    low, high = (person.walk(trial.trajectory, **options | {"values": values | {variable: at + sign * change}})
                 for sign in (-1.0, 1.0))
    same = np.logical_and.accumulate(np.all(branches(low) == branches(high), axis=1))
    cut = same & (walk.record.parts > 1)
    assert cut.any()
    rows = driven(person, walk)
    by, exact = (high.record.load - low.record.load)[:, rows] / (2.0 * change), walk.load_sensitivity.load[:, rows, 0]
    assert np.abs(by - exact)[cut].max() < 1e-4 * np.abs(exact[same]).max()


def test_at_rest_the_pelvis_takes_what_the_ground_does_not(walker, motion):
    """A pose of mid-stance held: whatever loads the foot more unloads the pelvis by the same force.

    What acts on motion only is left out: it changes nothing at rest."""
    q, _, _ = motion("right").sample(0.4)
    held = CoordinateTrajectory(np.linspace(0.0, 1.0, 11), np.repeat(q, 11, axis=0), motion("right").names)
    walk = walker("right").walk(held, fulcrum_m=0.1, start_s=0.0, end_s=1.0, step_s=2e-3, with_respect_to=NAMES,
                                with_loads=True)
    tree, by, ground = walk.mechanism.tree, walk.load_sensitivity, walk.sensitivity.grf_W[-1]
    elastic = [i for i, name in enumerate(NAMES) if "friction" not in name and "damping" not in name]
    for name, force in (("pelvis_tx", ground[0]), ("pelvis_ty", ground[2]), ("pelvis_tz", -ground[1])):
        left = by.load[-1, tree.index(name)] + force
        np.testing.assert_allclose((left / np.abs(ground[2]))[elastic], 0.0, atol=1e-5, err_msg=name)


def test_asking_for_loads_changes_nothing_else(walker, motion):
    plain, loads = (walker("right").walk(motion("right"), with_respect_to=NAMES, with_loads=asked, **OPTIONS)
                    for asked in (False, True))
    assert plain.load_sensitivity is None and plain.record.load_by.shape[0] == 0
    for key in ("q", "v", "load", "sites", "wrench_by"):
        np.testing.assert_array_equal(getattr(plain.record, key), getattr(loads.record, key))
    assert walker("right").walk(motion("right"), with_loads=True, **OPTIONS).load_sensitivity is None


def test_variables_that_move_prescribed_coordinates_are_refused(walker, motion):
    course = Course("bend", "knee_angle_r", lambda t: t)
    for name in ("coordinate.knee_angle_r", "course.bend"):
        with pytest.raises(InputError, match=f"not differentiated by {name}"):
            walker("right").walk(motion("right"), courses=(course,), with_respect_to=(name,), with_loads=True,
                                 **OPTIONS)
