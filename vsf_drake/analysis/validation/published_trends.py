"""The model held against published effects of stiffness: under one load, in walks of their own motion, and in strides
that adapt (level 2 of a tuning).

Level 1 of a tuning keeps the motion, so it has no say here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.published import (
    LEVEL_2,
    LOAD,
    OWN_MOTION,
    Evidence,
    Trend,
    published_effects,
    trends,
)
from vsf_drake.analysis.stiffness_map.cells import Cell, iso_22675, roll_cells, with_heel
from vsf_drake.analysis.tuning.level2 import StrideOptions, StrideTuning
from vsf_drake.analysis.tuning.level2.outcomes import KINDS, MEASURES, outcomes
from vsf_drake.analysis.tuning.level2.search import (
    Fixed,
    StrideSearch,
    held_by,
    swept,
    tracked,
    unless_interrupted,
)
from vsf_drake.analysis.validation.energy_section import EnergyCase, walk_cases
from vsf_drake.analysis.validation.roll_over_section import (
    DURATION_S,
    ISO_STEPS,
    QUICK_ISO_STEPS,
    QUICK_POSITIONS_M,
    iso_roll_over,
    walked_shapes,
)
from vsf_drake.analysis.validation.study import Progress, Study, StudyWalk, reached
from vsf_drake.errors import FitError, InputError, SimulationError
from vsf_drake.motion.trial import Trial
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.archive import provenance

FORMAT = "vsf_drake published trends 1"
STEPS_S = {
    False: 2.5e-4,
    True: 2e-3,
}  # of the walks whose energy is told, by whether it is the quick form
HEELS, HEEL_AT_M = (0.5, 1.0, 2.0), 0.108
WEIGHTS = (
    0.5,
    1.0,
    2.0,
)  # of the chosen weight of able-bodied walking, by which strides that adapt are held
ADAPTED = MEASURES | {
    "first peak of the sound side": "intact_first_peak",
    "metabolic cost": "muscle_energy",
    "centre-of-mass push-off work": "com_push_off_work",
}
"""By measure: the outcome of a stride that adapts which stands for it."""
WHY_NOT = dict.fromkeys(
    ADAPTED, "the person's own, and no stride that adapts (level 2) was found"
) | {
    "heel loading rate": "the force is given under a load, and a synthetic strike is no person's",
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
    rows: tuple[Trend, ...]
    counts: dict[str, int]  # rows by verdict
    missing: tuple[str, ...] = ()
    inputs: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)


def published_trends(study: Study, *, progress: Progress | None = None) -> TrendTable:
    """Rolls the study's foot at three settings under its subject's weight, takes its walks as they are, and judges."""
    show = progress or (lambda what, fraction: None)
    mass, quick = study.walks[0].recorded.subject.mass_kg, study.options.quick
    settings = reached(study.model.foot, QUICK_POSITIONS_M)
    show("rolling the foot", 0.0)
    loaded = load_evidence(
        study.model.foot, settings, mass_kg=mass, steps=QUICK_ISO_STEPS if quick else ISO_STEPS
    )
    walked, missing = own_motion_evidence(
        study, progress=lambda f: show("walking in small steps", 0.1 + 0.2 * f)
    )
    adapted, failed = level_2_evidence(study, progress=lambda what, f: show(what, 0.3 + 0.7 * f))
    rows = tuple(trends([*loaded, *walked, *adapted], published_effects(), why_not=WHY_NOT))
    return TrendTable(
        format=FORMAT,
        synthetic=study.synthetic,
        settings_mm=tuple(1e3 * x for x in settings),
        walked_mm=tuple(study.conditions()),
        walks=len(study.walks),
        mass_kg=mass,
        level_1="not applicable: it keeps the motion",
        rows=rows,
        missing=(*(f"{label}: {why}" for label, why in study.failed), *missing, *failed),
        inputs=dict(study.inputs),
        counts={
            verdict: sum(row.verdict == verdict for row in rows)
            for verdict in sorted({r.verdict for r in rows})
        },
        provenance=provenance(),
    )


def load_evidence(
    foot: FootParameters, settings_m: Sequence[float], *, mass_kg: float, steps: int
) -> list[Evidence]:
    """What the foot does under the ISO 22675 profile to the person's weight; SimulationError if a setting fails."""
    rows, _, failed = iso_roll_over(foot, settings_m, force_n=mass_kg * GRAVITY, steps=steps)
    load = iso_22675(DURATION_S / steps)
    rolled = roll_cells(
        foot,
        load,
        [
            Cell(
                mass_kg=mass_kg,
                slope_deg=0.0,
                fulcrum_mm=1e3 * x,
                alignment_deg=0.0,
                heel_ratio=1.0,
            )
            for x in settings_m
        ],
    )
    heels = [
        iso_roll_over(with_heel(foot, ratio), [HEEL_AT_M], force_n=mass_kg * GRAVITY, steps=steps)
        for ratio in HEELS
    ]
    if len(rows) < len(settings_m) or not all(curves for _, curves, _ in heels):
        raise SimulationError(f"a setting cannot be rolled: {'; '.join(failed)}", time_s=0.0)
    early = [
        curves[f"iso_{1e3 * HEEL_AT_M:.0f}_strain_j"][
            curves["iso_time_s"] <= 0.5 * DURATION_S
        ].max()
        for _, curves, _ in heels
    ]

    def evidence(measure: str, unit: str, stands: str, values: Sequence[float | None]) -> Evidence:
        return Evidence(
            measure=measure,
            way=LOAD,
            unit=unit,
            stands=stands,
            values=tuple(() if value is None else (float(value),) for value in values),
        )

    stored, returned = (
        [each.values[name] / mass_kg for each in rolled] for name in ("stored", "returned")
    )
    return [
        evidence(
            "energy stored", "J/kg", "largest in keel, fulcrum and foam late in stance", stored
        ),
        evidence("energy returned", "J/kg", "given back after that", returned),
        evidence(
            "push-off work", "J/kg", "energy given back late in stance stands for it", returned
        ),
        evidence(
            "roll-over radius",
            "m",
            "circle nearest to the roll-over shape",
            [row.radius_m for row in rows],
        ),
        evidence(
            "effective foot length ratio",
            "m/m",
            "from the rear end of the sole",
            [row.effective_foot_length_ratio for row in rows],
        ),
        evidence(
            "plantarflexor moment",
            "N m/kg",
            "largest moment about the pylon's end that turns the toe up",
            [row.dorsiflexing_moment_nm / mass_kg for row in rows],
        ),
        evidence(
            "dorsiflexion",
            "mm",
            "deflection of the forefoot stands for the angle",
            [row.deflection_forefoot_mm for row in rows],
        ),
        evidence(
            "heel energy returned",
            "J/kg",
            f"what is held in the first half, with {HEELS[0]:g}, {HEELS[1]:g} and "
            f"{HEELS[2]:g} times the heel's stiffness, stands for it",
            [value / mass_kg for value in early],
        ),
    ]


