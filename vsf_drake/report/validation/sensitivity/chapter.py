"""The sensitivity chapter: what of the model's uncertainty matters for force, centre of pressure and keel energy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Bullets, Chapter, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.sensitivity.indices_figure import indices_figure
from vsf_drake.report.validation.sensitivity.screening_figure import MOST, screening_figure
from vsf_drake.report.validation.sensitivity.tables import (
    condition_grid,
    factor_grid,
    index_grid,
    output_grid,
    screening_grid,
)
from vsf_drake.report.validation.sensitivity.words import OUTPUTS, shown_outputs, top

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
