"""Sentences about results: the prose stands in `wording/*.txt.j2`, Python hands over numbers and decisions."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2


@cache
def text_templates(package: str, folder: str) -> jinja2.Environment:
    """The plain-text templates of a folder; their filter `form` is Python's `format`."""
    found = jinja2.Environment(loader=jinja2.PackageLoader(package, folder), trim_blocks=True, lstrip_blocks=True,
                               undefined=jinja2.StrictUndefined)
    found.filters["form"] = format
    return found


def say(template: str, part: str = "", /, **numbers: Any) -> list[str]:
    """The paragraphs that `wording/TEMPLATE.txt.j2`, or its macro `part`, makes of numbers, each on one line."""
    found = text_templates("vsf_drake.analysis", "wording").get_template(f"{template}.txt.j2")
    text = str(getattr(found.module, part)(**numbers)) if part else found.render(numbers)
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]
