"""One periodic stride of a recorded trial, seen from the side: what a trajectory optimisation starts from and tracks.

The recording drives the 3-D model (fitted offsets and coordinates applied, keel and socket undeformed); the sagittal
model is laid on it instant by instant (`recorded_projection`), the stride is closed (`recorded_closing`,
`recorded_curves`), and the plates' forces with it (`recorded_curves`). Phase 0 is the strike of the prosthetic foot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vsf_drake.analysis.tuning.recorded_closing import (
    close,
    find_period,
    forced_acceleration,
    periodic_acceleration,
    second_derivative,
)
from vsf_drake.analysis.tuning.recorded_curves import (
    Curves,
    FootForce,
    advance_of,
    closing_weights,
    fit_periodic,
    fit_piece,
    foot_force,
    one_stride,
    plate_series,
)
from vsf_drake.analysis.tuning.recorded_errors import (
    View,
    center_rate,
    closing_errors,
    force_errors,
    moment_balance,
    place_errors,
    sentences,
    stride_heading,
    view,
)
from vsf_drake.analysis.tuning.recorded_events import (
    first_strike,
    heading,
    loaded_stances,
    moved_stances,
    sides,
    unknown_spans,
    within,
    within_stride,
)
from vsf_drake.analysis.tuning.recorded_projection import TX, Nearness, SagittalChain, project
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.walk import Walker

HARMONICS = 16
"""Order of the periodic curves (a choice): 12 to 15 Hz at usual cadences, twice what joint angles hold."""
LEAST_HARMONICS, MOST_HARMONICS = 4, 40
SHORTEST_SHARE, LONGEST_SHARE = 0.4, 0.85
"""What a stance can take of a stride."""
MARGIN_S = 0.1
MOST_MARGIN_S = 0.5
KNOT_S = 0.03
"""Distance of the knots of a piece of time (a choice: about as fine as the periodic curves)."""
Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class RecordedStride:
    """A recorded stride in the sagittal plane, or one prosthetic stance of it.

    Times are seconds since phase 0, the prosthetic foot's strike (the beginning of the piece if not `periodic`); time t
    is `start_s` + t in the recording. x is the distance along the way of walking from the laboratory's origin, z up.

    Attributes:
        names: the 8 coordinates, see `simulation.sagittal.model.sagittal_coordinates`.
        periodic: whether it is a stride that repeats, or a piece of time from 0 to `period_s`.
        period_s, advance_m: duration, and travel of pelvis_tx in it. start_s: time of phase 0 in the recording.
        curves: the motion. forces: of the feet by "prosthetic" and "intact"; a foot without a plate is missing.
        prosthetic_stance, intact_stance: (start, end) s; an end may lie beyond the period. None where unknown.
        forward: (2,) the way of walking in the laboratory's floor. chain: the sagittal model's geometry.
        errors: numbers by name with their unit at the end, see `recorded_errors`.
        notes: what was done and how well it fits, in sentences.
    """

    names: tuple[str, ...]
    periodic: bool
    period_s: float
    advance_m: float
    start_s: float
    curves: Curves
    forces: dict[str, FootForce]
    prosthetic_stance: Span
    intact_stance: Span | None
    forward: np.ndarray
    chain: SagittalChain
    errors: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def sample(self, times_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, rates and accelerations, each (n, 8), in m and rad, at (n,) s since phase 0.

        Of a stride at any time: q(t + period) is q(t) with pelvis_tx advanced.

        Raises:
            InputError: a time outside a piece that is not periodic.
        """
        return self.curves.sample(np.atleast_1d(np.asarray(times_s, dtype=float)))

    def grf(self, times_s: float | np.ndarray) -> dict[str, np.ndarray]:
        """By "prosthetic" and "intact" (n, 3): force along x and z (N), moment about y at W's origin (N m).

        NaN where no plate measured it, see `known`.
        """
        return {foot: force.sample(times_s)[0] for foot, force in self.forces.items()}

    def cop(self, times_s: float | np.ndarray) -> dict[str, np.ndarray]:
        """By "prosthetic" and "intact" (n,) m: the centre of pressure's x; NaN where the foot is not loaded."""
        return {foot: force.sample(times_s)[1] for foot, force in self.forces.items()}

    def known(self, times_s: float | np.ndarray) -> dict[str, np.ndarray]:
        """By "prosthetic" and "intact" (n,) whether the force is known; False for a foot without a plate."""
        count = len(np.atleast_1d(times_s))
        unknown = {foot: np.zeros(count, dtype=bool) for foot in ("prosthetic", "intact")}
        return unknown | {foot: np.isfinite(force[:, :2]).all(axis=1) for foot, force in self.grf(times_s).items()}


