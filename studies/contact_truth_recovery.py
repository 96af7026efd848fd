"""Whether the contact fit finds the parameters that a recording was made with, and what its
intervals are worth.

The recordings are made by the model itself, with parameters drawn from the prior of the fit.
Recovery: without noise, from five random starts each, on one trial and on two: are the parameters
that the data identify back within two standard errors, is the ground reaction force back within
0.2 % body weight? Intervals: with the noise that the fit assumes, truth and noise drawn anew for
each seed, from the middle of the prior: does the 95 % interval of each parameter that the data
identify hold the truth in at least 17 of 20? The results are in
studies/results/contact_truth_recovery.json.

Finished parts are kept: after an interruption the same command goes on where it stopped. The whole
takes some ten minutes on two free cores.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import kept, made_by
from contact_truth_study.making import Made, make
from contact_truth_study.recovering import cover, recover
from contact_truth_study.summary import covered, definitions, recovered, text
from floor_of_the_reference_subject import RESULTS, hashes
from make_reference_subject import DATA

from vsf_drake.base.files import sha256, write_json
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.model.bench_curves import load_bench_file
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.simulation.walk import Walker

PARTS = Path("results/contact_truth_recovery")
TRIALS = {"one_trial": ("low_1",), "two_trials": ("low_1", "high_1")}
TRUTHS, STARTS, SEED = 1, 5, 7
AFTER_S = 0.2
OPTIONS = ContactFitOptions(iterations=200)
INTERVALS = {"two_trials": (TRIALS["two_trials"], 1.0, 20)}
"""Trials, noise of the recordings and of the fit over the default, seeds."""


def main() -> None:
    """Fits, prints what was found and writes contact_truth_recovery.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        type=Path,
        help=f"folder for all; without it the results go to {RESULTS}, parts to {PARTS}",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="one truth, one start, two seeds, one trial; needs --out",
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the study must not replace it all: give --out")
    parts = (arguments.out or PARTS) / "parts"
    results = quick(parts) if arguments.quick else whole(parts)
    stored = arguments.out or RESULTS
    write_json(
        stored / "contact_truth_recovery.json",
        {
            "synthetic": True,
            "definitions": definitions(),
            **results,
            "provenance": {
                **provenance(input_hashes(), SEED),
                "sources": made_by("contact_truth_recovery.py"),
            },
        },
    )
    print(text(results))


def quick(parts: Path) -> dict[str, Any]:
    """A little of each."""
    one = TRIALS["one_trial"]
    return {
        "recovery": {"one_trial": recovered([recovery(parts, one, 0, starts=1, direct=False)])},
        "intervals": {"one_trial": covered([interval(parts, one, 1.0, seed) for seed in range(2)])},
    }


def whole(parts: Path) -> dict[str, Any]:
    """All of it."""
    return {
        "recovery": {
            name: recovered(
                [
                    recovery(parts, names, truth, starts=STARTS, direct=False)
                    for truth in range(TRUTHS)
                ]
            )
            for name, names in TRIALS.items()
        },
        "intervals": {
            name: covered([interval(parts, names, noise, seed) for seed in range(seeds)])
            for name, (names, noise, seeds) in INTERVALS.items()
        },
    }


def recovery(
    parts: Path, names: Sequence[str], truth: int, *, starts: int, direct: bool
) -> dict[str, Any]:
    """One truth, several starts."""
    return done(
        parts,
        f"recovery_{'_'.join(names)}_{truth}_{starts}",
        lambda: recover(
            made(names, [SEED, 0, truth], 0.0), starts=starts, seed=SEED + truth, direct=direct
        ),
    )


def interval(parts: Path, names: Sequence[str], noise: float, seed: int) -> dict[str, Any]:
    """One seed."""
    return done(
        parts,
        f"interval_{'_'.join(names)}_{noise:g}_{seed}",
        lambda: cover(made(names, [SEED, 1, seed], noise), noise),
    )


def made(names: Sequence[str], seed: Sequence[int], drawn: float) -> Made:
    """Recordings of these trials' kinematics."""
    return make(
        [trial(name) for name in names],
        load_bench_file(DATA / "bench.yaml"),
        walker(),
        seed,
        drawn=drawn,
        options=OPTIONS,
    )


def done(parts: Path, name: str, make_part: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The part, made now unless it was made before with the same inputs and the same code."""
    part, was_there = kept(parts, name, key(), make_part)
    print(f"{name}{' (kept)' if was_there else ''}", flush=True)
    return part


@cache
def trial(name: str) -> Trial:
    """Until AFTER_S past lift-off: a drawn foot that sits low must not strike a second time within
    the window."""
    whole = load_trial(DATA / "exact" / f"{name}.yaml")
    plate = whole.prosthetic_plate
    first = find_stances(plate.time_s, plate.force_W[:, 2])[0]
    return replace(whole, end_s=first.end_s + AFTER_S)


@cache
def walker() -> Walker:
    return Walker(trial("low_1").subject, trial("low_1").model)


@cache
def input_hashes() -> dict[str, str]:
    """SHA-256 of all that is read, by path in the reference subject's folder."""
    found = {"bench.yaml": sha256(DATA / "bench.yaml")}
    for name in TRIALS["two_trials"]:
        found |= hashes(trial(name))
    return found


@cache
def key() -> str:
    """Of everything that the study's numbers depend on: inputs, versions, sources of model,
    analysis and study."""
    return digest({**provenance(input_hashes()), **made_by("contact_truth_recovery.py")})


if __name__ == "__main__":
    main()
