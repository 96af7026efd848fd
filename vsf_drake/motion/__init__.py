"""Recordings in: laboratory files, the trial manifest, joint trajectories, force plates, stances, filters."""

from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Recording

__all__ = ["Recording", "read_trial"]
