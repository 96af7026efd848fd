"""The picture of the keel in four engines is what they answer."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

DOCS = Path(__file__).resolve().parents[2] / "docs"


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
