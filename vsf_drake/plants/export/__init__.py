"""The foot as files for other programs: `foot_sdf` and `foot_mjcf`."""

from vsf_drake.plants.export.mjcf import foot_mjcf
from vsf_drake.plants.export.sdf import foot_sdf

__all__ = ["foot_mjcf", "foot_sdf"]
