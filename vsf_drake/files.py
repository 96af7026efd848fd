"""Writing files so that nothing half-written stays behind, and fingerprints of what was read."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from vsf_drake.errors import InputError


@contextlib.contextmanager
def replaced(path: str | Path, mode: str = "w") -> Iterator[IO[Any]]:
    """A file to write that becomes `path` only when the block ends without an exception.

    The text goes to a temporary file in the same folder, which is renamed over `path` at
    the end; after an exception it is removed and an older `path` stays as it was.

    Args:
        path: the file to create or to replace; its folder must exist.
        mode: "w" for text (UTF-8, lines end in a line feed) or "wb" for bytes.

    Raises:
        InputError: the folder does not exist or cannot be written.
        ValueError: another mode.
    """
    path = Path(path)
    if mode not in ("w", "wb"):
        raise ValueError(f"mode must be 'w' or 'wb', not {mode!r}")
    try:
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=path) from None
    text: dict[str, Any] = {} if mode == "wb" else {"encoding": "utf-8", "newline": "\n"}
    try:
        with os.fdopen(descriptor, mode, **text) as stream:
            yield stream
        os.chmod(name, _default_permissions())
        try:
            os.replace(name, path)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=path) from None
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)
        raise


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


def _default_permissions() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
