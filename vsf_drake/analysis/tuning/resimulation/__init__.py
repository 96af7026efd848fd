"""Solutions of the sagittal problem carried out by the stepper with the full model."""

from vsf_drake.analysis.tuning.resimulation.design_values import design_values
from vsf_drake.analysis.tuning.resimulation.feedback import resimulate_with_feedback
from vsf_drake.analysis.tuning.resimulation.feedback_use import FeedbackUse
from vsf_drake.analysis.tuning.resimulation.prescribed import resimulate_prescribed
from vsf_drake.analysis.tuning.resimulation.regulator import RegulatorWeights
from vsf_drake.analysis.tuning.resimulation.result import Resimulation
from vsf_drake.analysis.tuning.resimulation.solved import solved_trajectory
from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory

__all__ = ["FeedbackUse", "RegulatorWeights", "Resimulation", "SagittalTrajectory", "design_values",
           "resimulate_prescribed", "resimulate_with_feedback", "solved_trajectory"]
