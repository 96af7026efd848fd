"""Stiffness and displacement of a foot in the testing machine as functions of its variables, with
exact derivatives.

Stiffness is the mean slope (F2 - F1) / (x(F2) - x(F1)) of load over the platen's travel from 200 N
to the largest load; the mid-range displacement is x(F2 / 2), counted from where the platen touches
the first sphere. Here only these loads are put on, each until the foot rests: at 50 mm/min damping
has less than a thousandth of the slope, inertia nothing.

At the forefoot foam and keel are in series, x(F) = keel(F) + foam(F), because the load stays
vertical and on its point of the keel whatever the foam does. keel(F) is `bench.keel_shape`.
foam(F): the spheres in the patch under the load, pressed together by a flat platen, sum k (s -
h)^n = F over the spheres with bottoms at h below the platen's height s. Where the travel is counted
from does not matter to a slope, and a rise that all spheres share changes neither a slope nor the
travel since the first was touched. At the heel: the spheres of the rigid heel block, and nothing in
series. In another shell (`model_file.in_shell`) these are the same spheres; the platen at the
forefoot, which is as long as it was, bears on a share of each, 1 / `shell_ratio`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.model.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.mechanism import LARGEST_KEEL_ANGLE
from vsf_drake.simulation.variables import check_number

LARGEST_DEPTH_M = 1.0
"""Depth of a foam beyond which it bears nothing worth the name: far more than a foot is thick, so
that a search may pass through feet that are much too soft."""
# least depth over the platen's travel since the first sphere that leaves a stiffness its digits
ROUNDING = 1e-9
MOST_ITERATIONS = 100
_WITHOUT_PART = ("friction.", "socket.", "offset.", "coordinate.", "perturbation.")
_LAW = {"stiffness": (1e-3, 1e30), "exponent": (1.0, 20.0), "rise": (-0.1, 0.1)}
"""Of a zone, with the values that mean something; those of the keel and the fulcrum likewise."""
_KEEL = {"keel.flexural_modulus": (1e6, 1e12), "fulcrum.stiffness": (1e-3, 1e30)}


class BenchStiffness:
    """A foot in the testing machine as a function of named variables: stiffness, mid-range
    displacement, derivatives.

    The names are those of a walk's variables. Of these contact.ZONE.stiffness, exponent and rise,
    keel.flexural_modulus and fulcrum.stiffness matter. The others are accepted, and all derivatives
    by them are zero: damping has no part at the testing machine's speed, fulcrum.shift is where the
    fulcrum was in a walk.

    `foot` has the values that hold where none is given; the forefoot is pressed at `fulcrums_m` (m
    from A), the heel if asked, to `max_load_n` (N).
    """

    def __init__(
        self,
        foot: FootParameters,
        *,
        fulcrums_m: Sequence[float],
        heel: bool,
        max_load_n: float = 600.0,
    ) -> None:
        if not STIFFNESS_ABOVE_N < max_load_n < math.inf:
            raise InputError(
                f"{max_load_n:g} N is no largest load for a slope",
                where="max_load_n",
                right=f"It must be more than {STIFFNESS_ABOVE_N:g} N",
            )
        self.loads_n = np.array([STIFFNESS_ABOVE_N, max_load_n, 0.5 * max_load_n])
        self.fulcrums_m = tuple(
            check_fulcrum(float(x), foot, where="fulcrums_m") for x in fulcrums_m
        )
        self.heel = heel
        reach = 0.5 * foot.series_patch_m
        self._foam = (
            _Foam(foot, lambda x: abs(x - foot.load_point_m) <= reach, 1.0 / foot.shell_ratio)
            if self.fulcrums_m
            else None
        )
        self._block = _Foam(foot, lambda x: x < foot.fulcrum.rearmost_m, 1.0) if heel else None
        self._foot = foot
        self._press = lru_cache(maxsize=1)(self._pressed)  # until modulus or support change
        self._names = [
            *_KEEL,
            *(f"contact.{zone.name}.{key}" for key in _LAW for zone in foot.zones),
        ]
        self._bounds = [*_KEEL.values(), *(bounds for bounds in _LAW.values() for _ in foot.zones)]
        self._default = np.array(
            [
                foot.keel.flexural_modulus_pa,
                foot.fulcrum.stiffness_n_per_m,
                *(zone.stiffness for zone in foot.zones),
                *(zone.exponent for zone in foot.zones),
                *(0.0 for _ in foot.zones),
            ]
        )
        self._damping = {
            f"contact.{zone.name}.{key}"
            for zone in foot.zones
            for key in ("damping", "full_damping_depth")
        }

    def evaluate(
        self, values: Mapping[str, float], with_respect_to: Sequence[str] = ()
    ) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness with these values of variables, all others as in the foot, and its derivatives.

        (m,) N/m: the forefoot at each fulcrum position, then the heel if asked; (m, P) derivatives
        per unit of each variable. SimulationError if the foot cannot bear the load.
        """
        travel, by, columns, _ = self._travel(values, with_respect_to)
        span = travel[:, 1] - travel[:, 0]
        stiffness = (self.loads_n[1] - self.loads_n[0]) / span
        return stiffness, _picked(-(stiffness / span)[:, None] * (by[:, 1] - by[:, 0]), columns)

    def displacement(
        self, values: Mapping[str, float], with_respect_to: Sequence[str] = ()
    ) -> tuple[np.ndarray, np.ndarray]:
        """Travel (m,) m since touch-down under half of the largest load, and (m, P) its
        derivatives; see `evaluate`.

        Where several zones are touched at once, the derivatives are those of the first one.
        """
        travel, by, columns, law = self._travel(values, with_respect_to)
        at = travel[:, 2]
        slope = by[:, 2].copy()
        rises = len(self._default) - law.shape[1]
        if self._foam is not None:
            slope[: len(self.fulcrums_m), rises + self._foam.touched_zone(law)] -= 1.0
        if self._block is not None:
            slope[-1, rises + self._block.touched_zone(law)] -= 1.0
        return at, _picked(slope, columns)

    def _travel(
        self, values: Mapping[str, float], with_respect_to: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray, list[int | None], np.ndarray]:
        """(m, L) m under each load; (m, L, N) its derivatives by all that matters, from a height
        that stays; columns of these for the names; (3, Z) law of the zones."""
        numbers = self._default.copy()
        for name, value in values.items():
            column = self._column(name, "values")
            number = check_number(value, f"values[{name!r}]")
            if column is not None:
                low, high = self._bounds[column]
                if not low <= number <= high:
                    raise InputError(
                        f"{number!r} is not usable",
                        where=f"values[{name!r}]",
                        right=f"It must be from {low:g} to {high:g}",
                    )
                numbers[column] = number
        columns = [self._column(name, "with_respect_to") for name in with_respect_to]
        law = numbers[2:].reshape(3, -1)
        travel = np.zeros((len(self.fulcrums_m) + self.heel, len(self.loads_n)))
        by = np.zeros((*travel.shape, len(numbers)))
        if self._foam is not None:
            rise, by_keel = self._press(float(numbers[0]), float(numbers[1]))
            foam, by_foam = self._foam.press(self.loads_n, law)
            count = len(rise)
            travel[:count], by[:count, :, :2], by[:count, :, 2:] = rise + foam, by_keel, by_foam
        if self._block is not None:
            travel[-1], by[-1, :, 2:] = self._block.press(self.loads_n, law)
        return travel, by, columns, law

    def _column(self, name: str, where: str) -> int | None:
        """Index into all that matters; None for what has no part."""
        if name in self._names:
            return self._names.index(name)
        if name in self._damping or name == "fulcrum.shift" or name.startswith(_WITHOUT_PART):
            return None
        raise InputError(
            f"there is no variable {name!r}",
            where=where,
            right=f"The bench knows: {', '.join(self._names)}",
        )

    def _pressed(self, modulus_pa: float, fulcrum_n_per_m: float) -> tuple[np.ndarray, np.ndarray]:
        """(f, L) m, rise of the load point, and (f, L, 2) its derivatives."""
        foot = replace(
            self._foot,
            keel=replace(self._foot.keel, flexural_modulus_pa=modulus_pa),
            fulcrum=replace(self._foot.fulcrum, stiffness_n_per_m=fulcrum_n_per_m),
        )
        rise = np.zeros((len(self.fulcrums_m), len(self.loads_n)))
        by = np.zeros((*rise.shape, 2))
        for (i, fulcrum), (k, load) in itertools.product(
            enumerate(self.fulcrums_m), enumerate(self.loads_n)
        ):
            try:
                shape = keel_shape(foot, fulcrum_m=fulcrum, load_n=float(load))
                if np.abs(shape.angles).max() > LARGEST_KEEL_ANGLE:
                    raise SimulationError(
                        f"a joint turns by more than {LARGEST_KEEL_ANGLE:g} rad", time_s=0.0
                    )
            except SimulationError as error:
                raise SimulationError(
                    f"the forefoot gives way under {self.loads_n[1]:g} N with the fulcrum at "
                    f"{1e3 * fulcrum:g} mm: {error.what}",
                    time_s=0.0,
                ) from error
            rise[i, k], by[i, k] = shape.load_point_K[1], shape.rise_by
        return rise, by


