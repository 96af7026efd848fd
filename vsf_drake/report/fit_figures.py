"""All figures of a contact fit, made from its saved table and curves alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from vsf_drake.report.page import number
from vsf_drake.report.style import (
    HEEL_COLOUR,
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    drawing,
    label,
    log_scale,
)

LONGEST = 60
"""Letters of a trial's label in a file name."""
MOST_ROWS, MOST_NAMES = 45, 40
"""Of the smooth errors, of more of which the largest are shown, and of the correlations."""
TOLD = 0.3
"""Least correlation that is written into its cell."""
_GOOD, _BAD = "#1f6f8b", "#b3261e"
_PUBLISHED = "0.9"
_PRIOR = ((2.0, "0.95"), (1.0, "0.87"))
_WIDEST = 4.5
_ACROSS = 3
_ERRORS = (("grf_rmse_bw", "RMS error (% body weight)", "Resultant force"),
           ("fore_aft_rmse_bw", "RMS error (% body weight)", "Fore-aft force"),
           ("cop_rmse_fl", "RMS error (% foot length)", "Centre of pressure, fore-aft"))


def fit_figures(table: Mapping[str, Any], curves: Mapping[str, np.ndarray]) -> dict[str, Figure]:
    """The figures by the name of their files, without those for which this fit has nothing.

    Args:
        table, curves: what fit.json and fit.npz hold.
    """
    figures: dict[str, Figure] = {}
    trials = table["trials"]
    if any(trial["metrics"] is not None for trial in trials):
        figures["errors"] = fit_error_figure(table)
    if any(trial["sweep"] is not None for trial in trials):
        figures["sweep"] = fit_sweep_figure(table)
    for i, trial in enumerate(trials):
        own = {name.removeprefix(f"trial_{i}_"): values for name, values in curves.items()
               if name.startswith(f"trial_{i}_")}
        if own:
            figures[trial_name(i, trial)] = fit_trial_figure(trial, own)
    if table["bench"] and table["bench"]["model_n_per_mm"] is not None:
        figures["bench"] = fit_bench_figure(table)
    if any(row["value_in_prior_sd"] is not None for row in table["parameters"]):
        figures["parameters"] = fit_parameter_figure(table)
        figures["correlations"] = fit_correlation_figure(table)
        figures["singular_values"] = fit_singular_figure(table)
    if table["searches"] or table["history"]:
        figures["searches"] = fit_search_figure(table)
    return figures


def trial_name(number: int, trial: Mapping[str, Any]) -> str:
    """Name of the figure of a trial, the `number`-th of its table, as a file can have it."""
    return f"trial_{number + 1}_{re.sub(r'[^0-9A-Za-z._-]', '_', trial['label'])[:LONGEST]}"


def is_smooth(name: str) -> bool:
    """Whether a parameter is a coefficient of a smooth curve or path."""
    return name.startswith("curve.") or (name.startswith("trial.") and ".path." in name)


def _dot(name: str, marker: str = "o", **look: Any) -> Line2D:
    """A marker alone in a legend."""
    return Line2D([], [], linestyle="", label=name, marker=marker, **look)


def _finish(figure: Figure, handles: Sequence[Artist], columns: int, trials: Sequence[Mapping[str, Any]] = ()) -> None:
    """Legend below, and over it all what nobody recorded."""
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
    if any(trial["synthetic"] for trial in trials):
        figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)


def _decades(axes: Axes) -> None:
    """A logarithmic y axis, labelled at its major ticks alone."""
    log_scale(axes.yaxis)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def fit_bench_figure(table: Mapping[str, Any]) -> Figure:
    """The fitted foot in the testing machine beside the measurement: stiffness, and mid-range displacement where it was
    measured, over the fulcrum's position; `table` is that of a judged fit with a bench."""
    bench = table["bench"]
    rows = [("stiffness", "N/mm", "n_per_mm", bench)]
    if "mid_range" in bench:
        rows.append(("mid-range displacement", "mm", "mm", bench["mid_range"]))
    with drawing(7.6, 4.0 * len(rows)) as figure:
        pairs = figure.subplots(len(rows), 2, width_ratios=(3.0, 1.0), squeeze=False)
        for (left, right), (name, unit, end, of) in zip(pairs, rows, strict=True):
            _forefoot(left, bench, f"{name} ({unit})", unit, **{key: of[f"{key}_{end}"] for key in (
                "measured", "model", "uncertainty", "rmse")})
            _heel(right, of[f"heel_measured_{end}"], of[f"heel_model_{end}"], of[f"uncertainty_{end}"])
            label(right, x="heel (one position)", y=f"{name} ({unit})", title="Heel")
    return figure


