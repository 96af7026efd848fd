"""The foot with nobody on it: bench, published tests, an equal load, the stiffness map."""
