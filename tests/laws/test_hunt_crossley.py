"""Hunt and Crossley's contact: what it loses, and that the matched dissipation loses what the
paper's law loses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from vsf_drake.laws import hunt_crossley, kelvin_voigt
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.hunt_crossley import matched_dissipation

SPHERE = {"stiffness": 3e4, "exponent": 1.0}


def normal_force(depth, rate, **law):
    return hunt_crossley.normal_force(depth, rate, LawConstants(**law))[0]


def test_damping_grows_with_the_elastic_force_and_never_pulls():
    force = normal_force(
        2e-3, np.array([0.0, 0.5, -0.5, -1.25, -9.0]), stiffness=3e5, exponent=1.5, dissipation=0.8
    )
    np.testing.assert_allclose(
        force, 3e5 * 2e-3**1.5 * np.array([1.0, 1.4, 0.6, 0.0, 0.0]), atol=1e-12
    )
    assert normal_force(0.0, 3.0, **SPHERE, dissipation=0.8) == 0.0


@pytest.mark.parametrize("exponent", [1.0, 1.5, 7.66])
def test_matched_dissipation_loses_in_a_stroke_what_the_papers_law_loses(exponent):
    """Half-sine depth, slow enough that no force is cut off at zero. Below its full-damping depth,
    a 600th of the stroke, the paper's law loses less than full damping would: 4 / pi times a 1200th
    of the whole."""
    depth, w, b = 6e-3, 0.2, 250.0
    k = 400.0 * depth**-exponent
    dissipation = matched_dissipation(stiffness=k, exponent=exponent, damping=b, depth=depth)[0]

    def loss(force):
        return quad(
            lambda t: (
                force(depth * np.sin(w * t), depth * w * np.cos(w * t)) * depth * w * np.cos(w * t)
            ),
            0.0,
            np.pi / w,
            points=[0.5 * np.pi / w],
            limit=400,
            epsabs=1e-12,
        )[0]

    matched = loss(
        lambda x, v: float(
            normal_force(x, v, stiffness=k, exponent=exponent, dissipation=dissipation)
        )
    )
    paper = loss(
        lambda x, v: float(
            kelvin_voigt.normal_force(
                x,
                v,
                LawConstants(stiffness=k, exponent=exponent, damping=b, full_damping_depth=1e-5),
            )[0]
        )
    )
    assert matched == pytest.approx(0.25 * np.pi * b * depth**2 * w, rel=1e-8)
    assert matched == pytest.approx(paper, rel=4.0 / np.pi / 1200.0 * 1.01)
    for nothing in ("stiffness", "damping"):
        law = {"stiffness": k, "exponent": exponent, "damping": b, "depth": depth} | {nothing: 0.0}
        assert matched_dissipation(**law)[0] == 0.0
    law = {"stiffness": k, "exponent": exponent, "damping": b}
    for name, slope in zip(law, matched_dissipation(**law, depth=depth)[1:], strict=True):
        step = 1e-6 * law[name]
        low, high = (
            matched_dissipation(**law | {name: law[name] + side * step}, depth=depth)[0]
            for side in (-1.0, 1.0)
        )
        assert slope == pytest.approx((high - low) / (2.0 * step), rel=1e-7)


def test_gradient_by_every_argument_and_finite_at_touch_down(assert_gradient, autodiff_gradient):
    def by(x):
        return normal_force(
            x[:1] * 1e-3, x[1:2], stiffness=x[2:3] * 1e5, exponent=x[3:4], dissipation=x[4:5]
        )

    for rate in (0.4, -0.4):
        assert_gradient(by, [4.0, rate, 1.3, 1.5, 0.7], rtol=1e-6)
    for rate in (0.0, 1.0, -2.0):
        assert np.all(np.isfinite(autodiff_gradient(by, [0.0, rate, 0.1, 1.0, 0.5])))
