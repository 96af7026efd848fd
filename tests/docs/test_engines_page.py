"""What the guide to other engines shows is what they do."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from vsf_drake.engines.osim import foot_osim
from vsf_drake.model.parameters import FootParameters

DOCS = Path(__file__).resolve().parents[2] / "docs"
PRESS = Path(__file__).resolve().parents[1] / "engines" / "press_in_moco.py"


def blocks():
    """Those that need OpenSim: they are not run with the blocks of the other pages."""
    page = (DOCS / "guide" / "engines.md").read_text(encoding="utf-8")
    return re.findall(r"^```{code-block} python\n(.*?)^```$", page, flags=re.M | re.S)


def test_the_block_for_opensim_finds_mount_and_hinges(tmp_path, monkeypatch, capsys):
    pytest.importorskip("opensim", reason="pip install 'vsf-drake[opensim]'")
    [block, _] = blocks()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foot").mkdir()
    text = foot_osim(FootParameters(), fulcrum_m=0.108)
    (tmp_path / "foot" / "vsf_foot_at_108mm.osim").write_text(text, encoding="utf-8")
    exec(block, {})
    mount = [f"vsf_mount_{name}" for name in ("pitch", "tx", "ty")]
    hinges = ["keel_pin", *(f"keel_{i}" for i in range(1, 9))]
    assert capsys.readouterr().out == f"{[*mount, *hinges]}\n"


def test_the_solver_of_moco_is_set_as_in_the_press_that_was_tested():
    [_, block] = blocks()
    pressed = PRESS.read_text(encoding="utf-8")
    intervals = re.search(r"^MESH = (\d+)$", pressed, flags=re.M)[1]
    settings = pressed.replace("(MESH)", f"({intervals})")
    assert block.count("set_") == 7
    assert [line for line in block.splitlines() if f"    {line}\n" not in settings] == []


@pytest.mark.slow
def test_the_picture_of_four_engines_is_what_they_answer(tmp_path, monkeypatch):
    for engine in ("opensim", "mujoco", "exudyn"):
        pytest.importorskip(engine, reason="pip install 'vsf-drake[engines]'")
    monkeypatch.syspath_prepend(DOCS)
    monkeypatch.chdir(tmp_path)  # where OpenSim leaves a log
    runpy.run_path(str(DOCS / "make_engines_picture.py"))["main"](tmp_path / "made.png")
    made, shown = imread(tmp_path / "made.png"), imread(DOCS / "pictures" / "engines.png")
    assert made.shape == shown.shape
    assert np.mean(np.abs(made - shown)) < 1e-3, "run python docs/make_engines_picture.py"
