"""What a tuning of level 2 leaves on disk."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from vsf_drake.base.schema import to_plain
from vsf_drake.base.sentences import say
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.optimal_control.outcomes import outcomes
from vsf_drake.optimal_control.own import OwnStrides
from vsf_drake.optimal_control.search import (
    SAME_MM,
    Fixed,
    StrideSolution,
    StrideTuning,
    position_mm,
)
from vsf_drake.optimal_control.stride import MM, OWN, PACE, TYPICAL_ACTIVATION, Stride
from vsf_drake.simulation.archive import provenance
from vsf_drake.tuning import table as t
from vsf_drake.tuning.common import WEIGHTED, least_seen
from vsf_drake.tuning.quantities import FREE_OUTCOMES, FREE_TERMS
from vsf_drake.walks.answer import Answer, answer_sentences

UNITS = {"heel_stiffness": "1", "alignment_rad": "rad", "keel_thickness": "1", PACE: "s"}
"""Of FREE but for the fulcrum."""
# standard deviations over the drawn contacts by which an outcome's range must exceed to matter (a
# choice)
SURE = 2.0
LITTLE = 0.01
"""Share of the cost below which what a setting gains is called little, if the grid tells as little
apart (a choice)."""
# share of the cost by which ends of searches differ that are not the same stride (a choice)
APART = 1e-3
# share of the range that an interval may take and still be a recommendation (a choice)
DECIDED = 0.5


def stride_table(result: StrideSolution) -> t.TuningTable:
    """The content of `tuning.json`."""
    tuning = result.tuning
    best = result.shown
    names = tuning.options.weights if tuning.cost == WEIGHTED else (tuning.cost,)
    near = as_good(result)
    return t.as_saved(
        t.TuningTable(
            format=t.FORMAT,
            level=2,
            cost_name=tuning.cost,
            cost_label=" and ".join(FREE_TERMS[name].label for name in names),
            cost_unit="1",
            optimal=result.success,
            status=result.message,
            fulcrum_mm=position_mm(best),
            cost=best.last_cost,
            at_bound=best.at_bound if result.success else (),
            fulcrum_interval_mm=near,
            along=result.along,
            **_worth(result, near),
            design=tuple(_design(result, best)),
            terms=tuple(
                t.Term(name, _term_label(result, name), value) for name, value in best.terms.items()
            ),
            sweep=tuple(_swept(result, row) for row in result.sweep),
            outcomes=tuple(_outcomes(result)),
            solver=t.SolverEnd(
                "Gauss-Newton SQP",
                best.message,
                best.iterations,
                best.evaluations,
                best.optimality,
            ),
            confirmed_by=tuple(result.confirmed),
            starts=tuple(
                t.SearchEnd(mm, position_mm(s), s.last_cost, s.success) for mm, s in result.free
            ),
            checks=tuple(result.checks),
            pareto=(),
            pareto_names=(),
            robustness=tuple(_changed(result)),
            trials=tuning.labels,
            recorded_mm=_recorded_mm(tuning),
            own=tuning.answer is not None,
            synthetic=tuning.trial.synthetic,
            notes=tuple(_notes(result)),
            wall_s=result.wall_s,
            provenance=t.Provenance(
                options=to_plain(tuning.options), **provenance(tuning.trial.inputs)
            ),
        )
    )


def _swept(result: StrideSolution, row: Fixed) -> t.SweepPoint:
    solution = row.solution
    found: dict[str, Any] = {}
    if solution is not None:
        found = {"terms": solution.terms, "outcomes": outcomes(solution, result.search.stride)}
    return t.SweepPoint(
        row.fulcrum_mm,
        None if solution is None else solution.last_cost,
        walked=_walked(result, row.fulcrum_mm),
        equal_load=result.equal_load.get(row.fulcrum_mm, {}),
        **found,
    )


def _worth(result: StrideSolution, near: tuple[float, float] | None) -> dict[str, Any]:
    """What the interval of the optimum holds, and why no recommendation follows from it."""
    if near is None:
        return {"interval_meaning": "", "undecided": ""}
    unmet = {check.name: check for check in result.checks if check.met is False}
    unlike = [unmet[name] for name in ("tracking_force", "tracking_motion") if name in unmet]
    moves = [unmet[name] for name in ("hold",) if name in unmet]
    asked = result.asked_again
    failed = sum(not solution.success for solution in asked) + (result.grid_share is None)
    low, high = result.search.stride.reach_mm
    share = (near[1] - near[0]) / (high - low)
    meaning = say(
        "stride",
        "interval",
        little=as_little(result),
        grid_share=result.grid_share,
        result=result,
        failed=failed,
    )
    undecided = say(
        "stride",
        "undecided",
        near=t.whole_mm(*near),
        share=share,
        failed=failed,
        count=len(asked) + 1,
        unlike=unlike,
        own=bool(result.search.stride.own),
        moves=moves,
        wide=share > DECIDED,
    )
    return {
        "interval_meaning": meaning[0],
        "undecided": " ".join(undecided),
        "believed": not unlike,
    }


def _recorded_mm(tuning: StrideTuning) -> tuple[float, ...]:
    """Where the fulcrum was recorded."""
    if isinstance(tuning.recorded, OwnStrides):
        return tuple((tuning.recorded.answer.fulcrum_m / MM).tolist())
    return (tuning.stride.own_m / MM,)


def _walked(result: StrideSolution, fulcrum_mm: float) -> float | None:
    """The cost of the own stride at a position of the sweep, before it adapts; None without one."""
    search = result.search
    stride = search.stride
    for own in stride.own:
        if abs(position_mm(own) - fulcrum_mm) < SAME_MM:
            y = stride.function.evaluate(own.last.z, own.last.p)
            return sum(
                float(stride.grid.weights @ term.values(y))
                for term in stride.minimised(search.cost, search.sizes)
            )
    return None


def _design(result: StrideSolution, best: TrajectorySolution) -> Iterator[t.DesignValue]:
    """What was free, whether it is in this solution or not."""
    tuning = result.tuning
    stride = result.search.stride
    own_mm = stride.own_m / MM
    yield t.DesignValue("fulcrum", "mm", position_mm(best), *stride.reach_mm, default=own_mm)
    ends = best.problem.p_low, best.problem.p_high
    for i, (name, unit) in enumerate(UNITS.items(), start=1):
        of_stride = name == PACE and ends[0][i] < ends[1][i]
        if not of_stride and name not in tuning.options.design:
            continue
        scale = stride.grid.duration_s if of_stride else 1.0
        value, low, high, own = (float(scale * p[i]) for p in (best.last.p, *ends, OWN))
        yield t.DesignValue(
            "stride time" if of_stride else name,
            unit,
            value,
            low,
            high,
            default=None if of_stride and tuning.speed_m_per_s is not None else own,
        )


def _changed(result: StrideSolution) -> Iterator[t.ChangedOptimum]:
    """Where the optimum goes with drawn contacts and other weights of the hold."""
    again = {f"drawn contact {i + 1}": s for i, (s, _) in enumerate(result.drawn)}
    again |= {f"weight {held.weight:g} of the hold": held.free for held in result.held}
    for what, s in again.items():
        found = (position_mm(s), s.last_cost) if s.success else (None, None)
        yield t.ChangedOptimum(what, *found)


def _notes(result: StrideSolution) -> list[str]:
    tuning = result.tuning
    speeds = {"asked": tuning.speed_m_per_s, "recorded": tuning.stride.speed}
    ends = [[cost for cost in row.tried.values() if np.isfinite(cost)] for row in result.sweep]
    different = sum(max(costs) - min(costs) > APART * abs(min(costs)) for costs in ends if costs)
    lost = [row.fulcrum_mm for row in result.sweep if row.solution is None and row.tried]
    return [
        *([] if tuning.speed_m_per_s is None else say("stride", "speed", **speeds)),
        *say(
            "stride",
            "limits",
            tracks=tuning.cost == "tracking",
            own=tuning.answer is not None,
            draws=tuning.options.draws,
        ),
        *tuning.recorded.notes,
        *([] if tuning.answer is None else _answered(tuning.answer)),
        *result.untold,
        *say("stride", "sweep", lost=lost, different=different, count=len(result.sweep)),
    ]


def _answered(answer: Answer) -> list[str]:
    """How the person answers the setting, in words."""
    return [sentence.removeprefix("! ") for sentence in answer_sentences(answer.table())]


def stride_arrays(result: StrideSolution) -> dict[str, np.ndarray]:
    """The content of `tuning.npz`: motion, torque (N m) and force (N) over the phase, of the stride
    that the full model carried out, recorded and re-simulated; and what a search begins from
    again."""
    stride = result.search.stride
    best = result.shown.last
    grid = result.search.stride.grid
    carried = result.carried_out or result.shown
    each = carried.problem.grid.instants // grid.instants
    z = carried.last.z[::each]
    y = carried.last_y()[::each]
    function = stride.function
    recorded = result.tuning.stride.reference
    torque = function.starting_with("torque_")
    arrays = {
        "phase": grid.times_s / grid.duration_s,
        "names": np.array(function.layout.coordinates),
        "q": z[:, function.layout.q],
        "q_recorded": recorded.q,
        "torque": y[:, torque],
        "torque_recorded": result.tracked.last_y()[:, torque],
        "tracked_z": result.tracked.last.z,
        "tracked_p": result.tracked.last.p,
        "best_z": best.z,
        "best_p": best.p,
    }
    for foot, force in recorded.force.items():
        arrays[f"grf_{foot}"] = y[:, function.index(f"{foot}_fx", f"{foot}_fz")]
        if recorded.known[foot].all():
            arrays[f"grf_{foot}_recorded"] = force
    return arrays | {
        name: value[::each][: grid.instants] for name, value in result.simulated.items()
    }


def _term_label(result: StrideSolution, name: str) -> str:
    """A cost as it counts in the sum: with its share of the weights and over its size, so that it
    is not taken for the outcome of that name."""
    tuning = result.tuning
    weights = tuning.options.weights if tuning.cost == WEIGHTED else {tuning.cost: 1.0}
    sizes = {**result.search.sizes, "activation": TYPICAL_ACTIVATION}
    label = FREE_TERMS[name].label
    # which counts as it is
    if tuning.cost == "tracking" or name not in weights or name not in sizes:
        return label
    share = weights[name] / sum(weights.values())
    return f"{f'{share:.2g} × ' if share < 1.0 else ''}{label} / {abs(sizes[name]):.3g}"


def _outcomes(result: StrideSolution) -> list[t.Outcome]:
    """The cost and FREE_OUTCOMES, each setting with its best stride, and of the tracked recording.
    `uncertainty`: standard deviation over the drawn contacts together with the change on the finer
    grid, None where one of them is not known and where nothing was recorded to compare with."""

    def of(solution: TrajectorySolution, stride: Stride) -> dict[str, float]:
        return {"cost": solution.last_cost, **outcomes(solution, stride)}

    stride = result.search.stride
    over = [of(solution, stride) for _, solution in result.solved]
    if not over:
        return []
    best = of(result.shown, stride)
    own = of(result.at_recorded, stride) if result.at_recorded else None
    tracked = outcomes(result.tracked, result.consistent)  # it has another cost
    drawn = [of(solution, other) for solution, other in result.drawn if solution.success]
    finer = None
    if result.grid_share is not None and result.carried_out is not None:
        finer = of(
            result.carried_out, dataclasses.replace(stride, grid=result.carried_out.problem.grid)
        )
    rows = []
    for name, (label, unit) in {
        "cost": ("whole cost, what holds it included", "1"),
        **FREE_OUTCOMES,
    }.items():
        by_grid = np.nan if finer is None else abs(finer[name] - best[name])
        spread = (
            float(np.std([values[name] for values in drawn], ddof=1)) if len(drawn) > 1 else np.nan
        )
        error = float(np.hypot(spread, by_grid))
        values = [row[name] for row in over]
        change = max(values) - min(values)
        rows.append(
            t.Outcome(
                name=name,
                label=label,
                unit=unit,
                softest=values[0],
                optimum=best[name],
                stiffest=values[-1],
                recorded=own[name] if own else None,
                tracked=tracked.get(name),
                uncertainty=error,
                matters=_matters(change, least_seen(values, unit), by_grid, error),
            )
        )
    return rows


def _matters(change: float, least: float, by_grid: float, error: float) -> bool | None:
    """Whether a change over the range is more than `least` and the finer grid's and than what SURE
    allows of `error`; None where that is not known."""
    if change <= least or change <= by_grid:
        return False
    return bool(change > SURE * error) if np.isfinite([change, error]).all() else None


def as_little(result: StrideSolution) -> float:
    """Share of the cost that is not told from none: LITTLE, or what a finer grid moves it by if
    that is more."""
    return max(LITTLE, result.grid_share or 0.0)


def as_good(result: StrideSolution) -> tuple[float, float] | None:
    """Between which positions the optimum may be: those whose cost is as good as the least, on a
    parabola from the optimum to the next fixed position and on straight lines farther out, and the
    ends of all searches with the fulcrum free, from every start, on the finer grid, with every
    drawn contact and every weight of the hold. What lies before a position without a
    stride may be as good up to the next one that has one."""
    if not result.solved or result.best is None:
        return None
    least = result.best.last_cost
    most = least + as_little(result) * abs(least)
    lost = [row.fulcrum_mm for row in result.sweep if row.solution is None]
    best_mm = position_mm(result.best)
    over = sorted(
        [
            (best_mm, least - most),
            *((mm, solution.last_cost - most) for mm, solution in result.solved),
        ]
    )
    near = [mm for mm, more in over if more <= 0.0]
    for (a, c), (b, d) in pairwise(over):
        if c * d < 0.0:  # between them it is as much
            unknown = any(a < mm < b for mm in lost)
            share = c / (c - d)
            if best_mm in (a, b):  # where the cost is least, it rises by the square
                share = math.sqrt(share) if a == best_mm else 1.0 - math.sqrt(1.0 - share)
            near.append((a if c > 0.0 else b) if unknown else a + share * (b - a))
    near += [
        mm
        for (end, more), way in ((over[0], -1.0), (over[-1], 1.0))
        if more <= 0.0
        for mm in lost
        if way * (mm - end) > 0.0
    ]
    near += [position_mm(solution) for solution in result.asked_again if solution.success]
    near += [position_mm(result.carried_out)] if result.carried_out is not None else []
    return min(near), max(near)
