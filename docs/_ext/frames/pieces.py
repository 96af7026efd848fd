"""What the drawings of frames and signs share: axes without ticks in millimetres, triads, arrows,
keel and spheres."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Circle, FancyArrowPatch
from pydrake.math import RigidTransform

from frames.foot_positions import FootPositions

SIDE, TOP, FRONT = (0, 2), (0, 1), (1, 2)
"""Columns of a point that a view shows: from the right (x, z), from above (x, y), from the front
(y, z)."""
X_COLOUR, Y_COLOUR, Z_COLOUR = "#c62828", "#2e7d32", "#1f3fbf"
KEEL_COLOUR, FORCE_COLOUR, REST_COLOUR, MOVED_COLOUR = "#33805f", "#e06100", "0.72", "#33805f"
ZONE_COLOURS = ("#8c6bb1", "#6a51a3", "#9e9ac8", "#4292c6", "#6baed6", "#969696")
MM = 1e3


def bare(axes: Axes, title: str) -> None:
    """Equal scales, no frame, a title at the left."""
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(title, loc="left")


def arrow(
    axes: Axes, start: Any, end: Any, colour: Any, width: float = 1.8, **options: Any
) -> None:
    """From `start` to `end` (mm)."""
    axes.add_patch(
        FancyArrowPatch(
            tuple(start),
            tuple(end),
            arrowstyle="-|>",
            mutation_scale=6.0 + 3.0 * width,
            linewidth=width,
            color=colour,
            shrinkA=0.0,
            shrinkB=0.0,
            zorder=6,
            **options,
        )
    )


def triad(
    axes: Axes,
    X_WF: RigidTransform,
    view: tuple[int, int],
    length: float,
    letter: str,
    *,
    offset: tuple[float, float] = (-8.0, -8.0),
) -> None:
    """The axes of frame F that `view` shows, `length` mm long, with its letter at `offset` points
    from the origin."""
    turned = X_WF.rotation().matrix()
    base = MM * X_WF.translation()[list(view)]
    for i, (name, colour) in enumerate(zip("xyz", (X_COLOUR, Y_COLOUR, Z_COLOUR), strict=True)):
        along = length * turned[list(view), i]
        if np.linalg.norm(along) < 1e-6 * length:
            continue
        arrow(axes, base, base + along, colour)
        axes.annotate(
            name, base + 1.13 * along, color=colour, ha="center", va="center", fontsize=8, zorder=7
        )
    axes.plot(*base, "o", color="black", markersize=4, zorder=8)
    axes.annotate(
        letter,
        base,
        xytext=offset,
        textcoords="offset points",
        ha="center",
        va="center",
        fontweight="bold",
        zorder=8,
    )


def keel(axes: Axes, foot: FootPositions, colour: Any = KEEL_COLOUR, **options: Any) -> None:
    """The keel's centreline from the side as thick as it is, with its joints."""
    line = MM * np.vstack([foot.joints, foot.tip])[:, list(SIDE)]
    up = np.array([0.0, MM * foot.half_thickness])
    outline = np.vstack([line + up, (line - up)[::-1]])
    axes.fill(
        *outline.T,
        facecolor=to_rgba(colour, 0.35),
        edgecolor=colour,
        linewidth=1.0,
        zorder=3,
        **options,
    )
    axes.plot(
        *line[:-1].T, "o", markersize=3.2, markerfacecolor="white", markeredgecolor=colour, zorder=4
    )


def spheres(axes: Axes, foot: FootPositions, view: tuple[int, int], *, faint: bool = False) -> None:
    """The contact spheres, one colour a zone."""
    for centre, radius, zone in zip(foot.spheres, foot.radius, foot.zone, strict=True):
        colour = ZONE_COLOURS[zone % len(ZONE_COLOURS)]
        at = MM * centre[list(view)]
        axes.add_patch(
            Circle(
                tuple(at),
                MM * radius,
                facecolor=to_rgba(colour, 0.06 if faint else 0.16),
                edgecolor=to_rgba(colour, 0.4 if faint else 0.9),
                linewidth=0.8,
                zorder=2,
            )
        )


def dimension(axes: Axes, start: float, end: float, level: float, text: str) -> None:
    """A horizontal dimension line (mm) with its text above."""
    _between(axes, (start, level), (end, level))
    axes.text(
        0.5 * (start + end), level + 1.5, text, ha="center", va="bottom", fontsize=7.5, color="0.25"
    )


def height(axes: Axes, x: float, level: float, text: str) -> None:
    """A vertical dimension line (mm) from the ground, with its text at the right."""
    _between(axes, (x, 0.0), (x, level))
    axes.text(x + 2.0, 0.5 * level, text, fontsize=7.5, color="0.25", va="center")


def _between(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate(
        "",
        end,
        start,
        arrowprops={
            "arrowstyle": "<|-|>",
            "color": "0.35",
            "linewidth": 0.8,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 7,
        },
    )


def roller(axes: Axes, foot: FootPositions, colour: Any = "0.1") -> None:
    """The fulcrum, which bears on the keel from above, as a triangle, from the side."""
    x, z = MM * foot.carriage[0], MM * (foot.carriage[2] + foot.half_thickness)
    axes.fill([x, x - 6.0, x + 6.0], [z, z + 11.0, z + 11.0], color=colour, zorder=5)
