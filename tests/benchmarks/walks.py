"""The embedded walk and the bench by the stepper, and both under Drake's `Simulator`; many walks in
two processes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from reference_runs import simulate_bench_reference
from table import YARDSTICK, Row
from walk_over_ground import walk_over

from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.batch import WalkCase, WalkOutcome, simulate_batch
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.simulation.stepped import make_stepped_person
from vsf_drake.simulation.stepping.runs import Inputs
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.embedded import embedded_trials

WALK_S, MILLISECOND, REPEATS = 1.2, 1e-3, 10
STEPS_S = (2e-3, 1e-3, 5e-4, 2.5e-4)
EXACT_STEP_S, SECOND_EXACT_STEP_S = 6.25e-5, 1.25e-4
STRIKE_N = 20.0
ZONES = ("heel_posterior", "heel", "heel_anterior", "midfoot", "forefoot")
BY = (
    *(f"contact.{zone}.{number}" for zone in ZONES for number in ("stiffness", "damping", "rise")),
    "friction.mu_static",
    "friction.threshold_velocity",
    "keel.flexural_modulus",
    "fulcrum.stiffness",
    "fulcrum.shift",
    "socket.ty.stiffness",
    "socket.flexion.stiffness",
    "offset.height",
    "offset.fore_aft",
    "offset.alignment",
)
"""Variables such as a fit of the contact would have."""
INSIDE_M = 0.108
"""A position (m from A) from which the fulcrum can shift both ways."""


@cache
def the_trial() -> Trial:
    """The first of the embedded trials, a synthetic walk."""
    return load_trial(embedded_trials("exact")[0])


@cache
def the_walker() -> Walker:
    """Its person."""
    return Walker(the_trial().subject, the_trial().model)


@cache
def stance(step_s: float) -> Walk:
    """The last WALK_S of the walk by the stepper, at steps of `step_s`."""
    return the_walker().walk(the_trial().trajectory, step_s=step_s, **span())


def span() -> dict[str, float]:
    """The last WALK_S of the trial's window as arguments of a walk."""
    trial = the_trial()
    return {
        "fulcrum_m": trial.fulcrum_m,
        "start_s": max(trial.start_s, trial.end_s - WALK_S),
        "end_s": trial.end_s,
    }


def best(run: Callable[[], Any], repeats: int = REPEATS) -> Any:
    """What the quickest of `repeats` runs left."""
    return min((run() for _ in range(repeats)), key=lambda run: run.wall_s)


