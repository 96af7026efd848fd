"""Folders of results on disk: whole or not at all, and never a mixture of two runs; which software
made them."""

from __future__ import annotations

import contextlib
import os
import platform
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import MOST_FILE_BYTES, part_of, read_json, sha256, write_json
from vsf_drake.base.schema import load_plain

SIDECAR_FILE = "result.yaml"
# what was written to a result folder: SHA-256 by path, by kind of result
RECORD_FILE = ".vsf_drake.json"
_KINDS = (".yaml", ".json", ".npz", ".html", ".mot", ".png", ".svg")  # of files that tables name


def check_target(
    out: str | Path,
    kind: str,
    known: Callable[[Path], bool] = lambda out: False,
    *,
    names: Iterable[str] = (),
    sidecar: str = SIDECAR_FILE,
) -> None:
    """InputError unless a result of `kind` ("walk", "bench") can go to `out`; asked before a long
    run, not after it.

    It can go to a new or empty folder, or one that holds an earlier result of the kind; `known`
    tells whether a folder without a record (an interrupted run) does. Nothing in it may be in the
    way of files of `names`, nor lead out of it. `sidecar` is the YAML file that says the kind.
    """
    out = Path(out).absolute()
    try:
        if out.is_symlink() and not out.exists():
            raise InputError("is a link to nothing", file=out, right="Choose another folder")
        with result_folder(out, kind, keep=False):
            pass
        record = _recorded(out).get(kind, {})
        _check_places(out, [*names, *record])
        others = out.is_dir() and any(not path.name.startswith(".") for path in out.iterdir())
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None
    earlier = None
    if (out / sidecar).is_file():
        with contextlib.suppress(InputError):  # a damaged one, or another program's
            earlier = load_plain(out / sidecar)
    earlier = earlier.get("kind") if isinstance(earlier, dict) else None
    if earlier not in (None, kind):
        raise InputError(
            f"holds the result of a {earlier}",
            file=out,
            right=f"Choose another folder for this {kind}",
        )
    if others and earlier is None and not record and not known(out):
        raise InputError(
            f"holds other things than an earlier {kind}", file=out, right="Choose another folder"
        )


@contextlib.contextmanager
def result_folder(
    out: str | Path, kind: str, *, keep: bool = True, add: bool = False, stale: Iterable[str] = ()
) -> Iterator[Path]:
    """A temporary folder whose content becomes that of `out` only when the block ends without an
    exception.

    A new `out` appears by one rename. From an existing `out` first goes what an earlier result of
    the kind left there (unless somebody changed it), then the new files come; Ctrl-C, SIGTERM and
    SIGHUP wait until they have. Killed in between, it holds a part of the new ones, never old
    beside new, and the next run of the kind clears it. Other files stay. After an exception nothing
    of the block remains.

    Args:
        kind: of result. Of another kind nothing goes but what has the same name.
        keep: false to try whether it could be written, and leave nothing.
        add: whether the earlier files of the kind stay, unless they have the same name.
        stale: patterns of names of what goes from a folder without a record, as earlier versions
            left it.

    Raises:
        InputError: it cannot be written, or something in it is in the way or leads out of it;
            nothing has changed.
    """
    out = Path(out).absolute()
    if out.exists() and not out.is_dir():
        raise InputError(
            "is a file, but results are a folder", file=out, right="Choose another folder"
        )
    if out.is_dir():  # perhaps on another file system than its parent
        home = out = Path(os.path.realpath(out))
    else:
        home = next(folder for folder in out.parents if folder.exists())
    with part_of(out, home, Path.mkdir) as temporary:
        try:
            yield temporary
            if keep:
                with _undisturbed():
                    _settle(temporary, out, kind, add=add, stale=stale)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=out) from None


def remove_result(
    out: Path, kind: str, names: Iterable[str] = (), *, stale: Iterable[str] = ()
) -> None:
    """Removes from `out` what was written there as a result of `kind` and not changed since, and
    files of `names`; `stale` as for `result_folder`."""
    for name, digest in {**_earlier(out, kind, stale), **dict.fromkeys(names)}.items():
        path = out / name
        if (
            path.is_file()
            and _inside(path, out)
            and (
                digest is None
                or (path.stat().st_size <= MOST_FILE_BYTES and digest == sha256(path))
            )
        ):
            path.unlink()
            for folder in _folders(out, name):
                with contextlib.suppress(OSError):  # it holds something else
                    folder.rmdir()


