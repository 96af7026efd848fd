"""The validation's page: what chapters are made of, in HTML; and what a browser makes of it."""

from __future__ import annotations

import pytest
from browser import chromium, look
from page_reader import Balanced

from vsf_drake.report.chapter_files import cell, chapter_page
from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Missing, Picture, Text
from vsf_drake.report.style import label, new_figure, style

needs_browser = pytest.mark.skipif(chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)")


def drawn() -> Picture:
    with style():
        figure = new_figure(10.0, 4.0)
        axes = figure.subplots()
        axes.plot([0.0, 1.0], [0.0, 2.0])
        label(axes, x="time (s)", y="force (N)")
    return Picture(name="line", figure=figure, caption="Force <rises>.", alt="The force rises from 0 to 2 N in 1 s.")


def chapter(*pieces) -> Chapter:
    return Chapter(name="bench", title="Bench & more", pieces=pieces)


def page(*pieces, **options) -> str:
    settings = {"synthetic": True, "links": {}} | options
    return chapter_page("A <title>", "Walking data are SYNTHETIC.", [chapter(*pieces)], **settings)


WIDE = Grid(name="wide", caption="Forty columns.", rows=[{f"c{i}": 1.0 / 3.0 for i in range(40)}],
            columns=[Column(key=f"c{i}", heading=f"number {i} (N)", form="{:.6f}") for i in range(40)])


def test_first_thing_on_the_page_is_where_the_data_come_from():
    text = page(Text("One."))
    body = text.partition("<body>")[2]
    assert body.lstrip().startswith('<p class="synthetic">Walking data are SYNTHETIC.</p>')


def test_every_tag_closes_in_turn_and_text_is_escaped():
    text = page(Text("a < b & c"), Heading("<h>"), Bullets(["<li>"]), Missing("No <CoP>."), WIDE, drawn())
    reader = Balanced()
    reader.feed(text.partition("\n")[2])
    assert reader.open == []
    assert "a &lt; b &amp; c" in text
    assert "<CoP>" not in text
    assert "Force &lt;rises&gt;." in text


def test_figures_are_inside_the_page_with_alternative_text():
    reader = Balanced()
    reader.feed(page(drawn()).partition("\n")[2])
    images = [attributes for tag, attributes in reader.seen if tag == "img"]
    assert len(images) == 1
    assert images[0]["alt"] == "The force rises from 0 to 2 N in 1 s."
    assert images[0]["src"].startswith("data:image/svg+xml;base64,")


@pytest.mark.parametrize(
    ("column", "value", "shown"),
    [
        (Column(key="k", heading="", form="{:.1f}", scale=100.0), 0.0534, "5.3"),
        (Column(key="k", heading="", form="{:.1f}"), None, "–"),
        (Column(key="k", heading="", form="{:.1f}"), 0.0, "0.0"),
        (Column(key="k", heading=""), True, "yes"),
        (Column(key="k", heading=""), False, "no"),
        (Column(key="k", heading=""), "low_1", "low_1"),
    ],
)
def test_unknown_values_are_dashes_and_never_numbers(column, value, shown):
    assert cell(column, value) == shown


def test_a_form_without_braces_is_refused_because_it_would_show_itself():
    with pytest.raises(ValueError, match="would show itself"):
        Column(key="k", heading="", form=".1f")


def test_a_line_of_the_summary_that_is_not_met_is_marked():
    grid = Grid(name="g", caption="", columns=[Column(key="met", heading="met")],
                rows=[{"met": True}, {"met": False}, {"met": None}])
    assert page(grid).count('<tr class="unmet">') == 1


def test_a_file_beside_the_page_is_linked():
    assert '<a href="replay.html">the replay</a>' in page(links={"the replay": "replay.html"})


@needs_browser
@pytest.mark.parametrize("width", [1280, 390])
def test_a_wide_table_scrolls_by_itself_and_the_page_does_not(tmp_path, width):
    file = tmp_path / "report.html"
    file.write_text(page(WIDE, drawn(), Text("long" * 60)), encoding="utf-8")
    (tmp_path / "work").mkdir()
    seen = look(file, tmp_path / "work", width=width)
    assert (seen.width, seen.scroll, seen.out) == (width, width, [])
    assert (seen.images, seen.broken, seen.unnamed) == (1, 0, 0)
    assert seen.console == []
    assert seen.requests == []


@needs_browser
def test_the_browser_would_notice_overflow_messages_requests_and_missing_images(tmp_path):
    file = tmp_path / "report.html"
    file.write_text('<!doctype html><html><body><div style="width:2000px">wide</div><img src="nowhere.png" alt="">'
                    '<script src="http://nowhere.invalid/x.js"></script><script>console.error("seen")</script>'
                    "</body></html>", encoding="utf-8")
    (tmp_path / "work").mkdir()
    seen = look(file, tmp_path / "work", width=390)
    assert seen.scroll > seen.width
    assert seen.out
    assert (seen.broken, seen.unnamed) == (1, 1)
    assert any("seen" in line for line in seen.console)
    assert seen.requests == ["http://nowhere.invalid/x.js"]


def test_on_paper_a_table_of_many_columns_is_set_smaller():
    narrow = Grid(name="narrow", caption="Two.", rows=WIDE.rows, columns=WIDE.columns[:2])
    text = page(WIDE, narrow)
    sizes = [float(part.partition("pt")[0]) for part in text.split("--print:")[1:]]
    assert sizes[0] < 4.0 and sizes[1] == 7.5
    assert "font-size:var(--print)" in text


@needs_browser
def test_figures_keep_a_size_that_can_be_read_on_a_telephone_and_scroll_by_themselves(tmp_path):
    file = tmp_path / "report.html"
    file.write_text(page(drawn()), encoding="utf-8")
    (tmp_path / "work").mkdir()
    seen = look(file, tmp_path / "work", width=390)
    assert seen.scroll == seen.width
    assert "width:720px" in file.read_text(encoding="utf-8")
