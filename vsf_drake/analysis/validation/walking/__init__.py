"""The section of the validation on walking."""
