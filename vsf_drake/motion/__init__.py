"""Recordings in: the trial manifest, OpenSim tables, joint trajectories, force plates, stances, filters."""
