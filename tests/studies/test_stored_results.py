"""Stored results are of the files as they are, and their numbers are those that the present sources give."""

from __future__ import annotations

import copy
import warnings

import check_stored
import pytest
from contact_fit_study.keeping import STUDIES, meaning, sources_sha256
from floor_of_the_reference_subject import NOMINAL


@pytest.mark.parametrize("name", check_stored.CHECKS)
def test_stored_numbers_are_of_the_files_as_they_are(name):
    stored = check_stored.read(name)
    assert NOMINAL in stored["provenance"]["inputs_sha256"]
    assert check_stored.changed_files(name, stored) == []


@pytest.mark.parametrize("name", check_stored.CHECKS)
def test_stored_numbers_are_those_of_the_present_sources(name):
    """Other sources are a warning, if a part that is made anew in seconds gives the stored numbers."""
    stored = check_stored.read(name)
    assert set(stored["provenance"]["sources"]) == {"sha256", "numbers"}
    if not check_stored.same_sources(name, stored):
        warnings.warn(f"studies/results/{name}.json: other sources made or checked it; python studies/check_stored.py "
                      "notes that these give the same numbers", stacklevel=1)
        assert check_stored.differences(name, stored) == [], f"stale: run studies/{check_stored.CHECKS[name][0]} again"


@pytest.mark.parametrize("name", ["floor", "contact_fit"])
def test_a_spot_check_tells_a_number_that_is_off_by_a_thousandth(name):
    stored = copy.deepcopy(check_stored.read(name))
    row = stored["trials"]["low_1"]["laboratory"] if name == "floor" else (
        stored["exact"]["transfer"]["trials"]["medium_2"])
    row["cop_rmse_fl"] *= 1.001
    (told,) = check_stored.differences(name, stored)
    assert "cop_rmse_fl" in told


def test_another_file_is_told():
    stored = copy.deepcopy(check_stored.read("floor"))
    stored["provenance"]["inputs_sha256"]["exact/low_1.yaml"] = "0" * 64
    assert check_stored.changed_files("floor", stored) == ["exact/low_1.yaml"]


def test_a_digest_knows_what_sources_say_and_not_how_they_are_written(tmp_path):
    def said(text: str) -> str:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text, encoding="utf-8")
        return meaning(path)[0]

    plain = said("def f(x):\n    return 2.0 * x\n")
    assert said('"""A module."""\n\n\ndef f( x ):  # twice\n    """Twice."""\n    return (2.0*x)\n') == plain
    assert said("def f(x):\n    return 2.1 * x\n") != plain


@pytest.mark.parametrize("script", [script for script, _ in check_stored.CHECKS.values()])
def test_a_law_that_changes_makes_every_result_one_of_other_sources(script, monkeypatch):
    law = STUDIES.parent / "vsf_drake" / "laws" / "scalar.py"
    before = sources_sha256(STUDIES / script)
    monkeypatch.setattr("contact_fit_study.keeping.meaning", lambda path: (
        ("another", set()) if path == law else meaning(path)))
    assert sources_sha256(STUDIES / script) != before
