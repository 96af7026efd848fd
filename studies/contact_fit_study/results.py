"""The study's results out of its parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from contact_fit_study.cases import (
    ALONE,
    KEEL_SPREAD,
    PAIR,
    SETTLED,
    TIERS,
    WRONG_KEEL,
    Case,
    keel_unknown,
    one_trial,
    other_pairs,
    paper_literal,
    paper_settled,
    resultant_alone,
    transfer,
    without_bench,
)
from contact_fit_study.floors import FITTED, HELD_OUT, floor_behind_fit_bw, stored

HELD_OUT_KEYS = {
    "held_out_grf_rmse_bw": "grf_rmse_bw",
    "held_out_fore_aft_rmse_bw": "fore_aft_rmse_bw",
    "held_out_cop_rmse_fl": "cop_rmse_fl",
    "held_out_impulse_rmse_bws": "impulse_rmse_bws",
    "held_out_stance_time_error_s": "stance_time_error_s",
    "null_model_grf_rmse_bw": "null_model_grf_rmse_bw",
    "stretched_null_grf_rmse_bw": "stretched_null_grf_rmse_bw",
    "floor_grf_rmse_bw": "floor_grf_rmse_bw",
}
"""Means over the held-out trials of the reported pair, by what they are means of; of a signed one,
of its size."""
ONE_TRIAL_KEYS = ("one_trial_grf_rmse_bw", "one_trial_grf_r2", "one_trial_wall_s")
SWEEP_KEY, BENCH_KEY, WALL_KEY = "fulcrum_sweep_correct", "bench_rmse_n_per_mm", "wall_s"
PAIR_KEYS = (
    "grf_rmse_bw",
    "fore_aft_rmse_bw",
    "cop_rmse_fl",
    "impulse_rmse_bws",
    "null_model_grf_rmse_bw",
)
BELOW = (
    "A fit of few trials takes the mean of their own constant errors (0.1 degrees in every "
    "angle, 0.4 mm) for an error that all trials share, and takes it off the held-out ones as "
    "well: a help where theirs happen to be alike, which is chance, not knowledge. "
    "floor_behind_fit_bw is what the true foot is left with when the same is taken off. Besides, "
    "a fitted trial has a height of its own and the smooth curves, which take up more of its own "
    "errors than the height that its floor allows for."
)


def definitions() -> dict[str, str]:
    """What the floors are, in words."""
    words = stored()["definitions"]
    return {
        "floor of held-out trials": "studies/results/floor.json: "
        + ", ".join(f"{tier} tier {name} ({words[name]})" for tier, name in HELD_OUT.items()),
        "floor of fitted trials": "studies/results/floor.json: "
        + ", ".join(f"{tier} tier {name} ({words[name]})" for tier, name in FITTED.items()),
        "null model": (
            "the measured resultants of the other fitted trials, stretched to the stance of this "
            "one and interpolated between their settings; of one setting the nearest of them"
        ),
        "stretched null": (
            "the nearest single one of these curves, which only this trial's own plate can name"
        ),
        "fulcrum sweep": (
            "right where the error over the fulcrum's travel is lowest within 10.5 mm of its "
            "place, one-sided where that was an end of its travel, so that an error outwards could "
            "not show"
        ),
        "wall_s": (
            "of the reported pair with all its starts, compiled before; load_before is the "
            "machine's load average before it, cpu_s what the process used"
        ),
        "held_out": "means over the seven trials that the pair leaves, and the worst of them",
        "without_bench": (
            "by recordings alone, keel and fulcrum being calibrated: two of the bench's "
            "stiffnesses are in the model all the same"
        ),
        "keel_unknown": (
            "by recordings alone, of a device that nobody has calibrated: the search begins with a "
            f"keel {WRONG_KEEL:g} times as stiff, and believes it and the fulcrum within "
            f"{100 * KEEL_SPREAD:g} %"
        ),
        "resultant_alone": (
            "by the resultant force alone, without components, centre of pressure and bench"
        ),
        "paper": (
            "literal: it ends at the first iteration that finds nothing better, as the paper's "
            f"words say; settled_{SETTLED}: when {SETTLED} in a row found nothing better"
        ),
    }


def tier_results(tier: str, part: Callable[[Case], dict[str, Any]]) -> dict[str, Any]:
    """The numbers of a tier at their keys, and behind them what they come from."""

    def parts(wanted: list[Case]) -> dict[str, Any]:
        return {"+".join(case.fitted): part(case) for case in wanted}

    pair, alone = part(transfer(tier)), parts(one_trial(tier))
    numbers: dict[str, Any] = dict.fromkeys(ONE_TRIAL_KEYS)
    first = alone[ALONE[0]]
    if "failed" not in first:
        own = first["trials"][ALONE[0]]
        numbers = dict(
            zip(
                ONE_TRIAL_KEYS,
                (own["grf_rmse_bw"], own["grf_r2"], first["time"]["wall_s"]),
                strict=True,
            )
        )
    return {
        **numbers,
        **pair_results(pair),
        "below_floor": below_floor(tier, pair),
        "one_trial": alone,
        "all_pairs": all_pairs(pair, parts(other_pairs(tier))),
        "without_bench": parts(without_bench(tier)),
        "keel_unknown": parts(keel_unknown(tier)),
        "resultant_alone": parts(resultant_alone(tier)),
        "paper": {
            "literal": parts(paper_literal(tier)),
            f"settled_{SETTLED}": parts(paper_settled(tier)),
        },
    }


def pair_results(pair: Mapping[str, Any]) -> dict[str, Any]:
    """Of the reported pair: means, the worst, and all of it."""
    keys = (*HELD_OUT_KEYS, SWEEP_KEY, BENCH_KEY, WALL_KEY)
    if "failed" in pair:
        return {**dict.fromkeys(keys), "transfer": pair}
    held = {key: spread(pair, name) for key, name in HELD_OUT_KEYS.items()}
    return {
        **{key: value["mean"] for key, value in held.items()},
        SWEEP_KEY: sum(row["sweep"]["right"] for row in pair["trials"].values()),
        BENCH_KEY: pair["bench"]["rmse_n_per_mm"],
        WALL_KEY: pair["time"]["wall_s"],
        "held_out": held,
        "fulcrum_sweep_one_sided": [name for name, row in pair["trials"].items() if _at_end(row)],
        "no_better_than_null_model": [
            name
            for name in pair["held_out"]
            if pair["trials"][name]["grf_rmse_bw"] >= pair["trials"][name]["null_model_grf_rmse_bw"]
        ],
        "transfer": pair,
    }


def _at_end(row: Mapping[str, Any]) -> bool:
    """Whether the fulcrum stood at an end of its travel, so that an error outwards could not
    show."""
    swept = row["sweep"]["fulcrum_mm"]
    return bool(min(abs(row["fulcrum_mm"] - swept[0]), abs(row["fulcrum_mm"] - swept[-1])) < 1.0)


def spread(part: Mapping[str, Any], metric: str) -> dict[str, Any]:
    """Mean, worst and whose it is, over the held-out trials; of sizes."""
    found = {
        name: abs(value)
        for name in part["held_out"]
        if (value := part["trials"][name][metric]) is not None
    }
    if len(found) < len(part["held_out"]):
        return {"mean": None, "worst": None, "worst_trial": None}
    worst = max(found, key=lambda name: found[name])
    return {"mean": float(np.mean([*found.values()])), "worst": found[worst], "worst_trial": worst}


def all_pairs(
    reported: Mapping[str, Any], others: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """How the reported pair compares with the other pairs of a soft and a stiff trial: no lucky
    draw."""
    rows = {name: _pair_row(pair) for name, pair in others.items()}
    sound = [row for row in rows.values() if "failed" not in row]
    told: dict[str, Any] = {"pairs": rows, "starts": 1}
    for key in PAIR_KEYS:
        values = [row[key] for row in sound]
        told[f"held_out_{key}"] = {
            "mean": float(np.mean(values)) if values else None,
            "best": min(values, default=None),
            "worst": max(values, default=None),
            "worst_trial": max((row[f"worst_{key}"] for row in sound), default=None),
        }
    if "failed" not in reported:
        mean = spread(reported, "grf_rmse_bw")["mean"]
        told["reported_pair"] = {
            "pair": "+".join(PAIR),
            "held_out_grf_rmse_bw": mean,
            "rank_of_nine": 1 + sum(row["grf_rmse_bw"] < mean for row in sound),
        }
    return told


def _pair_row(pair: Mapping[str, Any]) -> dict[str, Any]:
    if "failed" in pair:
        return {"failed": pair["failed"]}
    row = {
        key: value
        for name in PAIR_KEYS
        for key, value in (
            (name, spread(pair, name)["mean"]),
            (f"worst_{name}", spread(pair, name)["worst"]),
        )
    }
    return {
        **row,
        SWEEP_KEY: sum(t["sweep"]["right"] for t in pair["trials"].values()),
        BENCH_KEY: pair["bench"]["rmse_n_per_mm"],
        WALL_KEY: pair["time"]["wall_s"],
    }


def below_floor(tier: str, pair: Mapping[str, Any]) -> dict[str, Any]:
    """Which trials of the reported pair are below their floor, and what a fit of these trials could
    take off."""
    if "failed" in pair:
        return {"trials": {}, "why": ""}
    found: dict[str, Any] = {}
    for name, row in pair["trials"].items():
        if row["grf_rmse_bw"] < row["floor_grf_rmse_bw"]:
            found[name] = {
                "role": row["role"],
                "grf_rmse_bw": row["grf_rmse_bw"],
                "floor_grf_rmse_bw": row["floor_grf_rmse_bw"],
            }
            if row["role"] == "held out" and tier == TIERS[1]:
                found[name]["floor_behind_fit_bw"] = floor_behind_fit_bw(
                    name, tuple(pair["fitted"])
                )
    return {"trials": found, "why": BELOW if found else ""}
