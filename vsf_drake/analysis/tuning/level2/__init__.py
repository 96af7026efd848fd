"""Stiffness tuning in which the motion adapts: trajectory optimisation of one stride in the sagittal plane."""

from vsf_drake.analysis.tuning.level2.options import StrideOptions
from vsf_drake.analysis.tuning.level2.solution import StrideSolution
from vsf_drake.analysis.tuning.level2.tuning import StrideTuning

__all__ = ["StrideOptions", "StrideSolution", "StrideTuning"]
