"""`vsf-drake sweep`: from words to values, what it writes and where, how it goes on, and how it
refuses."""

from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas
import pytest
from command_line import exit_code, read_json
from sweep_files import copied, rows

from vsf_drake.base.errors import InputError
from vsf_drake.cli.sweep import MANY, MOST, axis, check_count, places_said, values_of
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.report import outputs
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.offsets import OffsetFit

EMBEDDED = {path.stem: path for path in embedded_trials("exact")}
LOW, MEDIUM = EMBEDDED["low_1"], EMBEDDED["medium_1"]
COLUMNS = [
    "grf_rmse_bw",
    "cop_rmse_fl",
    "cop_ml_rmse_fl",
    "vertical_impulse_error",
    "peak_vertical_bw",
    "unconverged_steps",
    "refined_steps",
    "failure",
    "notes",
]
STIFFNESS = "contact.forefoot.stiffness"

HEEDING_CTRL_C = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from vsf_drake.cli import main
main()
"""


def test_a_range_holds_both_ends_and_count_values():
    assert values_of("66:151:5", "") == pytest.approx(np.linspace(66.0, 151.0, 5))
    assert values_of("66,87,108", "") == (66.0, 87.0, 108.0) and values_of("108", "") == (108.0,)
    assert axis("offset.height=-0.01:0.01:3", sampled=False).values == (-0.01, 0.0, 0.01)
    assert axis("offset.height", sampled=True).values == ()
    assert axis("offset.height=-0.01:0.02", sampled=True).values == (-0.01, 0.02)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("66:66:5", "does not rise"),
        ("66:151:-3", "-3 values"),
        ("66:151:1", "single value alone"),
        ("66:151:1000000000", "1000000000 values"),
        ("66:151:2.5", "whole number"),
        ("66:80:90:3", "no range"),
        ("66:inf:5", "finite"),
        ("66,,87", "finite"),
        ("66,66", "twice"),
        ("soft", "'soft'"),
    ],
)
def test_what_is_no_range_is_refused(text, said):
    with pytest.raises(InputError, match=said) as caught:
        values_of(text, "--fulcrum-mm")
    assert caught.value.where == "--fulcrum-mm"


def test_stiffnesses_are_a_list_and_no_range():
    assert places_said("12N/mm, 16 N/mm") == ["12N/mm", "16 N/mm"]
    with pytest.raises(InputError, match="stiffnesses are a list, 12N/mm,16N/mm"):
        places_said("12N/mm:16N/mm:3")


def test_grids_need_values_and_samples_bounds():
    for text, sampled, said in (
        ("offset.height", False, "no values"),
        ("offset.height=0:1:5", True, "no bounds"),
        ("offset.height=1:0", True, "does not rise"),
        ("offset.height=", False, "finite"),
    ):
        with pytest.raises(InputError, match=said):
            axis(text, sampled=sampled)


def test_thousands_of_walks_have_to_be_meant_and_tens_of_thousands_are_refused():
    check_count(MANY, meant=False)
    check_count(MOST, meant=True)
    with pytest.raises(InputError, match="--yes"):
        check_count(MANY + 1, meant=False)
    with pytest.raises(InputError, match="at a time"):
        check_count(MOST + 1, meant=True)


def test_a_row_says_what_simulate_says_of_the_same_walk(run, tmp_path):
    step = ("--step-ms", 2)
    code, out, _ = run(
        "sweep",
        MEDIUM,
        "--out",
        tmp_path / "sweep",
        "--fulcrum-mm",
        "108,120",
        "--workers",
        1,
        *step,
    )
    assert code == 0 and "2 walks, 0 failed" in out
    run("simulate", MEDIUM, "--out", tmp_path / "walk", "--no-replay", "--contact", "none", *step)
    metrics = read_json(tmp_path / "walk" / "metrics.json")
    first, second = rows(tmp_path / "sweep")
    assert list(first) == ["trial", "fulcrum_mm", *COLUMNS]
    assert (first["trial"], first["failure"]) == (load_trial(MEDIUM).name, "")
    assert (float(first["fulcrum_mm"]), float(second["fulcrum_mm"])) == (108.0, 120.0)
    for name in ("grf_rmse_bw", "cop_rmse_fl", "cop_ml_rmse_fl", "vertical_impulse_error"):
        assert float(first[name]) == pytest.approx(metrics[name], rel=1e-9)
        assert float(second[name]) != pytest.approx(metrics[name], rel=1e-3)
    peaks = [
        max(stance["model_peaks_bw"][f"vertical_{half}_half"] for half in ("first", "second"))
        for stance in metrics["stances"]
    ]
    assert float(first["peak_vertical_bw"]) == pytest.approx(max(peaks), rel=1e-9)


def test_one_varied_quantity_gets_a_figure_and_two_get_none(run, tmp_path):
    out = tmp_path / "sweep"
    assert run("sweep", LOW, MEDIUM, "--out", out, "--fulcrum-mm", "66,87", "--workers", 1)[0] == 0
    assert read_json(out / "sweep.json")["plan"]["fulcrum_mm"] == [66.0, 87.0]
    assert {"sweep.png", "sweep.svg", "sweep.csv", "sweep.json", "cache"} == {
        p.name for p in out.glob("[!.]*")
    }
    svg = (out / "sweep.svg").read_text(encoding="utf-8")
    assert "SYNTHETIC" in svg and load_trial(LOW).name in svg and "(mm)" in svg
    assert len(rows(out)) == 4
    words = ("--vary", f"{STIFFNESS}=1e4,2e4", "--vary", "offset.height=-0.002,0.002")
    assert run("sweep", LOW, MEDIUM, "--out", out, "--workers", 1, "--parquet", *words)[0] == 0
    assert {"sweep.csv", "sweep.json", "sweep.parquet", "cache"} == {
        p.name for p in out.glob("[!.]*")
    }
    saved = pandas.read_parquet(out / "sweep.parquet")[STIFFNESS]
    assert saved.tolist() == [float(row[STIFFNESS]) for row in rows(out)]
    found = [(float(row[STIFFNESS]), float(row["offset.height"])) for row in rows(out)]
    assert found == 2 * [(1e4, -2e-3), (1e4, 2e-3), (2e4, -2e-3), (2e4, 2e-3)]


def test_the_table_holds_what_it_takes_to_repeat_a_sample(run, tmp_path):
    words = (
        "sweep",
        LOW,
        "--sample",
        3,
        "--seed",
        5,
        "--vary",
        STIFFNESS,
        "--vary",
        "offset.height=-0.004:0.004",
        "--workers",
        1,
        "--step-ms",
        2,
    )
    assert run(*words, "--out", tmp_path / "a")[0] == 0
    assert run(*words, "--out", tmp_path / "b")[0] == 0
    assert (tmp_path / "a" / "sweep.csv").read_bytes() == (
        tmp_path / "b" / "sweep.csv"
    ).read_bytes()
    table = read_json(tmp_path / "a" / "sweep.json")
    assert table["plan"]["sample"]["seed"] == 5 and table["plan"]["step_ms"] == 2
    assert table["plan"]["sample"]["bounds"]["offset.height"] == [-0.004, 0.004]
    assert table["columns"][STIFFNESS]["unit"].startswith("N/m")
    heights = sorted(float(row["offset.height"]) for row in rows(tmp_path / "a"))
    third = 0.008 / 3  # a Latin hypercube meets each third of the range once
    assert all(
        -0.004 + i * third <= height <= -0.004 + (i + 1) * third for i, height in enumerate(heights)
    )


def test_code_3_and_a_table_if_every_walk_fails(run, tmp_path):
    code, out, _ = run(
        "sweep",
        LOW,
        "--out",
        tmp_path / "sweep",
        "--vary",
        "coordinate.pelvis_ty=-0.6",
        "--workers",
        1,
    )
    assert code == 3 and "1 walks, 1 failed" in out
    assert "failed at t" in rows(tmp_path / "sweep")[0]["failure"]
    assert not list((tmp_path / "sweep").glob("sweep.[ps][nv]g"))  # a figure would be empty


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--fulcrum-mm", "66:300:3"), "out of the carriage's reach"),
        (("--vary", "contact.heel.stifness=1e4,2e4"), "Did you mean contact.heel.stiffness"),
        (("--vary", "friction.mu_static=-1:1:3"), "--vary friction.mu_static: -1.0 is not usable"),
        (("--vary", "friction.mu_static=0.1", "--vary", "friction.mu_static=0.2"), "stands twice"),
        (("--vary", "offset.height=-1:1:20000"), "--yes"),
        (("--sample", 5), "nothing to vary"),
        (("--fulcrum-mm", 80, "--step-ms", 0), "--step-ms: 0 ms is outside its"),
        (("--vary", "qqq=1,2"), "--list prints the names"),
        (("--sample", 3, "--vary", "fulcrum.shift", "--fulcrum-mm", "66,151"), "no room"),
    ],
)
def test_what_cannot_be_swept_is_refused_before_anything_is_written(run, tmp_path, words, said):
    code, _, error = run("sweep", LOW, "--out", tmp_path / "sweep", *words)
    assert code == 2
    assert said in error and "Traceback" not in error
    assert not (tmp_path / "sweep").exists()


def test_doubled_trials_and_a_missing_folder_are_refused(run, tmp_path):
    for words, said in (((LOW, LOW, "--out", tmp_path / "x"), "stands twice"), ((LOW,), "--out")):
        code, _, error = run("sweep", *words, "--fulcrum-mm", 80)
        assert code == 2 and said in error and "Traceback" not in error


SWEPT = ("--fulcrum-mm", "66:151:160", "--workers", "2", "--step-ms", "2")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("sweep") / "whole"
    assert exit_code("sweep", LOW, "--out", out, *SWEPT) == 0
    return out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "ended"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_who_ends_a_sweep_is_told_how_to_go_on_and_the_same_command_does(
    run, tmp_path, whole, number, ended
):
    words = ["sweep", LOW, "--out", tmp_path / "sweep", *SWEPT]
    first = subprocess.Popen(
        [sys.executable, "-c", HEEDING_CTRL_C, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while len(list((tmp_path / "sweep").rglob("*.npz"))) < 2 and first.poll() is None:
        time.sleep(0.02)
    os.kill(first.pid, number)
    _, error = first.communicate(timeout=60)
    assert first.returncode == ended
    assert "the same command goes on" in " ".join(error.split()) and "Traceback" not in error
    assert [path.name for path in (tmp_path / "sweep").iterdir()] == ["cache"]
    code, _, error = run(*words)
    [kept] = set(re.findall(r"(\d+) from the cache", error))
    assert code == 0 and 0 < int(kept) < 160
    assert (tmp_path / "sweep" / "sweep.csv").read_bytes() == (whole / "sweep.csv").read_bytes()


def test_names_with_formula_signs_or_twins_are_told_apart_by_file_and_a_lost_walk_by_its_reason(
    run, tmp_path
):
    name, out = r"_a $\frac{ b_^ $ trial", tmp_path / "sweep"
    twins = [
        copied(LOW, tmp_path / folder, name=name, prosthesis={"fulcrum_mm": mm})
        for folder, mm in (("a", 66), ("b", 80))
    ]
    code, said, _ = run(
        "sweep", *twins, "--out", out, "--vary", "fulcrum.shift=-0.01,0.02", "--workers", 1
    )
    assert code == 0 and "4 walks, 1 failed" in said
    found = rows(out)
    assert [row["trial"] for row in found] == [
        f"{name} ({path})" for path in twins for _ in range(2)
    ]
    assert "out of the carriage's reach" in found[0]["failure"] and found[0]["grf_rmse_bw"] == ""
    assert float(found[1]["grf_rmse_bw"]) > 0.0 and found[1]["failure"] == ""
    svg = (out / "sweep.svg").read_text(encoding="utf-8")
    assert name in svg and "1 FAILED" in svg and (out / "sweep.png").stat().st_size > 0


@pytest.mark.parametrize("what", ["save_figure", "write_csv"])
def test_a_full_disk_leaves_the_whole_sweep_or_nothing_and_the_walks_to_go_on_from(
    run, tmp_path, monkeypatch, what
):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    words, out = ("sweep", LOW, "--fulcrum-mm", 80, "--workers", 1), tmp_path / "sweep"
    with monkeypatch.context() as disk:
        disk.setattr(outputs, what, full)
        code, said, error = run(*words, "--out", out)
    assert (
        code == 2
        and "cannot be written (No space left on device)" in error
        and "the same command" in error
    )
    assert "written to" not in said
    assert {path.name for path in out.glob("[!.]*")} == {"cache"}
    code, said, error = run(*words, "--out", out)
    assert code == 0 and "1 walks, 0 failed" in said and "1 from the cache" in error
    assert {"sweep.csv", "sweep.json", "sweep.png", "sweep.svg", "cache"} == {
        path.name for path in out.glob("[!.]*")
    }


def test_doubts_about_a_walk_are_told_and_a_foot_in_the_air_is_never_the_best(run, tmp_path):
    words = ("sweep", LOW, "--workers", 1, "--vary")
    code, said, _ = run(*words, "offset.height=0,0.2", "--out", tmp_path / "a")
    assert code == 0 and said.startswith("! UNFITTED: the foot is a first guess")
    assert "at best, at offset.height 0 ! 1 of 2 walks have notes" in " ".join(said.split())
    sound, doubtful = rows(tmp_path / "a")
    assert sound["notes"] == "" and "0.00 body weights" in doubtful["notes"]
    assert float(doubtful["peak_vertical_bw"]) == 0.0
    table = read_json(tmp_path / "a" / "sweep.json")
    assert table["with_notes"] == 1


def test_a_fit_of_the_offsets_that_ended_badly_or_far_away_is_told(run, tmp_path, monkeypatch):
    far = GeometricOffsets(height_m=0.001, fore_aft_m=-0.06, alignment_rad=0.1)
    monkeypatch.setattr(
        "vsf_drake.walks.offsets.fit_offsets",
        lambda trial: OffsetFit(
            offsets=far,
            standard_error=far,
            cost=1.0,
            success=True,
            message="",
            at_bound=("fore_aft_m",),
        ),
    )
    code, said, _ = run(
        "sweep",
        LOW,
        "--fit-offsets",
        "--fulcrum-mm",
        80,
        "--step-ms",
        4,
        "--workers",
        1,
        "--out",
        tmp_path / "sweep",
    )
    said = " ".join(said.split())
    assert code == 0 and "The fitted offset fore_aft_m ended on its bound" in said
    assert (
        "the fitted fore-aft is -60 mm, beyond 20 mm" in said
        and "the fitted alignment is +5.7°, beyond 5°" in said
    )
    assert "the fitted height" not in said
    [trial] = read_json(tmp_path / "sweep" / "sweep.json")["trials"]
    assert len(trial["warnings"]) == 3 and all(
        f"{trial['name']}: {doubt}" in said for doubt in trial["warnings"]
    )


def test_a_sample_shifts_the_fulcrum_only_as_far_as_its_carriage_reaches(run, tmp_path):
    words = (
        "--sample",
        2,
        "--vary",
        "fulcrum.shift",
        "--fulcrum-mm",
        "80,120",
        "--step-ms",
        4,
        "--workers",
        1,
    )
    code, said, _ = run("sweep", LOW, "--out", tmp_path / "sweep", *words)
    assert code == 0 and "4 walks, 0 failed" in said
    bounds = read_json(tmp_path / "sweep" / "sweep.json")["plan"]["sample"]["bounds"][
        "fulcrum.shift"
    ]
    assert bounds == pytest.approx([0.066 - 0.080, 0.151 - 0.120])
    _, said, _ = run("sweep", "--list", MEDIUM)  # at 108 mm
    lines = {line.split()[0]: line.split()[1:] for line in said.splitlines() if line.strip()}
    assert (
        lines["friction.mu_static"] == ["1", "0.5", "0.1", "1.5"]
        and lines["offset.alignment"][0] == "rad"
    )
    assert lines["fulcrum.shift"][2:4] == ["-0.042", "0.043"]


def test_a_folder_that_cannot_take_the_sweep_is_refused_and_left_alone(run, tmp_path):
    file, other = tmp_path / "file", tmp_path / "other"
    file.write_text("mine")
    other.mkdir()
    (other / "sweep.json").write_text('{"rows": 3}')
    for out, said in ((file, "is a file"), (other, "not the table of a sweep")):
        code, _, error = run("sweep", LOW, "--out", out, "--fulcrum-mm", 80, "--workers", 1)
        assert code == 2 and said in error and "Traceback" not in error
    assert file.read_text() == "mine" and [path.name for path in other.iterdir()] == ["sweep.json"]


def test_a_folder_takes_a_larger_sweep_of_its_trials_but_none_of_others(run, tmp_path):
    out, first = tmp_path / "sweep", copied(LOW, tmp_path / "a")
    words = ("--workers", 1, "--step-ms", 4)
    run("sweep", first, "--out", out, "--fulcrum-mm", "80,90", *words)
    code, _, error = run("sweep", first, "--out", out, "--fulcrum-mm", "80,90,100", *words)
    assert code == 0 and "2 from the cache" in error
    code, _, error = run("sweep", MEDIUM, "--out", out, "--fulcrum-mm", "80", *words)
    assert code == 2 and "sweep of other trials" in error
    assert len(rows(out)) == 3
    code, _, error = run(
        "sweep", copied(LOW, tmp_path / "b"), "--out", out, "--fulcrum-mm", "80", *words
    )
    assert code == 0 and "1 from the cache" in error, "the same by what it holds"
