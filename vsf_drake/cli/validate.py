"""`vsf-drake validate`: bench and walk on the embedded data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from vsf_drake.cli.app import Contact, Out, app, console, contact_hash, file_of, model_of, progress, target
from vsf_drake.cli.bench import print_bench


@app.command()
def validate(
    out: Out = Path("results"),
    contact: Contact = None,
    quick: Annotated[bool, typer.Option("--quick", help="One walk a setting, coarser step, no replay.")] = False,
) -> None:
    """Bench and walks on the embedded data: published bench end points, and the synthetic reference subject."""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.validation import embedded_trials, validate_walk
    from vsf_drake.contact_file import load_contact
    from vsf_drake.motion.fitted_trial import check_person
    from vsf_drake.motion.subject_file import load_subject
    from vsf_drake.report.outputs import write_bench, write_walk
    from vsf_drake.simulation.bench import run_bench
    from vsf_drake.simulation.walk import DEFAULT_STEP_S

    out, contact = target(out, "bench"), file_of(contact)
    pressed, manifests = model_of(None, contact), embedded_trials(quick=quick)
    console.print("Walking data are SYNTHETIC (a virtual laboratory's); bench end points are published.")
    if contact:
        check_person(load_subject(manifests[0]), load_contact(contact), file=contact)
        console.print(f"The fitted contact of {contact} has its offsets: they are not fitted to each walk.",
                      highlight=False, markup=False)
    with progress() as show:
        result = run_bench(pressed, progress=lambda f: show("pressing", f),
                           inputs=contact_hash(contact))
    print_bench(write_bench(result, out))
    walks: dict[str, dict[str, Any]] = {}
    for manifest in manifests:
        with progress() as show:
            walk = validate_walk(manifest, with_fit=contact is None, contact=contact,
                                 step_s=2e-3 if quick else DEFAULT_STEP_S,
                                 progress=lambda what, f, name=manifest.stem: show(f"{name}: {what}", f))
        walks[manifest.stem] = write_walk(walk.result, walk.trial, out / manifest.stem, fit=walk.fit, replay=not quick)
    print_walks(walks, offsets="of the fitted contact" if contact else "fitted to each plate")
    console.print(f"written to {out}", highlight=False)


def print_walks(walks: dict[str, dict[str, Any]], *, offsets: str) -> None:
    """One row a walk, by name, then what is doubtful about any; `offsets` tells where they come from."""
    grid = Table("walk", "GRF RMSE (BW)", "R²", "impulse", "CoP (FL)", "stance (s)", "model (s)",
                 title=f"Walks (SYNTHETIC), offsets {offsets}; FL: foot lengths")
    for name, walk in walks.items():
        cells = (("{:.3f}", "grf_rmse_bw"), ("{:.3f}", "grf_r2"), ("{:+.1%}", "vertical_impulse_error"),
                 ("{:.3f}", "cop_rmse_fl"), ("{:.3f}", "stance_measured_s"), ("{:.3f}", "stance_model_s"))
        grid.add_row(name, *("not known" if walk[key] is None else form.format(walk[key]) for form, key in cells))
    console.print(grid)
    for name, walk in walks.items():
        for doubt in walk["doubts"]:
            console.print(f"! {name}: {doubt}", style="bold yellow", highlight=False, markup=False)
