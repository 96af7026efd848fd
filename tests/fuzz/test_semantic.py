"""Mistakes of meaning in a recording: refused, doubted, or of no consequence. The table:
`tests/fuzz/semantic.py`."""

from __future__ import annotations

from pathlib import Path

import pytest
import semantic

GUIDE = Path(__file__).parents[2] / "docs" / "guide" / "trials.md"
TOLD = (
    "signs: hip rotation, both sides",
    "signs: hip adduction, both sides",
    "signs: fore-aft force",
    "units: centre of pressure in cm",
    "sides: feet of the plates",
    "sides: prosthetic side",
    "times: forces 60 ms early",
    "filters: angles again at 3 Hz",
    "plates: centre of pressure 30 mm forward",
    "plates: turned by 90 degrees",
    "subject: mass 20 % too low",
    "units: mass in pounds",
)


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    return semantic.Right(semantic.recording(semantic.ANGLES[0]), tmp_path_factory.mktemp("right"))


def test_the_right_recording_is_good(right):
    assert right.examined.mark == "good"
    assert all(check.mark == "good" for check in right.examined.checks)


@pytest.mark.parametrize("mistake", TOLD)
def test_a_mistake_of_meaning_is_refused_or_doubted(right, tmp_path, mistake):
    said, because, _ = semantic.answer(
        semantic.MISTAKES[mistake], semantic.recording(semantic.ANGLES[0]), right.examined, tmp_path
    )
    assert said in ("refused", "doubted") and because


@pytest.mark.slow
def test_at_most_two_mistakes_of_fifty_are_silent_and_change_the_force_and_the_guide_names_them():
    found = list(semantic.outcomes())
    assert len(found) == 3 * (len(semantic.MISTAKES) + len(semantic.MARKER_MISTAKES)) == 150
    silent = {
        one.mistake
        for one in found
        if one.answer == "silent"
        and (one.consequence_bw is None or one.consequence_bw > semantic.SILENT_BW)
    }
    assert len(silent) <= 2, silent
    text = " ".join(GUIDE.read_text(encoding="utf-8").split())
    assert all(mistake.partition(": ")[2] in text for mistake in silent), silent
