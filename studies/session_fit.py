"""What the contact fit, as it is, reaches on the synthetic persons of data/sessions, recorded as
people are.

Per person one fit of the softest and the stiffest first trial at 1.1 m/s with the person's own
bench curves, nothing else told: judged by all other trials of the session, for C by 0.9 and
1.4 m/s, for all by the other speeds where they have been made (--data), and for A by the session of
another day, measured anew. The
passive foot of C is fitted to two trials of three without a bench. Every trial is predicted in
three layers (physics, the person's own momentum, the person's own curve), without its plate, the
held-out ones of the session also with errors of hip and knee of their own. Beside each error stand
the null model (vsf_drake/walks/null_model.py: the measured curves of the fitted trials,
interpolated between their settings and stretched to the measured times of stance; of the passive
foot, which has one setting, the nearest single one), the same stretched to the times that the
physics predicts, the nearest single curve, and the floors of data/sessions/README.md.
`against_null` counts the walks and the sessions in which each layer is nearer than the null model.
`measured_times_grf_rmse_bw` is the third layer's error over the measured times of stance. `phases`
has its means held out by phase of stance and component. `weights` has A's and B's mean errors held
out by the shares of need and of the vertical model in the third layer
(vsf_drake/walks/person_curve.py), which were chosen by them, and the error of each with the other's
best. `intervals_hold` is of curves of six walks, two of each setting: the share of the instants of
the other three in the 80 % interval, each number left out in turn. `third_person` has C's means by
the layer that C's held-out trials earn, and by each.

The first day's fits of A, B and C are made with ten seeds, which draw where the searches begin:
`fits` of these `converged`. `ends` tells how far apart the ten end. Ten seeds fit the same data, so
that `intervals` counts three persons: how many true values lie in the 95 % intervals, of how the
foot sits, and of the constant errors of hip flexion, hip adduction and knee
(virtual_laboratory/truth.py has what these are of, and what has no truth), apart for those that a
fit identifies (standard error at most half of the prior's) and those that it does not, where the
interval is nearly the prior's. `binomial_95` takes the intervals for independent, which those of
one person are not. `contained` is of the true segments; `contained_as_found` of what is wrong
beyond what a session gives back: it lays the pelvis's path so that the ankle is right, and measures
the foot in the shank as found, so that the recorded motion carries the foot nearly right where all
its angles and joint centres are wrong.

The results are in studies/results/session_fit.json; finished fits are kept beside the figures of
the other study until the data or the sources change, with C's walks at the other speeds, which are
made at first (a quarter of an hour). About two minutes a fit that is judged, less of one that is
not. `--judge-again` keeps the stored fits and judges them anew, if the foot's
physics gives the stored errors still.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.binomial import counted
from contact_fit_study.keeping import kept, made_by
from floor_of_the_reference_subject import NOMINAL, RESULTS, hashes
from make_reference_subject import DATA as REFERENCE
from make_sessions import DATA, EMBEDDED, SPEEDS, STEPS, Task, draws, make, session
from virtual_laboratory.truth import true_values

from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.files import plain, read_json, sha256, write_json
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.fit.assessment import HELD_OUT, assess
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import ContactFitSolution, JointEnd, solve
from vsf_drake.fit.solve import FitSearch, uncertainty_at
from vsf_drake.model.contact_file import FittedContact, PersonCurve
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks import person_curve
from vsf_drake.walks.comparison import Comparison
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.person_curve import laid, measured, over, spread
from vsf_drake.walks.phases import mean_phases, phase_errors
from vsf_drake.walks.prediction import (
    LAYERS,
    MOMENTUM,
    PERSON,
    PHYSICS,
    SCORES,
    LayeredWalk,
    TrialLayers,
    compared,
    layers_of,
    predict,
)

PARTS = Path("results/session_fit")
OTHER_SPEEDS = PARTS / "speeds"
"""C's walks at the speeds that are not embedded, written as the sessions are."""
SEED, SEEDS = 0, 10
NULLS = (
    "null_model_grf_rmse_bw",
    "null_model_predicted_times_grf_rmse_bw",
    "stretched_null_grf_rmse_bw",
)
NEEDS = (0.0, 0.125, 0.25, 0.375, 0.5)
MODELS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Shares of the need and of the vertical model in the third layer, tried on A and B."""
MEASURED_TIMES = "measured_times_grf_rmse_bw"
THIRD = "c_day_1"
CHOSEN_BY = ("a_day_1", "b_day_1")
QUICK = {"starts": 1, "tolerance": 0.01, "step_s": 4e-3, "report_step_s": 8e-3}
FITTED, SAME, UNSEEN, DAY = "fitted", "same setting", "unseen setting", "another day"
AT = {name: f"{value:g} m/s" for name, value in SPEEDS.items() if name != EMBEDDED}
"""Roles of walks at other speeds, by name of their folder."""
FLOORS = ("floor_bw", "own_floor_bw")
SEEN_ON_PEOPLE = {"held_out_grf_rmse_bw": (0.04, 0.09), "stretched_null_grf_rmse_bw": (0.02, 0.05)}
"""What fits like these were left with on recordings of people, from and to; those recordings are
not kept here."""


@dataclass(frozen=True)
class Case:
    """One fit: trials of a session by name in its folder of the embedded speed; the others judge
    it, but only with SEED."""

    person: str
    day: int
    fitted: tuple[str, str]
    seed: int = SEED

    @property
    def session(self) -> str:
        return f"{self.person}/day_{self.day}"

    @property
    def name(self) -> str:
        return self.reported + f"_seed_{self.seed}" * (self.seed != SEED)

    @property
    def reported(self) -> str:
        """Name of the same fit with SEED."""
        return f"{self.person}_day_{self.day}" + "_passive" * self.passive

    @property
    def passive(self) -> bool:
        return self.fitted[0].startswith("passive")


PAIR, PASSIVE = ("low_1", "high_1"), ("passive_1", "passive_2")
CASES = (
    Case("a", 1, PAIR),
    Case("a", 2, PAIR),
    Case("b", 1, PAIR),
    Case("c", 1, PAIR),
    Case("c", 1, PASSIVE),
)
REPEATED = tuple(Case(person, 1, PAIR, seed) for person in "abc" for seed in range(SEEDS))
"""Those whose ends and intervals are counted."""


def main() -> None:
    """Fits every person, prints a table and writes session_fit.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=DATA,
        help="folder of the sessions; with other speeds they judge",
    )
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick or --data is given"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes, a fit each")
    parser.add_argument(
        "--quick", action="store_true", help="one fit, coarsely, two trials judge; needs --out"
    )
    parser.add_argument(
        "--judge-again", action="store_true", help="judge the stored fits anew, without a search"
    )
    arguments = parser.parse_args()
    if arguments.judge_again and (arguments.quick or arguments.out or arguments.data != DATA):
        parser.error("--judge-again is of the stored fits: give no other option but --workers")
    if not arguments.out and (arguments.quick or arguments.data != DATA):
        parser.error("a part of the study, or one of other data, must not replace it: give --out")
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    if arguments.judge_again:
        judge_again(out / "session_fit.json", arguments.workers)
        return
    if not arguments.quick and arguments.data == DATA:
        make_other_speeds(arguments.workers)
    cases = CASES[:1] if arguments.quick else tuple(dict.fromkeys((*CASES, *REPEATED)))
    parts = (arguments.out or PARTS) / "parts"
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        found = list(
            pool.map(done, [(case, arguments.data, parts, arguments.quick) for case in cases])
        )
    inputs: dict[str, str] = {}
    for part in found:
        inputs |= part.pop("inputs")
    by_case = dict(zip(cases, found, strict=True))
    tell(
        out / "session_fit.json",
        by_case,
        {**provenance(inputs, SEED), "sources": made_by("session_fit.py")},
    )


