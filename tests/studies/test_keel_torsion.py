"""A keel that twists: closed forms by a second method, and what is stored bears out what
docs/departures.md concludes."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import keel_torsion
import numpy as np
import pytest
from floor_of_the_reference_subject import RESULTS
from virtual_laboratory.keel import torsional_stiffness

from vsf_drake.model.parameters import FootParameters

FOOT = FootParameters()
WALKS = [(person, name) for person in keel_torsion.PERSONS for name in keel_torsion.WALKS]


@pytest.fixture(scope="module")
def stored():
    return json.loads((RESULTS / "keel_torsion.json").read_text(encoding="utf-8"))


def test_a_flat_leaf_has_the_torsional_stiffness_of_saint_venants_series():
    """J = b h³/3 (1 - 192 h/(π⁵ b) Σ tanh(n π b / 2 h)/n⁵), n odd (Timoshenko & Goodier, Theory of
    Elasticity); there a bar of 10 to 1 has 0.312 b h³."""
    leaf = keel_torsion.leaf()
    b, h = leaf.width_rear_m, leaf.thickness_rear_m
    n = np.arange(1, 40, 2)
    series = np.sum(np.tanh(n * np.pi * b / (2.0 * h)) / n**5)
    constant = b * h**3 / 3.0 * (1.0 - 192.0 * h / (np.pi**5 * b) * series)
    found = keel_torsion.keel_numbers()["torsion_nm2"] / keel_torsion.SHEAR_MODULUS_PA
    assert found == pytest.approx(constant, rel=1e-3)
    ten = dataclasses.replace(leaf, width_rear_m=10.0 * h, width_tip_m=10.0 * h)
    bar = float(torsional_stiffness(ten, np.array(0.0)))
    assert bar / (keel_torsion.SHEAR_MODULUS_PA * 10.0 * h**4) == pytest.approx(0.312, abs=1e-3)


def test_forces_at_the_spheres_twist_and_bend_the_keel_as_its_moments_integrated_do():
    """Torque, and sideways bending moment, at 2000 places between A and the toe."""
    random = np.random.default_rng(1)
    count = sum(len(zone.x_mm) for zone in FOOT.zones)
    normal, aside = 40.0 * random.random(count), random.normal(scale=8.0, size=count)
    walk = SimpleNamespace(
        sphere_normal_n=normal[None],
        sphere_friction_W=np.column_stack([np.zeros(count), aside])[None],
    )
    found = keel_torsion.closed_form(walk)
    stiffness = keel_torsion.keel_numbers()
    step = 0.229 / 2000
    s = step * (np.arange(2000) + 0.5)
    torque, moment = np.zeros(2000), np.zeros(2000)
    spheres = [place for zone in FOOT.zones for place in zip(zone.x_mm, zone.y_mm, strict=True)]
    for (x_mm, y_mm), up, left in zip(spheres, normal, aside, strict=True):
        x = 1e-3 * x_mm
        if x > 0.066:
            torque += np.where(s < x, 1e-3 * y_mm * up + (0.030 + 0.5 * 0.00635) * left, 0.0)
            moment += np.where(s < x, (x - s) * left, 0.0)
    slope = np.cumsum(moment) * step / stiffness["sideways_nm2"]
    assert np.radians(found["twist_deg"]) == pytest.approx(
        abs(np.sum(torque)) * step / stiffness["torsion_nm2"], rel=1e-3
    )
    assert np.radians(found["yaw_deg"]) == pytest.approx(abs(slope[-1]), rel=1e-3)
    assert 1e-3 * found["sideways_mm"] == pytest.approx(abs(np.sum(slope)) * step, rel=2e-3)


def test_the_stored_keel_is_that_of_the_model(stored):
    assert stored["synthetic"] is True
    assert stored["keel"] == pytest.approx(keel_torsion.keel_numbers())


@pytest.mark.parametrize(("person", "name"), WALKS)
def test_twisting_explains_no_free_moment_that_the_model_misses(stored, person, name):
    """What it does is told apart from the time step, is a small part of the model's error in
    each walk, on an edge too, and adding it leaves as much."""
    walk = stored["persons"][person]["walks"][name]
    for key in ("free_moment", "lateral_cop"):
        assert walk["step"][key] < walk["twisting"][key] < walk["soft"][key], key
    for part in ("twisting", "soft", "on_edge"):
        assert walk[part]["free_moment"] < 0.25 * walk["error"]["free_moment"], part
        assert walk[part]["resultant"] < 0.05 * walk["error"]["resultant"], part
    if person != keel_torsion.REFERENCE_SUBJECT:
        left = walk["with_torsion"]["free_moment"]
        assert abs(left - walk["error"]["free_moment"]) < 0.1 * walk["error"]["free_moment"]


def test_friction_chosen_for_the_free_moment_takes_the_lowest_and_spoils_the_fore_aft_force(stored):
    for person, part in stored["persons"].items():
        own = keel_torsion.fitted_contact(person).values["friction.mu_static"]
        assert part["friction"]["friction.mu_static"] / own == pytest.approx(
            min(keel_torsion.FRICTION)
        )
        for walk in part["walks"].values():
            assert walk["friction"]["fore_aft"] > walk["error"]["fore_aft"]
