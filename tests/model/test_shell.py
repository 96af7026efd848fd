"""A shell of another length over the same device."""

from __future__ import annotations

import dataclasses

import pytest

from vsf_drake.base.schema import to_plain
from vsf_drake.model.contact_file import model_with
from vsf_drake.model.model_file import check_fulcrum, foam_under_load, in_shell
from vsf_drake.model.parameters import ModelParameters

FOOT = ModelParameters().foot
LENGTHS_M = [0.22, 0.225, 0.23, 0.255, 0.26, 0.265, 0.275, 0.28, 0.30]
"""Among them those at which spheres pass the ends of the platen and of the heel block."""


@pytest.mark.parametrize("length_m", LENGTHS_M)
def test_a_shell_of_another_length_holds_the_same_device(length_m):
    """Feet are sold from 22 to 30 cm; the keel, its fulcrum and how far that reaches are one
    size."""
    foot = in_shell(FOOT, length_m)
    assert (foot.keel, foot.fulcrum, foot.load_point_m, foot.pylon_x_m) == (
        FOOT.keel,
        FOOT.fulcrum,
        FOOT.load_point_m,
        FOOT.pylon_x_m,
    )
    assert foot.length_m == length_m
    for reach_m in (0.066, 0.151):
        assert check_fulcrum(reach_m, foot) == reach_m
    contact_m = [1e-3 * x for zone in foot.zones for x in zone.x_mm]
    assert foot.heel_x_m <= min(contact_m) and max(contact_m) <= foot.heel_x_m + length_m, (
        "within the shell"
    )
    # carriage and keel
    shell_kg = [each.mass_kg - 0.1 - 1850 * 0.229 * 0.0684 * 0.00635 for each in (FOOT, foot)]
    assert shell_kg[1] / shell_kg[0] == pytest.approx(length_m / 0.245)


def test_a_shell_of_the_models_length_is_the_models_foot():
    assert in_shell(FOOT, FOOT.length_m) == FOOT
    assert in_shell(FOOT, 1e-3 * 245.0) == FOOT
    assert "shell_ratio" not in to_plain(FOOT)


@pytest.mark.parametrize("length_m", LENGTHS_M)
def test_a_longer_shell_has_so_much_more_of_the_same_foam(length_m):
    """Stiffness along the sole (N/m by m) does not change; nor does the loss of a cycle, which the
    damping over the stiffness decides."""
    foot = in_shell(FOOT, length_m)
    per_m = [
        sum(zone.stiffness * len(zone.x_mm) for zone in each.zones) / each.length_m
        for each in (FOOT, foot)
    ]
    assert per_m[1] == pytest.approx(per_m[0])
    for own, other in zip(FOOT.zones, foot.zones, strict=True):
        assert other.damping_n_s_per_m / other.stiffness == pytest.approx(
            own.damping_n_s_per_m / own.stiffness
        )


@pytest.mark.parametrize("length_m", LENGTHS_M)
def test_under_the_benchs_platen_a_shell_of_another_length_has_the_same_foam(length_m):
    """The platen is as long as it was, and so much stiffness as lies along it (N/m by m) does not
    change."""
    foot = in_shell(FOOT, length_m)
    assert foam_under_load(foot) == pytest.approx((FOOT.series_stiffness_n_per_m, 1.0))
    # the same where a contact fitted in the shell makes its foam twice as stiff
    fitted = model_with(
        dataclasses.replace(ModelParameters(), foot=foot),
        {"contact.forefoot.stiffness": 2.0 * foot.zones[-1].stiffness},
    )
    assert fitted.foot.series_stiffness_n_per_m == pytest.approx(
        2.0 * FOOT.series_stiffness_n_per_m
    )


def test_a_shell_on_a_shell_is_that_shell():
    there_and_back = in_shell(in_shell(FOOT, 0.30), 0.225)
    assert there_and_back.shell_ratio == pytest.approx(225.0 / 245.0)
    assert foam_under_load(there_and_back) == pytest.approx(foam_under_load(FOOT))