def tell(path: Path, by_case: dict[Case, dict[str, Any]], made: dict[str, Any]) -> None:
    """Writes the results with their provenance, and prints a table."""
    fits = {case.name: part for case, part in by_case.items() if case.seed == SEED}
    repeated = {case: by_case[case] for case in REPEATED if case in by_case}
    write_json(
        path,
        {
            "synthetic": True,
            "definitions": __doc__,
            "seen_on_people": SEEN_ON_PEOPLE,
            "fits": len(repeated),
            "converged": sum(part["converged"] for part in repeated.values()),
            "intervals": coverage(repeated),
            "against_null": against_null(fits),
            "with_the_others_best": with_the_others_best(fits),
            "intervals_hold": mean_intervals(fits),
            "ends": ends(repeated),
            "seeds": {case.name: part for case, part in repeated.items() if case.seed != SEED},
            "third_person": third_person(fits.get(THIRD, {})),
            "cases": fits,
            "provenance": made,
        },
    )
    print(text_table(fits))
    print(text_of_ends(ends(repeated), coverage(repeated)))


def judge_again(path: Path, workers: int) -> None:
    """The stored fits, judged by today's sources; exits where the foot's physics gives other errors
    than are stored."""
    make_other_speeds(workers)
    stored = read_json(path)
    before = {**stored["cases"], **stored["seeds"]}
    by_case = {case: before[case.name] for case in dict.fromkeys((*CASES, *REPEATED))}
    judged = [case for case in by_case if case.seed == SEED and by_case[case]["converged"]]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for case, found in zip(
            judged, pool.map(judged_anew, judged, [by_case[case] for case in judged]), strict=True
        ):
            for trial, row in by_case[case]["trials"].items():
                was, now = (
                    of["layers"][LAYERS[0]]["grf_rmse_bw"] for of in (row, found["trials"][trial])
                )
                if not abs(now - was) <= 1e-4 * was:
                    sys.exit(
                        f"{case.name}: {trial} has {now:.6g} by physics, stored {was:.6g}: fit "
                        "again"
                    )
            by_case[case] = by_case[case] | found
    numbers = "judged by these sources; the fits are of others, whose physics these give again"
    tell(
        path,
        by_case,
        {**stored["provenance"], "sources": {**made_by("session_fit.py"), "numbers": numbers}},
    )


