"""The sagittal person with two intact legs: statics, symmetry, free fall, derivatives, nothing left
of the prosthesis.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import root

from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.anthropometry import DE_LEVA
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import IMAGINARY_STEP, SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker

SMOOTHING = Smoothing(depth_m=0.002)
SWAPPED = [0, 1, 2, 5, 6, 3, 4, 8, 7]  # q of the mirrored motion
GRAVITY = 9.81  # m/s^2


@cache
def _model(walker: Walker) -> SagittalModel:
    return SagittalModel(walker, able_bodied=True)


@pytest.fixture(params=["right", "left"])
def person(request, walker) -> SagittalModel:
    """The walker with the prosthesis on that side as an able-bodied person. Do not change it."""
    return _model(walker(request.param))


def whole(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> list[np.ndarray]:
    """What `evaluate` is given but for the smoothing: q, v, a (9, N) with the design as it is."""
    none = np.zeros((0, q.shape[1]))
    return [q, v, a, none, none, np.repeat(np.array([0.1, 1.0, 0.0, 1.0])[:, None], q.shape[1], 1)]


def drawn(model: SagittalModel, count: int, *, seed: int) -> list[np.ndarray]:
    """Instants in which the lower foot is 3 to 15 mm in the ground; every second one has the other
    lower."""
    rng = np.random.default_rng(seed)
    q, v, a = (size * rng.standard_normal((9, count)) for size in (0.15, 1.0, 5.0))
    q[4, ::2] -= 1.0
    q[6, 1::2] -= 1.0
    q[2] = 1.2
    soles = model.evaluate(*whole(q, v, a), SMOOTHING)[-2:]
    q[2] -= soles.min(axis=0) + rng.uniform(0.003, 0.015, count)
    return whole(q, v, a)


def named(model: SagittalModel, at: list[np.ndarray]) -> dict[str, np.ndarray]:
    return dict(zip(model.outputs, model.evaluate(*at, SMOOTHING), strict=True))


def test_derivatives_are_those_of_complex_steps(person):
    at = drawn(person, 40, seed=1)
    values, by = linearise(person, *at, SMOOTHING)
    sizes = [len(x) for x in at]
    wide = np.repeat(np.concatenate(at)[:, None], sum(sizes), 1).astype(complex)
    each = np.arange(sum(sizes))
    wide[each, each] += 1j * IMAGINARY_STEP
    known = person.evaluate(*np.split(wide, np.cumsum(sizes)[:-1]), SMOOTHING).imag / IMAGINARY_STEP
    np.testing.assert_allclose(
        values, person.evaluate(*at, SMOOTHING), atol=1e-12 * np.abs(values).max()
    )
    largest = np.abs(known).max(axis=(1, 2), keepdims=True)
    assert by.shape == known.shape == (len(person.outputs), 31, 40)
    assert (np.abs(by - known) / np.maximum(largest, 1.0)).max() < 1e-12
    assert not by[:, 27:].any()  # the design


def test_standing_on_both_feet_each_carries_half_of_the_weight_under_the_centre_of_mass(person):
    """Straight on level feet, as deep in the ground and leaning so far forward that the pelvis
    needs no help."""

    def standing(x: np.ndarray) -> list[np.ndarray]:
        q = np.zeros((9, 1))
        q[0], q[2], q[[7, 8]] = x[1], x[0], -x[1]
        return whole(q, 0.0 * q, 0.0 * q)

    def left_over(x: np.ndarray) -> np.ndarray:
        y = named(person, standing(x))
        return np.array([y["balance_pelvis_ty"][0], y["balance_pelvis_tilt"][0]]) / person.weight

    touching = -person.evaluate(*standing(np.zeros(2)), SMOOTHING)[-1, 0]
    found = root(left_over, [touching - 0.005, 0.0], tol=1e-13)
    at = standing(found.x)
    y = {name: float(value[0]) for name, value in named(person, at).items()}
    assert -0.02 < y["prosthetic_sole"] < 0.0
    assert 0.0 < -found.x[1] < 0.1
    for name in person.coordinates[:3]:
        assert y[f"balance_{name}"] == pytest.approx(0.0, abs=1e-8 * person.weight)
    assert y["prosthetic_fz"] + y["intact_fz"] == pytest.approx(
        person.subject.mass_kg * GRAVITY, rel=1e-9
    )
    assert y["prosthetic_fz"] == pytest.approx(y["intact_fz"], rel=1e-12)
    centre = person.motion(*at).H[0].sum() / person.subject.mass_kg
    assert -y["prosthetic_my"] / y["prosthetic_fz"] == pytest.approx(centre, abs=1e-8)
    for joint in ("hip_flexion", "knee_angle", "ankle_angle"):
        assert y[f"torque_{joint}_r"] == pytest.approx(y[f"torque_{joint}_l"], abs=1e-9)
    assert abs(y["torque_ankle_angle_r"]) > 1.0


def test_mirrored_motion_swaps_the_legs(person):
    at = drawn(person, 20, seed=2)
    y, mirrored = named(person, at), named(person, [x[SWAPPED] for x in at[:3]] + at[3:])
    other = {"_r": "_l", "_l": "_r"}
    for name, values in y.items():
        if name in ("prosthesis_power", "stored_energy"):
            continue
        swapped = (
            name[:-2] + other[name[-2:]]
            if name[-2:] in other
            else (
                name.replace("prosthetic", "intact")
                if name.startswith("prosthetic")
                else name.replace("intact", "prosthetic")
            )
        )
        np.testing.assert_allclose(mirrored[swapped], values, rtol=1e-11, atol=1e-9)
    assert np.abs(y["prosthetic_fz"] - y["intact_fz"]).max() > 100.0


def test_intact_leg_is_that_of_the_person_with_the_prosthesis(person, walker):
    at = drawn(person, 20, seed=3)
    side = person.subject.prosthetic_side
    other = SagittalModel(walker(side))
    none = np.zeros((len(other.quasi_static), 20))
    known = dict(
        zip(
            other.outputs,
            other.evaluate(*(x[:8] for x in at[:3]), none, none, at[5], SMOOTHING),
            strict=True,
        )
    )
    names = [
        name
        for name in other.outputs
        if name.startswith("intact")
        or (name.startswith(("torque", "power")) and not name.endswith(f"_{side[0]}"))
    ]
    assert len(names) == 3 + 3 + 4
    for name, values in named(person, at).items():
        if name in names:
            np.testing.assert_allclose(values, known[name], rtol=1e-11, atol=1e-9)


def test_whole_person_has_the_subjects_mass_and_nothing_of_the_prosthesis(walker):
    """Neither side nor mass, offsets and turn of the prosthesis are felt."""
    right = _model(walker("right"))
    subject, parameters = walker("right").subject, ModelParameters()
    table, masses = DE_LEVA[subject.sex], right.dynamics.mass[right.dynamics.link]
    legs = subject.mass_kg * np.array([table.thigh_mass, table.shank_mass, table.foot_mass])
    np.testing.assert_allclose(masses[[3, 4, 8]], legs, rtol=1e-12)
    np.testing.assert_allclose(masses[[5, 6, 7]], legs, rtol=1e-12)
    assert masses.sum() == pytest.approx(subject.mass_kg, rel=1e-12)

    heavy = replace(parameters, socket=replace(parameters.socket, socket_mass_kg=3.0))
    turned = replace(subject, prosthetic_side="left", prosthesis_toe_out_rad=0.1)
    other = SagittalModel(
        Walker(turned, heavy), offsets=GeometricOffsets(height_m=0.01), able_bodied=True
    )
    at = drawn(right, 20, seed=4)
    known = right.evaluate(*at, SMOOTHING)
    np.testing.assert_allclose(
        other.evaluate(*at, SMOOTHING), known, rtol=1e-9, atol=1e-11 * np.abs(known).max()
    )


def test_falling_freely_takes_no_torque(person):
    """Nor has a body that falls a weight to be carried, at whatever angles."""
    q, v, a = (
        0.5 * np.random.default_rng(5).standard_normal((9, 20)),
        np.zeros((9, 20)),
        np.zeros((9, 20)),
    )
    q[2], v[1:3], a[2] = 10.0, 3.0, -GRAVITY
    y = person.evaluate(*whole(q, v, a), SMOOTHING)
    np.testing.assert_allclose(y[:-2], 0.0, atol=1e-9)
    a[2] = 0.0
    still = named(person, whole(q, v, a))
    np.testing.assert_allclose(still["balance_pelvis_ty"], person.weight, rtol=1e-12)


def test_power_below_the_shank_is_of_its_own_leg(person):
    """As only the knee of that leg and its ankle turn: the knee's rate times what the ground
    changes in its torque."""
    q, v, a, *rest = drawn(person, 20, seed=6)
    own = [4, 8]
    v[[i for i in range(9) if i not in own]] = 0.0
    lifted = q.copy()
    lifted[2] += 10.0
    y, free = (named(person, [x, v, a, *rest]) for x in (q, lifted))
    knee = f"torque_{person.coordinates[4]}"
    np.testing.assert_allclose(
        y["prosthesis_power"], v[4] * (free[knee] - y[knee]), rtol=1e-9, atol=1e-8
    )
    assert np.abs(y["prosthesis_power"]).max() > 100.0
