"""A support that passes a joint of the keel over a width: differentiable in its place, and what that costs."""

from __future__ import annotations

import keel_at_rest
import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.laws.beam import section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.walk import Walker

FOOT = FootParameters()
JOINTS_M = np.cumsum(FOOT.keel.element_lengths_m) - 0.5 * np.array(FOOT.keel.element_lengths_m)
WIDTH_M, JOINT_M = 5e-3, float(JOINTS_M[2])
"""Joints are 23.29 mm apart there."""


def walked(walker: Walker, motion, fulcrum_m, width_m, **options):
    return walker.walk(motion("right"), fulcrum_m=fulcrum_m, start_s=0.1, end_s=0.7, step_s=2e-3,
                       support_width_m=width_m, **options)


def force_by_shift(walker, motion, fulcrum_m, width_m):
    """(n, 3) N/m, derivative of the ground reaction by the support's place."""
    walk = walked(walker, motion, fulcrum_m, width_m, with_respect_to=("fulcrum.shift",))
    return walk.sensitivity.grf_W[:, :, 0]


@pytest.mark.parametrize(("joint", "place"), [
    (joint, place) for joint in JOINTS_M for place in (-1.0, -0.5, -0.02, 0.0, 0.02, 0.5, 1.0)
    if FOOT.fulcrum.rearmost_m < joint + place * WIDTH_M < FOOT.fulcrum.foremost_m])
def test_derivative_of_a_walk_is_its_central_difference_on_a_joint_and_beside_it(walker, motion, joint, place):
    """At 1e-8 m either way both ends are on the same branch of every law; at a place of +-1 the weight's second
    derivative jumps, which changes a difference by as little."""
    person, fulcrum, change = walker("right"), float(joint + place * WIDTH_M), 1e-8
    exact = force_by_shift(person, motion, fulcrum, WIDTH_M)
    low, high = (walked(person, motion, fulcrum + sign * change, WIDTH_M).prosthetic.grf_W for sign in (-1.0, 1.0))
    error = np.abs((high - low) / (2.0 * change) - exact).max(axis=1) / np.abs(exact).max()
    assert np.median(error) < 1e-5 and error.max() < 1e-3


@pytest.mark.parametrize("place", [-1.0, 0.0, 1.0])
def test_derivative_is_continuous_across_a_joint(walker, motion, place):
    """From 1 um before to 1 um behind the joint, and the ends of the width; without a width it jumps at the joint."""
    fulcrum, change = JOINT_M + place * WIDTH_M, 1e-6
    before, behind = (force_by_shift(walker("right"), motion, fulcrum + sign * change, WIDTH_M)
                      for sign in (-1.0, 1.0))
    scale = np.abs(before).max()
    assert np.abs(before - behind).max() < 1e-3 * scale
    sharp = [force_by_shift(walker("right"), motion, fulcrum + sign * change, 0.0) for sign in (-1.0, 1.0)]
    jump = np.abs(sharp[0] - sharp[1]).max()
    assert jump > 0.1 * scale if place == 0.0 else jump < 1e-3 * scale


def test_away_from_joints_a_width_changes_nothing(walker, motion):
    """108 mm is 7 mm from the nearest joint: bit for bit."""
    plain, wide = (walked(walker("right"), motion, 0.108, width) for width in (0.0, WIDTH_M))
    for key in ("q", "v", "load", "sites", "fulcrum"):
        np.testing.assert_array_equal(getattr(plain.record, key), getattr(wide.record, key))


@pytest.mark.parametrize("place", [-0.8, -0.4, 0.0, 0.4, 0.8])
def test_keel_gives_way_next_to_a_joint_as_castigliano_has_it(place):
    """The rise of the load point under F is the sum of m^2 / (F k) over the joints, m the moment about each.

    Only at this joint x does the width change it: m = F (L - x) - share F L / l (l - x), where the piece ahead of
    the joint has the share 0 or 1 without a width. 1 N keeps the keel straight.
    """
    load, fulcrum, share = 1.0, JOINT_M + place * WIDTH_M, 0.5 * (1.0 + place)
    modulus, reach = FOOT.keel.flexural_modulus_pa, FOOT.load_point_m
    sharp, wide = (keel_at_rest.rises(FOOT, np.array([load]), fulcrum, width)[0] for width in (0.0, WIDTH_M))
    stiffness = modulus * section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m) / FOOT.keel.element_lengths_m[2]
    m_wide, m_sharp = (load * (reach - JOINT_M) - s * load * reach / fulcrum * (fulcrum - JOINT_M)
                       for s in (share * share * (3.0 - 2.0 * share), float(place >= 0.0)))
    assert wide - sharp == pytest.approx((m_wide**2 - m_sharp**2) / (load * stiffness), rel=1e-3, abs=1e-10)
    assert 0.0 <= wide - sharp + 1e-10
    assert wide - sharp < 0.175 * WIDTH_M * m_sharp / stiffness * reach / fulcrum * 1.05


@pytest.mark.parametrize("width", [-1e-3, 0.012, float("nan"), "5 mm"])
def test_width_that_reaches_the_next_joint_is_refused(walker, motion, width):
    with pytest.raises(InputError, match="support_width_m"):
        walked(walker("right"), motion, 0.108, width)
