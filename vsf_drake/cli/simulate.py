"""`vsf-drake simulate`: a recorded walk on the model."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import Contact, Out, app, check_contact_use, console, path, progress, read_trials, say, warn


@app.command()
def simulate(
    trial: Annotated[Path, typer.Argument(parser=path, help="Trial manifest (YAML).")],
    out: Out,
    contact: Contact = None,
    fit_offsets: Annotated[bool, typer.Option(
        "--fit-offsets", help="First fit height, fore-aft position and alignment of the prosthesis.")] = False,
    step_ms: Annotated[float, typer.Option(help="Step of the simulation.")] = 1.0,
    replay: Annotated[bool, typer.Option(help="Write the replay (HTML).")] = True,
) -> None:
    """Drives the person by a recording and compares the predicted ground reaction with the force plate."""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.validation.study import walk_trial
    from vsf_drake.report.outputs import WALK, write_walk

    check_contact_use(contact, fit_offsets=fit_offsets)
    WALK.check(out)
    [recorded] = read_trials([trial], contact)
    with progress() as show:
        walk = walk_trial(recorded, with_fit=fit_offsets, step_s=1e-3 * step_ms, progress=show)
    metrics = write_walk(walk.result, walk.trial, out, fit=walk.fit, replay=replay)
    print_walk(metrics, offsets_are="with those of the fitted contact" if contact else "not fitted")
    say(f"written to {out}")


def print_walk(metrics: dict[str, Any], *, offsets_are: str = "not fitted") -> None:
    """The scores of a walk, its offsets (`offsets_are`: where they come from, unless fitted), doubts and notes."""
    grid = Table("", "value", title=Text(metrics["trial"]), show_header=False)
    for label, key, form in (
        ("resultant GRF, RMSE (BW)", "grf_rmse_bw", "{:.3f}"), ("resultant GRF, R²", "grf_r2", "{:.3f}"),
        ("vertical, RMSE (BW)", "vertical_rmse_bw", "{:.3f}"), ("fore-aft, RMSE (BW)", "fore_aft_rmse_bw", "{:.3f}"),
        ("vertical impulse, error", "vertical_impulse_error", "{:+.1%}"),
        ("centre of pressure, RMSE (foot lengths)", "cop_rmse_fl", "{:.3f}"),
        ("stance, measured (s)", "stance_measured_s", "{:.3f}"), ("stance, model (s)", "stance_model_s", "{:.3f}"),
        ("unconverged steps", "unconverged_steps", "{:d}"), ("steps cut into smaller ones", "refined_steps", "{:d}"),
        ("simulated (s)", "simulated_s", "{:.3f}"),
        ("wall time (s)", "wall_s", "{:.3f}"), ("compilation, apart (s)", "compile_s", "{:.1f}"),
    ):
        if key != "refined_steps" or metrics[key]:
            grid.add_row(label, "not known" if metrics[key] is None else form.format(metrics[key]))
    console.print(grid)
    offsets = metrics["offsets"]
    fitted = offsets_are if metrics["offset_fit"] is None else "fitted to this plate"
    say(f"offsets ({fitted}): height {1e3 * offsets['height_m']:.1f} mm, fore-aft {1e3 * offsets['fore_aft_m']:.1f} "
        f"mm, alignment {degrees(offsets['alignment_rad']):.1f}°")
    for doubt in metrics["doubts"]:
        warn(doubt)
    for note in metrics["notes"]:
        say(f"- {note}")
