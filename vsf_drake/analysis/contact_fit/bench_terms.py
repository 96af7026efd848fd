"""The measured bench as residuals of a fit: a fitted foot shall still be the foot on the bench."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.analysis.contact_fit.mapping import TrialMap
from vsf_drake.analysis.contact_fit.parameters import FitParameters
from vsf_drake.analysis.contact_fit.terms import Term
from vsf_drake.bench_file import BenchMeasurement
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.variables import Variable

BENCH = "bench"
MID_RANGE = "mid-range displacement"


def bench_of(foot: FootParameters, bench: BenchMeasurement) -> BenchStiffness:
    """The machine that presses this foot as it was measured.

    Raises:
        InputError: the carriage of this foot does not reach a position.
    """
    return BenchStiffness(foot, fulcrums_m=bench.fulcrum_m, heel=bench.heel_stiffness_n_per_m is not None,
                          max_load_n=bench.max_load_n, mid_range=bench.mid_range_m is not None)


class BenchTerms:
    """The foot at the measured positions of the fulcrum, and its heel where that was measured: its stiffness, and its
    mid-range displacement where that was.

    Raises:
        InputError: the carriage of this foot does not reach a position.
    """

    def __init__(
        self, foot: FootParameters, bench: BenchMeasurement, parameters: FitParameters,
        variables: Mapping[str, Variable]
    ) -> None:
        self.bench = bench
        self._map = TrialMap(parameters, variables, None, None)
        self.measured = _joined(bench.stiffness_n_per_m, bench.heel_stiffness_n_per_m)
        self._machine = bench_of(foot, bench)

    def stiffness(self, u: np.ndarray) -> np.ndarray:
        """(m,) N/m of the model at u, in the order of `measured`. Raises SimulationError if it gives way."""
        return self._machine.evaluate(self._map.at(u).values)[0]

    def displacement(self, u: np.ndarray) -> np.ndarray:
        """(m,) m of mid-range displacement at u, in the same order. Raises ValueError if none was measured,
        SimulationError if the foot gives way."""
        return self._machine.displacement(self._map.at(u).values)[0]

    def terms(self, u: np.ndarray, *, derivatives: bool) -> list[Term]:
        """The residuals at u. Raises SimulationError if the foot gives way under the bench's load."""
        at, bench = self._map.at(u), self.bench
        names = at.names if derivatives else ()

        def term(name: str, pressed: tuple[np.ndarray, np.ndarray], measured: np.ndarray, sd: float) -> Term:
            value, by = pressed
            return Term(name=name, trial=BENCH, times_s=None, residual=(value - measured) / sd,
                        by=(by @ at.by if derivatives else np.zeros((len(value), 0))) / sd, weight=1.0)

        found = [term(BENCH, self._machine.evaluate(at.values, names), self.measured, bench.uncertainty_n_per_m)]
        if bench.mid_range_m is not None and bench.mid_range_uncertainty_m is not None:
            found.append(term(MID_RANGE, self._machine.displacement(at.values, names),
                              _joined(bench.mid_range_m, bench.heel_mid_range_m), bench.mid_range_uncertainty_m))
        return found


def _joined(forefoot: tuple[float, ...], heel: float | None) -> np.ndarray:
    return np.array([*forefoot, *([] if heel is None else [heel])])
