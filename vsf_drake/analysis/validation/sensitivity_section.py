"""Sensitivity of GRF error, centre of pressure and energy return to what one does not know of a walk's model.

Every factor is screened with Morris' elementary effects; the groups of factors, and the strongest single ones, then
get Sobol indices. The screening walks one trial a condition, a held-out one where there is one, and gives effects on
the mean of these and by condition. Indices are of the middle condition's trial alone, which allows more points.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from vsf_drake.analysis.comparison import compare_sensitivity
from vsf_drake.analysis.validation.sensitivity_walks import (
    AT_ONCE,
    OUTPUTS,
    Design,
    DesignWalks,
    Factor,
    dropped,
    morris_design,
    morris_rows,
    ranked,
    sensitivity_factors,
    sobol_design,
    sobol_rows,
    values_at,
)
from vsf_drake.analysis.validation.study import HELD_OUT, STEP_S, Progress, Section, Study, StudyWalk
from vsf_drake.files import plain
from vsf_drake.parameters import GRAVITY
from vsf_drake.sentences import say
from vsf_drake.simulation.many.processes import chosen

MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""The outputs by which the strongest factors are chosen: those that the question is about."""
TRAJECTORIES, QUICK_TRAJECTORIES = 16, 5
GROUP_SAMPLES, FACTOR_SAMPLES = 512, 256
STRONGEST = 8
"""How many single factors get Sobol indices."""
_QUOTED = 5
"""Failures that the table keeps in words."""


