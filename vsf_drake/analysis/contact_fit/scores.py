"""What `table.assess` finds about a fit, and that in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import rmse
from vsf_drake.analysis.contact_fit.paper_solution import PaperSolution
from vsf_drake.analysis.contact_fit.parameters import owner
from vsf_drake.analysis.contact_fit.solution import ALIKE, ContactFitSolution
from vsf_drake.analysis.contact_fit.solve import SURE_SHARE


@dataclass(frozen=True, kw_only=True)
class FulcrumSweep:
    """Error over the fulcrum's position.

    Attributes:
        fulcrum_m: (n,) m. grf_rmse_bw: (n,) resultant, BW; NaN where the walk fails.
        true_m: where it stood. best_m: where the error is lowest, by the parabola through the three lowest points.
        at_end: whether it stood at an end of its range, so that an error outwards could not show.
        right: whether best_m is within `table.RIGHT_WITHIN_M` of it.
    """

    fulcrum_m: tuple[float, ...]
    grf_rmse_bw: tuple[float, ...]
    true_m: float
    best_m: float
    at_end: bool
    right: bool


@dataclass(frozen=True, kw_only=True)
class TrialScore:
    """One trial under a fit.

    Attributes:
        role: "fitted" or "held out".
        metrics: of `analysis.metrics.walk_metrics`, the null model among them (None without another fitted trial).
        curves: time_s, model_bw and measured_bw (n, 3), cop_measured_fl and cop_model_fl (101,) of the first stance.
        floor_grf_rmse_bw: what the true foot would be left with on this recording's motion, where that is known.
    """

    label: str
    role: str
    fulcrum_m: float
    metrics: Mapping[str, Any]
    curves: Mapping[str, np.ndarray]
    sweep: FulcrumSweep | None
    floor_grf_rmse_bw: float | None = None


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A fit without some of its trials, judged by them.

    Attributes:
        kind: "trial" or "stiffness". left_out: labels. failed: why there is no score, or "".
        grf_rmse_bw, cop_rmse_fl: means over them; None if the fit failed or nothing is left to fit.
    """

    kind: str
    left_out: tuple[str, ...]
    grf_rmse_bw: float | None
    cop_rmse_fl: float | None
    failed: str = ""


@dataclass(frozen=True, kw_only=True)
class MidRangeScore:
    """Mid-range displacement of model and measurement on the bench, mm; the heel's apart, None if not measured."""

    measured_mm: tuple[float, ...]
    model_mm: tuple[float, ...]
    heel_measured_mm: float | None
    heel_model_mm: float | None

    @property
    def rmse_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_mm), np.array(self.measured_mm))


