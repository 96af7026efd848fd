"""`vsf-drake fit`: contact, geometry and shared errors of motion from recorded trials, and what that is worth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import Out, app, interrupted, path, print_text, say, warn
from vsf_drake.errors import FitError, InputError

JOINT, PAPER = "joint", "paper"


@app.command()
def fit(
    trials: Annotated[
        list[Path],
        typer.Argument(parser=path, metavar="TRIAL.yaml...", help="Trial manifests of one person."),
    ],
    out: Out,
    bench: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            metavar="BENCH.yaml|CURVES.csv",
            help="The foot as measured on a testing machine, for the fitted foot to agree with: stiffness or curves.",
        ),
    ] = None,
    hold_out: Annotated[
        list[Path] | None,
        typer.Option(
            parser=path,
            metavar="TRIAL.yaml",
            help="A trial that is not fitted and on which the fit is judged; may be repeated.",
        ),
    ] = None,
    held_out_height: Annotated[
        bool,
        typer.Option(
            "--held-out-height",
            help="Judge each held-out trial at a height that is fitted to its own plate.",
        ),
    ] = False,
    strategy: Annotated[
        str,
        typer.Option(
            metavar="joint|paper", help="All trials at once with priors, or the paper's procedure."
        ),
    ] = JOINT,
    starts: Annotated[
        int | None, typer.Option(help="Searches from different starts.", min=1, show_default="5")
    ] = None,
    seed: Annotated[
        int, typer.Option(help="Seed of everything that is drawn at random.", min=0)
    ] = 0,
    solver: Annotated[
        str | None,
        typer.Option(
            metavar="gauss_newton|snopt|ipopt|nlopt",
            help="Solver of each search.",
            show_default="gauss_newton",
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A frozen parameter to fit as well, or a prefix: 'friction.*'; may be repeated.",
        ),
    ] = None,
    freeze: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A parameter to keep at its start value, or a prefix: 'curve.*'; may be repeated.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=SD",
            help="How well a parameter was known before: 'curve.*=1.5deg'; in its unit, deg or mm, "
            "of its logarithm where that is fitted; may be repeated.",
        ),
    ] = None,
    prior_file: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            metavar="PRIORS.yaml",
            help="The same from a file, one line NAME: SD each; --prior has precedence.",
        ),
    ] = None,
    iterations: Annotated[
        int | None,
        typer.Option(help="Largest number of walks of a search.", min=1, show_default="100"),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Time after which the search ends where it is.", min=1.0
        ),
    ] = None,
    resultant: Annotated[
        bool,
        typer.Option(
            "--resultant", help="Compare the size of the force instead of its three components."
        ),
    ] = False,
    no_cop: Annotated[
        bool, typer.Option("--no-cop", help="Do not compare the centre of pressure.")
    ] = False,
    paths: Annotated[
        bool,
        typer.Option("--paths", help="Fit a slow correction of the pelvis's path in each trial."),
    ] = False,
    damping_by_zone: Annotated[
        bool,
        typer.Option(
            "--damping-by-zone", help="Fit the damping of each zone instead of one for all."
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the interrupted fit in --out.")
    ] = False,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="One search, no fulcrum sweeps, no trial left out in turn."),
    ] = False,
) -> None:
    """Fits the contact of the foot to one or more trials, and reports how well it predicts.

    Give trials at two or more fulcrum positions, a bench and some held-out trials: one stiffness alone does not
    identify the model. contact.yaml, for --contact of the other commands, is written only if the fit succeeded; a fit
    that failed ends with exit code 4 and says in fit.json and report.html how far it came, what stood in the way
    and what to do. Ctrl-C, a time limit and too few iterations leave a checkpoint, from which the same command
    continues with --resume.
    """
    given = [
        option
        for option, chosen in (
            ("--starts", starts is not None),
            ("--solver", solver),
            ("--free", free),
            ("--freeze", freeze),
            ("--resultant", resultant),
            ("--no-cop", no_cop),
            ("--paths", paths),
            ("--damping-by-zone", damping_by_zone),
            ("--prior", prior),
            ("--prior-file", prior_file),
            ("--iterations", iterations),
            ("--time-limit", time_limit),
        )
        if chosen
    ]
    if strategy not in (JOINT, PAPER):
        raise InputError(
            f"{strategy!r} is no strategy", where="--strategy", right=f"There are: {JOINT}, {PAPER}"
        )
    if strategy == PAPER and given:
        raise InputError(
            "is an option of the joint strategy; the paper's procedure is fitted as it is written",
            where=given[0],
            right="Leave it out",
        )
    if held_out_height and not hold_out:
        raise InputError(
            "there is no held-out trial",
            where="--held-out-height",
            right="Name one with --hold-out",
        )
    if quick and starts not in (None, 1):
        raise InputError(
            "cannot go with --quick, which searches once",
            where="--starts",
            right="Leave one of them out",
        )
    for pattern in free or ():
        if pattern in (freeze or ()):
            raise InputError(
                f"{pattern} is to be free and frozen", where="--free", right="Decide for one"
            )
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.cli.fit_run import Checkpoint, make_task, run_task
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.report.fit_output import CHECKPOINT, CONTACT, FIT, found, synthetic_of
    from vsf_drake.report.results_folder import PAGE

    FIT.check(out)
    checkpoint = Checkpoint(out / CHECKPOINT, resume=resume)
    task = make_task(
        [load_trial(file) for file in trials],
        [load_trial(file) for file in hold_out or ()],
        bench_file=bench,
        strategy=strategy,
        seed=seed,
        starts=starts,
        solver=solver,
        free=free or (),
        freeze=freeze or (),
        resultant=resultant,
        cop=not no_cop,
        paths=paths,
        damping_by_zone=damping_by_zone,
        quick=quick,
        own_height=held_out_height,
        priors=prior or (),
        prior_file=prior_file,
        iterations=iterations,
        time_limit_s=time_limit,
    )
    synthetic = synthetic_of(task.table())
    if synthetic:
        say(f"SYNTHETIC, not recorded: {', '.join(synthetic)}.")
    if checkpoint.note:
        warn(checkpoint.note)
    try:
        table = run_task(task, out, checkpoint)
    except KeyboardInterrupt:
        interrupted(checkpoint.after_interruption())
    if not table.success:
        for sentence in table.verdict:
            warn(sentence)
        raise FitError(
            f"the fit failed: {table.message.removesuffix('.')}. See {out / 'report.html'}; "
            "no contact.yaml was written"
        )
    print_text("fit", **found(table))
    say(f"written to {out / PAGE}; {CONTACT} beside it is for --contact")
