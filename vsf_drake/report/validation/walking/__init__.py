"""The chapter of the validation on walking."""
