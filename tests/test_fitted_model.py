"""Fitted values in a model, field by field; that the walk is the same is shown in tests/simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_contact import OF_THE_MODEL, OF_THE_TRIAL

from vsf_drake.contact_file import model_with
from vsf_drake.errors import InputError
from vsf_drake.model_file import FOAM_LOADS_N, foam_under_load, secant_stiffness
from vsf_drake.parameters import BushingAxis, ContactZone, ModelParameters

MODEL = ModelParameters()
FOOT = MODEL.foot


def zone(model, name):
    return next(zone for zone in model.foot.zones if zone.name == name)


def test_each_value_goes_to_its_field_and_nothing_else_changes():
    fitted = model_with(MODEL, OF_THE_MODEL)
    forefoot = zone(fitted, "forefoot")
    assert (forefoot.stiffness, forefoot.exponent, forefoot.damping_n_s_per_m) == (9e4, 1.4, 150.0)
    assert zone(fitted, "midfoot") == replace(zone(MODEL, "midfoot"), full_damping_depth_m=2e-3)
    assert zone(fitted, "heel") == replace(zone(MODEL, "heel"), rise_mm=(-1.0,))
    assert zone(fitted, "heel_posterior") == zone(MODEL, "heel_posterior")
    assert vars(fitted.foot.friction) == {"mu_static": 0.6, "mu_kinetic": 0.4, "threshold_velocity_m_per_s": 0.08}
    assert fitted.foot.keel == replace(FOOT.keel, flexural_modulus_pa=17.7e9)
    assert fitted.foot.fulcrum == replace(FOOT.fulcrum, stiffness_n_per_m=150e3)
    assert fitted.socket.tz == replace(MODEL.socket.tz, stiffness=8.3e4, stiffness_negative=pytest.approx(0.15 * 8.3e4))
    assert fitted.intact_foot == MODEL.intact_foot
    assert (fitted.foot.mass_kg, fitted.foot.load_point_m) == (FOOT.mass_kg, FOOT.load_point_m)


def test_what_belongs_to_the_trial_leaves_the_model_alone():
    assert model_with(MODEL, OF_THE_TRIAL) == MODEL
    assert model_with(MODEL, {}) == MODEL


def test_a_rise_is_added_to_that_of_each_sphere():
    uneven = replace(zone(MODEL, "heel_posterior"), rise_mm=(1.0, -2.0))
    model = replace(MODEL, foot=replace(FOOT, zones=(uneven, *FOOT.zones[1:])))
    fitted = model_with(model, {"contact.heel_posterior.rise": 5e-4})
    assert zone(fitted, "heel_posterior").rise_mm == pytest.approx((1.5, -1.5))


def test_the_benchs_foam_is_that_of_the_spheres_under_its_load():
    fitted = model_with(MODEL, {"contact.forefoot.stiffness": 9e4, "contact.forefoot.exponent": 1.4,
                                "contact.forefoot.rise": 2e-3})
    assert (fitted.foot.series_stiffness_n_per_m, fitted.foot.series_exponent) == (pytest.approx(8 * 9e4), 1.4)


@pytest.mark.parametrize("name", ["contact.heel.stiffness", "contact.midfoot.rise", "contact.forefoot.damping",
                                  "contact.forefoot.rise"])
def test_the_benchs_foam_stays_where_the_spheres_under_its_load_keep_their_law(name):
    model = replace(MODEL, foot=replace(FOOT, series_stiffness_n_per_m=5e4))
    fitted = model_with(model, {name: 1e-3 if name.endswith("rise") else 300.0})
    assert (fitted.foot.series_stiffness_n_per_m, fitted.foot.series_exponent) == (5e4, 1.0)


def mixed_foot():
    """Two spheres under the load, of other exponents, one a millimetre higher."""
    law = {"radius_m": 1e-3, "damping_n_s_per_m": 10.0, "y_mm": (0.0,)}
    return replace(FOOT, zones=(
        FOOT.zones[0], ContactZone(name="a", x_mm=(195.0,), rise_mm=(1.0,), stiffness=8e4, **law),
        ContactZone(name="b", x_mm=(203.0,), rise_mm=(2.0,), stiffness=3e6, exponent=1.7, **law),
        ContactZone(name="far", x_mm=(229.0,), rise_mm=(0.0,), stiffness=1e9, **law)))


def test_spheres_of_several_laws_bear_as_the_power_law_at_both_loads():
    stiffness, exponent = foam_under_load(mixed_foot())
    for load in FOAM_LOADS_N:
        depth = (load / stiffness) ** (1.0 / exponent)
        assert 8e4 * depth + 3e6 * (depth - 1e-3) ** 1.7 == pytest.approx(load, rel=1e-9)
    assert exponent > 1.0


def test_a_foam_that_bears_nothing_is_none():
    zones = tuple(replace(zone, stiffness=1e-2 * (i + 1)) for i, zone in enumerate(mixed_foot().zones))
    assert foam_under_load(replace(FOOT, zones=zones)) is None
    assert foam_under_load(replace(FOOT, series_patch_m=1e-3)) is None


@pytest.mark.parametrize(("stiffness", "exponent"), [(62.98e3, 1.0), (3e6, 1.7)])
def test_secant_stiffness_is_force_over_depth(stiffness, exponent):
    depth = 4e-3
    load = stiffness * depth**exponent
    assert secant_stiffness(stiffness, exponent, load) == pytest.approx(load / depth)
    assert exponent != 1.0 or secant_stiffness(stiffness, exponent, 123.0) == stiffness


@pytest.mark.parametrize(("values", "words"), [
    ({"contact.toe.stiffness": 1e4}, ["contact.toe.stiffness", "no contact zones 'toe'", "heel_posterior"]),
    ({"contact.forefoot.color": 1e4}, ["contact.forefoot.color"]),
    ({"fulcrum.shift": 0.01}, ["fulcrum.shift"]),
    ({"course.a": 0.01}, ["course.a"]),
    ({"keel.flexural_modulus": -1.0}, ["flexural_modulus_pa", "between"]),
    ({"contact.forefoot.exponent": 0.5}, ["exponent", "between 1 and 20"]),
    ({"contact.heel.rise": float("nan")}, ["rise_mm", "finite"]),
])
def test_unusable_values_are_refused_with_file_and_name(values, words):
    with pytest.raises(InputError) as caught:
        model_with(MODEL, values, file="contact.yaml")
    for word in ("contact.yaml", *words):
        assert word in str(caught.value)


def test_two_zones_of_one_name_and_an_axis_without_stiffness_are_refused():
    twice = replace(MODEL, foot=replace(FOOT, zones=(*FOOT.zones, FOOT.zones[0])))
    with pytest.raises(InputError, match="2 contact zones 'heel_posterior'"):
        model_with(twice, {"contact.heel_posterior.stiffness": 1e4})
    loose = BushingAxis(stiffness=0.0, stiffness_negative=10.0, damping=1.0, limit=0.1, rate_limit=1.0)
    with pytest.raises(InputError, match="tx axis has no stiffness"):
        model_with(replace(MODEL, socket=replace(MODEL.socket, tx=loose)), {"socket.tx.stiffness": 1e4})


def test_numpy_numbers_are_numbers():
    fitted = model_with(MODEL, {"fulcrum.stiffness": np.float64(2e5)})
    assert type(fitted.foot.fulcrum.stiffness_n_per_m) is float
