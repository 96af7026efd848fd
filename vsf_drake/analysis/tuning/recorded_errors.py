"""How well a sagittal stride tells what was recorded: numbers by name, the unit at the end of each name.

    place.*       where the final curves put a point against where the 3-D model has it, seen from the side; RMS
                  over the recorded instants; "up" and "along" the way. For a foot, in its stance: the mean over its
                  spheres near the floor, each by its nearness, while there are any; hips: from their mid; a constant
                  that the pelvis was moved by is in it; "slip": how fast a foot moves along against the 3-D model's
    angle.*       the final curves less the recorded angles of the 3-D motion, RMS
    smoothing.*   the final curves less the projection of every recorded instant, RMS
    closing.*     the projection at one end of the recording less that at the other, one stride apart, RMS
    force.*       m (g + a) of the centre of mass, the sagittal model's or the recorded 3-D motion's own, less the
                  forces of both feet, where both are known, RMS in body weights; balance: the mean of the plates'
                  forces over the stride in body weights (less 1 upward), and of their moment about the sagittal
                  model's centre of mass, about y; all are zero for a stride that repeats
    parts.*       between two recordings of the same instant of a foot's force, RMS
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsf_drake.analysis.tuning.recorded_curves import BodyPoints, Curves, FootForce, body_points
from vsf_drake.analysis.tuning.recorded_events import heading
from vsf_drake.analysis.tuning.recorded_projection import (
    TILT,
    TX,
    Misfit,
    Nearness,
    SagittalChain,
    make_misfit,
    near_floor,
    sagittal_chain,
    targets,
)
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker
from vsf_drake.subject import PELVIS_ROTATIONS

STEP_S = 0.002
ON_FLOOR = 0.5
"""Spheres' worth of nearness to the floor from which on a foot is said to be on it."""
_LENGTHS = ("pelvis_tx", "pelvis_ty")
FEET = (("P", "prosthetic"), ("I", "intact"))


def place_errors(seen: View, projected: np.ndarray, final: np.ndarray, weights: np.ndarray,
                 standing: Mapping[str, np.ndarray]) -> dict[str, float]:
    """`place.*`, `angle.*` and `smoothing.*`.

    Args:
        projected, final: (n, 8) coordinates. weights: (n,) of the instants.
        standing: by foot, (n,) whether it stands; a foot that is missing always counts.
    """
    chain, wanted = seen.chain, seen.wanted
    off = 1e3 * (chain.points(final)[0] - wanted)
    share = near_floor(chain, wanted, seen.ground, Nearness())
    found: dict[str, float] = {}
    for s, foot in FEET:
        rows = chain.rows(f"sphere {s}")
        near = share[:, rows].sum(axis=1)
        mean = (share[:, rows] * off[:, rows]).sum(axis=1) / np.maximum(near, 1e-9)
        on = weights * (near > ON_FLOOR) * standing.get(foot, True)
        found[f"place.{foot}_foot_up_mm"] = _rms(mean.imag, on)
        surely = (near > 1.0) & (on > 0.25)
        found[f"place.{foot}_foot_up_largest_mm"] = float(np.abs(mean.imag[surely]).max(initial=0.0))
        found[f"place.{foot}_foot_along_mm"] = _rms(mean.real, on)
        found[f"place.{foot}_foot_slip_mm_per_s"] = _rms(np.gradient(mean.real, seen.time_s), on)
        for joint in ("knee", "ankle"):
            d = off[:, chain.rows(f"{joint} {s}")][:, 0]
            found[f"place.{foot}_{joint}_up_mm"], found[f"place.{foot}_{joint}_along_mm"] = (
                _rms(d.imag, weights), _rms(d.real, weights))
    hips = off[:, np.concatenate([chain.rows("hip P"), chain.rows("hip I")])].mean(axis=1)
    mass = off @ chain.mass / chain.mass.sum()
    for name, d in (("hip", hips), ("mass_center", mass)):
        found[f"place.{name}_up_mm"], found[f"place.{name}_along_mm"] = _rms(d.imag, weights), _rms(d.real, weights)
    for c, name in enumerate(seen.names):
        if name not in _LENGTHS:
            found[f"angle.{name}_deg"] = _rms(np.degrees(final[:, c] - seen.recorded[:, c]), weights)
        found[f"smoothing.{_unit(name)}"] = _rms(_scaled(name, final[:, c] - projected[:, c]), weights)
    return found


