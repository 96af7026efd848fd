"""The contact spheres of a foot, as the sagittal plane sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.sagittal.planar_tree import PlanarTree, turned
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS

_ROUNDING = 9
"""Digits (m) to which two places are one."""


@dataclass(frozen=True, eq=False)
class Sites:
    """Spheres; those that the plane does not tell apart are one, with a count.

    Attributes:
        link: (s,). x, z: (s,) m, centres in the link's frame. count: (s,).
        columns: (s,) each, radius and constants of the laws by the stepper's names.
        heel: (s,) bool, of a zone whose stiffness is a design variable.
    """

    link: np.ndarray
    x: np.ndarray
    z: np.ndarray
    count: np.ndarray
    columns: dict[str, np.ndarray]
    heel: np.ndarray


def merged_sites(tree: PlanarTree, rows: np.ndarray, bodies: np.ndarray, heel: np.ndarray) -> Sites:
    """The rows (S, 11) of the stepper's sites on the plant's `bodies` (S,)."""
    merged: dict[tuple, list] = {}
    for row, body, is_heel in zip(rows, bodies, heel, strict=True):
        link, place, angle = tree.bodies[int(body)]
        x, z = place + np.array(turned(row[0], row[2], angle))
        key = (link, round(x, _ROUNDING), round(z, _ROUNDING), bool(is_heel), *row[3:])
        merged.setdefault(key, [link, x, z, 0, row, is_heel])[3] += 1
    links, xs, zs, counts, found, heels = zip(*merged.values(), strict=True)
    return Sites(link=np.array(links), x=np.array(xs), z=np.array(zs), count=np.array(counts, dtype=float),
                 columns=dict(zip(SITE_COLUMNS, np.array(found).T, strict=True)), heel=np.array(heels, dtype=bool))
