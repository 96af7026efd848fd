"""Paths that users give, reading within limits, writing so that nothing half-written stays, and fingerprints."""

from __future__ import annotations

import contextlib
import fcntl
import glob
import hashlib
import os
import re
import secrets
import shutil
import socket
import stat
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import IO, Any

from vsf_drake.errors import UNPRINTABLE, InputError

_FORMULA = re.compile(r"[=@\t\r]|[-+](?![0-9.]+(e[-+]?[0-9]+)?$)")
_SHOWN = 60
"""Characters of a path that cannot be one, in messages."""


def user_path(given: str | Path, *, file: str | Path | None = None, where: str | None = None) -> Path:
    """A path that a user gave, with ~ expanded; whether it exists is another question.

    Args:
        file, where: what names it, for messages; without them it is the file itself.

    Raises:
        InputError: it has unprintable characters or line breaks, is too long, or begins with the home of nobody.
    """
    text = str(given)
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}... ({len(text)} characters)"
    try:
        if UNPRINTABLE.search(text) or "\n" in text:
            raise InputError(f"{shown!r} has characters that no path may have", file=file, where=where)
        path = Path(given).expanduser()
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise InputError(f"{shown!r} cannot be used as a path ({error.strerror})", file=file, where=where) from None
    except RuntimeError:
        raise InputError(f"{shown!r} begins with a home folder that does not exist", file=file, where=where) from None
    return path


def read_bytes(path: str | Path, *, most: int, right: str | None = None) -> bytes:
    """The content of an ordinary file of at most `most` bytes.

    Args:
        right: what to do if there is no such file.

    Raises:
        InputError: it is missing, cannot be read, is larger, or is a folder, a pipe or a device.
    """
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode):
            raise InputError("is a folder" if stat.S_ISDIR(about.st_mode) else "is no ordinary file", file=path)
        if about.st_size > most:
            raise InputError(f"has {about.st_size} bytes, which is more than the {most} that are read", file=path)
        with open(path, "rb") as stream:
            return stream.read(most)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError("there is no such file", file=path, right=right) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=path) from None


def read_text(path: str | Path, *, most: int, right: str | None = None) -> str:
    """As `read_bytes`, for UTF-8.

    Raises:
        InputError: see `read_bytes`; or it is not UTF-8.
    """
    try:
        return read_bytes(path, most=most, right=right).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"cannot be read as text ({error})", file=path, right="Save it as UTF-8") from None

OTHER_HOSTS_S = 7 * 86400.0
"""How long what another machine has begun stays, whose processes cannot be seen from here."""
_HOST = hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]


@contextlib.contextmanager
def replaced(path: str | Path, mode: str = "w", *, lasting: bool = False) -> Iterator[IO[Any]]:
    """A file to write that becomes `path` only when the block ends without an exception.

    The text goes to a temporary file in the same folder, which is renamed over `path` at
    the end; after an exception it is removed and an older `path` stays as it was.

    Args:
        path: the file to create or to replace; its folder must exist.
        mode: "w" for text (UTF-8, lines end in a line feed) or "wb" for bytes.
        lasting: whether it must be whole even if the machine stops in the next moment, which costs milliseconds.

    Raises:
        InputError: the folder does not exist or cannot be written.
        ValueError: another mode.
    """
    path = Path(path)
    if mode not in ("w", "wb"):
        raise ValueError(f"mode must be 'w' or 'wb', not {mode!r}")
    text: dict[str, Any] = {} if mode == "wb" else {"encoding": "utf-8", "newline": "\n"}
    with part_of(path, path.parent, lambda part: part.touch(exist_ok=False)) as part:
        with open(part, mode, **text) as stream:
            yield stream
            if lasting:
                stream.flush()
                os.fsync(stream.fileno())
        try:
            os.replace(part, path)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=path) from None
    if lasting:
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def write_text(path: str | Path, text: str) -> None:
    """Writes `text` to `path`, all of it or nothing; see `replaced`."""
    with replaced(path) as stream:
        stream.write(text)


@contextlib.contextmanager
def part_of(path: Path, home: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """A file or folder in `home` that `make` creates, to be renamed to `path`; whatever is left of it then goes.

    Parts of `path` whose processes were killed are removed first. A process that lives holds a lock on its own.

    Raises:
        InputError: it cannot be made.
    """
    held = -1
    part = home
    try:
        try:
            for old in home.glob(f".{glob.escape(path.name)}.{'?' * 8}-{'?' * 8}.part"):
                _remove_dead(old)
            while held < 0:
                part = home / f".{path.name}.{_HOST}-{secrets.token_hex(4)}.part"
                make(part)
                with contextlib.suppress(FileNotFoundError):  # another process has taken it for dead
                    held = os.open(part, _for_lock(part))
                    with contextlib.suppress(OSError):  # a file system without locks
                        fcntl.flock(held, fcntl.LOCK_EX)
                    if not part.exists():
                        os.close(held)
                        held = -1
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=path) from None
        yield part
    finally:
        if part != home:
            _remove(part)
        if held >= 0:
            os.close(held)


def csv_cells(values: Iterable[Any]) -> list[Any]:
    """`values` for a row of CSV: nothing for None, an apostrophe before what a spreadsheet would take for a formula.

    After OWASP, "CSV injection": text, other than a number, that begins with = + - @, a tab or a carriage return.
    """
    return ["" if value is None else f"'{value}" if isinstance(value, str) and _FORMULA.match(value) else value
            for value in values]


def sha256(path: str | Path) -> str:
    """The SHA-256 of the file's bytes, 64 hexadecimal digits.

    Raises:
        InputError: the file is missing or cannot be read.
    """
    try:
        with open(path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None


def _remove_dead(part: Path) -> None:
    """Removes what nobody writes any more: unlocked, and of this machine or old."""
    with contextlib.suppress(OSError):
        held = os.open(part, _for_lock(part))
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if f".{_HOST}-" in part.name or time.time() - part.stat().st_mtime > OTHER_HOSTS_S:
                _remove(part)
        finally:
            os.close(held)


def _for_lock(part: Path) -> int:
    """How to open it: NFS locks files that are open for writing only."""
    return os.O_RDONLY if part.is_dir() else os.O_RDWR


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):
        if part.is_dir():
            shutil.rmtree(part)
        else:
            part.unlink()


# Where the files that ship with the package are: `models/` and `data/`.


_PACKAGE = Path(__file__).resolve().parent


def resource(relative: str) -> Path:
    """Path of a shipped file or folder such as "models/nominal.yaml".

    It lies inside an installed package, and beside it in a checkout.

    Raises:
        InputError: there is no such file.
    """
    for home in (_PACKAGE, _PACKAGE.parent):
        if (home / relative).exists():
            return home / relative
    raise InputError("is not among the files of this package", file=relative)
