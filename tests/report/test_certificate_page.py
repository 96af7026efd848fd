"""The page of a certificate: the verdict first, what did not run, what agreement does not prove."""

from __future__ import annotations

import re

import pytest
from command_line import read_json
from made_certificate import ASKED, made_certificate
from page_reader import Balanced

from vsf_drake.base.errors import InputError
from vsf_drake.report.certificate_page import CERTIFICATE, keel_figure, write_certificate


def page(folder, **how):
    """The text of the page, tags left out, after its title."""
    write_certificate(folder, made_certificate(**how))
    text = (folder / "report.html").read_text(encoding="utf-8")
    Balanced().feed(text)
    return " ".join(re.sub("<[^>]*>", " ", text[text.index("<h1>") :]).split())


def test_a_page_of_engines_that_agree_says_so_first(tmp_path):
    told = page(tmp_path)
    assert "same foot? All 9 comparisons agree: Drake 1.2 and OpenSim 1.2 compute" in told
    assert read_json(tmp_path / "certificate.json")["agreed"] is True


def test_titles_say_in_per_cent_how_far_engines_are_apart(tmp_path):
    told = page(tmp_path, apart=2e-4)
    assert "the load point rises: Drake differs by 0.02 % and OpenSim differs by less than" in told
    assert "OpenSim differs by less than 0.001 %" in told


def test_a_question_stands_once_on_the_page_and_in_every_row_of_its_file(tmp_path):
    told = page(tmp_path)
    assert told.count("mass matrix, 100 poses") == 1
    file = (tmp_path / "tables" / "rows.csv").read_text(encoding="utf-8")
    assert file.count("mass matrix, 100 poses") == 2


def test_the_page_says_of_poses_and_roll_over_what_was_asked_and_not_what_usually_is(tmp_path):
    told = page(tmp_path)
    assert "3 poses within 0.2 rad" in told and "0.8 s at 87 mm along" in told


def test_the_error_of_the_condensed_foot_is_on_the_page_and_in_the_file(tmp_path):
    told = page(tmp_path)
    assert "vertical force, of its peak 2.4 % 7.0 % 3 % root mean square" in told
    assert "centre of pressure 1.8 mm 8.3 mm 5 mm root mean square" in told
    assert "energy that is returned 4.5 % 5 %" in told
    assert read_json(tmp_path / "certificate.json")["condensed"]["worst"]["force_rms"] == 0.024


def test_a_row_that_differs_turns_the_certificate_red(tmp_path):
    told = page(tmp_path, apart=2e-6)
    assert "NOT the same foot: 1 of 9 comparisons do not agree (Drake: keel rise" in told
    assert 'class="unmet"' in (tmp_path / "report.html").read_text(encoding="utf-8")
    table = read_json(tmp_path / "certificate.json")
    assert table["agreed"] is False
    differing = [row for row in table["rows"] if row["verdict"] == "differs"]
    assert [(row["engine"], row["row"]) for row in differing] == [("drake", "keel_rise")]
    assert differing[0]["difference"] == pytest.approx(2e-6, rel=1e-6)


def test_an_engine_that_did_not_run_is_said_and_not_counted(tmp_path):
    told = page(tmp_path, not_run="opensim")
    assert "All 4 comparisons agree: Drake 1.2 computes the same" in told
    assert "this package and 1 other program from" in (tmp_path / "report.html").read_text("utf-8")
    assert "OpenSim was not run: nobody installed it." in told


def test_an_engine_that_failed_is_a_red_row_for_every_question(tmp_path):
    told = page(tmp_path, failed="opensim")
    assert "NOT the same foot: 5 of 9 comparisons" in told
    assert "OpenSim failed: it broke off." in told


def test_the_page_says_what_agreement_does_not_prove_in_four_sentences(tmp_path):
    told = page(tmp_path)
    heading = "What this proves, and what it does not "
    proof = told[told.index(heading) + len(heading) : told.index("How it was made")]
    assert len(re.findall(r"\.(?= |$)", proof.strip())) == 4
    assert "does not prove that the model is like a real foot" in proof


def test_a_saved_certificate_is_made_again_and_one_of_another_kind_is_refused(tmp_path):
    before = page(tmp_path)
    (tmp_path / "report.html").unlink()
    assert CERTIFICATE.remake(tmp_path) == []
    again = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert " ".join(re.sub("<[^>]*>", " ", again[again.index("<h1>") :]).split()) == before
    file = tmp_path / "certificate.json"
    file.write_text(file.read_text().replace("certificate 2", "map 1"))
    with pytest.raises(InputError, match="is not the table of a certificate"):
        CERTIFICATE.read(tmp_path)


def test_the_figure_of_the_keel_has_a_line_for_every_fulcrum_and_marks_for_every_engine():
    found = made_certificate(apart=1e-3)
    above, below = keel_figure(found.arrays, {"stepper": "we", "drake": "D", "opensim": "O"}).axes
    lines = [line for line in above.lines if line.get_linestyle() == "-"]
    assert len(lines) == len(ASKED["fulcrum_mm"])
    assert lines[0].get_ydata() == pytest.approx([2.0, 4.0, 6.0])
    drake, opensim = below.lines
    assert drake.get_ydata() == pytest.approx(0.1)  # per cent
    assert max(opensim.get_ydata()) < 1e-4
