"""The rounded sole as a grid of foam cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.design import SoleDesign

THINNEST_FOAM = 0.3
"""Foam left where the sole rises most, as a share of its full thickness."""
UNSUPPORTED = 0.5
"""Stiffness of foam that no keel bears, over that of the same foam under it (a choice)."""


@dataclass(frozen=True)
class Sole:
    """Foam cells, one row each, in the keel frame K (origin at A, x to the toe, y left, z up).

    Attributes:
        points: (n, 3) m, lower end of each cell, unloaded.
        on_block: (n,) whether it sits on the rigid heel block; otherwise on the keel.
        stiffness: (n,) N/m under small compression.
        dense_depth: (n,) m, compression at which the foam would be solid.
    """

    points: np.ndarray
    on_block: np.ndarray
    stiffness: np.ndarray
    dense_depth: np.ndarray


def rise(design: SoleDesign, x: np.ndarray) -> np.ndarray:
    """Height (m) of the sole's middle line above its lowest point at `x` (m from A); smooth in
    slope."""
    heel, toe, centre = design.heel_from_m, design.toe_from_m, design.rocker_centre_m
    middle = np.clip(x, heel, toe)
    height = (middle - centre) ** 2 / (2.0 * design.rocker_radius_m)
    height += (middle - centre) / design.rocker_radius_m * (x - middle)
    behind, ahead = np.maximum(heel - x, 0.0), np.maximum(x - toe, 0.0)
    height += design.heel_radius_m - np.sqrt(design.heel_radius_m**2 - behind**2)
    height += design.toe_radius_m - np.sqrt(design.toe_radius_m**2 - ahead**2)
    return np.asarray(height)


def half_width(design: SoleDesign, x: np.ndarray) -> np.ndarray:
    """Half the sole's width (m) at `x`: wider at the forefoot, with rounded ends."""
    base = np.interp(x, [0.05, 0.16], [design.half_width_heel_m, design.half_width_fore_m])
    to_end = np.minimum(x - design.rear_m, design.front_m - x)
    end = np.clip(1.0 - to_end / design.end_length_m, 0.0, 1.0)
    return np.asarray(base * (0.45 + 0.55 * np.sqrt(1.0 - end**2)))


def make_sole(
    design: SoleDesign, *, sole_height: float, foam_thickness: float, block_until: float
) -> Sole:
    """Cells of equal length; each column as wide as the sole is there.

    Args:
        sole_height: z (m) in K of the sole's lowest point.
        foam_thickness: m, where the sole is lowest.
        block_until: x (m) up to which the foam sits on the rigid heel block.
    """
    edges = np.linspace(design.rear_m, design.front_m, design.columns + 1)
    x = np.repeat(0.5 * (edges[1:] + edges[:-1]), design.rows)
    across = (2.0 * np.arange(design.rows) + 1.0) / design.rows - 1.0
    half = half_width(design, x)
    y = np.tile(across, design.columns) * half
    over_edge = np.clip(np.abs(y) - (half - design.edge_radius_m), 0.0, design.edge_radius_m)
    up = rise(design, x) + design.edge_radius_m - np.sqrt(design.edge_radius_m**2 - over_edge**2)
    thickness = np.maximum(foam_thickness - up, THINNEST_FOAM * foam_thickness)
    area = (edges[1] - edges[0]) * 2.0 * half / design.rows
    on_block = x < block_until
    modulus = np.where(on_block, design.heel_modulus_pa, design.foam_modulus_pa)
    modulus = np.where(x > design.unsupported_from_m, UNSUPPORTED, 1.0) * modulus
    return Sole(
        points=np.column_stack([x, y, sole_height + up]),
        on_block=on_block,
        stiffness=modulus * area / thickness,
        dense_depth=design.densification * thickness,
    )
