"""`vsf-drake tune` as a laboratory calls it: what comes out, how it ends, how mistakes are refused.

Where nothing is said, the tuning itself is replaced by a made-up one (`made_tuning`): these tests
are of the commands.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import yaml
from command_line import exit_code, read_json
from made_tuning import BEST_MM, POSITIONS, failed_table, small_table
from page_layers import both_layers
from sweep_files import copied

from vsf_drake.base.files import resource
from vsf_drake.cli import tune
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.tuning import inputs
from vsf_drake.tuning.table import DesignValue

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
    """The tuning replaced: called with the trials, the options and the warm start, it gives what
    `made` has for the first trial, or else `made["table"]`."""
    state = {"table": small_table(), "arrays": {"sweep_mm": POSITIONS}, "calls": []}

    def tuned(given, cost, options, show, warm):
        state["calls"].append((given, cost, options, warm))
        show("sweep, 100.0 mm, cost 2", 0.5)
        table = state.get(given.labels[0], state["table"])
        if isinstance(table, BaseException):
            raise table
        return table, state["arrays"]

    monkeypatch.setattr(tune, "_solved", tuned)
    return state


def test_results_are_written_and_the_screen_says_what_was_found(run, tmp_path, made):
    code, out, err = run(
        "tune", LOW, HIGH, "--contact", CONTACT, "--cost", "joint_load", "--out", tmp_path / "out"
    )
    assert (code, err.strip()) == (0, "")
    said = " ".join(out.split())
    assert said.startswith("Fulcrum 104.2 mm, SYNTHETIC data: least cost, 2 BW (joint load)")
    assert "Cost compared with that at 66 mm -12.7 %, at 151 mm -18.0 %" in said and said.endswith(
        "report.html"
    )
    assert len(list(filter(None, out.splitlines()))) == 3
    table = read_json(tmp_path / "out" / "tuning.json")
    assert (table["trials"], table["recorded_mm"]) == (["low_2", "high_2"], [66.0, 151.0])
    assert table["provenance"]["options"]["cost"] == "joint_load"
    assert any("contact.yaml" in name for name in table["provenance"]["inputs_sha256"])
    assert (tmp_path / "out" / "report.html").is_file()


def test_all_that_was_tuned_stands_on_the_screen(run, tmp_path, made):
    fulcrum = DesignValue("fulcrum", "mm", 104.2, 66.0, 151.0, None)
    made["table"] = small_table(
        design=(
            fulcrum,
            DesignValue("heel_stiffness", "N/mm", 71.2, 40.0, 90.0, 65.0),
            DesignValue("stride time", "s", 1.1, 0.8, 1.3, None),
        )
    )
    _, out, _ = run(
        "tune", LOW, "--contact", CONTACT, "--cost", "joint_load", "--out", tmp_path / "out"
    )
    assert "Together with it: heel stiffness 71.2 N/mm (nominal 65)" in out.splitlines()
    assert "Together with it: stride time 1.1 s" in out.splitlines(), (
        "of a speed at which nothing was recorded"
    )


def test_strides_that_are_not_the_person_s_show_no_interval_and_no_gain(run, tmp_path, made):
    why = "not to be believed: the stride is 11.6 % BW off the person's own force (limit 6 %)."
    made["table"] = small_table(
        level=2, own=True, believed=False, undecided=why, at_bound=("fulcrum",)
    )
    _, out, _ = run("tune", LOW, "--contact", CONTACT, "--level", "2", "--out", tmp_path / "out")
    first, second, *rest = filter(None, out.splitlines())
    assert first == f"! THE MODEL DOES NOT DECIDE: {why}"
    assert second.endswith("least at 104.2 mm: this is no setting to choose")
    assert "104.2" not in " ".join(rest) and "compared" not in out and "interval" not in out
    saved = read_json(tmp_path / "out" / "tuning.json")
    assert (saved["undecided"], saved["believed"]) == (why, False)


def test_an_unfitted_foot_is_told_before_any_number(run, tmp_path, made, monkeypatch):
    monkeypatch.setattr(
        inputs,
        "fit_offsets",
        lambda trial, progress: SimpleNamespace(offsets=trial.offsets, doubts=[]),
    )
    code, out, _ = run("tune", LOW, "--out", tmp_path / "out")
    note = read_json(tmp_path / "out" / "tuning.json")["notes"][0]
    said = " ".join(out.split())
    assert code == 0 and note.startswith("UNFITTED") and said.count(note) == 1
    assert said.index(note) < said.index("Fulcrum")


def test_options_reach_the_analysis(run, tmp_path, made):
    run(
        "tune",
        LOW,
        "--contact",
        CONTACT,
        "--cost",
        "weighted",
        "--weights",
        "joint_load=1, push_off=0.5",
        "--design",
        "alignment,heel_stiffness",
        "--fulcrum-range",
        "70",
        "140",
        "--pareto",
        "metabolic,push_off",
        "--seed",
        "3",
        "--quick",
        "--out",
        tmp_path / "out",
    )
    cost, options = made["calls"][0][1:3]
    assert cost == "weighted" and options.weights == {"joint_load": 1.0, "push_off": 0.5}
    assert (options.design, options.bounds_mm) == (("alignment", "heel_stiffness"), (70.0, 140.0))
    assert (options.pareto, options.seed, options.sweep_mm) == (("metabolic", "push_off"), 3, 5.0)
    given = read_json(tmp_path / "out" / "tuning.json")["provenance"]["options"]
    assert given["fulcrum_range_mm"] == [70.0, 140.0]


def test_without_trials_the_embedded_person_is_tuned_with_the_contact_that_was_fitted(
    run, tmp_path, made
):
    for words in (("--quick",), (), ("--level", "2")):
        assert run("tune", *words, "--out", tmp_path / "out")[0] == 0
    quick, whole, free = (call[0] for call in made["calls"])
    assert quick.labels == free.labels == ("medium_2",)
    assert whole.labels == ("medium_1", "medium_2", "medium_3")
    assert isinstance(made["calls"][2][2], StrideOptions)
    assert all(trial.synthetic for trial in quick.trials) and not quick.notes
    assert all("A fitted contact was applied" in " ".join(trial.notes) for trial in quick.trials)


def test_a_tuning_that_did_not_end_well_is_written_and_marked(run, tmp_path, made):
    for name, table, ending, words in (
        ("failed", failed_table(), 4, "error: NOT OPTIMAL: the iteration limit was reached"),
        (
            "stopped",
            failed_table(status="it was interrupted during: search 1 of 3"),
            130,
            "marked as NOT OPTIMAL",
        ),
        ("nothing", KeyboardInterrupt(), 130, "nothing was written"),
    ):
        made["table"], folder = table, tmp_path / name
        code, out, err = run("tune", LOW, "--contact", CONTACT, "--out", folder)
        assert (code, err.count("error:")) == (ending, 1 if ending == 4 else 0)
        assert words in err and "Traceback" not in err and "least cost" not in out
        assert folder.exists() == (name != "nothing")
        if folder.exists():
            assert read_json(folder / "tuning.json")["optimal"] is False
            assert 'class="alarm"' in (folder / "report.html").read_text(encoding="utf-8")


def test_each_level_gets_its_options_and_its_progress_is_shown(run, tmp_path, monkeypatch):
    """Made-up solutions in place of real ones: what the command hands over, and what it makes of
    what comes back."""
    seen, shown = {}, []
    monkeypatch.setattr(
        tune, "progress", lambda: nullcontext(lambda what, share: shown.append(what))
    )

    def tuning(trials, *, cost, options, labels):
        seen.update(trials=len(trials), cost=cost, options=options, labels=labels)

    def solve(tuning, *, progress, warm_start):
        progress("solving", 0.1)
        seen["warm"] = warm_start

    made = {
        "StiffnessTuning": tuning,
        "StrideTuning": tuning,
        "solve": solve,
        "tuning_table": lambda solution: small_table(level=2),
        "tuning_arrays": lambda solution: {"tracked_p": POSITIONS},
    }
    made |= {"stride_table": made["tuning_table"], "stride_arrays": made["tuning_arrays"]}
    for home, names in (
        ("tuning.problem", ("StiffnessTuning",)),
        ("tuning.solve", ("solve",)),
        ("tuning.solution", ("tuning_table", "tuning_arrays")),
        ("optimal_control.search", ("StrideTuning",)),
        ("optimal_control.solve", ("solve",)),
        ("optimal_control.saved", ("stride_table", "stride_arrays")),
    ):
        for name in names:
            monkeypatch.setattr(f"vsf_drake.{home}.{name}", made[name])
    common = (
        "tune",
        LOW,
        "--contact",
        CONTACT,
        "--cost",
        "metabolic",
        "--quick",
        "--design",
        "alignment",
        "--fulcrum-range",
        "70",
        "140",
    )
    words = (
        "--level",
        "2",
        "--intervals",
        "30",
        "--method",
        "trapezoidal",
        "--out",
        tmp_path / "free",
    )
    assert run(*common, *words)[0] == 0
    page = both_layers(tmp_path / "free")
    assert "whose gait is optimised together with the setting (level 2)" in page
    options = seen["options"]
    assert (seen["trials"], seen["cost"], seen["labels"], seen["warm"]) == (
        1,
        "metabolic",
        ("low_2",),
        None,
    )
    assert (options.intervals, options.method, options.design) == (
        30,
        "trapezoidal",
        ("alignment_rad",),
    )
    assert (options.bounds_mm, options.starts, options.confirm) == ((70.0, 140.0), 1, ())
    for named in (".", "tuning.json", "tuning.npz"):
        assert tune.read_warm_start(tmp_path / "free" / named)[0].fulcrum_mm == BEST_MM
    again = ("--warm-start", tmp_path / "free", "--out", tmp_path / "again")
    assert run(*common, "--level", "2", *again)[0] == 0
    assert seen["warm"]["tracked_p"].tolist() == POSITIONS.tolist()
    assert run(*common, *again)[0] == 0
    assert seen["warm"] == {"fulcrum": BEST_MM} and shown.count("solving") == 3


MISTAKES = [
    (("--cost", "joint_laod"), "--cost: there is no 'joint_laod'. Did you mean joint_load?"),
    (("--weights", "joint_load=1"), "--weights: cannot go with --cost joint_load"),
    (
        ("--cost", "weighted", "--weights", "joint_load"),
        "--weights: 'joint_load' is no weight. Write COST=NUMBER",
    ),
    (
        ("--cost", "weighted", "--weights", "joint_load=a"),
        "joint_load: 'a' is not a finite number",
    ),
    (
        ("--cost", "weighted", "--weights", "joint_load=nan"),
        "--weights joint_load: 'nan' is not a finite number",
    ),
    (("--cost", "weighted", "--weights", "push_off=1,push_off=2"), "push_off has two weights"),
    (("--design", "keel"), "--design: there is no 'keel'"),
    (("--design", ","), "--design: names nothing"),
    (("--fulcrum-range", "151", "66"), "--fulcrum-range: its lower bound 151 is not below"),
    (("--fulcrum-range", "20", "90"), "out of the carriage's reach"),
    (
        ("--intervals", "20"),
        "--intervals: is an option of level 2, where the motion is free. Leave it out",
    ),
    (
        ("--speed", "1.2"),
        "--speed: is an option of level 2, where the motion is free. Leave it out",
    ),
    (("--level", "2", "--speed", "nan"), "--speed: nan is not a finite number"),
    (("--level", "2", "--speed", "0"), "--speed: 0.00 m/s is out of what"),
    (
        ("--cost", "activation"),
        "--cost: activation is a cost of level 2, where the motion is free. Give --level 2",
    ),
    (("--level", "2", "--method", "euler"), "--method: 'euler' is not known"),
    (
        ("--level", "2", "--joints", "knee_angle"),
        (
            "--joints: is an option of level 1; level 2 has all joints of the sagittal plane. "
            "Leave it out"
        ),
    ),
    (("--pareto", "joint_load"), "--pareto: names 1 cost. Give two"),
    (("--contact", "none.yaml"), "none.yaml: there is no such file"),
    (("none.yaml",), "none.yaml: there is no such"),
    (("--warm-start", "none"), "none: --warm-start: there is no such file"),
    (("--warm-start", EMBEDDED / "subject.yaml"), "--warm-start: is no tuning"),
    (("--warm-start", EMBEDDED), "tuning.json: there is no such file"),
    ((LABORATORY / ".." / "laboratory" / LOW.name,), "is named twice"),
]


def test_a_mistake_ends_with_one_message_code_2_and_nothing_written(run, tmp_path):
    heavy = tmp_path / "heavy"
    heavy.mkdir()
    person = yaml.safe_load((EMBEDDED / "subject.yaml").read_text(encoding="utf-8")) | {
        "mass_kg": 90.0
    }
    (heavy / "subject.yaml").write_text(yaml.safe_dump(person), encoding="utf-8")
    others = [((copied(HIGH, heavy, subject="subject.yaml"),), "is of another subject")]
    for words, message in MISTAKES + others:
        fitted = () if "--contact" in words else ("--contact", CONTACT)
        code, _, err = run("tune", LOW, *fitted, "--quick", *words, "--out", tmp_path / "out")
        assert (code, message in err, err.count("error:")) == (2, True, 1), err
        assert "Traceback" not in err and not (tmp_path / "out").exists()
    (tmp_path / "thesis.txt").write_text("mine")
    code, _, err = run("tune", LOW, "--contact", CONTACT, "--out", tmp_path)
    assert code == 2 and "other things than an earlier tuning" in err


# Nothing replaced.


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """Folder of `vsf-drake tune --quick` on the embedded data."""
    out = tmp_path_factory.mktemp("tuned") / "out"
    assert exit_code("tune", "--quick", "--cost", "joint_load", "--out", out) == 0
    return out


@pytest.mark.slow
def test_the_embedded_person_is_tuned_and_the_optimum_is_the_lowest_of_the_sweep(run, tuned):
    table = read_json(tuned / "tuning.json")
    assert table["optimal"] is True and table["synthetic"] is True and table["level"] == 1
    least = min(table["sweep"], key=lambda row: row["cost"])
    assert abs(table["fulcrum_mm"] - least["fulcrum_mm"]) <= 5.0, "the spacing of the quick sweep"
    assert table["cost"] <= least["cost"] * (1.0 + 1e-6)
    before = {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()}
    assert run("report", tuned)[0] == 0
    assert {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_ctrl_c_in_the_middle_leaves_a_result_that_is_marked(tmp_path):
    """The whole program in a process of its own, interrupted when its searches have begun."""
    out = tmp_path / "out"
    words = ["vsf-drake", "tune", *map(str, (LOW, "--contact", CONTACT, "--out", out))]
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE.format(words=words)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
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
