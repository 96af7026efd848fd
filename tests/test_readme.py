"""README and guide: Python runs outside the checkout with only the package installed, commands have
these options."""

from __future__ import annotations

import ast
import json
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
from matplotlib.image import imread
from PIL import Image

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
from vsf_drake.model.parameters import FootParameters

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {
    path.name: path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "docs" / "guide").glob("*.md"))
}
GUIDE = "\n".join(PAGES.values())
OWN_TESTS = ("assist_sim.md", "foot_from_curves.md")
RUN_HERE = [text for name, text in PAGES.items() if name not in OWN_TESTS]
BLOCKS = re.findall(
    r"^```python\n(.*?)^```$", "\n".join([README, *RUN_HERE]), flags=re.MULTILINE | re.DOTALL
)
SHORT = BLOCKS[0]  # the README's
LEG = next(block for block in BLOCKS if "leg.urdf" in block)
RUNNING = """
import contextlib, io, json, sys
if __name__ == "__main__":
    for number, block in enumerate(json.load(open("blocks.json", encoding="utf-8"))):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(compile(block, f"block {number}", "exec"), {"__name__": "__main__"})
        print(json.dumps(said.getvalue()), flush=True)
"""
LATER = """
for moment in (0.75, 1.0):
    simulator.AdvanceTo(moment)
    print(wired.GetOutputPort("grf").Eval(forces))
"""


def test_readme_is_short_shows_the_replay_and_leads_to_every_page_of_the_guide():
    told = re.sub(r"^```.*?^```$", "", README, flags=re.MULTILINE | re.DOTALL)
    assert len(re.sub(r"\]\([^)]*\)", "]", told).split()) <= 600
    pictures = [ROOT / name for name in re.findall(r"!\[[^\]]{20,}\]\(([^)]+)\)", README)]
    assert len(pictures) == 5 and sum(path.stat().st_size for path in pictures) < 3_000_000
    with Image.open(pictures[0]) as replay:
        assert replay.n_frames > 20
    assert not [
        link
        for link in re.findall(r"\]\((?!https?:)([^)#]+)", README)
        if not (ROOT / link).is_file()
    ]
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert {path.stem for path in (ROOT / "docs" / "guide").iterdir()} == set(
        re.findall(r"^guide/(\w+)$", index, re.MULTILINE)
    )


def test_commands_in_readme_and_guide_have_the_options_that_they_name():
    shown = (README + GUIDE).replace("\\\n", " ")
    fenced = "\n".join(
        re.findall(r"^```(?:bash|shell)\n(.*?)^```$", shown, flags=re.MULTILINE | re.DOTALL)
    )
    lines = re.findall(r"^vsf-drake [a-z].*", fenced, re.MULTILINE) + re.findall(
        r"`(vsf-drake [a-z][^`]*)`", shown
    )
    commands = typer.main.get_command(app).commands
    words = [shlex.split(re.sub(r"[\[\]]", "", line), comments=True)[1:] for line in lines]
    assert {name for name, *_ in words} == set(commands)
    for name, *rest in words:
        command = commands[name]
        command.make_parser(command.context_class(command)).parse_args(rest)


def test_bench_walk_and_validation_are_shown_and_what_it_imports_is_there():
    text = "\n".join(BLOCKS)
    for name in ("run_bench", "simulate_trial", "write_walk", "make_gait", "wire_foot("):
        assert name in text
    imports = [
        node for node in ast.walk(ast.parse(text)) if isinstance(node, (ast.Import, ast.ImportFrom))
    ]
    exec(compile(ast.Module(imports, []), "imports", "exec"), {})


@pytest.mark.slow
def test_blocks_run_outside_the_checkout_and_legs_come_to_rest_on_their_weight(tmp_path):
    """One process for all, each with names of its own.

    Friction that creeps (in proportion to speed below its threshold) holds nothing at rest: what
    the landing bent in hip and knee slides away, by one exponential of 0.8 s. Three equal steps of
    it tell where it ends (Aitken).
    """
    blocks = [block + LATER if block is LEG else block for block in BLOCKS]
    (tmp_path / "blocks.json").write_text(json.dumps(blocks), encoding="utf-8")
    (tmp_path / "run.py").write_text(RUNNING, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(said) == len(BLOCKS) and all(text.strip() for text in said)
    leg = said[BLOCKS.index(LEG)]
    force, weight, *later = (
        [float(x) for x in re.findall(r"-?\d+\.\d*", line)] for line in leg.splitlines()
    )
    assert force[2] == pytest.approx(weight[0], rel=1e-3)
    first, second, third = force[0], later[0][0], later[1][0]
    assert 0.0 < third / second < 1.0 and 0.0 < second / first < 1.0
    assert abs(first * third - second**2) < 1e-3 * weight[0] * abs(first + third - 2.0 * second)
    short = [float(x) for x in re.findall(r"-?\d+\.\d*(?:e[+-]?\d+)?", said[BLOCKS.index(SHORT)])]
    assert short[2] == pytest.approx(9.81 * (60.0 + FootParameters().mass_kg), rel=1e-4)


def test_the_picture_of_the_ten_lines_is_what_they_do(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")
    runpy.run_path(str(ROOT / "docs" / "make_drop_picture.py"))["main"](tmp_path / "made.png")
    made = imread(tmp_path / "made.png")
    shown = imread(ROOT / "docs" / "pictures" / "drop.png")
    assert np.mean(np.abs(made - shown)) < 1e-3, "run python docs/make_drop_picture.py"
