"""Sentences about results: the prose stands in `templates/*.txt.j2`, Python hands over numbers and decisions."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template


@cache
def template(name: str) -> Template:
    """The template `name`.txt.j2. Its filter `percent` shows a share; numbers are shown as in "%.1f"|format(x)."""
    found = Environment(loader=FileSystemLoader(Path(__file__).with_name("templates")), undefined=StrictUndefined,
                        trim_blocks=True, lstrip_blocks=True, autoescape=False)
    found.filters["percent"] = lambda share: f"{100 * share:.1f} %"
    return found.get_template(f"{name}.txt.j2")


def sentences(name: str, **numbers: Any) -> tuple[str, ...]:
    """What a template says: one text for each of its lines that begin with "- ", without its line breaks."""
    said = re.split(r"^- ", template(name).render(numbers), flags=re.MULTILINE)
    return tuple(re.sub(r"\s*\n\s*", " ", text.strip()) for text in said if text.strip())
