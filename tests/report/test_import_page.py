"""The page of a check: one file, no network, nothing hidden, every text only text."""

from __future__ import annotations

import dataclasses
import html.parser
import re

import pytest
from browser import chromium, look
from page_reader import Balanced
from readable import assert_readable

from vsf_drake.base.files import resource
from vsf_drake.motion.markers.segments import TrackedMotion
from vsf_drake.motion.trial import load_trial
from vsf_drake.recording import MARKS
from vsf_drake.recording.examine import examine
from vsf_drake.report import import_outputs
from vsf_drake.report.import_outputs import angle_figure, floor_figure, force_figure, import_page


@pytest.fixture(scope="module")
def item():
    return examine(load_trial(resource("data/reference_subject/exact/medium_1.yaml")))


@pytest.fixture(scope="module")
def page(item):
    odd = dataclasses.replace(
        item, trial=dataclasses.replace(item.trial, name="<b>trial</b> & $x$ ü")
    )
    return import_page([item, odd], title="Check <1>", failures={"walk <3>.c3d": "is cut & short"})


def test_page_is_whole_html_and_loads_nothing(page):
    reader = Balanced()
    reader.feed(page)
    assert reader.open == []
    for tag, attributes in reader.seen:
        assert tag not in ("link", "iframe")
        for key in ("src", "href"):
            assert attributes.get(key, "#").startswith(("#", "data:image/png;base64,"))
    assert "http" not in re.sub(r"base64,[^\"]*", "", page)


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_page_reads_on_a_desk_and_on_a_telephone(page, tmp_path):
    (tmp_path / "import.html").write_text(page, encoding="utf-8")
    for width in (1300, 390):
        (tmp_path / str(width)).mkdir()
        seen = look(tmp_path / "import.html", tmp_path / str(width), width=width)
        assert (seen.console, seen.requests, seen.out, seen.broken, seen.unnamed) == (
            [],
            [],
            [],
            0,
            0,
        )
        assert seen.scroll <= width and seen.images == 7 and 60 < seen.words <= 600


def test_names_and_messages_are_only_text(page):
    assert "<b>trial" not in page
    assert "&lt;b&gt;trial&lt;/b&gt; &amp; $x$ ü" in page
    assert "walk &lt;3&gt;.c3d" in page
    assert "is cut &amp; short" in page


def test_every_check_stands_on_the_page_with_mark_and_sentence(item, page):
    text = html.unescape(str(page))
    for check in item.checks:
        assert check.sentence in text
        assert check.mark in MARKS
    order = [
        m for m in re.findall(r'<tr><td><span class="mark"[^>]*>(\w+)</span></td><td>[^<]', page)
    ]
    first = order[: len(item.checks)]
    assert first == sorted(first, key=lambda mark: -MARKS.index(mark))


def test_a_recording_without_a_plate_has_no_figure_of_forces(item, page):
    bare = examine(dataclasses.replace(item.trial, plates={}))
    alone = import_page([bare], title="Check")
    forces = "Force of each foot over time"
    assert forces in page and forces not in alone
    assert alone.count("<img") == 2


def test_synthetic_trials_are_called_so_in_title_text_and_every_figure_which_a_telephone_can_show(
    item, page
):
    assert "(SYNTHETIC)</title>" in page
    assert "SYNTHETIC, not recorded: " in page
    for make in (angle_figure, force_figure, floor_figure):
        figure = make(item)
        assert_readable(figure, make.__name__)
        labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert any("SYNTHETIC" in label for label in labels)


def test_figures_are_kept_only_of_the_same_feet_and_angles_drawn_by_the_same_code(
    item, monkeypatch
):
    def tracked(more):
        motion = item.trial.trajectory
        found = TrackedMotion(motion.time_s, motion.names, motion.values + more, {}, {}, {}, {})
        return dataclasses.replace(item, trial=dataclasses.replace(item.trial, tracked=found))

    feet = {
        side: dataclasses.replace(foot, toe_W=foot.toe_W + 1e-3) for side, foot in item.feet.items()
    }
    items = [item, dataclasses.replace(item, feet=feet), tracked(0.0), tracked(1e-3)]
    shown = [import_outputs._shown(each) for each in items]
    assert shown[0] == import_outputs._shown(item)
    monkeypatch.setattr(import_outputs, "version", lambda name: "0")
    shown.append(import_outputs._shown(item))
    monkeypatch.setattr(import_outputs, "DRAWN_BY", ("report/page.py",))
    shown.append(import_outputs._shown(item))
    assert len(set(shown)) == 6
