"""Smooth curves through a recorded stride: periodic ones, or a piece of time as it is.

A periodic coordinate is

    q(t) = s t / T + sum over h = 0 ... H of  a_h cos(2 pi h t / T) + b_h sin(2 pi h t / T)

with s the advance per stride (zero for all but pelvis_tx), by weighted least squares over everything that was recorded.
An instant of the stride that was recorded more than once counts as the mean of what was recorded; the weights rise from
zero at the recording's beginning and fall to zero at its end, over the time by which it is longer than a stride, so
that the mean has no step where a second recording sets in.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import BodyIndex
from scipy.interpolate import BSpline

from vsf_drake.errors import InputError
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.walk import Walker

DEGREE = 5
CLOSING_SHARE = 0.25
"""Part of a stride over which one stride's two ends are blended, if as much was recorded (a choice)."""


@dataclass(frozen=True, eq=False)
class PeriodicCurves:
    """m curves that repeat after `period_s`, up to an advance.

    Attributes:
        advance: (m,) per period. coefficients: (2 H + 1, m), mean, cosines, sines.
    """

    period_s: float
    advance: np.ndarray
    coefficients: np.ndarray

    @property
    def order(self) -> int:
        """H."""
        return (len(self.coefficients) - 1) // 2

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m) at any times (n,) s."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        q, v, a = (basis @ self.coefficients for basis in harmonics(times, self.period_s, self.order))
        return q + np.outer(times / self.period_s, self.advance), v + self.advance / self.period_s, a

    def basis(self, times: np.ndarray) -> np.ndarray:
        """(n, 2 H + 1) what the coefficients multiply."""
        return harmonics(times, self.period_s, self.order)[0]

    def grid(self) -> np.ndarray:
        """(4 H,) even times over a period."""
        return self.period_s * np.arange(4 * self.order) / (4 * self.order)

    def second_derivative(self) -> np.ndarray:
        """(4 H, 4 H) of a periodic function's values on the grid, up to the order H; what is faster is dropped."""
        count = 4 * self.order
        rate = 2.0 * np.pi * np.fft.fftfreq(count, self.period_s / count)
        kept = np.abs(np.fft.fftfreq(count, 1.0 / count)) <= self.order
        return np.fft.ifft((-(rate**2) * kept)[:, None] * np.fft.fft(np.eye(count), axis=0), axis=0).real


@dataclass(frozen=True, eq=False)
class PieceOfTime:
    """m curves from 0 to `end_s`: quintic splines on even knots.

    Attributes: coefficients: (k, m).
    """

    end_s: float
    coefficients: np.ndarray

    @property
    def advance(self) -> np.ndarray:
        """(m,) zeros: nothing repeats."""
        return np.zeros(self.coefficients.shape[1])

    def _knots(self) -> np.ndarray:
        inner = np.linspace(0.0, self.end_s, len(self.coefficients) - DEGREE + 1)
        return np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, self.end_s)])

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second derivatives (n, m); InputError outside."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        if times.size and not (times.min() >= -1e-9 and times.max() <= self.end_s + 1e-9):
            raise InputError(f"{times.min():g} to {times.max():g} s lies outside the piece of time of 0 to "
                             f"{self.end_s:g} s", where="times_s")
        spline = BSpline(self._knots(), self.coefficients, DEGREE)
        times = np.clip(times, 0.0, self.end_s)
        return spline(times), spline(times, 1), spline(times, 2)

    def basis(self, times: np.ndarray) -> np.ndarray:
        """(n, k) what the coefficients multiply."""
        return BSpline.design_matrix(np.clip(times, 0.0, self.end_s), self._knots(), DEGREE).toarray()

    def grid(self) -> np.ndarray:
        """(4 k,) even times from 0 to the end."""
        return np.linspace(0.0, self.end_s, 4 * len(self.coefficients))

    def second_derivative(self) -> np.ndarray:
        """(4 k, 4 k) of values on the grid by central differences; zero at both ends."""
        count = 4 * len(self.coefficients)
        D = np.diag(np.ones(count - 1), 1) + np.diag(np.ones(count - 1), -1) - 2.0 * np.eye(count)
        D[[0, -1]] = 0.0
        return D * ((count - 1) / self.end_s) ** 2


