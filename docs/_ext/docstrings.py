"""What is done to objects and docstrings before Sphinx shows them."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from types import ModuleType
from typing import Any

import port_text
from docutils import nodes
from pydrake.systems.scalar_conversion import TemplateSystem
from sphinx import addnodes

_KEPT = re.compile(
    r"(Args|Attributes|Raises|Returns|Yields|Examples?|Notes?):$|\.\. |[-*:] ?|\d+\. "
)
"""Lines whose indented followers are no equations: sections, directives, lists."""


_COMPOSED_FROM = ("vsf_drake.systems", "vsf_drake.plants")
"""Packages whose exported names every docstring may use."""


def template_systems(module: ModuleType) -> dict[str, TemplateSystem]:
    """Public template systems that are defined in `module`, by name (`FootForces_`)."""
    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, TemplateSystem)
        and not name.startswith("_")
        and value.get_instantiation(float)[0].__module__ == module.__name__
    }


def show_what_is_wrapped(modules: list[ModuleType]) -> None:
    """Gives template systems the name and the arguments they are used by; puts functions in place
    of compiled ones.

    For the process that builds the documentation, and no other.
    """
    for module in modules:
        for name in template_systems(module):
            cls = getattr(module, name.removesuffix("_"))
            cls.__name__ = cls.__qualname__ = name.removesuffix("_")
            arguments = [
                parameter
                for parameter in inspect.signature(cls._construct).parameters.values()
                if parameter.name not in ("self", "converter")
            ]
            cls.__signature__ = inspect.Signature(arguments)
        for name, value in list(vars(module).items()):
            if (
                not isinstance(value, type)
                and hasattr(value, "py_func")
                and hasattr(value, "signatures")
            ):
                setattr(module, name, value.py_func)


def role(
    name: str,
    rawtext: str,
    text: str,
    lineno: int,
    inliner: Any,
    options: Any = None,
    content: Any = (),
) -> tuple[list[nodes.Node], list[nodes.Node]]:
    """`text` as code, and as a link where the module that is being shown knows a thing of this
    package by that name."""
    environment = inliner.document.settings.env
    shown = nodes.literal(rawtext, text, classes=["py"])
    target = known_name(text, environment.ref_context.get("py:module"))
    if target is None:
        return [shown], []
    link = addnodes.pending_xref(
        rawtext,
        shown,
        refdomain="py",
        reftype="obj",
        reftarget=target,
        refwarn=False,
        refdoc=environment.docname,
    )
    return [link], []


def known_name(text: str, module_name: str | None) -> str | None:
    """Full name of what `text` means in a module: defined or imported there, a system or a builder,
    or a full name."""
    if not re.fullmatch(r"[A-Za-z_][\w.]*", text):
        return None
    if text.startswith("vsf_drake."):
        return text
    first, *rest = text.split(".")
    places = [
        vars(sys.modules[name]) for name in (module_name, *_COMPOSED_FROM) if name in sys.modules
    ]
    value = next((place[first] for place in places if first in place), None)
    home = getattr(value, "__module__", None)
    if inspect.ismodule(value):
        home, own = value.__name__, []
    else:
        own = [getattr(value, "__qualname__", first)]
    return ".".join([home, *own, *rest]) if str(home).startswith("vsf_drake") else None


def process(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Indented paragraphs (equations, sketches) as they stand; scalar types of a system; a table of
    quantities."""
    lines[:] = with_literal_blocks(lines)
    if what in ("data", "attribute", "property"):
        # a comment: else napoleon takes what stands before a colon in the first line for a type
        lines[:0] = ["..", ""]
    if what == "class":
        if port_text.port_block(obj.__doc__):
            at = next(i for i, line in enumerate(lines) if line.startswith(("Inputs:", "Outputs:")))
            lines[at:at] = ["", f".. port-block:: {obj.__module__}.{obj.__name__}", ""]
        module = inspect.getmodule(obj)
        template = getattr(module, f"{obj.__name__}_", None)
        if isinstance(template, TemplateSystem):
            types = ", ".join(T[0].__name__ for T in template.param_list)
            lines += [
                "",
                (
                    f"Scalar types: {types}, as ``{obj.__name__}_[T]``; ``{obj.__name__}`` is that "
                    "of float."
                ),
            ]
        if dataclasses.is_dataclass(obj):
            lines += quantity_table(obj)


def skip(app: Any, what: str, name: str, obj: Any, skipped: bool, options: Any) -> bool | None:
    """Leaves out the fields of a named tuple, which its signature shows, and the conversions that
    every system has."""
    field = (getattr(obj, "__doc__", None) or "").startswith("Alias for field number")
    return (
        True if field or name.startswith(("ToAutoDiffXd", "ToSymbolic", "ToScalarType")) else None
    )


def with_literal_blocks(lines: list[str]) -> list[str]:
    """Equations and sketches, which a docstring only indents, as literal blocks; elsewhere no sign
    is markup but `."""
    shown: list[str] = []
    # the last line at the margin, and where we are: text, kept or literal
    before, state = "", "text"
    for line in lines:
        blank = not line.strip()
        if not blank and not line.startswith("  "):
            if state == "literal" and shown[-1].strip():
                shown.append("")
            before, state = line, "kept" if _KEPT.match(line) else "text"
        elif not blank and state == "text":
            if not before.endswith("::"):
                shown += ["", "::", ""]
            state = "literal"
        shown.append(
            line
            if state == "literal" or line.lstrip().startswith(("..", ":"))
            else _without_markup(line)
        )
    return shown


def _without_markup(line: str) -> str:
    """Stars, bars and final underscores as they are, outside of backticks; a list keeps its
    bullet."""
    bullet = re.match(r"\s*\* ", line)
    start = bullet.end() if bullet else 0
    parts = re.split(r"(`+[^`]*`+)", line[start:])
    parts[::2] = [re.sub(r"([*|])|(?<=\w)(_)(?!\w)", r"\\\1\2", part) for part in parts[::2]]
    return line[:start] + "".join(parts)


def quantity_table(cls: type) -> list[str]:
    """Default, unit, range and source of each field that has them, as a table."""
    rows = []
    for field in dataclasses.fields(cls):
        if field.metadata.get("unit"):
            low, high = field.metadata.get("low"), field.metadata.get("high")
            bounds = "" if low is None or high is None else f"{low:g} to {high:g}"
            rows.append(
                (
                    f"``{field.name}``",
                    _default(field),
                    field.metadata["unit"],
                    bounds,
                    field.metadata.get("source") or "",
                )
            )
    if not rows:
        return []
    table = ["", ".. list-table::", "   :header-rows: 1", "   :class: quantities", ""]
    for row in [("field", "default", "unit", "range", "source"), *rows]:
        table += [
            f"   {'* -' if i == 0 else '  -'} {_escaped(cell) if cell[:2] != '``' else cell}"
            for i, cell in enumerate(row)
        ]
    return [*table, ""]


def _default(field: dataclasses.Field) -> str:
    value = field.default
    if value is dataclasses.MISSING or value is None:
        return ""
    if isinstance(value, tuple):
        return (
            ", ".join(f"{x:g}" for x in value)
            if all(isinstance(x, float | int) for x in value)
            else ""
        )
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def _escaped(text: str) -> str:
    return (
        text.replace("\\", "\\\\")
        .replace("*", "\\*")
        .replace("|", "\\|")
        .replace("_", "\\_")
        .replace("`", "\\`")
    )
