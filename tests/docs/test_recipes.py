"""Every recipe runs as it stands, in a copy of the SYNTHETIC recordings that come with the package,
and is short."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import tutorial

from vsf_drake.base.files import resource

DOCS = Path(__file__).resolve().parents[2] / "docs"
RECIPES = sorted((DOCS / "howto").glob("*.md"))
LONG = (
    "certify",
    "compare_two_settings",
    "fit_to_two_trials",
    "import_a_laboratory",
    "judge_a_recording",
    "map_for_a_mass",
    "predict_a_setting",
    "replay_in_a_browser",
    "tune_level_1",
    "walk_at_another_setting",
)
"""Recipes that take more than three seconds."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """The folder that recipes run in, as the page that lists them says."""
    return Path(
        shutil.copytree(resource("data/reference_subject"), tmp_path_factory.mktemp("lab") / "lab")
    )


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=[pytest.mark.slow] if page.stem in LONG else [])
        for page in RECIPES
    ],
)
def test_recipe_does_what_it_says(page, recordings):
    assert not tutorial.run(page, recordings)
    for folder in re.findall(r"--out (\w+)", page.read_text(encoding="utf-8")):
        assert any(recordings.glob(f"{folder}*")), folder


def test_twenty_recipes_of_ten_lines_stand_in_the_menu():
    """Imports and blank lines aside."""
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    assert {page.stem for page in RECIPES} == set(re.findall(r"^howto/(\w+)$", index, re.MULTILINE))
    assert len(RECIPES) >= 20
    for page in RECIPES:
        blocks = [block for block in tutorial.blocks(page) if block.language in ("python", "bash")]
        lines = "".join(block.text for block in blocks).splitlines()
        told = [line for line in lines if line and not re.match(r"(from|import) ", line)]
        assert 0 < len(told) <= 10, page.name