Curves = PeriodicCurves | PieceOfTime


def harmonics(times: np.ndarray, period_s: float, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2 order + 1) of 1, cosines and sines, and their first and second derivatives by time."""
    rate = 2.0 * np.pi * np.arange(1, order + 1) / period_s
    turn = np.outer(times, rate)
    cos, sin, one = np.cos(turn), np.sin(turn), np.ones((len(times), 1))
    return (np.hstack([one, cos, sin]), np.hstack([0.0 * one, -rate * sin, rate * cos]),
            np.hstack([0.0 * one, -(rate**2) * cos, -(rate**2) * sin]))


def closing_weights(times: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(n,) weights of recorded instants, such that those a period apart sum to 1.

    Args:
        start, end: of the recording, on the clock of `times`; at least a period apart.
    """
    ramp = max(min(end - start - period_s, 0.5 * period_s), 0.0)

    def rise(times: np.ndarray) -> np.ndarray:
        inside = (times >= start) & (times <= end)
        if ramp <= 0.0:
            return inside.astype(float)
        near = np.clip(np.minimum(times - start, end - times) / ramp, 0.0, 1.0)
        return np.where(inside, near**3 * (10.0 - 15.0 * near + 6.0 * near**2), 0.0)

    times = np.asarray(times, dtype=float)
    reach = int(np.ceil((end - start) / period_s)) + 1
    total = sum(rise(times + k * period_s) for k in range(-reach, reach + 1))
    return rise(times) / np.where(total > 0.0, total, 1.0)


def one_stride(record: tuple[float, float], middle: float, period_s: float) -> tuple[float, float]:
    """The part of a recording, around a time `middle` if there is enough, that is a stride and what closes it."""
    length = min(period_s * (1.0 + CLOSING_SHARE), record[1] - record[0])
    start = min(max(middle - 0.5 * length, record[0]), record[1] - length)
    return start, start + length


def fit_periodic(times: np.ndarray, values: np.ndarray, weights: np.ndarray, *, period_s: float, advance: np.ndarray,
                 order: int) -> PeriodicCurves:
    """The least-squares curves through (n,) times, (n, m) values with (n,) weights."""
    basis = harmonics(times, period_s, order)[0]
    root = np.sqrt(weights)[:, None]
    coefficients = np.linalg.lstsq(root * basis, root * (values - np.outer(times / period_s, advance)), rcond=None)[0]
    return PeriodicCurves(period_s, np.asarray(advance, dtype=float), coefficients)


def fit_piece(times: np.ndarray, values: np.ndarray, *, end_s: float, knot_s: float) -> PieceOfTime:
    """The least-squares splines through (n,) times from 0 to `end_s` and (n, m) values, knots `knot_s` apart."""
    count = max(1, min(round(end_s / knot_s), len(times) - DEGREE - 1)) + DEGREE
    empty = PieceOfTime(end_s, np.zeros((count, values.shape[1])))
    return PieceOfTime(end_s, np.linalg.lstsq(empty.basis(times), values, rcond=None)[0])


def advance_of(times: np.ndarray, values: np.ndarray, period_s: float) -> float:
    """Mean of value(t + period) - value(t) over all t that have both; from the mean rate if there are none.

    The mean is weighted toward the middle of the overlap, like `closing_weights`. times, values: (n,).
    """
    early = times[times + period_s <= times[-1]]
    if early.size < 2:
        return float((values[-1] - values[0]) * period_s / (times[-1] - times[0]))
    later = np.interp(early + period_s, times, values)
    x = (early - early[0]) / (early[-1] - early[0])
    return float(np.average(later - values[: len(early)], weights=x**2 * (1.0 - x) ** 2 + 1e-9))


# Where the person's joints, contact spheres and centres of mass are in the 3-D model, instant by instant.
#
# Keel and socket are undeformed: what the recording prescribes is all that is known.


