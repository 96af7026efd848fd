"""One person's stride as a trajectory problem, for any smoothing, grid, cost and range of the fulcrum."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from vsf_drake.analysis.tuning.level2.costs import StrideCosts, StrideFunction, StrideOptions, Terms, stride_reference
from vsf_drake.analysis.tuning.recorded_stride import RecordedStride
from vsf_drake.collocation.problem import Design, Grid, Layout, Limits, TrajectoryProblem
from vsf_drake.collocation.solution import Start
from vsf_drake.errors import SimulationError
from vsf_drake.simulation.sagittal.contact_spheres import Smoothing
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import DESIGN, SOCKET, SagittalModel

MM = 1e-3
OWN = np.array([np.nan, 1.0, 0.0, 1.0])
"""The device as it is, by DESIGN."""
RANGE = {"heel_stiffness": (0.5, 2.0), "alignment_rad": (-0.07, 0.07), "keel_thickness": (0.8, 1.25)}
"""Bounds of the design variables unless given."""


@dataclass(frozen=True, eq=False)
class Stride:
    """A recorded stride of a person on a prosthesis.

    Attributes:
        model: of the person. recorded: the motion. own_m: the fulcrum's position in the recording.
        leg_m: hip to ankle, intact side.
    """

    model: SagittalModel
    recorded: RecordedStride
    own_m: float
    leg_m: float
    options: StrideOptions

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Range of the fulcrum that is searched."""
        fulcrum = self.model.foot.fulcrum
        return self.options.bounds_mm or (fulcrum.rearmost_m / MM, fulcrum.foremost_m / MM)

    def grid(self, intervals: int | None = None) -> Grid:
        """The instants of one stride."""
        return Grid(method=self.options.method, intervals=intervals or self.options.intervals,
                    duration_s=self.recorded.period_s, periodic=True)

    def costs(self, grid: Grid, smoothing: Smoothing) -> StrideCosts:
        """The costs on a grid."""
        reference = stride_reference(self.recorded, grid, self.options)
        function = StrideFunction(self.model, smoothing, reference.cop_x)
        return StrideCosts(function=function, reference=reference, options=self.options,
                           mass_kg=self.model.subject.mass_kg, weight_n=self.model.weight, leg_m=self.leg_m,
                           duration_s=grid.duration_s)

    def problem(
        self, costs: StrideCosts, terms: Mapping[str, Terms], grid: Grid, fulcrum_mm: tuple[float, float], *,
        design: tuple[str, ...] = ()
    ) -> TrajectoryProblem:
        """The problem with the fulcrum within a range; equal ends fix it. design: of DESIGN, what else is free."""
        function, reference, options = costs.function, costs.reference, self.options
        layout, low, high = function.layout, OWN.copy(), OWN.copy()
        low[0], high[0] = fulcrum_mm[0] * MM, fulcrum_mm[1] * MM
        for name in design:
            low[DESIGN.index(name)], high[DESIGN.index(name)] = options.design_bounds.get(name, RANGE[name])
        margin = np.radians(options.angle_margin_deg)
        z_low, z_high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        z_low[3:8], z_high[3:8] = reference.q[:, 3:].min(0) - margin, reference.q[:, 3:].max(0) + margin
        torque = options.torque_nm_per_kg * costs.mass_kg
        limits = [Limits(outputs=function.starting_with("torque_"), low=-torque, high=torque)]
        for foot, swing in reference.clear.items():
            limits.append(Limits(outputs=function.index(f"{foot}_sole"),
                                 low=np.where(swing, options.clearance_m, -np.inf)[:, None]))
        advance = np.zeros(layout.n)
        advance[1] = self.recorded.advance_m
        parts = [dataclasses.replace(part, name=name) for name, term in terms.items() for part in term.residuals]
        convex = [dataclasses.replace(part, name=name) for name, term in terms.items() for part in term.convex]
        return TrajectoryProblem(
            function, layout, grid, outputs=len(function.names), equations=function.starting_with("balance_"),
            limits=limits, residuals=parts, convex=convex,
            design=Design(names=DESIGN, low=low, high=high, scale=np.array([0.02, 0.2, 0.02, 0.1])), advance=advance,
            low=z_low, high=z_high, z_scale=_variable_scales(layout),
            y_scale=_output_scales(function.names, costs.weight_n, costs.weight_n * self.leg_m))

    def start(self, costs: StrideCosts, grid: Grid, fulcrum_mm: float) -> Start:
        """The recorded motion with keel and socket in balance: not yet a possible motion, but for them."""
        reference, function = costs.reference, costs.function
        layout = function.layout
        rates = grid.rates()
        p = np.array([fulcrum_mm * MM, *OWN[1:]])
        w, u = quasi_static_motion(self.model, reference.q.T, reference.v.T, reference.a.T, p, rates,
                                   function.smoothing)
        z = np.zeros((grid.instants, layout.size))
        z[:, layout.q], z[:, layout.v], z[:, layout.a] = reference.q, reference.v, reference.a
        z[:, layout.w], z[:, layout.u] = w.T, u.T
        return Start(z=z, p=p)


