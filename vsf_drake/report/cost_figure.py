"""Cost against work in one figure: wall time per simulated second, with each walk's error written beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from vsf_drake.analysis.cost import Cost
from vsf_drake.report.style import NEUTRAL, condition_colour, label, log_scale, new_figure, style

_PANELS = {
    "step": ("step size (ms)", "Step size"),
    "spheres": ("contact spheres of the prosthetic foot", "Contact spheres (same outline and stiffness)"),
    "elements": ("elements of the keel", "Keel elements (same beam)"),
    "free": ("coordinates that are not prescribed", "Free coordinates (let go in mid-stance)"),
}
_FLOOR = 5e-5
"""Share of body weight below which an error is written as below that."""


def cost_figure(costs: Sequence[Cost], *, title: str) -> Figure:
    """Four panels, one a family of `costs`.

    Args:
        title: what was walked, and on what.
    """
    with style():
        figure = new_figure(9.6, 7.0)
        heights = [cost.stepping_per_second for cost in costs]
        for axes, (family, (x, name)) in zip(figure.subplots(2, 2, sharey=True).flat, _PANELS.items(), strict=True):
            members = sorted((cost for cost in costs if cost.family == family), key=lambda cost: cost.size)
            _panel(axes, members, 1e3 if family == "step" else 1.0)
            label(axes, x=x, y="wall time per simulated second (s)", title=name)
            axes.label_outer(remove_inner_ticks=True)
            axes.set_xlabel(x)
            axes.tick_params(labelbottom=True)
        axes.set_ylim(0.5 * min(heights), 2.0 * max(1.0, *heights))
        figure.suptitle(
            f"{title}\nBeside each point: RMS of the difference of its 40 Hz resultant from the panel's finest, % of "
            "body weight\n(free coordinates: from the same motion in the finest step)", x=0.01, ha="left", fontsize=9.5)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, members: Sequence[Cost], unit: float) -> None:
    x = np.array([unit * cost.size for cost in members])
    y = np.array([cost.stepping_per_second for cost in members])
    axes.axhline(1.0, color=NEUTRAL, linewidth=1.0, linestyle=":")
    falling = y[-1] < y[0]
    axes.annotate("real time", (1.0 if falling else 0.01, 1.0), xycoords=("axes fraction", "data"), xytext=(0, 3),
                  textcoords="offset points", ha="right" if falling else "left", fontsize=8, color=NEUTRAL)
    axes.plot(x, y, marker="o", markersize=6, linewidth=1.4, color=condition_colour(0.108))
    for place, height, cost in zip(x, y, members, strict=True):
        axes.annotate(_error(cost), (place, height), xytext=(3 if falling else -3, 7), textcoords="offset points",
                      ha="left" if falling else "right", fontsize=8)
    log_scale(axes.xaxis, base=2)
    log_scale(axes.yaxis)
    axes.margins(x=0.2)
    axes.xaxis.set_major_locator(FixedLocator(x.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _error(cost: Cost) -> str:
    if not cost.against:
        return "finest"
    return f"{100 * cost.difference_bw:.2g} %" if cost.difference_bw > _FLOOR else f"< {100 * _FLOOR:g} %"
