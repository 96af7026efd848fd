"""Runs the sections of the validation one after the other; what is finished survives an interruption."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from vsf_drake.analysis.validation.bench_section import bench_section
from vsf_drake.analysis.validation.energy_section import energy_section
from vsf_drake.analysis.validation.roll_over_section import roll_over_section
from vsf_drake.analysis.validation.sensitivity_section import sensitivity_section
from vsf_drake.analysis.validation.settings_section import settings_section
from vsf_drake.analysis.validation.standing_section import standing_section
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.analysis.validation.walking_section import walking_section
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.files import plain, read_json, read_npz, replaced, sha256, write_json
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.cases import digest, software

EXACT = "walking_exact"
"""The walking section of a second study: the same walks without errors of measurement."""
_SECTIONS: dict[str, tuple[Callable[..., Section], float]] = {
    "bench": (bench_section, 10.0), "standing": (standing_section, 10.0), "walking": (walking_section, 20.0),
    "energy": (energy_section, 30.0), "roll_over": (roll_over_section, 30.0), "settings": (settings_section, 90.0),
    "sensitivity": (sensitivity_section, 180.0)}
"""By name: what computes it, and about how long that takes (s), which only the progress depends on."""
NAMES = (*_SECTIONS, EXACT)
_PACKAGE = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, kw_only=True, eq=False)
class Finished:
    """A section with how long it took (s); `section` is None if it failed, and `failure` says why."""

    section: Section | None
    wall_s: float
    failure: str = ""


def run_sections(
    study: Study, *, exact: Study | None = None, folder: str | Path | None = None, progress: Progress | None = None
) -> dict[str, Finished]:
    """Every section of the validation, by name.

    A section that fails (a bench that gives way, a simulation that diverges) is named with the reason and stops no
    other.

    Args:
        exact: the same walks without errors of measurement, where there are such.
        folder: where finished sections are kept, so that an interrupted run of the same study goes on.
        progress: called with what is being done and the finished fraction of everything.
    """
    plan = [(name, make, weight, study) for name, (make, weight) in _SECTIONS.items()]
    if exact is not None:
        plan.append((EXACT, *_SECTIONS["walking"], exact))
    total, before, finished = sum(weight for _, _, weight, _ in plan), 0.0, {}
    for name, make, weight, own in plan:
        def show(what: str, fraction: float, name: str = name, before: float = before, weight: float = weight) -> None:
            if progress:
                progress(f"{name.replace('_', ' ')}: {what}", (before + weight * min(max(fraction, 0.0), 1.0)) / total)

        before += weight
        store = None if folder is None else SectionStore(Path(folder), study_key(own))
        kept = store.read(name) if store else None
        if kept is not None:
            finished[name] = Finished(section=kept[0], wall_s=kept[1])
            continue
        show("starting", 0.0)
        began = time.perf_counter()
        try:
            section = make(own, progress=show)
        except (InputError, SimulationError, FitError) as error:
            finished[name] = Finished(section=None, wall_s=time.perf_counter() - began, failure=str(error))
            continue
        finished[name] = Finished(section=section, wall_s=time.perf_counter() - began)
        if store:
            store.write(name, section, finished[name].wall_s)
    return finished


def study_key(study: Study) -> str:
    """Of all that a section's numbers depend on: files, contact, options, software; not the number of workers."""
    options = to_plain(study.options)
    options.pop("workers", None)
    sources = hashlib.sha256()
    for file in sorted((_PACKAGE / "analysis").rglob("*.py")):
        sources.update(f"\0{file.relative_to(_PACKAGE).as_posix()}\0".encode() + file.read_bytes())
    return digest({
        "inputs": dict(study.inputs), "walks": [(walk.label, walk.role) for walk in study.walks],
        "failed": [list(pair) for pair in study.failed], "options": options, "model": to_plain(study.model),
        "contact": None if study.contact is None else study.contact.values, "bench_problem": study.bench_problem,
        "software": software(), "spm1d": find_spec("spm1d") is not None, "analysis_sha256": sources.hexdigest()})


class SectionStore:
    """A folder of finished sections of an unfinished validation, each complete or not there.

    Args:
        folder: created when the first section is written.
        key: see `study_key`; what another key left is not read.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self.folder, self.key = folder, key

    def read(self, name: str) -> tuple[Section, float] | None:
        """The section and how long it took (s); None if it is not there, damaged, or of another key."""
        path = self.folder / f"{name}.json"
        try:
            found = read_json(path)
            if found["key"] != self.key or found["arrays_sha256"] != sha256(path.with_suffix(".npz")):
                return None
            section = Section(table=found["table"], arrays=read_npz(path.with_suffix(".npz")),
                              missing=tuple(found["missing"]))
            return section, float(found["wall_s"])
        except (ValueError, TypeError, KeyError, InputError):
            return None

    def write(self, name: str, section: Section, wall_s: float) -> None:
        """Keeps a finished section.

        Raises:
            InputError: the folder cannot be written.
        """
        arrays = self.folder / f"{name}.npz"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with replaced(arrays, "wb", lasting=True) as stream:
                np.savez_compressed(stream, allow_pickle=False, **section.arrays)
            write_json(self.folder / f"{name}.json", {
                "key": self.key, "table": plain(section.table), "missing": list(section.missing), "wall_s": wall_s,
                "arrays_sha256": sha256(arrays)}, sort=False)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=self.folder) from None

    def remove(self, names: Iterable[str]) -> None:
        """Takes away these sections, and the folder if nothing else is in it."""
        names = frozenset(names)
        with contextlib.suppress(OSError):
            for path in [path for path in self.folder.iterdir() if is_kept(path, names)]:
                path.unlink()
            self.folder.rmdir()


def is_kept(path: Path, names: Container[str]) -> bool:
    """Whether a file of a store's folder is of one of these sections, complete or not."""
    return path.suffix in (".json", ".npz", ".part") and path.name.lstrip(".").partition(".")[0] in names
