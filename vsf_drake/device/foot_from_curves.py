"""A foot of any size from its force-displacement curves: keel, clamp, heel, foam, with intervals.

    minimise    sum over curves c, points i of ((F_c(x_i + o_c) - F_i) / s_c)^2
                + sum over parameters of ((p - mean) / sd)^2 + sum over curves of (o_c / 0.5 mm)^2
    over        p, the eight of `FREE`, and o_c, by which touch-down was read too late
    F_c         forefoot: keel and foam in series under a load on the load point C, tilted as the
                platen is; u(F) = travel of C (`simulation.bench.keel_shape`) + d (F / F0)^(1 / n)
                heel: the spheres of the heel block, F = sum of k (x - h_i)^n, h_i along the
                platen's normal

Forefoot and heel are those of `vsf-drake bench`, whose platen is level. The other sums are what is
assumed where the curves do not tell, as wide as `FREE` says. Points are means over 24 equal parts
of a curve's travel. s_c is 2 % of the curve's largest load at first; the fit is then made again
with what it left: the root mean square of the residuals, widened by their correlation from one
point to the next, so that a misfit of the model counts as one error and not as 24.

The 90 % interval lies about the model's force and is to hold the foot's own:

    measured  = foot's + e, noise of one size in a curve, independent from point to point
    model's   = foot's + the misfit that the fit leaves + what the fit follows of e
    half      = 1.645 sqrt(s^2 + J N J')
    s^2       = r^2 - e^2 (1 - h)   misfit: the mean square left of the curve, less noise in it
    N         = G E^2 G', G = C S'  noise: covariance that it gives the parameters

with C the covariance of the parameters (Gauss-Newton, at the end), S the slopes of the weighted
residuals and E their noise, J the slopes of the force; h is the share of the noise of a curve that
the fit follows, the mean of the diagonal of S G over its points. e^2 is a sixth of the mean square
second difference of what is left, in which a smooth misfit cancels. Misfit and noise are
independent: their squares add. Misfit is in s alone, since it is seen where the curve was pressed;
C, which has it too, makes the intervals of the parameters, where it is not.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from vsf_drake.base.errors import FitError, InputError, SimulationError, require
from vsf_drake.base.schema import unit_hint
from vsf_drake.laws.beam import section_inertia
from vsf_drake.model.foot_curves import LOAD_N, STIFFNESS_N_PER_MM, FootCurve, load_foot_curves
from vsf_drake.model.model_file import bending_stiffness, check_model, spheres_under_load
from vsf_drake.model.parameters import (
    FOAM_DAMPING_TIME_S,
    ContactZone,
    FootParameters,
    ModelParameters,
)
from vsf_drake.plants.foot import sole_height
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.mechanism import LARGEST_KEEL_ANGLE

REFERENCE_N = 600.0  # load F0 under which a foam's depth is a parameter
HEEL_ZONES = ("heel_posterior", "heel", "heel_anterior")
POINTS = 24  # of a curve
FIRST_SHARE = 0.02  # of a curve's largest load, its error before anything is known
LEAST_SHARE = 0.002  # of a curve's largest load: no model is nearer than that
TOUCH_SD_M = 5e-4  # choice: how well touch-down is read
QUANTILE = 1.645  # 90 % of a normal distribution lie so many standard deviations about its mean
TOLD = 0.5  # share of the assumed spread that may be left of a parameter that the curves tell
AT_END = 1e-3  # of the assumed spread: so near the end of its range a value is at it
CYCLE_LOSS = 0.10  # that the nominal foot's damping stands for
LENGTH_MM = (150.0, 360.0)
MASS_G = (100.0, 3000.0)
_NOMINAL = FootParameters()
_SPAN_M = sum(_NOMINAL.keel.element_lengths_m)
_SHORTEST_CLAMP = 0.083
_LONGEST_CLAMP = 0.125
"""Ends of where a keel may be clamped (m from A, of the nominal foot): the heel's spheres lie
behind, those of the midfoot ahead."""
_NODES = 14  # loads at which the keel is bent
_GRID = 400  # loads between which a curve is interpolated
_MOST = 1.3  # times the largest load up to which a curve is computed; a straight line beyond


@dataclass(frozen=True)
class Free:
    """A parameter of the fit: what is assumed of it before, and where it ends."""

    name: str
    unit: str
    mean: float  # of the parameter, or of its logarithm
    sd: float
    low: float
    high: float
    logarithm: bool = True
    shown: float = 1.0  # times the value is what people read
    along: bool = False  # a length, as a share of that of a keel in the nominal proportion


def _log(value: float, ratio: float, low: float, high: float) -> tuple[float, float, float, float]:
    return math.log(value), math.log(ratio), math.log(low), math.log(high)


FREE = (
    Free(
        "keel's bending stiffness at its rear end",
        "N m²",
        *_log(_NOMINAL.keel.flexural_modulus_pa, 3.0, 2e8, 9e11),
        shown=section_inertia(_NOMINAL.keel.width_m, _NOMINAL.keel.thickness_m),
    ),
    Free(
        "keel clamped at",
        "mm",
        0.44,
        0.05,
        _SHORTEST_CLAMP / _SPAN_M,
        _LONGEST_CLAMP / _SPAN_M,
        logarithm=False,
        shown=1e3,
        along=True,
    ),
    Free("keel thins from", "mm", 0.5, 0.15, 0.0, 0.85, logarithm=False, shown=1e3, along=True),
    Free("bending stiffness of its tip over that", "", *_log(1.0, 2.0, 0.02, 5.0)),
    Free("forefoot foam under 600 N", "mm", *_log(0.0102, 3.0, 1e-4, 0.3), shown=1e3),
    Free("forefoot foam's exponent", "", *_log(1.3, 1.6, 1.0, 8.0)),
    Free("heel under 600 N", "mm", *_log(0.0092, 3.0, 1e-4, 0.3), shown=1e3),
    Free("heel's exponent", "", *_log(1.3, 1.6, 1.0, 8.0)),
)
"""Means are the nominal foot's or choices, spreads choices: a factor of three in stiffness, two in
taper, 11 mm of where the keel is clamped."""
CLAMP = 1
_MEAN = np.array([each.mean for each in FREE])
_SD = np.array([each.sd for each in FREE])
_LOW = np.array([each.low for each in FREE])
_HIGH = np.array([each.high for each in FREE])


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """One parameter of the foot as people read it, with its 90 % interval."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    told: bool  # the curves leave less than half of the spread that was assumed
    at_end: bool  # of what it may be


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedCurve:
    """A curve beside the model's, at its displacements."""

    curve: FootCurve
    load_n: np.ndarray  # (n,) of the model
    half_width_n: np.ndarray  # (n,) of the 90 % interval of the true load
    rms_share: float  # root mean square of model less curve, over the curve's largest load
    late_m: float  # by which touch-down was read too late


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedFoot:
    """A foot that bears as its curves do."""

    model: ModelParameters
    clamp_m: float  # where the keel is clamped (m from its posterior end A)
    values: tuple[FittedValue, ...]  # in the order of FREE
    curves: tuple[FittedCurve, ...]
    lost_share: float | None  # energy lost in a cycle; None without unloading: 0.10 is assumed


