"""Directives that show ports: the block of a system, and tables of what each port carries."""

from __future__ import annotations

import importlib
from typing import Any

import api_pages
import built_diagrams
import docstrings
import port_text
from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx import addnodes
from sphinx.util.docutils import SphinxDirective


class Ports(Directive):
    """`port-block` with the path of a class: input ports on its left and output ports on its
    right."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        path = self.arguments[0]
        block = port_text.port_block(_load(path).__doc__)
        return [drawn(path.rsplit(".", 1)[1], block)] if block else []


def drawn(name: str, block: port_text.PortBlock) -> nodes.container:
    """The block as nodes; `ports.css` draws it."""
    system = nodes.container(classes=["port-block"])
    for side, names in (("inputs", block.inputs), (None, ()), ("outputs", block.outputs)):
        if side is None:
            system += nodes.container("", nodes.paragraph("", name), classes=["port-system"])
            continue
        items = [
            nodes.list_item("", nodes.paragraph("", "", nodes.literal("", name))) for name in names
        ]
        column = nodes.container(classes=[f"port-{side}"])
        if items:
            column += nodes.bullet_list("", *items)
        system += column
    return system


def _table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> nodes.container:
    """A table whose first column is code, in a container that scrolls where the page is narrow."""
    group = nodes.tgroup(cols=len(header))
    for width in (28, 12, 60)[: len(header)]:
        group += nodes.colspec(colwidth=width)
    head, body = nodes.thead(), nodes.tbody()
    for line in [header, *rows]:
        row = nodes.row()
        for i, text in enumerate(line):
            shown = nodes.literal("", text) if i == 0 and line is not header else nodes.Text(text)
            row += nodes.entry("", nodes.paragraph("", "", shown))
        (head if line is header else body).append(row)
    group += [head, body]
    return nodes.container("", nodes.table("", group), classes=["table-wrapper", "port-table"])


def _sides(docstring: str | None) -> list[tuple[str, dict[str, port_text.Port], tuple[str, ...]]]:
    block = port_text.port_block(docstring)
    if block is None:
        raise ValueError("the docstring has no section Outputs:")
    texts = port_text.sections(docstring)
    return [
        (side, port_text.ports(texts.get(side, ""), names), names)
        for side, names in (("Inputs", block.inputs), ("Outputs", block.outputs))
        if names
    ]


def _load(path: str) -> Any:
    module, name = path.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)


class SystemPorts(Directive):
    """`system-ports` with the path of a class: what its docstring says of its ports."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        found: list[nodes.Node] = []
        for side, known, names in _sides(_load(self.arguments[0]).__doc__):
            rows = [
                (name, known[name].size or "abstract", known[name].text)
                for name in names
                if name in known
            ]
            found += [nodes.rubric("", side), _table(("port", "size", "what"), rows)]
        return found


class DiagramPorts(Directive):
    """`diagram-ports` with the class that holds a diagram: sizes from the diagram, the rest from
    its docstring."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        cls = _load(self.arguments[0])
        sizes = built_diagrams.sizes(cls)
        found: list[nodes.Node] = []
        for side, known, names in _sides(cls.__doc__):
            rows = [(name, sizes[name], known[name].text) for name in names]
            found += [nodes.rubric("", side), _table(("port", "size", "what"), rows)]
        return found


class AllSystems(SphinxDirective):
    """`all-systems`: the block of every public system, under a link to its page."""

    def run(self) -> list[nodes.Node]:
        found: list[nodes.Node] = []
        for module in api_pages.public_modules():
            for name in docstrings.template_systems(module):
                shown = name.removesuffix("_")
                block = port_text.port_block(getattr(module, shown).__doc__)
                if block is None:
                    continue
                link = addnodes.pending_xref(
                    "",
                    nodes.literal("", shown),
                    refdomain="py",
                    reftype="class",
                    refwarn=True,
                    reftarget=f"{module.__name__}.{shown}",
                    refdoc=self.env.docname,
                )
                found += [nodes.paragraph("", "", link), drawn(shown, block)]
        return found
