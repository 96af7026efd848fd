"""One periodic stride of a recorded trial, seen from the side: what a trajectory optimisation
starts from and tracks.

The recording drives the 3-D model (fitted offsets and coordinates applied, keel and socket
undeformed); the sagittal model is laid on it instant by instant (`recorded_projection`), the stride
is closed, and the plates' forces with it (`recorded_curves`). Phase 0 is the strike of the
prosthetic foot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY, PELVIS_ROTATIONS
from vsf_drake.motion.contacts import TOLERANCE_S, WIDEN_S
from vsf_drake.motion.events import Stance, find_stances, kinematic_stances, walking_direction
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial
from vsf_drake.optimal_control import recorded_curves as periodic
from vsf_drake.optimal_control import recorded_projection as sagittal
from vsf_drake.optimal_control.recorded_curves import FootForce, PeriodicCurves, Span
from vsf_drake.optimal_control.recorded_projection import FEET, TILT, TX, BodyPoints, SagittalChain
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker

# faster recordings are thinned to about this rate: a stride's curves hold nothing above 20 Hz
MOST_HZ = 200.0
# what a stance can take of a stride
SHORTEST_SHARE = 0.4
LONGEST_SHARE = 0.85


@dataclass(frozen=True, eq=False)
class RecordedStride:
    """A recorded stride in the sagittal plane; time t, from the prosthetic strike on, is
    `start_s` + t in the recording, x the distance along the way of walking from the laboratory's
    origin, z up."""

    names: tuple[str, ...]
    """of the 8 coordinates, see `simulation.sagittal.model.sagittal_coordinates`"""
    period_s: float
    advance_m: float  # travel of pelvis_tx in it
    start_s: float  # time of phase 0 in the recording
    curves: PeriodicCurves  # the motion
    forces: dict[str, FootForce]  # by "prosthetic" and "intact"; a foot without a plate is missing
    prosthetic_stance: Span  # start and end, s; the end may lie beyond the period
    intact_stance: Span | None  # None where unknown
    forward: np.ndarray  # (2,) the way of walking in the laboratory's floor
    chain: SagittalChain  # the sagittal model's geometry
    errors: dict[str, float]  # see `_errors`
    notes: tuple[str, ...]  # what was done and how well it fits, in sentences

    def sample(self, times_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, rates and accelerations, each (n, 8), at any (n,) s."""
        return self.curves.sample(np.asarray(times_s))

    def measured(self, foot: str, times_s: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the "prosthetic" or "intact" foot: (n, 3) force along x and z (N) and moment about y
        at W's origin (N m), NaN where no plate measured it; (n,) the centre of pressure's x (m),
        NaN where the foot is not loaded too."""
        times = np.atleast_1d(np.asarray(times_s, dtype=float))
        if foot not in self.forces:
            return np.full((len(times), 3), np.nan), np.full(len(times), np.nan)
        return self.forces[foot].sample(times)


def recorded_stride(trial: Trial, walker: Walker | None = None) -> RecordedStride:
    """The periodic stride around a trial's first whole prosthetic stance; strides differ by
    millimetres of height.

    The closed motion's accelerations follow the plates where these know both feet's forces over the
    whole stride, else the recorded motion. InputError: the recording holds no whole stride, no
    strike of the prosthetic foot, or does not travel; the foot is turned out too far.

    Args:
        trial: with its fitted contact applied (`motion.fitted_trial.trial_with`), if it has one.
        walker: of the trial's person and model; made if None. Its Context is not changed.
    """
    motion = trial.trajectory
    file = trial.path
    require(
        trial.plate is not None,
        "no force was measured, and the recorded stride begins where the plate tells a strike",
        "forces",
        "Tune at --level 1, or name the file of the forces",
        file=file,
    )
    mass = trial.subject.mass_kg
    names, (rows, points, chain) = (
        sagittal_coordinates(trial.subject.prosthetic_side),
        _shown(trial, walker),
    )
    time = motion.time_s[rows]

    # When: the period, the strike that is phase 0, and both feet's stances.
    whole_way = _heading(points, file=file)
    loaded = _loaded_stances(trial)
    moved = _moved_stances(time, points, chain)
    unknown = _unknown_spans(trial, loaded, moved)
    plates = {s: trial.plates[side] for s, side in _sides(trial).items() if side in trial.plates}
    angles = [i for i, name in enumerate(motion.names) if not name.startswith("pelvis")]
    T, method = find_period(
        time,
        motion.sample(time)[0][:, angles],
        [periodic.plate_series(plate, whole_way, unknown[s]) for s, plate in plates.items()],
        loaded,
        moved,
        file=file,
    )
    first = _first_strike(loaded["P"], (trial.start_s, trial.end_s), file=file)
    start = first.start_s
    prosthetic, how_p = _within_stride(
        [first] if first.complete else loaded["P"], moved["P"], start, T
    )
    if (
        prosthetic is None
        or not SHORTEST_SHARE * T <= prosthetic[1] - prosthetic[0] <= LONGEST_SHARE * T
    ):
        raise InputError(
            f"the prosthetic stance that begins at {start:.3f} s has no end that can be told",
            file=file,
            where="forces",
            right="A stride needs strike and lift-off of the prosthetic foot",
        )
    intact, how_i = _within_stride(loaded["I"], moved["I"], start, T)

    # What is seen from the side, along the mean way of the pelvis over a stride, in which its sway
    # has no part.
    way = [
        column.mean() for column in periodic.changes(time, points.pelvis[:, :2], T).T if column.size
    ]
    forward = np.array(way) / np.hypot(*way) if way else whole_way
    wanted = points.seen(forward)
    recorded = _along(motion, names, points, forward, rows)
    span = periodic.one_stride((time[0], time[-1]), start + 0.5 * sum(prosthetic), T)
    weights = periodic.closing_weights(time, *span, T)
    rates = periodic.second_derivative(
        chain.with_mass(wanted)[:, -1], time, cutoff_hz=1.5 * periodic.HARMONICS / T
    )
    path = periodic.periodic_acceleration(time - start, rates, weights, T)

    # The sagittal model laid on the 3-D one, instant by instant, then closed; its accelerations
    # follow the plates where these know both feet's forces throughout.
    inside = (time >= span[0]) & (time <= span[1])
    t = time[inside] - start
    wanted = wanted[inside]
    recorded = recorded[inside]
    weights = weights[inside]
    misfit = sagittal.make_misfit(chain, wanted, recorded, ground=points.ground)
    projected, shift, converged = sagittal.project(misfit)
    advance = periodic.advance_of(t, projected[:, TX], T)

    def forces_with(advance: float) -> dict[str, FootForce]:
        record = motion.start_s, motion.end_s
        return {
            FEET[s]: periodic.foot_force(
                plate,
                forward,
                record=record,
                span=span,
                start_s=start,
                period_s=T,
                advance_m=advance,
                unknown=unknown[s],
            )
            for s, plate in plates.items()
        }

    forced = periodic.forced_acceleration(forces_with(advance), mass)
    target = path if forced is None else forced
    curves = periodic.fit_periodic(
        t, projected, weights, period_s=T, advance=advance * np.eye(8)[TX]
    )
    curves, shift, closed = periodic.close(misfit, curves, t, weights, target, shift)
    advance = float(curves.advance[TX])
    forces = forces_with(advance)

    # How well that went, in numbers and in words.
    final = curves.sample(t)[0]
    turned = {
        name: _rms(np.degrees(final[:, c] - recorded[:, c]), weights)
        for c, name in enumerate(names)
        if name not in ("pelvis_tx", "pelvis_ty")
    }
    worst = max(turned, key=lambda name: turned[name])
    # one end of the recording less the other
    off = np.degrees(periodic.changes(time[inside], projected, T))
    apart = {name: _rms(off[:, c]) for c, name in enumerate(names) if name in turned and len(off)}
    closing = max(apart.items(), key=lambda each: each[1], default=None)
    spans = {"prosthetic": prosthetic, "intact": intact or (0.0, T)}
    standing = {foot: ~np.isnan(share_of(own, t, T)) for foot, own in spans.items()}
    errors = _errors(
        chain, final, wanted, chain.near_floor(wanted, points.ground), weights, standing
    )
    errors |= {
        "angle_deg": turned[worst],
        "toe_out_deg": _toe_out(trial, points, chain, forward),
        **_force_errors(chain, curves, forces, mass),
    }
    notes = say(
        "stride",
        "recorded",
        period_s=T,
        by=method,
        advance_m=advance,
        prosthetic=how_p,
        intact=how_i,
        follows_plates=target is not path,
        converged=closed and converged,
        shift=shift,
        errors=errors,
        worst=worst,
        closing=closing,
    )
    return RecordedStride(
        names=names,
        period_s=T,
        advance_m=advance,
        start_s=start,
        curves=curves,
        forces=forces,
        prosthetic_stance=prosthetic,
        intact_stance=intact,
        forward=forward,
        chain=chain,
        errors=errors,
        notes=tuple(notes),
    )


def _shown(trial: Trial, walker: Walker | None) -> tuple[slice, BodyPoints, SagittalChain]:
    walker = walker or Walker(trial.subject, trial.model)
    motion = trial.trajectory
    require(
        walker.subject.prosthetic_side == trial.subject.prosthetic_side,
        f"the walker's prosthesis is on the {walker.subject.prosthetic_side}, the trial's on "
        f"the {trial.subject.prosthetic_side}",
        "subject.prosthetic_side",
        file=trial.path,
    )
    rate = (len(motion.time_s) - 1) / (motion.end_s - motion.start_s)
    rows = slice(None, None, max(1, round(rate / MOST_HZ)))
    points = sagittal.body_points(
        walker, trial.offsets, motion.names, motion.values[rows], fulcrum_m=trial.fulcrum_m
    )
    flat = sagittal.straightened(trial)
    straight = walker if flat.subject == trial.subject else Walker(flat.subject, trial.model)
    return rows, points, sagittal.sagittal_chain(straight, flat.offsets, fulcrum_m=trial.fulcrum_m)


MOST_TURNED_DEG = 15.0
"""A keel that is turned by so much shows 7 % less of its stiffness along the way of walking, the
square of the angle's cosine (a choice)."""


def _toe_out(trial: Trial, points: BodyPoints, chain: SagittalChain, forward: np.ndarray) -> float:
    """Degrees, from above, by which the prosthetic foot's spheres, where they are near the floor,
    are turned away from the midline against where the chain, which knows no toe-out, has them.
    InputError where that is more than MOST_TURNED_DEG."""
    rows = chain.rows("sphere P")
    near = chain.near_floor(points.seen(forward), points.ground)[:, rows].sum(axis=1)
    foot = chain.local[rows].real + 1j * chain.aside[rows]
    seen = points.places[:, rows] @ [1.0, 1j, 0.0] / complex(*forward)
    to_the_left = np.angle(near @ (seen @ (foot - foot.mean()).conj()))
    side = 1.0 if trial.subject.prosthetic_side == "left" else -1.0
    toe_out = float(np.degrees(side * to_the_left))
    require(
        abs(toe_out) <= MOST_TURNED_DEG,
        f"the prosthetic foot is turned out of the way of walking by {toe_out:.0f}°",
        "kinematics",
        f"From the side no more than {MOST_TURNED_DEG:g}° can be left out. Tune at --level 1",
        file=trial.path,
    )
    return toe_out


def _along(
    motion: CoordinateTrajectory,
    names: tuple[str, ...],
    points: BodyPoints,
    forward: np.ndarray,
    rows: slice,
) -> np.ndarray:
    """(n, 8) the sagittal coordinates in the 3-D motion, in a laboratory whose x axis is the way of
    walking."""
    recorded = motion.ordered(names).values[rows].copy()
    # tilt about -y, then list about x, then rotation about z, each in the axes that the former have
    # turned
    pelvis = motion.ordered(PELVIS_ROTATIONS).values[rows] * [-1.0, 1.0, 1.0]
    turned = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0])) * Rotation.from_euler(
        "YXZ", pelvis
    )
    recorded[:, TILT], recorded[:, TX] = (
        -turned.as_euler("YXZ")[:, 0],
        points.pelvis[:, :2] @ forward,
    )
    return recorded


