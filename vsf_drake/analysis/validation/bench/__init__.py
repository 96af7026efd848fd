"""The section of the validation on bench."""
