"""Sentences on recordings and results: the prose stands in `*/wording/*.txt.j2`, Python hands over
what was found."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2


@cache
def text_templates(*folders: str) -> jinja2.Environment:
    """The plain-text templates of folders of the package; their filter `form` is Python's
    `format`."""
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader("vsf_drake", folder) for folder in folders])
    texts = jinja2.Environment(
        loader=loader, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    texts.filters["form"] = format
    return texts


def say(template: str, part: str = "", /, **numbers: Any) -> list[str]:
    """The paragraphs that `wording/TEMPLATE.txt.j2`, or its macro `part`, makes of numbers, each on
    one line."""
    wording = text_templates("motion/wording", "simulation/wording", "wording")
    page = wording.get_template(f"{template}.txt.j2")
    text = str(getattr(page.module, part)(**numbers)) if part else page.render(numbers)
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]
