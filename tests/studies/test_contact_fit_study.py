"""The study of the contact fit: the stored results are of the present data, add up, and are what the README shows."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from contact_fit_study import results as made
from contact_fit_study.cases import ALONE, PAIR, TIERS, TRIALS, cases, transfer
from contact_fit_study.floors import floor_behind_fit_bw
from contact_fit_study.floors import stored as floors
from contact_fit_study.keeping import kept
from contact_fit_study.table import TARGETS, Target, markdown_table, text_table
from floor_of_the_reference_subject import RESULTS

from vsf_drake.files import sha256

ROOT = RESULTS.parents[1]
SCRIPT, STORED = RESULTS.parent / "contact_fit.py", RESULTS / "contact_fit.json"
KEYS = ("one_trial_grf_rmse_bw", "one_trial_grf_r2", "held_out_grf_rmse_bw", "held_out_fore_aft_rmse_bw",
        "held_out_cop_rmse_fl", "held_out_impulse_rmse_bws", "null_model_grf_rmse_bw", "floor_grf_rmse_bw",
        "fulcrum_sweep_correct", "bench_rmse_n_per_mm", "wall_s")


@pytest.fixture(scope="module")
def stored():
    return json.loads(STORED.read_text(encoding="utf-8"))


def test_every_fit_is_stored_and_none_failed(stored):
    assert stored["synthetic"] is True
    for tier in TIERS:
        found = stored[tier]
        for key in KEYS:
            assert isinstance(found[key], int if key == "fulcrum_sweep_correct" else float), (tier, key)
        blocks = [found["one_trial"], found["without_bench"], found["keel_unknown"], found["resultant_alone"],
                  found["paper"]["literal"], found["paper"]["settled_10"]]
        fits = [found["transfer"], *(fit for block in blocks for fit in block.values())]
        assert len(fits) + len(found["all_pairs"]["pairs"]) == len(cases(tier))
        assert not any("failed" in fit for fit in [*fits, *found["all_pairs"]["pairs"].values()])
        assert all(set(fit["trials"]) == set(TRIALS) for fit in fits)
        assert all(found["one_trial"][name]["fitted"] == [name] for name in ALONE)
        assert found["transfer"]["fitted"] == list(PAIR) and found["transfer"]["starts"] == 5


def test_the_stored_results_are_of_all_trials_in_both_tiers(stored):
    inputs = stored["provenance"]["inputs_sha256"]
    assert len(inputs) == 4 + 2 * 3 * len(TRIALS)  # subject, model, bench and floors, and three files a trial and tier


@pytest.mark.parametrize("tier", TIERS)
def test_numbers_at_their_keys_are_means_over_the_seven_held_out_trials(stored, tier):
    found = stored[tier]
    trials = found["transfer"]["trials"]
    held = [row for row in trials.values() if row["role"] == "held out"]
    assert len(held) == 7 and not set(PAIR) & {name for name, row in trials.items() if row in held}
    for key, metric in (("held_out_grf_rmse_bw", "grf_rmse_bw"), ("held_out_cop_rmse_fl", "cop_rmse_fl"),
                        ("held_out_fore_aft_rmse_bw", "fore_aft_rmse_bw"),
                        ("held_out_impulse_rmse_bws", "impulse_rmse_bws"),
                        ("null_model_grf_rmse_bw", "null_model_grf_rmse_bw")):
        values = [row[metric] for row in held]
        assert found[key] == pytest.approx(np.mean(values)), key
        assert found["held_out"][key]["worst"] == max(values)
    definition = "exact" if tier == "exact" else "shared_errors_removed"
    floor = [floors()["trials"][name][definition]["grf_rmse_bw"] for name in found["transfer"]["held_out"]]
    assert found["floor_grf_rmse_bw"] == pytest.approx(np.mean(floor))
    right = [abs(row["sweep"]["best_mm"] - row["fulcrum_mm"]) <= 10.5 for row in trials.values()]
    assert found["fulcrum_sweep_correct"] == sum(right)
    bench = found["transfer"]["bench"]
    off = np.subtract(bench["model_n_per_mm"], bench["measured_n_per_mm"])
    assert found["bench_rmse_n_per_mm"] == pytest.approx(np.sqrt(np.mean(off**2)))


@pytest.mark.parametrize("tier", TIERS)
def test_errors_below_their_floor_are_named(stored, tier):
    trials = stored[tier]["transfer"]["trials"]
    below = {name for name, row in trials.items() if row["grf_rmse_bw"] < row["floor_grf_rmse_bw"]}
    assert set(stored[tier]["below_floor"]["trials"]) == below
    assert bool(stored[tier]["below_floor"]["why"]) == bool(below)


def test_the_readme_shows_the_stored_numbers(stored):
    assert markdown_table(stored) in (ROOT / "README.md").read_text(encoding="utf-8")


def test_targets_are_met(stored):
    missed = [(tier, t.what) for tier in TIERS for t in TARGETS if tier in t.limits and not t.met(tier, stored[tier])]
    assert not missed
    assert "MISSED" not in text_table(stored)


def test_a_fit_that_failed_is_no_number_and_a_target_missed():
    numbers = made.pair_results({"failed": "the walk diverges"})
    assert all(numbers[key] is None for key in ("held_out_grf_rmse_bw", "fulcrum_sweep_correct", "wall_s"))
    text = text_table({"exact": numbers})
    assert "failed" in text and "MISSED" in text


def test_a_mean_is_of_sizes_and_not_of_some_trials():
    rows = {"a": {"late": -0.02}, "b": {"late": 0.01}}
    assert made.spread({"held_out": ["a", "b"], "trials": rows}, "late") == {
        "mean": pytest.approx(0.015), "worst": 0.02, "worst_trial": "a"}
    rows["b"]["late"] = None
    assert made.spread({"held_out": ["a", "b"], "trials": rows}, "late")["mean"] is None


def test_a_target_is_a_most_or_a_least():
    most = Target(what="", key="x", limits={"exact": 1.0})
    least = Target(what="", key="x", limits={"exact": 1.0}, at_least=True)
    assert most.met("exact", {"x": 1.0}) and not most.met("exact", {"x": 1.1})
    assert least.met("exact", {"x": 1.0}) and not least.met("exact", {"x": 0.9})
    assert not most.met("exact", {"x": None})


def test_a_kept_part_is_made_again_only_for_another_key(tmp_path):
    calls = []

    def make():
        calls.append(1)
        return {"value": float(len(calls)), "lost": float("nan")}

    def broken():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kept(tmp_path, "part", "one", broken)
    assert not (tmp_path / "part.json").exists()
    assert kept(tmp_path, "part", "one", make) == ({"value": 1.0, "lost": None}, False)
    assert kept(tmp_path, "part", "one", make) == ({"value": 1.0, "lost": None}, True)
    assert kept(tmp_path, "part", "two", make)[0]["value"] == 2.0


def test_less_its_own_errors_too_a_trial_is_left_with_the_plates_noise():
    """What remains of the laboratory tier then is the exact tier's motion under the laboratory's plate."""
    expected = floors()["trials"]["high_1"]["plate_noise"]["grf_rmse_bw"]
    assert floor_behind_fit_bw("high_1", ("high_1",)) == pytest.approx(expected, abs=5e-5)


def test_cases_have_names_of_their_own_and_pairs_are_soft_and_stiff():
    names = [case.name for tier in TIERS for case in cases(tier)] + [transfer("exact", starts=1).name]
    assert len(set(names)) == len(names)
    pairs = {case.fitted for case in cases("exact") if len(case.fitted) == 2}
    assert len(pairs) == 9 and all(a.startswith("low") and b.startswith("high") for a, b in pairs)


def test_a_part_of_the_study_never_replaces_the_whole():
    done = subprocess.run([sys.executable, SCRIPT, "--quick"], check=False, capture_output=True, text=True)
    assert done.returncode == 2 and "--out" in done.stderr


@pytest.mark.slow
def test_the_quick_form_finds_the_stored_fit_again(tmp_path, stored):
    """One start ends where the best of five does, as far as what it predicts goes; the stored file stays as it was."""
    before = sha256(STORED)
    subprocess.run([sys.executable, SCRIPT, "--quick", "--out", tmp_path], check=True, capture_output=True)
    again = json.loads((tmp_path / "contact_fit.json").read_text(encoding="utf-8"))
    assert set(again) - set(stored) == set() and "laboratory" not in again
    for key in ("held_out_grf_rmse_bw", "held_out_cop_rmse_fl", "held_out_fore_aft_rmse_bw"):
        assert again["exact"][key] == pytest.approx(stored["exact"][key], abs=2e-3), key
    assert again["exact"]["fulcrum_sweep_correct"] == stored["exact"]["fulcrum_sweep_correct"]
    for name in ("errors_by_trial", "fulcrum_sweeps"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000 and (tmp_path / f"{name}.svg").exists()
    assert sha256(STORED) == before
