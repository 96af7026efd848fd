"""What a foot by the clauses of a test leaves on disk, all of it or nothing, and its page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.base.files import plain, record
from vsf_drake.device.bench_metrics import LOAD_N
from vsf_drake.device.bench_protocol import FORMAT, BenchProtocol, ProtocolRow, ProtocolTable
from vsf_drake.device.protocols import PRESS
from vsf_drake.report.page import Chapter, number, render, write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import (
    HEEL_COLOUR,
    LINES,
    MARKERS,
    NEUTRAL,
    PANEL,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    legend_below,
)

CSV = "protocol.csv"
_RINGS = 4
_CIRCLE = (0.2, 0.2, 0.6, 0.67)  # of the picture: left, bottom, width, height
_NAMES_AT = 1.06  # where names of axes stand, in radii


def protocol_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of protocol.json and protocol.npz."""
    table = record(ProtocolTable, saved)
    answered = [row for row in table.rows if row.computed]
    drawn = shown_settings(table)
    axes = [row for row in table.rows if row.clause.axis]
    facts = {
        "t": table,
        "beyond": table.settings[0].fulcrum_mm is not None and table.load_n > LOAD_N,
        "published_n": LOAD_N,
        "widest": axes[_widest(axes)],
        "answered": [
            {"clause": row.clause, "values": [number(v, row.clause.form) for v in row.values]}
            for row in answered
        ],
        "blank": [row.clause for row in table.rows if not row.computed],
        "pressed": any(name.startswith("load_n/") for name in arrays),
        "returned": [
            100.0 * value
            for row in answered
            if row.clause.quantity == "returned_share"
            for value in row.values
            if value is not None
        ],
        "rolled": any(name.startswith("forward_m/") for name in arrays),
        "drawn": drawn,
        "columns": [setting.setting_short for setting in table.settings],
    }
    figures = {"radar": radar_figure(table, drawn)}
    if facts["pressed"]:
        figures["curves"] = curves_figure(table, arrays)
    if facts["rolled"]:
        figures["shape"] = shape_figure(table, arrays)
    return {
        "title": table.title,
        "chapters": [
            Chapter(
                name="answer",
                title="",
                template="protocol/answer.html.j2",
                figures=figures,
                facts=facts,
                missing=table.missing,
            ),
            Chapter(
                name="made",
                title="Angles, loads, sources",
                template="protocol/made.html.j2",
                facts=facts,
            ),
        ],
        "synthetic": False,
        "first_line": render("protocol/first_line.txt.j2"),
    }


