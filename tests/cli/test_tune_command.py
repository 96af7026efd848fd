"""`vsf-drake tune` as a laboratory calls it: what comes out, how it ends, and how mistakes are refused.

Where nothing is said, the tuning itself is replaced by a made-up one (`made_tuning`): these tests are of the command.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import yaml
from browser import chromium, look
from command_line import exit_code, read_json
from made_tuning import BEST_MM, POSITIONS, failed_table, small_table
from sweep_files import copied

from vsf_drake.analysis.tuning import level2
from vsf_drake.cli import tune
from vsf_drake.errors import InputError
from vsf_drake.files import resource

EMBEDDED = resource("data/reference_subject")
LABORATORY = EMBEDDED / "laboratory"
LOW, HIGH = LABORATORY / "low_2.yaml", LABORATORY / "high_2.yaml"
CONTACT = LABORATORY / "contact.yaml"
INTERRUPTIBLE = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
import sys
from contextlib import contextmanager
from vsf_drake.cli import tune
@contextmanager
def progress():
    yield lambda what, share: print(what, flush=True)
tune.progress = progress
sys.argv = {words}
from vsf_drake.cli import main
main()
"""


@pytest.fixture
def made(monkeypatch):
    """The tuning replaced: called with the trials, the options and the warm start, it gives `made["table"]`."""
    state = {"table": small_table(), "arrays": {"sweep_mm": POSITIONS}, "calls": []}

    def tuned(given, cost, options, show, warm):
        state["calls"].append((given, cost, options, warm))
        show("sweep, 100.0 mm, cost 2", 0.5)
        if isinstance(state["table"], BaseException):
            raise state["table"]
        return state["table"], state["arrays"]

    monkeypatch.setattr(tune, "_motion_given", tuned)
    monkeypatch.setattr(tune, "_motion_free", tuned)
    return state


def test_results_are_written_and_the_screen_says_what_was_found(run, tmp_path, made):
    code, out, err = run("tune", LOW, HIGH, "--contact", CONTACT, "--cost", "joint_load", "--out", tmp_path / "out")
    assert (code, err.strip()) == (0, "")
    said = " ".join(out.split())
    assert said.startswith("Data are SYNTHETIC, not recorded")
    assert "the fulcrum at 104.2 mm has the least cost: 2 BW" in said
    assert "open report.html first" in said
    table = read_json(tmp_path / "out" / "tuning.json")
    assert table["recorded_mm"] == [66.0, 151.0], "of these trials"
    assert table["provenance"]["options"]["cost"] == "joint_load"
    assert any("contact.yaml" in name for name in table["provenance"]["inputs_sha256"])
    assert (tmp_path / "out" / "report.html").is_file()


def test_options_reach_the_analysis(run, tmp_path, made):
    run("tune", LOW, "--contact", CONTACT, "--cost", "weighted", "--weights", "joint_load=1, push_off=0.5", "--design",
        "alignment,heel_stiffness", "--fulcrum-range", "70", "140", "--pareto", "metabolic,push_off", "--seed", "3",
        "--quick", "--out", tmp_path / "out")
    cost, options = made["calls"][0][1:3]
    assert cost == "weighted" and options.weights == {"joint_load": 1.0, "push_off": 0.5}
    assert options.design == ("alignment", "heel_stiffness")
    assert options.bounds_mm == (70.0, 140.0)
    assert (options.pareto, options.seed, options.sweep_mm) == (("metabolic", "push_off"), 3, 5.0)
    told = read_json(tmp_path / "out" / "tuning.json")["provenance"]["options"]
    assert told["fulcrum_range_mm"] == [70.0, 140.0]


def test_without_trials_the_embedded_person_is_tuned_with_the_contact_that_was_fitted(run, tmp_path, made):
    assert run("tune", "--quick", "--out", tmp_path / "out")[0] == 0
    given = made["calls"][0][0]
    assert given.labels == ("medium_2",)
    assert run("tune", "--out", tmp_path / "out")[0] == 0
    assert made["calls"][1][0].labels == ("medium_1", "medium_2", "medium_3")
    assert given.synthetic and not given.notes
    assert all("A fitted contact was applied" in " ".join(trial.notes) for trial in given.trials)


