"""All figures of a contact fit, made from its table alone."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from vsf_drake.report.page import number
from vsf_drake.report.style import (
    FULCRUM,
    MARKERS,
    MEASURED,
    NEUTRAL,
    PANEL,
    SIMULATED,
    colour_of,
    drawing,
    label,
    legend_below,
    log_scale,
    say_synthetic,
    tag,
)
from vsf_drake.walks.fulcrum_sweep import FulcrumSweep
from vsf_drake.walks.quantities import FLOOR, JUDGED, quantity

if TYPE_CHECKING:  # these import Drake, which takes longer than to draw
    from vsf_drake.fit.assessment import BenchRow, Beside, TrialScore
    from vsf_drake.fit.paper import PaperState
    from vsf_drake.fit.solution import ParameterRow
    from vsf_drake.fit.table import FitTable, FitTrialRow

LONGEST = 60
"""Letters of a trial's label in a file name."""
MOST_ROWS = 45
"""Smooth errors, of more of which the largest are shown."""
_FITTED = "fitted"
_GOOD = "#1f6f8b"
_BAD = "#b3261e"
_PRIOR = ((2.0, "0.95"), (1.0, "0.87"))
_WIDEST = 4.5
_STAR: dict[str, Any] = {"marker": "*", "markersize": 12, "color": "white"}
_FIT: dict[str, Any] = {"marker": "o", "markersize": 7, "markeredgewidth": 1.8}


def fit_figures(table: FitTable) -> dict[str, Figure]:
    """The figures by the name of their files, without those for which this fit has nothing."""
    figures: dict[str, Figure] = {}
    if any(trial.score for trial in table.trials):
        figures["errors"] = fit_error_figure(table)
    swept = [
        (trial.label, trial.fulcrum_mm, trial.score.sweep)
        for trial in table.trials
        if trial.score is not None
        and trial.score.sweep is not None
        and trial.fulcrum_mm is not None
    ]
    if swept:
        synthetic = any(trial.synthetic for trial in table.trials)
        figures["sweep"] = fit_sweep_figure(swept, synthetic=synthetic)
    for i, trial in enumerate(table.trials):
        if trial.score is not None:
            figures[trial_name(i, trial)] = fit_trial_figure(trial, trial.score)
    if (
        table.bench is not None
        and table.bench.stiffness is not None
        and None not in table.bench.fulcrum_mm
    ):
        figures["bench"] = fit_bench_figure(table.bench)
    if table.uncertainty is not None:
        figures["parameters"] = fit_parameter_figure(
            table.parameters, table.uncertainty.unidentified
        )
    if table.paper is not None and table.paper.history:
        figures["searches"] = paper_search_figure(table.paper)
    return figures


def trial_name(number: int, trial: FitTrialRow) -> str:
    """Name of the figure of a trial, the `number`-th of its table, as a file can have it."""
    return f"trial_{number + 1}_{re.sub(r'[^0-9A-Za-z._-]', '_', trial.label)[:LONGEST]}"


def is_smooth(name: str) -> bool:
    """Whether a parameter is a coefficient of a smooth curve or path."""
    return name.startswith("curve.") or (name.startswith("trial.") and ".path." in name)


def _line(name: str, **look: Any) -> Line2D:
    """A line in a legend."""
    return Line2D([], [], label=name, **look)


def _dot(name: str, **look: Any) -> Line2D:
    """A marker alone in a legend."""
    return _line(name, linestyle="", **{"marker": "o"} | look)


def fit_bench_figure(bench: BenchRow) -> Figure:
    """The fitted foot's forefoot in the testing machine beside the measurement: stiffness, and
    mid-range displacement where it was measured, over the fulcrum's position."""
    rows = [
        (name, unit, quantity)
        for name, unit, quantity in (
            ("stiffness", "N/mm", bench.stiffness),
            ("mid-range displacement", "mm", bench.mid_range),
        )
        if quantity
    ]
    synthetic = " (SYNTHETIC)" if bench.synthetic else ""
    with drawing(PANEL[0], 0.6 + 2.6 * len(rows)) as figure:
        for axes, (name, unit, quantity) in zip(
            figure.subplots(len(rows), squeeze=False)[:, 0], rows, strict=True
        ):
            places = [mm for mm in bench.fulcrum_mm if mm is not None]
            handles = _bench(axes, places, quantity)
            label(
                axes,
                x=FULCRUM,
                y=f"{name} ({unit})",
                title=f"Forefoot{synthetic}, RMS difference {quantity.rmse:.2f} {unit}",
            )
        legend_below(figure, handles)
    return figure


