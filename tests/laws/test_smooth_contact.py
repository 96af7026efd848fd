"""The smooth contact law: no corner left in it, and how far it is from the law that it smooths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from vsf_drake.laws import kelvin_voigt, smooth_contact
from vsf_drake.laws._elementwise import rounded_positive_part
from vsf_drake.laws.contact_law import LawConstants

LAW = {"stiffness": 3e4, "exponent": 1.0, "damping": 300.0, "full_damping_depth": 1e-3}
WIDTHS = {"depth_width": 5e-4, "rate_width": 0.02}


def normal_force(signed_depth, rate, **law):
    site = LawConstants(**law)
    depth, _ = smooth_contact.penetration(signed_depth, site)
    return smooth_contact.normal_force(depth, rate, site)[0]


def test_corner_is_three_sixteenths_of_its_width_too_large_and_exact_beyond_it():
    x = np.array([-0.4, -0.3, 0.0, 0.3, 0.4])
    np.testing.assert_allclose(
        rounded_positive_part(x, 0.3), [0.0, 0.0, 3.0 / 16.0 * 0.3, 0.3, 0.4], atol=1e-17
    )


def test_law_is_the_papers_where_both_corners_are_behind():
    depth, rate = np.array([5e-4, 2e-3]), np.array([0.02, 0.3])
    np.testing.assert_allclose(
        normal_force(depth, rate, **LAW, **WIDTHS),
        kelvin_voigt.normal_force(depth, rate, LawConstants(**LAW))[0],
        rtol=1e-14,
    )
    assert normal_force(-5e-4, 1.0, **LAW, **WIDTHS) == 0.0
    assert normal_force(2e-3, -0.02, **LAW, **WIDTHS) == pytest.approx(3e4 * 2e-3, rel=1e-14)


def test_second_derivative_by_depth_is_continuous_through_touch_down():
    """Second differences change between neighbours in proportion to the step; a jump would not, and
    the paper's law jumps by stiffness / step. The elastic corner's largest bend is 3/4 stiffness /
    width."""

    def bends(step, damping):
        force = normal_force(
            np.arange(-8e-4, 8e-4, step),
            0.0,
            **LAW | {"damping": damping},
            **WIDTHS,
        )
        return np.diff(force, 2) / step**2

    fine, coarse = (np.abs(np.diff(bends(step, 300.0))).max() for step in (1e-6, 8e-6))
    assert fine < coarse / 6.0
    assert np.abs(bends(1e-6, 0.0)).max() <= 1.01 * 0.75 * LAW["stiffness"] / WIDTHS["depth_width"]


def test_strain_is_the_integral_of_the_elastic_force():
    site = LawConstants(**LAW | {"exponent": 1.7}, **WIDTHS)
    for depth in (-6e-4, -3e-4, 1e-4, 5e-4, 4e-3):
        force, energy = smooth_contact.strain(np.array([depth]), site)
        assert force[0] == normal_force(depth, -1.0, **site._asdict())
        pressed = quad(
            lambda x: normal_force(x, -1.0, **site._asdict()),
            -5e-4,
            max(depth, -5e-4),
            points=[min(depth, 5e-4)],
            epsabs=1e-14,
        )[0]
        assert energy[0] == pytest.approx(pressed, rel=1e-7, abs=1e-14)


def test_gradient_by_every_argument(assert_gradient):
    def by(x):
        return normal_force(
            x[:1] * 1e-3,
            x[1:2],
            stiffness=x[2:3] * 1e4,
            exponent=x[3:4],
            damping=x[4:5] * 100.0,
            full_damping_depth=x[5:6] * 1e-3,
            depth_width=x[6:7] * 1e-3,
            rate_width=x[7:8] * 0.01,
        )

    for depth_mm in (-0.2, 0.3, 4.0):
        for rate in (-0.1, 0.01, 0.3):
            assert_gradient(by, [depth_mm, rate, 3.0, 1.2, 3.0, 1.0, 0.5, 2.0], rtol=1e-5)