def foot_from_curves(
    curves: str | Path | Sequence[FootCurve],
    *,
    length_m: float,
    mass_kg: float,
    keel_m: float | None = None,
) -> FittedFoot:
    """The foot of this length and mass that bears as `curves` say.

    Args:
        curves: a CSV file with the columns part (forefoot or heel), displacement_mm and load_n,
            and where known angle_deg and branch (loading or unloading), a row a sample; or curves.
        length_m: of the foot, from heel to toe (m).
        mass_kg: of the foot (kg).
        keel_m: length of its keel (m); by default the nominal foot's share of its length.

    Returns:
        `model`, a passive foot for every function that takes one; what was fitted, with intervals
        of 90 %; and each curve beside the model's.

    Raises:
        InputError: the file, or a length or mass that makes no foot.
        FitError: no foot was found that bears these loads.
    """
    read = load_foot_curves(curves) if isinstance(curves, (str, Path)) else tuple(curves)
    require(
        any(curve.part == "forefoot" for curve in read),
        "holds no curve of the forefoot",
        "curves",
        "The forefoot alone tells of the keel",
    )
    losses = [curve.lost_share for curve in read if curve.lost_share is not None]
    lost = None if not losses else max(float(np.mean(losses)), 0.0)
    foot = _sized(length_m, mass_kg, keel_m, lost)
    problem = _Problem(foot, read)
    x, spread = problem.solve()
    x[CLAMP] = round(x[CLAMP] * problem.span_m, 4) / problem.span_m  # as people type it
    found = problem.foot(x)
    model = check_model(dataclasses.replace(ModelParameters(), foot=found))
    clamp = found.fulcrum.rearmost_m
    for curve in read:
        if curve.part == "forefoot":
            shape = keel_shape(
                found,
                fulcrum_m=clamp,
                load_n=float(curve.load_n[-1]),
                tilt_rad=curve.tilt_rad,
            )
            if np.abs(shape.angles).max() > LARGEST_KEEL_ANGLE:
                raise FitError(
                    f"the keel that fits bends by more than {LARGEST_KEEL_ANGLE:g} rad in one "
                    "joint: are length and loads those of this foot?"
                )
    return FittedFoot(
        model=model,
        clamp_m=clamp,
        values=problem.values(x, spread),
        curves=problem.beside(x, spread),
        lost_share=lost,
    )