def recorded_stride(trial: Trial, walker: Walker | None = None, *, harmonics: int = HARMONICS,
                    period_s: float | None = None, nearness: Nearness | None = None,
                    follow_forces: bool | None = None, all_strides: bool = False) -> RecordedStride:
    """The periodic stride of a trial.

    Args:
        trial: with its fitted contact applied (`motion.fitted_trial.trial_with`), if it has one.
        walker: of the trial's person and model; made if None. Its Context is not changed.
        harmonics: order of the periodic curves.
        period_s: instead of the one that the recording tells.
        nearness: what counts how much where the sagittal model cannot follow.
        all_strides: whether the mean of all that was recorded is taken, instead of the stride around the first whole
            prosthetic stance alone; strides differ from each other by millimetres of height.
        follow_forces: whether the closed motion's accelerations follow the plates rather than the recorded motion;
            None: where the plates know both feet's forces over the whole stride.

    Raises:
        InputError: the recording holds no whole stride, no strike of the prosthetic foot, or does not travel.
    """
    if not LEAST_HARMONICS <= harmonics <= MOST_HARMONICS:
        raise InputError(f"{harmonics} harmonics are no order of a stride's curves", where="harmonics",
                         right=f"They must be from {LEAST_HARMONICS} to {MOST_HARMONICS}")
    seen, file = view(trial, walker), trial.path
    time = seen.time_s
    loaded, moved = loaded_stances(trial), moved_stances(time, seen.points, seen.zero)
    unknown = unknown_spans(trial, loaded, moved)
    angles = [i for i, name in enumerate(trial.trajectory.names) if not name.startswith("pelvis")]
    series = [plate_series(trial.plates[side], seen.forward, unknown[s]) for s, side in sides(trial).items()
              if side in trial.plates]
    period = find_period(time, trial.trajectory.sample(time)[0][:, angles], series, loaded, moved, stated_s=period_s,
                         file=file)
    T, mass = period.seconds, trial.subject.mass_kg
    first = first_strike(loaded["P"], (trial.start_s, trial.end_s), file=file)
    start = first.start_s
    prosthetic, how_p = within_stride([first] if first.complete else loaded["P"], moved["P"], start, T)
    if prosthetic is None or not SHORTEST_SHARE * T <= prosthetic[1] - prosthetic[0] <= LONGEST_SHARE * T:
        raise InputError(f"the prosthetic stance that begins at {start:.3f} s has no end that can be told", file=file,
                         where="forces", right="A stride needs strike and lift-off of the prosthetic foot")
    intact, how_i = within_stride(loaded["I"], moved["I"], start, T)
    seen = seen.turned(stride_heading(seen, T))
    span = (time[0], time[-1]) if all_strides else one_stride((time[0], time[-1]), start + np.mean(prosthetic), T)
    weights = closing_weights(time, *span, T)
    rates = second_derivative(seen.misfit(nearness).wanted[:, -1], time, cutoff_hz=1.5 * harmonics / T)
    path = periodic_acceleration(time - start, rates, weights, period_s=T, order=harmonics)
    inside = (time >= span[0]) & (time <= span[1])
    seen, weights = seen.at(inside), weights[inside]
    misfit, t = seen.misfit(nearness), seen.time_s - start
    projection = project(seen.chain, misfit)
    advance = advance_of(t, projection.q[:, TX], T)
    by = {"start_s": start, "period_s": T, "unknown": unknown, "span": span}
    forced = forced_acceleration(_forces(trial, seen, advance_m=advance, **by), mass)
    if follow_forces and forced is None:
        raise InputError("the plates do not know both feet's forces over the whole stride", file=file, where="forces",
                         right="Without follow_forces the motion's own accelerations serve")
    wish = path
    if forced is not None and follow_forces is not False:
        wish = periodic_acceleration(forced[0][1:], forced[1][1:], np.ones(len(forced[0]) - 1), period_s=T,
                                     order=harmonics)
    curves = fit_periodic(t, projection.q, weights, period_s=T, advance=advance * np.eye(8)[TX], order=harmonics)
    curves, shift, closed = close(seen.chain, misfit, curves, t, weights, wish, projection.shift)
    advance = float(curves.advance[TX])
    forces = _forces(trial, seen, advance_m=advance, **by)
    errors = {"period.overlap_s": period.overlap_s}
    standing = {"prosthetic": within(t, prosthetic, T), "intact": within(t, intact, T)}
    errors |= place_errors(seen, projection.q, curves.sample(t)[0], weights, standing)
    errors |= closing_errors(seen, projection.q, curves.advance, T)
    errors |= force_errors(lambda times: center_rate(seen.chain, curves, times), forces, mass, T)
    errors |= force_errors(lambda times: path.sample(times)[0] @ [1.0, 1j], forces, mass, T, of="recorded")
    errors |= moment_balance(seen.chain, curves, forces, T)
    notes = (f"The stride takes {T:.4f} s, by {period.method}; the pelvis travels {advance:.3f} m.",
             f"Prosthetic stance: {how_p}. Intact stance: {how_i}.",
             f"Its accelerations follow the {'recorded motion' if wish is path else 'plates'}.",
             *sentences(errors, shift, converged=closed and projection.converged))
    return RecordedStride(
        names=seen.names, periodic=True, period_s=T, advance_m=advance, start_s=start, curves=curves, forces=forces,
        prosthetic_stance=prosthetic, intact_stance=intact, forward=seen.forward, chain=seen.chain, errors=errors,
        notes=notes)


