"""The implicit stepper: advances a plant of one-degree-of-freedom joints under stiff forces by
fixed steps, one walk or several side by side.

All of a step is compiled (`newton`), and so is the loop over them (`advance`). Any subset of
coordinates is prescribed: it follows its values exactly at every step, and the loads that this
takes come out with it. First order in the step. A step that does not converge is halved.

Walks side by side are taken WIDTH at a time in the lanes of the processor (`laws.lanes`) by the
same code as one alone, and every one is to the bit what it is alone.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.laws.lanes import TOGETHER
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping.block import Block
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.runs import Inputs, Mechanism, Record, Run
from vsf_drake.simulation.stepping.sensitivity import ForwardSensitivity

_warm: set[str] = set()  # the variants of the loop that are compiled
SETTLED_TOLERANCE, SETTLED_SPEED = 1e-10, 1e-9
"""Of the steps that lead to rest (with the usual one they would coast at 1e-7 m/s), and m/s or
rad/s at it."""
ALONE, CARRIED, SIDE_BY_SIDE = "one walk", "one walk with sensitivities", "walks side by side"
"""Variants of the compiled loop."""


def run_side_by_side(
    runs: Sequence[Run],
    *,
    tolerance: float = assembly.TOLERANCE,
    sites: bool = True,
    stop: Callable[[int, Record], bool] | None = None,
    progress: Callable[[float], None] | None = None,
    forward: ForwardSensitivity | None = None,
) -> list[Record | SimulationError]:
    """The record of each run, or why there is none: a coordinate becomes NaN, too fast or larger
    than its limit. It is the same to the bit in whatever company a run is taken.

    The runs have the bodies, joints, inertias and keel of the first one, its contact law and width
    of the support, and prescribe the same coordinates; numbers of frames, contact, springs and
    support, motions, grids and lengths are their own. ValueError if they do not fit together. A
    step has converged within `tolerance`, see `assembly.Workspace`. `sites`: whether the record of
    each site is kept. `stop` is called now and then with the number of finished steps and the
    record of each run, written as far (true ends the run), `progress` with the finished fraction.
    `forward` says what the sensitivities of a single run are carried to.
    """
    done: list[Record | SimulationError] = []
    for begin in range(0, len(runs), TOGETHER):
        block = Block(runs[begin : begin + TOGETHER], tolerance, sites=sites, forward=forward)
        share = len(block.runs) / len(runs)

        def tell(finished: float, begin: int = begin, share: float = share) -> None:
            if progress:
                progress(begin / len(runs) + share * finished)

        done += block.run(stop, tell)
    return done


class Stepper:
    """Runs one `Mechanism`; holds no state between runs. See `run_side_by_side` for the
    arguments."""

    def __init__(self, mechanism: Mechanism, *, tolerance: float = assembly.TOLERANCE) -> None:
        self.mechanism = mechanism
        self.tolerance = tolerance

    def run(
        self,
        inputs: Inputs,
        q0: np.ndarray,
        v0: np.ndarray,
        *,
        forward: ForwardSensitivity | None = None,
        stop: Callable[[int, Record], bool] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Record:
        """Advances from `q0`, `v0` over the grid of `inputs`; SimulationError as said there."""
        (outcome,) = run_side_by_side(
            [Run(self.mechanism, inputs, q0, v0)],
            tolerance=self.tolerance,
            stop=stop,
            progress=progress,
            forward=forward,
        )
        if isinstance(outcome, SimulationError):
            raise outcome
        return outcome

    def warm_up(self, variant: str = ALONE) -> float:
        """Seconds in which a throw-away step has compiled a variant of the loop; 0 if it was."""
        if variant in _warm:
            return 0.0
        _warm.add(variant)
        started = time.perf_counter()
        n = self.mechanism.tree.num_coordinates
        held = Inputs(
            time_s=np.array([0.0, 1e-3]),
            prescribed=np.arange(n),
            prescribed_q=np.zeros((2, n)),
            fulcrum=np.zeros(2),
            ground=np.zeros(2),
        )
        run = Run(self.mechanism, held, np.zeros(n), np.zeros(n))
        measured = np.zeros(len(self.mechanism.sites), dtype=bool)
        nothing = ForwardSensitivity(tangents=(), measured=measured, q0=np.zeros((n, 0)))
        run_side_by_side(
            [run] * (2 if variant == SIDE_BY_SIDE else 1),
            forward=nothing if variant == CARRIED else None,
        )
        return time.perf_counter() - started


def settle_side_by_side(
    runs: Sequence[Run], *, step_s: float = 0.02, steps: int = 100
) -> list[tuple[np.ndarray, float] | SimulationError]:
    """Of each run the rest position near its q0 with everything prescribed held at the first row of
    its inputs, and the largest speed left.

    Large implicit steps without damping and friction, which would only delay the same equilibrium,
    until no coordinate is faster than SETTLED_SPEED, at most `steps` of them.
    """
    lossy = ("damping", "dissipation", "mu_static", "mu_kinetic")
    columns = [assembly.SITE_COLUMNS.index(name) for name in lossy]
    held = []
    for run in runs:
        sites = run.mechanism.sites.copy()
        springs = run.mechanism.springs.copy()
        fulcrum = run.mechanism.fulcrum.copy()
        sites[:, columns] = 0.0
        springs[:, assembly.SPRING_COLUMNS.index("damping")] = 0.0
        fulcrum[1] = 0.0
        still = Inputs(
            time_s=step_s * np.arange(steps + 1),
            prescribed=run.inputs.prescribed,
            prescribed_q=np.repeat(run.inputs.prescribed_q[:1], steps + 1, axis=0),
            fulcrum=np.full(steps + 1, run.inputs.fulcrum[0]),
            ground=np.full(steps + 1, run.inputs.ground[0]),
        )
        undamped = dataclasses.replace(run.mechanism, sites=sites, springs=springs, fulcrum=fulcrum)
        held.append(Run(undamped, still, run.q0, np.zeros_like(run.q0)))
    records = run_side_by_side(
        held,
        tolerance=SETTLED_TOLERANCE,
        sites=False,
        stop=lambda done, record: bool(np.abs(record.v[done - 1]).max() < SETTLED_SPEED),
    )
    return [
        record
        if isinstance(record, SimulationError)
        else (record.q[-1], float(np.abs(record.v[-1]).max()))
        for record in records
    ]


def rest_sensitivity(rest: Run, tangents: Sequence[ParameterTangent]) -> np.ndarray:
    """(n, P) derivatives of a rest position, q0 of the run, by the parameters, from the linearised
    balance of forces, with everything prescribed held as it is there.

    InputError if no force holds one of the others at rest, so that its rest has no derivative.
    """
    # At rest dv0 = dv = 0 over any step: the free directions must balance, Gq_free dq =
    # -(Gq_prescribed unit + E).
    inputs = rest.inputs
    still = Inputs(
        time_s=np.array([0.0, 1e-3]),
        prescribed=inputs.prescribed,
        prescribed_q=np.repeat(rest.q0[None, inputs.prescribed], 2, axis=0),
        fulcrum=np.full(2, inputs.fulcrum[0]),
        ground=np.full(2, inputs.ground[0]),
    )
    by = np.zeros((len(rest.q0), len(tangents)))
    forward = ForwardSensitivity(
        tangents=tuple(
            one
            if one.perturbation is None
            else dataclasses.replace(one, perturbation=one.perturbation[:2])
            for one in tangents
        ),
        measured=np.zeros(len(rest.mechanism.sites), dtype=bool),
        q0=by,
    )
    run = Run(rest.mechanism, still, rest.q0, np.zeros_like(rest.q0))
    block = Block([run], assembly.TOLERANCE, sites=False, forward=forward)
    block.run(None, lambda finished: None)
    dofs = block.dofs
    directions = block.directions
    tangent = block.tangent
    assert directions is not None
    assert tangent is not None
    count = len(dofs.free)
    try:
        moved = tangent.Gq[:, count:] @ directions.unit[count:] + tangent.E[:, : len(tangents)]
        by[dofs.free] = -np.linalg.solve(tangent.Gq[:, :count], moved)
    except np.linalg.LinAlgError:
        loose = dofs.free[np.argmin(np.abs(tangent.Gq[:, :count]).sum(axis=1))]
        name = rest.mechanism.tree.coordinate_names[loose]
        raise InputError(
            f"no force holds {name} at rest: where it starts has no derivative",
            where="with_respect_to",
            right="Let the recording say where it starts",
        ) from None
    shifted = directions.coordinate[count:] >= 0
    np.add.at(by, directions.coordinate[count:][shifted], directions.unit[count:][shifted])
    return by
