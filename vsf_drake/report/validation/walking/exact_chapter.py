"""The chapter on the embedded walks without errors of measurement: what of an error is the model's own."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Chapter, Text
from vsf_drake.report.validation.walking import text as say
from vsf_drake.report.validation.walking.grids import table_3, walk_grid


def exact_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """Table 3 and every walk of the tier whose motion and force belong together; `walking_section` made both."""
    grids = [dataclasses.replace(grid, name=grid.name.replace("walking", "exact"))
             for grid in (table_3(table), walk_grid(table))]
    return Chapter(name="walking_exact", title="Walking without errors of measurement", pieces=(
        Text("The same synthetic walks with the very motion that made the force, and with a contact fitted to two of "
             "them. Here nothing is wrong but the model, so what is left is its own; the walks above also have errors "
             "of measurement, and a contact that was fitted with these."),
        *(Text(sentence) for sentence in say.findings(table)), *grids))
