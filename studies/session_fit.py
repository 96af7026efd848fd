"""What the contact fit, as it is, reaches on the synthetic persons of data/sessions, recorded as people are.

Per person one fit of the softest and the stiffest first trial at 1.1 m/s with the person's own bench curves, nothing
else told: judged by all other trials of the session, by the other speeds where they have been made (--data), and for A
by the session of another day, measured anew. The passive foot of C is fitted to two trials of three without a bench.
Beside each error stand the null model (the measured curve of a fitted trial, stretched) and the floors of
data/sessions/README.md. The results are in studies/results/session_fit.json; finished fits are kept beside the figures
of the other study until the data or the sources change. About two minutes a fit.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import kept, made_by
from floor_of_the_reference_subject import NOMINAL, RESULTS, hashes
from make_reference_subject import DATA as REFERENCE
from make_sessions import DATA, EMBEDDED

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions, assess, solve
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution
from vsf_drake.analysis.metrics import WalkMetrics, stance_curve, walk_metrics
from vsf_drake.analysis.validation.bench_lines import load_measured_bench
from vsf_drake.errors import FitError, SimulationError
from vsf_drake.files import sha256, write_json
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.simulation.walk import Walker

PARTS = Path("results/session_fit")
SEED = 0
METRICS = ("grf_rmse_bw", "null_model_grf_rmse_bw", "vertical_rmse_bw", "fore_aft_rmse_bw", "medio_lateral_rmse_bw",
           "cop_rmse_fl", "cop_ml_rmse_fl")
QUICK = {"starts": 1, "tolerance": 0.01, "step_s": 8e-3, "report_step_s": 8e-3}
FITTED, SAME, UNSEEN, SPEED, DAY = "fitted", "same setting", "unseen setting", "another speed", "another day"
FLOORS = ("floor_bw", "own_floor_bw")
SEEN_ON_PEOPLE = {"held_out_grf_rmse_bw": (0.04, 0.09), "null_model_grf_rmse_bw": (0.02, 0.05)}
"""What fits like these were left with on recordings of people, from and to; those recordings are not kept here."""


@dataclass(frozen=True)
class Case:
    """One fit: trials of a session by name in its folder of the embedded speed; the others judge it."""

    person: str
    day: int
    fitted: tuple[str, str]

    @property
    def session(self) -> str:
        return f"{self.person}/day_{self.day}"

    @property
    def name(self) -> str:
        return f"{self.person}_day_{self.day}" + "_passive" * self.passive

    @property
    def passive(self) -> bool:
        return self.fitted[0].startswith("passive")


PAIR, PASSIVE = ("low_1", "high_1"), ("passive_1", "passive_2")
CASES = (Case("a", 1, PAIR), Case("a", 2, PAIR), Case("b", 1, PAIR), Case("c", 1, PAIR), Case("c", 1, PASSIVE))


def main() -> None:
    """Fits every person, prints a table and writes session_fit.json."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the sessions; with other speeds they judge")
    parser.add_argument("--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick or --data is given")
    parser.add_argument("--workers", type=int, default=2, help="processes, a fit each")
    parser.add_argument("--quick", action="store_true", help="one person, coarsely, two trials judge; needs --out")
    arguments = parser.parse_args()
    if not arguments.out and (arguments.quick or arguments.data != DATA):
        parser.error("a part of the study, or one of other data, must not replace it: give --out")
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    cases = CASES[:1] if arguments.quick else CASES
    parts = (arguments.out or PARTS) / "parts"
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(done, [(case, arguments.data, parts, arguments.quick) for case in cases]))
    fits = dict(zip([case.name for case in cases], found, strict=True))
    inputs: dict[str, str] = {}
    for part in found:
        inputs |= part.pop("inputs")
    write_json(out / "session_fit.json", {
        "synthetic": True, "definitions": __doc__, "seen_on_people": SEEN_ON_PEOPLE, "fits": fits,
        "provenance": {**provenance(inputs, SEED), "sources": made_by("session_fit.py")}})
    print(text_table(fits))


def done(task: tuple[Case, Path, Path, bool]) -> dict[str, Any]:
    """The case's part, made now unless it was made before of the same files by the same sources."""
    case, data, parts, quick = task
    began = time.perf_counter()
    inputs = {NOMINAL: sha256(REFERENCE / NOMINAL)}
    for trial in [*judging(case, data), *(read(data, case, name) for name in case.fitted)]:
        inputs |= hashes(trial)
    if not case.passive:
        inputs |= {f"../sessions/{case.person}/bench_curves.csv": sha256(data / case.person / "bench_curves.csv")}
    key = digest({"case": asdict(case), "quick": quick, **provenance(inputs), **made_by("session_fit.py")})
    part, _ = kept(parts, case.name, key, lambda: run(case, data, quick))
    print(f"{case.name} ({time.perf_counter() - began:.0f} s)", flush=True)
    return {**part, "inputs": inputs}


def run(case: Case, data: Path, quick: bool) -> dict[str, Any]:
    """Fits and judges; a fit that fails is told as such."""
    told: dict[str, Any] = {"fitted": list(case.fitted), "bench": not case.passive}
    problem, own = fit_of(case, data, quick), judging(case, data)
    if quick:
        own = own[:2]
    here = [trial for trial in own if trial.subject == problem.trials[0].subject]
    try:
        solution = solve(problem)
        if not solution.success:
            return {**told, "converged": False, "ended": solution.message}
        judged = assess(solution, here, sweep=False, leave_out=False, angle_errors=False)
    except (FitError, SimulationError) as error:
        return {**told, "converged": False, "ended": str(error)}
    metrics = [score.metrics for score in judged.scores] + [
        walked(solution, trial) for trial in own if trial not in here]
    every = [*problem.trials, *here, *(trial for trial in own if trial not in here)]
    trials = {path_in(data, trial): row(case, data, trial, found)
              for trial, found in zip(every, metrics, strict=True)}
    return {**told, "converged": True, "ended": solution.message, "wall_s": solution.wall_s,
            "values": solution.values, "bench_rmse_n_per_mm": judged.bench and judged.bench.stiffness
            and judged.bench.stiffness.rmse, "trials": trials, "mean": means(trials)}


