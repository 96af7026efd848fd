"""Finished sections of an unfinished validation on disk, each complete or not there."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Container, Iterable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from vsf_drake.analysis.validation.study import Section, Study
from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256
from vsf_drake.json_file import plain, read_json, write_json
from vsf_drake.npz_file import read_npz
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.cases import digest, software

PACKAGE = Path(__file__).resolve().parents[2]


def study_key(study: Study) -> str:
    """Of all that a section's numbers depend on: files, contact, options, software; not the number of workers."""
    options = to_plain(study.options)
    options.pop("workers", None)
    sources = hashlib.sha256()
    for file in sorted((PACKAGE / "analysis").rglob("*.py")):
        sources.update(f"\0{file.relative_to(PACKAGE).as_posix()}\0".encode() + file.read_bytes())
    return digest({
        "inputs": dict(study.inputs), "walks": [(walk.label, walk.role) for walk in study.walks],
        "failed": [list(pair) for pair in study.failed], "options": options, "model": to_plain(study.model),
        "contact": None if study.contact is None else study.contact.values, "bench_problem": study.bench_problem,
        "software": software(), "spm1d": find_spec("spm1d") is not None, "analysis_sha256": sources.hexdigest()})


class SectionStore:
    """A folder of finished sections that belong to one key.

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
