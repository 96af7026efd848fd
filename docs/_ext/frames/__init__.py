"""Drawings of the frames and signs, made from the model: every position and direction is asked of a
plant."""