def _bench(axes: Axes, x: Sequence[float], quantity: Beside) -> list[Artist]:
    measured = quantity.measured
    model = quantity.model
    solid: dict[str, Any] = {"color": "0.6", "linewidth": 2.4}
    dashed: dict[str, Any] = {"color": "0.2", "linewidth": 1.4, "linestyle": (0, (4, 1.6))}
    axes.plot(x, measured, zorder=1, **solid)
    axes.plot(x, model, zorder=2, **dashed)
    for i, (position, k, fitted) in enumerate(zip(x, measured, model, strict=True)):
        colour = colour_of(position)
        axes.errorbar(
            position,
            k,
            yerr=2.0 * quantity.uncertainty,
            color=colour,
            marker="_",
            markersize=16,
            markeredgewidth=3.0,
            capsize=4,
            linewidth=1.4,
            zorder=3,
        )
        axes.plot(
            position,
            fitted,
            marker=MARKERS[i % len(MARKERS)],
            color=colour,
            markersize=7,
            markerfacecolor="white",
            markeredgewidth=1.6,
            zorder=4,
        )
        axes.annotate(
            number(fitted - k, "{:+.2f}"),
            (position, max(k, fitted)),
            xytext=(0, 9),
            ha="center",
            fontsize=8,
            textcoords="offset points",
        )
    axes.set_ylim(0.0, 1.2 * max(*measured, *model))
    axes.margins(x=0.1)
    return [
        _line("measured, ± 2 standard deviations", **solid),
        _line("fitted, with its difference", marker="o", markerfacecolor="white", **dashed),
    ]


def fit_error_figure(table: FitTable) -> Figure:
    """The resultant's error by trial beside the null model and the floor: one row a trial that was
    judged."""
    rows = [(trial, trial.score) for trial in table.trials if trial.score is not None]
    beside: list[tuple[str, list[float | None], dict[str, Any]]] = [
        (
            "null model: other trials' curves",
            [score.null_bw for _, score in rows],
            {"marker": "D", "color": NEUTRAL, "markersize": 5.5, "markerfacecolor": "white"},
        ),
        (
            "floor: the true foot on this motion",
            [score.number(FLOOR) for _, score in rows],
            {"marker": "|", "color": "black", "markersize": 12, "markeredgewidth": 1.8},
        ),
    ]
    names = [textwrap.fill(t.label, 22) + f"\n{t.role}, {t.setting_short}" for t, _ in rows]
    with drawing(
        PANEL[0], 1.9 + len(rows) * (0.1 + 0.14 * max(name.count("\n") + 1 for name in names))
    ) as figure:
        axes = figure.subplots()
        for _, values, look in beside:
            for y, value in enumerate(values):
                if value is not None:
                    axes.plot(100.0 * value, y, **look)
        for y, (trial, score) in enumerate(rows):
            if (error := score.error_bw) is not None:
                colour = colour_of(trial)
                axes.plot([0.0, 100.0 * error], [y, y], color=colour, linewidth=1.2, alpha=0.6)
                inside = colour if trial.role == _FITTED else "white"
                axes.plot(100.0 * error, y, color=colour, markerfacecolor=inside, **_FIT)
        axes.set_xlim(left=0.0)
        axes.margins(x=0.08)
        axes.set_yticks(range(len(rows)), names)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        beaten = any(null is not None for null in beside[0][1])
        label(
            axes,
            x="RMS error (% body weight)",
            y="trial\n(one row each)",
            title=(
                "Resultant force"
                + ": left of its\ndiamond nearer to the plate\nthan the null model" * beaten
            ),
        )
        handles: list[Artist] = [_dot("fitted trial", color=NEUTRAL, **_FIT)]
        if any(trial.role != _FITTED for trial, _ in rows):
            handles.append(_dot("held-out trial", color=NEUTRAL, markerfacecolor="white", **_FIT))
        handles += [
            _dot(name, **look)
            for name, values, look in beside
            if any(v is not None for v in values)
        ]
        legend_below(figure, handles)
        say_synthetic(figure, any(trial.synthetic for trial, _ in rows), "trials")
    return figure


