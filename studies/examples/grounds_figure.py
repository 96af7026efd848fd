"""The picture of walking_over_grounds: foot and force over each ground above, force and its point over time below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from vsf_drake.ground import Ground
from vsf_drake.report.style import NEUTRAL, label, new_figure, style

SHARES = (0.06, 0.3, 0.6, 0.9)
"""Instants that are drawn, in shares of the time shown."""
ARROW_M_PER_BW = 0.2
SHOWN_N = 20.0


def draw(runs: dict[str, Any], grounds: dict[str, Ground], plate: Any, body_weight_n: float) -> Figure:
    """The figure of `runs` by ground name; `plate` is what was recorded on level ground."""
    with style():
        figure = new_figure(2.55 * max(len(runs), 4), 6.2)
        above, below = figure.subfigures(2, 1, height_ratios=(1.0, 1.0))
        colours = {name: colormaps["viridis"](0.9 * i / max(len(grounds) - 1, 1)) for i, name in enumerate(grounds)}
        shared = above.subplots(1, len(runs), sharex=True, sharey=True, squeeze=False)[0]
        for axes, (name, run) in zip(shared, runs.items(), strict=True):
            _draw_ground(axes, grounds[name])
            _draw_step(axes, run, colours[name], body_weight_n)
            axes.set_aspect("equal")
            axes.grid(False)
            axes.set_xlim(0.42, 0.80)
            axes.set_ylim(-0.03, 0.33)
            label(axes, x="x in W (m)", y="z in W (m)" if axes is shared[0] else "", title=name)
        _draw_courses(below.subplots(1, 3), runs, colours, plate, body_weight_n)
        above.suptitle("One recorded step, the limb's path the same on every ground (synthetic recording)", fontsize=10)
    return figure


def profile(ground: Ground, x: np.ndarray) -> np.ndarray:
    """Height (n,) m of `ground` at x (n,) and y = 0; NaN where there is none."""
    z = np.full(len(x), -np.inf)
    for patch in ground.patches:
        inside = (x >= patch.from_x_m) & (x < patch.to_x_m) & (patch.from_y_m <= 0.0 < patch.to_y_m)
        plane = patch.height_m + np.tan(np.radians(patch.slope_deg)) * (x - patch.reference_x_m)
        z = np.where(inside, np.maximum(z, plane), z)
    return np.where(np.isfinite(z), z, np.nan)


def _draw_ground(axes: Any, ground: Ground) -> None:
    x = np.linspace(0.2, 1.0, 1601)
    soft = any(patch.stiffness_n_per_m for patch in ground.patches)
    axes.fill_between(x, -1.0, profile(ground, x), color="0.88", hatch="..." if soft else None, edgecolor="0.6", lw=0.0)
    axes.plot(x, profile(ground, x), color="0.35", lw=1.0)


def _draw_step(axes: Any, run: Any, colour: Any, body_weight_n: float) -> None:
    for share in SHARES:
        i = round(share * (len(run.time_s) - 1))
        fade = 0.3 + 0.7 * share
        top, mount, *sole = run.outline[i]
        axes.plot(*np.array([top, mount]).T, color=NEUTRAL, lw=2.2, alpha=fade)
        axes.fill(*np.array([mount, *sole]).T, facecolor="0.6", edgecolor="0.15", lw=0.9, alpha=0.6 * fade)
        if run.grf_W[i, 2] > SHOWN_N:
            tip = ARROW_M_PER_BW * run.grf_W[i] / body_weight_n
            axes.annotate("", xy=run.cop_W[i, [0, 2]] + tip[[0, 2]], xytext=run.cop_W[i, [0, 2]],
                          arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0})
    loaded = run.grf_W[:, 2] > SHOWN_N
    axes.plot(run.cop_W[loaded, 0], run.cop_W[loaded, 2], color=colour, lw=3.0, solid_capstyle="round")


def _draw_courses(panels: Any, runs: dict[str, Any], colours: dict[str, Any], plate: Any, body_weight_n: float) -> None:
    start = next(iter(runs.values())).time_s[0]
    for axes, column, scale, title in ((panels[0], 2, body_weight_n, "vertical"),
                                       (panels[1], 0, body_weight_n, "fore-aft, forward positive")):
        first = next(iter(runs.values()))
        own = (plate.time_s >= first.time_s[0]) & (plate.time_s <= first.time_s[-1])
        axes.plot(plate.time_s[own] - start, plate.force_W[own, column] / scale, color=NEUTRAL, lw=3.0, alpha=0.5,
                  label="recorded, level")
        for name, run in runs.items():
            axes.plot(run.time_s - start, run.grf_W[:, column] / scale, color=colours[name], lw=1.4, label=name)
        label(axes, x="time (s)", y="ground reaction force (body weights)", title=title)
    for name, run in runs.items():
        loaded = run.grf_W[:, 2] > SHOWN_N
        panels[2].plot(run.time_s[loaded] - start, run.cop_W[loaded, 0], color=colours[name], lw=1.4)
    label(panels[2], x="time (s)", y="x of the centre of pressure (m)", title="centre of pressure")
    panels[0].legend(loc="best", ncols=2)
