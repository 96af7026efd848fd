"""What the data of a joint contact fit tell: correlations of its parameters, singular values of its Jacobian."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from vsf_drake.report.fit_text import is_smooth
from vsf_drake.report.style import NEUTRAL, label, log_scale, new_figure, style

MOST_NAMES = 40
TOLD = 0.3
"""Least correlation that is written into its cell."""
_COLOUR = "#1f6f8b"


def fit_correlation_figure(table: Mapping[str, Any]) -> Figure:
    """Correlations; coefficients of smooth curves are left out unless there is nothing else."""
    names, matrix = table["correlations"]["names"], np.array(table["correlations"]["matrix"], dtype=float)
    rows = [i for i, name in enumerate(names) if not is_smooth(name)]
    rows = (rows if len(rows) > 1 else [*range(len(names))])[:MOST_NAMES]
    shown, matrix = [names[i] for i in rows], matrix[np.ix_(rows, rows)]
    size = 2.9 + 0.29 * len(rows)
    with style():
        figure = new_figure(size + 0.8, size)
        axes = figure.subplots()
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axes.set_xticks(range(len(rows)), shown, rotation=90, fontsize=7.5)
        axes.set_yticks(range(len(rows)), shown, fontsize=7.5)
        axes.grid(False)
        for i, j in zip(*np.nonzero(np.abs(matrix) >= TOLD), strict=True):
            if i != j:
                axes.text(j, i, f"{100 * matrix[i, j]:+.0f}", ha="center", va="center", fontsize=6.5,
                          color="white" if abs(matrix[i, j]) > 0.7 else "black")
        bar = figure.colorbar(image, ax=axes, shrink=0.5, pad=0.02)
        bar.set_label("correlation (1); in the cells in percent")
        label(axes, x="parameter (one column each)", y="parameter (one row each)", title="Correlation of errors")
        figure.draw_without_rendering()
    return figure


def fit_singular_figure(table: Mapping[str, Any]) -> Figure:
    """Singular values of the data's Jacobian by the parameters in prior standard deviations."""
    values = np.array(table["singular_values"], dtype=float)
    numbers = np.arange(1, len(values) + 1)
    known = values >= 1.0
    shown = np.maximum(values, 1e-3)
    with style():
        figure = new_figure(7.6, 3.4)
        axes = figure.subplots()
        axes.axhline(1.0, color=NEUTRAL, linewidth=1.2, linestyle="--")
        axes.vlines(numbers, 1.0, shown, color="0.75", linewidth=1.0)
        axes.plot(numbers[known], shown[known], linestyle="", marker="o", color=_COLOUR,
                  label=f"told by the data more than by the prior ({known.sum()})")
        axes.plot(numbers[~known], shown[~known], linestyle="", marker="o", color=NEUTRAL, markerfacecolor="white",
                  label=f"told less ({(~known).sum()})")
        log_scale(axes.yaxis)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_ylim(bottom=0.7e-3 if shown.min() <= 1e-3 else None)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="upper right")
        label(axes, x="direction (number)", y="data over prior (1)",
              title="Singular values" + (", below 0.001 drawn at 0.001" if values.min() < 1e-3 else ""))
        figure.draw_without_rendering()
    return figure
