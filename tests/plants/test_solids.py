"""Mass properties of the solids against integrals over their volume."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.plants.solids import frustum, frustum_taper, frustum_volume

MASS = 3.0


def integrate(points, weights):
    """Centre and central moments of mass MASS spread over `points` (n, 3) with volume `weights` (n,)."""
    w = MASS * weights / weights.sum()
    center = w @ points / MASS
    x, y, z = (points - center).T
    return center, np.array([w @ (y**2 + z**2), w @ (x**2 + z**2), w @ (x**2 + y**2)])


def gauss(count, low, high):
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (high - low) * nodes + 0.5 * (high + low), 0.5 * (high - low) * weights


def frustum_points(proximal, distal, length):
    (s, ws), (r, wr) = gauss(8, 0.0, 1.0), gauss(8, 0.0, 1.0)
    angle = np.arange(16) * 2 * np.pi / 16
    S, Q, A = np.meshgrid(s, r, angle, indexing="ij")
    edge = proximal + (distal - proximal) * S
    points = np.stack([edge * Q * np.cos(A), edge * Q * np.sin(A), -length * S], axis=-1)
    weights = ws[:, None, None] * wr[None, :, None] * edge**2 * Q
    return points.reshape(-1, 3), weights.ravel()


def assert_inertia(inertia, center, moments):
    assert inertia.get_mass() == pytest.approx(MASS)
    np.testing.assert_allclose(inertia.get_com(), center, atol=1e-12)
    central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    np.testing.assert_allclose(central.get_moments(), moments, rtol=1e-10)
    np.testing.assert_allclose(central.get_products(), 0.0, atol=1e-12)
    assert inertia.IsPhysicallyValid()


@pytest.mark.parametrize("radii", [(0.095, 0.06), (0.055, 0.04), (0.05, 0.05), (0.02, 0.07)])
def test_frustum_equals_the_integral_over_its_volume(radii):
    center, moments = integrate(*frustum_points(*radii, 0.43))
    assert_inertia(frustum(MASS, *radii, 0.43), center, moments)
    _, weights = frustum_points(*radii, 0.43)
    assert frustum_volume(*radii, 0.43) == pytest.approx(2 * np.pi / 16 * 0.43 * weights.sum(), rel=1e-12)


def test_taper_puts_the_centre_where_it_is_wanted():
    for center in (0.36, 0.4095, 0.4395, 0.5):
        hanging = frustum(MASS, 0.06, 0.06 * frustum_taper(center), 0.43)
        assert hanging.get_com()[2] == pytest.approx(-0.43 * center, rel=1e-12)
    with pytest.raises(ValueError, match="no frustum"):
        frustum_taper(0.55)