def sensitivity_section(study: Study, *, progress: Progress | None = None) -> Section:
    """The sensitivity study; in its short form the screening of one walk alone. A table without arrays.

    By output: `baseline` (as the study has it, `mean` and `by_condition`), `morris` (rows of factors with mu, mu_star,
    mu_star_conf, sigma), `morris_by_condition` (mu* by condition and factor), `stability` (lowest rank correlation of
    mu* between two conditions), `ranking` (names by mu*), `sobol` (rows of groups with s1, st, their conf and wide, or
    None), `sobol_factors` (the same of `strongest`), `interaction` and `interaction_conf` (share of the variance that
    is of no group alone), `spread` (percentiles with everything uncertain), `explained` (variance with only the
    strongest varied over that with all varied).
    Else: `factors` (with local_grf_bw: change of the resultant for half the range, by exact derivatives; None in the
    short form, which spares compiling them), `local_agreement` (rank correlation of that and the screening, or None),
    `conditions`, `indexed` (the place of the one that indices and spread are of), `walks`, `unconverged`, `failures`
    (count, examples, and by output what was dropped), `trajectories`, `samples`, `seed`, `quick`, `synthetic`.
    """
    quick, seed = study.options.quick, study.options.seed
    walked = chosen_walks(study, one=quick)
    show = progress or (lambda what, fraction: None)
    show("as the study is" if quick else "exact derivatives", 0.0)
    with chosen(study.options.workers, None, AT_ONCE) as (executor, most):
        walks = DesignWalks(walked, executor=executor, count=max(1, most // 2))
        factors = sensitivity_factors(walks.variables[0], walked[0].trial.subject.prosthetic_side)
        names, middle = [factor.name for factor in factors], len(walked) // 2
        baseline, local = walks.baseline(), None if quick else local_changes(walks, factors)
        screen = morris_design(names, QUICK_TRAJECTORIES if quick else TRAJECTORIES, seed)
        total = len(screen.points) * len(walked) + (0 if quick else (
            GROUP_SAMPLES * (len({factor.group for factor in factors}) + 2) + FACTOR_SAMPLES * (STRONGEST + 2)))

        def run(design: Design, own: Sequence[Factor], what: str, trials: Sequence[int]) -> Walked:
            done, size = walks.walked - len(walked), len(design.points) * len(trials)
            return Walked(design, walks(design.points, factors=own, trials=trials, progress=lambda fraction: show(
                what, min((done + fraction * size) / total, 1.0))))

        screened = run(screen, factors, "screening", range(len(walked)))
        morris = {name: morris_rows(screen, screened.of(i), seed) for i, name in enumerate(OUTPUTS)}
        strongest = strongest_factors(morris)
        few = [factor for factor in factors if factor.name in strongest]
        grouped = None if quick else run(
            sobol_design(names, GROUP_SAMPLES, seed + 1, groups=[factor.group for factor in factors]), factors,
            "Sobol indices of groups", [middle])
        single = None if quick or not few else run(
            sobol_design([factor.name for factor in few], FACTOR_SAMPLES, seed + 2), few, "Sobol indices of factors",
            [middle])
    table: dict[str, Any] = {
        "factors": [{key: value for key, value in dataclasses.asdict(factor).items() if key != "kind"}
                    | {"local_grf_bw": None if local is None else local[i]} for i, factor in enumerate(factors)],
        "conditions": [{"label": walk.label, "fulcrum_mm": walk.fulcrum_mm, "role": walk.role} for walk in walked],
        "indexed": middle, "strongest": strongest, "walks": walks.walked, "unconverged": walks.unconverged,
        "trajectories": len(screen.points) // screen.block,
        "samples": None if quick else {"groups": GROUP_SAMPLES, "factors": FACTOR_SAMPLES}, "seed": seed,
        "quick": quick, "synthetic": any(walk.trial.synthetic for walk in walked),
        "local_agreement": None if morris["grf_rmse_bw"] is None or local is None else spearmanr(
            [row["mu_star"] for row in morris["grf_rmse_bw"]], local).statistic,
        "failures": {"count": len(walks.failures), "examples": walks.failures[:_QUOTED], "dropped": {}}}
    for i, name in enumerate(OUTPUTS):
        own = morris[name]
        by_condition = [morris_rows(screen, screened.values[:, t, i], seed) for t in range(len(walked))]
        effects = [None if rows is None else [row["mu_star"] for row in rows] for rows in by_condition]
        groups, singles = (part and sobol_rows(part.design, part.of(i), seed) for part in (grouped, single))
        table["failures"]["dropped"][name] = {what: part and dropped(part.design, part.of(i)) for what, part in (
            ("trajectories", screened), ("group_blocks", grouped), ("factor_blocks", single))}
        for key, value in {
            "sobol": groups, "sobol_factors": singles,
            "morris": own and [row | {"group": factor.group} for row, factor in zip(own, factors, strict=True)],
            "baseline": {"mean": baseline[:, i].mean(), "by_condition": baseline[:, i]},
            "morris_by_condition": effects, "stability": stability(effects), "ranking": ranked(own, "mu_star"),
            # What no index of first order has, and half of its 95 % interval (as if they erred independently).
            "interaction": groups and 1.0 - sum(row["s1"] for row in groups),
            "interaction_conf": groups and np.linalg.norm([row["s1_conf"] for row in groups]),
            "spread": spread(grouped, i), "explained": explained(grouped, single, i)}.items():
            table.setdefault(key, {})[name] = value
    without = [walk.label for walk in walked if not walk.trial.prosthetic_plate.has_cop]
    return Section(table=plain(table), missing=tuple(say(
        "sensitivity", "missing", quick=quick, trajectories=table["trajectories"], conditions=len(walked),
        without_cop=without, failed=len(walks.failures), walks=walks.walked, without_effects=[
            name for name in OUTPUTS if morris[name] is None and not (without and name.startswith("cop_"))])))


def chosen_walks(study: Study, *, one: bool = False) -> tuple[StudyWalk, ...]:
    """One walk a condition, or only the middle condition's: the held-out one (any, where none is) nearest to the middle
    of the repeats."""
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


# What each factor does about the study's values, by exact derivatives: a second way to the same, without sampling.

_LEAST_N = 1.0
"""Below this a resultant's direction, and with it its derivative, means nothing."""
_DIFFERENCE = 1e-4
"""Share of a range over which the values' slopes are taken; they are smooth and known in closed form."""


def value_slopes(walks: DesignWalks, factors: Sequence[Factor], trial: int) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the variables that the factors change, and (variables, k) d value / d share in the middle of the ranges.
    """
    def values(shares: np.ndarray) -> dict[str, float]:
        return values_at(factors, shares, walks.variables[trial], walks.limits[trial])

    middle, step = np.full(len(factors), 0.5), 0.5 * _DIFFERENCE * np.eye(len(factors))
    slopes = [(np.array([*values(middle + one).values()]) - np.array([*values(middle - one).values()])) / _DIFFERENCE
              for one in step]
    return tuple(values(middle)), np.column_stack(slopes)


def local_changes(walks: DesignWalks, factors: Sequence[Factor]) -> np.ndarray:
    """(k,) root mean square change of the resultant GRF (BW, 40 Hz, scored instants) for half of each range: linear,
    about the study's values, mean over the trials."""
    found = []
    for t, walk in enumerate(walks.walks):
        trial, walker = walk.trial, walks.walkers[t]
        names, slopes = value_slopes(walks, factors, t)
        run = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                          step_s=STEP_S, offsets=trial.offsets, with_respect_to=names)
        assert run.sensitivity is not None
        c = walks.scorers[t].comparison
        by = compare_sensitivity(c, walks.scorers[t].result, run.sensitivity).model[c.scored] @ slopes
        force = c.model[c.scored]
        way = force / np.maximum(np.linalg.norm(force, axis=1), _LEAST_N)[:, None]
        change = 0.5 * np.einsum("ni,nik->nk", way, by) / (trial.subject.mass_kg * GRAVITY)
        found.append(np.sqrt(np.mean(change**2, axis=0)))
    return np.asarray(np.mean(found, axis=0))


# What is read off the walked designs of the sensitivity study, by output.

PERCENTILES = (5, 50, 95)


@dataclass(frozen=True, eq=False)
class Walked:
    """A design and `values` (rows, trials, len(OUTPUTS)) at its points, NaN where unknown."""

    design: Design
    values: np.ndarray

    def of(self, output: int) -> np.ndarray:
        """(rows,) mean of an output over the trials."""
        return np.asarray(self.values[:, :, output].mean(axis=1))

    def independent(self, output: int) -> np.ndarray:
        """(n,) an output at the independent points of Saltelli's design: the first and the last of each whole block."""
        y = self.of(output)
        return y[self.design.whole(y)].reshape(-1, self.design.block)[:, [0, -1]].ravel()


def spread(walked: Walked | None, output: int) -> dict[str, float] | None:
    """Mean, standard deviation and PERCENTILES of an output over the uncertainty."""
    y = np.empty(0) if walked is None else walked.independent(output)
    if len(y) < 2:
        return None
    return {"mean": float(y.mean()), "sd": float(y.std(ddof=1)),
            **{f"p{p:02d}": float(np.percentile(y, p)) for p in PERCENTILES}}


def explained(every: Walked | None, few: Walked | None, output: int) -> float | None:
    """Variance with a few factors varied over that with every one varied."""
    if every is None or few is None:
        return None
    both = [walked.independent(output) for walked in (every, few)]
    return float(both[1].var() / both[0].var()) if min(map(len, both)) > 1 and both[0].var() > 0.0 else None


def stability(by_condition: Sequence[Sequence[float] | None]) -> float | None:
    """The lowest rank correlation of mu* between two conditions; None of fewer than two."""
    some = [effects for effects in by_condition if effects is not None]
    pairs = [spearmanr(some[i], some[j]).statistic for i in range(len(some)) for j in range(i)]
    return min(pairs) if pairs else None
