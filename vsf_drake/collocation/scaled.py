"""The problem in its scales: values, first derivatives and the Gauss-Newton Hessian at a point.

Everything here is scaled: x = [z / z_scale (N Z), p / p_scale (P)], outputs by y_scale, the cost by
cost_scale, every linear equation by its largest coefficient. Legend: N instants, Z variables, P
parameters, E equations and C limited outputs of an instant, L linear equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from vsf_drake.base.errors import InputError
from vsf_drake.collocation.pattern import KktPattern
from vsf_drake.collocation.problem import TrajectoryProblem


@dataclass(frozen=True, eq=False)
class Point:
    """Values at x."""

    x: np.ndarray  # (N Z + P,)
    y: np.ndarray  # (N, m) unscaled outputs
    terms: dict[str, float]  # of the cost, unscaled, by name
    cost: float
    linear: np.ndarray  # (L,), 0 in a solution
    equations: np.ndarray  # (N, E), 0 in a solution
    limited: np.ndarray  # (N, C) outputs with limits

    @property
    def finite(self) -> bool:
        return bool(
            np.isfinite(self.cost)
            and np.isfinite(self.equations).all()
            and np.isfinite(self.limited).all()
        )


@dataclass(frozen=True, eq=False)
class Linearised(Point):
    """Derivatives too."""

    gradient: np.ndarray  # (N Z + P,) of the cost
    hessian: tuple[np.ndarray, np.ndarray, np.ndarray]  # (N, Z, Z), (N, Z, P), (P, P), Gauss-Newton
    by_z: np.ndarray  # (N, E + C, Z) of equations and limited outputs
    by_p: np.ndarray  # (N, E + C, P)

    @property
    def diagonal(self) -> np.ndarray:
        """(N Z + P,) of the Hessian."""
        own, _, shared = self.hessian
        return np.concatenate([np.einsum("nzz->nz", own).ravel(), np.diag(shared)])


class Scaled:
    """A problem's scaled values and derivatives; counts evaluations.

    Attributes:
        shape: (N, Z). count: N Z. parameters: P. equations: E. which: (E + C,) outputs that are
            equations or limited.
        x_scale: (N Z + P,). low, high: of x. fixed: where they are equal. limit_low, limit_high:
            (N, C).
        matrix: (L, N Z), right: (L,): the linear equations, each over its `row_scale` (L,).
    """

    def __init__(self, problem: TrajectoryProblem) -> None:
        self.problem = problem
        self.evaluations = 0
        self.shape = problem.low.shape
        self.count = problem.low.size
        self.parameters = problem.parameters
        self.x_scale = np.concatenate([problem.z_scale.ravel(), problem.p_scale])
        self.low = np.concatenate([problem.low.ravel(), problem.p_low]) / self.x_scale
        self.high = np.concatenate([problem.high.ravel(), problem.p_high]) / self.x_scale
        self.fixed = self.low == self.high
        which, low, high = problem.limited
        self.which = np.concatenate([problem.equations, which])
        self.equations = len(problem.equations)
        self.limit_low = low / problem.y_scale[which]
        self.limit_high = high / problem.y_scale[which]
        matrix, right = problem.grid.collocation(problem.layout, problem.advance)
        wide = matrix @ sp.diags(self.x_scale[: self.count])
        self.row_scale = np.maximum(abs(wide).max(axis=1).toarray().ravel(), 1e-300)
        self.matrix = (sp.diags(1.0 / self.row_scale) @ wide).tocsr()
        self.right = right / self.row_scale

    @cached_property
    def pattern(self) -> KktPattern:
        """Of the KKT matrices of all steps."""
        return KktPattern(self.shape, self.parameters, self.equations, self.matrix)

    def scaled(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """x, within the bounds."""
        x: np.ndarray = np.concatenate([np.ravel(z), np.ravel(p)]) / self.x_scale
        return x.clip(self.low, self.high)

    def unscaled(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z (N, Z) and p (P,)."""
        full = x * self.x_scale
        return full[: self.count].reshape(self.shape), full[self.count :]

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, Z, ...) and (P, ...) of an array (N Z + P, ...), scaled as it is."""
        return x[: self.count].reshape(*self.shape, *x.shape[1:]), x[self.count :]

    def start(self, z: np.ndarray, p: np.ndarray) -> Linearised:
        """The point to begin from, within the bounds; InputError for another shape, or no finite
        value there."""
        for name, values, shape in (("z", z, self.shape), ("p", p, (self.parameters,))):
            if np.shape(values) != shape or not np.isfinite(values).all():
                raise InputError(
                    f"must be finite numbers of shape {shape}, is of {np.shape(values)}",
                    where=f"start.{name}",
                )
        at = self.linearised(self.scaled(z, p))
        if not (at.finite and np.isfinite(at.gradient).all()):
            instants = np.flatnonzero(~np.isfinite(at.y).all(axis=1))
            times = ", ".join(f"{self.problem.grid.times_s[i]:.3f}" for i in instants[:5])
            raise InputError(
                f"the function has no finite value at {times or 'some'} s",
                where="start",
                right="Begin from another trajectory",
            )
        return at

    def point(self, x: np.ndarray) -> Point:
        self.evaluations += 1
        with np.errstate(all="ignore"):
            return self._point(
                x, np.asarray(self.problem.function.evaluate(*self.unscaled(x)), dtype=float)
            )

    def linearised(self, x: np.ndarray) -> Linearised:
        with np.errstate(all="ignore"):
            y, by_z, by_p = self.outputs(x)
            slope, bend = self.slopes(y)

            # H = J' diag(phi'') J over the outputs that have any: the cost's curvature, without
            # that of the outputs. With roots of phi'' in both factors it is symmetric and never
            # negative to rounding.
            used = np.flatnonzero(bend.any(axis=0))
            root = np.sqrt(bend[:, used])[:, :, None]
            rows_z = root * by_z[:, used]
            rows_p = root * by_p[:, used]
            turned = rows_z.transpose(0, 2, 1)
            flat_p = rows_p.reshape(len(y) * len(used), self.parameters)

            # g = J' phi', by z for each instant, by p summed over them
            unit = self.problem.y_scale[self.which][:, None]
            return Linearised(
                **vars(self._point(x, y)),
                by_z=by_z[:, self.which] / unit,
                by_p=by_p[:, self.which] / unit,
                gradient=np.concatenate(
                    [
                        np.matmul(slope[:, None, :], by_z).ravel(),
                        np.einsum("nm,nmp->p", slope, by_p),
                    ]
                ),
                hessian=(turned @ rows_z, turned @ rows_p, flat_p.T @ flat_p),
            )

    def _point(self, x: np.ndarray, y: np.ndarray) -> Point:
        terms = {name: float(values.sum()) for name, values in self.instant_terms(y).items()}
        here = y[:, self.which] / self.problem.y_scale[self.which]
        return Point(
            x=x,
            y=y,
            terms=terms,
            cost=sum(terms.values()) / self.problem.cost_scale,
            linear=self.matrix @ x[: self.count] - self.right,
            equations=here[:, : self.equations],
            limited=here[:, self.equations :],
        )

    def outputs(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y (N, m) unscaled, and its derivatives (N, m, Z) and (N, m, P) by the scaled variables;
        of r points (r, N Z + P) that share p, (r N, ...) one below the other."""
        points = np.atleast_2d(x) * self.x_scale
        self.evaluations += len(points)
        with np.errstate(all="ignore"):
            y, by_z, by_p = self.problem.function.linearise(
                points[:, : self.count].reshape(-1, self.shape[1]), points[0, self.count :]
            )
            z_scale = np.tile(self.problem.z_scale, (len(points), 1))
            return y, by_z * z_scale[:, None, :], by_p * self.problem.p_scale

    def instant_terms(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """(N,) what each instant adds to the cost's terms, by name, unscaled."""
        terms: dict[str, np.ndarray] = {}
        for part in self.problem.terms:
            terms[part.name] = terms.get(part.name, 0.0) + part.values(y, self.problem.grid.weights)
        return terms

    def slopes(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives (N, m) of the cost by the unscaled outputs."""
        slope = np.zeros_like(y)
        bend = np.zeros_like(y)
        for part in self.problem.terms:
            for whole, own in zip(
                (slope, bend), part.slopes(y, self.problem.grid.weights), strict=True
            ):
                np.add.at(whole.T, np.asarray(part.outputs), own.T)
        return slope / self.problem.cost_scale, bend / self.problem.cost_scale

    def slacks(self, at: Point) -> np.ndarray:
        """Slacks of all inequalities at a point: x above low, below high, limited outputs above
        low, below high; infinite where there is no such inequality, and for fixed variables."""
        low = at.x - self.low
        high = self.high - at.x
        low[self.fixed] = high[self.fixed] = np.inf
        limits = at.limited - self.limit_low, self.limit_high - at.limited
        return np.concatenate([low, high, *(slacks.ravel() for slacks in limits)])

    def violations(self, at: Point) -> np.ndarray:
        """Violations >= 0 of linear equations (L), equations (N E), then all inequalities as in
        `slacks`."""
        return np.concatenate(
            [np.abs(at.linear), np.abs(at.equations).ravel(), np.maximum(-self.slacks(at), 0.0)]
        )

    def worst(self, at: Point) -> tuple[float, str]:
        """The largest violation, and where it is, in words."""
        broken = self.violations(at)
        layout = self.problem.layout
        design = self.problem.design
        times = [f"{time:.3f} s" for time in self.problem.grid.times_s]
        variables = [f"{name} at {time}" for time in times for name in layout.names]
        of_rows = np.asarray(abs(self.matrix).argmax(axis=1)).ravel()
        names = [f"a linear equation of {variables[i]}" for i in of_rows]
        names += [
            f"output {output} at {time}, an equation"
            for time in times
            for output in self.which[: self.equations]
        ]
        names += [
            f"{side} bound of {name}"
            for side in ("lower", "upper")
            for name in (*variables, *design.names)
        ]
        names += 2 * [
            f"output {output} at {time}, a limit"
            for time in times
            for output in self.which[self.equations :]
        ]
        index = int(np.argmax(broken))
        return float(broken[index]), names[index]
