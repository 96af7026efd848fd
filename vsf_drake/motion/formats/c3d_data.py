"""The frames of a C3D file: points and analog channels, mapped from the file rather than copied whole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.text import as_label

MOST_FRAMES = 100_000_000
LARGEST = 1e9
"""No position is as large, in any unit."""
MOST_16_BITS = 65535
"""What the header says as last frame where there are more."""
_CHUNK = 1 << 20
"""Bytes of the file that are converted at a time."""


@dataclass(frozen=True, eq=False)
class Layout:
    """How the frames lie in the file.

    Attributes:
        start: byte of the first frame.
        frames, points, channels, subframes: counts; analog channels have `subframes` samples a frame.
        floats: whether numbers are 32-bit floats rather than 16-bit integers.
        first_frame: number of the first frame, from 1.
    """

    start: int
    frames: int
    points: int
    channels: int
    subframes: int
    floats: bool
    first_frame: int

    @property
    def words(self) -> int:
        """Numbers a frame."""
        return 4 * self.points + self.channels * self.subframes

    @property
    def frame_bytes(self) -> int:
        return self.words * (4 if self.floats else 2)


def read_layout(c3d: C3dDescription) -> Layout:
    """Where and how many the frames are; header and parameters that disagree are settled by the file's size.

    Raises:
        InputError: counts make no sense, or the file is shorter than they say.
    """
    header = c3d.header
    block = int(header.data_block or c3d.number("POINT:DATA_START") or 0)
    scale = header.scale if header.points == 0 or header.scale else c3d.number("POINT:SCALE") or 0.0
    if block < 2 or not np.isfinite(scale):
        raise InputError("the header does not say where the frames are", file=c3d.path, where="header",
                         right="Is the file damaged?")
    subframes = _subframes(c3d) if header.analog_per_frame else 0
    if header.analog_per_frame and not subframes:
        raise InputError(f"{header.analog_per_frame} analog numbers a frame fit neither {header.subframes} samples a "
                         "frame nor ANALOG:USED and ANALOG:RATE", file=c3d.path, where="header",
                         right="Is the file damaged?")
    channels = header.analog_per_frame // subframes if subframes else 0
    one = Layout((block - 1) * BLOCK, 1, header.points, channels, subframes, scale < 0.0, max(header.first_frame, 1))
    if one.words == 0:
        raise InputError("has neither points nor analog channels", file=c3d.path)
    held = max(c3d.size - one.start, 0) // one.frame_bytes
    stated = _stated_frames(c3d)
    fitting = [frames for frames in stated if 0 < frames <= held]
    if not fitting:
        raise InputError(f"the header says {max(stated, default=0)} frames, the file holds {held}", file=c3d.path,
                         right="Is the file truncated?")
    frames = max(fitting)
    if frames == header.last_frame - header.first_frame + 1 and header.last_frame == MOST_16_BITS:
        frames = _frames_held(c3d, one, held)
    trial = _trial_frames(c3d)
    first = trial[0] if trial and trial[0] % (MOST_16_BITS + 1) == header.first_frame else one.first_frame
    return Layout(one.start, frames, one.points, channels, subframes, one.floats, first)


def _subframes(c3d: C3dDescription) -> int:
    """Analog samples a frame: the header's where they divide the numbers of a frame, but where the parameters agree.

    ANALOG:USED channels and the rates of ANALOG and POINT each give a number; where both give the same, that counts,
    else the header's, else the one of the two that divides. 0 where none does.
    """
    total = c3d.header.analog_per_frame
    used, fast, slow = (c3d.number(name) or 0.0 for name in ("ANALOG:USED", "ANALOG:RATE", "POINT:RATE"))
    by_channels = total / used if used >= 1.0 else 0.0
    by_rate = fast / (slow or c3d.header.rate_hz or np.inf)
    own = float(c3d.header.subframes)
    agreed = by_channels if abs(by_rate - by_channels) < 1e-3 * by_channels else 0.0
    for subframes in (agreed, own, by_channels, by_rate):
        if 1.0 <= subframes <= total and subframes == round(subframes) and total % subframes == 0:
            return int(subframes)
    return 0


def _frames_held(c3d: C3dDescription, layout: Layout, held: int) -> int:
    """The frames that the file holds, without zeros that fill its last block: for counts beyond 16 bits."""
    with open(c3d.path, "rb") as stream:
        stream.seek(layout.start + max(held - 1 - BLOCK // layout.frame_bytes, 0) * layout.frame_bytes)
        tail = stream.read()
    while held > 1:
        last = tail[:len(tail) // layout.frame_bytes * layout.frame_bytes][-layout.frame_bytes:]
        if not last or any(last):
            break
        tail, held = tail[:len(tail) - layout.frame_bytes], held - 1
    return held


def _stated_frames(c3d: C3dDescription) -> list[int]:
    """Numbers of frames by header and parameters; those of 16 bits are wrong in long recordings."""
    header = c3d.header
    found = [header.last_frame - header.first_frame + 1]
    trial = _trial_frames(c3d)
    if trial:
        found.append(trial[1] - trial[0] + 1)
    stated = c3d.number("POINT:FRAMES") if header.last_frame == MOST_16_BITS else None
    found += [int(min(value, MOST_FRAMES)) for value in (stated, c3d.number("POINT:LONG_FRAMES")) if value]
    return [frames for frames in found if 0 < frames < MOST_FRAMES]


def _trial_frames(c3d: C3dDescription) -> tuple[int, int] | None:
    ends = []
    for name in ("TRIAL:ACTUAL_START_FIELD", "TRIAL:ACTUAL_END_FIELD"):
        words = c3d.values(name).ravel(order="F")
        if words.size < 2 or not np.isfinite(words[:2]).all():
            return None
        ends.append(sum(int(w) % (MOST_16_BITS + 1) * k for w, k in zip(words, (1, MOST_16_BITS + 1), strict=False)))
    return (ends[0], ends[1]) if 0 < ends[0] <= ends[1] else None


def read_points(c3d: C3dDescription, layout: Layout, points: list[int], *, length_m: float) -> np.ndarray:
    """(frames, len(points), 3) m of the points asked for (from 0); each point's path lies in one piece.

    NaN where the residual is negative, or all three numbers are zero.

    Args:
        length_m: metres in the file's unit.
    """
    scale = 1.0 if layout.floats else abs(c3d.header.scale or c3d.number("POINT:SCALE") or 1.0)
    wanted = slice(None) if points == list(range(layout.points)) else points
    out = np.empty((len(points), layout.frames, 3)).transpose(1, 0, 2)
    for rows, block in _chunks(c3d, layout):
        words = block[:, :4 * layout.points].reshape(len(block), layout.points, 4)[:, wanted]
        with np.errstate(invalid="ignore"):
            place = words[..., :3].astype(float)
        unseen = ~(np.abs(place) < LARGEST).all(axis=-1) | (place == 0.0).all(axis=-1) | ~(words[..., 3] >= 0.0)
        place[unseen] = np.nan
        place *= scale
        place *= length_m
        out[rows] = place
    return out


def read_analog(c3d: C3dDescription, layout: Layout, channels: list[int]) -> np.ndarray:
    """(samples, len(channels)) of the channels asked for (from 0), in their own units."""
    general = c3d.number("ANALOG:GEN_SCALE")
    unsigned = any(text.upper().startswith("UNSIGNED") for text in c3d.texts("ANALOG:FORMAT"))
    scales = _per_channel(c3d, "ANALOG:SCALE", channels, 1.0) * (1.0 if general is None else general)
    offsets = _per_channel(c3d, "ANALOG:OFFSET", channels, 0.0)
    if unsigned:
        offsets = np.where(offsets < 0.0, offsets + 65536.0, offsets)
    out = np.empty((layout.frames * layout.subframes, len(channels)))
    for rows, block in _chunks(c3d, layout, signed=not unsigned):
        samples = block[:, 4 * layout.points:].reshape(-1, layout.channels)[:, channels]
        with np.errstate(invalid="ignore", over="ignore"):
            out[rows.start * layout.subframes:rows.stop * layout.subframes] = (samples - offsets) * scales
    return out


def _per_channel(c3d: C3dDescription, name: str, channels: list[int], default: float) -> np.ndarray:
    """A parameter with one number a channel; it goes on in NAME2, ... beyond 255 channels."""
    value, i = c3d.values(name).ravel(order="F"), 2
    while (more := c3d.values(f"{name}{i}").ravel(order="F")).size:
        value, i = np.concatenate([value, more]), i + 1
    return np.array([value[c] if c < len(value) else default for c in channels])


def _chunks(c3d: C3dDescription, layout: Layout, *, signed: bool = True):
    """Slices of the frames with their numbers (frames, words)."""
    step = max(1, _CHUNK // layout.frame_bytes)
    with open(c3d.path, "rb") as stream:
        stream.seek(layout.start)
        for first in range(0, layout.frames, step):
            last = min(first + step, layout.frames)
            data = stream.read((last - first) * layout.frame_bytes)
            if len(data) != (last - first) * layout.frame_bytes:
                raise InputError("ends before its last frame", file=c3d.path, right="Is the file truncated?")
            numbers = c3d.numbers.floats(data) if layout.floats else c3d.numbers.integers(data, signed=signed)
            yield slice(first, last), numbers.reshape(last - first, layout.words)


# The header and the parameter section of a C3D file, checked against the file's size before anything is reserved.
#
# The format is that of the C3D user guide (Motion Lab Systems, https://www.c3d.org): a header block of 512 bytes, a
# chain of groups and parameters, then the frames; numbers in the manner of Intel, DEC or MIPS processors.


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
