"""What a bench, a walk and standing leave on disk, whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.doubts import doubts
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.offsets import OffsetFit
from vsf_drake.motion.trial_record import Trial
from vsf_drake.report.bench_figure import bench_figure
from vsf_drake.report.replay import write_replay
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import MEASURED, NEUTRAL, condition_colour, drawing, label, save_figure
from vsf_drake.report.walk_figure import walk_figure
from vsf_drake.schema import to_plain
from vsf_drake.simulation.results import (
    LARGEST_DRIFT_M,
    BenchResult,
    Standing,
    WalkResult,
    save_bench,
    save_walk,
    standing_table,
)

_NOT_BY_NAME: dict[str, Any] = {"known": lambda table: False, "damaged_too": False}
"""Of tables whose names others may have too: their folders are told by the record beside them."""
BENCH = ResultsFolder(kind="bench", command="bench", table="bench.json", **_NOT_BY_NAME)
WALK = ResultsFolder(kind="walk", command="simulate", table="metrics.json", stale=("replay.html",), **_NOT_BY_NAME)
STANDING = ResultsFolder(kind="standing", command="stand", table="standing.json")


def write_bench(result: BenchResult, out: str | Path) -> dict[str, Any]:
    """Writes bench.json, bench.png, bench.svg and the saved result to the folder `out`; returns the table.

    Raises:
        InputError: a curve cannot be evaluated, or `out` cannot be written.
    """
    def more(folder: Path, table: dict[str, Any]) -> None:
        save_bench(result, folder)
        save_figure(bench_figure(result, table), folder / "bench")

    return BENCH.write(out, bench_table(result), more=more)


def write_walk(
    result: WalkResult, trial: Trial, out: str | Path, *, fit: OffsetFit | None = None, replay: bool = True,
    null_curve: np.ndarray | None = None
) -> dict[str, Any]:
    """Writes metrics.json, walk.png, walk.svg, the saved result and replay.html to `out`; returns the metrics.

    Args:
        fit: the fit that the offsets come from; reported in the metrics.
        replay: whether to write the replay.
        null_curve: see `walk_metrics`.

    Raises:
        InputError: `out` cannot be written.
    """
    plate = trial.prosthetic_plate
    comparison = compare(result, plate)
    metrics = walk_metrics(result, plate, null_curve=null_curve, comparison=comparison)
    metrics |= {"offsets": to_plain(result.parameters["offsets"]), "offset_fit": None if fit is None else to_plain(fit),
                "doubts": doubts(result, comparison, metrics, fit), "notes": list(result.notes)}

    def more(folder: Path, table: dict[str, Any]) -> None:
        save_walk(result, folder)
        save_figure(walk_figure(result, plate, metrics), folder / "walk")
        if replay:
            write_replay(result, folder / "replay.html", plate=plate)

    return WALK.write(out, metrics, more=more)


def write_standing(standing: Standing, out: str | Path) -> dict[str, Any]:
    """Writes standing.json, standing.png and standing.svg to the folder `out`; returns the table.

    Raises:
        InputError: `out` cannot be written.
    """
    return STANDING.write(out, standing_table(standing), more=lambda folder, table: save_figure(
        standing_figure(table), folder / "standing"))


# Standing in one figure: the force under each foot and under both against the weight, and how the pelvis drifts.


PROSTHETIC, INTACT, BOTH = condition_colour(0.066), condition_colour(0.151), "0.1"
LIMIT_MM = 1e3 * LARGEST_DRIFT_M
"""Where standing still ends, marked in the figure."""


def standing_figure(table: Mapping[str, Any]) -> Figure:
    """The figure of `standing_table`."""
    with drawing(9.0, 4.2) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        _forces(left, table)
        _drift(right, table)
        verdict = "stands" if table["stands"] else "DOES NOT STAND STILL"
        state = "" if table["converged"] else f", {table['unconverged_steps']} STEPS NOT CONVERGED"
        figure.suptitle(f"{table['subject']}, {table['prosthetic_side']} prosthesis, fulcrum "
                        f"{table['fulcrum_mm']:g} mm: {verdict}{state}", x=0.01, ha="left", fontsize=11)
    return figure


def _forces(axes: Axes, table: Mapping[str, Any]) -> None:
    series = table["series"]
    time, prosthetic, intact = (np.asarray(series[key]) for key in ("time_s", "prosthetic_n", "intact_n"))
    axes.axhline(table["weight_n"], color=NEUTRAL, label=f"weight, {table['weight_n']:.1f} N", **MEASURED)
    axes.plot(time, prosthetic + intact, color=BOTH, linewidth=1.6,
              label=f"both feet, mean {table['mean_vertical_n']:.1f} N ({table['weight_error']:+.2%})")
    axes.plot(time, intact, color=INTACT, linewidth=1.6, linestyle="-.",
              label=f"intact foot, {table['intact_share']:.0%}")
    axes.plot(time, prosthetic, color=PROSTHETIC, linewidth=1.6, linestyle="--",
              label=f"prosthetic foot, {table['prosthetic_share']:.0%}")
    axes.set_ylim(0.0, 1.45 * max(table["weight_n"], float(np.max(prosthetic + intact))))
    axes.set_xlim(0.0, table["duration_s"])
    axes.legend(loc="upper left", ncols=2)
    label(axes, x="time (s)", y="vertical force (N)", title="What the ground carries")


def _drift(axes: Axes, table: Mapping[str, Any]) -> None:
    series = table["series"]
    drift = np.asarray(series["drift_mm"])
    axes.plot(series["time_s"], drift, color=BOTH, linewidth=1.6)
    axes.axhline(LIMIT_MM, color=NEUTRAL, linewidth=0.8, linestyle=":")
    axes.set_ylim(0.0, 1.6 * max(float(np.max(drift)), LIMIT_MM))
    axes.set_xlim(0.0, table["duration_s"])
    angles = table["pelvis_deg"]
    free = [name.removeprefix("pelvis_") for name in table["free"]]
    held = [f"{name.removeprefix('pelvis_')} {value:+.1f} N m" for name, value in table["held_nm"].items()]
    lines = [f"largest {table['drift_mm']:.2g} mm, {table['turn_deg']:.2g}°",
             f"tilt {angles['tilt']:+.1f}°, list {angles['list']:+.1f}°", f"free: {', '.join(free)}",
             "held by: " + (", ".join(held) or "nothing")]
    axes.text(0.03, 0.97, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=8, linespacing=1.5)
    label(axes, x="time (s)", y="distance of the pelvis from its start (mm)",
          title=f"How still: let go {table['let_go_off_rest']['raised_mm']:g} mm off rest")