def closing_errors(seen: View, projected: np.ndarray, advance: np.ndarray, period_s: float) -> dict[str, float]:
    """`closing.*`: nothing if the recording is no longer than a stride. advance: (8,) per stride."""
    time = seen.time_s
    early = time[time + period_s <= time[-1]]
    found = {}
    for c, name in enumerate(seen.names) if early.size else ():
        later = np.interp(early + period_s, time, projected[:, c])
        found[f"closing.{_unit(name)}"] = _rms(_scaled(name, later - advance[c] - projected[: len(early), c]))
    return found


def center_rate(chain: SagittalChain, curves: Curves, times: np.ndarray) -> np.ndarray:
    """(n,) complex, m/s^2: the acceleration of the sagittal model's centre of mass at even times, inner differences."""
    h = times[1] - times[0]
    center = chain.mass_center(curves.sample(times)[0])
    inner = (center[2:] - 2.0 * center[1:-1] + center[:-2]) / h**2
    return np.concatenate([inner[:1], inner, inner[-1:]])


def moment_balance(chain: SagittalChain, curves: Curves, forces: Mapping[str, FootForce],
                   period_s: float) -> dict[str, float]:
    """`force.balance_moment_nm`, if both feet's forces and centres of pressure are known throughout a stride."""
    times = np.linspace(0.0, period_s, max(8, round(period_s / STEP_S)) + 1)
    if len(forces) < len(FEET):
        return {}
    along, up, about_origin = sum(force.sample(times)[0] for force in forces.values()).T
    center = chain.mass_center(curves.sample(times)[0])
    about_center = about_origin - (center.imag * along - center.real * up)
    if not np.isfinite(about_center).all():
        return {}
    return {"force.balance_moment_nm": float(np.trapezoid(about_center, times) / period_s)}


def force_errors(acceleration: Callable[[np.ndarray], np.ndarray], forces: Mapping[str, FootForce], mass_kg: float,
                 period_s: float, *, of: str = "sagittal", periodic: bool = True) -> dict[str, float]:
    """`force.*` and `parts.*`; a balance only where both feet's forces are known throughout a periodic stride.

    Args:
        acceleration: complex (n,) m/s^2 of the centre of mass at even times (n,) s. of: whose it is.
    """
    found: dict[str, float] = {}
    for foot, force in forces.items():
        if force.parts_overlap_s > 0.0:
            found[f"parts.{foot}_overlap_s"] = force.parts_overlap_s
            found[f"parts.{foot}_along_n"], found[f"parts.{foot}_up_n"] = force.parts_differ
    if len(forces) < len(FEET):
        return found
    times = np.linspace(0.0, period_s, max(8, round(period_s / STEP_S)) + 1)
    total = sum(force.sample(times)[0][:, :2] for force in forces.values()) / (mass_kg * GRAVITY)
    needed = acceleration(times) / GRAVITY + 1j
    known = np.isfinite(total).all(axis=1)
    if known.any():
        found[f"force.{of}_along_bw"] = _rms(needed.real[known] - total[known, 0])
        found[f"force.{of}_up_bw"] = _rms(needed.imag[known] - total[known, 1])
        found["force.known_share"] = float(known.mean())
    if known.all() and periodic:
        along, up = np.trapezoid(total, times, axis=0) / period_s
        found["force.balance_along_bw"], found["force.balance_up_bw"] = float(along), float(up) - 1.0
    return found


