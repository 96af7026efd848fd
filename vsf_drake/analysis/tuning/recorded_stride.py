"""One periodic stride of a recorded trial, seen from the side: what a trajectory optimisation starts from and tracks.

The recording drives the 3-D model (fitted offsets and coordinates applied, keel and socket undeformed); the sagittal
model is laid on it instant by instant (`recorded_projection`), the stride is closed, and the plates' forces with it
(`recorded_curves`). Phase 0 is the strike of the prosthetic foot (`recorded_events`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsf_drake.analysis.tuning import recorded_curves as periodic
from vsf_drake.analysis.tuning import recorded_events as events
from vsf_drake.analysis.tuning.recorded_curves import FootForce, PeriodicCurves, Span
from vsf_drake.analysis.tuning.recorded_projection import (
    FEET,
    TILT,
    TX,
    BodyPoints,
    SagittalChain,
    body_points,
    make_misfit,
    project,
    sagittal_chain,
)
from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import GRAVITY, PELVIS_ROTATIONS
from vsf_drake.sentences import say
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker

MOST_HZ = 200.0  # faster recordings are thinned to about this rate: a stride's curves hold nothing above 20 Hz
SHORTEST_SHARE, LONGEST_SHARE = 0.4, 0.85  # what a stance can take of a stride


@dataclass(frozen=True, eq=False)
class RecordedStride:
    """A recorded stride in the sagittal plane.

    Times are seconds since phase 0, the prosthetic foot's strike; time t is `start_s` + t in the recording. x is the
    distance along the way of walking from the laboratory's origin, z up.
    """

    names: tuple[str, ...]  # of the 8 coordinates, see `simulation.sagittal.model.sagittal_coordinates`
    period_s: float
    advance_m: float  # travel of pelvis_tx in it
    start_s: float  # time of phase 0 in the recording
    curves: PeriodicCurves  # the motion
    forces: dict[str, FootForce]  # by "prosthetic" and "intact"; a foot without a plate is missing
    prosthetic_stance: Span  # start and end, s; the end may lie beyond the period
    intact_stance: Span | None  # None where unknown
    forward: np.ndarray  # (2,) the way of walking in the laboratory's floor
    chain: SagittalChain  # the sagittal model's geometry
    errors: dict[str, float]  # numbers by name with their unit at the end, see below
    notes: tuple[str, ...]  # what was done and how well it fits, in sentences

    def sample(self, times_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, rates and accelerations, each (n, 8), in m and rad, at any (n,) s since phase 0; a period later
        pelvis_tx has advanced."""
        return self.curves.sample(times_s)

    def measured(self, foot: str, times_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the "prosthetic" or "intact" foot: (n, 3) force along x and z (N) and moment about y at W's origin (N m),
        NaN where no plate measured it; (n,) the centre of pressure's x (m), NaN where the foot is not loaded too."""
        times = np.atleast_1d(np.asarray(times_s, dtype=float))
        if foot not in self.forces:
            return np.full((len(times), 3), np.nan), np.full(len(times), np.nan)
        return self.forces[foot].sample(times)


def recorded_stride(trial: Trial, walker: Walker | None = None, *, period_s: float | None = None,
                    follow_forces: bool | None = None) -> RecordedStride:
    """The periodic stride around a trial's first whole prosthetic stance; strides differ by millimetres of height.

    Args:
        trial: with its fitted contact applied (`motion.fitted_trial.trial_with`), if it has one.
        walker: of the trial's person and model; made if None. Its Context is not changed.
        period_s: instead of the one that the recording tells.
        follow_forces: whether the closed motion's accelerations follow the plates rather than the recorded motion;
            None: where the plates know both feet's forces over the whole stride.

    Raises:
        InputError: the recording holds no whole stride, no strike of the prosthetic foot, or does not travel.
    """
    motion, file, mass = trial.trajectory, trial.path, trial.subject.mass_kg
    names, (rows, points, chain) = sagittal_coordinates(trial.subject.prosthetic_side), _shown(trial, walker)
    time = motion.time_s[rows]
    whole_way = events.heading(points, file=file)
    loaded, moved = events.loaded_stances(trial), events.moved_stances(time, points, chain)
    unknown = events.unknown_spans(trial, loaded, moved)
    plates = {s: trial.plates[side] for s, side in events.sides(trial).items() if side in trial.plates}
    angles = [i for i, name in enumerate(motion.names) if not name.startswith("pelvis")]
    T, method = events.find_period(
        time, motion.sample(time)[0][:, angles],
        [periodic.plate_series(plate, whole_way, unknown[s]) for s, plate in plates.items()], loaded, moved,
        stated_s=period_s, file=file)
    first = events.first_strike(loaded["P"], (trial.start_s, trial.end_s), file=file)
    start = first.start_s
    prosthetic, how_p = events.within_stride([first] if first.complete else loaded["P"], moved["P"], start, T)
    if prosthetic is None or not SHORTEST_SHARE * T <= prosthetic[1] - prosthetic[0] <= LONGEST_SHARE * T:
        raise InputError(f"the prosthetic stance that begins at {start:.3f} s has no end that can be told", file=file,
                         where="forces", right="A stride needs strike and lift-off of the prosthetic foot")
    intact, how_i = events.within_stride(loaded["I"], moved["I"], start, T)
    # the mean way of the pelvis over a stride, in which its sway from side to side has no part
    way = [column.mean() for column in periodic.changes(time, points.pelvis[:, :2], T).T if column.size]
    forward = np.array(way) / np.hypot(*way) if way else whole_way
    wanted, recorded = points.seen(forward), _along(motion, names, points, forward, rows)
    span = periodic.one_stride((time[0], time[-1]), start + np.mean(prosthetic), T)
    weights = periodic.closing_weights(time, *span, T)
    rates = periodic.second_derivative(chain.with_mass(wanted)[0][:, -1], time, cutoff_hz=1.5 * periodic.HARMONICS / T)
    path = periodic.periodic_acceleration(time - start, rates, weights, T)
    inside = (time >= span[0]) & (time <= span[1])
    t, wanted, recorded, weights = time[inside] - start, wanted[inside], recorded[inside], weights[inside]
    misfit = make_misfit(chain, wanted, recorded, ground=points.ground)
    projected, shift, converged = project(misfit)
    advance = periodic.advance_of(t, projected[:, TX], T)

    def forces_with(advance: float) -> dict[str, FootForce]:
        record = motion.start_s, motion.end_s
        return {FEET[s]: periodic.foot_force(plate, forward, record=record, span=span, start_s=start, period_s=T,
                                             advance_m=advance, unknown=unknown[s]) for s, plate in plates.items()}

    forced = periodic.forced_acceleration(forces_with(advance), mass)
    if follow_forces and forced is None:
        raise InputError("the plates do not know both feet's forces over the whole stride", file=file, where="forces",
                         right="Without follow_forces the motion's own accelerations serve")
    wish = path if forced is None or follow_forces is False else forced
    curves = periodic.fit_periodic(t, projected, weights, period_s=T, advance=advance * np.eye(8)[TX])
    curves, shift, closed = periodic.close(misfit, curves, t, weights, wish, shift)
    advance = float(curves.advance[TX])
    forces = forces_with(advance)
    standing = {"prosthetic": events.within(t, prosthetic, T), "intact": events.within(t, intact, T)}
    final, off = curves.sample(t)[0], np.degrees(periodic.changes(time[inside], projected, T))
    turns = [c for c, name in enumerate(names) if name not in ("pelvis_tx", "pelvis_ty")]
    errors = _place_errors(chain, final, wanted, chain.near_floor(wanted, points.ground), weights, standing)
    errors |= {f"angle.{names[c]}_deg": _rms(np.degrees(final[:, c] - recorded[:, c]), weights) for c in turns}
    errors |= {f"closing.{names[c]}_deg": _rms(off[:, c]) for c in turns if len(off)}
    errors |= force_errors(chain, curves, path, forces, mass)
    notes = say("stride", "recorded", period_s=T, by=method, advance_m=advance, prosthetic=how_p, intact=how_i,
                follows_plates=wish is not path, converged=closed and converged, shift=shift, errors=errors,
                **{name: _worst(errors, f"{name}.") for name in ("angle", "closing")})
    return RecordedStride(
        names=names, period_s=T, advance_m=advance, start_s=start, curves=curves, forces=forces,
        prosthetic_stance=prosthetic, intact_stance=intact, forward=forward, chain=chain, errors=errors,
        notes=tuple(notes))


def _shown(trial: Trial, walker: Walker | None) -> tuple[slice, BodyPoints, SagittalChain]:
    """Which instants of the recording are taken, where the 3-D model has its points there, and the sagittal model."""
    walker, motion = walker or Walker(trial.subject, trial.model), trial.trajectory
    if walker.subject.prosthetic_side != trial.subject.prosthetic_side:
        raise InputError(f"the walker's prosthesis is on the {walker.subject.prosthetic_side}, the trial's on the "
                         f"{trial.subject.prosthetic_side}", file=trial.path, where="subject.prosthetic_side")
    rate = (len(motion.time_s) - 1) / (motion.end_s - motion.start_s)
    rows = slice(None, None, max(1, round(rate / MOST_HZ)))
    points = body_points(walker, trial.offsets, motion.names, motion.values[rows], fulcrum_m=trial.fulcrum_m)
    return rows, points, sagittal_chain(walker, trial.offsets, fulcrum_m=trial.fulcrum_m)


def _along(motion: CoordinateTrajectory, names: tuple[str, ...], points: BodyPoints, forward: np.ndarray,
           rows: slice) -> np.ndarray:
    """(n, 8) the sagittal coordinates in the 3-D motion, in a laboratory whose x axis is the way of walking."""
    recorded = motion.ordered(names).values[rows].copy()
    # tilt about -y, then list about x, then rotation about z, each in the axes that the former have turned
    pelvis = motion.ordered(PELVIS_ROTATIONS).values[rows] * [-1.0, 1.0, 1.0]
    turned = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0])) * Rotation.from_euler("YXZ", pelvis)
    recorded[:, TILT], recorded[:, TX] = -turned.as_euler("YXZ")[:, 0], points.pelvis[:, :2] @ forward
    return recorded


