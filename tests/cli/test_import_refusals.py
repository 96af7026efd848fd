"""How `vsf-drake import` refuses what it cannot use, and what it asks for."""

from __future__ import annotations

import re

import pytest
from command_line import read_json
from made_laboratory import MADE, STATED, leftovers


@pytest.mark.parametrize(("missing", "option"), [("--prosthetic-side", "--prosthetic-side"), ("--sex", "--sex")])
def test_what_no_recording_tells_is_asked_for(run, laboratory, tmp_path, missing, option):
    words = list(STATED)
    at = words.index(missing)
    del words[at : at + 2]
    code, _, err = run("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out", *words)
    assert code == 2
    assert option in err
    assert not (tmp_path / "out").exists()


def test_one_bad_walk_does_not_spoil_the_others(run, laboratory, tmp_path):
    standing, good, bad = laboratory.standing(), laboratory.walk(), laboratory.walk("bad.trc")
    bad.write_bytes(bad.read_bytes()[:3000])
    out = tmp_path / "out"
    code, _, err = run("import", standing, bad, good, "--out", out, *STATED)
    assert code == 2
    assert "bad.trc" in err
    assert {path.name for path in out.glob("[!.]*")} == MADE
    table = read_json(out / "import.json")
    assert [trial["name"] for trial in table["trials"]] == ["walk"]
    [(path, why)] = table["failures"].items()
    assert path.endswith("bad.trc")
    assert why
    assert table["mark"] == "unusable"
    assert "bad.trc" in (out / "import.html").read_text(encoding="utf-8")


def test_only_bad_walks_leave_nothing_but_the_error(run, laboratory, tmp_path):
    walks = [laboratory.walk(f"walk{n}.trc", forces=False) for n in (1, 2)]
    code, _, err = run("import", laboratory.standing(), *walks, "--out", tmp_path / "out", *STATED)
    assert code == 2
    assert "walk1.trc" in err
    assert "walk2.trc" in err
    assert "--forces" in err
    assert not (tmp_path / "out").exists()
    assert not leftovers(tmp_path)


def test_gap_too_long_to_fill_names_marker_and_interval(run, laboratory, tmp_path):
    walk = laboratory.walk(hidden=("RCAL", "RMT2", "RMT5"))  # no marker of the foot is left to hold it
    code, _, err = run("import", laboratory.standing(), walk, "--out", tmp_path / "out", *STATED)
    assert code == 2
    assert re.search("RCAL|RMT2|RMT5", err)
    assert "1.000" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--fulcrum-mm", "300"), "reach"),
        (("--map", "none.yaml"), "none.yaml"),
        (("--forces", "none.mot"), "none.mot"),
        (("--hip", "guess"), "guess"),
        (("--window", "2", "1"), "window"),
        (("--cutoff-hz", "80"), "80"),
        (("--belt-speed-m-per-s", "nan"), "--belt-speed-m-per-s"),
        (("--subject", "none.yaml"), "--subject"),
    ],
)
def test_unusable_options_end_with_one_message_and_code_2(run, laboratory, tmp_path, words, said):
    code, _, err = run("import", laboratory.standing(), laboratory.walk(), "--out", tmp_path / "out", *STATED, *words)
    assert code == 2
    assert said in err
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_forces_must_be_as_many_as_walks(run, laboratory, tmp_path):
    walk = laboratory.walk()
    code, _, err = run("import", laboratory.standing(), walk, "--out", tmp_path / "out", *STATED, "--forces",
                       walk.with_suffix(".mot"), "--forces", walk.with_suffix(".mot"))
    assert code == 2
    assert "2 force files do not fit 1 walks" in err
