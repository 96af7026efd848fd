"""A trajectory, and design parameters with it, that minimise a cost: the problem in plain text.

    minimise    sum of the terms (residuals, convex penalties) over z (N, Z) and p (P,)
    subject to  y_e(z_i, p) = 0                     for the outputs that are equations, at every
                                                    instant i
                low <= y_c(z_i, p) <= high          for the outputs that have limits
                q from v, v from a, u from w        by collocation, linear
                low <= z <= high, low <= p <= high

y = function(z, p) sees one instant at a time: all that binds instants together is linear.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import check, choice, quantity
from vsf_drake.collocation.methods import METHODS

KINDS = ("q", "v", "a", "w", "u", "s")
Curve = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""phi, phi' >= or <= 0, phi'' >= 0 of an array, each of its shape."""


@dataclass(frozen=True)
class Layout:
    """z = [q (n), v (n), a (n), w (k), u (k), s (e)] of one instant, Z = 3n + 2k + e: coordinates,
    their derivatives, what is in equilibrium at every instant with its rates, free variables. q to
    s are their columns of z."""

    coordinates: tuple[str, ...]
    quasi_static: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()
    q: slice = field(init=False, compare=False)
    v: slice = field(init=False, compare=False)
    a: slice = field(init=False, compare=False)
    w: slice = field(init=False, compare=False)
    u: slice = field(init=False, compare=False)
    s: slice = field(init=False, compare=False)

    def __post_init__(self) -> None:
        every = (*self.coordinates, *self.quasi_static, *self.extra)
        start = 0
        for name in every:
            if every.count(name) > 1:
                raise InputError(
                    f"{name!r} appears twice", where="layout", right="Names must differ"
                )
        for kind, names in self._kinds():
            object.__setattr__(self, kind, slice(start, start + len(names)))
            start += len(names)

    def _kinds(self) -> list[tuple[str, Sequence[str]]]:
        return list(
            zip(KINDS, (*3 * [self.coordinates], *2 * [self.quasi_static], self.extra), strict=True)
        )

    @property
    def n(self) -> int:
        return len(self.coordinates)

    @property
    def k(self) -> int:
        return len(self.quasi_static)

    @property
    def size(self) -> int:
        return int(self.s.stop)

    @property
    def names(self) -> tuple[str, ...]:
        """(Z,) "kind.name" of every column, e.g. "v.hip"."""
        return tuple(f"{kind}.{name}" for kind, names in self._kinds() for name in names)


@dataclass(frozen=True)
class Grid:
    """Instants on which a trajectory is written down, and the linear equations by which values
    follow from rates.

    Hermite-Simpson in separated form, over an interval of h seconds from knot 0 over the midpoint m
    to knot 1, for x = q with rate v and for x = v with rate a (Hargraves and Paris 1987; Betts
    2010, 4.5):

        x_1 - x_0 = h/6 (r_0 + 4 r_m + r_1),    x_m = (x_0 + x_1)/2 + h/8 (r_0 - r_1)

    Trapezoidal: x_1 - x_0 = h/2 (r_0 + r_1). Rates of the quasi-static variables are central
    differences over the instants beside an instant; at an end that is not periodic, one-sided of
    second order. Where the end is the beginning again (`periodic`), its instant is left out.
    """

    method: str = choice("hermite_simpson", options=METHODS, source="choice")
    intervals: int = quantity(40, unit="1", low=4, source="choice")
    duration_s: float = quantity(1.0, unit="s", low=1e-9, source="choice")
    periodic: bool = True

    def __post_init__(self) -> None:
        check(self)

    @property
    def per_interval(self) -> int:
        return 2 if self.method == "hermite_simpson" else 1

    @property
    def instants(self) -> int:
        return self.per_interval * self.intervals + (not self.periodic)

    @property
    def step_s(self) -> float:
        return self.duration_s / (self.per_interval * self.intervals)

    @cached_property
    def times_s(self) -> np.ndarray:
        """(N,) s, from 0 on; knots and midpoints in turn for Hermite-Simpson."""
        return self.step_s * np.arange(self.instants)

    @cached_property
    def weights(self) -> np.ndarray:
        """(N,) s, of the quadrature of the same order (Simpson's or trapezoidal); they sum to the
        duration."""
        h = self.duration_s / self.intervals
        rule = (h / 6.0, 4.0 * h / 6.0, h / 6.0) if self.per_interval == 2 else (h / 2.0, h / 2.0)
        return np.asarray(self._over_intervals(rule)[0].sum(axis=0)).ravel()

    def collocation(self, layout: Layout, advance: np.ndarray) -> tuple[sp.csr_matrix, np.ndarray]:
        """matrix (c, N Z), right (c,): values from rates for q, v and w at every interval or
        instant, where coordinates are larger by `advance` (n,) after one period."""
        h = self.duration_s / self.intervals
        stencils = (
            [
                ((-1.0, 0.0, 1.0), (-h / 6.0, -4.0 * h / 6.0, -h / 6.0)),
                ((-0.5, 1.0, -0.5), (-h / 8.0, 0.0, h / 8.0)),
            ]
            if self.per_interval == 2
            else [((-1.0, 1.0), (-h / 2.0, -h / 2.0))]
        )
        pick = sp.identity(layout.size, format="csr")
        matrices = []
        rights = []
        for value, rate, gain in (
            (layout.q, layout.v, advance),
            (layout.v, layout.a, np.zeros(layout.n)),
        ):
            for of_values, of_rates in stencils:
                by_value, carried = self._over_intervals(of_values)
                by_rate, _ = self._over_intervals(of_rates)
                matrices.append(sp.kron(by_value, pick[value]) + sp.kron(by_rate, pick[rate]))
                rights.append(-np.outer(carried, gain).ravel())
        matrices.append(
            sp.kron(sp.identity(self.instants), pick[layout.u])
            - sp.kron(self.rates(), pick[layout.w])
        )
        rights.append(np.zeros(self.instants * layout.k))
        return sp.vstack(matrices, format="csr"), np.concatenate(rights)

    def _over_intervals(self, weights: Sequence[float]) -> tuple[sp.csr_matrix, np.ndarray]:
        """(intervals, N) that weighs the instants of each interval; what falls into the next
        period."""
        rows = np.arange(self.intervals)[:, None]
        columns = self.per_interval * rows + np.arange(len(weights))
        rows = np.broadcast_to(rows, columns.shape)
        values = np.broadcast_to(weights, columns.shape)
        matrix = sp.csr_matrix(
            (values.ravel(), (rows.ravel(), columns.ravel() % self.instants)),
            shape=(self.intervals, self.instants),
        )
        return matrix, np.sum(values * (columns >= self.instants), axis=1)

    def rates(self) -> sp.csr_matrix:
        """(N, N) rates of a series over the instants."""
        ahead = np.roll(np.eye(self.instants), 1, axis=1)
        matrix = 0.5 * (ahead - ahead.T)
        if not self.periodic:
            matrix[[0, -1]] = 0.0
            matrix[0, :3], matrix[-1, -3:] = (-1.5, 2.0, -0.5), (0.5, -2.0, 1.5)
        return sp.csr_matrix(matrix / self.step_s)


