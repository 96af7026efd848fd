"""Which files belong together: the standing trial, the walks, their forces; and what their results are called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.errors import InputError
from vsf_drake.files import user_path

BESIDE = ("{}.mot", "{}_grf.mot", "{}.sto", "{}_grf.sto", "{}.csv", "{}_grf.csv", "{}.forces")
"""Names of a force file beside `walk.trc`, the first that exists counts; {} is the walk's name without suffix."""
RESERVED = ("subject", "model", "standing", "import")
"""Names that a result folder needs for itself."""


@dataclass(frozen=True)
class FileSet:
    """The files of one person.

    Attributes:
        standing: the standing trial; None where a walk stands for it.
        walks, forces: as many of each; None for a walk that has its forces in itself.
        standing_forces: of the standing trial, where they are in a file of their own.
        found: the force files that nobody named but that lie beside their walk.
    """

    standing: Path | None
    walks: tuple[Path, ...]
    forces: tuple[Path | None, ...]
    standing_forces: Path | None = None
    found: tuple[Path, ...] = ()

    def all(self) -> list[Path]:
        """Every file, each once."""
        named = (self.standing, self.standing_forces, *self.walks, *self.forces)
        return list(dict.fromkeys(path for path in named if path is not None))

    def notes(self, walk: Path) -> tuple[str, ...]:
        """What was assumed about the files of a walk."""
        forces = self.forces[self.walks.index(walk)]
        if forces is None or forces not in self.found:
            return ()
        return (f"Forces were taken from {forces.name}, which lies beside {walk.name}.",)


def gather(standing: Path, walks: Sequence[Path], forces: Sequence[Path] = ()) -> FileSet:
    """The files that belong together.

    Args:
        standing: the standing trial; one of `walks` where there is none.
        walks: one or more.
        forces: the walks' force files in the walks' order, or none.

    Raises:
        InputError: a file is missing, a walk is given twice, or there are not as many forces as walks.
    """
    walks = [user_path(path) for path in walks]
    forces = [user_path(path) for path in forces]
    standing = user_path(standing)
    for path in (standing, *walks, *forces):
        if not path.is_file():
            raise InputError("is a folder" if path.is_dir() else "there is no such file", file=path)
    real = [path.resolve() for path in walks]
    for number, path in enumerate(real):
        if path in real[:number]:
            raise InputError("is given twice", file=walks[number], right="Name every walk once")
    if forces and len(forces) != len(walks):
        raise InputError(f"{len(forces)} force files do not fit {len(walks)} walks", where="--forces",
                         right="Repeat --forces once for each walk, in the walks' order")
    beside = [None if forces else beside_of(path) for path in walks]
    alone = standing.resolve() in real
    return FileSet(None if alone else standing, tuple(walks), tuple(forces) if forces else tuple(beside),
                   None if alone else beside_of(standing), tuple(path for path in beside if path is not None))


def beside_of(path: Path) -> Path | None:
    """The force file beside a .trc file, if there is one."""
    if path.suffix.lower() != ".trc":
        return None
    candidates = (path.with_name(name.format(path.stem)) for name in BESIDE)
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def walk_names(walks: Sequence[Path]) -> list[str]:
    """A name for the files made from each walk: its own without suffix, made unique."""
    names: list[str] = []
    for path in walks:
        stem = "".join(c if c.isprintable() else "_" for c in path.stem) or "walk"
        if stem.casefold() in RESERVED:
            stem = f"{stem}_trial"
        name, number = stem, 2
        while name.casefold() in (n.casefold() for n in names):
            name, number = f"{stem}_{number}", number + 1
        names.append(name)
    return names
