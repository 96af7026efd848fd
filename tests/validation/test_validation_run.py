"""Sections one after the other: what is finished survives an interruption, and the summary of it
all."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.base.sentences import say
from vsf_drake.validation import run as running
from vsf_drake.validation.run import (
    Finished,
    Part,
    SectionStore,
    shipped_key,
    study_key,
    summary_rows,
)
from vsf_drake.validation.study import Section
from vsf_drake.validation.walking_section import RoleSummary


@dataclass(frozen=True)
class Found:
    """What a made section finds."""

    error_bw: float
    unknown: float | None = None
    labels: tuple[str, ...] = ("low_1",)


SECTION = Section(
    table=Found(0.025), arrays={"curve": np.array([0.1, np.nan, 1.0 / 3.0])}, missing=("No CoP.",)
)


def test_a_kept_section_comes_back_bit_for_bit_and_no_other_or_damaged_one(tmp_path):
    store = SectionStore(tmp_path / "kept", "key")
    store.write("walking", Finished(section=SECTION, wall_s=1.5))
    kept = store.read("walking", Found)
    section = kept.section
    assert (section.table, section.missing, kept.wall_s) == (SECTION.table, SECTION.missing, 1.5)
    np.testing.assert_array_equal(section.arrays["curve"], SECTION.arrays["curve"])
    assert SectionStore(tmp_path / "kept", "other").read("walking", Found) is None
    assert store.read("bench", Found) is None and store.read("walking", Part) is None
    (tmp_path / "kept" / "walking.npz").write_bytes(b"PK")
    assert store.read("walking", Found) is None
    (tmp_path / "kept" / "walking.json").write_text('{"key": ')
    assert store.read("walking", Found) is None


def test_what_is_kept_is_taken_away_and_nothing_else(tmp_path):
    store = SectionStore(tmp_path / "kept", "key")
    store.write("walking", Finished(section=SECTION, wall_s=1.5))
    (tmp_path / "kept" / ".walking.npz.x1.part").write_bytes(b"PK")
    store.remove(["walking"])
    assert not (tmp_path / "kept").exists()
    store.write("walking", Finished(section=SECTION, wall_s=1.5))
    (tmp_path / "kept" / "thesis.txt").write_text("mine")
    store.remove(["walking"])
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["thesis.txt"]


def test_the_key_is_of_what_the_numbers_depend_on():
    study = embedded_study()
    own = study_key(study)
    for change, same in (
        ({"workers": 2}, True),
        ({"seed": 1}, False),
        ({"quick": False}, False),
        ({"iso_force_n": 1000.0}, False),
    ):
        other = dataclasses.replace(study, options=dataclasses.replace(study.options, **change))
        assert (study_key(other) == own) is same, change
    assert (
        study_key(dataclasses.replace(study, inputs=dict.fromkeys(study.inputs, "0" * 64))) != own
    )
    contact = dataclasses.replace(
        study.contact, values={**study.contact.values, "offset.height": 0.001}
    )
    assert study_key(dataclasses.replace(study, contact=contact)) != own


def test_an_interrupted_validation_goes_on_where_it_stopped_and_tells_its_progress(
    tmp_path, monkeypatch
):
    count, seen = {"first": 0, "second": 0}, []

    def first(study, *, progress=None):
        count["first"] += 1
        progress("half", 0.5)
        return SECTION

    def second(study, *, progress=None):
        count["second"] += 1
        if count["second"] == 1:
            raise KeyboardInterrupt
        return Section(table=Found(0.5))

    monkeypatch.setattr(
        running, "_SECTIONS", {"first": Part(first, Found, 1.0), "second": Part(second, Found, 3.0)}
    )
    with pytest.raises(KeyboardInterrupt):
        running.run_sections(
            embedded_study(), folder=tmp_path, progress=lambda *what: seen.append(what)
        )
    finished = running.run_sections(embedded_study(), folder=tmp_path)
    assert count == {"first": 1, "second": 2}
    assert [finished[name].section.table for name in count] == [SECTION.table, Found(0.5)]
    assert seen == [("first: starting", 0.0), ("first: half", 0.125), ("second: starting", 0.25)]


def test_long_sections_are_shown_as_shipped_where_the_key_fits(tmp_path, monkeypatch):
    """With a date; what does not fit is left out."""

    def short(study, *, progress=None):
        return SECTION

    def other(study, *, progress=None):
        return Section(table=Found(0.5))

    monkeypatch.setattr(
        running, "_SECTIONS", {"short": Part(short, Found, 1.0), "other": Part(other, Found, 9.0)}
    )
    monkeypatch.setattr(running, "LONG", {"long": Found})
    study, grown = embedded_study(), []
    full = dataclasses.replace(study, options=dataclasses.replace(study.options, full=True))
    key = shipped_key(study)
    assert key == shipped_key(full) != shipped_key(dataclasses.replace(study, inputs={}))
    SectionStore(tmp_path, key).write("long", Finished(section=SECTION, wall_s=99.0))

    def found(study, key):
        finished = running.run_sections(
            study,
            shipped=SectionStore(tmp_path, key),
            grown=lambda done, to_come: grown.append(([*done], to_come)),
        )
        return {name: one.section.table.error_bw for name, one in finished.items()}, finished

    assert found(study, "another")[0] == {"short": 0.025, "other": 0.5}
    grown.clear()
    shown, finished = found(study, key)
    assert shown == {"short": 0.025, "other": 0.5, "long": 0.025}
    assert grown == [(["short"], ["other", "long"])]
    content, _ = running.validation_content(study, finished)
    assert "Computed on 20" in content.sections["long"].missing[0] and content.sections[
        "short"
    ].missing == ("No CoP.",)


MEASURED = {"synthetic": False, "bench_synthetic": False}


@pytest.mark.parametrize(
    ("key", "value", "met", "shown", "asked"),
    [
        ("bench/stiffness_r2", 0.98, True, "0.9800", "at least 0.98"),
        ("bench/stiffness_r2", 0.97, False, "0.9700", "at least 0.98"),
        ("bench/stiffness_r2", None, None, None, "at least 0.98"),
        ("walking/held_out/grf_rmse_bw", 0.0999, True, "9.99", "at most 10"),
        ("walking/held_out/grf_rmse_bw", 0.1001, False, "10.01", "at most 10"),
        ("energy/softer_stores_more", True, True, "yes", "yes"),
        ("energy/softer_stores_more", False, False, "no", "yes"),
        ("energy/softer_stores_more", None, None, None, "yes"),
    ],
)
def test_the_summary_sets_a_value_beside_what_is_asked_and_never_makes_one_up(
    key, value, met, shown, asked
):
    section, *names = key.split("/")
    table = value
    for name in reversed(names):
        table = {name: table}
    row = next(row for row in summary_rows({section: table}, **MEASURED) if row.key == key)
    assert (row.value, row.met, row.shown, row.asked) == (value, met, shown, asked)
    made = next(
        row
        for row in summary_rows({section: table}, synthetic=True, bench_synthetic=True)
        if row.key == key
    )
    assert made == dataclasses.replace(row, met=None, asked=None, synthetic=True), (
        "a made one meets no criterion"
    )
    others = [
        row
        for row in summary_rows({section: table, "walking": table}, **MEASURED)
        if row.key != key
    ]
    assert others and all(
        row.value is None and row.shown is None and row.met is None for row in others
    )


def test_recorded_walks_are_judged_although_the_bench_is_synthetic():
    tables = {"bench": {"stiffness_r2": 0.999}, "walking": {"fitted": {"grf_rmse_bw": 0.02}}}
    walk, bench = (
        next(
            row
            for row in summary_rows(tables, synthetic=False, bench_synthetic=True)
            if row.key == key
        )
        for key in ("walking/fitted/grf_rmse_bw", "bench/stiffness_r2")
    )
    assert (walk.synthetic, walk.met) == (False, True) and (bench.synthetic, bench.met) == (
        True,
        None,
    )


def test_a_bench_that_the_foot_was_fitted_to_meets_no_criterion():
    table = {"stiffness_r2": 0.999, "contact_on_bench": ["fitted to a bench"]}
    row = next(
        row for row in summary_rows({"bench": table}, **MEASURED) if row.key == "bench/stiffness_r2"
    )
    assert (row.met, row.asked) == (None, None) and row.what.endswith("(fitted to a bench)")


def role(n, error, null=None, beats=0):
    return RoleSummary(
        n=n,
        beats_null=beats,
        beats_null_of=n,
        scores={
            "grf_rmse_bw": error,
            "null_model_grf_rmse_bw": null,
            "stretched_null_grf_rmse_bw": null and null + 0.01,
            "null_model_unknown": "" if null else "alone",
        },
    )


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (
            {"held_out": role(7, 0.028, 0.042, 6)},
            [
                "The model beats the null model, other walks' plate curves: on 7 held-out walks "
                "its ground reaction force is 2.8 % of body weight off (RMS), theirs 4.2 %; nearer "
                "in 6 of 7.",
                "The null model, other walks' plate curves stretched to the stance and, of several "
                "settings, interpolated to this one, is 4.2 % off. The nearest single curve, which "
                "only the walk's own plate can name, leaves 5.2 %.",
            ],
        ),
        (
            {"held_out": role(2, 0.05, 0.042), "synthetic": True},
            [
                "The model does not beat the null model, other walks' plate curves: on 2 held-out "
                "SYNTHETIC walks its ground reaction force is 5.0 % of body weight off (RMS), "
                "theirs 4.2 %; nearer in 0 of 2.",
                "The null model, other walks' plate curves stretched to the stance and, of several "
                "settings, interpolated to this one, is 4.2 % off. The nearest single curve, which "
                "only the walk's own plate can name, leaves 5.2 %.",
            ],
        ),
        (
            {"held_out": role(1, 0.05), "synthetic": True},
            [
                "On 1 held-out SYNTHETIC walk, the model's ground reaction force is 5.0 % of body "
                "weight off (RMS); the null model's error is not known: no curve of another walk "
                "from strike to lift-off is known."
            ],
        ),
        (
            {"fitted": role(2, 0.01)},
            [
                "No walk was held out. On the walks that it was fitted to, the model's RMS error "
                "of the resultant ground reaction force is 1.0 % of body weight; that is no "
                "prediction."
            ],
        ),
    ],
)
def test_the_verdict_compares_the_model_with_the_null_model_on_walks_it_has_not_seen(found, said):
    walking = SimpleNamespace(
        **{"fitted": None, "offsets_fitted": None, "angle_errors": [], "synthetic": False} | found
    )
    known = {"held_out": None, "synthetic": False} | found

    def verdict(to_come=False, summary=(), **sections):
        return say(
            "validation",
            "verdict",
            found=sections,
            held_out=known["held_out"] if sections else None,
            synthetic=known["synthetic"],
            to_come=to_come,
            summary=summary,
        )

    assert verdict(walking=walking) == said
    if known["held_out"] and known["held_out"].null_bw:
        layers = SimpleNamespace(null_bw=0.02, nearer=[True, False], rows=[], phases=[])
        both = verdict(walking=walking, layers=layers)
        assert "does not beat the harder null" in both[0]
        assert both[0].endswith("2.0 %; nearer in 1 of 2.")
        assert "the model has the smaller error in" in both[1]
    assert verdict(summary=[{"what": "bench", "met": False}, {"what": "energy", "met": None}]) == [
        "No walk could be compared with its plate.",
        "Criteria not met: bench.",
    ]
    assert verdict(to_come=True) == [], "not yet"
