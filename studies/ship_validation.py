"""Makes data/validation again: which settings can be distinguished, and what of the model's
uncertainty matters, of the embedded study.

`vsf-drake validate` shows both on its page, with their date, where its inputs are these. Of trials
of your own the same is computed, and the answer printed: name them, with the contact that
`vsf-drake fit` made of others. Some five minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import hashes
from shipped_sections.sensitivity import sensitivity_section
from shipped_sections.settings import settings_section

from vsf_drake.base.files import read_json, resource, write_json
from vsf_drake.validation.options import StudyOptions
from vsf_drake.validation.run import LONG, SHIPPED, Finished, SectionStore, shipped_key
from vsf_drake.validation.study import Section, Study, make_study
from vsf_drake.walks.embedded import embedded_bench, embedded_contact, embedded_trials

TIER = "laboratory"
SECTIONS: dict[str, Callable[..., Section[Any]]] = {
    "settings": settings_section,
    "sensitivity": sensitivity_section,
}


def main() -> None:
    """Computes what does not fit the present inputs and sources."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trials", type=Path, nargs="*", help="manifests; the embedded ones if none")
    parser.add_argument("--contact", type=Path, help="fitted contact of these trials")
    parser.add_argument("--out", type=Path, help=f"folder to write to; {SHIPPED} unless given")
    parser.add_argument("--quick", action="store_true", help="the short form; needs --out")
    arguments = parser.parse_args()
    if (arguments.quick or arguments.trials) and not arguments.out:
        parser.error("other walks or fewer must not replace what the package has: give --out")
    options = StudyOptions(quick=arguments.quick)
    if arguments.trials:
        study = make_study(arguments.trials, contact=arguments.contact, options=options)
    else:
        study = embedded(options)
    store = SectionStore(arguments.out or resource(SHIPPED), shipped_key(study))
    sources = made_by(Path(__file__).name)
    for name, make in SECTIONS.items():
        if fits(store, name, sources):
            print(f"{name}: there already")
            continue
        began = time.perf_counter()
        section = make(study)
        wall_s = time.perf_counter() - began
        store.write(name, Finished(section=section, wall_s=wall_s))
        note(store, name, study, sources)
        print(f"{name}: {wall_s:.0f} s. {getattr(section.table, 'answer', '')}")


def embedded(options: StudyOptions) -> Study:
    """The study that `vsf-drake validate` makes of the embedded walks."""
    return make_study(
        embedded_trials(TIER, quick=options.quick),
        contact=embedded_contact(TIER),
        bench=embedded_bench(),
        options=options,
    )


def fits(store: SectionStore, name: str, sources: dict[str, str]) -> bool:
    """Whether the section is there, of the same inputs and sources."""
    if store.read(name, LONG[name]) is None:
        return False
    of = read_json(store.folder / f"{name}.json").get("provenance", {}).get("sources", {})
    return bool(of.get("sha256") == sources["sha256"])


def note(store: SectionStore, name: str, study: Study, sources: dict[str, str]) -> None:
    """Beside the section, for `check_stored.py`: the files and sources that it comes from."""
    inputs = {name: sha for walk in study.walks for name, sha in hashes(walk.recorded).items()}
    path = store.folder / f"{name}.json"
    about = {"provenance": {"inputs_sha256": inputs, "sources": sources}}
    write_json(path, read_json(path) | about, sort=False)


if __name__ == "__main__":
    main()
