"""The same foot with more contact spheres (with more keel elements:
`vsf_drake.plants.foot.with_elements`).

What tells a model of pieces from the foot that it stands for is that finer pieces change little.
The refinement keeps what the foot is (what a zone bears, its outline, the contact laws) and only
divides it further.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import ContactZone, FootParameters


def with_spheres(foot: FootParameters, spheres: int) -> FootParameters:
    """`foot` with `spheres` contact spheres, which fill the outline of each zone evenly instead of
    marking it.

    A zone's outline is the convex hull of its spheres' centres seen from above. The spheres are
    shared out in proportion to what the zones have; a zone of one sphere keeps it, since a point
    has no inside. Stiffness and damping of a zone are divided among its spheres, at any exponent.
    The pressure moves inwards, though: the few spheres of a coarse zone stand on its outline.

    Raises:
        InputError: `spheres` is fewer than the foot has, or so few that a zone would lose a corner;
            the spheres of a zone do not have one height.
    """
    has = [len(zone.x_mm) for zone in foot.zones]
    if spheres == sum(has):
        return foot
    if spheres < sum(has) or max(has) == 1:
        raise InputError(
            f"{spheres} spheres cannot be had by refining {sum(has)}",
            where="spheres",
            right="It must be at least what the foot has, with a zone of several",
        )
    shared = np.array([count if count > 1 else 0 for count in has])
    share = (spheres - has.count(1)) * shared / shared.sum()
    counts = np.where(shared > 0, np.floor(share).astype(int), 1)
    short = spheres - int(counts.sum())
    counts[np.argsort(np.floor(share) - share, kind="stable")[:short]] += 1
    zones = tuple(
        _refined(zone, int(count)) for zone, count in zip(foot.zones, counts, strict=True)
    )
    return dataclasses.replace(foot, zones=zones)


def _refined(zone: ContactZone, count: int) -> ContactZone:
    if count == len(zone.x_mm):
        return zone
    if len(set(zone.rise_mm)) > 1:
        raise InputError(
            f"the spheres of zone {zone.name!r} do not have one height",
            where="zones",
            right="Only a zone that is flat can be refined",
        )
    points = fill(np.column_stack([zone.x_mm, zone.y_mm]), count)
    ratio = len(zone.x_mm) / count
    return dataclasses.replace(
        zone,
        x_mm=tuple(points[:, 0].tolist()),
        y_mm=tuple(points[:, 1].tolist()),
        rise_mm=zone.rise_mm[:1] * count,
        stiffness=zone.stiffness * ratio,
        damping_n_s_per_m=zone.damping_n_s_per_m * ratio,
    )


def fill(corners: np.ndarray, count: int) -> np.ndarray:
    """(count, 2) points spread evenly over the convex hull of `corners` (m, 2), its corners among
    them.

    They stand in rows along y, one through each corner, closest to squares; symmetric in y if the
    hull is.

    Raises:
        InputError: `count` is too small to hold every corner.
    """
    rear, front = corners[:, 0].min(), corners[:, 0].max()
    right, left = _hull_side(corners, -1.0), _hull_side(corners, 1.0)
    breaks = np.unique(np.concatenate([right[:, 0], left[:, 0]]))

    def edges(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.interp(x, right[:, 0], right[:, 1]), np.interp(x, left[:, 0], left[:, 1])

    low, high = edges(breaks)
    if front == rear or np.all(high - low <= 0.0):
        ends = (
            corners[np.lexsort(corners.T)][[0, -1]]
            if front == rear
            else np.column_stack([breaks, low])[[0, -1]]
        )
        return np.linspace(ends[0], ends[1], count)
    spacing = np.sqrt(np.trapezoid(high - low, breaks) / count)
    rows = breaks
    while True:
        parts = np.maximum(np.ceil(np.diff(breaks) / spacing), 1).astype(int)
        rows = np.append(
            np.concatenate(
                [
                    np.linspace(a, b, n, endpoint=False)
                    for a, b, n in zip(breaks[:-1], breaks[1:], parts, strict=True)
                ]
            ),
            breaks[-1],
        )
        low, high = edges(rows)
        least = np.where(high > low, 2, 1)
        if least.sum() <= count:
            break
        if len(rows) == len(breaks):
            raise InputError(
                f"{count} spheres cannot hold an outline of {least.sum()}",
                where="spheres",
                right="Take more",
            )
        spacing *= 1.1
    gaps = np.diff(rows)
    area = (high - low) * 0.5 * (np.append(gaps, 0.0) + np.append(0.0, gaps))
    held = least.copy()
    for _ in range(count - int(held.sum())):
        held[np.argmax(np.where(high > low, area * count / area.sum() - held, -np.inf))] += 1
    return np.concatenate(
        [
            np.column_stack([np.full(n, x), np.linspace(a, b, n) if n > 1 else [0.5 * (a + b)]])
            for x, a, b, n in zip(rows, low, high, held, strict=True)
        ]
    )


def _hull_side(corners: np.ndarray, sign: float) -> np.ndarray:
    """(k, 2) the hull's boundary towards +y (sign 1) or -y (sign -1), x increasing."""
    chain: list[np.ndarray] = []
    outermost: dict[float, float] = {}
    for x, y in corners.tolist():
        outermost[x] = max(outermost.get(x, -np.inf), sign * y)
    for x in sorted(outermost):
        point = np.array([x, outermost[x]])
        while len(chain) > 1:
            along, ahead = chain[-1] - chain[-2], point - chain[-2]
            if along[0] * ahead[1] - along[1] * ahead[0] < 0.0:
                break
            chain.pop()
        chain.append(point)
    return np.array(chain) * [1.0, sign]
