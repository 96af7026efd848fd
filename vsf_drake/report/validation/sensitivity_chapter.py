"""The sensitivity chapter: what of the model's uncertainty matters for force, centre of pressure and keel energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.style import label, new_figure, style

_NAMED = 4


def sensitivity_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Made of a `sensitivity_section` alone; `arrays` is empty."""
    screened, indexed = shown_outputs(table["morris"]), shown_outputs(table["sobol"])
    pieces: list[Piece] = [Text(_what(table)), Text(_READ)]
    if screened:
        pieces += [
            Bullets([*(_finding(table, name) for name in screened), *_general(table)]),
            Picture(name="sensitivity_screening", figure=screening_figure(table), alt=_screening_alt(table, screened),
                    caption=f"Morris' screening, the {MOST} strongest factors of each output. A bar is the mean size "
                            "of the effect of moving the factor over its whole range, wherever the others stand. Where "
                            "the diamond (signs kept) reaches the bar's end, the effect has one sign everywhere; where "
                            "it stays near zero, the factor raises the output here and lowers it there.")]
    else:
        pieces.append(Missing("No output has enough whole trajectories for a screening."))
    if indexed or shown_outputs(table["sobol_factors"]):
        pieces += [Heading("Shares of the variance"), Text(_shares(table)),
                   Picture(name="sensitivity_indices", figure=indices_figure(table), alt=_indices_alt(table),
                           caption="Sobol indices with 95 % bootstrap intervals. Upper row: all factors varied, by "
                                   "group. Lower row: only the strongest factors varied, the others as they are.")]
        pieces += [index_grid(table, key) for key in ("sobol", "sobol_factors") if shown_outputs(table[key])]
    pieces += [Heading("Every output, every factor"), output_grid(table)]
    if screened:
        pieces.append(screening_grid(table))
        pieces += [condition_grid(table)] if len(table["conditions"]) > 1 else []
    pieces += [factor_grid(table), Text(_method(table))]
    return Chapter(name="sensitivity", title="Sensitivity", pieces=tuple(pieces))


def _what(table: Mapping[str, Any]) -> str:
    kind = "synthetic " if table["synthetic"] else ""
    named = ", ".join(f"{one['label']} ({one['role']}, {one['fulcrum_mm']:g} mm)" for one in table["conditions"])
    mean = "; effects are on their mean" if len(table["conditions"]) > 1 else ""
    groups = list(dict.fromkeys(row["group"] for row in table["factors"]))
    return (f"{len(table['factors'])} numbers of the model are moved about the values of this study, each over what "
            f"one does not know of it before a fit (last table): {', '.join(groups[:-1])} and {groups[-1]}. "
            f"Walked: {kind}{named}{mean}. A fit moves several of these numbers together and cannot tell some apart; "
            "shown here is what each does if it alone is not known, or if none is known and nothing is fitted.")


_READ = (
    "The motion is prescribed, so the force follows from how far foam, keel and socket are compressed: a millimetre at "
    "the foot counts, wherever it comes from. Errors of the pelvis's orientation are left out: where markers on the "
    "thigh are tracked, the hip's angles take them up. Energy is that of the spring, the keel with the support under "
    "it: stored, its largest strain in stance above touch-down; returned, what of it is gone at toe-off less what "
    "damping took. The foam is not in it.")


def _finding(table: Mapping[str, Any], name: str) -> str:
    output, rows = OUTPUTS[name], top(table["morris"][name], "mu_star", _NAMED)
    named = ", ".join(f"{row['name']} {output.shown(row['mu_star'], unit=False)} ± "
                      f"{output.shown(row['mu_star_conf'], unit=False)}" for row in rows)
    text = (f"{output.name[0].upper()}{output.name[1:]} ({output.shown(table['baseline'][name]['mean'])} as it is): "
            f"the strongest are {named} {output.unit} over the whole range")
    groups = table["sobol"].get(name)
    if groups:
        shares = ", ".join(f"{row['name']} {100 * row['st']:.0f} ± {100 * row['st_conf']:.0f}"
                           for row in top(groups, "st", 3))
        text += f"; percent of the variance that involves {shares}"
    spread = table["spread"].get(name)
    if spread:
        text += (f". With everything uncertain at once it lies between {output.shown(spread['p05'], unit=False)} and "
                 f"{output.shown(spread['p95'])} in {_indexed(table)} (5th and 95th percentile)")
    return text + "."


