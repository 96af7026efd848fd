"""What a tuning leaves on disk, and the page made again of it."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from browser import chromium, look
from command_line import read_json
from made_tuning import (
    failed_table,
    made_arrays,
    made_stride_arrays,
    made_stride_table,
    made_table,
    small_table,
)
from page_reader import Balanced

from vsf_drake.analysis.tuning.common import KEYS
from vsf_drake.errors import InputError
from vsf_drake.report.tuning.chapters import TUNING

MADE = {"level_1": (made_table, made_arrays), "level_2": (made_stride_table, made_stride_arrays),
        "failed": (failed_table, dict)}
every_kind = pytest.mark.parametrize("kind", MADE)
needs_browser = pytest.mark.skipif(chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder of each kind of tuning."""
    home = tmp_path_factory.mktemp("tunings")
    for kind, (table, arrays) in MADE.items():
        TUNING.write(home / kind, table(), arrays())
    return home


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def page_of(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_everything_of_a_tuning_is_written(folders):
    names = set(files(folders / "level_1"))
    assert {"tuning.json", "tuning.npz", "report.html", "figures/cost.png", "figures/cost.svg", "figures/outcomes.png",
            "figures/force.svg", "figures/tasks.png", "figures/pareto.png", "figures/robustness.png",
            "tables/sweep.csv", "tables/outcomes.csv", "tables/checks.csv", "tables/confirmed_by.csv"} <= names
    stride = set(files(folders / "level_2"))
    assert {"figures/motion.png", "figures/torque.png", "figures/stride_force.png"} <= stride
    assert "figures/force.png" not in stride, "of a stride, both feet are shown"


@every_kind
def test_the_table_has_every_key_and_the_values_that_were_given(folders, kind):
    found = read_json(folders / kind / "tuning.json")
    given = MADE[kind][0]()
    assert set(KEYS) <= set(found)
    assert {key: found[key] for key in given} == json.loads(json.dumps(given))


@every_kind
def test_results_read_back_are_those_that_were_written(folders, kind):
    table, arrays = TUNING.read(folders / kind)
    assert table["status"] == MADE[kind][0]()["status"]
    given = MADE[kind][1]()
    assert set(arrays) == set(given)
    for name, values in given.items():
        np.testing.assert_array_equal(arrays[name], values)


def test_numbers_that_are_not_finite_are_unknown_in_the_table(tmp_path):
    bad = dict(wall_s=float("nan"), robustness=[{"what": "a", "fulcrum_mm": float("inf"), "cost": None}])
    written = TUNING.write(tmp_path / "out", small_table() | bad, {})
    assert (written["wall_s"], written["robustness"][0]["fulcrum_mm"]) == (None, None)


def test_tables_hold_every_digit(folders):
    with (folders / "level_1" / "tables" / "sweep.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    given = made_table()["sweep"]
    assert [float(row["cost"]) for row in rows] == [row["cost"] for row in given]
    assert [float(row["term_knee"]) for row in rows] == [row["terms"]["knee"] for row in given]


@every_kind
def test_the_report_made_again_is_the_same_to_the_byte(run, tmp_path, kind):
    out = tmp_path / "out"
    TUNING.write(out, MADE[kind][0](), MADE[kind][1]())
    before = files(out)
    for path in [*out.rglob("*.html"), *out.rglob("*.png"), *out.rglob("*.svg"), *out.rglob("*.csv")]:
        path.unlink()
    code, said, err = run("report", out)
    assert (code, err) == (0, "")
    assert "report.html" in "".join(said.split())
    assert files(out) == before


@pytest.mark.slow
@needs_browser
@every_kind
@pytest.mark.parametrize("width", [1280, 390])
def test_page_reads_on_a_desk_and_on_a_telephone(folders, tmp_path, kind, width):
    seen = look(folders / kind / "report.html", tmp_path, width=width)
    assert (seen.console, seen.requests, seen.out) == ([], [], [])
    assert seen.scroll <= width
    assert (seen.broken, seen.unnamed) == (0, 0)
    assert seen.images == {"level_1": 6, "level_2": 7, "failed": 0}[kind]


@every_kind
def test_every_tag_closes_in_turn(folders, kind):
    reader = Balanced()
    reader.feed(page_of(folders / kind).partition("\n")[2])
    assert reader.open == []


def test_a_result_that_is_none_is_marked_above_everything_else(folders):
    body = page_of(folders / "failed").partition("<body>")[2].lstrip()
    assert body.startswith('<p class="alarm" role="alert">NOT OPTIMAL: the iteration limit was reached.')
    assert "<h1>NOT OPTIMAL: stiffness tuned: load of the intact knee</h1>" in body
    assert "has the least" not in body
    assert "alarm" not in page_of(folders / "level_1").partition("<body>")[2]


def test_a_sweep_beside_a_solver_that_failed_shows_no_optimum(tmp_path):
    TUNING.write(tmp_path / "out", made_table(optimal=False, status="interrupted"), made_arrays())
    body = page_of(tmp_path / "out").partition("<body>")[2]
    assert "NOT OPTIMAL: the last iterate is at 104.2 mm" in body, "the alternative text of the figure"
    assert "The optimum is at" not in body
    assert ">optimum</th>" not in body, "in the heading of the outcomes"
    svg = (tmp_path / "out" / "tables" / "outcomes.csv").read_text(encoding="utf-8")
    assert svg.startswith("label,unit,softest")


def test_another_tuning_in_the_same_folder_leaves_nothing_of_the_first(tmp_path):
    out = tmp_path / "out"
    TUNING.write(out, small_table(), {})
    (out / "figures" / "notes.txt").write_text("mine", encoding="utf-8")
    TUNING.write(out, failed_table(), {})
    assert {path.name for path in (out / "figures").iterdir()} == {"notes.txt"}
    assert not (out / "tables" / "sweep.csv").exists()


@pytest.mark.parametrize("change", [{"level": 3}, {"format": "vsf_drake tuning 0"}, {"fulcrum_mm": None}])
def test_a_table_that_cannot_be_is_refused_by_who_writes_it(tmp_path, change):
    with pytest.raises(ValueError, match=r"level|format|optimum"):
        TUNING.write(tmp_path / "out", made_table(**change), {})
    assert not (tmp_path / "out").exists()


def test_a_table_without_a_key_is_refused_by_who_writes_it(tmp_path):
    table = made_table()
    del table["checks"]
    with pytest.raises(ValueError, match="lacks checks"):
        TUNING.write(tmp_path / "out", table, {})


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [("tuning.json", None, "vsf-drake tune --out"), ("tuning.json", "{", "cannot be read as JSON"),
     ("tuning.json", '{"format": "fit"}', "not the table of a tuning"),
     ("tuning.json", '{"format": "vsf_drake tuning 1"}', "lacks level"), ("tuning.npz", "other", "SHA-256")])
def test_damaged_results_are_refused_with_file_and_reason(tmp_path, name, text, words):
    out = tmp_path / "out"
    TUNING.write(out, small_table(), {})
    if text is None:
        (out / name).unlink()
    else:
        (out / name).write_text(text)
    with pytest.raises(InputError, match=words) as raised:
        TUNING.remake(out)
    assert name in str(raised.value)


def test_what_an_edited_table_lacks_is_said_and_the_rest_shown(tmp_path):
    out = tmp_path / "out"
    TUNING.write(out, small_table(), {})
    table = read_json(out / "tuning.json")
    table["checks"] = [{"label": "fine sweep"}]
    (out / "tuning.json").write_text(json.dumps(table), encoding="utf-8")
    missing = TUNING.remake(out)
    assert any(sentence.startswith("Checks") for sentence in missing)
    assert "This version cannot show what the results hold of it (KeyError" in page_of(out)
    assert "has the least" in page_of(out)


def test_a_folder_of_something_else_is_not_written_to(tmp_path):
    TUNING.check(tmp_path / "new")
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things than an earlier tuning"):
        TUNING.check(tmp_path)
    TUNING.write(tmp_path / "out", small_table(), {})
    TUNING.check(tmp_path / "out")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        TUNING.check(tmp_path / "file")
