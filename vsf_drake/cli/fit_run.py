"""What `vsf-drake fit` does with its options: builds the fit that they ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import sha256
from vsf_drake.cli.fit_priors import prior_widths, with_frozen, with_priors
from vsf_drake.cli.options import Asked, made
from vsf_drake.device.bench_lines import CURVES, load_measured_bench
from vsf_drake.fit.options import COP, FORCES, PAPER, RESULTANT, ContactFitOptions, PaperOptions
from vsf_drake.fit.parameters import standard_parameters
from vsf_drake.fit.problem import ContactFit, bench_of, check_recordings
from vsf_drake.motion.trial import Trial
from vsf_drake.sessions.fitting import FitTask
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.recorded_walk import labels_of

if TYPE_CHECKING:
    from vsf_drake.cli.fit import FitRequest


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
        held_out=held_out,
        quick=request.quick,
        own_height=request.held_out_height,
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
