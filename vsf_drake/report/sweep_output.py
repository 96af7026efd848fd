"""What a sweep leaves on disk: a row a walk as CSV, what it was made of as JSON, a figure if one thing was varied."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vsf_drake.analysis.sweep_table import SCORES, has_stance, measured_peak_bw, sweep_row
from vsf_drake.errors import InputError
from vsf_drake.files import read_json
from vsf_drake.motion.trial_record import Trial
from vsf_drake.report.page import write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, drawing, label, log_scale, save_figure
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import result_folder
from vsf_drake.simulation.many import WalkOutcome
from vsf_drake.simulation.many.cases import software
from vsf_drake.simulation.variables import Variable

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


def write_sweep(
    outcomes: Sequence[WalkOutcome], trials: Mapping[str, Trial], out: Path, *, variables: Mapping[str, Variable],
    fulcrum: bool, plan: Mapping[str, Any], show: Callable[[float], None]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Writes sweep.csv and sweep.json, and removes the figure of an earlier sweep.

    Args:
        outcomes: of walks of the `trials`, which are given by the names that the table shall have.
        variables: that were varied; fulcrum: whether it was.
        plan: what was asked for, for the table.
        show: called with the finished fraction.

    Returns:
        What is in sweep.json, and the rows of sweep.csv.

    Raises:
        InputError: `out` cannot be written.
    """
    rows, name_of = [], {id(trial): name for name, trial in trials.items()}
    for i, outcome in enumerate(outcomes):
        rows.append(sweep_row(outcome, name_of[id(outcome.case.trial)], list(variables)))
        show((i + 1) / len(outcomes))
    varied = [*(["fulcrum_mm"] if fulcrum else []), *variables]
    failures = [row["failure"] for row in rows if row["failure"]]
    table = SWEEP.write(out, {
        "kind": "sweep", "walks": len(rows), "failed": len(failures), "failures": failures,
        "with_notes": sum(bool(outcome.notes) for outcome in outcomes),
        "notes": [{"row": i + 1, "notes": outcome.notes} for i, outcome in enumerate(outcomes) if outcome.notes],
        "unconverged_steps": sum(row["unconverged_steps"] or 0 for row in rows),
        "refined_steps": sum(row["refined_steps"] or 0 for row in rows),
        "varied": varied, "plan": to_plain(dict(plan)), "software": software(), "columns": {
            "trial": {"meaning": "name of the trial"},
            "fulcrum_mm": {"unit": "mm", "meaning": "fulcrum from the keel's posterior end"},
            **{name: {"unit": v.unit, "meaning": "added to what is there" if v.added else "instead of the model's",
                      "in_the_model": v.default} for name, v in variables.items()},
            **{name: {"unit": unit, "meaning": meaning} for name, (unit, meaning) in SCORES.items()},
            "failure": {"meaning": "why there are no scores; empty if there are"},
            "notes": {"meaning": "doubts about the walk, with | between them"}},
        "trials": [_trial(name, trial, rows, varied, outcomes) for name, trial in trials.items()]},
        more=lambda folder, table: write_csv(folder / "sweep.csv", rows[0], (row.values() for row in rows)))
    return table, rows


def _trial(name: str, trial: Trial, rows: Sequence[Mapping[str, Any]], varied: Sequence[str],
           outcomes: Sequence[WalkOutcome]) -> dict[str, Any]:
    own = [row for row in rows if row["trial"] == name and row["grf_rmse_bw"] is not None]
    best = min(filter(has_stance, own), key=lambda row: row["grf_rmse_bw"], default=None)
    return {"name": name, "file": str(trial.path), "synthetic": trial.synthetic, "inputs": trial.inputs,
            "fulcrum_mm": round(1e3 * trial.fulcrum_m, 9), "window_s": [trial.start_s, trial.end_s],
            "mass_kg": trial.subject.mass_kg, "measured_peak_vertical_bw": measured_peak_bw(outcomes, trial),
            "notes": list(trial.notes), "finished": len(own),
            "smallest_error": None if best is None else {
                "grf_rmse_bw": best["grf_rmse_bw"], "at": {key: best[key] for key in varied}}}


