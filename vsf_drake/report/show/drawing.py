"""What shown models and replays share: Meshcat itself, arrows and triads drawn in it, and its page
with a caption."""

from __future__ import annotations

import logging
import re
import secrets
import sys
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import escape
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, MeshcatParams, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from vsf_drake.report.page import render

RGB = tuple[float, float, float]
FIELD_OF_VIEW_DEG = 35.0
ASPECT = 1.6
ENDLESS = 100_000
# colours of x, y, z
_AXES = (Rgba(0.85, 0.10, 0.10), Rgba(0.10, 0.60, 0.15), Rgba(0.15, 0.25, 0.85))
_STROKES = {
    "W": [(0.0, 1.0), (0.25, 0.0), (0.5, 0.8), (0.75, 0.0), (1.0, 1.0)],
    "K": [(0.0, 0.0), (0.0, 1.0), (0.0, 0.45), (0.9, 1.0), (0.0, 0.45), (0.9, 0.0)],
    "M": [(0.0, 0.0), (0.0, 1.0), (0.5, 0.3), (1.0, 1.0), (1.0, 0.0)],
}


SPHERE_OPACITY = 0.8
"""Of contact spheres on pages where they hide no other part of the foot."""


def open_meshcat() -> Meshcat:
    """A Meshcat for this program only, without Drake's message about it.

    Drake's server answers whoever finds it, web pages included. On Linux, where 127.0.0.0/8 is this
    machine, it gets one of 16 million addresses by chance, which no page can guess; `scene.gate` is
    where visitors come in.
    """
    host = f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        meshcat = Meshcat(
            MeshcatParams(
                host=host if sys.platform == "linux" else "localhost", show_stats_plot=False
            )
        )
    finally:
        log.setLevel(level)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.2)
    for end, shade in (("top", 1.0), ("bottom", 0.90)):
        meshcat.SetProperty("/Background/<object>", f"{end}_color", [shade, shade, shade])
    return meshcat


def finish_page(
    meshcat: Meshcat,
    title: str,
    template: str,
    /,
    *,
    parts: Sequence[Mapping[str, object]] = (),
    follow: str | None = None,
    inset: str | None = None,
    **facts: object,
) -> str:
    """Meshcat as one HTML file with `title`, a time bar, switches and the caption of a template.

    Of `parts` of the animation, each with its `name`, its `span` (s) and the `roots` in Meshcat's
    tree of what is seen in it, one is played at a time, and the camera goes with what `follow`
    names below the first root; the foot whose frame is at `inset` is shown enlarged beside.
    """
    head = (
        '<meta name="viewport" '
        f'content="width=device-width,initial-scale=1"><title>{escape(title)}</title>'
    )
    page, titles = re.subn(
        r"<title>.*?</title>", lambda _: head, meshcat.StaticHtml(), count=1, flags=re.DOTALL
    )
    start, tag, end = page.rpartition("</body>")
    if not titles or not tag:
        raise ValueError("Meshcat's page has no title or no body to write into")
    rendered = render(
        template,
        title=title,
        parts=parts,
        follow=follow,
        inset=inset,
        field_of_view=FIELD_OF_VIEW_DEG,
        **facts,
    )
    return f"{start}{rendered}{tag}{end}"


def shifted(x: float, y: float, z: float) -> RigidTransform:
    """The pose of a frame whose axes are parallel and whose origin is at (x, y, z)."""
    return RigidTransform(np.array([x, y, z]))


def add_arrow(
    meshcat: Meshcat,
    path: str,
    colour: Rgba,
    *,
    shaft_radius: float,
    head: tuple[float, float],
    shaft_from: float,
    order: int = 1,
) -> None:
    """An arrow along z, of a shaft of length 1 m that begins at `shaft_from` and a `head` (length,
    radius in m).

    If not quite opaque, it is painted over what it passes through, and over arrows of lower
    `order`.
    """
    length, radius = head
    meshcat.SetObject(f"{path}/shaft/rod", Cylinder(shaft_radius, 1.0), colour)
    meshcat.SetTransform(f"{path}/shaft/rod", shifted(0.0, 0.0, shaft_from + 0.5))
    meshcat.SetObject(f"{path}/head/cone", MeshcatCone(length, radius, radius), colour)
    # Drake's cone has its tip at the origin and opens along +z
    turned = RotationMatrix.MakeXRotation(np.pi)
    meshcat.SetTransform(f"{path}/head/cone", RigidTransform(turned))
    for part in ("shaft/rod", "head/cone"):
        paint_last(meshcat, f"{path}/{part}", order)


def paint_last(meshcat: Meshcat, path: str, order: int = 1) -> None:
    """Lets what is at `path`, if it is not quite opaque, show through everything of lower
    `order`."""
    meshcat.SetProperty(f"{path}/<object>", "material.depthTest", False)
    meshcat.SetProperty(f"{path}/<object>", "renderOrder", float(order))


def add_triad(meshcat: Meshcat, path: str, length: float) -> None:
    """Axes of `length` (m), x red, y green, z blue, with the frame's letter, which ends `path`,
    behind its origin."""
    radius = 0.02 * length
    turns = (
        RotationMatrix.MakeYRotation(0.5 * np.pi),
        RotationMatrix.MakeXRotation(-0.5 * np.pi),
        RotationMatrix(),
    )
    for axis, turn, colour in zip("xyz", turns, _AXES, strict=True):
        meshcat.SetObject(f"{path}/{axis}", Cylinder(radius, length), colour)
        meshcat.SetTransform(
            f"{path}/{axis}", RigidTransform(turn, turn @ np.array([0.0, 0.0, 0.5 * length]))
        )
    strokes = np.array(_STROKES[path[-1]]) * 0.3 * length
    points = np.array(
        [strokes[:, 0] - 0.45 * length, np.zeros(len(strokes)), strokes[:, 1] + 0.1 * length]
    )
    meshcat.SetLine(f"{path}/letter", np.asfortranarray(points), 3.0, Rgba(0.1, 0.1, 0.1, 1.0))
