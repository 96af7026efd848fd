"""The simulated testing machine as the validation uses it: pass by pass, in mm and N, loading or there and back."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.bench_metrics import mid_range_displacement, stiffness
from vsf_drake.analysis.validation.bench.shape import energy
from vsf_drake.analysis.validation.bench.statistics import up_to
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, STEPS_PER_MM, Bench

LOAD_N = 600.0
"""Largest load of a pass, where no measured curve says another."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """The platen up to a load and down again at one speed.

    Attributes:
        up_mm, up_n: (n,) loading, from (0, 0).
        down_mm, down_n: (m,) unloading, in order: the displacement falls.
        loading_s: duration of the loading.
        unconverged_steps: accepted without convergence; the energies are then doubtful.
    """

    up_mm: np.ndarray
    up_n: np.ndarray
    down_mm: np.ndarray
    down_n: np.ndarray
    loading_s: float
    unconverged_steps: int

    @property
    def stored_j(self) -> float:
        """Work of the platen on the foot while it loads."""
        return 1e-3 * energy(self.up_mm, self.up_n)

    @property
    def returned_j(self) -> float:
        """Work of the foot on the platen while it unloads."""
        return -1e-3 * energy(np.append(self.up_mm[-1], self.down_mm), np.append(self.up_n[-1], self.down_n))


class Machine:
    """One foot in the testing machine; forefoot and heel are built when they are first pressed."""

    def __init__(self, foot: FootParameters) -> None:
        self.foot = foot
        self._benches: dict[bool, Bench] = {}

    def press(
        self, fulcrum_m: float | None, load_n: float = LOAD_N, speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Displacement (mm) and load (N) from (0, 0) to exactly `load_n`, and how many steps did not converge.

        Args:
            fulcrum_m: m from A; None for the heel.

        Raises:
            InputError, SimulationError: see `simulation.bench.Bench.press`.
        """
        setting = self._bench(fulcrum_m).press(
            fulcrum_m=self._carriage(fulcrum_m), max_load_n=load_n, speed_m_per_s=speed_m_per_s)
        x, load = from_touch(setting.platen_m, setting.load_n)
        return *up_to(x, load, load_n), setting.unconverged_steps

    def loop(
        self, fulcrum_m: float | None, load_n: float, speed_m_per_s: float, *, steps_per_mm: float = STEPS_PER_MM
    ) -> Loop:
        """Up to where the load is reached at this speed, and down to touch-down at the same.

        The platen's speed jumps at the top and viscous forces with it: the loading's last load is extrapolated from
        the two steps before.

        Raises:
            InputError, SimulationError: see `press`.
        """
        top = 1e-3 * float(self.press(fulcrum_m, load_n, speed_m_per_s)[0][-1])
        steps = int(np.ceil(top * 1e3 * steps_per_mm))
        way = np.linspace(0.0, top, steps + 1)
        platen = np.concatenate((way, way[-2::-1]))
        setting = self._bench(fulcrum_m).follow(
            fulcrum_m=self._carriage(fulcrum_m), time_s=np.linspace(0.0, 2.0 * top / speed_m_per_s, 2 * steps + 1),
            platen_m=platen)
        x, load = from_touch(setting.platen_m[:steps], setting.load_n[:steps])
        load[-1] = 2.0 * load[-2] - load[-3]
        return Loop(up_mm=x, up_n=load, down_mm=1e3 * setting.platen_m[steps:], down_n=setting.load_n[steps:],
                    loading_s=top / speed_m_per_s, unconverged_steps=setting.unconverged_steps)

    def _bench(self, fulcrum_m: float | None) -> Bench:
        heel = fulcrum_m is None
        if heel not in self._benches:
            self._benches[heel] = Bench(self.foot, heel=heel)
        return self._benches[heel]

    def _carriage(self, fulcrum_m: float | None) -> float:
        return self.foot.fulcrum.rearmost_m if fulcrum_m is None else fulcrum_m


def from_touch(platen_m: np.ndarray, load_n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A simulated pass in mm and N with its touch-down, (0, 0), before the end of its first step."""
    return np.concatenate(([0.0], 1e3 * platen_m)), np.concatenate(([0.0], load_n))


def moved_load(foot: FootParameters, load_point_m: float) -> FootParameters:
    """The foot with its load point elsewhere (m from A); the foam under it stays as it is."""
    return dataclasses.replace(foot, load_point_m=load_point_m)


def stiffness_n_per_mm(x: np.ndarray, load: np.ndarray, where: str) -> float:
    """Mean slope above 200 N of a curve in mm and N (`analysis.bench_metrics.stiffness`)."""
    return 1e-3 * stiffness(1e-3 * x, load, where=where)


def mid_range_mm(x: np.ndarray, load: np.ndarray, where: str) -> float:
    """Displacement at half of the largest load (`analysis.bench_metrics.mid_range_displacement`)."""
    return 1e3 * mid_range_displacement(1e-3 * x, load, where=where)
