"""Walks over the whole range of the fulcrum: the cost, position by position, and what else a
setting changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.threads import side_by_side
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.motion.events import find_stances
from vsf_drake.simulation.walk import Walk
from vsf_drake.tuning.costs import CONSISTENCY, StanceFrame, value_of
from vsf_drake.tuning.problem import SettingOutcome, StiffnessTuning, TrialTuning
from vsf_drake.tuning.quantities import SAME_LOAD
from vsf_drake.tuning.table import ChangedOptimum, ParetoPoint
from vsf_drake.walks.energy_ledger import prosthesis_energy, stance_energy, walk_with_same_load

Job = TypeVar("Job")
Result = TypeVar("Result")
Share = Callable[[float], None]  # called with the share of a stage that is done
RISE = (0.2, 0.8)  # shares of the first peak between which the loading rate is taken (a choice)


@dataclass(frozen=True, eq=False)
class SettingSweep:
    """Costs of T trials at m settings, the same for all or each trial's own; NaN where a walk
    failed."""

    x: np.ndarray  # (m, P) or (T, m, P) the settings
    costs: dict[str, np.ndarray]  # by name of a cost, the consistency among them, (T, m)
    terms: dict[str, np.ndarray]  # of the tuned cost, by name, (T, m)
    outcomes: dict[str, np.ndarray] = field(default_factory=dict)
    """GIVEN_OUTCOMES by name, (T, m), if asked for"""
    forces: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)
    """(n, 3) N in W by trial and setting, too"""
    failures: tuple[str, ...] = ()  # why a walk failed, in words
    unconverged: int = 0  # walks with steps that did not converge

    @property
    def fulcrum_mm(self) -> np.ndarray:
        return self.x[..., 0]

    @property
    def per_trial(self) -> np.ndarray:
        """(T, m) the tuned cost."""
        return np.asarray(np.sum([*self.terms.values()], axis=0))

    @property
    def cost(self) -> np.ndarray:
        return np.asarray(self.per_trial.mean(axis=0))

    @property
    def force_change(self) -> np.ndarray:
        """(m,) body weights, change of the ground reaction force from the recorded settings, mean
        over trials."""
        return np.asarray(np.sqrt(self.costs[CONSISTENCY]).mean(axis=0))

    def believable(self, allowed_bw: float) -> tuple[np.ndarray, tuple[float, float] | None]:
        """(m,) whether the force changes by no more than that, and from where to where (mm)."""
        near: np.ndarray = self.force_change <= allowed_bw
        mm = self.fulcrum_mm[near]
        return near, (float(mm[0]), float(mm[-1])) if len(mm) else None

    def lowest(self, factors: Mapping[str, float] | None = None) -> tuple[float, float]:
        """Where the tuned cost, or the sum of factors times costs, is least, and its value there;
        see `lowest`."""
        whole = (
            self.per_trial
            if factors is None
            else np.sum([factor * self.costs[name] for name, factor in factors.items()], axis=0)
        )
        return lowest(self.fulcrum_mm, whole.mean(axis=0))


def positions(tuning: StiffnessTuning, x: np.ndarray, spacing_mm: float) -> np.ndarray:
    """(m, P) settings like x (P,) with the fulcrum over its bounds, at most `spacing_mm` apart,
    both ends included."""
    low = tuning.low[0]
    high = tuning.high[0]
    count = max(2, int(np.ceil((high - low) / spacing_mm - 1e-9)) + 1)
    return np.column_stack([np.linspace(low, high, count), np.tile(x[1:], (count, 1))])


def _each(
    tuning: StiffnessTuning,
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    progress: Share | None,
) -> Iterator[tuple[Job, Result]]:
    """What `work` makes of every job, in threads, in order."""
    with side_by_side(tuning.workers) as pool:
        for k, pair in enumerate(zip(jobs, pool.map(work, jobs), strict=True)):
            yield pair
            if progress:
                progress((k + 1) / len(jobs))


def sweep(
    tuning: StiffnessTuning,
    x: np.ndarray,
    *,
    step_s: float,
    energies_every: int = 0,
    forces: bool = False,
    base: Mapping[str, float] | None = None,
    progress: Share | None = None,
) -> SettingSweep:
    """Walks every trial at settings x (m, P), or at its own of (T, m, P).

    Args:
        energies_every: settings from one with energies to the next, besides the last; 0 for no
            outcomes at all.
        forces: whether they are kept. base: as of `TrialTuning.at`.
    """
    settings = np.broadcast_to(x, (len(tuning.parts), *x.shape[-2:]))
    shape = settings.shape[:2]
    for part in tuning.parts:
        part.frame(step_s, base)  # made here: what threads share is not made by them
    grf: dict[tuple[int, int], np.ndarray] = {}

    def walked(job: tuple[int, range]) -> list[tuple[dict[str, dict[str, float]], bool] | str]:
        i, own = job
        part = tuning.parts[i]
        results: list[tuple[dict[str, dict[str, float]], bool] | str] = []
        found = part.at_each(
            settings[i, own.start : own.stop],
            step_s=step_s,
            base=base,
            sites=energies_every > 0,
        )
        for j, walk in zip(own, found, strict=True):
            if isinstance(walk, SimulationError):
                results.append(f"{part.label} at {settings[i, j][0]:g} mm: {walk}")
                continue
            if forces:
                grf[i, j] = walk.loads.grf[..., 0]
            energies = energies_every > 0 and (j % energies_every == 0 or j == shape[1] - 1)
            terms = tuning.combination.terms(walk.terms)
            numbers = {
                "costs": {name: value_of(parts) for name, parts in walk.terms.items()},
                "terms": {name: float(term[0]) for name, term in terms.items()},
                "outcomes": outcomes(part, walk, energies=energies) if energies_every else {},
            }
            results.append((numbers, bool(walk.walk.record.converged.all())))
        return results

    table: dict[str, dict[str, np.ndarray]] = {"costs": {}, "terms": {}, "outcomes": {}}
    failures: list[str] = []
    unconverged = 0
    jobs = [
        (i, range(j, min(j + WIDTH, shape[1])))
        for j in range(0, shape[1], WIDTH)
        for i in range(shape[0])
    ]
    for (i, own), results in _each(tuning, walked, jobs, progress):
        for j, result in zip(own, results, strict=True):
            if isinstance(result, str):
                failures.append(result)
                continue
            for kind, numbers in result[0].items():
                for name, value in numbers.items():
                    table[kind].setdefault(name, np.full(shape, np.nan))[i, j] = value
            unconverged += not result[1]
    return SettingSweep(x=x, **table, forces=grf, failures=tuple(failures), unconverged=unconverged)


def lowest(fulcrum_mm: np.ndarray, cost: np.ndarray) -> tuple[float, float]:
    """Where a curve (m,) is lowest and its value there, by a parabola through the lowest point and
    its neighbours."""
    if np.isnan(cost).all():
        return float("nan"), float("nan")
    i = int(np.nanargmin(cost))
    if 0 < i < len(cost) - 1 and not np.isnan(cost[i - 1 : i + 2]).any():
        a, b, c = np.polyfit(fulcrum_mm[i - 1 : i + 2] - fulcrum_mm[i], cost[i - 1 : i + 2], 2)
        if a > 0.0:
            shift = float(np.clip(-b / (2.0 * a), *(fulcrum_mm[[i - 1, i + 1]] - fulcrum_mm[i])))
            return float(fulcrum_mm[i]) + shift, float(a * shift**2 + b * shift + c)
    return float(fulcrum_mm[i]), float(cost[i])


def local_minima(cost: np.ndarray) -> list[int]:
    """Indices of the minima of a curve (m,), the ends among them, the lowest first."""
    filled = np.where(np.isnan(cost), np.inf, cost)
    before = np.append(np.inf, filled[:-1])
    after = np.append(filled[1:], np.inf)
    minima = np.flatnonzero(np.isfinite(filled) & (filled <= before) & (filled <= after))
    return sorted(minima.tolist(), key=lambda i: filled[i])


# Numbers of one walk, averaged over its stances.
#
# Peaks are those of the forces low-passed as for the costs, over stance with its margins. The
# loading rate is the mean slope of the vertical force from 20 to 80 % of its first peak, the
# largest of the first half of stance.


def outcomes(
    part: TrialTuning, result: SettingOutcome, *, energies: bool = True
) -> dict[str, float]:
    """GIVEN_OUTCOMES of one walk. Stored and returned energy take a third of a walk's time; they
    are NaN unless asked for."""
    frame = result.frame
    loads = result.loads
    inside = frame.inside > 0.0
    moments = np.abs(loads.joints[inside, :, 0] / frame.mass_kg).max(axis=0)
    peaks = dict(zip(part.options.joints, moments.tolist(), strict=True))
    socket = loads.socket[inside, :, 0]
    stored, returned = _energies(part, result.walk)[:2] if energies else (np.nan, np.nan)
    first, second, rate = _vertical_peaks(frame, loads.grf[:, 2, 0] / frame.weight_n)
    return {
        "stored_energy": stored,
        "returned_energy": returned,
        "push_off_work": -value_of(result.terms["push_off"]),
        "joint_work_energy": value_of(result.terms["metabolic"]),
        "hip_moment": peaks.get("hip_flexion", np.nan),
        "knee_moment": peaks.get("knee_angle", np.nan),
        "first_peak": first,
        "second_peak": second,
        "loading_rate": rate,
        "socket_force": float(np.linalg.norm(socket[:, :3], axis=1).max() / frame.weight_n),
        "socket_moment": float(np.linalg.norm(socket[:, 3:], axis=1).max() / frame.mass_kg),
        "force_change": float(np.sqrt(value_of(result.terms[CONSISTENCY]))),
    }


def _energies(part: TrialTuning, walk: Walk) -> tuple[float, float, float]:
    """Stored, returned (J) and push-off work on the shank (J/kg) by the energy ledger; means over
    whole stances."""
    energy = prosthesis_energy(part.walker, walk)
    rows = []
    time = energy.time_s
    for stance in find_stances(time, energy.vertical_n):
        if stance.complete:
            row = stance_energy(
                energy, stance, foot=part.trial.model.foot, fulcrum_m=float(walk.fulcrum_m[0])
            ).row
            late = (time >= stance.start_s + part.options.late_share * stance.duration_s) & (
                time <= stance.end_s
            )
            work = np.sum(np.maximum(energy.shank_power[late], 0.0)) * (time[1] - time[0])
            rows.append((row.stored_j, row.returned_j, work / part.trial.subject.mass_kg))
    stored, returned, pushed = np.mean(rows, axis=0).tolist() if rows else [np.nan] * 3
    return stored, returned, pushed


def _vertical_peaks(frame: StanceFrame, vertical: np.ndarray) -> tuple[float, float, float]:
    """First and second peak (BW) and loading rate (BW/s), means over stances."""
    time = frame.time_s
    rows = []
    margin = 0.5 * (frame.inside.sum() - frame.duration_s) / len(frame.stances)
    for stance in frame.stances:
        middle = 0.5 * (stance.start_s + stance.end_s)
        early = (time >= stance.start_s - margin) & (time <= middle)
        late = (time >= middle) & (time <= stance.end_s + margin)
        first = float(vertical[early].max())
        second = float(vertical[late].max())
        rising = np.maximum.accumulate(vertical[early][: int(vertical[early].argmax()) + 1])
        start, end = (
            float(np.interp(share * first, rising, time[early][: len(rising)])) for share in RISE
        )
        rows.append((first, second, (RISE[1] - RISE[0]) * first / max(end - start, frame.step_s)))
    first, second, rate = np.mean(rows, axis=0).tolist()
    return first, second, rate


# What the settings do under the load of the recorded setting, rather than under its motion.
#
# With the motion given a stiffer foot is pressed as far and bears more. Experiments compare
# settings under about the same load: people carry the same weight on any foot. Here the pelvis
# rises and sinks by what keeps the vertical force that of the trial's own setting
# (`walks.energy_ledger`); everything else of the motion stays. It is no prediction of
# how a person adapts, and no cost counts it; it tells the direction in which the device works.


def same_load_outcomes(
    tuning: StiffnessTuning, fulcrum_mm: np.ndarray, progress: Share
) -> dict[str, np.ndarray]:
    """SAME_LOAD at positions (T, k) of the fulcrum: by name, (T, k), NaN where no height keeps the
    load, or a walk fails."""

    def walked(job: tuple[int, float]) -> tuple[float, float, float]:
        part = tuning.parts[job[0]]
        try:
            same = walk_with_same_load(
                part.walker,
                part.trial,
                fulcrum_m=1e-3 * job[1],
                step_s=part.options.step_s,
                search_step_s=part.options.search_step_s,
            )
        except SimulationError:
            return np.nan, np.nan, np.nan
        return _energies(part, same.walk) if same.kept else (np.nan, np.nan, np.nan)

    energies = {name: np.full(fulcrum_mm.shape, np.nan) for name in SAME_LOAD}
    jobs = [(i, float(at)) for i, row in enumerate(fulcrum_mm) for at in dict.fromkeys(row)]
    for (i, at), numbers in _each(tuning, walked, jobs, progress):
        for name, value in zip(SAME_LOAD, numbers, strict=True):
            energies[name][i, fulcrum_mm[i] == at] = value
    return energies


def pareto(tuning: StiffnessTuning, swept: SettingSweep) -> list[ParetoPoint]:
    """For weights of the first of the options' two costs, each over its size, with the consistency
    beside them."""
    names = tuning.options.pareto
    size = tuning.size
    if not names or any(name not in swept.costs or name not in size for name in names):
        return []
    share = tuning.options.consistency_weight / tuning.options.consistency_bw**2
    rows = []
    for weight in np.linspace(0.0, 1.0, 11).tolist():
        where, _ = swept.lowest(
            {
                names[0]: weight / size[names[0]],
                names[1]: (1.0 - weight) / size[names[1]],
                CONSISTENCY: share,
            }
        )
        first, second = (
            float(np.interp(where, swept.fulcrum_mm, swept.costs[name].mean(axis=0)))
            for name in names
        )
        rows.append(ParetoPoint(weight, fulcrum_mm=where, first=first, second=second))
    return rows


def other_optima(
    tuning: StiffnessTuning, swept: SettingSweep, draws: Sequence[SettingSweep]
) -> list[ChangedOptimum]:
    """Where the cost is least with other weights of the consistency, and with each draw of the
    contact."""
    factors = tuning.combination.factors
    optima = {}
    if CONSISTENCY in factors:
        optima = {
            f"{what} the weight of the force's change": swept.lowest(
                {**factors, CONSISTENCY: factor * factors[CONSISTENCY]}
            )
            for factor, what in ((0.0, "without"), (0.5, "with half"), (2.0, "with twice"))
        }
    optima |= {f"draw {k + 1} of the contact": draw.lowest() for k, draw in enumerate(draws)}
    return [ChangedOptimum(what, fulcrum_mm=at, cost=cost) for what, (at, cost) in optima.items()]
