"""What a setting of the foot does mechanically: a map over mass, slope and fulcrum, and its
inverse.

    table, arrays = make_map(model, axes=standard_axes(model.foot), load=iso_22675())
    mapped = StiffnessMap(table, arrays)
    mapped.at("radius", mass_kg=90.0, fulcrum_mm=108.0)
    mapped.inverse("radius", 0.25, mass_kg=90.0, slope_deg=0.0)
"""

from vsf_drake.device.roll_over import Load, iso_22675
from vsf_drake.device.stiffness_map.cells import load_profile
from vsf_drake.device.stiffness_map.make import make_map, standard_axes
from vsf_drake.device.stiffness_map.surface import (
    FORMAT,
    Answer,
    Band,
    MapTable,
    StiffnessMap,
    map_of,
)

__all__ = [
    "FORMAT",
    "Answer",
    "Band",
    "Load",
    "MapTable",
    "StiffnessMap",
    "iso_22675",
    "load_profile",
    "make_map",
    "map_of",
    "standard_axes",
]