def _indexed(table: Mapping[str, Any]) -> str:
    """The trial that indices and percentiles are of."""
    return str(table["conditions"][table["indexed"]]["label"])


def _general(table: Mapping[str, Any]) -> list[str]:
    found = []
    if table["local_agreement"] is not None:
        found.append("A second way, without sampling: by exact derivatives of the force about the study's values. Its "
                     "ranking and that of the screening of the GRF error have a rank correlation of "
                     f"{table['local_agreement']:.2f}.")
    known = {name: table["stability"][name] for name in shown_outputs(table["morris"])
             if table["stability"][name] is not None}
    if known:
        name = min(known, key=lambda name: known[name])
        found.append("The rankings at different fulcrum positions agree: the lowest rank correlation of two conditions "
                     f"is {known[name]:.2f} ({OUTPUTS[name].name})." if known[name] >= 0.8 else
                     "The rankings at different fulcrum positions differ: the rank correlation of two conditions falls "
                     f"to {known[name]:.2f} ({OUTPUTS[name].name}).")
    return found


def _shares(table: Mapping[str, Any]) -> str:
    parts = [f"Of {_indexed(table)} alone. A first-order index is the share of an output's variance that would "
             "vanish if the group or factor were known; the total index also counts what it does only together with "
             "others. "]
    known = [name for name in shown_outputs(table["sobol"]) if table["interaction"][name] is not None]
    if known:
        parts.append("Share of the variance that is of no group alone: " + ", ".join(
            f"{100 * table['interaction'][name]:.0f} ± {100 * table['interaction_conf'][name]:.0f} % "
            f"({OUTPUTS[name].name})" for name in known) + ". An error is smallest where several shifts cancel, which "
            "is an interaction. ")
    kept = [name for name in shown_outputs(table["sobol_factors"]) if table["explained"][name] is not None]
    if kept:
        parts.append(f"With only the {len(table['strongest'])} strongest factors varied, the variance is " + ", ".join(
            f"{100 * table['explained'][name]:.0f} % ({OUTPUTS[name].name})" for name in kept)
            + " of that with all varied. ")
    wide = [f"{row['name']} ({OUTPUTS[name].name})" for key in ("sobol", "sobol_factors")
            for name in shown_outputs(table[key]) for row in table[key][name] if row["st_wide"]]
    first = [row["s1_wide"] for key in ("sobol", "sobol_factors") for name in shown_outputs(table[key])
             for row in table[key][name]]
    parts.append(f"The 95 % interval is wider than the index for {sum(first)} of {len(first)} first-order indices: "
                 "those are not told from a small share by this many walks. " + (
                     f"The same holds for the total index of {', '.join(wide)}." if wide else
                     "No total index is that uncertain."))
    return "".join(parts)


def _method(table: Mapping[str, Any]) -> str:
    samples = table["samples"]
    text = (f"{table['walks']} walks at 2 ms; {table['failures']['count']} failed, {table['unconverged']} have steps "
            f"accepted without convergence. Seed {table['seed']}. Screening: {table['trajectories']} trajectories of "
            "Morris (1991) on four levels, mu* of Campolongo et al. (2007)")
    if samples:
        text += (f"; indices: Saltelli et al. (2010) on a scrambled Sobol sequence, {samples['groups']} blocks for "
                 f"groups, {samples['factors']} for factors; both by SALib")
    drops = {OUTPUTS[name].name: count for name, of in table["failures"]["dropped"].items()
             if (count := sum(value or 0 for value in of.values()))}
    if drops:
        text += ". Trajectories and blocks left out because a walk failed or lacks the value: " + ", ".join(
            f"{count} for the {name}" for name, count in drops.items())
    examples = table["failures"]["examples"]
    return text + "." + (f" First failure: {examples[0]}." if examples else "")


def _screening_alt(table: Mapping[str, Any], names: list[str]) -> str:
    parts = []
    for name in names:
        output = OUTPUTS[name]
        best = top(table["morris"][name], "mu_star", 3)
        parts.append(f"{output.name}: " + ", ".join(f"{row['name']} {output.shown(row['mu_star'])}" for row in best))
    return "Bars of the mean absolute effect of each factor's whole range, strongest first. " + "; ".join(parts) + "."


def _indices_alt(table: Mapping[str, Any]) -> str:
    parts = []
    for key in ("sobol", "sobol_factors"):
        for name in shown_outputs(table[key]):
            best = top(table[key][name], "st", 2)
            parts.append(f"{OUTPUTS[name].name}: " + ", ".join(
                f"{row['name']} total {row['st']:.2f}, first order {row['s1']:.2f}" for row in best))
    return "Bars of Sobol indices. " + "; ".join(parts) + "."


