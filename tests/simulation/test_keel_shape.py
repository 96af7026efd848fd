"""The keel's shape at rest: beam theory for small loads, the bench's own statics for large ones, balance of moments."""

from __future__ import annotations

import dataclasses

import keel_at_rest
import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.foot import keel_joint_stiffness
from vsf_drake.simulation.bench import keel_shape

FOOT = FootParameters()
POSITIONS_M = (0.066, 0.0905, 0.151)


@pytest.mark.parametrize("fulcrum_m", POSITIONS_M)
def test_small_load_meets_beam_theory(fulcrum_m):
    keel, load = FOOT.keel, 0.01
    stiffness = lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m, support=fulcrum_m, load_point=FOOT.load_point_m,
        fulcrum_stiffness=FOOT.fulcrum.stiffness_n_per_m)
    rise = keel_shape(FOOT, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1]
    assert load / rise == pytest.approx(stiffness, rel=1e-5)


def test_large_load_meets_the_bench_advanced_to_rest():
    loads = np.array([200.0, 600.0])
    for fulcrum_m in (0.066, 0.151):
        own = [keel_shape(FOOT, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1] for load in loads]
        np.testing.assert_allclose(own, keel_at_rest.rises(FOOT, loads, fulcrum_m), rtol=1e-7)


def test_moments_about_the_pin_and_the_first_spring_balance():
    """Of the free body ahead of each: the load's arm and the support's, in the bent shape."""
    load, fulcrum_m = 500.0, 0.108
    shape = keel_shape(FOOT, fulcrum_m=fulcrum_m, load_n=load)
    first = 0.5 * FOOT.keel.element_lengths_m[0]
    second = FOOT.keel.element_lengths_m[0] + 0.5 * FOOT.keel.element_lengths_m[1]
    third = second + FOOT.keel.element_lengths_m[2]
    inclined = np.cumsum(shape.angles)
    x = np.cumsum(np.array([first, second - first, third - second, fulcrum_m - third]) * np.cos(inclined[:4]))
    x_B, x_C = x[3], shape.load_point_K[0]
    assert load * x_C + shape.support_force_n * x_B == pytest.approx(0.0, abs=1e-6)
    ahead = load * (x_C - x[0]) + shape.support_force_n * (x_B - x[0])
    assert ahead == pytest.approx(keel_joint_stiffness(FOOT.keel)[0] * shape.angles[1], rel=1e-9)


def test_the_same_load_bends_less_with_the_fulcrum_ahead_and_lifts_the_toe():
    shapes = [keel_shape(FOOT, fulcrum_m=x, load_n=400.0) for x in np.linspace(0.066, 0.151, 18)]
    rises = [shape.load_point_K[1] for shape in shapes]
    assert np.all(np.diff(rises) < 0.0) and min(rises) > 0.0
    assert all(shape.support_force_n < 0.0 and np.all(shape.angles >= 0.0) for shape in shapes)


def test_no_load_is_no_bending_and_a_very_soft_keel_still_finds_rest():
    assert keel_shape(FOOT, fulcrum_m=0.1, load_n=0.0).angles == pytest.approx(0.0, abs=1e-15)
    soft = dataclasses.replace(FOOT, keel=dataclasses.replace(FOOT.keel, thickness_m=3e-3))
    x, z = keel_shape(soft, fulcrum_m=0.066, load_n=800.0).load_point_K
    assert np.hypot(x, z) < FOOT.load_point_m and z > 0.0


@pytest.mark.parametrize(("place", "said"), [
    ({"fulcrum_m": 0.2, "load_n": 1.0}, "out of the carriage's reach"),
    ({"fulcrum_m": 0.1, "load_n": np.nan}, "no load"),
    ({"fulcrum_m": np.nan, "load_n": 1.0}, "out of the carriage's reach")])
def test_what_has_no_shape_is_refused(place, said):
    with pytest.raises(InputError, match=said):
        keel_shape(FOOT, **place)
