"""The paper's study on any trials: bench, standing, walking, energy, roll-over, what it can tell apart, sensitivity.

`make_study` reads and walks the trials; each section is a function of the study.
"""

from vsf_drake.analysis.validation.study import (
    Section,
    Study,
    StudyOptions,
    StudyWalk,
    ValidatedWalk,
    embedded_bench,
    embedded_contact,
    embedded_trials,
    make_study,
    validate_walk,
)

__all__ = [
    "Section",
    "Study",
    "StudyOptions",
    "StudyWalk",
    "ValidatedWalk",
    "embedded_bench",
    "embedded_contact",
    "embedded_trials",
    "make_study",
    "validate_walk",
]
