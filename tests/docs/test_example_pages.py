"""The site's example pages are made by commands that there are, of files that come with the
package; CI_FULL=1 makes them, and the test of the site then follows their links."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

import typer

from vsf_drake.base.files import resource
from vsf_drake.cli import fit, session, stiffness_map, study, tune  # noqa: F401 (each adds its own)
from vsf_drake.cli.app import app

MADE = runpy.run_path(str(Path(__file__).resolve().parents[2] / "docs" / "make_example_pages.py"))


def test_every_example_page_is_of_options_and_recordings_that_there_are():
    commands = typer.main.get_command(app).commands
    lab = resource("data/reference_subject")
    for name, words in MADE["COMMANDS"].items():
        command = commands[name]
        command.make_parser(command.context_class(command)).parse_args(words.split())
        files = [word for word in words.split() if word.endswith(".yaml")]
        assert [file for file in files if not (lab / file).is_file()] == []
    assert {f"{name}.c3d" for name in MADE["WALKS"]} <= {
        path.name for path in (lab / "c3d").iterdir()
    }


def test_an_example_keeps_pages_alone_and_replaces_an_earlier_one(tmp_path):
    made, target = tmp_path / "made", tmp_path / "target"
    for name in ("report.html", "figures/bench.png", "walks/result.npz", "fit/report.html"):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_text(name, encoding="utf-8")
    shutil.copytree(made, target)
    (target / "left.html").touch()
    MADE["keep"](made, target)
    kept = {path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file()}
    assert kept == {"report.html", "fit/report.html"}
