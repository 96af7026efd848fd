"""The model held against published effects of stiffness: under one load, in walks of their own
motion, and in strides that adapt (level 2 of a tuning), to the fulcrum's setting and to the heel's
stiffness.

Level 1 of a tuning keeps the motion, so it has no say here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.base.errors import FitError, InputError, SimulationError
from vsf_drake.base.files import resource, sha256
from vsf_drake.base.progress import Progress
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.device.equal_load import EqualLoad, at_equal_load, missed
from vsf_drake.device.stiffness_map.cells import with_heel
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.trial import Trial
from vsf_drake.optimal_control import StrideOptions, StrideTuning
from vsf_drake.optimal_control.outcomes import KINDS, MEASURES, outcomes
from vsf_drake.optimal_control.search import (
    Fixed,
    StrideSearch,
    eased,
    held_by,
    swept,
    tracked,
    unless_interrupted,
)
from vsf_drake.optimal_control.stride import MM, Stride
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.energy_section import EnergyCase, walk_cases
from vsf_drake.validation.roll_over_section import (
    ISO_STEPS,
    QUICK_ISO_STEPS,
    QUICK_POSITIONS_M,
    walked_shapes,
)
from vsf_drake.validation.study import Study, StudyWalk
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
    "heel energy returned": ("returned_energy", KINDS["returned_energy"][0]),
    "heel loading rate": (
        "loading_rate",
        "largest rate of the vertical force early in stance, from one instant of "
        "the grid to the next",
    ),
    "stance knee flexion": ("knee_flexion", "largest prosthetic knee flexion early in stance"),
    "knee extensor moment": (
        "knee_extensor_moment",
        "largest prosthetic knee extensor moment early in stance",
    ),
}
"""The same of strides that adapt to the heel: the outcome, and what it is."""
HEEL_UNITS = {
    "returned_energy": "J/kg",
    "loading_rate": "BW/s",
    "knee_flexion": "deg",
    "knee_extensor_moment": "N m/kg",
}
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
    show = progress or (lambda what, fraction: None)
    subject = study.walks[0].recorded.subject
    quick = study.options.quick
    settings = reached(study.model.foot, QUICK_POSITIONS_M)
    show("rolling the foot", 0.0)
    loaded, load_stiffness = load_evidence(
        subject, study.model, settings, steps=QUICK_ISO_STEPS if quick else ISO_STEPS
    )
    walked, missing = own_motion_evidence(
        study, progress=lambda f: show("walking in small steps", 0.05 + 0.1 * f)
    )
    adapted, failed = level_2_evidence(study, progress=lambda what, f: show(what, 0.15 + 0.85 * f))
    evidence = (*loaded, *walked, *adapted)
    stiffness = {LOAD: tuple(load_stiffness)} | _own_stiffness(adapted)
    return TrendTable(
        format=FORMAT,
        synthetic=study.synthetic,
        settings_mm=tuple(1e3 * x for x in settings),
        walked_mm=tuple(study.conditions()),
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

    def evidence(
        measure: str,
        unit: str,
        stands: str,
        rows: Sequence[EqualLoad],
        value: Callable[[EqualLoad], float | None],
        aside: str = "",
    ) -> Evidence:
        known = [value(row) for row in rows]
        off = missed(rows)
        return Evidence(
            measure=measure,
            way=LOAD,
            unit=unit,
            stands=f"{stands}; {off}" if off else stands,
            aside=aside,
            same=measure not in STANDS_FOR,
            values=tuple(() if each is None else (float(each),) for each in known),
        )

    def outcome(name: str, size: float = 1.0) -> Callable[[EqualLoad], float]:
        return lambda row: row.outcomes[name] / size

    heel = f"with {HEELS[0]:g}, {HEELS[1]:g} and {HEELS[2]:g} times the heel's stiffness"
    nobody = "there is no knee: a point where the person's is, on the pylon's line"
    return [
        evidence(
            "energy stored",
            "J/kg",
            "largest in keel, fulcrum and foam late in stance",
            settings,
            outcome("stored_energy", mass),
        ),
        evidence(
            "energy returned",
            "J/kg",
            "given back after that",
            settings,
            outcome("returned_energy", mass),
        ),
        evidence(
            "push-off work",
            "J/kg",
            "energy given back late in stance stands for it",
            settings,
            outcome("returned_energy", mass),
            "the same number as energy returned, which is counted",
        ),
        evidence(
            "push-off power",
            "W/kg",
            "largest rate of giving back, over 20 ms",
            settings,
            outcome("push_off_power"),
            "the load sets the pace, not a person",
        ),
        evidence(
            "roll-over radius",
            "m",
            "circle nearest to the roll-over shape",
            settings,
            lambda row: row.row.radius_m,
        ),
        evidence(
            "effective foot length ratio",
            "m/m",
            "from the rear end of the sole",
            settings,
            lambda row: row.row.effective_foot_length_ratio,
        ),
        evidence(
            "plantarflexor moment",
            "N m/kg",
            "largest moment about the pylon's end that turns the toe up",
            settings,
            outcome("ankle_moment"),
        ),
        evidence(
            "dorsiflexion",
            "deg",
            "largest turn of the keel's end stands for the angle",
            settings,
            outcome("dorsiflexion"),
        ),
        evidence(
            "knee flexor moment",
            "N m/kg",
            "largest moment of the ground's force about the knee late in stance",
            settings,
            outcome("knee_flexor_moment"),
            nobody,
        ),
        evidence(
            "heel energy returned",
            "J/kg",
            f"what is held in the first half, {heel}, stands for it",
            heels,
            lambda row: row.early_j / mass,
        ),
        evidence(
            "knee extensor moment",
            "N m/kg",
            f"largest moment of the ground's force about the knee early in stance, {heel}",
            heels,
            lambda row: row.knee_extensor_moment,
            nobody,
        ),
    ], [row.stiffness for row in settings]


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
    mass = study.walks[0].recorded.subject.mass_kg
    found: dict[str, dict[float, list[float]]] = {}
    missing = [f"{one.case.label}: {one.failure}" for one in energies if one.failure]
    for walk, energy in zip(walks, energies, strict=True):
        numbers: dict[str, float | None] = {}
        if energy.stances:
            row = energy.stances[0].row
            numbers = {
                "energy stored": row.stored_j / mass,
                "energy returned": row.returned_j / mass,
                "push-off work": row.returned_j / mass,
                "push-off power": row.distal_peak_w / mass,
                "knee flexor moment": _late_flexor_moment(
                    walk, energy.stances[0].stance.start_s, energy.stances[0].stance.end_s
                )
                / mass,
            }
        shapes, _ = walked_shapes(walk)
        if shapes:
            numbers |= {
                "roll-over radius": shapes[0][0].model.radius_m,
                "effective foot length ratio": shapes[0][0].model.effective_foot_length_ratio,
            }
        for measure, value in numbers.items():
            if value is not None and np.isfinite(value):
                found.setdefault(measure, {x: [] for x in conditions})[walk.fulcrum_mm].append(
                    value
                )
    stands = {
        "energy stored": ("J/kg", "largest in keel, fulcrum and foam in a stance"),
        "energy returned": ("J/kg", "given back after that"),
        "push-off work": ("J/kg", "energy given back stands for it"),
        "push-off power": ("W/kg", "largest distal power of the pylon"),
        "knee flexor moment": (
            "N m/kg",
            "largest load that drives the knee in the second half of stance",
        ),
        "roll-over radius": ("m", "circle nearest to the roll-over shape, seen from the shank"),
        "effective foot length ratio": (
            "m/m",
            "from the rear end of the sole, seen from the shank",
        ),
    }
    return [
        Evidence(
            measure=measure,
            way=OWN_MOTION,
            unit=stands[measure][0],
            stands=stands[measure][1],
            same=measure not in STANDS_FOR,
            aside=MADE if study.synthetic else "",
            values=tuple(map(tuple, by_setting.values())),
        )
        for measure, by_setting in found.items()
    ], missing


def level_2_evidence(
    study: Study, *, progress: Progress | None = None
) -> tuple[list[Evidence], list[str]]:
    """What strides that adapt have, squared activations least: at the softest, a middle and the
    stiffest setting, and at the recorded one with HEELS. A repetition for the first walk of each
    setting, its mean over WEIGHTS; in the quick form one walk and one weight. And what is not
    there."""
    show = progress or (lambda what, fraction: None)
    if len({walk.trial.subject for walk in study.walks}) > 1:
        return [], ["Strides that adapt need walks of one person."]
    first = [own[0] for own in study.conditions().values()]
    walks, weights = ([first[len(first) // 2]], (1.0,)) if study.options.quick else (first, WEIGHTS)
    # by walk and setting the outcomes
    found: dict[str, list[list[dict[str, float]]]] = {"setting": [], "heel": []}
    counts = dict.fromkeys(found, 0)
    missing = []
    for i, walk in enumerate(walks):

        def each(what: str, fraction: float, i: int = i, label: str = walk.label) -> None:
            show(f"{label}, adapting: {what}", (i + fraction) / len(walks))

        try:
            by_kind = _adapted(walk.trial, weights, each)
        except (FitError, InputError, SimulationError) as error:
            missing.append(f"{walk.label}, adapting: {error}")
            continue
        for kind, by_weight in by_kind.items():
            known = [rows for rows in by_weight if rows]
            if len(known) < len(weights):
                lost = f"{len(weights) - len(known)} of {len(weights)} weights"
                missing.append(
                    f"{walk.label}, adapting: with {lost} there is no stride at each {kind}."
                )
            if known:
                counts[kind] += len(known)
                found[kind].append(
                    [
                        {
                            name: float(np.mean([rows[k][name] for rows in known]))
                            for name in known[0][k]
                        }
                        for k in range(len(known[0]))
                    ]
                )
    mass = study.walks[0].recorded.subject.mass_kg
    evidence = []
    named = {measure: (name, *KINDS[name]) for measure, name in ADAPTED.items()}
    heel = {
        measure: (name, label, HEEL_UNITS[name]) for measure, (name, label) in AT_THE_HEEL.items()
    }
    for kind, measures in (("setting", named), ("heel", heel)):
        repetitions = found[kind]
        tried = (
            f"mean of {counts[kind]} of {len(walks) * len(weights)} strides that adapt, "
            f"{len(repetitions)} walks"
        )
        tried += ", SYNTHETIC" if study.synthetic else ""
        for measure, (name, label, unit) in measures.items() if repetitions else ():
            size = mass if name in ("stored_energy", "returned_energy") else 1.0
            evidence.append(
                Evidence(
                    measure=measure,
                    way=LEVEL_2,
                    unit="J/kg" if size == mass else unit,
                    stands=f"{label}; {tried}",
                    same=measure not in STANDS_FOR,
                    aside=WHOLE_STANCE if measure == "heel energy returned" else "",
                    values=tuple(
                        tuple(rows[k][name] / size for rows in repetitions)
                        for k in range(len(repetitions[0]))
                    ),
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


def _late_flexor_moment(walk: StudyWalk, start_s: float, end_s: float) -> float:
    """Largest flexor moment (N m) of the prosthetic knee in the second half of a stance; knee
    flexion is positive."""
    result = walk.result
    name = f"knee_angle_{walk.trial.subject.prosthetic_side[0]}"
    late = (result.time_s >= 0.5 * (start_s + end_s)) & (result.time_s <= end_s)
    return float(result.generalized_force[late, result.coordinate_names.index(name)].max())
