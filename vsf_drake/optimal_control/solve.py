"""Solves a tuning with a motion that adapts: a stride tracked through the stages of smoothing, at
fixed positions of the fulcrum, and with it free; then what the answer is worth."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vsf_drake.base.errors import FitError, InputError, SimulationError, require
from vsf_drake.base.progress import Progress
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.solution import Start, TrajectorySolution, resampled
from vsf_drake.device.equal_load import at_equal_load, missed
from vsf_drake.fit.draws import contact_draws
from vsf_drake.optimal_control.equal_load import costs_under_equal_load
from vsf_drake.optimal_control.outcomes import (
    SIGNS_OF,
    beyond_the_load,
    outcomes,
    published_signs,
    steady_signs,
)
from vsf_drake.optimal_control.own import OwnStrides
from vsf_drake.optimal_control.resimulate import resimulate_prescribed, resimulate_with_feedback
from vsf_drake.optimal_control.search import (
    LOST,
    NEAR_ENOUGH,
    Held,
    StrideSearch,
    StrideSolution,
    StrideTuning,
    held_by,
    own_strides,
    position_mm,
    swept,
    tracked,
    unless_interrupted,
    with_recorded,
)
from vsf_drake.optimal_control.stride import FREE, MM, Stride
from vsf_drake.optimal_control.trajectory import solved_trajectory
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.tuning import table as t
from vsf_drake.tuning.along import told_along
from vsf_drake.tuning.common import COSTS, FREE_COSTS, WEIGHTED
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.tuning.problem import StiffnessTuning
from vsf_drake.tuning.quantities import FREE_CHECKS

# what a tracked or own stride may differ from what was recorded by, root mean square (a choice);
# of one that differs by more nothing follows for the person
ANGLE_DEG = 2.0
FORCE_BW = 0.06
STARTS = 0.005  # share of the cost within which searches from several starts must end (a choice)
# how near to its own position a consistent stride, tracked with the fulcrum free, must end (a
# choice)
FOUND_MM = 10.0
# by how much the optimum of own strides may move with half and twice the hold (a choice)
HOLD_MM = 5.0


def solve(
    tuning: StrideTuning,
    *,
    progress: Progress | None = None,
    warm_start: Mapping[str, np.ndarray] | None = None,
) -> StrideSolution:
    """Tracks the recording, sweeps the fulcrum, frees it, and checks what comes out. `warm_start`:
    arrays of an earlier solution of the same stride and grid. SimulationError where keel and socket
    find no balance."""
    began = time.perf_counter()
    warm = None
    if warm_start is not None:
        require(
            {"tracked_z", "tracked_p"} <= warm_start.keys(),
            "holds no stride",
            "warm_start",
            "Give the result of a tuning at level 2",
        )
        warm = Start(z=np.array(warm_start["tracked_z"]), p=np.array(warm_start["tracked_p"]))
        shapes = (tuning.stride.grid.instants, tuning.stride.function.layout.size), (len(FREE),)
        require(
            (warm.z.shape, warm.p.shape) == shapes,
            "is of another number of intervals, or of an earlier version",
            "warm_start",
            "Leave it out, or give the same options",
        )
    result = StrideSolution(
        tuning=tuning,
        tracked=tracked(tuning.stride, progress, warm),
        search=StrideSearch(tuning.stride, tuning.cost, progress=progress),
    )
    try:
        result.message = _search(result, progress)
    except KeyboardInterrupt:
        result.message = f"interrupted while {result.doing}"
    result.wall_s = time.perf_counter() - began
    return result


def _search(result: StrideSolution, progress: Progress | None) -> str:
    """Fills `result`; returns how it ended."""
    tuning = result.tuning
    search = result.search
    options = tuning.options
    if not unless_interrupted(result.tracked).success:
        return f"the recorded stride could not be tracked: {result.tracked.message}"
    search.sizes = {name: search.stride.value(name, result.tracked.y()) for name in FREE_COSTS}
    if tuning.answer is not None:
        result.doing = "tracking the own strides"
        own = own_strides(tuning.stride, result.tracked.last, progress)
        for one in own:
            if not one.success or one.last_cost > LOST:
                why = one.message
                if one.success:
                    angle, force = _tracking_errors(one, _recorded_at(tuning.stride, one))
                    why = f"the nearest possible motion that was found is {angle:.1f}° and "
                    why += f"{100.0 * force:.1f} % of body weight off the person's own"
                return f"no own stride was found at {position_mm(one):.0f} mm: {why}"
        search.stride = dataclasses.replace(search.stride, own=own)
    search.stride, start = _to_solve(tuning, search.stride, result.tracked)
    result.doing = "sweeping the fulcrum"
    swept(search, start, result.sweep, chains=options.confirm != ())
    with_recorded(search, result.sweep)
    if not result.solved:
        return "no fixed position of the fulcrum could be solved"
    if tuning.cost != "tracking" and tuning.speed_m_per_s is None:
        result.doing = "the spring alone under an equal load"
        result.equal_load = {
            row.fulcrum_mm: costs_under_equal_load(search, result.tracked, MM * row.fulcrum_mm)
            for row in result.sweep
        }
    result.doing = "the cost along the person's own answer"
    weighed = options.weighed if tuning.cost == WEIGHTED else (tuning.cost,)
    if tuning.answer is not None and set(weighed) <= set(COSTS):  # level 1 knows no activation
        given = TuningOptions(
            weights={name: options.weights.get(name, 1.0) for name in weighed},
            socket_weight=options.socket_weight,
            late_share=options.late_share,
        )
        result.along, result.untold = told_along(
            lambda: StiffnessTuning(tuning.trials, cost=tuning.cost, options=given)
        )
    result.doing = "searching with the fulcrum free"
    for i, (mm, fixed) in enumerate(_spread(result.solved, options.starts)):
        solution = search.free(fixed.last, f"free from {mm:.0f} mm", i / options.starts)
        result.free.append((mm, solution))
        unless_interrupted(solution)
    if result.best is None:
        return "no search with the fulcrum free converged: " + result.free[0][1].message
    result.doing = "checking the solution"
    _check(result, result.best, progress)
    _draw(result, result.best)
    _hold(result, result.best)
    for solver in options.confirm:
        if progress:
            progress(f"confirming with {solver}", 0.9)
        result.confirmed.append(_confirmed(result.best, solver))
    return "first-order conditions hold"


def _to_solve(
    tuning: StrideTuning, recorded: Stride, tracked: TrajectorySolution
) -> tuple[Stride, Start]:
    """The consistent stride, or that at the speed asked for, and a start."""
    stride = dataclasses.replace(recorded, consistent=tracked)
    speed = tuning.speed_m_per_s
    return (stride, tracked.last) if speed is None else stride.at_speed(speed, tracked.last)


def _spread(
    good: list[tuple[float, TrajectorySolution]], count: int
) -> list[tuple[float, TrajectorySolution]]:
    """The best of a sweep, then the ones farthest from all taken."""
    taken = [min(good, key=lambda row: row[1].last_cost)]
    while len(taken) < min(count, len(good)):
        rest = [row for row in good if row not in taken]
        taken.append(max(rest, key=lambda row: min(abs(row[0] - mm) for mm, _ in taken)))
    return taken


def _draw(result: StrideSolution, best: TrajectorySolution) -> None:
    """The best stride with each drawn contact that the data would have allowed as well, see
    `fit.draws`, and of own strides with walks drawn anew too; costs count by their sizes in the
    consistent stride that it makes of the recording."""
    tuning = result.tuning
    drawn = contact_draws(
        tuning.walker,
        tuning.trial.subject.prosthetic_side,
        tuning.options.draws,
        tuning.options.seed,
    )
    rng = np.random.default_rng([tuning.options.seed, 11])
    rows = []
    for i, values in enumerate(drawn):
        recorded = tuning.recorded
        drawn_stride = dataclasses.replace(
            tuning.stride,
            recorded=recorded.drawn(rng) if isinstance(recorded, OwnStrides) else recorded,
            model=SagittalModel(tuning.walker, offsets=tuning.trial.offsets, values=values),
        )
        own = unless_interrupted(tracked(drawn_stride, warm=result.tracked.last))
        other = StrideSearch(drawn_stride, tuning.cost, progress=result.search.progress)
        needed = [own]
        near = [one.last for one in result.search.stride.own]
        if own.success and near:
            needed += own_strides(drawn_stride, own.last, near=near)
        solution = next((one for one in needed if not one.success), own)
        if solution.success:
            other.sizes = {name: drawn_stride.value(name, own.y()) for name in FREE_COSTS}
            drawn_stride = dataclasses.replace(drawn_stride, own=tuple(needed[1:]))
            other.stride = _to_solve(tuning, drawn_stride, own)[0]
            solution = other.free(
                best.last, f"drawn contact {i + 1} of {len(drawn)}", i / len(drawn)
            )
        rows.append((unless_interrupted(solution), other.stride))
    result.drawn = rows


def _hold(result: StrideSolution, best: TrajectorySolution) -> None:
    """The best strides with other weights of the hold, and whether stiffness has the
    published signs with each."""
    search = result.search
    options = result.tuning.options
    stride = result.search.stride
    if result.tuning.cost == "tracking":  # which no weight holds
        return
    own = bool(stride.own)
    for factor in options.own_factors if own else options.hold_factors:
        weight = factor * stride.hold_weight
        other, over = held_by(search, weight, result.settings)
        free = unless_interrupted(other.free(best.last, f"weight {weight:g}", 0.88))
        result.held.append(Held(weight, over, free))
    if own and result.held:
        moved = [
            abs(position_mm(held.free) - position_mm(best))
            for held in result.held
            if held.free.success
        ]
        found = len(moved) == len(result.held)
        result.checks.add(
            "hold", max(moved) if found else None, HOLD_MM, weights=options.own_factors
        )
    if len(result.settings) < 3 or not all(
        solution.success for held in result.held for solution in held.over
    ):
        result.checks.add("signs", None, None, part="no_signs")
        return
    rows = [
        (stride.hold_weight, tuple(solution for _, solution in result.settings)),
        *((held.weight, held.over) for held in result.held),
    ]
    by_weight = {
        weight: [outcomes(solution, stride) for solution in over]
        for weight, over in sorted(rows, key=lambda row: row[0])
    }
    tuning = result.tuning
    try:
        alone = at_equal_load(
            tuning.trial.subject, tuning.trial.model, [MM * mm for mm, _ in result.settings]
        )
    except SimulationError as error:
        result.checks.add("signs", None, None, part="no_foot_alone", error=error)
        return
    load = [one.outcomes for one in alone]
    signs = {weight: published_signs(over) for weight, over in by_weight.items()}
    bent = {
        weight: [
            measure
            for measure, steady in steady_signs(over).items()
            if signs[weight][measure] and not steady
        ]
        for weight, over in by_weight.items()
    }
    beyond = [beyond_the_load(over, load) for over in by_weight.values()]
    lacks = len(beyond[0])
    least = min(sum(own.values()) for own in beyond)
    result.checks.add(
        "signs",
        least,
        f">= {lacks}",
        least == lacks,
        unit=f"of {lacks}",
        signs=signs,
        bent=bent,
        source=SIGNS_OF,
        load=published_signs(load, every_step=True),
        missed=missed(alone),
        own=own,
    )


def _check(result: StrideSolution, best: TrajectorySolution, progress: Progress | None) -> None:
    tuning = result.tuning
    search = result.search
    stride = result.search.stride

    add = result.checks.add
    _tell_likeness(result)
    fixed = min(solution.last_cost for _, solution in result.solved)
    # Neither search goes on for what is less than this.
    rest = 1e-9 if tuning.cost == "tracking" else NEAR_ENOUGH["gain"] * (1.0 + abs(fixed))
    add(
        "fixed_positions",
        best.last_cost - fixed,
        f"<= {rest:.1g}",
        best.last_cost <= fixed + rest,
        cost=best.last_cost,
        count=len(result.solved),
        least=fixed,
    )
    ends = [
        (position_mm(solution), solution.last_cost)
        for _, solution in result.free
        if solution.success
    ]
    if len(result.free) > 1:
        (low_mm, high_mm), (least, most) = (
            (min(part), max(part)) for part in zip(*ends, strict=True)
        )
        more = (most - least) / abs(least)
        add(
            "starts",
            100.0 * more,
            100.0 * STARTS,
            more <= STARTS and len(ends) == len(result.free),
            converged=len(ends),
            count=len(result.free),
            spread=high_mm - low_mm,
        )

    def changed(
        name: str,
        what: str,
        done: float,
        again: Callable[[TrajectorySolution], Start],
        **changes: Any,
    ) -> TrajectorySolution:
        other_search = search.changed(**changes)
        near = [again(one) for one in stride.own]
        own = own_strides(other_search.stride, near[0], progress, near) if near else ()
        failed = next((one for one in own if not one.success), None)
        other = failed or unless_interrupted(
            other_search.changed(own=own).free(again(best), what, done)
        )
        moved = position_mm(other) - position_mm(best) if other.success else None
        add(
            name,
            moved,
            "",
            part="change",
            label_of=FREE_CHECKS[name].label,
            message=other.message,
            change=(other.last_cost - best.last_cost) / abs(best.last_cost),
        )
        return other

    # What the full model carries out is the stride on a finer grid: an error of integration is no
    # error of the model.
    grid = dataclasses.replace(stride.grid, intervals=2 * stride.grid.intervals)
    fine = changed("mesh", "finer mesh", 0.4, lambda one: resampled(one, grid), grid=grid)
    if progress:
        progress("re-simulating", 0.5)
    result.carried_out = fine if fine.success else best
    intervals = result.carried_out.problem.grid.intervals
    add("carried_out", position_mm(result.carried_out), "", intervals=intervals)
    trajectory = solved_trajectory(
        result.carried_out,
        tuning.walker,
        outputs=stride.function.names,
        offsets=tuning.trial.offsets,
    )
    for kind, simulate in (
        ("prescribed", resimulate_prescribed),
        ("feedback", resimulate_with_feedback),
    ):
        try:
            run = simulate(tuning.walker, trajectory)
        except (SimulationError, FitError) as error:
            add(f"resimulation_{kind}", None, "", False, row="resimulation", kind=kind, error=error)
        else:
            result.checks.append(run.as_check())
            result.simulated |= run.arrays()
    if not tuning.options.confirm:
        return
    again = StrideSearch(result.consistent, "tracking", progress=progress)
    for mm in (result.solved[0][0], result.solved[-1][0]):
        held = again.at(mm, result.tracked.last, f"tracked at {mm:.0f} mm", 0.55)
        found = unless_interrupted(again.free(held.last, f"tracked from {mm:.0f} mm", 0.55))
        off = position_mm(found) - stride.own_m / MM if found.success else None
        add(
            f"found_from_{mm:.0f}",
            off,
            FOUND_MM,
            off is not None and abs(off) <= FOUND_MM,
            row="found",
            mm=mm,
            message=found.message,
        )
    changed(
        "smoothing",
        "softer contact",
        0.7,
        lambda one: one.last,
        smoothing=dataclasses.replace(stride.smoothing, depth_m=2.0 * stride.smoothing.depth_m),
    )


def _tell_likeness(result: StrideSolution) -> None:
    """How far what a stride is compared with is off the recording, own strides at the worst
    position."""
    recorded = result.tuning.stride
    pairs = [(own, _recorded_at(recorded, own)) for own in result.search.stride.own] or [
        (result.tracked, recorded)
    ]
    angle, force = np.max([_tracking_errors(*pair) for pair in pairs], axis=0).tolist()
    result.checks.add("tracking_motion", angle, ANGLE_DEG, count=len(pairs))
    result.checks.add("tracking_force", 100.0 * force, 100.0 * FORCE_BW, count=len(pairs))


def _recorded_at(stride: Stride, own: TrajectorySolution) -> Stride:
    """The stride recorded where an own one is."""
    return dataclasses.replace(stride, own_m=position_mm(own) * MM)


def _tracking_errors(solution: TrajectorySolution, stride: Stride) -> tuple[float, float]:
    """Of the tracked stride: worst angle (deg), resultant force of the worse foot (body weights),
    RMS."""
    y = solution.y()
    reference = stride.reference
    force = 0.0
    angles = np.degrees(y[:, stride.function.starting_with("q_")] - reference.q)
    for foot, known in reference.force.items():
        rows = reference.known[foot]
        if rows.any():
            size = np.linalg.norm(y[:, stride.function.index(f"{foot}_fx", f"{foot}_fz")], axis=1)
            difference = (size - np.linalg.norm(known, axis=1))[rows] / stride.model.weight
            force = max(force, float(np.sqrt(np.mean(difference**2))))
    return float(np.sqrt(np.mean(np.delete(angles, (1, 2), axis=1) ** 2, axis=0)).max()), force


def _confirmed(best: TrajectorySolution, solver: str) -> t.Confirmation:
    try:
        again = confirm(best.problem, best.last, solver)
    except (InputError, RuntimeError) as error:
        return t.Confirmation(solver, fulcrum_mm=None, cost=None, success=False, message=str(error))
    return t.Confirmation(
        solver,
        fulcrum_mm=position_mm(again),
        cost=again.last_cost,
        success=again.success,
        message=again.message,
    )
