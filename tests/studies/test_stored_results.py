"""Studies of the contact fit: what is stored is of the present data and sources, adds up, and is in
the guide."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
import warnings

import adaptive_stride
import check_stored
import contact_fit
import contact_truth_recovery
import device_hypotheses
import floor_of_the_reference_subject
import make_reference_subject
import numpy as np
import pytest
import ship_validation
from command_line import exit_code
from contact_fit_study import results as fit_results
from contact_fit_study.cases import ALONE, PAIR, TIERS, TRIALS, cases
from contact_fit_study.floors import stored as floors
from contact_fit_study.keeping import STUDIES, kept, meaning, sources_sha256
from contact_fit_study.table import TARGETS, text_table
from contact_truth_recovery import OPTIONS, made, trial
from contact_truth_recovery import TRIALS as TRUTH_TRIALS
from contact_truth_study.making import IMPULSE, assuming, impulse
from contact_truth_study.recovering import ROUNDS, cover, row, through
from floor_of_the_reference_subject import NOMINAL, RESULTS
from scipy.stats import binom

from vsf_drake.base.files import plain, record, resource, sha256
from vsf_drake.fit.options import FitNoise
from vsf_drake.fit.solve import prior_samples
from vsf_drake.model.contact_file import load_contact
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.tuning.common import FREE_COSTS
from vsf_drake.validation.options import StudyOptions
from vsf_drake.validation.published_trends import TrendTable, judged
from vsf_drake.validation.run import LONG, SHIPPED, SectionStore, shipped_key
from vsf_drake.walks.embedded import embedded_bench, embedded_contact, embedded_trials
from vsf_drake.walks.published import TABLE

ROOT = RESULTS.parents[1]
ASSUMED_BW = np.sqrt(3.0) * FitNoise().vertical  # of the resultant, whose components are alike
FIT_SCRIPT, FIT_STORED = RESULTS.parent / "contact_fit.py", RESULTS / "contact_fit.json"


@pytest.fixture(scope="module")
def fit_stored():
    return json.loads(FIT_STORED.read_text(encoding="utf-8"))


def test_every_fit_is_stored_none_failed_and_what_misses_its_target_is_known(fit_stored):
    assert fit_stored["synthetic"] is True
    inputs = fit_stored["provenance"]["inputs_sha256"]
    # subject, model, bench and floors, and three files a trial and tier
    assert len(inputs) == 4 + 2 * 3 * len(TRIALS)
    for tier in TIERS:
        found = fit_stored[tier]
        blocks = [
            found["one_trial"],
            found["without_bench"],
            found["keel_unknown"],
            found["resultant_alone"],
            found["paper"]["literal"],
            found["paper"]["settled_10"],
        ]
        fits = [found["transfer"], *(fit for block in blocks for fit in block.values())]
        assert len(fits) + len(found["all_pairs"]["pairs"]) == len(cases(tier))
        assert not any("failed" in fit for fit in [*fits, *found["all_pairs"]["pairs"].values()])
        assert all(set(fit["trials"]) == set(TRIALS) for fit in fits)
        assert all(found["one_trial"][name]["fitted"] == [name] for name in ALONE)
        assert found["transfer"]["fitted"] == list(PAIR) and found["transfer"]["starts"] == 5
        missed = [t.what for t in TARGETS if tier in t.limits and not t.met(tier, found)]
        assert missed == []  # and the guide says so


@pytest.mark.parametrize("tier", TIERS)
def test_numbers_at_their_keys_are_means_over_the_seven_held_out_trials(fit_stored, tier):
    found = fit_stored[tier]
    trials = found["transfer"]["trials"]
    held = [row for row in trials.values() if row["role"] == "held out"]
    assert len(held) == 7 and not set(PAIR) & {name for name, row in trials.items() if row in held}
    for key, metric in (
        ("held_out_grf_rmse_bw", "grf_rmse_bw"),
        ("held_out_cop_rmse_fl", "cop_rmse_fl"),
        ("held_out_fore_aft_rmse_bw", "fore_aft_rmse_bw"),
        ("held_out_impulse_rmse_bws", "impulse_rmse_bws"),
        ("null_model_grf_rmse_bw", "null_model_grf_rmse_bw"),
        ("stretched_null_grf_rmse_bw", "stretched_null_grf_rmse_bw"),
    ):
        values = [row[metric] for row in held]
        assert found[key] == pytest.approx(np.mean(values)), key
        assert found["held_out"][key]["worst"] == max(values)
    definition = "exact" if tier == "exact" else "shared_errors_removed"
    floor = [
        floors()["trials"][name][definition]["grf_rmse_bw"]
        for name in found["transfer"]["held_out"]
    ]
    assert found["floor_grf_rmse_bw"] == pytest.approx(np.mean(floor))
    right = [abs(row["sweep"]["best_mm"] - row["fulcrum_mm"]) <= 10.5 for row in trials.values()]
    assert found["fulcrum_sweep_correct"] == sum(right)
    bench = found["transfer"]["bench"]
    off = np.subtract(bench["model_n_per_mm"], bench["measured_n_per_mm"])
    assert found["bench_rmse_n_per_mm"] == pytest.approx(np.sqrt(np.mean(off**2)))
    below = {name for name, row in trials.items() if row["grf_rmse_bw"] < row["floor_grf_rmse_bw"]}
    assert set(found["below_floor"]["trials"]) == below
    assert bool(found["below_floor"]["why"]) == bool(below)


def test_a_fit_that_failed_is_no_number_and_a_target_missed():
    numbers = fit_results.pair_results({"failed": "the walk diverges"})
    assert all(
        numbers[key] is None for key in ("held_out_grf_rmse_bw", "fulcrum_sweep_correct", "wall_s")
    )
    text = text_table({"exact": numbers})
    assert "failed" in text and "MISSED" in text


def test_a_kept_part_is_made_again_only_for_another_key(tmp_path):
    calls = []

    def make():
        calls.append(1)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return {"value": float(len(calls)), "lost": float("nan")}

    with pytest.raises(KeyboardInterrupt):
        kept(tmp_path, "part", "one", make)
    assert not (tmp_path / "part.json").exists()
    assert kept(tmp_path, "part", "one", make) == ({"value": 2.0, "lost": None}, False)
    assert kept(tmp_path, "part", "one", make) == ({"value": 2.0, "lost": None}, True)
    assert kept(tmp_path, "part", "two", make)[0]["value"] == 3.0


@pytest.mark.parametrize(
    "script",
    [
        adaptive_stride,
        contact_fit,
        contact_truth_recovery,
        device_hypotheses,
        floor_of_the_reference_subject,
        make_reference_subject,
    ],
    ids=lambda script: script.__name__,
)
def test_a_part_of_a_study_never_replaces_the_whole(monkeypatch, capsys, script):
    monkeypatch.setattr(sys, "argv", [script.__name__, "--quick"])
    with pytest.raises(SystemExit) as ended:
        script.main()
    assert ended.value.code == 2 and "--out" in capsys.readouterr().err


@pytest.mark.slow
def test_the_quick_form_finds_the_stored_fit_again(tmp_path, fit_stored):
    """One start ends where the best of five does, as far as what it predicts goes; the stored file
    stays as it was."""
    before = sha256(FIT_STORED)
    subprocess.run(
        [sys.executable, FIT_SCRIPT, "--quick", "--out", tmp_path], check=True, capture_output=True
    )
    again = json.loads((tmp_path / "contact_fit.json").read_text(encoding="utf-8"))
    assert set(again) - set(fit_stored) == set() and "laboratory" not in again
    for key in ("held_out_grf_rmse_bw", "held_out_cop_rmse_fl", "held_out_fore_aft_rmse_bw"):
        assert again["exact"][key] == pytest.approx(fit_stored["exact"][key], abs=2e-3), key
    assert again["exact"]["fulcrum_sweep_correct"] == fit_stored["exact"]["fulcrum_sweep_correct"]
    for name in ("errors_by_trial", "fulcrum_sweeps"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000 and (
            tmp_path / f"{name}.svg"
        ).exists()
    assert sha256(FIT_STORED) == before


# Strides that adapt: what the guide says of level 2.


@pytest.fixture(scope="module")
def adaptive():
    stored = json.loads((RESULTS / "adaptive_stride.json").read_text(encoding="utf-8"))
    assert stored["synthetic"] is True
    return stored


def test_the_weight_of_able_bodied_walking_is_the_least_that_keeps_such_a_person_in_the_bands(
    adaptive,
):
    """At all of 0.9, 1.1 and 1.4 m/s: stride time, step length and both peaks."""
    found = adaptive["able_bodied"]
    assert found["least_that_meets_all"] == StrideOptions().normal_weight
    for weight, rows in found["weights"].items():
        assert set(rows) == {"0.9", "1.1", "1.4"} and len(rows["0.9"]["bands"]) == 4
        assert all(row["within"] for row in rows.values()) == (
            float(weight) >= StrideOptions().normal_weight
        )


def test_consistent_strides_find_their_fulcrum(adaptive):
    """Nine of nine within 10 mm from three starts."""
    assert len(adaptive["found"]) == 9
    for stride in adaptive["found"].values():
        assert len(stride["consistent_mm"]) == 3
        assert all(abs(mm - stride["own_mm"]) < 10.0 for mm in stride["consistent_mm"].values())


def test_the_full_model_carries_out_what_the_guide_says(adaptive):
    """3 % of body weight with a tenth of the torques, in fifteen of fifteen."""
    rows = {(walk, cost): of[cost] for walk, of in adaptive["costs"].items() for cost in FREE_COSTS}
    assert len(rows) == 15
    for one in rows.values():
        assert one["status"] == ["optimal", "optimal"] and not one["fell"]
        assert (
            one["feedback_share"] < 0.1
            and max(one["prescribed_percent_bw"], one["feedback_percent_bw"]) < 3.0
        )


def test_nine_positions_are_solved_at_each_of_three_speeds_and_the_best_is_stiffer_the_faster(
    adaptive,
):
    found = adaptive["speeds"]
    assert len(found["positions_mm"]) == 9
    assert all(cost is not None for row in found["speeds"].values() for cost in row["cost"])
    best = [found["speeds"][speed]["fulcrum_mm"] for speed in ("0.9", "1.1", "1.4")]
    assert best == sorted(best) and best[0] < best[-1]


def test_a_passive_foot_returns_no_more_than_it_stored_in_any_stored_stride(adaptive):
    """Negative and positive work of one power."""
    for one in adaptive["signs"]:
        told = one["outcomes"]
        both = zip(told["returned_energy"], told["stored_energy"], strict=True)
        assert all(0.0 < given < taken for given, taken in both)


def test_starts_of_strides_that_adapt_end_alike(adaptive):
    for found in adaptive["signs"]:
        costs = [end["cost"] for end in found["free"] if end["status"] == "optimal"]
        own = found["weight"] == StrideOptions().normal_weight
        assert len(costs) >= 2 and max(costs) / min(costs) < (1.005 if own else 1.01)


# Published effects.


@pytest.fixture(scope="module")
def trend_table():
    return record(TrendTable, check_stored.read("published_trends"))


def test_stored_verdicts_follow_from_the_published_table_as_it_is(trend_table):
    """Without walking again: another sign or number in the table would judge the stored evidence
    otherwise."""
    assert trend_table.inputs[TABLE] == sha256(resource(TABLE))
    again = judged(trend_table.evidence, trend_table.stiffness)
    for name, found in again.items():
        assert plain(found) == plain(getattr(trend_table, name)), name


# Truth recovery: recordings that the model made are fitted back.


TRUTH_STORED = RESULTS / "contact_truth_recovery.json"


@pytest.fixture(scope="module")
def one():
    """A truth and its recording of one trial, without noise."""
    return made(TRUTH_TRIALS["one_trial"], [7, 2, 0], 0.0)


def test_at_the_truth_nothing_is_left_but_the_prior_and_the_recording_carries_the_person(one):
    *data, prior = one.fit.evaluate(one.truth, derivatives=False).terms
    for term in data:
        np.testing.assert_allclose(
            term.residual, 0.0, atol=2e-3, err_msg=f"{term.trial} {term.name}"
        )
    np.testing.assert_array_equal(prior.residual, one.truth)
    assert np.abs(one.truth).max() > 1.0, "the truth is not the middle of the prior"
    impulses = [impulse(one.fit.trials[0]), impulse(trial("low_1"))]
    assert impulses[0] == pytest.approx(impulses[1], rel=IMPULSE)


def test_less_noise_is_assumed_of_the_same_recordings(one):
    less = assuming(one, 0.1)
    assert less.fit.options.noise.vertical == pytest.approx(0.1 * OPTIONS.noise.vertical)
    assert less.fit.options.noise.correlation_s == OPTIONS.noise.correlation_s
    assert less.fit.bench.uncertainty_n_per_m == pytest.approx(
        0.1 * one.fit.bench.uncertainty_n_per_m
    )
    u = np.zeros(len(one.truth))
    for a, b in zip(one.fit.evaluate(u).terms[:-1], less.fit.evaluate(u).terms[:-1], strict=True):
        np.testing.assert_allclose(b.residual, 10.0 * a.residual, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_drawn_noise_is_as_large_as_was_assumed_and_nothing_in_swing():
    """The filter at 40 Hz takes a twentieth of the force's variance, that at 6 Hz a third of the
    other's."""
    noisy = [made(TRUTH_TRIALS["one_trial"], [7, 3, seed], 1.0) for seed in range(4)]
    rms: dict[str, list[float]] = {}
    for item in noisy:
        at = item.fit.evaluate(item.truth, derivatives=False)
        stance = (
            item.fit.terms_of(item.fit.trials[0], item.fit.labels[0])
            .walk(item.truth)[0]
            .stances[0]
            .measured
        )
        for term in at.terms[:-2]:
            inside = (term.times_s > stance.start_s + 0.02) & (term.times_s < stance.end_s - 0.02)
            rms.setdefault(term.name, []).append(np.mean(term.residual[inside] ** 2))
        plate = item.fit.trials[0].prosthetic_plate
        # a foot that is drawn low leaves the floor just after the recording begins
        assert not plate.force_W[
            (plate.time_s > 0.05) & (plate.time_s < stance.start_s - 0.05)
        ].any()
    found = {name: np.sqrt(np.mean(values)) for name, values in rms.items()}
    for name in ("fore_aft", "lateral", "vertical"):
        assert found[name] == pytest.approx(0.97, rel=0.3), name
    assert found["cop_fore_aft"] == pytest.approx(0.82, rel=0.4)


