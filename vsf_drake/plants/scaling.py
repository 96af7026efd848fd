"""Feet of other sizes: each dimension scales on its own."""

from __future__ import annotations

import dataclasses

from vsf_drake.errors import InputError
from vsf_drake.parameters import ContactZone, FootParameters


def scale_foot(
    foot: FootParameters, *, length: float = 1.0, width: float = 1.0, thickness: float = 1.0, height: float = 1.0
) -> FootParameters:
    """`foot` with its dimensions multiplied; material, masses and contact laws stay.

    Args:
        length: keel elements, fulcrum range, load point, sphere x, pylon position, foot length.
        width: keel width, sphere y.
        thickness: keel thickness (stiffness goes with its cube).
        height: build height, foam thickness, rise of the spheres.

    Raises:
        InputError: a ratio is not positive.
    """
    for name, ratio in (("length", length), ("width", width), ("thickness", thickness), ("height", height)):
        if not ratio > 0.0:
            raise InputError(f"{ratio:g} is not a ratio of sizes", where=name, right="It must be positive")
    keel = dataclasses.replace(
        foot.keel, element_lengths_m=_times(foot.keel.element_lengths_m, length), width_m=foot.keel.width_m * width,
        thickness_m=foot.keel.thickness_m * thickness)
    fulcrum = dataclasses.replace(
        foot.fulcrum, rearmost_m=foot.fulcrum.rearmost_m * length, foremost_m=foot.fulcrum.foremost_m * length)

    def scaled(zone: ContactZone) -> ContactZone:
        return dataclasses.replace(zone, x_mm=_times(zone.x_mm, length), y_mm=_times(zone.y_mm, width),
                                   rise_mm=_times(zone.rise_mm, height))

    return dataclasses.replace(
        foot, keel=keel, fulcrum=fulcrum, zones=tuple(scaled(zone) for zone in foot.zones),
        load_point_m=foot.load_point_m * length, length_m=foot.length_m * length, heel_x_m=foot.heel_x_m * length,
        pylon_x_m=foot.pylon_x_m * length,
        series_patch_m=foot.series_patch_m * length, build_height_m=foot.build_height_m * height,
        foam_thickness_m=foot.foam_thickness_m * height)


def _times(values: tuple[float, ...], ratio: float) -> tuple[float, ...]:
    return tuple(value * ratio for value in values)
