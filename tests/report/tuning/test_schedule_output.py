"""What a schedule leaves on disk, what its page says, and the page made again of it."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from browser import chromium, look
from command_line import read_json
from made_tuning import BEST, SPEEDS, made_schedule
from page_reader import Balanced

from vsf_drake.analysis.tuning.schedule import load_schedule
from vsf_drake.errors import InputError
from vsf_drake.report.tuning.chapters import SCHEDULE, schedule_words, write_schedule
from vsf_drake.report.tuning.figures import policy_figure, schedule_curves_figure
from vsf_drake.report.tuning.reading import telling
from vsf_drake.simulation.archive import RECORD_FILE


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("schedule") / "out"
    write_schedule(out, made_schedule())
    return out


def test_policy_is_written_for_the_controller_and_for_people(folder):
    assert {"policy.json", "policy.csv", "report.html", "figures/policy.png", "figures/curves.svg", "figures/tasks.png",
            "tables/policy.csv"} <= set(files(folder))
    with (folder / "policy.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["label"], float(row["speed_m_per_s"]), float(row["fulcrum_mm"])) for row in rows] == [
        (f"speed {speed}", speed, best) for speed, best in zip(SPEEDS, BEST, strict=True)]
    assert rows[0]["slope_deg"] == "" and rows[0]["matters"] == "True"
    assert (float(rows[0]["interval_low_mm"]), float(rows[0]["interval_high_mm"])) == (71.0, 79.0)


def test_the_written_policy_is_looked_up(folder):
    assert load_schedule(folder / "policy.json").lookup(speed=1.0) == 90.0


def test_the_schedule_s_report_made_again_is_the_same_to_the_byte(run, tmp_path):
    out = tmp_path / "out"
    write_schedule(out, made_schedule())
    before = files(out)
    for name in before:
        if name not in ("policy.json", "policy.csv", RECORD_FILE):
            (out / name).unlink()
    code, _, err = run("report", out)
    assert (code, err) == (0, "")
    assert files(out) == before


@pytest.mark.slow
@pytest.mark.skipif(chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)")
@pytest.mark.parametrize("width", [1280, 390])
def test_schedule_page_reads_on_a_desk_and_on_a_telephone(folder, tmp_path, width):
    seen = look(folder / "report.html", tmp_path, width=width)
    assert (seen.console, seen.requests, seen.out, seen.broken, seen.unnamed) == ([], [], [], 0, 0)
    assert seen.scroll <= width and seen.images == 3


def test_page_says_what_to_store_and_what_that_buys(folder):
    """The parabolas' mean is 101.7 mm, 101.5 on half millimetres: 26.5² 1e-4 on 2 is 3.5 %, 3.5² and 23.5² less."""
    lost = [100.0 * 1e-4 * (101.5 - best) ** 2 / 2.0 for best in BEST]
    words = " ".join(schedule_words(read_json(folder / "policy.json")))
    assert "To store: 75.0 mm for speed 0.8, 105.0 mm for speed 1.2, 125.0 mm for speed 1.6." in words
    assert f"One setting for all (101.5 mm) costs {np.mean(lost):.4g} % more on average and {max(lost):.4g} % at most" \
        in words
    assert "Known to need a setting of its own: speed 0.8, speed 1.6." in words
    assert "Not told from the one setting for all: speed 1.2." in words, "101.5 lies within 101 to 109 mm"
    reader = Balanced()
    reader.feed((folder / "report.html").read_text(encoding="utf-8").partition("\n")[2])
    assert reader.open == []


def test_tasks_that_need_nothing_of_their_own_are_called_so_first():
    assert schedule_words(made_schedule(matters=False))[0].startswith("THE SETTING HARDLY MATTERS")
    unknown = schedule_words(made_schedule(matters=None))
    assert "Known to need a setting of its own: none." in unknown
    assert "Not told from the one setting for all: speed 1.2." in unknown, "what lies within its interval is known"


def test_a_schedule_with_a_task_that_failed_says_not_to_store_it(tmp_path):
    write_schedule(tmp_path / "out", made_schedule(optimal=False))
    body = (tmp_path / "out" / "report.html").read_text(encoding="utf-8").partition("<body>")[2].lstrip()
    assert body.startswith('<p class="alarm" role="alert">NOT OPTIMAL: speed 1.2: the iteration limit was reached.')
    assert "do not store it" in body and "To store:" not in body


def test_setting_is_drawn_over_what_tells_the_tasks_apart():
    table = made_schedule()
    assert telling(table) == "speed_m_per_s"
    line = next(line for line in policy_figure(table, "speed_m_per_s").axes[0].get_lines()
                if line.get_label() == "lookup, before rounding")
    np.testing.assert_allclose(line.get_ydata(), [75.0, 75.0, 105.0, 125.0, 125.0], err_msg="flat outside of the tasks")
    assert telling(made_schedule(described=False)) is None


def test_curves_are_zero_where_each_task_is_best():
    axes = schedule_curves_figure(made_schedule()).axes[0]
    curves = [line for line in axes.get_lines() if len(line.get_xdata()) == 86]
    assert [line.get_xdata()[np.argmin(line.get_ydata())] for line in curves] == list(BEST)
    assert all(abs(min(line.get_ydata())) < 1e-12 for line in curves)


def test_tasks_that_nothing_tells_apart_have_no_such_figure(tmp_path):
    write_schedule(tmp_path / "out", made_schedule(described=False))
    assert not (tmp_path / "out" / "figures" / "policy.png").exists()


def test_folders_and_tables_of_other_things_are_refused(tmp_path):
    with pytest.raises(InputError, match="vsf-drake schedule --out"):
        SCHEDULE.remake(tmp_path)
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things than an earlier schedule"):
        SCHEDULE.check(tmp_path)
    (tmp_path / "policy.json").write_text('{"format": "vsf_drake schedule 1", "tasks": 3}')
    with pytest.raises(InputError, match="cannot be used"):
        SCHEDULE.remake(tmp_path)
    with pytest.raises(ValueError, match="lacks cost_name"):
        write_schedule(tmp_path / "out", {"tasks": []})


def test_what_only_holds_to_the_recording_is_no_gain_of_adaptability():
    """Without it the costs are 1.5 at the tasks' own settings and 1.47 with one for all: 0.03 BW less, 2 %."""
    table = made_schedule()
    for row in table["tasks"]:
        row |= {"rest": 1.5, "rest_common": 1.47}
    assert "one setting for all costs 0.03 BW LESS on average (2 %)." in " ".join(schedule_words(table))
    assert "holds to the recording" not in " ".join(schedule_words(made_schedule()))
