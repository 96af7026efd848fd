"""The command line: `vsf-drake bench`, `simulate`, `validate`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from vsf_drake import __version__
from vsf_drake.errors import VsfError

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
                  help="A variable-stiffness foot prosthesis on the bench and under a walking person.")
console = Console()
errors = Console(stderr=True)

Out = Annotated[Path, typer.Option(help="Folder for the results; created if needed.")]
Model = Annotated[Path | None, typer.Option(help="Model file (YAML) instead of the nominal one.")]


def main() -> None:
    """Runs the command line; a user's mistake ends with one message and exit code 2, a failed simulation with 3."""
    try:
        app()
    except VsfError as error:
        errors.print(f"error: {error}", style="red", highlight=False, soft_wrap=True, markup=False)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        errors.print("interrupted; nothing of the unfinished part was written")
        sys.exit(130)


@app.command()
def bench(
    out: Out,
    model: Model = None,
    fulcrum_mm: Annotated[list[float] | None, typer.Option(
        help="Fulcrum position from the keel's posterior end; repeat for several. Default: the paper's five.")] = None,
    max_load_n: Annotated[float, typer.Option(help="Load at which a pass ends.")] = 600.0,
    speed_mm_per_min: Annotated[float, typer.Option(help="Speed of the platen.")] = 50.0,
    heel: Annotated[bool, typer.Option(help="Test the heel too.")] = True,
) -> None:
    """Presses the foot in the testing machine: stiffness at each fulcrum position and at the heel."""
    from vsf_drake.report.outputs import write_bench
    from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, run_bench

    out = _target(out, "bench")
    positions = [1e-3 * position for position in fulcrum_mm] if fulcrum_mm else PUBLISHED_FULCRUMS_M
    with _progress() as show:
        result = run_bench(_model(model), fulcrums_m=positions, heel=heel, max_load_n=max_load_n,
                           speed_m_per_s=1e-3 * speed_mm_per_min / 60.0, progress=lambda f: show("pressing", f))
    _print_bench(write_bench(result, out))
    console.print(f"written to {out}", highlight=False)


@app.command()
def simulate(
    trial: Annotated[Path, typer.Argument(help="Trial manifest (YAML).")],
    out: Out,
    fit_offsets: Annotated[bool, typer.Option(
        "--fit-offsets", help="First fit height, fore-aft position and alignment of the prosthesis.")] = False,
    step_ms: Annotated[float, typer.Option(help="Step of the simulation.")] = 1.0,
    replay: Annotated[bool, typer.Option(help="Write the replay (HTML).")] = True,
) -> None:
    """Drives the person by a recording and compares the predicted ground reaction with the force plate."""
    from vsf_drake.analysis.validation import validate_walk
    from vsf_drake.report.outputs import write_walk

    out = _target(out, "walk")
    with _progress() as show:
        walk = validate_walk(trial.expanduser(), with_fit=fit_offsets, step_s=1e-3 * step_ms, progress=show)
    metrics = write_walk(walk.result, walk.trial, out, fit=walk.fit, replay=replay)
    _print_walk(metrics)
    console.print(f"written to {out}", highlight=False)


@app.command()
def validate(
    out: Out = Path("results"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser step, no replay.")] = False,
) -> None:
    """Bench and walk on the embedded data: published bench end points, and a synthetic walk."""
    from vsf_drake.analysis.validation import QUICK_STEP_S, embedded_trials, validate_walk
    from vsf_drake.model_file import load_model
    from vsf_drake.report.outputs import write_bench, write_walk
    from vsf_drake.resources import resource
    from vsf_drake.simulation.bench import run_bench
    from vsf_drake.simulation.walk import DEFAULT_STEP_S

    out = _target(out, "bench")
    console.print("Walking data are SYNTHETIC (built from published group means); bench end points are published.")
    with _progress() as show:
        result = run_bench(load_model(resource("models/nominal.yaml")), progress=lambda f: show("pressing", f))
    _print_bench(write_bench(result, out))
    for manifest in embedded_trials():
        with _progress() as show:
            walk = validate_walk(manifest, step_s=QUICK_STEP_S if quick else DEFAULT_STEP_S, progress=show)
        folder = out / manifest.parent.name
        _print_walk(write_walk(walk.result, walk.trial, folder, fit=walk.fit, replay=not quick))
    console.print(f"written to {out}", highlight=False)


def _target(out: Path, kind: str) -> Path:
    """`out` with ~ expanded, after making sure that results can go there."""
    from vsf_drake.simulation.archive import check_target

    out = out.expanduser()
    check_target(out, kind)
    return out


def _version(asked: bool) -> None:
    if asked:
        console.print(__version__, highlight=False)
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")] = False,
) -> None:
    pass


