"""NumPy's .npz files that anybody may have made: numbers and text only, and nothing read before its size is known."""

from __future__ import annotations

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import UNPRINTABLE, InputError
from vsf_drake.files import replaced

MOST_BYTES = 2**31
"""Of all arrays of a file together; a walk of ten minutes has 1.3e9."""
ALWAYS_BYTES, LARGEST_RATIO = 2**27, 8
"""What any file may hold, and how many times its own size beyond that; walks are compressed to 0.6 of theirs."""
_DIRECTORY_BYTES = 2**20
"""Of the list of arrays."""
_END = struct.Struct("<4s4xHHLL2x")
_HEADER = re.compile(
    rb"\{'descr': '([<|](?:b1|[iu][1248]|f[248]|U[1-9]\d{0,4}))', 'fortran_order': (True|False), "
    rb"'shape': \(([\d, ]{0,99})\), \} *\n")
_PIECE = 2**20


def write_npz(path: str | Path, arrays: Mapping[str, Any]) -> None:
    """Writes `arrays` by name, compressed, all of them or nothing; without pickle."""
    with replaced(path, "wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **{name: np.asarray(values) for name, values in arrays.items()})


def read_npz(path: str | Path, *, right: str | None = None) -> dict[str, Any]:
    """Every array by name, and as bytes what is no array (no .npy).

    Args:
        right: what to do about a file that cannot be read.

    Raises:
        InputError: the file is missing or damaged, no .npz, encrypted or compressed in another way than NumPy's; an
            array is none of numbers or text, has not the size that it states, or all are larger than MOST_BYTES or than
            a file of this size can honestly hold.
    """
    path, where = Path(path), None
    try:
        with open(path, "rb") as stream:
            size = _check_end(stream)
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
                most = min(MOST_BYTES, ALWAYS_BYTES + LARGEST_RATIO * size)
                total = sum(member.file_size for member in members)
                if total > most:
                    raise ValueError(f"says that it holds {total} bytes; {most} are read from a file of {size}")
                if len({member.filename for member in members}) < len(members):
                    raise ValueError("two arrays have the same name")
                found = {}
                for member in members:
                    where = member.filename
                    found[member.filename.removesuffix(".npy")] = _read(archive, member)
                return found
    except FileNotFoundError:
        raise InputError("there is no such file", file=path, right=right) from None
    except (OSError, ValueError, EOFError, IndexError, OverflowError, RuntimeError, struct.error, zipfile.BadZipFile,
            zlib.error) as error:  # RuntimeError, with NotImplementedError: what zipfile does not know
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise InputError(f"cannot be read ({why})", file=path, where=where, right=right) from None


def _check_end(stream: Any) -> int:
    """The file's size; ValueError unless it ends as a zip file does, with a list of members of bounded size."""
    size: int = stream.seek(0, 2)
    stream.seek(max(0, size - _END.size - 20))
    tail = stream.read()
    if len(tail) < _END.size or not tail[-_END.size:].startswith(b"PK\5\6"):
        raise ValueError("it is no .npz file, or its end is missing")
    directory = _END.unpack(tail[-_END.size:])[3]
    if directory > _DIRECTORY_BYTES or tail.startswith(b"PK\6\7"):  # the latter: the sizes stand elsewhere
        raise ValueError("it has too many members")
    return size


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Any:
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("compressed in a way that NumPy does not use")
    if UNPRINTABLE.search(member.filename):
        raise ValueError("its name has unprintable characters")
    with archive.open(member) as stream:
        if not member.filename.endswith(".npy"):
            return stream.read(member.file_size)
        magic, length = struct.unpack("<8sH", stream.read(10))
        stated = _HEADER.fullmatch(stream.read(length)) if magic == b"\x93NUMPY\1\0" else None
        if stated is None:
            raise ValueError("it is no array of numbers or text")
        kind, order = np.dtype(stated[1].decode()), "F" if stated[2] == b"True" else "C"
        shape = tuple(int(part) for part in stated[3].split(b",") if part.strip())
        if math.prod(shape) * kind.itemsize + 10 + length != member.file_size:
            raise ValueError(f"its shape {shape} does not fit its size")
        array = np.empty(shape, kind, order)  # type: ignore[call-overload]
        content, at = array.reshape(-1, order="A").view(np.uint8), 0
        while piece := stream.read(_PIECE):
            content[at : at + len(piece)] = np.frombuffer(piece, np.uint8)
            at += len(piece)
        if at != len(content):
            raise ValueError("it is truncated")
        if kind.kind == "U" and UNPRINTABLE.search(array.tobytes().decode("utf-32-le").replace("\0", "")):
            raise ValueError("its text has unprintable characters")
        return array
