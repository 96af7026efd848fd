"""The cost as a sum over instants, and what whole-trajectory totals add; all as functions of the outputs y (N, m)."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.collocation.problem import TrajectoryProblem


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
