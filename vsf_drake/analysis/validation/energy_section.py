"""Energy that the prosthetic foot stores, returns and loses in a step, and how well the ledger of it closes.

What a softer setting does is asked three times: of the trials as recorded, each at its own position; of each trial's
load, kept while the fulcrum moves; and of each trial's motion, kept. The last is no person's choice: a stiffer spring
that is pressed as far bears more and stores more, k x²/2. The verdict is of the first two.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.energy_ledger import (
    PERCENT,
    TERMS,
    StanceEnergy,
    prosthesis_energy,
    stance_energy,
    walk_with_same_load,
)
from vsf_drake.analysis.validation.study import Progress, Section, Study, reached, spread, walkers_of
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial_record import Trial
from vsf_drake.sentences import say
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.walk import Walker

STEPS_S = {False: (1.25e-4, 2.5e-4, 5e-4, 2e-3), True: (1e-3, 2e-3, 2e-3, 2e-3)}
"""By `quick`: steps of the walks that are reported, of their coarser twins, of the walks at other positions, and of the
search for those with the same load."""
ASKED_SHARE = 0.01
"""Of the stored energy within which the ledger has to close."""
SPREAD = ("stored_j", "keel_stored_j", "returned_j", "return_ratio", "efficiency", "lost_j", "bushing_loss_j",
          "distal_peak_w", "distal_lowest_w", "limb_work_j", "late_load_n", "bench_j")
_SAME_M = 1e-6
Row = dict[str, Any]


def energy_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Walks every trial at a fine step, at twice that, and twice at the five published fulcrum positions.

    Table: `trials` (a row a stance: `stored_j`, `returned_j`, `return_ratio`, the ledger's terms at toe-off,
    `remainder_share`, second methods), `conditions` (means and SD), `same_load` and `same_motion` (a row a trial and
    position), `convergence`, `ledger_remainder_share_max`, `softer_stores_more`, `softer_returns_more` (None with one
    condition). Arrays: `percent` (201,), `terms_j` (rows, len(terms), 201) by `terms`, `pylon_power_w` and
    `shank_power_w` (rows, 200).
    """
    fine, coarse, moved, search = STEPS_S[study.options.quick]
    positions = reached(study.model.foot, PUBLISHED_FULCRUMS_M)
    own = [EnergyCase(label=walk.label, trial=walk.trial, fulcrum_m=walk.trial.fulcrum_m, step_s=step)
           for step in (fine, coarse) for walk in study.walks]
    elsewhere = [EnergyCase(label=walk.label, trial=walk.trial, fulcrum_m=x, step_s=moved, search_step_s=step)
                 for step in (None, search) for walk in study.walks for x in positions]
    found = walk_cases([*own, *elsewhere], workers=study.options.workers,
                       progress=progress and (lambda f: progress("walking in small steps", 0.95 * f)))
    count = len(study.walks)
    reported, twins, walks = found[:count], found[count : 2 * count], found[2 * count :]

    # N/m by position (mm) of this model in the testing machine
    wanted = sorted({round(1e3 * x, 6) for x in positions} | {walk.fulcrum_mm for walk in study.walks})
    stiffness: dict[float, float] = {}
    bench_problem = None
    try:
        bench = BenchStiffness(study.model.foot, fulcrums_m=[1e-3 * x for x in wanted], heel=False)
        stiffness = dict(zip(wanted, map(float, bench.evaluate({})[0]), strict=True))
    except (InputError, SimulationError) as error:
        bench_problem = error
    trials = [row for walk in reported for row in _rows(walk, stiffness)]
    motion, load = (
        [row | {"own": abs(walk.case.fulcrum_m - walk.case.trial.fulcrum_m) < _SAME_M, "off_bw": walk.off_bw,
                "height_mm": walk.height_mm}
         for walk in part for row in _rows(walk, stiffness)[:1]]
        for part in (walks[: len(walks) // 2], walks[len(walks) // 2 :]))
    conditions = [_condition(x, [row for row in trials if row["fulcrum_mm"] == x])
                  for x in sorted({row["fulcrum_mm"] for row in trials})]
    persons = len({walk.trial.subject for walk in study.walks})
    judged = {key: _judged(load, motion, conditions if persons == 1 else (), key) for key in ("stored_j", "returned_j")}
    worst = {key: max((row[key] for row in trials if row[key] is not None), default=None)
             for key in ("remainder_share", "balance_share", "distal_share")}
    remainder = worst["remainder_share"]
    table = {
        "trials": trials, "conditions": conditions, "same_load": load, "same_motion": motion,
        "convergence": _convergence(trials, [row for walk in twins for row in _rows(walk, stiffness)]),
        "terms": list(TERMS), "step_s": fine, "coarse_step_s": coarse, "moved_step_s": moved,
        "load_point_mm": 1e3 * study.model.foot.load_point_m, "asked_share": ASKED_SHARE,
        "ledger_remainder_share_max": remainder,
        "ledger_closes": None if remainder is None else remainder <= ASKED_SHARE,
        "balance_share_max": worst["balance_share"], "distal_share_max": worst["distal_share"],
        "result_remainder_share_max": _result_remainder(study, trials), "result_step_s": study.options.step_s,
        "softer_stores_more": judged["stored_j"]["both"], "softer_returns_more": judged["returned_j"]["both"],
        "softer": judged, "synthetic": study.synthetic}
    stances = [stance for walk in reported for stance in walk.stances]
    curves = {name: np.array([stance.curves[name] for stance in stances])
              for name in ("terms_j", "pylon_power_w", "shank_power_w")} if stances else {}
    return Section(table=table, arrays={"percent": PERCENT} | curves, missing=tuple(say(
        "energy", "missing", bench=bench_problem, reaches_all=len(positions) == len(PUBLISHED_FULCRUMS_M),
        failed=[(walk.case.label, 1e3 * walk.case.fulcrum_m, walk.case.search_step_s is not None, walk.failure)
                for walk in (*reported, *walks) if walk.failure],
        unconverged=[(walk.case.label, walk.unconverged_steps) for walk in reported if walk.unconverged_steps],
        one_position=len(conditions) == 1, persons=persons if len(conditions) > 1 else 1)))


def _rows(walk: EnergyWalk, stiffness: Mapping[float, float]) -> list[Row]:
    """A row for each stance of a walk."""
    rows = []
    for i, stance in enumerate(walk.stances):
        row = {"label": walk.case.label, "stance": i + 1, **stance.row}
        k = stiffness.get(row["fulcrum_mm"])
        row["bench_j"] = None if k is None else 0.5 * row["late_load_n"] ** 2 / k
        row["bench_n_per_mm"] = None if k is None else 1e-3 * k
        rows.append(row)
    return rows


def _result_remainder(study: Study, rows: Sequence[Row]) -> float | None:
    """What the whole person's ledger misses at most in a stance of the study's own walks, over what the foot stores."""
    found = []
    for walk in study.walks:
        result = walk.result
        ledger = dict(zip(result.energy_names, result.energy_j.T, strict=True))
        for row in rows if "remainder" in ledger else ():
            inside = ledger["remainder"][(result.time_s >= row["start_s"]) & (result.time_s <= row["end_s"])]
            if row["label"] == walk.label and row["stored_j"] > 0.0 and inside.size:
                found.append(float(np.abs(inside - inside[0]).max()) / row["stored_j"])
    return max(found, default=None)


def _condition(fulcrum_mm: float, rows: Sequence[Row]) -> Row:
    """Mean and sample SD (None for one stance) over the stances at one position."""
    found: Row = {"fulcrum_mm": fulcrum_mm, "n": len(rows), "labels": [row["label"] for row in rows]}
    for key in SPREAD:
        own = spread(row[key] for row in rows)
        found |= {key: own["mean"], f"{key}_sd": own["sd"]}
    return found


def _convergence(fine: Sequence[Row], coarse: Sequence[Row]) -> list[Row]:
    """By stance, what twice the step changes."""
    twins = {(row["label"], row["stance"]): row for row in coarse}
    rows = []
    for row in fine:
        twin = twins.get((row["label"], row["stance"]))
        if twin is not None:
            small, large = row["remainder_max_j"], twin["remainder_max_j"]
            rows.append({key: row[key] for key in ("label", "stance", "fulcrum_mm", "remainder_max_j")}
                        | {"coarse_remainder_max_j": large, "remainder_ratio": large / small if small > 0.0 else None}
                        | {f"{key}_change": twin[key] - row[key] for key in ("stored_j", "returned_j", "lost_j")})
    return rows


def _judged(load: Sequence[Row], motion: Sequence[Row], conditions: Sequence[Row], key: str) -> Row:
    """Whether `key` falls from each fulcrum position to the next stiffer one; None where nothing can be compared.

    `same_load` and `same_motion`: in every trial that was walked at all positions (`..._against`: those in which it
    does not). `recorded`: over the means of the recorded conditions. `both`: under the same load and as recorded.
    """
    def falls(values: Sequence[float]) -> bool | None:
        return bool(np.all(np.diff(values) < 0)) if len(values) > 1 else None

    recorded = falls([row[key] for row in conditions])
    found: Row = {"recorded": recorded}
    for name, rows in (("same_load", load), ("same_motion", motion)):
        curves: dict[str, list[float]] = {}
        for row in sorted(rows, key=lambda row: row["fulcrum_mm"]):
            curves.setdefault(row["label"], []).append(row[key])
        positions = len({row["fulcrum_mm"] for row in rows})
        judged = {label: falls(values) for label, values in curves.items() if len(values) == positions}
        known = [one for one in judged.values() if one is not None]
        found[name] = all(known) if known else None
        found[f"{name}_against"] = [label for label, one in judged.items() if one is False]
    kept = found["same_load"]
    return found | {"both": None if kept is None or recorded is None else kept and recorded}


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyCase:
    """A trial to be walked with the fulcrum at `fulcrum_m` (m from A) in steps of `step_s`; `label` is the trial's."""

    label: str
    trial: Trial
    fulcrum_m: float
    step_s: float
    search_step_s: float | None = None
    """Step of the walks that look for the pelvis' height with which the load is that of the trial's own position; None
    for the recorded motion as it is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyWalk:
    """What became of a case: its complete stances, or why there are none; `off_bw`, `height_mm`: see `SameLoad`."""

    case: EnergyCase
    stances: tuple[StanceEnergy, ...] = ()
    unconverged_steps: int = 0
    off_bw: float | None = None
    height_mm: float | None = None
    failure: str = ""


def walk_cases(
    cases: Sequence[EnergyCase], *, workers: int | None, progress: Callable[[float], None] | None = None
) -> list[EnergyWalk]:
    """Walks every case, in their order, in as many threads (None: one a core); one that fails stops no other."""
    walkers = walkers_of(case.trial for case in cases)  # before there are threads, which share them
    found: list[EnergyWalk] = []
    with ThreadPoolExecutor(max(1, min(workers or os.cpu_count() or 1, len(cases)))) as pool:
        for walk in pool.map(_walk, walkers, cases):
            found.append(walk)
            if progress:
                progress(len(found) / len(cases))
    return found


def _walk(walker: Walker, case: EnergyCase) -> EnergyWalk:
    trial, off_bw, height_mm = case.trial, None, None
    try:
        if case.search_step_s is None:
            walk = walker.walk(trial.trajectory, fulcrum_m=case.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                               step_s=case.step_s, offsets=trial.offsets)
        else:
            same = walk_with_same_load(walker, trial, fulcrum_m=case.fulcrum_m, step_s=case.step_s,
                                       search_step_s=case.search_step_s)
            if not same.kept:
                return EnergyWalk(case=case, failure=say("energy", "not_kept", off_bw=same.off_bw)[0])
            walk, off_bw, height_mm = same.walk, same.off_bw, same.height_mm
    except (InputError, SimulationError) as error:
        return EnergyWalk(case=case, failure=str(error))
    energy = prosthesis_energy(walker, walk)
    stances = tuple(stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=case.fulcrum_m)
                    for stance in find_stances(energy.time_s, energy.vertical_n) if stance.complete)
    if not stances:
        return EnergyWalk(case=case, failure="the model's foot has no whole stance within the walk")
    return EnergyWalk(case=case, stances=stances, unconverged_steps=int(np.sum(~walk.record.converged)), off_bw=off_bw,
                      height_mm=height_mm)
