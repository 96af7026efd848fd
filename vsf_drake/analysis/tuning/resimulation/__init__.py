"""Solutions of the sagittal problem carried out by the stepper with the full model."""

from vsf_drake.analysis.tuning.resimulation.feedback import (
           resimulate_prescribed,
           resimulate_with_feedback,
           solved_trajectory,
)
from vsf_drake.analysis.tuning.resimulation.regulator import RegulatorWeights
from vsf_drake.analysis.tuning.resimulation.result import FeedbackUse, Resimulation, design_values
from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory

__all__ = ["FeedbackUse", "RegulatorWeights", "Resimulation", "SagittalTrajectory", "design_values",
           "resimulate_prescribed", "resimulate_with_feedback", "solved_trajectory"]
