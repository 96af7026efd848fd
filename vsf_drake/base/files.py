"""Files: paths that users give, reading within limits, writing whole or not at all, fingerprints;
JSON and .npz.

Whatever is read may have been made by anybody: nothing is read before its size is known, nothing in
it is executed, and what is not numbers and text is refused.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import fcntl
import functools
import glob
import hashlib
import io
import json
import math
import os
import re
import secrets
import shutil
import socket
import stat
import struct
import time
import types
import typing
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np

from vsf_drake.base.errors import UNPRINTABLE, InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
_FORMULA = re.compile(r"[=@\t\r]|[-+](?![0-9.]+(e[-+]?[0-9]+)?$)")
_SHOWN = 60  # characters of a path that cannot be one, in messages
_PACKAGE = Path(__file__).resolve().parents[1]
PACKAGE = "package://vsf_drake/"


def user_path(
    given: str | Path, *, file: str | Path | None = None, where: str | None = None
) -> Path:
    """A path that a user gave, with ~ expanded, whether it exists or not; `file` and `where` name
    it in messages.

    `package://vsf_drake/NAME` is a shipped file of `models`, which must exist.
    """
    text = str(given)
    if text.startswith(PACKAGE):
        return resource(f"models/{text.removeprefix(PACKAGE)}")
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}... ({len(text)} characters)"
    try:
        if UNPRINTABLE.search(text) or "\n" in text:
            raise InputError(
                f"{shown!r} has characters that no path may have", file=file, where=where
            )
        path = Path(given).expanduser()
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise InputError(
            f"{shown!r} cannot be used as a path ({error.strerror})", file=file, where=where
        ) from None
    except RuntimeError:
        raise InputError(
            f"{shown!r} begins with a home folder that does not exist", file=file, where=where
        ) from None
    return path


def resource(relative: str) -> Path:
    """A shipped file or folder such as "models/nominal.yaml": in an installed package, or beside it
    in a checkout."""
    for home in (_PACKAGE, _PACKAGE.parent):
        if (home / relative).exists():
            return home / relative
    raise InputError("is not among the files of this package", file=relative)


def table_of(relative: str) -> list[dict[str, str]]:
    """Rows, by column, of a CSV file that stands beside the code which reads it: words and formats,
    for people who know no Python."""
    with resource(relative).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@contextlib.contextmanager
def reading(path: str | Path, *, right: str | None = None) -> Iterator[None]:
    """Around the reading of a file: says that it is missing (and what is `right`) or cannot be
    read."""
    try:
        yield
    except (FileNotFoundError, NotADirectoryError):
        raise InputError("there is no such file", file=path, right=right) from None
    except IsADirectoryError:
        raise InputError("is a folder", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None


MOST_FILE_BYTES = 2**31
"""Of a file that has no smaller limit, recordings and .npz files; a walk of ten minutes in text has
some 3e8."""


@contextlib.contextmanager
def opened(
    path: str | Path, *, most: int = MOST_FILE_BYTES, right: str | None = None
) -> Iterator[io.BufferedReader]:
    """The one door to what others wrote: an ordinary file of at most `most` bytes, or a link to
    one, open for reading.

    Refused are a folder, a pipe, a device, and what is larger; `right`: what to do if there is no
    such file.
    """
    try:
        if b"\0" in os.fsencode(path):
            raise InputError("cannot be read (embedded null byte)", file=path)
    except UnicodeEncodeError:  # half of a character
        raise InputError(f"{str(path)!r} cannot be read: no file has such a name") from None
    # O_NONBLOCK waits for no pipe's other end, and means nothing for an ordinary file.
    with (
        reading(path, right=right),
        open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as stream,
    ):
        about = os.fstat(stream.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise InputError("is no ordinary file, but a pipe or a device", file=path)
        if about.st_size > most:
            raise InputError(
                f"has {about.st_size} bytes, which is more than the {most} that are read", file=path
            )
        yield stream


def read_bytes(path: str | Path, *, most: int, right: str | None = None) -> bytes:
    """A file of at most `most` bytes through `opened`."""
    with opened(path, most=most, right=right) as stream:
        # not `most`, for which so much memory would be taken first
        return stream.read(os.fstat(stream.fileno()).st_size)


def read_text(path: str | Path, *, most: int, right: str | None = None) -> str:
    """As `read_bytes`, for UTF-8."""
    try:
        return read_bytes(path, most=most, right=right).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"cannot be read as text ({error})", file=path, right="Save it as UTF-8"
        ) from None


def sha256(path: str | Path) -> str:
    """The SHA-256 of the bytes of a file through `opened`, 64 hexadecimal digits."""
    with opened(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


# Writing: a part beside the target, locked while its process lives, becomes the target at the end.


# how long what another machine has begun stays, whose processes cannot be seen from here
OTHER_HOSTS_S = 7 * 86400.0
_HOST = hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]


@contextlib.contextmanager
def replaced(path: str | Path, mode: str = "w", *, lasting: bool = False) -> Iterator[IO[Any]]:
    """A file to write that becomes `path` only when the block ends without an exception; else an
    older one stays.

    `mode` is "w" for text (UTF-8, lines end in a line feed) or "wb" for bytes. `lasting` makes it
    whole even if the machine stops in the next moment, which costs milliseconds.
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
    """Writes `text` to `path`, all of it or nothing."""
    with replaced(path) as stream:
        stream.write(text)


