"""What a contact fit leaves: a page with the verdict first, on which texts are only text; files of
one fit alone."""

from __future__ import annotations

import html
import itertools
import json
import re
from dataclasses import replace

import pytest
from browser import chromium, look
from made_contact import made_contact
from made_fit import BENCH, METRICS, failed_fit, made_fit, made_parameter, made_trial
from made_results import FOOT_LENGTH_M
from matplotlib.figure import Figure
from page_reader import Balanced

from vsf_drake.base.errors import InputError
from vsf_drake.fit.table import fit_arrays
from vsf_drake.motion.trial import RecordingMark
from vsf_drake.report import fit_output
from vsf_drake.report.fit_output import (
    FIT,
    HEADINGS,
    clear_fit,
    trial_cells,
    write_fit,
)
from vsf_drake.report.page import chapter_page
from vsf_drake.simulation.archive import RECORD_FILE

SMALL = made_fit(
    trials=(made_trial(sweep=None),), bench=None, parameters=(), searches=(), uncertainty=None
)
"""A fit with two figures."""


def left(folder):
    """The files in it that are shown."""
    files = [path.relative_to(folder) for path in folder.rglob("[!.]*") if path.is_file()]
    return sorted(path.as_posix() for path in files)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("fit") / "out"
    write_fit(made_fit(), out, contact=made_contact())
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def appendix(written):
    return (written / "appendix.html").read_text(encoding="utf-8")


@pytest.fixture
def layers(monkeypatch):
    """What makes story and appendix of a table, without figures."""
    monkeypatch.setattr(fit_output, "fit_figures", lambda _: {})
    return lambda table: chapter_page(**fit_output.fit_page(table), layers=FIT.layers)[0]


@pytest.mark.parametrize(
    ("layer", "images"),
    [("page", 2), ("appendix", 6)],
    ids=["story: errors and the held-out trial", "appendix: the rest, and every trial"],
)
def test_both_layers_are_whole_html_that_load_nothing(request, layer, images):
    text = request.getfixturevalue(layer)
    reader = Balanced()
    reader.feed(text)
    assert reader.open == []
    for tag, attributes in reader.seen:
        assert tag not in ("link", "iframe")
        assert attributes.get("src", "data:image/png;base64,").startswith("data:image/png;base64,")
    assert "http" not in re.sub(r"base64,[^\"]*", "", text)
    assert sum(tag == "img" for tag, _ in reader.seen) == images


def test_the_story_has_the_verdict_before_any_number_and_the_appendix_the_rest(page, appendix):
    assert re.findall(r"<h2>(.*?)</h2>", page) == ["What to do next"]
    assert "<details" not in page and 'href="appendix.html"' in page
    first, warning = made_fit().headline
    assert f'<p class="verdict">{first}</p>' in html.unescape(page)
    assert f'<p class="missing">{warning.removeprefix("! ")}</p>' in page
    assert "Not &lt;so&gt;" not in page, "the rest of the verdict is in the appendix"
    assert (
        "<li>Not &lt;so&gt; sure &amp; so on.</li>" in appendix
        and "&lt;b&gt;odd&lt;/b&gt; $x_$ ü" in appendix
    )
    assert 'href="report.html"' in appendix and "What to do next" not in appendix


def test_unusable_recordings_and_far_offsets_are_alarms_of_the_story(layers):
    mark = RecordingMark(
        mark="unusable", expected_error_bw=0.12, verdict="unusable, expected error 12.0 % > 10 % BW"
    )
    first, *others = made_fit().trials
    offsets = [
        made_parameter(name, value, unit=unit)
        for name, value, unit in (
            ("offset.height", -0.055, "m"),
            ("offset.fore_aft", 0.01, "m"),
            ("offset.inversion", 0.1, "rad"),
        )
    ]
    table = made_fit(trials=(replace(first, recording=mark), *others), parameters=tuple(offsets))
    label = first.label
    assert table.alarms[0] == f"{label}: UNUSABLE RECORDING, expected error 12.0 % > 10 % BW"
    assert [alarm[:40] for alarm in table.alarms[1:]] == [
        "FAR OFFSET: the fitted height is -55 mm,",
        "FAR OFFSET: the fitted inversion is +5.7",
    ]
    shown = html.unescape(layers(replace(table, headline=()))[0])
    for alarm in table.alarms:
        assert alarm in shown, "also where nothing was judged"


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_page_reads_on_a_desk_and_on_a_telephone(written, tmp_path):
    for name, width in itertools.product(("report", "appendix"), (1300, 390)):
        folder = tmp_path / f"{name}_{width}"
        folder.mkdir()
        seen = look(written / f"{name}.html", folder, width=width)
        assert (seen.console, seen.requests, seen.out, seen.broken, seen.unnamed) == (
            [],
            [],
            [],
            0,
            0,
        )
        assert seen.scroll <= width and 60 < seen.words <= 1200


def test_every_trial_stands_there_in_layers_with_its_correction(appendix, layers):
    text = re.sub(r"<[^>]*>", "|", appendix)
    assert (
        "||".join(
            (
                "soft",
                "fitted",
                "66",
                "2.0",
                "2.0",
                "1.0",
                "3.0",
                "4.0",
                "5.0",
                "2.0, 2.0, 1.0",
                "2.0, 2.0, 1.0",
                "2.0, 2.0, 1.0",
                "height +1.2 mm, hip +0.0°, knee +0.0°, alignment +0.0°",
            )
        )
        in text
    )
    assert "|4.1||4.2||–||–|" in text and "none: the intact foot was not seen to swing" in text
    assert "Prediction in three layers" in appendix
    assert "three layers" not in layers(made_fit(layers=None))[1]


