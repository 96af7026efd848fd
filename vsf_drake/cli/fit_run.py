"""What `vsf-drake fit` does once its options are read: builds the problem, fits, judges, writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsf_drake.base.errors import FitError, InputError, SimulationError, require
from vsf_drake.base.files import read_json, sha256, write_json
from vsf_drake.cli.app import progress
from vsf_drake.cli.fit_priors import prior_widths, with_frozen, with_priors
from vsf_drake.cli.options import Asked, made
from vsf_drake.device.bench_lines import CURVES, load_measured_bench
from vsf_drake.fit.assessment import Assessment, assess
from vsf_drake.fit.options import COP, FORCES, PAPER, RESULTANT, ContactFitOptions, PaperOptions
from vsf_drake.fit.parameters import standard_parameters
from vsf_drake.fit.problem import ContactFit, bench_of, check_recordings
from vsf_drake.fit.solution import ContactFitSolution, solve
from vsf_drake.fit.table import FitTable, fit_json, fit_table
from vsf_drake.motion.trial import Trial
from vsf_drake.report.fit_output import FIT, clear_fit, write_fit
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.recorded_walk import labels_of

if TYPE_CHECKING:
    from vsf_drake.cli.fit import FitRequest

_SEARCHED, _SCORED, _REFITTED = 0.6, 0.85, 0.95
"""Shares of the bar at which searching, scoring and fitting again end."""


@dataclass(frozen=True, kw_only=True)
class FitTask:
    """A fit that can be done; `options` are what was asked for."""

    problem: ContactFit
    request: FitRequest
    held_out: Sequence[Trial]
    options: Mapping[str, object]
    inputs: Mapping[str, str]

    def table(
        self,
        solution: ContactFitSolution | None = None,
        judged: Assessment | None = None,
        *,
        failed: str = "",
    ) -> FitTable:
        """The table of this fit if it ended, or failed, so."""
        return fit_table(
            self.problem,
            solution,
            judged,
            failed=failed,
            held_out=self.held_out,
            options=self.options,
            inputs=self.inputs,
        )


def make_task(
    trials: list[Trial], held_out: list[Trial], request: FitRequest, search: Asked
) -> FitTask:
    """What the command's options ask for, after making sure, before the long part, that all of it
    can be fitted."""
    widths = prior_widths(request.prior, request.prior_file)
    bench = None if request.bench is None else load_measured_bench(request.bench)
    asked: dict[str, object] = {}
    options: ContactFitOptions | PaperOptions
    if request.strategy == PAPER:
        options = PaperOptions(**search)
    else:
        asked = {
            "free": request.free,
            "freeze": request.freeze,
            "paths": request.paths,
            "damping_by_zone": request.damping_by_zone,
            "priors": widths,
        }
        forces = (RESULTANT,) if request.resultant else FORCES
        series = forces if request.no_cop else (*forces, *COP)
        quick = {"starts": 1} if request.quick else {}
        options = made(ContactFitOptions, {**search, **quick, "series": series})
    check_recordings(trials, held_out, series=options.series)
    subject = trials[0].subject
    model = trials[0].model
    if bench is not None and request.bench is not None:
        try:
            bench_of(model.foot, bench)
        except InputError as error:
            forefoot = "column fulcrum" if request.bench.suffix.lower() == CURVES else "forefoot"
            where = forefoot if error.where == "fulcrums_m" else error.where
            raise InputError(
                error.what, file=request.bench, where=where, right=error.right
            ) from None
    walker = Walker(subject, model)
    parameters = standard_parameters(
        walker.variables,
        subject.prosthetic_side,
        labels_of(trials),
        bench=bench is not None,
        damping_by_zone=request.damping_by_zone,
        paths=request.paths,
    )
    problem = ContactFit(
        trials,
        bench=bench,
        options=options,
        walker=walker,
        parameters=with_priors(with_frozen(parameters, request.free, request.freeze), widths),
    )
    return FitTask(
        problem=problem,
        request=request,
        held_out=held_out,
        inputs={}
        if request.bench is None
        else {f"bench: {request.bench.name}": sha256(request.bench)},
        options={
            **asked,
            "quick": request.quick,
            "own_height": request.held_out_height,
            "bench": None if request.bench is None else request.bench.name,
        },
    )


class Checkpoint:
    """The state of a fit on disk, and the moment from which on the folder is that fit's."""

    def __init__(self, path: Path, *, resume: bool) -> None:
        self.path = path
        self.resumed = resume
        self.began = False
        self.saved = False
        self.state: dict[str, Any] | None = None  # to go on from
        self.note = ""  # what a user should know before the fit begins
        if resume:
            require(
                path.exists(),
                "there is no interrupted fit to go on from",
                "--resume",
                "Leave --resume out to begin one",
                file=path,
            )
            self.state = read_json(path, damaged="Leave --resume out to begin again")
        elif path.exists():
            self.note = (
                f"{path} is left by an interrupted fit, which this one replaces; --resume would "
                "have gone on from it"
            )

    def begin(self, task: FitTask) -> None:
        """Takes the folder, once: what an earlier fit left goes, and fit.json says that this one
        has not ended."""
        if self.began:
            return
        self.began = True
        self.path.parent.mkdir(parents=True, exist_ok=True)
        clear_fit(self.path.parent, checkpoint=not self.resumed)
        write_json(
            self.path.parent / FIT.table,
            {
                **fit_json(task.table(failed="the fit has not ended")),
                "files": [FIT.table],
                "arrays_sha256": None,
            },
        )

    def save(self, state: Mapping[str, Any]) -> None:
        """Replaces the state on disk."""
        write_json(self.path, state)
        self.saved = True

    def after_interruption(self) -> str:
        """What to tell who pressed Ctrl-C, after "interrupted"."""
        if self.saved or (self.resumed and self.path.exists()):
            return (
                f"; {self.path} holds what was found: the same command with --resume goes on from "
                "it"
            )
        if self.began:
            return " before anything was found; the same command begins again"
        return " before the fit began; nothing was written"