@pytest.mark.slow
def test_a_truth_comes_back_from_random_starts(one):
    """With the noise that a fit assumes and with three tenths of it: all starts end in one minimum
    that costs no more than the truth, its force within the noise, parameters within two standard
    errors. (With a twelfth of it they end in another, which costs more than the truth.)"""
    problems = [assuming(one, scale) for scale in ROUNDS[:2]]
    ends = [through(problems, u) for u in prior_samples(one.fit.parameters, 2, [1])]
    for k, problem in enumerate(problems):
        truth = problem.fit.evaluate(problem.truth, derivatives=False).cost
        for found in (row(problem, each[k]) for each in ends):
            assert found["success"] and found["cost"] < truth
            assert max(found["grf_rmse_bw"]) < ROUNDS[k] * ASSUMED_BW
            assert found["within"] >= 0.9 * found["identified"] >= 9, found["outside"]
        assert ends[0][k].cost == pytest.approx(ends[1][k].cost, abs=2.0)


@pytest.mark.slow
def test_intervals_hold_the_truth_in_most_seeds(tmp_path):
    """Three seeds of one trial, two of them by the study's quick form: of some twenty-five
    intervals of what is identified one or two are expected to miss."""
    before = sha256(TRUTH_STORED)
    subprocess.run(
        [sys.executable, contact_truth_recovery.__file__, "--quick", "--out", tmp_path],
        check=True,
        capture_output=True,
    )
    parts = [
        json.loads(
            (tmp_path / "parts" / f"interval_low_1_1_{seed}.json").read_text(encoding="utf-8")
        )["part"]
        for seed in range(2)
    ]
    found = [*parts, cover(made(TRUTH_TRIALS["one_trial"], [7, 1, 2], 1.0), 1.0)]
    known = [
        p["contained"] for seed in found for p in seed["parameters"].values() if p["identified"]
    ]
    assert all(seed["success"] for seed in found)
    assert len(known) >= 15 and np.mean(known) > 0.8
    recovery = json.loads((tmp_path / "contact_truth_recovery.json").read_text(encoding="utf-8"))[
        "recovery"
    ]
    assert recovery["one_trial"]["default_noise"]["searches"]["grf_rmse_bw"]["worst"] < ASSUMED_BW
    assert sha256(TRUTH_STORED) == before


