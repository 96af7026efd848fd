"""What a tuning found, the way to it, and both as records: what `tuning.json` and `tuning.npz`
hold."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vsf_drake.base.errors import FitError
from vsf_drake.base.schema import to_plain
from vsf_drake.base.tables import Headline, LabelledArrays, Quantity, Tabular
from vsf_drake.simulation.archive import provenance
from vsf_drake.tuning import table as t
from vsf_drake.tuning.common import RECORDED, SETTINGS, WEIGHTED, Checks, digests, least_seen
from vsf_drake.tuning.costs import CONSISTENCY
from vsf_drake.tuning.problem import StiffnessTuning, TuningEvaluation
from vsf_drake.tuning.quantities import GIVEN_OUTCOMES, GIVEN_TERMS, SAME_LOAD
from vsf_drake.tuning.sweep import SettingSweep
from vsf_drake.tuning.uncertainty import Worth, difference

AT_BOUND = 1e-3  # share of a bound's width within which a variable counts as on the bound


@dataclass(frozen=True, eq=False)
class TuningSearch:
    """How one search from `start` to x (P,) ended."""

    solver: str
    step_s: float
    start: np.ndarray
    x: np.ndarray
    cost: float  # inf where the walk fails
    success: bool  # whether it ended at a minimum
    message: str
    iterations: int  # evaluations by the solver
    optimality: float
    """largest component of the projected gradient, in sizes of the cost over a bound's width"""


