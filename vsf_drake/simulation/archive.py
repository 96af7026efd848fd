"""Result folders on disk: arrays in one `.npz`, everything else in a readable YAML sidecar. No pickle."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Container, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import part_of, replaced, sha256
from vsf_drake.json_file import read_json, write_json
from vsf_drake.npz_file import read_npz
from vsf_drake.schema import load_plain
from vsf_drake.yaml_file import dump

ARRAYS_FILE = "result.npz"
SIDECAR_FILE = "result.yaml"


RECORD_FILE = ".vsf_drake.json"
"""What was written to a result folder: SHA-256 by path, by kind of result."""


def check_target(out: str | Path, kind: str, known: Callable[[Path], bool] = lambda out: False) -> None:
    """Whether a result of `kind` ("walk", "bench") can go to `out`; asked before a long run rather than after it.

    Args:
        out: a new or empty folder, or one that holds an earlier result of the kind.
        kind: of result.
        known: tells whether a folder without a record (an interrupted run) is one of the kind.

    Raises:
        InputError: `out` or one of its parents is a file, cannot be created, or holds anything else.
    """
    out = Path(out).absolute()
    try:
        if out.is_symlink() and not out.exists():
            raise InputError("is a link to nothing", file=out, right="Choose another folder")
        with result_folder(out, kind, keep=False):
            pass
        others = out.is_dir() and any(not path.name.startswith(".") for path in out.iterdir())
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None
    try:
        found = load_plain(out / SIDECAR_FILE) if (out / SIDECAR_FILE).is_file() else None
    except InputError:  # a damaged one
        return
    if isinstance(found, dict) and found.get("kind") not in (None, kind):
        raise InputError(f"holds the result of a {found['kind']}", file=out,
                         right=f"Choose another folder for this {kind}")
    if others and found is None and not _recorded(out).get(kind) and not known(out):
        raise InputError(f"holds other things than an earlier {kind}", file=out, right="Choose another folder")


@contextlib.contextmanager
def result_folder(out: str | Path, kind: str, *, keep: bool = True, add: bool = False) -> Iterator[Path]:
    """A temporary folder whose content becomes that of `out` only when the block ends without an exception.

    A new `out` appears by one rename. From an existing `out` first goes what an earlier result of the kind left there
    (unless somebody changed it), then the new files come: killed in between, it holds a part of the new ones, never old
    beside new. Other files stay. After an exception (an interruption too) nothing of the block remains.

    Args:
        out: the folder to create or to fill; missing parents are created.
        kind: of result. Of another kind nothing goes but what has the same name.
        keep: false to try whether it could be written, and leave nothing.
        add: whether the earlier files of the kind stay, unless they have the same name.

    Raises:
        InputError: `out` or one of its parents is a file, or cannot be written.
    """
    out = Path(out).absolute()
    if out.exists() and not out.is_dir():
        raise InputError("is a file, but results are a folder", file=out, right="Choose another folder")
    home = out.parent
    while not home.exists():
        home = home.parent
    with part_of(out, home, Path.mkdir) as temporary:
        yield temporary
        try:
            if keep:
                _settle(temporary, out, kind, add=add)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=out) from None


def remove_result(out: Path, kind: str, names: Container[str] = ()) -> None:
    """Removes from `out` what was written there as a result of `kind` and not changed since, or has one of `names`."""
    for name, digest in _recorded(out).get(kind, {}).items():
        path = out / name
        if path.is_file() and (name in names or sha256(path) == digest):
            path.unlink()
            for folder in list(path.parents)[:len(Path(name).parents) - 1]:
                with contextlib.suppress(OSError):  # it holds something else
                    folder.rmdir()


def write_archive(folder: str | Path, arrays: Mapping[str, np.ndarray], sidecar: Mapping[str, Any]) -> None:
    """Writes `arrays` and `sidecar` (plain values) into the existing `folder`.

    The sidecar also gets the arrays' SHA-256, so that a mixed-up pair is noticed on reading.
    """
    folder = Path(folder)
    with replaced(folder / ARRAYS_FILE, "wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **dict(arrays))
    content = {**sidecar, "arrays_sha256": sha256(folder / ARRAYS_FILE)}
    with replaced(folder / SIDECAR_FILE) as stream:
        stream.write(dump(content, width=120))


def read_archive(folder: str | Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and sidecar of a result folder.

    Raises:
        InputError: a file is missing or damaged, or the two do not belong together.
    """
    path = Path(folder) / SIDECAR_FILE
    sidecar = load_plain(path, right="A result folder holds one")
    if not isinstance(sidecar, dict):
        raise InputError("does not describe a result", file=path)
    path = Path(folder) / ARRAYS_FILE
    if sha256(path) != sidecar.pop("arrays_sha256", None):
        raise InputError(f"is not the file that {SIDECAR_FILE} describes (its SHA-256 differs)", file=path)
    return read_npz(path), sidecar


def _settle(source: Path, target: Path, kind: str, *, add: bool) -> None:
    """Makes `source` the folder `target`, or fills that with its files; see `result_folder`."""
    new = {path.relative_to(source).as_posix(): sha256(path) for path in sorted(source.rglob("*"))
           if path.is_file() and path != source / RECORD_FILE}
    if not target.exists():
        _write_record(source, {kind: new})
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
        return
    for name in new:
        if (target / name).is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    record = _recorded(target)
    old = record.get(kind, {})
    _write_record(target, record | {kind: old | new})
    if not add:
        remove_result(target, kind, new)
    for name in new:
        (target / name).unlink(missing_ok=True)
    for folder in sorted(path for path in source.rglob("*") if path.is_dir()):
        (target / folder.relative_to(source)).mkdir(exist_ok=True)
    for name in new:
        os.replace(source / name, target / name)
    _write_record(target, record | {kind: old | new if add else new})


def _write_record(folder: Path, record: Mapping[str, Mapping[str, str]]) -> None:
    write_json(folder / RECORD_FILE, record)


def _recorded(folder: Path) -> dict[str, dict[str, str]]:
    """SHA-256 by path within `folder`, by kind; nothing that leads out of it."""
    try:
        found = read_json(folder / RECORD_FILE)
        return {kind: {name: digest for name, digest in files.items()
                       if (folder / name).resolve().is_relative_to(folder.resolve())} for kind, files in found.items()}
    except (InputError, OSError, TypeError, AttributeError):
        return {}
