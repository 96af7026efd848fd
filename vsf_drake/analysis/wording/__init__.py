"""Sentences that results keep: templates of macros beside this file, filled with numbers and decisions."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2


@cache
def _environment() -> jinja2.Environment:
    found = jinja2.Environment(loader=jinja2.PackageLoader("vsf_drake.analysis", "wording"), trim_blocks=True,
                               lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    found.filters["form"] = format
    return found


def say(template: str, part: str, **numbers: Any) -> list[str]:
    """The paragraphs that the macro `part` of `TEMPLATE.txt.j2` makes of numbers, each on one line."""
    module = _environment().get_template(f"{template}.txt.j2").module
    text = str(getattr(module, part)(**numbers))
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]
