"""What every chapter of a validation is put together from: a template, and what a saved section
gives it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from vsf_drake.report.page import Chapter


def mark(colour: ColorType, full: bool, marker: str = "o", **more: Any) -> dict[str, Any]:
    """The look of a mark without a line, open or full."""
    return {
        "linestyle": "",
        "marker": marker,
        "color": colour,
        "markerfacecolor": colour if full else "white",
        **more,
    }


def plate_name(synthetic: bool) -> str:
    """What a legend calls the force plate."""
    return "plate (SYNTHETIC)" if synthetic else "plate"


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
