"""A simulated walk beside its force plate: the same instants, axes and filters for both.

Time-locked: nothing is shifted. The axes are the walk's own: fore-aft along the mean horizontal
velocity of the pelvis, lateral to the left of it, vertical up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.motion.events import (
    LIFTED_N,
    STRUCK_N,
    Stance,
    common,
    find_stances,
    known_stances,
    runs,
)
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.simulation.options import TRANSIENT_S

FORCE_CUTOFF_HZ = 40.0
COP_CUTOFF_HZ = 6.0
THRESHOLD_N = 20.0
MARGIN_S = 0.25
PERCENT = np.linspace(0.0, 100.0, 101)
_MINIMUM_PATH_M = 0.2
_SHORTEST_RUN_S = 0.02
_MOST_OF_RATE = 0.45  # of a cut-off, as a share of the samples per second

if TYPE_CHECKING:
    from vsf_drake.simulation.reactions import ReactionSensitivity


class MovingWalk(Protocol):
    """What has histories of coordinates."""

    def column(self, name: str) -> np.ndarray: ...


class ComparableWalk(MovingWalk, Protocol):
    """What a comparison reads of a finished walk; a `WalkResult` has it."""

    @property
    def time_s(self) -> np.ndarray: ...
    @property
    def grf_W(self) -> np.ndarray: ...
    @property
    def cop_W(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class StanceComparison:
    """One measured stance that overlaps the simulation; centres of pressure (101, 2) m, fore-aft
    and lateral, at 0-100 % of the measured stance."""

    measured: Stance  # in the plate's whole record
    model: Stance | None  # the model's stance that overlaps it most, if any
    inside: bool  # the measured stance lies inside the simulated time as a whole
    span: tuple[float, float]
    """start and end (s) of stance ± MARGIN_S, clipped to the compared time, and of a stance in
    which the walk starts to what is later than TRANSIENT_S"""
    measured_cop: np.ndarray  # of the whole stance; NaN where the plate is not loaded
    model_cop: np.ndarray  # NaN where it cannot be compared

    @property
    def strike_error_s(self) -> float | None:
        """The model's strike less the measured one; None unless both were seen, in the compared
        time."""
        own = self.model
        real = self.measured
        seen = own and own.start_seen and real.start_seen and real.start_s >= self.span[0]
        return own.start_s - real.start_s if own and seen else None

    @property
    def lift_off_error_s(self) -> float | None:
        """Likewise of the lift-off."""
        own = self.model
        real = self.measured
        seen = own and own.end_seen and real.end_seen and real.end_s <= self.span[1]
        return own.end_s - real.end_s if own and seen else None


@dataclass(frozen=True, eq=False)
class Comparison:
    """Model and plate on the model's instants. Without a plate what is measured is NaN, nothing is
    scored, and `stances` are none."""

    time_s: np.ndarray  # (n,) evenly spaced, where both exist
    step_s: float
    model: np.ndarray  # (n, 3) N, low-passed: fore-aft, lateral (left), vertical
    measured: np.ndarray  # likewise
    scored: np.ndarray  # (n,) bool: the instant lies in a `span` of `stances`
    stances: tuple[StanceComparison, ...]  # that overlap `time_s`, in order
    model_stances: tuple[Stance, ...]  # of the model, but for those in unknown force
    extra_model_stances: int | None  # of them that overlap no measured one; None without a plate
    heading: np.ndarray  # (2,) unit vector of progression in W

    @property
    def plateless(self) -> bool:
        """Whether no force was measured."""
        return self.extra_model_stances is None

    @property
    def laid_on(self) -> list[Stance]:
        """The model's `whole` stances, on which curves over a stance are laid: those on the plate
        where there is one."""
        on_plate = {item.model for item in self.stances}
        return [
            stance
            for stance in self.model_stances
            if stance.whole and (self.plateless or stance in on_plate)
        ]

    def within(self, start_s: float, end_s: float) -> np.ndarray:
        """(n,) whether the instant lies in [start_s, end_s]."""
        return _within(self.time_s, start_s, end_s)

    def measured_rows(self) -> list[np.ndarray]:
        """For each measured stance, (n,) whether the instant lies in it, after a start in it as
        far as it is scored."""
        return [
            self.within(max(item.measured.start_s, item.span[0]), item.measured.end_s)
            for item in self.stances
        ]


def compare(result: ComparableWalk, plate: PlateRecording | None) -> Comparison:
    """Brings a finished walk and the record of the plate under the prosthetic foot together; None
    where there is no plate.

    Forces: the plate is resampled to the model's instants (and beyond the simulated time where it
    has data, so that its filter has no edge there), then both are low-passed, zero-phase
    (Butterworth, 4th order, FORCE_CUTOFF_HZ). Centre of pressure: low-passed at COP_CUTOFF_HZ
    inside each interval with more than THRESHOLD_N only, never across a gap. Stances are scored
    with MARGIN_S before and after, but for the spans in which the plate's force is unknown, the
    stances that these touch, and TRANSIENT_S of a stance in which the walk starts. InputError if
    the two have no time in common.
    """
    return compare_all([result], plate)[0]


def compare_all(walks: Sequence[ComparableWalk], plate: PlateRecording | None) -> list[Comparison]:
    """`compare` of each of some walks on the same instants: what filters them takes all at once,
    and the plate is filtered once. ValueError if they do not share their instants."""
    time_s = walks[0].time_s
    if not all(np.array_equal(walk.time_s, time_s) for walk in walks[1:]):
        raise ValueError("walks that are compared together must have the same instants")
    grid = uniform_grid(time_s)
    step = float(grid[1] - grid[0])
    real = _unmeasured(grid) if plate is None else _measured(plate, float(grid[0]), step, len(grid))
    unknown_s = () if plate is None else plate.unknown_s

    # the model's forces in W on even instants (n, 3, walks), as they are and filtered
    raw = resample(grid, time_s, np.stack([walk.grf_W for walk in walks], axis=2))
    smooth = low_pass(raw, rate_hz=1.0 / step, cutoff_hz=FORCE_CUTOFF_HZ)
    loaded = (
        smooth[:, 2]
        if FORCE_CUTOFF_HZ <= _MOST_OF_RATE / step
        else _smooth_load(raw[:, 2], 1.0 / step)
    )
    centres = _filtered_parts(
        [walk.cop_W[:, :2] for walk in walks],
        time_s,
        [(walk.grf_W[:, 2], walk.cop_W) for walk in walks],
        grid,
        loaded,
    )

    # by the axes of each walk, with its stances
    measured: dict[bytes, np.ndarray] = {}
    comparisons = []
    for w, walk in enumerate(walks):
        heading = walking_direction(walk)
        axes = walk_axes(heading)
        model_stances = [
            stance
            for stance in find_stances(grid, raw[:, 2, w], threshold_n=THRESHOLD_N)
            if not any(common((stance.start_s, stance.end_s), span) for span in unknown_s)
            or partner(stance, real.known)
        ]
        stances = []
        for own in real.stances:
            model_cop = _at(own.instants, centres[w], 2)
            model_cop[own.beyond] = np.nan
            stances.append(
                StanceComparison(
                    measured=own.stance,
                    model=partner(own.stance, model_stances),
                    measured_cop=own.cop_W @ axes[:2, :2].T,
                    model_cop=model_cop @ axes[:2, :2].T,
                    inside=own.inside,
                    span=own.span,
                )
            )
        comparisons.append(
            Comparison(
                time_s=real.time_s,
                step_s=step,
                model=smooth[real.seen, :, w] @ axes.T,
                measured=measured.setdefault(heading.tobytes(), real.force_W @ axes.T),
                scored=real.scored,
                stances=tuple(stances),
                model_stances=tuple(model_stances),
                heading=heading,
                extra_model_stances=None
                if plate is None
                else sum(partner(stance, real.known) is None for stance in model_stances),
            )
        )
    return comparisons


class _MeasuredStance(NamedTuple):
    stance: Stance
    instants: np.ndarray  # (101,) s
    cop_W: np.ndarray  # (101, 2) m, of the whole stance; NaN where the plate is not loaded
    beyond: np.ndarray  # (101,) whether no model can be compared
    inside: bool
    span: tuple[float, float]


class _Measured(NamedTuple):
    """A plate on the instants of walks, in W."""

    seen: np.ndarray  # (grid,) whether the plate has a record, too
    time_s: np.ndarray  # (n,) of those instants
    force_W: np.ndarray  # (n, 3) N, low-passed
    known: list[Stance]  # all that the plate knows
    stances: list[_MeasuredStance]  # of them that overlap `time_s`
    scored: np.ndarray  # (n,) see `Comparison`


def _unmeasured(time_s: np.ndarray) -> _Measured:
    """No plate."""
    everywhere = np.ones(len(time_s), dtype=bool)
    return _Measured(
        seen=everywhere,
        time_s=time_s,
        force_W=np.full((len(time_s), 3), np.nan),
        known=[],
        stances=[],
        scored=~everywhere,
    )


@lru_cache(maxsize=64)
def _measured(plate: PlateRecording, start_s: float, step: float, count: int) -> _Measured:
    """The plate on `count` even instants, as arrays that nobody may change: they are kept for all
    its walks."""
    grid = start_s + step * np.arange(count)
    seen = (grid >= plate.time_s[0] - 1e-9) & (grid <= plate.time_s[-1] + 1e-9)
    if np.count_nonzero(seen) < 2:
        raise InputError(
            f"the plate's record, {plate.time_s[0]:g} to {plate.time_s[-1]:g} s, does not "
            f"overlap the simulation, {grid[0]:g} to {grid[-1]:g} s"
        )
    time = grid[seen]
    begins_s = start_s - step  # the grid has the ends of the walk's steps
    load_n = np.interp([begins_s, time[-1]], plate.time_s, plate.force_W[:, 2])
    starts_loaded, ends_loaded = load_n > [STRUCK_N, LIFTED_N]
    known = known_stances(plate)
    stances = []
    for stance in (s for s in known if s.end_s > time[0] and s.start_s < time[-1]):
        begun = bool(stance.start_s <= time[0] and starts_loaded)
        first_s = float(max(time[0], begins_s + TRANSIENT_S)) if begun else float(time[0])
        if first_s >= stance.end_s:
            continue
        instants = percent_instants(stance)
        cop = filtered_while_loaded(
            plate.cop_W[:, :2], plate.time_s, plate.force_W[:, 2], plate.cop_W, instants
        )
        beyond = (instants < first_s - 1e-9) | (instants > time[-1] + 1e-9)
        stances.append(
            _MeasuredStance(
                stance=stance,
                instants=instants,
                cop_W=cop,
                beyond=beyond | np.isnan(cop).any(axis=1),
                inside=bool(
                    stance.whole and not begun and (stance.end_s <= time[-1] or not ends_loaded)
                ),
                span=(
                    max(stance.start_s - MARGIN_S, first_s),
                    min(stance.end_s + MARGIN_S, float(time[-1])),
                ),
            )
        )
    scored = np.zeros(len(time), dtype=bool)
    for own in stances:
        scored[_within(time, *own.span)] = True
    for span in plate.unknown_s:
        scored[_within(time, *span)] = False
    force = _filtered_plate(time, step, plate)
    of_stances = (array for own in stances for array in (own.instants, own.cop_W, own.beyond))
    for shared in (seen, time, force, scored, *of_stances):
        shared.setflags(write=False)
    return _Measured(
        seen=seen,
        time_s=time,
        force_W=force,
        known=known,
        stances=stances,
        scored=scored,
    )


def walking_direction(result: MovingWalk) -> np.ndarray:
    """(2,) unit vector of the pelvis's mean horizontal velocity in W; W's x where it hardly
    moves."""
    path = np.array([result.column("pelvis_tx"), -result.column("pelvis_tz")])
    travelled = path[:, -1] - path[:, 0]
    distance = float(np.linalg.norm(travelled))
    return travelled / distance if distance > _MINIMUM_PATH_M else np.array([1.0, 0.0])


def walk_axes(heading: np.ndarray) -> np.ndarray:
    """(3, 3) unit vectors in W as rows: fore-aft, lateral (left), vertical."""
    return np.array([[*heading, 0.0], [-heading[1], heading[0], 0.0], [0.0, 0.0, 1.0]])


def percent_instants(stance: Stance) -> np.ndarray:
    """(101,) instants (s) of 0-100 % of a stance."""
    return np.asarray(stance.start_s + PERCENT / 100.0 * (stance.end_s - stance.start_s))


def resample(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n, ...) values at `time` -> at `grid`, on straight lines; beyond its ends the last."""
    left = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 2)
    share = np.clip((grid - time[left]) / (time[left + 1] - time[left]), 0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    before = values[left]
    return np.asarray(before + share * (values[left + 1] - before))


def _within(time: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
    return (time >= start_s - 1e-9) & (time <= end_s + 1e-9)


def _filtered_plate(time: np.ndarray, step: float, plate: PlateRecording) -> np.ndarray:
    before = int(min(MARGIN_S, time[0] - plate.time_s[0]) / step + 1e-6)
    after = int(min(MARGIN_S, plate.time_s[-1] - time[-1]) / step + 1e-6)
    wide = time[0] + step * np.arange(-before, len(time) + after)
    smooth = low_pass(
        resample(wide, plate.time_s, plate.force_W), rate_hz=1.0 / step, cutoff_hz=FORCE_CUTOFF_HZ
    )
    return smooth[before : before + len(time)]


def filtered_while_loaded(
    series: np.ndarray,
    time: np.ndarray,
    vertical: np.ndarray,
    cop: np.ndarray,
    instants: np.ndarray,
) -> np.ndarray:
    """(k, m) a series at other instants (k,), low-passed while the foot is loaded, each time apart;
    NaN elsewhere.

    Args:
        series: (n, m) the centre of pressure, or what is as linear as it: a derivative of it.
        time, vertical, cop: (n,) s, (n,) N and (n, 2 or 3) m, which tell when the foot is loaded.
    """
    grid = uniform_grid(time)
    loaded = _smooth_load(resample(grid, time, vertical[:, None]), 1.0 / float(grid[1] - grid[0]))
    [parts] = _filtered_parts([series], time, [(vertical, cop)], grid, loaded)
    return _at(instants, parts, series.shape[1])


class _Part(NamedTuple):
    """A series while the foot is loaded once."""

    instants: np.ndarray  # (k,) s
    values: np.ndarray  # (k, m)


def _smooth_load(vertical: np.ndarray, rate_hz: float) -> np.ndarray:
    """Of which a foot is taken for loaded, from the vertical force (n, ...) at even instants."""
    return low_pass(
        vertical, rate_hz=rate_hz, cutoff_hz=min(FORCE_CUTOFF_HZ, _MOST_OF_RATE * rate_hz)
    )


def _filtered_parts(
    series: Sequence[np.ndarray],
    time: np.ndarray,
    loads: Sequence[tuple[np.ndarray, np.ndarray]],
    grid: np.ndarray,
    smooth: np.ndarray,
) -> list[list[_Part]]:
    """For each of w series (n, m) its parts under load, low-passed; `loads` are the vertical force
    (n,) and centre of pressure (n, 2 or 3) of each, `smooth` (grid, w) its `_smooth_load`."""
    rate = 1.0 / float(grid[1] - grid[0])
    parts: list[list[_Part]] = [[] for _ in series]
    alike: dict[int, list[tuple[int, int]]] = {}
    for w, (own_series, (vertical, cop)) in enumerate(zip(series, loads, strict=True)):
        valid = (vertical > THRESHOLD_N) & np.isfinite(cop).all(axis=1)
        for start, stop in runs(smooth[:, w] > THRESHOLD_N):
            # the grid is rounded
            own = np.flatnonzero(valid & _within(time, grid[start], grid[stop - 1]))
            if len(own) < 2:
                continue
            first, last = time[own[[0, -1]]]
            points = grid[_within(grid, first, last)]
            if last - first < _SHORTEST_RUN_S or len(points) < 2:
                continue
            alike.setdefault(len(points), []).append((w, len(parts[w])))
            parts[w].append(_Part(points, resample(points, time[own], own_series[own])))
    for members in alike.values():
        filtered = low_pass(
            np.stack([parts[w][i].values for w, i in members], axis=2),
            rate_hz=rate,
            cutoff_hz=min(COP_CUTOFF_HZ, _MOST_OF_RATE * rate),
        )
        for k, (w, i) in enumerate(members):
            parts[w][i] = parts[w][i]._replace(values=filtered[:, :, k])
    return parts


def _at(instants: np.ndarray, parts: Sequence[_Part], width: int) -> np.ndarray:
    """(k, width) at the instants (k,); NaN outside of the parts."""
    curve = np.full((len(instants), width), np.nan)
    for part in parts:
        here = (instants >= part.instants[0]) & (instants <= part.instants[-1])
        curve[here] = resample(instants[here], part.instants, part.values)
    return curve


def partner(stance: Stance, candidates: Sequence[Stance]) -> Stance | None:
    """The one of `candidates` that overlaps `stance` most, if any does."""
    overlaps = [
        (min(one.end_s, stance.end_s) - max(one.start_s, stance.start_s), one) for one in candidates
    ]
    overlap, best = max(overlaps, key=lambda item: item[0], default=(0.0, None))
    return best if overlap > 0.0 else None


# All that `compare` does to the model's force and centre of pressure is linear in them (axes,
# resampling, filters), so derivatives go the same way. When the foot counts as loaded, and the
# direction of walking, are taken as they are.


@dataclass(frozen=True, eq=False)
class ComparisonSensitivity:
    """Derivatives of a `Comparison` by P variables, per unit of each."""

    names: tuple[str, ...]
    model: np.ndarray  # (n, 3, P) N, of `Comparison.model`
    cop: tuple[np.ndarray, ...]  # (101, 2, P) m, of each stance's `model_cop`, NaN where that is


def compare_sensitivity(
    comparison: Comparison, result: ComparableWalk, sensitivity: ReactionSensitivity
) -> ComparisonSensitivity:
    """Derivatives of what `compare` made of `result`, a finished walk; `sensitivity` is of the same
    walk."""
    if len(sensitivity.grf_W) != len(result.time_s):
        raise ValueError(
            f"sensitivities at {len(sensitivity.grf_W)} instants are not of a walk with "
            f"{len(result.time_s)}"
        )
    axes = walk_axes(comparison.heading)
    grid = uniform_grid(result.time_s)
    force, cop = (
        by.reshape(len(by), -1)
        for by in (axes @ sensitivity.grf_W, axes[:2, :2] @ sensitivity.cop_W)
    )
    filtered = low_pass(
        resample(grid, result.time_s, force),
        rate_hz=1.0 / comparison.step_s,
        cutoff_hz=FORCE_CUTOFF_HZ,
    )
    first = int(np.searchsorted(grid, comparison.time_s[0]))
    stances = []
    for item in comparison.stances:
        curve = filtered_while_loaded(
            cop, result.time_s, result.grf_W[:, 2], result.cop_W, percent_instants(item.measured)
        )
        curve[np.isnan(item.model_cop).any(axis=1)] = np.nan
        stances.append(curve.reshape(len(curve), 2, -1))
    return ComparisonSensitivity(
        names=sensitivity.names,
        cop=tuple(stances),
        model=filtered[first : first + len(comparison.time_s)].reshape(
            len(comparison.time_s), 3, -1
        ),
    )


# Small measures between two series that share their instants.


def rmse(model: np.ndarray, measured: np.ndarray) -> float:
    """Root of the mean squared difference; NaN without a sample."""
    difference = np.asarray(model, dtype=float) - np.asarray(measured, dtype=float)
    return float(row_rmse(difference.reshape(1, -1))[0])


def row_rmse(difference: np.ndarray, counted: np.ndarray | None = None) -> np.ndarray:
    """(w,) root of the mean square of each row of differences (w, n), of what is `counted` (w, n)
    in it; NaN without a sample."""
    if counted is None:
        squares = difference**2
        count: np.ndarray | int = difference.shape[1]
    else:
        squares = np.where(counted, difference, 0.0) ** 2
        count = np.count_nonzero(counted, axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(row_sums(squares) / np.asarray(count, dtype=float)))


def row_sums(values: np.ndarray) -> np.ndarray:
    """(w,) sum of each row (w, n), the same to the bit whichever rows stand beside it."""
    return np.asarray(np.ascontiguousarray(values).sum(axis=1))


def r_squared(
    model: np.ndarray, measured: np.ndarray, *, groups: np.ndarray | None = None
) -> float:
    """Coefficient of determination 1 - SSE / SST, no squared correlation; NaN where `measured` does
    not vary.

    With labels `groups` (n,) SST is taken about the mean of each group, so that a distance between
    groups (footprints along a walkway) is not counted as explained.
    """
    model = np.asarray(model, dtype=float).reshape(1, -1)
    measured = np.asarray(measured, dtype=float).reshape(1, -1)
    return float(row_r_squared(model, measured, groups=groups)[0])


def row_r_squared(
    model: np.ndarray,
    measured: np.ndarray,
    *,
    groups: np.ndarray | None = None,
    counted: np.ndarray | None = None,
) -> np.ndarray:
    """(w,) `r_squared` of each row (w, n), of what is `counted` (w, n) in it; `measured` may be one
    row for all."""
    shape = np.broadcast_shapes(model.shape, measured.shape)
    own = np.ones(shape, dtype=bool) if counted is None else counted
    difference = np.where(own, model - measured, 0.0)
    labels = np.zeros(shape[1]) if groups is None else np.asarray(groups)
    total = np.zeros(shape[0])
    for g in np.unique(labels):
        of_group = own[:, labels == g]
        part = np.where(of_group, measured[:, labels == g], 0.0)
        count = np.maximum(np.count_nonzero(of_group, axis=1), 1)
        mean = (row_sums(part) / count)[:, None]
        total += row_sums(np.where(of_group, part - mean, 0.0) ** 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = 1.0 - row_sums(difference**2) / total
    return np.where(total > 0.0, found, np.nan)


def cumulative_integral(values: np.ndarray, step: float) -> np.ndarray:
    """(..., n) integral along the last axis from the first sample to each by the trapezoidal rule;
    starts at zero."""
    values = np.asarray(values, dtype=float)
    steps = 0.5 * step * (values[..., 1:] + values[..., :-1])
    return np.concatenate([np.zeros_like(values[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def uniform_grid(time_s: np.ndarray) -> np.ndarray:
    """Evenly spaced instants over the span of `time_s`, at its median spacing."""
    step = float(np.median(np.diff(time_s)))
    return np.asarray(
        time_s[0] + step * np.arange(int(np.floor((time_s[-1] - time_s[0]) / step + 1e-6)) + 1)
    )
