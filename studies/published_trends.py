"""Which published effects of stiffness the model reproduces, contradicts, or cannot say.

As `vsf-drake validate --against published`: the foot under one load, and the embedded walks (SYNTHETIC, three at each
of three settings, with their fitted contact), each with its own motion and adapting, are held against
data/published/stiffness_effects.csv. Own motion of a SYNTHETIC person is no adaptation of a person. The results are in
studies/results/published_trends.json; the whole takes some five minutes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from floor_of_the_reference_subject import RESULTS

from vsf_drake.analysis.validation import (
    StudyOptions,
    embedded_contact,
    embedded_trials,
    make_study,
)
from vsf_drake.analysis.validation.published_trends import published_trends
from vsf_drake.files import plain, write_json


def main() -> None:
    """Computes, prints and stores every row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument(
        "--quick", action="store_true", help="one walk a setting, coarser steps; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and arguments.out == RESULTS:
        parser.error("a part of the study must not replace it all: give --out")
    study = make_study(
        embedded_trials("exact", quick=arguments.quick),
        contact=embedded_contact("exact"),
        options=StudyOptions(quick=arguments.quick),
    )
    table = published_trends(study)
    for row in table.rows:
        print(
            f"{row.verdict:13}{row.way:12}{row.source:28}{row.measure:32}{row.published:28}{row.model}"
        )
    print(", ".join(f"{count} {verdict}" for verdict, count in table.counts.items()))
    for why in table.missing:
        print(why)
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "published_trends.json", plain(table), sort=False)
    if table.missing:
        sys.exit(1)


if __name__ == "__main__":
    main()
