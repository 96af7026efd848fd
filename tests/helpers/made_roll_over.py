"""The section on rolling over of the embedded study, worked out once a session."""

from __future__ import annotations

from functools import cache

from made_study import embedded_study

from vsf_drake.analysis.validation.roll_over_section import roll_over_section
from vsf_drake.analysis.validation.study import Section


@cache
def embedded_roll_over() -> Section:
    """Of one walk a setting, in the short form."""
    return roll_over_section(embedded_study())