def test_a_tuning_that_did_not_converge_is_written_marked_and_ends_with_4(run, tmp_path, made):
    made["table"] = failed_table()
    code, out, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 4
    assert "NOT OPTIMAL: the iteration limit was reached" in err and err.count("error:") == 1
    assert "has the least cost" not in out
    assert read_json(tmp_path / "out" / "tuning.json")["optimal"] is False
    assert 'class="alarm"' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_an_interrupt_keeps_what_was_found(run, tmp_path, made):
    made["table"] = failed_table(status="it was interrupted during: search 1 of 3")
    code, _, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 130
    assert "marked as NOT OPTIMAL" in err and "error:" not in err and "whole or not" not in err
    assert read_json(tmp_path / "out" / "tuning.json")["optimal"] is False


def test_an_interrupt_before_anything_was_found_writes_nothing(run, tmp_path, made):
    made["table"] = KeyboardInterrupt()
    code, _, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 130
    assert "nothing was written" in err and "Traceback" not in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("named", [".", "tuning.json", "tuning.npz"])
def test_an_earlier_tuning_can_be_begun_from(run, tmp_path, made, named):
    assert run("tune", LOW, "--contact", CONTACT, "--out", tmp_path / "one")[0] == 0
    named = tmp_path / "one" / named
    code, _, _ = run("tune", LOW, "--contact", CONTACT, "--warm-start", named, "--out", tmp_path / "two")
    assert code == 0
    table, arrays = made["calls"][1][3]
    assert table["fulcrum_mm"] == BEST_MM
    assert set(arrays) == {"sweep_mm"}


def test_without_a_contact_offsets_are_fitted_and_that_is_said(run, tmp_path, made, monkeypatch):
    from vsf_drake.analysis.tuning import inputs  # noqa: PLC0415 (the module is replaced in part)

    class Fit:
        offsets, success, at_bound, message = None, True, ("height_m",), ""

    def fit_offsets(trial, progress):
        progress(3, 1.5)
        Fit.offsets = trial.offsets
        return Fit

    monkeypatch.setattr(inputs, "fit_offsets", fit_offsets)
    code, out, _ = run("tune", LOW, "--out", tmp_path / "out")
    assert code == 0
    notes = read_json(tmp_path / "out" / "tuning.json")["notes"]
    assert notes[0].startswith("No fitted contact was given")
    assert "low_2: the fit of its offsets ended on a bound (height_m)." in notes
    assert "No fitted contact was given" in out


def test_mistakes_of_the_analysis_are_named_as_the_command_line_names_them(run, tmp_path, made):
    made["table"] = InputError("60 to 151 mm is out of the carriage's reach", where="bounds_mm", right="Stay inside")
    code, _, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path / "out")
    assert code == 2
    assert "error: --fulcrum-range: 60 to 151 mm is out of the carriage's reach. Stay inside" in err