def fit_parameter_figure(
    parameters: Sequence[ParameterRow], unidentified: Collection[str]
) -> Figure:
    """Value and 95 % interval of each free parameter in standard deviations of what was believed of
    it before; hollow where it is not identified."""
    free = [(row, value) for row in parameters if (value := row.value_in_prior_sd) is not None]
    smooth = [pair for pair in free if is_smooth(pair[0].name)]
    largest = sorted(smooth, key=lambda pair: -abs(pair[1]))[:MOST_ROWS]
    of = f",\nthe {MOST_ROWS} largest of {len(smooth)}" if len(smooth) > MOST_ROWS else ""
    columns = [
        (rows, title)
        for rows, title in (
            ([pair for pair in free if pair not in smooth], "Contact, geometry\nand the rest"),
            (sorted(largest, key=lambda pair: pair[0].name), f"Smooth errors\nof the motion{of}"),
        )
        if rows
    ]
    counts = [3 + len(rows) for rows, _ in columns]
    with drawing(PANEL[0], max(3.2, 2.3 + 0.19 * sum(counts))) as figure:
        panels = figure.subplots(len(columns), squeeze=False, height_ratios=counts)[:, 0]
        for axes, (rows, title) in zip(panels, columns, strict=True):
            _parameters(axes, rows, unidentified)
            label(
                axes,
                x="from the prior's mean\n(its standard deviations)",
                y="parameter\n(one row each)",
                title=title,
            )
        handles: list[Artist] = [
            Patch(facecolor=_PRIOR[1][1], label="prior, ± 1 SD (lighter: ± 2)"),
            _line("fitted value and 95 % interval", color=_GOOD, marker="o"),
            _line(
                "not identified: mostly prior", color=NEUTRAL, marker="o", markerfacecolor="white"
            ),
        ]
        if any(row.at_bound for row, _ in free):
            handles.append(_line("at a bound", color=_BAD, marker="s"))
        legend_below(figure, handles)
    return figure


def _parameters(
    axes: Axes, rows: Sequence[tuple[ParameterRow, float]], unidentified: Collection[str]
) -> None:
    for width, shade in _PRIOR:
        axes.axvspan(-width, width, color=shade, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color="0.7", linewidth=0.8)
    ends = [abs(end) for row, value in rows for end in (*(row.interval_in_prior_sd or ()), value)]
    reach = max(2.4, min(_WIDEST, 1.08 * max(ends)))
    for y, (row, value) in enumerate(rows):
        known = row.name not in unidentified
        colour = _BAD if row.at_bound else _GOOD if known else NEUTRAL
        axes.plot(row.interval_in_prior_sd or (), [y, y], color=colour, linewidth=1.6)
        axes.plot(
            value,
            y,
            marker="s" if row.at_bound else "o",
            color=colour,
            markersize=5,
            markerfacecolor=colour if known or row.at_bound else "white",
        )
        if abs(value) > reach:
            axes.annotate(
                f"{value:+.1f}",
                (np.copysign(reach, value), y),
                color=_BAD,
                fontsize=7.5,
                va="center",
                ha="right" if value > 0 else "left",
            )
    axes.set_xlim(-reach, reach)
    axes.set_yticks(range(len(rows)), [row.name for row, _ in rows], fontsize=7.5)
    axes.set_ylim(len(rows) - 0.4, -0.6)


def paper_search_figure(state: PaperState) -> Figure:
    """The paper's error over its iterations."""
    objectives = (state.initial_objective_n2, *(objective for _, objective, _ in state.history))
    with drawing(PANEL[0], 2.6) as figure:
        axes = figure.subplots()
        axes.plot(
            [0, *(number for number, *_ in state.history)],
            [*map(state.rms_n, objectives)],
            color=_GOOD,
            marker="o",
            markersize=4.0,
            linewidth=1.4,
        )
        axes.set_ylim(bottom=0.0)
        label(
            axes,
            x="iteration (0: initial guess)",
            y="best RMS difference\nof the resultant (N)",
            title="The paper's search",
        )
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    return figure


