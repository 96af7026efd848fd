"""The ground as a list of plane patches: height, slopes, bounds, friction, compliance, belt. Schema
only.

World frame W: x forward, y left, z up. A file holds the patches in a list:

    patches:
      - {name: floor}
      - {name: ramp, from_x_m: 1.0, reference_x_m: 1.0, slope_deg: 5.0}
      - {name: ice, from_x_m: 0.3, to_x_m: 0.6, mu_static: 0.1, mu_kinetic: 0.08}
      - {name: mat, from_x_m: 0.6, to_x_m: 1.0, height_m: 0.01, stiffness_n_per_m: 2.0e+4}
      - {name: treadmill, from_x_m: 3.0, to_x_m: 5.0, belt_m_per_s: -1.2}
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.base import errors
from vsf_drake.base.schema import check, load_yaml, quantity

_CHOICE = "a description of the place"
_FAR_M = 1e3
_place = functools.partial(quantity, unit="m", low=-_FAR_M, high=_FAR_M, source=_CHOICE)


@dataclass(frozen=True, kw_only=True)
class GroundPatch:
    """A plane above a rectangle of W: z = height + tan(slope) (x - reference_x) + tan(bank) y.

    Where patches overlap the highest carries, of equally high ones the last: ice on a floor is
    named after the floor. Where there is no patch nothing carries. `mu_static` and `mu_kinetic`
    replace the foot's coefficients where they are given; with `mu_static` alone the foot's kinetic
    one is lowered to it if need be. `stiffness_n_per_m` is the ground's own spring under each
    contact sphere, in series with the sphere's. With `belt_m_per_s` the patch stays where it is and
    its surface runs, as a treadmill's: friction follows the speed of a sphere against the belt.
    """

    name: str = "ground"  # of the patch
    from_x_m: float = _place(-_FAR_M)  # rear edge of the rectangle
    to_x_m: float = _place(_FAR_M)  # front edge of the rectangle
    from_y_m: float = _place(-_FAR_M)  # right edge of the rectangle
    to_y_m: float = _place(_FAR_M)  # left edge of the rectangle
    reference_x_m: float = _place(0.0)  # x at which the plane has height_m
    height_m: float = quantity(  # of the plane at reference_x_m and y = 0
        0.0, unit="m", low=-100.0, high=100.0, source=_CHOICE
    )
    slope_deg: float = quantity(0.0, unit="deg", low=-45.0, high=45.0, source=_CHOICE)
    """rising along +x"""
    bank_deg: float = quantity(0.0, unit="deg", low=-45.0, high=45.0, source=_CHOICE)
    """rising along +y"""
    mu_static: float | None = quantity(  # coefficient of static friction; the foot's if left out
        None, unit="1", low=0.0, high=5.0, source=_CHOICE
    )
    mu_kinetic: float | None = quantity(  # coefficient of kinetic friction; the foot's if left out
        None, unit="1", low=0.0, high=5.0, source=_CHOICE
    )
    stiffness_n_per_m: float | None = quantity(None, unit="N/m", low=1.0, high=1e12, source=_CHOICE)
    """of the ground under each sphere; rigid if left out"""
    belt_m_per_s: float = quantity(0.0, unit="m/s", low=-20.0, high=20.0, source=_CHOICE)
    """speed of the surface along +x, up a slope; negative under who walks forward on a treadmill"""


@dataclass(frozen=True, kw_only=True)
class Ground:
    """The ground that one foot meets; by default the plane z = 0 with the foot's own friction."""

    patches: tuple[GroundPatch, ...] = (GroundPatch(),)


def load_ground(path: str | Path) -> Ground:
    """Reads a ground from YAML, and checks it."""
    return check_ground(load_yaml(path, Ground), file=path)


def check_ground(ground: Ground, *, file: str | Path | None = None) -> Ground:
    """Returns `ground` if it is one: patches, one at least, with numbers in range and bounds in the
    right order."""
    require = functools.partial(errors.require, file=file)
    require(
        isinstance(ground, Ground),
        f"{ground!r} is no Ground",
        "ground",
        "Give Ground(patches=(GroundPatch(...),)), or load_ground(path)",
    )
    require(
        isinstance(ground.patches, (list, tuple))
        and all(isinstance(p, GroundPatch) for p in ground.patches),
        f"{ground.patches!r} is no tuple of GroundPatch",
        "patches",
        "Write patches=(GroundPatch(...),), with the comma",
    )
    check(ground, file=file)
    require(ground.patches, "has no patch", "patches", "Give one at least; {} is the plane z = 0")
    for i, patch in enumerate(ground.patches):
        for axis, low, high in (
            ("x", patch.from_x_m, patch.to_x_m),
            ("y", patch.from_y_m, patch.to_y_m),
        ):
            require(
                low < high,
                f"from_{axis}_m is {low:g}, to_{axis}_m {high:g}",
                f"patches[{i}]",
                "From must be less than to",
            )
    return ground


def ground_arrays(ground: Ground, *, mu_static: float, mu_kinetic: float) -> dict[str, np.ndarray]:
    """The M patches as arrays (M,), bounds (M, 4): what `laws.ground` and `systems.FootForces`
    take.

    `mu_static` and `mu_kinetic` are the foot's, for patches that name none.
    """

    def column(field: str, missing: float = math.nan) -> np.ndarray:
        values = [getattr(patch, field) for patch in ground.patches]
        return np.array([missing if value is None else value for value in values], dtype=float)

    # a place that is only said to be slippery is so for a foot that slides, too
    kinetic = column("mu_kinetic")
    return {
        "ground_bounds": np.column_stack(
            [column(f) for f in ("from_x_m", "to_x_m", "from_y_m", "to_y_m")]
        ),
        "ground_reference_x": column("reference_x_m"),
        "ground_height": column("height_m"),
        "ground_slope": np.tan(np.radians(column("slope_deg"))),
        "ground_bank": np.tan(np.radians(column("bank_deg"))),
        "ground_compliance": 1.0 / column("stiffness_n_per_m", math.inf),
        "ground_speed": column("belt_m_per_s"),
        "mu_static": column("mu_static", mu_static),
        "mu_kinetic": np.where(
            np.isnan(kinetic), np.minimum(mu_kinetic, column("mu_static", math.inf)), kinetic
        ),
    }