STEP_S = 0.002
ON_FLOOR = 0.5  # spheres' worth of nearness to the floor from which on a foot is said to be on it


def _errors(
    chain: SagittalChain,
    final: np.ndarray,
    wanted: np.ndarray,
    share: np.ndarray,
    weights: np.ndarray,
    standing: Mapping[str, np.ndarray],
) -> dict[str, float]:
    """Height of the feet, each in its stance, and of the centre of mass at final coordinates (n, 8)
    against those wanted (n, k), RMS with weights (n,); a foot's is the mean of its spheres by their
    nearness (n, k) to the floor. Of the prosthetic foot too how far its spheres are off along the
    way, and in height one against another."""
    apart = 1e3 * (chain.points(final) - wanted)
    off = apart.imag
    errors: dict[str, float] = {}
    for s, foot in FEET.items():
        rows = chain.rows(f"sphere {s}")
        near = share[:, rows].sum(axis=1)
        mean = (share[:, rows] * off[:, rows]).sum(axis=1) / np.maximum(near, 1e-9)
        stands = weights * (near > ON_FLOOR) * standing[foot]
        errors[f"{foot}_foot_up_mm"] = _rms(mean, stands)
        if s == "P":
            each = share[:, rows] * stands[:, None]
            errors["sole_tilt_mm"] = _rms(off[:, rows] - mean[:, None], each)
            errors["prosthetic_foot_along_mm"] = _rms(apart[:, rows].real, each)
    errors["mass_center_up_mm"] = _rms(off @ chain.mass / chain.mass.sum(), weights)
    return errors


