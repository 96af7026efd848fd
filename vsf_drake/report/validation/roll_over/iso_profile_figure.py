"""The foot under the ISO 22675 loading profile: what is prescribed, and how the foot answers at each position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    condition_label,
    label,
    new_figure,
    style,
)


def iso_profile_figure(iso: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's table `iso` (`analysis.validation.roll_over.section`)."""
    with style():
        figure = new_figure(10.5, 6.4)
        panels = figure.subplots(2, 3)
        time = 1e3 * np.asarray(arrays["iso_time_s"])
        _force(panels[0, 0], iso["positions"], arrays, time)
        tilt = panels[0, 1]
        tilt.plot(time, arrays["iso_tilt_deg"], color=NEUTRAL, linewidth=1.8)
        tilt.axhline(0.0, color=NEUTRAL, linewidth=0.6)
        label(tilt, x="time (ms)", y="tilt of the platform (deg)", title="Tilt (below zero: heel)")
        for axes, name, words, title in (
                (panels[0, 2], "deflection_mm", "deflection (mm)", "Deflection along the line of force"),
                (panels[1, 1], "moment_nm", "moment at the pylon's end (N m)", "Moment (positive: toe up)"),
                (panels[1, 2], "strain_j", "stored energy (J)", "Energy stored in keel and foam")):
            for x, y, look in _curves(iso["positions"], arrays, name):
                axes.plot(time if x is None else x, y, **look)
            label(axes, x="time (ms)", y=words, title=title)
        _shape(panels[1, 0], iso["positions"], arrays, time)
        handles, names = panels[0, 2].get_legend_handles_labels()
        panels[0, 2].legend(handles, names, loc="upper left")
        figure.draw_without_rendering()
    return figure


def _curves(
    rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], name: str
) -> list[tuple[None, np.ndarray, dict[str, Any]]]:
    found = []
    for i, row in enumerate(rows):
        fulcrum = row["fulcrum_mm"]
        look = {**SIMULATED, "color": condition_colour(1e-3 * fulcrum), "label": condition_label(1e-3 * fulcrum),
                "marker": MARKERS[i % len(MARKERS)], "markersize": 4, "markevery": (12 * (i + 1), 60)}
        found.append((None, np.asarray(arrays[f"iso_{fulcrum:.0f}_{name}"]), look))
    return found


def _force(
    axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], time: np.ndarray
) -> None:
    axes.plot(time, arrays["iso_wanted_n"], color=NEUTRAL, label="profile", **MEASURED)
    for i, (_, force, look) in enumerate(_curves(rows, arrays, "force_n")):
        axes.plot(time, force, **(look | {"label": "foot" if i == 0 else None}))
    axes.legend(loc="lower center")
    label(axes, x="time (ms)", y="force along the fixed line (N)", title="Force: profile, and what the foot bears")


def _shape(
    axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray], time: np.ndarray
) -> None:
    for (_, forward, look), (_, up, _) in zip(
            _curves(rows, arrays, "cop_forward_m"), _curves(rows, arrays, "cop_up_m"), strict=True):
        rolled = time <= 447.5
        axes.plot(1e3 * forward[rolled], 1e3 * up[rolled], **look)
        axes.plot(1e3 * forward[~rolled], 1e3 * up[~rolled], color=look["color"], linewidth=0.7, linestyle=":")
    axes.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=9)
    axes.set_aspect("equal", adjustable="datalim")
    label(axes, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
          title="Centre of pressure seen from the pylon")
