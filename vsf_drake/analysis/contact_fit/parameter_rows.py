"""A row a parameter, as a fit's table has them: value, error, prior, and what makes either doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.paper_solution import PaperSolution
from vsf_drake.analysis.contact_fit.parameters import FitParameter
from vsf_drake.analysis.contact_fit.solution import ALIKE, ContactFitSolution
from vsf_drake.contact_file import variable_unit
from vsf_drake.motion.gait_cycle import periodic_bsplines

_PHASES = np.linspace(0.0, 1.0, 201)


def joint_rows(solution: ContactFitSolution) -> list[dict[str, Any]]:
    """Of every parameter of a joint fit that succeeded, the frozen ones too, in their order.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's coordinate.
    `spread_over_starts` is None unless several searches fit alike.
    """
    values, known = solution.values, solution.uncertainty
    lowest = solution.searches[solution.best].cost
    several = sum(s.cost <= lowest + ALIKE for s in solution.searches) > 1
    spread = solution.spread() if several else {}
    rows = []
    for item in solution.fit.parameters.items:
        row = _row(item, values[item.name])
        if not item.frozen:
            i = known.names.index(item.name)
            low, high = known.interval[i]
            row |= {
                "standard_error": known.standard_error[i], "interval_95": [low, high],
                "share_of_prior": known.share_of_prior[i], "at_bound": item.name in known.at_bound,
                "spread_over_starts": spread.get(item.name), "value_in_prior_sd": item.to_u(values[item.name]),
                "interval_in_prior_sd": [item.to_u(float(low)), item.to_u(float(high))]}
        rows.append(row)
    return rows


def paper_rows(solution: PaperSolution) -> list[dict[str, Any]]:
    """Of every variable that the paper's procedure set; nothing but value and start is known."""
    start = solution.paper.initial_values
    return [_plain_row(name, variable_unit(name), value, start.get(name)) for name, value in
            solution.walk_values.items()]


def curve_rows(values: Mapping[str, float]) -> list[dict[str, Any]]:
    """Of every joint angle with a smooth error over the gait cycle: the largest value of that curve, and where."""
    coefficients: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith("curve."):
            coefficients.setdefault(name.split(".")[1], []).append(value)
    rows = []
    for coordinate, c in coefficients.items():
        curve = np.degrees(periodic_bsplines(len(c))(_PHASES) @ np.array(c))
        i = int(np.argmax(np.abs(curve)))
        rows.append({"coordinate": coordinate, "largest_deg": float(curve[i]),
                     "at_percent_of_cycle": float(100.0 * _PHASES[i])})
    return rows


def _row(item: FitParameter, value: float) -> dict[str, Any]:
    return _plain_row(item.name, item.unit, value, item.start) | {
        "frozen": item.frozen, "low": item.low, "high": item.high, "prior_mean": item.mean, "prior_scale": item.scale,
        "prior": item.prior, "logarithmic": item.logarithmic, "why": item.why}


def _plain_row(name: str, unit: str, value: float, start: float | None) -> dict[str, Any]:
    return {
        "name": name, "unit": unit, "value": value, "start": start, "frozen": False, "at_bound": False,
        "standard_error": None, "interval_95": None, "share_of_prior": None, "spread_over_starts": None,
        "value_in_prior_sd": None, "interval_in_prior_sd": None, "low": None, "high": None, "prior_mean": None,
        "prior_scale": None, "prior": False, "logarithmic": False, "why": ""}
