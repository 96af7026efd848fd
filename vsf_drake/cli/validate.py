"""`vsf-drake validate`: bench and walk on the embedded data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import Out, app, console, progress, target
from vsf_drake.cli.bench import print_bench
from vsf_drake.cli.simulate import print_walk


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

    out = target(out, "bench")
    console.print("Walking data are SYNTHETIC (built from published group means); bench end points are published.")
    with progress() as show:
        result = run_bench(load_model(resource("models/nominal.yaml")), progress=lambda f: show("pressing", f))
    print_bench(write_bench(result, out))
    for manifest in embedded_trials():
        with progress() as show:
            walk = validate_walk(manifest, step_s=QUICK_STEP_S if quick else DEFAULT_STEP_S, progress=show)
        folder = out / manifest.parent.name
        print_walk(write_walk(walk.result, walk.trial, folder, fit=walk.fit, replay=not quick))
    console.print(f"written to {out}", highlight=False)
