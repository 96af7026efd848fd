"""The command line as a whole: signals end it with a word; names and paths that anybody chose are
text or refused."""

from __future__ import annotations

import io
import os
import pty
import re
import signal
import subprocess
import sys
import time
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml
from command_line import read_json
from rich.console import Console

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import csv_cells, read_bytes, resource, user_path
from vsf_drake.base.text_table import as_label
from vsf_drake.cli import app
from vsf_drake.cli.app import console, errors, progress
from vsf_drake.cli.guide import GUIDES
from vsf_drake.motion.trial import load_trial
from vsf_drake.report.style import drawing, label, save_figure

SUBJECT = {"mass_kg": 78.0, "stature_m": 1.81, "sex": "male", "prosthetic_side": "right"}
PATHS = [
    "~nosuchuser/a.yaml",
    "a" * 5000,
    "/".join(["a" * 200] * 30),
    "a\x1b[31m.yaml",
    "a\nb.yaml",
    "a\udcff.yaml",
]
NAMES = [
    r"cost $\foo$",
    "$x^2",
    "[/b]",
    "[red]a",
    ":warning: a",
    "<b>&amp;\"'",
    "=1+2",
    "a\u2028b",
    "üß 漢字",
]


@pytest.fixture
def subject(tmp_path):
    def write(name):
        path = tmp_path / "subject.yaml"
        path.write_text(yaml.safe_dump(SUBJECT | {"name": name}), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "{}"),
        ("fit", "{}", "{}"),
        ("bench", "--model", "{}"),
        ("export", "--out", "{}"),
        ("show", "--html", "{}"),
        ("import", "--list-markers", "{}"),
        ("report", "{}"),
    ],
    ids=" ".join,
)
def test_a_path_that_is_none_is_refused_by_every_command(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    for path in ("~nosuchuser/a.yaml", "a" * 5000, "a\x1b[31m\udcff.yaml"):
        code, out, error = run(*(word.format(path) for word in words))
        assert code == 2 and "Traceback" not in error and "error" in error.lower()
        assert "\x1b[31m" not in out + error and "\udcff" not in out + error and len(error) < 2000
        assert not list(tmp_path.iterdir())


def test_report_of_results_that_it_does_not_make_names_those_that_it_does(run, tmp_path):
    (tmp_path / "fit.json").write_text("{}", encoding="utf-8")
    code, _, error = run("report", tmp_path)
    said = " ".join(error.split())
    assert code == 2 and "holds no results whose report can be made again" in said
    for command in ("session", "validate", "bench --protocol"):
        assert f"`{command}`" in said


@pytest.mark.parametrize("key", ["subject", "kinematics", "forces", "model"])
def test_a_path_that_is_none_is_refused_in_a_manifest(tmp_path, key):
    content = {
        "subject": "subject.yaml",
        "kinematics": "a.mot",
        "forces": "a.mot",
        "prosthesis": {"fulcrum_mm": 66},
    }
    (tmp_path / "subject.yaml").write_text(yaml.safe_dump(SUBJECT), encoding="utf-8")
    (tmp_path / "a.mot").write_text("", encoding="utf-8")
    for path in ("~nosuchuser/s.yaml", "s" * 5000, "s\0", "\udcff"):
        (tmp_path / "walk.yaml").write_text(yaml.safe_dump(content | {key: path}), encoding="utf-8")
        with pytest.raises(InputError, match=r"walk\.yaml") as raised:
            load_trial(tmp_path / "walk.yaml")
        assert len(str(raised.value)) < 2000


def test_a_path_that_is_none_is_an_input_error():
    for path in (*PATHS, "a\0b"):
        with pytest.raises(InputError) as raised:
            user_path(path, file="walk.yaml", where="subject")
        assert str(raised.value).startswith("walk.yaml: subject: ") and len(str(raised.value)) < 300
        with pytest.raises(InputError):
            read_bytes(path, most=10)


def test_a_name_is_text_wherever_it_comes(run, subject, tmp_path):
    name = " ".join(NAMES)
    out = tmp_path / name.replace("/", "∕")
    code, said, error = run("stand", subject(name), "--out", out, "--duration-s", 0.1, "--upright")
    assert code == 0 and not error.strip() and "written to" in said
    assert "".join(name.split()) in "".join(said.split())
    assert read_json(out / "standing.json")["subject"] == name
    texts = "".join(ElementTree.parse(out / "standing.svg").getroot().itertext())
    assert "".join(name.split()) in "".join(texts.split())


def test_a_name_that_cannot_be_printed_is_refused(run, subject, tmp_path):
    for name in ("\x1b[31mred", "a\0", "a\x07", "\x9b31m", "\ud800", "\u202eevil", "a\uffff"):
        code, out, error = run("stand", subject(name), "--out", tmp_path / "out")
        assert code == 2 and "unprintable" in error and "line " in error and name not in out + error
        assert not (tmp_path / "out").exists()


def test_labels_of_recordings_lose_what_cannot_be_printed():
    assert as_label(" LASI\x1b[31m\x07 ") == "LASI[31m"
    assert as_label("M\u00fcller\x92s") == "M\u00fcllers"  # of another encoding
    assert as_label("\u202eHEEL".encode().decode("latin-1")) == "HEEL"


def test_no_console_reads_markup(capsys):
    for place in (console, errors):
        place.print("[red]a[/b] :warning:")
    with progress() as show:
        show("[/b]", 0.5)
    assert all("[red]a[/b] :warning:" in said for said in capsys.readouterr())


def test_no_figure_reads_mathtext(tmp_path):
    text = r"$\foo$ \$5 $a$ & <b> $"
    with drawing(4.0, 3.0) as figure:
        axes = figure.add_subplot()
        axes.plot([0, 1], label=text)
        axes.legend()
        axes.set_xticks([0], [text])
        label(axes, x=text, y=text, title=text)
        figure.suptitle(text)
    save_figure(figure, tmp_path / "a")
    texts = [
        element.text
        for element in ElementTree.parse(tmp_path / "a.svg").getroot().iter()
        if element.text
    ]
    assert texts.count(text) == 6


def test_no_cell_is_a_formula_and_others_stay_as_they_are():
    for text in ("=1+2", "+1+2", "-1+2", "@SUM(1)", "\tx", "\r=1", "=cmd|' /C calc'!A0", "-", "+a"):
        assert csv_cells([text]) == [f"'{text}"]
    cells = ["a=1", "", 1.5, -2.0, True, "-1.5", "+2e-3", "−3"]
    assert csv_cells([*cells, None]) == [*cells, ""]


# Signals.


BEGIN = """
import contextlib, ctypes, importlib.abc, signal, sys, threading, time
for each, usual in ((signal.SIGHUP, signal.SIG_DFL), (signal.SIGINT, signal.default_int_handler)):
    signal.signal(each, usual)  # the tests may run where it is ignored
from vsf_drake.cli import main
"""
COMMANDS = (
    BEGIN
    + """
from vsf_drake.cli.app import app
from vsf_drake.simulation.archive import _undisturbed
@app.command()
def wait():
    print("ready", flush=True)
    time.sleep(60.0)
@app.command()
def draw(number: int):
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt:
        raise ValueError("Invalid bounding box") from None
@app.command()
def compile(number: int, settles: bool):
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(number))()
    with _undisturbed() if settles else contextlib.nullcontext():
        threading.Event().wait(0.5)
        print("settled", flush=True)
    threading.Event().wait(20.0)
main()
"""
)
LOADING = (
    BEGIN
    + """
class Slow(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "vsf_drake.cli.tune":
            print("loading", flush=True)
            time.sleep(10.0)
sys.meta_path.insert(0, Slow())
main()
"""
)
INTERRUPTED = "interrupted; results are written whole or not at all"


def test_a_terminal_breaks_lines_between_words_and_a_file_nowhere(monkeypatch):
    sentence, path = "a sentence of words " * 8, f"written to {'folder/' * 30}report.html"
    for terminal in (True, False):
        stream = io.StringIO()
        monkeypatch.setattr(
            app,
            "console",
            Console(file=stream, force_terminal=terminal, width=40, color_system=None),
        )
        app.say(sentence)
        app.say(path)
        lines = stream.getvalue().splitlines()
        assert lines[-1] == path and (max(map(len, lines[:-1])) <= 40) == terminal
        assert " ".join(" ".join(lines[:-1]).split()) == sentence.strip()


@pytest.mark.parametrize("terminal", [True, False])
def test_results_fit_80_columns_of_a_terminal_with_long_names_and_in_a_file_a_line_is_one(
    monkeypatch, terminal
):
    name, sentence = (
        "a person's name, walk " * 5,
        "this cannot drive the model, for many reasons " * 3,
    )
    check = SimpleNamespace(mark="unusable", name="swing clearance", sentence=sentence.strip())
    item = SimpleNamespace(
        mark="unusable",
        checks=(check,),
        trial=SimpleNamespace(name=name.strip(), synthetic=True),
        verdict="unusable: expected error 12.0 % > 10 %",
        notes=(),
    )
    stream = io.StringIO()
    monkeypatch.setattr(
        app, "console", Console(file=stream, force_terminal=terminal, width=200, color_system=None)
    )
    app.print_text("recordings", items=[item, item], to_do=(), more=("folder/" * 20,))
    lines = stream.getvalue().splitlines()
    widest = max(len(line) for line in lines if "folder/" not in line)
    assert (widest <= 80) == terminal and "folder/" * 20 in "".join(lines)
    assert terminal or f"! {sentence.strip()}" in lines
    assert f"! {name.strip()} (SYNTHETIC): unusable: expected error 12.0 % > 10 %" in " ".join(
        " ".join(lines).split()
    )


def test_a_table_in_a_file_is_cut_nowhere(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(
        app, "console", Console(file=stream, force_terminal=False, width=40, color_system=None)
    )
    row = SimpleNamespace(
        fulcrum_mm=66.0,
        stiffness_n_per_mm=10.0,
        published_n_per_mm=10.0,
        tuned_joints_n_per_mm=None,
        mid_range_displacement_mm=30.0,
        max_load_n=600.0,
    )
    app.print_text("bench", settings=[row], heel_stiffness_n_per_mm=None, unconverged_steps=0)
    assert "stiffness (N/mm)" in stream.getvalue() and "mid-range (mm)" in stream.getvalue()
    assert "…" not in stream.getvalue()


def test_help_shows_flags_and_values_and_no_type_of_python(run):
    listed = run("--help")[1]
    for name in GUIDES:
        code, said, _ = run(name, "--help")
        assert code == 0 and name in listed
        assert not re.search(r"<bool>|list\[|NoneType", said), name
    said = run("import", "--help")[1]
    assert (
        re.search(r"--ik {2,}Refine", said)
        and "--forces FILE" in said
        and "--fulcrum-mm MM" in said
    )


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "{}"),
        ("check", "{}"),
        ("sweep", "{}", "--fulcrum-mm", "66,108"),
        ("fit", "{}"),
        ("tune", "{}"),
        ("validate", "{}"),
        ("stand", "{}"),
    ],
    ids=lambda words: words[0],
)
def test_a_recording_in_place_of_a_manifest_is_told_the_line_that_makes_one(run, tmp_path, words):
    walk = resource("data/reference_subject/c3d/low_1.c3d")
    code, _, error = run(*(word.format(walk) for word in words), "--out", tmp_path / "out")
    assert code == 2 and "is a recording and no trial manifest" in error and "UTF-8" not in error
    assert "vsf-drake import STANDING.c3d low_1.c3d --prosthetic-side" in error
    table = resource("data/reference_subject/exact/low_1_forces.mot")
    code, _, error = run(*(word.format(table) for word in words), "--out", tmp_path / "out")
    assert code == 2 and "is a table and no trial manifest" in error and "kinematics" in error


