"""Force files of Motion Analysis Cortex (.forces): N, mm, and N mm for the free moment about the vertical.

No unit stands in the file. That MZ is the free moment at the centre of pressure in N mm is the reading under which a
walking foot has the few N m that it should have.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.force_tables import Table
from vsf_drake.motion.formats.text import as_label, fitted_rows, text_lines

LENGTH_M = 1e-3
_HEADER_LINES = 50


def read_cortex(path: Path) -> tuple[Table, float, None]:
    """The table and its rate (1/s); the file has no clock.

    Raises:
        InputError: labels or rate are missing, a row does not fit, samples are missing.
    """
    lines = text_lines(path)
    head, labels = _read_header(lines, path)
    try:
        rate, samples = float(head["samplerate"]), float(head.get("numberofsamples", "nan"))
    except (KeyError, ValueError):
        raise InputError("there is no SampleRate", file=path, where="header") from None
    if not 0.0 < rate < 1e6:
        raise InputError(f"a SampleRate of {rate:g} makes no sense", file=path, where="header")
    table, places = fitted_rows(lines, labels, path, "\t")
    if samples > len(table):
        raise InputError(f"the header says {samples:.0f} samples, the file has {len(table)}", file=path,
                         where="NumberOfSamples", right="Is the file truncated?")
    wrong = np.diff(table[:, 0]) != 1.0
    if len(table) < 2 or wrong.any():
        where = f"line {places[int(np.argmax(wrong)) + 1]}" if len(table) > 1 else None
        raise InputError("samples are missing or out of order", file=path, where=where,
                         right="Their numbers must follow each other")
    columns = {label: table[:, i] for i, label in enumerate(labels) if i}
    return Table(path, columns, places, LENGTH_M), rate, None


def _read_header(lines: Iterator[tuple[int, str]], path: Path) -> tuple[dict[str, str], list[str]]:
    """The keys (lower case) with their values, and the labels."""
    head: dict[str, str] = {}
    for number, line in lines:
        if line.startswith("#"):
            labels = [as_label(cell) for cell in line.lstrip("#").rstrip().split("\t")]
            if len(labels) < 2 or len(set(labels)) < len(labels) or "" in labels:
                raise InputError("a label is empty or stands twice", file=path, where=f"line {number}")
            return head, labels
        key, _, value = line.partition("=")
        head[key.strip().lower()] = value.strip()
        if number > _HEADER_LINES:
            break
    raise InputError("there is no line of labels that begins with #Sample", file=path)
