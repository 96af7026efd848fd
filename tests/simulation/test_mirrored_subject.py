"""A left subject with unequal legs and a placed prosthesis walks as the mirror image of the right one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.walk import Walker

SUBJECT = Subject(
    mass_kg=71.0, stature_m=1.78, sex="male", prosthetic_side="right", thigh_length_m=0.44, shank_length_m=0.45,
    prosthetic_thigh_length_m=0.43, prosthesis_length_m=0.535, prosthesis_fore_aft_m=0.012, prosthesis_lateral_m=0.009,
    prosthesis_alignment_rad=0.04, prosthesis_inversion_rad=-0.03, prosthesis_toe_out_rad=0.12)
MIRROR = np.array([1.0, -1.0, 1.0])
START_S, END_S = 0.15, 0.40
"""Part of the motion in which the prosthetic foot comes down and rolls to flat."""


@pytest.fixture(scope="module")
def both(motion):
    walks = {}
    for side in ("right", "left"):
        walker = Walker(replace(SUBJECT, prosthetic_side=side), ModelParameters())
        walks[side] = walker.walk(motion(side), fulcrum_m=0.1, start_s=START_S, end_s=END_S)
    return walks["right"], walks["left"]


def test_unequal_legs_walk_as_their_mirror_image(both):
    right, left = both
    weight = SUBJECT.mass_kg * 9.81
    assert right.prosthetic.grf_W[:, 2].max() > 0.3 * weight
    assert np.abs(right.prosthetic.grf_W[:, 1]).max() > 0.02 * weight, "a planar walk would show nothing"
    np.testing.assert_allclose(left.prosthetic.grf_W * MIRROR, right.prosthetic.grf_W, atol=1e-8 * weight)
    np.testing.assert_allclose(left.prosthetic.cop_W * MIRROR, right.prosthetic.cop_W, atol=1e-9)
    np.testing.assert_allclose(-left.prosthetic.free_moment_nm, right.prosthetic.free_moment_nm, atol=1e-7)


def test_placement_moves_what_the_ground_sees(both, motion):
    """Without it (same lengths, standard place) the same walk loads the foot elsewhere: it is no dead parameter."""
    plain = replace(SUBJECT, prosthesis_fore_aft_m=None, prosthesis_lateral_m=None, prosthesis_alignment_rad=None,
                    prosthesis_inversion_rad=None, prosthesis_toe_out_rad=None)
    walk = Walker(plain, ModelParameters()).walk(motion("right"), fulcrum_m=0.1, start_s=START_S, end_s=END_S)
    difference = walk.prosthetic.grf_W[:, 2] - both[0].prosthetic.grf_W[:, 2]
    assert np.abs(difference).max() > 0.05 * SUBJECT.mass_kg * 9.81
