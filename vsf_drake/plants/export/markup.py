"""XML text with numbers that are the same on every machine."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

DIGITS = 12
NOISE = 1e-15
"""Smaller values (SI) are what rounding left of zero."""


def number(value: float) -> str:
    """`value` with 12 significant digits: the thirteenth may differ from one machine's mathematics to another's."""
    return "0" if abs(value) < NOISE else f"{float(value):.{DIGITS}g}"


def numbers(values: Iterable[float]) -> str:
    """`values` as one attribute or element has them."""
    return " ".join(number(value) for value in values)


def element(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    """A new last child of `parent`."""
    child = ET.SubElement(parent, tag, attributes)
    child.text = text
    return child


def document(root: ET.Element, comment: str) -> str:
    """The whole file: declaration, `comment` of some lines, and the indented tree."""
    ET.indent(root)
    return (f'<?xml version="1.0" encoding="utf-8"?>\n<!--\n{comment.strip()}\n-->\n'
            f'{ET.tostring(root, encoding="unicode")}\n')