def test_stored_truths_add_up_and_every_start_ends_alike_at_the_noise_that_a_fit_assumes():
    """At noise sharpened to a twelfth of it, searches end in minima above what the truth costs:
    told, not asked."""
    stored = json.loads(TRUTH_STORED.read_text(encoding="utf-8"))
    assert stored["synthetic"] is True
    for name, found in stored["recovery"].items():
        rows = [search for truth in found["truths"] for search in truth["in_rounds"]["searches"]]
        searches, allowed = found["in_rounds"]["searches"], found["default_noise"]["searches"]
        assert searches["within"] == sum(r["within"] for r in rows)
        assert all(r["identified"] - r["within"] == len(r["outside"]) for r in rows)
        assert (
            searches["converged"]
            == allowed["converged"]
            == allowed["at_the_lowest"]
            == searches["count"]
        ), name
        assert allowed["grf_rmse_bw"]["worst"] < ASSUMED_BW, name
    for found in stored["intervals"].values():
        known, wide = (
            found["share_contained"]["identified"],
            found["share_contained"]["not_identified"],
        )
        assert known["n"] == sum(row["identified"] for row in found["parameters"].values())
        assert known["held"] == sum(
            row["contained_of_identified"] for row in found["parameters"].values()
        )
        assert known["n"] + wide["n"] == found["seeds"] * len(found["parameters"])
        assert known["binomial_95"][0] < known["share"] < known["binomial_95"][1]
        for parameter in found["parameters"].values():
            assert (
                sum(parameter["contained_in_twenties"]) == parameter["contained"] <= found["seeds"]
            )


