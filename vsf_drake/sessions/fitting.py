"""A contact fit with all that it leaves on disk: searched, judged, written, and gone on with after
an interruption."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsf_drake.base.errors import FitError, InputError, SimulationError, require
from vsf_drake.base.files import read_json, write_json
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.fit.assessment import Assessment, assess
from vsf_drake.fit.options import PAPER
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import ContactFitSolution, solve
from vsf_drake.fit.table import FitTable, fit_json, fit_table
from vsf_drake.motion.trial import Trial
from vsf_drake.report.fit_output import FIT, clear_fit, write_fit

_SEARCHED, _SCORED, _REFITTED = 0.6, 0.85, 0.95
"""Shares of the bar at which searching, scoring and fitting again end."""


@dataclass(frozen=True, kw_only=True)
class FitTask:
    """A fit that can be done; `options` are what was asked for."""

    problem: ContactFit
    held_out: Sequence[Trial]
    quick: bool
    """one search, no fulcrum sweeps, no trial left out in turn"""
    own_height: bool  # whether held-out trials are judged at a height of their own
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


def run_task(
    task: FitTask, out: Path, checkpoint: Checkpoint, progress: Progress | None = None
) -> FitTable:
    """Fits, judges and writes to `out`; the table, whether the fit succeeded or not."""
    show = part_of(progress)

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
            sweep=not task.quick,
            leave_out=not task.quick,
            own_height=task.own_height,
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


def _solved(task: FitTask, checkpoint: Checkpoint, show: Progress) -> ContactFitSolution:
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
