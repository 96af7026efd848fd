"""The chapter of the validation on sensitivity."""