# How well a sagittal stride tells what was recorded: numbers by name, the unit at the end of each name.
#
#     place.*       where the final curves put a point against where the 3-D model has it, seen from the side; RMS
#                   over the recorded instants. For a foot, in its stance: the mean over its spheres near the floor,
#                   each by its nearness, while there are any; a constant that the pelvis was moved by is in it
#     angle.*       the final curves less the recorded angles of the 3-D motion, RMS
#     closing.*     the projection at one end of the recording less that at the other, one stride apart, RMS
#     force.*       m (g + a) of the centre of mass, the sagittal model's or the recorded 3-D motion's own, less the
#                   forces of both feet, where both are known, RMS in body weights; balance: the mean of the plates'
#                   forces over the stride in body weights (less 1 upward), and of their moment about the sagittal
#                   model's centre of mass, about y; all are zero for a stride that repeats
#     parts.*       between two recordings of the same instant of a foot's force, RMS


STEP_S = 0.002
ON_FLOOR = 0.5  # spheres' worth of nearness to the floor from which on a foot is said to be on it


def _place_errors(chain: SagittalChain, final: np.ndarray, wanted: np.ndarray, share: np.ndarray, weights: np.ndarray,
                  standing: Mapping[str, np.ndarray]) -> dict[str, float]:
    """`place.*` of final coordinates (n, 8), with weights (n,) of the instants and (n, k) nearness to the floor."""
    off = 1e3 * (chain.points(final)[0] - wanted)
    found: dict[str, float] = {}
    for s, foot in FEET.items():
        rows = chain.rows(f"sphere {s}")
        near = share[:, rows].sum(axis=1)
        mean = (share[:, rows] * off[:, rows]).sum(axis=1) / np.maximum(near, 1e-9)
        found[f"place.{foot}_foot_up_mm"] = _rms(mean.imag, weights * (near > ON_FLOOR) * standing[foot])
    found["place.mass_center_up_mm"] = _rms((off @ chain.mass / chain.mass.sum()).imag, weights)
    return found