# Session fits: ten seeds for each of three persons.


def test_thirty_session_fits_are_stored_and_their_counts_add_up():
    """What is counted anew from each fit's own intervals: a fit that failed is in no share."""
    stored = json.loads((RESULTS / "session_fit.json").read_text(encoding="utf-8"))
    fits = {**stored["seeds"], **{name: stored["cases"][name] for name in stored["ends"]}}
    assert stored["fits"] == len(fits) == 30 and set(stored["ends"]) == {
        "a_day_1",
        "b_day_1",
        "c_day_1",
    }
    converged = [fit for fit in fits.values() if fit["converged"]]
    assert (
        stored["converged"]
        == len(converged)
        == sum(row["converged"] for row in stored["ends"].values())
    )
    told = stored["intervals"]
    assert told["persons"] == 3 and told["seeds_agree"] is True, (
        "ten seeds fit the same data: a person counts once"
    )
    rows = [
        row
        for name in stored["ends"]
        for row in stored["cases"][name]["end"]["parameters"].values()
    ]
    assert len(rows) == 3 * 8
    for group, identified in (("identified", True), ("not_identified", False)):
        for key, truth in (("contained", "truth"), ("contained_as_found", "truth_as_found")):
            inside = [
                row["interval"][0] <= row[truth] <= row["interval"][1]
                for row in rows
                if row["identified"] is identified
            ]
            found = told[group][key]
            assert (found["n"], found["held"]) == (len(inside), sum(inside))
            # Clopper-Pearson: each end leaves 2.5 % beyond what was seen
            low, high = found["binomial_95"]
            assert low == 0.0 or binom.sf(found["held"] - 1, found["n"], low) == pytest.approx(
                0.025
            )
            assert high == 1.0 or binom.cdf(found["held"], found["n"], high) == pytest.approx(0.025)


