"""Parts of `ship_validation.py`: sections of the validation that take long."""
