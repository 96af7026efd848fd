"""`vsf-drake validate`: the paper's study, and more, as a report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from vsf_drake.cli.app import INTERRUPTED, Contact, Out, app, console, errors, file_of, progress
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import user_path

MOST_ISO_FORCE_N = 10_000.0
"""Beyond what any structural test presses a foot with (a choice)."""


@app.command()
def validate(
    trials: Annotated[list[Path] | None, typer.Argument(
        metavar="[TRIAL.yaml...]", help="Trial manifests; without any, the embedded synthetic subject.")] = None,
    out: Out = Path("results"),
    contact: Contact = None,
    bench: Annotated[Path | None, typer.Option(
        help="Measured load-displacement curves: CSV with fulcrum_mm, displacement_mm, load_n.")] = None,
    quick: Annotated[bool, typer.Option(
        "--quick", help="The short form: one embedded walk a setting, coarser steps, small samples.")] = False,
    seed: Annotated[int, typer.Option(help="Of all that is random.", min=0)] = 0,
    workers: Annotated[int | None, typer.Option(
        help="Processes for many walks; default one a core. The numbers do not depend on it.", min=1)] = None,
    iso_force_n: Annotated[float | None, typer.Option(
        help="Largest force of the ISO 22675 loading profile; default the subject's weight.")] = None,
) -> None:
    """The paper's study and more, as one report: bench, standing, walking, energy, roll-over, sensitivity."""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.validation import (
        StudyOptions,
        embedded_bench,
        embedded_contact,
        embedded_trials,
        make_study,
    )
    from vsf_drake.analysis.validation.content import first_line, validation_content
    from vsf_drake.analysis.validation.run import NAMES, SectionStore, run_sections
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.validation.output import UNFINISHED, VALIDATION, write_validation

    out, contact, bench = user_path(out), file_of(contact), file_of(bench)
    VALIDATION.check(out)
    if iso_force_n is not None and not 0.0 < iso_force_n <= MOST_ISO_FORCE_N:
        raise InputError(f"{iso_force_n:g} N is no force of a structural test of feet", where="--iso-force-n",
                         right=f"Give newtons, above 0 and at most {MOST_ISO_FORCE_N:g}")
    options = StudyOptions(quick=quick, seed=seed, workers=workers, iso_force_n=iso_force_n)
    exact = None
    with progress() as show:
        if trials:
            study = make_study([user_path(path) for path in trials], contact=contact, bench=bench, options=options,
                               progress=show)
        else:
            study = make_study(embedded_trials(quick=quick), contact=contact or embedded_contact(),
                               bench=bench or embedded_bench(), options=options, progress=show)
            if contact is None and not quick:
                exact = make_study(embedded_trials("exact"), contact=embedded_contact("exact"), options=options,
                                   progress=show)
    console.print(first_line(study), highlight=False, markup=False)
    try:
        with progress() as show:
            finished = run_sections(study, exact=exact, folder=out / UNFINISHED, progress=show)
            show("writing the report", 0.99)
            written = write_validation(*validation_content(study, finished, exact=exact), out, study=study)
    except KeyboardInterrupt:
        errors.print(f"interrupted; finished sections are in {out / UNFINISHED}: the same command goes on from them",
                     highlight=False, soft_wrap=True, markup=False)
        sys.exit(INTERRUPTED)
    SectionStore(out / UNFINISHED, "").remove(NAMES)
    print_summary(written)
    console.print(f"written to {out}; open {PAGE} first", highlight=False, markup=False)
    _finish(study.failed, {name: one.failure for name, one in finished.items() if one.section is None},
            study.bench_problem)


def print_summary(content: dict[str, Any]) -> None:
    """The summary's rows, then what is missing or doubtful."""
    grid = Table("", "here", "paper", "asked", "met")
    for row in content["summary"]:
        met = {True: "yes", False: "NO", None: ""}[row["met"]]
        here = "not known" if row["shown"] is None else f"{row['shown']} {row['unit']}".strip()
        cells = (row["what"], here, row["paper"] or "", row["asked"] or "", met)
        grid.add_row(*cells, style="bold yellow" if row["met"] is False else None)
    console.print(grid)
    for note in content["notes"]:
        console.print(f"! {note}", style="bold yellow", highlight=False, markup=False)
    for trial in content["trials"]:
        if trial["doubts"]:
            console.print(f"! {trial['label']}: {trial['doubts']}", style="bold yellow", highlight=False, markup=False)


def _finish(unread: tuple[tuple[str, str], ...], failed: dict[str, str], bench_problem: str | None) -> None:
    """Names what could not be used, and ends with exit code 2 or 3 if there is anything."""
    lines = [f"{label}: {why}" for label, why in unread] + ([bench_problem] if bench_problem else [])
    for line in lines:
        errors.print(f"error: {line}", style="red", highlight=False, soft_wrap=True, markup=False)
    for name, why in failed.items():
        errors.print(f"error: the section {name} failed: {why}", style="red", highlight=False, soft_wrap=True,
                     markup=False)
    if lines or failed:
        sys.exit(InputError.exit_code if lines else SimulationError.exit_code)
