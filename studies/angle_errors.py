"""What the embedded contact is worth where hip and knee angles repeat from walk to walk no better
than people's.

The contact that comes with the package was fitted to two of the reference subject's nine walks of
the laboratory tier. Each walk is walked again with errors of hip and knee of its own
(`vsf_drake.walks.angle_errors`): the held-out ones in layers, as `vsf-drake fit` judges them,
all by the physics alone, as the page of `vsf-drake validate` shows them. The errors hang on a
walk's name, so fit, page and this study draw the same. README and guides quote the numbers that
stand in studies/results/angle_errors.json. `other_draws` has the held-out walks by the physics with
other seeds, which tells how far the mean of so few draws is known; `one` has the held-out walk
`medium_2` by itself. Some three minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import RESULTS, hashes

from vsf_drake.base.files import plain, sha256, write_json
from vsf_drake.fit.assessment import HELD_OUT
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.simulation.archive import provenance
from vsf_drake.validation.study import Study, StudyOptions, make_study
from vsf_drake.walks.angle_errors import DRAWS, AngleErrorRow, JudgedTrial, angle_error_rows
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

TIER, ONE = "laboratory", "medium_2"
OTHER_SEEDS = (1, 2, 3)


def main() -> None:
    """Walks, prints the held-out walks' errors and writes angle_errors.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick is given"
    )
    parser.add_argument(
        "--quick", action="store_true", help="one walk, by the physics; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the walks must not replace them all: give --out")
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    study = embedded((ONE,) if arguments.quick else ())
    rows = () if arguments.quick else disturbed(study, contact=study.contact)
    others = (
        {}
        if arguments.quick
        else {
            seed: [row for row in disturbed(study, seed=seed) if row.role == HELD_OUT]
            for seed in OTHER_SEEDS
        }
    )
    for row in rows:
        print(
            f"{row.role:<10}{row.layer:<14}{row.sd_deg:>6g} deg{row.walks:>4} "
            f"walks{100 * (row.grf_rmse_bw or float('nan')):>7.1f} % BW{row.beats_null:>4} of "
            f"{row.beats_null_of}"
        )
    inputs = {f"{TIER}/contact.yaml": sha256(embedded_contact(TIER))}
    for walk in study.walks:
        inputs |= hashes(walk.recorded)
    write_json(
        out / "angle_errors.json",
        {
            "synthetic": True,
            "draws": DRAWS,
            "rows": plain(rows),
            "one": plain(disturbed(study, (ONE,))),
            "other_draws": {f"seed {seed}": plain(found) for seed, found in others.items()},
            "provenance": {**provenance(inputs, 0), "sources": made_by("angle_errors.py")},
        },
    )


def embedded(names: Sequence[str] = ()) -> Study:
    """The embedded walks of TIER, or those of these names, with their contact."""
    trials = [path for path in embedded_trials(TIER) if not names or path.stem in names]
    return make_study(trials, contact=embedded_contact(TIER), options=StudyOptions())


def disturbed(
    study: Study, names: Sequence[str] = (), *, contact: FittedContact | None = None, seed: int = 0
) -> tuple[AngleErrorRow, ...]:
    """The rows of all walks, or of those of these names; with a contact the held-out ones in
    layers, too."""
    return angle_error_rows(
        [
            JudgedTrial(walk.trial, walk.role, walk.metrics.null_model_grf_rmse_bw)
            for walk in study.walks
            if not names or walk.label in names
        ],
        step_s=study.options.step_s,
        seed=seed,
        contact=contact,
        in_layers=HELD_OUT,
    )


if __name__ == "__main__":
    main()
