"""What a stride is held against: what was recorded or, once that is tracked, the possible motion
nearest to it; and able-bodied walking.

No recording is a possible motion of the sagittal model: what the plates measured is not what its
masses need, by some percent of body weight. Held to that, a free fulcrum is moved to make up for
it. Held to the tracked stride, whose motion, forces of both feet and fulcrum belong together, it
has nothing to make up for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import TrajectorySolution, resampled
from vsf_drake.optimal_control.normal import ANGLES, FORCES, NormalGait, without_side
from vsf_drake.optimal_control.recorded_curves import Span
from vsf_drake.optimal_control.recorded_projection import TILT, TX, TY
from vsf_drake.optimal_control.recorded_stride import RecordedStride, share_of
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel, Smoothing

SWING_MIDDLE = (0.3, 0.7)  # share of a swing in which the foot must clear the ground
FEET = ("prosthetic", "intact")
# of body weight, under more of which a foot of able-bodied walking stands (a choice)
LOADED_BW = 0.05
# how far a foot that stands is in the ground at first, smoothed over the stride
SUNK_M = 0.005
HEIGHT_HARMONICS = 4
LOADED_N = 1.0  # below, a centre of pressure says nothing (a choice)


@dataclass(frozen=True, eq=False)
class StrideReference:
    """N instants of a recorded stride or of a consistent one, sagittal; SI."""

    q: np.ndarray  # (N, 8), and its derivatives
    v: np.ndarray
    a: np.ndarray
    force: dict[str, np.ndarray]  # by foot (N, 2) fx, fz in N, 0 where not known
    cop_x: dict[str, np.ndarray]
    """by foot (N,) m, where the moment counts: the centre of pressure, if there is load"""
    moment: dict[str, np.ndarray]  # by foot (N,) N m of the ground about +y there
    known: dict[str, np.ndarray]  # by foot (N,) whether the force was measured
    stance: dict[str, np.ndarray]  # by foot (N,)
    clear: dict[str, np.ndarray]  # by foot (N,) middle of swing
    late: np.ndarray  # (N,) late prosthetic stance


def stride_reference(
    recorded: RecordedStride, times: np.ndarray, late_share: float
) -> StrideReference:
    """The recorded stride at instants (N,) s."""
    measured = {foot: recorded.measured(foot, times) for foot in FEET}
    q, v, a = recorded.sample(times)
    return StrideReference(
        q=q,
        v=v,
        a=a,
        force={foot: np.nan_to_num(force[:, :2]) for foot, (force, _) in measured.items()},
        cop_x={foot: np.nan_to_num(cop) for foot, (_, cop) in measured.items()},
        moment=dict.fromkeys(FEET, np.zeros(len(times))),
        known={
            foot: np.isfinite(force[:, :2]).all(axis=1) for foot, (force, _) in measured.items()
        },
        **phases_of(
            {"prosthetic": recorded.prosthetic_stance, "intact": recorded.intact_stance},
            times,
            recorded.period_s,
            late_share,
        ),
    )


def phases_of(
    spans: Mapping[str, Span | None], times: np.ndarray, period: float, late_share: float
) -> dict[str, Any]:
    """`stance`, `clear` and `late` of a `StrideReference` at times (N,), of each foot's stance,
    None where it is not known; times, stances and period in one unit."""
    never = np.zeros(len(times), dtype=bool)
    stance = dict.fromkeys(spans, never)
    clear = dict.fromkeys(spans, never)
    late = never
    for foot, span in spans.items():
        if span is not None:
            share = share_of(span, times, period)
            stance[foot] = ~np.isnan(share)
            clear[foot] = _in_the_middle(share_of((span[1], span[0] + period), times, period))
            late = share >= late_share if foot == "prosthetic" else late
    return {"stance": stance, "clear": clear, "late": late}


def _in_the_middle(swing: np.ndarray) -> np.ndarray:
    """(N,) whether shares of a swing are in its middle."""
    return (swing >= SWING_MIDDLE[0]) & (swing <= SWING_MIDDLE[1])


def consistent_reference(
    recorded: StrideReference, solution: TrajectorySolution, grid: Grid, outputs: tuple[str, ...]
) -> StrideReference:
    """The stride of a solution whose function's first outputs have these names, both feet's forces
    known, at the instants of a grid of the same duration; by splines where these are not the
    solution's own."""
    y = solution.last_y()
    old = solution.problem.grid
    layout = solution.problem.layout
    z = resampled(solution, grid).z
    times = np.append(old.times_s, old.duration_s)

    kinds = ("fx", "fz", "my")

    def at(foot: str) -> np.ndarray:
        values = y[:, [outputs.index(f"{foot}_{kind}") for kind in kinds]]
        spline = CubicSpline(times, np.vstack([values, values[:1]]), bc_type="periodic")
        return np.asarray(spline(grid.times_s).T)

    force = {}
    cop = {}
    moment = {}
    for foot, recorded_x in recorded.cop_x.items():
        fx, fz, my = at(foot)
        cop[foot] = np.where(fz > LOADED_N, -my / np.maximum(fz, LOADED_N), recorded_x)
        force[foot], moment[foot] = np.column_stack([fx, fz]), my + cop[foot] * fz
    return dataclasses.replace(
        recorded,
        q=z[:, layout.q],
        v=z[:, layout.v],
        a=z[:, layout.a] / solution.last.p[-1] ** 2,
        force=force,
        cop_x=cop,
        moment=moment,
        known={foot: np.ones(grid.instants, dtype=bool) for foot in force},
    )