def own_motion_evidence(
    study: Study, *, progress: Callable[[float], None] | None = None
) -> tuple[list[Evidence], list[str]]:
    """What the walks have, each at the setting and with the motion of its recording, a repetition each; and what is
    not there. Nothing of one setting, or of several persons."""
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
    made = "; SYNTHETIC walks, which are no adaptation of a person" if study.synthetic else ""
    return [
        Evidence(
            measure=measure,
            way=OWN_MOTION,
            unit=stands[measure][0],
            stands=stands[measure][1] + made,
            values=tuple(map(tuple, by_setting.values())),
        )
        for measure, by_setting in found.items()
    ], missing


def level_2_evidence(
    study: Study, *, progress: Progress | None = None
) -> tuple[list[Evidence], list[str]]:
    """What strides that adapt have at the softest, a middle and the stiffest setting, squared activations least: a
    repetition for the first walk of each setting, its mean over WEIGHTS; in the quick form one walk and one weight. And
    what is not there."""
    show = progress or (lambda what, fraction: None)
    if len({walk.trial.subject for walk in study.walks}) > 1:
        return [], ["Strides that adapt need walks of one person."]
    first = [own[0] for own in study.conditions().values()]
    walks, weights = ([first[len(first) // 2]], (1.0,)) if study.options.quick else (first, WEIGHTS)
    repetitions: list[list[dict[str, float]]] = []
    missing, count = [], 0
    for i, walk in enumerate(walks):

        def each(what: str, fraction: float, i: int = i, label: str = walk.label) -> None:
            show(f"{label}, adapting: {what}", (i + fraction) / len(walks))

        try:
            found = [rows for rows in _adapted(walk.trial, weights, each) if rows]
        except (FitError, InputError, SimulationError) as error:
            missing.append(f"{walk.label}, adapting: {error}")
            continue
        if len(found) < len(weights):
            lost = f"{len(weights) - len(found)} of {len(weights)} weights"
            missing.append(
                f"{walk.label}, adapting: with {lost} there is no stride at each setting."
            )
        if found:
            count += len(found)
            repetitions.append(
                [
                    {
                        name: float(np.mean([rows[k][name] for rows in found]))
                        for name in ADAPTED.values()
                    }
                    for k in range(len(found[0]))
                ]
            )
    mass, evidence = study.walks[0].recorded.subject.mass_kg, []
    stands = (
        f"; strides that adapt: {count} of {len(walks) * len(weights)}, walks: {len(repetitions)}"
    )
    made = ", SYNTHETIC" if study.synthetic else ""
    for measure, name in ADAPTED.items() if repetitions else ():
        label, unit = KINDS[name]
        size, unit = (mass, "J/kg") if unit == "J" else (1.0, unit)
        evidence.append(
            Evidence(
                measure=measure,
                way=LEVEL_2,
                unit=unit,
                stands=label + stands + made,
                values=tuple(
                    tuple(rows[k][name] / size for rows in repetitions)
                    for k in range(len(repetitions[0]))
                ),
            )
        )
    return evidence, missing


def _adapted(
    trial: Trial, weights: Sequence[float], progress: Progress
) -> list[list[dict[str, float]]]:
    """By weight the outcomes at three settings, softest first, nothing where one has no stride. FitError where the
    recording cannot be tracked."""
    tuning = StrideTuning(
        [trial], cost="activation", options=StrideOptions(intervals=20, positions=3)
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
    return [
        [outcomes(solution, other.stride) for solution in found]
        if len(found) == len(sweep) and all(solution.success for solution in found)
        else []
        for other, found in held
    ]


def _late_flexor_moment(walk: StudyWalk, start_s: float, end_s: float) -> float:
    """Largest flexor moment (N m) of the prosthetic knee in the second half of a stance; knee flexion is positive."""
    result = walk.result
    name = f"knee_angle_{walk.trial.subject.prosthetic_side[0]}"
    late = (result.time_s >= 0.5 * (start_s + end_s)) & (result.time_s <= end_s)
    return float(result.generalized_force[late, result.coordinate_names.index(name)].max())
