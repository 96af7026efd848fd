"""Damage done to files, which a reader must survive: bytes and lines of any, nodes, headers and
values of some."""

from __future__ import annotations

import functools
import io
import json
import random
import re
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

HEADS = {".c3d": 3000, ".trc": 250, ".mot": 300, ".sto": 300, ".csv": 200, ".forces": 150}
"""Bytes at the beginning of a file, where every second damage of a byte lies."""
WORDS = [
    b"nan",
    b"-",
    b"1e308",
    b"-1e308",
    b"1e999",
    b"inf",
    b"",
    b"\t",
    b"\0",
    b"0",
    b"99999999999",
    b"-1",
    b"1,5",
    b"\xff\xfe",
    b"Time",
    b"endheader",
    b"1_000",
    b"\xc3\xa4",
    b"\r",
    b'"',
    b";",
    b"4294967296",
]
SCALARS = [
    "~",
    "",
    "{}",
    "[]",
    "[[[]]]",
    "{a: b}",
    "!!int ''",
    "!!int x",
    "!!bool x",
    "!!float ''",
    "!!timestamp x",
    "!!binary x",
    "!!set {a}",
    "!!omap x",
    "!!str",
    "!!python/object/apply:os.getcwd []",
    "!x 1",
    "1" * 400,
    "1" * 5000,
    "070",
    "0x1F",
    "1:18",
    "1_000",
    ".nan",
    ".inf",
    "-.inf",
    "1e999",
    "-1e-999",
    "1e",
    "yes",
    "2001-02-30",
    "2001-01-01",
    "-1",
    "0",
    "1.0e+4",
    "'1'",
    "?",
    "*a",
    "&a {x: *a}",
    "&a [*a]",
    "{<<: *a}",
    "{<<: {a: 1}}",
    "[" * 2000,
    "[" * 300 + "]" * 300,
    "{a: " * 300 + "}" * 300,
    "x" * 5000,
    "~nosuchuser/x",
    "~/x",
    "/dev/null",
    "/dev/zero",
    "a/../b",
    "..",
    '"\\0"',
    '"\\ud800"',
    '"\\e[31m"',
    '"\\u202e"',
    "$\\foo$",
    "a[/b]",
    "'=1+1'",
    "\t",
    "|",
    ">-\n  x",
    "{a: &a [x, x, x, x, x, x, x, x, x], b: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a], "
    "c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b], d: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c], "
    "e: &e [*d, *d, *d, *d, *d, *d, *d, *d, *d], f: &f [*e, *e, *e, *e, *e, *e, *e, *e, *e], "
    "g: &g [*f, *f, *f, *f, *f, *f, *f, *f, *f], h: [*g, *g, *g, *g, *g, *g, *g, *g, *g]}",
]
"""What may stand where YAML has a value."""
VALUES: list[Any] = [
    None,
    True,
    "",
    "x",
    "\ud800",
    "\x1b[31m",
    "a[/b]",
    "$\\foo$",
    "<b>",
    "../x",
    "x" * 5000,
    0,
    -1,
    1.5,
    float("nan"),
    float("inf"),
    -1e308,
    10**400,
    [],
    [[]],
    {},
    {"a": None},
    [1, 2],
    ["x"] * 50,
]
"""What may stand where JSON has a value."""


def mutated(data: bytes, suffix: str, rng: random.Random) -> bytes:
    """The data with one to six random damages; half of the time such as its kind of file invites,
    if it has one."""
    kinds: dict[str, Callable[[bytes, random.Random], bytes]] = {
        ".yaml": _yaml,
        ".json": _json,
        ".npz": _npz,
        ".c3d": _c3d,
    }
    if suffix in kinds and rng.random() < 0.5:
        return kinds[suffix](data, rng)
    return _bytes(data, rng, HEADS.get(suffix))


def _bytes(data: bytes, rng: random.Random, head: int | None) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 3, 6])):
        if not out:
            break
        at = (
            rng.randrange(min(len(out), head))
            if head and rng.random() < 0.5
            else rng.randrange(len(out))
        )
        match rng.randrange(8):
            case 0 | 1:
                out[at] = rng.randrange(256)
            case 2:
                out[at] ^= 1 << rng.randrange(8)
            case 3:
                del out[at : len(out) if rng.random() < 0.5 else at + rng.randrange(1, 600)]
            case 4:
                out[at:at] = rng.choice(WORDS)
            case 5:
                word = rng.choice(WORDS)
                out[at : at + len(word)] = word
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
            lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
        case _:
            cells = lines[i].split(b"\t")
            cells[rng.randrange(len(cells))] = rng.choice([*WORDS, str(rng.gauss(0, 1e4)).encode()])
            lines[i] = b"\t".join(cells)
    out[:] = b"\n".join(lines)