def test_every_trial_stands_there_with_all_its_numbers_and_what_is_there_is_explained(
    page, appendix, layers
):
    text = re.sub(r"<[^>]*>", "|", appendix)
    for trial in made_fit().trials[:2]:
        assert "||".join(trial_cells(trial)) in text and len(HEADINGS) == len(trial_cells(trial))
    assert "|12.7|" in text and "length of the model&#39;s prosthetic foot" in appendix.replace(
        "'", "&#39;"
    )
    assert f"{1e3 * FOOT_LENGTH_M:.0f} mm, in both directions" in appendix
    null = "Null model: measured curves"
    explained = ("The floor is", "The sweep moves")
    assert null in page and all(words in appendix for words in explained)
    bare = made_trial(
        metrics=replace(METRICS, null_model_grf_rmse_bw=None), floor_grf_rmse_bw=None, sweep=None
    )
    story, alone = layers(made_fit(trials=(bare,)))
    assert "Stance error is" in alone and null not in story
    assert not any(words in alone for words in explained)


def test_a_failed_fit_says_so_in_its_first_line_and_shows_no_number_as_a_result(layers):
    for page in layers(failed_fit()):
        assert re.search(r"<h1>(.*?)<", page)[1].startswith("FAILED: contact fit")
        alarm = re.search(r'<p class="alarm" role="alert">(.*?)</p>', page)[1]
        assert alarm.startswith("FAILED: no &lt;search&gt; converged. No contact file was written")
        assert "<title>FAILED" in page and "<h2>Parameters</h2>" not in page
        Balanced().feed(page)


def test_a_fit_without_a_bench_has_its_page_and_doubts_about_a_bench_are_of_the_story(layers):
    page, _ = layers(made_fit(bench=None))
    assert "Press the foot in a testing machine" in page
    doubted, _ = layers(made_fit(bench=replace(BENCH, doubts=("kgf, not N?",))))
    assert "kgf, not N?" in doubted and "kgf" not in page


def test_a_trial_may_be_named_with_the_sign_that_parts_cells(layers):
    table = made_fit(trials=(made_trial("a│b"),))
    left_out = replace(table.left_out[0], left_out=("a│b",))
    assert "a|b" in layers(replace(table, left_out=(left_out,)))[1]


def test_synthetic_data_are_named_in_title_and_text(layers):
    table = made_fit(
        synthetic=True, trials=(made_trial(synthetic=True),), bench=replace(BENCH, synthetic=True)
    )
    for page in layers(table):
        assert "(SYNTHETIC)</title>" in page
        assert '<p class="synthetic">SYNTHETIC, not recorded: soft, the bench.' in page


def test_table_and_curves_are_read_back_and_refused_where_they_do_not_belong_together(
    written, tmp_path
):
    table, arrays = FIT.read(written)
    assert table["files"] == left(written)
    assert (
        table["searches"][1]["cost"] is None
        and table["trials"][0]["sweep"]["grf_rmse_bw"][-1] is None
    )
    expected = fit_arrays(made_fit())
    assert set(arrays) == set(expected) and all(
        (arrays[name] == expected[name])[0].all() for name in expected if "cop_model" not in name
    )
    write_fit(SMALL, tmp_path)
    (tmp_path / "fit.npz").write_bytes(b"other")
    with pytest.raises(InputError, match="SHA-256"):
        FIT.read(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        FIT.read(tmp_path / "nowhere")


@pytest.mark.parametrize("recorded", [True, False], ids=["", "of an earlier version"])
def test_a_later_fit_leaves_nothing_of_an_earlier_one_and_all_of_others(
    tmp_path, monkeypatch, recorded
):
    monkeypatch.setattr(
        fit_output,
        "fit_figures",
        lambda table: {"trial_1_soft" if table.success else "errors": Figure()},
    )

    def forget():
        if not recorded:
            (tmp_path / RECORD_FILE).unlink()

    write_fit(SMALL, tmp_path, contact=made_contact())
    drawn = {"figures/trial_1_soft.png", "figures/trial_1_soft.svg"}
    assert drawn | {"appendix.html", "fit.npz", "contact.yaml"} < {*left(tmp_path)}
    (tmp_path / "notes.txt").write_text("mine")
    forget()
    write_fit(failed_fit(), tmp_path)
    drawn = {"figures/errors.png", "figures/errors.svg"}
    assert {*left(tmp_path)} == drawn | {"notes.txt", "fit.json", "report.html", "appendix.html"}
    write_fit(SMALL, tmp_path, contact=made_contact())
    forget()
    clear_fit(tmp_path)
    assert left(tmp_path) == ["notes.txt"]


def test_a_table_cannot_make_the_next_fit_remove_files_of_others(tmp_path):
    out, other = tmp_path / "out", tmp_path / "other.yaml"
    out.mkdir()
    other.write_text("mine")
    (out / "notes.txt").write_text("mine")
    (out / "fit.json").write_text(
        json.dumps({"kind": "fit", "files": ["../other.yaml", "notes.txt", 3]})
    )
    clear_fit(out)
    assert other.exists() and (out / "notes.txt").exists()


def test_a_failed_fit_takes_no_contact(tmp_path):
    with pytest.raises(ValueError, match="no contact"):
        write_fit(failed_fit(), tmp_path / "out", contact=made_contact())
    assert not (tmp_path / "out").exists()
