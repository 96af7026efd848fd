"""`vsf-drake bench`: the foot in the testing machine."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table

from vsf_drake.cli.app import Contact, Model, Out, app, console, contact_hash, file_of, model_of, progress
from vsf_drake.files import user_path


@app.command()
def bench(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[list[float] | None, typer.Option(
        help="Fulcrum position from the keel's posterior end; repeat for several. Default: the paper's five.")] = None,
    max_load_n: Annotated[float, typer.Option(help="Load at which a pass ends.")] = 600.0,
    speed_mm_per_min: Annotated[float, typer.Option(help="Speed of the platen.")] = 50.0,
    heel: Annotated[bool, typer.Option(help="Test the heel too.")] = True,
) -> None:
    """Presses the foot in the testing machine: stiffness at each fulcrum position and at the heel."""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.report.outputs import BENCH, write_bench
    from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, run_bench

    out, contact = BENCH.check(user_path(out)), file_of(contact)
    pressed = model_of(file_of(model), contact)
    positions = [1e-3 * position for position in fulcrum_mm] if fulcrum_mm else PUBLISHED_FULCRUMS_M
    with progress() as show:
        result = run_bench(pressed, fulcrums_m=positions, heel=heel, max_load_n=max_load_n,
                           speed_m_per_s=1e-3 * speed_mm_per_min / 60.0, progress=lambda f: show("pressing", f),
                           inputs=contact_hash(contact))
    print_bench(write_bench(result, out))
    if contact:
        console.print(f"the foot has the fitted contact of {contact}", highlight=False, markup=False)
    console.print(f"written to {out}", highlight=False)


def print_bench(table: dict[str, Any]) -> None:
    """The table of settings, and how long it took."""
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
    refined = f", {table['refined_steps']} cut into smaller ones" if table["refined_steps"] else ""
    console.print(f"{table['simulated_s']:.0f} s simulated in {table['wall_s']:.2f} s "
                  f"(compilation, {table['compile_s']:.1f} s, apart), "
                  f"{table['unconverged_steps']} steps unconverged{refined}", highlight=False)
