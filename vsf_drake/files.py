"""Writing files so that nothing half-written stays behind, and fingerprints of what was read."""

from __future__ import annotations

import contextlib
import fcntl
import glob
import hashlib
import os
import secrets
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from vsf_drake.errors import InputError

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
                    held = os.open(part, os.O_RDONLY)
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
        held = os.open(part, os.O_RDONLY)
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if f".{_HOST}-" in part.name or time.time() - part.stat().st_mtime > OTHER_HOSTS_S:
                _remove(part)
        finally:
            os.close(held)


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):
        if part.is_dir():
            shutil.rmtree(part)
        else:
            part.unlink()
