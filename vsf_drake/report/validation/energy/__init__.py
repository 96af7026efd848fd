"""The chapter of the validation on energy storage and return."""
