"""Reads what Meshcat wrote into a page: the commands (MessagePack in base64) and the animation in
them."""

from __future__ import annotations

import base64
import re
import struct

import numpy as np

_NUMBERS = {
    0xCA: ">f",
    0xCB: ">d",
    0xCC: ">B",
    0xCD: ">H",
    0xCE: ">I",
    0xCF: ">Q",
    0xD0: ">b",
    0xD1: ">h",
    0xD2: ">i",
    0xD3: ">q",
}
_SIZED = {
    0xC4: (">B", "bin"),
    0xC5: (">H", "bin"),
    0xC6: (">I", "bin"),
    0xD9: (">B", "str"),
    0xDA: (">H", "str"),
    0xDB: (">I", "str"),
    0xDC: (">H", "list"),
    0xDD: (">I", "list"),
    0xDE: (">H", "dict"),
    0xDF: (">I", "dict"),
    0xC7: (">B", "ext"),
    0xC8: (">H", "ext"),
    0xC9: (">I", "ext"),
}
_FIXED_EXT = {0xD4: 1, 0xD5: 2, 0xD6: 4, 0xD7: 8, 0xD8: 16}


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, count: int) -> bytes:
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, code: str):
        return struct.unpack(code, self.take(struct.calcsize(code)))[0]

    def sized(self, kind: str, count: int):
        if kind == "str":
            return self.take(count).decode()
        if kind == "bin":
            return self.take(count)
        if kind == "ext":
            return self.take(count + 1)
        if kind == "list":
            return [self.value() for _ in range(count)]
        return {self.value(): self.value() for _ in range(count)}

    def value(self):
        tag = self.take(1)[0]
        if tag < 0x80 or tag >= 0xE0:
            return tag if tag < 0x80 else tag - 0x100
        if tag < 0xC0:
            kind, mask = (
                ("dict", 0x0F) if tag < 0x90 else ("list", 0x0F) if tag < 0xA0 else ("str", 0x1F)
            )
            return self.sized(kind, tag & mask)
        if tag in (0xC0, 0xC2, 0xC3):
            return {0xC0: None, 0xC2: False, 0xC3: True}[tag]
        if tag in _NUMBERS:
            return self.number(_NUMBERS[tag])
        if tag in _FIXED_EXT:
            return self.take(_FIXED_EXT[tag] + 1)
        code, kind = _SIZED[tag]
        return self.sized(kind, self.number(code))


def commands(page: str) -> list[dict]:
    """Every command that the page gives its viewer, in order."""
    found = re.findall(r'fetch\("data:application/octet-binary;base64,([^"]*)"\)', page)
    return [_Reader(base64.b64decode(text)).value() for text in found]


def tracks(page: str) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Path -> property -> (frames, values) of the page's animation."""
    found = {}
    for command in commands(page):
        if command["type"] == "set_animation":
            for part in command["animations"]:
                own = found.setdefault(part["path"], {})
                for track in part["clip"]["tracks"]:
                    keys = track["keys"]
                    own[track["name"].removeprefix(".")] = (
                        np.array([key["time"] for key in keys]),
                        np.array([key["value"] for key in keys]),
                    )
    return found
