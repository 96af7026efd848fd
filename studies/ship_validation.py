"""Makes data/validation again: the sections of the embedded study that take long, which come with the package."""

from __future__ import annotations

import argparse

from vsf_drake.analysis import validation
from vsf_drake.analysis.validation.run import LONG, SHIPPED, SectionStore, run_sections, shipped_key
from vsf_drake.files import resource


def main() -> None:
    """Computes what does not fit the present inputs and sources; some minutes for all."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    study = validation.make_study(
        validation.embedded_trials(), contact=validation.embedded_contact(), bench=validation.embedded_bench(),
        options=validation.StudyOptions(full=True))
    store = SectionStore(resource(SHIPPED), shipped_key(study))
    for name, finished in run_sections(study, shipped=store, names=LONG).items():
        print(name, finished.failure or finished.computed or f"{finished.wall_s:.0f} s")
        if not finished.computed:
            store.write(name, finished)


if __name__ == "__main__":
    main()
