"""Instants of a trajectory, their quadrature, and the linear equations by which values follow from rates.

Hermite-Simpson in separated form, over an interval of h seconds from knot 0 over the midpoint m to knot 1, for x = q
with rate v and for x = v with rate a (Hargraves and Paris 1987; Betts 2010, 4.5):

    x_1 - x_0 = h/6 (r_0 + 4 r_m + r_1),    x_m = (x_0 + x_1)/2 + h/8 (r_0 - r_1)

Trapezoidal: x_1 - x_0 = h/2 (r_0 + r_1). Rates of the quasi-static variables are central differences over the instants
beside an instant; at an end that is not periodic, one-sided of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from vsf_drake.errors import InputError

METHODS = ("hermite_simpson", "trapezoidal")


@dataclass(frozen=True, eq=False)
class LinearEquations:
    """matrix x = right over x = [z of all instants, row by row (N Z), p (P)].

    Attributes:
        matrix: (c, N Z + P) or, where p does not enter, (c, N Z), sparse.
        right: (c,).
    """

    matrix: sp.csr_matrix
    right: np.ndarray


@dataclass(frozen=True)
class Grid:
    """Instants on which a trajectory is written down.

    Attributes:
        method: "hermite_simpson" (fourth order) or "trapezoidal" (second order).
        intervals: number of equal intervals.
        duration_s: of the trajectory, of one period if it is periodic.
        periodic: whether the end is the beginning again; its instant is then left out.

    Raises:
        InputError: one of them is unusable.
    """

    method: str = "hermite_simpson"
    intervals: int = 40
    duration_s: float = 1.0
    periodic: bool = True

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"{self.method!r} is no collocation", where="method",
                             right=f"There are: {', '.join(METHODS)}")
        if isinstance(self.intervals, bool) or not isinstance(self.intervals, (int, np.integer)) or self.intervals < 4:
            raise InputError(f"{self.intervals!r} is not usable", where="intervals",
                             right="It must be a whole number from 4 on")
        if not (np.isfinite(self.duration_s) and self.duration_s > 0.0):
            raise InputError(f"{self.duration_s!r} is not usable", where="duration_s", right="It must be above 0")

    @property
    def per_interval(self) -> int:
        """Instants that an interval adds: 2 with midpoints, else 1."""
        return 2 if self.method == "hermite_simpson" else 1

    @property
    def instants(self) -> int:
        """N, knots and midpoints; the last knot of a periodic grid is the first one and not counted."""
        return self.per_interval * self.intervals + (not self.periodic)

    @property
    def step_s(self) -> float:
        """From one instant to the next, s."""
        return self.duration_s / (self.per_interval * self.intervals)

    @cached_property
    def times_s(self) -> np.ndarray:
        """(N,) s, from 0 on; knots and midpoints in turn for Hermite-Simpson."""
        return self.step_s * np.arange(self.instants)

    @cached_property
    def weights(self) -> np.ndarray:
        """(N,) s, of the quadrature of the same order (Simpson's or trapezoidal); they sum to the duration."""
        every = np.zeros(self.per_interval * self.intervals + 1)
        h = self.duration_s / self.intervals
        parts = (h / 6.0, 4.0 * h / 6.0, h / 6.0) if self.per_interval == 2 else (h / 2.0, h / 2.0)
        for offset, part in enumerate(parts):
            every[offset:offset + self.per_interval * self.intervals:self.per_interval] += part
        if self.periodic:
            every[0] += every[-1]
            every = every[:-1]
        return every

    def collocation(self, layout: Layout, advance: np.ndarray | None = None) -> LinearEquations:
        """Values from rates for q, v and w at every interval or instant.

        Args:
            layout: of z.
            advance: (n,) by how much each coordinate is larger after one period; None for 0.

        Raises:
            InputError: an advance without a period, or of another size.
        """
        advance = np.zeros(layout.n) if advance is None else np.asarray(advance, dtype=float)
        if advance.shape != (layout.n,) or not np.isfinite(advance).all():
            raise InputError(f"must be {layout.n} finite numbers, one for each coordinate", where="advance")
        if not self.periodic and advance.any():
            raise InputError("only a periodic trajectory advances", where="advance", right="Leave it out")
        chain, carried = self._chain()
        still = np.zeros(layout.n)
        parts = [(chain[0], layout.q, chain[1], layout.v, carried, advance),
                 (chain[0], layout.v, chain[1], layout.a, carried, still)]
        matrices, rights = [], []
        for by_value, value, by_rate, rate, carry, gain in parts:
            matrices.append(sp.kron(by_value, _pick(layout, value)) + sp.kron(by_rate, _pick(layout, rate)))
            rights.append(-np.outer(carry, gain).ravel())
        difference = self.rates()
        eye = sp.identity(self.instants, format="csr")
        matrices.append(sp.kron(eye, _pick(layout, layout.u)) - sp.kron(difference, _pick(layout, layout.w)))
        rights.append(np.zeros(self.instants * layout.k))
        return LinearEquations(sp.vstack(matrices, format="csr"), np.concatenate(rights))

    def _chain(self) -> tuple[tuple[sp.csr_matrix, sp.csr_matrix], np.ndarray]:
        """Equations of one scalar x with rate r: by x, by r (c, N), and how often the period's gain enters each."""
        h, step = self.duration_s / self.intervals, self.per_interval
        stencils = (
            [([-1.0, 0.0, 1.0], [-h / 6.0, -4.0 * h / 6.0, -h / 6.0]), ([-0.5, 1.0, -0.5], [-h / 8.0, 0.0, h / 8.0])]
            if step == 2 else [([-1.0, 1.0], [-h / 2.0, -h / 2.0])])
        rows = len(stencils) * self.intervals
        by_x, by_r, carried = sp.lil_matrix((rows, self.instants)), sp.lil_matrix((rows, self.instants)), np.zeros(rows)
        for interval in range(self.intervals):
            for form, (values, rates) in enumerate(stencils):
                row = len(stencils) * interval + form
                for offset in range(step + 1):
                    at = interval * step + offset
                    wrapped = at >= self.instants
                    by_x[row, at % self.instants] += values[offset]
                    by_r[row, at % self.instants] += rates[offset]
                    carried[row] += values[offset] * wrapped
        return (by_x.tocsr(), by_r.tocsr()), carried

    def rates(self) -> sp.csr_matrix:
        """(N, N) rates of a series over the instants."""
        count, step = self.instants, self.step_s
        matrix = sp.lil_matrix((count, count))
        for i in range(count):
            if self.periodic or 0 < i < count - 1:
                matrix[i, (i + 1) % count] += 0.5 / step
                matrix[i, (i - 1) % count] -= 0.5 / step
            else:
                sign = 1 if i == 0 else -1
                for offset, weight in enumerate((-1.5, 2.0, -0.5)):
                    matrix[i, i + sign * offset] = sign * weight / step
        return matrix.tocsr()


def _pick(layout: Layout, columns: slice) -> sp.csr_matrix:
    """(columns, Z) that takes them out of z."""
    return sp.identity(layout.size, format="csr")[columns]


# What one instant's variables are, and where each of them stands.


KINDS = ("q", "v", "a", "w", "u", "s")


@dataclass(frozen=True)
class Layout:
    """z = [q (n), v (n), a (n), w (k), u (k), s (e)] of one instant, Z = 3n + 2k + e.

    Attributes:
        coordinates: names (n,) of the coordinates q; v and a are their first and second time derivatives.
        quasi_static: names (k,) of the variables w that are in equilibrium at every instant; u are their rates.
        extra: names (e,) of free variables s of the instant, e.g. a torque.

    Raises:
        InputError: a name appears twice.
    """

    coordinates: tuple[str, ...]
    quasi_static: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("coordinates", "quasi_static", "extra"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        every = (*self.coordinates, *self.quasi_static, *self.extra)
        twice = [name for name in every if every.count(name) > 1]
        if twice:
            raise InputError(f"{twice[0]!r} appears twice", where="layout", right="Names must differ")

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def k(self) -> int:
        """Number of quasi-static variables."""
        return len(self.quasi_static)

    @property
    def size(self) -> int:
        """Z, number of variables of an instant."""
        return 3 * self.n + 2 * self.k + len(self.extra)

    @property
    def q(self) -> slice:
        """Coordinates, columns of z."""
        return slice(0, self.n)

    @property
    def v(self) -> slice:
        """Velocities, columns of z."""
        return slice(self.n, 2 * self.n)

    @property
    def a(self) -> slice:
        """Accelerations, columns of z."""
        return slice(2 * self.n, 3 * self.n)

    @property
    def w(self) -> slice:
        """Quasi-static variables, columns of z."""
        return slice(3 * self.n, 3 * self.n + self.k)

    @property
    def u(self) -> slice:
        """Rates of the quasi-static variables, columns of z."""
        return slice(3 * self.n + self.k, 3 * self.n + 2 * self.k)

    @property
    def s(self) -> slice:
        """Free variables, columns of z."""
        return slice(3 * self.n + 2 * self.k, self.size)

    @property
    def names(self) -> tuple[str, ...]:
        """(Z,) "kind.name" of every column, e.g. "v.hip"."""
        of = {"q": self.coordinates, "v": self.coordinates, "a": self.coordinates, "w": self.quasi_static,
              "u": self.quasi_static, "s": self.extra}
        return tuple(f"{kind}.{name}" for kind in KINDS for name in of[kind])

    def column(self, kind: str, name: str) -> int:
        """Column of z of one variable, e.g. column("v", "hip").

        Raises:
            InputError: there is none of that kind and name.
        """
        try:
            return self.names.index(f"{kind}.{name}")
        except ValueError:
            raise InputError(f"there is no {kind}.{name}", where="layout",
                             right=f"There are: {', '.join(self.names)}") from None