def test_level_2_gets_its_options_and_tells_its_iterations(run, tmp_path, monkeypatch):
    """A made-up stride in place of the real one: what the command hands over, and what it makes of what comes back."""
    seen = {}

    def stride(trials, *, cost, options, labels):
        seen.update(trials=len(trials), cost=cost, options=options, labels=labels)

    def solved(tuning, *, progress, warm_start):
        progress("tracking, smoothing 1 of 4", 0.1, SimpleNamespace(number=7, cost=0.25))
        progress("66 mm, cold", 0.2, None)
        seen["warm"] = warm_start

    monkeypatch.setattr(level2, "StrideTuning", stride)
    monkeypatch.setattr(level2, "solve", solved)
    monkeypatch.setattr(level2, "stride_table", lambda solution: small_table(level=2))
    monkeypatch.setattr(level2, "stride_arrays", lambda solution: {})
    said = []
    monkeypatch.setattr(tune, "progress", lambda: nullcontext(lambda what, share: said.append(what)))
    code, out, _ = run("tune", LOW, "--contact", CONTACT, "--level", "2", "--cost", "metabolic", "--intervals", "30",
                       "--method", "trapezoidal", "--design", "alignment", "--fulcrum-range", "70", "140", "--quick",
                       "--out", tmp_path / "out")
    assert code == 0 and "whose gait is optimised together with the setting (level 2)" in out
    options = seen["options"]
    assert (seen["trials"], seen["cost"], seen["labels"], seen["warm"]) == (1, "metabolic", ("low_2",), None)
    assert (options.intervals, options.method, options.design) == (30, "trapezoidal", ("alignment_rad",))
    assert (options.bounds_mm, options.starts, options.confirm) == ((70.0, 140.0), 1, ())
    assert said[:2] == ["tracking, smoothing 1 of 4, iteration 7, cost 0.25", "66 mm, cold"]


def test_without_a_trial_level_2_takes_one_embedded_stride(run, tmp_path, made):
    assert run("tune", "--level", "2", "--out", tmp_path / "out")[0] == 0
    given, _, options, _ = made["calls"][0]
    assert given.labels == ("medium_2",) and isinstance(options, level2.StrideOptions)


MISTAKES = [
    (("--cost", "joint_laod"), "--cost: there is no 'joint_laod'. Did you mean joint_load?"),
    (("--cost", "comfort"), "There are: joint_load, metabolic, push_off, tracking, weighted"),
    (("--weights", "joint_load=1"), "--weights: cannot go with --cost joint_load"),
    (("--cost", "weighted", "--weights", "joint_load"), "--weights: 'joint_load' is no weight. Write COST=NUMBER"),
    (("--cost", "weighted", "--weights", "joint_load=a"), "--weights joint_load: 'a' is no number"),
    (("--cost", "weighted", "--weights", "joint_load=-1"), "--weights joint_load: -1 is outside its physical range"),
    (("--cost", "weighted", "--weights", "joint_load=nan"), "--weights joint_load: nan is not a finite number"),
    (("--cost", "weighted", "--weights", "joint_load=0,push_off=0"), "--weights: are all zero"),
    (("--cost", "weighted", "--weights", "push_of=1"), "Did you mean push_off?"),
    (("--cost", "weighted", "--weights", "push_off=1,push_off=2"), "push_off has two weights"),
    (("--design", "keel"), "--design: there is no 'keel'"), (("--design", ","), "--design: names nothing"),
    (("--design", "alignment,alignment"), "names alignment twice"),
    (("--fulcrum-range", "151", "66"), "--fulcrum-range: its lower bound 151 is not below"),
    (("--fulcrum-range", "nan", "66"), "--fulcrum-range: nan is not a finite number"),
    (("--fulcrum-range", "20", "90"), "out of the carriage's reach"),
    (("--level", "3"), "should be less than or equal to 2"),
    (("--intervals", "20"), "--intervals: is an option of level 2, where the motion is free. Leave it out"),
    (("--method", "trapezoidal"), "--method: is an option of level 2"),
    (("--level", "2", "--method", "euler"), "--method: 'euler' is not known"),
    (("--level", "2", "--intervals", "0"), "--intervals: 0 is outside its physical range"),
    (("--level", "2", "--joints", "knee_angle"),
     "--joints: is an option of level 1; level 2 has all joints of the sagittal plane. Leave it out"),
    (("--joints", "elbow"), "--joints: 'elbow' is not known"),
    (("--pareto", "joint_load"), "--pareto: names 1 cost. Give two"),
    (("--pareto", "joint_load,comfort"), "--pareto: there is no 'comfort'"),
    (("--contact", "none.yaml"), "none.yaml: there is no such file"),
    (("--contact", EMBEDDED / "subject.yaml"), "unknown key"), (("none.yaml",), "none.yaml: there is no such file"),
    (("--warm-start", "none"), "none: --warm-start: there is no such file"),
    (("--warm-start", EMBEDDED / "subject.yaml"), "--warm-start: is no tuning"),
    (("--warm-start", EMBEDDED), "tuning.json: there is no such file"), (("--seed", "-1"), "--seed"),
    ((LABORATORY / ".." / "laboratory" / LOW.name,), "is named twice"),
]