def test_walks_below_the_null_model_are_counted_against_curves_between_the_fitted_settings():
    """Counted anew from every held-out walk."""
    stored = json.loads((RESULTS / "session_fit.json").read_text(encoding="utf-8"))
    for days, names in (
        ("first_days", ("a_day_1", "b_day_1", "c_day_1")),
        ("with_second_day", ("a_day_1", "a_day_2", "b_day_1", "c_day_1")),
    ):
        for told, roles in (
            ("held out", ("same setting", "unseen setting")),
            ("unseen setting", ("unseen setting",)),
        ):
            rows = [
                row
                for name in names
                for row in stored["cases"][name]["trials"].values()
                if row["role"] in roles
            ]
            found = stored["against_null"][days][told.replace(" ", "_")]
            assert found["walks"] == len(rows)
            for layer in ("physics", "momentum", "person"):
                error = [row["layers"][layer]["grf_rmse_bw"] for row in rows]
                assert found[layer]["nearer"] == sum(
                    a < row["null_model_grf_rmse_bw"] for a, row in zip(error, rows, strict=True)
                )


# Stored results are of the files and the sources as they are.


@pytest.mark.parametrize("name", check_stored.CHECKS)
def test_stored_numbers_are_of_the_files_as_they_are(name):
    saved = check_stored.read(name)
    assert NOMINAL in saved["provenance"]["inputs_sha256"]
    assert check_stored.changed_files(name, saved) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_sections_that_come_with_the_package_are_shown_beside_its_walks(name):
    """Else a validation of the embedded subject lacks them: studies/ship_validation.py makes them
    again."""
    key = shipped_key(ship_validation.embedded(StudyOptions()))
    assert SectionStore(resource(SHIPPED), key).read(name, LONG[name]) is not None


