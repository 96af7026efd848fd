"""How a contact fit is to be done: by the joint strategy or by the paper's, on which series, with
which noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import SEED, check, choice, quantity

JOINT = "joint"
PAPER = "paper"
FORCES = ("fore_aft", "lateral", "vertical")
RESULTANT = "resultant"
COP = ("cop_fore_aft", "cop_lateral")
SERIES = (*FORCES, RESULTANT, *COP)
SOLVERS = ("gauss_newton", "snopt", "ipopt", "nlopt")
_CHOICE = "choice"
_PAPER = "McGeehan 2021"
_HALF = "half of what McGeehan 2021 (doi 10.1115/1.4050456) is left with on its fitted trial"
_ABOVE_0 = 1e-12
_noise = partial(quantity, low=_ABOVE_0, high=1.0, source=_HALF)
_step = partial(quantity, unit="s", low=_ABOVE_0, high=0.01, source=_CHOICE)
_count = partial(quantity, unit="1", low=1, source=_CHOICE)
_seed = partial(quantity, 0, unit="1", low=0, source=_CHOICE)


@dataclass(frozen=True, kw_only=True)
class FitNoise:
    """How wrong model and measurement are expected to be together (standard deviations), and how
    long an error lasts.

    Errors of neighbouring instants are alike: as long as `correlation_s` lasts, n samples tell no
    more than one. So n residuals of a series with spacing dt weigh together as n dt / (2
    correlation_s) independent ones (the integral time of an exponential correlation), which keeps
    priors from being outvoted by a sampling rate. Errors of motion are as slow as the motion (6 Hz:
    1 / (2 pi 6 Hz) = 27 ms), those of the model last as long as a phase of stance.
    """

    fore_aft: float = _noise(0.025, unit="body weights")
    lateral: float = _noise(0.025, unit="body weights")
    vertical: float = _noise(0.025, unit="body weights")
    resultant: float = _noise(0.025, unit="body weights")
    cop_fore_aft: float = _noise(0.03, unit="foot lengths")
    cop_lateral: float = _noise(0.03, unit="foot lengths")
    correlation_s: float = quantity(
        0.05, unit="s", low=_ABOVE_0, high=1.0, source="choice between 27 ms and a stance"
    )

    def weight(self, spacing_s: float) -> float:
        """What each of many residuals in units of its standard deviation counts for, at most 1."""
        return float(min(1.0, np.sqrt(spacing_s / (2.0 * self.correlation_s))))

    def correlation(self, times_s: np.ndarray) -> np.ndarray:
        """(n, n) correlation of the errors at the times (n,)."""
        return np.asarray(np.exp(-np.abs(times_s[:, None] - times_s[None, :]) / self.correlation_s))


@dataclass(frozen=True, kw_only=True)
class ContactFitOptions:
    """Options of the joint fit.

    Attributes:
        only_ends: options that an interrupted fit may change, since only where a search ends
            depends on them.
        series: what is compared; the resultant alone accepts nonsense.
        starts: searches, the first from the parameters' own start, the others from the best of
            `screened` Latin hypercube samples of the prior.
        solver: "gauss_newton" (trust region, from much assumed noise to what is assumed), "snopt"
            or "ipopt" (Drake, exact gradients), "nlopt" (global: DIRECT and then a local search,
            Drake).
        iterations: most evaluations of a search, its hops included; for "nlopt" of its global part.
            A search that converged before they end it is a minimum, but not everything beside it
            was tried, and the verdict says so.
        time_limit_s: of wall time, after which the search that runs is ended as it is, and no other
            begun; the result then says so, since another run may end elsewhere. None for no limit:
            only iterations count.
        tolerance: a search has converged when a step betters the cost by less than this part of it.
        step_s: of the walks during the search. report_step_s: of those that are reported.
    """

    strategy: ClassVar[str] = JOINT
    only_ends: ClassVar[tuple[str, ...]] = ("iterations", "time_limit_s")
    series: tuple[str, ...] = choice((*FORCES, *COP), options=SERIES, source=_CHOICE)
    noise: FitNoise = field(default_factory=FitNoise)
    starts: int = _count(5, help="Searches from different starts.")
    screened: int = _count(12)
    seed: int = _seed(help=SEED)
    solver: str = choice(
        "gauss_newton",
        options=SOLVERS,
        source=_CHOICE,
        metavar="|".join(SOLVERS),
        help="Solver of each search.",
    )
    iterations: int = _count(300, help="Largest number of walks of a search.")
    time_limit_s: float | None = quantity(
        None,
        unit="s",
        low=_ABOVE_0,
        source=_CHOICE,
        flag="--time-limit",
        metavar="SECONDS",
        help="Wall time after which the search ends where it is; the result says so, since another "
        "run may end elsewhere.",
    )
    tolerance: float = quantity(1e-5, unit="1", low=_ABOVE_0, high=0.01, source=_CHOICE)
    step_s: float = _step(2e-3)
    report_step_s: float = _step(1e-3)

    def __post_init__(self) -> None:
        check(self)
        if not self.series or len(set(self.series)) != len(self.series):
            raise InputError(
                "must name series, each once",
                where="series",
                right=f"There are: {', '.join(SERIES)}",
            )
        if RESULTANT in self.series and any(name in FORCES for name in self.series):
            raise InputError(
                "the resultant and its components are the same data twice",
                where="series",
                right=f"Give {RESULTANT}, or some of {', '.join(FORCES)}",
            )


@dataclass(frozen=True, kw_only=True)
class PaperOptions:
    """Options of the fit by the paper's procedure: what the paper states, and choices where it does
    not.

    Attributes:
        scenarios: in one iteration.
        iterations: after which a run that did not converge ends.
        objective_tolerance_n: change of the objective below which it counts as settled; that it is
            of the root mean square difference of the resultants is our reading.
        parameter_tolerance: the same of the parameters, over the distance of their bounds, our
            reading too.
        settled: iterations in a row that must change so little (1: the paper's words, read
            literally).
        restarts: how often a run that did not converge is begun again from its result.
        workers: threads; they do not change the result.
    """

    strategy: ClassVar[str] = PAPER
    only_ends: ClassVar[tuple[str, ...]] = (
        "iterations",
        "objective_tolerance_n",
        "parameter_tolerance",
        "settled",
        "restarts",
        "workers",
    )
    series: ClassVar[tuple[str, ...]] = (RESULTANT,)
    report_step_s: ClassVar[float] = 1e-3
    scenarios: int = _count(100)
    iterations: int = quantity(100, unit="1", low=1, source=_PAPER)
    objective_tolerance_n: float = quantity(0.1, unit="N", low=_ABOVE_0, source=_PAPER)
    parameter_tolerance: float = quantity(1e-3, unit="1", low=_ABOVE_0, source=_PAPER)
    settled: int = quantity(1, unit="1", low=1, source=_PAPER)
    restarts: int = quantity(2, unit="1", low=0, source=_CHOICE)
    step_s: float = quantity(2e-3, unit="s", low=_ABOVE_0, source=_CHOICE)
    seed: int = _seed()
    workers: int = _count(2)

    def __post_init__(self) -> None:
        check(self)
