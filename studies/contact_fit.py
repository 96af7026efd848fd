"""What the contact fit is worth on the nine walks of the synthetic reference subject, whose truth
is another model.

In both tiers: the joint fit of one soft and one stiff trial, judged by the other seven, by a sweep
of the fulcrum, by the bench, and by the other eight pairs like it; the joint fit of one trial, also
without the bench, of a device that nobody calibrated, and by the resultant alone; and the paper's
procedure. All are judged by all other trials. Beside each error stand the null model and the floor:
what the true foot itself is left with on the recorded motion. The results are in
studies/results/contact_fit.json.

Finished parts are kept in the folder for figures: after an interruption the same command goes on
where it stopped. The whole takes half an hour on two free cores.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.cases import TIERS, Case, cases, transfer
from contact_fit_study.figures import figures
from contact_fit_study.inputs import input_hashes, key
from contact_fit_study.keeping import kept, made_by
from contact_fit_study.results import definitions, pair_results, tier_results
from contact_fit_study.running import SEED, run, warm_up
from contact_fit_study.table import text_table
from floor_of_the_reference_subject import RESULTS

from vsf_drake.base.files import write_json
from vsf_drake.report import style as look
from vsf_drake.simulation.archive import provenance

FIGURES = Path("results/contact_fit")


def main() -> None:
    """Fits, prints the targets beside what was reached, writes contact_fit.json and the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        type=Path,
        help=f"folder for all; without it the results go to {RESULTS}, parts and "
        f"figures to {FIGURES}",
    )
    parser.add_argument(
        "--quick", action="store_true", help="one pair, one start, the exact tier; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the study must not replace it all: give --out")
    shown = arguments.out or FIGURES
    shown.mkdir(parents=True, exist_ok=True)
    results = quick(shown / "parts") if arguments.quick else whole(shown / "parts")
    stored = arguments.out or RESULTS
    write_json(
        stored / "contact_fit.json",
        {
            "synthetic": True,
            "definitions": definitions(),
            **results,
            "provenance": {
                **provenance(input_hashes(), SEED),
                "sources": made_by("contact_fit.py"),
            },
        },
    )
    with look.style():
        for name, figure in figures(results).items():
            look.save_figure(figure, shown / name)
    print(text_table(results))


def quick(parts: Path) -> dict[str, Any]:
    """One pair from one start."""
    case = transfer(TIERS[0], starts=1)
    return {case.tier: pair_results(done(case, parts))}


def whole(parts: Path) -> dict[str, Any]:
    """Every case of both tiers."""
    for tier in TIERS:
        warm_up(tier)
        every = cases(tier)
        for i, case in enumerate(every, 1):
            began = time.perf_counter()
            part = done(case, parts)
            print(
                f"{i:3d}/{len(every)} {case.name:<58} {told(part)} "
                f"({time.perf_counter() - began:.0f} s)",
                flush=True,
            )
    return {tier: tier_results(tier, lambda case: done(case, parts)) for tier in TIERS}


def done(case: Case, parts: Path) -> dict[str, Any]:
    """The case's part, made now unless it was made before with the same inputs and the same
    code."""
    part, _ = kept(parts, case.name, key(), lambda: run(case))
    return part


def told(part: dict[str, Any]) -> str:
    """A line on a finished part."""
    if "failed" in part:
        return f"FAILED: {part['failed']}"
    held = [part["trials"][name]["grf_rmse_bw"] for name in part["held_out"]]
    own = [part["trials"][name]["grf_rmse_bw"] for name in part["fitted"]]
    return (
        f"fitted {100 * sum(own) / len(own):5.2f}, held out {100 * sum(held) / len(held):5.2f} % "
        f"BW, bench {part['bench']['rmse_n_per_mm']:5.2f} N/mm, fit "
        f"{part['time']['wall_s']:4.0f} s"
    )


if __name__ == "__main__":
    main()
