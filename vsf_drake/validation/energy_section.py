"""Energy that the prosthetic foot stores, returns and loses in a step, and how well the ledger of
it closes.

What a softer setting does is asked three times: of the trials as recorded, each at its own
position; of each trial's load, kept while the fulcrum moves; and of each trial's motion, kept. The
last is no person's choice: a stiffer spring that is pressed as far bears more and stores more, k
x²/2. The verdict is of the first two.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import flat
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.sentences import say
from vsf_drake.base.threads import side_by_side
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.study import Section, Study
from vsf_drake.walks.energy_ledger import (
    PERCENT,
    TERMS,
    StanceEnergy,
    StanceNumbers,
    prosthesis_energy,
    stance_energy,
    walk_with_same_load,
)
from vsf_drake.walks.numbers import by_fulcrum, cells, spread
from vsf_drake.walks.quantities import known
from vsf_drake.walks.recorded_walk import reached, walkers_of

STEPS_S = {
    "full": (1.25e-4, 2.5e-4, 5e-4, 2e-3),
    "": (2.5e-4, 5e-4, 1e-3, 2e-3),
    "quick": (1e-3, 2e-3, 2e-3, 2e-3),
}
"""By the form of the study: steps of the walks that are reported, of their coarser twins, of the
walks at other positions, and of the search for those with the same load."""
ASKED_SHARE = 0.01
"""Of the stored energy within which the ledger has to close."""
SPREAD = ("stored_j", "returned_j", "return_ratio", "lost_j", "distal_peak_w", "distal_lowest_w")


@dataclass(frozen=True, kw_only=True)
class EnergyRow(StanceNumbers):
    """One stance of a walk."""

    label: str  # of the trial
    stance: int  # from 1
    coarse_remainder_max_j: float | None  # in twice the step; None where that walk failed

    @property
    def coarse_ratio(self) -> float | None:
        """That remainder in parts of this one; None where there is none of them."""
        coarse_j = self.coarse_remainder_max_j
        return coarse_j / self.remainder_max_j if coarse_j and self.remainder_max_j > 0.0 else None

    @property
    def beam_ratio(self) -> float | None:
        """What keel and support hold, in parts of the closed form."""
        held = self.keel_at_most_j + self.fulcrum_at_most_j
        return held / self.beam_j if self.beam_j else None


@dataclass(frozen=True, kw_only=True)
class MovedRow:
    """The first stance of a trial with the fulcrum elsewhere; what `SameLoad` has of its load, None
    where the motion is kept."""

    label: str
    fulcrum_mm: float
    stored_j: float
    returned_j: float
    return_ratio: float | None
    friction_loss_j: float
    late_load_n: float
    remainder_share: float | None
    off_bw: float | None
    height_mm: float | None


@dataclass(frozen=True, kw_only=True)
class EnergyCondition:
    """The stances at one position of the fulcrum."""

    fulcrum_mm: float
    n: int
    means: Mapping[str, float | None] = flat()
    """of SPREAD by its key, and the sample SD by `<key>_sd`"""


@dataclass(frozen=True, kw_only=True)
class Softer:
    """Whether an energy falls from each fulcrum position to the next stiffer one; None where
    nothing can be compared.
    """

    recorded: bool | None  # over the means of the recorded conditions
    same_load: bool | None  # in every trial that was walked at all positions
    same_load_against: tuple[str, ...]  # those in which it does not
    same_motion: bool | None
    both: bool | None  # under the same load and as recorded


@dataclass(frozen=True, kw_only=True)
class EnergyTable:
    """The energy section; the largest shares are over all stances, None if nothing was stored."""

    trials: tuple[EnergyRow, ...]
    conditions: tuple[EnergyCondition, ...]
    same_load: tuple[MovedRow, ...]
    same_motion: tuple[MovedRow, ...]
    terms: tuple[str, ...]  # by which the array `terms_j` is ordered
    step_s: float
    coarse_step_s: float
    moved_step_s: float
    asked_share: float
    ledger_remainder_share_max: float | None
    ledger_closes: bool | None
    balance_share_max: float | None
    distal_share_max: float | None
    result_remainder_share_max: float | None
    """of the whole person's ledger of the study's own walks"""
    result_step_s: float
    softer_stores_more: bool | None
    softer_returns_more: bool | None
    softer: Mapping[str, Softer]  # "stored_j", "returned_j"
    synthetic: bool


def energy_section(study: Study, *, progress: Progress | None = None) -> Section[EnergyTable]:
    """Walks every trial at a fine step, at twice that, and twice at the five published fulcrum
    positions.

    Arrays: `percent` (201,), `terms_j` (rows, len(terms), 201) by `terms`, `pylon_power_w` and
    `shank_power_w` (rows, 200).
    """
    fine, coarse_step, moved, search = STEPS_S[
        "quick" if study.options.quick else "full" if study.options.full else ""
    ]
    positions = reached(study.model.foot, PUBLISHED_FULCRUMS_M)
    own = [(walk, walk.trial.fulcrum_m) for walk in study.walks]
    elsewhere = [(walk, x) for walk in study.walks for x in positions]
    parts = [
        [
            EnergyCase(
                label=walk.label,
                trial=walk.trial,
                fulcrum_m=x,
                step_s=step,
                search_step_s=search_step,
            )
            for walk, x in places
        ]
        for places, step, search_step in (
            (own, fine, None),
            (own, coarse_step, None),
            (elsewhere, moved, None),
            (elsewhere, moved, search),
        )
    ]
    show = part_of(progress, share=0.95)
    every = iter(
        walk_cases(
            [*itertools.chain(*parts)],
            workers=study.options.workers,
            progress=lambda fraction: show("walking in small steps", fraction),
        )
    )
    reported, twins, kept, loaded = [[next(every) for _ in part] for part in parts]

    coarse = {
        (walk.case.label, i): stance.row.remainder_max_j
        for walk in twins
        for i, stance in enumerate(walk.stances)
    }
    trials = tuple(
        EnergyRow(
            **vars(stance.row),
            label=walk.case.label,
            stance=i + 1,
            coarse_remainder_max_j=coarse.get((walk.case.label, i)),
        )
        for walk in reported
        for i, stance in enumerate(walk.stances)
    )
    motion, load = (
        tuple(_moved(walk) for walk in walks if walk.stances) for walks in (kept, loaded)
    )
    conditions = tuple(_condition(x, rows) for x, rows in by_fulcrum(trials).items())
    persons = len({walk.trial.subject for walk in study.walks})
    judged = {
        key: _judged(load, motion, conditions if persons == 1 else (), key)
        for key in ("stored_j", "returned_j")
    }
    remainder, balance, distal = (
        max(known(getattr(row, f"{name}_share") for row in trials), default=None)
        for name in ("remainder", "balance", "distal")
    )
    table = EnergyTable(
        trials=trials,
        conditions=conditions,
        same_load=load,
        same_motion=motion,
        terms=TERMS,
        step_s=fine,
        coarse_step_s=coarse_step,
        moved_step_s=moved,
        asked_share=ASKED_SHARE,
        ledger_remainder_share_max=remainder,
        ledger_closes=None if remainder is None else remainder <= ASKED_SHARE,
        balance_share_max=balance,
        distal_share_max=distal,
        result_remainder_share_max=_result_remainder(study, reported),
        result_step_s=study.options.step_s,
        softer_stores_more=judged["stored_j"].both,
        softer_returns_more=judged["returned_j"].both,
        softer=judged,
        synthetic=study.synthetic,
    )
    curves = [stance.curves for walk in reported for stance in walk.stances]
    names = ("terms_j", "pylon_power_w", "shank_power_w") if curves else ()
    return Section(
        table=table,
        arrays={"percent": PERCENT}
        | {name: np.array([one[name] for one in curves]) for name in names},
        missing=tuple(
            say(
                "energy",
                "missing",
                reaches_all=len(positions) == len(PUBLISHED_FULCRUMS_M),
                walks=[*reported, *kept, *loaded],
                reported=reported,
                conditions=conditions,
                persons=persons,
            )
        ),
    )


def _moved(walk: EnergyWalk) -> MovedRow:
    row = walk.stances[0].row
    return MovedRow(
        label=walk.case.label,
        fulcrum_mm=row.fulcrum_mm,
        stored_j=row.stored_j,
        returned_j=row.returned_j,
        return_ratio=row.return_ratio,
        friction_loss_j=row.terms_j["friction_loss_j"],
        late_load_n=row.late_load_n,
        remainder_share=row.remainder_share,
        off_bw=walk.off_bw,
        height_mm=walk.height_mm,
    )


def _result_remainder(study: Study, reported: Sequence[EnergyWalk]) -> float | None:
    """What the whole person's ledger misses at most in a stance of the study's own walks, over what
    the foot stores."""
    shares = []
    for walk, own in zip(study.walks, reported, strict=True):
        result = walk.result
        if "remainder" not in result.energy_names:
            continue
        remainder = result.energy_j[:, result.energy_names.index("remainder")]
        for one in own.stances:
            after = result.time_s >= one.stance.start_s
            inside = remainder[after & (result.time_s <= one.stance.end_s)]
            if one.row.stored_j > 0.0 and inside.size:
                shares.append(float(np.abs(inside - inside[0]).max()) / one.row.stored_j)
    return max(shares, default=None)


def _condition(fulcrum_mm: float, rows: Sequence[EnergyRow]) -> EnergyCondition:
    """Mean and sample SD (None for one stance) over the stances at one position."""
    means = {key: spread(getattr(row, key) for row in rows) for key in SPREAD}
    return EnergyCondition(fulcrum_mm=fulcrum_mm, n=len(rows), means=cells(means))


def _judged(
    load: Sequence[MovedRow],
    motion: Sequence[MovedRow],
    conditions: Sequence[EnergyCondition],
    key: str,
) -> Softer:
    """Whether the energy `key` falls with the setting's stiffness."""
    means = [mean for row in conditions if (mean := row.means[key]) is not None]
    recorded = _falls(means)
    in_load = _falls_by_trial(load, key)
    in_motion = _falls_by_trial(motion, key)
    same_load = all(in_load.values()) if in_load else None
    return Softer(
        recorded=recorded,
        same_load=same_load,
        same_load_against=tuple(label for label, falls in in_load.items() if not falls),
        same_motion=all(in_motion.values()) if in_motion else None,
        both=None if same_load is None or recorded is None else same_load and recorded,
    )


