"""All figures of a contact fit, made from its saved table and curves alone."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.fit_bench_figure import fit_bench_figure
from vsf_drake.report.fit_error_figure import fit_error_figure
from vsf_drake.report.fit_knowledge_figure import fit_correlation_figure, fit_singular_figure
from vsf_drake.report.fit_parameter_figure import fit_parameter_figure
from vsf_drake.report.fit_search_figure import fit_search_figure
from vsf_drake.report.fit_sweep_figure import fit_sweep_figure
from vsf_drake.report.fit_trial_figure import fit_trial_figure

LONGEST = 60
"""Letters of a trial's label in a file name."""


def fit_figures(table: Mapping[str, Any], curves: Mapping[str, np.ndarray]) -> dict[str, Figure]:
    """The figures by the name of their files, without those for which this fit has nothing.

    Args:
        table, curves: what fit.json and fit.npz hold.
    """
    figures: dict[str, Figure] = {}
    trials = table["trials"]
    if any(trial["metrics"] is not None for trial in trials):
        figures["errors"] = fit_error_figure(table)
    if any(trial["sweep"] is not None for trial in trials):
        figures["sweep"] = fit_sweep_figure(table)
    for i, trial in enumerate(trials):
        own = {name.removeprefix(f"trial_{i}_"): values for name, values in curves.items()
               if name.startswith(f"trial_{i}_")}
        if own:
            figures[trial_name(i, trial)] = fit_trial_figure(trial, own)
    if table["bench"] and table["bench"]["model_n_per_mm"] is not None:
        figures["bench"] = fit_bench_figure(table)
    if any(row["value_in_prior_sd"] is not None for row in table["parameters"]):
        figures["parameters"] = fit_parameter_figure(table)
        figures["correlations"] = fit_correlation_figure(table)
        figures["singular_values"] = fit_singular_figure(table)
    if table["searches"] or table["history"]:
        figures["searches"] = fit_search_figure(table)
    return figures


def trial_name(number: int, trial: Mapping[str, Any]) -> str:
    """Name of the figure of a trial, the `number`-th of its table, as a file can have it."""
    return f"trial_{number + 1}_{re.sub(r'[^0-9A-Za-z._-]', '_', trial['label'])[:LONGEST]}"
