"""What positive values of the person's coordinates do: the pose at zero in grey, the moved one over it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.frames import pieces
from vsf_drake.report.frames.person_poses import KINDS, DrawnPerson, kind_of
from vsf_drake.report.frames.pieces import FORCE_COLOUR, FRONT, MOVED_COLOUR, REST_COLOUR, SIDE, TOP
from vsf_drake.report.style import new_figure, style

VIEWS = {"right": SIDE, "front": FRONT, "above": TOP}
GROUPS = {
    "pelvis": ("pelvis_tx", "pelvis_ty", "pelvis_tz", "pelvis_tilt", "pelvis_list", "pelvis_rotation"),
    "legs": ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation",
             "ankle_angle", "ankle_adduction", "ankle_rotation"),
    "socket": ("socket_tx", "socket_ty", "socket_tz", "socket_flexion", "socket_adduction", "socket_rotation"),
}
"""Kinds of coordinates that share a figure, row by row, three a row."""
_COLUMNS = 3
_NEAR = ("ankle", "socket")
"""Kinds that are drawn on one leg alone, from the knee down."""
_SOLE = ("rear inner", "rear outer", "front outer", "front inner", "rear inner")


def person_figure(person: DrawnPerson, group: str) -> Figure:
    """One panel a kind of coordinate of `group`; where both legs have it, both are moved by the same value."""
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
        pieces.arrow(axes, rest[point][list(columns)], moved[point][list(columns)], FORCE_COLOUR, 1.8)
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


def _stick(axes: Axes, points: dict[str, np.ndarray], columns: tuple[int, int], colour: str, width: float,
           only: str = "") -> None:
    """The person as lines between joint centres, with outlines of the feet; or one leg from the knee down."""
    def line(*names: str) -> None:
        axes.plot(*np.array([points[name][list(columns)] for name in names]).T, color=colour, linewidth=width,
                  solid_capstyle="round", zorder=3 if colour == MOVED_COLOUR else 2)

    def centre(name: str) -> None:
        axes.plot(*points[name][list(columns)], "o", markersize=3.6, markeredgecolor=colour, markerfacecolor="white",
                  zorder=4)

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