def curves_of_stiffness(
    *, forefoot_n_per_m: float, heel_n_per_m: float | None, load_n: float
) -> tuple[FootCurve, ...]:
    """Curves of one point each: the secant stiffness (N/m) of forefoot and heel at one load (N)."""
    least_n, most_n = LOAD_N
    require(
        least_n <= load_n <= most_n,
        f"{load_n:g} N is no load",
        "load_n",
        f"It must be {least_n:g} to {most_n:g} N",
    )
    curves = []
    least, most = STIFFNESS_N_PER_MM
    for part, stiffness in (("forefoot", forefoot_n_per_m), ("heel", heel_n_per_m)):
        if stiffness is None:
            continue
        require(
            1e3 * least <= stiffness <= 1e3 * most,
            f"{1e-3 * stiffness:g} N/mm is no foot's",
            f"{part}_n_per_m",
            f"It must be from {least:g} to {most:g} N/mm",
        )
        curves.append(
            FootCurve(
                part=part,
                displacement_m=np.array([0.0, load_n / stiffness]),
                load_n=np.array([0.0, load_n]),
            )
        )
    return tuple(curves)


def _sized(
    length_m: float, mass_kg: float, keel_m: float | None, lost: float | None
) -> FootParameters:
    """The nominal foot drawn out to this length, with a carriage that stays: all places along it in
    proportion, the keel's to the keel; damping by the energy lost in a cycle."""
    for value, unit, (low, high), what, where in (
        (1e3 * length_m, "mm", LENGTH_MM, "length", "length_m"),
        (1e3 * mass_kg, "g", MASS_G, "mass", "mass_kg"),
    ):
        require(
            low <= value <= high,
            f"{value:g} {unit} is no foot's {what}",
            where,
            f"It must be from {low:g} to {high:g} {unit}{unit_hint(value, unit, low, high)}",
        )
    by_length = length_m / _NOMINAL.length_m
    if keel_m is None:
        keel_m = _SPAN_M * by_length
    load_point = _NOMINAL.load_point_m * by_length
    require(
        load_point <= keel_m <= length_m,
        f"a keel of {1e3 * keel_m:.0f} mm does not go with a foot of {1e3 * length_m:.0f} mm: its "
        f"forefoot is loaded {1e3 * load_point:.0f} mm ahead of the keel's rear end",
        "keel_m",
        f"The keel must reach that point and be no longer than the foot: {1e3 * load_point:.0f} to "
        f"{1e3 * length_m:.0f} mm",
    )
    by_keel = keel_m / _SPAN_M
    times = 1.0 if lost is None else lost / CYCLE_LOSS
    keel = dataclasses.replace(
        _NOMINAL.keel,
        element_lengths_m=tuple(by_keel * each for each in _NOMINAL.keel.element_lengths_m),
        damping_time_s=times * _NOMINAL.keel.damping_time_s,
    )
    own = keel.density_kg_m3 * keel_m * keel.width_m * keel.thickness_m
    if own > 0.5 * mass_kg:  # a keel of half the mass, at most
        keel = dataclasses.replace(keel, density_kg_m3=0.5 * mass_kg / own * keel.density_kg_m3)
    zones = tuple(
        dataclasses.replace(
            zone,
            x_mm=tuple(by_length * x for x in zone.x_mm),
            damping_n_s_per_m=times * FOAM_DAMPING_TIME_S,  # of a stiffness of 1 N/m
        )
        for zone in _NOMINAL.zones
    )
    return dataclasses.replace(
        _NOMINAL,
        keel=keel,
        zones=zones,
        fulcrum=dataclasses.replace(_NOMINAL.fulcrum, carriage_mass_kg=0.02),
        series_patch_m=by_length * _NOMINAL.series_patch_m,
        load_point_m=load_point,
        mass_kg=mass_kg,
        length_m=length_m,
        heel_x_m=by_length * _NOMINAL.heel_x_m,
        pylon_x_m=by_length * _NOMINAL.pylon_x_m,
    )