def _forefoot(
    axes: Any, bench: Mapping[str, Any], y: str, unit: str, *, measured: list[float], model: list[float],
    uncertainty: float, rmse: float
) -> None:
    x, solid = bench["fulcrum_mm"], {"color": "0.6", "linewidth": 2.4}
    dashed: dict[str, Any] = {"color": "0.2", "linewidth": 1.4, "linestyle": (0, (4, 1.6))}
    axes.plot(x, measured, zorder=1, **solid)
    axes.plot(x, model, zorder=2, **dashed)
    for i, (position, k, fitted) in enumerate(zip(x, measured, model, strict=True)):
        colour = condition_colour(1e-3 * position)
        axes.errorbar(position, k, yerr=2.0 * uncertainty, color=colour, marker="_",
                      markersize=16, markeredgewidth=3.0, capsize=4, linewidth=1.4, zorder=3)
        axes.plot(position, fitted, marker=MARKERS[i % len(MARKERS)], color=colour, markersize=7,
                  markerfacecolor="white", markeredgewidth=1.6, zorder=4)
        axes.annotate(number(fitted - k, "{:+.2f}"), (position, max(k, fitted)), xytext=(0, 9), ha="center",
                      fontsize=8, textcoords="offset points")
    axes.plot([], [], label="measured, ± 2 standard deviations", **solid)
    axes.plot([], [], marker="o", markerfacecolor="white", label=f"fitted model; number: its difference ({unit})",
              **dashed)
    axes.set_ylim(0.0, 1.2 * max(*measured, *model))
    axes.margins(x=0.1)
    axes.legend(loc="upper right" if measured[-1] < measured[0] else "upper left")
    synthetic = " (SYNTHETIC)" if bench["synthetic"] else ""
    label(axes, x="fulcrum from the keel's posterior end (mm)", y=y,
          title=f"Forefoot{synthetic}, RMS difference {rmse:.2f} {unit}")


def _heel(axes: Any, measured: float | None, model: float | None, uncertainty: float) -> None:
    axes.set_xticks([])
    if measured is None or model is None:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center")
        return
    axes.errorbar(-0.35, measured, yerr=2.0 * uncertainty, color="0.6", marker="_", markersize=22,
                  markeredgewidth=3.0, capsize=4)
    axes.plot(0.35, model, marker="*", color=HEEL_COLOUR, markersize=11, markerfacecolor="white", markeredgewidth=1.4)
    axes.annotate(number(model - measured, "{:+.2f}"), (0.35, model), xytext=(0, 10), textcoords="offset points",
                  ha="center", fontsize=8)
    axes.set_xlim(-1.0, 1.0)
    axes.set_ylim(0.0, 1.25 * max(measured, model))


