"""The study's results out of its parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from contact_fit_study.binomial import counted
from scipy.stats import binom

NOMINAL, ASKED, SEEDS = 0.95, 17, 20
"""Of intervals, and how often of SEEDS one must hold the truth."""
WAYS = ("default_noise", "in_rounds", "at_once")


def definitions() -> dict[str, str]:
    """What the results are, in words."""
    return {
        "recordings": (
            "made by the model itself with parameters drawn from the fit's prior, in the fit's "
            "step; see studies/contact_truth_study/making.py"
        ),
        "identified": "of a parameter: its standard error is at most half of the prior's",
        "within": (
            "identified parameters within 2 standard errors of the truth; outside: the others, in "
            "standard errors"
        ),
        "default_noise": (
            "searches from random starts (Latin hypercube samples of the prior) of recordings "
            "without noise, with the noise that a fit assumes by default: 2.5 % body weight, 3 % "
            "foot length"
        ),
        "in_rounds": (
            "the same, and from there on with less and less noise assumed, down to 0.2 % body "
            "weight and 0.24 % foot length"
        ),
        "at_once": "from the same starts with that little noise assumed from the beginning",
        "alike": "how many searches ended within 2 of the lowest cost",
        "lowest": (
            "of the searches that began at one truth's starts the one with the lowest cost, as a "
            "fit takes it"
        ),
        "contained": (
            "how many of the seeds' 95 % intervals hold the truth, drawn anew for each, of all "
            "seeds and in each twenty of them"
        ),
        "share_contained": (
            "the same of all parameters that a seed identifies, and of those that it does not, "
            "whose interval is nearly the prior's; the binomial 95 % interval (Clopper-Pearson) "
            "takes them for independent, which those of one seed are not"
        ),
        "identifiable": "identified in more than half of the seeds",
        "linear": (
            "the estimate's errors if the residuals were linear about the truth: the mean over "
            "seeds of their squares in the covariance that the fit tells, which is the number of "
            "parameters if noise and covariance are right, and how many intervals then hold the "
            "truth"
        ),
    }


def recovered(truths: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Over several truths."""
    return {
        "truths": list(truths),
        **{
            way: _way([truth[way] for truth in truths])
            for way in WAYS
            if all(way in truth for truth in truths)
        },
    }


def _way(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    every = [row for way in found for row in way["searches"]]
    lowest = [way["searches"][way["best"]] for way in found]
    return {
        "searches": _rows(every) | {"at_the_lowest": sum(way["alike"] for way in found)},
        "lowest": _rows(lowest),
    }


def _rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    errors = [error for row in rows for error in row["grf_rmse_bw"]]
    return {
        "count": len(rows),
        "converged": sum(row["success"] for row in rows),
        "identified": sum(row["identified"] for row in rows),
        "within": sum(row["within"] for row in rows),
        "all_identified_within": sum(not row["outside"] for row in rows),
        "grf_rmse_bw": {"mean": float(np.mean(errors)), "worst": float(np.max(errors))},
        "evaluations": float(np.mean([row["evaluations"] for row in rows])),
    }


def covered(seeds: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Over several seeds, some twenties of them or fewer."""
    names = list(seeds[0]["parameters"])
    parameters = {name: _parameter([seed["parameters"][name] for seed in seeds]) for name in names}
    identifiable = [name for name in names if 2 * parameters[name]["identified"] > len(seeds)]
    known, wide = (
        [
            p["contained"]
            for seed in seeds
            for p in seed["parameters"].values()
            if p["identified"] is told
        ]
        for told in (True, False)
    )
    below = float(binom.cdf(ASKED - 1, SEEDS, NOMINAL))
    return {
        "seeds": len(seeds),
        "converged": sum(seed["success"] for seed in seeds),
        "parameters": parameters,
        "identifiable": identifiable,
        "fewest_contained": {
            name: min(parameters[name]["contained_in_twenties"]) for name in identifiable
        },
        "twenties_below_17": {
            "found": sum(
                count < ASKED
                for name in identifiable
                for count in parameters[name]["contained_in_twenties"]
            )
            if len(seeds) >= SEEDS
            else None,
            "expected_of_exact_intervals": below * len(identifiable) * (len(seeds) // SEEDS),
        },
        "share_contained": {"identified": counted(known), "not_identified": counted(wide)},
        "linear": {
            "mean_chi_squared": float(np.mean([seed["linear"]["chi_squared"] for seed in seeds])),
            "parameters": len(names),
            "share_contained": float(np.mean([seed["linear"]["contained"] for seed in seeds]))
            / len(names),
        },
        "noise_ratios": {
            name: float(np.mean([seed["noise_ratios"][name] for seed in seeds]))
            for name in seeds[0]["noise_ratios"]
        },
        "not_at_the_minimum_of_the_truth": sum(
            seed["cost"] > seed["cost_from_truth"] + 2.0 for seed in seeds
        ),
        "evaluations": float(np.mean([seed["evaluations"] for seed in seeds])),
    }


def _parameter(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    contained = [bool(row["contained"]) for row in rows]
    off = np.array([row["off_in_standard_errors"] for row in rows])
    return {
        "identified": sum(row["identified"] for row in rows),
        "contained": sum(contained),
        "contained_of_identified": sum(row["contained"] for row in rows if row["identified"]),
        "contained_in_twenties": [
            sum(contained[i : i + SEEDS]) for i in range(0, len(rows), SEEDS)
        ],
        "rms_off_in_standard_errors": float(np.sqrt(np.mean(off**2))),
        "mean_share_of_prior": float(np.mean([row["share_of_prior"] for row in rows])),
    }


def text(results: Mapping[str, Any]) -> str:
    """A few lines for the screen."""
    lines = []
    for name, found in results["recovery"].items():
        for way in (way for way in WAYS if way in found):
            for kind in ("searches", "lowest"):
                row = found[way][kind]
                lines.append(
                    (
                        f"{name:11} {way:13} {kind:8} {row['count']:3d}: {row['within']} of "
                        f"{row['identified']} identified within 2 s.e., GRF "
                        f"{100 * row['grf_rmse_bw']['mean']:.3f}, at worst "
                        f"{100 * row['grf_rmse_bw']['worst']:.3f} % BW, {row['evaluations']:.0f} "
                        "evaluations"
                    )
                    + (f", {row['at_the_lowest']} at the lowest" if "at_the_lowest" in row else "")
                )
    for name, found in results["intervals"].items():
        (known, wide), linear = found["share_contained"].values(), found["linear"]
        low, high = known["binomial_95"]
        lines.append(
            f"{name}: {found['seeds']} seeds, 95 % intervals hold the truth in {known['held']} "
            f"of {known['n']} that are identified (binomial 95 %: {100 * low:.0f} to "
            f"{100 * high:.0f} %) and in {wide['held']} of {wide['n']} that are not; if linear "
            f"{100 * linear['share_contained']:.1f} %, chi-squared "
            f"{linear['mean_chi_squared']:.1f} of {linear['parameters']}"
        )
        for parameter in found["identifiable"]:
            row = found["parameters"][parameter]
            lines.append(
                f"    {parameter:32} identified {row['identified']:3d}, contained "
                f"{', '.join(map(str, row['contained_in_twenties']))}, rms "
                f"{row['rms_off_in_standard_errors']:.2f} s.e."
            )
    return "\n".join(lines)
