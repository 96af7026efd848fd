"""Cells of the map: what equal load asks of their signs, alignment against slope, and loads of
one's own."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.device.stiffness_map import iso_22675, load_profile
from vsf_drake.device.stiffness_map.cells import Cell, roll_cells, with_heel
from vsf_drake.model.parameters import GRAVITY, FootParameters

STEP_S = 2e-3
FOOT = FootParameters()


def cell(mass_kg=80.0, slope_deg=0.0, fulcrum_mm=108.0, alignment_deg=0.0, heel_ratio=1.0):
    return Cell(
        mass_kg=mass_kg,
        slope_deg=slope_deg,
        fulcrum_mm=fulcrum_mm,
        alignment_deg=alignment_deg,
        heel_ratio=heel_ratio,
    )


def rolled(*cells, foot=FOOT):
    return [each.values for each in roll_cells(foot, iso_22675(STEP_S), cells)]


def test_under_equal_load_a_softer_setting_bends_more_stores_more_and_reaches_less_far():
    soft, middle, stiff = rolled(*(cell(fulcrum_mm=x) for x in (66.0, 108.0, 151.0)))
    for name, sign in (
        ("radius", 1),
        ("eflr", 1),
        ("moment_arm", 1),
        ("stored", -1),
        ("returned", -1),
    ):
        assert sign * soft[name] < sign * middle[name] < sign * stiff[name], name
    assert soft["loading_rate"] == stiff["loading_rate"], "the force is given"
    assert all(0.0 < each["returned"] < each["stored"] for each in (soft, middle, stiff)), (
        "energy is never created"
    )


def test_more_mass_stores_more_and_its_loading_rate_is_in_proportion():
    light, heavy = rolled(cell(mass_kg=60.0), cell(mass_kg=90.0))
    assert heavy["stored"] > light["stored"] and heavy["radius"] < light["radius"]
    assert heavy["loading_rate"] == pytest.approx(1.5 * light["loading_rate"], rel=1e-12)


def test_the_loading_rate_is_the_given_forces():
    load = iso_22675(STEP_S)
    normal = 80.0 * GRAVITY * load.force_bw / np.cos(load.tilt_rad)
    half = load.time_s <= 0.3
    steepest = max((normal[i + 10] - normal[i]) / 0.02 for i in range(half.sum() - 10))
    assert rolled(cell())[0]["loading_rate"] == pytest.approx(1e-3 * steepest, rel=1e-9)


def test_uphill_loads_the_forefoot_longer_and_a_toe_turned_up_undoes_it():
    """The ground turned by 4 degrees and the foot turned up by 4 meet at the same angle. The line
    of force does not: at the second peak, 20 degrees, the ground's force is larger by cos 20 / cos
    24, 3 %, and energy by twice that."""
    down, level, up, undone = rolled(
        cell(slope_deg=-4.0), cell(), cell(slope_deg=4.0), cell(slope_deg=4.0, alignment_deg=4.0)
    )
    assert down["moment_arm"] < level["moment_arm"] < up["moment_arm"]
    assert down["returned"] < level["returned"] < up["returned"]
    for name, apart in (("radius", 0.03), ("eflr", 0.03), ("stored", 0.07), ("returned", 0.07)):
        assert undone[name] == pytest.approx(level[name], rel=apart), name


def test_a_turned_foot_is_pressed_on_the_ground_by_what_the_force_along_the_pylon_makes_there():
    """The foot turned up as far as the ground meets it as on the level, and all that it knows is
    how hard: without friction F along the pylon, which leans against the ground's normal by tilt +
    slope, takes N = F / cos of that. So it is the level foot under the force N cos(tilt) along its
    own axis."""
    load, turned = iso_22675(STEP_S), 6.0
    pressed = dataclasses.replace(
        load,
        force_bw=load.force_bw * np.cos(load.tilt_rad) / np.cos(load.tilt_rad + np.radians(turned)),
    )
    (found,) = rolled(cell(slope_deg=turned, alignment_deg=turned))
    (level,) = roll_cells(FOOT, pressed, [cell()])
    assert found == pytest.approx(level.values, rel=1e-6)


def test_only_the_heel_takes_the_heels_ratio_and_loses_the_same_share_of_what_it_takes():
    """Stiffness and damping alike: a foam of the same material, whose time constant is its own."""
    softer = with_heel(FOOT, 0.5)
    for zone, own in zip(softer.zones, FOOT.zones, strict=True):
        ratio = 0.5 if own.name.startswith("heel") else 1.0
        assert (zone.stiffness, zone.damping_n_s_per_m) == (
            ratio * own.stiffness,
            ratio * own.damping_n_s_per_m,
        )
    bare = dataclasses.replace(
        FOOT, zones=tuple(zone for zone in FOOT.zones if not zone.name.startswith("heel"))
    )
    with pytest.raises(InputError, match="heel_ratio: the model has no contact zone"):
        with_heel(bare, 0.5)


def test_the_profile_of_the_standard_written_to_a_file_is_the_same_load(tmp_path):
    iso = iso_22675(STEP_S)
    path = tmp_path / "load.csv"
    rows = [
        f"{t},{np.degrees(tilt)},{force}"
        for t, tilt, force in zip(iso.time_s, iso.tilt_rad, iso.force_bw, strict=True)
    ]
    path.write_text("# mine\ntime_s,tilt_deg,force_bw\n" + "\n".join(rows))
    own = load_profile(path, STEP_S)
    np.testing.assert_allclose(own.force_bw, iso.force_bw, atol=1e-9)
    np.testing.assert_allclose(own.tilt_rad, iso.tilt_rad, atol=1e-9)
    assert (
        own.shape_ends_s == pytest.approx(iso.shape_ends_s, abs=STEP_S) and own.name == "load.csv"
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, a, f: (t, a, 800.0 * f), "divide newtons"),
        (lambda t, a, f: (1e3 * t, a, f), "lasts 600 s"),
        (lambda t, a, f: (t[::-1], a, f), "does not rise"),
        (lambda t, a, f: (t, 10.0 * a, f), "tilt_deg"),
        (lambda t, a, f: (t, a, f + 0.2), "begins with 0.2"),
        (lambda t, a, f: (t[:5], a[:5], f[:5]), "5 rows"),
        (lambda t, a, f: (t, a, f * np.nan), "blank"),
    ],
)
def test_what_is_no_stance_is_refused_in_one_line(tmp_path, change, said):
    iso = iso_22675(0.01)
    columns = change(iso.time_s, np.degrees(iso.tilt_rad), iso.force_bw)
    path = tmp_path / "load.csv"
    path.write_text(
        "time_s,tilt_deg,force_bw\n"
        + "\n".join(",".join(map(str, row)) for row in zip(*columns, strict=True))
    )
    with pytest.raises(InputError, match=said) as refused:
        load_profile(path)
    assert "\n" not in str(refused.value)


def test_a_file_of_other_columns_says_which_are_needed(tmp_path):
    path = tmp_path / "load.csv"
    path.write_text("t,tilt,force\n0,0,0\n")
    with pytest.raises(InputError, match="time_s, tilt_deg, force_bw"):
        load_profile(path)
