"""The page of a contact fit: verdict first, one file, no network, every text only text; failure in its first line."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from made_contact import made_contact
from made_fit import ODD, failed_fit, made_curves, made_fit, made_trial, paper_fit
from page_reader import Balanced

from vsf_drake.errors import InputError
from vsf_drake.report.fit_figures import fit_figures
from vsf_drake.report.fit_output import (
    FIT,
    clear_fit,
    fit_page,
    smooth_errors,
    trial_cells,
    trial_headings,
    write_fit,
)
from vsf_drake.report.page import UNKNOWN, number
from vsf_drake.simulation.archive import RECORD_FILE


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("fit") / "out"
    write_fit(made_fit(), made_curves(), out, contact=made_contact())
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.html").read_text(encoding="utf-8")


def test_page_is_whole_html_and_loads_nothing(page):
    reader = Balanced()
    reader.feed(page)
    assert reader.open == []
    for tag, attributes in reader.seen:
        assert tag not in ("script", "link", "iframe")
        assert attributes.get("src", "data:image/svg+xml;base64,").startswith("data:image/svg+xml;base64,")
    assert "http" not in re.sub(r"base64,[^\"]*", "", page)
    assert sum(tag == "img" for tag, _ in reader.seen) == 10


def test_the_verdict_comes_before_any_number(page):
    heads = re.findall(r"<h2>(.*?)</h2>", page)
    assert heads[:2] == ["Verdict", "Trials"]
    assert "<li>Not &lt;so&gt; sure &amp; so on.</li>" in page


def test_names_are_only_text(page):
    assert "<b>odd" not in page and "&lt;b&gt;odd&lt;/b&gt; $x_$ ü" in page


def test_every_trial_stands_there_with_all_its_numbers(page):
    text = re.sub(r"<[^>]*>", "|", page)
    for trial in made_fit()["trials"][:2]:
        row = "||".join(trial_cells(trial))
        assert row in text
    assert len(trial_headings()) == len(trial_cells(made_trial()))


def test_only_columns_that_are_there_are_explained(page):
    explained = ("The null model is", "The floor is", "The sweep moves", "right of its diamond")
    assert all(words in page for words in explained)
    bare = made_trial(null_model_grf_rmse_bw=None, floor_grf_rmse_bw=None, sweep=None)
    table = made_fit(trials=[bare])
    alone = fit_page(table, fit_figures(table, {}))
    assert "Stance error is" in alone and not any(words in alone for words in explained)


def test_curves_that_were_frozen_at_zero_are_no_smooth_errors():
    flat = {"coordinate": "hip_flexion_r", "largest_deg": 0.0, "at_percent_of_cycle": 0.0}
    assert smooth_errors(made_fit(curves=[flat])) == ""
    assert "hip_flexion_r" not in smooth_errors(made_fit(curves=[flat, *made_fit()["curves"]]))


def test_the_seed_stands_there_once():
    for options in ({"starts": 3}, {"starts": 3, "seed": 0}):
        assert fit_page(made_fit(options=options), {}).count(">seed<") == 1


def test_a_failed_fit_says_so_in_its_first_line_and_shows_no_number_as_a_result():
    failed = failed_fit()
    page = fit_page(failed, fit_figures(failed, {}))
    body = page.split("<body>")[1].strip()
    assert re.sub(r"<[^>]*>", "", body.splitlines()[0]).startswith("FAILED: contact fit")
    assert "<title>FAILED" in page and "no &lt;search&gt; converged" in page
    assert "No contact file was written" in page and "<h2>Parameters</h2>" not in page
    Balanced().feed(page)


def test_a_fit_by_the_papers_procedure_has_a_page():
    paper = paper_fit()
    page = fit_page(paper, fit_figures(paper, made_curves()))
    assert "by the paper&#39;s procedure" in page and "120.0 N" in page and "304 walks" in page
    assert "95 % interval" not in page


def test_that_there_is_no_bench_is_said_of_a_failed_fit_too():
    failed = failed_fit(bench=None)
    assert "No bench was given" in fit_page(failed, {})


def test_synthetic_data_are_named_in_title_and_text():
    bench = made_fit()["bench"] | {"synthetic": True}
    page = fit_page(made_fit(synthetic=True, trials=[made_trial(synthetic=True)], bench=bench), {})
    assert "(SYNTHETIC)</title>" in page and "SYNTHETIC, not recorded: soft, the bench." in page


def test_what_is_written_is_read_back_and_gives_the_same_page(written, page):
    table, curves = FIT.read(written)
    assert fit_page(table, fit_figures(table, curves)) == page
    for name, values in made_curves().items():
        np.testing.assert_array_equal(curves[name], values)
    assert table["files"] == sorted(path.name for path in written.glob("[!.]*"))


SMALL = made_fit(trials=[made_trial(sweep=None)], bench=None, parameters=[], searches=[])
"""A fit with two figures."""


def test_a_later_fit_leaves_nothing_of_an_earlier_one_and_all_of_others(tmp_path):
    write_fit(SMALL, made_curves(1), tmp_path, contact=made_contact())
    assert {"errors.png", "trial_1_soft.svg", "fit.npz", "contact.yaml"} < {path.name for path in tmp_path.iterdir()}
    (tmp_path / "notes.txt").write_text("mine")
    write_fit(failed_fit(), {}, tmp_path)
    assert {path.name for path in tmp_path.glob("[!.]*")} == {"notes.txt", "fit.json", "report.html", "searches.png",
                                                          "searches.svg"}
    clear_fit(tmp_path)
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["notes.txt"]


def test_a_failed_fit_leaves_nothing_of_one_of_an_earlier_version(tmp_path):
    write_fit(SMALL, made_curves(1), tmp_path, contact=made_contact())
    (tmp_path / RECORD_FILE).unlink()
    write_fit(failed_fit(), {}, tmp_path)
    assert {path.name for path in tmp_path.glob("[!.]*")} == {"fit.json", "report.html", "searches.png", "searches.svg"}
    write_fit(SMALL, made_curves(1), tmp_path, contact=made_contact())
    (tmp_path / RECORD_FILE).unlink()
    clear_fit(tmp_path)
    assert not list(tmp_path.glob("[!.]*"))


def test_a_table_cannot_make_the_next_fit_remove_files_of_others(tmp_path):
    out, other = tmp_path / "out", tmp_path / "other.yaml"
    out.mkdir()
    other.write_text("mine")
    (out / "notes.txt").write_text("mine")
    (out / "fit.json").write_text(json.dumps({"kind": "fit", "files": ["../other.yaml", "notes.txt", 3]}))
    clear_fit(out)
    assert other.exists() and (out / "notes.txt").exists()


def test_a_failed_fit_takes_no_contact(tmp_path):
    with pytest.raises(ValueError, match="no contact"):
        write_fit(failed_fit(), {}, tmp_path / "out", contact=made_contact())
    assert not (tmp_path / "out").exists()


def test_tables_and_curves_that_do_not_belong_together_are_refused(tmp_path):
    write_fit(SMALL, made_curves(1), tmp_path)
    (tmp_path / "fit.npz").write_bytes(b"other")
    with pytest.raises(InputError, match="SHA-256"):
        FIT.read(tmp_path)
    (tmp_path / "fit.json").write_text("{")
    with pytest.raises(InputError, match="JSON"):
        FIT.read(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        FIT.read(tmp_path / "nowhere")


def test_unknown_numbers_are_a_word_and_zeros_have_no_sign():
    assert number(None, "{:.1f}") == UNKNOWN
    assert number(-1e-9, "{:+.3f}") == number(1e-9, "{:+.3f}") == "0.000"
    assert number(-0.002, "{:+.3f}") == "-0.002"
    assert ODD in trial_cells(made_trial(ODD))
