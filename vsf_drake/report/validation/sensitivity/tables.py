"""Tables of the sensitivity chapter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Column, Grid
from vsf_drake.report.validation.sensitivity.words import OUTPUTS, shown_outputs

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


def _indexed(table: Mapping[str, Any]) -> str:
    """The trial that indices and percentiles are of."""
    return str(table["conditions"][table["indexed"]]["label"])


def factor_grid(table: Mapping[str, Any]) -> Grid:
    """What was varied, how far, and why so far."""
    return Grid(name="sensitivity_factors", rows=table["factors"], caption=(
        "What was varied. mm, deg and 1 are added to the study's value; × multiplies it (sampled evenly in the "
        "logarithm)."),
        columns=(Column(key="name", heading="factor"), Column(key="group", heading="group"),
                 Column(key="low", heading="from", form="{:.3g}"), Column(key="high", heading="to", form="{:.3g}"),
                 Column(key="unit", heading="unit"), Column(key="why", heading="why so far")))
