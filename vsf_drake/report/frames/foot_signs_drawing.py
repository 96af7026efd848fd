"""The signs of the foot: coordinates, the fulcrum's force, the ground's force and moment, slopes of the ground."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.frames import pieces
from vsf_drake.report.frames.foot_positions import FootPositions
from vsf_drake.report.frames.foot_signs import LOAD_N, SLIDING_M_PER_S, SLOPE_DEG, FootSigns, GroundForces
from vsf_drake.report.frames.pieces import FORCE_COLOUR, FRONT, MM, MOVED_COLOUR, REST_COLOUR, SIDE, TOP
from vsf_drake.report.style import new_figure, style

_MM_PER_N = 0.09
_WIDE, _HIGH = (-125.0, 195.0), (-38.0, 118.0)
_SUPPORT_COLOUR = "#7b1fa2"


def foot_signs_figure(signs: FootSigns) -> Figure:
    """Eight panels; forces to one scale, lengths in mm."""
    with style():
        figure = new_figure(9.4, 10.2)
        grid = figure.subplots(4, 2).ravel()
        panels = (_keel_coordinate, _carriage, _support, _sliding, _turning, _sloping, _banked, _depth)
        for axes, draw in zip(grid, panels, strict=True):
            draw(axes, signs)
            axes.set(xlim=_WIDE, ylim=_HIGH)
        grid[4].set(ylim=(-78.0, 78.0))
        for axes in (grid[6], grid[7]):
            axes.set(xlim=(-160.0, 160.0))
    return figure


def _ground(axes: Axes) -> None:
    axes.plot(_WIDE, (0.0, 0.0), color="0.5", linewidth=1.0, zorder=1)


def _force(axes: Axes, start: Any, force: Any, colour: Any, text: str, offset: tuple[float, float]) -> None:
    """An arrow from `start` (mm) with the components of `force` (N) in the plane of the drawing."""
    end = np.asarray(start) + _MM_PER_N * np.asarray(force)
    pieces.arrow(axes, start, end, colour, 2.2)
    axes.annotate(text, end, xytext=offset, textcoords="offset points", color=colour, ha="center", va="center",
                  fontsize=8.5, zorder=9)


def _keel_coordinate(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "keel_1 … keel_8 positive: the toe is lifted")
    _ground(axes)
    pieces.keel(axes, signs.rest, REST_COLOUR)
    pieces.keel(axes, signs.lifted)
    rest, lifted = (MM * foot.tip[list(SIDE)] for foot in (signs.rest, signs.lifted))
    pieces.arrow(axes, rest, lifted, "black", connectionstyle="arc3,rad=0.25")
    axes.annotate("A", MM * signs.rest.A[list(SIDE)], xytext=(-10.0, 0.0), textcoords="offset points", va="center")
    pieces.triad(axes, signs.rest.X_WK, SIDE, 24.0, "", offset=(0.0, 0.0))
    axes.text(_WIDE[0], -28.0, "0 (grey) and +3° in each sprung joint; rotation about -y of K", fontsize=8)


def _carriage(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "carriage coordinate fulcrum positive: from A to the toe")
    _ground(axes)
    pieces.keel(axes, signs.rest)
    pieces.roller(axes, signs.rear, REST_COLOUR)
    pieces.roller(axes, signs.front)
    level = MM * signs.rest.A[2]
    for y, foot in ((level + 14.0, signs.rear), (level + 34.0, signs.front)):
        pieces.dimension(axes, MM * foot.A[0], MM * foot.B[0], y, f"l = {MM * foot.fulcrum_m:g} mm")
    start, end = MM * signs.rear.carriage[0], MM * signs.front.carriage[0]
    pieces.arrow(axes, (start + 9.0, level - 13.0), (end - 9.0, level - 13.0), "black")


def _support(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "support_force: on the keel, along z of K")
    pieces.keel(axes, signs.rest, REST_COLOUR)
    pieces.keel(axes, signs.loaded)
    pieces.roller(axes, signs.loaded)
    C, B = MM * signs.loaded.C[list(SIDE)], MM * signs.loaded.B[list(SIDE)]
    below, reach = C - np.array([0.0, _MM_PER_N * LOAD_N]), np.array([0.0, _MM_PER_N * signs.support_force])
    pieces.arrow(axes, below, C, FORCE_COLOUR, 2.2)
    axes.annotate(f"load +{LOAD_N:.0f} N", below, xytext=(0.0, -8.0), textcoords="offset points",
                  color=FORCE_COLOUR, ha="center", va="center", fontsize=8.5)
    pieces.arrow(axes, B - reach, B, _SUPPORT_COLOUR, 2.2)
    axes.annotate(f"support_force {signs.support_force:.0f} N", B - 0.6 * reach, xytext=(-6.0, 0.0),
                  textcoords="offset points", color=_SUPPORT_COLOUR, ha="right", va="center", fontsize=8.5)


def _pressed(axes: Axes, forces: GroundForces) -> None:
    pieces.spheres(axes, forces.foot, SIDE, faint=True)
    pieces.keel(axes, forces.foot)


def _cop(axes: Axes, at: Any, offset: tuple[float, float] = (0.0, -9.0)) -> None:
    axes.plot(*at, "o", color="black", markersize=5, zorder=9)
    axes.annotate("cop", at, xytext=offset, textcoords="offset points", ha="center", va="center", fontsize=8.5,
                  zorder=9)


def _sliding(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "grf: of the ground on the foot, in W, at cop")
    _ground(axes)
    forces = signs.sliding
    _pressed(axes, forces)
    at = MM * forces.cop[list(SIDE)]
    x, _, z = forces.grf
    _force(axes, at, [x, z], FORCE_COLOUR, f"grf ({x:.0f}, 0, {z:.0f}) N", (-8.0, 8.0))
    _cop(axes, at)
    pieces.arrow(axes, (110.0, 60.0), (165.0, 60.0), "black")
    axes.text(112.0, 65.0, f"slides forward\n{SLIDING_M_PER_S:g} m/s", fontsize=8, va="bottom")


def _turning(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "free_moment: on the foot, about the normal at cop, from above")
    forces = signs.turning
    pieces.spheres(axes, forces.foot, TOP, faint=True)
    half, A, tip = MM * forces.foot.half_width, MM * forces.foot.A[0], MM * forces.foot.tip[0]
    axes.plot([A, tip, tip, A, A], [-half, -half, half, half, -half], color=MOVED_COLOUR)
    at = MM * forces.cop[list(TOP)]
    _cop(axes, at, (0.0, -10.0))
    round_ = {"connectionstyle": "arc3,rad=0.55" if forces.free_moment > 0 else "arc3,rad=-0.55"}
    x, y = at
    pieces.arrow(axes, (x + 26.0, y - 16.0), (x + 26.0, y + 18.0), FORCE_COLOUR, 2.2, **round_)
    axes.text(x + 40.0, y + 3.0, f"free_moment\n{forces.free_moment:+.1f} N m", color=FORCE_COLOUR, fontsize=8.5,
              va="center")
    pieces.arrow(axes, (tip + 12.0, 26.0), (tip + 12.0, -26.0), "black", connectionstyle="arc3,rad=-0.2")
    axes.text(tip + 6.0, 38.0, "foot turns\nclockwise", fontsize=8, ha="center", va="bottom")


def _sloping(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, f"ground: slope_deg +{SLOPE_DEG:g}, up along +x")
    _inclined(axes, signs.sloping, SIDE)
    _pressed(axes, signs.sloping)


def _banked(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, f"ground: bank_deg +{SLOPE_DEG:g}, up along +y; from the front, y to the right")
    _inclined(axes, signs.banked, FRONT)
    _section(axes, signs.banked.foot)


def _section(axes: Axes, foot: FootPositions) -> None:
    """The keel's cross-section and the spheres from the front."""
    pieces.spheres(axes, foot, FRONT, faint=True)
    centre, up = MM * foot.C[list(FRONT)], foot.X_WK.rotation().matrix()
    y, z = up[list(FRONT), 1], up[list(FRONT), 2]
    corners = [centre + MM * (a * foot.half_width * y + b * foot.half_thickness * z)
               for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    axes.fill(*np.array(corners).T, color=MOVED_COLOUR, alpha=0.6, zorder=3)


def _inclined(axes: Axes, forces: GroundForces, view: tuple[int, int]) -> None:
    """The ground's line, its normal (dashed) and the force of a foot that does not slide."""
    normal, at = forces.normal[list(view)], MM * forces.cop[list(view)]
    along = np.array([normal[1], -normal[0]])
    line = at + np.outer([-170.0, 170.0], along)
    axes.plot(*line.T, color="0.5", linewidth=1.0, zorder=1)
    axes.plot(*(at + np.outer([0.0, 105.0], normal)).T, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)), zorder=5)
    _force(axes, at, forces.grf[list(view)], FORCE_COLOUR, "grf", (9.0, 4.0))
    _cop(axes, at)
    level = line[0] + 20.0 * along
    axes.plot([level[0], level[0] + 95.0], [level[1]] * 2, color="0.5", linewidth=0.8, linestyle=":", zorder=1)


