"""`vsf-drake fit`: contact, geometry and shared errors of motion from recorded trials, and what
that is worth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.base.errors import FitError, require
from vsf_drake.base.schema import choice, option
from vsf_drake.cli.app import (
    FolderOrTrials,
    Out,
    app,
    interrupted,
    manifests_of,
    progress,
    say,
    under,
    warn,
)
from vsf_drake.cli.options import Asked, fields_of, flags, from_fields
from vsf_drake.cli.recordings import AcceptUnusable, judged
from vsf_drake.fit.options import JOINT, PAPER, ContactFitOptions
from vsf_drake.simulation.options import LawOptions


@dataclass(frozen=True, kw_only=True)
class FitRequest(LawOptions):
    """What is asked of a fit beside its options."""

    bench: Path | None = option(
        None,
        "The foot as measured on a testing machine, for the fitted foot to agree with: stiffness "
        "or curves.",
        metavar="BENCH.yaml|CURVES.csv",
    )
    hold_out: tuple[Path, ...] = option(
        (),
        "A trial that is not fitted and on which the fit is judged; may be repeated.",
        metavar="TRIAL.yaml",
    )
    held_out_height: bool = option(
        False, "Judge each held-out trial at a height that is fitted to its own plate."
    )
    strategy: str = choice(
        JOINT,
        options=(JOINT, PAPER),
        source="choice",
        metavar=f"{JOINT}|{PAPER}",
        help="All trials at once with priors, or the paper's procedure.",
    )
    free: tuple[str, ...] = option(
        (),
        "A frozen parameter to fit as well, or a prefix: 'friction.*'; may be repeated.",
        metavar="NAME",
    )
    freeze: tuple[str, ...] = option(
        (),
        "A parameter to keep at its start value, or a prefix: 'curve.*'; may be repeated.",
        metavar="NAME",
    )
    prior: tuple[str, ...] = option(
        (),
        "How well a parameter was known before: 'curve.*=1.5deg'; in its unit, deg or mm, of its "
        "logarithm where that is fitted; may be repeated.",
        metavar="NAME=SD",
    )
    prior_file: Path | None = option(
        None,
        "The same from a file, one line NAME: SD each; --prior has precedence.",
        metavar="PRIORS.yaml",
    )
    resultant: bool = option(
        False, "Compare the size of the force instead of its three components."
    )
    no_cop: bool = option(False, "Do not compare the centre of pressure.")
    paths: bool = option(False, "Fit a slow correction of the pelvis's path in each trial.")
    damping_by_zone: bool = option(False, "Fit the damping of each zone instead of one for all.")
    quick: bool = option(False, "One search, no fulcrum sweeps, no trial left out in turn.")


_OF_BOTH = {"law", "bench", "hold_out", "held_out_height", "strategy", "seed", "quick"}
"""Options that are not of the joint strategy alone."""


@app.command()
@from_fields
def fit(
    trials: FolderOrTrials,
    out: Out,
    request: FitRequest,
    search: Annotated[Asked, ContactFitOptions],
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the interrupted fit in --out.")
    ] = False,
    accept_unusable: AcceptUnusable = False,
) -> None:
    """Fits the contact of the foot to one or more trials, and reports how well it predicts.

    Give trials at two or more fulcrum positions, a bench and some held-out trials: one stiffness
    alone does not identify the model. Of a folder the best recording of its softest and of its
    stiffest setting is fitted, and all others are held out. contact.yaml, for --contact of the
    other commands, is written only if the fit succeeded; a fit that failed ends with exit code 4
    and says in fit.json and report.html how far it came, what stood in the way and what to do.
    Ctrl-C, a time limit and too few iterations leave a checkpoint, from which the same command
    continues with --resume.
    """
    for name, field in fields_of(ContactFitOptions, FitRequest).items():
        given = name in search or getattr(request, name, field.default) != field.default
        require(
            request.strategy == JOINT or name in _OF_BOTH or not given,
            "is an option of the joint strategy; the paper's procedure is fitted as it is written",
            flags(field)[0],
            "Leave it out",
        )
    require(
        request.hold_out or not request.held_out_height,
        "there is no held-out trial",
        "--held-out-height",
        "Name one with --hold-out",
    )
    require(
        not request.quick or search.get("starts", 1) == 1,
        "cannot go with --quick, which searches once",
        "--starts",
        "Leave one of them out",
    )
    for pattern in request.free:
        require(
            pattern not in request.freeze,
            f"{pattern} is to be free and frozen",
            "--free",
            "Decide for one",
        )
    from vsf_drake.cli.fit_run import make_task
    from vsf_drake.model.bench_curves import bench_doubts
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.report.fit_output import CHECKPOINT, CONTACT, FIT, synthetic_of
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.sessions.fitting import Checkpoint, run_task
    from vsf_drake.sessions.table import outer_walks

    of_folder = any(given.is_dir() for given in trials)
    require(
        not of_folder or (len(trials) == 1 and not request.hold_out),
        "a folder stands alone: which of its trials are held out it decides",
        "TRIAL.yaml...|FOLDER",
        "Name one folder and nothing else, or manifests",
    )
    trials = manifests_of(trials)
    FIT.check(out)
    checkpoint = Checkpoint(out / CHECKPOINT, resume=resume)
    read = judged(
        under(request.law, map(load_trial, (*trials, *request.hold_out))), accept=accept_unusable
    )
    fitted = read[: len(trials)]
    held_out = read[len(trials) :]
    if of_folder:
        fitted = [read[i] for i in outer_walks(read)]
        held_out = [trial for trial in read if trial not in fitted]
        say(f"Fitted: {', '.join(trial.path.stem for trial in fitted)}; the others are held out")
    task = make_task(fitted, held_out, request, search)
    synthetic = synthetic_of(task.table())
    if synthetic:
        say(f"SYNTHETIC, not recorded: {', '.join(synthetic)}.")
    for sentence in bench_doubts(task.problem.bench) if task.problem.bench else ():
        warn(sentence)
    if checkpoint.note:
        warn(checkpoint.note)
    try:
        with progress() as show:
            table = run_task(task, out, checkpoint, show)
    except KeyboardInterrupt:
        interrupted(checkpoint.after_interruption())
    if not table.success:
        for sentence in table.verdict:
            warn(sentence)
        raise FitError(
            f"the fit failed: {table.message.removesuffix('.')}. See {out / 'report.html'}; "
            "no contact.yaml was written"
        )
    for sentence in table.headline:
        say(sentence)
    say(f"written to {out / PAGE}; {CONTACT} beside it is for --contact")
