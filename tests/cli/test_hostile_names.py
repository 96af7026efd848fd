"""Names and paths that somebody chose to do harm, or just chose: text, or refused."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
import yaml
from command_line import read_json

from vsf_drake.cli.app import console, errors, progress
from vsf_drake.errors import InputError
from vsf_drake.files import csv_cells, read_bytes, user_path
from vsf_drake.report.style import label, new_figure, save_figure, style
from vsf_drake.text_table import as_label

SUBJECT = {"mass_kg": 78.0, "stature_m": 1.81, "sex": "male", "prosthetic_side": "right"}
PATHS = ["~nosuchuser/a.yaml", "a" * 5000, "/".join(["a" * 200] * 30), "a\x1b[31m.yaml", "a\nb.yaml", "a\udcff.yaml"]
NAMES = [r"cost $\foo$", "$x^2", "[/b]", "[red]a", ":warning: a", "<b>&amp;\"'", "=1+2", "a\u2028b", "üß 漢字"]


@pytest.fixture
def subject(tmp_path):
    def write(name):
        path = tmp_path / "subject.yaml"
        path.write_text(yaml.safe_dump(SUBJECT | {"name": name}), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("path", PATHS, ids=range(len(PATHS)))
@pytest.mark.parametrize("words", [
    ("simulate", "{}"), ("simulate", "{}", "--model", "{}"), ("check", "{}"), ("stand", "{}"), ("sweep", "{}"),
    ("fit", "{}", "{}"), ("tune", "{}"), ("validate", "{}"), ("report", "{}"), ("import", "{}"),
    ("import", "--list-markers", "{}"), ("bench", "--contact", "{}"), ("bench", "--model", "{}"),
    ("bench", "--out", "{}"), ("export", "--out", "{}"), ("show", "--html", "{}"), ("show", "--model", "{}"),
    ("schedule", "level={}"), ("tune", "--warm-start", "{}"), ("validate", "--bench", "{}"),
    ("validate", "--out", "{}")],
    ids=" ".join)
def test_a_path_that_is_none_is_refused_by_every_command(run, tmp_path, monkeypatch, words, path):
    monkeypatch.chdir(tmp_path)
    code, out, error = run(*(word.format(path) for word in words))
    assert code == 2 and "Traceback" not in error and "error" in error.lower()
    assert "\x1b[31m" not in out + error and "\udcff" not in out + error and len(error) < 2000
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", ["~nosuchuser/s.yaml", "s" * 5000, "s\0", "\udcff", "a" * 4000])
@pytest.mark.parametrize("key", ["subject", "kinematics", "forces", "model"])
def test_a_path_that_is_none_is_refused_in_a_manifest(run, tmp_path, key, path):
    content = {"subject": "subject.yaml", "kinematics": "a.mot", "forces": "a.mot", "prosthesis": {"fulcrum_mm": 66}}
    (tmp_path / "walk.yaml").write_text(yaml.safe_dump(content | {key: path}), encoding="utf-8")
    (tmp_path / "subject.yaml").write_text(yaml.safe_dump(SUBJECT), encoding="utf-8")
    (tmp_path / "a.mot").write_text("", encoding="utf-8")
    code, _, error = run("simulate", tmp_path / "walk.yaml", "--out", tmp_path / "out")
    assert code == 2 and "Traceback" not in error and "walk.yaml" in error
    assert len(error) < 2000


@pytest.mark.parametrize("path", [*PATHS, "a\0b"], ids=range(len(PATHS) + 1))
def test_a_path_that_is_none_is_an_input_error(path):
    with pytest.raises(InputError) as raised:
        user_path(path, file="walk.yaml", where="subject")
    assert str(raised.value).startswith("walk.yaml: subject: ") and len(str(raised.value)) < 300
    with pytest.raises(InputError):
        read_bytes(path, most=10)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_text_wherever_it_comes(run, subject, tmp_path, name):
    out = tmp_path / name.replace("/", "∕")
    code, said, error = run("stand", subject(name), "--out", out, "--duration-s", 0.1, "--upright")
    assert code == 0 and not error.strip()
    assert "".join(name.split()) in "".join(said.split())
    assert read_json(out / "standing.json")["subject"] == name
    texts = "".join(ElementTree.parse(out / "standing.svg").getroot().itertext())
    assert "".join(name.split()) in "".join(texts.split())


def test_a_folder_named_like_markup_gets_its_results(run, subject, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, said, _ = run("stand", subject("A"), "--out", "a[/b]", "--duration-s", 0.1, "--upright")
    assert code == 0 and "written to a[/b]" in said
    assert (tmp_path / "a[" / "b]" / "standing.svg").is_file()


@pytest.mark.parametrize("name", ["\x1b[31mred", "a\0", "a\x07", "\x9b31m", "\ud800", "\u202eevil", "a\uffff"])
def test_a_name_that_cannot_be_printed_is_refused(run, subject, tmp_path, name):
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
    captured = capsys.readouterr()
    assert "[red]a[/b] :warning:" in captured.out and "[red]a[/b] :warning:" in captured.err


@pytest.mark.parametrize("text", [r"$\foo$", "$", r"\$5", "$a$ & <b>"])
def test_no_figure_reads_mathtext(tmp_path, text):
    with style():
        figure = new_figure(4.0, 3.0)
        axes = figure.add_subplot()
        axes.plot([0, 1], label=text)
        axes.legend()
        axes.set_xticks([0], [text])
        label(axes, x=text, y=text, title=text)
        figure.suptitle(text)
    save_figure(figure, tmp_path / "a")
    texts = [element.text for element in ElementTree.parse(tmp_path / "a.svg").getroot().iter() if element.text]
    assert texts.count(text) == 6


@pytest.mark.parametrize("text", ["=1+2", "+1+2", "-1+2", "@SUM(1)", "\tx", "\r=1", "=cmd|' /C calc'!A0", "-", "+a"])
def test_no_cell_is_a_formula(text):
    assert csv_cells([text]) == [f"'{text}"]


def test_other_cells_stay_as_they_are():
    cells = ["a=1", "", 1.5, -2.0, True, "-1.5", "+2e-3", "−3"]
    assert csv_cells([*cells, None]) == [*cells, ""]