def _force_errors(
    chain: SagittalChain, curves: PeriodicCurves, forces: Mapping[str, FootForce], mass_kg: float
) -> dict[str, float]:
    """m (g + a) of the sagittal centre of mass less both feet's forces, in body weights, RMS where
    both are known."""
    T = curves.period_s
    times = np.linspace(0.0, T, max(8, round(T / STEP_S)) + 1)
    center = chain.mass_center(curves.sample(times)[0])
    inner = (center[2:] - 2.0 * center[1:-1] + center[:-2]) / (times[1] - times[0]) ** 2
    needed = np.concatenate([inner[:1], inner, inner[-1:]]) / GRAVITY + 1j
    both = np.sum([force.sample(times)[0] for force in forces.values()], axis=0) / (
        mass_kg * GRAVITY
    )
    if len(forces) < len(FEET) or not (known := np.isfinite(both[:, :2]).all(axis=1)).any():
        return {}
    return {
        "force_along_bw": _rms((needed.real - both[:, 0])[known]),
        "force_up_bw": _rms((needed.imag - both[:, 1])[known]),
    }


def _rms(values: np.ndarray, weights: np.ndarray | None = None) -> float:
    if weights is not None and not weights.sum() > 0.0:
        return float("nan")
    return float(np.sqrt(np.average(np.square(values), weights=weights)))


