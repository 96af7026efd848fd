"""What a prediction at another setting leaves on disk, all of it or nothing, and its page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vsf_drake.base.files import plain
from vsf_drake.report.layer_curves import COMPONENTS, draw_layers, layer_handles
from vsf_drake.report.outputs import write_motion
from vsf_drake.report.page import Chapter, render
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import (
    MEASURED,
    PANEL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    legend_below,
    name_of,
    say_synthetic,
)
from vsf_drake.tuning.answered import SettingPrediction
from vsf_drake.walks.comparison import PERCENT

PREDICTED: dict[str, Any] = {**SIMULATED, "color": "black"}
JOINTS = ("hip_flexion", "knee_angle", "ankle_angle")
WORDS = {"hip_flexion": "hip flexion", "knee_angle": "knee flexion", "ankle_angle": "ankle"}


def predict_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of predict.json and predict.npz."""
    facts = {"t": saved, "interval": "half_width" in arrays}
    return {
        "title": f"The walk at {saved['fulcrum_mm']:g} mm",
        "chapters": [
            Chapter(
                name="answer",
                title="",
                template="predict/answer.html.j2",
                figures={"force": force_figure(saved, arrays)},
                facts=facts,
            ),
            Chapter(
                name="motion",
                title="How the person answers the setting",
                template="predict/motion.html.j2",
                figures={"joints": joint_figure(saved, arrays)},
                facts=facts,
            ),
            Chapter(
                name="made", title="How it was made", template="predict/made.html.j2", facts=facts
            ),
        ],
        "synthetic": saved["synthetic"],
        "first_line": render("predict/first_line.txt.j2", t=saved),
    }


PREDICT = ResultsFolder(
    kind="prediction at a setting",
    command="predict",
    table="predict.json",
    arrays="predict.npz",
    show=predict_page,
    names=("walk_ik.mot", "walk_grf.mot"),
    known=lambda table: "fulcrum_mm" in table and "answer" in table,
)


def write_prediction(out: str | Path, found: SettingPrediction) -> None:
    """Writes a prediction, its page, figures and tables, and the walk for OpenSim."""
    table = {
        **plain(found.table),
        "rows": plain(found.table.rows()),
        "layer": found.table.layer,
        "names": found.answer.names,
        "side": found.trial.subject.prosthetic_side,
    }
    result = [*found.walk.results.values()][-1]
    PREDICT.write(out, table, found.arrays, more=lambda folder, _: write_motion(result, folder))


def force_figure(saved: Mapping[str, Any], arrays: Arrays) -> Figure:
    """Force over stance: plates at the recorded settings, and predicted."""
    settings = saved["answer"]["settings_mm"]
    own = colour_of(saved["fulcrum_mm"])
    with drawing(PANEL[0], 2.2 * PANEL[1]) as figure:
        say_synthetic(figure, saved["synthetic"], "walks")
        panels = figure.subplots(3, 1, sharex=True, height_ratios=(2, 1, 1))
        for axes, k in zip(panels, (2, 0, 1), strict=True):
            for mm, force in zip(settings, arrays["plates"], strict=True):
                axes.plot(PERCENT, force[:, k], color=colour_of(mm), **MEASURED)
            axes.plot(PERCENT, arrays["physics"][:, k], color=own, **SIMULATED)
            draw_layers(axes, PERCENT, arrays, k)
            if "person" not in arrays:
                axes.plot(PERCENT, arrays[saved["layer"]][:, k], **PREDICTED)
            label(axes, x="stance (%)" if k == 1 else "", y="force (BW)", title=COMPONENTS[k])
        physics = entry(f"physics alone, {name_of(saved['fulcrum_mm'])}", color=own, **SIMULATED)
        known = [*_recorded(settings), physics, *layer_handles(arrays)]
        if "person" not in arrays:
            known.append(entry("predicted", **PREDICTED))
        legend_below(figure, known)
    return figure


def joint_figure(saved: Mapping[str, Any], arrays: Arrays) -> Figure:
    """Sagittal joint angles over stance: means at the recorded settings, and predicted."""
    settings = saved["answer"]["settings_mm"]
    prosthetic = saved["side"][0]
    sides = {"prosthetic": prosthetic, "intact": "l" if prosthetic == "r" else "r"}
    shown = [
        (f"{word} {WORDS[joint]}", f"{joint}_{side}")
        for word, side in sides.items()
        for joint in JOINTS
        if f"{joint}_{side}" in saved["names"]
    ]
    share = 100.0 * arrays["share"]
    rows = -(-len(shown) // 2)
    with drawing(1.3 * PANEL[0], 0.85 * rows * PANEL[1]) as figure:
        say_synthetic(figure, saved["synthetic"], "walks")
        panels = figure.subplots(rows, 2).ravel()
        for axes, (title, name) in zip(panels, shown, strict=False):
            k = list(saved["names"]).index(name)
            for mm, motion in zip(settings, arrays["recorded"], strict=True):
                colour = colour_of(mm)
                axes.plot(share, motion[:, k], color=colour, **MEASURED)
                if "spread" in arrays:
                    wide = arrays["spread"][:, k]
                    axes.fill_between(
                        share, motion[:, k] - wide, motion[:, k] + wide, color=colour, alpha=0.12
                    )
            axes.plot(share, arrays["predicted"][:, k], **PREDICTED)
            axes.axvspan(0.0, 100.0, color="0.95", zorder=-1)
            label(axes, x="stance (%)", y="degrees", title=title)
        for axes in panels[len(shown) :]:
            axes.set_axis_off()
        known = [*_recorded(settings), entry("predicted", **PREDICTED)]
        if "spread" in arrays:
            known.append(Patch(color="0.5", alpha=0.25, label="spread between walks"))
        legend_below(figure, known)
    return figure


def _recorded(settings: list[float]) -> list[Artist]:
    return [entry(f"recorded, {name_of(mm)}", color=colour_of(mm), **MEASURED) for mm in settings]
