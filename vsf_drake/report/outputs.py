"""What a bench, a walk, standing and a sweep leave on disk, whole or not at all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import plain, read_json, write_text
from vsf_drake.base.schema import to_plain
from vsf_drake.base.tables import tables_module
from vsf_drake.device.bench_metrics import BenchTable, bench_table
from vsf_drake.motion.formats.recording import SIDES, Plate
from vsf_drake.motion.formats.tables import write_opensim
from vsf_drake.motion.trial import Trial
from vsf_drake.report.figures import bench_figure, standing_figure, sweep_figure, walk_figure
from vsf_drake.report.page import write_csv
from vsf_drake.report.replay import walk_replay
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import Arrays, save_figure
from vsf_drake.simulation.results import (
    BenchResult,
    Standing,
    StandingTable,
    WalkResult,
    coordinate_unit,
    save_bench,
    save_walk,
    standing_table,
)
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.metrics import walk_metrics, warnings
from vsf_drake.walks.offsets import OffsetFit
from vsf_drake.walks.person_curve import PersonForce
from vsf_drake.walks.prediction import TrialLayers
from vsf_drake.walks.sweep_table import Sweep, SweepRow, SweepTable

_NOT_BY_NAME: dict[str, Any] = {"known": lambda table: False, "damaged_too": False}
"""Of tables whose names others may have too: their folders are told by the record beside them."""
BENCH = ResultsFolder(kind="bench", command="bench", table="bench.json", **_NOT_BY_NAME)
WALK = ResultsFolder(
    kind="walk", command="simulate", table="metrics.json", stale=("replay.html",), **_NOT_BY_NAME
)
STANDING = ResultsFolder(kind="standing", command="stand", table="standing.json")
_SWEEP_FIGURES = ("sweep.png", "sweep.svg")
SWEEP = ResultsFolder(
    kind="sweep",
    command="sweep",
    table="sweep.json",
    names=("sweep.csv", "sweep.parquet", *_SWEEP_FIGURES),
    stale=_SWEEP_FIGURES,
    unfinished=lambda out: (out / "cache").is_dir(),
)


def write_bench(result: BenchResult, out: str | Path) -> BenchTable:
    """Writes bench.json, bench.png, bench.svg and the saved result to the folder `out`; returns the
    table."""
    table = bench_table(result)

    def more(folder: Path, _: dict[str, Any]) -> None:
        save_bench(result, folder)
        save_figure(bench_figure(result, table), folder / "bench")

    BENCH.write(out, plain(table), more=more)
    return table


def write_walk(
    result: WalkResult,
    trial: Trial,
    out: str | Path,
    *,
    fit: OffsetFit | None = None,
    layers: TrialLayers | None = None,
    person: PersonForce | None = None,
    curves: Arrays | None = None,
    replay: bool = True,
    opensim: bool = False,
) -> dict[str, Any]:
    """Writes metrics.json, walk.png, walk.svg, the saved result and replay.html to `out`; returns
    the metrics.

    `fit` is the one that the offsets come from, `layers` what the fitted contact predicts beyond
    the walk, `person` the force by the person's own curve, which adds person_force.csv, `curves`
    what the figure shows of them; `opensim` adds walk_ik.mot and walk_grf.mot.
    """
    plate = trial.plate
    comparison = compare(result, plate)
    metrics = walk_metrics(result, plate, comparison=comparison)
    table = {
        **plain(metrics),
        "offsets": to_plain(result.parameters["offsets"]),
        "offset_fit": None if fit is None else to_plain(fit),
        "layers": None if layers is None else plain(layers),
        "recording": None if trial.judged is None else plain(trial.judged),
        "warnings": warnings(result, comparison, metrics, fit),
        "notes": list(result.notes),
    }

    def more(folder: Path, table: dict[str, Any]) -> None:
        save_walk(result, folder)
        save_figure(
            walk_figure(result, plate, metrics, setting=trial.setting, curves=curves),
            folder / "walk",
        )
        if replay:
            page = walk_replay(result, plate=plate, intact_plate=trial.intact_plate)
            write_text(folder / "replay.html", page)
        if person is not None:
            columns = person.columns()
            rows = zip(*columns.values(), strict=True)
            write_csv(folder / "person_force.csv", columns, rows)
        if opensim:
            write_motion(result, folder)

    return WALK.write(out, table, more=more)


def write_motion(result: WalkResult, folder: Path) -> None:
    """All coordinates of the walk, and what the ground did to both feet; of the intact one no free
    moment is known."""
    names = result.coordinate_names
    unknown = np.full(len(result.time_s), np.nan)
    plates = {
        side: Plate(side, result.grf_W, result.cop_W, result.free_moment_nm)
        if side == result.side
        else Plate(side, result.intact_grf_W, result.intact_cop_W, unknown)
        for side in SIDES
    }
    write_opensim(
        folder,
        "walk",
        time_s=result.time_s,
        coordinates=dict(zip(names, result.q.T, strict=True)),
        metres=[name for name in names if coordinate_unit(name) == "m"],
        force_time_s=result.time_s,
        plates=plates,
        source="model, SYNTHETIC motion" if result.synthetic else "model",
    )


def write_standing(standing: Standing, out: str | Path) -> StandingTable:
    """Writes standing.json, standing.png and standing.svg to the folder `out`; returns the
    table."""
    table = standing_table(standing)
    STANDING.write(
        out,
        plain(table),
        more=lambda folder, _: save_figure(standing_figure(table), folder / "standing"),
    )
    return table


def check_sweep_folder(out: Path, trials: Iterable[Trial], *, parquet: bool = False) -> None:
    """Raises InputError unless a sweep of `trials` can go to `out`: a new folder, or that of a
    sweep of the same ones.

    Trials are the same if they come from the same files, wherever these are named from, or hold the
    same. For `parquet` the extra `tables` must be installed.
    """
    for needed in ("pandas", "pyarrow") if parquet else ():
        tables_module(needed)
    SWEEP.check(out)
    path = out / SWEEP.table
    given = list(trials)
    if not path.exists():
        return
    try:
        earlier = read_json(path)["trials"]
        files = [
            sorted(str(Path(each).resolve()) for each in paths)
            for paths in ([trial.path for trial in given], [trial["file"] for trial in earlier])
        ]
        hashes = [
            sorted(sorted(inputs.values()) for inputs in both)
            for both in ([trial.inputs for trial in given], [trial["inputs"] for trial in earlier])
        ]
        names = ", ".join(trial["name"] for trial in earlier)
    except (InputError, OSError, TypeError, KeyError, AttributeError):
        raise InputError(
            "is not the table of a sweep", file=path, right="Choose another folder"
        ) from None
    if files[0] != files[1] and hashes[0] != hashes[1]:
        raise InputError(
            f"holds a sweep of other trials ({names})",
            file=out,
            right="Choose another folder for this sweep",
        )


def write_sweep(
    table: SweepTable, rows: Sequence[SweepRow], out: Path, *, parquet: bool = False
) -> None:
    """Writes sweep.json, sweep.csv, and sweep.parquet if asked; sweep.png and sweep.svg if one
    quantity was varied and any walk has scores, else the figure of an earlier sweep goes. All of it
    or nothing."""

    def more(folder: Path, _: dict[str, Any]) -> None:
        write_csv(folder / "sweep.csv", rows[0].cells(), (row.cells().values() for row in rows))
        if parquet:
            Sweep(table, rows).to_dataframe().to_parquet(folder / "sweep.parquet", index=False)
        if len(table.varied) == 1 and any(trial.finished for trial in table.trials):
            save_figure(sweep_figure(table, rows), folder / "sweep")

    SWEEP.write(out, plain(table), more=more)
