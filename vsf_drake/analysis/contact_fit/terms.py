"""What a fit compares: one trial's walk against its plate, as named series of residuals with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import Comparison, compare, compare_sensitivity
from vsf_drake.analysis.contact_fit.mapping import TrialMap
from vsf_drake.analysis.contact_fit.parameters import FitParameters
from vsf_drake.analysis.contact_fit.recordings import COP, FORCES, RESULTANT, FitNoise
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walker

STRIDE = 4
"""Every fourth instant of a series at 500 Hz, every fourth percent of a stance: they are no more independent."""
_LEAST_RESULTANT_N = 1.0
"""Below this a resultant's direction, and with it its derivative, means nothing."""


@dataclass(frozen=True, eq=False)
class Term:
    """One series of residuals.

    Attributes:
        name: of the series, as in `FitNoise`. trial: label of the trial, or "bench" or "prior".
        times_s: (n,) s, when each was measured; None where errors are independent of each other.
        residual: (n,) model minus measurement in standard deviations.
        by: (n, P) by the search coordinates; P = 0 where no derivatives were asked for.
        weight: of each in the cost, see `FitNoise.weight`.
    """

    name: str
    trial: str
    times_s: np.ndarray | None
    residual: np.ndarray
    by: np.ndarray
    weight: float


class TrialTerms:
    """The residuals of one trial.

    Args:
        walker: of the subject; shared by trials. trial, label, map: the recording and the parameters' part in it.
        series: names of `recordings.SERIES` that are compared.
    """

    def __init__(
        self, walker: Walker, trial: Trial, label: str, trial_map: TrialMap, *, noise: FitNoise, series: Sequence[str],
        step_s: float
    ) -> None:
        self.walker, self.trial, self.label, self.map = walker, trial, label, trial_map
        self.noise, self.series, self.step_s = noise, tuple(series), step_s
        self._weight_n = trial.subject.mass_kg * GRAVITY

    def walk(
        self, u: np.ndarray, *, derivatives: bool = False, step_s: float | None = None, fulcrum_m: float | None = None
    ) -> tuple[Comparison, WalkResult, np.ndarray | None, tuple[np.ndarray, ...]]:
        """The trial's walk at u beside its plate, and by u: (n, 3, P) N of the force and (101, 2, P) m of each CoP.

        Raises:
            SimulationError: the walk diverges.
        """
        trial, at = self.trial, self.map.at(u)
        walk = self.walker.walk(
            trial.trajectory, fulcrum_m=trial.fulcrum_m if fulcrum_m is None else fulcrum_m, start_s=trial.start_s,
            end_s=trial.end_s, step_s=step_s or self.step_s, offsets=trial.offsets, values=at.values,
            with_respect_to=at.names if derivatives else (), courses=self.map.courses)
        result = self.walker.result(walk, trial, trial.offsets, energy=False)
        comparison = compare(result, trial.prosthetic_plate)
        if not derivatives:
            return comparison, result, None, ()
        assert walk.sensitivity is not None
        by = compare_sensitivity(comparison, result, walk.sensitivity)
        return comparison, result, by.model @ at.by, tuple(cop @ at.by for cop in by.cop)

    def terms(self, u: np.ndarray, *, derivatives: bool) -> list[Term]:
        """The residuals at u. Raises SimulationError if the walk diverges."""
        c, result, force_by, cop_by = self.walk(u, derivatives=derivatives)
        rows = np.flatnonzero(c.scored)[:: max(1, round(STRIDE * 2e-3 / c.step_s))]
        times, model, measured = c.time_s[rows], c.model[rows], c.measured[rows]
        none = np.zeros((len(rows), 3, 0))
        by = none if force_by is None else force_by[rows]
        found = []
        for name in self.series:
            if name in FORCES:
                i = FORCES.index(name)
                found.append(self._term(name, times, (model - measured)[:, i] / self._weight_n,
                                        by[:, i] / self._weight_n))
            elif name == RESULTANT:
                sizes = np.linalg.norm(model, axis=1), np.linalg.norm(measured, axis=1)
                way = model / np.maximum(sizes[0], _LEAST_RESULTANT_N)[:, None]
                found.append(self._term(name, times, (sizes[0] - sizes[1]) / self._weight_n,
                                        np.einsum("ni,nip->np", way, by) / self._weight_n))
        for name in self.series:
            if name in COP:
                for i, stance in enumerate(c.stances):
                    error = (stance.model_cop - stance.measured_cop)[::STRIDE, COP.index(name)] / result.foot_length_m
                    slope = cop_by[i][::STRIDE, COP.index(name)] / result.foot_length_m if cop_by else \
                        np.zeros((len(error), 0))
                    instants = np.linspace(stance.measured.start_s, stance.measured.end_s, len(error))
                    # Where either foot is not loaded there is no centre to compare; the force says so.
                    found.append(self._term(name, instants, np.nan_to_num(error), np.nan_to_num(slope)))
        return found

    def _term(self, name: str, times: np.ndarray, error: np.ndarray, by: np.ndarray) -> Term:
        sd = getattr(self.noise, name)
        spacing = float(np.median(np.diff(times))) if len(times) > 1 else 2.0 * self.noise.correlation_s
        return Term(name=name, trial=self.label, times_s=times, residual=error / sd, by=by / sd,
                    weight=self.noise.weight(spacing))


# The measured bench as residuals of a fit: a fitted foot shall still be the foot on the bench.


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
