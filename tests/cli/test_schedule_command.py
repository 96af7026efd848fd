"""`vsf-drake schedule` as a laboratory calls it; the tuning of each task is made up, unless something else is said."""

from __future__ import annotations

import pytest
from command_line import read_json
from made_tuning import failed_table, made_table, small_table

from vsf_drake.analysis.tuning.schedule import load_schedule
from vsf_drake.cli import tune
from vsf_drake.files import resource

LABORATORY = resource("data/reference_subject") / "laboratory"
CONTACT = LABORATORY / "contact.yaml"
WORDS = tuple(f"{name}={LABORATORY / name}_2.yaml" for name in ("low", "medium", "high"))
BEST = {"low_2": 80.0, "medium_2": 100.0, "high_2": 120.0}


@pytest.fixture
def made(monkeypatch):
    """Every task's tuning is a parabola about BEST of its trial, or what `made` has for it."""
    state = {"calls": []}

    def parabola(best):
        sweep = [row | {"cost": 2.0 + 1e-4 * (row["fulcrum_mm"] - best) ** 2} for row in made_table()["sweep"]]
        return small_table(fulcrum_mm=best, cost=2.0, sweep=sweep, fulcrum_interval_mm=[best - 3.0, best + 3.0])

    def tuned(given, cost, options, show, warm):
        name = given.labels[0]
        state["calls"].append(given.labels)
        show("sweep", 0.5)
        found = state.get(name) or parabola(BEST[name])
        if isinstance(found, BaseException):
            raise found
        return found, {}

    monkeypatch.setattr(tune, "_motion_given", tuned)
    return state


def test_one_setting_a_task_is_stored_and_the_screen_says_what_that_buys(run, tmp_path, made):
    code, out, err = run("schedule", *WORDS, "--contact", CONTACT, "--resolution-mm", "1", "--out", tmp_path / "out")
    assert (code, err.strip()) == (0, "")
    said = " ".join(out.split())
    assert "To store: 80.0 mm for low, 100.0 mm for medium, 120.0 mm for high." in said
    assert "One setting for all (100.0 mm) costs" in said and "policy.json is for the controller" in said
    table = read_json(tmp_path / "out" / "policy.json")
    assert table["common_fulcrum_mm"] == pytest.approx(100.0)
    assert table["reach_mm"] == pytest.approx([66.0, 151.0]) and table["resolution_mm"] == 1.0
    assert [row["trials"] for row in table["tasks"]] == [["low_2"], ["medium_2"], ["high_2"]]
    assert table["synthetic"] is True


def test_a_task_file_s_speeds_are_looked_up_between(run, tmp_path, made):
    lines = [f"- {{label: {name}, trials: [{LABORATORY / name}_2.yaml], speed_m_per_s: {speed}}}\n"
             for name, speed in (("low", 0.8), ("medium", 1.2), ("high", 1.6))]
    (tmp_path / "tasks.yaml").write_text("tasks:\n" + "".join(lines), encoding="utf-8")
    code, _, _ = run("schedule", tmp_path / "tasks.yaml", "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 0
    assert load_schedule(tmp_path / "out" / "policy.json").lookup(speed=1.0) == pytest.approx(90.0)
    assert (tmp_path / "out" / "figures" / "policy.svg").is_file()


def test_trials_of_one_label_are_tuned_together(run, tmp_path, made):
    made["low_2"] = made_table()
    words = (*WORDS, f"low={LABORATORY / 'low_1.yaml'}")
    assert run("schedule", *words, "--contact", CONTACT, "--out", tmp_path / "out")[0] == 0
    assert made["calls"][0] == ("low_2", "low_1")


def test_a_task_that_failed_makes_a_table_that_is_not_to_be_stored(run, tmp_path, made):
    made["medium_2"] = failed_table()
    code, out, err = run("schedule", *WORDS, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 4
    assert "NOT OPTIMAL: medium: the iteration limit was reached" in err and "To store" not in out
    table = read_json(tmp_path / "out" / "policy.json")
    assert (table["optimal"], table["common_fulcrum_mm"]) == (False, None)
    assert [row["optimal"] for row in table["tasks"]] == [True, False, True]


@pytest.mark.parametrize("kept", [True, False])
def test_an_interrupt_keeps_the_tasks_that_were_done(run, tmp_path, made, kept):
    made["medium_2"] = failed_table(status="it was interrupted during: sweep") if kept else KeyboardInterrupt()
    code, _, err = run("schedule", *WORDS, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 130 and "marked as NOT OPTIMAL" in err
    rows = read_json(tmp_path / "out" / "policy.json")["tasks"]
    assert [row["optimal"] for row in rows] == [True, False, False]
    assert rows[2]["status"] == "it was not reached: interrupted"
    assert len(made["calls"]) == 2


def test_an_interrupt_before_any_task_was_done_writes_nothing(run, tmp_path, made):
    made["low_2"] = KeyboardInterrupt()
    code, _, err = run("schedule", *WORDS, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 130 and "nothing was written" in err
    assert not (tmp_path / "out").exists()


MISTAKES = [
    ((WORDS[0],), "1 task make no schedule"), (("low=",), "'low=' is no task"),
    ((*WORDS, "x=none.yaml"), "none.yaml: there is no such file"), (("none.yaml",), "none.yaml: there is no such file"),
    ((*WORDS, f"low={LABORATORY / 'high_2.yaml'}"), "is named twice"),
    ((*WORDS, "--cost", "joint"), "--cost: there is no 'joint'"),
    ((*WORDS, "--resolution-mm", "0"), "--resolution-mm: 0 mm is no resolution"),
    ((*WORDS, "--resolution-mm", "90"), "at most the reach, 85 mm"),
    ((*WORDS, "--fulcrum-range", "20", "90"), "--fulcrum-range: 20 to 90 mm is out of the carriage's reach"),
    ((*WORDS, "--cost", "weighted", "--weights", "a=1"), "--weights: there is no 'a'"),
]


@pytest.mark.parametrize(("words", "said"), MISTAKES, ids=lambda value: value if isinstance(value, str) else None)
def test_a_schedule_that_cannot_be_is_refused_in_one_message(run, tmp_path, made, words, said):
    code, _, err = run("schedule", *words, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 2
    assert said in err and "Traceback" not in err and err.count("error:") == 1
    assert not made["calls"] and not (tmp_path / "out").exists()


@pytest.mark.slow
def test_two_settings_of_the_embedded_person_make_a_schedule(run, tmp_path):
    """Nothing replaced; the motions of the softest and the stiffest setting stand for two tasks."""
    code, _, err = run("schedule", WORDS[0], WORDS[2], "--contact", CONTACT, "--cost", "tracking", "--quick",
                       "--resolution-mm", "1", "--out", tmp_path / "out")
    assert code == 0, err
    table = read_json(tmp_path / "out" / "policy.json")
    low, high = table["tasks"]
    assert low["fulcrum_mm"] <= table["common_fulcrum_mm"] <= high["fulcrum_mm"]
    assert all(row["cost"] <= row["cost_common"] + 1e-12 for row in table["tasks"])
    assert low["fulcrum_mm"] == pytest.approx(66.0, abs=10.0), "where it stood: the force is best told there"
    assert high["fulcrum_mm"] == pytest.approx(151.0, abs=10.0)