FEET = ("P", "I")
"""The prosthetic and the intact side, in this order wherever both appear."""


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Points of the person in W (x forward, y left, z up), m. n instants; sides in the order of `FEET`.

    Attributes:
        pelvis: (n, 3) the pelvis's origin.
        hip, knee, ankle: (n, 2, 3) joint centres; the prosthetic "ankle" is the pylon's lower end.
        spheres: by side, (n, m, 3) centres of the contact spheres. radius: by side, (m,).
        mass: (b,) kg of the bodies that have one. mass_center: (n, b, 3) their centres.
        mass_body: (b,) index into `SEGMENTS` of the planar segment that carries each.
        ground: z of the floor, m.
    """

    pelvis: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    ankle: np.ndarray
    spheres: dict[str, np.ndarray]
    radius: dict[str, np.ndarray]
    mass: np.ndarray
    mass_center: np.ndarray
    mass_body: np.ndarray
    ground: float

    def at(self, rows: np.ndarray) -> BodyPoints:
        """The same at some of the instants only; rows: (n,) bool."""
        return dataclasses.replace(
            self, pelvis=self.pelvis[rows], hip=self.hip[rows], knee=self.knee[rows], ankle=self.ankle[rows],
            spheres={s: centres[rows] for s, centres in self.spheres.items()}, mass_center=self.mass_center[rows])

    @property
    def whole_center(self) -> np.ndarray:
        """(n, 3) m, the whole body's centre of mass."""
        return np.einsum("b,nbk->nk", self.mass, self.mass_center) / self.mass.sum()


SEGMENTS = ("pelvis", "thigh_P", "shank_P", "thigh_I", "shank_I", "foot_I")
"""Rigid segments of the sagittal model; socket, pylon and prosthetic foot belong to "shank_P"."""


def body_points(walker: Walker, offsets: GeometricOffsets, names: Sequence[str], values: np.ndarray,
                *, fulcrum_m: float) -> BodyPoints:
    """The points of `BodyPoints` for n sets of coordinates.

    Args:
        walker: the person; its Context is copied, not changed.
        offsets: of the prosthesis.
        names: m coordinates. values: (n, m) rad and m; coordinates that are not named are zero.
    """
    gait = walker.gait
    plant, person = gait.plant, gait.person
    root = walker.context.Clone()
    context = gait.plant_context(root)
    set_mount(context, person.foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
              alignment=offsets.alignment_rad)
    mechanism = gait_mechanism(gait, root)
    side = {"P": person.subject.prosthetic_side, "I": "left" if person.subject.prosthetic_side == "right" else "right"}
    segments = person.segments
    frames = [segments["pelvis"].body_frame(), *(segments[f"thigh_{side[s]}"].body_frame() for s in FEET),
              *(segments[f"shank_{side[s]}"].body_frame() for s in FEET), person.socket.distal,
              segments[f"foot_{side['I']}"].body_frame()]
    count = len(person.foot.sites.radius)
    carriers = [plant.get_body(BodyIndex(int(i))) for i in mechanism.site_bodies]
    heavy, parents = _heavy(walker, context, side)
    columns = [plant.GetJointByName(name).position_start() for name in names]
    q = np.zeros(plant.num_positions())
    q[plant.GetJointByName(person.foot.carriage_joint_name, person.foot.instance).position_start()] = fulcrum_m
    origins = np.empty((len(values), len(frames), 3))
    centres = np.empty((len(values), len(mechanism.sites), 3))
    masses = np.empty((len(values), len(heavy), 3))
    own = [(body, body.CalcCenterOfMassInBodyFrame(context)) for body in heavy]
    for i, row in enumerate(np.asarray(values, dtype=float)):
        q[columns] = row
        plant.SetPositions(context, q)
        for j, frame in enumerate(frames):
            origins[i, j] = frame.CalcPoseInWorld(context).translation()
        for j, (body, p_BS) in enumerate(zip(carriers, mechanism.sites[:, :3], strict=True)):
            centres[i, j] = plant.EvalBodyPoseInWorld(context, body) @ p_BS
        for j, (body, p_BC) in enumerate(own):
            masses[i, j] = plant.EvalBodyPoseInWorld(context, body) @ p_BC
    radius = mechanism.sites[:, 3]
    return BodyPoints(
        pelvis=origins[:, 0], hip=origins[:, 1:3], knee=origins[:, 3:5], ankle=origins[:, 5:7],
        spheres={"P": centres[:, :count], "I": centres[:, count:]},
        radius={"P": radius[:count], "I": radius[count:]},
        mass=np.array([body.get_mass(context) for body in heavy]), mass_center=masses, mass_body=np.array(parents),
        ground=float(mechanism.ground_height))


