"""A simulated walk beside its force plate: the same instants, axes and filters for both.

Time-locked: nothing is shifted. The axes are the walk's own: fore-aft along the mean horizontal
velocity of the pelvis, lateral to the left of it, vertical up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from vsf_drake.motion.events import Stance, common, find_stances, known_stances, runs
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass

FORCE_CUTOFF_HZ = 40.0
COP_CUTOFF_HZ = 6.0
THRESHOLD_N = 20.0
MARGIN_S = 0.25
PERCENT = np.linspace(0.0, 100.0, 101)
_MINIMUM_PATH_M = 0.2
_SHORTEST_RUN_S = 0.02

if TYPE_CHECKING:
    from vsf_drake.simulation.reactions import ReactionSensitivity


class ComparableWalk(Protocol):
    """What a comparison reads of a finished walk; a `WalkResult` has it."""

    @property
    def time_s(self) -> np.ndarray: ...
    @property
    def grf_W(self) -> np.ndarray: ...
    @property
    def cop_W(self) -> np.ndarray: ...
    def column(self, name: str) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class StanceComparison:
    """One measured stance that overlaps the simulation; centres of pressure (101, 2) m, fore-aft
    and lateral, at 0-100 % of the measured stance."""

    measured: Stance  # in the plate's whole record
    model: Stance | None  # the model's stance that overlaps it most, if any
    inside: bool  # the measured stance lies inside the simulated time as a whole
    span: tuple[float, float]
    """start and end (s) of stance ± MARGIN_S, clipped to the compared time"""
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
    """Model and plate on the model's instants."""

    time_s: np.ndarray  # (n,) evenly spaced, where both exist
    step_s: float
    model: np.ndarray  # (n, 3) N, low-passed: fore-aft, lateral (left), vertical
    measured: np.ndarray  # likewise
    scored: np.ndarray  # (n,) bool: the instant lies in a measured stance ± MARGIN_S
    stances: tuple[StanceComparison, ...]  # that overlap `time_s`, in order
    extra_model_stances: int  # that overlap no measured one
    heading: np.ndarray  # (2,) unit vector of progression in W

    def within(self, start_s: float, end_s: float) -> np.ndarray:
        """(n,) whether the instant lies in [start_s, end_s]."""
        return (self.time_s >= start_s - 1e-9) & (self.time_s <= end_s + 1e-9)

    def measured_rows(self) -> list[np.ndarray]:
        """For each measured stance, (n,) whether the instant lies in it."""
        return [self.within(item.measured.start_s, item.measured.end_s) for item in self.stances]


def compare(result: ComparableWalk, plate: PlateRecording) -> Comparison:
    """Brings a finished walk and the record of the plate under the prosthetic foot together.

    Forces: the plate is resampled to the model's instants (and beyond the simulated time where it
    has data, so that its filter has no edge there), then both are low-passed, zero-phase
    (Butterworth, 4th order, FORCE_CUTOFF_HZ). Centre of pressure: low-passed at COP_CUTOFF_HZ
    inside each interval with more than THRESHOLD_N only, never across a gap. Stances are scored
    with MARGIN_S before and after, but for the spans in which the plate's force is unknown and the
    stances that these touch. ValueError if the two have no time in common.
    """
    grid = uniform_grid(result.time_s)
    step = float(grid[1] - grid[0])

    # forces on the model's instants, where the plate has a record too
    heading = walking_direction(result)
    axes = walk_axes(heading)
    raw = resample(grid, result.time_s, result.grf_W @ axes.T)
    model = low_pass(raw, rate_hz=1.0 / step, cutoff_hz=FORCE_CUTOFF_HZ)
    plate_force = plate.force_W @ axes.T
    seen = (grid >= plate.time_s[0] - 1e-9) & (grid <= plate.time_s[-1] + 1e-9)
    if np.count_nonzero(seen) < 2:
        raise ValueError(
            f"the plate's record, {plate.time_s[0]:g} to {plate.time_s[-1]:g} s, does not "
            f"overlap the simulation, {grid[0]:g} to {grid[-1]:g} s"
        )
    time = grid[seen]

    # each measured stance with the model's that overlaps it most, and both centres of pressure over
    # its percents
    measured_stances = known_stances(plate)
    model_stances = [
        stance
        for stance in find_stances(grid, raw[:, 2], threshold_n=THRESHOLD_N)
        if not any(common((stance.start_s, stance.end_s), span) for span in plate.unknown_s)
        or partner(stance, measured_stances)
    ]
    stances = []
    for stance in (s for s in measured_stances if s.end_s > time[0] and s.start_s < time[-1]):
        instants = percent_instants(stance)
        cop = [
            filtered_while_loaded((p @ axes.T)[:, :2], t, force, p, instants)
            for t, force, p in (
                (plate.time_s, plate_force[:, 2], plate.cop_W),
                (result.time_s, result.grf_W[:, 2], result.cop_W),
            )
        ]
        cop[1][
            (instants < time[0] - 1e-9)
            | (instants > time[-1] + 1e-9)
            | np.isnan(cop[0]).any(axis=1)
        ] = np.nan
        stances.append(
            StanceComparison(
                measured=stance,
                model=partner(stance, model_stances),
                measured_cop=cop[0],
                model_cop=cop[1],
                inside=bool(
                    stance.complete and stance.start_s >= time[0] and stance.end_s <= time[-1]
                ),
                span=(
                    max(stance.start_s - MARGIN_S, float(time[0])),
                    min(stance.end_s + MARGIN_S, float(time[-1])),
                ),
            )
        )
    comparison = Comparison(
        time_s=time,
        step_s=step,
        model=model[seen],
        measured=_filtered_plate(time, step, plate, plate_force),
        scored=np.zeros(len(time), dtype=bool),
        stances=tuple(stances),
        heading=heading,
        extra_model_stances=sum(
            partner(stance, measured_stances) is None for stance in model_stances
        ),
    )
    for item in stances:
        comparison.scored[comparison.within(*item.span)] = True
    for span in plate.unknown_s:
        comparison.scored[comparison.within(*span)] = False
    return comparison


