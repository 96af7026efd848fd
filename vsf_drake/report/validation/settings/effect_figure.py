"""What the model predicts when the fulcrum is moved under the same motion, against what is detectable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.style import MARKERS, condition_colour, label, new_figure, style

SHOWN = ("resultant_first_bw", "resultant_second_bw", "vertical_trough_bw", "propulsion_bw", "cop_mid_stance_fl",
         "energy_stored_j")
DESIGNS = {"same_recording": "same recording", "same_session": "two recordings, one session",
           "two_sessions": "two sessions"}
_SHADES = {"two_sessions": "0.93", "same_session": "0.84", "same_recording": "0.70"}
_ROUND = 0.25


def settings_effect_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Six outcomes over the fulcrum's position, each as a difference from the middle position."""
    positions = np.array(table["positions_mm"], dtype=float)
    middle = int(np.argmin(np.abs(positions - 0.5 * (positions[0] + positions[-1]))))
    effects = np.array(arrays["effects"], dtype=float)
    recorded = [trial["fulcrum_mm"] for trial in table["trials"]]
    with style():
        figure = new_figure(10.6, 6.4)
        for axes, name in zip(figure.subplots(2, 3, sharex=True).ravel(), SHOWN, strict=True):
            row = next(row for row in table["outcomes"] if row["name"] == name)
            column = table["names"].index(name)
            known = row["sdd_same_recording"] is not None
            _bands(axes, table["pairs"], name, positions, middle, "" if known else "noise_")
            change = effects[:, :, column] - effects[:, middle:middle + 1, column]
            for values, at in zip(change, recorded, strict=True):
                axes.plot(positions, values, color=condition_colour(1e-3 * at), linewidth=1.0)
            axes.plot(positions, np.nanmean(change, axis=0), color="black", linewidth=2.2, marker="o", markersize=4.5)
            axes.axhline(0.0, color="0.4", linewidth=0.8)
            axes.set_xticks(positions)
            label(axes, x="fulcrum from the keel's end (mm)",
                  y=f"difference from {positions[middle]:g} mm ({row['unit']})",
                  title=row["title"] + ("" if known else ": noise alone"))
        settings = sorted(set(recorded))
        handles = [Patch(facecolor=_SHADES[d], edgecolor="0.6", label=f"not detectable: {DESIGNS[d]}")
                   for d in reversed(_SHADES)]
        handles += [Line2D([], [], color="black", linewidth=2.2, marker=MARKERS[0], markersize=4.5,
                           label="mean of the trials"),
                    *(Line2D([], [], color=condition_colour(1e-3 * x), label=f"trials recorded at {x:g} mm")
                      for x in settings)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.suptitle(("SYNTHETIC trials. " if table["synthetic"] else "")
                        + "The same motion walked at every position of the fulcrum", x=0.01, ha="left", fontsize=10.5)
        figure.draw_without_rendering()
    return figure


def _bands(axes: Axes, pairs: Sequence[Mapping[str, Any]], name: str, positions: np.ndarray, middle: int,
           prefix: str) -> None:
    own = [row for row in pairs if row["outcome"] == name]
    here = positions[middle]
    for design, shade in _SHADES.items():
        found = {row["to_mm"] if row["from_mm"] == here else row["from_mm"]: row[f"{prefix}sdd_{design}"]
                 for row in own if here in (row["from_mm"], row["to_mm"])}
        known = [(x, limit) for x, limit in sorted(found.items()) if limit is not None]
        if len(known) < len(found):
            continue
        for side in ([item for item in known if item[0] < here], [item for item in known if item[0] > here]):
            x = np.array([at for at, _ in side])
            limit = np.array([value for _, value in side])
            near = np.argmin(np.abs(x - here))
            at = np.append(x, here)
            wide = np.append(limit, limit[near])
            order = np.argsort(at)
            axes.fill_between(at[order], -wide[order], wide[order], color=shade, linewidth=0.0, zorder=0)
