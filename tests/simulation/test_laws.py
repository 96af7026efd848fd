"""Walks under each contact law: derivatives, and where the energy goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from differences import central, errors, size

from vsf_drake.laws import smooth_contact
from vsf_drake.laws.contact import FIRST_COLUMN
from vsf_drake.laws.contact_law import constants_of
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.simulation.mechanism import DISSIPATION, edited, gait_mechanism
from vsf_drake.simulation.reactions import LOST, total
from vsf_drake.simulation.stepping.assembly import MAX_APPROACH
from vsf_drake.simulation.walk import Walker

VALUES = {"contact.forefoot.exponent": 1.1}
SPAN = {"fulcrum_m": 0.108, "start_s": 0.0, "end_s": 0.94}
NAMES = (
    "contact.forefoot.stiffness",
    "contact.forefoot.exponent",
    "contact.forefoot.damping",
    "contact.forefoot.rise",
    "friction.mu_static",
    "friction.threshold_velocity",
)


@pytest.fixture(scope="module", params=["smooth", "hunt_crossley"])
def under(request, walker):
    """The walker under another law than the fitted one."""
    own = walker("right")
    return Walker(own.subject, replace(own.model, contact_law=request.param))


def test_sensitivities_are_what_differences_of_walks_lead_to(under, motion):
    span = SPAN | {"values": VALUES}
    exact = under.walk(motion("right"), **span, with_respect_to=NAMES).sensitivity
    for name in NAMES:
        change = 3e-6 * size(under.variables[name])
        by = central(under, motion("right"), name, change, **span)
        for series, error in errors(under, exact, name, by):
            assert error[by.alike].max() < 1e-3, (name, series)
            assert np.median(error) < 1e-5, (name, series)


def test_energy_balance_closes_in_proportion_to_the_step(under, motion):
    gaps = []
    for step_s in (1e-3, 5e-4):
        walk = under.walk(motion("right"), **SPAN, step_s=step_s)
        terms = under.energies(walk)
        gaps.append(np.abs(terms["remainder"]).max() / total(terms, LOST)[-1])
    assert gaps[1] < 0.05
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.4)


def test_laws_press_alike_and_not_the_same(under, motion, stance, body_weight):
    """What the smooth law rounds, and the dissipation that is matched, change a stance a little."""
    other = under.walk(motion("right"), **SPAN, step_s=1e-3).prosthetic.grf_W
    off = np.abs(other - stance("right", 1e-3).prosthetic.grf_W).max() / body_weight
    assert 1e-3 < off < 0.3


def test_rounded_foam_presses_before_it_touches_in_the_smallest_steps(walker, motion):
    """Every sphere bears what the law says of its depth and depth rate at the end of each step; in
    0.05 ms nothing comes as far as the rounding reaches above the ground."""
    own = walker("right")
    rounded = Walker(own.subject, replace(own.model, contact_law="smooth"))
    span = {"fulcrum_m": 0.108, "start_s": 0.12, "end_s": 0.15, "step_s": 5e-5}
    walk = rounded.walk(motion("right"), **span)
    depth, rate = walk.record.site("depth"), walk.record.site("depth_rate")
    site = constants_of(walk.mechanism.sites[:, FIRST_COLUMN:])
    expected, _, _ = smooth_contact.normal_force(
        smooth_contact.penetration(depth, site)[0], rate, site
    )
    above = (depth < -MAX_APPROACH * 5e-5) & (expected > 0.0)
    assert np.count_nonzero(above) > 10
    np.testing.assert_allclose(walk.record.site("normal_force"), expected, rtol=1e-9, atol=1e-9)


def test_dissipation_follows_what_it_is_matched_to(walker):
    own = walker("right")
    walking = Walker(own.subject, replace(own.model, contact_law="hunt_crossley"))
    mechanism = gait_mechanism(walking.gait, walking.context)
    twice = 2.0 * walking.variables["contact.forefoot.damping"].default
    changed = edited(mechanism, walking.variables, {"contact.forefoot.damping": twice})
    ratio = changed.sites[:, DISSIPATION] / mechanism.sites[:, DISSIPATION]
    foot = walking.gait.person.foot.sites
    of = foot.zone == foot.zone_names.index("forefoot")
    np.testing.assert_allclose(ratio[: len(of)], np.where(of, 2.0, 1.0), rtol=1e-14)
    assert ModelParameters().contact_law == "kelvin_voigt"