def walking_direction(result: ComparableWalk) -> np.ndarray:
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
    """(n, m) values at `time` -> at `grid`, on straight lines."""
    return np.column_stack([np.interp(grid, time, column) for column in values.T])


def _filtered_plate(
    time: np.ndarray, step: float, plate: PlateRecording, force: np.ndarray
) -> np.ndarray:
    before = int(min(MARGIN_S, time[0] - plate.time_s[0]) / step + 1e-6)
    after = int(min(MARGIN_S, plate.time_s[-1] - time[-1]) / step + 1e-6)
    wide = time[0] + step * np.arange(-before, len(time) + after)
    smooth = low_pass(
        resample(wide, plate.time_s, force), rate_hz=1.0 / step, cutoff_hz=FORCE_CUTOFF_HZ
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
    rate = 1.0 / float(grid[1] - grid[0])
    curve = np.full((len(instants), series.shape[1]), np.nan)
    smooth = low_pass(
        np.interp(grid, time, vertical), rate_hz=rate, cutoff_hz=min(FORCE_CUTOFF_HZ, 0.45 * rate)
    )
    valid = (vertical > THRESHOLD_N) & np.isfinite(cop).all(axis=1)
    for start, stop in runs(smooth > THRESHOLD_N):
        # the grid is rounded
        own = valid & (time >= grid[start] - 1e-9) & (time <= grid[stop - 1] + 1e-9)
        if np.count_nonzero(own) < 2:
            continue
        first, last = time[own][[0, -1]]
        points = grid[(grid >= first - 1e-9) & (grid <= last + 1e-9)]
        if last - first < _SHORTEST_RUN_S or len(points) < 2:
            continue
        filtered = low_pass(
            resample(points, time[own], series[own]),
            rate_hz=rate,
            cutoff_hz=min(COP_CUTOFF_HZ, 0.45 * rate),
        )
        here = (instants >= points[0]) & (instants <= points[-1])
        curve[here] = resample(instants[here], points, filtered)
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
    return float(np.sqrt(np.mean(difference**2))) if difference.size else float("nan")


def r_squared(
    model: np.ndarray, measured: np.ndarray, *, groups: np.ndarray | None = None
) -> float:
    """Coefficient of determination 1 - SSE / SST, no squared correlation; NaN where `measured` does
    not vary.

    With labels `groups` (n,) SST is taken about the mean of each group, so that a distance between
    groups (footprints along a walkway) is not counted as explained.
    """
    model = np.asarray(model, dtype=float)
    measured = np.asarray(measured, dtype=float)
    labels = np.zeros(measured.shape) if groups is None else np.asarray(groups)
    total = sum(
        float(np.sum((part - part.mean()) ** 2))
        for part in (measured[labels == g] for g in np.unique(labels))
    )
    return 1.0 - float(np.sum((model - measured) ** 2)) / total if total > 0.0 else float("nan")


def cumulative_integral(values: np.ndarray, step: float) -> np.ndarray:
    """(n,) integral from the first sample to each by the trapezoidal rule; starts at zero."""
    values = np.asarray(values, dtype=float)
    return np.concatenate(([0.0], np.cumsum(0.5 * step * (values[1:] + values[:-1]))))


def uniform_grid(time_s: np.ndarray) -> np.ndarray:
    """Evenly spaced instants over the span of `time_s`, at its median spacing."""
    step = float(np.median(np.diff(time_s)))
    return np.asarray(
        time_s[0] + step * np.arange(int(np.floor((time_s[-1] - time_s[0]) / step + 1e-6)) + 1)
    )