def _heavy(walker: Walker, context, side: dict[str, str]) -> tuple[list, list[int]]:
    """Bodies with mass, and the planar segment of each."""
    plant = walker.gait.plant
    rigid = {walker.gait.person.segments["pelvis"].index(): 0}
    for name, segment in ((f"thigh_{side['P']}", 1), (f"thigh_{side['I']}", 3), (f"shank_{side['I']}", 4),
                          (f"foot_{side['I']}", 5)):
        rigid[walker.gait.person.segments[name].index()] = segment
    bodies = [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]
    heavy = [body for body in bodies if body.get_mass(context) > 0.0]
    return heavy, [rigid.get(body.index(), SEGMENTS.index("shank_P")) for body in heavy]


# The ground's forces over a recorded stride, both feet, seen from the side and made periodic.
#
# Each component is the mean of what the plates saw at that instant of the stride, weighed as `closing_weights` says; an
# instant that no plate saw is not known. The centre of pressure moves on by one advance per stride; it is
# averaged with the force as weight, less the part of the advance that has gone by.


GRID_S = 0.001
LEAST_WEIGHT = 1e-9
"""Of what was recorded in another stride: it counts only where there is nothing else."""

Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class FootForce:
    """One foot's force over one stride (or one piece of time), on an even grid.

    Attributes:
        time_s: (g,) s since phase 0, from 0 to the period, both included.
        force: (g, 2) N, along the way of walking and up; NaN where not known.
        cop: (g,) m along the way, less `advance_m` times t / period; NaN where not known or not loaded.
        period_s, advance_m: see `RecordedStride`. periodic: whether it goes on beyond the grid.
        parts_differ: RMS (N, along and up) between two recordings of the same instant while the foot was loaded; NaN if
            there are none. parts_overlap_s: for how long there are.
    """

    time_s: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    period_s: float
    advance_m: float
    periodic: bool
    parts_differ: tuple[float, float]
    parts_overlap_s: float

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) force along and up (N) and moment about W's y axis at W's origin (N m); (n,) centre of pressure (m).

        All NaN where the force is not known; the centre of pressure also where the foot is not loaded (the moment of
        what little force there is then is that at the nearest place known).
        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        phase = np.mod(times, self.period_s) if self.periodic else times
        along, up, cop, held = (np.interp(phase, self.time_s, column, left=np.nan, right=np.nan)
                                for column in (*self.force.T, self.cop, _held(self.cop)))
        gone = self.advance_m * times / self.period_s
        return np.column_stack([along, up, -(held + gone) * up]), cop + gone