def processor_s(run: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Least processor time of `repeats` runs, after one that compiles."""
    run()
    spent = []
    for _ in range(repeats):
        started = time.process_time()
        run()
        spent.append(time.process_time() - started)
    return min(spent)


def difference(force: np.ndarray, step_s: float, exact: np.ndarray, exact_step_s: float) -> float:
    """RMS difference of the 40 Hz resultants of forces (n, 3) at the ends of steps, each
    millisecond or at the longer step, in percent of body weight."""
    spacing = max(MILLISECOND, step_s, exact_step_s)
    pair = [
        f[round(spacing / h) - 1 :: round(spacing / h)]
        for f, h in ((force, step_s), (exact, exact_step_s))
    ]
    count = min(map(len, pair))
    first, second = (
        np.linalg.norm(low_pass(f[:count], rate_hz=1 / spacing, cutoff_hz=40.0), axis=1)
        for f in pair
    )
    return (
        100
        * float(np.sqrt(np.mean((first - second) ** 2)))
        / (the_trial().subject.mass_kg * GRAVITY)
    )


def stepper() -> list[Row]:
    """The whole person: 21 coordinates follow the recording, socket and keel respond, both feet on
    the ground."""
    exact, second = (
        stance(step_s).prosthetic.grf_W for step_s in (EXACT_STEP_S, SECOND_EXACT_STEP_S)
    )
    made = []
    for step_s in STEPS_S:
        walk = best(
            lambda step_s=step_s: the_walker().walk(the_trial().trajectory, step_s=step_s, **span())
        )
        record, force = walk.record, walk.prosthetic.grf_W
        name = YARDSTICK if step_s == MILLISECOND else f"person, stepper at {1e3 * step_s:g} ms"
        made.append(
            Row(
                name,
                len(record.time_s) * step_s,
                walk.wall_s,
                (
                    f"{difference(force, step_s, second, SECOND_EXACT_STEP_S):.3f} % BW from "
                    f"0.125 ms, {difference(force, step_s, exact, EXACT_STEP_S):.3f} from 0.0625 "
                    f"ms; {record.iterations.mean():.2f} iterations a step, "
                    f"{np.count_nonzero(~record.converged)} unconverged"
                ),
            )
        )
    return [*made, _sensitivities(), _bench()]


def shared_motion() -> list[dict[str, Any]]:
    """Eight walks of one motion with the fulcrum in other places, as `Walker.walk_many` takes
    them."""
    motion = {"trajectory": the_trial().trajectory, **span()}
    return [motion | {"fulcrum_m": INSIDE_M + 0.004 * i} for i in range(8)]


def side_by_side() -> list[Row]:
    """Eight walks in the lanes of one core: with other settings of the foot under one motion, and
    with eight motions; and whether each is to the bit what it is alone."""
    walker = the_walker()
    shared = shared_motion()
    others = [load_trial(path) for path in embedded_trials("exact")[:8]]
    motions = [
        {
            "trajectory": trial.trajectory,
            "fulcrum_m": request["fulcrum_m"],
            "start_s": max(trial.start_s, trial.end_s - WALK_S),
            "end_s": trial.end_s,
        }
        for trial, request in zip(others, shared, strict=True)
    ]
    rows = [
        Row("one walk, everything of it", WALK_S, processor_s(lambda: walker.walk(**shared[0])), "")
    ]
    for name, requests in (("one motion", shared), ("eight motions", motions)):
        spent = processor_s(lambda requests=requests: walker.walk_many(requests))
        together = walker.walk_many(requests)
        alone = [walker.walk(**request) for request in requests]
        equal = all(
            a.record.wrench.tobytes() == b.record.wrench.tobytes()
            for a, b in zip(together, alone, strict=True)
        )
        rows.append(
            Row(
                f"eight walks side by side, {name}",
                sum(len(walk.record.time_s) for walk in alone) * MILLISECOND,
                spent,
                f"each {'to the bit what it is alone' if equal else 'DIFFERENT from alone'}",
            )
        )
    return rows


def _sensitivities() -> Row:
    """The walk with exact derivatives of the prosthetic foot's reaction, and how near central
    differences come."""
    walker = the_walker()
    options = {"trajectory": the_trial().trajectory, **span(), "fulcrum_m": INSIDE_M}
    plain, walk = (
        best(lambda by=by: walker.walk(**options, with_respect_to=by)) for by in ((), BY)
    )
    errors = []
    for i, name in enumerate(BY):
        variable = walker.variables[name]
        change = 3e-6 * (abs(variable.default) or variable.high)
        low, high = (
            walker.walk(**options, values={name: variable.default + sign * change}).prosthetic.grf_W
            for sign in (-1.0, 1.0)
        )
        exact = walk.sensitivity.grf_W[:, :, i]
        errors.append(np.abs(exact - (high - low) / (2.0 * change)).max() / np.abs(exact).max())
    return Row(
        f"{len(BY)} sensitivities, 1 ms",
        WALK_S,
        walk.wall_s,
        (
            f"{walk.wall_s / plain.wall_s:.2f} times the walk without them; force from central "
            f"differences at most {max(errors):.0e} of its largest, by the worst variable"
        ),
    )


def _bench() -> Row:
    result, one = best(lambda: run_bench(the_trial().model)), Bench(the_trial().model.foot)
    stroke = one.press(fulcrum_m=0.066, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
    exact = simulate_bench_reference(
        one,
        fulcrum_m=0.066,
        travel_m=stroke.platen_m[-1],
        accuracy=1e-6,
        speed_m_per_s=PUBLISHED_SPEED_M_PER_S,
    )
    load = np.interp(exact.platen_m, np.append(0.0, stroke.platen_m), np.append(0.0, stroke.load_n))
    return Row(
        "bench, five settings and heel, stepper",
        result.simulated_s,
        result.wall_s,
        f"{np.abs(load - exact.load_n).max():.3f} N from radau3 1e-6 (at 66 mm)",
    )


def simulator(length_s: float = 0.2) -> list[Row]:
    """The person from 50 ms before the heel strike by Drake's integrators, and by the stepper over
    the same time."""
    trial, walker, whole = the_trial(), the_walker(), stance(MILLISECOND)
    vertical = whole.prosthetic.grf_W[:, 2]
    strike = whole.record.time_s[1:][(vertical[1:] > STRIKE_N) & (vertical[:-1] <= STRIKE_N)][0]
    start = max(span()["start_s"], round(strike - 0.05, 3))
    options = {"fulcrum_m": trial.fulcrum_m, "start_s": start, "end_s": start + length_s}
    person = trial.subject, trial.model, trial.trajectory, Ground()
    exact = walk_over(*person, accuracy=1e-4, **options).grf_W[1:]
    runs = {
        f"Simulator {scheme} {accuracy:g}": walk_over(
            *person, integrator=scheme, accuracy=accuracy, **options
        )
        for scheme, accuracy in (("radau3", 1e-3), ("implicit_euler", 1e-2))
    }
    forces = {name: (run.grf_W[1:], run.wall_s) for name, run in runs.items()}
    walk = walker.walk(trial.trajectory, **options)
    forces["stepper at 1 ms"] = walk.prosthetic.grf_W, walk.wall_s
    return [
        Row(
            f"person, heel strike, {name}",
            length_s,
            wall_s,
            f"{difference(force, MILLISECOND, exact, MILLISECOND):.4f} % BW from radau3 1e-4",
        )
        for name, (force, wall_s) in forces.items()
    ]


def sweeps(walks: int = 200) -> list[Row]:
    """The same sweep in this process, and in this and another from nothing."""
    part = replace(the_trial(), start_s=span()["start_s"])
    cases = [WalkCase(trial=part, fulcrum_m=0.066 + 0.085 * i / walks) for i in range(walks)]

    def timed(workers: int) -> tuple[list[WalkOutcome], float]:
        started = time.perf_counter()
        return simulate_batch(cases, workers=workers), time.perf_counter() - started

    (alone, one_s), (both, two_s) = timed(1), timed(2)
    equal = all(
        a.arrays[name].tobytes() == b.arrays[name].tobytes()
        for a, b in zip(alone, both, strict=True)
        for name in a.arrays
    )
    return [
        Row(
            f"{walks} walks, one process",
            walks * WALK_S,
            one_s,
            f"{sum(o.ok for o in alone)} finished",
        ),
        Row(
            f"{walks} walks, two processes, with the start of the second",
            walks * WALK_S,
            two_s,
            f"{'same bits' if equal else 'DIFFERENT numbers'}; {one_s / two_s:.2f} times one "
            "process",
        ),
    ]


def stepped() -> list[Row]:
    """The person held in mid stride, by the stepper's loop and as a system in a diagram: share of
    the loop's speed, by processor time."""
    walk = stance(MILLISECOND)
    record = walk.record
    rows = []
    for period_s in (1e-2, 1e-3):
        system = make_stepped_person(
            the_trial().subject,
            the_trial().model,
            fulcrum_m=float(walk.fulcrum_m[0]),
            period_s=period_s,
        )
        names = walk.mechanism.tree.coordinate_names
        driven = [names.index(name) for name in (*system.prescribed, "fulcrum")]
        steps = 10 * round(0.1 * len(record.time_s))
        inputs = Inputs(
            time_s=MILLISECOND * np.arange(steps + 1),
            prescribed=np.array(driven),
            prescribed_q=np.tile(record.q[steps // 2, driven], (steps + 1, 1)),
            fulcrum=np.full(steps + 1, walk.fulcrum_m[0]),
            ground=np.zeros(steps + 1),
        )
        start = record.q[steps // 2], record.v[steps // 2]
        simulator = Simulator(system)

        def in_a_diagram(system=system, simulator=simulator, start=start, steps=steps) -> None:
            context = simulator.get_mutable_context()
            context.SetTime(0.0)
            context.SetDiscreteState(0, np.concatenate(start))
            simulator.Initialize()
            simulator.AdvanceTo(MILLISECOND * steps)

        stepper = Stepper(walk.mechanism)
        loop_s = processor_s(
            lambda stepper=stepper, inputs=inputs, start=start: stepper.run(inputs, *start)
        )
        system_s = processor_s(in_a_diagram)
        rows.append(
            Row(
                f"person held, as a system, {1e3 * period_s:g} ms a period",
                steps * MILLISECOND,
                system_s,
                f"{loop_s / system_s:.0%} of the speed of the stepper's loop",
            )
        )
    return rows
