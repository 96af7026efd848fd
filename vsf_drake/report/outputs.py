"""Everything that a bench or a walk leaves on disk, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.bench_metrics import (
    bench_table,
)
from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.doubts import doubts
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.offsets import OffsetFit
from vsf_drake.json_file import write_json
from vsf_drake.motion.trial import Trial
from vsf_drake.report.bench_figure import bench_figure
from vsf_drake.report.replay import write_replay
from vsf_drake.report.style import (
    save_figure,
)
from vsf_drake.report.walk_figure import walk_figure
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import result_folder
from vsf_drake.simulation.results import BenchResult, WalkResult, save_bench, save_walk

REPLAY = "replay.html"


def write_bench(result: BenchResult, out: str | Path) -> dict[str, Any]:
    """Writes bench.json, bench.png, bench.svg and the saved result to the folder `out`; returns the table.

    Raises:
        InputError: a curve cannot be evaluated, or `out` cannot be written.
    """
    table = bench_table(result)
    with result_folder(out, "bench") as folder:
        save_bench(result, folder)
        save_figure(bench_figure(result, table), folder / "bench")
        write_json(folder / "bench.json", table)
    return table


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
    metrics["offsets"] = to_plain(result.parameters["offsets"])
    metrics["offset_fit"] = None if fit is None else to_plain(fit)
    metrics["doubts"] = doubts(result, comparison, metrics, fit)
    metrics["notes"] = list(result.notes)
    with result_folder(out, "walk", stale=(REPLAY,)) as folder:
        save_walk(result, folder)
        save_figure(walk_figure(result, plate, metrics), folder / "walk")
        if replay:
            write_replay(result, folder / REPLAY, plate=plate)
        write_json(folder / "metrics.json", metrics)
    return metrics
