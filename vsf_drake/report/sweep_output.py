"""What a sweep leaves on disk: a row a walk as CSV, what it was made of as JSON, a figure if one thing was varied."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.errors import InputError
from vsf_drake.files import read_json
from vsf_drake.motion.trial_record import Trial
from vsf_drake.report.page import write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, drawing, label, log_scale, save_figure
from vsf_drake.simulation.archive import result_folder

_FIGURES = ("sweep.png", "sweep.svg")
SWEEP = ResultsFolder(kind="sweep", command="sweep", table="sweep.json", names=("sweep.csv", *_FIGURES), stale=_FIGURES,
                      unfinished=lambda out: (out / "cache").is_dir())


def check_sweep_folder(out: Path, trials: Iterable[Trial]) -> None:
    """Raises InputError unless a sweep of `trials` can go to `out`: a new folder, or that of a sweep of the same ones.

    Trials are the same if they come from the same files, wherever these are named from, or hold the same.
    """
    SWEEP.check(out)
    path, given = out / SWEEP.table, list(trials)
    if not path.exists():
        return
    try:
        found = read_json(path)["trials"]
        files = [sorted(str(Path(each).resolve()) for each in paths)
                 for paths in ([trial.path for trial in given], [trial["file"] for trial in found])]
        hashes = [sorted(sorted(inputs.values()) for inputs in both)
                  for both in ([trial.inputs for trial in given], [trial["inputs"] for trial in found])]
        names = ", ".join(trial["name"] for trial in found)
    except (InputError, OSError, TypeError, KeyError, AttributeError):
        raise InputError("is not the table of a sweep", file=path, right="Choose another folder") from None
    if files[0] != files[1] and hashes[0] != hashes[1]:
        raise InputError(f"holds a sweep of other trials ({names})", file=out,
                         right="Choose another folder for this sweep")


def write_sweep(table: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], out: Path) -> dict[str, Any]:
    """Writes `sweep_table` and removes the figure of an earlier sweep; returns what is in sweep.json."""
    return SWEEP.write(out, table, more=lambda folder, table: write_csv(
        folder / "sweep.csv", rows[0], (row.values() for row in rows)))


def write_sweep_figure(table: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], out: Path) -> None:
    """Writes sweep.png and sweep.svg if one quantity was varied and any walk has scores."""
    if len(table["varied"]) == 1 and any(row["grf_rmse_bw"] is not None for row in rows):
        with result_folder(out, SWEEP.kind, add=True) as folder:
            try:
                save_figure(_sweep_figure(table, rows), folder / "sweep")
            except OSError as error:
                raise InputError(f"cannot be written ({error.strerror})", file=out / _FIGURES[0]) from None


_PANELS = (("grf_rmse_bw", 100.0, "RMS error (% body weight)", "Resultant force"),
           ("cop_rmse_fl", 100.0, "RMS error (% foot length)", "Centre of pressure, fore-aft"),
           ("peak_vertical_bw", 1.0, "vertical force (body weights)", "Peak of the model"))
_WIDE = 20.0
"""Ratio of largest to smallest value above which the axis is logarithmic."""


def _sweep_figure(table: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Errors against the plate and the peak force over the one quantity that is varied, one line a trial."""
    [name] = table["varied"]
    trials, column = table["trials"], table["columns"][name]
    values = [row[name] for row in rows]
    with drawing(9.6, 4.0 + 0.16 * len(trials)) as figure:
        for axes, (key, factor, y, title) in zip(figure.subplots(1, 3), _PANELS, strict=True):
            lines = []
            for number, trial in enumerate(trials):
                own = [row for row in rows if row["trial"] == trial["name"]]
                colour = condition_colour(1e-3 * trial["fulcrum_mm"])
                known = sorted((row[name], factor * row[key]) for row in own if row[key] is not None)
                lines += axes.plot([x for x, _ in known], [y for _, y in known], marker=MARKERS[number % len(MARKERS)],
                                   markersize=4, linewidth=1.4, color=colour)
                for row in own:
                    if row["failure"]:
                        axes.plot(row[name], 0.02, marker="x", color=colour, transform=axes.get_xaxis_transform(),
                                  clip_on=False)
                if key == "peak_vertical_bw" and trial["measured_peak_vertical_bw"] is not None:
                    axes.axhline(trial["measured_peak_vertical_bw"], color=colour, linestyle=":", linewidth=1.2)
            for value in {column["in_the_model"]} if "in_the_model" in column else {t["fulcrum_mm"] for t in trials}:
                axes.axvline(value, color=NEUTRAL, linewidth=5.0, alpha=0.35, zorder=0)
            if min(values) > 0.0 and max(values) / min(values) > _WIDE:
                log_scale(axes.xaxis)
            label(axes, x="", y=y, title=title)
        figure.axes[1].set_xlabel("fulcrum from the keel's posterior end (mm)" if name == "fulcrum_mm"
                                  else f"{name} ({column['unit']})")
        # legends leave out what begins with an underscore
        figure.legend(lines, [f" {trial['name']}" if trial["name"].startswith("_") else trial["name"]
                              for trial in trials], loc="outside lower left")
        synthetic = " (SYNTHETIC)" if any(trial["synthetic"] for trial in trials) else ""
        failed = f", {table['failed']} FAILED" if table["failed"] else ""
        figure.suptitle(f"{table['walks']} walks{synthetic}{failed}; shaded: the trial's own value; dotted: measured "
                        "peak", x=0.01, ha="left", fontsize=10)
    return figure
