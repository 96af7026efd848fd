"""What a certificate leaves on disk, all of it or nothing, and its page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.base.files import record
from vsf_drake.engines.certificate.rows import Judged
from vsf_drake.engines.certificate.run import ENGINES, FORMAT, REFERENCE, Certificate, Ran
from vsf_drake.engines.condensed import CENTRE_WITHIN_M, ENERGY_WITHIN, FORCE_WITHIN
from vsf_drake.report.page import Chapter, render
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import (
    PANEL,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    legend_below,
    log_scale,
)

COLOURS = {
    REFERENCE: "black",
    "drake": "#0072b2",
    "opensim": "#d55e00",
    "mujoco": "#009e73",
    "moco": "#cc79a7",
    "exudyn": "#e69f00",
}
MARKS = {"drake": "o", "opensim": "s", "mujoco": "^", "exudyn": "x"}
"""Of the programs, each once."""
FIGURES = {
    "rise_m": "How far the load point rises",
    "roll_nominal_n": "Rolled over by the foot's own law, without friction",
    "roll_elastic_n": "Rolled over without damping of the spheres, without friction",
    "roll_own_n": "Rolled over by each engine's own contact, with friction",
}
"""What figures show, by the answers that they show."""
_LEAST_PERCENT = 1e-5
"""Difference below which it is drawn as this."""


def certificate_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of certificate.json and certificate.npz."""
    engines = [record(Ran, each) for each in saved["engines"]]
    rows = [record(Judged, each) for each in saved["rows"]]
    labels = {each.name: each.label for each in engines}
    ran = [each for each in engines if not each.status]
    drawn = {stem: title for stem, title in FIGURES.items() if len(_answers(arrays, stem)) > 1}
    facts = {
        "agreed": saved["agreed"],
        "rows": [{**vars(row), "met": row.met, "label": labels[row.engine]} for row in rows],
        "labels": labels,
        "engines": [{**vars(each), "status": each.status or "answered"} for each in engines],
        "silent": [each for each in engines if each.status],
        "others": [each for each in ran if each.name in MARKS],
        "figures": drawn,
        "least_percent": _LEAST_PERCENT,
        "condensed": saved["condensed"],
        "condensed_within": {
            "force": FORCE_WITHIN,
            "centre_m": CENTRE_WITHIN_M,
            "energy": ENERGY_WITHIN,
        },
        "provenance": saved["provenance"],
        "fulcrum_mm": arrays["asked/fulcrum_mm"].tolist(),
        "loads_n": arrays["asked/load_n"].tolist(),
        "duration_s": arrays["asked/time_s"][-1],
        "roll_fulcrum_mm": arrays["asked/roll_fulcrum_mm"],
        "poses": len(arrays["asked/poses_rad"]),
        "largest_angle_rad": np.abs(arrays["asked/poses_rad"]).max(),
    }
    return {
        "title": "Certificate: do other engines compute the same foot?",
        "chapters": [
            Chapter(
                name="answer",
                title="",
                template="certificate/answer.html.j2",
                figures={
                    stem: keel_figure(arrays, labels)
                    if stem == "rise_m"
                    else roll_figure(arrays, labels, stem)
                    for stem in drawn
                },
                facts=facts,
            ),
            Chapter(
                name="made",
                title="How it was made",
                template="certificate/made.html.j2",
                facts=facts,
            ),
        ],
        "synthetic": False,
        "first_line": render("certificate/first_line.txt.j2", others=facts["others"]),
    }


CERTIFICATE = ResultsFolder(
    kind="certificate",
    command="certify",
    table="certificate.json",
    arrays="certificate.npz",
    show=certificate_page,
    known=lambda table: table.get("format") == FORMAT,
)


def write_certificate(out: str | Path, certificate: Certificate) -> None:
    """Writes a certificate, its page, figures and tables; see `ResultsFolder.write`."""
    CERTIFICATE.write(out, certificate.table, certificate.arrays)


def keel_figure(arrays: Arrays, labels: Mapping[str, str]) -> Figure:
    """Rise of the load point over the load, and how far the engines differ."""
    answers = _answers(arrays, "rise_m")
    own = answers[REFERENCE]
    load_n = arrays["asked/load_n"]
    with drawing(PANEL[0], 1.7 * PANEL[1]) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        for i, mm in enumerate(arrays["asked/fulcrum_mm"]):
            colour = colour_of(mm)
            above.plot(load_n, 1e3 * own[i], color=colour, linewidth=1.2)
            above.annotate(
                f"{mm:g} mm",
                (load_n[-1], 1e3 * own[i, -1]),
                (4, 0),
                textcoords="offset points",
                color=colour,
                va="center",
                annotation_clip=False,
            )
        for name, rise in answers.items():
            if name == REFERENCE:
                continue
            look = {"color": COLOURS[name], "marker": MARKS[name], "markersize": 4}
            above.plot(load_n, 1e3 * rise.T, linestyle="", fillstyle="none", **look)
            percent = 100.0 * np.abs(rise / own - 1.0).max(axis=0)
            below.plot(load_n, np.maximum(percent, _LEAST_PERCENT), linewidth=1.0, **look)
        log_scale(below.yaxis)
        label(above, x="", y="rise (mm)")
        label(below, x="load (N)", y="largest difference (%)")
        legend_below(
            figure,
            [
                entry(labels[name], color=COLOURS[name], marker=MARKS.get(name, ""))
                for name in answers
            ],
        )
    return figure


def roll_figure(arrays: Arrays, labels: Mapping[str, str], answer: str) -> Figure:
    """Vertical force of every engine over the stance, and its difference from this package's."""
    answers = _answers(arrays, answer)
    own = answers[REFERENCE]
    time_s = arrays["asked/time_s"]
    with drawing(PANEL[0], 1.7 * PANEL[1]) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        for name, force in answers.items():
            above.plot(time_s, force, color=COLOURS[name], linewidth=1.2)
            if name != REFERENCE:
                percent = np.maximum(100.0 * np.abs(force - own) / own.max(), _LEAST_PERCENT)
                below.plot(time_s, percent, color=COLOURS[name], linewidth=0.9)
        log_scale(below.yaxis)
        label(above, x="", y="force (N)")
        label(below, x="time (s)", y="difference over the peak (%)")
        legend_below(figure, [entry(labels[name], color=COLOURS[name]) for name in answers])
    return figure


def _answers(arrays: Arrays, answer: str) -> dict[str, np.ndarray]:
    """Of the engines that have it, this package first."""
    return {name: arrays[f"{name}/{answer}"] for name in ENGINES if f"{name}/{answer}" in arrays}