# Sobol indices: whose share of an output's variance is whose, by group and by factor.


_HEIGHT = 0.38


def indices_figure(table: Mapping[str, Any]) -> Figure:
    """First-order and total indices: a row of panels for groups, one for single factors; outputs side by side.

    Of groups or of factors at least one main output must have rows.
    """
    blocks = [(kind, shown_outputs(table[key])) for kind, key in (("group", "sobol"), ("factor", "sobol_factors"))]
    blocks = [(kind, names) for kind, names in blocks if names]
    across = max(len(names) for _, names in blocks)
    with style():
        figure = new_figure(11.0 if across > 1 else 6.5, 0.9 + 3.1 * len(blocks))
        panels = figure.subplots(len(blocks), across, squeeze=False)
        for line, (kind, names) in zip(panels, blocks, strict=True):
            for axes, name in zip(line, names, strict=False):
                _panel(axes, table, kind, name)
            for axes in line[len(names):]:
                axes.set_axis_off()
        handles = [Patch(facecolor="0.6", edgecolor="black", linewidth=0.5, label="first order: alone (coloured)"),
                   Patch(facecolor="white", edgecolor="black", linewidth=0.9, label="total: with all interactions"),
                   *(Patch(label=group, **look(group)) for group in GROUPS)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], kind: str, name: str) -> None:
    groups = {row["name"]: row["group"] for row in table["factors"]}
    rows = sorted(table["sobol" if kind == "group" else "sobol_factors"][name], key=lambda row: -row["st"])
    places = np.arange(len(rows))
    for place, row in zip(places, rows, strict=True):
        group = row["name"] if kind == "group" else groups[row["name"]]
        axes.barh(place - _HEIGHT / 2, max(row["s1"], 0.0), height=_HEIGHT, **look(group))
        axes.barh(place + _HEIGHT / 2, row["st"], height=_HEIGHT, facecolor="white", edgecolor="black", linewidth=0.9)
        for key, at in (("s1", place - _HEIGHT / 2), ("st", place + _HEIGHT / 2)):
            axes.plot(_interval(row, key), [at, at], color="black", linewidth=1.0, clip_on=False)
    axes.set_yticks(places, [row["name"] for row in rows], fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(False, axis="y")
    label(axes, x="share of the variance (1)", y=kind, title=OUTPUTS[name].name)


def _interval(row: Mapping[str, Any], key: str) -> Sequence[float]:
    return [max(row[key] - row[f"{key}_conf"], 0.0), max(row[key] + row[f"{key}_conf"], 0.0)]


# Morris' screening: the strongest factors of each output.


MOST = 12


def screening_figure(table: Mapping[str, Any]) -> Figure:
    """mu* of the MOST strongest factors, one panel an output; at least one main output must have rows."""
    names = shown_outputs(table["morris"])
    with style():
        figure = new_figure(11.0 if len(names) > 1 else 6.5, 4.8)
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        for axes, name in zip(panels, names, strict=True):
            _screening_panel(axes, table, name)
        present = {row["group"] for name in names for row in top(table["morris"][name], "mu_star", MOST)}
        handles: list[Any] = [Patch(label=group, **look(group)) for group in GROUPS if group in present]
        handles += [Line2D([], [], color="black", marker="D", linestyle="", markersize=4.5, markerfacecolor="white",
                           label="size of the mean effect, signs kept"),
                    Line2D([], [], color="black", linewidth=1.0, label="95 % bootstrap interval")]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _screening_panel(axes: Axes, table: Mapping[str, Any], name: str) -> None:
    output, rows = OUTPUTS[name], top(table["morris"][name], "mu_star", MOST)
    places = np.arange(len(rows))
    for place, row in zip(places, rows, strict=True):
        size = output.scale * row["mu_star"]
        axes.barh(place, size, height=0.72, **look(row["group"]))
        spread = output.scale * row["mu_star_conf"]
        axes.plot([max(size - spread, 0.0), size + spread], [place, place], color="black", linewidth=1.0)
        axes.plot(output.scale * abs(row["mu"]), place, marker="D", markersize=4.0, color="black",
                  markerfacecolor="white", linestyle="")
    axes.set_yticks(places, [row["name"] for row in rows], fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(False, axis="y")
    label(axes, x=f"effect mu* ({output.unit})", y="factor",
          title=f"{output.name}: {output.shown(table['baseline'][name]['mean'])}")


# Tables of the sensitivity chapter.


_MOST_BY_CONDITION = 12


def output_grid(table: Mapping[str, Any]) -> Grid:
    """Every output: as it is, over the uncertainty, and by what it is moved most. Values in the output's unit."""
    rows = []
    for name, output in OUTPUTS.items():
        spread, ranking = table["spread"].get(name), table["ranking"].get(name) or []
        scaled = {f"p{p}": None if spread is None else output.scale * spread[f"p{p}"] for p in ("05", "50", "95")}
        known = table["baseline"][name]["by_condition"][table["indexed"]]
        rows.append({"output": output.name, "unit": output.unit,
                     "baseline": None if known is None else output.scale * known, **scaled,
                     "interaction": table["interaction"].get(name),
                     "interaction_conf": table["interaction_conf"].get(name),
                     "stability": table["stability"].get(name),
                     "strongest": ", ".join(ranking[:3]) or None})
    return Grid(name="sensitivity_outputs", rows=rows, caption=(
        f"Outputs of {_indexed(table)}: as they are with the study's values, and their 5th, 50th and 95th percentile "
        "with everything uncertain at once; the share of the variance that is of no group alone, ± half of its 95 % "
        "interval. Of all conditions: the lowest rank correlation of mu* between two; the strongest factors."),
        columns=(
        Column(key="output", heading="output"), Column(key="unit", heading="unit"),
        Column(key="baseline", heading="as it is", form="{:.2f}"), Column(key="p05", heading="5 %", form="{:.2f}"),
        Column(key="p50", heading="50 %", form="{:.2f}"), Column(key="p95", heading="95 %", form="{:.2f}"),
        Column(key="interaction", heading="of no group alone (%)", form="{:.0f}", scale=100.0),
        Column(key="interaction_conf", heading="±", form="{:.0f}", scale=100.0),
        Column(key="stability", heading="agreement of conditions", form="{:.2f}"),
        Column(key="strongest", heading="strongest factors")))


def screening_grid(table: Mapping[str, Any]) -> Grid:
    """All factors by all outputs: mu* with its interval, and sigma."""
    names = [name for name in OUTPUTS if table["morris"].get(name)]
    found = {name: {row["name"]: row for row in table["morris"][name]} for name in names}
    order = table["ranking"][shown_outputs(table["morris"])[0]]
    factors = {row["name"]: row for row in table["factors"]}
    rows, columns = [], [Column(key="factor", heading="factor"), Column(key="group", heading="group"),
                         Column(key="local_grf_bw", heading="resultant, derivative (% BW)", form="{:.2f}", scale=100.0)]
    for factor in order:
        row = {"factor": factor, "group": factors[factor]["group"], "local_grf_bw": factors[factor]["local_grf_bw"]}
        for name in names:
            row |= {f"{name}_{key}": found[name][factor][key] for key in ("mu", "mu_star", "mu_star_conf", "sigma")}
        rows.append(row)
    for name in names:
        output, main = OUTPUTS[name], name in shown_outputs(table["morris"])
        columns.append(Column(key=f"{name}_mu_star", heading=f"{output.name} mu* ({output.unit})", form="{:.2f}",
                              scale=output.scale))
        columns += [Column(key=f"{name}_{key}", heading=words, form="{:.2f}", scale=output.scale)
                    for key, words in (("mu_star_conf", "±"), ("mu", "mu"), ("sigma", "sigma")) if main]
    return Grid(name="sensitivity_screening", columns=columns, rows=rows, caption=(
        "Morris' effects of the whole range, by the strength of the first output: mu* mean size, ± half of its 95 % "
        "interval, mu mean with signs, sigma standard deviation (interactions and curvature). Derivative: change of "
        "the resultant (root mean square) for half of the range, linear about the study's values."))


def condition_grid(table: Mapping[str, Any]) -> Grid:
    """mu* of the first main output by condition."""
    name = shown_outputs(table["morris"])[0]
    output, factors = OUTPUTS[name], [row["name"] for row in table["factors"]]
    effects = table["morris_by_condition"][name]
    rows = []
    for factor in table["ranking"][name][:_MOST_BY_CONDITION]:
        i = factors.index(factor)
        rows.append({"factor": factor} | {f"condition_{n}": None if one is None else one[i]
                                          for n, one in enumerate(effects)})
    columns = [Column(key="factor", heading="factor"), *(
        Column(key=f"condition_{n}", heading=f"{one['fulcrum_mm']:g} mm ({one['label']})", form="{:.2f}",
               scale=output.scale) for n, one in enumerate(table["conditions"]))]
    return Grid(name="sensitivity_conditions", columns=columns, rows=rows,
                caption=f"mu* of the {output.name} ({output.unit}) at each fulcrum position.")


def index_grid(table: Mapping[str, Any], key: str) -> Grid:
    """Sobol indices of groups ("sobol") or of single factors ("sobol_factors") for the main outputs."""
    names, what = shown_outputs(table[key]), "group" if key == "sobol" else "factor"
    first = table[key][names[0]]
    found = {name: {row["name"]: row for row in table[key][name]} for name in names}
    rows = [{"name": one["name"]} | {f"{name}_{part}": found[name][one["name"]][part] for name in names
                                     for part in ("s1", "s1_conf", "st", "st_conf")}
            for one in sorted(first, key=lambda row: -row["st"])]
    columns = [Column(key="name", heading=what)]
    for name in names:
        columns += [Column(key=f"{name}_{part}", heading=words, form="{:.2f}") for part, words in (
            ("s1", f"{OUTPUTS[name].name}: first order"), ("s1_conf", "±"), ("st", "total"), ("st_conf", "±"))]
    return Grid(name=f"sensitivity_{what}_indices", columns=columns, rows=rows,
                caption=f"Sobol indices by {what} ({_indexed(table)}), ± half of the 95 % bootstrap interval.")



def factor_grid(table: Mapping[str, Any]) -> Grid:
    """What was varied, how far, and why so far."""
    return Grid(name="sensitivity_factors", rows=table["factors"], caption=(
        "What was varied. mm, deg and 1 are added to the study's value; × multiplies it (sampled evenly in the "
        "logarithm)."),
        columns=(Column(key="name", heading="factor"), Column(key="group", heading="group"),
                 Column(key="low", heading="from", form="{:.3g}"), Column(key="high", heading="to", form="{:.3g}"),
                 Column(key="unit", heading="unit"), Column(key="why", heading="why so far")))


# Names, units and colours of the sensitivity chapter.


@dataclass(frozen=True)
class Output:
    """How an output of the study is shown: its name, unit, scale of the stored value, and number format."""

    name: str
    unit: str
    scale: float = 1.0
    form: str = "{:.2f}"

    def shown(self, value: float | None, *, unit: bool = True) -> str:
        """The value in words; an en dash where it is unknown."""
        if value is None:
            return "–"
        return self.form.format(self.scale * value) + (f" {self.unit}" if unit else "")


OUTPUTS = {
    "grf_rmse_bw": Output("resultant GRF error", "% BW", 100.0, "{:.1f}"),
    "cop_rmse_fl": Output("CoP error", "% foot length", 100.0, "{:.2f}"),
    "cop_shift_mm": Output("mean CoP shift", "mm", 1.0, "{:.1f}"),
    "peak_vertical_bw": Output("peak vertical force", "% BW", 100.0, "{:.1f}"),
    "spring_stored_j": Output("energy stored", "J"),
    "spring_returned_j": Output("energy returned", "J"),
    "spring_return_ratio": Output("return ratio", "%", 100.0, "{:.2f}"),
    "keel_stored_j": Output("energy stored in the keel alone", "J"),
}
MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""What the chapter draws."""
GROUPS = {  # colours of Okabe and Ito, told apart with any colour vision, and a hatch each for grey print
    "kinematics": ("#D55E00", ""), "geometry": ("#E69F00", "///"), "bushing": ("#009E73", "..."),
    "contact": ("#0072B2", "\\\\\\"), "friction": ("#56B4E9", "ooo"), "keel": ("#CC79A7", "xxx")}
_OTHER = ("0.5", "")


def look(group: str) -> dict[str, Any]:
    """Colour and hatch of a group's bars."""
    colour, hatch = GROUPS.get(group, _OTHER)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}


def shown_outputs(rows_by_output: Mapping[str, Sequence[Any] | None]) -> list[str]:
    """The MAIN outputs of which there are rows."""
    return [name for name in MAIN if rows_by_output.get(name)]


def top(rows: Sequence[Mapping[str, Any]], key: str, most: int) -> list[Mapping[str, Any]]:
    """The rows with the largest values of `key`, falling."""
    return sorted(rows, key=lambda row: -row[key])[:most]