def _falls(values: Sequence[float]) -> bool | None:
    return bool(np.all(np.diff(values) < 0)) if len(values) > 1 else None


def _falls_by_trial(rows: Sequence[MovedRow], key: str) -> dict[str, bool]:
    """Of the trials that were walked at all positions, if these are several."""
    curves: dict[str, list[float]] = {}
    positions = by_fulcrum(rows)
    for row in itertools.chain(*positions.values()):
        curves.setdefault(row.label, []).append(getattr(row, key))
    return {
        label: falls
        for label, values in curves.items()
        if len(values) == len(positions) and (falls := _falls(values)) is not None
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyCase:
    """A trial to be walked with the fulcrum at `fulcrum_m` (m from A) in steps of `step_s`; `label`
    is the trial's."""

    label: str
    trial: Trial
    fulcrum_m: float
    step_s: float
    search_step_s: float | None = None
    """Step of the walks that look for the pelvis' height with which the load is that of the trial's
    own position; None for the recorded motion as it is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyWalk:
    """What became of a case: its complete stances, or why there are none; `off_bw`, `height_mm`:
    see `SameLoad`."""

    case: EnergyCase
    stances: tuple[StanceEnergy, ...] = ()
    unconverged_steps: int = 0
    off_bw: float | None = None
    height_mm: float | None = None
    failure: str = ""


def walk_cases(
    cases: Sequence[EnergyCase],
    *,
    workers: int | None,
    progress: Callable[[float], None] | None = None,
) -> list[EnergyWalk]:
    """Walks every case, in their order, in as many threads (None: one a core); one that fails stops
    no other."""
    walkers = walkers_of(case.trial for case in cases)  # before there are threads, which share them
    walks: list[EnergyWalk] = []
    with side_by_side(max(1, min(workers or os.cpu_count() or 1, len(cases)))) as pool:
        for walk in pool.map(_walk, walkers, cases):
            walks.append(walk)
            if progress:
                progress(len(walks) / len(cases))
    return walks


def _walk(walker: Walker, case: EnergyCase) -> EnergyWalk:
    trial = case.trial
    same = None
    try:
        if case.search_step_s is None:
            walk = walker.walk(
                trial.trajectory,
                fulcrum_m=case.fulcrum_m,
                start_s=trial.start_s,
                end_s=trial.end_s,
                step_s=case.step_s,
                offsets=trial.offsets,
            )
        else:
            same = walk_with_same_load(
                walker,
                trial,
                fulcrum_m=case.fulcrum_m,
                step_s=case.step_s,
                search_step_s=case.search_step_s,
            )
            walk = same.walk
    except (InputError, SimulationError) as error:
        return EnergyWalk(case=case, failure=str(error))
    if same and not same.kept:
        return EnergyWalk(case=case, failure=say("energy", "not_kept", off_bw=same.off_bw)[0])
    energy = prosthesis_energy(walker, walk)
    stances = tuple(
        stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=case.fulcrum_m)
        for stance in find_stances(energy.time_s, energy.vertical_n)
        if stance.complete
    )
    if not stances:
        return EnergyWalk(case=case, failure="the model's foot has no whole stance within the walk")
    return EnergyWalk(
        case=case,
        stances=stances,
        unconverged_steps=int(np.sum(~walk.record.converged)),
        off_bw=same.off_bw if same else None,
        height_mm=same.height_mm if same else None,
    )
