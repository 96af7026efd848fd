"""What a format cannot hold of a foot is named, with what stands in its place; nothing else is."""

from __future__ import annotations

import dataclasses
import typing
from xml.etree import ElementTree

import pytest

from vsf_drake.engines.limits import cannot_hold
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.engines.osim import foot_osim
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.parameters import FootParameters, FrictionParameters, ModelParameters

FOOT = FootParameters()
WRITERS = {"osim": foot_osim, "mjcf": foot_mjcf, "sdf": foot_sdf}


def foot(friction=FOOT.friction, **zone):
    """The nominal foot with `zone` in its heel's single sphere, and the others without damping."""
    zones = [dataclasses.replace(one, damping_n_s_per_m=0.0) for one in FOOT.zones]
    zones[1] = dataclasses.replace(zones[1], **zone)
    return dataclasses.replace(FOOT, zones=tuple(zones), friction=friction)


@pytest.mark.parametrize("form", WRITERS)
def test_a_linear_elastic_foot_without_friction_is_in_every_format_whole(form):
    bare = foot(FrictionParameters(mu_static=0.0, mu_kinetic=0.0))
    assert cannot_hold(bare, form) == {}


@pytest.mark.parametrize(
    ("form", "law", "lost"),
    [
        ("osim", "hunt_crossley", {"foot.friction"}),
        (
            "mjcf",
            "kelvin_voigt",
            {
                "foot.zones.exponent",
                "foot.zones.damping_n_s_per_m",
                "foot.zones.full_damping_depth_m",
                "foot.friction.mu_kinetic",
                "foot.friction.threshold_velocity_m_per_s",
            },
        ),
        (
            "sdf",
            "kelvin_voigt",
            {
                "foot.zones.exponent",
                "foot.zones.damping_n_s_per_m",
                "foot.zones.full_damping_depth_m",
                "foot.friction.threshold_velocity_m_per_s",
            },
        ),
        # Drake's point contact is this law
        (
            "sdf",
            "hunt_crossley",
            {"foot.zones.exponent", "foot.friction.threshold_velocity_m_per_s"},
        ),
    ],
)
def test_a_format_loses_what_its_contact_does_not_know_and_names_the_zone(form, law, lost):
    limits = cannot_hold(foot(exponent=1.2, damping_n_s_per_m=1e3), form, law=law)
    assert set(limits) == lost
    for name, told in limits.items():
        assert "; instead " in told
        assert ("zones" in name) is (told.startswith("of heel ") or told.startswith("of heel;"))


@pytest.mark.parametrize("form", WRITERS)
@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_what_is_named_is_a_parameter_of_model_files(form, law):
    for name in cannot_hold(foot(exponent=1.2, damping_n_s_per_m=1e3), form, law=law):
        kind = ModelParameters
        for part in name.split("."):
            hint = typing.get_type_hints(kind)[part]
            kind = next(iter(typing.get_args(hint)), hint)


@pytest.mark.parametrize("form", WRITERS)
def test_the_head_of_a_file_says_what_it_cannot_hold(form):
    curved = foot(exponent=1.2, damping_n_s_per_m=1e3)
    head = WRITERS[form](curved, fulcrum_m=0.108, law="smooth").partition("-->")[0]
    limits = cannot_hold(curved, form, law="smooth")
    assert limits
    for name, told in limits.items():
        assert f"    {name}: {told}\n" in head


@pytest.mark.parametrize("form", WRITERS)
def test_a_zone_of_any_name_leaves_a_file_that_can_be_read(form):
    named = foot(exponent=1.2, damping_n_s_per_m=1e3, name="<a--->\nb: ")
    ElementTree.fromstring(WRITERS[form](named, fulcrum_m=0.108))
    for told in cannot_hold(named, form).values():
        assert "zones" not in told or told.startswith("of <a---> b:")
