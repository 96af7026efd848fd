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

from vsf_drake.analysis.comparison import cumulative_integral
from vsf_drake.analysis.validation.energy_same_load import (
    FOOT_LOSSES,
    FOOT_STRAINS,
    INPUT,
    REMAINDER,
    TERMS,
    ProsthesisEnergy,
    prosthesis_energy,
    walk_with_same_load,
)
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.analysis.validation.walking_ensembles import spread
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.model_file import check_fulcrum
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import FootParameters
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


def energy_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Walks every trial at a fine step, at twice that, and twice at the five published fulcrum positions.

    Table: `trials` (a row a stance: `stored_j`, `returned_j`, `return_ratio`, the ledger's terms at toe-off,
    `remainder_share`, second methods), `conditions` (means and SD), `same_load` and `same_motion` (a row a trial and
    position), `convergence`, `ledger_remainder_share_max`, `softer_stores_more`, `softer_returns_more` (None with one
    condition). Arrays: `percent` (201,), `terms_j` (rows, len(terms), 201) by `terms`, `pylon_power_w` and
    `shank_power_w` (rows, 200).
    """
    fine, coarse, moved, search = STEPS_S[study.options.quick]
    cases = [EnergyCase(label=walk.label, trial=walk.trial, fulcrum_m=walk.trial.fulcrum_m, step_s=step)
             for walk in study.walks for step in (fine, coarse)]
    own = len(cases)
    positions = _positions(study)
    cases += [EnergyCase(label=walk.label, trial=walk.trial, fulcrum_m=x, step_s=moved, search_step_s=step)
              for step in (None, search) for walk in study.walks for x in positions]
    found = walk_cases(cases, workers=study.options.workers,
                       progress=progress and (lambda f: progress("walking in small steps", 0.95 * f)))
    missing = [f"{walk.case.label} has no energy ledger with the fulcrum at {1e3 * walk.case.fulcrum_m:g} mm"
               f"{' and its own load' * (walk.case.search_step_s is not None)}: {walk.failure}."
               for i, walk in enumerate(found) if walk.failure and (i >= own or i % 2 == 0)]
    for walk in found[:own:2]:
        if walk.unconverged_steps:
            missing.append(f"{walk.unconverged_steps} steps of {walk.case.label} did not converge: its energies are "
                           "not to be trusted.")
    stiffness, why = _bench_stiffness(study, positions)
    missing += why
    trials = [row for walk in found[:own:2] for row in _rows(walk, stiffness)]
    twins = [row for walk in found[1:own:2] for row in _rows(walk, stiffness)]
    motion, load = (_moved([walk for walk in found[own:] if (walk.case.search_step_s is not None) == kept], stiffness)
                    for kept in (False, True))
    if len(positions) < len(PUBLISHED_FULCRUMS_M):
        missing.append("Not all of the published fulcrum positions are within reach of this foot's carriage.")
    conditions = [_condition(x, [row for row in trials if row["fulcrum_mm"] == x])
                  for x in sorted({row["fulcrum_mm"] for row in trials})]
    if len(conditions) == 1:
        missing.append("There is one fulcrum position among the trials: whether a softer setting stores more cannot be "
                       "told as recorded, only for this load with the fulcrum elsewhere.")
    worst = {key: max((row[key] for row in trials if row[key] is not None), default=None)
             for key in ("remainder_share", "balance_share", "distal_share")}
    remainder = worst.pop("remainder_share")
    one_person = len({walk.trial.subject for walk in study.walks}) == 1
    if not one_person and len(conditions) > 1:
        missing.append("The trials are of more than one person: whether a softer setting stores more cannot be told as "
                       "recorded.")
    judged = {key: _judged(load, motion, conditions if one_person else (), key) for key in ("stored_j", "returned_j")}
    table = {
        "trials": trials, "conditions": conditions, "same_load": load, "same_motion": motion,
        "convergence": _convergence(trials, twins),
        "terms": list(TERMS), "step_s": fine, "coarse_step_s": coarse, "moved_step_s": moved,
        "load_point_mm": 1e3 * study.model.foot.load_point_m, "asked_share": ASKED_SHARE,
        "ledger_remainder_share_max": remainder,
        "ledger_closes": None if remainder is None else remainder <= ASKED_SHARE,
        **{f"{key}_max": value for key, value in worst.items()},
        "result_remainder_share_max": _result_remainder(study, trials), "result_step_s": study.options.step_s,
        "softer_stores_more": judged["stored_j"]["both"], "softer_returns_more": judged["returned_j"]["both"],
        "softer": judged, "synthetic": study.synthetic,
    }
    stances = [stance for walk in found[:own:2] for stance in walk.stances]
    arrays = {"percent": PERCENT} if not stances else {"percent": PERCENT} | {
        name: np.array([stance.curves[name] for stance in stances])
        for name in ("terms_j", "pylon_power_w", "shank_power_w")}
    return Section(table=table, arrays=arrays, missing=tuple(missing))


def _positions(study: Study) -> list[float]:
    """The published fulcrum positions (m from A) that this carriage reaches."""
    reached = []
    for x in PUBLISHED_FULCRUMS_M:
        try:
            reached.append(check_fulcrum(x, study.model.foot))
        except InputError:
            continue
    return reached


def _bench_stiffness(study: Study, positions: Sequence[float]) -> tuple[dict[float, float], list[str]]:
    """N/m by position (mm) of this model in the testing machine, and what went wrong with it."""
    wanted = sorted({round(1e3 * x, 6) for x in positions} | {walk.fulcrum_mm for walk in study.walks})
    try:
        bench = BenchStiffness(study.model.foot, fulcrums_m=[1e-3 * x for x in wanted], heel=False)
        found, _ = bench.evaluate({})
    except (InputError, SimulationError) as error:
        return {}, [f"The bench's F²/2k is not there for comparison: {error}"]
    return dict(zip(wanted, map(float, found), strict=True)), []


def _rows(walk: EnergyWalk, stiffness: Mapping[float, float]) -> list[dict[str, Any]]:
    """A row for each stance of a walk."""
    rows = []
    for i, stance in enumerate(walk.stances):
        row = {"label": walk.case.label, "stance": i + 1, **stance.row}
        k = stiffness.get(row["fulcrum_mm"])
        row["bench_j"] = None if k is None else 0.5 * row["late_load_n"] ** 2 / k
        row["bench_n_per_mm"] = None if k is None else 1e-3 * k
        rows.append(row)
    return rows


def _result_remainder(study: Study, rows: Sequence[Mapping[str, Any]]) -> float | None:
    """What the whole person's ledger misses at most in a stance of the study's own walks, over what the foot stores."""
    found = []
    for walk in study.walks:
        result = walk.result
        if "remainder" not in result.energy_names:
            continue
        remainder = result.energy_j[:, result.energy_names.index("remainder")]
        for row in rows:
            inside = remainder[(result.time_s >= row["start_s"]) & (result.time_s <= row["end_s"])]
            if row["label"] == walk.label and row["stored_j"] > 0.0 and inside.size:
                found.append(float(np.abs(inside - inside[0]).max()) / row["stored_j"])
    return max(found, default=None)


def _moved(walks: Sequence[EnergyWalk], stiffness: Mapping[float, float]) -> list[dict[str, Any]]:
    """A row for the first stance of each walk with the fulcrum elsewhere; `own` where it is the trial's position."""
    return [row | {"own": abs(walk.case.fulcrum_m - walk.case.trial.fulcrum_m) < _SAME_M, "off_bw": walk.off_bw,
                   "height_mm": walk.height_mm} for walk in walks for row in _rows(walk, stiffness)[:1]]


