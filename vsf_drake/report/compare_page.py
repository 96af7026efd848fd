"""What a comparison of two sides leaves on disk, all of it or nothing, and its page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.base.files import plain, record, write_text
from vsf_drake.report.page import UNKNOWN, Chapter, number, render
from vsf_drake.report.recorded_replay import REPLAY
from vsf_drake.report.replay import ForceFrames, ReplayFrames, Shown, replay_page
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import PANEL, Arrays, drawing, label, say_synthetic, tag
from vsf_drake.walks.answer import standing_on
from vsf_drake.walks.comparison import PERCENT, THRESHOLD_N
from vsf_drake.walks.difference import (
    DIFFERENCES,
    JOINTS,
    MOMENT,
    DifferenceTable,
    Side,
    difference_sentences,
)

COLOURS = {"A": "#31688e", "B": "#c8553d"}
FORCE_PANELS = {
    "vertical": ("vertical", "BW", 1.0),
    "fore_aft": ("fore-aft, forward +", "BW", 1.0),
    "medio_lateral": ("medio-lateral, to the midline +", "BW", 1.0),
    "cop": ("centre of pressure, fore-aft", "mm", 1e3),
}
JOINT_WORDS = {"hip_flexion": "hip flexion", "knee_angle": "knee flexion", "ankle_angle": "ankle"}
JOINT_PANELS = {
    f"{leg}_{joint}": (f"{leg} {JOINT_WORDS[joint]}", "degrees", 1.0)
    for leg in ("prosthetic", "intact")
    for joint in JOINTS
} | {
    f"prosthetic_{MOMENT}{joint}": (f"prosthetic {JOINT_WORDS[joint]} moment", "N m/kg", 1.0)
    for joint in JOINTS
}
"""By curve of a side: title, unit, and what the curve is multiplied by."""
STEP_PERCENT = 2.0  # of stance, from frame to frame of the replay


def compare_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of compare.json and compare.npz."""
    table = record(DifferenceTable, saved["table"])
    synthetic = table.a.synthetic or table.b.synthetic
    joints = {name: own for name, own in JOINT_PANELS.items() if f"a/{name}" in arrays}
    facts = {
        "joints": bool(joints),
        "t": table,
        "sentences": difference_sentences(table),
        "rows": difference_rows(table),
        "meanings": DIFFERENCES.values(),
        "replay": REPLAY if (folder / REPLAY).exists() else "",
        "provenance": saved["provenance"],
    }
    chapters = [
        Chapter(
            name="answer",
            title="",
            template="compare/answer.html.j2",
            figures={"force": curve_figure(FORCE_PANELS, arrays, synthetic)},
            facts=facts,
        ),
        Chapter(
            name="joints",
            title="Joint angles and moments",
            template="compare/joints.html.j2",
            figures={"joints": curve_figure(joints, arrays, synthetic)} if joints else {},
            facts=facts,
        ),
        Chapter(
            name="made", title="What was compared", template="compare/made.html.j2", facts=facts
        ),
    ]
    return {
        "title": "Two sides compared",
        "chapters": chapters,
        "synthetic": synthetic,
        "first_line": str(render("compare/first_line.txt.j2", t=table)).strip(),
    }


def difference_rows(table: DifferenceTable) -> list[dict[str, str]]:
    """The numbers of both sides as they are shown."""
    rows = []
    for one in table.differences:
        own = DIFFERENCES[one.name]
        values = {
            name: number(getattr(one, name), own.form, own.scale)
            for name in ("a", "b", "difference", "spread", "half_width")
        }
        larger = {None: UNKNOWN, True: "beyond", False: "within"}[one.larger]
        rows.append({"label": own.label, "unit": own.shown, **values, "larger": larger})
    return rows


COMPARE = ResultsFolder(
    kind="comparison",
    command="compare",
    table="compare.json",
    arrays="compare.npz",
    show=compare_page,
    names=(REPLAY,),
    known=lambda table: "table" in table and "differences" in table["table"],
)


