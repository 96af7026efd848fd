"""A foot by the clauses of published tests: what springs and rest say of the presses, the bench and
the map of the same foot, and that what was not read has no number."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import vsf_drake as vsf
from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import plain, record
from vsf_drake.device.bench_protocol import ProtocolTable, bench_protocol
from vsf_drake.device.inclined import press_inclined
from vsf_drake.device.protocols import PROTOCOLS, clauses_of
from vsf_drake.device.roll_over import iso_22675
from vsf_drake.device.stiffness_map.cells import Cell, roll_cells
from vsf_drake.model.parameters import GRAVITY, ModelParameters
from vsf_drake.model.setting import AtSetting
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.roll_over import RollOver, in_mount_frame

ROOT = Path(__file__).resolve().parents[2]
MODEL = ModelParameters()
LOAD_N = 600.0
SPEED_M_PER_S = 0.05 / 60.0
POSITIONS_M = (0.066, 0.151)


@pytest.fixture(scope="module")
def made():
    return {
        name: bench_protocol(MODEL, name, fulcrums_m=POSITIONS_M, load_n=LOAD_N)
        for name in PROTOCOLS
    }


def passive(model=MODEL):
    fixed = replace(model.foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    return replace(model, foot=replace(model.foot, fulcrum=fixed))


def values(protocol, part, quantity):
    [row] = [
        row
        for row in protocol.table.rows
        if (row.clause.part, row.clause.quantity) == (part, quantity)
    ]
    return row.values


def pressed(foot, angle_deg, *, speed_m_per_s=SPEED_M_PER_S):
    return press_inclined(
        RollOver(foot, friction=False),
        angle_deg=angle_deg,
        fulcrum_m=0.108,
        load_n=LOAD_N,
        speed_m_per_s=speed_m_per_s,
        steps_per_mm=160.0,
    )


# The presses.


def foam(foot, angle_deg):
    """Load (N) and energy (J) of a foot whose keel does not bend, over the displacement (m): its
    spheres are springs side by side, on a flat sole."""
    angle = np.radians(angle_deg)
    spheres = [
        (1e-3 * x, zone.radius_m, zone.stiffness, zone.exponent)
        for zone in foot.zones
        for x in zone.x_mm
    ]
    x, r, k, n = np.array(spheres).T
    height = -x * np.sin(angle) + r * np.cos(angle) - r
    height -= height.min()

    def load(d):
        return float(np.sum(k * np.maximum(d - height, 0.0) ** n))

    def energy(d):
        return float(np.sum(k * np.maximum(d - height, 0.0) ** (n + 1.0) / (n + 1.0)))

    return load, energy


@pytest.mark.parametrize("angle_deg", [-15.0, 0.0, 20.0])
def test_with_a_keel_that_does_not_bend_the_spheres_are_springs_side_by_side(angle_deg):
    keel = replace(MODEL.foot.keel, flexural_modulus_pa=1e12, thickness_m=0.03)
    support = replace(MODEL.foot.fulcrum, stiffness_n_per_m=1e9)
    foot = replace(MODEL.foot, keel=keel, fulcrum=support, mass_kg=1.2)
    row, _ = pressed(foot, angle_deg)
    load, energy = foam(foot, angle_deg)
    displacement = brentq(lambda d: load(d) - LOAD_N, 0.0, 0.1)
    at_200 = brentq(lambda d: load(d) - 200.0, 0.0, 0.1)
    assert row.displacement_mm == pytest.approx(1e3 * displacement, rel=5e-3)
    assert row.stiffness_n_per_mm == pytest.approx(0.4 / (displacement - at_200), rel=5e-3)
    assert row.energy_stored_j == pytest.approx(energy(displacement), rel=1e-2)


def test_the_energy_stored_is_that_up_to_the_load_however_coarse_the_steps():
    """Level and stiff a step of 1 / 40 mm goes 1 % beyond the load."""
    machine = RollOver(MODEL.foot, friction=False)
    coarse, fine = (
        press_inclined(
            machine,
            angle_deg=0.0,
            fulcrum_m=0.151,
            load_n=LOAD_N,
            speed_m_per_s=SPEED_M_PER_S,
            steps_per_mm=steps,
        )[0].energy_stored_j
        for steps in (40.0, 640.0)
    )
    assert coarse == pytest.approx(fine, rel=1e-3)


def test_what_a_press_gives_back_is_less_the_faster_it_is():
    """Losses are viscous: none at rest, more with speed, never more back than was stored."""
    slow, fast, faster = (
        pressed(MODEL.foot, -15.0, speed_m_per_s=speed)[1].returned_share
        for speed in (SPEED_M_PER_S, 10.0 * SPEED_M_PER_S, 20.0 * SPEED_M_PER_S)
    )
    assert 1.0 > slow > fast > faster > 0.0 and slow > 0.99


def test_the_fulcrum_has_a_part_under_the_toe_and_hardly_one_at_the_heel(made):
    soft, stiff = values(made["aopa"], "toe", "displacement_mm")
    assert soft > 1.5 * stiff
    soft, stiff = values(made["aopa"], "heel", "displacement_mm")
    assert soft == pytest.approx(stiff, rel=1e-2)


def test_it_is_told_that_the_sole_comes_down_at_the_soft_setting(made):
    """A keel that bends by more than the sole is high over the platen behind the toe."""
    zones = {(each.part, each.setting): each.zones for each in made["aopa"].table.bearing}
    assert zones["toe", "151 mm"] == ("forefoot",)
    assert set(zones["toe", "66 mm"]) > {"midfoot", "forefoot"}


@pytest.mark.parametrize("fulcrum_m", POSITIONS_M)
def test_under_the_toe_the_load_moves_back_along_the_sole_as_the_foot_bends(fulcrum_m):
    """Which is why its slope above 200 N is steeper than that of a load that stays on a point."""
    run = RollOver(MODEL.foot, friction=False).press(
        fulcrum_m=fulcrum_m,
        pitch_rad=-np.radians(20.0),
        max_load_n=LOAD_N,
        speed_m_per_s=SPEED_M_PER_S,
        steps_per_mm=40.0,
    )
    load = run.grf_W[:, 2]
    place = MODEL.foot.pylon_x_m + in_mount_frame(run.cop_W, run.mount)[:, 0]
    first, middle, last = (place[np.argmax(load >= share * load.max())] for share in (0.1, 0.4, 1))
    assert first > middle > last
    assert first > MODEL.foot.load_point_m


# The same numbers as the bench and the map have.


def test_the_bench_beside_it_is_that_of_the_same_foot(made):
    table = made["iso16955"].table.bench
    others = BenchStiffness(MODEL.foot, fulcrums_m=POSITIONS_M, heel=False).evaluate({})[0]
    own = [row.stiffness_n_per_mm for row in table.settings]
    np.testing.assert_allclose(own, 1e-3 * others, rtol=1e-2)
    assert table.heel_stiffness_n_per_mm == pytest.approx(65.0, rel=1e-2)
    assert vsf.bench_table(vsf.run_bench(MODEL, fulcrums_m=POSITIONS_M)).settings == table.settings


@pytest.mark.parametrize("name", ["iso16955", "iso22675"])
def test_the_roll_over_is_that_of_the_map_at_the_same_load(made, name):
    cells = [
        Cell(
            mass_kg=LOAD_N / GRAVITY,
            slope_deg=0.0,
            fulcrum_mm=1e3 * position,
            alignment_deg=0.0,
            heel_ratio=1.0,
        )
        for position in POSITIONS_M
    ]
    mapped = [each.values for each in roll_cells(MODEL.foot, iso_22675(), cells)]
    for quantity, other, factor in (
        ("radius_m", "radius", 1.0),
        ("effective_foot_length_ratio", "eflr", 1.0),
        ("mean_moment_arm_m", "moment_arm", 1e3),
        ("stored_forefoot_j", "stored", 1.0),
    ):
        own = factor * np.array(values(made[name], "stance", quantity))
        np.testing.assert_allclose(own, [cell[other] for cell in mapped], rtol=1e-2)


def test_the_roll_over_shape_ends_with_the_second_peak_of_the_force(made):
    """Later the load only leaves the toe."""
    profile = iso_22675()
    late = profile.time_s > 0.5 * profile.time_s[-1]
    peak_s = profile.time_s[late][np.argmax(profile.force_bw[late])]
    for i in range(len(POSITIONS_M)):
        forward = made["iso22675"].arrays[f"forward_m/{i}"]
        time_s = np.linspace(0.0, profile.time_s[-1], len(forward))
        assert time_s[np.isfinite(forward)][-1] == pytest.approx(peak_s, abs=3e-3)


def test_more_load_bends_more_and_the_roll_over_takes_it_too():
    heavy = bench_protocol(MODEL, "iso16955", fulcrums_m=[0.151], load_n=1000.0)
    light = bench_protocol(MODEL, "iso16955", fulcrums_m=[0.151], load_n=500.0)
    for part, quantity in (("toe", "displacement_mm"), ("stance", "dorsiflexing_moment_nm")):
        assert values(heavy, part, quantity)[0] > values(light, part, quantity)[0]


# What is not known.


def test_all_clauses_of_16955_stand_there_and_those_out_of_the_plane_have_no_number(made):
    rows = made["iso16955"].table.rows
    answered = {row.clause.clause for row in rows if row.computed}
    blank = {row.clause.clause for row in rows if not row.computed}
    assert answered == {"7.1", "7.2"} and blank == {"7.3", "7.4", "8", "Annex A", "Annex B"}
    assert {row.clause.part for row in rows if row.clause.clause == "7.1"} == {
        "heel",
        "mid-foot",
        "toe",
    }


@pytest.mark.parametrize("name", PROTOCOLS)
def test_a_clause_has_a_number_or_a_reason_and_a_source_in_any_case(made, name):
    for row in made[name].table.rows:
        clause = row.clause
        assert clause.source and clause.test and bool(clause.why_not) != row.computed
        if row.computed:
            assert len(row.values) == len(POSITIONS_M) and all(np.isfinite(row.values))
            assert "choice" in clause.conditions and clause.unit and clause.label
        else:
            assert row.values == () and clause.angle_deg is None and not clause.conditions


def test_no_limit_of_aopa_is_claimed_and_codes_do_not_follow(made):
    rows = made["aopa"].table.rows
    assert all("no limit" in row.clause.follows for row in rows if row.computed)
    codes = [row for row in rows if row.clause.clause == "codes"]
    assert len(codes) == 4 and not any(row.computed for row in codes)


def test_what_the_foot_does_not_bear_is_told_and_has_no_number(monkeypatch):
    def gives_way(*_, angle_deg, **more):
        if angle_deg > 0.0:
            raise SimulationError("the foot gave way", time_s=1.0)
        return press_inclined(*_, angle_deg=angle_deg, **more)

    monkeypatch.setattr("vsf_drake.device.bench_protocol.press_inclined", gives_way)
    made = bench_protocol(MODEL, "aopa", fulcrums_m=[0.108])
    assert values(made, "toe", "displacement_mm") == (None,)
    assert values(made, "heel", "displacement_mm")[0] > 0.0
    [sentence] = made.table.missing
    assert "toe, 108 mm" in sentence and "gave way" in sentence
    assert "load_n/toe_0" not in made.arrays


def test_a_load_that_the_level_bench_does_not_bear_leaves_the_clauses_their_numbers():
    """At 66 mm under 4900 N the keel turns by more than the model means anything for."""
    made = bench_protocol(MODEL, "aopa", fulcrums_m=[0.066], load_n=4900.0)
    assert made.table.bench is None
    [sentence] = made.table.missing
    assert sentence.startswith("The level bench beside the clauses, to 4900 N: ")
    assert values(made, "heel", "displacement_mm")[0] > 0.0
    assert record(ProtocolTable, json.loads(json.dumps(plain(made.table)))) == made.table


# A passive foot, the record, bad input, time.


def test_what_a_passive_foot_does_not_bear_is_told_without_a_fulcrum():
    softer = tuple(replace(zone, stiffness=0.02 * zone.stiffness) for zone in MODEL.foot.zones)
    model = passive(replace(MODEL, foot=replace(MODEL.foot, zones=softer)))
    missing = bench_protocol(model, "iso16955", load_n=2000.0).table.missing
    assert sum("gave way" in sentence and "(foot passive)" in sentence for sentence in missing) == 3
    assert not any("fulcrum" in sentence for sentence in missing)


def test_a_passive_foot_has_one_setting_that_is_called_by_no_millimetres():
    table = bench_protocol(passive(), "iso16955").table
    assert table.settings == (AtSetting(fulcrum_mm=None, foot="passive"),)
    reach = replace(MODEL.foot.fulcrum, rearmost_m=0.1)  # what lies behind it is on the rigid frame
    movable = replace(MODEL, foot=replace(MODEL.foot, fulcrum=reach))
    same = bench_protocol(movable, "iso16955", fulcrums_m=[0.1]).table
    assert [row.values for row in table.rows] == [row.values for row in same.rows]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_record_comes_back_from_json_as_it_was(made, name):
    table = made[name].table
    assert record(ProtocolTable, json.loads(json.dumps(plain(table)))) == table


@pytest.mark.parametrize(
    ("model", "changed", "why"),
    [
        (MODEL, {"protocol": "iso10328"}, "Choose one of iso16955, iso22675, aopa"),
        (MODEL, {"fulcrums_m": [0.2]}, "out of the carriage's reach"),
        (MODEL, {"fulcrums_m": []}, "is empty"),
        (MODEL, {"fulcrums_m": [0.1, 0.1]}, "twice"),
        (MODEL, {"load_n": 150.0}, "choose between 200 and 5000 N"),
        (MODEL, {"load_n": float("nan")}, "choose between 200 and 5000 N"),
        (MODEL, {"speed_m_per_s": 0.0}, "not a platen speed"),
        (passive(), {"fulcrums_m": [0.1]}, "this foot has no fulcrum"),
    ],
)
def test_bad_input_is_refused_by_name(model, changed, why):
    asked = {"protocol": "aopa"} | changed
    with pytest.raises(InputError, match=why):
        bench_protocol(model, **asked)


def test_protocols_are_data_with_a_title_and_known_words():
    for name in PROTOCOLS:
        for clause in clauses_of(name):
            assert clause.part in ("heel", "mid-foot", "toe", "stance", "")
            assert bool(clause.axis) == (clause.axis_end is not None)


def test_five_settings_take_less_than_ten_seconds_of_processor_time(made):
    began = time.process_time()
    table = bench_protocol(MODEL, "iso16955").table
    assert len(table.settings) == 5
    assert table.processor_s <= time.process_time() - began < 10.0


def test_the_numbers_of_the_guide_are_those_of_the_foot(made):
    page = (ROOT / "docs" / "guide" / "protocols.md").read_text(encoding="utf-8")
    toe = values(made["iso16955"], "toe", "stiffness_n_per_mm")
    bench = [row.stiffness_n_per_mm for row in made["iso16955"].table.bench.settings]
    said = (
        f"at 66 and 151 mm it has {toe[0]:.1f} and {toe[1]:.1f} N/mm where the level bench has "
        f"{bench[0]:.1f} and {bench[1]:.1f}"
    )
    assert said in " ".join(page.split())
    returned = [
        share
        for part in ("heel", "mid-foot", "toe")
        for share in values(made["iso16955"], part, "returned_share")
    ]
    assert min(returned) >= 0.99 and "gives back 99 % or more" in page
    assert "-15° and +20°" in page and "over 0.6 s" in page
    assert {clause.angle_deg for clause in clauses_of("aopa")} == {-15.0, 20.0, None}
    for name in PROTOCOLS:
        for row in made[name].table.rows:
            for link in re.findall(r"https://[^;\s]+", row.clause.source):
                assert link in page
