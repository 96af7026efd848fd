"""What the foot does with nobody on it: bench, ISO 22675, an equal load, the stiffness map."""
