"""Standing at every fulcrum position: what the ground carries against the weight, and the share of each foot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import MEASURED, NEUTRAL, condition_colour, condition_label, label, new_figure, style

_SETTLED_S = 1.0
"""What is drawn of the force: later there is nothing to see."""


def standing_mass_figure(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """Left, the force on both feet until it has settled; right, the mean force on each foot by position."""
    rows = [(i, row) for i, row in enumerate(table["rows"]) if row["failure"] is None]
    with style():
        figure = new_figure(10.5, 3.9)
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        weight = rows[0][1]["weight_n"]
        left.axhline(weight, color=NEUTRAL, label=f"weight, {weight:.1f} N", **MEASURED)
        for k, (i, row) in enumerate(rows):
            time = np.asarray(arrays[f"standing_{i}_time_s"])
            both = np.asarray(arrays[f"standing_{i}_prosthetic_n"]) + np.asarray(arrays[f"standing_{i}_intact_n"])
            left.plot(time, both, color=condition_colour(1e-3 * row["fulcrum_mm"]), linewidth=1.4,
                      linestyle=("--", "-.", (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))[k % 4],
                      label=f"{condition_label(1e-3 * row['fulcrum_mm'])}, mean {row['mean_vertical_n']:.1f} N")
        left.set_xlim(0.0, min(table["duration_s"], _SETTLED_S))
        left.legend(loc="upper right")
        label(left, x="time (s)", y="vertical force on both feet (N)", title="Let go off rest: the start")
        places = np.arange(len(rows))
        for key, shade, hatch, name in (("mean_prosthetic_n", "0.35", "", "prosthetic foot"),
                                        ("mean_intact_n", "0.85", "///", "intact foot")):
            base = np.zeros(len(rows)) if key == "mean_prosthetic_n" else np.array(
                [row["mean_prosthetic_n"] for _, row in rows])
            right.bar(places, [row[key] for _, row in rows], bottom=base, color=shade, edgecolor="0.2", hatch=hatch,
                      width=0.6, label=name)
        for place, (_, row) in zip(places, rows, strict=True):
            right.text(place, 0.5 * row["mean_prosthetic_n"], f"{row['prosthetic_share']:.0%}", color="white",
                       ha="center", va="center")
        right.axhline(weight, color=NEUTRAL, **MEASURED)
        right.set_xticks(places, [f"{row['fulcrum_mm']:g}" for _, row in rows])
        right.set_ylim(0.0, 1.3 * weight)
        right.legend(loc="upper center", ncols=2)
        label(right, x="fulcrum from the keel's end (mm)", y="mean vertical force (N)", title="How the feet share it")
        figure.draw_without_rendering()
    return figure
