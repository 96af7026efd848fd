from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from vsf_drake.laws.beam import (
    combined_stiffness,
    lumped_stiffness,
    overhung_stiffness,
    section_inertia,
    taper,
)

SUPPORTS = np.array([0.066, 0.087, 0.108, 0.129, 0.151])
LOAD_POINT, KEEL = 0.199, 0.229
PAPER_LAYOUT = (0.066,) + (0.163 / 7,) * 7


def compliance_error_percent(lengths, rigid_length=0.0):
    """Of the chain against the closed form, at each support."""
    errors = []
    for support in SUPPORTS:
        beam = {"bending_stiffness": 27.1, "support": support, "load_point": LOAD_POINT}
        chain = lumped_stiffness(**beam, element_lengths=lengths, rigid_length=rigid_length)
        errors.append(100.0 * (overhung_stiffness(**beam) / chain - 1.0))
    return np.array(errors)


def test_closed_form_equals_the_integral_of_the_bending_moment():
    """Castigliano: the deflection per unit load is the integral of M² / (E I)."""
    for support in SUPPORTS:
        a = LOAD_POINT - support
        span = quad(lambda x, a=a, support=support: (a * x / support) ** 2, 0.0, support)[0]
        overhang = quad(lambda x: (LOAD_POINT - x) ** 2, support, LOAD_POINT)[0]
        stiffness = overhung_stiffness(
            bending_stiffness=27.1, support=support, load_point=LOAD_POINT
        )
        assert 1.0 / stiffness == pytest.approx((span + overhang) / 27.1, rel=1e-12)


@pytest.mark.parametrize(
    ("bending", "springs", "expected"),
    [
        (11.73, {}, [10.0, 14.1, 21.4, 36.1, 76.8]),
        (4.89, {}, [4.2, 5.9, 8.9, 15.0, 32.0]),
        (14.84, {"series_stiffness": 1e3 / 0.02095}, [10.0, 13.0, 17.3, 23.3, 32.0]),
        (
            27.1,
            {"fulcrum_stiffness": 236e3, "series_stiffness": 54.8e3},
            [10.0, 14.1, 18.9, 24.8, 32.0],
        ),
    ],
)
def test_published_ends_are_reached_by_compliance_in_series_and_not_by_a_uniform_beam_alone(
    bending, springs, expected
):
    assert 18.6e9 * section_inertia(0.0684, 0.00635) == pytest.approx(27.1, abs=0.05)
    stiffness = combined_stiffness(
        bending_stiffness=bending, support=SUPPORTS, load_point=LOAD_POINT, **springs
    )
    np.testing.assert_allclose(1e-3 * stiffness, expected, atol=0.06)


@pytest.mark.parametrize(
    ("lengths", "rigid", "expected"),
    [
        ((KEEL / 8,) * 8, 0.0, [0.4, -2.1, -0.8, 4.3, -0.5]),
        (PAPER_LAYOUT, 0.0, [-8.8, -5.4, -3.5, -1.9, -0.5]),
        ((0.163 / 7,) * 7, 0.066, [-33.7, -19.8, -12.8, -8.4, -5.3]),
        ((KEEL / 2000,) * 2000, 0.0, [0.0] * 5),
    ],
    ids=["8 equal", "66 mm + 7", "rigid 66 mm + 7", "the beam in the limit"],
)
def test_chain_has_the_known_compliance_error(lengths, rigid, expected):
    np.testing.assert_allclose(
        np.round(compliance_error_percent(lengths, rigid), 1), expected, atol=1e-12
    )


def test_chain_equals_the_statics_of_its_joints():
    """Second method: springs in static equilibrium, pin at A and support at B solved for."""
    lengths = np.array(PAPER_LAYOUT)
    joints = np.cumsum(lengths) - 0.5 * lengths
    for support in SUPPORTS:

        def arms(x):
            # height at x per unit of pin and joint angles
            return np.concatenate(([x], np.maximum(x - joints, 0.0)))

        springs = np.diag(np.concatenate(([0.0], 27.1 / lengths)))
        b, c = arms(support), arms(LOAD_POINT)
        system = np.block([[springs, -b[:, None]], [b[None, :], np.zeros((1, 1))]])
        angles = np.linalg.solve(system, np.append(c, 0.0))[:-1]
        chain = lumped_stiffness(
            bending_stiffness=27.1,
            element_lengths=PAPER_LAYOUT,
            support=support,
            load_point=LOAD_POINT,
        )
        assert 1.0 / chain == pytest.approx(c @ angles, rel=1e-10)


def test_a_tapered_plate_bends_as_the_cube_of_its_thickness():
    x = np.linspace(0.0, KEEL, 50)
    thickness = np.interp(x, [0.1, KEEL], [1.0, 0.7])
    np.testing.assert_allclose(taper(x, start=0.1, end=KEEL, tip=0.7**3), thickness**3, rtol=1e-12)
    assert np.all(taper(x, start=0.0, end=KEEL, tip=1.0) == 1.0)


def test_a_chain_with_a_taper_is_as_stiff_as_the_integral_of_its_compliance():
    lengths = np.full(400, KEEL / 400)
    middle = np.cumsum(lengths) - 0.5 * lengths
    ratio = taper(middle, start=0.05, end=KEEL, tip=0.3)
    support = 0.108
    chain = lumped_stiffness(
        bending_stiffness=27.1 * ratio,
        element_lengths=lengths,
        support=support,
        load_point=LOAD_POINT,
    )

    def share(x):
        moment = (LOAD_POINT - support) * x / support if x < support else LOAD_POINT - x
        return moment**2 / taper(np.array([x]), start=0.05, end=KEEL, tip=0.3)[0]

    compliance = quad(share, 0.0, LOAD_POINT, points=[0.05, support])[0] / 27.1
    assert chain == pytest.approx(1.0 / compliance, rel=1e-4)
