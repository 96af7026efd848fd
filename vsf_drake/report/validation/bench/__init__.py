"""The chapter of the validation on bench."""
