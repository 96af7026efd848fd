"""The energy section of the embedded study's short form, made once a session."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from typing import Any

import numpy as np
from made_study import embedded_study

from vsf_drake.analysis.validation import Section
from vsf_drake.analysis.validation.energy_section import energy_section


def made_energy(walks: int = 3) -> Section:
    """Of the first `walks` of the three quick walks."""
    return _made(walks)


@cache
def _made(walks: int) -> Section:
    study = embedded_study()
    return energy_section(dataclasses.replace(study, walks=study.walks[:walks]))


def saved_energy(walks: int = 3) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Table and arrays as they come back from disk."""
    section = made_energy(walks)
    return json.loads(json.dumps(section.table, allow_nan=False)), section.arrays
