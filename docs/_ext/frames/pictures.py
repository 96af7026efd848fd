"""Writes the pictures of frames and signs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pydrake.math import RigidTransform

from frames import pieces
from frames.foot_positions import (
    FULCRUM_M,
    LOAD_N,
    SLIDING_M_PER_S,
    SLOPE_DEG,
    DrawnFoot,
    FootPositions,
    FootSigns,
    GroundForces,
    foot_signs,
)
from frames.person_poses import KINDS, STEP, DrawnPerson, Effect, effects, kind_of
from frames.pieces import FORCE_COLOUR, FRONT, MM, MOVED_COLOUR, REST_COLOUR, SIDE, TOP
from vsf_drake.model.parameters import FootParameters
from vsf_drake.report.style import new_figure, save_figure, style

# What positive values of the person's coordinates do: the pose at zero in grey, the moved one over
# it.


VIEWS = {"right": SIDE, "front": FRONT, "above": TOP}
GROUPS = {
    "pelvis": (
        "pelvis_tx",
        "pelvis_ty",
        "pelvis_tz",
        "pelvis_tilt",
        "pelvis_list",
        "pelvis_rotation",
    ),
    "legs": (
        "hip_flexion",
        "hip_adduction",
        "hip_rotation",
        "knee_angle",
        "knee_adduction",
        "knee_rotation",
        "ankle_angle",
        "ankle_adduction",
        "ankle_rotation",
    ),
    "socket": (
        "socket_tx",
        "socket_ty",
        "socket_tz",
        "socket_flexion",
        "socket_adduction",
        "socket_rotation",
    ),
}
"""Kinds of coordinates that share a figure, row by row, three a row."""
_COLUMNS = 3
_NEAR = ("ankle", "socket")
"""Kinds that are drawn on one leg alone, from the knee down."""
_SOLE = ("rear inner", "rear outer", "front outer", "front inner", "rear inner")


def person_figure(person: DrawnPerson, group: str) -> Figure:
    """One panel a kind of coordinate of `group`; where both legs have it, both are moved by the
    same value."""
    kinds = GROUPS[group]
    with style():
        rows = len(kinds) // _COLUMNS
        figure = new_figure(9.0, 3.3 * rows)
        for axes, kind in zip(figure.subplots(rows, _COLUMNS).ravel(), kinds, strict=True):
            _panel(axes, person, [name for name in person.coordinates if kind_of(name) == kind])
    return figure


def _panel(axes: Axes, person: DrawnPerson, names: Sequence[str]) -> None:
    kind = kind_of(names[0])
    word, _, view, size = KINDS[kind]
    value = np.radians(size) if person.is_angle(names[0]) else size
    rest, moved = person.points(), person.points(**dict.fromkeys(names, value))
    columns = VIEWS[view]
    own = person.moving_point(names[0])[-1] if kind.startswith(_NEAR) and view != "above" else ""
    _stick(axes, rest, columns, REST_COLOUR, 2.6, own)
    _stick(axes, moved, columns, MOVED_COLOUR, 1.8, own)
    for name in names:
        point = person.moving_point(name)
        if point.startswith("inner edge"):  # it lies beside the ankle, where no line is
            for pose, colour in ((rest, REST_COLOUR), (moved, MOVED_COLOUR)):
                ends = np.array([pose[f"ankle_{point[-1]}"], pose[point]])[:, list(columns)]
                axes.plot(*ends.T, color=colour, linewidth=1.2, linestyle=(0, (3, 2)), zorder=2)
        pieces.arrow(
            axes, rest[point][list(columns)], moved[point][list(columns)], FORCE_COLOUR, 1.8
        )
    unit = f"+{size:g}°" if person.is_angle(names[0]) else f"+{pieces.MM * size:g} mm"
    seen = {"right": "from the right", "front": "from the front", "above": "from above"}[view]
    shown = names[0] if len(names) == 1 else f"{names[0]}, {names[1][-2:]}"
    pieces.bare(axes, f"{shown}\n{unit}: {word}")
    axes.margins(0.06)
    axes.autoscale_view()
    if own and kind.startswith("ankle"):  # the foot and a piece of its shank
        low, ankle = axes.get_ylim()[0], rest[f"ankle_{own}"][2]
        axes.set_ylim(low, ankle + 0.6 * (ankle - low))
    axes.text(0.0, -0.02, seen, transform=axes.transAxes, fontsize=7.5, color="0.4", va="top")


def _stick(
    axes: Axes,
    points: dict[str, np.ndarray],
    columns: tuple[int, int],
    colour: str,
    width: float,
    only: str = "",
) -> None:
    """The person as lines between joint centres, with outlines of the feet; or one leg from the
    knee down."""

    def line(*names: str) -> None:
        axes.plot(
            *np.array([points[name][list(columns)] for name in names]).T,
            color=colour,
            linewidth=width,
            solid_capstyle="round",
            zorder=3 if colour == MOVED_COLOUR else 2,
        )

    def centre(name: str) -> None:
        axes.plot(
            *points[name][list(columns)],
            "o",
            markersize=3.6,
            markeredgecolor=colour,
            markerfacecolor="white",
            zorder=4,
        )

    if not only:
        line("trunk", "pelvis")
        line("hip_l", "pelvis", "hip_r")
    for s in only or "rl":
        if not only:
            line(f"hip_{s}", f"knee_{s}")
            centre(f"hip_{s}")
        if f"pylon_{s}" in points:
            line(f"knee_{s}", f"limb_{s}")
            line(f"pylon_{s}", f"ankle_{s}")
        else:
            line(f"knee_{s}", f"ankle_{s}")
        line(*(f"{corner}_{s}" for corner in _SOLE))
        line(f"heel_{s}", f"ankle_{s}", f"toe_{s}")
        centre(f"knee_{s}")
        centre(f"ankle_{s}")


NAMES = ("foot_frames", "foot_signs", *(f"person_{group}" for group in GROUPS))
"""Of the pictures, each as .png and .svg."""


def write_pictures(
    folder: str | Path, parameters: FootParameters | None = None
) -> tuple[Path, ...]:
    """Writes every picture of NAMES as PNG and SVG; the same model and Matplotlib give the same
    bytes.

    Args:
        folder: an existing one.
        parameters: of the foot; the nominal one by default. The person has a prosthesis on the
            left.

    Raises:
        InputError: the folder cannot be written.
    """
    foot = parameters or FootParameters()
    person = DrawnPerson("left")
    figures = [
        foot_frames_figure(DrawnFoot(foot).positions(FULCRUM_M)),
        foot_signs_figure(foot_signs(foot)),
        *(person_figure(person, group) for group in GROUPS),
    ]
    return tuple(
        path
        for name, figure in zip(NAMES, figures, strict=True)
        for path in save_figure(figure, Path(folder) / name, letters="path")
    )


# The foot's frames, points and spheres from the side and from above.


_PYLON_RADIUS_M, _PYLON_SHOWN_M = 0.015, 0.045


def foot_frames_figure(foot: FootPositions) -> Figure:
    """Side view above, top view below; lengths in mm, as the model has them."""
    with style():
        figure = new_figure(8.2, 7.6)
        wide = MM * foot.A[0] - 60.0, MM * foot.tip[0] + 62.0
        high = {
            _side: (-52.0, MM * (foot.X_WM.translation()[2] + _PYLON_SHOWN_M) + 4.0),
            _top: (-MM * foot.half_width - 50.0, MM * foot.half_width + 36.0),
        }
        ratios = [top - bottom for bottom, top in high.values()]
        for axes, (draw, limits) in zip(
            figure.subplots(2, 1, height_ratios=ratios), high.items(), strict=True
        ):
            draw(axes, foot)
            axes.set(xlim=wide, ylim=limits)
    return figure


def _side(axes: Axes, foot: FootPositions) -> None:
    pieces.bare(axes, "from the right: x forward, z up; lengths in mm")
    ground = foot.tip[0] + 0.03
    axes.plot([MM * (foot.A[0] - 0.06), MM * ground], [0.0, 0.0], color="0.4", linewidth=1.2)
    M, frame_top = foot.X_WM.translation(), MM * foot.X_WM.translation()[2]
    axes.fill_between(
        MM * (M[0] + _PYLON_RADIUS_M * np.array([-1.0, 1.0])),
        frame_top,
        frame_top + MM * _PYLON_SHOWN_M,
        color="0.86",
        zorder=1,
    )
    axes.annotate("pylon", (MM * M[0] + 17.0, frame_top + 24.0), color="0.35")
    rear = foot.parameters.fulcrum.rearmost_m
    bottom = MM * (foot.A[2] + foot.half_thickness)
    axes.fill_between(
        MM * (foot.A[0] + np.array([0.0, 1.5 * rear])), bottom, frame_top, color="0.93", zorder=0
    )
    axes.annotate(
        "rigid frame",
        (MM * foot.A[0] + 60.0, 0.5 * (bottom + frame_top) + 6.0),
        color="0.45",
        fontsize=8,
    )
    pieces.spheres(axes, foot, SIDE)
    pieces.keel(axes, foot)
    pieces.roller(axes, foot)
    pieces.triad(axes, RigidTransform(), SIDE, 30.0, "W", offset=(-10.0, 9.0))
    pieces.triad(axes, foot.X_WK, SIDE, 30.0, "K = A", offset=(-20.0, 0.0))
    pieces.triad(axes, foot.X_WM, SIDE, 30.0, "M", offset=(-10.0, 8.0))
    for letter, point, right in (("B", foot.B, 14.0), ("C", foot.C, 0.0)):
        at = MM * point[list(SIDE)]
        axes.plot(*at, "o", color="black", markersize=4, zorder=8)
        axes.annotate(
            letter,
            at,
            xytext=(right, 11.0),
            textcoords="offset points",
            ha="center",
            fontweight="bold",
        )
    A, z = MM * foot.A[0], MM * foot.A[2]
    for level, point, text in (
        (-16.0, foot.B, f"fulcrum position l = {MM * (foot.B - foot.A)[0]:.0f}"),
        (-29.0, foot.C, f"load point {MM * (foot.C - foot.A)[0]:.0f}"),
        (-42.0, foot.tip, f"keel {MM * (foot.tip - foot.A)[0]:.0f}"),
    ):
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
    axes.fill(
        [A, tip, tip, A],
        [-half, -half, half, half],
        facecolor="#dcebe4",
        edgecolor=pieces.KEEL_COLOUR,
        zorder=1,
    )
    for x in MM * foot.joints[:, 0]:
        axes.plot(
            [x, x],
            [-half, half],
            color=pieces.KEEL_COLOUR,
            linewidth=0.7,
            linestyle=(0, (4, 3)),
            zorder=2,
        )
    x = MM * foot.carriage[0]
    axes.plot([x, x], [-1.15 * half, 1.15 * half], color="0.1", linewidth=3.0, zorder=3)
    pieces.spheres(axes, foot, TOP)
    pieces.triad(axes, RigidTransform(), TOP, 30.0, "W, M", offset=(8.0, -10.0))
    pieces.triad(axes, foot.X_WK, TOP, 30.0, "K = A", offset=(-20.0, 0.0))
    for letter, point in (("B", foot.B), ("C", foot.C)):
        at = MM * point[list(TOP)]
        axes.plot(*at, "o", color="black", markersize=4, zorder=8)
        axes.annotate(
            letter,
            at,
            xytext=(9.0, 6.0),
            textcoords="offset points",
            ha="center",
            fontweight="bold",
        )
    level = -half - 26.0
    for index, name in enumerate(foot.zone_names):
        own = foot.spheres[foot.zone == index]
        colour = pieces.ZONE_COLOURS[index % len(pieces.ZONE_COLOURS)]
        axes.plot(MM * own[:, 0], np.full(len(own), level), "|", color=colour, markersize=7)
        axes.annotate(
            f"{name} ({len(own)})",
            (MM * own[:, 0].mean(), level),
            xytext=(0.0, -11.0 - 11.0 * (index % 2)),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=7.5,
            color=colour,
        )


# The signs of the foot: coordinates, the fulcrum's force, the ground's force and moment, slopes of
# the ground.


_MM_PER_N = 0.09
_WIDE, _HIGH = (-125.0, 195.0), (-38.0, 118.0)
_SUPPORT_COLOUR = "#7b1fa2"


def foot_signs_figure(signs: FootSigns) -> Figure:
    """Eight panels; forces to one scale, lengths in mm."""
    with style():
        figure = new_figure(9.4, 10.2)
        grid = figure.subplots(4, 2).ravel()
        panels = (
            _keel_coordinate,
            _carriage,
            _support,
            _sliding,
            _turning,
            _sloping,
            _banked,
            _depth,
        )
        for axes, draw in zip(grid, panels, strict=True):
            draw(axes, signs)
            axes.set(xlim=_WIDE, ylim=_HIGH)
        grid[4].set(ylim=(-78.0, 78.0))
        for axes in (grid[6], grid[7]):
            axes.set(xlim=(-160.0, 160.0))
    return figure


def _ground(axes: Axes) -> None:
    axes.plot(_WIDE, (0.0, 0.0), color="0.5", linewidth=1.0, zorder=1)


def _force(
    axes: Axes, start: Any, force: Any, colour: Any, text: str, offset: tuple[float, float]
) -> None:
    """An arrow from `start` (mm) with the components of `force` (N) in the plane of the drawing."""
    end = np.asarray(start) + _MM_PER_N * np.asarray(force)
    pieces.arrow(axes, start, end, colour, 2.2)
    axes.annotate(
        text,
        end,
        xytext=offset,
        textcoords="offset points",
        color=colour,
        ha="center",
        va="center",
        fontsize=8.5,
        zorder=9,
    )


def _keel_coordinate(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "keel_1 … keel_8 positive: the toe is lifted")
    _ground(axes)
    pieces.keel(axes, signs.rest, REST_COLOUR)
    pieces.keel(axes, signs.lifted)
    rest, lifted = (MM * foot.tip[list(SIDE)] for foot in (signs.rest, signs.lifted))
    pieces.arrow(axes, rest, lifted, "black", connectionstyle="arc3,rad=0.25")
    axes.annotate(
        "A",
        MM * signs.rest.A[list(SIDE)],
        xytext=(-10.0, 0.0),
        textcoords="offset points",
        va="center",
    )
    pieces.triad(axes, signs.rest.X_WK, SIDE, 24.0, "", offset=(0.0, 0.0))
    axes.text(
        _WIDE[0], -28.0, "0 (grey) and +3° in each sprung joint; rotation about -y of K", fontsize=8
    )


def _carriage(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "carriage coordinate fulcrum positive: from A to the toe")
    _ground(axes)
    pieces.keel(axes, signs.rest)
    pieces.roller(axes, signs.rear, REST_COLOUR)
    pieces.roller(axes, signs.front)
    level = MM * signs.rest.A[2]
    for y, foot in ((level + 19.0, signs.rear), (level + 39.0, signs.front)):
        pieces.dimension(axes, MM * foot.A[0], MM * foot.B[0], y, f"l = {MM * foot.fulcrum_m:g} mm")
    start, end = MM * signs.rear.carriage[0], MM * signs.front.carriage[0]
    pieces.arrow(axes, (start + 9.0, level - 13.0), (end - 9.0, level - 13.0), "black")


def _support(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "support_force: on the keel, along z of K")
    pieces.keel(axes, signs.rest, REST_COLOUR)
    pieces.keel(axes, signs.loaded)
    pieces.roller(axes, signs.loaded)
    C, B = MM * signs.loaded.C[list(SIDE)], MM * signs.loaded.B[list(SIDE)]
    below, reach = (
        C - np.array([0.0, _MM_PER_N * LOAD_N]),
        np.array([0.0, _MM_PER_N * signs.support_force]),
    )
    pieces.arrow(axes, below, C, FORCE_COLOUR, 2.2)
    axes.annotate(
        f"load +{LOAD_N:.0f} N",
        below,
        xytext=(0.0, -8.0),
        textcoords="offset points",
        color=FORCE_COLOUR,
        ha="center",
        va="center",
        fontsize=8.5,
    )
    pieces.arrow(axes, B - reach, B, _SUPPORT_COLOUR, 2.2)
    axes.annotate(
        f"support_force {signs.support_force:.0f} N",
        B - 0.6 * reach,
        xytext=(-6.0, 0.0),
        textcoords="offset points",
        color=_SUPPORT_COLOUR,
        ha="right",
        va="center",
        fontsize=8.5,
    )


def _pressed(axes: Axes, forces: GroundForces) -> None:
    pieces.spheres(axes, forces.foot, SIDE, faint=True)
    pieces.keel(axes, forces.foot)


def _cop(axes: Axes, at: Any, offset: tuple[float, float] = (0.0, -9.0)) -> None:
    axes.plot(*at, "o", color="black", markersize=5, zorder=9)
    axes.annotate(
        "cop",
        at,
        xytext=offset,
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.5,
        zorder=9,
    )


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
    axes.text(
        x + 40.0,
        y + 3.0,
        f"free_moment\n{forces.free_moment:+.1f} N m",
        color=FORCE_COLOUR,
        fontsize=8.5,
        va="center",
    )
    pieces.arrow(
        axes, (tip + 12.0, 26.0), (tip + 12.0, -26.0), "black", connectionstyle="arc3,rad=-0.2"
    )
    axes.text(tip + 6.0, 38.0, "foot turns\nclockwise", fontsize=8, ha="center", va="bottom")


def _sloping(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, f"ground: slope_deg +{SLOPE_DEG:g}, up along +x")
    _inclined(axes, signs.sloping, SIDE)
    _pressed(axes, signs.sloping)


def _banked(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(
        axes, f"ground: bank_deg +{SLOPE_DEG:g}, up along +y; from the front, y to the right"
    )
    _inclined(axes, signs.banked, FRONT)
    _section(axes, signs.banked.foot)


def _section(axes: Axes, foot: FootPositions) -> None:
    """The keel's cross-section and the spheres from the front."""
    pieces.spheres(axes, foot, FRONT, faint=True)
    centre, up = MM * foot.C[list(FRONT)], foot.X_WK.rotation().matrix()
    y, z = up[list(FRONT), 1], up[list(FRONT), 2]
    corners = [
        centre + MM * (a * foot.half_width * y + b * foot.half_thickness * z)
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    axes.fill(*np.array(corners).T, color=MOVED_COLOUR, alpha=0.6, zorder=3)


def _inclined(axes: Axes, forces: GroundForces, view: tuple[int, int]) -> None:
    """The ground's line, its normal (dashed) and the force of a foot that does not slide."""
    normal, at = forces.normal[list(view)], MM * forces.cop[list(view)]
    along = np.array([normal[1], -normal[0]])
    line = at + np.outer([-170.0, 170.0], along)
    axes.plot(*line.T, color="0.5", linewidth=1.0, zorder=1)
    axes.plot(
        *(at + np.outer([0.0, 105.0], normal)).T,
        color="0.3",
        linewidth=0.9,
        linestyle=(0, (5, 3)),
        zorder=5,
    )
    _force(axes, at, forces.grf[list(view)], FORCE_COLOUR, "grf", (9.0, 4.0))
    _cop(axes, at)
    level = line[0] + 20.0 * along
    axes.plot(
        [level[0], level[0] + 95.0],
        [level[1]] * 2,
        color="0.5",
        linewidth=0.8,
        linestyle=":",
        zorder=1,
    )


def _depth(axes: Axes, signs: FootSigns) -> None:
    pieces.bare(axes, "depth: how far a sphere's lowest point is below the ground")
    radius, depth = 55.0, 14.0
    axes.plot((-160.0, 160.0), (0.0, 0.0), color="0.5", linewidth=1.0)
    centre = np.array([-40.0, radius - depth])
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.fill(
        *(centre[:, None] + radius * np.array([np.cos(turn), np.sin(turn)])),
        facecolor="0.93",
        edgecolor="0.4",
    )
    axes.plot(*centre, "o", color="black", markersize=3)
    axes.annotate("S", centre, xytext=(-9.0, -4.0), textcoords="offset points", va="center")
    axes.plot([centre[0], 45.0], [-depth, -depth], color="0.6", linewidth=0.7)
    pieces.arrow(axes, (40.0, 0.0), (40.0, -depth), "black", 1.0)
    axes.text(
        48.0,
        -0.5 * depth,
        "depth > 0 in contact,\ndepth_rate > 0 going in",
        va="center",
        fontsize=8,
    )
    pieces.arrow(axes, (centre[0], -depth), (centre[0], -depth + 68.0), FORCE_COLOUR, 2.2)
    axes.annotate(
        "normal_force ≥ 0",
        (centre[0], -depth + 68.0),
        xytext=(0.0, 8.0),
        textcoords="offset points",
        color=FORCE_COLOUR,
        fontsize=8.5,
        ha="center",
        va="center",
    )
    pieces.arrow(axes, (centre[0], -depth), (centre[0] - 40.0, -depth), FORCE_COLOUR, 2.2)
    axes.text(
        centre[0] - 44.0,
        -depth,
        "friction_force\nagainst the slip",
        color=FORCE_COLOUR,
        fontsize=8.5,
        ha="right",
        va="center",
    )
    pieces.arrow(axes, (centre[0] + 62.0, radius), (centre[0] + 100.0, radius), "black")
    axes.text(centre[0] + 62.0, radius + 4.0, "slips along +x", fontsize=8)


# The table of all coordinates, with unit, name of a positive value, and what then moves where, as
# the model has it.


BEGIN, END = (
    "<!-- coordinates: begin (docs/make_pictures.py writes this table) -->",
    "<!-- coordinates: end -->",
)
BENDING = "bending of the keel"
HEAD = "| coordinate | unit | positive | what it moves, and where |\n|---|---|---|---|"


def coordinate_table() -> str:
    """The table as Markdown, from `BEGIN` to `END`."""
    lines = [BEGIN, "", HEAD]
    merged: dict[tuple[str, str], list[Effect]] = {}
    for effect in (*effects(), *foot_effects(FootParameters())):
        kind = "keel" if effect.positive == BENDING else kind_of(effect.name)
        merged.setdefault((kind, effect.direction), []).append(effect)
    for group in merged.values():
        named, first = [f"`{effect.name}`" for effect in group], group[0]
        names = f"{named[0]} … {named[-1]}" if len(named) > 2 else ", ".join(named)
        lines.append(
            f"| {names} | {first.unit} | {first.positive} | {first.point} {first.direction} |"
        )
    return "\n".join([*lines, "", END])


def with_table(text: str) -> str:
    """`text` with the table as it is now.

    Raises:
        ValueError: `text` has no place for it.
    """
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"there is no {BEGIN} ... {END} in the text")
    return head + coordinate_table() + tail


def foot_effects(parameters: FootParameters) -> tuple[Effect, ...]:
    """What the foot's own coordinates do: the pin, the sprung joints, the carriage."""
    drawn = DrawnFoot(parameters)
    rest = drawn.positions(parameters.fulcrum.rearmost_m)
    found = []
    for i, name in enumerate(drawn.foot.keel_joint_names):
        angles = np.zeros(len(drawn.foot.keel))
        angles[i] = STEP
        rises = (drawn.positions(parameters.fulcrum.rearmost_m, angles).tip - rest.tip)[2] > 0.0
        found.append(
            Effect(name, "rad", BENDING if i else "turn about A", "toe", "up" if rises else "down")
        )
    ahead = (drawn.positions(parameters.fulcrum.rearmost_m + STEP).carriage - rest.carriage)[
        0
    ] > 0.0
    found.append(
        Effect(
            drawn.foot.carriage_joint_name,
            "m",
            "distance from A",
            "carriage",
            "forward" if ahead else "backward",
        )
    )
    return tuple(found)