@pytest.mark.parametrize(("words", "said"), MISTAKES, ids=lambda value: value if isinstance(value, str) else None)
def test_a_mistake_ends_with_one_message_code_2_and_nothing_written(run, tmp_path, words, said):
    fitted = () if "--contact" in words else ("--contact", CONTACT)
    code, _, err = run("tune", LOW, *fitted, "--quick", *words, "--out", tmp_path / "out")
    assert code == 2
    assert said in err and "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_trials_of_two_persons_are_refused(run, tmp_path):
    (tmp_path / "heavy").mkdir()
    person = yaml.safe_load((EMBEDDED / "subject.yaml").read_text(encoding="utf-8")) | {"mass_kg": 90.0}
    (tmp_path / "heavy" / "subject.yaml").write_text(yaml.safe_dump(person), encoding="utf-8")
    other = copied(HIGH, tmp_path / "heavy", subject="subject.yaml")
    code, _, err = run("tune", LOW, other, "--out", tmp_path / "out")
    assert code == 2
    assert "is of another subject" in err and str(other) in err


def test_a_folder_with_other_things_is_left_alone(run, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    code, _, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path)
    assert code == 2 and "other things than an earlier tuning" in err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.fixture(scope="session")
def tuned(tmp_path_factory):
    """Folder of `vsf-drake tune --quick` on the embedded data, nothing replaced."""
    out = tmp_path_factory.mktemp("tuned") / "out"
    assert exit_code("tune", "--quick", "--cost", "joint_load", "--out", out) == 0
    return out


@pytest.mark.slow
def test_the_embedded_person_is_tuned_and_the_optimum_is_the_lowest_of_the_sweep(tuned):
    table = read_json(tuned / "tuning.json")
    assert table["optimal"] is True and table["synthetic"] is True and table["level"] == 1
    costs = [row["cost"] for row in table["sweep"]]
    lowest = table["sweep"][costs.index(min(costs))]["fulcrum_mm"]
    assert abs(table["fulcrum_mm"] - lowest) <= 5.0, "the spacing of the quick sweep"
    assert table["cost"] <= min(costs) * (1.0 + 1e-6)


@pytest.mark.slow
@pytest.mark.skipif(chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)")
@pytest.mark.parametrize("width", [1280, 390])
def test_page_of_the_embedded_person_reads_on_a_desk_and_on_a_telephone(tuned, tmp_path, width):
    seen = look(tuned / "report.html", tmp_path, width=width)
    assert (seen.console, seen.requests, seen.out, seen.broken, seen.unnamed) == ([], [], [], 0, 0)
    assert seen.scroll <= width and seen.images >= 4


@pytest.mark.slow
def test_report_of_the_embedded_person_made_again_is_the_same_to_the_byte(run, tuned):
    before = {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()}
    assert run("report", tuned)[0] == 0
    assert {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_ctrl_c_in_the_middle_leaves_a_result_that_is_marked(tmp_path):
    """The whole program in a process of its own, interrupted when its searches have begun."""
    out = tmp_path / "out"
    words = ["vsf-drake", "tune", *map(str, (LOW, "--contact", CONTACT, "--out", out))]
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTIBLE.format(words=words)], stderr=subprocess.PIPE,
                               stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        while "search" not in (line := process.stdout.readline()):
            assert line, process.communicate()[1]
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=120.0)
    finally:
        process.kill()
    assert process.returncode == 130, error
    assert "Traceback" not in error
    table = read_json(out / "tuning.json")
    assert table["optimal"] is False and "interrupted" in table["status"]
    assert "NOT OPTIMAL" in (out / "report.html").read_text(encoding="utf-8")
