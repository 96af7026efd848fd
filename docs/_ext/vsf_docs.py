"""Sphinx extension: pages of API, commands and files; template systems under their own names; port
blocks, tables, equations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import api_pages
import docstrings
import generated_reference
import mathml
import port_nodes
import typer.main


def _before_reading(app: Any) -> None:
    modules = api_pages.public_modules()
    docstrings.show_what_is_wrapped(modules)
    examples = {"example_pages.md": _example_pages(Path(app.srcdir) / "_static" / "examples")}
    api_pages.write(Path(app.srcdir) / "api", modules, generated_reference.pages() | examples)


def _example_pages(folder: Path) -> str:
    """The page that leads to what docs/make_example_pages.py has left."""
    lines = [
        "# Example pages",
        "",
        "What commands show, of SYNTHETIC recordings, by their quick forms.",
        "",
    ]
    commands = typer.main.get_command(generated_reference.app).commands
    for page in sorted(folder.glob("*/report.html")):
        name = page.parent.name
        link = f'<a href="../_static/examples/{name}/report.html">vsf-drake {name}</a>'
        lines.append(f"- {link}: {commands[name].get_short_help_str(limit=200)}")
    if not lines[-1]:
        lines.append("None is in this copy: `python docs/make_example_pages.py` makes them.")
    return "\n".join(lines)


def _index(_: Any, __: str, source: list[str]) -> None:
    """`<!-- index: keel -->` leads the search for a word to a page, unseen in the file itself."""
    source[0] = re.sub(
        "^<!-- index: (.+) -->$", r"```{index} ! \1\n```", source[0], flags=re.MULTILINE
    )


def setup(app: Any) -> dict[str, Any]:
    """Registers everything with Sphinx."""
    app.connect("builder-inited", _before_reading)
    app.connect("source-read", _index)
    app.connect("autodoc-process-docstring", docstrings.process, priority=400)  # napoleon's is 500
    app.connect("autodoc-skip-member", docstrings.skip)
    app.add_role("name", docstrings.role)
    app.add_directive("port-block", port_nodes.Ports)
    app.add_directive("system-ports", port_nodes.SystemPorts)
    app.add_directive("diagram-ports", port_nodes.DiagramPorts)
    app.add_directive("all-systems", port_nodes.AllSystems)
    app.add_html_math_renderer("mathml", (mathml.inline, None), (mathml.block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
