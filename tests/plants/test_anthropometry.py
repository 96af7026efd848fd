"""Segments of a subject: de Leva's table, masses that add up, and the place of the foot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.plants.anthropometry import DE_LEVA, FootPlacement, residual_volume_ratio, scale_body
from vsf_drake.plants.foot import add_foot, mount_pose, set_mount

MODEL = ModelParameters()
REST_OF_BODY = {  # head, trunk, upper arm, forearm, hand as fractions of body mass, de Leva 1996
    "male": (0.0694, 0.4346, 0.0271, 0.0162, 0.0061),
    "female": (0.0668, 0.4257, 0.0255, 0.0138, 0.0056),
}


def body_of(subject, **changes):
    return scale_body(replace(subject, **changes), MODEL.foot, MODEL.socket)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_masses_add_up_to_the_whole_body_and_to_the_subjects(subject, sex):
    table = DE_LEVA[sex]
    head, trunk, *arm = REST_OF_BODY[sex]
    total = head + trunk + 2 * (sum(arm) + table.thigh_mass + table.shank_mass + table.foot_mass)
    assert total == pytest.approx(1.0, abs=1.5e-4)
    for mass in (50.0, 120.0):
        body = body_of(subject, sex=sex, mass_kg=mass)
        total = (
            body.pelvis_mass
            + 2 * body.thigh_mass
            + body.shank_mass
            + body.foot_mass
            + body.residual_shank_mass
            + body.prosthesis_mass
        )
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


def test_hip_centre_lies_where_hara_puts_it_for_a_leg_of_900_mm(subject):
    """Hara et al. 2016: 11 - 0.063 LL, -9 - 0.078 LL, 8 + 0.086 LL mm, LL from the spine, 79.2 mm
    over the hip, down to the malleolus: thigh and shank of 820.8 mm."""
    body = body_of(subject, thigh_length_m=0.420, shank_length_m=0.4008)
    assert (body.hip_forward, body.hip_up, body.hip_lateral) == pytest.approx(
        (-0.0457, -0.0792, 0.0854), abs=1e-9
    )


def test_residual_shank_goes_by_the_intact_one_and_the_pylon_makes_up_the_length(subject):
    table = DE_LEVA["male"]
    assert residual_volume_ratio(table, 1.0) == pytest.approx(1.0)
    assert 0.66 < residual_volume_ratio(table, 0.66) < 1.0, "the shank tapers downwards"
    standard = body_of(subject, shank_length_m=0.45)
    short = body_of(
        subject, shank_length_m=0.45, prosthesis_length_m=standard.prosthesis_length - 0.012
    )
    assert short.residual_length == standard.residual_length == pytest.approx(0.66 * 0.45)
    assert standard.pylon_length - short.pylon_length == pytest.approx(0.012)
    assert standard.prosthetic_leg_length == pytest.approx(standard.leg_length, rel=1e-14)


def test_a_heavier_prosthesis_takes_its_mass_from_nothing_but_the_trunk(subject):
    light, socket = body_of(subject), MODEL.socket
    heavy = scale_body(
        subject, MODEL.foot, replace(socket, socket_mass_kg=socket.socket_mass_kg + 0.3)
    )
    assert heavy.prosthesis_mass - light.prosthesis_mass == pytest.approx(0.3)
    assert light.pelvis_mass - heavy.pelvis_mass == pytest.approx(0.3)
    assert heavy.residual_shank_mass == light.residual_shank_mass


def test_bodies_that_cannot_be_are_refused_by_name(subject):
    for changes, message in (
        ({"shank_length_m": 0.15, "ankle_height_m": 0.02}, "no room.*or correct shank_length_m"),
        ({"prosthesis_length_m": 0.38}, "residual_length_ratio.*or correct prosthesis_length_m"),
    ):
        with pytest.raises(InputError, match=message):
            body_of(subject, **changes)
    with pytest.raises(InputError, match="legs and prosthesis weigh"):
        scale_body(
            replace(subject, mass_kg=20.0),
            replace(MODEL.foot, mass_kg=5.0),
            replace(MODEL.socket, socket_mass_kg=5.0),
        )


# How the foot sits under the pylon: signs by anatomy, order as the ankle's, the sole where it was
# measured.


SIDES = pytest.mark.parametrize("mirrored", [False, True], ids=["right", "left"])
ALL = FootPlacement(fore_aft=0.012, lateral=0.007, alignment=0.11, inversion=0.06, toe_out=0.15)


@SIDES
def test_a_trials_offsets_act_within_the_place_whatever_it_is(mirrored):
    """Offsets of a manifest mean the same foot-fixed change on any subject."""
    parameters = FootParameters()
    offsets = {
        "height": 0.004,
        "fore_aft": -0.006,
        "alignment": 0.03,
        "inversion": 0.05,
        "toe_out": -0.04,
    }
    plant = MultibodyPlant(0.0)
    place = plant.AddFrame(
        FixedOffsetFrame("place", plant.world_frame(), ALL.pose(mirrored=mirrored))
    )
    handles = add_foot(plant, place, parameters, side="left" if mirrored else "right")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    set_mount(context, handles, **offsets)
    seen = ALL.pose(mirrored=mirrored).inverse() @ handles.frame.EvalPoseInWorld(context)
    expected = mount_pose(parameters, **offsets, mirrored=mirrored).inverse()
    np.testing.assert_allclose(seen.GetAsMatrix34(), expected.GetAsMatrix34(), atol=1e-15)


@SIDES
def test_offsets_of_a_trial_turn_the_foot_as_the_place_of_a_subject_does(mirrored):
    """Alignment, inversion and toe-out about the mount have one order and one sign wherever they
    are told."""
    turns = {"alignment": 0.11, "inversion": 0.06, "toe_out": 0.15}
    offset = mount_pose(FootParameters(), **turns, mirrored=mirrored).inverse().rotation().matrix()
    placed = FootPlacement(**turns).pose(mirrored=mirrored).rotation().matrix()
    np.testing.assert_allclose(offset, placed, atol=1e-15)
