"""The header and the parameter section of a C3D file, checked against the file's size before anything is reserved.

The format is that of the C3D user guide (Motion Lab Systems, https://www.c3d.org): a header block of 512 bytes, a
chain of groups and parameters, then the frames; numbers in the manner of Intel, DEC or MIPS processors.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.text import as_label

BLOCK = 512
_KEY = 0x50
_INTEL, _DEC, _MIPS = 84, 85, 86
_SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}
_MOST_RECORDS = 100_000


@dataclass(frozen=True)
class Numbers:
    """How the file writes its numbers."""

    processor: int

    def integers(self, data: bytes | np.ndarray, *, signed: bool = True) -> np.ndarray:
        """16-bit integers."""
        return np.frombuffer(data, ("<" if self.processor != _MIPS else ">") + ("i2" if signed else "u2"))

    def floats(self, data: bytes | np.ndarray) -> np.ndarray:
        """32-bit numbers; DEC's have their halves swapped and four times the value of IEEE's."""
        if self.processor == _DEC:
            halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
            return np.ascontiguousarray(halves).view("<f4").ravel() / np.float32(4.0)
        return np.frombuffer(data, "<f4" if self.processor == _INTEL else ">f4")


@dataclass(frozen=True, eq=False)
class Header:
    """Counts and places that the header states; frames count from 1."""

    points: int
    analog_per_frame: int
    first_frame: int
    last_frame: int
    scale: float
    data_block: int
    subframes: int
    rate_hz: float


@dataclass(eq=False)
class C3dDescription:
    """Header and parameters of a C3D file; parameters by "GROUP:NAME", arrays in Fortran order, texts as lists."""

    path: Path
    size: int
    numbers: Numbers
    header: Header
    parameters: dict[str, np.ndarray | list[str]]

    def texts(self, name: str) -> list[str]:
        """A parameter of texts; empty where there is none."""
        value = self.parameters.get(name)
        return value if isinstance(value, list) else []

    def all_texts(self, name: str) -> list[str]:
        """A list that goes on in NAME2, NAME3, ... where it has more than 255 entries."""
        found, i = self.texts(name), 2
        while more := self.texts(f"{name}{i}"):
            found, i = found + more, i + 1
        return found

    def values(self, name: str) -> np.ndarray:
        """A parameter of numbers as float; empty where there is none."""
        value = self.parameters.get(name)
        return np.zeros(0) if value is None or isinstance(value, list) else np.asarray(value, dtype=float)

    def number(self, name: str) -> float | None:
        """The first number of a parameter, if it is finite."""
        value = self.values(name).ravel(order="F")
        return float(value[0]) if value.size and np.isfinite(value[0]) else None


def read_description(path: Path) -> C3dDescription:
    """Reads header and parameters of a C3D file.

    Raises:
        InputError: the file is missing, empty, no C3D file, or its header or parameters are damaged.
    """
    try:
        size = path.stat().st_size
        with open(path, "rb") as stream:
            head = stream.read(BLOCK)
            if size == 0:
                raise InputError("the file is empty", file=path)
            if len(head) < BLOCK or head[1] != _KEY:
                raise InputError("is not a C3D file", file=path, where="header",
                                 right="Its second byte must be 0x50" if len(head) >= BLOCK else "It is too short")
            start = (max(head[0], 1) - 1) * BLOCK
            stream.seek(start)
            lead = stream.read(4)
            if len(lead) < 4:
                raise InputError("ends before its parameters", file=path, right="Is the file truncated?")
            numbers = Numbers(lead[3] if lead[3] in (_INTEL, _DEC, _MIPS) else lead[3] + 83)
            if numbers.processor not in (_INTEL, _DEC, _MIPS):
                raise InputError(f"the processor type {lead[3]} is unknown", file=path, where="parameters",
                                 right="It must be 84, 85 or 86: is the file damaged?")
            header = _read_header(head, numbers)
            stream.seek(start)
            section = stream.read(max(lead[2], header.data_block - 1 - start // BLOCK, 1) * BLOCK)
    except FileNotFoundError:
        raise InputError("there is no such file", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    return C3dDescription(path, size, numbers, header, _read_parameters(section, numbers, path))


def _read_header(head: bytes, numbers: Numbers) -> Header:
    words = numbers.integers(head, signed=False)
    with np.errstate(all="ignore"):
        scale, rate = (float(numbers.floats(head[at:at + 4])[0]) for at in (12, 20))
    return Header(int(words[1]), int(words[2]), int(words[3]), int(words[4]), scale, int(words[8]), int(words[9]), rate)


def _read_parameters(section: bytes, numbers: Numbers, path: Path) -> dict[str, np.ndarray | list[str]]:
    groups: dict[int, str] = {}
    found: list[tuple[int, str, np.ndarray | list[str]]] = []
    at = 4
    for _ in range(_MOST_RECORDS):
        if at + 2 > len(section) or section[at] == 0:
            break
        length = abs(int(np.int8(section[at])) if section[at] < 128 else section[at] - 256)
        group = section[at + 1] - 256 if section[at + 1] > 127 else section[at + 1]
        name_end = at + 2 + length
        if name_end + 2 > len(section) or group == 0:
            raise _damaged(path, at)
        name = section[at + 2:name_end].decode("latin-1").strip().upper()
        step = int(numbers.integers(section[name_end:name_end + 2], signed=False)[0])
        if group < 0:
            groups[-group] = name
        else:
            value = _read_value(section, name_end + 2, numbers)
            if value is None:
                raise _damaged(path, at, name)
            found.append((group, name, value))
        if step == 0:
            break
        at = name_end + step
    return {f"{groups.get(group, group)}:{name}": value for group, name, value in found}


def _read_value(section: bytes, at: int, numbers: Numbers) -> np.ndarray | list[str] | None:
    """The value of a parameter whose type byte is at `at`; None where it does not fit into the section."""
    if at + 2 > len(section):
        return None
    kind = section[at] - 256 if section[at] > 127 else section[at]
    count = section[at + 1]
    shape = tuple(section[at + 2:at + 2 + count])
    if kind not in _SIZES or len(shape) != count or count > 7:
        return None
    items = int(np.prod(shape, dtype=object)) if shape else 1
    data = section[at + 2 + count:at + 2 + count + items * _SIZES[kind]]
    if len(data) != items * _SIZES[kind]:
        return None
    if kind == -1:
        width = shape[0] if shape else 1
        return [_text(data[i * width:(i + 1) * width]) for i in range(items // width if width else 0)]
    if kind == 1:
        values = np.frombuffer(data, np.int8)
    else:
        values = numbers.integers(data) if kind == 2 else numbers.floats(data)
    return values.reshape(shape, order="F") if shape else values


def _text(data: bytes) -> str:
    return as_label(data.decode("latin-1")).replace("\n", " ").replace("\t", " ")


def _damaged(path: Path, at: int, name: str | None = None) -> InputError:
    where = f"parameter {name}" if name else f"parameters, byte {at}"
    return InputError("the parameter section is damaged", file=path, where=where, right="Export the trial again")
