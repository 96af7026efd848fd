"""Which published effects of stiffness the model reproduces, contradicts, or cannot say: one
verdict a measure.

As `vsf-drake validate --against published`: the foot under one load, and the embedded walks
(SYNTHETIC, three at each of three settings, with their fitted contact), each with its own motion
and adapting, are held against data/published/stiffness_effects.csv. Own motion of a SYNTHETIC
person is no adaptation of a person, and never counted; nor is a sign of strides that adapt which
the foot has under an equal load with nobody on it. The results are in
studies/results/published_trends.json; the whole takes some ten minutes.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import DATA, RESULTS, hashes

from vsf_drake.base.files import plain, resource, sha256, write_json
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.validation.published_trends import published_trends
from vsf_drake.validation.study import Study, StudyOptions, make_study
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.published import TABLE


def embedded(*, quick: bool) -> Study:
    """The walks of the exact tier with their fitted contact."""
    return make_study(
        embedded_trials("exact", quick=quick),
        contact=embedded_contact("exact"),
        options=StudyOptions(quick=quick),
    )


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
    table = published_trends(embedded(quick=arguments.quick))
    for row in table.rows:
        counted = "aside" if row.aside else ""
        print(
            f"{row.verdict:13}{counted:6}{row.way:12}{row.source:28}{row.measure:32}{row.published:28}{row.model}"
        )
    for size in table.sizes:
        print(
            f"{size.measure:32}{size.source:28}{size.published:+9.3g} {size.unit:14} load "
            f"{size.load} level 2 {size.level_2}"
        )
    for one in table.measures:
        print(
            f"{one.verdict:13}{one.measure:36}{one.published:8} load {one.load:2} level 2 "
            f"{one.level_2:2} {', '.join(one.by)}: {one.reason}"
        )
    print(", ".join(f"{count} {verdict}" for verdict, count in table.counts.items()))
    for why in table.missing:
        print(why)
    arguments.out.mkdir(parents=True, exist_ok=True)
    inputs = {
        file: sha
        for path in embedded_trials("exact", quick=arguments.quick)
        for file, sha in hashes(load_trial(path)).items()
    }
    inputs |= {
        os.path.relpath(path, DATA): sha256(path)
        for path in (embedded_contact("exact"), resource(TABLE))
    }
    made = provenance(inputs) | {"sources": made_by("published_trends.py")}
    write_json(
        arguments.out / "published_trends.json", plain(table) | {"provenance": made}, sort=False
    )
    if table.missing:
        sys.exit(1)


if __name__ == "__main__":
    main()
