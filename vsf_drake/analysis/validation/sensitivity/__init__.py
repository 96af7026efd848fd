"""The section of the validation on sensitivity."""
