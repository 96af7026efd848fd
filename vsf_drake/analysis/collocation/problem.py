"""A trajectory, and design parameters with it, that minimise a cost: the problem in plain text.

    minimise    sum of the terms (see the last section: residuals, convex penalties, totals) over z (N, Z) and p (P,)
    subject to  y_e(z_i, p) = 0                     for the outputs that are equations, at every instant i
                low <= y_c(z_i, p) <= high          for the outputs that have limits
                q from v, v from a, u from w        by collocation (`grid`), linear
                any further linear equations in z and p
                low <= z <= high, low <= p <= high

y = function(z, p) sees one instant at a time: all that binds instants together is linear.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from vsf_drake.analysis.collocation.grid import Grid, Layout, LinearEquations
from vsf_drake.errors import InputError


class InstantFunction(Protocol):
    """Outputs of every instant as functions of its variables and of the design parameters.

    Legend: N instants, Z variables of an instant, P design parameters, m outputs. Row i of z is instant i, for which
    the function may hold data of its own. A point that it cannot evaluate has outputs that are not finite.
    """

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """y (N, m) at z (N, Z), p (P,)."""
        ...

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y (N, m) and its derivatives by z (N, m, Z) and by p (N, m, P)."""
        ...


class TrajectoryProblem:
    """What is to be minimised over a trajectory, see the module's text.

    Args:
        function: of an instant.
        layout: of z. grid: of the instants.
        outputs: m, how many outputs the function has.
        equations: indices of the outputs that are 0 at every instant.
        limits, residuals, convex, totals: see the last section; all add up.
        design: parameters p; none by default.
        advance: (n,) by how much the coordinates grow over a period.
        low, high: bounds of z, (Z,) or (N, Z); equal ones fix a variable.
        linear: further linear equations.
        z_scale: (Z,) or (N, Z) what counts as a change of one, > 0. y_scale: (m,) likewise for outputs, > 0.
        cost_scale: what counts as a difference of one of the cost, > 0.

    Raises:
        InputError: something has another shape, names an output that is none, or leaves no room.
    """

    def __init__(
        self, function: InstantFunction, layout: Layout, grid: Grid, *, outputs: int, equations: Sequence[int] = (),
        limits: Sequence[Limits] = (), residuals: Sequence[Residuals] = (), convex: Sequence[Convex] = (),
        totals: Sequence[Total] = (), design: Design | None = None, advance: np.ndarray | None = None,
        low: np.ndarray | float = -np.inf, high: np.ndarray | float = np.inf, linear: LinearEquations | None = None,
        z_scale: np.ndarray | float = 1.0, y_scale: np.ndarray | float = 1.0, cost_scale: float = 1.0
    ) -> None:
        self.function, self.layout, self.grid, self.outputs = function, layout, grid, outputs
        self.limits, self.residuals = tuple(limits), tuple(residuals)
        self.convex, self.totals = tuple(convex), tuple(totals)
        self.design = design or Design()
        self.advance = np.zeros(layout.n) if advance is None else np.asarray(advance, dtype=float)
        count, size, extra = grid.instants, layout.size, len(tuple(self.design.names))
        self.equations = _outputs(equations, outputs, "equations")
        self.low = _filled(low, (count, size), "low")
        self.high = _filled(high, (count, size), "high")
        self.z_scale = _filled(z_scale, (count, size), "z_scale", positive=True)
        self.y_scale = _filled(y_scale, (outputs,), "y_scale", positive=True)
        self.p_low = _filled(self.design.low, (extra,), "design.low")
        self.p_high = _filled(self.design.high, (extra,), "design.high")
        width = self.p_high - self.p_low
        usual = np.where(np.isfinite(width) & (width > 0.0), width, 1.0)
        self.p_scale = usual if self.design.scale is None else _filled(
            self.design.scale, (extra,), "design.scale", positive=True)
        self.preferred = _filled(self.design.preferred, (extra,), "design.preferred")
        self.p_weight = _filled(self.design.weight, (extra,), "design.weight", least=0.0)
        self.cost_scale = float(_filled(cost_scale, (), "cost_scale", positive=True))
        self.linear = linear
        self._check()

    @property
    def parameters(self) -> int:
        """P, number of design parameters."""
        return len(self.p_low)

    @property
    def size(self) -> int:
        """Number of all variables, N Z + P."""
        return self.low.size + self.parameters

    @cached_property
    def linear_equations(self) -> LinearEquations:
        """Collocation and further linear equations, over [z, p]."""
        parts = [self.grid.collocation(self.layout, self.advance)]
        parts += [] if self.linear is None else [self.linear]
        wide = [sp.csr_matrix((part.matrix.data, part.matrix.indices, part.matrix.indptr),
                              shape=(part.matrix.shape[0], self.size)) for part in parts]
        return LinearEquations(sp.vstack(wide, format="csr"), np.concatenate([part.right for part in parts]))

    @cached_property
    def limited(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs (c,) that have limits, and low and high (N, c) of them."""
        count = self.grid.instants
        rows = [(_outputs(part.outputs, self.outputs, "limits"), part) for part in self.limits]
        if not rows:
            return np.zeros(0, dtype=int), np.zeros((count, 0)), np.zeros((count, 0))
        low = [_filled(part.low, (count, len(which)), "limits.low") for which, part in rows]
        high = [_filled(part.high, (count, len(which)), "limits.high") for which, part in rows]
        return np.concatenate([which for which, _ in rows]), np.hstack(low), np.hstack(high)

    def _check(self) -> None:
        which, low, high = self.limited
        for name, under, over in (("bounds of z", self.low, self.high), ("bounds of p", self.p_low, self.p_high),
                                  ("limits", low, high)):
            crossed = np.argwhere(~(under <= over))
            if len(crossed):
                at = tuple(int(i) for i in crossed[0])
                place = self.layout.names[at[1]] if name == "bounds of z" else (
                    f"output {which[at[1]]}" if name == "limits" else str(self.design.names[at[0]]))
                raise InputError(f"leave no room at {place}: {under[at]:g} to {over[at]:g}", where=name)
        for part in self.residuals:
            count = len(_outputs(part.outputs, self.outputs, part.name))
            _filled(part.target, (self.grid.instants, count), f"{part.name}.target")
            _filled(part.weight, (self.grid.instants, count), f"{part.name}.weight", least=0.0)
        for part in self.convex:
            _outputs([part.output], self.outputs, part.name)
            _filled(part.weight, (self.grid.instants,), f"{part.name}.weight", least=0.0)
        for part in self.totals:
            _outputs([part.output], self.outputs, part.name)
            _filled(part.weight, (), f"{part.name}.weight", least=-np.inf if part.target is None else 0.0)
        if self.linear is not None and self.linear.matrix.shape not in (
                (len(self.linear.right), self.size), (len(self.linear.right), self.low.size)):
            raise InputError(f"is of shape {self.linear.matrix.shape}, with {len(self.linear.right)} right sides and "
                             f"{self.size} variables", where="linear")


def _outputs(which: Sequence[int], outputs: int, where: str) -> np.ndarray:
    found = np.asarray(list(which), dtype=int)
    if ((found < 0) | (found >= outputs)).any():
        raise InputError(f"names outputs {found.tolist()}", where=where, right=f"There are {outputs}, from 0 on")
    return found


def _filled(value: object, shape: tuple[int, ...], where: str, *, positive: bool = False,
            least: float | None = None) -> np.ndarray:
    """The numbers in their full shape, checked."""
    try:
        full = np.broadcast_to(np.asarray(value, dtype=float), shape).copy()
    except (TypeError, ValueError):
        raise InputError(f"must be numbers of shape {shape}", where=where) from None
    bad = np.isnan(full) | (~np.isfinite(full) if positive or least is not None else False)
    bad |= (full <= 0.0) if positive else False
    bad |= (full < least) if least is not None else False
    if bad.any():
        raise InputError(f"has {full[bad].flat[0]:g}", where=where,
                         right="It must be finite and above 0" if positive else "It must be a number")
    return full


# How a trajectory problem is to be solved.


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


# What the outputs of an instant are for: limits, residuals, convex penalties, totals; and the design parameters.


Curve = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""phi, phi' >= or <= 0, phi'' >= 0 of an array, each of its shape."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Limits:
    """low <= y[:, outputs] <= high at every instant.

    Attributes:
        outputs: (c,) indices of outputs.
        low: number, (c,) or (N, c); -inf for none. high: likewise, +inf for none.
    """

    outputs: Sequence[int]
    low: np.ndarray | float = -np.inf
    high: np.ndarray | float = np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Residuals:
    """Adds 1/2 sum_k weights_k sum_r weight_kr (y_kr - target_kr)^2 to the cost; weights_k are the grid's, s.

    Attributes:
        outputs: (r,) indices of outputs.
        target: number, (r,) or (N, r), in the outputs' units. weight: likewise, >= 0.
        name: by which the term is reported.
    """

    outputs: Sequence[int]
    target: np.ndarray | float = 0.0
    weight: np.ndarray | float = 1.0
    name: str = "residuals"


@dataclass(frozen=True, eq=False, kw_only=True)
class Convex:
    """Adds sum_k weights_k weight_k phi(y_k) to the cost, phi convex and twice differentiable.

    Attributes:
        output: index of the output. function: phi with its two derivatives. weight: number or (N,), >= 0.
        name: by which the term is reported.
    """

    output: int
    function: Curve
    weight: np.ndarray | float = 1.0
    name: str = "convex"


@dataclass(frozen=True, eq=False, kw_only=True)
class Total:
    """A whole trajectory's J = sum_k weights_k y_k: adds weight (J - target)^2 / 2, or weight J without a target.

    Attributes:
        output: index of the output. weight: of any sign without a target, else >= 0.
        target: of J, or None. name: by which the term is reported.
    """

    output: int
    weight: float = 1.0
    target: float | None = None
    name: str = "total"


@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """Parameters p (P,) that all instants share.

    Attributes:
        names: (P,). low, high: (P,) bounds; equal ones freeze a parameter.
        scale: (P,) what counts as a change of one; high - low by default, 1 where that is 0 or infinite.
        preferred: (P,) p0 of the cost 1/2 sum weight (p - p0)^2, 0 by default. weight: (P,), 0 by default.
    """

    names: Sequence[str] = ()
    low: np.ndarray | float = -np.inf
    high: np.ndarray | float = np.inf
    scale: np.ndarray | float | None = None
    preferred: np.ndarray | float = 0.0
    weight: np.ndarray | float = 0.0
