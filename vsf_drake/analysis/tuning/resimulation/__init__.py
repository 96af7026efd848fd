"""Solutions of the sagittal problem carried out by the stepper with the full model."""

from vsf_drake.analysis.tuning.resimulation.regulator import RegulatorWeights
from vsf_drake.analysis.tuning.resimulation.resimulate import (
    FeedbackUse,
    Resimulation,
    resimulate_prescribed,
    resimulate_with_feedback,
)
from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory, design_values, solved_trajectory

__all__ = ["FeedbackUse", "RegulatorWeights", "Resimulation", "SagittalTrajectory", "design_values",
           "resimulate_prescribed", "resimulate_with_feedback", "solved_trajectory"]
