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


class BenchTerms:
    """Stiffness of the foot at the measured positions of the fulcrum, and of the heel where it was measured.

    Raises:
        InputError: the carriage of this foot does not reach a position.
    """

    def __init__(
        self, foot: FootParameters, bench: BenchMeasurement, parameters: FitParameters,
        variables: Mapping[str, Variable]
    ) -> None:
        self.bench = bench
        self._map = TrialMap(parameters, variables, None, None)
        heel = bench.heel_stiffness_n_per_m
        self.measured = np.array([*bench.stiffness_n_per_m, *([] if heel is None else [heel])])
        self._stiffness = BenchStiffness(foot, fulcrums_m=bench.fulcrum_m, heel=heel is not None,
                                         max_load_n=bench.max_load_n)

    def stiffness(self, u: np.ndarray) -> np.ndarray:
        """(m,) N/m of the model at u, in the order of `measured`. Raises SimulationError if it gives way."""
        return self._stiffness.evaluate(self._map.at(u).values)[0]

    def term(self, u: np.ndarray, *, derivatives: bool) -> Term:
        """The residuals at u. Raises SimulationError if the foot gives way under the bench's load."""
        at = self._map.at(u)
        stiffness, by = self._stiffness.evaluate(at.values, at.names if derivatives else ())
        sd = self.bench.uncertainty_n_per_m
        return Term(name=BENCH, trial=BENCH, times_s=None, residual=(stiffness - self.measured) / sd,
                    by=(by @ at.by if derivatives else np.zeros((len(stiffness), 0))) / sd, weight=1.0)
