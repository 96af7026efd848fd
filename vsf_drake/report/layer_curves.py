"""What a walk in layers adds to a figure of its forces: the person's own curve with its interval,
and the null model."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vsf_drake.model.setting import AtSetting
from vsf_drake.report.style import (
    ASIDE_S,
    MEASURED,
    NEUTRAL,
    PANEL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    legend_below,
    say_synthetic,
)

COMPONENTS = ("fore-aft", "lateral", "vertical")
RESULTANT = 3
LOOKS: dict[str, tuple[str, dict[str, Any]]] = {
    "null": ("null model, measured times", {"color": NEUTRAL, "linestyle": ":", "linewidth": 1.5}),
    "null_predicted": (
        "null model, predicted times",
        {"color": NEUTRAL, "linestyle": "-.", "linewidth": 1.0},
    ),
    "person": ("person's own curve", {"color": "black", "linewidth": 1.2}),
}
"""By name in `walks.prediction.layer_curves`: what a legend calls it, and its look."""
_LOADED_BW = 0.02
"""What counts as stance (a choice)."""
BAND: dict[str, Any] = {"color": "black", "alpha": 0.16, "linewidth": 0.0}
INTERVAL = "its 80 % interval"


def draw_layers(axes: Axes, x: np.ndarray, curves: Arrays, component: int) -> None:
    """The curves of LOOKS that there are, over x: of a component, or their RESULTANT."""
    shown = {name: component_of(curves[name], component) for name in LOOKS if name in curves}
    if "half_width" in curves and "person" in shown:
        wide = curves["half_width"][:, component]
        axes.fill_between(x, shown["person"] - wide, shown["person"] + wide, **BAND)
    for name, force in shown.items():
        axes.plot(x, force, **LOOKS[name][1])


def layer_handles(curves: Arrays) -> list[Artist]:
    """What a legend shows of `draw_layers`, the person's own curve first."""
    handles: list[Artist] = [
        entry(*LOOKS[name][:1], **LOOKS[name][1]) for name in reversed(LOOKS) if name in curves
    ]
    if "half_width" in curves and "person" in curves:
        handles.insert(1, Patch(label=INTERVAL, **BAND))
    return handles


def layers_figure(curves: Arrays, setting: AtSetting, *, synthetic: bool) -> Figure:
    """A walk's `layer_curves` beside its plate and the physics, over time."""
    colour = colour_of(setting)
    with drawing(PANEL[0], 2.2 * PANEL[1]) as figure:
        say_synthetic(figure, synthetic, "walk")
        panels = figure.subplots(3, 1, sharex=True, height_ratios=(2, 1, 1))
        for axes, k in zip(panels, (2, 0, 1), strict=True):
            axes.plot(curves["time_s"], curves["plate"][:, k], color=colour, **MEASURED)
            axes.plot(curves["time_s"], curves["physics"][:, k], color=colour, **SIMULATED)
            draw_layers(axes, curves["time_s"], curves, k)
            label(axes, x="time (s)" if k == 1 else "", y="force (BW)", title=COMPONENTS[k])
        loaded = curves["time_s"][
            np.nan_to_num(np.fmax(curves["plate"][:, 2], curves["physics"][:, 2])) > _LOADED_BW
        ]
        if loaded.size:
            panels[0].set_xlim(loaded[0] - ASIDE_S, loaded[-1] + ASIDE_S)
        known = [
            entry("plate", color=colour, **MEASURED),
            entry("physics alone", color=colour, **SIMULATED),
        ]
        legend_below(figure, [*known, *layer_handles(curves)])
    return figure


def component_of(force: np.ndarray, component: int) -> np.ndarray:
    """(n,) of forces (n, 3)."""
    return (
        np.linalg.norm(force, axis=1) if component == RESULTANT else np.asarray(force[:, component])
    )
