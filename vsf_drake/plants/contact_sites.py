"""Where a foot's contact spheres are and by which law each presses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.parameters import ContactZone


@dataclass(frozen=True)
class ContactSites:
    """The contact spheres of one foot, one row each (N spheres).

    Attributes:
        body_indices: body that carries each sphere.
        p_BS: (N, 3) sphere centres in their bodies' frames (m).
        radius, stiffness, exponent, damping, full_damping_depth: (N,) SI.
        zone: (N,) index into `zone_names`.
    """

    body_indices: list
    p_BS: np.ndarray
    radius: np.ndarray
    stiffness: np.ndarray
    exponent: np.ndarray
    damping: np.ndarray
    full_damping_depth: np.ndarray
    zone: np.ndarray
    zone_names: tuple[str, ...]

    @property
    def law(self) -> dict[str, np.ndarray]:
        """The constants of the normal force, by the names that the contact law gives them."""
        names = ("stiffness", "exponent", "damping", "full_damping_depth")
        return {name: getattr(self, name) for name in names}


def zone_sites(zones: tuple[ContactZone, ...], body_indices: list, p_BS: np.ndarray) -> ContactSites:
    """Sites of `zones` in their order, with every zone's law repeated for each of its spheres."""
    count = [len(zone.x_mm) for zone in zones]

    def repeated(field: str) -> np.ndarray:
        return np.repeat([float(getattr(zone, field)) for zone in zones], count)

    return ContactSites(
        body_indices=body_indices, p_BS=p_BS, radius=repeated("radius_m"), stiffness=repeated("stiffness"),
        exponent=repeated("exponent"), damping=repeated("damping_n_s_per_m"),
        full_damping_depth=repeated("full_damping_depth_m"),
        zone=np.repeat(np.arange(len(zones)), count), zone_names=tuple(zone.name for zone in zones))