def _condition(fulcrum_mm: float, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean and sample SD (None for one stance) over the stances at one position."""
    found: dict[str, Any] = {"fulcrum_mm": fulcrum_mm, "n": len(rows), "labels": [row["label"] for row in rows]}
    for key in SPREAD:
        own = spread(rows, key)
        found |= {key: own["mean"], f"{key}_sd": own["sd"]}
    return found


def _convergence(fine: Sequence[Mapping[str, Any]], coarse: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """By stance, what twice the step changes."""
    twins = {(row["label"], row["stance"]): row for row in coarse}
    rows = []
    for row in fine:
        twin = twins.get((row["label"], row["stance"]))
        if twin is not None:
            small, large = row["remainder_max_j"], twin["remainder_max_j"]
            rows.append({"label": row["label"], "stance": row["stance"], "fulcrum_mm": row["fulcrum_mm"],
                         "remainder_max_j": small,
                         "coarse_remainder_max_j": large, "remainder_ratio": large / small if small > 0.0 else None}
                        | {f"{key}_change": twin[key] - row[key] for key in ("stored_j", "returned_j", "lost_j")})
    return rows


def _judged(
    load: Sequence[Mapping[str, Any]], motion: Sequence[Mapping[str, Any]], conditions: Sequence[Mapping[str, Any]],
    key: str
) -> dict[str, Any]:
    """Whether `key` falls from each fulcrum position to the next stiffer one; None where nothing can be compared.

    `same_load` and `same_motion`: in every trial that was walked at all positions (`..._against`: those in which it
    does not). `recorded`: over the means of the recorded conditions. `both`: under the same load and as recorded.
    """
    recorded = _falls([row[key] for row in conditions])
    found: dict[str, Any] = {"recorded": recorded}
    for name, rows in (("same_load", load), ("same_motion", motion)):
        curves: dict[str, list[float]] = {}
        for row in sorted(rows, key=lambda row: row["fulcrum_mm"]):
            curves.setdefault(row["label"], []).append(row[key])
        positions = len({row["fulcrum_mm"] for row in rows})
        falls = {label: _falls(values) for label, values in curves.items() if len(values) == positions}
        known = [one for one in falls.values() if one is not None]
        found[name] = all(known) if known else None
        found[f"{name}_against"] = [label for label, one in falls.items() if one is False]
    kept = found["same_load"]
    return found | {"both": None if kept is None or recorded is None else kept and recorded}


def _falls(values: Sequence[float]) -> bool | None:
    return bool(np.all(np.diff(values) < 0)) if len(values) > 1 else None


# Walks for the energy ledger: at several steps and fulcrum positions, on threads, each reduced to its stances.


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyCase:
    """A trial to be walked with the fulcrum at `fulcrum_m` (m from A) in steps of `step_s`; `label` is the trial's.

    `search_step_s`: step of the walks that look for the pelvis' height with which the load is that of the trial's own
    position; None for the recorded motion as it is.
    """

    label: str
    trial: Trial
    fulcrum_m: float
    step_s: float
    search_step_s: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyWalk:
    """What became of a case: its complete stances, or why there are none.

    Attributes:
        unconverged_steps: of the walk.
        off_bw, height_mm: where the load was to be kept, see `SameLoad`; None elsewhere.
    """

    case: EnergyCase
    stances: tuple[StanceEnergy, ...] = ()
    unconverged_steps: int = 0
    off_bw: float | None = None
    height_mm: float | None = None
    failure: str = ""


def walk_cases(
    cases: Sequence[EnergyCase], *, workers: int | None, progress: Callable[[float], None] | None = None
) -> list[EnergyWalk]:
    """Walks every case, in their order; one that fails stops no other.

    Args:
        workers: threads; None for one a core. The numbers do not depend on it.
        progress: called with the finished fraction.
    """
    walkers = _Walkers()
    for case in cases:  # built here: what threads share is not made by them
        walkers.of(case.trial)
    count = max(1, min(workers or os.cpu_count() or 1, len(cases)))
    found: list[EnergyWalk] = []
    with ThreadPoolExecutor(count) as pool:
        for walk in pool.map(lambda case: _one(walkers.of(case.trial), case), cases):
            found.append(walk)
            if progress:
                progress(len(found) / len(cases))
    return found


class _Walkers:
    """One walker for each person with a device: several trials share it."""

    def __init__(self) -> None:
        self._known: list[Walker] = []

    def of(self, trial: Trial) -> Walker:
        for walker in self._known:
            if walker.subject == trial.subject and walker.model == trial.model:
                return walker
        self._known.append(Walker(trial.subject, trial.model))
        return self._known[-1]


def _one(walker: Walker, case: EnergyCase) -> EnergyWalk:
    trial, off_bw, height_mm = case.trial, None, None
    try:
        if case.search_step_s is None:
            walk = walker.walk(trial.trajectory, fulcrum_m=case.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                               step_s=case.step_s, offsets=trial.offsets)
        else:
            same = walk_with_same_load(walker, trial, fulcrum_m=case.fulcrum_m, step_s=case.step_s,
                                       search_step_s=case.search_step_s)
            if not same.kept:
                return EnergyWalk(case=case, failure="no height of the pelvis was found that keeps the load: it is "
                                                     f"off by {same.off_bw:.1%} of body weight")
            walk, off_bw, height_mm = same.walk, same.off_bw, same.height_mm
    except (InputError, SimulationError) as error:
        return EnergyWalk(case=case, failure=str(error))
    energy = prosthesis_energy(walker, walk)
    complete = [stance for stance in find_stances(energy.time_s, energy.vertical_n) if stance.complete]
    if not complete:
        return EnergyWalk(case=case, failure="the model's foot has no whole stance within the walk")
    stances = tuple(stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=case.fulcrum_m)
                    for stance in complete)
    return EnergyWalk(case=case, stances=stances, unconverged_steps=int(np.sum(~walk.record.converged)), off_bw=off_bw,
                      height_mm=height_mm)


# One stance of the prosthesis' energy ledger in numbers: stored, returned, lost, and how well it closes.
#
# Stored is the strain of keel, foam and fulcrum support above what it was at touch-down, at its largest. Of it,
# `released` is gone again at toe-off; `returned` is what of that the foot gave back: released without what keel, foam,
# support and friction lost on the way. The return ratio is returned over stored. The efficiency is returned over what
# was put into the foot up to the largest strain, stored and lost.


PERCENT = np.linspace(0.0, 100.0, 201)
"""Of stance, where curves are given; powers are means between neighbours."""
LATE = 0.5
"""Share of stance after which the largest vertical load is that of push-off."""
PHASES = {"loading": (0.0, 0.15), "middle": (0.15, 0.75), "push_off": (0.75, 1.0)}
"""Shares of stance by which the remainder is looked at (a choice)."""


@dataclass(frozen=True, eq=False)
class StanceEnergy:
    """Numbers of one stance, and curves on PERCENT: `terms_j` (len(TERMS), 201) from touch-down on, and
    `pylon_power_w`, `shank_power_w` (200,)."""

    row: dict[str, Any]
    curves: dict[str, np.ndarray]


def stance_energy(energy: ProsthesisEnergy, stance: Stance, *, foot: FootParameters, fulcrum_m: float) -> StanceEnergy:
    """The ledger from the last instant before touch-down to the first after toe-off."""
    first = max(int(np.searchsorted(energy.time_s, stance.start_s)) - 1, 0)
    last = min(int(np.searchsorted(energy.time_s, stance.end_s)), len(energy.time_s) - 1)
    cut, time = slice(first, last + 1), energy.time_s[first : last + 1]
    step = float(time[1] - time[0])

    def since(history: np.ndarray) -> np.ndarray:
        own: np.ndarray = history[cut] - history[first]
        return own

    terms = {name: since(energy.terms[name]) for name in TERMS}
    strain = np.sum([terms[name] for name in FOOT_STRAINS], axis=0)
    lost = np.sum([terms[name] for name in FOOT_LOSSES], axis=0)
    top = int(strain.argmax())
    stored, released = float(strain[top]), float(strain[top] - strain[-1])
    returned = released - float(lost[-1] - lost[top])
    absorbed = stored + float(lost[top])
    pylon, shank = (cumulative_integral(power[cut], step) for power in (energy.pylon_power, energy.shank_power))
    remainder = terms[REMAINDER]
    grid = time[0] + 0.01 * PERCENT * (time[-1] - time[0])
    bins = np.diff(grid)
    powers = {name: np.diff(np.interp(grid, time, work)) / bins
              for name, work in (("pylon_power_w", pylon), ("shank_power_w", shank))}
    vertical, half = energy.vertical_n[cut], int(LATE * len(time))
    load, place = energy.keel_load[cut][top]
    row: dict[str, Any] = {
        "fulcrum_mm": round(1e3 * fulcrum_m, 6), "start_s": stance.start_s, "end_s": stance.end_s, "step_s": step,
        "stored_j": stored, "stored_at_percent": 100.0 * top / (len(time) - 1),
        "keel_stored_j": float(terms["keel_strain"].max()),
        **{f"{name.removesuffix('_strain')}_at_most_j": float(terms[name][top]) for name in FOOT_STRAINS},
        "released_j": released, "returned_j": returned, "return_ratio": _ratio(returned, stored),
        "absorbed_j": absorbed, "efficiency": _ratio(returned, absorbed), "lost_j": float(lost[-1]),
        "lost_before_j": float(lost[top]), "lost_after_j": float(lost[-1] - lost[top]),
        **{f"{name}_j": float(terms[name][-1]) for name in TERMS},
        "remainder_max_j": float(np.abs(remainder).max()),
        "remainder_share": _ratio(float(np.abs(remainder).max()), stored),
        "remainder_by_phase_j": {name: _between(remainder, *ends) for name, ends in PHASES.items()},
        "socket_work_j": float(since(energy.socket_work)[-1]), "balance_work_j": float(since(energy.balance_work)[-1]),
        "balance_share": _ratio(float(np.abs(since(energy.balance_work) - terms[INPUT]).max()), stored),
        "distal_work_j": float(pylon[-1]), "distal_absorbed_j": -float(pylon[top]),
        "distal_returned_j": float(pylon[-1] - pylon[top]), "distal_peak_w": float(powers["pylon_power_w"].max()),
        "distal_lowest_w": float(powers["pylon_power_w"].min()), "shank_distal_work_j": float(shank[-1]),
        "shank_distal_peak_w": float(powers["shank_power_w"].max()),
        "distal_share": _ratio(float(np.abs(pylon + strain + lost).max()), stored),
        "late_load_n": float(vertical[half:].max()),
        "late_load_at_percent": 100.0 * (half + int(vertical[half:].argmax())) / (len(time) - 1),
        "keel_load_n": float(load), "keel_load_point_mm": float(1e3 * place) if np.isfinite(place) else None,
        "beam_j": _beam_energy(foot, fulcrum_m, float(load), float(place)),
    }
    row["bent_at_most_j"] = row["keel_at_most_j"] + row["fulcrum_at_most_j"]
    curves = {"terms_j": np.array([np.interp(grid, time, terms[name]) for name in TERMS]), **powers}
    return StanceEnergy(row=row, curves=curves)


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None


def _between(history: np.ndarray, start: float, end: float) -> float:
    last = len(history) - 1
    return float(history[round(end * last)] - history[round(start * last)])


def _beam_energy(foot: FootParameters, fulcrum_m: float, load_n: float, place_m: float) -> float | None:
    """F²/2k of keel and support in closed form under one load across the keel; None if it is not ahead of the fulcrum.

    A second method: small deflections, one load in place of the spheres', no time.
    """
    keel = foot.keel
    if not place_m > fulcrum_m:
        return None
    stiffness = lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m, support=fulcrum_m, load_point=place_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m)
    return 0.5 * load_n**2 / stiffness
