"""What a bench, a walk and standing leave on disk, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.doubts import doubts
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.offsets import OffsetFit
from vsf_drake.motion.trial_record import Trial
from vsf_drake.report.figures import bench_figure, standing_figure, walk_figure
from vsf_drake.report.replay import write_replay
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import save_figure
from vsf_drake.schema import to_plain
from vsf_drake.simulation.results import BenchResult, Standing, WalkResult, save_bench, save_walk, standing_table

_NOT_BY_NAME: dict[str, Any] = {"known": lambda table: False, "damaged_too": False}
"""Of tables whose names others may have too: their folders are told by the record beside them."""
BENCH = ResultsFolder(kind="bench", command="bench", table="bench.json", **_NOT_BY_NAME)
WALK = ResultsFolder(kind="walk", command="simulate", table="metrics.json", stale=("replay.html",), **_NOT_BY_NAME)
STANDING = ResultsFolder(kind="standing", command="stand", table="standing.json")


def write_bench(result: BenchResult, out: str | Path) -> dict[str, Any]:
    """Writes bench.json, bench.png, bench.svg and the saved result to the folder `out`; returns the table."""
    def more(folder: Path, table: dict[str, Any]) -> None:
        save_bench(result, folder)
        save_figure(bench_figure(result, table), folder / "bench")

    return BENCH.write(out, bench_table(result), more=more)


def write_walk(
    result: WalkResult, trial: Trial, out: str | Path, *, fit: OffsetFit | None = None, replay: bool = True,
    null_curve: np.ndarray | None = None
) -> dict[str, Any]:
    """Writes metrics.json, walk.png, walk.svg, the saved result and replay.html to `out`; returns the metrics.

    `fit` is the one that the offsets come from; `null_curve` as in `walk_metrics`.
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
    """Writes standing.json, standing.png and standing.svg to the folder `out`; returns the table."""
    return STANDING.write(out, standing_table(standing), more=lambda folder, table: save_figure(
        standing_figure(table), folder / "standing"))
