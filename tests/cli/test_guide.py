"""An error names the section of the guide on what it is about."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer.main
import yaml
from command_line import exit_code

from vsf_drake.base.files import resource
from vsf_drake.cli import (  # noqa: F401
    certify,
    compare,
    device,
    doctor,
    fit,
    foot,
    predict,
    recordings,
    session,
    stiffness_map,
    study,
    sweep,
    tune,
)
from vsf_drake.cli.app import app
from vsf_drake.cli.guide import _SECTIONS, GUIDES

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "guide"
WALK = resource("data/reference_subject/exact/medium_1.yaml")


def anchors(page):
    """Anchors of a page's headings, as GitHub and the site make them."""
    text = re.sub(
        r"^```.*?^```$", "", (GUIDE / f"{page}.md").read_text(encoding="utf-8"), flags=re.M | re.S
    )
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_command_has_a_page_and_every_section_that_is_named_exists():
    assert set(GUIDES) == {each.name or each.callback.__name__ for each in app.registered_commands}
    for place in (*GUIDES.values(), *_SECTIONS.values()):
        page, _, section = place.partition("#")
        assert not section or section in anchors(page), place


def test_every_option_that_leads_to_a_section_is_one_of_a_command():
    commands = typer.main.get_command(app).commands
    options = {
        name: {word for parameter in command.params for word in parameter.opts}
        for name, command in commands.items()
    }
    for name in _SECTIONS:
        command, _, option = name.rpartition(":")
        assert not option.startswith("--") or any(
            option in own for word, own in options.items() if command in ("", word)
        ), name


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A folder to run in, with files of which each has one fault."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "other/mine.txt").write_text("mine")
    (tmp_path / "bench.yaml").write_text("forefoot: [{fulcrum_mm: 66, stiffness: 10}]")
    (tmp_path / "load.csv").write_text("time_s,force\n0,1\n")
    (tmp_path / "model.yaml").write_text("leg: {}")
    (tmp_path / "contact.yaml").write_text("values: 3")
    subject = {"mass_kg": 800, "stature_m": 1.8, "sex": "male", "prosthetic_side": "right"}
    (tmp_path / "heavy.yaml").write_text(yaml.safe_dump(subject))
    (tmp_path / "angles.yaml").write_text(
        "subject: heavy.yaml\nkinematics: a.mot\nforces: a.mot\nprosthesis: 66\n"
    )
    (tmp_path / "hips.yaml").write_text(
        "subject: heavy.yaml\nmarkers: a.trc\nprosthesis: {fulcrum_mm: 66}\nhip_centre: mine\n"
    )
    (tmp_path / "broken.c3d").write_bytes(b"no C3D")


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("simulate none.yaml --out out", "trials.md"),
        ("simulate angles.yaml --out out", "trials.md#from-joint-angles"),
        ("simulate hips.yaml --out out", "trials.md#from-markers"),
        ("stand heavy.yaml --out out", "trials.md#the-subject"),
        (f"simulate {WALK} --out out --fulcrum-mm 300", "trials.md#another-setting"),
        (f"simulate {WALK} --out other", "results.md#the-folder"),
        (
            f"simulate {WALK} --out out --contact contact.yaml",
            "fit.md#which-trials-and-what-comes-out",
        ),
        (
            "import broken.c3d broken.c3d --out out --prosthetic-side right --sex male",
            "laboratory_files.md#files",
        ),
        (
            "import broken.c3d --no-standing --out out --prosthetic-side middle",
            "laboratory_files.md#person",
        ),
        (f"fit {WALK} --out out --prior nothing", "fit.md#what-is-fitted-and-priors"),
        (f"fit {WALK} --out out --bench=bench.yaml", "fit.md#the-bench-file"),
        (f"fit {WALK} --out out --resume", "fit.md#how-long-and-how-to-go-on"),
        ("map --out out --target radius=much", "stiffness_map.md#the-map-and-asking-it"),
        ("map --out out --mass 50:60", "stiffness_map.md#axes"),
        ("map --out out --load load.csv", "stiffness_map.md#a-load-of-your-own"),
        (f"sweep {WALK} --out out --vary nothing=1,2", "sweep.md#what-is-varied"),
        ("tune --out out --cost comfort", "tune.md#costs"),
        ("bench --out out --model model.yaml", "files_and_units.md#which-file-is-what"),
    ],
)
def test_an_error_leads_to_the_section_that_says_what_is_right(words, place, files, capsys):
    assert exit_code(*words.split()) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"guide: docs/guide/{place}"
