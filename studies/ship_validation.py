"""Makes data/validation again: the sections of the embedded study that take long, which come with
the package."""

from __future__ import annotations

import argparse
from pathlib import Path

from vsf_drake import validation
from vsf_drake.base.files import resource
from vsf_drake.validation.run import LONG, SHIPPED, SectionStore, run_sections, shipped_key
from vsf_drake.walks import embedded


def main() -> None:
    """Computes what does not fit the present inputs and sources; some minutes for all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help=f"folder to write to; {SHIPPED} unless given")
    parser.add_argument(
        "--quick", action="store_true", help="name the sections that fit, compute none"
    )
    arguments = parser.parse_args()
    study = validation.make_study(
        embedded.embedded_trials(),
        contact=embedded.embedded_contact(),
        bench=embedded.embedded_bench(),
        options=validation.StudyOptions(full=not arguments.quick),
    )
    key = shipped_key(study)
    shipped, written = (
        SectionStore(resource(SHIPPED), key),
        SectionStore(arguments.out or resource(SHIPPED), key),
    )
    for name, finished in run_sections(study, shipped=shipped, names=LONG).items():
        print(name, finished.failure or finished.computed or f"{finished.wall_s:.0f} s")
        if not finished.computed:
            written.write(name, finished)


if __name__ == "__main__":
    main()
