"""Parameters of a joint contact fit in standard deviations of what was believed of them before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.fit_text import is_smooth
from vsf_drake.report.style import NEUTRAL, label, new_figure, style

MOST_ROWS = 45
"""Of the smooth errors; of more of them the largest are shown."""
_KNOWN, _BOUND = "#1f6f8b", "#b3261e"
_BANDS = ((2.0, "0.95"), (1.0, "0.87"))
_WIDEST = 4.5


def fit_parameter_figure(table: Mapping[str, Any]) -> Figure:
    """Value and 95 % interval of each free parameter; `table` is that of a joint fit that succeeded."""
    free = [row for row in table["parameters"] if row["value_in_prior_sd"] is not None]
    own = [row for row in free if not is_smooth(row["name"])]
    smooth = [row for row in free if is_smooth(row["name"])]
    shown = sorted(sorted(smooth, key=lambda row: -abs(row["value_in_prior_sd"]))[:MOST_ROWS],
                   key=lambda row: row["name"])
    columns = [(rows, title) for rows, title in (
        (own, "Contact, geometry and the rest"),
        (shown, "Smooth errors of the motion" + (f", the {MOST_ROWS} largest of {len(smooth)}"
                                                 if len(smooth) > MOST_ROWS else ""))) if rows]
    share = table["unidentified_above_share"]
    with style():
        figure = new_figure(5.6 * len(columns), max(3.2, 1.5 + 0.19 * max(len(rows) for rows, _ in columns)))
        for axes, (rows, title) in zip(figure.subplots(1, len(columns), squeeze=False)[0], columns, strict=True):
            _rows(axes, rows, share)
            label(axes, x="from the prior's mean (its standard deviations)", y="parameter (one row each)", title=title)
        handles: list[Artist] = [
            Patch(facecolor=_BANDS[1][1], label="prior, ± 1 standard deviation (lighter: ± 2)"),
            Line2D([], [], color=_KNOWN, marker="o", label="fitted value and 95 % interval"),
            Line2D([], [], color=NEUTRAL, marker="o", markerfacecolor="white",
                   label=f"not identified: error above {share:g} of the prior's")]
        if any(row["at_bound"] for row in free):
            handles.append(Line2D([], [], color=_BOUND, marker="s", label="at a bound"))
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        figure.draw_without_rendering()
    return figure


def _rows(axes: Any, rows: Sequence[Mapping[str, Any]], share: float) -> None:
    for width, shade in _BANDS:
        axes.axvspan(-width, width, color=shade, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color="0.7", linewidth=0.8)
    for y, row in enumerate(rows):
        known = row["share_of_prior"] is not None and row["share_of_prior"] <= share
        colour = _BOUND if row["at_bound"] else _KNOWN if known else NEUTRAL
        low, high = row["interval_in_prior_sd"]
        axes.plot([low, high], [y, y], color=colour, linewidth=1.6)
        axes.plot(row["value_in_prior_sd"], y, marker="s" if row["at_bound"] else "o", color=colour, markersize=5,
                  markerfacecolor=colour if known or row["at_bound"] else "white")
    ends = [abs(end) for row in rows for end in (*row["interval_in_prior_sd"], row["value_in_prior_sd"])]
    reach = max(2.4, min(_WIDEST, 1.08 * max(ends)))
    axes.set_xlim(-reach, reach)
    beyond = [y for y, row in enumerate(rows) if abs(row["value_in_prior_sd"]) > reach]
    for y in beyond:
        value = rows[y]["value_in_prior_sd"]
        axes.annotate(f"{value:+.1f}", (reach if value > 0 else -reach, y), color=_BOUND, fontsize=7.5, va="center",
                      ha="right" if value > 0 else "left")
    axes.set_yticks(range(len(rows)), [row["name"] for row in rows], fontsize=7.5)
    axes.set_ylim(len(rows) - 0.4, -0.6)
