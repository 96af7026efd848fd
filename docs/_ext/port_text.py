"""Reads what a docstring says of a system: its ports, their sizes and meanings, its parameters.

Used by the documentation, which shows it, and by the tests, which compare it with the ports that
the system declares. A docstring says it so:

    Inputs: body_poses, of all bodies. Outputs: normal_force (N,) N, >= 0; depth (N,) m.

    Parameters in the Context: stiffness, exponent. A scalar stands for N equal values.

A vector's name is followed by its size in brackets, an abstract port's by what it is; names that
share both may share them (`depth and depth_rate (N,)`). What follows, up to a semicolon or the end
of the sentence, is its meaning.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

_HEADERS = (
    "Inputs|Outputs|Wiring|Args|Parameters in the "
    "Context|Raises|Returns|Attributes|Example|Source|Validity"
)
_SECTION = re.compile(rf"(?:^|(?<=[.\s]))({_HEADERS}):")


@dataclass(frozen=True)
class Port:
    """A port as the docstring explains it; `size` is None where no size stands, `text` "" where
    nothing follows."""

    name: str
    size: str | None
    text: str


@dataclass(frozen=True)
class PortBlock:
    """Names of a system's ports, in their order."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def port_block(docstring: str | None) -> PortBlock | None:
    """What the sections `Inputs` and `Outputs` list, or None without them."""
    texts = sections(docstring)
    return (
        PortBlock(_listed(texts.get("Inputs", "")), _listed(texts["Outputs"]))
        if "Outputs" in texts
        else None
    )


def _listed(text: str) -> tuple[str, ...]:
    """Names at the beginning of the parts of the first sentence, which semicolons separate; two may
    share a part."""
    parts = re.split(r";(?![^\[\]]*\])", re.split(r"\.(?=\s|$)", text)[0])
    return tuple(
        name
        for part in parts
        if part.strip()
        for name in re.findall(r"^\s*\w+(?: and \w+)?", part)[0].strip().split(" and ")
    )


def sections(docstring: str | None) -> dict[str, str]:
    """Text behind each of the headers (`Inputs`, `Outputs`, ...), on one line."""
    text = inspect.cleandoc(docstring or "").replace("`", "")
    marks = list(_SECTION.finditer(text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)]
    found: dict[str, str] = {}
    for mark, end in zip(marks, ends, strict=False):
        found.setdefault(mark[1], " ".join(text[mark.end() : end].split()))
    return found


def ports(text: str, names: tuple[str, ...]) -> dict[str, Port]:
    """What `text` (a section) says of each of the ports `names`; those that it does not name are
    missing."""
    any_name = "|".join(sorted(map(re.escape, names), key=len, reverse=True)) or "(?!)"
    found = {}
    for name in names:
        entry = re.search(
            rf"(?<!\w){re.escape(name)}(?!\w)((?:(?:,| and|,? and) (?:{any_name})(?!\w))*)(.*)",
            text,
        )
        if entry:
            size, rest = _leading_bracket(entry[2])
            found[name] = Port(name, _size(size), _meaning(size, rest))
    return found


def _leading_bracket(text: str) -> tuple[str | None, str]:
    """What stands in the bracket that `text` begins with, and the rest; None where it begins
    otherwise."""
    stripped = text.lstrip()
    if not stripped.startswith("("):
        return None, text
    depth = 0
    for i, character in enumerate(stripped):
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return stripped[1:i], stripped[i + 1 :]
    return None, text


def _size(bracket: str | None) -> str | None:
    """The first thing in the bracket: `(3, N in W)` and `(3,)` are 3, `(2 p: positions, ...)` is
    2 p."""
    return None if bracket is None else re.split(r"[,:]", bracket)[0].strip()


