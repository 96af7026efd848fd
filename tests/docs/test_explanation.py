"""What the pages of explanation say of the model is the model's, and their pictures are those that
the script draws."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from vsf_drake.model.parameters import ModelParameters

DOCS = Path(__file__).resolve().parents[2] / "docs"
PICTURES = sorted((DOCS / "pictures").glob("explained_*.png"))


def words(name):
    return " ".join((DOCS / "explanation" / f"{name}.md").read_text(encoding="utf-8").split())


def test_constants_on_the_pages_are_those_of_the_nominal_model():
    model = ModelParameters()
    foot = model.foot
    first, *others = (1e3 * length for length in foot.keel.element_lengths_m)
    assert f"one element of {first:.0f} mm, seven of {others[0]:.2f} mm" in words("keel")
    assert len(others) == 7 and np.ptp(others) < 1e-2
    assert f"{1e-6 * foot.fulcrum.stiffness_n_per_m:.0f} MN/m" in words("keel")
    assert f"{sum(len(zone.x_mm) for zone in foot.zones)} spheres" in words("contact")
    (full_m,) = {zone.full_damping_depth_m for zone in foot.zones}
    assert rf"$\delta_\mathrm{{full}}$ = {1e3 * full_m:.0f} mm" in words("contact")
    friction = foot.friction
    assert (
        f"$\\mu_s$ = {friction.mu_static} at the threshold, {friction.threshold_velocity_m_per_s} "
        f"m/s, falls to $\\mu_k$ = {friction.mu_kinetic}" in words("friction")
    )


def test_every_page_has_a_picture_and_every_picture_a_page():
    told = " ".join(words(path.stem) for path in (DOCS / "explanation").glob("*.md"))
    for path in (DOCS / "explanation").glob("*.md"):
        assert f"(../pictures/explained_{path.stem}.png)" in words(path.stem)
    assert all(f"(../pictures/{path.name})" in told for path in PICTURES)


@pytest.mark.slow
@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.stem)
def test_the_picture_is_drawn_from_the_model(picture, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    script = importlib.import_module("make_explanation_pictures")
    monkeypatch.setattr(script, "PICTURES_OF", tmp_path)
    script.main([picture.stem.removeprefix("explained_")])
    made = imread(tmp_path / picture.name)
    shown = imread(picture)
    assert made.shape == shown.shape and np.mean(np.abs(made - shown)) < 0.02
