"""Torques on free coordinates do what torques do, and what was measured on a held motion moves a free one alike."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from cut_walks import inputs_of
from differences import central, errors, exact_series, size

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.reactions import INPUTS
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.walk import AppliedTorques, Walker, torques_on_grid

SWING = ("hip_flexion_l", "knee_angle_l", "ankle_angle_l")
"""Flexion of the leg that the made motion keeps in the air."""
SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
SPAN = {"fulcrum_m": 0.108, "start_s": 0.0}


@cache
def person(*free):
    return Walker(SUBJECT, ModelParameters(), free=free)


@pytest.fixture(scope="module")
def recording(motion):
    return motion("right")


@pytest.fixture(scope="module")
def still(recording):
    """The pose in which the motion begins, both feet in the air, held; knees bent."""
    q, _, _ = recording.sample(0.0)
    return CoordinateTrajectory(np.linspace(0.0, 1.0, 11), np.repeat(q, 11, axis=0), recording.names)


def columns(walk, names):
    return [walk.mechanism.tree.index(name) for name in names]


def held_loads(motion, step_s, end_s):
    """Instants at which steps start, and loads (n, 3) that hold the swing leg over them."""
    walk = person().walk(motion, end_s=end_s, step_s=step_s, **SPAN)
    return walk.record.time_s - step_s, walk.record.load[:, columns(walk, SWING)]


def test_torque_accelerates_as_the_plants_mass_matrix_says(recording):
    """One step from the same state with and without torques: the change of velocity is h M^-1 tau.

    The pelvis is held, so that the swing leg has no part in what socket and keel do.
    """
    walker, torque = person(*SWING), np.array([7.0, -3.0, 0.5])
    with_torque, without = (
        walker.walk(recording, end_s=1e-3, step_s=1e-3, **SPAN, applied=applied)
        for applied in (AppliedTorques(SWING, np.tile(torque, (1, 1))), None))
    rows, plant = columns(without, SWING), walker.gait.plant
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, without.record.q0)
    M = plant.CalcMassMatrix(context)[np.ix_(rows, rows)]
    change = with_torque.record.v[0, rows] - without.record.v[0, rows]
    np.testing.assert_allclose(change, 1e-3 * np.linalg.solve(M, torque), rtol=1e-8)
    np.testing.assert_array_equal(with_torque.applied, [torque])
    np.testing.assert_allclose(with_torque.record.load[0, rows], torque, atol=1e-3)
    np.testing.assert_allclose(without.record.load[0, rows], 0.0, atol=1e-3)


def test_torques_work_is_found_as_energy(still):
    """The leg thrown about by constant torques: the balance closes to first order in the step."""
    left = []
    for step_s in (1e-3, 5e-4):
        applied = AppliedTorques(SWING, lambda t: np.tile([30.0, 5.0, 1.0], (len(t), 1)))
        walker = person(*SWING)
        walk = walker.walk(still, end_s=0.2, step_s=step_s, **SPAN, applied=applied)
        energy = walker._ledger(walk)
        assert energy["driver_work"][-1] > 3.0
        total = sum(abs(energy[name][-1]) for name in INPUTS)
        left.append(abs(energy["remainder"][-1]) / total)
    assert left[0] < 0.02
    assert left[1] == pytest.approx(0.5 * left[0], rel=0.2)


def test_load_of_a_held_motion_moves_the_free_leg_the_same_way(recording):
    """The same equations solved for the motion instead of the load: equal but for what Newton's method leaves."""
    motion, end_s = recording, 0.6
    _, load = held_loads(motion, 1e-3, end_s)
    held = person().walk(motion, end_s=end_s, step_s=1e-3, **SPAN)
    free = person(*SWING).walk(motion, end_s=end_s, step_s=1e-3, **SPAN, applied=AppliedTorques(SWING, load))
    np.testing.assert_allclose(free.record.q, held.record.q, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(free.record.load[:, columns(free, SWING)], load, atol=1e-3)


def test_load_found_in_fine_steps_moves_the_leg_in_coarse_ones_to_first_order(recording):
    motion, end_s, off = recording, 0.3, []
    time_s, load = held_loads(motion, 1.25e-4, end_s)
    later = np.append(time_s, end_s)
    whole = np.cumsum(np.vstack([np.zeros(3), load]), axis=0) * 1.25e-4

    def mean(start):
        step = start[1] - start[0]
        return np.column_stack([(np.interp(start + step, later, w) - np.interp(start, later, w)) / step
                                for w in whole.T])

    for step_s in (1e-3, 5e-4):
        free = person(*SWING).walk(motion, end_s=end_s, step_s=step_s, **SPAN, applied=AppliedTorques(SWING, mean))
        wanted = motion.ordered(SWING).sample(free.record.time_s)[0]
        off.append(np.abs(free.record.q[:, columns(free, SWING)] - wanted).max())
    assert off[0] < np.radians(1.0)
    assert off[1] == pytest.approx(0.5 * off[0], rel=0.25)


def test_feedback_brings_a_displaced_knee_back_as_a_damped_oscillator(still):
    """e'' + 2 w e' + w^2 e = 0 from rest: e = e0 (1 + w t) exp(-w t), with gains w^2 M and 2 w M."""
    knee, w, e0, step_s = ("knee_angle_l",), 60.0, 0.02, 2.5e-4
    away = still.values + e0 * (np.array(still.names) == "knee_angle_l")
    displaced = CoordinateTrajectory(still.time_s, away, still.names)
    walker = person(*knee)
    holding = person().walk(still, end_s=0.1, step_s=step_s, **SPAN).record.load[-1]
    row = columns(walker.walk(still, end_s=1e-3, **SPAN), knee)
    plant = walker.gait.plant
    context = plant.CreateDefaultContext()
    for name, value in zip(still.names, still.values[0], strict=True):
        joint = plant.GetJointByName(name)
        (joint.set_angle if hasattr(joint, "set_angle") else joint.set_translation)(context, value)
    M = plant.CalcMassMatrix(context)[row[0], row[0]]
    at = still.ordered(knee).values[0, 0]
    applied = AppliedTorques(
        knee, lambda t: np.full((len(t), 1), holding[row]), gain=lambda t: np.tile([[[w * w * M, 2.0 * w * M]]],
                                                                                   (len(t), 1, 1)),
        reference=lambda t: np.tile([at, 0.0], (len(t), 1)))
    walk = walker.walk(displaced, end_s=0.15, step_s=step_s, **SPAN, applied=applied)
    t = walk.record.time_s
    # Gravity, some 10 N m/rad beside 700, and the hold over a step make the difference.
    np.testing.assert_allclose(walk.record.q[:, row[0]] - at, e0 * (1.0 + w * t) * np.exp(-w * t), atol=0.03 * e0)
    q = np.append(walk.record.q0[row], walk.record.q[:-1, row[0]])
    v = np.append(walk.record.v0[row], walk.record.v[:-1, row[0]])
    np.testing.assert_allclose(walk.applied[:, 0], holding[row] - w * w * M * (q - at) - 2.0 * w * M * v, atol=1e-9)


@pytest.fixture(scope="module")
def tracking(recording):
    """A prosthetic knee and hip that follow the recording by feedback alone, through stance."""
    names = ("hip_flexion_r", "knee_angle_r")
    motion = recording.ordered(names)

    def reference(t):
        q, v, _ = motion.sample(t)
        return np.column_stack([q, v])

    gain = np.hstack([np.diag([4000.0, 3000.0]), np.diag([150.0, 60.0])])
    return person(*names), AppliedTorques(
        names, lambda t: np.zeros((len(t), 2)), gain=lambda t: np.tile(gain, (len(t), 1, 1)), reference=reference)


def test_sensitivities_know_the_feedback(recording, tracking):
    walker, applied = tracking
    options = {"fulcrum_m": 0.108, "start_s": 0.1, "end_s": 0.6, "step_s": 1e-3, "applied": applied}
    names = ("fulcrum.shift", "contact.heel.stiffness", "offset.height", "coordinate.pelvis_ty")
    walk = walker.walk(recording, with_respect_to=names, **options)
    assert walk.prosthetic.grf_W[:, 2].max() > 300.0
    for variable in names:
        by = central(walker, recording, variable, 1e-5 * size(walker.variables[variable]), **options)
        assert by.alike.all()
        for key, error in errors(walker, walk.sensitivity, variable, by):
            assert np.nanmax(np.abs(exact_series(walk.sensitivity, variable)[key])) > 0.0
            assert error.max() < 1e-3 and np.median(error) < 1e-5, (variable, key)


def test_drakes_dynamics_take_the_same_torques(recording, tracking):
    walker, applied = tracking
    walk = walker.walk(recording, fulcrum_m=0.108, start_s=0.1, end_s=0.2, applied=applied)
    moments = np.concatenate([[0.1], walk.record.time_s])
    torques = torques_on_grid(applied, free=walker.free, moments=moments,
                              coordinate_names=walk.mechanism.tree.coordinate_names)
    inputs = dataclasses.replace(inputs_of(walk, walker), torques=torques)
    record = Stepper(walk.mechanism, dynamics="drake").run(inputs, walk.record.q0, walk.record.v0)
    np.testing.assert_allclose(record.q, walk.record.q, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(record.applied, walk.applied, rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(record.load, walk.record.load, rtol=0.0, atol=1e-2)


def test_torque_of_zero_is_none(recording):
    walker = person(*SWING)
    some, none = (walker.walk(recording, end_s=0.2, **SPAN, applied=applied)
                  for applied in (AppliedTorques(SWING, np.zeros((200, 3))), None))
    for key in ("q", "v", "load", "sites"):
        np.testing.assert_array_equal(getattr(some.record, key), getattr(none.record, key))
    assert none.applied.shape == (200, 0) and none.applied_names == ()


ZERO = np.zeros((100, 1))


@pytest.mark.parametrize(("applied", "match"), [
    (AppliedTorques(("knee_angle_r",), ZERO), "'knee_angle_r' is not a free coordinate.*Free are: hip_flexion_l"),
    (AppliedTorques(("knee_angle_l", "knee_angle_l"), ZERO), "stands twice"),
    (AppliedTorques("knee_angle_l", ZERO), "no list of names"),
    (AppliedTorques(("knee_angle_l",), np.zeros((99, 1))), r"applied.feedforward.*\(99, 1\).*\(100, 1\)"),
    (AppliedTorques(("knee_angle_l",), ZERO + np.nan), "applied.feedforward.*not finite at 0 s"),
    (AppliedTorques(("knee_angle_l",), ZERO, gain=np.zeros((100, 1, 6))), "both a gain and a reference"),
    (AppliedTorques(("knee_angle_l",), ZERO, np.zeros((100, 1, 2)), np.zeros((100, 2))), r"\(100, 1, 6\)"),
    ({"knee_angle_l": ZERO}, "no AppliedTorques")])
def test_torques_without_meaning_are_refused(applied, match, recording):
    with pytest.raises(InputError, match=match):
        person(*SWING).walk(recording, end_s=0.1, **SPAN, applied=applied)
