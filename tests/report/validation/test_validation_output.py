"""What a validation leaves on disk, and the page made again of it: without simulating, and of
another version too."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from dataclasses import dataclass, replace

import numpy as np
import pytest
from jinja2 import ChoiceLoader, DictLoader
from page_layers import both_layers

from vsf_drake.base.errors import InputError
from vsf_drake.report import page
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import drawing, label
from vsf_drake.report.validation import chapters, output
from vsf_drake.report.validation.output import VALIDATION, write_validation
from vsf_drake.validation.run import SavedSection, SummaryRow, Validation

THIRD = 1.0 / 3.0
TEMPLATE = """
<p>Error {{ error_bw | number("{:.3f}") }} BW.</p><p>{{ keys | join(", ") }}</p>
{% call table("errors", rows, (("label", "trial"), ("error_bw", "GRF (BW)", "{:.3f}"),
                               ("cop_fl", "CoP (FL)", "{:.3f}"))) %}
Errors.
{% endcall %}
{% call figure("force", alt="The force rises over the whole of stance.") %}Force.{% endcall %}
"""


@dataclass(frozen=True)
class Found:
    """The table of a made section."""

    tilt: int
    list: int
    error_bw: float | tuple[float, ...]


def walking(table, arrays):
    with drawing(6.0, 3.0) as figure:
        axes = figure.subplots()
        axes.plot(arrays["force_bw"])
        label(axes, x="stance (%)", y="force (BW)")
    rows = [{"label": "low_1", "error_bw": table.error_bw, "cop_fl": None}]
    return Chapter(
        name="walking",
        title="Walking",
        template="made_walking.html.j2",
        figures={"force": figure},
        facts={**vars(table), "keys": list(vars(table)), "rows": rows},
    )


def section(table, failure=""):
    return SavedSection(table=table, missing=("No CoP was measured.",), wall_s=1.0, failure=failure)


def content(**sections):
    return Validation(
        title="Validation",
        verdict=("The model is closer.",),
        first_line="Walking data are SYNTHETIC.",
        notes=(),
        synthetic=True,
        failed=(("low_9", "there is no such file"),),
        summary=(),
        trials=(),
        contact="none",
        options={"quick": True, "seed": 0, "step_s": 0.002},
        provenance={"versions": {"vsf-drake": "0.1.0"}, "inputs_sha256": {}},
        sections=sections or {"walking": section(Found(tilt=2, list=1, error_bw=THIRD))},
    )


ARRAYS = {"walking/force_bw": np.array([0.0, THIRD, np.nan])}


@pytest.fixture
def templates():
    return {"made_walking.html.j2": TEMPLATE}


@pytest.fixture(autouse=True)
def one_chapter(monkeypatch, templates):
    monkeypatch.setattr(
        page._PAGES, "loader", ChoiceLoader([DictLoader(templates), page._PAGES.loader])
    )
    monkeypatch.setattr(
        chapters, "_MAKERS", {"walking": ("Walking", walking), "bench": ("Bench", walking)}
    )
    monkeypatch.setattr(output, "tables", lambda: {"walking": Found, "bench": Found})


def test_page_figures_tables_and_numbers_are_written(tmp_path):
    out = tmp_path / "out"
    write_validation(content(), ARRAYS, out)
    assert {path.relative_to(out).as_posix() for path in out.rglob("[!.]*") if path.is_file()} == {
        "validation.json",
        "validation.npz",
        "report.html",
        "appendix.html",
        "figures/force.png",
        "tables/errors.csv",
        "tables/trials.csv",
        "tables/times.csv",
    }
    shown = both_layers(out)
    for words in (
        "Error 0.333 BW.",
        "No CoP was measured.",
        "low_9 is not among the results",
        "Not among these results",
    ):
        assert words in shown


@pytest.mark.parametrize("synthetic", [True, False])
def test_synthetic_numbers_share_no_table_with_the_paper_s(tmp_path, synthetic):
    row = SummaryRow(
        what="Held-out walks",
        key="walking/x",
        value=0.02,
        unit="% BW",
        paper="10 to 14",
        shown="2.00",
        asked=None if synthetic else "at most 10",
        met=None if synthetic else True,
        synthetic=synthetic,
    )
    write_validation(
        replace(content(), summary=(row,), synthetic=synthetic), ARRAYS, tmp_path / "out"
    )
    shown = both_layers(tmp_path / "out")
    heads = re.search(r"<thead>.*?</thead>", shown)[0]
    assert re.findall(r">([^<>]+)</th>", heads) == (
        ["what", "SYNTHETIC", "unit"]
        if synthetic
        else ["what", "here", "unit", "paper", "criterion", "met"]
    )
    assert "Held-out walks: 10 to 14 % BW</li>" in shown, "folded, in a list of its own"


def test_results_read_back_are_those_that_were_written_and_give_the_same_report_to_the_byte(
    tmp_path,
):
    out = tmp_path / "out"
    written = write_validation(content(), ARRAYS, out)
    table, arrays = VALIDATION.read(out)
    assert table == written
    np.testing.assert_array_equal(arrays["walking/force_bw"], ARRAYS["walking/force_bw"])
    with (out / "tables" / "errors.csv").open(encoding="utf-8") as stream:
        row = next(csv.DictReader(stream))
    assert float(row["error_bw"]) == THIRD and row["cop_fl"] == ""
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for path in before:
        if path.suffix in (".html", ".png", ".svg", ".csv"):
            path.unlink()
    VALIDATION.remake(out)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_results_of_another_version_show_what_they_have_and_name_the_rest(tmp_path):
    out = tmp_path / "out"
    write_validation(content(), ARRAYS, out)
    table = json.loads((out / "validation.json").read_text())
    table["format"] = 7
    table["sections"]["walking"]["table"] = {"error_percent": 3.0}
    table["sections"]["bench"] = {
        "table": {"error_bw": 0.5},
        "missing": [],
        "wall_s": 1.0,
        "failure": "gave way",
    }
    (out / "validation.json").write_text(json.dumps(table))
    missing = VALIDATION.remake(out)
    shown = both_layers(out)
    assert "These results have format 7" in shown
    assert (
        "This version cannot show what the results hold of it (ValueError: tilt is missing)"
        in shown
    )
    assert any(sentence.startswith("Walking: This version cannot show") for sentence in missing)
    assert any(sentence.startswith("These results have format 7") for sentence in missing)
    assert not (out / "figures" / "force.png").exists(), "a figure of the earlier report"


def edited(out, change):
    """The results in `out` with `change` of their table, as an editor or another version leaves
    them."""
    write_validation(content(), ARRAYS, out)
    table = json.loads((out / "validation.json").read_text())
    change(table)
    (out / "validation.json").write_text(json.dumps(table))
    return VALIDATION.remake(out), both_layers(out)


def test_a_table_that_cannot_be_shown_leaves_the_rest_of_its_chapter(tmp_path, templates):
    templates["made_walking.html.j2"] = """
        <p>First.</p>
        {% call table("spoiled", rows, (("label", "trial"), ("error_bw", "GRF (BW)", "{:.3f}"))) %}Odd.{% endcall %}
        {% call table("errors", [{"error_bw": 0.5}], (("error_bw", "GRF (BW)", "{:.3f}"),)) %}Errors.{% endcall %}"""  # noqa: E501
    missing, text = edited(
        tmp_path / "out", lambda table: table["sections"]["walking"]["table"].update(error_bw=[1])
    )
    assert any(
        "Walking: This version cannot show the table spoiled (TypeError" in sentence
        for sentence in missing
    )
    assert "First." in text and "0.500" in text
    assert not (tmp_path / "out" / "tables" / "spoiled.csv").exists()


def test_a_figure_that_cannot_be_drawn_leaves_the_rest_of_its_chapter(tmp_path, monkeypatch):
    def undrawable(table, arrays):
        chapter = walking(table, arrays)
        chapter.figures["force"].axes[0].set_title("$\\frac{$", parse_math=True)
        return chapter

    write_validation(content(), ARRAYS, tmp_path / "out")
    monkeypatch.setattr(chapters, "_MAKERS", {"walking": ("Walking", undrawable)})
    missing = VALIDATION.remake(tmp_path / "out")
    assert any("cannot show the figure force (ValueError" in sentence for sentence in missing)
    assert "Error 0.333 BW." in both_layers(tmp_path / "out")
    assert not list((tmp_path / "out" / "figures").iterdir())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table["sections"].update(walking=3), "Not among these results"),
        (lambda table: table["sections"]["walking"].update(missing=None), "Error 0.333 BW."),
        (lambda table: table.update(notes=None, title=None), "<h1>Validation</h1>"),
        (
            lambda table: table.pop("first_line"),
            "do not say whether their data are measured or synthetic",
        ),
        (lambda table: table.pop("format"), "These results have format unknown"),
        (lambda table: table.update(replay="low_1"), "replay.html is not there any more"),
    ],
    ids=["section", "missing", "notes", "first_line", "format", "replay"],
)
def test_what_an_edited_table_lacks_is_said_and_the_rest_shown(tmp_path, change, words):
    _, shown = edited(tmp_path / "out", change)
    assert words in shown
    assert 'href="replay.html"' not in shown


def test_a_chapter_that_this_version_wrote_must_not_fail_and_a_section_that_failed_says_why(
    tmp_path,
):
    with pytest.raises(ValueError, match="tilt is missing"):
        write_validation(content(walking=section({})), {}, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    write_validation(
        content(walking=section(None, failure="the keel gave way")), {}, tmp_path / "out"
    )
    assert "This could not be computed: the keel gave way" in both_layers(tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("validation.json", None, "vsf-drake validate --out"),
        ("validation.json", "{", "cannot be read as JSON"),
        ("validation.json", "[]", "no table"),
        ("validation.json", '{"kind": "fit"}', "not the table of a validation"),
        ("validation.npz", "other", "SHA-256"),
    ],
)
def test_damaged_results_are_refused_with_file_and_reason(tmp_path, name, text, words):
    out = tmp_path / "out"
    write_validation(content(), ARRAYS, out)
    shown = (out / "report.html").read_bytes()
    if text is None:
        (out / name).unlink()
    else:
        (out / name).write_text(text)
    with pytest.raises(InputError, match=words) as raised:
        VALIDATION.remake(out)
    assert name in str(raised.value)
    assert (out / "report.html").read_bytes() == shown


@pytest.mark.parametrize(
    ("name", "kind"), [("figures", "file"), ("tables", "file"), ("report.html", "folder")]
)
def test_what_stands_in_the_way_is_told_before_anything_is_computed_or_drawn(tmp_path, name, kind):
    out = tmp_path / "out"
    write_validation(content(), ARRAYS, out)
    if kind == "file":
        shutil.rmtree(out / name)
        (out / name).write_text("mine")
    else:
        (out / name).unlink()
        (out / name).mkdir()
    for check in (VALIDATION.check, VALIDATION.remake):
        with pytest.raises(InputError, match=f"{name}: cannot be written .it is a {kind}"):
            check(out)


def test_a_folder_that_may_not_be_written_to_is_told_before_anything_is_computed(
    tmp_path, monkeypatch
):
    # a mode does not stop the superuser
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(InputError, match="Permission denied"):
        VALIDATION.check(tmp_path)


def test_a_folder_of_something_else_is_not_written_to(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things"):
        VALIDATION.check(tmp_path)
    (tmp_path / "thesis.txt").unlink()
    (tmp_path / "validation.json").write_text('{"kind": "of another program"}')
    with pytest.raises(InputError, match="other things"):
        VALIDATION.check(tmp_path)
    (tmp_path / "validation.json").unlink()
    (tmp_path / "unfinished").mkdir()
    VALIDATION.check(tmp_path)
    (tmp_path / "unfinished" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things"):
        VALIDATION.check(tmp_path)
    VALIDATION.check(tmp_path / "new")
    write_validation(content(), ARRAYS, tmp_path / "out")
    VALIDATION.check(tmp_path / "out")
