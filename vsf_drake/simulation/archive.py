"""Result folders on disk: arrays in one `.npz`, everything else in a readable YAML sidecar. No pickle."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256
from vsf_drake.npz_file import read_npz
from vsf_drake.schema import load_plain
from vsf_drake.yaml_file import dump

ARRAYS_FILE = "result.npz"
SIDECAR_FILE = "result.yaml"


def check_target(out: str | Path, kind: str) -> None:
    """Whether a result of `kind` ("walk", "bench") can go to `out`; asked before a long run rather than after it.

    Raises:
        InputError: `out` or one of its parents is a file, cannot be created, or holds a result of another kind.
    """
    out = Path(out).absolute()
    try:
        if out.is_symlink() and not out.exists():
            raise InputError("is a link to nothing", file=out, right="Choose another folder")
        with result_folder(out, keep=False):
            pass
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None
    try:
        found = load_plain(out / SIDECAR_FILE)
    except InputError:  # none, or a damaged one
        return
    if isinstance(found, dict) and found.get("kind") not in (None, kind):
        raise InputError(f"holds the result of a {found['kind']}", file=out,
                         right=f"Choose another folder for this {kind}")


@contextlib.contextmanager
def result_folder(out: str | Path, *, keep: bool = True) -> Iterator[Path]:
    """A temporary folder whose content becomes that of `out` only when the block ends without an exception.

    A new `out` appears by one rename. In an existing `out` each file replaces its namesake at the
    end and other files stay. After an exception (an interruption too) nothing of the block remains.

    Args:
        out: the folder to create or to fill; missing parents are created.
        keep: false to try whether it could be written, and leave nothing.

    Raises:
        InputError: `out` or one of its parents is a file, or cannot be written.
    """
    out = Path(out).absolute()
    if out.exists() and not out.is_dir():
        raise InputError("is a file, but results are a folder", file=out, right="Choose another folder")
    home = out.parent
    while not home.exists():
        home = home.parent
    temporary = home / f".{out.name}.{secrets.token_hex(4)}.part"
    try:
        temporary.mkdir()
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None
    try:
        yield temporary
        try:
            if keep:
                _move(temporary, out)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=out) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


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


def _move(source: Path, target: Path) -> None:
    """Renames `source` to `target`, or merges it file by file into an existing folder."""
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
        return
    for item in sorted(source.iterdir()):
        if item.is_dir() and (target / item.name).is_dir():
            _move(item, target / item.name)
        else:
            os.replace(item, target / item.name)