@dataclass(frozen=True, kw_only=True)
class BenchScore:
    """Model and measurement on the bench, N/mm; the heel's apart, None where it was not measured. `mid_range`: None
    where no displacement was measured."""

    fulcrum_mm: tuple[float, ...]
    measured_n_per_mm: tuple[float, ...]
    model_n_per_mm: tuple[float, ...]
    heel_measured_n_per_mm: float | None
    heel_model_n_per_mm: float | None
    mid_range: MidRangeScore | None = None

    @property
    def rmse_n_per_mm(self) -> float:
        """Of the forefoot."""
        return rmse(np.array(self.model_n_per_mm), np.array(self.measured_n_per_mm))


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that speaks for and against a fit."""

    scores: tuple[TrialScore, ...]
    left_out: tuple[LeftOut, ...]
    bench: BenchScore | None

    def mean(self, role: str, key: str) -> float | None:
        """Mean of a metric over the trials of a role; None where there is none."""
        values = [s.metrics[key] for s in self.scores if s.role == role and s.metrics[key] is not None]
        return float(np.mean(values)) if values else None


# A fit's worth in sentences, each with the numbers it comes from.


PAPER_BW = 0.053
"""Resultant error of McGeehan 2021 (doi 10.1115/1.4050456) on its fitted trial; 0.10 to 0.14 on others."""
PAPER_BENCH_N_PER_MM, PAPER_MID_RANGE_MM = 1.37, 0.45
NOISE_TOO_SMALL = 1.2
"""Residuals larger than this many times what was assumed mean that errors are told too small (a choice; with noise as
assumed half of all series stay below 0.7, since the parameters take up some of it and swing has none)."""


def verdict(solution: ContactFitSolution | PaperSolution, assessment: Assessment) -> tuple[str, ...]:
    """What to make of a fit that succeeded: how it ended, what it predicts, what it cannot know."""
    fitted, held = assessment.mean("fitted", "grf_rmse_bw"), assessment.mean("held out", "grf_rmse_bw")
    assert fitted is not None
    said = [f"The fitted trials are left with {_percent(fitted)} body weight (resultant, root mean square); "
            f"the paper's fitted trial with {_percent(PAPER_BW)}."]
    settings = {trial.fulcrum_m for trial in solution.trials}
    if len(settings) == 1:
        said.append("All fitted trials have one fulcrum position: one stiffness does not identify the model, and what "
                    "it predicts at others is not to be trusted before it has been seen to.")
    fitted_too = not isinstance(solution, PaperSolution)
    said += [*_held_out(assessment, held), *_left_out(assessment), *_sweep(assessment), *_bench(assessment, fitted_too)]
    if isinstance(solution, PaperSolution):
        return (*said, "Fitted by the paper's procedure, to the resultant force alone: it knows neither centre of "
                       "pressure nor bench, and tells nothing of what its data identify. It ended so: "
                       f"{solution.message}.")
    return (*said, *_noise(solution), *_identified(solution), *_starts(solution))


def _held_out(assessment: Assessment, held: float | None) -> list[str]:
    if held is None:
        return ["No trial was held out: how far the fit carries over to others is not known."]
    scores = [s for s in assessment.scores if s.role == "held out"]
    worst = max(scores, key=lambda s: s.metrics["grf_rmse_bw"])
    said = [f"{len(scores)} held-out trial{'s' * (len(scores) > 1)}: {_percent(held)} body weight on average, at worst "
            f"{_percent(worst.metrics['grf_rmse_bw'])} ({worst.label})."]
    beaten = [s.label for s in scores if s.metrics["null_model_grf_rmse_bw"] is not None
              and s.metrics["grf_rmse_bw"] >= s.metrics["null_model_grf_rmse_bw"]]
    nulls = [s.metrics["null_model_grf_rmse_bw"] for s in scores if s.metrics["null_model_grf_rmse_bw"] is not None]
    if nulls:
        said.append("The best of the fitted trials' measured curves, stretched to the held-out stances, is "
                    f"{_percent(sum(nulls) / len(nulls))} off on average. Of a held-out trial's plate the model knows "
                    "when the foot was on the ground, no more.")
    if beaten:
        said.append("No better than a stretched measured curve without any model: " + ", ".join(beaten) + ".")
    below = [s.label for s in assessment.scores if s.floor_grf_rmse_bw is not None
             and s.metrics["grf_rmse_bw"] < s.floor_grf_rmse_bw]
    if below:
        said.append("Below what the true foot itself would be left with on this recorded motion, so that some of the "
                    "recording's noise was fitted, or its errors happen to cancel: " + ", ".join(below) + ".")
    return said


def _left_out(assessment: Assessment) -> list[str]:
    said = []
    alone = {row.left_out for row in assessment.left_out if row.kind == "trial"}
    for kind, what in (("trial", "each trial"), ("stiffness", "each stiffness")):
        rows = [row for row in assessment.left_out if row.kind == kind]
        if kind == "stiffness" and {row.left_out for row in rows} == alone:
            continue
        errors = [row.grf_rmse_bw for row in rows if row.grf_rmse_bw is not None]
        if errors:
            said.append(f"Fitted without {what} in turn, the one left out is predicted within {_percent(min(errors))} "
                        f"to {_percent(max(errors))} body weight.")
        failed = [", ".join(row.left_out) for row in rows if row.failed]
        if failed:
            said.append(f"The fit without {'; '.join(failed)} failed.")
    return said


def _sweep(assessment: Assessment) -> list[str]:
    sweeps = [s for s in assessment.scores if s.sweep is not None]
    if not sweeps:
        return []
    right = [s for s in sweeps if s.sweep is not None and s.sweep.right]
    inside = sum(s.sweep is not None and not s.sweep.at_end for s in sweeps)
    said = ["Moved over its range, the fulcrum fits best where it really stood in "
            f"{len(right)} of {len(sweeps)} trials; {inside} of them could have erred to both sides, the others' "
            "fulcrum stood at an end of its range."]
    for s in sweeps:
        if s.sweep is not None and not s.sweep.right:
            known = s.sweep.best_m == s.sweep.best_m
            best = f"at {1e3 * s.sweep.best_m:.0f} mm" if known else "nowhere, for every walk failed"
            said.append(f"{s.label}: the fulcrum fits best {best}, but stood at {1e3 * s.sweep.true_m:.0f} mm.")
    return said


def _bench(assessment: Assessment, fitted_too: bool) -> list[str]:
    bench = assessment.bench
    if bench is None:
        return ["No bench was given: whether this is still the foot of the bench is not known."]
    error = bench.rmse_n_per_mm
    still = "still the foot of the bench" if error <= PAPER_BENCH_N_PER_MM else "another foot"
    heel = ""
    if bench.heel_model_n_per_mm is not None and bench.heel_measured_n_per_mm is not None:
        heel = f", its heel {bench.heel_model_n_per_mm - bench.heel_measured_n_per_mm:+.2f} N/mm"
    known = "to which it was fitted too" if fitted_too else "which it was not fitted to"
    return [f"On the bench, {known}, the forefoot is {error:.2f} N/mm off (root mean square; the paper's model "
            f"{PAPER_BENCH_N_PER_MM} N/mm){heel}: {still}.", *_mid_range(bench)]


def _mid_range(bench: BenchScore) -> list[str]:
    score = bench.mid_range
    if score is None:
        return []
    reached = "as near as" if score.rmse_mm <= PAPER_MID_RANGE_MM else "farther off than"
    heel = "" if score.heel_model_mm is None or score.heel_measured_mm is None else \
        f" The heel's is {score.heel_model_mm - score.heel_measured_mm:+.2f} mm off."
    return [f"Under half of the bench's largest load the forefoot's displacement is {score.rmse_mm:.2f} mm off (root "
            f"mean square), {reached} the paper's model ({PAPER_MID_RANGE_MM} mm).{heel}"]


def _noise(solution: ContactFitSolution) -> list[str]:
    ratios = solution.noise_ratios()
    large = [f"{term.trial} {term.name} ({ratio:.1f} times)" for term, ratio in ratios if ratio > NOISE_TOO_SMALL]
    least, most = min(ratio for _, ratio in ratios), max(ratio for _, ratio in ratios)
    said = ["Errors and intervals hold for a right model and the noise that was assumed; what another foot shifts is "
            f"not in them. Residuals are {least:.1f} to {most:.1f} times that noise."]
    if large:
        said.append("Larger than assumed, so that errors and intervals are told too small: " + ", ".join(large) + ".")
    return said


def _identified(solution: ContactFitSolution) -> list[str]:
    u = solution.uncertainty
    shared = [name for name in u.names if owner(name) is None]
    known = [name for name in shared if name not in u.unidentified]
    said = [f"{len(known)} of {len(shared)} free parameters that all trials share are told by the data (standard error "
            f"below {SURE_SHARE:g} of what was believed before); {sum(s < 1.0 for s in u.singular_values)} directions "
            "are told less than by the prior."]
    own = [name for name in u.unidentified if not name.startswith(("curve.", "trial."))]
    if own:
        said.append("Not identified, mostly what was believed before: " + ", ".join(own) + ".")
    if u.at_bound:
        said.append("Ended at a bound, their errors mean nothing: " + ", ".join(u.at_bound) + ".")
    pairs = [f"{a} and {b} ({c:+.2f})" for a, b, c in u.together if owner(a) is None and owner(b) is None]
    if pairs:
        said.append("Known only together: " + ", ".join(pairs[:5]) + ".")
    return said


def _starts(solution: ContactFitSolution) -> list[str]:
    ended = [s for s in solution.searches if s.success]
    lowest = solution.searches[solution.best].cost
    alike = [s for s in ended if s.cost <= lowest + ALIKE]
    lost = len(solution.searches) - len(ended)
    said = [f"{len(alike)} of {len(solution.searches)} searches ended alike (cost within {ALIKE:g} of {lowest:.1f})."
            + (f" {lost} did not converge." if lost else "")]
    better = [s for s in solution.searches if not s.success and s.cost < lowest - ALIKE]
    if better:
        said.append(f"A search that did not converge got to a lower cost, {min(s.cost for s in better):.1f}: allow "
                    "more iterations.")
    return said


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