def judged_anew(case: Case, stored: dict[str, Any]) -> dict[str, Any]:
    """A stored fit's verdict at the values that it ended at."""
    return judge(case, DATA, solution_at(case, stored))


def solution_at(case: Case, stored: dict[str, Any]) -> ContactFitSolution:
    """A stored fit at the values that it ended at."""
    fit = fit_of(case, DATA)
    u = fit.parameters.u(stored["values"])
    at = fit.evaluate(u)
    search = FitSearch(
        start=u,
        u=u,
        start_cost=at.cost,
        cost=at.cost,
        success=True,
        message=stored["ended"],
        evaluations=1,
        failed=0,
    )
    end = JointEnd(
        u=u, evaluation=at, uncertainty=uncertainty_at(fit, u), searches=(search,), best=0
    )
    return ContactFitSolution(
        fit=fit, success=True, message=stored["ended"], end=end, wall_s=stored["wall_s"]
    )


def done(task: tuple[Case, Path, Path, bool]) -> dict[str, Any]:
    """The case's part, made now unless it was made before of the same files by the same sources."""
    case, data, parts, quick = task
    began = time.perf_counter()
    inputs = {
        NOMINAL: sha256(REFERENCE / NOMINAL),
        "../sessions/draws.csv": sha256(data / "draws.csv"),
    }
    judges = judging(case, data) if case.seed == SEED else []
    kept_here = [trial for trial in judges if OTHER_SPEEDS not in trial.path.parents]
    for trial in [*kept_here, *(read(data, case, name) for name in case.fitted)]:
        inputs |= hashes(trial)
    if not case.passive:
        inputs |= {
            f"../sessions/{case.person}/bench_curves.csv": sha256(
                data / case.person / "bench_curves.csv"
            )
        }
    key = digest(
        {"case": asdict(case), "quick": quick, **provenance(inputs), **made_by("session_fit.py")}
    )
    part, _ = kept(parts, case.name, key, lambda: run(case, data, quick))
    print(f"{case.name} ({time.perf_counter() - began:.0f} s)", flush=True)
    return {**part, "inputs": inputs}


def run(case: Case, data: Path, quick: bool) -> dict[str, Any]:
    """Fits and judges; a fit that fails is told as such."""
    told: dict[str, Any] = {
        "fitted": list(case.fitted),
        "bench": not case.passive,
        "seed": case.seed,
    }
    problem = fit_of(case, data, quick)
    try:
        solution = solve(problem)
        told["wall_s"] = solution.wall_s
        if not solution.success:
            return {**told, "converged": False, "ended": solution.message}
        told["end"] = end_of(case, data, solution)
        told |= {"converged": True, "ended": solution.message}
        return told if case.seed != SEED else told | judge(case, data, solution, quick)
    except (FitError, SimulationError) as error:
        return {**told, "converged": False, "ended": str(error)}