def _model(path: Path | None) -> Any:
    from vsf_drake.model_file import load_model
    from vsf_drake.resources import resource

    return load_model(path or resource("models/nominal.yaml"))


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """A bar that disappears when done; called with what is being done and the finished fraction of it."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("preparing", total=1.0)
        yield lambda what, fraction: bar.update(task, description=what, completed=fraction)


def _print_bench(table: dict[str, Any]) -> None:
    grid = Table("fulcrum (mm)", "stiffness (N/mm)", "published", "mid-range (mm)", "load (N)", title="Bench")
    for row in table["settings"]:
        published = row["published_n_per_mm"]
        grid.add_row(f"{row['fulcrum_mm']:.0f}", f"{row['stiffness_n_per_mm']:.2f}",
                     "prediction" if published is None else f"{published:.1f}",
                     f"{row['mid_range_displacement_mm']:.2f}", f"{row['max_load_n']:.0f}")
    if table["heel_stiffness_n_per_mm"] is not None:
        published = f"{table['heel_published_n_per_mm']:.1f}"
        grid.add_row("heel", f"{table['heel_stiffness_n_per_mm']:.2f}", published, "", "")
    console.print(grid)
    console.print(f"{table['simulated_s']:.0f} s simulated in {table['wall_s']:.2f} s "
                  f"(compilation, {table['compile_s']:.1f} s, apart), "
                  f"{table['unconverged_steps']} steps unconverged", highlight=False)


def _print_walk(metrics: dict[str, Any]) -> None:
    grid = Table("", "value", title=Text(metrics["trial"]), show_header=False)
    rows = (
        ("resultant GRF, RMSE (BW)", "grf_rmse_bw", "{:.3f}"), ("resultant GRF, R²", "grf_r2", "{:.3f}"),
        ("vertical, RMSE (BW)", "vertical_rmse_bw", "{:.3f}"), ("fore-aft, RMSE (BW)", "fore_aft_rmse_bw", "{:.3f}"),
        ("vertical impulse, error", "vertical_impulse_error", "{:+.1%}"),
        ("centre of pressure, RMSE (foot lengths)", "cop_rmse_fl", "{:.3f}"),
        ("stance, measured (s)", "stance_measured_s", "{:.3f}"), ("stance, model (s)", "stance_model_s", "{:.3f}"),
        ("unconverged steps", "unconverged_steps", "{:d}"), ("simulated (s)", "simulated_s", "{:.3f}"),
        ("wall time (s)", "wall_s", "{:.3f}"), ("compilation, apart (s)", "compile_s", "{:.1f}"),
    )
    for label, key, form in rows:
        grid.add_row(label, "not known" if metrics[key] is None else form.format(metrics[key]))
    console.print(grid)
    offsets = metrics["offsets"]
    fitted = "not fitted" if metrics["offset_fit"] is None else "fitted to this plate"
    height, fore_aft, angle = 1e3 * offsets["height_m"], 1e3 * offsets["fore_aft_m"], degrees(offsets["alignment_rad"])
    console.print(f"offsets ({fitted}): height {height:.1f} mm, fore-aft {fore_aft:.1f} mm, alignment {angle:.1f}°",
                  highlight=False)
    for doubt in metrics["doubts"]:
        console.print(f"! {doubt}", style="bold yellow", highlight=False, markup=False)
    for note in metrics["notes"]:
        console.print(f"- {note}", highlight=False, markup=False)
