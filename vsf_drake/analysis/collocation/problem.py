"""A trajectory, and design parameters with it, that minimise a cost: the problem in plain text.

    minimise    sum of the terms (`terms`: residuals, convex penalties, totals) over z (N, Z) and p (P,)
    subject to  y_e(z_i, p) = 0                     for the outputs that are equations, at every instant i
                low <= y_c(z_i, p) <= high          for the outputs that have limits
                q from v, v from a, u from w        by collocation (`grid`), linear
                any further linear equations in z and p
                low <= z <= high, low <= p <= high

y = function(z, p) sees one instant at a time: all that binds instants together is linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from vsf_drake.analysis.collocation.grid import Grid, LinearEquations
from vsf_drake.analysis.collocation.layout import Layout
from vsf_drake.analysis.collocation.terms import Convex, Design, Limits, Residuals, Total
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
        limits, residuals, convex, totals: see `terms`; all add up.
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