@dataclass(kw_only=True, eq=False)
class TuningSolution(Tabular):
    """The end of a tuning; what had not been reached when it was interrupted is empty or None."""

    tuning: StiffnessTuning
    success: bool = False
    """whether a search ended at a minimum that the sweep confirms, where all walks converged"""
    message: str = ""  # how it ended, in words
    best: TuningEvaluation = field(init=False)  # the best point found, whatever `success` says
    searched: TuningSearch | None = None  # the search that `best` is from
    searches: list[TuningSearch] = field(default_factory=list)  # of the fulcrum's range
    confirmed: list[TuningSearch] = field(default_factory=list)  # by other solvers
    sweep: SettingSweep | None = None  # through the best setting
    compared: SettingSweep | None = None
    """of SETTINGS, the recorded one each trial's own, the device as it is"""
    same_load: dict[str, np.ndarray] = field(default_factory=dict)  # SAME_LOAD by name, (T, 4)
    worth: Worth | None = None  # how well the position is known, and what it is worth
    draws: list[SettingSweep] = field(default_factory=list)  # by draw of the contact
    draw_failures: list[str] = field(default_factory=list)  # why some could not be walked
    pareto: list[t.ParetoPoint] = field(default_factory=list)
    robustness: list[t.ChangedOptimum] = field(default_factory=list)
    along: tuple[t.AlongPoint, ...] = ()  # the cost along the person's own answer, `along`
    checks: Checks = field(default_factory=lambda: Checks(1))
    notes: list[str] = field(default_factory=list)  # what a reader has to know
    wall_s: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """What was tuned, by name, in the units of `tuning.design`. FitError if the tuning
        failed."""
        if not self.success:
            raise FitError(f"the tuning did not come to an optimum: {self.message}")
        return {
            variable.name: float(x)
            for variable, x in zip(self.tuning.design, self.best.x, strict=True)
        }

    @property
    def fulcrum_mm(self) -> float:
        return self.values["fulcrum"]

    @property
    def cost(self) -> float:
        return self.best.cost if self.values else float("nan")

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of what ended on a bound, whether the tuning failed or not."""
        u = self.tuning.to_u(self.best.x)
        return tuple(
            variable.name
            for variable, at in zip(self.tuning.design, u, strict=True)
            if at < AT_BOUND or at > 1.0 - AT_BOUND
        )

    def labelled(self) -> LabelledArrays:
        """The sweep of the fulcrum through the optimum: the cost, its terms and the outcomes of
        each trial."""
        swept = self.sweep
        combination = self.tuning.combination
        if not self.values or swept is None:  # `values` raises for a tuning that failed
            raise FitError("the tuning was ended before its sweep")
        dims = ("fulcrum_mm", "trial")
        named = {"cost": (swept.cost, combination.label, combination.unit)}
        for name, each in swept.terms.items():
            named[f"term_{name}"] = each.T, GIVEN_TERMS[name].label, combination.unit
        for name, each in swept.outcomes.items():
            named[name] = each.T, *GIVEN_OUTCOMES[name]
        quantities = [
            Quantity(name=name, values=values, dims=dims[: values.ndim], unit=unit, meaning=label)
            for name, (values, label, unit) in named.items()
        ]
        fulcrum = Quantity(
            name="fulcrum_mm",
            values=swept.fulcrum_mm,
            dims=dims[:1],
            unit="mm",
            meaning="fulcrum from the keel's posterior end",
        )
        return LabelledArrays(
            labels={"fulcrum_mm": fulcrum, "trial": self.tuning.labels},
            quantities=quantities,
            about={
                "cost_name": self.tuning.cost_name,
                "optimum_mm": self.fulcrum_mm,
                "synthetic": self.tuning.synthetic,
            },
        )

    def headline(self) -> Headline:
        """The optimum, its cost, and how well its position is known."""
        tuning = self.tuning
        known = self.worth.interval_mm if self.worth else None
        facts = [
            (variable.name, float(x), variable.unit)
            for variable, x in zip(tuning.design, self.best.x, strict=True)
        ]
        facts += [(tuning.combination.label, self.best.cost, tuning.combination.unit)]
        facts += (
            [("Fulcrum known from", known[0], "mm"), ("Fulcrum known to", known[1], "mm")]
            if known
            else []
        )
        return Headline(
            kind="Tuning",
            name=", ".join(tuning.labels),
            failure="" if self.success else self.message,
            synthetic=tuning.synthetic,
            facts=facts if self.success else (),
        )


def tuning_table(solution: TuningSolution) -> t.TuningTable:
    """The content of `tuning.json`; of a tuning that failed `optimal` is false."""
    tuning = solution.tuning
    best = solution.best
    swept = solution.sweep
    worth = solution.worth
    searched = solution.searched
    combination = tuning.combination
    inputs = digests(tuning.labels, tuning.trials)
    weighted = combination.factors if tuning.cost_name == WEIGHTED else {}
    shares = {name: f"{factor:.3g} × " for name, factor in weighted.items()}
    return t.as_saved(
        t.TuningTable(
            format=t.FORMAT,
            level=1,
            cost_name=tuning.cost_name,
            cost_label=combination.label,
            cost_unit=combination.unit,
            optimal=solution.success,
            status=solution.message,
            fulcrum_mm=float(best.x[0]),
            cost=best.cost,
            at_bound=solution.at_bound,
            fulcrum_interval_mm=worth.interval_mm if worth else None,
            interval_meaning=worth.interval_meaning if worth else "",
            design=tuple(
                t.DesignValue(v.name, v.unit, float(x), v.low, v.high, v.default)
                for v, x in zip(tuning.design, best.x, strict=True)
            ),
            terms=tuple(
                t.Term(name, shares.get(name, "") + GIVEN_TERMS[name].label, float(term[0]))
                for name, term in best.terms.items()
            ),
            sweep=tuple(
                t.SweepPoint(
                    float(mm), float(cost), _means(swept.terms, j), _means(swept.outcomes, j)
                )
                for j, (mm, cost) in enumerate(zip(swept.fulcrum_mm, swept.cost, strict=True))
            )
            if swept
            else (),
            outcomes=tuple(_outcomes(solution)),
            solver=t.SolverEnd(
                name=searched.solver if searched else None,
                message=searched.message if searched else solution.message,
                iterations=searched.iterations if searched else None,
                evaluations=tuning.evaluations,
                optimality=searched.optimality if searched else None,
            ),
            confirmed_by=tuple(
                t.Confirmation(s.solver, float(s.x[0]), s.cost, s.success, s.message)
                for s in solution.confirmed
            ),
            starts=tuple(
                t.SearchEnd(float(s.start[0]), float(s.x[0]), s.cost, s.success)
                for s in solution.searches
            ),
            checks=tuple(solution.checks),
            pareto=tuple(solution.pareto),
            pareto_names=tuning.options.pareto if solution.pareto else (),
            robustness=tuple(solution.robustness),
            along=solution.along,
            trials=tuning.labels,
            recorded_mm=tuple(float(part.own[0]) for part in tuning.parts),
            synthetic=tuning.synthetic,
            notes=tuple(solution.notes),
            wall_s=solution.wall_s,
            provenance=t.Provenance(
                options=to_plain(tuning.options),
                **provenance(inputs, tuning.options.seed),
            ),
        )
    )


def _means(values: dict[str, np.ndarray], position: int) -> dict[str, float | None]:
    return {name: float(each[:, position].mean()) for name, each in values.items()}


def _outcomes(solution: TuningSolution) -> list[t.Outcome]:
    """Means over trials; `uncertainty`: standard deviation over repeated trials of an outcome's
    range."""
    tuning = solution.tuning
    swept = solution.sweep
    worth = solution.worth
    rows: list[t.Outcome] = []
    if swept is not None and worth is not None:
        rows.append(
            t.Outcome(
                name="cost",
                label="whole cost"
                + ", what holds it included" * (CONSISTENCY in tuning.combination.factors),
                unit=tuning.combination.unit,
                softest=float(swept.cost[0]),
                optimum=solution.best.cost,
                stiffest=float(swept.cost[-1]),
                recorded=tuning.own_cost,
                uncertainty=worth.uncertainty,
                matters=worth.matters,
                sentence=worth.sentence,
            )
        )
    for name, each in (
        solution.compared.outcomes | solution.same_load if solution.compared else {}
    ).items():
        label, unit = (GIVEN_OUTCOMES | SAME_LOAD)[name]
        at = dict(zip(SETTINGS, each.mean(axis=0).tolist(), strict=True))
        change = difference(swept.outcomes.get(name, each) if swept else each, tuning.groups)
        known = name in GIVEN_OUTCOMES or bool(np.isfinite(each).all())
        rows.append(
            t.Outcome(
                name=name,
                label=label,
                unit=unit,
                **at,
                uncertainty=change.spread,
                matters=change.matters(least_seen(at.values(), unit)) if known else None,
            )
        )
    return rows


def tuning_arrays(solution: TuningSolution) -> dict[str, np.ndarray]:
    """The content of `tuning.npz`: arrays by name.

        sweep_mm (m,), sweep_cost_trials (m, T)         the tuned cost
        sweep_term_NAME, sweep_cost_NAME, sweep_outcome_NAME (m, T)
        draw_mm (d,), draw_cost (d, D)                  of drawn contacts
        grf_time (n,) s, grf_softest, grf_optimum, grf_stiffest, grf_recorded (n, 3) N in W
                                                        of the trial whose own position is
                                                        nearest to the optimum
        trial_K_time, trial_K_softest, ...              the same of every trial, K counting from 0

    T trials in the order of the table. `recorded` is the plate where there is one, else the model
    at the own setting.
    """
    tuning = solution.tuning
    swept = solution.sweep
    arrays: dict[str, np.ndarray] = {}
    if swept is not None:
        arrays |= {"sweep_mm": swept.fulcrum_mm, "sweep_cost_trials": swept.per_trial.T}
        for kind, rows in (
            ("term", swept.terms),
            ("cost", swept.costs),
            ("outcome", swept.outcomes),
        ):
            arrays |= {f"sweep_{kind}_{name}": value.T for name, value in rows.items()}
    if solution.draws:
        arrays["draw_mm"] = solution.draws[0].fulcrum_mm
        arrays["draw_cost"] = np.array([draw.cost for draw in solution.draws]).T
    nearest = int(np.argmin([abs(part.own[0] - solution.best.x[0]) for part in tuning.parts]))
    forces = solution.compared.forces if solution.compared else {}
    for i, part in enumerate(tuning.parts if forces else ()):
        frame = part.frame(tuning.options.step_s)
        shown = {"time": frame.time_s} | {
            name: forces[i, s] for s, name in enumerate(SETTINGS) if (i, s) in forces
        }
        shown |= {} if frame.plate_W is None else {RECORDED: frame.plate_W}
        for prefix in (f"trial_{i}_", *(["grf_"] if i == nearest else [])):
            arrays |= {f"{prefix}{name}": force for name, force in shown.items()}
    return arrays
