"""The null of a stride that adapts: the spring alone, under an equal load.

Of a stride nothing answers the setting but the height of the pelvis over the prosthetic foot, which
keeps that foot's vertical force (`walks.energy_ledger` has the same of a walk in space); keel and
socket are in balance, and all that the other leg does stays. What a cost changes by then is the
mechanics of a spring, whoever stands on it.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.optimal_control.balance import quasi_static_motion
from vsf_drake.optimal_control.recorded_projection import TY
from vsf_drake.optimal_control.reference import LOADED_BW
from vsf_drake.optimal_control.search import StrideSearch
from vsf_drake.optimal_control.stride import Stride
from vsf_drake.tuning.common import SEEN

COSTS = ("push_off_work", "metabolic", "joint_load", "activation")
"""Outcomes that are costs, as `outcomes.outcomes` has them."""
ITERATIONS = 30
# N/m over body weight (N), by which heights are first corrected: 1 mm about 3 % (a choice)
FIRST_STIFFNESS = 30.0
MOST_M = 2e-3  # of one correction


def costs_under_equal_load(
    search: StrideSearch, solution: TrajectorySolution, fulcrum_m: float
) -> dict[str, float]:
    """What `search` minimises, but for its hold, and COSTS by name, `under_equal_load`; empty where
    none is kept."""
    stride = search.stride
    y = under_equal_load(stride, solution, fulcrum_m)
    if y is None:
        return {}
    cost = sum(
        float(stride.grid.weights @ term.values(y))
        for term in stride.minimised(search.cost, search.sizes)
        if term.name not in ("own", "normal")
    )
    found = (
        -float(solution.last.p[-1]) * stride.value("push_off", y),
        stride.value("metabolic", y) / stride.advance_m,
        stride.value("joint_load", y),
        stride.value("activation", y),
    )
    return {"cost": cost, **dict(zip(COSTS, found, strict=True))}


def under_equal_load(
    stride: Stride, solution: TrajectorySolution, fulcrum_m: float
) -> np.ndarray | None:
    """(N, m) the outputs of `stride.function` with the fulcrum at another position, of the
    prosthetic leg; those of everything else are the solution's. None where no height keeps the load
    (root mean square in stance within `tuning.common.SEEN`)."""
    function = stride.function
    layout = function.layout
    grid = stride.grid
    y = function.evaluate(solution.last.z, solution.last.p)
    p = solution.last.p.copy()
    p[0] = fulcrum_m
    rates = grid.rates()
    (up,) = function.index("prosthetic_fz")
    wanted = y[:, up]
    weight = stride.model.weight
    stands = np.flatnonzero(wanted > LOADED_BW * weight)
    stiffness = np.full(len(stands), FIRST_STIFFNESS * weight)
    lifted = np.zeros(len(stands))  # m
    start = solution.last.z[:, layout.w].T
    before: tuple[np.ndarray, np.ndarray] | None = None
    for _ in range(ITERATIONS):
        z = solution.last.z.copy()
        lift = np.interp(grid.times_s, grid.times_s[stands], lifted, period=grid.duration_s)
        z[:, TY] += lift
        z[:, layout.v.start + TY] += rates @ lift
        q, v, a, *_ = function.parts(z, p)
        try:
            w, u = quasi_static_motion(
                stride.model, q, v, a, p[:-1], rates / p[-1], stride.smoothing, start=start
            )
        except SimulationError:
            return None
        z[:, layout.w] = w.T
        z[:, layout.u] = p[-1] * u.T
        start = w
        there = function.evaluate(z, p)
        off = (there[:, up] - wanted)[stands]
        if np.sqrt(np.mean(off**2)) <= SEEN["BW"] * weight:
            own = [
                i
                for i, name in enumerate(function.names)
                if name.startswith(("prosthetic_", "prosthesis_", "force_", "stored_"))
                or (
                    name.endswith(layout.coordinates[3:5])
                    and name.startswith(("torque_", "power_", "activation_"))
                )
            ]
            y[:, own] = there[:, own]
            return y
        if before is not None:  # secant, instant by instant
            moved = lifted - before[0]
            slope = (before[1] - off) / np.where(np.abs(moved) > 1e-9, moved, np.inf)
            stiffness = np.where(
                slope > 0.1 * stiffness, np.minimum(slope, 1e3 * weight), stiffness
            )
        before = lifted, off
        lifted = lifted + np.clip(off / stiffness, -MOST_M, MOST_M)
    return None
