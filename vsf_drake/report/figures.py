"""A bench, a walk, standing and a sweep in one figure each; functions of saved results."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.typing import ColorType

from vsf_drake.device.bench_metrics import (
    BenchTable,
    closed_form_stiffness,
    displacement,
)
from vsf_drake.model.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.model.setting import AtSetting
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trial import NO_PLATE, UNUSABLE_RECORDING
from vsf_drake.report.layer_curves import RESULTANT, component_of, draw_layers, layer_handles
from vsf_drake.report.style import (
    ASIDE_S,
    FULCRUM,
    HEEL_COLOUR,
    LINES,
    MARKERS,
    MEASURED,
    NEUTRAL,
    SHADE,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    label,
    log_scale,
    tag,
)
from vsf_drake.simulation.options import STARTS_LOADED
from vsf_drake.simulation.results import (
    LARGEST_DRIFT_M,
    NUDGE_M,
    BenchResult,
    StandingTable,
    WalkResult,
)
from vsf_drake.walks.comparison import PERCENT, Comparison, compare
from vsf_drake.walks.metrics import UNFITTED, Agreement
from vsf_drake.walks.quantities import JUDGED, quantity

if TYPE_CHECKING:  # it would bring Drake
    from vsf_drake.walks.sweep_table import SweepRow, SweepTable

# inches, and letters on a line of the title
WIDTH = 5.4
TITLE_WIDTH = 60
# stances that the legend tells apart; a longer recording shows its footprints without one
MOST_LABELLED = 4
PROSTHETIC, INTACT, BOTH = colour_of(66.0), colour_of(151.0), "0.1"
LIMIT_MM = 1e3 * LARGEST_DRIFT_M  # where standing still ends, marked in the figure
_PANELS = (
    (JUDGED, "RMS error (% body weight)", "Resultant force"),
    (
        "cop_rmse_fl",
        "RMS error (% length of the model's foot)",
        "Centre of pressure (dashed: lateral)",
    ),
    ("peak_vertical_bw", "vertical force (body weights)", "Peak of the model"),
)
_WIDE = 20.0  # ratio of largest to smallest value above which the axis is logarithmic


def bench_figure(bench: BenchResult, table: BenchTable) -> Figure:
    """Load against displacement at every setting, and, unless the foot is passive, stiffness
    against fulcrum position.

    After Figure 4 of McGeehan 2021 (doi 10.1115/1.4050456), with the published end points beside
    it.
    """
    places_mm = [row.fulcrum_mm for row in table.settings if row.fulcrum_mm is not None]
    panels = 1 if len(places_mm) < len(table.settings) else 2
    with drawing(WIDTH, 3.3 * panels) as figure:
        above, *below = figure.subplots(panels, squeeze=False)[:, 0]
        _bench_curves(above, bench, table)
        for axes in below:
            _bench_stiffness(axes, bench, table, places_mm)
        state = "" if bench.converged else f", {table.unconverged_steps} STEPS NOT CONVERGED"
        _head(
            figure,
            f"Testing machine, {table.speed_mm_per_min:g} mm/min, up to {bench.max_load_n:g} "
            f"N{state}",
        )
    return figure


def _bench_curves(axes: Axes, bench: BenchResult, table: BenchTable) -> None:
    rows = table.settings
    passes = [
        (setting, row, row.published_n_per_mm)
        for setting, row in zip(bench.forefoot, rows, strict=True)
    ]
    heel = [(bench.heel, None, table.heel_published_n_per_mm)] if bench.heel else []
    for i, (setting, row, published) in enumerate([*passes, *heel]):
        x = 1e3 * displacement(setting)
        colour = colour_of(row, rows)
        axes.plot(
            x, setting.load_n, color=colour, label="simulated" if i == 0 else None, **SIMULATED
        )
        tag(
            axes,
            "heel" if row is None else row.setting_cell,
            (x[-1], setting.load_n[-1]),
            colour,
            offset=(0, 4),
            ha="center",
        )
        if published is not None:  # a line of that slope through the simulated curve at 200 N
            x0 = float(np.interp(STIFFNESS_ABOVE_N, setting.load_n, displacement(setting)))
            loads = np.array([STIFFNESS_ABOVE_N, float(np.max(setting.load_n))])
            axes.plot(
                1e3 * x0 + (loads - STIFFNESS_ABOVE_N) / published,
                loads,
                color=colour,
                **MEASURED,
            )
    axes.axhline(STIFFNESS_ABOVE_N, color=NEUTRAL, linewidth=0.8, linestyle=":")
    if any(published is not None for _, _, published in [*passes, *heel]):
        axes.plot([], [], color=NEUTRAL, label="published slope (offset not published)", **MEASURED)
    axes.set_xlim(left=0.0)
    axes.margins(y=0.1)
    axes.set_ylim(bottom=0.0)
    numbers = None if any(row.fulcrum_mm is None for row in rows) else "numbers: fulcrum (mm)"
    axes.legend(loc="lower right", title=numbers, alignment="left")
    label(axes, x="displacement of the platen (mm)", y="load (N)", title="Load and displacement")


def _bench_stiffness(
    axes: Axes, bench: BenchResult, table: BenchTable, places_mm: Sequence[float]
) -> None:
    rows = table.settings
    if rows:
        span = np.linspace(places_mm[0], places_mm[-1], 100)
        beam = closed_form_stiffness(bench.parameters["foot"], 1e-3 * span)
        axes.plot(
            span,
            1e-3 * beam,
            color=NEUTRAL,
            linewidth=1.2,
            linestyle=":",
            label="overhung beam, small deflection",
        )
    for i, (fulcrum_mm, row) in enumerate(zip(places_mm, rows, strict=True)):
        colour = colour_of(row)
        published = row.published_n_per_mm
        if published is not None:
            axes.plot(
                fulcrum_mm,
                published,
                marker="_",
                markersize=22,
                markeredgewidth=3.5,
                color=colour,
                alpha=MEASURED["alpha"],
                linestyle="",
            )
        axes.plot(
            fulcrum_mm,
            row.stiffness_n_per_mm,
            marker=MARKERS[i % len(MARKERS)],
            color=colour,
            markersize=7,
            linestyle="",
            markerfacecolor="none" if published is None else colour,
        )
        axes.annotate(
            f"{row.stiffness_n_per_mm:.1f}",
            (fulcrum_mm, row.stiffness_n_per_mm),
            xytext=(0, 8),
            textcoords="offset points",
            ha="center",
        )
    axes.plot(
        [], [], linestyle="", marker="o", color=NEUTRAL, label="simulated (full where published)"
    )
    axes.plot(
        [],
        [],
        linestyle="",
        marker="_",
        markersize=14,
        markeredgewidth=3.5,
        color=NEUTRAL,
        alpha=MEASURED["alpha"],
        label="published",
    )
    axes.plot(
        places_mm,
        [row.tuned_joints_n_per_mm or np.nan for row in rows],
        linestyle="",
        marker="x",
        color=NEUTRAL,
        label="tuned joints of the authors' model, small loads",
    )
    heel = table.heel_stiffness_n_per_mm
    if heel is not None:
        text = f"heel: {heel:.1f} N/mm (published {table.heel_published_n_per_mm:g})"
        axes.text(0.98, 0.03, text, color=HEEL_COLOUR, transform=axes.transAxes, ha="right")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1, y=0.15)
    axes.legend(loc="upper left")
    label(axes, x=FULCRUM, y="stiffness (N/mm)", title=f"Stiffness above {STIFFNESS_ABOVE_N:g} N")


def walk_figure(
    result: WalkResult,
    plate: PlateRecording | None,
    metrics: Agreement,
    *,
    setting: AtSetting,
    curves: Arrays | None = None,
) -> Figure:
    """A finished walk beside the plate under the prosthetic foot, if there is one: forces, centre
    of pressure and the load of each zone.

    Forces are those that the metrics score (40 Hz, time-locked), `walk_metrics(result, plate)`;
    `curves` are the same walk's in layers (`walks.prediction.layer_curves`). Stances that the
    simulated time cuts are shaded.
    """
    curves = curves or {}
    off = "physics" if curves else "RMSE"
    comparison = compare(result, plate)
    model, measured = (
        force / metrics.body_weight_n for force in (comparison.model, comparison.measured)
    )
    colour = colour_of(setting)
    kind = "synthetic walk, not recorded" if result.synthetic else "recorded walk"
    state = "" if result.converged else f", {result.unconverged_steps} STEPS NOT CONVERGED"
    state += "".join(
        f", {word}"
        for word in (UNFITTED, UNUSABLE_RECORDING, NO_PLATE, STARTS_LOADED)
        if any(note.startswith(word) for note in result.notes)
    )
    with drawing(WIDTH, 7.4) as figure:
        panels = figure.subplots(3, 2)
        for axes, name, column, error in (
            (panels[0, 0], "Resultant", RESULTANT, metrics.error_bw),
            (panels[0, 1], "Vertical", 2, metrics.vertical_rmse_bw),
            (panels[1, 0], "Fore-aft", 0, metrics.fore_aft_rmse_bw),
            (panels[1, 1], "Lateral", 1, metrics.medio_lateral_rmse_bw),
        ):
            _shade(axes, comparison)
            for force, look in ((measured, MEASURED), (model, SIMULATED))[plate is None :]:
                axes.plot(comparison.time_s, component_of(force, column), color=colour, **look)
            if curves:
                draw_layers(axes, curves["time_s"], curves, column)
            label(axes, x="time (s)", y="force (BW)", title=name + _error(error, "BW", off))
            axes.set_xlim(*_seen_s(comparison))
        _centre_of_pressure(panels[2, 0], result, comparison, metrics, colour)
        _zones(panels[2, 1], result, comparison)
        handles: list[Artist] = [
            Line2D(
                [],
                [],
                color=colour,
                label="reference (synthetic)" if result.synthetic else "force plate",
                **MEASURED,
            ),
            Line2D(
                [], [], color=colour, label="physics alone" if curves else "simulated", **SIMULATED
            ),
            *layer_handles(curves),
            Line2D(
                [],
                [],
                color=NEUTRAL,
                linewidth=0.7,
                linestyle=":",
                label="compared: stance ± 0.25 s",
            ),
        ]
        if plate is None:
            handles = handles[1:-1]
        if not all(item.inside for item in comparison.stances):
            handles.append(
                Patch(
                    facecolor=SHADE,
                    edgecolor=NEUTRAL,
                    linewidth=0.6,
                    label="stance cut by the simulated time",
                )
            )
        figure.legend(handles=handles, loc="lower center", ncols=2)
        title = (
            f"{result.trial_name}: {kind}, {result.side} prosthesis, {setting.setting_words}{state}"
        )
        _head(figure, title)
    return figure


def _head(figure: Figure, title: str) -> None:
    figure.suptitle(textwrap.fill(title, TITLE_WIDTH), x=0.01, ha="left", fontsize=9.5)


def zone_loads(result: WalkResult) -> dict[str, np.ndarray]:
    """Zone -> (n,) normal force (N) summed over its spheres; one entry `all spheres` where zones
    are unknown."""
    names = np.array(result.sphere_zones)
    if len(names) != result.sphere_normal_n.shape[1]:
        return {"all spheres": result.sphere_normal_n.sum(axis=1)}
    return {
        zone: result.sphere_normal_n[:, names == zone].sum(axis=1)
        for zone in dict.fromkeys(result.sphere_zones)
    }


def _seen_s(comparison: Comparison) -> tuple[float, float]:
    """From when to when there is something to see: what is compared, of a walk without a plate
    everything (s)."""
    spans = [item.span for item in comparison.stances]
    whole = (float(comparison.time_s[0]), float(comparison.time_s[-1]))
    if not spans:
        return whole
    return (
        max(min(start for start, _ in spans) - ASIDE_S, whole[0]),
        min(max(end for _, end in spans) + ASIDE_S, whole[1]),
    )


def _error(value: float | None, unit: str, off: str = "RMSE") -> str:
    return "" if value is None else f", {off} {value:.3f} {unit}"


def _shade(axes: Axes, comparison: Comparison) -> None:
    """Shades the stances that the simulated time cuts and marks the ends of what is scored."""
    axes.axhline(0.0, color="0.7", linewidth=0.8)
    for item in comparison.stances:
        if not item.inside:
            start, end = (
                np.clip(t, *comparison.time_s[[0, -1]])
                for t in (item.measured.start_s, item.measured.end_s)
            )
            axes.axvspan(start, end, color=SHADE, linewidth=0.0, zorder=0)
        for instant in item.span:
            axes.axvline(instant, color=NEUTRAL, linewidth=0.7, linestyle=":")


def _centre_of_pressure(
    axes: Axes, result: WalkResult, comparison: Comparison, metrics: Agreement, colour: ColorType
) -> None:
    """Fore-aft centre of pressure in foot lengths ahead of the plate's rearmost one in each
    footprint."""
    several = len(comparison.stances) > 1
    for number, item in enumerate(comparison.stances, start=1):
        known = np.isfinite(item.measured_cop[:, 0])
        if not known.any():
            continue
        origin = item.measured_cop[known, 0].min()
        measured = (item.measured_cop[:, 0] - origin) / result.foot_length_m
        model = (item.model_cop[:, 0] - origin) / result.foot_length_m
        axes.plot(PERCENT, measured, color=colour, **MEASURED)
        axes.plot(
            PERCENT,
            model,
            color=colour,
            marker=MARKERS[number % len(MARKERS)] if several else "",
            markevery=(5 * number, 12),
            markersize=4.5,
            label=f"stance {number}, simulated",
            **SIMULATED,
        )
    if not metrics.cop_points:
        axes.text(
            0.5,
            0.5,
            "no plate" if comparison.plateless else "no centre of pressure\nin common",
            transform=axes.transAxes,
            ha="center",
            va="center",
            color="0.35",
        )
    if 1 < len(axes.get_legend_handles_labels()[0]) <= MOST_LABELLED:
        axes.legend(loc="upper left")
    axes.set_xlim(0.0, 100.0)
    label(
        axes,
        x="measured stance (%)",
        y="ahead of the\nrearmost (foot lengths)",
        title="CoP" + _error(metrics.cop_rmse_fl, "FL"),
    )


def _zones(axes: Axes, result: WalkResult, comparison: Comparison) -> None:
    _shade(axes, comparison)
    loads = zone_loads(result)
    for i, (zone, load) in enumerate(loads.items()):
        shade = str(0.05 + 0.5 * i / max(1, len(loads) - 1))
        axes.plot(
            result.time_s,
            load,
            color=shade,
            linewidth=1.3,
            linestyle=LINES[i % len(LINES)],
            label=zone.replace("_", " ").replace("posterior", "post.").replace("anterior", "ant."),
        )
    axes.set_xlim(*_seen_s(comparison))
    axes.set_ylim(0.0, 2.0 * max(1.0, *(float(np.max(load)) for load in loads.values())))
    axes.legend(loc="upper left", ncols=2, handlelength=1.2, columnspacing=0.6, handletextpad=0.4)
    label(axes, x="time (s)", y="normal force (N)", title="Simulated load by zone")


def standing_figure(table: StandingTable) -> Figure:
    """The force under each foot and under both against the weight, and how the pelvis drifts."""
    with drawing(WIDTH, 6.0) as figure:
        left, right = figure.subplots(2)
        _forces(left, table)
        _drift(right, table)
        verdict = "stands" if table.stands else "DOES NOT STAND STILL"
        state = "" if table.converged else f", {table.unconverged_steps} STEPS NOT CONVERGED"
        _head(
            figure,
            f"{table.subject}, {table.prosthetic_side} prosthesis, {table.setting_words}: "
            f"{verdict}{state}",
        )
    return figure


def _forces(axes: Axes, table: StandingTable) -> None:
    series = table.series
    time = series.time_s
    prosthetic = series.prosthetic_n
    intact = series.intact_n
    axes.axhline(table.weight_n, color=NEUTRAL, label=f"weight, {table.weight_n:.1f} N", **MEASURED)
    axes.plot(
        time,
        prosthetic + intact,
        color=BOTH,
        linewidth=1.6,
        label=f"both feet, mean {table.mean_vertical_n:.1f} N ({table.weight_error:+.2%})",
    )
    axes.plot(
        time,
        intact,
        color=INTACT,
        linewidth=1.6,
        linestyle="-.",
        label=f"intact foot, {table.intact_share:.0%}",
    )
    axes.plot(
        time,
        prosthetic,
        color=PROSTHETIC,
        linewidth=1.6,
        linestyle="--",
        label=f"prosthetic foot, {table.prosthetic_share:.0%}",
    )
    axes.set_ylim(0.0, 1.45 * max(table.weight_n, float(np.max(prosthetic + intact))))
    axes.set_xlim(0.0, table.duration_s)
    axes.legend(loc="upper left", ncols=2)
    label(axes, x="time (s)", y="vertical force (N)", title="What the ground carries")


def _drift(axes: Axes, table: StandingTable) -> None:
    series = table.series
    drift = series.drift_mm
    axes.plot(series.time_s, drift, color=BOTH, linewidth=1.6)
    axes.axhline(LIMIT_MM, color=NEUTRAL, linewidth=0.8, linestyle=":")
    axes.set_ylim(0.0, 1.6 * max(float(np.max(drift)), LIMIT_MM))
    axes.set_xlim(0.0, table.duration_s)
    angles = table.pelvis_deg
    free = [name.removeprefix("pelvis_") for name in table.free]
    held = [
        f"{name.removeprefix('pelvis_')} {value:+.1f} N m" for name, value in table.held_nm.items()
    ]
    lines = [
        f"largest {table.drift_mm:.2g} mm, {table.turn_deg:.2g}°",
        f"tilt {angles['tilt']:+.1f}°, list {angles['list']:+.1f}°",
        f"free: {', '.join(free)}",
        "held by: " + (", ".join(held) or "nothing"),
    ]
    axes.text(0.03, 0.97, "\n".join(lines), transform=axes.transAxes, va="top")
    label(
        axes,
        x="time (s)",
        y="pelvis from its start (mm)",
        title=f"How still: let go {1e3 * NUDGE_M:g} mm off rest",
    )


def sweep_figure(table: SweepTable, rows: Sequence[SweepRow]) -> Figure:
    """Errors against the plate and the peak force over the one quantity that is varied, one line a
    trial."""
    [name] = table.varied
    trials = table.trials
    column = table.columns[name]
    values = [row.varied(name) for row in rows]
    with drawing(9.6, 4.0 + 0.16 * len(trials)) as figure:
        for axes, (key, y, title) in zip(figure.subplots(1, 3), _PANELS, strict=True):
            lines = []
            factor = quantity(key).scale
            for number, trial in enumerate(trials):
                own = [row for row in rows if row.trial == trial.name]
                colour = colour_of(trial, trials)
                known, lateral = (
                    sorted(
                        (row.varied(name), factor * score)
                        for row in own
                        if (score := row.scores[of]) is not None
                    )
                    for of in (key, "cop_ml_rmse_fl")
                )
                if key == "cop_rmse_fl":
                    axes.plot(
                        [x for x, _ in lateral],
                        [y for _, y in lateral],
                        "--",
                        linewidth=1.0,
                        color=colour,
                    )
                lines += axes.plot(
                    [x for x, _ in known],
                    [y for _, y in known],
                    marker=MARKERS[number % len(MARKERS)],
                    markersize=4,
                    linewidth=1.4,
                    color=colour,
                )
                for lost in (row.varied(name) for row in own if row.failure):
                    axes.plot(
                        lost,
                        0.02,
                        marker="x",
                        color=colour,
                        transform=axes.get_xaxis_transform(),
                        clip_on=False,
                    )
                if key == "peak_vertical_bw" and trial.measured_peak_vertical_bw is not None:
                    axes.axhline(
                        trial.measured_peak_vertical_bw, color=colour, linestyle=":", linewidth=1.2
                    )
            for value in (
                {column["in_the_model"]}
                if "in_the_model" in column
                else {t.fulcrum_mm for t in trials}
            ):
                axes.axvline(value, color=NEUTRAL, linewidth=5.0, alpha=0.35, zorder=0)
            if min(values) > 0.0 and max(values) / min(values) > _WIDE:
                log_scale(axes.xaxis)
            label(axes, x="", y=y, title=title)
        figure.axes[1].set_xlabel(FULCRUM if name == "fulcrum_mm" else f"{name} ({column['unit']})")
        # legends leave out what begins with an underscore
        figure.legend(
            lines,
            [
                " " * trial.name.startswith("_")
                + trial.name
                + f", foot {trial.foot}" * bool(trial.foot)
                for trial in trials
            ],
            loc="outside lower left",
        )
        synthetic = " (SYNTHETIC)" if any(trial.synthetic for trial in trials) else ""
        failed = f", {table.failed} FAILED" if table.failed else ""
        figure.suptitle(
            f"{table.walks} walks{synthetic}{failed}; shaded: the trial's own value; dotted: "
            "measured peak",
            x=0.01,
            ha="left",
            fontsize=10,
        )
    return figure
