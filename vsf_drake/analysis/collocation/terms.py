"""What the outputs of an instant are for: limits, residuals, convex penalties, totals; and the design parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

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
