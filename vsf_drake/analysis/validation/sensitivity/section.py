"""Sensitivity of GRF error, centre of pressure and energy return to what one does not know of a walk's model.

Every factor is screened with Morris' elementary effects; the groups of factors, and the strongest single ones, then
get Sobol indices. The screening walks one trial a condition, a held-out one where there is one, and gives effects on
the mean of these and by condition. Indices are of the middle condition's trial alone, which allows more points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vsf_drake.analysis.validation.sensitivity.factors import Factor, sensitivity_factors
from vsf_drake.analysis.validation.sensitivity.local import local_changes
from vsf_drake.analysis.validation.sensitivity.rows import (
    Walked,
    agreement,
    dropped_samples,
    explained,
    index_rows,
    interaction,
    known,
    spread,
    stability,
)
from vsf_drake.analysis.validation.sensitivity.screening import Design, morris_design, morris_rows, ranked, sobol_design
from vsf_drake.analysis.validation.sensitivity.walks import OUTPUTS, DesignWalks, workers
from vsf_drake.analysis.validation.study import HELD_OUT, Progress, Section, Study, StudyWalk

MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""The outputs by which the strongest factors are chosen: those that the question is about."""
TRAJECTORIES, QUICK_TRAJECTORIES = 16, 5
GROUP_SAMPLES, FACTOR_SAMPLES = 512, 256
STRONGEST = 8
"""How many single factors get Sobol indices."""
_QUOTED = 5
"""Failures that the table keeps in words."""


def sensitivity_section(study: Study, *, progress: Progress | None = None) -> Section:
    """The sensitivity study; in its short form the screening of one walk alone.

    Returns:
        A table without arrays. By output: `baseline` (as the study has it, `mean` and `by_condition`), `morris` (rows
        of factors with mu, mu_star, mu_star_conf, sigma), `morris_by_condition` (mu* by condition and factor),
        `stability` (lowest rank correlation of mu* between two conditions), `ranking` (names by mu*), `sobol` (rows of
        groups with s1, st, their conf and wide, or None), `sobol_factors` (the same of `strongest`), `interaction` and
        `interaction_conf` (share of the variance that is of no group alone), `spread` (percentiles with everything
        uncertain), `explained` (variance with only the strongest varied over that with all varied).
        Else: `factors` (name, group, unit, low, high, why, and local_grf_bw: change of the resultant for half the
        range, by exact derivatives; None in the short form, which spares compiling them), `local_agreement` (rank
        correlation of that and the screening, or None), `conditions`,
        `indexed` (the place of the one that indices and spread are of), `walks`, `unconverged`, `failures` (count,
        examples, and by output what was dropped), `trajectories`, `samples`, `seed`, `quick`, `synthetic`.
    """
    quick, seed = study.options.quick, study.options.seed
    chosen = chosen_walks(study, one=quick)
    show = progress or (lambda what, fraction: None)
    show("as the study is" if quick else "exact derivatives", 0.0)
    with workers(study.options.workers) as (executor, count):
        walks = DesignWalks(chosen, executor=executor, count=count)
        factors = sensitivity_factors(walks.variables[0], chosen[0].trial.subject.prosthetic_side)
        names, middle = [factor.name for factor in factors], len(chosen) // 2
        baseline, local = walks.baseline(), None if quick else local_changes(walks, factors)
        screen = morris_design(names, QUICK_TRAJECTORIES if quick else TRAJECTORIES, seed)
        runs = _Runs(walks, show, len(screen.points) * len(chosen) + (0 if quick else (
            GROUP_SAMPLES * (len({factor.group for factor in factors}) + 2) + FACTOR_SAMPLES * (STRONGEST + 2))))
        screened = runs(screen, factors, "screening", range(len(chosen)))
        morris = {name: morris_rows(screen, screened.of(i), seed) for i, name in enumerate(OUTPUTS)}
        strongest = strongest_factors(morris)
        grouped = single = None
        if not quick:
            design = sobol_design(names, GROUP_SAMPLES, seed + 1, groups=[factor.group for factor in factors])
            grouped = runs(design, factors, "Sobol indices of groups", [middle])
        if not quick and strongest:
            few = [factor for factor in factors if factor.name in strongest]
            design = sobol_design([factor.name for factor in few], FACTOR_SAMPLES, seed + 2)
            single = runs(design, few, "Sobol indices of factors", [middle])
    conditions = [{name: _sizes(morris_rows(screen, screened.values[:, t, i], seed)) for i, name in enumerate(OUTPUTS)}
                  for t in range(len(chosen))]
    table: dict[str, Any] = {
        "factors": [factor.row() | {"local_grf_bw": None if local is None else float(local[i])}
                    for i, factor in enumerate(factors)],
        "conditions": [{"label": walk.label, "fulcrum_mm": walk.fulcrum_mm, "role": walk.role} for walk in chosen],
        "indexed": middle, "local_agreement": agreement(_sizes(morris["grf_rmse_bw"]), local), "strongest": strongest,
        "walks": walks.walked, "unconverged": walks.unconverged, "trajectories": len(screen.points) // screen.block,
        "samples": None if quick else {"groups": GROUP_SAMPLES, "factors": FACTOR_SAMPLES}, "seed": seed,
        "quick": quick, "synthetic": any(walk.trial.synthetic for walk in chosen),
        "sobol": index_rows(grouped, seed), "sobol_factors": index_rows(single, seed),
        "failures": {"count": len(walks.failures), "examples": walks.failures[:_QUOTED],
                     "dropped": dropped_samples(screened, grouped, single)},
        "morris": {name: None if rows is None else [row | {"group": factor.group} for row, factor in zip(
            rows, factors, strict=True)] for name, rows in morris.items()}}
    for i, name in enumerate(OUTPUTS):
        effects = [by_output[name] for by_output in conditions]
        whole, conf = interaction(table["sobol"][name])
        for key, value in {
            "baseline": {"mean": known(baseline[:, i].mean()), "by_condition": [known(x) for x in baseline[:, i]]},
            "morris_by_condition": effects, "stability": stability(effects), "ranking": ranked(morris[name], "mu_star"),
            "interaction": whole, "interaction_conf": conf, "spread": spread(grouped, i),
            "explained": explained(grouped, single, i)}.items():
            table.setdefault(key, {})[name] = value
    return Section(table=table, missing=_missing(table, chosen))