def fit_error_figure(table: Mapping[str, Any]) -> Figure:
    """Errors by trial beside the null model, the floor and what the paper was left with: one panel an error, one row a
    trial; `table` is that of a fit that was judged."""
    trials, published = [trial for trial in table["trials"] if trial["metrics"] is not None], table["published"]
    looks: dict[str, tuple[str, dict[str, Any]]] = {
        "null_model_grf_rmse_bw": ("null model: another trial's curve", {
            "marker": "D", "color": NEUTRAL, "markersize": 5.5, "markerfacecolor": "white"}),
        "floor_grf_rmse_bw": ("floor: the true foot on this motion", {
            "marker": "|", "color": "black", "markersize": 12, "markeredgewidth": 1.8})}
    with drawing(11.0, max(2.6, 1.7 + 0.27 * len(trials))) as figure:
        panels = figure.subplots(1, 3, sharey=True, width_ratios=(1.5, 1.0, 1.0))
        for axes, (key, x, title) in zip(panels, _ERRORS, strict=True):
            if key == "grf_rmse_bw":
                axes.axvline(100.0 * published["fitted_grf_rmse_bw"], color=NEUTRAL, linewidth=1.0, linestyle=":",
                             zorder=0)
            band = {"grf_rmse_bw": published["other_grf_rmse_bw"], "cop_rmse_fl": published["cop_rmse_fl"]}.get(key)
            if band is not None:  # of the fore-aft force the paper says nothing
                axes.axvspan(100.0 * band[0], 100.0 * band[1], color=_PUBLISHED, linewidth=0.0, zorder=0)
            for row, trial in enumerate(trials):
                value, colour = trial["metrics"][key], condition_colour(1e-3 * trial["fulcrum_mm"])
                for beside, (_, look) in looks.items() if key == "grf_rmse_bw" else ():
                    if trial[beside] is not None:
                        axes.plot(100.0 * trial[beside], row, **look)
                if value is not None:
                    axes.plot([0.0, 100.0 * value], [row, row], color=colour, linewidth=1.2, alpha=0.6)
                    axes.plot(100.0 * value, row, marker="o", color=colour, markersize=7, markeredgewidth=1.8,
                              markerfacecolor=colour if trial["role"] == "fitted" else "white")
            axes.set_xlim(left=0.0)
            axes.margins(x=0.08)
            axes.xaxis.set_major_locator(MaxNLocator(5))
            label(axes, x=x, y="", title=title)
        panels[0].set_yticks(range(len(trials)), [f"{t['label']}, {t['role']}, {t['fulcrum_mm']:g} mm" for t in trials])
        panels[0].set_ylim(len(trials) - 0.4, -0.6)
        panels[0].set_ylabel("trial (one row each)")
        handles: list[Artist] = [_dot("fitted trial", color=NEUTRAL, markersize=7)]
        if any(trial["role"] != "fitted" for trial in trials):
            handles.append(_dot("held-out trial", color=NEUTRAL, markersize=7, markerfacecolor="white",
                                markeredgewidth=1.8))
        handles += [_dot(name, **look) for key, (name, look) in looks.items()
                    if any(trial[key] is not None for trial in trials)]
        handles += [Line2D([], [], color=NEUTRAL, linestyle=":", linewidth=1.0, label="paper, fitted trial"),
                    Patch(facecolor=_PUBLISHED, label="paper, force: other trials; centre of pressure: all")]
        _finish(figure, handles, 3, trials)
    return figure


def fit_correlation_figure(table: Mapping[str, Any]) -> Figure:
    """Correlations of the errors; coefficients of smooth curves are left out unless there is nothing else."""
    names, matrix = table["correlations"]["names"], np.array(table["correlations"]["matrix"], dtype=float)
    rows = [i for i, name in enumerate(names) if not is_smooth(name)]
    rows = (rows if len(rows) > 1 else [*range(len(names))])[:MOST_NAMES]
    shown, matrix = [names[i] for i in rows], matrix[np.ix_(rows, rows)]
    size = 2.9 + 0.29 * len(rows)
    with drawing(size + 0.8, size) as figure:
        axes = figure.subplots()
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axes.set_xticks(range(len(rows)), shown, rotation=90, fontsize=7.5)
        axes.set_yticks(range(len(rows)), shown, fontsize=7.5)
        axes.grid(False)
        for i, j in zip(*np.nonzero(np.abs(matrix) >= TOLD), strict=True):
            if i != j:
                axes.text(j, i, f"{100 * matrix[i, j]:+.0f}", ha="center", va="center", fontsize=6.5,
                          color="white" if abs(matrix[i, j]) > 0.7 else "black")
        bar = figure.colorbar(image, ax=axes, shrink=0.5, pad=0.02)
        bar.set_label("correlation (1); in the cells in percent")
        label(axes, x="parameter (one column each)", y="parameter (one row each)", title="Correlation of errors")
    return figure