# a pelvis that gets no farther than this over the recording does not walk over the ground
LEAST_WAY_M = 0.3


def _sides(trial: Trial) -> dict[str, str]:
    own = trial.subject.prosthetic_side
    return {"P": own, "I": "left" if own == "right" else "right"}


def _loaded_stances(trial: Trial) -> dict[str, list[Stance]]:
    """What the plates saw within the motion; a stance that this cuts is marked so."""
    stances: dict[str, list[Stance]] = {}
    first = trial.trajectory.start_s
    last = trial.trajectory.end_s
    for s, side in _sides(trial).items():
        plate = trial.plates.get(side)
        own = [] if plate is None else find_stances(plate.time_s, plate.force_W[:, 2])
        missed = trial.unmeasured.get(side, ())
        stances[s] = [
            Stance(
                max(x.start_s, first),
                min(x.end_s, last),
                x.start_seen and x.start_s >= first,
                x.end_seen and x.end_s <= last,
            )
            for x in own
            if x.end_s > first
            and x.start_s < last
            and not any(a < 0.5 * (x.start_s + x.end_s) < b for a, b in missed)
        ]
    return stances


def _moved_stances(
    time_s: np.ndarray, points: BodyPoints, chain: SagittalChain
) -> dict[str, list[Stance]]:
    feet = {}
    for s in FEET:
        rows = chain.rows(f"sphere {s}")
        x = chain.local[rows].real
        bottom = points.places[:, rows] - np.outer(points.radius[rows], (0.0, 0.0, 1.0))
        feet[s] = FootTrack(
            heel_W=bottom[:, x <= x.min() + 1e-6].mean(axis=1),
            toe_W=bottom[:, x >= x.max() - 1e-6].mean(axis=1),
            ankle_W=points.of(f"ankle {s}")[:, 0],
        )
    forward = walking_direction(feet, points.pelvis)
    return {
        s: kinematic_stances(time_s, foot, points.pelvis, forward_W=forward)
        for s, foot in feet.items()
    }


