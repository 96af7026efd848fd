"""Walks under each contact law: derivatives, and where the energy goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from differences import central, errors, size

from vsf_drake.model.parameters import ModelParameters
from vsf_drake.simulation.mechanism import DISSIPATION, edited, gait_mechanism
from vsf_drake.simulation.reactions import LOST, total
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
