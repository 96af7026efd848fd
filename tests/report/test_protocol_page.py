"""The page of a published test: what stands first, every clause once, a picture that is read
without colour, a CSV with units."""

from __future__ import annotations

import csv
import html
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from vsf_drake.base.errors import InputError
from vsf_drake.device.bench_protocol import bench_protocol
from vsf_drake.device.protocols import PROTOCOLS
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.report.protocol_page import PROTOCOL, radar_figure, shown_settings, write_protocol

MODEL = ModelParameters()
COLUMNS = (
    "protocol clause test part quantity value unit fulcrum_mm setting angle_deg load_n computed "
    "why_not limit_or_code conditions source"
).split()


@pytest.fixture(scope="module")
def made():
    return {
        name: bench_protocol(MODEL, name, fulcrums_m=[0.066, 0.108, 0.151]) for name in PROTOCOLS
    }


def text_of(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    return html.unescape(" ".join(re.sub("<[^>]*>", " ", page[page.index("<body>") :]).split()))


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_page_says_first_that_it_shows_no_conformity_and_has_every_clause(made, name, tmp_path):
    write_protocol(tmp_path, made[name])
    text = text_of(tmp_path)
    assert text.index("nothing here shows conformity") < text.index(PROTOCOLS[name])
    for row in made[name].table.rows:
        assert row.clause.test in text and row.clause.source in text
        assert row.computed or row.clause.why_not in text
    assert "not computed, because" in text


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_csv_has_every_value_with_its_unit_and_blanks_where_nothing_is_computed(
    made, name, tmp_path
):
    write_protocol(tmp_path, made[name])
    with (tmp_path / "protocol.csv").open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == COLUMNS
    table = made[name].table
    computed = [row for row in table.rows if row.computed]
    assert len(lines) == 3 * len(computed) + len(table.rows) - len(computed)
    for line in lines:
        blank = [line[column] == "" for column in ("value", "unit", "load_n", "fulcrum_mm")]
        assert any(blank) == all(blank) == bool(line["why_not"]) and line["source"]
    values = [float(line["value"]) for line in lines if line["value"]]
    assert values == [value for row in computed for value in row.values]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_settings_in_the_radar_differ_in_mark_and_in_grey_and_are_named(made, name):
    table = made[name].table
    figure = radar_figure(table, shown_settings(table))
    [axes] = figure.axes
    greys = [np.dot((0.299, 0.587, 0.114), to_rgb(line.get_color())) for line in axes.lines]
    assert np.all(np.diff(greys) > 0.1)
    assert len({line.get_marker() for line in axes.lines}) == 3
    [legend] = figure.legends
    assert [text.get_text() for text in legend.texts] == ["66 mm", "108 mm", "151 mm"]
    named = {text.get_text() for text in axes.texts}
    for row in table.rows:
        if row.clause.axis:
            assert any(text.split("\n")[:-1] == row.clause.axis.split(" ", 1) for text in named)
    for line in axes.lines:
        assert 0.0 < np.min(line.get_ydata()) <= np.max(line.get_ydata()) <= 1.0


def test_an_axis_ends_at_twice_its_value_where_a_foot_is_beyond_it(made):
    [row] = [row for row in made["aopa"].table.rows if row.clause.axis == "heel displacement"]
    far = replace(row, values=(25.0, 5.0, 5.0))
    table = replace(made["aopa"].table, rows=(far, *made["aopa"].table.rows))
    [axes] = radar_figure(table, [0, 1, 2]).axes
    assert "heel\ndisplacement\nto 40 mm" in {text.get_text() for text in axes.texts}
    assert axes.lines[0].get_ydata()[0] == pytest.approx(25.0 / 40.0)


def test_what_changes_most_is_told_over_the_axis_that_it_has(made, tmp_path):
    """Of 100 N/mm 20 are less than of 5 J three."""
    own = made["aopa"]
    changed = {"heel stiffness": (40.0, 50.0, 60.0), "heel stored": (1.0, 2.0, 4.0)}
    rows = tuple(
        replace(row, values=changed.get(row.clause.axis, 3 * row.values[:1]))
        for row in own.table.rows
    )
    write_protocol(tmp_path, replace(own, table=replace(own.table, rows=rows)))
    assert "changes most: heel stored, 1.00 J at 66 mm, 4.00 J at 151 mm" in text_of(tmp_path)


@pytest.mark.parametrize(("load_n", "said"), [(600.0, False), (1000.0, True)])
def test_a_load_beyond_the_published_presses_is_said_to_be_extrapolated(
    made, tmp_path, load_n, said
):
    own = made["aopa"]
    write_protocol(tmp_path, replace(own, table=replace(own.table, load_n=load_n)))
    assert ("Published presses of this device end at 600 N" in text_of(tmp_path)) is said


def test_a_passive_foot_has_one_column_and_no_fulcrum_on_its_page(tmp_path):
    fixed = replace(MODEL.foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    model = replace(MODEL, foot=replace(MODEL.foot, fulcrum=fixed))
    write_protocol(tmp_path, bench_protocol(model, "iso16955"))
    text = text_of(tmp_path)
    assert "fulcrum" not in text and "passive" in text and "100 mm" not in text


def test_a_part_that_gave_way_is_a_dash_and_a_sentence(made, tmp_path):
    own = made["aopa"]
    rows = tuple(
        replace(row, values=(None, *row.values[1:])) if row.clause.part == "toe" else row
        for row in own.table.rows
    )
    arrays = {name: array for name, array in own.arrays.items() if not name.endswith("toe_0")}
    failed = ("Pressed at the toe, 66 mm: gave way.", "On the level bench: gave way.")
    table = replace(own.table, rows=rows, missing=failed, bench=None)
    write_protocol(tmp_path, replace(own, table=table, arrays=arrays))
    text = text_of(tmp_path)
    assert all(sentence in text for sentence in failed) and "–" in text
    assert "level bench of vsf-drake bench" not in text


def test_the_page_is_made_again_from_what_was_saved_and_another_format_is_refused(made, tmp_path):
    write_protocol(tmp_path, made["iso22675"])
    before = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert PROTOCOL.remake(tmp_path) == []
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == before
    path = tmp_path / PROTOCOL.table
    path.write_text(path.read_text().replace("bench protocol 1", "bench protocol 9"))
    with pytest.raises(InputError, match="format"):
        PROTOCOL.read(tmp_path)
