"""Where the energy of the foot is over a stance: one trial a fulcrum position."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import SIMULATED, condition_colour, condition_label, label, new_figure, style

_STORES = (("keel_strain", "keel", 0.85, ""), ("fulcrum_strain", "fulcrum support", 0.5, "////"),
           ("foam_strain", "foam", 0.2, ""))
_LOSSES = ("keel_loss", "foam_loss", "friction_loss", "fulcrum_loss")


def first_of_each(table: Mapping[str, Any]) -> list[tuple[float, int]]:
    """(fulcrum in mm, row of `trials`) of the first stance at each position, softest first."""
    found: dict[float, int] = {}
    for i, row in enumerate(table["trials"]):
        found.setdefault(row["fulcrum_mm"], i)
    return sorted(found.items())


def energy_stance_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: strain of keel, support and foam stacked, and losses of the foot so far; a panel a position."""
    shown = first_of_each(table)
    terms, percent = np.asarray(arrays["terms_j"], dtype=float), np.asarray(arrays["percent"], dtype=float)
    with style():
        figure = new_figure(10.5, 3.9)
        panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        for axes, (fulcrum, i) in zip(panels, shown, strict=True):
            _panel(axes, percent, dict(zip(table["terms"], terms[i], strict=True)), 1e-3 * fulcrum)
            label(axes, x="stance (%)", y="energy (J)" if axes is panels[0] else "",
                  title=f"{condition_label(1e-3 * fulcrum)}: {table['trials'][i]['label']}")
        panels[0].legend(loc="upper left")
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, percent: np.ndarray, terms: Mapping[str, np.ndarray], fulcrum_m: float) -> None:
    colour, base = condition_colour(fulcrum_m), np.zeros(len(percent))
    for name, text, alpha, hatch in _STORES:
        top = base + terms[name]
        axes.fill_between(percent, base, top, facecolor=(*colour[:3], alpha), edgecolor="white", hatch=hatch,
                          linewidth=0.0, label=text)
        base = top
    axes.plot(percent, base, color=colour, **SIMULATED)
    axes.plot(percent, np.sum([terms[name] for name in _LOSSES], axis=0), color="0.1", linestyle=(0, (1, 1)),
              linewidth=1.4, label="lost in the foot so far")
    axes.set_xlim(0.0, 100.0)
    axes.set_ylim(bottom=0.0)
