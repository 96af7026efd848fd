"""A folder of results with a page: whether it may be written to, and its table and arrays read back."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.json_file import read_json
from vsf_drake.npz_file import read_npz
from vsf_drake.simulation.archive import check_target

Known = Callable[[Mapping[str, Any]], bool]
"""Whether a JSON table is one of these results."""


def check_report_folder(
    out: Path, kind: str, *, table: str, files: Iterable[str], folders: Iterable[str], known: Known,
    unfinished: Callable[[Path], bool] = lambda out: False
) -> None:
    """Whether results of this `kind` can go to `out`: a new or empty folder, or that of earlier ones.

    Args:
        table: name of their JSON file. files, folders: what else they write.
        unfinished: whether a folder without a table is that of an interrupted run.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_target(out, kind, lambda out: holds(out / table, known) or unfinished(out),
                 names=(table, *files, *(f"{folder}/*" for folder in folders)))
    if out.is_dir() and not os.access(out, os.W_OK | os.X_OK):
        raise InputError(f"cannot be written ({os.strerror(errno.EACCES)})", file=out, right="Choose another folder")


def holds(path: Path, known: Known) -> bool:
    """Whether there is such a table, be it damaged."""
    try:
        return known(read_json(path))
    except InputError:
        return path.is_file()


def read_table(path: Path, known: Known, *, kind: str, command: str) -> dict[str, Any]:
    """The JSON table of a `kind` of results, which `vsf-drake COMMAND --out` wrote.

    Raises:
        InputError: it is missing, damaged, or another table.
    """
    right = f"Name the folder that `vsf-drake {command} --out` wrote"
    table = read_json(path, right=right, damaged=f"Run `vsf-drake {command}` again")
    if not known(table):
        raise InputError(f"is not the table of a {kind}", file=path, right=right)
    return table


def read_arrays(path: Path, table: Mapping[str, Any], *, named: str, command: str) -> dict[str, np.ndarray]:
    """The arrays that belong to a table: those whose SHA-256 it has; `named` is its file.

    Raises:
        InputError: the file is missing or damaged, or another than the table describes.
    """
    right = f"Run `vsf-drake {command}` again"
    if sha256(path) != table.get("arrays_sha256"):
        raise InputError(f"is not the file that {named} describes (its SHA-256 differs)", file=path, right=right)
    return read_npz(path, right=right)