def _picked(every: np.ndarray, columns: Sequence[int | None]) -> np.ndarray:
    """(m, P) of these columns of (m, N), zero where there is none."""
    picked = np.zeros((len(every), len(columns)))
    for i, column in enumerate(columns):
        if column is not None:
            picked[:, i] = every[:, column] + 0.0  # no -0
    return picked


class _Foam:
    """Contact spheres pressed together by a flat platen, which bears on a `share` of each: those
    that are `pressed` by x in a shell of `shell_ratio` 1 (m from A)."""

    def __init__(
        self, foot: FootParameters, pressed: Callable[[float], bool], share: float
    ) -> None:
        spheres = [
            (z, 1e-3 * rise)
            for z, zone in enumerate(foot.zones)
            for x, rise in zip(zone.x_mm, zone.rise_mm, strict=True)
            if pressed(1e-3 * x / foot.shell_ratio)
        ]
        if not spheres:
            raise InputError(
                "no contact sphere lies where the testing machine presses", where="foot.zones"
            )
        self.zone = np.array([z for z, _ in spheres])
        self.height = np.array([rise for _, rise in spheres])
        self.of_zone = np.eye(len(foot.zones))[self.zone]
        self.share = share

    def touched_zone(self, law: np.ndarray) -> int:
        """Index of the zone whose sphere is touched first under this law (3, Z)."""
        return int(self.zone[np.argmin(self.height + law[2, self.zone])])

    def press(self, loads_n: np.ndarray, law: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,) m, travel of the platen under loads (n,) and (n, 3 Z) its derivatives by law (3, Z),
        row by row.

        Travel counts from the sphere that is touched first, its derivatives from a height that
        stays: in differences between loads it is all one.

        The load is convex and rises with the platen, and at the height at which one sphere alone
        bears it the spheres together bear no less: from there Newton's method descends to the root
        without passing it.
        """
        stiffness, exponent, rise = law[:, self.zone]
        stiffness = self.share * stiffness
        bottom = self.height + rise
        lowest = np.min(self.height + rise)
        with np.errstate(divide="ignore"):
            deepest = np.min(
                bottom - lowest + (loads_n[:, None] / stiffness) ** (1.0 / exponent), axis=1
            )
        if not np.all(deepest <= LARGEST_DEPTH_M):
            raise SimulationError(
                f"the foam bears less than {loads_n.max():g} N at {LARGEST_DEPTH_M:g} m", time_s=0.0
            )
        for _ in range(MOST_ITERATIONS):
            depth = np.maximum(deepest[:, None] - (bottom - lowest), 0.0)
            slope = np.where(depth > 0.0, exponent * stiffness * depth ** (exponent - 1.0), 0.0)
            force = stiffness * depth**exponent
            steep = slope.sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                change = (force.sum(axis=1) - loads_n) / steep
            if not np.all((np.abs(change) <= deepest) & (loads_n > ROUNDING * steep * deepest)):
                raise SimulationError(
                    "the foam is as good as rigid: how far it is pressed in is lost in rounding",
                    time_s=0.0,
                )
            deepest = deepest - change
            if np.all(np.abs(change) <= 1e-14 * deepest):
                break
        with np.errstate(divide="ignore", invalid="ignore"):
            by_exponent = np.where(depth > 0.0, force * np.log(depth), 0.0)
            by = np.hstack(
                [
                    self.share * depth**exponent @ self.of_zone,
                    by_exponent @ self.of_zone,
                    -slope @ self.of_zone,
                ]
            )
        return deepest, -by / steep[:, None]