def force_errors(chain: SagittalChain, curves: PeriodicCurves, path: PeriodicCurves, forces: Mapping[str, FootForce],
                 mass_kg: float) -> dict[str, float]:
    """`parts.*` and `force.*`; a balance only where both feet's forces are known throughout the stride. The values of
    `path` are the acceleration (., 2) of the recorded motion's own centre of mass, m/s^2."""
    found: dict[str, float] = {}
    for foot, force in forces.items():
        if force.parts_overlap_s > 0.0:
            found[f"parts.{foot}_overlap_s"] = force.parts_overlap_s
            found[f"parts.{foot}_along_n"], found[f"parts.{foot}_up_n"] = force.parts_differ
    if len(forces) < len(FEET):
        return found
    T = curves.period_s
    times = np.linspace(0.0, T, max(8, round(T / STEP_S)) + 1)
    both, center = sum(force.sample(times)[0] for force in forces.values()), chain.mass_center(curves.sample(times)[0])
    inner = (center[2:] - 2.0 * center[1:-1] + center[:-2]) / (times[1] - times[0]) ** 2
    total = both[:, :2] / (mass_kg * GRAVITY)
    known = np.isfinite(total).all(axis=1)
    for of, acceleration in (("sagittal", np.concatenate([inner[:1], inner, inner[-1:]])),
                             ("recorded", path.sample(times)[0] @ [1.0, 1j])):
        needed = acceleration[known] / GRAVITY + 1j
        if known.any():
            found[f"force.{of}_along_bw"] = _rms(needed.real - total[known, 0])
            found[f"force.{of}_up_bw"] = _rms(needed.imag - total[known, 1])
    if known.all():
        along, up = np.trapezoid(total, times, axis=0) / T
        found["force.balance_along_bw"], found["force.balance_up_bw"] = float(along), float(up) - 1.0
    about_center = both[:, 2] - (center.imag * both[:, 0] - center.real * both[:, 1])
    if np.isfinite(about_center).all():
        found["force.balance_moment_nm"] = float(np.trapezoid(about_center, times) / T)
    return found


def _worst(errors: Mapping[str, float], start: str) -> tuple[str, float] | None:
    """The angle whose error, of those whose name begins so, is largest, and that, deg."""
    found = {name: value for name, value in errors.items() if name.startswith(start)}
    name = max(found, key=found.__getitem__, default=None)
    return None if name is None else (name.removeprefix(start).removesuffix("_deg"), found[name])


def _rms(values: np.ndarray, weights: np.ndarray | None = None) -> float:
    if weights is not None and not weights.sum() > 0.0:
        return float("nan")
    return float(np.sqrt(np.average(np.square(values), weights=weights)))