def fit_singular_figure(table: Mapping[str, Any]) -> Figure:
    """Singular values of the data's Jacobian by the parameters in prior standard deviations."""
    values = np.array(table["singular_values"], dtype=float)
    numbers, known, shown = np.arange(1, len(values) + 1), values >= 1.0, np.maximum(values, 1e-3)
    with drawing(7.6, 3.4) as figure:
        axes = figure.subplots()
        axes.axhline(1.0, color=NEUTRAL, linewidth=1.2, linestyle="--")
        axes.vlines(numbers, 1.0, shown, color="0.75", linewidth=1.0)
        axes.plot(numbers[known], shown[known], linestyle="", marker="o", color=_GOOD,
                  label=f"told by the data more than by the prior ({known.sum()})")
        axes.plot(numbers[~known], shown[~known], linestyle="", marker="o", color=NEUTRAL, markerfacecolor="white",
                  label=f"told less ({(~known).sum()})")
        _decades(axes)
        axes.set_ylim(bottom=0.7e-3 if shown.min() <= 1e-3 else None)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="upper right")
        label(axes, x="direction (number)", y="data over prior (1)",
              title="Singular values" + (", below 0.001 drawn at 0.001" if values.min() < 1e-3 else ""))
    return figure


def fit_parameter_figure(table: Mapping[str, Any]) -> Figure:
    """Value and 95 % interval of each free parameter in standard deviations of what was believed of it before; `table`
    is that of a joint fit that succeeded."""
    free = [row for row in table["parameters"] if row["value_in_prior_sd"] is not None]
    smooth = [row for row in free if is_smooth(row["name"])]
    largest = sorted(smooth, key=lambda row: -abs(row["value_in_prior_sd"]))[:MOST_ROWS]
    of = f", the {MOST_ROWS} largest of {len(smooth)}" if len(smooth) > MOST_ROWS else ""
    columns = [(rows, title) for rows, title in (
        ([row for row in free if row not in smooth], "Contact, geometry and the rest"),
        (sorted(largest, key=lambda row: row["name"]), f"Smooth errors of the motion{of}")) if rows]
    share = table["unidentified_above_share"]
    with drawing(5.6 * len(columns), max(3.2, 1.5 + 0.19 * max(len(rows) for rows, _ in columns))) as figure:
        for axes, (rows, title) in zip(figure.subplots(1, len(columns), squeeze=False)[0], columns, strict=True):
            _parameters(axes, rows, share)
            label(axes, x="from the prior's mean (its standard deviations)", y="parameter (one row each)", title=title)
        handles: list[Artist] = [
            Patch(facecolor=_PRIOR[1][1], label="prior, ± 1 standard deviation (lighter: ± 2)"),
            Line2D([], [], color=_GOOD, marker="o", label="fitted value and 95 % interval"),
            Line2D([], [], color=NEUTRAL, marker="o", markerfacecolor="white",
                   label=f"not identified: error above {share:g} of the prior's")]
        if any(row["at_bound"] for row in free):
            handles.append(Line2D([], [], color=_BAD, marker="s", label="at a bound"))
        _finish(figure, handles, 2)
    return figure


def _parameters(axes: Any, rows: Sequence[Mapping[str, Any]], share: float) -> None:
    for width, shade in _PRIOR:
        axes.axvspan(-width, width, color=shade, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color="0.7", linewidth=0.8)
    ends = [abs(end) for row in rows for end in (*row["interval_in_prior_sd"], row["value_in_prior_sd"])]
    reach = max(2.4, min(_WIDEST, 1.08 * max(ends)))
    for y, row in enumerate(rows):
        known = row["share_of_prior"] is not None and row["share_of_prior"] <= share
        colour, value = _BAD if row["at_bound"] else _GOOD if known else NEUTRAL, row["value_in_prior_sd"]
        axes.plot(row["interval_in_prior_sd"], [y, y], color=colour, linewidth=1.6)
        axes.plot(value, y, marker="s" if row["at_bound"] else "o", color=colour, markersize=5,
                  markerfacecolor=colour if known or row["at_bound"] else "white")
        if abs(value) > reach:
            axes.annotate(f"{value:+.1f}", (np.copysign(reach, value), y), color=_BAD, fontsize=7.5, va="center",
                          ha="right" if value > 0 else "left")
    axes.set_xlim(-reach, reach)
    axes.set_yticks(range(len(rows)), [row["name"] for row in rows], fontsize=7.5)
    axes.set_ylim(len(rows) - 0.4, -0.6)


