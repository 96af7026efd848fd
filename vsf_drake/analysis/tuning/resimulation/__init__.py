"""Solutions of the sagittal problem carried out by the stepper with the full model."""

from vsf_drake.analysis.tuning.resimulation.prescribed import resimulate_prescribed
from vsf_drake.analysis.tuning.resimulation.result import Resimulation
from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory, sagittal_names

__all__ = ["Resimulation", "SagittalTrajectory", "resimulate_prescribed", "sagittal_names"]