@contextlib.contextmanager
def part_of(path: Path, home: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """A file or folder in `home` that `make` creates, to be renamed to `path`; whatever is left of
    it then goes.

    Parts of `path` whose processes were killed are removed first. A process that lives holds a lock
    on its own.
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
                # another process has taken it for dead
                with contextlib.suppress(FileNotFoundError):
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


def csv_cells(values: Iterable[Any]) -> list[Any]:
    """`values` for a row of CSV: nothing for None, an apostrophe before what a spreadsheet would
    take for a formula.

    After OWASP, "CSV injection": text, other than a number, that begins with = + - @, a tab or a
    carriage return.
    """
    return [
        ""
        if value is None
        else f"'{value}"
        if isinstance(value, str) and _FORMULA.match(value)
        else value
        for value in values
    ]


# JSON: tables in full precision, never NaN.


MOST_JSON_BYTES = 2**25  # of a table that is read; that of a sweep of 100 000 walks has that many
_TAKEN, _MOST_TAKEN = {"{": 232, "[": 64, ",": 64}, 2**28
"""Bytes that each of these letters stands for in memory, about, and how many all may take."""
_MOST_DIGITS = 99


def plain(value: Any) -> Any:
    """`value` as dicts, lists and scalars that JSON knows; a number that is not finite becomes
    None.

    A dataclass becomes a dict of its fields in their order; `record` makes it again.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        table: dict[str, Any] = {}
        for field in dataclasses.fields(value):
            item = plain(getattr(value, field.name))
            table |= item if "flat" in field.metadata else {field.name: item}
        return table
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def flat() -> Any:
    """The last field of a record: a mapping whose entries stand among the record's own in `plain`,
    values of one type under names that are put together of others."""
    return dataclasses.field(metadata={"flat": True})


def record(kind: type[T], values: Any, *, where: str = "") -> T:
    """The dataclass that `plain` turned into `values`; keys that it does not know are left out.

    ValueError, with the place `where` the value stands: it is missing, or not of the type of its
    field.
    """
    if not isinstance(values, Mapping):
        raise ValueError(f"{where or kind.__name__} is no table")
    hints = _field_types(kind)
    given = {}
    for field in dataclasses.fields(kind):
        if "flat" in field.metadata:
            rest = {name: item for name, item in values.items() if name not in hints}
            given[field.name] = _typed(hints[field.name], rest, where)
        elif field.name in values:
            given[field.name] = _typed(
                hints[field.name], values[field.name], f"{where}{'.' * bool(where)}{field.name}"
            )
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{where}{'.' * bool(where)}{field.name} is missing")
    return kind(**given)


@functools.cache
def _field_types(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _typed(hint: Any, value: Any, where: str) -> Any:  # noqa: PLR0911 (one return a kind of type)
    """`value` as its field has it: records, tuples and dicts of them, numbers, text, None where
    that is allowed."""
    kind = typing.get_origin(hint) or hint
    parts = typing.get_args(hint)
    if hint is Any or (value is None and type(None) in parts):
        return value
    if kind in (types.UnionType, typing.Union):
        *others, last = (part for part in parts if part is not type(None))
        for part in others:
            with contextlib.suppress(ValueError):
                return _typed(part, value, where)
        return _typed(last, value, where)
    elif kind is typing.Literal:
        if value in parts:
            return value
    elif isinstance(kind, type) and dataclasses.is_dataclass(kind):
        return record(kind, value, where=where)
    elif isinstance(kind, type) and issubclass(kind, Mapping) and isinstance(value, Mapping):
        inner = parts[1] if parts else Any
        return {
            name: _typed(inner, item, f"{where}{'.' * bool(where)}{name}")
            for name, item in value.items()
        }
    elif kind in (list, tuple, Sequence) and isinstance(value, (list, tuple)):
        hints = (
            parts
            if kind is tuple and parts[-1] is not Ellipsis
            else (parts[0] if parts else Any,) * len(value)
        )
        if len(hints) == len(value):
            items = [
                _typed(inner, item, f"{where}[{i}]")
                for i, (inner, item) in enumerate(zip(hints, value, strict=True))
            ]
            return items if kind is list else tuple(items)
    elif kind is float and type(value) in (int, float):
        return float(value)
    elif type(value) is kind:
        return value
    raise ValueError(f"{where} is {str(value)[:_SHOWN]!r}, not {getattr(hint, '__name__', hint)}")


def write_json(path: str | Path, values: Mapping[str, Any], *, sort: bool = True) -> None:
    """Writes `values` to `path`, all of it or nothing; keys sorted, or else in the order they
    have."""
    text = json.dumps(plain(values), sort_keys=sort, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


def read_json(
    path: str | Path, *, right: str | None = None, damaged: str | None = None
) -> dict[str, Any]:
    """A table of finite numbers and printable text; what to do if there is no such file, and if it
    is no such table."""
    text = read_text(path, most=MOST_JSON_BYTES, right=right)
    try:
        if sum(size * text.count(letter) for letter, size in _TAKEN.items()) > _MOST_TAKEN:
            raise ValueError("it holds too many values")
        table = json.loads(text, parse_int=_integer, parse_constant=_integer)
        if not isinstance(table, dict) or not _sound(table):
            raise ValueError("it is no table of numbers and text")
    except (ValueError, RecursionError) as error:
        raise InputError(f"cannot be read as JSON ({error})", file=path, right=damaged) from None
    return table


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"{text[:_MOST_DIGITS]}... is too large")
    return int(text)


def _sound(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str):
        return not UNPRINTABLE.search(value)
    items = (
        [*value, *value.values()]
        if isinstance(value, dict)
        else value
        if isinstance(value, list)
        else ()
    )
    return all(map(_sound, items))


# .npz: arrays of numbers and text by name.


MOST_NPZ_BYTES = 2**31  # of all arrays of a file together; a walk of ten minutes has 1.3e9
ALWAYS_BYTES, LARGEST_RATIO = 2**27, 8
"""What any file may hold, and how many times its own size beyond that; walks are compressed to
0.6 of theirs."""
# of the list of arrays; of what is read at once
_DIRECTORY_BYTES = 2**20
_CHUNK = 2**20
_END = struct.Struct("<4s4xHHLL2x")
_HEADER = re.compile(
    rb"\{'descr': '([<|](?:b1|[iu][1248]|f[248]|U[1-9]\d{0,4}))', 'fortran_order': (True|False), "
    rb"'shape': \(([\d, ]{0,99})\), \} *\n"
)


def write_npz(path: str | Path, arrays: Mapping[str, Any]) -> None:
    """Writes `arrays` by name, compressed, all of them or nothing; without pickle."""
    with replaced(path, "wb") as stream:
        np.savez_compressed(
            stream,
            allow_pickle=False,
            **{name: np.asarray(values) for name, values in arrays.items()},
        )


def read_npz(path: str | Path, *, right: str | None = None) -> dict[str, Any]:
    """Every array by name, and as bytes what is no array (no .npy); `right`: what to do if it
    cannot be read.

    Refused is what is no .npz, encrypted or compressed in another way than NumPy's, an array that
    has not the size that it states, and more than `MOST_NPZ_BYTES` or than a file of this size can
    honestly hold.
    """
    where = None
    try:
        with opened(path, right=right) as stream:
            size = _check_end(stream)
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
                most = min(MOST_NPZ_BYTES, ALWAYS_BYTES + LARGEST_RATIO * size)
                total = sum(member.file_size for member in members)
                if total > most:
                    raise ValueError(
                        f"says that it holds {total} bytes; {most} are read from a file of {size}"
                    )
                if len({member.filename for member in members}) < len(members):
                    raise ValueError("two arrays have the same name")
                arrays = {}
                for member in members:
                    where = member.filename
                    arrays[member.filename.removesuffix(".npy")] = _read_member(archive, member)
                return arrays
    except (
        ValueError,
        EOFError,
        IndexError,
        OverflowError,
        RuntimeError,
        struct.error,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        # RuntimeError, with NotImplementedError: what zipfile does not know
        raise InputError(f"cannot be read ({error})", file=path, where=where, right=right) from None


def _check_end(stream: Any) -> int:
    """The file's size; ValueError unless it ends as a zip file does, with a list of members of
    bounded size."""
    size: int = stream.seek(0, 2)
    stream.seek(max(0, size - _END.size - 20))
    tail = stream.read()
    if len(tail) < _END.size or not tail[-_END.size :].startswith(b"PK\5\6"):
        raise ValueError("it is no .npz file, or its end is missing")
    directory = _END.unpack(tail[-_END.size :])[3]
    # the latter: the sizes stand elsewhere
    if directory > _DIRECTORY_BYTES or tail.startswith(b"PK\6\7"):
        raise ValueError("it has too many members")
    return size


def _read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Any:
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
        kind = np.dtype(stated[1].decode())
        order = "F" if stated[2] == b"True" else "C"
        shape = tuple(int(part) for part in stated[3].split(b",") if part.strip())
        if math.prod(shape) * kind.itemsize + 10 + length != member.file_size:
            raise ValueError(f"its shape {shape} does not fit its size")
        array = np.empty(shape, kind, order)  # type: ignore[call-overload] # orders as plain text
        content = array.reshape(-1, order="A").view(np.uint8)
        at = 0
        while chunk := stream.read(_CHUNK):
            content[at : at + len(chunk)] = np.frombuffer(chunk, np.uint8)
            at += len(chunk)
        if at != len(content):
            raise ValueError("it is truncated")
        if kind.kind == "U" and UNPRINTABLE.search(
            array.tobytes().decode("utf-32-le").replace("\0", "")
        ):
            raise ValueError("its text has unprintable characters")
        return array
