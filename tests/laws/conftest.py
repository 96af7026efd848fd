"""Gradients of a law by two methods: AutoDiffXd and central differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff


def _autodiff(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    value = np.atleast_1d(function(InitializeAutoDiff(np.asarray(x, dtype=float)).ravel())).ravel()
    return ExtractGradient(
        np.array([v if isinstance(v, AutoDiffXd) else AutoDiffXd(v) for v in value])
    )


def _central(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float
) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    columns = []
    for i in range(len(x)):
        h = np.zeros(len(x))
        h[i] = step * max(1.0, abs(x[i]))
        columns.append((np.ravel(function(x + h)) - np.ravel(function(x - h))) / (2.0 * h[i]))
    return np.stack(columns, axis=1)


@pytest.fixture
def autodiff_gradient() -> Callable:
    """Jacobian of function(x) by AutoDiffXd."""
    return _autodiff


@pytest.fixture
def assert_gradient() -> Callable:
    """Asserts that the AutoDiffXd Jacobian of function(x) equals central differences."""

    def check(function: Callable, x: np.ndarray, *, step: float = 1e-7, rtol: float = 1e-5) -> None:
        expected = _central(function, x, step)
        np.testing.assert_allclose(
            _autodiff(function, x),
            expected,
            rtol=rtol,
            atol=rtol * max(1e-12, np.abs(expected).max()),
        )

    return check
