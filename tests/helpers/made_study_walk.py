"""Walks of a validation study made from formulas, or real ones with another plate."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

from made_results import make_plate, make_walk

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.validation.study import Study, StudyWalk
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.metrics import walk_metrics


def made_study_walk(
    label="made", *, fulcrum_m=0.066, role="held out", plate=None, result=None
) -> StudyWalk:
    """A walk of `made_results` as one of a study; it cannot be walked again."""
    plate, result = plate or make_plate(), result or make_walk()
    comparison = compare(result, plate)
    trial = SimpleNamespace(
        name=label,
        fulcrum_m=fulcrum_m,
        synthetic=True,
        prosthetic_plate=plate,
        trajectory=CoordinateTrajectory(
            result.time_s, result.prescribed_q, result.prescribed_names
        ),
    )
    return StudyWalk(
        label=label,
        role=role,
        recorded=trial,
        trial=trial,
        result=result,
        comparison=comparison,
        metrics=walk_metrics(result, plate, comparison=comparison),
        warnings=(),
    )


def with_plate(walk: StudyWalk, **changes) -> StudyWalk:
    """A real walk, scored against a plate of which something is different."""
    plate = dataclasses.replace(walk.recorded.prosthetic_plate, **changes)
    side = walk.trial.subject.prosthetic_side
    recorded, trial = (
        dataclasses.replace(t, plates=t.plates | {side: plate}) for t in (walk.recorded, walk.trial)
    )
    comparison = compare(walk.result, plate)
    return dataclasses.replace(
        walk,
        recorded=recorded,
        trial=trial,
        comparison=comparison,
        metrics=walk_metrics(walk.result, plate, comparison=comparison),
    )


def with_walks(study: Study, *walks: StudyWalk) -> Study:
    """The study of other walks."""
    return dataclasses.replace(study, walks=walks)
