"""The problem in its scales: values, first derivatives and the Gauss-Newton Hessian at a point.

Everything here is scaled: x = [z / z_scale (N Z), p / p_scale (P)], outputs by y_scale, the cost by cost_scale, every
linear equation by its largest coefficient. Legend: N instants, Z variables, P parameters, E equations and C limited
outputs of an instant, T totals with a target, L linear equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from vsf_drake.analysis.collocation.problem import TrajectoryProblem
from vsf_drake.errors import InputError


@dataclass(frozen=True, eq=False)
class Point:
    """Values at x.

    Attributes:
        x: (N Z + P,). y: (N, m) unscaled outputs. terms: name to value of the cost's terms, unscaled.
        cost: scaled. linear: (L,) and equations: (N, E), 0 in a solution. limited: (N, C) outputs with limits.
    """

    x: np.ndarray
    y: np.ndarray
    terms: dict[str, float]
    cost: float
    linear: np.ndarray
    equations: np.ndarray
    limited: np.ndarray

    @property
    def finite(self) -> bool:
        """Whether the function could be evaluated."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.equations).all() and np.isfinite(self.limited).all())


@dataclass(frozen=True, eq=False)
class Linearised(Point):
    """Derivatives too.

    Attributes:
        gradient: (N Z + P,) of the cost.
        hessian: (N, Z, Z), (N, Z, P) and (P, P), Gauss-Newton, without the totals.
        by_z: (N, E + C, Z) and by_p: (N, E + C, P) of equations and limited outputs.
        totals: (T, N Z + P) derivatives of the totals with a target, and total_weights (T,) of their squares.
    """

    gradient: np.ndarray
    hessian: tuple[np.ndarray, np.ndarray, np.ndarray]
    by_z: np.ndarray
    by_p: np.ndarray
    totals: np.ndarray
    total_weights: np.ndarray


@dataclass(frozen=True, eq=False)
class Instants:
    """What each instant adds by itself.

    Attributes:
        y: (N, m) unscaled. by_z: (N, m, Z) and by_p: (N, m, P) by the scaled variables.
        cost: (N,) scaled, without squared totals and design. slope: (N, m) of that by y.
    """

    y: np.ndarray
    by_z: np.ndarray
    by_p: np.ndarray
    cost: np.ndarray
    slope: np.ndarray


