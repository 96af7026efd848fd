"""The section on rolling over: what physics asks of it, its force level, and its plain values."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from made_roll_over import embedded_roll_over
from made_study import embedded_study

from vsf_drake.analysis.validation.roll_over_section import (
    DURATION_S,
    _iso_row,
    force_share,
    iso_roll_over,
    roll_over_section,
    tilt_rad,
)
from vsf_drake.errors import InputError
from vsf_drake.files import plain
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.roll_over import RollOver


@pytest.fixture(scope="module")
def section():
    return embedded_roll_over()


def test_nothing_is_missing_of_the_embedded_walks(section):
    assert section.missing == ()
    json.dumps(plain(section.table), allow_nan=False)
    assert all("/" not in name and np.asarray(value).ndim == 1 for name, value in section.arrays.items())


def test_profile_is_followed_at_the_subjects_weight_which_is_said(section):
    iso = section.table["iso"]
    assert iso["force_n"] == pytest.approx(78.0 * GRAVITY)
    assert iso["force_from"] == "weight"
    assert iso["follows"]
    for row in iso["positions"]:
        force = section.arrays[f"iso_{row['fulcrum_mm']:.0f}_force_n"]
        assert np.abs(force - section.arrays["iso_wanted_n"]).max() < 0.01 * iso["force_n"]


def test_friction_changes_what_is_lost_and_hardly_the_shape(section):
    """Geometry is of the tilt and the deflection; friction, at most half of the normal force, acts across them."""
    iso = section.table["iso"]
    for smooth, rough in zip(iso["positions"], iso["with_friction"], strict=True):
        assert rough["radius_m"] == pytest.approx(smooth["radius_m"], rel=0.1)
        assert rough["lost_by_sliding_j"] > 1.0 > smooth["lost_by_sliding_j"] == 0.0
        assert rough["return_ratio"] < smooth["return_ratio"]


def test_softer_settings_deflect_more_store_more_and_roll_on_a_smaller_arc(section):
    for name, sign in (("deflection_forefoot_mm", -1), ("stored_forefoot_j", -1), ("radius_m", 1),
                       ("effective_foot_length_ratio", 1), ("dorsiflexing_moment_nm", 1)):
        assert np.all(sign * np.diff([row[name] for row in section.table["iso"]["positions"]]) > 0.0), name
    forefoot = [row for row in section.table["inclined"] if row["angle_deg"] > 0.0]
    assert np.all(np.diff([row["stiffness_n_per_mm"] for row in forefoot]) > 0.0)
    assert np.all(np.diff([row["energy_stored_j"] for row in forefoot]) < 0.0)


def test_fulcrum_has_no_part_at_the_heel(section):
    heel = [row for row in section.table["inclined"] if row["angle_deg"] < 0.0]
    assert np.ptp([row["displacement_mm"] for row in heel]) < 1e-3
    assert all(set(row["zones_loaded"]) <= {"heel_posterior", "heel"} for row in heel)


def test_energy_balance_of_the_profile_closes(section):
    """What is taken in, less what is given back, is lost or left, to rounding."""
    for row in section.table["iso"]["positions"]:
        assert row["energy_in_j"] - row["energy_out_j"] == pytest.approx(row["lost_j"] + row["left_j"], rel=1e-6)
        assert 0.0 < row["return_ratio"] < 1.0


def test_conditions_have_mean_and_count_and_no_sd_of_a_single_walk(section):
    conditions = section.table["conditions"]
    assert [row["fulcrum_mm"] for row in conditions] == [66.0, 108.0, 151.0]
    for row, walk in zip(conditions, section.table["walks"], strict=True):
        for side in ("model", "measured"):
            for name in ("radius_m", "effective_foot_length_ratio", "mean_moment_arm_m"):
                assert row[side][name] == {"mean": walk[side][name], "sd": None, "count": 1}


def test_larger_given_force_deflects_more():
    foot = embedded_study().model.foot
    rows = [iso_roll_over(foot, (0.108,), force_n=force, steps=300)[0][0] for force in (500.0, 900.0)]
    assert rows[1]["deflection_forefoot_mm"] > rows[0]["deflection_forefoot_mm"]
    assert rows[1]["stored_heel_j"] > rows[0]["stored_heel_j"]


@pytest.mark.parametrize("force", [0.0, -100.0, 1e6, np.nan])
def test_a_force_no_foot_is_tested_with_is_refused_by_name(force):
    study = embedded_study()
    wrong = replace(study, options=replace(study.options, iso_force_n=force))
    with pytest.raises(InputError, match="iso_force_n"):
        roll_over_section(wrong)


def test_with_friction_the_grounds_moment_about_the_mount_is_what_the_drive_holds():
    """But for the foot's own weight, at most at the foot's length, and an inertia with accelerations below g."""
    foot, time = embedded_study().model.foot, np.linspace(0.0, DURATION_S, 301)
    machine = RollOver(foot, friction=True)
    run, following = machine.roll(fulcrum_m=0.108, time_s=time, tilt_rad=tilt_rad(time),
                                  force_n=765.0 * force_share(time))
    moment = _iso_row(machine, run, following, 0.108)[1]["moment_nm"]
    loaded, most = following.wanted_n > 100.0, 2.0 * foot.mass_kg * GRAVITY * foot.length_m
    np.testing.assert_allclose(-run.load[loaded, 2], moment[loaded], atol=most)
    assert np.abs(run.mount[:, 1] * run.grf_W[:, 0]).max() > 10.0 * most, "friction has a part in it"


def test_same_foot_same_numbers_to_the_last_digit():
    foot = embedded_study().model.foot
    once, again = (iso_roll_over(foot, (0.108,), force_n=765.0, steps=300) for _ in range(2))
    assert plain(once[0]) == plain(again[0])
    for name, values in once[1].items():
        np.testing.assert_array_equal(again[1][name], values)