def _unknown_spans(
    trial: Trial, loaded: Mapping[str, Sequence[Stance]], moved: Mapping[str, Sequence[Stance]]
) -> dict[str, tuple[Span, ...]]:
    """When the foot stands on no plate: as the trial states, or a stance in the motion shows for
    more than 0.12 s."""
    unknown: dict[str, tuple[Span, ...]] = {}
    for s, side in _sides(trial).items():
        plate = trial.plates.get(side)
        spans = list(trial.unmeasured.get(side, ()))
        for stance in () if spans or plate is None else moved[s]:
            assert plate is not None
            start = max(stance.start_s, plate.time_s[0])
            end = min(stance.end_s, plate.time_s[-1])
            own = [
                (x.start_s, x.end_s) for x in loaded[s] if min(x.end_s, end) > max(x.start_s, start)
            ]
            if own:  # where the motion shows no strike or no lift-off, the plate's counts
                start = start if stance.start_seen else max(start, min(a for a, _ in own))
                end = end if stance.end_seen else min(end, max(b for _, b in own))
            edges = [start, *(edge for span in sorted(own) for edge in span), end]
            gap = max((b - a for a, b in zip(edges[::2], edges[1::2], strict=True)), default=0.0)
            if gap > min(TOLERANCE_S, 0.5 * (end - start)) and end > start:
                spans.append(
                    (
                        min([start, *(a for a, _ in own)]) - WIDEN_S,
                        max([end, *(b for _, b in own)]) + WIDEN_S,
                    )
                )
        unknown[s] = tuple(spans)
    return unknown


def _heading(points: BodyPoints, *, file: Path | None = None) -> np.ndarray:
    """(2,) unit vector in the floor along which the pelvis travels."""
    way = (points.pelvis[-1] - points.pelvis[0])[:2]
    length = float(np.linalg.norm(way))
    require(
        length >= LEAST_WAY_M,
        f"the pelvis gets only {length:.2f} m ahead",
        "kinematics",
        "On a treadmill, give the manifest its belt_speed_m_per_s",
        file=file,
    )
    return np.asarray(way / length)


def _within_stride(
    stances: Sequence[Stance], moved: Sequence[Stance], start_s: float, period_s: float
) -> tuple[Span | None, str]:
    """A foot's stance within the stride, and how it was found: whole, or pieced together, on the
    plates or in the motion."""
    for source, where in ((stances, "the plates"), (moved, "the motion of the foot")):
        whole = [x for x in source if x.complete]
        if whole:
            best = min(
                whole, key=lambda x: abs(0.5 * (x.start_s + x.end_s) - start_s - 0.5 * period_s)
            )
            start = (best.start_s - start_s) % period_s
            return (
                start,
                start + best.duration_s,
            ), f"whole on {where}" if source is stances else f"whole in {where}"
        strikes = [x.start_s for x in source if x.start_seen]
        lifts = [x.end_s for x in source if x.end_seen]
        if strikes and lifts:
            start = (strikes[0] - start_s) % period_s
            length = (lifts[-1] - strikes[0]) % period_s
            return (start, start + length), f"pieced together from two parts in {where}"
    return None, "not seen"


