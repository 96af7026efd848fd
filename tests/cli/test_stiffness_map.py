"""`vsf-drake map`: asks a saved map again, makes one, and refuses in one line."""

from __future__ import annotations

import pytest
from command_line import exit_code, read_json
from made_map import made_map

from vsf_drake.device.stiffness_map import iso_22675, make
from vsf_drake.report.map_page import MAP, write_map


@pytest.fixture
def folder(tmp_path):
    mapped = made_map(
        lambda m, s, x: 0.1 + 0.003 * (x - 66.0) + 0 * m, tuple(i / 100.0 for i in range(91, 110))
    )
    write_map(tmp_path / "map", mapped.table, mapped.arrays)
    return tmp_path / "map"


def test_a_target_is_answered_from_the_saved_map_as_an_interval(folder, capsys):
    before = (folder / MAP.table).read_bytes()
    assert (
        exit_code(
            "map", "--out", folder, "--target", "stiffness=18", "--mass", "90", "--slope", "0"
        )
        == 0
    )
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "stiffness 18 N/mm at 90 kg, slope 0 deg: fulcrum 106.0 mm" in said
        and "for 90 % of the contacts" in said
    )
    assert "rolled at 106.0 mm: " in said and "no prescription" in said
    assert (folder / MAP.table).read_bytes() == before


def test_what_is_out_of_reach_has_its_nearest(folder, capsys):
    assert exit_code("map", "--out", folder, "--target", "radius=0.9", "--mass", "70") == 0
    assert "not reachable, nearest is 0.355 m with the fulcrum at 151.0 mm" in " ".join(
        capsys.readouterr().out.split()
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--target", "ankle=1"], "'ankle' is no target"),
        (["--target", "radius=much"], "no finite number"),
        (["--target", "radius"], "Give radius=NUMBER"),
        (["--target", "loading_rate=9"], "no fulcrum changes it"),
        (
            ["--target", "radius=0.2", "--slope", "12"],
            "12 is outside this map, which holds -6 to 6",
        ),
        (["--target", "radius=0.2", "--mass", "50,60"], "has 2 values"),
        (["--target", "radius=0.2", "--fulcrum-mm", "80"], "Leave it out"),
        (["--target", "radius=0.2", "--draws", "30"], "--draws: 30 is not that of the map"),
        (
            ["--target", "radius=0.2", "--model", "package://vsf_drake/soft_support.yaml"],
            "--model: is not what the map",
        ),
        (["--target", "radius=0.2", "--mass", "heavy"], "--mass: 'heavy'"),
    ],
)
def test_what_cannot_be_asked_is_one_line_and_exit_code_2(folder, capsys, words, said):
    assert exit_code("map", "--out", folder, *words) == 2
    error = capsys.readouterr().err
    assert said.replace("no finite", "not a finite") in error
    assert error.count("\n") == 2 and "\nguide: docs/guide/" in error


def test_help_names_the_number_of_draws_that_is_taken(capsys):
    assert exit_code("map", "--help") == 0
    assert f"[default: ({make.DRAWS}); x>=0]" in " ".join(
        capsys.readouterr().out.replace("│", " ").split()
    )


def test_a_folder_of_other_things_is_refused_before_anything_is_rolled(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    assert exit_code("map", "--out", tmp_path) == 2
    assert "other things" in capsys.readouterr().err


def test_a_map_of_ones_own_load_is_made_asked_and_shown_again(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(make, "HELD_OUT", 2)
    load, iso = tmp_path / "load.csv", iso_22675(0.01)
    load.write_text(
        "time_s,tilt_deg,force_bw\n"
        + "\n".join(
            f"{t},{57.29578 * a},{f}"
            for t, a, f in zip(iso.time_s, iso.tilt_rad, iso.force_bw, strict=True)
        )
    )
    words = ("map", "--out", tmp_path / "own", "--load", load)
    assert (
        exit_code(
            *words,
            "--mass",
            "80",
            "--slope",
            "0",
            "--fulcrum-mm",
            "66:151:4",
            "--draws",
            "0",
            "--workers",
            "1",
        )
        == 0
    )
    assert "fulcrum mm" in capsys.readouterr().out
    table = read_json(tmp_path / "own" / MAP.table)
    assert (
        table["load"]["name"] == "load.csv"
        and list(table["inputs"]) == ["--load load.csv"]
        and table["cells"] == 4
    )
    assert exit_code(*words, "--target", "radius=0.3") == 0
    assert exit_code("report", tmp_path / "own") == 0
    page = (tmp_path / "own" / "report.html").read_text(encoding="utf-8")
    assert page.index("does not prescribe") < page.index("<h1>")
