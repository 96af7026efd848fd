"""Segments of a subject: de Leva's table, and masses that add up."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vsf_drake.errors import InputError
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.anthropometry import DE_LEVA, residual_volume_ratio, scale_body

MODEL = ModelParameters()
REST_OF_BODY = {  # head, trunk, upper arm, forearm, hand as fractions of body mass, de Leva 1996
    "male": (0.0694, 0.4346, 0.0271, 0.0162, 0.0061), "female": (0.0668, 0.4257, 0.0255, 0.0138, 0.0056)}


def body_of(subject, **changes):
    return scale_body(replace(subject, **changes), MODEL.foot, MODEL.socket)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_table_adds_up_to_the_whole_body(sex):
    table = DE_LEVA[sex]
    head, trunk, *arm = REST_OF_BODY[sex]
    total = head + trunk + 2 * (sum(arm) + table.thigh_mass + table.shank_mass + table.foot_mass)
    assert total == pytest.approx(1.0, abs=1.5e-4)


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("mass", [50.0, 78.0, 120.0])
def test_masses_add_up_to_the_subjects(subject, sex, mass):
    body = body_of(subject, sex=sex, mass_kg=mass)
    total = (body.pelvis_mass + 2 * body.thigh_mass + body.shank_mass + body.foot_mass + body.residual_shank_mass
             + body.prosthesis_mass)
    assert total == pytest.approx(mass, rel=1e-12)


def test_segments_of_the_papers_subject(subject):
    """78 kg, 1.81 m: fractions of mass and lengths scaled by 1.81 / 1.741."""
    body = body_of(subject)
    assert body.thigh_mass == pytest.approx(11.045, abs=1e-3)
    assert body.shank_mass == pytest.approx(3.377, abs=1e-3)
    assert body.foot_mass == pytest.approx(1.069, abs=1e-3)
    assert body.thigh_length == pytest.approx(0.4389, abs=1e-4)
    assert body.shank_length == pytest.approx(0.4403 * 1.81 / 1.741, abs=1e-4)
    assert body.foot_length == pytest.approx(0.2683, abs=1e-4)


def test_measured_lengths_replace_scaled_ones(subject):
    body = body_of(subject, thigh_length_m=0.40, shank_length_m=0.41, ankle_height_m=0.08, foot_length_m=0.25,
                   hip_forward_m=0.0, hip_up_m=-0.08, hip_lateral_m=0.09)
    assert body.leg_length == pytest.approx(0.89)
    assert (body.foot_length, body.hip_forward, body.hip_up, body.hip_lateral) == (0.25, 0.0, -0.08, 0.09)


def test_hip_centre_lies_where_hara_puts_it_for_a_leg_of_900_mm(subject):
    """Hara et al. 2016: 11 - 0.063 LL, -9 - 0.078 LL, 8 + 0.086 LL mm, LL from the spine, 79.2 mm over the hip, down to
    the malleolus: thigh and shank of 820.8 mm."""
    body = body_of(subject, thigh_length_m=0.420, shank_length_m=0.4008)
    assert (body.hip_forward, body.hip_up, body.hip_lateral) == pytest.approx((-0.0457, -0.0792, 0.0854), abs=1e-9)


def test_both_legs_are_equally_long(subject):
    body = body_of(subject)
    prosthetic = body.thigh_length + body.residual_length + body.pylon_length + MODEL.foot.build_height_m
    assert prosthetic == pytest.approx(body.leg_length, rel=1e-12)


def test_residual_shank_is_the_upper_part_of_the_whole():
    table = DE_LEVA["male"]
    assert residual_volume_ratio(table, 1.0) == pytest.approx(1.0)
    assert 0.66 < residual_volume_ratio(table, 0.66) < 1.0, "the shank tapers downwards"


def test_no_room_for_the_pylon_is_said(subject):
    with pytest.raises(InputError, match="no room for the pylon"):
        body_of(subject, shank_length_m=0.15, ankle_height_m=0.02)


def test_a_body_lighter_than_its_legs_is_refused(subject):
    heavy = replace(MODEL.foot, mass_kg=5.0)
    with pytest.raises(InputError, match="legs and prosthesis weigh"):
        scale_body(replace(subject, mass_kg=20.0), heavy, replace(MODEL.socket, socket_mass_kg=5.0))
