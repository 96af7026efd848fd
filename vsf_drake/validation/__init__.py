"""The paper's study on any trials: bench, standing, walking, energy, roll-over, what it can tell
apart, sensitivity.

`make_study` reads and walks the trials; each section is a function of the study.
"""

from vsf_drake.validation.study import Section, Study, StudyOptions, StudyWalk, make_study

__all__ = [
    "Section",
    "Study",
    "StudyOptions",
    "StudyWalk",
    "make_study",
]