@pytest.mark.parametrize("name", check_stored.CHECKS)
def test_stored_numbers_are_those_of_the_present_sources(name):
    """Other sources are a warning, if a part that is made anew in seconds gives the saved
    numbers."""
    saved = check_stored.read(name)
    assert set(saved["provenance"]["sources"]) == {"sha256", "numbers"}
    if not check_stored.same_sources(name, saved):
        warnings.warn(
            f"studies/results/{name}.json: other sources made or checked it; python "
            "studies/check_stored.py notes that these give the same numbers",
            stacklevel=1,
        )
        assert check_stored.differences(name, saved) == [], (
            f"stale: run studies/{check_stored.CHECKS[name][0]} again"
        )


@pytest.mark.parametrize("name", [pytest.param("floor", marks=pytest.mark.slow), "contact_fit"])
def test_a_spot_check_tells_a_number_that_is_off_by_a_thousandth(name):
    saved = copy.deepcopy(check_stored.read(name))
    row = (
        saved["trials"]["low_1"]["laboratory"]
        if name == "floor"
        else (saved["exact"]["transfer"]["trials"]["medium_2"])
    )
    row["cop_rmse_fl"] *= 1.001
    (told,) = check_stored.differences(name, saved)
    assert "cop_rmse_fl" in told


def test_a_digest_knows_what_sources_say_and_not_how_they_are_written(tmp_path):
    def said(text: str) -> str:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text, encoding="utf-8")
        return meaning(path)[0]

    plain = said("def f(x):\n    return 2.0 * x\n")
    assert (
        said('"""A module."""\n\n\ndef f( x ):  # twice\n    """Twice."""\n    return (2.0*x)\n')
        == plain
    )
    assert said("def f(x):\n    return 2.1 * x\n") != plain


@pytest.mark.parametrize("script", [script for script, _ in check_stored.CHECKS.values()])
def test_a_law_that_changes_makes_every_result_one_of_other_sources(script, monkeypatch):
    law = STUDIES.parent / "vsf_drake" / "laws" / "kelvin_voigt.py"
    before = sources_sha256(STUDIES / script)
    monkeypatch.setattr(
        "contact_fit_study.keeping.meaning",
        lambda path, roots: ("another", set()) if path == law else meaning(path, roots),
    )
    assert sources_sha256(STUDIES / script) != before


@pytest.mark.parametrize("missing", [[], ["strides that adapt to the heel were not computed"]])
def test_a_result_that_lacks_something_is_not_stamped(tmp_path, monkeypatch, capsys, missing):
    """Of other sources that find every number again: stamped if it is whole, else refused with what
    it lacks."""

    def stored(**sources):
        return {
            "value": 1.0,
            "missing": missing,
            "provenance": {"inputs_sha256": {}, "sources": sources},
        }

    file = tmp_path / "whole.json"
    file.write_text(
        json.dumps(stored(sha256="of others", numbers="made by others")), encoding="utf-8"
    )
    monkeypatch.setattr(check_stored, "RESULTS", tmp_path)
    monkeypatch.setattr(
        check_stored,
        "CHECKS",
        {"whole": ("gait.py", lambda saved: [("value", 1.0, saved["value"])])},
    )
    monkeypatch.setattr(sys, "argv", ["check_stored.py"])
    before = file.read_text(encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        check_stored.main()
    said = capsys.readouterr().out
    assert ended.value.code == bool(missing)
    if missing:
        assert file.read_text(encoding="utf-8") == before
        assert (
            "run studies/gait.py again: it lacks something: strides that adapt to the heel were not"
            in said
        )
    else:
        assert (
            json.loads(file.read_text(encoding="utf-8"))["provenance"]["sources"]["numbers"]
            == check_stored.CHECKED
        )


@pytest.mark.slow
@pytest.mark.parametrize("tier", TIERS)
def test_a_new_fit_says_what_the_shipped_contact_says(tier, tmp_path):
    """The command of data/reference_subject/README.md, some two minutes."""
    paths = {path.stem: path for path in embedded_trials(tier)}
    held_out = [
        word for name, path in paths.items() if name not in PAIR for word in ("--hold-out", path)
    ]
    assert (
        exit_code(
            "fit",
            *(paths[name] for name in PAIR),
            "--bench",
            embedded_bench(),
            *held_out,
            "--out",
            tmp_path / "fit",
        )
        == 0
    )
    again = load_contact(tmp_path / "fit" / "contact.yaml")
    assert set(again.verdict) == set(load_contact(embedded_contact(tier)).verdict)
