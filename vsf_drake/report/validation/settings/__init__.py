"""The chapter of the validation on whether two settings can be told apart."""