class _Runs:
    """Walks one design after the other and shows how far all of them are.

    Args:
        total: walks of all designs.
    """

    def __init__(self, walks: DesignWalks, show: Progress, total: int) -> None:
        self._walks, self._show, self._total, self._done = walks, show, total, 0

    def __call__(self, design: Design, factors: Sequence[Factor], what: str, trials: Sequence[int]) -> Walked:
        own = len(design.points) * len(trials)
        values = self._walks(design.points, factors=factors, trials=trials, progress=lambda fraction: self._show(
            what, min((self._done + fraction * own) / self._total, 1.0)))
        self._done += own
        return Walked(design, values)


def chosen_walks(study: Study, *, one: bool = False) -> tuple[StudyWalk, ...]:
    """One walk a condition: of those held out (of all, where none is) the one nearest to the middle of the repeats.

    Args:
        one: only that of the middle condition.
    """
    found = []
    for repeats in study.conditions().values():
        held = [i for i, walk in enumerate(repeats) if walk.role == HELD_OUT] or range(len(repeats))
        found.append(repeats[min(held, key=lambda i: abs(i - (len(repeats) - 1) / 2))])
    return (found[len(found) // 2],) if one else tuple(found)


def strongest_factors(morris: Mapping[str, Sequence[Mapping[str, Any]] | None]) -> list[str]:
    """The STRONGEST names by their largest share of the largest mu* of any of the MAIN outputs, strongest first."""
    share: dict[str, float] = {}
    for output in MAIN:
        rows = morris[output] or ()
        most = max((row["mu_star"] for row in rows), default=0.0)
        for row in rows if most > 0.0 else ():
            share[row["name"]] = max(share.get(row["name"], 0.0), row["mu_star"] / most)
    return sorted(share, key=lambda name: -share[name])[:STRONGEST]


def _sizes(rows: Sequence[Mapping[str, Any]] | None) -> list[float] | None:
    """mu* by factor."""
    return None if rows is None else [row["mu_star"] for row in rows]


def _missing(table: Mapping[str, Any], chosen: Sequence[StudyWalk]) -> tuple[str, ...]:
    sentences = []
    if table["quick"]:
        sentences.append(f"Short form: one walk, {table['trajectories']} trajectories of Morris' screening, no Sobol "
                         "indices, no derivatives and no comparison of conditions.")
    elif len(table["conditions"]) < 2:
        sentences.append("One condition only: whether the ranking holds at other fulcrum positions is not known.")
    without = [walk.label for walk in chosen if not walk.trial.prosthetic_plate.has_cop]
    if without:
        sentences.append(f"No centre of pressure was measured in {', '.join(without)}: there is no sensitivity of its "
                         "error.")
    if table["failures"]["count"]:
        sentences.append(f"{table['failures']['count']} of {table['walks']} walks failed. What they belong to (a "
                         "Morris trajectory, a block of Saltelli's design) was left out as a whole; where extreme "
                         "points fail, the rest says less about extremes.")
    return (*sentences, *(f"No effects on {name}: too few walks have it." for name in OUTPUTS
                          if table["morris"][name] is None and not (without and name.startswith("cop_"))))
