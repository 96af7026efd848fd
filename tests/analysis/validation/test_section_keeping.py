"""What is finished of a validation survives an interruption, and never comes back for another study."""

from __future__ import annotations

import dataclasses
import errno

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.validation import run as running
from vsf_drake.analysis.validation.run import SectionStore, study_key
from vsf_drake.analysis.validation.study import Section, StudyOptions
from vsf_drake.errors import InputError, SimulationError

SECTION = Section(table={"tilt": 1, "error_bw": 0.025, "unknown": None, "rows": [{"label": "low_1"}]},
                  arrays={"curve": np.array([0.1, np.nan, 1.0 / 3.0])}, missing=("No CoP.",))


def test_a_kept_section_comes_back_bit_for_bit(tmp_path):
    store = SectionStore(tmp_path / "kept", "key")
    store.write("walking", SECTION, 1.5)
    section, wall_s = store.read("walking")
    assert section.table == SECTION.table
    assert [*section.table] == [*SECTION.table], "in the order in which it was made"
    assert section.missing == SECTION.missing
    np.testing.assert_array_equal(section.arrays["curve"], SECTION.arrays["curve"])
    assert wall_s == 1.5


def test_a_section_of_another_study_or_a_damaged_one_is_not_read(tmp_path):
    SectionStore(tmp_path, "key").write("walking", SECTION, 1.5)
    assert SectionStore(tmp_path, "other").read("walking") is None
    assert SectionStore(tmp_path, "key").read("bench") is None
    (tmp_path / "walking.npz").write_bytes(b"PK")
    assert SectionStore(tmp_path, "key").read("walking") is None
    (tmp_path / "walking.json").write_text('{"key": ')
    assert SectionStore(tmp_path, "key").read("walking") is None


def test_what_is_kept_is_taken_away_and_nothing_else(tmp_path):
    store = SectionStore(tmp_path / "kept", "key")
    store.write("walking", SECTION, 1.5)
    (tmp_path / "kept" / ".walking.npz.x1.part").write_bytes(b"PK")
    store.remove(["walking"])
    assert not (tmp_path / "kept").exists()
    store.write("walking", SECTION, 1.5)
    (tmp_path / "kept" / "thesis.txt").write_text("mine")
    store.remove(["walking"])
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["thesis.txt"]


def test_a_full_disk_is_told_as_such(tmp_path, monkeypatch):
    def full(*args, **arrays):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(InputError, match="No space left"):
        SectionStore(tmp_path / "kept", "key").write("walking", SECTION, 1.5)
    assert not list((tmp_path / "kept").iterdir())


@pytest.mark.parametrize(
    ("change", "same"),
    [({"workers": 2}, True), ({"seed": 1}, False), ({"quick": False}, False), ({"iso_force_n": 1000.0}, False)],
)
def test_the_key_is_of_what_the_numbers_depend_on(change, same):
    study = embedded_study()
    other = dataclasses.replace(study, options=dataclasses.replace(study.options, **change))
    assert (study_key(other) == study_key(study)) is same


def test_the_key_differs_with_the_files_and_the_contact():
    study = embedded_study()
    spoiled = {name: "0" * 64 for name in study.inputs}
    assert study_key(dataclasses.replace(study, inputs=spoiled)) != study_key(study)
    contact = dataclasses.replace(study.contact, values={**study.contact.values, "offset.height": 0.001})
    assert study_key(dataclasses.replace(study, contact=contact)) != study_key(study)


@pytest.fixture
def sections(monkeypatch):
    """Two sections in place of the real ones, and how often each was computed."""
    count = {"first": 0, "second": 0}

    def first(study, *, progress=None):
        count["first"] += 1
        progress("half", 0.5)
        return SECTION

    def second(study, *, progress=None):
        count["second"] += 1
        if count["second"] == 1:
            raise KeyboardInterrupt
        return Section(table={"seed": study.options.seed})

    monkeypatch.setattr(running, "_SECTIONS", {"first": (first, 1.0), "second": (second, 3.0)})
    return count


def test_an_interrupted_validation_goes_on_where_it_stopped(tmp_path, sections):
    study = embedded_study()
    with pytest.raises(KeyboardInterrupt):
        running.run_sections(study, folder=tmp_path)
    finished = running.run_sections(study, folder=tmp_path)
    assert sections == {"first": 1, "second": 2}
    assert finished["first"].section.table == SECTION.table
    assert finished["second"].section.table == {"seed": StudyOptions().seed}


def test_progress_runs_from_nothing_to_the_share_of_what_is_done(sections):
    seen = []
    sections["second"] = 1
    running.run_sections(embedded_study(), progress=lambda what, fraction: seen.append((what, fraction)))
    assert seen == [("first: starting", 0.0), ("first: half", 0.125), ("second: starting", 0.25)]


def test_a_section_that_fails_stops_no_other_and_is_named(monkeypatch):
    def diverges(study, *, progress=None):
        raise SimulationError("the keel gave way", time_s=0.1)

    monkeypatch.setattr(running, "_SECTIONS", {
        "first": (diverges, 1.0), "second": (lambda study, *, progress=None: SECTION, 1.0)})
    finished = running.run_sections(embedded_study())
    assert finished["first"].section is None
    assert "keel gave way" in finished["first"].failure
    assert finished["second"].section is SECTION