def share_of(span: Span, times: np.ndarray, period_s: float) -> np.ndarray:
    """(n,) share of the way from a span's start to its end at times modulo the period, NaN outside
    of it."""
    share = np.mod(times - span[0], period_s) / (span[1] - span[0])
    return np.where(share <= 1.0, share, np.nan)


def _first_strike(stances: Sequence[Stance], window: Span, *, file: Path | None) -> Stance:
    """The first whole prosthetic stance in the window, or one whose strike is seen."""
    inside = [x for x in stances if window[0] - 1e-9 <= x.start_s <= window[1]]
    whole = [x for x in inside if x.complete and x.end_s <= window[1] + 1e-9]
    struck = [x for x in inside if x.start_seen]
    if whole or struck:
        return (whole or struck)[0]
    seen = ", ".join(f"{x.start_s:.3f} to {x.end_s:.3f} s" for x in stances) or "none"
    raise InputError(
        f"the plate shows no strike of the prosthetic foot from {window[0]:.3f} to "
        f"{window[1]:.3f} s",
        file=file,
        where="forces",
        right=f"Its stances are: {seen}",
    )


LEAST_SHARE, MOST_SHARE = 0.5, 0.75
"""Stance may take this share of a stride: walking, from fast to slow (choices; 0.62 is usual)."""
STRIDES_S = (0.7, 2.2)  # where no stance is known
# the recording must outlast the stride by this for its two ends to be compared
LEAST_OVERLAP_S = 0.1
NEAR_EVENTS_S = 0.06  # kinematic events are wrong by up to 0.035 s each (see `motion.contacts`)
GRID_S = 0.005
SAMPLES = 200
LARGEST_CLOSING = np.radians(8.0)
"""Ends of a stride that differ by more than this are not the same instant of two strides (a
choice)."""


def find_period(
    time_s: np.ndarray,
    motion: np.ndarray,
    forces: Sequence[tuple[np.ndarray, np.ndarray]],
    loaded: Mapping[str, Sequence[Stance]],
    moved: Mapping[str, Sequence[Stance]],
    *,
    file: Path | None = None,
) -> tuple[float, str]:
    """The stride of a recording in seconds, and in words by what.

    Two strikes or two lift-offs of one foot on the plates tell it; else two of them in the motion,
    sharpened by the self-similarity nearby; else the self-similarity alone: the time by which the
    recording is shifted against itself with the least squares of the differences of all angles, of
    their rates and of the forces, each over its own spread. InputError where the recording holds no
    whole stride, or does not repeat itself.
    """
    alike = _Alike(time_s, motion, forces)

    def period(seconds: float, method: str) -> tuple[float, str]:
        closing = alike.closing(seconds)
        require(
            not closing > LARGEST_CLOSING,  # it may be unknown
            f"its two ends, {seconds:.3f} s apart ({method}), differ by "
            f"{np.degrees(closing):.1f}° RMS",
            "kinematics",
            "A periodic stride needs steady walking",
            file=file,
        )
        return seconds, method

    record = float(time_s[-1] - time_s[0])
    lengths = [
        s.duration_s
        for stances in (*loaded.values(), *moved.values())
        for s in stances
        if s.complete
    ]
    low, high = STRIDES_S
    if lengths:
        low = np.median(lengths) / MOST_SHARE
        high = np.median(lengths) / LEAST_SHARE
    require(
        record >= low,
        f"the motion lasts {record:.2f} s, a stride at least {low:.2f} s",
        "kinematics",
        "A periodic stride needs a whole one: record longer",
        file=file,
    )
    for stances, where in ((loaded, "the plates"), (moved, "the motion of the foot")):
        for foot, what, seconds, count in _intervals(stances, low, high):
            method = f"{count + 1} {what} of the {FEET[foot]} foot in {where}"
            bracket = (
                seconds - NEAR_EVENTS_S,
                min(seconds + NEAR_EVENTS_S, record - LEAST_OVERLAP_S),
            )
            if stances is moved and bracket[1] - bracket[0] > NEAR_EVENTS_S:
                return period(alike.best(*bracket)[0], f"{method}, sharpened by self-similarity")
            return period(seconds, method)
    high = min(high, record - LEAST_OVERLAP_S)
    require(
        low < high,
        f"the motion lasts {record:.2f} s and shows no two strikes of one foot; a stride "
        f"takes at least {low:.2f} s",
        "kinematics",
        "Record longer",
        file=file,
    )
    seconds, inside = alike.best(low, high)
    require(
        inside,
        f"the motion does not repeat itself between {low:.2f} and {high:.2f} s",
        "kinematics",
        "A periodic stride needs steady walking over more than a stride",
        file=file,
    )
    return period(seconds, "self-similarity of the motion and the forces")


