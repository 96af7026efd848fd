"""The keel at rest under a load: beam theory and a chain solved in another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

from vsf_drake.errors import SimulationError
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.bench_stiffness import BenchStiffness

FOOT = FootParameters()
FULCRUMS = (0.066, 0.108, 0.151)
LOADS = np.array([200.0, 600.0])
MODULUS, SUPPORT = FOOT.keel.flexural_modulus_pa, FOOT.fulcrum.stiffness_n_per_m
SECTION = section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m)


def press(fulcrum, modulus=MODULUS, support=SUPPORT, *, loads=LOADS, foot=FOOT):
    """(n,) m, rise of the load point, and (n, 2) its derivatives by modulus and support."""
    foot = replace(foot, keel=replace(foot.keel, flexural_modulus_pa=modulus),
                   fulcrum=replace(foot.fulcrum, stiffness_n_per_m=support))
    shapes = [keel_shape(foot, fulcrum_m=fulcrum, load_n=load) for load in loads]
    return np.array([shape.load_point_K[1] for shape in shapes]), np.array([shape.rise_by for shape in shapes])


@pytest.mark.parametrize("fulcrum", FULCRUMS)
def test_small_loads_meet_the_stiffness_of_the_chain(fulcrum):
    rise, _ = press(fulcrum, loads=[1e-3, 2e-3])
    known = lumped_stiffness(
        bending_stiffness=MODULUS * SECTION, element_lengths=FOOT.keel.element_lengths_m, support=fulcrum,
        load_point=FOOT.load_point_m, fulcrum_stiffness=SUPPORT)
    np.testing.assert_allclose([1e-3, 2e-3] / rise, known, rtol=1e-5)


@pytest.mark.parametrize(("fulcrum", "known"), [(0.066, 11.1), (0.108, 17.9), (0.129, 23.8), (0.151, 32.2)])
def test_fine_keel_bends_as_the_elastica(fulcrum, known):
    """With 47.7 N/mm in series, the numbers of `test_keel`, where the beam's equation is integrated."""
    fine = replace(FOOT, keel=replace(FOOT.keel, element_lengths_m=(0.229 / 64,) * 64))
    low, high = press(fulcrum, 14.84 / SECTION, 1e9, foot=fine)[0]
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
def test_keel_is_where_moments_balance(fulcrum, modulus, support):
    rise, _ = press(fulcrum, modulus * MODULUS, support * SUPPORT)
    known = [balanced_rise(load, fulcrum, modulus * MODULUS, support * SUPPORT) for load in LOADS]
    np.testing.assert_allclose(rise, known, rtol=1e-8)


@pytest.mark.parametrize("fulcrum", FULCRUMS)
def test_derivatives_are_those_of_the_balance(fulcrum):
    """Differences of the chain that is solved in another way."""
    _, by = press(fulcrum, MODULUS, SUPPORT)
    for i, load in enumerate(LOADS):
        for p, step in enumerate(1e-3 * np.array([[MODULUS, 0.0], [0.0, SUPPORT]])):
            more, less = (balanced_rise(load, fulcrum, MODULUS + s * step[0], SUPPORT + s * step[1]) for s in (1, -1))
            assert by[i, p] == pytest.approx((more - less) / (2 * step[p]), rel=1e-5)


@pytest.mark.parametrize("support", [0.17, 0.18, 0.25])
def test_derivatives_are_also_those_of_a_keel_that_all_but_folds_up(support):
    """Where the pin turns by nearly a radian, rest takes many more steps."""
    k = support * SUPPORT
    _, by = press(0.066, MODULUS, k)
    more, less = (press(0.066, MODULUS, k * factor)[0] for factor in (1.0001, 0.9999))
    np.testing.assert_allclose(by[:, 1], (more - less) / (2e-4 * k), rtol=3e-7)


@pytest.mark.parametrize(("modulus", "support"), [
    (1e7, SUPPORT), (1e6, 1e-3), (MODULUS, 0.05 * SUPPORT)])
def test_keel_that_folds_up_is_a_failure_that_says_where(modulus, support):
    machine = BenchStiffness(FOOT, fulcrums_m=(0.066,), heel=False)
    with pytest.raises(SimulationError, match="gives way under 600 N with the fulcrum at 66 mm: "):
        machine.evaluate({"keel.flexural_modulus": modulus, "fulcrum.stiffness": support})
