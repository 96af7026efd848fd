"""`vsf-drake sweep`: which folders and trials it takes, and what it tells of doubtful walks and failing figures."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from command_line import read_json
from sweep_files import copied, rows

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.report import outputs

EMBEDDED = {path.stem: path for path in embedded_trials("exact")}
LOW, MEDIUM = EMBEDDED["low_1"], EMBEDDED["medium_1"]


@pytest.mark.parametrize("name", [r"a $\frac{ b_^ $ trial", "_a quiet trial"])
def test_a_name_with_signs_of_formulas_stands_in_the_figure_as_it_is(run, tmp_path, name):
    trial, out = copied(LOW, tmp_path / "trial", name=name), tmp_path / "sweep"
    assert run("sweep", trial, "--out", out, "--fulcrum-mm", 80, "--workers", 1)[0] == 0
    assert name in (out / "sweep.svg").read_text(encoding="utf-8")
    assert (out / "sweep.png").stat().st_size > 0


def test_a_figure_that_cannot_be_written_costs_neither_tables_nor_summary(run, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.EFBIG, "File too large")

    monkeypatch.setattr(outputs, "save_figure", full)
    out = tmp_path / "sweep"
    code, said, error = run("sweep", LOW, "--out", out, "--fulcrum-mm", 80, "--workers", 1)
    assert code == 2 and "cannot be written (File too large)" in error and "sweep.png" in error
    assert "1 walks, 0 failed" in said
    assert {"sweep.csv", "sweep.json", "cache"} == {path.name for path in out.glob("[!.]*")}


def test_doubts_about_a_walk_are_told_and_a_foot_in_the_air_is_never_the_best(run, tmp_path):
    words = ("sweep", LOW, "--workers", 1, "--vary")
    code, said, _ = run(*words, "offset.height=0,0.2", "--out", tmp_path / "a")
    assert code == 0 and "notes on 1 of 2 walks" in said and "at best, at offset.height 0\n" in said
    sound, doubtful = rows(tmp_path / "a")
    assert sound["notes"] == "" and "0.00 body weights" in doubtful["notes"]
    assert float(doubtful["peak_vertical_bw"]) == 0.0
    table = read_json(tmp_path / "a" / "sweep.json")
    assert table["with_notes"] == 1
    assert [(item["row"], " | ".join(item["notes"])) for item in table["notes"]] == [(2, doubtful["notes"])]
    code, said, _ = run(*words, "offset.height=0.2", "--out", tmp_path / "b")
    assert code == 0 and "at best" not in said and "no walk has a stance" in said


def test_a_sample_shifts_the_fulcrum_only_as_far_as_its_carriage_reaches(run, tmp_path):
    words = ("--sample", 4, "--vary", "fulcrum.shift", "--fulcrum-mm", "80,120", "--step-ms", 2, "--workers", 1)
    code, said, _ = run("sweep", LOW, "--out", tmp_path / "sweep", *words)
    assert code == 0 and "8 walks, 0 failed" in said
    bounds = read_json(tmp_path / "sweep" / "sweep.json")["plan"]["sample"]["bounds"]["fulcrum.shift"]
    assert bounds == pytest.approx([0.066 - 0.080, 0.151 - 0.120])
    _, said, _ = run("sweep", "--list", MEDIUM)  # at 108 mm
    [line] = [line for line in said.splitlines() if line.startswith("fulcrum.shift")]
    assert line.split()[3:5] == ["-0.042", "0.043"]


def test_a_folder_that_cannot_take_the_sweep_is_refused_and_left_alone(run, tmp_path):
    file, other = tmp_path / "file", tmp_path / "other"
    file.write_text("mine")
    other.mkdir()
    (tmp_path / "drawn" / "sweep.png").mkdir(parents=True)
    (other / "sweep.json").write_text('{"rows": 3}')
    for out, said in ((file, "is a file"), (file / "below", "file"), (other, "not the table of a sweep"),
                      (tmp_path / "drawn", "cannot be written (it is a folder)"), (Path("/proc/sweep"), "cannot be")):
        code, _, error = run("sweep", LOW, "--out", out, "--fulcrum-mm", 80, "--workers", 1)
        assert code == 2 and said in error and "Traceback" not in error
    assert file.read_text() == "mine"
    assert [path.name for path in other.iterdir()] == ["sweep.json"]


def test_a_folder_takes_a_larger_sweep_of_its_trials_but_none_of_others(run, tmp_path):
    out = tmp_path / "sweep"
    run("sweep", LOW, "--out", out, "--fulcrum-mm", "80,90", "--workers", 1)
    code, _, error = run("sweep", LOW, "--out", out, "--fulcrum-mm", "80,90,100", "--workers", 1)
    assert code == 0 and "2 from the cache" in error
    code, _, error = run("sweep", MEDIUM, "--out", out, "--fulcrum-mm", "80", "--workers", 1)
    assert code == 2 and "sweep of other trials" in error
    assert len(rows(out)) == 3


def test_trials_are_the_same_by_file_or_content_and_not_by_name(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out, first = tmp_path / "sweep", copied(LOW, tmp_path / "a", name="walk")
    words = ("--out", out, "--fulcrum-mm", "80", "--workers", 1)
    assert run("sweep", first, *words)[0] == 0
    assert run("sweep", first.relative_to(tmp_path), *words)[0] == 0
    assert run("sweep", copied(LOW, tmp_path / "b", name="walk"), *words)[0] == 0
    code, _, error = run("sweep", copied(MEDIUM, tmp_path / "c", name="walk"), *words)
    assert code == 2 and "sweep of other trials" in error