def judge(
    case: Case, data: Path, solution: ContactFitSolution, quick: bool = False
) -> dict[str, Any]:
    """What the fit is worth on all other trials."""
    problem, own = solution.fit, judging(case, data)[: 2 if quick else None]
    here = [
        trial for trial in own if path_in_session(trial).startswith(f"{case.session}/{EMBEDDED}/")
    ]
    judged = assess(solution, here, sweep=False, leave_out=False, angle_errors=not quick)
    assert judged.layers is not None
    contact, step_s = judged.layers.teach(solution.contact()), problem.options.report_step_s
    walkers = {trial.subject: walker_of(trial, contact) for trial in own if trial not in here}
    layers = [
        *judged.layers.trials,
        *(
            layers_of(
                trial, path_in_session(trial), contact, walker=walkers[trial.subject], step_s=step_s
            )
            for trial in own
            if trial not in here
        ),
    ]
    every = [*problem.trials, *here, *(trial for trial in own if trial not in here)]
    trials = {
        path_in_session(trial): row(case, data, trial, found)
        for trial, found in zip(every, layers, strict=True)
    }
    walks = [
        Walked(trial, contact, walkers.get(trial.subject) or walker_of(trial, contact), step_s)
        for trial in every
    ]
    for walk, told in zip(walks, trials.values(), strict=True):
        told[MEASURED_TIMES] = walk.error(over(contact.person_curve, walk.seen, walk.stances))
    of_session = walks[: len(problem.trials) + len(here)]
    return {
        "values": solution.values,
        "bench_rmse_n_per_mm": judged.bench
        and judged.bench.stiffness
        and judged.bench.stiffness.rmse,
        "trials": trials,
        "mean": means(trials),
        "walked": {
            score.label: {key: getattr(score.metrics, key) for key in SCORES}
            for score in judged.scores
        },
        "earned": judged.layers.earned,
        "phases": plain(judged.layers.phases),
        "momentum": plain(contact.momentum),
        "angle_errors": plain(judged.angle_errors),
        "weights": {}
        if quick or case.reported not in CHOSEN_BY
        else weights(of_session[len(problem.trials) :], contact),
        "intervals_hold": [] if quick or case.passive else intervals_hold(of_session),
    }


class Walked:
    """A trial in layers, and what its plate is to the person's curve."""

    def __init__(self, trial: Trial, contact: FittedContact, walker: Walker, step_s: float) -> None:
        self.name = trial.path.stem
        self.plate = trial.prosthetic_plate
        self.layered: LayeredWalk = predict(
            trial_with(trial, contact), contact, walker=walker, step_s=step_s
        )
        self.seen = self.layered.seen
        self.on_plate = measured(self.seen, self.plate, trial.name)
        self.comparisons = compared(self.layered, self.plate)
        self.stances = [item.measured for item in self.comparisons[PHYSICS].stances]

    def beside(self, person: person_curve.PersonForce) -> Comparison:
        """The plate beside another force."""
        return compared(replace(self.layered, person=person), self.plate)[PERSON]

    def error(self, person: person_curve.PersonForce) -> float | None:
        """Of that force's resultant, BW."""
        result = self.layered.results[MOMENTUM]
        return walk_metrics(result, self.plate, comparison=self.beside(person)).error_bw


def weights(walks: Sequence[Walked], contact: FittedContact) -> dict[str, dict[str, float | None]]:
    """Mean error of the third layer by NEED and by the vertical of MODEL."""
    found: dict[str, dict[str, float | None]] = {}
    for need in NEEDS:
        for share in MODELS:
            shares = np.array([*person_curve.MODEL[:2], share])
            with mock.patch.multiple(person_curve, NEED=need, MODEL=shares):
                found.setdefault(f"{need:g}", {})[f"{share:g}"] = mean_of(
                    walk.error(laid(contact.person_curve, walk.seen)) for walk in walks
                )
    return found