def _intervals(
    stances: Mapping[str, Sequence[Stance]], low: float, high: float
) -> Iterator[tuple[str, str, float, int]]:
    """Wherever one event of a foot was seen more than once."""
    for what, attribute, seen in (
        ("strikes", "start_s", "start_seen"),
        ("lift-offs", "end_s", "end_seen"),
    ):
        for foot, own in stances.items():
            instants = [getattr(stance, attribute) for stance in own if getattr(stance, seen)]
            steps = [b - a for a, b in pairwise(instants) if low <= b - a <= high]
            if steps:
                yield foot, what, float(np.mean(steps)), len(steps)


class _Alike:
    """A recording beside itself, shifted in time."""

    def __init__(
        self,
        time_s: np.ndarray,
        motion: np.ndarray,
        forces: Sequence[tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self.start = float(time_s[0])
        self.end = float(time_s[-1])
        grid = np.arange(self.start, self.end, GRID_S)
        self.angles = CubicSpline(time_s, motion)
        self.parts = [
            (part, float(np.sqrt(np.sum(self.angles(grid, order).std(axis=0) ** 2))))
            for order, part in enumerate((self.angles, self.angles.derivative()))
        ]
        for force_time_s, force in forces:
            known = np.isfinite(force).all(axis=1)
            if (
                known.any()
                and (spread := float(np.sqrt(np.sum(force[known].std(axis=0) ** 2)))) > 0.0
            ):
                self.parts.append((_linear(force_time_s, force), spread))

    def _times(self, seconds: float) -> np.ndarray:
        # As many for every shift: a number that changes with it would put steps into the cost.
        return np.linspace(self.start, self.end - seconds, SAMPLES)

    def cost(self, seconds: float) -> float:
        times = self._times(seconds)
        total = 0.0
        for part, spread in self.parts:
            difference = part(times + seconds) - part(times)
            known = np.isfinite(difference).all(axis=1)
            if known.any():
                total += float(np.mean(np.sum(difference[known] ** 2, axis=1))) / spread**2
        return total

    def best(self, low: float, high: float) -> tuple[float, bool]:
        """The shift with the least cost, and whether it lies inside the bracket."""
        shifts = np.arange(low, high, GRID_S)
        costs = [self.cost(shift) for shift in shifts]
        at = int(np.argmin(costs))
        near = (max(low, shifts[at] - 2 * GRID_S), min(high, shifts[at] + 2 * GRID_S))
        least = minimize_scalar(self.cost, bounds=near, method="bounded", options={"xatol": 1e-5})
        return float(least.x), 0 < at < len(shifts) - 1

    def closing(self, seconds: float) -> float:
        """RMS difference of the angles; NaN without an overlap."""
        if self.end - self.start <= seconds:
            return float("nan")
        times = self._times(seconds)
        return float(np.sqrt(np.mean((self.angles(times + seconds) - self.angles(times)) ** 2)))


def _linear(time_s: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda times: np.column_stack(
        [np.interp(times, time_s, column, left=np.nan, right=np.nan) for column in values.T]
    )