def _depth(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "depth: how far a sphere's lowest point is below the ground")
    radius, depth = 55.0, 14.0
    axes.plot((-160.0, 160.0), (0.0, 0.0), color="0.5", linewidth=1.0)
    centre = np.array([-40.0, radius - depth])
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.fill(*(centre[:, None] + radius * np.array([np.cos(turn), np.sin(turn)])), facecolor="0.93", edgecolor="0.4")
    axes.plot(*centre, "o", color="black", markersize=3)
    axes.annotate("S", centre, xytext=(-9.0, -4.0), textcoords="offset points", va="center")
    axes.plot([centre[0], 45.0], [-depth, -depth], color="0.6", linewidth=0.7)
    pieces.arrow(axes, (40.0, 0.0), (40.0, -depth), "black", 1.0)
    axes.text(48.0, -0.5 * depth, "depth > 0 in contact,\ndepth_rate > 0 going in", va="center", fontsize=8)
    pieces.arrow(axes, (centre[0], -depth), (centre[0], -depth + 68.0), FORCE_COLOUR, 2.2)
    axes.annotate("normal_force ≥ 0", (centre[0], -depth + 68.0), xytext=(0.0, 8.0), textcoords="offset points",
                  color=FORCE_COLOUR, fontsize=8.5, ha="center", va="center")
    pieces.arrow(axes, (centre[0], -depth), (centre[0] - 40.0, -depth), FORCE_COLOUR, 2.2)
    axes.text(centre[0] - 44.0, -depth, "friction_force\nagainst the slip", color=FORCE_COLOUR, fontsize=8.5,
              ha="right", va="center")
    pieces.arrow(axes, (centre[0] + 62.0, radius), (centre[0] + 100.0, radius), "black")
    axes.text(centre[0] + 62.0, radius + 4.0, "slips along +x", fontsize=8)