def run_task(task: FitTask, out: Path, checkpoint: Checkpoint) -> FitTable:
    """Fits, judges and writes to `out`; the table, whether the fit succeeded or not."""
    with progress() as show:

        def judging(what: str, share: float) -> None:
            low, high = (_SCORED, _REFITTED) if what.startswith("fitting") else (_SEARCHED, _SCORED)
            show(what, low + (high - low) * share)

        solution = None
        try:
            solution = _solved(task, checkpoint, show)
            if not solution.success:
                raise FitError(solution.message)
            judged = assess(
                solution,
                task.held_out,
                sweep=not task.request.quick,
                leave_out=not task.request.quick,
                own_height=task.request.held_out_height,
                progress=judging,
            )
        except (FitError, SimulationError) as error:
            # of a good fit, its walks or its foot fail where it is judged
            good = solution is not None and solution.success
            table = task.table(
                solution,
                _best_point(task, solution),
                failed=f"it cannot be judged: {error}" if good else str(error),
            )
            write_fit(table, out)
            return table
        show("writing figures and page", _REFITTED)
        table = task.table(solution, judged)
        contact = solution.contact(table.verdict)
        write_fit(table, out, contact=judged.layers.teach(contact) if judged.layers else contact)
        return table


def _best_point(task: FitTask, solution: ContactFitSolution | None) -> Assessment | None:
    """How far off the walks are at the best point of a joint fit that did not converge; None where
    they fail."""
    if solution is None or solution.success or task.problem.options.strategy == PAPER:
        return None
    try:
        return assess(
            solution.opened(),
            task.held_out,
            sweep=False,
            leave_out=False,
            angle_errors=False,
            layers=False,
        )
    except (FitError, SimulationError):
        return None


def _solved(
    task: FitTask, checkpoint: Checkpoint, show: Callable[[str, float], None]
) -> ContactFitSolution:
    highest = 0.0

    def tell(what: str, share: float) -> None:
        nonlocal highest
        checkpoint.begin(task)
        highest = max(highest, share)
        show(what, _SEARCHED * highest)

    def save(state: Mapping[str, Any]) -> None:
        checkpoint.begin(task)  # where a search's first walk fails, nothing was told yet
        checkpoint.save(state)

    show("preparing", 0.0)
    try:
        return solve(task.problem, progress=tell, resume=checkpoint.state, checkpoint=save)
    except InputError as error:
        if error.where != "resume":
            raise
        raise InputError(
            error.what, file=checkpoint.path, where="--resume", right=error.right
        ) from None