def prosthetic_stance_only(trial: Trial, walker: Walker | None = None, *, margin_s: float = MARGIN_S,
                           nearness: Nearness | None = None, follow_forces: bool | None = None) -> RecordedStride:
    """One prosthetic stance with a margin before and after it, not periodic: for a recording without a whole stride.

    Args:
        margin_s: as much of it as was recorded. Others: see `recorded_stride`.

    Raises:
        InputError: no prosthetic stance was seen as a whole, or the person does not travel.
    """
    seen, file = view(trial, walker), trial.path
    time = seen.time_s
    loaded, moved = loaded_stances(trial), moved_stances(time, seen.points, seen.zero)
    stance = first_strike(loaded["P"], (trial.start_s, trial.end_s), file=file)
    if not stance.complete:
        raise InputError(f"the prosthetic stance from {stance.start_s:.3f} s is cut at {stance.end_s:.3f} s", file=file,
                         where="forces", right="A stance needs strike and lift-off, in the motion and on the plate")
    if not 0.0 <= margin_s <= MOST_MARGIN_S:
        raise InputError(f"{margin_s:g} s is no margin of a stance", where="margin_s",
                         right=f"It must be from 0 to {MOST_MARGIN_S:g} s")
    start, end = max(time[0], stance.start_s - margin_s), min(time[-1], stance.end_s + margin_s)
    rows = (time >= start) & (time <= end)
    seen = seen.turned(heading(seen.at(rows).points, file=file))
    path = second_derivative(seen.misfit(nearness).wanted[:, -1], time, cutoff_hz=0.5 / KNOT_S)[rows]
    seen = seen.at(rows)
    t, misfit, mass = seen.time_s - start, seen.misfit(nearness), trial.subject.mass_kg
    forces = _forces(trial, seen, span=(start, end), start_s=start, period_s=end - start, advance_m=0.0,
                     periodic=False, unknown=unknown_spans(trial, loaded, moved))
    forced = forced_acceleration(forces, mass)
    if follow_forces and forced is None:
        raise InputError("the plates do not know both feet's forces throughout", file=file, where="forces",
                         right="Without follow_forces the motion's own accelerations serve")
    by = {"end_s": end - start, "knot_s": KNOT_S}
    wish = fit_piece(t, path, **by) if forced is None or follow_forces is False else fit_piece(*forced, **by)
    projection = project(seen.chain, misfit)
    curves, shift, closed = close(seen.chain, misfit, fit_piece(t, projection.q, **by), t, np.ones(len(t)), wish,
                                  projection.shift)
    q = curves.sample(t)[0]
    standing = {"prosthetic": (seen.time_s >= stance.start_s) & (seen.time_s <= stance.end_s)}
    errors = place_errors(seen, projection.q, q, np.ones(len(q)), standing)
    errors |= force_errors(lambda times: center_rate(seen.chain, curves, times), forces, mass, end - start,
                           periodic=False)
    return RecordedStride(
        names=seen.names, periodic=False, period_s=end - start, advance_m=float(q[-1, TX] - q[0, TX]), start_s=start,
        curves=curves, forces=forces, prosthetic_stance=(stance.start_s - start, stance.end_s - start),
        intact_stance=None, forward=seen.forward, chain=seen.chain, errors=errors,
        notes=(f"One prosthetic stance of {stance.duration_s:.3f} s with margins of {stance.start_s - start:.3f} and "
               f"{end - stance.end_s:.3f} s, not periodic.",
               *sentences(errors, shift, converged=closed and projection.converged)))


def _forces(trial: Trial, seen: View, *, unknown: dict[str, tuple[Span, ...]], **by) -> dict[str, FootForce]:
    record = (trial.trajectory.start_s, trial.trajectory.end_s)
    feet = zip(sides(trial).items(), ("prosthetic", "intact"), strict=True)
    return {foot: foot_force(trial.plates[side], seen.forward, record=record, unknown=unknown[s], **by)
            for (s, side), foot in feet if side in trial.plates}