def fit_of(case: Case, data: Path, quick: bool = False) -> ContactFit:
    """The fit as `vsf-drake fit` makes it of two trials and curves."""
    bench = None if case.passive else load_measured_bench(data / case.person / "bench_curves.csv")
    return ContactFit([read(data, case, name) for name in case.fitted], bench=bench,
                      options=ContactFitOptions(seed=SEED, **(QUICK if quick else {})))


def walked(solution: ContactFitSolution, trial: Trial) -> WalkMetrics:
    """A trial of another day, whose person was measured anew, with the fitted contact."""
    fitted = trial_with(trial, solution.contact())
    walker, step_s = Walker(fitted.subject, fitted.model), solution.fit.options.report_step_s
    walk = walker.walk(fitted.trajectory, fulcrum_m=fitted.fulcrum_m, start_s=fitted.start_s, end_s=fitted.end_s,
                       offsets=fitted.offsets, step_s=step_s)
    result = walker.result(walk, fitted, fitted.offsets, energy=False)
    comparison = compare(result, trial.prosthetic_plate)
    nulls = [stance_curve(one.prosthetic_plate, subject_mass_kg=one.subject.mass_kg) for one in solution.fit.trials]
    return min((walk_metrics(result, trial.prosthetic_plate, comparison=comparison, null_curve=curve)
                for curve in nulls if curve is not None), key=lambda found: found.null_model_grf_rmse_bw or 0.0)


def judging(case: Case, data: Path) -> list[Trial]:
    """What judges: the other trials with this foot, of all days and speeds of this person that are there."""
    files = sorted((data / case.person).glob("day_*/*/*.yaml"))
    own = {data / case.session / EMBEDDED / f"{name}.yaml" for name in case.fitted}
    return [load_trial(file) for file in files if file not in own and file.stem.startswith("passive") == case.passive]


@cache
def read(data: Path, case: Case, name: str) -> Trial:
    return load_trial(data / case.session / EMBEDDED / f"{name}.yaml")


def path_in(data: Path, trial: Trial) -> str:
    """Of a trial in the sessions' folder, without its suffix."""
    return trial.path.resolve().relative_to(data.resolve()).with_suffix("").as_posix()


def row(case: Case, data: Path, trial: Trial, metrics: WalkMetrics) -> dict[str, Any]:
    """A trial's numbers, and what it is to the fit."""
    path = path_in(data, trial)
    person_day, speed, name = path.rsplit("/", 2)
    role = (DAY if person_day != case.session else SPEED if speed != EMBEDDED else FITTED if name in case.fitted
            else SAME if name[:-1] in {one[:-1] for one in case.fitted} else UNSEEN)
    return {"role": role, "fulcrum_mm": round(1e3 * trial.fulcrum_m, 6),
            **{name: getattr(metrics, name) for name in METRICS}, **floors(data).get(path, {})}


@cache
def floors(data: Path) -> dict[str, dict[str, float]]:
    """By trial, from figures.csv."""
    with (data / "figures.csv").open(encoding="utf-8") as lines:
        rows = csv.DictReader(line for line in lines if not line.startswith("#"))
        return {row["trial"]: {name: float(row[name]) for name in FLOORS} for row in rows}


def means(trials: dict[str, dict[str, Any]]) -> dict[str, dict[str, float]]:
    """By role, and over all that were held out on this day at this speed ("held out")."""
    roles: dict[str, Sequence[str]] = {role: (role,) for role in (FITTED, SAME, UNSEEN, SPEED, DAY)}
    found = {}
    for name, of in {**roles, "held out": (SAME, UNSEEN)}.items():
        rows = [row for row in trials.values() if row["role"] in of]
        if rows:
            found[name] = {"n": len(rows), **{
                key: float(np.mean(known)) for key in (*METRICS, *FLOORS)
                if (known := [row[key] for row in rows if row.get(key) is not None])},
                "beats_null": sum(row["grf_rmse_bw"] < row["null_model_grf_rmse_bw"] for row in rows
                                  if row["null_model_grf_rmse_bw"] is not None)}
    return found


def text_table(fits: dict[str, dict[str, Any]]) -> str:
    """Lines for the screen: % body weight, centre of pressure % foot length."""
    columns = {"grf_rmse_bw": "error", "null_model_grf_rmse_bw": "null", "own_floor_bw": "own floor",
               "cop_rmse_fl": "CoP", "cop_ml_rmse_fl": "CoP lateral"}
    lines = [f"{'fit':<18}{'judged by':<16}{'n':>4}{'beat null':>11}" + "".join(f"{t:>13}" for t in columns.values())]
    for name, part in fits.items():
        if not part["converged"]:
            lines.append(f"{name:<18}FAILED: {part['ended']}")
        for role, mean in part.get("mean", {}).items():
            lines.append(f"{name:<18}{role:<16}{mean['n']:>4}{mean['beats_null']:>11}" + "".join(
                f"{100 * mean[key]:>13.1f}" if key in mean else f"{'-':>13}" for key in columns))
    return "\n".join(lines)


if __name__ == "__main__":
    main()
