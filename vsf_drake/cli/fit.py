"""`vsf-drake fit`: contact, geometry and shared errors of motion from recorded trials, and what that is worth."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from vsf_drake.cli.app import Out, app, console, errors, file_of
from vsf_drake.cli.fit_names import check_patterns
from vsf_drake.cli.fit_screen import print_fit
from vsf_drake.errors import FitError, InputError
from vsf_drake.files import user_path

JOINT, PAPER = "joint", "paper"


@app.command()
def fit(
    trials: Annotated[list[Path], typer.Argument(metavar="TRIAL.yaml...", help="Trial manifests of one person.")],
    out: Out,
    bench: Annotated[Path | None, typer.Option(
        metavar="BENCH.yaml|CURVES.csv",
        help="The foot on a testing machine, so that what is fitted stays that foot: stiffness, or curves.")] = None,
    hold_out: Annotated[list[Path] | None, typer.Option(
        metavar="TRIAL.yaml", help="A trial that judges the fit and is not fitted; repeat it for more.")] = None,
    strategy: Annotated[str, typer.Option(
        metavar="joint|paper", help="All trials at once with priors, or the paper's procedure.")] = JOINT,
    starts: Annotated[int | None, typer.Option(help="Searches from different starts.", show_default="5")] = None,
    seed: Annotated[int, typer.Option(help="Of all that is drawn.")] = 0,
    solver: Annotated[str | None, typer.Option(
        metavar="gauss_newton|snopt|ipopt|nlopt", help="Of each search.", show_default="gauss_newton")] = None,
    free: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="A frozen parameter to fit as well, or a prefix: 'friction.*'; repeat it.")] = None,
    freeze: Annotated[list[str] | None, typer.Option(
        metavar="NAME", help="A parameter to leave where it starts, or a prefix: 'curve.*'; repeat it.")] = None,
    resultant: Annotated[bool, typer.Option(
        "--resultant", help="Compare the size of the force instead of its three components.")] = False,
    no_cop: Annotated[bool, typer.Option("--no-cop", help="Do not compare the centre of pressure.")] = False,
    paths: Annotated[bool, typer.Option(
        "--paths", help="Fit a slow correction of the pelvis's path in each trial.")] = False,
    damping_by_zone: Annotated[bool, typer.Option(
        "--damping-by-zone", help="Fit the damping of each zone instead of one for all.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the interrupted fit in --out.")] = False,
    quick: Annotated[bool, typer.Option(
        "--quick", help="One search, no fulcrum sweeps, no trial left out in turn.")] = False,
) -> None:
    """Fits the contact of the foot to one or more trials, and says in numbers and words what the fit is worth.

    Give trials at two or more fulcrum positions, a bench and some held-out trials: one stiffness alone does not
    identify the model. contact.yaml, for --contact of the other commands, is written only if the fit succeeded; a fit
    that failed ends with exit code 4 and says why in fit.json and report.html. Ctrl-C leaves a checkpoint from which
    the same command with --resume goes on.
    """
    chosen = {"--starts": starts is not None, "--solver": solver is not None, "--free": bool(free),
              "--freeze": bool(freeze), "--resultant": resultant, "--no-cop": no_cop, "--paths": paths,
              "--damping-by-zone": damping_by_zone}
    _check_options(strategy, chosen, quick=quick, starts=starts, seed=seed)
    check_patterns(free or [], freeze or [])
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.measured_bench import load_measured_bench
    from vsf_drake.cli.fit_run import Checkpoint, Task, run_task
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.report.fit_output import CHECKPOINT, check_fit_folder

    out, bench = user_path(out), file_of(bench)
    check_fit_folder(out)
    checkpoint = Checkpoint(out / CHECKPOINT, resume=resume)
    task = Task(
        trials=[load_trial(user_path(path)) for path in trials], strategy=strategy,
        held_out=[load_trial(user_path(path)) for path in hold_out or ()],
        bench=None if bench is None else load_measured_bench(bench), bench_file=bench, seed=seed,
        starts=1 if quick else starts, solver=solver, free=tuple(free or ()), freeze=tuple(freeze or ()),
        resultant=resultant, cop=not no_cop, paths=paths, damping_by_zone=damping_by_zone, quick=quick)
    task.check()
    _announce(task, checkpoint)
    try:
        table = run_task(task, out, checkpoint)
    except KeyboardInterrupt:
        errors.print(checkpoint.after_interruption(), highlight=False, soft_wrap=True, markup=False)
        sys.exit(130)
    if not table["success"]:
        raise FitError(f"the fit failed: {table['message'].removesuffix('.')}. See {out / 'report.html'}; "
                       "no contact.yaml was written")
    print_fit(table)
    console.print(f"written to {out}; read report.html first, contact.yaml is for --contact", highlight=False,
                  markup=False, soft_wrap=True)


def _check_options(
    strategy: str, chosen: dict[str, bool], *, quick: bool, starts: int | None, seed: int
) -> None:
    """Raises InputError for what cannot go together, before anything is read."""
    if strategy not in (JOINT, PAPER):
        raise InputError(f"{strategy!r} is no strategy", where="--strategy", right=f"There are: {JOINT}, {PAPER}")
    given = [option for option, is_given in chosen.items() if is_given]
    if strategy == PAPER and given:
        raise InputError("is an option of the joint strategy; the paper's procedure is fitted as it is written",
                         where=given[0], right="Leave it out")
    if quick and starts not in (None, 1):
        raise InputError("cannot go with --quick, which searches once", where="--starts",
                         right="Leave one of them out")
    if starts is not None and starts < 1:
        raise InputError(f"{starts} searches are none", where="--starts", right="Give 1 or more")
    if seed < 0:
        raise InputError(f"{seed} is negative", where="--seed")


def _announce(task: Any, checkpoint: Any) -> None:
    """What is said before the fit begins."""
    if task.synthetic:
        console.print(f"SYNTHETIC, not recorded: {', '.join(task.synthetic)}.", highlight=False, markup=False)
    if task.bench is None:
        console.print("No bench was given: the walks alone decide how stiff the foot is.", highlight=False)
    if checkpoint.note:
        console.print(f"! {checkpoint.note}", style="bold yellow", highlight=False, markup=False, soft_wrap=True)
