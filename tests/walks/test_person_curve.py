"""The person's own curve: what does not differ from the fitted walks is their measured curve, what
differs is added by its share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.model.contact_file import PersonCurve, PersonWalk
from vsf_drake.motion.events import Stance
from vsf_drake.walks.comparison import PERCENT
from vsf_drake.walks.person_curve import (
    ALIGNED,
    FADE,
    MODEL,
    NEED,
    ModelStance,
    SeenWalk,
    Swing,
    laid,
    over,
    spread,
)

WEIGHT_N = 800.0
STANCE = Stance(0.2, 1.2)
LIFT_OFF, SWUNG = 20.0, (0.42, 0.98)
BUMP = np.sin(np.pi * PERCENT / 100.0) ** 2


def seen(*, shift=(0.0, 0.0, 0.0), needed=(1.0, 0.0, 0.0), lift_off=LIFT_OFF, **changes):
    """A walk of one stance of one second whose model gives BUMP in every component, and `shift`
    more."""
    force = BUMP[:, None] + np.array(shift)
    cop = np.column_stack([0.2 * PERCENT / 100.0, np.zeros(101)])
    swing = Swing(STANCE.start_s + 0.01 * lift_off, *SWUNG, np.array(needed))
    whole = {
        "fulcrum_m": 0.066,
        "weight_n": WEIGHT_N,
        "time_s": np.arange(0.0, 1.4, 1e-3),
        "heading": np.array([1.0, 0.0]),
        "stances": [STANCE],
        "model": [ModelStance(STANCE, force, cop)],
        "swings": [swing],
        "believed": True,
    }
    return SeenWalk(**whole | changes)


def fitted(plate=BUMP, fulcrum_m=0.066, *, model=BUMP, times=(0.0, 0.0), **changes):
    """A fitted walk whose plate measured the same in every component."""
    names = ("fore_aft_bw", "lateral_bw", "vertical_bw")
    place = np.linspace(-0.1, 0.1, 101)
    cop = {"fore_aft_cop_m": tuple(place + 0.01), "lateral_cop_m": (0.0,) * 101}
    model_cop = {"model_fore_aft_cop_m": tuple(place), "model_lateral_cop_m": (0.0,) * 101}
    told = {
        "fingerprint": "0" * 64,
        "fulcrum_m": fulcrum_m,
        "needed_bw": (1.0, 0.0, 0.0),
        "intact_lift_off_percent": LIFT_OFF,
        "stance_s": 1.0,
        "strike_error_s": times[0],
        "lift_off_error_s": times[1],
        **dict.fromkeys(names, tuple(map(float, plate))),
        **{f"model_{name}": tuple(map(float, model)) for name in names},
        **cop,
        **model_cop,
    }
    return PersonWalk(**told | changes)


def inside(force, low=0.0, high=100.0):
    """(k, 3) BW between two percents of the stance."""
    percent = 100.0 * (force.time_s - STANCE.start_s) / STANCE.duration_s
    rows = (percent >= low) & (percent <= high)
    return force.force_n[rows] / WEIGHT_N, percent[rows]


def test_a_walk_that_differs_in_nothing_has_the_fitted_walks_curve_whatever_the_model_gets_wrong():
    plate = 1.1 * BUMP**0.5
    force = laid(PersonCurve(walks=(fitted(plate),)), seen())
    values, percent = inside(force)
    expected = np.interp(percent, PERCENT, plate)
    np.testing.assert_allclose(values, np.column_stack([expected] * 3), atol=1e-9)
    assert force.corrected and not force.force_n[force.time_s < STANCE.start_s].any()
    assert np.isnan(force.cop_m[force.time_s > STANCE.end_s + 1e-3]).all()
    # 10 mm ahead of the model's, everywhere
    foot = 0.1 + np.linspace(-0.1, 0.1, 101) + 0.01
    rows = force.time_s[np.isfinite(force.cop_m[:, 0])]
    np.testing.assert_allclose(
        force.cop_m[np.isfinite(force.cop_m[:, 0]), 0],
        np.interp(100.0 * (rows - STANCE.start_s), PERCENT, foot),
        atol=1e-9,
    )


def test_between_two_settings_the_curve_is_linear_and_beyond_them_that_of_the_nearest():
    curve = PersonCurve(
        walks=(fitted(0.0 * BUMP, 0.066), fitted(BUMP, 0.106), fitted(3.0 * BUMP, 0.106))
    )
    for fulcrum_m, share in ((0.066, 0.0), (0.096, 1.5), (0.106, 2.0), (0.151, 2.0), (0.05, 0.0)):
        values, percent = inside(laid(curve, seen(fulcrum_m=fulcrum_m)))
        np.testing.assert_allclose(
            values[:, 2], share * np.interp(percent, PERCENT, BUMP), atol=1e-9
        )


def test_of_what_the_model_says_is_different_a_share_is_added():
    values, percent = inside(laid(PersonCurve(walks=(fitted(),)), seen(shift=(0.1, 0.2, -0.3))))
    base = np.interp(percent, PERCENT, BUMP)[:, None]
    np.testing.assert_allclose(
        values - base, np.tile(MODEL * (0.1, 0.2, -0.3), (len(percent), 1)), atol=1e-9
    )


def test_what_momentum_needs_beyond_the_fitted_walks_is_added_in_single_support_and_fades():
    """0.2 BW more, upwards alone; halfway through the fade half of it."""
    values, percent = inside(laid(PersonCurve(walks=(fitted(),)), seen(needed=(1.2, 0.0, 0.0))))
    added = values - np.interp(percent, PERCENT, BUMP)[:, None]
    np.testing.assert_allclose(added[:, :2], 0.0, atol=1e-9)
    low, high = (100.0 * (instant - STANCE.start_s) for instant in SWUNG)
    for place, share in (
        (50.0, 1.0),
        (low, 1.0),
        (low - 0.5 * FADE, 0.5),
        (high + 0.5 * FADE, 0.5),
        (low - FADE, 0.0),
        (100.0, 0.0),
    ):
        assert np.interp(place, percent, added[:, 2]) == pytest.approx(
            0.2 * NEED * share, abs=1e-4
        ), place


def test_where_momentum_is_not_believed_the_base_stands_alone():
    walk = seen(shift=(0.5, 0.5, 0.5), needed=(2.0, 0.0, 0.0), believed=False)
    force = laid(PersonCurve(walks=(fitted(),)), walk)
    values, percent = inside(force)
    np.testing.assert_allclose(
        values, np.tile(np.interp(percent, PERCENT, BUMP)[:, None], 3), atol=1e-9
    )
    assert not force.corrected
    unseen = fitted(model_vertical_bw=None, needed_bw=None, intact_lift_off_percent=None)
    again, _ = inside(laid(PersonCurve(walks=(unseen,)), seen(shift=(0.5, 0.5, 0.5))))
    np.testing.assert_allclose(again, values, atol=1e-9)


def test_the_curve_is_aligned_where_the_intact_foot_leaves_the_ground_by_half():
    """A peak of the plate where the intact foot leaves, at 20 %; here it leaves at 30 %."""
    peak = np.interp(PERCENT, [0.0, LIFT_OFF, 100.0], [0.0, 1.0, 0.0])
    walk = seen(lift_off=30.0, believed=False)
    values, percent = inside(laid(PersonCurve(walks=(fitted(peak),)), walk))
    assert percent[np.argmax(values[:, 2])] == pytest.approx(20.0 + ALIGNED * 10.0, abs=0.1)
    untold = replace(walk, swings=[])
    values, percent = inside(laid(PersonCurve(walks=(fitted(peak),)), untold))
    assert percent[np.argmax(values[:, 2])] == pytest.approx(20.0, abs=0.1)


def test_stances_are_the_physics_less_what_it_was_early_and_late_in_the_fitted_walks():
    curve = PersonCurve(walks=(fitted(times=(0.02, 0.01)), fitted(times=(0.04, -0.03))))
    (stance,) = laid(curve, seen()).stances
    assert (stance.start_s, stance.end_s) == pytest.approx((0.2 - 0.03, 1.2 + 0.01))


@pytest.mark.parametrize(
    ("seen_ends", "span"), [((False, True), (0.1, 1.2)), ((True, False), (0.2, 1.3))]
)
def test_a_stance_that_the_recording_cuts_lasts_as_long_as_those_of_the_fitted_walks(
    seen_ends, span
):
    cut = replace(STANCE, start_seen=seen_ends[0], end_seen=seen_ends[1])
    walk = seen(stances=[cut], model=[], swings=[])
    force = laid(PersonCurve(walks=(fitted(stance_s=1.1),)), walk)
    (stance,) = force.stances
    assert (stance.start_s, stance.end_s) == pytest.approx(span) and not force.corrected
    place = 0.5 * sum(span)
    assert np.interp(place, force.time_s, force.force_n[:, 2]) == pytest.approx(WEIGHT_N, rel=1e-3)


def test_an_interval_is_what_walks_of_one_setting_differ_by_and_none_without_two_of_one():
    """Two walks of one setting whose plates are 0.1 BW apart: the variance of two numbers is half
    the square of their difference. With one degree of freedom, tan(0.4 pi) = 3.08 standard
    deviations hold 80 % (Student's t is Cauchy's distribution); a third walk differs from the mean
    of two by sqrt(1 + 1/2) of them."""
    pair = fitted(), fitted(BUMP + 0.1)
    walks = [seen(), seen()]
    curve = spread(PersonCurve(walks=pair), walks)
    np.testing.assert_allclose(curve.vertical_sd_bw, 0.1 / np.sqrt(2.0), atol=1e-6)
    half = laid(curve, seen()).half_width_n
    middle = (np.arange(len(half)) > 300) & (np.arange(len(half)) < 1100)
    wide = np.tan(0.4 * np.pi) * np.sqrt(1.5) * 0.1 / np.sqrt(2.0)
    np.testing.assert_allclose(half[middle, 2], wide * WEIGHT_N, rtol=1e-6)
    apart = PersonCurve(walks=(pair[0], replace(pair[1], fulcrum_m=0.151)))
    alone = spread(apart, [walks[0], replace(walks[1], fulcrum_m=0.151)])
    assert alone.vertical_sd_bw is None and laid(alone, seen()).half_width_n is None


def test_the_same_curve_may_be_laid_over_stances_that_a_plate_measured():
    curve = PersonCurve(walks=(fitted(),))
    later = Stance(0.25, 1.15)
    force = over(curve, seen(believed=False), [later])
    assert force.force_n[:250].max() == 0.0 and force.stances == (later,)
