"""How a contact fit is to be done."""

from __future__ import annotations

from dataclasses import dataclass, field

from vsf_drake.analysis.contact_fit.noise import COP, FORCES, RESULTANT, SERIES, FitNoise
from vsf_drake.errors import InputError

SOLVERS = ("gauss_newton", "snopt", "ipopt", "nlopt")


@dataclass(frozen=True, kw_only=True)
class ContactFitOptions:
    """Options of the joint fit.

    Attributes:
        series: what is compared, names of `noise.SERIES`; the force components and the fore-aft centre of pressure by
            default, because the resultant alone accepts nonsense.
        noise: how wrong that is expected to be.
        starts: searches, the first from the parameters' own start, the others from the best of `screened` samples.
        screened: Latin hypercube samples of the prior that are tried for each further start.
        seed: of the samples.
        solver: "gauss_newton" (bounded trust region, scipy), "snopt" or "ipopt" (Drake, exact gradients), "nlopt"
            (global: DIRECT and then a local search, Drake).
        iterations: most evaluations of a search; for "nlopt" of its global part.
        tolerance: a search has converged when a step betters the cost by less than this part of it.
        step_s: of the walks during the search. report_step_s: of those that are reported.

    Raises:
        InputError: an option is none of what it may be.
    """

    series: tuple[str, ...] = (*FORCES, *COP)
    noise: FitNoise = field(default_factory=FitNoise)
    starts: int = 5
    screened: int = 12
    seed: int = 0
    solver: str = "gauss_newton"
    iterations: int = 100
    tolerance: float = 1e-5
    step_s: float = 2e-3
    report_step_s: float = 1e-3

    def __post_init__(self) -> None:
        unknown = [name for name in self.series if name not in SERIES]
        if unknown or not self.series or len(set(self.series)) != len(self.series):
            raise InputError(f"{unknown[0]!r} is not compared" if unknown else "must name series, each once",
                             where="series", right=f"There are: {', '.join(SERIES)}")
        if RESULTANT in self.series and any(name in FORCES for name in self.series):
            raise InputError("the resultant and its components are the same data twice", where="series",
                             right=f"Give {RESULTANT}, or some of {', '.join(FORCES)}")
        if not isinstance(self.noise, FitNoise):
            raise InputError(f"is a {type(self.noise).__name__}, no FitNoise", where="noise")
        if self.solver not in SOLVERS:
            raise InputError(f"{self.solver!r} is no solver", where="solver", right=f"There are: {', '.join(SOLVERS)}")
        for name, least in (("starts", 1), ("screened", 1), ("seed", 0), ("iterations", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise InputError(f"{value!r} is not usable", where=name,
                                 right=f"It must be a whole number from {least} on")
        for name in ("tolerance", "step_s", "report_step_s"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value <= 0.01:
                raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0 and at most 0.01")