PROTOCOL = ResultsFolder(
    kind="bench protocol",
    command="bench --protocol",
    table="protocol.json",
    arrays="protocol.npz",
    names=(CSV,),
    show=protocol_page,
    known=lambda table: str(table.get("format")).startswith(FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: _of_this_format(table),
)


def write_protocol(out: str | Path, made: BenchProtocol) -> None:
    """Writes table, curves, CSV, page and figures; see `ResultsFolder.write`."""

    def more(folder: Path, _: dict[str, Any]) -> None:
        rows = list(csv_rows(made.table))
        write_csv(folder / CSV, rows[0], (row.values() for row in rows))

    PROTOCOL.write(out, plain(made.table), made.arrays, more=more)


def csv_rows(table: ProtocolTable) -> Iterator[dict[str, Any]]:
    """One row a clause and setting, one of a clause that is not computed; a value is in its
    `unit`."""
    for row in table.rows:
        own = row.clause
        for i, value in enumerate(row.values or (None,)):
            yield {
                "protocol": table.protocol,
                "clause": own.clause,
                "test": own.test,
                "part": own.part,
                "quantity": own.label,
                "value": value,
                "unit": own.unit,
                "fulcrum_mm": table.settings[i].fulcrum_mm if row.computed else None,
                "setting": table.settings[i].setting_short if row.computed else "",
                "angle_deg": own.angle_deg,
                "load_n": table.load_n if row.computed else None,
                "computed": row.computed,
                "why_not": own.why_not,
                "limit_or_code": own.follows,
                "conditions": own.conditions,
                "source": own.source,
            }


def _of_this_format(table: Mapping[str, Any]) -> None:
    if table.get("format") != FORMAT:
        raise ValueError(f"its format is {table.get('format')!r}, not {FORMAT!r}")
    record(ProtocolTable, table)


def shown_settings(table: ProtocolTable) -> list[int]:
    """Of the settings those that a picture has room for: the first, the middle, the last."""
    last = len(table.settings) - 1
    return sorted({0, last // 2, last})


def radar_figure(table: ProtocolTable, drawn: list[int]) -> Figure:
    """Every quantity with an axis, from 0 in the middle to the end of its axis at the rim."""
    rows = [row for row in table.rows if row.clause.axis]
    ends = np.array([_axis_end(row) for row in rows])
    values = np.array([[row.values[i] for i in drawn] for row in rows], dtype=np.float64)
    shares = values / ends[:, None]
    turns = np.linspace(0.0, 2.0 * np.pi, len(rows), endpoint=False)
    looks = [
        {**_look(table, i), "marker": MARKERS[k], "markersize": 4} for k, i in enumerate(drawn)
    ]
    with drawing(1.15 * PANEL[0], 1.1 * PANEL[0]) as figure:
        figure.set_layout_engine("none")  # it does not see the names of the axes
        axes = figure.add_axes(
            _CIRCLE, projection="polar", theta_offset=0.5 * np.pi, theta_direction=-1
        )
        for share, look in zip(shares.T, looks, strict=True):
            axes.plot(
                np.append(turns, turns[0]),
                np.append(share, share[0]),
                linewidth=1.6,
                clip_on=False,
                **look,
            )
        axes.set_ylim(0.0, 1.0)
        axes.set_yticks(np.arange(1, _RINGS + 1) / _RINGS, [])
        axes.set_xticks(turns, [])
        for row, end, turn in zip(rows, ends, turns, strict=True):
            unit = "" if row.clause.unit == "1" else f" {row.clause.unit}"
            aside = round(np.sin(turn), 6)
            above = round(np.cos(turn), 6)
            axes.text(
                turn,
                _NAMES_AT,
                "\n".join((*row.clause.axis.split(" ", 1), f"to {end:g}{unit}")),
                ha=("center", "left", "right")[int(np.sign(aside))],
                va=("center", "bottom", "top")[int(np.sign(above))],
            )
        axes.spines["polar"].set_color(NEUTRAL)
        names = [table.settings[i].setting_short for i in drawn]
        legend_below(figure, [entry(name, **look) for name, look in zip(names, looks, strict=True)])
    return figure


def _widest(rows: list[ProtocolRow]) -> int:
    """The row whose values differ most between settings, over the end of its axis."""
    known = [[value for value in row.values if value is not None] or [0.0] for row in rows]
    return int(
        np.argmax([np.ptp(own) / _axis_end(row) for own, row in zip(known, rows, strict=True)])
    )


def _axis_end(row: ProtocolRow) -> float:
    """The value at the rim: the clause's, doubled until all values fit."""
    end = row.clause.axis_end or 1.0
    largest = max((value for value in row.values if value is not None), default=0.0)
    while largest > end:
        end *= 2.0
    return end


def curves_figure(table: ProtocolTable, arrays: Arrays) -> Figure:
    """Load over displacement of every part that is pressed."""
    parts = dict.fromkeys(row.clause.part for row in table.rows if row.clause.method == PRESS)
    with drawing(PANEL[0], 0.75 * PANEL[1] * len(parts)) as figure:
        panels = figure.subplots(len(parts), 1, squeeze=False).ravel()
        for axes, part in zip(panels, parts, strict=True):
            for i in range(len(table.settings)):
                if f"load_n/{part}_{i}" in arrays:
                    axes.plot(
                        arrays[f"displacement_mm/{part}_{i}"],
                        arrays[f"load_n/{part}_{i}"],
                        **_look(table, i),
                    )
            label(axes, x="displacement (mm)", y="load (N)", title=part)
        legend_below(figure, _entries(table))
    return figure


def shape_figure(table: ProtocolTable, arrays: Arrays) -> Figure:
    """Where the centre of pressure goes, seen from the pylon, up to the second peak."""
    with drawing(PANEL[0], 0.65 * PANEL[1]) as figure:
        axes = figure.subplots()
        for i in range(len(table.settings)):
            if f"forward_m/{i}" in arrays:
                axes.plot(
                    1e3 * arrays[f"forward_m/{i}"],
                    1e3 * arrays[f"up_m/{i}"],
                    **_look(table, i),
                )
        axes.set_aspect("equal")
        label(axes, x="forward of the pylon (mm)", y="up (mm)")
        legend_below(figure, _entries(table))
    return figure


def _look(table: ProtocolTable, i: int) -> dict[str, Any]:
    """Of the line of a setting, the same in every figure."""
    several = len(table.settings) > 1
    return {
        "color": colour_of(table.settings[i]) if several else HEEL_COLOUR,
        "linestyle": LINES[i % len(LINES)],
    }


def _entries(table: ProtocolTable) -> list[Any]:
    return [entry(at.setting_short, **_look(table, i)) for i, at in enumerate(table.settings)]
