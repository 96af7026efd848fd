"""Mass properties of the frustum against its discs summed up and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from vsf_drake.plants.solids import frustum, frustum_taper, frustum_volume

MASS, LENGTH = 3.0, 0.43


@pytest.mark.parametrize("radii", [(0.095, 0.06), (0.05, 0.05), (0.02, 0.07)])
def test_frustum_is_the_sum_of_its_discs(radii):
    R, r = radii

    def summed(of):
        """Integral over the volume of `of` height and radius of a disc."""
        return quad(
            lambda s: math.pi * LENGTH * (e := R + (r - R) * s) ** 2 * of(-LENGTH * s, e), 0.0, 1.0
        )[0]

    volume = summed(lambda z, e: 1.0)
    assert frustum_volume(R, r, LENGTH) == pytest.approx(volume, rel=1e-12)
    centre = summed(lambda z, e: z) / volume
    lateral, axial = (
        MASS / volume * summed(of)
        for of in (lambda z, e: 0.25 * e**2 + (z - centre) ** 2, lambda z, e: 0.5 * e**2)
    )
    inertia = frustum(MASS, R, r, LENGTH)
    np.testing.assert_allclose(inertia.get_com(), [0.0, 0.0, centre], atol=1e-12)
    central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    np.testing.assert_allclose(central.get_moments(), [lateral, lateral, axial], rtol=1e-10)
    assert inertia.get_mass() == MASS


def test_taper_puts_the_centre_where_it_is_wanted():
    for center in (0.36, 0.4095, 0.4395, 0.5):
        hanging = frustum(MASS, 0.06, 0.06 * frustum_taper(center), LENGTH)
        assert hanging.get_com()[2] == pytest.approx(-LENGTH * center, rel=1e-12)
    with pytest.raises(ValueError, match="no frustum"):
        frustum_taper(0.55)