def write_sweep_figure(
    rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any], out: Path, variables: Mapping[str, Variable]
) -> None:
    """Writes sweep.png and sweep.svg if one quantity was varied and any walk has scores.

    Args:
        rows, table: as `write_sweep` returned them; out, variables: as it took them.

    Raises:
        InputError: they cannot be written.
    """
    if len(table["varied"]) == 1 and any(row["grf_rmse_bw"] is not None for row in rows):
        with result_folder(out, SWEEP.kind, add=True) as folder:
            try:
                save_figure(_sweep_figure(rows, table, variables), folder / "sweep")
            except OSError as error:
                raise InputError(f"cannot be written ({error.strerror})", file=out / _FIGURES[0]) from None


_PANELS = (("grf_rmse_bw", 100.0, "RMS error (% body weight)", "Resultant force"),
           ("cop_rmse_fl", 100.0, "RMS error (% foot length)", "Centre of pressure, fore-aft"),
           ("peak_vertical_bw", 1.0, "vertical force (body weights)", "Peak of the model"))
_WIDE = 20.0
"""Ratio of largest to smallest value above which the axis is logarithmic."""


def _sweep_figure(
    rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any], variables: Mapping[str, Variable]
) -> Figure:
    """Errors against the plate and the peak force over the one quantity that is varied, one line a trial."""
    [name] = table["varied"]
    unit = table["columns"][name]["unit"]
    axis = "fulcrum from the keel's posterior end (mm)" if name == "fulcrum_mm" else f"{name} ({unit})"
    with drawing(9.6, 4.0 + 0.16 * len(table["trials"])) as figure:
        for axes, (key, factor, y, title) in zip(figure.subplots(1, 3), _PANELS, strict=True):
            lines = []
            for number, trial in enumerate(table["trials"]):
                own = [row for row in rows if row["trial"] == trial["name"]]
                lines.append(_line(axes, own, name, key, factor, trial, number))
            _own_values(axes, name, table, variables)
            values = [row[name] for row in rows]
            if min(values) > 0.0 and max(values) / min(values) > _WIDE:
                log_scale(axes.xaxis)
            label(axes, x="", y=y, title=title)
        figure.axes[1].set_xlabel(axis)
        figure.legend(lines, [_shown(trial["name"]) for trial in table["trials"]], loc="outside lower left")
        synthetic = " (SYNTHETIC)" if any(trial["synthetic"] for trial in table["trials"]) else ""
        failed = f", {table['failed']} FAILED" if table["failed"] else ""
        figure.suptitle(f"{table['walks']} walks{synthetic}{failed}; shaded: the trial's own value; dotted: measured "
                        "peak", x=0.01, ha="left", fontsize=10)
    return figure


def _line(axes: Axes, rows: Sequence[Mapping[str, Any]], name: str, key: str, factor: float,
          trial: Mapping[str, Any], number: int) -> Line2D:
    colour = condition_colour(1e-3 * trial["fulcrum_mm"])
    known = sorted((row[name], factor * row[key]) for row in rows if row[key] is not None)
    [line] = axes.plot([x for x, _ in known], [y for _, y in known], marker=MARKERS[number % len(MARKERS)],
                       markersize=4, linewidth=1.4, color=colour)
    for row in rows:
        if row["failure"]:
            axes.plot(row[name], 0.02, marker="x", color=colour, transform=axes.get_xaxis_transform(), clip_on=False)
    if key == "peak_vertical_bw" and trial["measured_peak_vertical_bw"] is not None:
        axes.axhline(trial["measured_peak_vertical_bw"], color=colour, linestyle=":", linewidth=1.2)
    return line


def _shown(name: str) -> str:
    """`name` as legends take it: they leave out what begins with an underscore."""
    return f" {name}" if name.startswith("_") else name


def _own_values(axes: Axes, name: str, table: Mapping[str, Any], variables: Mapping[str, Any]) -> None:
    own = {trial["fulcrum_mm"] for trial in table["trials"]} if name == "fulcrum_mm" else {variables[name].default}
    for value in own:
        axes.axvline(value, color=NEUTRAL, linewidth=5.0, alpha=0.35, zorder=0)
