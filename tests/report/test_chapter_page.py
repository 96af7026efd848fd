"""The validation's page: what chapters are made of, in HTML; and what a browser makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from browser import chromium, look
from jinja2 import ChoiceLoader, DictLoader, UndefinedError
from page_reader import Balanced

from vsf_drake.report import page as page_module
from vsf_drake.report.page import Chapter, Column, cell, chapter_page, listed, number, said
from vsf_drake.report.style import drawing, label

needs_browser = pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)


def drawn():
    with drawing(10.0, 4.0) as figure:
        axes = figure.subplots()
        axes.plot([0.0, 1.0], [0.0, 2.0])
        label(axes, x="time (s)", y="force (N)")
    return figure


@pytest.fixture
def templates(monkeypatch):
    """Templates of a test beside those of the package."""
    own: dict[str, str] = {}
    monkeypatch.setattr(
        page_module._PAGES, "loader", ChoiceLoader([DictLoader(own), page_module._PAGES.loader])
    )
    return own


WIDE = {
    "rows": [{f"c{i}": 1.0 / 3.0 for i in range(40)}],
    "columns": [(f"c{i}", f"number {i} (N)", "{:.6f}") for i in range(40)],
}
TABLE = '{% call table("wide", rows, columns) %}Forty columns.{% endcall %}'
FIGURE = (
    '{% call figure("line", alt="The force rises from 0 to 2 N in 1 s.") %}Force {{ "<rises>" '
    "}}.{% endcall %}"
)


@pytest.fixture
def page(templates):
    """The page of one chapter with this template."""

    def of(template: str, **facts) -> str:
        templates["one.html.j2"] = template
        made = Chapter(
            name="bench",
            title="Bench & more",
            template="one.html.j2",
            facts=WIDE | facts,
            figures={"line": drawn()} if "figure" in template else {},
        )
        return chapter_page(
            [made], title="A <title>", first_line="Walking data are SYNTHETIC.", synthetic=True
        )[0][0]

    return of


def test_values_are_numbers_in_their_form_or_words_and_unknown_ones_are_dashes():
    for column, value, shown in (
        (Column("k", "", "{:.1f}", 100.0), 0.0534, "5.3"),
        (Column("k", "", "{:.1f}"), None, "–"),
        (Column("k", ""), True, "yes"),
        (Column("k", ""), "low_1", "low_1"),
    ):
        assert cell(column, value) == shown
    with pytest.raises(ValueError, match="would show itself"):
        Column("k", "", ".1f")
    assert number(-0.001, "{:+.2f}") == "0.00"
    assert said({"a": [1, 2.5, None], "b": True, "c": []}) == "a 1, 2.5, –, b yes, c –"
    assert [listed(names) for names in ([], ["a"], ["a", "b"], "abc")] == [
        "–",
        "a",
        "a and b",
        "a, b and c",
    ]


def test_rows_are_mappings_or_records_and_one_that_is_not_met_is_marked(page):
    table = (
        '{% call table("g", rows, (("met", "met"), ("n", "n", "{:.1f}"), ("k", "nowhere"))) %}{% '
        "endcall %}"
    )
    rows = [{"met": True}, {"met": False, "n": 2}, {"met": None}]
    text = page(table, rows=rows)
    assert text.count('<tr class="unmet">') == 1 and ">2.0</td>" in text
    assert "nowhere" not in text, "a column of which nothing is known"
    assert page(table, rows=[Goal(row["met"], row.get("n")) for row in rows]) == text


@dataclass(frozen=True)
class Goal:
    met: bool | None
    n: float | None


@pytest.mark.slow
@needs_browser
def test_a_wide_table_scrolls_by_itself_and_the_page_does_not(page, tmp_path):
    file, width = tmp_path / "report.html", 390
    file.write_text(page(TABLE + FIGURE + "<p>" + "long" * 60 + "</p>"), encoding="utf-8")
    (tmp_path / "work").mkdir()
    seen = look(file, tmp_path / "work", width=width)
    assert (seen.width, seen.scroll, seen.out) == (width, width, [])
    assert (seen.images, seen.broken, seen.unnamed, seen.console, seen.requests) == (
        1,
        0,
        0,
        [],
        [],
    )


TEMPLATE = """
{% if bad %}<p>{{ odd }}</p><p>{{ name }} failed, {{ share | number("{:.0f}", 100) }} %.</p>{% endif %}
{% call missing() %}No <b>{{ name }}</b>
   was measured.{% endcall %}
{% call table("wide", rows, columns) %}Forty of {{ name }}.{% endcall %}
{% call figure("line", alt="Rises to " ~ name) %}Force of {{ name }}.{% endcall %}
"""  # noqa: E501


def written(templates, text, folder, **options):
    templates["own.html.j2"] = text
    made = Chapter(
        name="own",
        title="Own",
        template="own.html.j2",
        figures={"line": drawn()},
        facts=WIDE | {"bad": True, "odd": "a < b & c", "name": "<x>", "share": 0.5},
    )
    pages, shown = chapter_page(
        [made],
        title="A <title>",
        first_line="Walking data are SYNTHETIC.",
        synthetic=True,
        folder=folder,
        **options,
    )
    return pages[0], shown


def test_a_chapter_is_its_template_filled_in_and_leaves_files_of_what_it_shows(templates, tmp_path):
    text, [shown] = written(templates, TEMPLATE, tmp_path)
    reader = Balanced()
    reader.feed(text.partition("\n")[2])
    assert reader.open == [] and "<x>" not in text
    for words in (
        "<p>&lt;x&gt; failed, 50 %.</p>",
        'alt="Rises to &lt;x&gt;"',
        "Forty of &lt;x&gt;.",
        "Force of &lt;x&gt;.",
        '<p class="synthetic">Walking data are SYNTHETIC.</p>',
        "a &lt; b &amp; c",
        'src="data:image/png;base64,',
    ):
        assert words in text, words
    assert {str(path) for path in shown.files} == {"tables/wide.csv", "figures/line.png"}
    assert all((tmp_path / path).is_file() for path in shown.files)
    assert shown.missing == ["No <x> was measured."]


def test_a_page_without_figures_and_tables_leaves_no_folders_for_them(templates, tmp_path):
    written(templates, "<p>Nothing to draw.</p>", tmp_path)
    assert not [*tmp_path.iterdir()]


def test_a_template_that_asks_for_what_nobody_gave_is_an_error_or_said_in_its_place(
    templates, tmp_path
):
    with pytest.raises(UndefinedError):
        written(templates, "{{ nobody }}", tmp_path)
    text, [shown] = written(templates, "{{ nobody }}", None, lenient=True)
    assert (
        "This version cannot show what the results hold of it" in text
        and "nobody" in shown.missing[0]
    )


def test_a_command_in_what_is_missing_is_set_as_code_and_nothing_else_is_markup(page):
    shown = page(
        "{{ missing(text) }}", text="Not made: <b> is missing; `pip install 'a[b]'` gets it."
    )
    assert (
        "Not made: &lt;b&gt; is missing; <code>pip install &#39;a[b]&#39;</code> gets it." in shown
    )
