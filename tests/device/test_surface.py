"""The surface of a map, its bands and its inverse, on functions of known answer."""

from __future__ import annotations

import numpy as np
import pytest
from made_map import AXES, made_map

from vsf_drake.base.errors import InputError


def plane(m, s, x):
    return 0.1 + 0.003 * (x - 66.0) - 0.0004 * m - 0.002 * s


def test_a_plane_is_found_again_everywhere_and_its_inverse_is_exact():
    mapped = made_map(plane)
    for m, s, x in ((50.0, -6.0, 66.0), (63.0, 1.3, 99.0), (110.0, 6.0, 151.0)):
        assert mapped.at("radius", mass_kg=m, slope_deg=s, fulcrum_mm=x).value == pytest.approx(
            plane(m, s, x)
        )
    assert all(
        item.largest_error < 1e-9
        for item in mapped.table.quantities
        if item.name in ("radius", "moment_arm")
    )
    answer = mapped.inverse("radius", 0.2, mass_kg=90.0, slope_deg=-3.0)
    assert answer.positions_mm == pytest.approx([66.0 + (0.2 - 0.1 + 0.036 - 0.006) / 0.003])
    assert answer.interval_mm is None  # without draws nothing is known of it


def test_the_surface_passes_through_its_cells_and_overshoots_nowhere():
    mapped = made_map(lambda m, s, x: 0.2 + 0.3 * (x > 100.0) + 0 * m)
    x = np.linspace(66.0, 151.0, 300)
    value = mapped.along("radius", x)[0]
    assert (
        np.diff(value).min() > -1e-12
        and value.min() == pytest.approx(0.2)
        and value.max() == pytest.approx(0.5)
    )
    own = [mapped.at("radius", fulcrum_mm=at).value for at in AXES["fulcrum_mm"]]
    np.testing.assert_allclose(own, [0.2, 0.2, 0.2, 0.5, 0.5, 0.5])


def test_the_error_on_held_out_cells_is_that_of_the_surface():
    """1 in every cell and 1.1 wherever else it is asked: the surface misses by 0.1 / 1.1."""
    radius = made_map(
        lambda m, s, x: np.where(np.isin(x, AXES["fulcrum_mm"]), 1.0, 1.1) + 0 * m
    ).quantity("radius")
    assert (
        radius.largest_error == radius.median_error == pytest.approx(0.1 / 1.1)
        and not radius.within
    )


def test_bands_are_the_draws_least_and_largest_of_nineteen_and_the_inverse_has_their_interval():
    """Weibull's position of 5 % is that of the least of 19. r = k x: the target is held where low
    x < r < high x."""
    factors = tuple(np.linspace(0.9, 1.1, 19))
    mapped = made_map(lambda m, s, x: x / 400.0 + 0 * m, factors)
    band = mapped.at("radius", fulcrum_mm=100.0)
    assert tuple(band) == pytest.approx((0.25, 0.225, 0.275))
    answer = mapped.inverse("radius", 0.25)
    assert answer.positions_mm == pytest.approx([100.0])
    assert answer.interval_mm == pytest.approx((100.0 / 1.1, 100.0 / 0.9), abs=0.03)
    arm = mapped.at("moment_arm", fulcrum_mm=100.0, slope_deg=0.0)
    assert arm.low < arm.value + 1e-12 and arm.value < arm.high + 1e-12


def test_out_of_reach_the_nearest_is_told_and_a_valley_has_two_answers():
    mapped = made_map(plane, tuple(np.linspace(0.99, 1.01, 19)))
    answer = mapped.inverse("radius", 0.9, mass_kg=70.0)
    assert answer.positions_mm == () and answer.interval_mm is None
    assert answer.nearest_mm == 151.0 and answer.nearest.value == pytest.approx(
        plane(70.0, 2.0, 151.0)
    )
    valley = made_map(lambda m, s, x: 0.2 + 1e-4 * (x - 108.5) ** 2 + 0 * m)
    assert len(valley.inverse("radius", 0.25).positions_mm) == 2


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda m: m.inverse("ankle", 1.0), "ankle: is no quantity"),
        (lambda m: m.inverse("loading_rate", 1.0), "hardly"),
        (lambda m: m.inverse("radius", float("nan")), "no number"),
        (
            lambda m: m.at("radius", slope_deg=12.0),
            "slope_deg: 12 is outside this map, which holds -6 to 6",
        ),
        (lambda m: m.at("radius", alignment_deg=2.0), "0 alone"),
        (lambda m: m.at("radius", speed=1.0), "no axis"),
        (lambda m: m.inverse("radius", 0.2, fulcrum_mm=80.0), "looked for"),
    ],
)
def test_what_cannot_be_asked_is_refused_by_name(ask, said):
    with pytest.raises(InputError, match=said):
        ask(made_map(plane))


def test_a_quantity_that_some_cells_lack_is_refused_with_their_number():
    with pytest.raises(InputError, match="unknown in 3 of 96 cells"):
        made_map(plane, unknown=True).inverse("radius", 0.2)
