"""The foot's frames, points and spheres from the side and from above."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pydrake.math import RigidTransform

from vsf_drake.report.frames import pieces
from vsf_drake.report.frames.foot_positions import FootPositions
from vsf_drake.report.frames.pieces import MM, SIDE, TOP
from vsf_drake.report.style import new_figure, style

_PYLON_RADIUS_M, _PYLON_SHOWN_M = 0.015, 0.045


def foot_frames_figure(foot: FootPositions) -> Figure:
    """Side view above, top view below; lengths in mm, as the model has them."""
    with style():
        figure = new_figure(8.2, 7.6)
        wide = MM * foot.A[0] - 60.0, MM * foot.tip[0] + 62.0
        high = {_side: (-52.0, MM * (foot.X_WM.translation()[2] + _PYLON_SHOWN_M) + 4.0),
                _top: (-MM * foot.half_width - 50.0, MM * foot.half_width + 36.0)}
        ratios = [top - bottom for bottom, top in high.values()]
        for axes, (draw, limits) in zip(figure.subplots(2, 1, height_ratios=ratios), high.items(), strict=True):
            draw(axes, foot)
            axes.set(xlim=wide, ylim=limits)
    return figure


def _side(axes: Axes, foot: FootPositions) -> None:
    pieces.bare(axes, "from the right: x forward, z up; lengths in mm")
    ground = foot.tip[0] + 0.03
    axes.plot([MM * (foot.A[0] - 0.06), MM * ground], [0.0, 0.0], color="0.4", linewidth=1.2)
    M, frame_top = foot.X_WM.translation(), MM * foot.X_WM.translation()[2]
    axes.fill_between(MM * (M[0] + _PYLON_RADIUS_M * np.array([-1.0, 1.0])), frame_top,
                      frame_top + MM * _PYLON_SHOWN_M, color="0.86", zorder=1)
    axes.annotate("pylon", (MM * M[0] + 17.0, frame_top + 24.0), color="0.35")
    rear = foot.parameters.fulcrum.rearmost_m
    bottom = MM * (foot.A[2] + foot.half_thickness)
    axes.fill_between(MM * (foot.A[0] + np.array([0.0, 1.5 * rear])), bottom, frame_top, color="0.93", zorder=0)
    axes.annotate("rigid frame", (MM * foot.A[0] + 60.0, 0.5 * (bottom + frame_top) + 6.0), color="0.45", fontsize=8)
    pieces.spheres(axes, foot, SIDE)
    pieces.keel(axes, foot)
    pieces.roller(axes, foot)
    pieces.triad(axes, RigidTransform(), SIDE, 30.0, "W", offset=(-10.0, 9.0))
    pieces.triad(axes, foot.X_WK, SIDE, 30.0, "K = A", offset=(-20.0, 0.0))
    pieces.triad(axes, foot.X_WM, SIDE, 30.0, "M", offset=(-10.0, 8.0))
    for letter, point in (("B", foot.B), ("C", foot.C)):
        at = MM * point[list(SIDE)]
        axes.plot(*at, "o", color="black", markersize=4, zorder=8)
        axes.annotate(letter, at, xytext=(0.0, 11.0), textcoords="offset points", ha="center", fontweight="bold")
    A, z = MM * foot.A[0], MM * foot.A[2]
    for level, point, text in ((-16.0, foot.B, f"fulcrum position l = {MM * (foot.B - foot.A)[0]:.0f}"),
                               (-29.0, foot.C, f"load point {MM * (foot.C - foot.A)[0]:.0f}"),
                               (-42.0, foot.tip, f"keel {MM * (foot.tip - foot.A)[0]:.0f}")):
        pieces.dimension(axes, A, MM * point[0], level, text)
        axes.plot([MM * point[0]] * 2, [level, z], color="0.75", linewidth=0.6, zorder=0)
    axes.plot([A, A], [-42.0, z], color="0.75", linewidth=0.6, zorder=0)
    for i, (name, level) in enumerate((("M", frame_top), ("K", z))):
        x = MM * foot.tip[0] + 14.0 + 20.0 * i
        pieces.height(axes, x, level, f"{name}\n{level:.1f}")


def _top(axes: Axes, foot: FootPositions) -> None:
    pieces.bare(axes, "from above: x forward, y left")
    half = MM * foot.half_width
    A, tip = MM * foot.A[0], MM * foot.tip[0]
    axes.fill([A, tip, tip, A], [-half, -half, half, half], facecolor="#dcebe4", edgecolor=pieces.KEEL_COLOUR, zorder=1)
    for x in MM * foot.joints[:, 0]:
        axes.plot([x, x], [-half, half], color=pieces.KEEL_COLOUR, linewidth=0.7, linestyle=(0, (4, 3)), zorder=2)
    x = MM * foot.carriage[0]
    axes.plot([x, x], [-1.15 * half, 1.15 * half], color="0.1", linewidth=3.0, zorder=3)
    pieces.spheres(axes, foot, TOP)
    pieces.triad(axes, RigidTransform(), TOP, 30.0, "W, M", offset=(8.0, -10.0))
    pieces.triad(axes, foot.X_WK, TOP, 30.0, "K = A", offset=(-20.0, 0.0))
    for letter, point in (("B", foot.B), ("C", foot.C)):
        at = MM * point[list(TOP)]
        axes.plot(*at, "o", color="black", markersize=4, zorder=8)
        axes.annotate(letter, at, xytext=(9.0, 6.0), textcoords="offset points", ha="center", fontweight="bold")
    level = -half - 26.0
    for index, name in enumerate(foot.zone_names):
        own = foot.spheres[foot.zone == index]
        colour = pieces.ZONE_COLOURS[index % len(pieces.ZONE_COLOURS)]
        axes.plot(MM * own[:, 0], np.full(len(own), level), "|", color=colour, markersize=7)
        axes.annotate(f"{name} ({len(own)})", (MM * own[:, 0].mean(), level), xytext=(0.0, -11.0 - 11.0 * (index % 2)),
                      textcoords="offset points", ha="center", va="top", fontsize=7.5, color=colour)
