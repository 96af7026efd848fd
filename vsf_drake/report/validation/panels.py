"""What every chapter of a validation is put together from: a template, and what a saved section
gives it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter


def section_chapter(
    template: str, table: object, figures: Mapping[str, Figure] | None = None, **facts: Any
) -> Chapter:
    """The chapter of a section, to be named by who lists the sections.

    The template has the fields of the section's record and the `facts` under their names; `drawn`
    are the figures that there are.
    """
    figures = figures or {}
    return Chapter(
        name=template,
        title="",
        template=f"validation/{template}.html.j2",
        facts={**vars(table), "drawn": [*figures], **facts},
        figures=figures,
    )