class Scaled:
    """A problem's scaled values and derivatives; counts evaluations."""

    def __init__(self, problem: TrajectoryProblem) -> None:
        self.problem, self.evaluations = problem, 0
        self.shape = problem.low.shape
        self.count, self.parameters = problem.low.size, problem.parameters
        self.x_scale = np.concatenate([problem.z_scale.ravel(), problem.p_scale])
        self.low = np.concatenate([problem.low.ravel(), problem.p_low]) / self.x_scale
        self.high = np.concatenate([problem.high.ravel(), problem.p_high]) / self.x_scale
        self.fixed = self.low == self.high
        which, low, high = problem.limited
        self.which = np.concatenate([problem.equations, which]).astype(int)
        self.equations = len(problem.equations)
        self.limit_low, self.limit_high = low / problem.y_scale[which], high / problem.y_scale[which]
        found = problem.linear_equations
        wide = found.matrix @ sp.diags(self.x_scale)
        largest = np.maximum(abs(wide).max(axis=1).toarray().ravel(), 1e-300)
        self.row_scale = largest
        self.matrix = (sp.diags(1.0 / largest) @ wide).tocsr()
        self.right = found.right / largest

    @cached_property
    def transposed(self) -> sp.csr_matrix:
        """Of the linear equations, (N Z + P, L)."""
        return self.matrix.T.tocsr()

    def scaled(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """x, within the bounds."""
        return np.clip(np.concatenate([np.ravel(z), np.ravel(p)]) / self.x_scale, self.low, self.high)

    def checked(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """x of a start, within the bounds.

        Raises:
            InputError: it has another shape or is not finite.
        """
        for name, values, shape in (("z", z, self.shape), ("p", p, (self.parameters,))):
            if np.shape(values) != shape or not np.isfinite(values).all():
                raise InputError(f"must be finite numbers of shape {shape}, is of {np.shape(values)}",
                                 where=f"start.{name}")
        return self.scaled(z, p)

    def linearised_start(self, x: np.ndarray) -> Linearised:
        """Values and derivatives at a start.

        Raises:
            InputError: the function has no value there.
        """
        at = self.linearised(x)
        if not (at.finite and np.isfinite(at.gradient).all()):
            instants = np.flatnonzero(~np.isfinite(at.y).all(axis=1))
            times = ", ".join(f"{self.problem.grid.times_s[i]:.3f}" for i in instants[:5])
            raise InputError(f"the function has no finite value at {times or 'some'} s", where="start",
                             right="Begin from another trajectory")
        return at

    def unscaled(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z (N, Z) and p (P,)."""
        full = x * self.x_scale
        return full[:self.count].reshape(self.shape), full[self.count:]

    def point(self, x: np.ndarray) -> Point:
        """Values at x."""
        self.evaluations += 1
        with np.errstate(all="ignore"):
            y = np.asarray(self.problem.function.evaluate(*self.unscaled(x)), dtype=float)
            return Point(**self._values(x, y))

    def linearised(self, x: np.ndarray) -> Linearised:
        """Values and derivatives at x."""
        with np.errstate(all="ignore"):
            y, by_z, by_p = self.outputs(x)
            return Linearised(**self._values(x, y), **self._derivatives(x, y, by_z, by_p))

    def outputs(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y (N, m), by_z (N, m, Z) and by_p (N, m, P) at x, unscaled."""
        self.evaluations += 1
        with np.errstate(all="ignore"):
            y, by_z, by_p = self.problem.function.linearise(*self.unscaled(x))
            return np.asarray(y, dtype=float), np.asarray(by_z, dtype=float), np.asarray(by_p, dtype=float)

    def slope(self, y: np.ndarray) -> np.ndarray:
        """(N, m) of the scaled cost by the outputs."""
        problem = self.problem
        slope = slopes(problem, y)[0]
        squared = [part for part in problem.totals if part.target is not None]
        for part, off in zip(squared, of_totals(problem, y)[1], strict=True):
            slope[:, part.output] += problem.grid.weights * part.weight * off
        return slope / problem.cost_scale

    def instants(self, x: np.ndarray) -> Instants:
        """What each instant adds by itself at x, for solvers that sum it up on their own."""
        problem = self.problem
        with np.errstate(all="ignore"):
            y, by_z, by_p = self.outputs(x)
            parts = of_instants(problem, y)
            return Instants(y=y, by_z=by_z * problem.z_scale[:, None, :], by_p=by_p * problem.p_scale,
                            cost=sum(parts.values(), np.zeros(len(y))) / problem.cost_scale,
                            slope=slopes(problem, y)[0] / problem.cost_scale)

    def _values(self, x: np.ndarray, y: np.ndarray) -> dict[str, object]:
        problem = self.problem
        terms = {name: float(values.sum()) for name, values in of_instants(problem, y).items()}
        for more in (of_totals(problem, y)[0], of_design(problem, x[self.count:] * problem.p_scale)):
            terms |= {name: terms.get(name, 0.0) + value for name, value in more.items()}
        here = y[:, self.which] / problem.y_scale[self.which]
        return {"x": x, "y": y, "terms": terms, "cost": sum(terms.values()) / problem.cost_scale,
                "linear": self.matrix @ x - self.right, "equations": here[:, :self.equations],
                "limited": here[:, self.equations:]}

    def _derivatives(self, x: np.ndarray, y: np.ndarray, by_z: np.ndarray, by_p: np.ndarray) -> dict[str, object]:
        problem, weights, scale = self.problem, self.problem.grid.weights, self.problem.cost_scale
        p = x[self.count:] * problem.p_scale
        slope, bend = self.slope(y), slopes(problem, y)[1] / scale
        squared = [part for part in problem.totals if part.target is not None]
        gradient = np.concatenate([
            (np.matmul(slope[:, None, :], by_z)[:, 0] * problem.z_scale).ravel(),
            (np.einsum("nm,nmp->p", slope, by_p) + problem.p_weight * (p - problem.preferred) / scale)
            * problem.p_scale])
        used = np.flatnonzero(bend.any(axis=0))
        root = np.sqrt(bend[:, used])[:, :, None]
        rows_z = root * by_z[:, used] * problem.z_scale[:, None, :]
        rows_p = root * by_p[:, used] * problem.p_scale
        turned = rows_z.transpose(0, 2, 1)
        flat_p = rows_p.reshape(len(y) * len(used), self.parameters)
        hessian = (turned @ rows_z, turned @ rows_p,
                   flat_p.T @ flat_p + np.diag(problem.p_weight * problem.p_scale**2 / scale))
        totals = np.zeros((len(squared), len(x)))
        for row, part in enumerate(squared):
            totals[row, :self.count] = (weights[:, None] * by_z[:, part.output] * problem.z_scale).ravel()
            totals[row, self.count:] = weights @ by_p[:, part.output] * problem.p_scale
        unit = problem.y_scale[self.which][None, :, None]
        return {"gradient": gradient, "hessian": hessian, "totals": totals,
                "total_weights": np.array([part.weight / scale for part in squared]),
                "by_z": by_z[:, self.which] * problem.z_scale[:, None, :] / unit,
                "by_p": by_p[:, self.which] * problem.p_scale / unit}


# The cost as a sum over instants, and what whole-trajectory totals add; all as functions of the outputs y (N, m).


def of_instants(problem: TrajectoryProblem, y: np.ndarray) -> dict[str, np.ndarray]:
    """(N,) of each term that is a sum over instants: residuals, convex terms, totals without a target."""
    weights, terms = problem.grid.weights, {}

    def add(name: str, values: np.ndarray) -> None:
        terms[name] = terms.get(name, 0.0) + values

    for part in problem.residuals:
        off = y[:, list(part.outputs)] - part.target
        add(part.name, 0.5 * weights * np.sum(part.weight * off * off, axis=1))
    for part in problem.convex:
        add(part.name, weights * part.weight * part.function(y[:, part.output])[0])
    for part in problem.totals:
        if part.target is None:
            add(part.name, weights * part.weight * y[:, part.output])
    return terms


def slopes(problem: TrajectoryProblem, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives (N, m) by y of the sum over `of_instants`."""
    weights, slope, bend = problem.grid.weights, np.zeros_like(y), np.zeros_like(y)
    for part in problem.residuals:
        which = list(part.outputs)
        weight = np.broadcast_to(weights[:, None] * part.weight, (len(y), len(which)))
        np.add.at(slope, (slice(None), which), weight * (y[:, which] - part.target))
        np.add.at(bend, (slice(None), which), weight)
    for part in problem.convex:
        _, first, second = part.function(y[:, part.output])
        slope[:, part.output] += weights * part.weight * first
        bend[:, part.output] += weights * part.weight * second
    for part in problem.totals:
        if part.target is None:
            slope[:, part.output] += weights * part.weight
    return slope, bend


def of_totals(problem: TrajectoryProblem, y: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
    """The terms of the squared totals, and their J - target (T,)."""
    squared = [part for part in problem.totals if part.target is not None]
    off = np.array([problem.grid.weights @ y[:, part.output] - part.target for part in squared])
    terms: dict[str, float] = {}
    for part, by in zip(squared, off, strict=True):
        terms[part.name] = terms.get(part.name, 0.0) + 0.5 * part.weight * float(by) ** 2
    return terms, off


def of_design(problem: TrajectoryProblem, p: np.ndarray) -> dict[str, float]:
    """The term of the preferred design, if there is one."""
    return {"design": 0.5 * float(np.sum(problem.p_weight * (p - problem.preferred) ** 2))} if (
        problem.p_weight.any()) else {}