def fit_trial_figure(trial: FitTrialRow, score: TrialScore) -> Figure:
    """Of one trial, measured and of the fitted model: resultant and fore-aft force over time, and
    the centre of pressure over the first stance."""

    def off(error: float | None, unit: str) -> str:
        return "" if error is None else f": {quantity(JUDGED).told(error)} {unit} off"

    metrics = score.metrics
    curves = score.curves
    colour = colour_of(trial)
    both = [curves.measured_bw, curves.model_bw]
    forces = (
        ("Resultant", "", [np.linalg.norm(force, axis=1) for force in both], metrics.error_bw),
        ("Fore-aft", "forward ", [force[:, 0] for force in both], metrics.fore_aft_rmse_bw),
    )
    looks: list[dict[str, Any]] = [{"color": colour, **MEASURED}, {"color": colour, **SIMULATED}]
    with drawing(PANEL[0], 6.4) as figure:
        panels = figure.subplots(3)
        windows = metrics.scored_window_s or ((curves.time_s[0], curves.time_s[-1]),)
        for axes, (name, forward, pair, error) in zip(panels, forces, strict=False):
            axes.axhline(0.0, color="0.7", linewidth=0.8)
            for force, look in zip(pair, looks, strict=True):
                axes.plot(curves.time_s, force, **look)
            axes.set_xlim(windows[0][0], windows[-1][1])
            label(
                axes,
                x="time (s)",
                y=f"{forward}force\n(body weights)",
                title=f"{name}{off(error, 'BW')}",
            )
        axes = panels[-1]
        centres = [curves.cop_measured_fl, curves.cop_model_fl]
        if np.isfinite(centres).all(axis=0).any():
            for centre, look in zip(centres, looks, strict=True):
                axes.plot(
                    np.linspace(0.0, 100.0, len(centre)),
                    100.0 * (centre - np.nanmin(centres[0])),
                    **look,
                )
        else:
            axes.text(
                0.5,
                0.5,
                "no centre of pressure\nin common",
                transform=axes.transAxes,
                ha="center",
                va="center",
                color=NEUTRAL,
            )
        axes.set_xlim(0.0, 100.0)
        label(
            axes,
            x="stance (%)",
            y="ahead of its\nrearmost (% FL)",
            title=f"Centre of pressure{off(metrics.cop_rmse_fl, 'FL')}",
        )
        names = (
            "reference (synthetic)" if trial.synthetic else "force plate",
            "fitted model (off: root mean square)",
        )
        legend_below(
            figure,
            [_line(name, **look) for name, look in zip(names, looks, strict=True)],
        )
        title = (
            f"{trial.label}: {trial.role}, {trial.setting_words}{', SYNTHETIC' * trial.synthetic}"
        )
        figure.suptitle(textwrap.fill(title, 54), x=0.01, ha="left", fontsize=10)
    return figure


TrialSweep = tuple[str, float, FulcrumSweep]
"""A trial's label, where its fulcrum stood (mm from the keel's posterior end), its errors there and
elsewhere."""


def fit_sweep_figure(trials: Sequence[TrialSweep], *, synthetic: bool) -> Figure:
    """The error of every trial over the fulcrum's position; where the least one is not where it
    stood is named."""
    with drawing(*PANEL) as figure:
        axes = figure.subplots()
        for setting in sorted({fulcrum_mm for _, fulcrum_mm, _ in trials}):
            axes.axvline(setting, color=colour_of(setting), linewidth=6.0, alpha=0.3, zorder=0)
            axes.text(
                setting,
                1.01,
                f"{setting:g} mm",
                color=colour_of(setting),
                fontweight="bold",
                ha="center",
                transform=axes.get_xaxis_transform(),
            )
        for trial in trials:
            _sweep(axes, *trial)
        log_scale(axes.yaxis)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        handles: list[Artist] = [
            _line("where it stood", color=NEUTRAL, linewidth=6.0, alpha=0.3),
            _dot("least error of a trial", markeredgecolor="black", **_STAR),
        ]
        if any(np.isnan(sweep.errors_bw).any() for _, _, sweep in trials):
            handles.append(_dot("the walk failed", marker="x", color="black"))
        label(axes, x=FULCRUM, y="resultant, RMS error (% BW)")
        legend_below(figure, handles)
        say_synthetic(figure, synthetic, "trials")
    return figure


def _sweep(axes: Axes, name: str, fulcrum_mm: float, sweep: FulcrumSweep) -> None:
    colour = colour_of(fulcrum_mm)
    positions = np.array(sweep.fulcrum_mm)
    errors = 100.0 * sweep.errors_bw
    axes.plot(positions, errors, color=colour, linewidth=1.2)
    known = np.isfinite(errors)
    if sweep.best_mm is not None and known.any():
        least = float(errors[known].min())
        axes.plot(sweep.best_mm, least, markeredgecolor=colour, zorder=5, **_STAR)
        if sweep.right is False:
            tag(
                axes,
                f"{name}: WRONG",
                (sweep.best_mm, least),
                colour,
                offset=(0, -11),
                ha="center",
            )
    for position in positions[~known]:
        axes.plot(
            position,
            0.02,
            marker="x",
            color=colour,
            transform=axes.get_xaxis_transform(),
            clip_on=False,
        )
