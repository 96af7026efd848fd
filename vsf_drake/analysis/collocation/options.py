"""How a trajectory problem is to be solved."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.errors import InputError

CURVATURES = ("auto", "gauss_newton", "exact")


@dataclass(frozen=True, kw_only=True)
class CollocationOptions:
    """Options of the Gauss-Newton SQP; tolerances are in the problem's scales.

    Attributes:
        iterations: most iterations. time_limit_s: most wall time, s; checked once an iteration.
        violation: largest violation of any equation or limit of a solution.
        optimality: largest first-order residual, relative to 1 + the largest multiplier.
        step: largest change of a scaled variable that the next step would still make, unless
        gain: that step would lower the cost by less than this part of 1 + the cost, scaled.
        damping: first Levenberg damping of the scaled step. least_damping, most_damping: its range.
        curvature: "gauss_newton", "exact" (Hessian of the Lagrangian by differences, Z + P more linearisations an
            iteration) or "auto": exact once Gauss-Newton has become slow near a solution.
        inequality_weight: of the l1 penalty at which limits may be broken within a step.

    Raises:
        InputError: an option is none of what it may be.
    """

    iterations: int = 200
    time_limit_s: float = 600.0
    violation: float = 1e-8
    optimality: float = 1e-6
    step: float = 1e-5
    gain: float = 1e-11
    damping: float = 1e-3
    least_damping: float = 1e-9
    most_damping: float = 1e6
    curvature: str = "auto"
    inequality_weight: float = 1e6

    def __post_init__(self) -> None:
        if isinstance(self.iterations, bool) or not isinstance(self.iterations, int) or self.iterations < 1:
            raise InputError(f"{self.iterations!r} is not usable", where="iterations",
                             right="It must be a whole number from 1 on")
        if self.curvature not in CURVATURES:
            raise InputError(f"{self.curvature!r} is none", where="curvature",
                             right=f"There are: {', '.join(CURVATURES)}")
        for name in ("time_limit_s", "violation", "optimality", "step", "gain", "damping", "least_damping",
                     "most_damping", "inequality_weight"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0.0:
                raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0")
