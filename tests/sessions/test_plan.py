"""session.csv: guessed from files, read as a spreadsheet leaves it, and what it must say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import FootParameters
from vsf_drake.sessions.found import BENCH, OTHER, STANDING, WALK, FoundFile, setting_in
from vsf_drake.sessions.plan import (
    PlanRow,
    guess,
    make_plan,
    missing,
    read_rows,
    unused,
    write_rows,
)
from vsf_drake.simulation.bench_stiffness import BenchStiffness

DAY_S = 86_400.0
FOOT = FootParameters()
PASSIVE = replace(FOOT, fulcrum=replace(FOOT.fulcrum, rearmost_m=0.1, foremost_m=0.1))


def found(name, role=WALK, **more):
    return FoundFile(path=Path(name), role=role, **more)


@pytest.mark.parametrize(
    ("name", "setting"),
    [
        ("66mm_1", "66"),
        ("walk 108 mm b", "108"),
        ("Gang 87,5mm", "87.5"),
        ("F108_walk3", "108"),
        ("p03_F66", "66"),
        ("fulcrum151 trial2", "151"),
        ("soft 2", "soft"),
        ("S01_Stiff03", "stiff"),
        ("walk12", ""),
        ("software check", ""),
        ("trial_66", ""),
        ("half108", ""),
    ],
)
def test_a_name_tells_the_setting_or_nothing(name, setting):
    assert setting_in(name) == setting


def test_the_standing_trial_nearest_in_time_is_taken_and_the_other_says_why_not():
    files = [
        found("new.c3d", STANDING, when_s=2 * DAY_S),
        found("old.c3d", STANDING, when_s=0.0),
        found("66mm.c3d", setting="66", when_s=1.9 * DAY_S),
        found("broken.c3d", OTHER, usable=False, remark="is truncated"),
    ]
    rows = {row.file: row for row in guess(files, FOOT)}
    assert rows["new.c3d"].use and not rows["old.c3d"].use
    assert "new.c3d" in rows["old.c3d"].remark and "2 days" in rows["old.c3d"].remark
    assert [row.file for row in unused(rows.values())] == ["old.c3d", "broken.c3d"]
    assert missing([*rows.values()], FOOT) == []


def test_a_walk_without_a_setting_is_asked_for_and_a_named_setting_gets_a_row():
    rows = guess(
        [
            found("walk.c3d"),
            found("soft 1.c3d", setting="soft"),
            found("soft 2.c3d", setting="soft"),
        ],
        FOOT,
    )
    assert [row.file for row in rows if row.role == "setting"] == ["soft"]
    unset, unplaced, standing = missing(rows, FOOT)
    assert "walk.c3d" in unset and "soft 1" not in unset
    assert "soft" in unplaced and "standing" in standing


def test_a_setting_typed_wrongly_is_named_with_the_files_that_name_it(tmp_path):
    path = tmp_path / "session.csv"
    path.write_text(
        "file,role,fulcrum_mm,use\nstatic.c3d,standing,,yes\na.c3d,walk,sotf,yes\n"
        "b.c3d,walk,Soft,\nc.c3d,walk,stif,yes\nSOFT,setting,66 MM,\n"
    )
    rows = read_rows(path)
    first, second = missing(rows, FOOT)
    assert "a.c3d" in first and "no setting sotf" in first
    assert "c.c3d" in second and "no setting stif." in second
    assert rows[2].fulcrum_mm == rows[4].file and rows[4].fulcrum_mm == "66 mm"


def test_rows_come_back_as_they_were_written(tmp_path):
    rows = [
        PlanRow(file='a, "b".c3d', role=WALK, fulcrum_mm="66", remark="Ä; none"),
        PlanRow(file="=cmd.c3d", role=OTHER, use=False),
        PlanRow(file="soft", role="setting", fulcrum_mm="66"),
    ]
    write_rows(tmp_path / "session.csv", rows)
    assert read_rows(tmp_path / "session.csv") == rows
    assert "\n'=cmd" in (tmp_path / "session.csv").read_text()


def test_a_spreadsheet_with_semicolons_and_decimal_commas_is_read(tmp_path):
    path = tmp_path / "session.csv"
    path.write_text("\ufefffile;role;fulcrum_mm;use\r\nG1.c3d;Walk;87,5 mm;Yes\r\n;;;\r\n")
    rows = read_rows(path)
    assert rows == [PlanRow(file="G1.c3d", role=WALK, fulcrum_mm="87,5 mm")]
    assert planned([found("G1.c3d")], rows).fulcrums_mm == (87.5,)


def test_a_table_saved_by_excel_keeps_its_letters(tmp_path):
    path = tmp_path / "session.csv"
    path.write_bytes("file;role;fulcrum_mm;use\r\nfrüh.c3d;walk;66;yes\r\n".encode("cp1252"))
    assert [row.file for row in read_rows(path)] == ["früh.c3d"]


@pytest.mark.parametrize("position", ["9", "300", "6 6"])
def test_a_position_that_the_fulcrum_cannot_have_is_refused_by_its_row(position):
    files = [STAND, found("a.c3d", setting=position)]
    with pytest.raises(InputError, match=r"session\.csv: a\.c3d, fulcrum_mm"):
        planned(files)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no column file"),
        ("file,role,fulcrum_mm\n", "has no column use"),
        ("file,role,fulcrum_mm,use\na.c3d,gait,66,yes\n", "line 2, role: 'gait' is no role"),
        ("file,role,fulcrum_mm,use\na.c3d,walk,66,ja\n", "line 2, use: 'ja'"),
        ("file,role,fulcrum_mm,use\na.c3d,walk,66,\na.c3d,walk,66,\n", "names a.c3d twice"),
    ],
)
def test_a_table_that_cannot_be_used_says_where(tmp_path, text, said):
    path = tmp_path / "session.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_rows(path)
    assert said in str(refused.value) and "session.csv" in str(refused.value)


def planned(files, rows=None):
    return make_plan(rows or guess(files, FOOT), files, Path("monday"), FOOT)


STAND = found("static.c3d", STANDING)


def test_walks_have_the_position_of_their_row_or_of_their_setting():
    files = [STAND, found("a.c3d", setting="soft"), found("b.c3d", setting="151")]
    rows = [
        row if row.role != "setting" else PlanRow(file="soft", role="setting", fulcrum_mm="66")
        for row in guess(files, FOOT)
    ]
    plan = planned(files, rows)
    assert plan.fulcrums_mm == (66.0, 151.0) and plan.standing == Path("static.c3d")


def test_a_setting_may_be_said_by_the_stiffness_that_the_bench_finds_there():
    rows = [
        PlanRow(file="a.c3d", role=WALK, fulcrum_mm="soft"),
        PlanRow(file="soft", role="setting", fulcrum_mm="16 n/mm"),
    ]
    [position_mm] = planned([found("a.c3d")], rows).fulcrums_mm
    bench = BenchStiffness(FOOT, fulcrums_m=[1e-3 * position_mm], heel=False)
    assert bench.evaluate({})[0] == pytest.approx([16e3], rel=1e-6)


def test_walks_on_a_passive_foot_need_no_setting_and_can_have_none():
    files = [STAND, found("a.c3d", setting="66")]
    rows = guess(files, PASSIVE)
    assert missing(rows, PASSIVE) == []
    plan = make_plan(rows, files, Path("monday"), PASSIVE)
    assert plan.fulcrums_mm == (100.0,), "where the model clamps it"
    for said in ("66", "16 n/mm", "soft"):
        stated = [rows[0], replace(rows[1], fulcrum_mm=said)]
        assert missing(stated, PASSIVE) == [], "it is not asked where that setting is"
        with pytest.raises(InputError, match=r"session\.csv: a\.c3d, fulcrum_mm: this foot has no"):
            make_plan(stated, files, Path("monday"), PASSIVE)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([{"subjects": ("Ann",)}, {"subjects": ("Ben",)}], "Ann (a.c3d); Ben (b.c3d)"),
        ([{"person": {"mass_kg": 60.0}}, {"person": {"mass_kg": 75.0}}], "60 kg and b.c3d 75 kg"),
        ([{"person": {"stature_m": 1.8}}, {"person": {"stature_m": 1.6}}], "1.6 m"),
    ],
)
def test_files_of_two_persons_are_refused_unless_those_of_one_are_left_out(more, said):
    files = [
        STAND,
        *(found(f"{name}.c3d", setting="66", **of) for name, of in zip("ab", more, strict=True)),
    ]
    with pytest.raises(InputError) as refused:
        planned(files)
    assert said in str(refused.value)
    rows = [
        row if row.file != "b.c3d" else PlanRow(file="b.c3d", role=WALK, use=False)
        for row in guess(files, FOOT)
    ]
    assert planned(files, rows).walks == (Path("a.c3d"),)


def test_a_row_without_its_file_is_refused_and_a_file_without_a_row_is_told():
    files = [STAND, found("a.c3d", setting="66"), found("new.c3d", setting="66")]
    rows = guess(files, FOOT)[:2]
    assert any("new.c3d" in note for note in planned(files, rows).notes)
    with pytest.raises(InputError, match="gone"):
        planned(files, [*rows, PlanRow(file="gone.c3d", role=WALK, fulcrum_mm="66")])


def test_rates_that_differ_and_a_standing_trial_of_another_day_are_told():
    files = [
        found("static.c3d", STANDING, when_s=0.0),
        found("a.c3d", setting="66", rate_hz=100.0, when_s=3 * DAY_S),
        found("b.c3d", setting="66", rate_hz=200.0, when_s=3 * DAY_S),
    ]
    days, rates = planned(files).notes
    assert "3 days away" in days and "100, 200 Hz" in rates


def test_of_two_benches_one_is_used():
    files = [
        STAND,
        found("bench.yaml", BENCH),
        found("curves.csv", BENCH),
        found("a.c3d", setting="66"),
    ]
    assert planned(files).bench == Path("curves.csv"), "curves tell more than their stiffness"