def fit_search_figure(table: Mapping[str, Any]) -> Figure:
    """The cost of each search, or the paper's error over its iterations; of the table of a fit that failed, too, in
    which either `searches` or `history` is not empty."""
    with drawing(7.6, 3.4) as figure:
        axes = figure.subplots()
        if table["searches"]:
            _searches(axes, table)
        else:
            rows = [{"iteration": 0, "rms_n": table["initial_rms_n"]}, *table["history"]]
            axes.plot([row["iteration"] for row in rows], [row["rms_n"] for row in rows], color=_GOOD, marker="o",
                      markersize=4.0, linewidth=1.4)
            axes.set_ylim(bottom=0.0)
            label(axes, x="iteration (0: initial guess)", y="best RMS difference\nof the resultant (N)",
                  title="The paper's search")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    return figure


def _searches(axes: Any, table: Mapping[str, Any]) -> None:
    searches = table["searches"]
    for i, s in enumerate(searches, start=1):
        if s["cost"] is None:
            axes.plot(i, 0.04, marker="x", color=_BAD, markersize=9, markeredgewidth=2.2,
                      transform=axes.get_xaxis_transform())
            continue
        axes.plot([i, i], [s["start_cost"], s["cost"]], color=NEUTRAL, linewidth=1.0, zorder=1)
        axes.plot(i, s["start_cost"], marker="o", color=NEUTRAL, markerfacecolor="white", markersize=7)
        best = i - 1 == table["best_search"]
        axes.plot(i, s["cost"], marker=("*" if best else "o") if s["success"] else "x",
                  color=_GOOD if s["success"] else _BAD, markersize=13 if best else 8, markeredgewidth=1.8)
        axes.annotate(f"{s['cost']:.1f}", (i, s["cost"]), xytext=(9, 0), textcoords="offset points", va="center",
                      fontsize=8)
    if any(s["cost"] is not None for s in searches):
        _decades(axes)
    axes.set_xlim(0.5, len(searches) + 0.7)
    axes.margins(y=0.15)
    handles = [_dot("start", color=NEUTRAL, markerfacecolor="white"), _dot("end", color=_GOOD),
               _dot("end, taken", "*", color=_GOOD, markersize=12)]
    if not all(s["success"] for s in searches):
        handles.append(_dot("end, not converged", "x", color=_BAD, markeredgewidth=1.8))
    _finish(axes.figure, handles, 4)
    label(axes, x="search (number)", y="cost (half the sum of squares, 1)", title="Searches from different starts")


def fit_trial_figure(trial: Mapping[str, Any], curves: Mapping[str, np.ndarray]) -> Figure:
    """Of one trial, measured and of the fitted model: resultant and fore-aft force over time, and the centre of
    pressure over the first stance.

    Args:
        trial: a row of the fit's table, with its metrics.
        curves: time_s (n,), measured_bw and model_bw (n, 3), cop_measured_fl and cop_model_fl (101,).
    """
    def off(key: str, unit: str) -> str:
        return "" if metrics[key] is None else f": {100.0 * metrics[key]:.1f} % {unit} off"

    metrics, colour, time = trial["metrics"], condition_colour(1e-3 * trial["fulcrum_mm"]), curves["time_s"]
    both = [curves["measured_bw"], curves["model_bw"]]
    forces = (("Resultant", "", [np.linalg.norm(force, axis=1) for force in both], "grf_rmse_bw"),
              ("Fore-aft", "forward ", [force[:, 0] for force in both], "fore_aft_rmse_bw"))
    looks: list[dict[str, Any]] = [{"color": colour, **MEASURED}, {"color": colour, **SIMULATED}]
    with drawing(11.0, 3.1) as figure:
        panels = figure.subplots(1, 3)
        windows = metrics["scored_window_s"] or [[float(time[0]), float(time[-1])]]
        for axes, (name, forward, pair, key) in zip(panels, forces, strict=False):
            axes.axhline(0.0, color="0.7", linewidth=0.8)
            for force, look in zip(pair, looks, strict=True):
                axes.plot(time, force, **look)
            axes.set_xlim(windows[0][0], windows[-1][1])
            label(axes, x="time (s)", y=f"{forward}force (body weights)", title=f"{name}{off(key, 'BW')}")
        axes, centres = panels[-1], [curves["cop_measured_fl"], curves["cop_model_fl"]]
        if np.isfinite(centres).all(axis=0).any():
            for centre, look in zip(centres, looks, strict=True):
                axes.plot(np.linspace(0.0, 100.0, len(centre)), 100.0 * (centre - np.nanmin(centres[0])), **look)
        else:
            axes.text(0.5, 0.5, "no centre of pressure\nin common", transform=axes.transAxes, ha="center", va="center",
                      color=NEUTRAL)
        axes.set_xlim(0.0, 100.0)
        label(axes, x="stance (%)", y="ahead of its rearmost (% FL)",
              title=f"Centre of pressure{off('cop_rmse_fl', 'FL')}")
        names = ("reference (synthetic)" if trial["synthetic"] else "force plate",
                 "fitted model (off: root mean square; FL: foot length)")
        _finish(figure, [Line2D([], [], label=name, **look) for name, look in zip(names, looks, strict=True)], 2)
        kind = ", SYNTHETIC" if trial["synthetic"] else ""
        figure.suptitle(f"{trial['label']}: {trial['role']}, fulcrum {trial['fulcrum_mm']:g} mm{kind}", x=0.01,
                        ha="left", fontsize=11)
        figure.set_layout_engine("constrained", w_pad=0.08)
    figure.set_layout_engine("none")  # there are many of these, and to lay them out takes as long as to draw them
    return figure