def _meaning(bracket: str | None, rest: str) -> str:
    inside = re.split(r"[,:]", bracket, maxsplit=1)[1:] if bracket else []
    outside = re.split(r";(?![^\[\]]*\])|\.(?=\s|$)", rest)[0].strip(" ,:")
    return ", ".join(part for part in (*(piece.strip() for piece in inside), outside) if part)


def listed_parameters(text: str, known: Iterable[str]) -> set[str]:
    """Which of the `known` names the section `Parameters in the Context` lists, and what it lists
    beside them.

    A plain list of names is taken literally. Where sizes and units stand between them, what is not
    known but has an underscore is taken for a name; `laws.some_name` and what stands in brackets is
    not.
    """
    first = re.split(r"\.(?=\s|$)", text)[0]
    if re.fullmatch(r"\w+(, \w+| and \w+)*", first):
        return set(re.split(r", | and ", first))
    words = set(re.findall(r"(?<![\w.])\w+(?!\w|\.\w)", re.sub(r"\([^()]*\)", "", text)))
    return {word for word in words if word in set(known) or "_" in word.strip("_")}


def disagreements(
    docstring: str | None, declared: Iterable[tuple[str, str, int | None]]
) -> list[str]:
    """What the docstring does not say of the `declared` ports, or says otherwise; a sentence each.

    A symbol (`N`) means the same number wherever it stands; which, its first use tells.

    Args:
        declared: section (Inputs or Outputs), name, and size (None for an abstract port) of each
            port.
    """
    declared, texts, found = list(declared), sections(docstring), []
    sizes: list[tuple[str, str, int]] = []
    for section in ("Inputs", "Outputs"):
        names = tuple(name for kind, name, _ in declared if kind == section)
        known = ports(texts.get(section, ""), names)
        for _, name, size in (port for port in declared if port[0] == section):
            if name not in known:
                found.append(f"{name} is not explained under {section}:")
            elif size is None and not known[name].text:
                found.append(f"of {name} nothing is said under {section}:")
            elif size is not None and known[name].size is None:
                found.append(f"{name} has no size in brackets under {section}:")
            elif size is not None:
                sizes.append((name, known[name].size or "", size))
    return found + _wrong_sizes(sizes)


def _wrong_sizes(sizes: list[tuple[str, str, int]]) -> list[str]:
    """Those of (name, written size, declared size) that do not agree."""
    symbols: dict[str, int] = {}
    for _, written, size in sorted(sizes, key=lambda entry: len(entry[1])):  # bare symbols first
        alone = re.fullmatch(r"(?:(\d+) )?([A-Za-z]\w*)", written)
        if alone:
            symbols.setdefault(alone[2], size // int(alone[1] or 1))
    found = []
    for name, written, size in sizes:
        try:
            value = evaluate_size(written, symbols)
        except KeyError as missing:
            if len(set(re.findall(r"[A-Za-z]\w*", written)) - set(symbols)) > 1:
                continue  # two unknowns: not for us to tell
            symbols[missing.args[0]] = size - evaluate_size(
                written, {**symbols, missing.args[0]: 0}
            )
            value = evaluate_size(written, symbols)
        if value != size:
            found.append(f"{name} has size {size}, not {written} = {value}")
    return found


def evaluate_size(size: str, symbols: Mapping[str, int]) -> int:
    """The number that a size such as `3`, `3 N` or `nq + nv` stands for.

    Raises:
        KeyError: a symbol is not among `symbols`.
        ValueError: it is no such expression.
    """
    return _number(
        ast.parse(re.sub(r"(\w)\s+(?=\w)", r"\1 * ", size), mode="eval").body, size, symbols
    )


def _number(node: ast.expr, size: str, symbols: Mapping[str, int]) -> int:
    match node:
        case ast.Constant(value=int(value)):
            return value
        case ast.Name(id=name):
            return symbols[name]
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _number(left, size, symbols) + _number(right, size, symbols)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _number(left, size, symbols) * _number(right, size, symbols)
    raise ValueError(f"{size!r} is no size: a number, a symbol, or sums and products of them")