def write_comparison(
    out: Path, table: DifferenceTable, a: Side, b: Side, provenance: Mapping[str, Any]
) -> None:
    """Writes a comparison, its page, figures and tables, and both sides to play."""
    arrays = {
        f"{key}/{name}": side.curves[name]
        for key, side in (("a", a), ("b", b))
        for name in a.curves
        if name in b.curves
    }
    COMPARE.write(
        out,
        {"table": plain(table), "provenance": provenance},
        arrays,
        more=lambda folder, _: write_text(folder / REPLAY, _replay(a, b)),
    )


def curve_figure(
    panels: Mapping[str, tuple[str, str, float]], arrays: Arrays, synthetic: bool
) -> Figure:
    """Curves of both sides over stance: every walk thin, the means bold, each with its letter."""
    rows = -(-len(panels) // 2)
    with drawing(1.3 * PANEL[0], 0.85 * rows * PANEL[1]) as figure:
        say_synthetic(figure, synthetic, "walks")
        places = figure.subplots(rows, 2, squeeze=False).ravel()
        for axes, (name, (title, unit, scale)) in zip(places, panels.items(), strict=False):
            _draw_both(axes, scale * arrays[f"a/{name}"], scale * arrays[f"b/{name}"])
            axes.margins(y=0.12)
            label(axes, x="stance (%)", y=unit, title=title)
        for axes in places[len(panels) :]:
            axes.set_axis_off()
    return figure


def _draw_both(axes: Axes, a: np.ndarray, b: np.ndarray) -> None:
    means = {"A": a.mean(axis=0), "B": b.mean(axis=0)}
    for letter, walks in (("A", a), ("B", b)):
        axes.plot(PERCENT, walks.T, color=COLOURS[letter], linewidth=0.7, alpha=0.35)
        axes.plot(PERCENT, means[letter], color=COLOURS[letter], linewidth=2.0)
    apart = np.abs(means["A"] - means["B"])
    apart[(PERCENT < 10.0) | (PERCENT > 90.0)] = 0.0
    at = int(np.nanargmax(apart))  # where the letters are told apart best
    upper = "A" if means["A"][at] > means["B"][at] else "B"
    for letter, mean in means.items():
        above = letter == upper
        tag(
            axes,
            letter,
            (PERCENT[at], mean[at]),
            COLOURS[letter],
            offset=(0, 4 if above else -4),
            ha="center",
            va="bottom" if above else "top",
        )


def _replay(a: Side, b: Side) -> str:
    """A walk of each side over the same shares of stance, its foot at the same place."""
    first = max(a.share[0], b.share[0])
    last = min(a.share[-1], b.share[-1])
    step = STEP_PERCENT / 100.0
    share = step * np.arange(np.ceil(first / step - 1e-6), np.floor(last / step + 1e-6) + 1)
    lasts = float(np.mean([side.walks[side.typical].stance_s for side in (a, b)]))
    sides = [
        _shown(letter, side, share, 1.0 / (step * lasts)) for letter, side in (("A", a), ("B", b))
    ]
    return replay_page(
        [sides],
        "A and B",
        "compared.html.j2",
        share=np.round(100.0 * share).tolist(),
        labels={"A": a.name, "B": b.name},
        synthetic=any(trial.synthetic for side in (a, b) for trial in side.trials),
    )


def _shown(letter: str, side: Side, share: np.ndarray, rate_hz: float) -> Shown:
    walk = side.walks[side.typical]
    trial = side.trials[side.typical]
    names = trial.trajectory.names
    kept = [k for k, name in enumerate(names) if not name.startswith(MOMENT)]
    at = np.searchsorted(side.share, share).clip(max=len(side.share) - 1)
    values = standing_on(names, walk.values[at], trial)
    force_W = walk.plate[at, :3]
    cop_W = walk.plate[at, 3:6]
    return Shown(
        name=side.name,
        subject=trial.subject,
        model=trial.model,
        offsets=trial.offsets,
        names=tuple(names[k] for k in kept),
        frames=ReplayFrames(
            rate_hz=rate_hz,
            time_s=100.0 * share,  # its time bar has per cent of stance
            q=values[:, kept],
            fulcrum_m=np.full(len(share), walk.fulcrum_m),
            forces={
                f"prosthetic {letter}": ForceFrames(
                    force_W=force_W,
                    cop_W=cop_W,
                    shown=(force_W[:, 2] > THRESHOLD_N) & np.isfinite(cop_W).all(axis=1),
                )
            },
        ),
        tint=COLOURS[letter],
    )