def fit_sweep_figure(table: Mapping[str, Any]) -> Figure:
    """The error of every trial over the fulcrum's position, one panel a true position; `table` is that of a fit with
    sweeps."""
    swept = [trial for trial in table["trials"] if trial["sweep"] is not None]
    settings = sorted({trial["fulcrum_mm"] for trial in swept})
    across = min(_ACROSS, len(settings))
    down = -(-len(settings) // across)
    with drawing(11.0 if across > 1 else 6.5, 0.5 + 3.3 * down) as figure:
        panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, setting in zip(panels, settings, strict=False):
            axes.axvline(setting, color=NEUTRAL, linewidth=6.0, alpha=0.35, zorder=0)
            own = [trial for trial in swept if trial["fulcrum_mm"] == setting]
            for i, trial in enumerate(own):
                _sweep(axes, trial, condition_colour(1e-3 * setting), MARKERS[i % len(MARKERS)])
            axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
            label(axes, x="fulcrum from the keel's end (mm)", y="resultant, RMS error (% BW)",
                  title=f"Trials at {setting:g} mm")
        _decades(panels[0])
        panels[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        for axes in panels[len(settings):]:
            axes.set_axis_off()
        handles = [Line2D([], [], color=NEUTRAL, linewidth=6.0, alpha=0.35, label="where it stood"),
                   _dot("least error", "*", color="white", markersize=12, markeredgecolor="black", markeredgewidth=1.3),
                   *(Line2D([], [], color="black", marker="o", markersize=4.5, label=f"{role} trial",
                            markerfacecolor="black" if role == "fitted" else "white")
                     for role in dict.fromkeys(trial["role"] for trial in swept))]
        if any(None in trial["sweep"]["grf_rmse_bw"] for trial in swept):
            handles.append(_dot("the walk failed", "x", color="black"))
        _finish(figure, handles, len(handles), swept)
    return figure


def _sweep(axes: Any, trial: Mapping[str, Any], colour: Any, marker: str) -> None:
    sweep = trial["sweep"]
    positions = np.array(sweep["fulcrum_mm"])
    errors = 100.0 * np.array(sweep["grf_rmse_bw"], dtype=float)  # None is NaN
    verdict = "not known" if sweep["right"] is None else "right" if sweep["right"] else "WRONG"
    axes.plot(positions, errors, color=colour, linewidth=1.2, marker=marker, markersize=4.5, markevery=2,
              markerfacecolor=colour if trial["role"] == "fitted" else "white", label=f" {trial['label']}: {verdict}")
    known = np.isfinite(errors)
    if sweep["best_mm"] is not None and known.any():
        axes.plot(sweep["best_mm"], errors[known].min(), marker="*", markersize=12, color="white",
                  markeredgecolor=colour, markeredgewidth=1.3, zorder=5)
    for position in positions[~known]:
        axes.plot(position, 0.02, marker="x", color=colour, transform=axes.get_xaxis_transform(), clip_on=False)
