"""Distal segment power over stance, of the pylon and of the residual shank."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import SIMULATED, condition_colour, condition_label, label, new_figure, style

_PANELS = (("pylon_power_w", "Seen from the pylon: the foot alone"),
           ("shank_power_w", "Seen from the residual shank: foot and socket"))


def energy_power_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: one line a stance, in the colour of its fulcrum position."""
    percent = np.asarray(arrays["percent"], dtype=float)
    middle = 0.5 * (percent[1:] + percent[:-1])
    with style():
        figure = new_figure(10.5, 3.9)
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (name, title) in zip(panels, _PANELS, strict=True):
            seen = set()
            for row, power in zip(table["trials"], np.asarray(arrays[name], dtype=float), strict=True):
                home = row["fulcrum_mm"]
                axes.plot(middle, power, color=condition_colour(1e-3 * home),
                          label=None if home in seen else condition_label(1e-3 * home), **SIMULATED)
                seen.add(home)
            axes.axhline(0.0, color="0.3", linewidth=0.8)
            axes.set_xlim(0.0, 100.0)
            label(axes, x="stance (%)", y="distal segment power (W)" if axes is panels[0] else "", title=title)
        panels[0].legend(loc="upper left")
        panels[0].text(0.99, 0.97, "given back", transform=panels[0].transAxes, ha="right", va="top", fontsize=8)
        panels[0].text(0.99, 0.03, "taken up", transform=panels[0].transAxes, ha="right", va="bottom", fontsize=8)
        figure.draw_without_rendering()
    return figure