def sentences(errors: Mapping[str, float], shift: complex, *, converged: bool) -> tuple[str, ...]:
    """What a reader should know of `errors`; shift: the constant by which the pelvis was moved, m."""
    notes = []
    if not converged:
        notes.append("The sagittal motion DID NOT CONVERGE: it is near the nearest one, not at it.")
    notes.append("Seen from the side, the soles near the floor lie within "
                 f"{errors['place.prosthetic_foot_up_mm']:.2f} mm (prosthetic) and "
                 f"{errors['place.intact_foot_up_mm']:.2f} mm (intact, both RMS in height) of the 3-D model's, the "
                 f"centre of mass within {errors['place.mass_center_up_mm']:.2f} mm; the pelvis was moved by "
                 f"{1e3 * shift.real:+.1f} mm along the way and {1e3 * shift.imag:+.1f} mm up.")
    angles = {name: value for name, value in errors.items() if name.startswith("angle.")}
    worst = max(angles, key=angles.__getitem__)
    notes.append(f"For that the joint angles differ from the recorded ones by up to {angles[worst]:.1f}° RMS "
                 f"({worst.removeprefix('angle.').removesuffix('_deg')}).")
    closing = {name: value for name, value in errors.items() if name.startswith("closing.") and name.endswith("_deg")}
    if closing:
        worst = max(closing, key=closing.__getitem__)
        notes.append(f"Both ends of the recording, a stride apart, differ by up to {closing[worst]:.1f}° RMS "
                     f"({worst.removeprefix('closing.').removesuffix('_deg')}); they were blended.")
    for foot in ("prosthetic", "intact"):
        if f"parts.{foot}_up_n" in errors:
            notes.append(f"The {foot} foot's force was recorded twice over {errors[f'parts.{foot}_overlap_s']:.3f} s "
                         f"of the stride; the two differ by {errors[f'parts.{foot}_up_n']:.0f} N up and "
                         f"{errors[f'parts.{foot}_along_n']:.0f} N along (RMS), and were blended.")
    for of, whose in (("sagittal", "sagittal model's"), ("recorded", "recorded motion's own")):
        if f"force.{of}_up_bw" in errors:
            notes.append(f"What the {whose} centre of mass needs differs from what the plates measured by "
                         f"{100 * errors[f'force.{of}_up_bw']:.1f} % of body weight up and "
                         f"{100 * errors[f'force.{of}_along_bw']:.1f} % along (RMS).")
    if "force.balance_up_bw" in errors:
        notes.append(f"Over the stride the plates carry {100 * (1.0 + errors['force.balance_up_bw']):.1f} % of body "
                     f"weight on average and {100 * errors['force.balance_along_bw']:+.1f} % of it along the way; of a "
                     "stride that repeats they carry 100 and 0 %.")
    if "force.balance_moment_nm" in errors:
        notes.append("Their moment about the centre of mass, about the axis to the left, is "
                     f"{errors['force.balance_moment_nm']:+.0f} N m on average; over a stride that repeats it is zero. "
                     "So far apart are the centres of pressure and the body above them.")
    return tuple(notes)


def _unit(name: str) -> str:
    return f"{name}_mm" if name in _LENGTHS else f"{name}_deg"


def _scaled(name: str, values: np.ndarray) -> np.ndarray:
    return 1e3 * values if name in _LENGTHS else np.degrees(values)


def _rms(values: np.ndarray, weights: np.ndarray | None = None) -> float:
    if weights is not None and not weights.sum() > 0.0:
        return float("nan")
    return float(np.sqrt(np.average(np.square(values), weights=weights)))


# A recorded trial as the 3-D model shows it, and seen from the side of its way of walking.


MOST_HZ = 200.0
"""Faster recordings are thinned to about this rate: a stride's curves hold nothing above 20 Hz."""


