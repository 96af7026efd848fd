"""The summary: figures beside the paper's and beside what is asked, and never a number that is not there."""

from __future__ import annotations

import pytest

from vsf_drake.analysis.validation.run import summary_rows


def row(key, sections):
    return next(row for row in summary_rows(sections) if row["key"] == key)


def test_without_sections_everything_is_unknown_and_nothing_is_met():
    rows = summary_rows({})
    assert rows
    assert all(row["value"] is None and row["shown"] is None and row["met"] is None for row in rows)


@pytest.mark.parametrize(("value", "met"), [(0.98, True), (0.97, False), (None, None)])
def test_a_correlation_must_be_at_least_the_papers(value, met):
    found = row("bench/stiffness_r2", {"bench": {"stiffness_r2": value}})
    assert found["met"] is met
    assert found["asked"] == "at least 0.98"


@pytest.mark.parametrize(("value", "met"), [(0.0999, True), (0.1001, False)])
def test_an_error_must_be_at_most_what_is_asked(value, met):
    found = row("walking/held_out/grf_rmse_bw", {"walking": {"held_out": {"grf_rmse_bw": value}}})
    assert found["met"] is met
    assert found["shown"] == f"{100.0 * value:.2f}"
    assert found["value"] == value


def test_a_section_without_held_out_walks_leaves_them_unknown():
    assert row("walking/held_out/grf_rmse_bw", {"walking": {"held_out": None}})["value"] is None


@pytest.mark.parametrize(("value", "shown"), [(True, "yes"), (False, "no"), (None, None)])
def test_an_answer_is_yes_no_or_unknown(value, shown):
    found = row("energy/softer_stores_more", {"energy": {"softer_stores_more": value}})
    assert (found["shown"], found["met"]) == (shown, value)