def normal_reference(
    gait: NormalGait,
    model: SagittalModel,
    grid: Grid,
    advance_m: float,
    tilt_rad: float,
    late_share: float,
) -> StrideReference:
    """Able-bodied walking of a person with this mean tilt of the pelvis, the prosthetic foot's
    strike at 0, the other's half a stride later; the pelvis at a steady speed, as high as puts the
    lower foot on the ground."""
    phase = grid.times_s / grid.duration_s
    phases = {"prosthetic": phase, "intact": (phase - 0.5) % 1.0}
    other = "l" if model.subject.prosthetic_side == "right" else "r"
    q, v, a = (np.zeros((grid.instants, len(model.coordinates))) for _ in range(3))
    for i, name in enumerate(model.coordinates):
        if (kind := without_side(name)) in ANGLES:
            quantity, sign = ANGLES[kind]
            own = phases["intact" if name.endswith(f"_{other}") else "prosthetic"]
            for rank, values in enumerate((q, v, a)):
                values[:, i] = (
                    sign * np.radians(gait.at(quantity, own, rank)) / grid.duration_s**rank
                )
    lean = tilt_rad - q[:, TILT].mean()
    q[:, TILT] += lean
    hips = [i for i, name in enumerate(model.coordinates) if name.startswith("hip_flexion")]
    q[:, hips] -= lean
    v[:, TX] = advance_m / grid.duration_s
    q[:, TX] = v[:, TX] * grid.times_s

    # Set down: of the soles' height the slow part, with its derivatives.
    still = np.zeros((len(model.quasi_static), grid.instants))
    y = model.evaluate(
        q.T,
        v.T,
        a.T,
        still,
        still,
        np.repeat(np.eye(len(DESIGN))[1][:, None], grid.instants, 1),
        Smoothing(),
    )
    height = SUNK_M + np.min([y[model.outputs.index(f"{foot}_sole")] for foot in FEET], axis=0)
    turn = 2.0j * np.pi * np.fft.rfftfreq(grid.instants, grid.duration_s / grid.instants)
    slow = np.fft.rfft(-height) * (np.arange(len(turn)) <= HEIGHT_HARMONICS)
    for rank, values in enumerate((q, v, a)):
        values[:, TY] = np.fft.irfft(slow * turn**rank, grid.instants)

    force = {
        foot: np.column_stack([gait.at(name, own) for name in FORCES])
        for foot, own in phases.items()
    }
    stance = {foot: own[:, 1] > LOADED_BW for foot, own in force.items()}
    ends = {foot: phases[foot][stance[foot]].max() for foot in FEET}
    swing = {foot: (phases[foot] - end) / (1.0 - end) for foot, end in ends.items()}
    nothing = np.zeros(grid.instants)
    never = np.zeros(grid.instants, dtype=bool)
    return StrideReference(
        q=q,
        v=v,
        a=a,
        force={foot: model.weight * own for foot, own in force.items()},
        cop_x=dict.fromkeys(FEET, nothing),
        moment=dict.fromkeys(FEET, nothing),
        known=dict.fromkeys(FEET, never),
        stance=stance,
        late=stance["prosthetic"] & (phase >= late_share * ends["prosthetic"]),
        clear={foot: _in_the_middle(share) for foot, share in swing.items()},
    )
