"""The keel as an overhung beam: closed form, and small-load stiffness of its chain of sprung
joints.

            F (up)
    A       B        C          A: pin; B: simple support at distance l = support;
    o=======^========|---       C: load at distance L_c = load_point; overhang a = L_c - l
    |<- l ->|<-- a ->|

Euler-Bernoulli, small deflections, constant bending stiffness E I: bending moment F a x / l up to B
and F (L_c - x) from B to C, hence a deflection F a² L_c / (3 E I) under the load (Gere &
Timoshenko, Mechanics of Materials). Lengths in m, E I in N m², stiffness in N/m; support in (0,
load_point).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np


def section_inertia(width: float, thickness: float) -> float:
    """Second moment of area width · thickness³ / 12 (m⁴), bending in the direction of the
    thickness."""
    return width * thickness**3 / 12.0


def taper(x: np.ndarray, *, start: float, end: float, tip: float) -> np.ndarray:
    """Bending stiffness at `x` (m from A) over that at A, of a plate whose thickness falls along a
    straight line from `start` to `end` (m), where the ratio is `tip`: the cube of the thickness's
    own ratio."""
    share = np.clip((x - start) / (end - start), 0.0, 1.0)
    return np.asarray((1.0 + (tip ** (1.0 / 3.0) - 1.0) * share) ** 3)


def overhung_stiffness(*, bending_stiffness: Any, support: Any, load_point: Any) -> Any:
    """Stiffness 3 E I / (a² L_c) under the load (N/m), both supports rigid."""
    overhang = load_point - support
    return 3.0 * bending_stiffness / (overhang * overhang * load_point)


def combined_stiffness(
    *,
    bending_stiffness: Any,
    support: Any,
    load_point: Any,
    fulcrum_stiffness: Any = math.inf,
    series_stiffness: Any = math.inf,
) -> Any:
    """Stiffness (N/m) of beam, compliant support B and a spring in series with the load.

    1 / (1 / k_beam + (L_c / l)² / fulcrum_stiffness + 1 / series_stiffness): the support carries
    L_c / l times the load and its yielding appears at C magnified by the same ratio.
    """
    beam = overhung_stiffness(
        bending_stiffness=bending_stiffness, support=support, load_point=load_point
    )
    return _in_series(beam, support, load_point, fulcrum_stiffness, series_stiffness)


def lumped_stiffness(
    *,
    bending_stiffness: np.ndarray | float,
    element_lengths: Sequence[float] | np.ndarray,
    support: float,
    load_point: float,
    rigid_length: float = 0.0,
    fulcrum_stiffness: float = math.inf,
    series_stiffness: float = math.inf,
) -> float:
    """Exact small-load stiffness (N/m) of a chain of elements: rigid half, sprung joint, rigid
    half.

    Each joint adds M² L_element / (E I) to the compliance, M being the bending moment there per
    unit load: a midpoint rule for the integral of M² / (E I).

    Args:
        bending_stiffness: of all elements, or (N,) of each (N m²).
        element_lengths: from A, or the end of a rigid part of `rigid_length` (m) there, to the toe
            (m).
        fulcrum_stiffness, series_stiffness: as in `combined_stiffness` (N/m).
    """
    lengths = np.asarray(element_lengths, dtype=float)
    x = rigid_length + np.cumsum(lengths) - 0.5 * lengths
    overhang = load_point - support
    moment = np.where(x < support, overhang * x / support, np.maximum(load_point - x, 0.0))
    stiffest = np.max(bending_stiffness)
    beam = stiffest / float(np.sum(moment * moment * lengths * (stiffest / bending_stiffness)))
    return float(_in_series(beam, support, load_point, fulcrum_stiffness, series_stiffness))


def _in_series(
    beam: Any, support: Any, load_point: Any, fulcrum_stiffness: Any, series_stiffness: Any
) -> Any:
    ratio = load_point / support
    return 1.0 / (1.0 / beam + ratio * ratio / fulcrum_stiffness + 1.0 / series_stiffness)
