"""What commands say of a passive foot, on the screen, on pages, in figures and tables: its name,
and nothing of a fulcrum, which it has not."""

from __future__ import annotations

import re

import pytest
from command_line import exit_code
from matplotlib.colors import to_hex
from sweep_files import copied

from vsf_drake.base.files import resource
from vsf_drake.model.setting import AtSetting
from vsf_drake.report.style import colour_of

SOFT = "package://vsf_drake/passive.yaml"
LABORATORY = resource("data/reference_subject/laboratory")
RECORDED = resource("data/reference_subject/c3d")
TOLD = (".html", ".svg", ".csv")
ALLOWED = {
    "fulcrum.stiffness": "the parameter of that name, which --vary and --prior take",
    "fulcrum_mm": "the column of CSV files, empty for a passive foot",
}
COMMANDS = [
    ("check", "SOFT"),
    ("simulate", "SOFT", "--contact", "none"),
    ("compare", "SOFT", "STIFF"),
    ("sweep", "SOFT", "STIFF", "--vary", "offset.height=0,0.001"),
    ("bench", "--model", SOFT),
    ("stand", LABORATORY.parent / "subject.yaml", "--model", SOFT, "--duration-s", 0.5),
]


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Walks of which somebody says that they were walked on two passive feet."""
    folder = tmp_path_factory.mktemp("passive")
    shipped = resource("models/passive.yaml").read_text(encoding="utf-8")
    stiff = folder / "stiff.yaml"
    stiff.write_text(
        shipped.replace("clamp_m: 0.108", "clamp_m: 0.13").replace(
            "name: passive", "name: stiff 5"
        ),
        encoding="utf-8",
    )
    return {
        name: copied(
            LABORATORY / f"medium_{number}.yaml", folder / name, model=model, prosthesis={}
        )
        for name, number, model in (
            ("SOFT", 1, SOFT),
            ("SECOND", 2, SOFT),
            ("THIRD", 3, SOFT),
            ("STIFF", 1, str(stiff)),
        )
    }


def told_in(folder):
    """Of every page, figure and table below: where it is, and what a reader sees of it."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in TOLD:
            text = path.read_text(encoding="utf-8")
            for name in ALLOWED:
                text = text.replace(name, "")
            yield path.relative_to(folder).as_posix(), text


def nothing_of_a_fulcrum(folder, screen=""):
    """Fails at the first word of a fulcrum."""
    for place, text in (*told_in(folder), ("screen", screen)):
        said = re.search("[Ff]ulcrum|[Cc]arriage", text)
        if said is not None:
            pytest.fail(f"{place}: {text[max(0, said.start() - 60) : said.end() + 40]}")


@pytest.mark.parametrize("words", COMMANDS, ids=[words[0] for words in COMMANDS])
def test_screen_pages_figures_and_tables_tell_nothing_of_a_fulcrum(run, tmp_path, walks, words):
    words = [walks.get(word, word) for word in words]
    code, screen, error = run(*words, "--out", tmp_path / "out")
    assert code == 0, error
    nothing_of_a_fulcrum(tmp_path / "out", screen + error)


def test_two_passive_feet_compared_are_told_apart_by_their_names(run, tmp_path, walks):
    assert run("compare", walks["SOFT"], walks["STIFF"], "--out", tmp_path / "out")[0] == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "foot passive. B:" in page and "foot stiff 5." in page


def test_a_side_of_walks_on_two_passive_feet_is_refused_with_their_names(run, tmp_path, walks):
    both = tmp_path / "both"
    for name in ("SECOND", "STIFF"):
        copied(walks[name], both)
    code, _, error = run("compare", both, walks["THIRD"], "--out", tmp_path / "out")
    assert code == 2 and "holds walks on 2 feet (passive, stiff 5)" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_validation_draws_the_clamp_and_advises_what_a_passive_foot_can_do(run, tmp_path, walks):
    out = tmp_path / "out"
    trials = (walks["SOFT"], walks["SECOND"])
    code, screen, error = run("validate", *trials, "--quick", "--out", out)
    assert code == 0, error
    nothing_of_a_fulcrum(out, screen + error)
    story = (out / "report.html").read_text(encoding="utf-8")
    assert ">clamp</text>" in story and "vsf-drake bench --model" in story
    assert "vsf-drake tune" not in story and "vsf-drake map" not in story, "they refuse it"
    again = run("report", out)[1:]
    assert not any(line.startswith("! :") for text in again for line in text.splitlines())


def test_two_passive_feet_of_a_figure_have_two_colours():
    feet = [AtSetting(fulcrum_mm=None, foot=name) for name in ("firm", "soft")]
    assert len({to_hex(colour_of(foot, feet)) for foot in feet}) == 2


def test_a_shown_passive_foot_has_neither_fulcrum_nor_a_slider_of_it(tmp_path):
    page = tmp_path / "foot.html"
    assert exit_code("show", "--model", SOFT, "--html", page) == 0
    nothing_of_a_fulcrum(tmp_path)
    assert "load point raised" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_fit_and_what_is_made_of_it_tell_nothing_of_a_fulcrum(run, tmp_path, walks):
    fitted = [walks["SOFT"], walks["SECOND"]]
    held = walks["THIRD"]
    fit = tmp_path / "fit"
    contact = ("--contact", fit / "contact.yaml")
    commands = (
        ("fit", *fitted, "--hold-out", held, "--quick", "--out", fit),
        ("simulate", held, *contact, "--out", tmp_path / "walk"),
        ("validate", *fitted, held, "--quick", *contact, "--out", tmp_path / "validation"),
    )
    for words in commands:
        code, screen, error = run(*words)
        assert code == 0, error
        nothing_of_a_fulcrum(tmp_path, screen + error)


@pytest.mark.slow
def test_a_session_on_a_passive_foot_tells_nothing_of_a_fulcrum(run, tmp_path):
    folder = tmp_path / "recorded"
    folder.mkdir()
    for file in RECORDED.glob("*.c3d"):
        (folder / file.name).symlink_to(file)
    person = ("--sex", "male", "--prosthetic-side", "right", "--model", SOFT)
    code, screen, error = run("session", folder, *person, "--out", tmp_path / "out")
    assert code == 0, error
    nothing_of_a_fulcrum(tmp_path / "out", screen + error)