@pytest.mark.slow
def test_a_first_run_says_at_once_that_it_compiles_and_the_next_does_not(tmp_path):
    command = [
        sys.executable,
        "-c",
        "from vsf_drake.cli import main; main()",
        "simulate",
        str(resource("data/reference_subject/exact/low_1.yaml")),
        "--no-replay",
        "--out",
        str(tmp_path / "out"),
    ]
    said = [
        subprocess.run(
            command,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        ).stderr
        for _ in range(2)
    ]
    assert [text.count("compiling once, about 20 s") for text in said] == [1, 0]


def test_a_closed_terminal_ends_a_command_with_129():
    """What it says then goes nowhere: writing to a terminal that is gone is an error."""
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", COMMANDS, "wait"])
    said = b""
    while b"ready" not in said:
        said += os.read(terminal, 1000)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 128 + signal.SIGHUP


def test_signal_while_the_commands_load_ends_with_a_sentence():
    process = subprocess.Popen(
        [sys.executable, "-c", LOADING, "--help"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=30.0)[1] == f"{INTERRUPTED}\n"
    assert process.returncode == 128 + signal.SIGTERM


@pytest.mark.parametrize(
    ("words", "given", "out", "said"),
    [
        # Matplotlib's compiled code was seen to make an error of its own of it
        (("draw",), signal.SIGINT, "", f"{INTERRUPTED} (ValueError: Invalid bounding box)"),
        # LLVM calls Python while numba compiles; Python prints what is raised there, and goes on
        (("compile", "False"), signal.SIGINT, "", INTERRUPTED),
        (("compile", "True"), signal.SIGTERM, "settled\n", INTERRUPTED),
    ],
)
def test_signal_that_compiled_code_swallows_or_misreads_is_not_lost(words, given, out, said):
    began = time.monotonic()
    process = subprocess.run(
        [sys.executable, "-c", COMMANDS, words[0], str(int(given)), *words[1:]],
        capture_output=True,
        text=True,
        check=False,
        timeout=60.0,
    )
    assert (process.stdout, process.stderr) == (out, f"{said}\n")
    assert process.returncode == 128 + given
    assert time.monotonic() - began < 15.0
