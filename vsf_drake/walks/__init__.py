"""Walks of recorded trials: to walk one, to compare it, and the quantities that come out."""