class _Problem:
    """Curves, and a foot but for its eight parameters x, in the order of `FREE`."""

    def __init__(self, foot: FootParameters, curves: tuple[FootCurve, ...]) -> None:
        self.sized = foot
        self.span_m = _SPAN_M * foot.length_m / _NOMINAL.length_m
        self.curves = curves
        self.points = [_points(curve) for curve in curves]
        self.under_load = len(spheres_under_load(foot))
        self.error_n = [FIRST_SHARE * float(curve.load_n[-1]) for curve in curves]
        self.least_n = [LEAST_SHARE * float(curve.load_n[-1]) for curve in curves]
        self._asked = np.empty(0)
        self._answer: list[tuple[np.ndarray, np.ndarray]] = []

    def foot(self, x: np.ndarray) -> FootParameters:
        """The foot of parameters x, its support where the keel is clamped."""
        modulus, clamp, start, tip, foam_m, foam_n, heel_m, heel_n = _natural(x, self.span_m)
        sized = self.sized
        heel = [zone for zone in sized.zones if zone.name in HEEL_ZONES]
        shares = {
            True: (sum(len(zone.x_mm) for zone in heel), heel_m, heel_n),
            False: (self.under_load, foam_m, foam_n),
        }

        def zone_of(zone: ContactZone) -> ContactZone:
            count, depth, n = shares[zone.name in HEEL_ZONES]
            k = REFERENCE_N / depth**n / count
            slope = n * k * depth ** (n - 1.0)
            return dataclasses.replace(
                zone,
                stiffness=k,
                exponent=n,
                damping_n_s_per_m=zone.damping_n_s_per_m * slope,
            )

        return dataclasses.replace(
            sized,
            keel=dataclasses.replace(
                sized.keel, flexural_modulus_pa=modulus, taper_from_m=start, tip_stiffness=tip
            ),
            fulcrum=dataclasses.replace(sized.fulcrum, rearmost_m=clamp, foremost_m=clamp),
            zones=tuple(zone_of(zone) for zone in sized.zones),
            series_stiffness_n_per_m=REFERENCE_N / foam_m**foam_n,
            series_exponent=foam_n,
        )

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters and touch-downs (8 + curves,), and their covariance."""
        start = np.concatenate((_MEAN, np.zeros(len(self.curves))))
        free = np.full(len(self.curves), np.inf)
        for again in (False, True):
            try:
                found = least_squares(
                    self._residuals,
                    start,
                    self._slopes,
                    bounds=(np.append(_LOW, -free), np.append(_HIGH, free)),
                    x_scale=np.append(_SD, np.full(len(free), TOUCH_SD_M)),
                    xtol=1e-9,
                    ftol=1e-9,
                )
            except SimulationError as error:
                raise FitError(f"no keel was found that bears these loads: {error.what}") from error
            start = found.x
            if not again:
                self._learn_errors(start)
        if not found.success:
            raise FitError(f"the search for the foot did not end: {found.message}")
        slopes = self._slopes(start)
        return start, np.linalg.inv(slopes.T @ slopes)

    def values(self, x: np.ndarray, covariance: np.ndarray) -> tuple[FittedValue, ...]:
        """The eight parameters as people read them."""
        sd = np.sqrt(np.diag(covariance))[: len(FREE)]
        low, value, high = (
            _natural(np.clip(x[: len(FREE)] + side * QUANTILE * sd, _LOW, _HIGH), self.span_m)
            for side in (-1.0, 0.0, 1.0)
        )
        return tuple(
            FittedValue(
                name=free.name,
                unit=free.unit,
                value=free.shown * value[i],
                low=free.shown * low[i],
                high=free.shown * high[i],
                told=bool(sd[i] < TOLD * free.sd),
                at_end=not free.low + AT_END * free.sd < x[i] < free.high - AT_END * free.sd,
            )
            for i, free in enumerate(FREE)
        )

    def beside(self, x: np.ndarray, covariance: np.ndarray) -> tuple[FittedCurve, ...]:
        """Each curve beside the model's."""
        left = self._left(x)
        noise_n = [_noise(each) for each in left]
        counts = [len(each) for each in left]
        slopes = self._slopes(x)[len(x) :]
        gain = covariance @ slopes.T
        weighted = np.repeat(np.array(noise_n) / self.error_n, counts)
        by_noise = (gain * weighted**2) @ gain.T
        followed = np.split(np.sum(slopes * gain.T, axis=1), np.cumsum(counts)[:-1])
        fitted = []
        for i, curve in enumerate(self.curves):
            load, by = self._loads(i, x, curve.displacement_m)
            noise_left = noise_n[i] ** 2 * (1.0 - followed[i].mean())
            misfit = max(np.mean(left[i] ** 2) - noise_left, self.least_n[i] ** 2)
            variance = misfit + np.einsum("ij,jk,ik->i", by, by_noise, by)
            difference = load - curve.load_n
            fitted.append(
                FittedCurve(
                    curve=curve,
                    load_n=load,
                    half_width_n=QUANTILE * np.sqrt(variance),
                    rms_share=float(np.sqrt(np.mean(difference**2)) / curve.load_n[-1]),
                    late_m=float(x[len(FREE) + i]),
                )
            )
        return tuple(fitted)

    def _left(self, x: np.ndarray) -> list[np.ndarray]:
        """N, the model's loads less the measured ones at the points of each curve."""
        return [
            own - load for (own, _), (_, load) in zip(self._at_points(x), self.points, strict=True)
        ]

    def _learn_errors(self, x: np.ndarray) -> None:
        for i, left in enumerate(self._left(x)):
            along = float(np.sum(left[1:] * left[:-1]) / np.sum(left**2)) if len(left) > 2 else 0.0
            correlation = min(max(along, 0.0), 0.9)
            size = max(float(np.sqrt(np.mean(left**2))), self.least_n[i])
            self.error_n[i] = size * math.sqrt((1.0 + correlation) / (1.0 - correlation))

    def _residuals(self, x: np.ndarray) -> np.ndarray:
        parts = [(x[: len(FREE)] - _MEAN) / _SD, x[len(FREE) :] / TOUCH_SD_M]
        try:
            for left, error in zip(self._left(x), self.error_n, strict=True):
                parts.append(left / error)
        except SimulationError:
            if np.array_equal(x[: len(FREE)], _MEAN):
                raise
            return np.full(len(x) + sum(len(at) for at, _ in self.points), np.inf)
        return np.concatenate(parts)

    def _slopes(self, x: np.ndarray) -> np.ndarray:
        parts: list[np.ndarray] = [
            np.diag(1.0 / np.append(_SD, np.full(len(self.curves), TOUCH_SD_M)))
        ]
        parts += [
            slopes / error
            for (_, slopes), error in zip(self._at_points(x), self.error_n, strict=True)
        ]
        return np.vstack(parts)

    def _at_points(self, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """`_loads` at the points of each curve; the search asks for loads, then for slopes."""
        if not np.array_equal(x, self._asked):
            self._answer = [self._loads(i, x, at) for i, (at, _) in enumerate(self.points)]
            self._asked = x.copy()
        return self._answer

    def _loads(
        self, i: int, x: np.ndarray, displacement_m: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(n,) N, the model's loads at displacements of curve i, and (n, 8 + curves) their
        derivatives."""
        curve = self.curves[i]
        at = displacement_m + x[len(FREE) + i]
        pressed = self._heel if curve.part == "heel" else self._forefoot
        load, by, stiffness = pressed(curve, x[: len(FREE)], at)
        slopes = np.zeros((len(at), len(x)))
        slopes[:, : len(FREE)] = by
        slopes[:, len(FREE) + i] = stiffness
        return load, slopes

    def _forefoot(
        self, curve: FootCurve, x: np.ndarray, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        foot = self.foot(x)
        nodes = np.linspace(0.0, _MOST * float(curve.load_n[-1]), _NODES)
        rows = np.zeros((_NODES, 1 + 4))
        by_x = self._joints_by(x)
        shape = None
        for k, load in enumerate(nodes[1:], start=1):
            shape = keel_shape(
                foot,
                fulcrum_m=foot.fulcrum.rearmost_m,
                load_n=float(load),
                tilt_rad=curve.tilt_rad,
                after=shape,
            )
            rows[k, 0] = shape.travel_m
            rows[k, 1:] = shape.travel_by_joints @ by_x
            rows[k, 2] += shape.travel_by_place * self.span_m
        load = nodes[-1] * np.linspace(0.0, 1.0, _GRID)[1:] ** 2
        keel = CubicSpline(nodes, rows)(load)
        share = load / REFERENCE_N
        n = math.exp(x[5])
        foam = math.exp(x[4]) * share ** (1.0 / n)
        travel = keel[:, 0] + foam
        by = np.zeros((len(load), len(FREE)))
        by[:, :4] = keel[:, 1:]
        by[:, 4] = foam
        by[:, 5] = -foam * np.log(share) / n
        stiffness = np.gradient(load, travel)
        inside = np.interp(at, travel, load, left=0.0)
        beyond = np.maximum(at - travel[-1], 0.0)
        slope = np.interp(at, travel, stiffness) * (at > 0.0)
        slopes = np.column_stack([np.interp(at, travel, column) for column in by.T])
        return inside + stiffness[-1] * beyond, -slopes * slope[:, None], slope

    def _joints_by(self, x: np.ndarray) -> np.ndarray:
        """(m, 4) derivatives of the joints' stiffness by the first four of x; by the second, where
        the keel is clamped, none."""
        lengths = np.array(self.sized.keel.element_lengths_m)
        by = np.zeros((len(lengths), 4))
        for column in (0, 2, 3):
            step = np.zeros(len(FREE))
            step[column] = 1e-6
            by[:, column] = (
                bending_stiffness(self.foot(x + step).keel)
                - bending_stiffness(self.foot(x - step).keel)
            ) / (2e-6 * lengths)
        return by

    def _heel(
        self, curve: FootCurve, x: np.ndarray, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        spheres = [
            (1e-3 * along, zone.radius_m, 1e-3 * rise)
            for zone in self.sized.zones
            if zone.name in HEEL_ZONES
            for along, rise in zip(zone.x_mm, zone.rise_mm, strict=True)
        ]
        place, radius, rise = np.array(spheres).T
        height = (
            -math.sin(curve.tilt_rad) * place
            + math.cos(curve.tilt_rad) * (sole_height(self.sized) + rise + radius)
            - radius
        )
        depth = np.maximum(at[:, None] - (height - height.min()), 0.0)
        reference = math.exp(x[6])
        n = math.exp(x[7])
        share = depth / reference
        each = REFERENCE_N / len(place) * share**n
        load = each.sum(axis=1)
        by = np.zeros((len(at), len(FREE)))
        by[:, 6] = -n * load
        by[:, 7] = n * np.sum(each * np.log(np.maximum(share, 1e-12)), axis=1)
        slope = n * REFERENCE_N / len(place) / reference * share ** (n - 1.0) * (depth > 0.0)
        return load, by, slope.sum(axis=1)


def _natural(x: np.ndarray, span_m: float) -> list[float]:
    """The eight parameters in SI units; `span_m` is what lengths are shares of."""
    return [
        (math.exp(value) if free.logarithm else float(value)) * (span_m if free.along else 1.0)
        for free, value in zip(FREE, x, strict=False)
    ]


def _points(curve: FootCurve) -> tuple[np.ndarray, np.ndarray]:
    """Mean displacement and load of the samples in each of POINTS equal parts of the travel, those
    at touch-down aside."""
    x = curve.displacement_m[1:]
    load = curve.load_n[1:]
    part = np.minimum((POINTS * x / x[-1]).astype(int), POINTS - 1)
    kept, which, count = np.unique(part, return_inverse=True, return_counts=True)
    if not len(kept):
        raise InputError("holds no sample beyond touch-down", where=curve.name)
    return np.bincount(which, weights=x) / count, np.bincount(which, weights=load) / count


def _noise(left: np.ndarray) -> float:
    """Standard deviation of what of `left` is independent from point to point; 0 of fewer than
    three points, where all counts as misfit."""
    return float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0)) if len(left) > 2 else 0.0
