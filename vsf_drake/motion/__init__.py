"""Recordings in: laboratory files, the trial manifest, joint trajectories, force plates, stances,
filters."""
