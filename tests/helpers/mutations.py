"""Damage done to files: what a reader must survive."""

from __future__ import annotations

import random

_WORDS = [b"nan", b"-", b"1e308", b"-1e308", b"1e999", b"inf", b"", b"\t", b"\0", b"0", b"99999999999", b"-1", b"1,5",
          b"\xff\xfe", b"Time", b"endheader", b"1_000", b"\xc3\xa4", b"\r", b'"', b";", b"4294967296"]


def mutated(data: bytes, seed: int, *, head: int | None = None) -> bytes:
    """The data with one to six random damages; those of single bytes lie within `head` half of the time."""
    rng = random.Random(seed)
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 3, 6])):
        if not out:
            break
        at = rng.randrange(min(len(out), head)) if head and rng.random() < 0.5 else rng.randrange(len(out))
        match rng.randrange(8):
            case 0 | 1:
                out[at] = rng.randrange(256)
            case 2:
                out[at] ^= 1 << rng.randrange(8)
            case 3:
                del out[at:len(out) if rng.random() < 0.5 else at + rng.randrange(1, 600)]
            case 4:
                out[at:at] = rng.choice(_WORDS)
            case 5:
                word = rng.choice(_WORDS)
                out[at:at + len(word)] = word
            case _:
                _on_lines(out, rng)
    return bytes(out)


def _on_lines(out: bytearray, rng: random.Random) -> None:
    """Takes away, doubles, swaps or cuts a line, or changes one of its cells."""
    lines = bytes(out).split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[i]
        case 1:
            lines.insert(i, lines[i])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            lines[i] = lines[i][:rng.randrange(len(lines[i]) + 1)]
        case _:
            cells = lines[i].split(b"\t")
            cells[rng.randrange(len(cells))] = rng.choice([*_WORDS, str(rng.gauss(0, 1e4)).encode()])
            lines[i] = b"\t".join(cells)
    out[:] = b"\n".join(lines)
