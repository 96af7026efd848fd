"""The model held against published effects of stiffness: under one load, in walks of their own
motion, and in strides that adapt (level 2 of a tuning), to the fulcrum's setting and to the heel's
stiffness.

Level 1 of a tuning keeps the motion, so it has no say here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.base.errors import FitError, InputError, SimulationError
from vsf_drake.base.files import resource, sha256, table_of
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.device.equal_load import at_equal_load, missed
from vsf_drake.device.stiffness_map.cells import with_heel
from vsf_drake.model.model_file import check_movable
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.events import Stance
from vsf_drake.motion.trial import Trial
from vsf_drake.optimal_control.outcomes import MEASURES, outcomes
from vsf_drake.optimal_control.search import (
    Fixed,
    StrideSearch,
    StrideTuning,
    eased,
    held_by,
    swept,
    tracked,
    unless_interrupted,
)
from vsf_drake.optimal_control.stride import MM, Stride, StrideOptions
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning.quantities import FREE_OUTCOMES
from vsf_drake.validation.energy_section import EnergyCase, walk_cases
from vsf_drake.validation.roll_over_section import (
    ISO_STEPS,
    QUICK_ISO_STEPS,
    QUICK_POSITIONS_M,
    walked_shapes,
)
from vsf_drake.validation.study import Study, StudyWalk
from vsf_drake.walks.numbers import known
from vsf_drake.walks.published import (
    LEVEL_2,
    LOAD,
    OWN_MOTION,
    REPRODUCED,
    TABLE,
    Evidence,
    MeasureVerdict,
    Size,
    Trend,
    published_effects,
    sizes,
    trends,
    verdicts,
)
from vsf_drake.walks.recorded_walk import reached

FORMAT = "vsf_drake published trends 2"
# of the walks whose energy is told, by whether it is the quick form
STEPS_S = {False: 2.5e-4, True: 2e-3}
HEELS = (0.5, 1.0, 2.0)
HEEL_AT_M = 0.108
# of the chosen weight of able-bodied walking, by which strides that adapt are held
WEIGHTS = 0.5, 1.0, 2.0
INTERVALS = 20
ADAPTED = MEASURES | {
    "first peak of the sound side": "intact_first_peak",
    "metabolic cost": "muscle_energy",
    "centre-of-mass push-off work": "com_push_off_work",
    "push-off work": "push_off_work",
}
"""By measure: the outcome of a stride that adapts which stands for it."""
AT_THE_HEEL = {
    "heel energy returned": ("returned_energy", *FREE_OUTCOMES["returned_energy"]),
    "heel loading rate": (
        "loading_rate",
        "largest rate of the vertical force early in stance, from one instant of "
        "the grid to the next",
        "BW/s",
    ),
    "stance knee flexion": (
        "knee_flexion",
        "largest prosthetic knee flexion early in stance",
        "deg",
    ),
    "knee extensor moment": (
        "knee_extensor_moment",
        "largest prosthetic knee extensor moment early in stance",
        "N m/kg",
    ),
}
"""The same of strides that adapt to the heel: the outcome, what it is, and its unit."""
STANDS_FOR = "push-off work", "dorsiflexion", "heel energy returned", "metabolic cost"
"""What of the model only stands for a measure: it has its sign, not its mean."""
WHOLE_STANCE = "what is given back over the whole stance, of which the heel's share is not known"
MADE = "SYNTHETIC walks: their forces were drawn without regard to the setting"
NO_STRIDE = "the person's own, and there is no stride that adapts (level 2) to tell it"
WHY_NOT = dict.fromkeys((*ADAPTED, *AT_THE_HEEL), NO_STRIDE) | {
    "energy taken in early": "the pylon's stiffness is not a setting of the model",
    "preferred stiffness against body mass": "the model prefers nothing",
}
"""By measure: why there is no evidence of it, whatever the trials."""


@dataclass(frozen=True, kw_only=True)
class TrendTable:
    """The content of published_trends.json."""

    format: str
    synthetic: bool  # whether any of the walks was made rather than recorded
    settings_mm: tuple[float, ...]  # under the load
    walked_mm: tuple[float, ...]  # of the walks
    walks: int
    mass_kg: float
    level_1: str
    measures: tuple[MeasureVerdict, ...]
    counts: dict[str, int]  # measures by verdict
    sizes: tuple[Size, ...]
    rows: tuple[Trend, ...]
    evidence: tuple[Evidence, ...]
    """from which, with the published table, all of these follow: see `judged`"""
    stiffness: dict[str, tuple[float, ...]]  # N m/(deg kg), of the ankle at each setting, by way
    missing: tuple[str, ...] = ()
    inputs: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def reproduced(self, *, by_foot_alone: bool) -> list[str]:
        """The measures that the foot alone reproduces under an equal load, or that only own motion
        or strides that adapt do."""
        return [
            one.measure
            for one in self.measures
            if one.verdict == REPRODUCED and (LOAD in one.by) == by_foot_alone
        ]

    @property
    def foot_s_own_signs(self) -> dict[str, list[str]]:
        """Of the signs of SIGNS_OF, those that hold at every step: by `load` with nobody on the
        foot, by `level_2` in strides that adapt, and `beyond` in those but not under the load."""
        own = [one for one in self.measures if one.measure in MEASURES]
        load = [one.measure for one in own if one.load == one.published]
        level_2 = [one.measure for one in own if one.level_2 == one.published]
        return {
            "load": load,
            "level_2": level_2,
            "beyond": [measure for measure in level_2 if measure not in load],
        }


def published_trends(study: Study, *, progress: Progress | None = None) -> TrendTable:
    """Rolls the study's foot at three settings under its subject's weight, takes its walks as they
    are, lets them adapt, and judges."""
    show = part_of(progress)
    subject = study.walks[0].recorded.subject
    quick = study.options.quick
    check_movable(study.model.foot, "Published effects are those of the setting")
    settings = reached(study.model.foot, QUICK_POSITIONS_M)
    show("rolling the foot", 0.0)
    loaded, load_stiffness = load_evidence(
        subject, study.model, settings, steps=QUICK_ISO_STEPS if quick else ISO_STEPS
    )
    walked, missing = own_motion_evidence(
        study, progress=lambda f: show("walking in small steps", 0.05 + 0.1 * f)
    )
    adapted, failed = level_2_evidence(study, progress=part_of(progress, 0.15, 0.85))
    evidence = (*loaded, *walked, *adapted)
    stiffness = {LOAD: tuple(load_stiffness)} | _own_stiffness(adapted)
    return TrendTable(
        format=FORMAT,
        synthetic=study.synthetic,
        settings_mm=tuple(1e3 * x for x in settings),
        walked_mm=tuple(setting.fulcrum_mm or 0.0 for setting in study.conditions()),
        walks=len(study.walks),
        mass_kg=subject.mass_kg,
        level_1="not applicable: it keeps the motion",
        evidence=evidence,
        stiffness=stiffness,
        missing=(*(f"{label}: {why}" for label, why in study.failed), *missing, *failed),
        inputs=dict(study.inputs) | {TABLE: sha256(resource(TABLE))},
        provenance=provenance(),
        **judged(evidence, stiffness),
    )


def judged(
    evidence: Sequence[Evidence], stiffness: Mapping[str, Sequence[float]]
) -> dict[str, Any]:
    """What the published table makes of the evidence: the fields `measures`, `counts`, `sizes` and
    `rows`."""
    effects = published_effects()
    rows = trends(evidence, effects, why_not=WHY_NOT)
    measures = verdicts(rows, effects, evidence)
    said = sorted({one.verdict for one in measures})
    return {
        "measures": tuple(measures),
        "rows": tuple(rows),
        "counts": {verdict: sum(one.verdict == verdict for one in measures) for verdict in said},
        "sizes": tuple(sizes(evidence, effects, stiffness=stiffness)),
    }


def _own_stiffness(adapted: Sequence[Evidence]) -> dict[str, tuple[float, ...]]:
    """Of the ankle in strides that adapt, as `EqualLoad.stiffness` of the foot alone."""
    means = {one.measure: [float(np.mean(values)) for values in one.values] for one in adapted}
    if not {"plantarflexor moment", "dorsiflexion"} <= means.keys():
        return {}
    return {
        LEVEL_2: tuple(
            moment / turn
            for moment, turn in zip(
                means["plantarflexor moment"], means["dorsiflexion"], strict=True
            )
        )
    }


def load_evidence(
    subject: Subject, model: ModelParameters, settings_m: Sequence[float], *, steps: int
) -> tuple[list[Evidence], list[float]]:
    """What the foot does under the ISO 22675 profile to the person's weight, and its stiffness at
    each setting, N m/(deg kg); SimulationError if a setting fails."""
    mass = subject.mass_kg
    settings = at_equal_load(subject, model, settings_m, steps=steps)
    heels = [
        at_equal_load(
            subject,
            dataclasses.replace(model, foot=with_heel(model.foot, ratio)),
            [HEEL_AT_M],
            steps=steps,
        )[0]
        for ratio in HEELS
    ]

    evidence = []
    for of, rolled in (("load", settings), ("load on heels", heels)):
        off = missed(rolled)
        for row in _measures(of):
            size = mass if row["unit"] == "J/kg" else 1.0
            stands = row["stands"].format(*HEELS)
            numbers = [(vars(one.row) | vars(one) | one.outcomes)[row["number"]] for one in rolled]
            evidence.append(
                _evidence(
                    row["measure"],
                    LOAD,
                    row["unit"],
                    f"{stands}; {off}" if off else stands,
                    [() if value is None else (float(value / size),) for value in numbers],
                    aside=row["aside"],
                )
            )
    return evidence, [row.stiffness for row in settings]


def _measures(of: str) -> list[dict[str, str]]:
    """What is had of the foot alone, over settings (`load`) or heels (`load on heels`), or of walks
    of their own motion: the measure, its unit, the number of an `EqualLoad`, of a stance or of a
    footfall (energies in J, of the whole person), what that is, and why it is never counted."""
    return [row for row in table_of("validation/evidence.csv") if row["of"] == of]


def _evidence(
    measure: str,
    way: str,
    unit: str,
    stands: str,
    values: Iterable[Iterable[float]],
    *,
    aside: str = "",
) -> Evidence:
    return Evidence(
        measure=measure,
        way=way,
        unit=unit,
        stands=stands,
        values=tuple(map(tuple, values)),
        same=measure not in STANDS_FOR,
        aside=aside,
    )


def own_motion_evidence(
    study: Study, *, progress: Callable[[float], None] | None = None
) -> tuple[list[Evidence], list[str]]:
    """What the walks have, each at the setting and with the motion of its recording, a repetition
    each; and what is not there. Nothing of one setting, or of several persons."""
    conditions = study.conditions()
    if len(conditions) < 2 or len({walk.trial.subject for walk in study.walks}) > 1:
        return [], ["Own motion needs walks of one person at two settings or more."]
    walks = [walk for own in conditions.values() for walk in own]
    step = STEPS_S[study.options.quick]
    energies = walk_cases(
        [
            EnergyCase(
                label=walk.label, trial=walk.trial, fulcrum_m=walk.trial.fulcrum_m, step_s=step
            )
            for walk in walks
        ],
        workers=study.options.workers,
        progress=progress,
    )
    numbers = []
    for walk, energy in zip(walks, energies, strict=True):
        own: dict[str, Any] = {}
        for one in energy.stances[:1]:
            own |= vars(one.row) | {"knee_flexor_nm": _late_flexor_moment(walk, one.stance)}
        for footfall, _ in walked_shapes(walk)[0][:1]:
            own |= vars(footfall.model)
        numbers.append((walk.setting, own))
    mass = study.walks[0].recorded.subject.mass_kg
    evidence = []
    aside = MADE if study.synthetic else ""
    for row in _measures("own motion"):
        size = mass if row["unit"].endswith("/kg") else 1.0
        values = [
            (known(own.get(row["number"]) for at, own in numbers if at == setting) / size).tolist()
            for setting in conditions
        ]
        if any(values):
            evidence.append(
                _evidence(
                    row["measure"], OWN_MOTION, row["unit"], row["stands"], values, aside=aside
                )
            )
    return evidence, [f"{one.case.label}: {one.failure}" for one in energies if one.failure]


def level_2_evidence(
    study: Study, *, progress: Progress | None = None
) -> tuple[list[Evidence], list[str]]:
    """What strides that adapt have, squared activations least: at the softest, a middle and the
    stiffest setting, and at the recorded one with HEELS. A repetition for the first walk of each
    setting, its mean over WEIGHTS; in the quick form one walk and one weight. And what is not
    there."""
    if len({walk.trial.subject for walk in study.walks}) > 1:
        return [], ["Strides that adapt need walks of one person."]
    first = [own[0] for own in study.conditions().values()]
    walks, weights = ([first[len(first) // 2]], (1.0,)) if study.options.quick else (first, WEIGHTS)
    # by walk and setting the outcomes
    found: dict[str, list[list[dict[str, float]]]] = {"setting": [], "heel": []}
    counts = dict.fromkeys(found, 0)
    missing = []
    for i, walk in enumerate(walks):
        show = part_of(progress, i / len(walks), 1.0 / len(walks), name=f"{walk.label}, adapting: ")
        try:
            by_kind = _adapted(walk.trial, weights, show)
        except (FitError, InputError, SimulationError) as error:
            missing.append(f"{walk.label}, adapting: {error}")
            continue
        for kind, by_weight in by_kind.items():
            whole = [rows for rows in by_weight if rows]
            counts[kind] += len(whole)
            if len(whole) < len(weights):
                missing.append(
                    f"{walk.label}, adapting: with {len(weights) - len(whole)} of {len(weights)} "
                    f"weights there is no stride at each {kind}."
                )
            if whole:
                found[kind].append(
                    [
                        {name: float(np.mean([row[name] for row in same])) for name in same[0]}
                        for same in zip(*whole, strict=True)
                    ]
                )
    mass = study.walks[0].recorded.subject.mass_kg
    evidence = []
    named = {measure: (name, *FREE_OUTCOMES[name]) for measure, name in ADAPTED.items()}
    for kind, measures in (("setting", named), ("heel", AT_THE_HEEL)):
        repetitions = found[kind]
        tried = (
            f"mean of {counts[kind]} of {len(walks) * len(weights)} strides that adapt, "
            f"{len(repetitions)} walks{', SYNTHETIC' if study.synthetic else ''}"
        )
        for measure, (name, label, unit) in measures.items() if repetitions else ():
            size = mass if unit == "J" else 1.0
            evidence.append(
                _evidence(
                    measure,
                    LEVEL_2,
                    "J/kg" if unit == "J" else unit,
                    f"{label}; {tried}",
                    [[row[name] / size for row in same] for same in zip(*repetitions, strict=True)],
                    aside=WHOLE_STANCE if measure == "heel energy returned" else "",
                )
            )
    return evidence, missing


def _adapted(
    trial: Trial, weights: Sequence[float], progress: Progress
) -> dict[str, list[list[dict[str, float]]]]:
    """By weight the outcomes at three settings and with HEELS, softest first, nothing where one has
    no stride. FitError where the recording cannot be tracked."""
    tuning = StrideTuning(
        [trial], cost="activation", options=StrideOptions(intervals=INTERVALS, positions=3)
    )
    recorded = unless_interrupted(tracked(tuning.stride, progress))
    if not recorded.success:
        raise FitError(f"the recorded stride could not be tracked: {recorded.message}")
    search = StrideSearch(
        dataclasses.replace(tuning.stride, consistent=recorded), "activation", progress=progress
    )
    sweep: list[Fixed] = []
    swept(search, recorded.last, sweep, chains=False)
    settings = [(row.fulcrum_mm, row.solution) for row in sweep if row.solution is not None]
    held = [held_by(search, weight * tuning.options.normal_weight, settings) for weight in weights]
    heels = [_on_a_heel(search, trial, ratio, recorded) for ratio in HEELS]
    own_mm = trial.fulcrum_m / MM
    on_heels = [
        [
            held_by(other, weight * tuning.options.normal_weight, [(own_mm, best)])
            for other, best in heels
            if best is not None
        ]
        for weight in weights
    ]
    return {
        "setting": [
            [outcomes(solution, other.stride) for solution in found]
            if len(found) == len(sweep) and all(solution.success for solution in found)
            else []
            for other, found in held
        ],
        "heel": [
            [_early(solution, other.stride, trial) for other, (solution,) in found]
            if len(found) == len(HEELS) and all(solution.success for _, (solution,) in found)
            else []
            for found in on_heels
        ],
    }


def _on_a_heel(
    search: StrideSearch, trial: Trial, ratio: float, recorded: TrajectorySolution
) -> tuple[StrideSearch, TrajectorySolution | None]:
    """The search of the same person on a heel so many times as stiff, and its best stride at the
    recorded setting."""
    foot = with_heel(trial.model.foot, ratio)
    walker = Walker(trial.subject, dataclasses.replace(trial.model, foot=foot))
    other = search.changed(model=SagittalModel(walker, offsets=trial.offsets))
    own_mm = trial.fulcrum_m / MM
    starts = recorded.last, eased(other, own_mm, recorded.last)[1]
    ends = [unless_interrupted(other.at(own_mm, start, f"heel {ratio:g}")) for start in starts]
    return other, min(
        (end for end in ends if end.success), key=lambda end: end.last_cost, default=None
    )


def _early(solution: TrajectorySolution, stride: Stride, trial: Trial) -> dict[str, float]:
    """The outcomes of AT_THE_HEEL, in the first half of prosthetic stance: BW/s, deg, N m/kg;
    energy, of the whole stance, in J."""
    y = solution.last_y()
    index = stride.function.index
    rows = np.flatnonzero(stride.reference.stance["prosthetic"])
    gap = np.flatnonzero(np.diff(rows) > 1)
    if len(gap):  # a stance that goes over the end of the period begins late in it
        rows = np.concatenate([rows[gap[0] + 1 :], rows[: gap[0] + 1]])
    early = rows[: len(rows) // 2]
    times = float(solution.last.p[-1]) * stride.grid.times_s
    force = y[[rows[0] - 1, *early], index("prosthetic_fz")[0]] / stride.model.weight
    knee = f"knee_angle_{trial.subject.prosthetic_side[0]}"
    return {
        "loading_rate": float(np.diff(force).max() / (times[1] - times[0])),
        "knee_flexion": float(np.degrees(y[early, index(f"q_{knee}")[0]].max())),
        "knee_extensor_moment": -float(y[early, index(f"torque_{knee}")[0]].min())
        / trial.subject.mass_kg,
        "returned_energy": outcomes(solution, stride)["returned_energy"],
    }


def _late_flexor_moment(walk: StudyWalk, stance: Stance) -> float:
    """Largest flexor moment (N m) of the prosthetic knee in the second half of a stance; knee
    flexion is positive."""
    result = walk.result
    name = f"knee_angle_{walk.trial.subject.prosthetic_side[0]}"
    middle_s = 0.5 * (stance.start_s + stance.end_s)
    late = (result.time_s >= middle_s) & (result.time_s <= stance.end_s)
    return float(result.generalized_force[late, result.coordinate_names.index(name)].max())
