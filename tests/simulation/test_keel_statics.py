"""The keel at rest under a load: beam theory, a chain solved in another way, and no trace of the path there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

from vsf_drake.errors import SimulationError
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench_stiffness import KeelStatics

FOOT = FootParameters()
FULCRUMS = (0.066, 0.108, 0.151)
LOADS = np.array([200.0, 600.0])
MODULUS, SUPPORT = FOOT.keel.flexural_modulus_pa, FOOT.fulcrum.stiffness_n_per_m
SECTION = section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m)


@pytest.fixture(scope="module")
def keel():
    return KeelStatics(FOOT, LOADS, 0.5)


@pytest.mark.parametrize("fulcrum", FULCRUMS)
def test_small_loads_meet_the_stiffness_of_the_chain(fulcrum):
    rise, _ = KeelStatics(FOOT, np.array([1e-3, 2e-3]), 0.5).press(fulcrum, MODULUS, SUPPORT)
    known = lumped_stiffness(
        bending_stiffness=MODULUS * SECTION, element_lengths=FOOT.keel.element_lengths_m, support=fulcrum,
        load_point=FOOT.load_point_m, fulcrum_stiffness=SUPPORT)
    np.testing.assert_allclose([1e-3, 2e-3] / rise, known, rtol=1e-5)


@pytest.mark.parametrize(("fulcrum", "known"), [(0.066, 11.1), (0.108, 17.9), (0.129, 23.8), (0.151, 32.2)])
def test_fine_keel_bends_as_the_elastica(fulcrum, known):
    """With 47.7 N/mm in series, the numbers of `test_keel`, where the beam's equation is integrated."""
    fine = replace(FOOT, keel=replace(FOOT.keel, element_lengths_m=(0.229 / 64,) * 64))
    low, high = KeelStatics(fine, LOADS, 0.5).press(fulcrum, 14.84 / SECTION, 1e9)[0]
    assert 0.4 / (high - low + 0.4 / 47.7) == pytest.approx(known, abs=0.07)


def balanced_rise(load, fulcrum, modulus, support):
    """Rise (m) of the load point of a planar chain: joints (rad) and the pin such that moments balance.

    Load and support push along z on points that stay where they are on the chain.
    """
    lengths = np.array(FOOT.keel.element_lengths_m)
    starts = np.append(0.0, np.cumsum(lengths) - 0.5 * lengths)
    joints = modulus * SECTION / np.append(np.inf, lengths)

    def place(turns, x):
        """(2,) m of the point x from A, and its rise by each turn."""
        body = np.searchsorted(starts, x, side="right") - 1
        pieces = np.append(np.diff(starts[: body + 1]), x - starts[body])
        angles = np.cumsum(turns)[: body + 1]
        by_turn = np.cumsum((pieces * np.cos(angles))[::-1])[::-1]
        return pieces @ np.sin(angles), np.append(by_turn, np.zeros(len(turns) - body - 1))

    def moments(turns):
        by_load, (sunk, by_support) = place(turns, FOOT.load_point_m)[1], place(turns, fulcrum)
        return load * by_load - support * sunk * by_support - joints * turns

    start = np.full(len(starts), load * FOOT.load_point_m / 2e4)
    found = root(moments, start, tol=1e-14, options={"xtol": 1e-14})
    assert np.abs(moments(found.x)).max() < 1e-9
    return place(found.x, FOOT.load_point_m)[0]


@pytest.mark.parametrize(("modulus", "support"), [(1.0, 1.0), (0.5, 2.0), (2.0, 0.3)])
@pytest.mark.parametrize("fulcrum", FULCRUMS)
def test_keel_is_where_moments_balance(keel, fulcrum, modulus, support):
    rise, _ = keel.press(fulcrum, modulus * MODULUS, support * SUPPORT)
    known = [balanced_rise(load, fulcrum, modulus * MODULUS, support * SUPPORT) for load in LOADS]
    np.testing.assert_allclose(rise, known, rtol=1e-8)


@pytest.mark.parametrize("fulcrum", FULCRUMS)
def test_derivatives_are_those_of_the_balance(keel, fulcrum):
    """Differences of the chain that is solved in another way."""
    _, by = keel.press(fulcrum, MODULUS, SUPPORT)
    for i, load in enumerate(LOADS):
        for p, step in enumerate(1e-3 * np.array([[MODULUS, 0.0], [0.0, SUPPORT]])):
            more, less = (balanced_rise(load, fulcrum, MODULUS + s * step[0], SUPPORT + s * step[1]) for s in (1, -1))
            assert by[i, p] == pytest.approx((more - less) / (2 * step[p]), rel=1e-5)


@pytest.mark.parametrize("support", [0.17, 0.18, 0.25])
def test_derivatives_are_also_those_of_a_keel_that_all_but_folds_up(keel, support):
    """Where the pin turns by nearly a radian, rest takes many more steps."""
    k = support * SUPPORT
    _, by = keel.press(0.066, MODULUS, k)
    more, less = (keel.press(0.066, MODULUS, k * factor)[0] for factor in (1.0001, 0.9999))
    np.testing.assert_allclose(by[:, 1], (more - less) / (2e-4 * k), rtol=3e-7)


@pytest.mark.parametrize("steps_per_mm", [0.02, 5.0])
def test_path_to_a_load_does_not_matter(keel, steps_per_mm):
    for fulcrum in FULCRUMS:
        found = KeelStatics(FOOT, LOADS, steps_per_mm).press(fulcrum, MODULUS, SUPPORT)
        for a, b in zip(found, keel.press(fulcrum, MODULUS, SUPPORT), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-8)


@pytest.mark.parametrize("alone", LOADS)
def test_load_put_on_alone_finds_the_same_rest(keel, alone):
    row = list(LOADS).index(alone)
    found = KeelStatics(FOOT, np.array([alone]), 0.5).press(0.066, MODULUS, SUPPORT)
    for a, b in zip(found, keel.press(0.066, MODULUS, SUPPORT), strict=True):
        np.testing.assert_allclose(a[0], b[row], rtol=1e-8)


@pytest.mark.parametrize(("modulus", "support"), [
    (1e7, SUPPORT), (1e6, 1e-3), (MODULUS, 0.05 * SUPPORT)])
def test_keel_that_folds_up_is_a_failure_that_says_where(keel, modulus, support):
    with pytest.raises(SimulationError, match="gives way under 600 N with the fulcrum at 66 mm: coordinate keel"):
        keel.press(0.066, modulus, support)
