"""The study's figures, from its stored results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from contact_fit_study.cases import PAIR, TIERS, TRIALS
from vsf_drake.report import style as look

_WHAT = {"grf_rmse_bw": "resultant force (% BW)", "cop_rmse_fl": "centre of pressure (% FL)"}
_FITS = (
    "joint, with the bench",
    "joint, without the bench",
    "joint, without the bench, keel unknown",
    "paper, literally",
)
_DARKEST_PERCENT = 15.0


def figures(results: Mapping[str, Any]) -> dict[str, Figure]:
    """By file name; of the tiers whose fit succeeded."""
    tiers = [tier for tier in TIERS if "trials" in results.get(tier, {}).get("transfer", {})]
    found = {}
    if tiers:
        found = {
            "errors_by_trial": _errors(results, tiers),
            "fulcrum_sweeps": _sweeps(results, tiers),
        }
    whole = [tier for tier in tiers if "one_trial" in results[tier]]
    return found | ({"fitted_on_tested_on": _matrix(results, whole)} if whole else {})


def _errors(results: Mapping[str, Any], tiers: list[str]) -> Figure:
    """Each trial of the reported pair's fit beside null model and floor."""
    made = look.new_figure(5.4 * len(tiers), 5.6)
    grid = made.subplots(2, len(tiers), squeeze=False, sharex=True, sharey="row")
    for column, tier in enumerate(tiers):
        trials = results[tier]["transfer"]["trials"]
        place = np.arange(len(TRIALS))
        for axes, (metric, what) in zip(grid[:, column], _WHAT.items(), strict=True):
            if metric == "grf_rmse_bw":
                for key, mark, label in (
                    ("null_model_grf_rmse_bw", "x", "null model"),
                    ("floor_grf_rmse_bw", "_", "floor"),
                ):
                    axes.plot(
                        place,
                        [100 * trials[name][key] for name in TRIALS],
                        mark,
                        color=look.NEUTRAL,
                        markersize=11,
                        markeredgewidth=1.8,
                        clip_on=False,
                        label=label,
                    )
            for role, face in (("fitted", "white"), ("held out", None)):
                of = [i for i in place if trials[TRIALS[i]]["role"] == role]
                colours = [look.colour_of(trials[TRIALS[i]]["fulcrum_mm"]) for i in of]
                axes.scatter(
                    of,
                    [100 * trials[TRIALS[i]][metric] for i in of],
                    s=42,
                    label=role,
                    edgecolors=colours,
                    facecolors=face or colours,
                    linewidths=1.6,
                    zorder=3,
                )
            axes.set_ylim(0.0, 1.08 * axes.dataLim.y1)
            axes.set_xticks(place, TRIALS, rotation=35, ha="right")
            look.label(
                axes,
                x="",
                y=what,
                title=f"{tier} tier (synthetic)" if axes is grid[0, column] else "",
            )
    grid[0, 0].legend(ncols=2)
    return made


def _sweeps(results: Mapping[str, Any], tiers: list[str]) -> Figure:
    """Error over the fulcrum's travel, the lowest marked; vertical lines where it stood."""
    made = look.new_figure(5.0 * len(tiers), 3.8)
    for axes, tier in zip(
        made.subplots(1, len(tiers), squeeze=False, sharey=True)[0], tiers, strict=True
    ):
        shown = set()
        for name in TRIALS:
            row = results[tier]["transfer"]["trials"][name]
            true = row["fulcrum_mm"]
            colour = look.colour_of(true)
            if true not in shown:
                axes.axvline(true, color=colour, linewidth=5.0, alpha=0.25)
            x, y = (
                row["sweep"]["fulcrum_mm"],
                [np.nan if e is None else 100 * e for e in row["sweep"]["grf_rmse_bw"]],
            )
            axes.plot(
                x,
                y,
                color=colour,
                linewidth=1.2,
                alpha=0.9,
                label=None if true in shown else look.name_of(round(true, 6)),
            )
            best = row["sweep"]["best_mm"]
            if best is not None:
                axes.plot(
                    best,
                    np.interp(best, x, y),
                    "o" if row["sweep"]["right"] else "X",
                    color=colour,
                    markersize=6,
                    markeredgecolor="white",
                )
            shown.add(true)
        axes.set_ylim(bottom=0.0)
        look.label(
            axes,
            x="fulcrum from the keel's posterior end (mm)",
            y="resultant error (% BW)",
            title=(
                f"{tier} tier (synthetic): {results[tier]['fulcrum_sweep_correct']} of "
                f"{len(TRIALS)} right"
            ),
        )
        axes.legend()
    return made


def _matrix(results: Mapping[str, Any], tiers: list[str]) -> Figure:
    """Fitted on one trial (rows), tested on all (columns): resultant error in percent of body
    weight."""
    made = look.new_figure(6.2 * len(tiers), 2.0 * len(_FITS) + 0.8)
    grid = made.subplots(len(_FITS), len(tiers), squeeze=False)
    for column, tier in enumerate(tiers):
        found = results[tier]
        blocks = (
            {**found["one_trial"], "+".join(PAIR): found["transfer"]},
            found["without_bench"],
            found["keel_unknown"],
            found["paper"]["literal"],
        )
        for axes, rows, what in zip(grid[:, column], blocks, _FITS, strict=True):
            errors = np.array(
                [
                    [
                        100 * fit["trials"][name]["grf_rmse_bw"] if "trials" in fit else np.nan
                        for name in TRIALS
                    ]
                    for fit in rows.values()
                ]
            )
            axes.imshow(errors, cmap="Greys", vmin=0.0, vmax=_DARKEST_PERCENT, aspect="auto")
            for i, fit in enumerate(rows.values()):
                for j, name in enumerate(TRIALS):
                    dark = errors[i, j] > 0.6 * _DARKEST_PERCENT
                    axes.text(
                        j,
                        i,
                        f"{errors[i, j]:.1f}",
                        ha="center",
                        va="center",
                        fontsize=8.5,
                        color="white" if dark else "black",
                        fontweight="bold" if name in fit["fitted"] else "normal",
                    )
            axes.grid(visible=False)
            axes.set_yticks(range(len(rows)), rows)
            last = what == _FITS[-1]
            axes.set_xticks(range(len(TRIALS)), TRIALS if last else [], rotation=35, ha="right")
            look.label(
                axes,
                x="tested on" if last else "",
                y="fitted on",
                title=f"{tier} tier (synthetic), {what}: error, % BW; bold: fitted",
            )
    return made
