"""The section of the validation on energy storage and return."""
