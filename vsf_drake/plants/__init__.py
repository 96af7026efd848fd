"""Bodies, joints and diagrams: the foot alone (`add_foot`, `wire_foot`), on the bench, under a
person."""

from vsf_drake.plants.contact_geometry import add_ground_geometry
from vsf_drake.plants.foot import add_foot, mirrored, place_fulcrum
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import (
    FulcrumDrive,
    WiredFoot,
    add_fulcrum_drive,
    add_fulcrum_slider,
    follow_fulcrum,
    wire_foot,
)
from vsf_drake.plants.wiring import share_generalized_forces, share_spatial_forces, to_symbolic

__all__ = [
    "FootHandles",
    "FulcrumDrive",
    "WiredFoot",
    "add_foot",
    "add_fulcrum_drive",
    "add_fulcrum_slider",
    "add_ground_geometry",
    "follow_fulcrum",
    "mirrored",
    "place_fulcrum",
    "share_generalized_forces",
    "share_spatial_forces",
    "to_symbolic",
    "wire_foot",
]
