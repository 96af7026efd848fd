"""Where on the curve model and plate differ: mean differences over stance, with the regions that the test found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.style import NEUTRAL, condition_colour, label, new_figure, style
from vsf_drake.report.validation.walking.ensemble_figure import NAMES, PERCENT, has_curves

_LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))


def main_group(table: Mapping[str, Any]) -> int | str:
    """The group of all walks; the only condition where there is one only."""
    return "all" if any(d["group"] == "all" for d in table["differences"]) else 0


def difference_figure(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """A panel a quantity: conditions in colour, all walks black with their band, regions marked below."""
    group = main_group(table)
    shown = [name for name in NAMES if has_curves(arrays, group, name)]
    down = -(-len(shown) // 2)
    with style():
        figure = new_figure(10.5, 0.9 + 2.1 * down)
        panels = figure.subplots(down, 2, sharex=True, squeeze=False).ravel()
        for axes, name in zip(panels, shown, strict=False):
            _panel(axes, table, arrays, name, group)
        for axes in panels[len(shown):]:
            axes.set_axis_off()
        for axes in panels[max(0, len(shown) - 2):len(shown)]:
            axes.set_xlabel("measured stance (%)")
            axes.tick_params(labelbottom=True)
        panels[0].set_xlim(0.0, 100.0)
        handles = _handles(table, group)
        if len(shown) % 2:
            panels[len(shown)].legend(handles=handles, loc="center")
        else:
            figure.legend(handles=handles, loc="outside lower center", ncols=3)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC walks, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, np.ndarray], name: str, group: Any) -> None:
    own = next(d for d in table["differences"] if d["group"] == group and d["quantity"] == name)
    curve = {key: np.asarray(arrays[f"group_{group}_{name}_difference_{key}"], dtype=float)
             for key in ("mean", "low", "high")}
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    for region in own["regions"]:
        axes.axvspan(region["start_percent"], region["end_percent"], color="0.88", linewidth=0.0, zorder=0)
        axes.plot([region["start_percent"], region["end_percent"]], [0.02, 0.02], color="0.1", linewidth=4.0,
                  solid_capstyle="butt", transform=axes.get_xaxis_transform())
    axes.fill_between(PERCENT, curve["low"], curve["high"], color=NEUTRAL, alpha=0.35, linewidth=0.0)
    if group == "all":
        for i, condition in enumerate(table["conditions"]):
            if has_curves(arrays, i, name):
                axes.plot(PERCENT, np.asarray(arrays[f"group_{i}_{name}_difference_mean"], dtype=float), linewidth=1.3,
                          color=condition_colour(1e-3 * condition["fulcrum_mm"]), linestyle=_LINES[i % len(_LINES)])
    axes.plot(PERCENT, curve["mean"], color="black", linewidth=2.0)
    title = NAMES[name][0]
    label(axes, x="", y=f"model less plate ({table['units'][name]})", title=title[0].upper() + title[1:])


def _handles(table: Mapping[str, Any], group: Any) -> list[Artist]:
    count = max((d["n"] for d in table["differences"] if d["group"] == group), default=0)
    own = [d for d in table["differences"] if d["group"] == group]
    found: list[Artist] = [Line2D([], [], color="black", linewidth=2.0,
                                  label=f"mean of {count} walk{'s' * (count != 1)}")]
    if any(d["method"] for d in own):
        found.append(Patch(facecolor=NEUTRAL, alpha=0.4, label="its pointwise 95 % bootstrap band"))
        found.append(Line2D([], [], color="0.1", linewidth=4.0, label="they differ (α = 0.05)"))
    if group == "all":
        found += [Line2D([], [], color=condition_colour(1e-3 * c["fulcrum_mm"]), linestyle=_LINES[i % len(_LINES)],
                         linewidth=1.3, label=f"fulcrum {c['fulcrum_mm']:g} mm")
                  for i, c in enumerate(table["conditions"])]
    return found