BALANCE_OF_BODY = ("balance_pelvis_tilt", "balance_pelvis_tx", "balance_pelvis_ty")


def _output_scales(names: tuple[str, ...], weight_n: float, moment_nm: float) -> np.ndarray:
    """(m,) what counts as a change of one: body weight, or that at the length of a leg; a tenth on keel and socket."""
    scale = np.ones(len(names))
    for i, name in enumerate(names):
        kind = name.split("_")[0]
        turning = not any(part in name for part in ("_tx", "_ty", "_tz", "_fx", "_fz"))
        scale[i] = {"power": weight_n, "stored": weight_n, "prosthesis": weight_n, "q": 0.1, "a": 20.0}.get(
            kind, moment_nm if turning else weight_n)
        if kind == "balance" and name not in BALANCE_OF_BODY and turning:
            scale[i] = 0.1 * moment_nm
        if name.endswith("_sole"):
            scale[i] = 0.01
    return scale


def _variable_scales(layout: Layout) -> np.ndarray:
    """(Z,) what counts as a change of one."""
    scale = np.ones(layout.size)
    for kind, angle, length in (("q", 0.1, 0.05), ("v", 1.0, 0.5), ("a", 20.0, 10.0)):
        part = getattr(layout, kind)
        scale[part] = angle
        scale[part][1:3] = length
    socket = np.array([5e-3, 5e-3, 0.05])
    w = np.concatenate([socket, np.full(layout.k - len(SOCKET), 0.02)])
    scale[layout.w], scale[layout.u] = w, 10.0 * w
    return scale


# Keel and socket under the load of a given motion: the displacements at which every instant is in balance.


BALANCED = 1e-8
"""Largest force (N) or moment (N m) that is left, over body weight."""
ITERATIONS, HALVINGS = 100, 25


def quasi_static_motion(
    model: SagittalModel, q: np.ndarray, v: np.ndarray, a: np.ndarray, p: np.ndarray, rates: sp.spmatrix,
    smoothing: Smoothing, *, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """w, u (12, N) of a motion q, v, a (8, N) with the design p (4,).

    Args:
        rates: (N, N) sparse, u = rates w over the instants. It must not look ahead only, as a one-sided difference
            at the first instant does: a damper would push; let a motion that is not periodic begin with a row of 0.
        start: (12, N) first guess; zeros by default.

    Raises:
        SimulationError: Newton's method finds no balance, with the instant and coordinate that lack most.
    """
    k, N = len(model.quasi_static), q.shape[1]
    w = np.zeros((k, N)) if start is None else np.array(start)
    design = np.repeat(np.asarray(p, dtype=float)[:, None], N, 1)
    rows, rates = slice(3, 3 + k), sp.coo_matrix(rates)

    def left(w: np.ndarray) -> np.ndarray:
        return model.evaluate(q, v, a, w, (rates @ w.T).T, design, smoothing)[rows]

    first = 3 * len(q)
    for _ in range(ITERATIONS):
        y, by = linearise(model, q, v, a, w, (rates @ w.T).T, design, smoothing)
        r, by = y[rows], by[rows, first:first + 2 * k]
        if np.abs(r).max() <= BALANCED * model.weight:
            return w, (rates @ w.T).T
        if not np.isfinite(by).all():
            break
        try:
            step = -_solved(by[:, :k], by[:, k:], rates, r)
        except RuntimeError:  # exactly singular
            break
        size, before = 1.0, float((r * r).sum())
        for _ in range(HALVINGS):
            after = left(w + size * step)
            if float((after * after).sum()) < before * (1.0 - 1e-4 * size):
                break
            size *= 0.5
        else:
            break
        w = w + size * step
    at, instant = np.unravel_index(np.argmax(np.where(np.isfinite(r), np.abs(r), np.inf)), r.shape)
    raise SimulationError(f"keel and socket find no balance under this motion's load: at instant {instant + 1} of {N} "
                          f"{model.quasi_static[at]} is off by {abs(r[at, instant]):.3g} N or N m", time_s=0.0)


def _solved(by_w: np.ndarray, by_u: np.ndarray, rates: sp.coo_matrix, r: np.ndarray) -> np.ndarray:
    """w (k, N) for which by_w w + by_u (rates w) is r, with (k, k, N) by instants; an instant's unknowns together."""
    k, N = r.shape
    i, j = (index[..., None] for index in np.indices((k, k)))
    of, at = (np.concatenate([np.arange(N), part]) * k for part in (rates.row, rates.col))
    entries = np.concatenate([by_w, by_u[..., rates.row] * rates.data], axis=-1)
    A = sp.csc_matrix((entries.ravel(), ((of + i).ravel(), (at + j).ravel())), shape=(k * N, k * N))
    return splu(A).solve(r.T.ravel()).reshape(N, k).T