class InstantFunction(Protocol):
    """Outputs (m) of every instant as functions of its Z variables and of P design parameters.

    Row i of z is instant i, for which the function may hold data of its own. `linearise` may be
    given the instants several times over, one trajectory below the other. A point that it cannot
    evaluate has outputs that are not finite.
    """

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """y (N, m) at z (N, Z), p (P,)."""
        ...

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y (r N, m) at z (r N, Z), p (P,), and its derivatives by z (r N, m, Z) and by p
        (r N, m, P)."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Limits:
    """low <= y[:, outputs] <= high at every instant."""

    outputs: Sequence[int]  # (c,) indices
    low: np.ndarray | float = -np.inf  # number, (c,) or (N, c)
    high: np.ndarray | float = np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Residuals:
    """Adds 1/2 sum_k weights_k sum_r weight_kr (y_kr - target_kr)^2 to the cost; weights_k are the
    grid's, s."""

    outputs: Sequence[int]  # (r,) indices
    target: np.ndarray | float = 0.0  # number, (r,) or (N, r), in the outputs' units
    weight: np.ndarray | float = 1.0  # likewise, >= 0
    name: str = "residuals"  # by which the term is reported

    def values(self, y: np.ndarray, weights: np.ndarray | float = 1.0) -> np.ndarray:
        """(N,) what every instant adds, with weights (N,)."""
        off = y[:, list(self.outputs)] - self.target
        return np.asarray(0.5 * weights * np.sum(self.weight * off * off, axis=1))

    def slopes(self, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives (N, r) of that by the outputs."""
        weight = np.broadcast_to(weights[:, None] * self.weight, (len(y), len(self.outputs)))
        return weight * (y[:, list(self.outputs)] - self.target), weight


@dataclass(frozen=True, eq=False, kw_only=True)
class Convex:
    """Adds sum_k weights_k weight_k phi(y_k) to the cost, phi convex and twice differentiable."""

    output: int
    function: Curve  # phi with its two derivatives
    weight: np.ndarray | float = 1.0  # number or (N,), >= 0
    name: str = "convex"

    @property
    def outputs(self) -> Sequence[int]:
        return [self.output]

    def values(self, y: np.ndarray, weights: np.ndarray | float = 1.0) -> np.ndarray:
        """As of `Residuals`."""
        return weights * self.weight * self.function(y[:, self.output])[0]

    def slopes(self, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As of `Residuals`."""
        _, first, second = self.function(y[:, self.output])
        return (weights * self.weight * first)[:, None], (weights * self.weight * second)[:, None]


@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """Parameters p (P,) that all instants share; equal bounds freeze one."""

    names: Sequence[str] = ()
    low: np.ndarray | float = -np.inf
    high: np.ndarray | float = np.inf
    scale: np.ndarray | float | None = None
    """what counts as a change of one; None: high - low, 1 where 0 or infinite"""


class TrajectoryProblem:
    """What is to be minimised over a trajectory, see the module's text; InputError where something
    has another shape, names an output that is none, or leaves no room.

    Args:
        outputs: m, how many outputs the function has. equations: indices of those that are 0 at
            every instant.
        advance: (n,) by how much the coordinates grow over a period.
        low, high: bounds of z, (Z,) or (N, Z); equal ones fix a variable.
        z_scale, y_scale, cost_scale: what counts as a change of one, (Z,) or (N, Z), (m,) and a
            number, > 0.
    """

    def __init__(
        self,
        function: InstantFunction,
        layout: Layout,
        grid: Grid,
        *,
        outputs: int,
        equations: Sequence[int] = (),
        limits: Sequence[Limits] = (),
        residuals: Sequence[Residuals] = (),
        convex: Sequence[Convex] = (),
        design: Design | None = None,
        advance: np.ndarray | None = None,
        low: np.ndarray | float = -np.inf,
        high: np.ndarray | float = np.inf,
        z_scale: np.ndarray | float = 1.0,
        y_scale: np.ndarray | float = 1.0,
        cost_scale: float = 1.0,
    ) -> None:
        self.function = function
        self.layout = layout
        self.grid = grid
        self.outputs = outputs
        self.terms: tuple[Residuals | Convex, ...] = (*residuals, *convex)
        self.design = design or Design()
        self.cost_scale = float(_filled(cost_scale, (), "cost_scale", least=1e-300))
        self.advance = _filled(0.0 if advance is None else advance, (layout.n,), "advance")
        if not grid.periodic and self.advance.any():
            raise InputError(
                "only a periodic trajectory advances", where="advance", right="Leave it out"
            )
        every = (grid.instants, layout.size)
        parameters = (len(self.design.names),)
        self.low = _filled(low, every, "low")
        self.high = _filled(high, every, "high")
        self.z_scale = _filled(z_scale, every, "z_scale", least=1e-300)
        self.y_scale = _filled(y_scale, (outputs,), "y_scale", least=1e-300)
        self.p_low = _filled(self.design.low, parameters, "design.low")
        self.p_high = _filled(self.design.high, parameters, "design.high")
        width = self.p_high - self.p_low
        usual = np.where(np.isfinite(width) & (width > 0.0), width, 1.0)
        scale = usual if self.design.scale is None else self.design.scale
        self.p_scale = _filled(scale, parameters, "design.scale", least=1e-300)
        self.equations = self._outputs(equations, "equations")
        which, low, high = self.limited = self._limited(limits)
        places = (
            ("bounds of z", self.low, self.high, layout.names),
            ("bounds of p", self.p_low, self.p_high, None),
            ("limits", low, high, [f"output {output}" for output in which]),
        )
        for name, under, over, columns in places:
            for at in np.argwhere(~(under <= over))[:1]:
                place = self.design.names[at[0]] if columns is None else columns[at[1]]
                raise InputError(
                    f"leave no room at {place}: {under[tuple(at)]:g} to {over[tuple(at)]:g}",
                    where=name,
                )
        for part in self.terms:
            shape: tuple[int, ...] = grid.instants, len(self._outputs(part.outputs, part.name))
            if isinstance(part, Residuals):
                _filled(part.target, shape, f"{part.name}.target")
            _filled(
                part.weight,
                shape if isinstance(part, Residuals) else shape[:1],
                f"{part.name}.weight",
                least=0.0,
            )

    @property
    def parameters(self) -> int:
        """P."""
        return len(self.p_low)

    @property
    def size(self) -> int:
        """Number of all variables, N Z + P."""
        return self.low.size + self.parameters

    def _limited(self, limits: Sequence[Limits]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs (c,) that have limits, and low and high (N, c) of them."""
        count = self.grid.instants
        which = [np.zeros(0, dtype=int)]
        low = [np.zeros((count, 0))]
        high = [np.zeros((count, 0))]
        for part in limits:
            which.append(self._outputs(part.outputs, "limits"))
            low.append(_filled(part.low, (count, len(which[-1])), "limits.low"))
            high.append(_filled(part.high, (count, len(which[-1])), "limits.high"))
        return np.concatenate(which), np.hstack(low), np.hstack(high)

    def _outputs(self, which: Sequence[int], where: str) -> np.ndarray:
        outputs = np.asarray(list(which), dtype=int)
        if ((outputs < 0) | (outputs >= self.outputs)).any():
            raise InputError(
                f"names outputs {outputs.tolist()}",
                where=where,
                right=f"There are {self.outputs}, from 0 on",
            )
        return outputs


def _filled(
    value: object, shape: tuple[int, ...], where: str, *, least: float | None = None
) -> np.ndarray:
    """The numbers in their full shape, checked: finite and from `least` on, if that is given."""
    try:
        full = np.broadcast_to(np.asarray(value, dtype=float), shape).copy()
    except (TypeError, ValueError):
        raise InputError(f"must be numbers of shape {shape}", where=where) from None
    bad = np.isnan(full) if least is None else ~(np.isfinite(full) & (full >= least))
    if bad.any():
        right = (
            "a number"
            if least is None
            else "finite, " + ("from 0 on" if least == 0.0 else "above 0")
        )
        raise InputError(f"has {full[bad].flat[0]:g}", where=where, right=f"It must be {right}")
    return full