def with_the_others_best(fits: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Of each person by whom the weights were chosen: the best of the other, and the error with
    it."""
    told = {}
    for name, other in (CHOSEN_BY, CHOSEN_BY[::-1]):
        tried = fits.get(other, {}).get("weights")
        if tried and fits.get(name, {}).get("weights"):
            need, share = min(
                ((need, share) for need in tried for share in tried[need]),
                key=lambda pair: tried[pair[0]][pair[1]],
            )
            error = fits[name]["weights"][need][share]
            told[name] = {"need": float(need), "model": float(share), "grf_rmse_bw": error}
    return told


def intervals_hold(walks: Sequence[Walked]) -> list[dict[str, Any]]:
    """By phase and component, the walks of each number told by all others."""
    found = []
    for number in sorted({walk.name[-1] for walk in walks}):
        base = [walk for walk in walks if walk.name[-1] != number]
        curve = spread(
            PersonCurve(walks=tuple(walk.on_plate for walk in base)), [one.seen for one in base]
        )
        for walk in walks:
            if walk not in base:
                person = laid(curve, walk.seen)
                found.append(
                    phase_errors(
                        walk.comparisons[PHYSICS],
                        walk.beside(person),
                        person,
                        None,
                        walk.seen.weight_n,
                    )
                )
    return [
        {"phase": one.phase, "component": one.component, "held": one.in_interval}
        for one in mean_phases(found)
    ]


def mean_intervals(fits: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """`intervals_hold` over the first days."""
    told = [part.get("intervals_hold") for name, part in fits.items() if name.endswith("day_1")]
    return [
        {**rows[0], "held": mean_of(row["held"] for row in rows)}
        for rows in zip(*[one for one in told if one], strict=True)
    ]


def fit_of(case: Case, data: Path, quick: bool = False) -> ContactFit:
    """The fit as `vsf-drake fit` makes it of two trials and curves."""
    bench = None if case.passive else load_measured_bench(data / case.person / "bench_curves.csv")
    return ContactFit(
        [read(data, case, name) for name in case.fitted],
        bench=bench,
        options=ContactFitOptions(seed=case.seed, **(QUICK if quick else {})),
    )


def end_of(case: Case, data: Path, solution: ContactFitSolution) -> dict[str, Any]:
    """Where the searches ended, and the parameters with a truth; `cost_spread` is of those that
    converged, the highest cost over the lowest less 1, with the priors as they were at first."""
    assert isinstance(solution.end, JointEnd)
    told, values = solution.end.uncertainty, solution.values
    costs = [one.cost for one in solution.end.searches[: solution.fit.joint.starts] if one.success]
    (truth, found), parameters = (truths(case, data, as_found) for as_found in (False, True)), {}
    for i, name in enumerate(told.names):
        if name in truth:
            low, high = map(float, told.interval[i])
            parameters[name] = {
                "truth": truth[name],
                "value": values[name],
                "interval": [low, high],
                "standard_error": float(told.standard_error[i]),
                "contained": low <= truth[name] <= high,
                "truth_as_found": found[name],
                "contained_as_found": low <= found[name] <= high,
                "identified": name not in told.unidentified,
            }
    return {
        "cost": solution.end.evaluation.cost,
        "starts_converged": len(costs),
        "cost_spread": max(costs) / min(costs) - 1.0,
        "widened": sorted(solution.contradiction.sd_away) if solution.contradiction else [],
        "parameters": parameters,
    }


@cache
def truths(case: Case, data: Path, as_found: bool = False) -> dict[str, float]:
    """True values by name of a parameter."""
    person, trials = case.person.upper(), []
    number = {draw.name: i for i, draw in enumerate(draws(person, case.day, EMBEDDED))}
    for name in case.fitted:
        drawn = table(data, "draws")[f"{case.session}/{EMBEDDED}/{name}"]
        stride_s = float(drawn["stance_s"]) / float(drawn["duty"])
        trials.append(
            (read(data, case, name), stride_s, (list(SPEEDS).index(EMBEDDED), number[name]))
        )
    return true_values(session(person, case.day), trials, as_found=as_found)


def coverage(repeated: dict[Case, dict[str, Any]]) -> dict[str, Any]:
    """How many 95 % intervals hold the truth, of the segments and as found: once a person, by the
    first seed that converged, since all seeds fit the same data; by whether the fit identifies the
    parameter, and by parameter without its side."""
    first: dict[str, dict[str, Any]] = {}
    for case, part in repeated.items():
        if part["converged"]:
            first.setdefault(case.reported, part["end"]["parameters"])
    told = [
        (case.reported, part["end"]["parameters"])
        for case, part in repeated.items()
        if part["converged"]
    ]
    named: dict[str, list[dict[str, Any]]] = {}
    for parameters in first.values():
        for name, row in parameters.items():
            named.setdefault(name.removesuffix("_r").removesuffix("_l"), []).append(row)
    every = [row for of in named.values() for row in of]
    groups = {
        "identified": [row for row in every if row["identified"]],
        "not_identified": [row for row in every if not row["identified"]],
    }
    return {
        "persons": len(first),
        **{
            group: {
                key: counted([row[key] for row in of])
                for key in ("contained", "contained_as_found")
            }
            for group, of in groups.items()
        },
        "parameters": {
            name: {
                "persons": len(of),
                **{
                    key: sum(row[key] for row in of)
                    for key in ("contained", "contained_as_found", "identified")
                },
                "rms_off_in_standard_errors": float(
                    np.sqrt(
                        np.mean(
                            [
                                ((row["value"] - row["truth"]) / row["standard_error"]) ** 2
                                for row in of
                            ]
                        )
                    )
                ),
            }
            for name, of in named.items()
        },
        "seeds_agree": all(
            row[key] == first[reported][name][key]
            for reported, parameters in told
            for name, row in parameters.items()
            for key in ("contained", "contained_as_found", "identified")
        ),
    }


def against_null(fits: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """In how many held-out walks of the sessions with two settings each layer is nearer to the
    plate than the null model, and than the nearest single curve; in how many sessions on average;
    on the persons' first days, and with the second day; at settings that were fitted and at those
    that were not."""
    sessions = {
        name: fits[name]
        for name in (case.name for case in CASES if not case.passive)
        if fits.get(name, {}).get("mean")
    }
    told: dict[str, Any] = {}
    for days, of in (
        ("first_days", [part for name, part in sessions.items() if name.endswith("day_1")]),
        ("with_second_day", [*sessions.values()]),
    ):
        told[days] = {"sessions": len(of)}
        for role in (HELD_OUT, SAME, UNSEEN):
            own = [part["mean"][role] for part in of if role in part["mean"]]
            told[days][role.replace(" ", "_")] = {
                "walks": sum(mean["n"] for mean in own),
                **{
                    layer: {
                        "nearer": sum(mean["layers"][layer]["beats_null"] for mean in own),
                        "nearer_than_single_curve": sum(
                            mean["layers"][layer]["beats_stretched_null"] for mean in own
                        ),
                        "sessions_nearer_on_average": sum(
                            mean["layers"][layer]["grf_rmse_bw"] < mean[NULLS[0]] for mean in own
                        ),
                    }
                    for layer in LAYERS
                },
            }
    return told


def ends(repeated: dict[Case, dict[str, Any]]) -> dict[str, Any]:
    """By person: how the ends of all seeds agree, of those that converged. `cost_spread` as of
    starts; `largest_cost_spread_of_starts` within one fit; `largest_apart` by which two seeds
    differ in a parameter with a truth, in the larger of their standard errors."""
    told: dict[str, Any] = {}
    for reported in dict.fromkeys(case.reported for case in repeated):
        parts = [part for case, part in repeated.items() if case.reported == reported]
        found = [part["end"] for part in parts if part["converged"]]
        told[reported] = {"fits": len(parts), "converged": len(found)}
        if found:
            costs = [end["cost"] for end in found]
            apart = {
                name: float(
                    np.ptp([end["parameters"][name]["value"] for end in found])
                    / max(end["parameters"][name]["standard_error"] for end in found)
                )
                for name in found[0]["parameters"]
            }
            told[reported] |= {
                "cost": min(costs),
                "cost_spread": max(costs) / min(costs) - 1.0,
                "largest_cost_spread_of_starts": max(end["cost_spread"] for end in found),
                "fewest_starts_converged": min(end["starts_converged"] for end in found),
                "largest_apart": max(apart.values()),
                "apart": apart,
                "largest_wall_s": max(part["wall_s"] for part in parts if part["converged"]),
            }
    return told


def walker_of(trial: Trial, contact: FittedContact) -> Walker:
    """Of a person who was measured anew, with the fitted contact."""
    fitted = trial_with(trial, contact)
    return Walker(fitted.subject, fitted.model)


def make_other_speeds(workers: int) -> None:
    """Writes C's walks at the other speeds unless they are there."""
    if not (OTHER_SPEEDS / "draws.csv").exists():
        person, day = THIRD[0].upper(), 1
        wanted = [
            Task(person, day, speed, number, STEPS)
            for speed in SPEEDS
            if speed != EMBEDDED
            for number in range(len(draws(person, day, speed)))
        ]
        make(OTHER_SPEEDS, wanted, workers)


def judging(case: Case, data: Path) -> list[Trial]:
    """What judges: the other trials with this foot, of all days and speeds of this person that are
    there."""
    files = sorted((data / case.person).glob("day_*/*/*.yaml"))
    if data == DATA and case.reported == THIRD:
        files += sorted((OTHER_SPEEDS / case.person).glob("day_*/*/*.yaml"))
    own = {data / case.session / EMBEDDED / f"{name}.yaml" for name in case.fitted}
    return [
        load_trial(file)
        for file in files
        if file not in own and file.stem.startswith("passive") == case.passive
    ]


@cache
def read(data: Path, case: Case, name: str) -> Trial:
    return load_trial(data / case.session / EMBEDDED / f"{name}.yaml")


def path_in_session(trial: Trial) -> str:
    """Person, day, speed and name of a trial of a session."""
    return "/".join(trial.path.with_suffix("").parts[-4:])


def row(case: Case, data: Path, trial: Trial, found: TrialLayers) -> dict[str, Any]:
    """A trial's numbers, and what it is to the fit."""
    path = path_in_session(trial)
    person_day, speed, name = path.rsplit("/", 2)
    role = (
        DAY
        if person_day != case.session
        else AT[speed]
        if speed != EMBEDDED
        else FITTED
        if name in case.fitted
        else SAME
        if name[:-1] in {one[:-1] for one in case.fitted}
        else UNSEEN
    )
    return {
        "role": role,
        "fulcrum_mm": round(1e3 * trial.fulcrum_m, 6),
        "layers": plain(found.layers),
        "correction": plain(found.correction),
        **{name: getattr(found, name) for name in NULLS},
        **floors(data).get(path, {}),
    }


def floors(data: Path) -> dict[str, dict[str, float]]:
    """By trial."""
    return {
        trial: {name: float(row[name]) for name in FLOORS}
        for trial, row in table(data, "figures").items()
    }


@cache
def table(data: Path, name: str) -> dict[str, dict[str, str]]:
    """Rows of one of the sessions' tables by trial."""
    with (data / f"{name}.csv").open(encoding="utf-8") as lines:
        return {
            row["trial"]: row
            for row in csv.DictReader(line for line in lines if not line.startswith("#"))
        }


def means(trials: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """By role, and over all that were held out on this day at this speed ("held out")."""
    roles: dict[str, Sequence[str]] = {
        role: (role,) for role in (FITTED, SAME, UNSEEN, *AT.values(), DAY)
    }
    found = {}
    for name, of in {**roles, HELD_OUT: (SAME, UNSEEN)}.items():
        rows = [row for row in trials.values() if row["role"] in of]
        if rows:
            layers = {
                layer: {
                    **{key: mean_of(row["layers"][layer][key] for row in rows) for key in SCORES},
                    **{
                        of: sum(
                            row["layers"][layer]["grf_rmse_bw"] < row[null]
                            for row in rows
                            if row[null] is not None
                        )
                        for of, null in (
                            ("beats_null", NULLS[0]),
                            ("beats_null_predicted_times", NULLS[1]),
                            ("beats_stretched_null", NULLS[2]),
                        )
                    },
                }
                for layer in LAYERS
            }
            found[name] = {
                "n": len(rows),
                "layers": layers,
                **{
                    key: mean_of(row.get(key) for row in rows)
                    for key in (*NULLS, MEASURED_TIMES, *FLOORS)
                },
            }
    return found


def mean_of(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def third_person(part: dict[str, Any]) -> dict[str, Any] | None:
    """What the person has on whom nothing was chosen, by the layer that the held-out trials earn
    and by each; None of one without a fit."""
    mean = part.get("mean")
    if not mean:
        return None
    layers = {
        layer: {
            "fitted_grf_rmse_bw": mean[FITTED]["layers"][layer]["grf_rmse_bw"],
            "held_out_same_setting_grf_rmse_bw": mean[SAME]["layers"][layer]["grf_rmse_bw"],
            "held_out_unseen_setting_grf_rmse_bw": mean[UNSEEN]["layers"][layer]["grf_rmse_bw"],
            "null_model_grf_rmse_bw": mean[HELD_OUT][NULLS[0]],
            **{null: mean[HELD_OUT][null] for null in NULLS[1:]},
            "held_out_fore_aft_rmse_bw": mean[HELD_OUT]["layers"][layer]["fore_aft_rmse_bw"],
            "held_out_cop_rmse_fl": mean[HELD_OUT]["layers"][layer]["cop_rmse_fl"],
            "held_out_cop_lateral_rmse_fl": mean[HELD_OUT]["layers"][layer]["cop_ml_rmse_fl"],
            "held_out_beats_null": mean[HELD_OUT]["layers"][layer]["beats_null"],
            "held_out": mean[HELD_OUT]["n"],
        }
        for layer in LAYERS
    }
    return {
        "layer": part["earned"],
        **layers[part["earned"]],
        "layers": layers,
        "angle_errors": [row for row in part["angle_errors"] if row["role"] == HELD_OUT],
    }


def text_table(fits: dict[str, dict[str, Any]]) -> str:
    """Lines for the screen: % body weight, centre of pressure % foot length."""
    heads = (
        *(f"+ {layer}" for layer in LAYERS),
        "null",
        "null, pred.",
        "single curve",
        "own floor",
        "CoP",
        "CoP lateral",
    )
    lines = [f"{'fit':<18}{'judged by':<16}{'n':>4}" + "".join(f"{head:>15}" for head in heads)]
    for name, part in fits.items():
        if not part["converged"]:
            lines.append(f"{name:<18}FAILED: {part['ended']}")
        for role, mean in part.get("mean", {}).items():
            scores = mean["layers"]
            numbers = [
                *(scores[layer]["grf_rmse_bw"] for layer in LAYERS),
                *(mean[key] for key in NULLS),
                mean["own_floor_bw"],
                *(scores[part["earned"] or LAYERS[0]][key] for key in SCORES[-2:]),
            ]
            lines.append(
                f"{name:<18}{role:<16}{mean['n']:>4}"
                + "".join(
                    f"{'-':>15}" if number is None else f"{100 * number:>15.1f}"
                    for number in numbers
                )
            )
    return "\n".join(lines)


def text_of_ends(found: dict[str, Any], covered: dict[str, Any]) -> str:
    """Lines for the screen: seeds' ends and the intervals' coverage."""
    lines = []
    for name, row in found.items():
        of = f"{name:<18}{row['converged']} of {row['fits']} seeds converged"
        lines.append(
            of
            if not row["converged"]
            else f"{of}; cost apart {100 * row['cost_spread']:.1f} % by seed, "
            f"{100 * row['largest_cost_spread_of_starts']:.1f} % by start; values up to "
            f"{row['largest_apart']:.2f} standard errors"
        )
    for name, row in covered["parameters"].items():
        lines.append(
            f"{name:<28}truth in {row['contained']:>2} of {row['persons']:>2} 95 % intervals, as "
            f"found in {row['contained_as_found']:>2}; off by "
            f"{row['rms_off_in_standard_errors']:.1f} standard errors"
        )
    for group in ("identified", "not_identified"):
        for key, words in (("contained_as_found", "as found"), ("contained", "true segments")):
            row = covered[group][key]
            share = (
                ""
                if row["binomial_95"] is None
                else " (binomial 95 %: {:.0f} to {:.0f} %)".format(
                    *(100 * end for end in row["binomial_95"])
                )
            )
            lines.append(
                f"{group.replace('_', ' ') + ', ' + words:<30}{row['held']} of {row['n']} "
                f"intervals of {covered['persons']} persons{share}"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