def _yaml(data: bytes, rng: random.Random) -> bytes:
    """Another value, or another key, where one stands."""
    text = data.decode()
    at, to = rng.choice(_yaml_spans(text))
    return (text[:at] + rng.choice(SCALARS) + text[to:]).encode()


def _npz(data: bytes, rng: random.Random) -> bytes:
    """Another shape, type or content of one array; another file, or one member less."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    head = members[name].find(b"\n") + 1
    match rng.randrange(5):
        case 0:
            return rng.choice([b"", b"PK\5\6" + bytes(18), b"\x93NUMPY", b"\x80\4N."])
        case 1:
            del members[name]
        case 2:
            shape = rng.choice(
                [b"(10000000000000,)", b"(-1,)", b"(0,)", b"()", b"(1, 1, 1)", b"(True,)", b"'x'"]
            )
            members[name] = _header(members[name], rb"'shape': \(.*?\)", b"'shape': " + shape)
        case 3:
            kind = rng.choice(
                [
                    b"'|O'",
                    b"'<U1000000000'",
                    b"'>f4'",
                    b"'|V8'",
                    b"'<M8[s]'",
                    b"'<c16'",
                    b"'x'",
                    b"None",
                ]
            )
            members[name] = _header(members[name], rb"'descr': '.*?'", b"'descr': " + kind)
        case _:
            at = head + 8 * rng.randrange((len(members[name]) - head) // 8 + 1)
            number = np.array(rng.choice([np.nan, np.inf, -1e308, 0.0, -1.0])).tobytes()
            members[name] = members[name][:at] + rng.choice([number, b""]) + members[name][at + 8 :]
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return stream.getvalue()


def _header(member: bytes, pattern: bytes, new: bytes) -> bytes:
    size = int.from_bytes(member[8:10], "little")
    head = re.sub(pattern, new, member[10 : 10 + size])
    return member[:8] + len(head).to_bytes(2, "little") + head + member[10 + size :]


@functools.cache
def _yaml_spans(text: str) -> list[tuple[int, int]]:
    """Where the nodes stand, keys too."""
    spans, todo = [], [yaml.compose(text, Loader=yaml.SafeLoader)]
    while todo:
        node = todo.pop()
        spans.append((node.start_mark.index, node.end_mark.index))
        if not isinstance(node, yaml.ScalarNode):
            todo += [
                part
                for item in node.value
                for part in (item if isinstance(item, tuple) else (item,))
            ]
    return spans


def _json(data: bytes, rng: random.Random) -> bytes:
    """A value that is another, gone or buried somewhere in the tree."""
    if rng.random() < 0.05:
        return b'{"a":' * 100_000 if rng.random() < 0.5 else b"[" * 100_000
    tree = json.loads(data)
    places = [(tree, key) for key in tree]
    for holder, key in places:
        value = holder[key]
        if isinstance(value, dict | list):
            places += [
                (value, inner)
                for inner in (value if isinstance(value, dict) else range(len(value)))
            ]
    holder, key = rng.choice(places)
    if rng.random() < 0.2:
        del holder[key]
    else:
        holder[key] = rng.choice(VALUES)
    return json.dumps(tree).encode()


def _c3d(data: bytes, rng: random.Random) -> bytes:
    """Another size, type or value of one of the parameters, or two of them exchanged."""
    out = bytearray(data)
    names = [m for m in re.finditer(rb"[A-Z][A-Z_]{3,}", data[512 : HEADS[".c3d"] + 4096])]
    at = 512 + rng.choice(names).end() + rng.randrange(24)
    value = rng.choice(
        [
            b"\0",
            b"\xff",
            b"\x7f",
            b"\0\0",
            b"\xff\xff",
            *(
                np.float32(x).tobytes()
                for x in (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-38, 3e38, 1e6)
            ),
        ]
    )
    out[at : at + len(value)] = value
    return bytes(out)