@dataclass(frozen=True, eq=False)
class View:
    """The recorded instants of a trial, n of them.

    Attributes:
        points: in 3-D. zero: the same with every coordinate at zero. chain: the sagittal model.
        names: its coordinates. recorded: (n, 8) their values in the 3-D motion; pelvis_tx and pelvis_tilt as they
            would be called in a laboratory whose x axis is the way of walking.
        pelvis: (n, 3) tilt, list and rotation of the pelvis in the laboratory, rad.
        forward: (2,) the way of walking. ground: z of the floor, m.
    """

    time_s: np.ndarray
    points: BodyPoints
    zero: BodyPoints
    chain: SagittalChain
    names: tuple[str, ...]
    recorded: np.ndarray
    pelvis: np.ndarray
    forward: np.ndarray
    ground: float

    @property
    def wanted(self) -> np.ndarray:
        """(n, k) complex, m: the chain's points seen from the side."""
        return targets(self.chain, self.points, self.forward)

    def turned(self, forward: np.ndarray) -> View:
        """The same along another way of walking."""
        recorded = self.recorded.copy()
        # tilt about -y, then list about x, then rotation about z, each in the axes that the former have turned
        turned = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0]))
        turned = turned * Rotation.from_euler("YXZ", self.pelvis * [-1.0, 1.0, 1.0])
        recorded[:, TILT] = -turned.as_euler("YXZ")[:, 0]
        recorded[:, TX] = self.points.pelvis[:, :2] @ forward
        return dataclasses.replace(self, forward=forward, recorded=recorded)

    def at(self, rows: np.ndarray) -> View:
        """The same at some of the instants only; rows: (n,) bool."""
        return dataclasses.replace(self, time_s=self.time_s[rows], points=self.points.at(rows),
                                   recorded=self.recorded[rows], pelvis=self.pelvis[rows])

    def misfit(self, nearness: Nearness | None) -> Misfit:
        """What is to be small for a sagittal motion to be near."""
        return make_misfit(self.chain, self.wanted, self.recorded, ground=self.ground, nearness=nearness)


def view(trial: Trial, walker: Walker | None) -> View:
    """What the model shows of a trial, along the pelvis's way over the whole recording.

    Raises:
        InputError: the walker is another person; the pelvis hardly travels.
    """
    walker = walker or Walker(trial.subject, trial.model)
    if walker.subject.prosthetic_side != trial.subject.prosthetic_side:
        raise InputError(f"the walker's prosthesis is on the {walker.subject.prosthetic_side}, the trial's on the "
                         f"{trial.subject.prosthetic_side}", file=trial.path, where="subject.prosthetic_side")
    motion = trial.trajectory
    rate = (len(motion.time_s) - 1) / (motion.end_s - motion.start_s)
    rows = slice(None, None, max(1, round(rate / MOST_HZ)))
    time, values = motion.time_s[rows], motion.values[rows]
    place = {"fulcrum_m": trial.fulcrum_m}
    points = body_points(walker, trial.offsets, motion.names, values, **place)
    names = sagittal_coordinates(trial.subject.prosthetic_side)
    forward = heading(points, file=trial.path)
    found = View(
        time_s=time, points=points, names=names, recorded=motion.ordered(names).values[rows], forward=forward,
        pelvis=motion.ordered(PELVIS_ROTATIONS).values[rows],
        zero=body_points(walker, trial.offsets, (), np.zeros((1, 0)), **place),
        chain=sagittal_chain(walker, trial.offsets, **place), ground=points.ground)
    return found.turned(forward)


def stride_heading(seen: View, period_s: float) -> np.ndarray:
    """(2,) the mean way of the pelvis over a stride, in which its sway from side to side has no part."""
    time = seen.time_s
    early = time[time + period_s <= time[-1]]
    if not early.size:
        return seen.forward
    way = [np.mean(np.interp(early + period_s, time, column) - column[: len(early)])
           for column in seen.points.pelvis[:, :2].T]
    return np.array(way) / np.hypot(*way)
