"""The roll-over shape of a foot: its arc, its effective length, and the mean moment arm about the ankle.

The shape is the centre of pressure seen from the shank, from heel contact to opposite heel contact; its rocker is
described by the radius of a circular arc (Hansen, Childress & Knox 2004, and the abstracts of Hansen's later work).
The following were not read at their source (for the length Hansen, Sam & Childress 2004, "The effective foot length
ratio", J. Prosthet. Orthot. 16) and are stated here as they are used:

- effective foot length: from the heel, the rear end of the foot, to the shape's front end, along the shank frame's
  forward axis;
- its ratio: to the length of the foot, from the same heel to its toe;
- arc: the circle whose distances from the points of the shape have the least sum of squares, the points evenly spaced
  along the shape rather than in time, so that no part counts more because the load rests there.

The dynamic mean ankle moment arm is "the ratio of sagittal ankle moment impulse to ground reaction force impulse"
(abstract of Adamczyk 2020, doi 10.1115/1.4045817); here the impulse of the vertical force is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPACING_M = 1e-3
STRAIGHT = 20.0
"""Radius in lengths of the shape beyond which it counts as straight (a choice)."""
_FEWEST = 5
_MOST_STEPS = 50


@dataclass(frozen=True)
class Arc:
    """A circle through points in a plane: centre (forward, up) and radius in m, and the points' RMS distance (m)."""

    centre_m: tuple[float, float]
    radius_m: float
    rms_m: float


def fit_arc(points_m: np.ndarray) -> Arc | None:
    """The circle nearest to points (n, 2), by Gauss-Newton on their distances from Taubin's algebraic fit.

    G. Taubin, IEEE Trans. Pattern Anal. Mach. Intell. 13:1115-1138 (1991). None where the points are too few, or
    nearly on a line: then a radius means nothing.
    """
    points = np.asarray(points_m, dtype=float)
    points = points[np.isfinite(points).all(axis=1)]
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if len(points) < _FEWEST or size == 0.0:
        return None
    origin = points.mean(axis=0)
    p = (points - origin) / size
    circle = _taubin(p)
    if circle is None:
        return None
    centre, radius = circle[:2], circle[2]
    for _ in range(_MOST_STEPS):
        away = p - centre
        distance = np.linalg.norm(away, axis=1)
        slopes = np.column_stack([-away / distance[:, None], -np.ones(len(p))])
        change = np.linalg.lstsq(slopes, radius - distance, rcond=None)[0]
        centre, radius = centre + change[:2], radius + change[2]
        if np.abs(change).max() < 1e-12 * max(1.0, radius):
            break
    if not (np.isfinite(radius) and 0.0 < radius < STRAIGHT):
        return None
    error = np.linalg.norm(p - centre, axis=1) - radius
    at = origin + size * centre
    return Arc((float(at[0]), float(at[1])), float(size * radius), float(size * np.sqrt(np.mean(error**2))))


def evenly_along(points_m: np.ndarray) -> np.ndarray:
    """(m, 2) points every SPACING_M along the line through `points_m` (n, 2), without those that are NaN."""
    points = np.asarray(points_m, dtype=float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return points
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0.0, along[-1], max(2, round(along[-1] / SPACING_M) + 1))
    return np.column_stack([np.interp(at, along, column) for column in points.T])


def shape_numbers(points_m: np.ndarray, *, heel_m: float, foot_length_m: float) -> dict[str, float | None]:
    """What describes a roll-over shape; None where it cannot be known.

    Args:
        points_m: (n, 2) m, centre of pressure forward and up in the shank's frame; NaN where there is none.
        heel_m: where the rear end of the foot, from which `foot_length_m` counts, is on the forward axis.
    """
    arc = fit_arc(evenly_along(points_m))
    forward = np.asarray(points_m)[:, 0]
    front = float(np.nanmax(forward)) if np.isfinite(forward).any() else None
    length = None if front is None else front - heel_m
    return {
        "radius_m": arc.radius_m if arc else None,
        "centre_forward_m": arc.centre_m[0] if arc else None,
        "centre_up_m": arc.centre_m[1] if arc else None,
        "arc_rms_m": arc.rms_m if arc else None,
        "effective_foot_length_m": length,
        "effective_foot_length_ratio": None if length is None else length / foot_length_m,
    }


def mean_moment_arm(time_s: np.ndarray, moment_nm: np.ndarray, vertical_n: np.ndarray) -> float | None:
    """Impulse of the moment about the ankle (toe up positive) over that of the vertical force (m); None without load.

    Args:
        time_s, moment_nm, vertical_n: (n,); where the moment is NaN neither counts.
    """
    known = np.isfinite(moment_nm)
    force = np.where(known, vertical_n, 0.0)
    impulse = float(np.trapezoid(force, time_s))
    if impulse <= 0.0:
        return None
    return float(np.trapezoid(np.where(known, moment_nm, 0.0), time_s)) / impulse


def _taubin(p: np.ndarray) -> np.ndarray | None:
    """Centre and radius (3,) of the algebraic fit to centred points (n, 2), or None if they are on a line."""
    squares = np.sum(p**2, axis=1)
    mean = squares.mean()
    if mean <= 0.0:
        return None
    design = np.column_stack([(squares - mean) / (2.0 * np.sqrt(mean)), p])
    a = np.linalg.svd(design, full_matrices=False)[2][-1]
    if abs(a[0]) < 1e-9:
        return None
    scale = a[0] / (2.0 * np.sqrt(mean))
    centre = -a[1:] / (2.0 * scale)
    radius = np.sqrt(a[1] ** 2 + a[2] ** 2 + 4.0 * scale**2 * mean) / (2.0 * abs(scale))
    return np.array([*centre, radius])