def _settle(source: Path, target: Path, kind: str, *, add: bool, stale: Iterable[str]) -> None:
    """Makes `source` the folder `target`, or fills that with its files; see `result_folder`."""
    new = {
        path.relative_to(source).as_posix(): sha256(path)
        for path in sorted(source.rglob("*"))
        if path.is_file() and path != source / RECORD_FILE
    }
    if not target.exists():
        write_json(source / RECORD_FILE, {kind: new})
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
        return
    _check_places(target, [RECORD_FILE, *new])
    record = _recorded(target)
    old = _earlier(target, kind, stale)
    write_json(target / RECORD_FILE, record | {kind: old | new})
    if not add:
        remove_result(target, kind, new)
    for folder in sorted(path for path in source.rglob("*") if path.is_dir()):
        (target / folder.relative_to(source)).mkdir(exist_ok=True)
    for name in new:
        os.replace(source / name, target / name)
    write_json(target / RECORD_FILE, record | {kind: old | new if add else new})


def _check_places(out: Path, names: Iterable[str]) -> None:
    """Raises InputError unless files of `names` can be renamed to what they are called in `out`."""
    for name in names:
        path = out / name
        right = "Choose another folder"
        if not _inside(path, out):
            raise InputError(f"leads out of {out}", file=path, right=right)
        if path.is_dir():
            raise InputError("cannot be written (it is a folder)", file=path, right=right)
        for folder in _folders(out, name):
            if folder.exists() and not folder.is_dir():
                raise InputError("cannot be written (it is a file)", file=folder, right=right)
            if folder.exists() and folder.stat().st_dev != out.stat().st_dev:
                raise InputError(f"is on another file system than {out}", file=folder, right=right)


def _inside(path: Path, out: Path) -> bool:
    """Whether `path` lies in `out` after all links."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(out))


def _folders(out: Path, name: str) -> list[Path]:
    """The folders between `out` and a file in it, the innermost first."""
    return list((out / name).parents)[: len(Path(name).parents) - 1]


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Signals that end a program wait until the block has ended (in the main thread, which handles
    them)."""
    came: list[int] = []
    before = (
        {}
        if threading.current_thread() is not threading.main_thread()
        else {
            each: signal.getsignal(each)
            for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
            if signal.getsignal(each) not in (None, signal.SIG_IGN)
        }
    )
    try:
        for each in before:
            signal.signal(each, lambda number, frame: came.append(number))
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
        for number in came[:1]:
            signal.raise_signal(number)


def _recorded(folder: Path) -> dict[str, dict[str, str | None]]:
    """SHA-256 by path within `folder`, by kind; None for what goes even if it was changed."""
    try:
        return {kind: {**files} for kind, files in read_json(folder / RECORD_FILE).items()}
    except (InputError, TypeError):
        return {}


def _earlier(out: Path, kind: str, stale: Iterable[str] = ()) -> dict[str, str | None]:
    """What is recorded of `kind`; without a record what its table names as its own, and what
    matches `stale`."""
    if record := _recorded(out).get(kind):
        return record
    names = [path.relative_to(out).as_posix() for pattern in stale for path in out.glob(pattern)]
    with contextlib.suppress(InputError, KeyError, TypeError):
        table = read_json(out / f"{kind}.json")
        names += [
            name
            for name in table["files"]
            if table["kind"] == kind and Path(name).name == name and Path(name).suffix in _KINDS
        ]
    return dict.fromkeys(names)


# Which software made a result.


def provenance(inputs: dict[str, str] | None = None, seed: int | None = None) -> dict[str, Any]:
    """Versions, SHA-256 of the `inputs` by file name, and the seed, for a result's sidecar."""
    return {"versions": dict(_versions()), "inputs_sha256": dict(inputs or {}), "seed": seed}


@cache
def _versions() -> dict[str, str]:
    packages = ("vsf-drake", "drake", "numpy", "scipy", "numba")
    return {name: version(name) for name in packages} | {"python": platform.python_version()}