def plate_series(plate: PlateRecording, forward: np.ndarray,
                 unknown: Sequence[Span] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Times (j,) s and forces (j, 2) N along the way and up; NaN in the spans `unknown`."""
    force = np.column_stack([plate.force_W[:, :2] @ forward, plate.force_W[:, 2]])
    for a, b in unknown:
        force[(plate.time_s >= a) & (plate.time_s <= b)] = np.nan
    return plate.time_s, force


def foot_force(plate: PlateRecording, forward: np.ndarray, *, record: Span, span: Span, start_s: float,
               period_s: float, advance_m: float, unknown: Sequence[Span] = (), periodic: bool = True) -> FootForce:
    """What one foot's plate says of a stride.

    Args:
        forward: (2,) unit vector along the way of walking in the floor.
        record: for which time the motion was recorded, s: outside, nobody knows whether the foot stands on the plate.
        span: the part of it that makes the stride; the rest serves where there is nothing else.
        start_s: time of phase 0 on the plate's clock.
        unknown: spans (s) in which the foot stands on no plate though the record says zero.
    """
    count = max(2, round(period_s / GRID_S))
    grid = np.linspace(0.0, period_s, count + 1)
    first, last = max(plate.time_s[0], record[0]), min(plate.time_s[-1], record[1])
    cycles = np.arange(np.floor((first - start_s) / period_s), np.ceil((last - start_s) / period_s) + 1)
    t = start_s + grid + period_s * (cycles if periodic else np.zeros(1))[:, None]
    seen = (t >= first - 1e-9) & (t <= last + 1e-9)
    for a, b in unknown:
        seen &= (t < a) | (t > b)
    w = np.ones(t.shape)
    if periodic:
        w = np.maximum(closing_weights(t.ravel(), *span, period_s).reshape(t.shape), LEAST_WEIGHT)
    w = np.where(seen, w, 0.0)
    _, series = plate_series(plate, forward)
    f = np.stack([np.interp(t, plate.time_s, column) for column in series.T], axis=2)
    c = _places(plate, forward, t) - advance_m * (t - start_s) / period_s
    total = w.sum(axis=0)
    known = total > 0.0
    force = np.where(known[:, None], np.einsum("kg,kgc->gc", w, f) / np.where(known, total, 1.0)[:, None], np.nan)
    carried = w * np.maximum(f[:, :, 1], 0.0) * np.isfinite(c)
    on = carried.sum(axis=0) > 0.0
    cop = np.where(on, np.sum(carried * np.nan_to_num(c), axis=0) / np.where(on, carried.sum(axis=0), 1.0), np.nan)
    if periodic:
        force[-1], cop[-1] = force[0], cop[0]
    differ, overlap = _parts(seen, f)
    return FootForce(grid, force, cop, period_s, advance_m, periodic, differ, overlap * period_s / count)


def _places(plate: PlateRecording, forward: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The centre of pressure along the way at times t; NaN where the foot is not loaded."""
    loaded = np.isfinite(plate.cop_W).all(axis=1) & (plate.force_W[:, 2] > THRESHOLD_N)
    if not loaded.any():
        return np.full(t.shape, np.nan)
    x = np.interp(t, plate.time_s[loaded], plate.cop_W[loaded, :2] @ forward)
    return np.where(np.interp(t, plate.time_s, loaded.astype(float)) > 0.5, x, np.nan)


def _held(cop: np.ndarray) -> np.ndarray:
    """The centre of pressure, and where there is none the nearest that there is."""
    known = np.flatnonzero(np.isfinite(cop))
    if not known.size:
        return cop
    at = np.arange(len(cop))
    right = known[np.minimum(np.searchsorted(known, at), len(known) - 1)]
    left = known[np.maximum(np.searchsorted(known, at, side="right") - 1, 0)]
    return cop[np.where(np.abs(at - left) <= np.abs(right - at), left, right)]


def _parts(seen: np.ndarray, f: np.ndarray) -> tuple[tuple[float, float], int]:
    """RMS between two recordings of one instant while the foot is loaded in either, and at how many instants."""
    both = seen.sum(axis=0) > 1
    mean = np.sum(f * seen[:, :, None], axis=0) / np.maximum(seen.sum(axis=0), 1)[:, None]
    both &= mean[:, 1] > THRESHOLD_N
    if not both.any():
        return (float("nan"), float("nan")), 0
    spread = np.sum(np.where(seen[:, both, None], f[:, both] - mean[both], 0.0) ** 2, axis=0)
    spread *= 2.0 / (seen[:, both].sum(axis=0) - 1)[:, None]
    x, z = np.sqrt(np.mean(spread, axis=0))
    return (float(x), float(z)), int(both.sum())
