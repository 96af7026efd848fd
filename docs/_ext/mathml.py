"""Equations as MathML, which browsers set without a script."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml


def inline(writer: Any, node: nodes.math) -> None:
    """Within a line."""
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.math_block) -> None:
    """On its own lines, which scroll where they are wider than the screen."""
    writer.body.append(f'<div class="equation">{tex2mathml(node.astext(), True)}</div>')
    raise nodes.SkipNode
