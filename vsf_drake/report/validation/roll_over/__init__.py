"""The chapter of the validation on roll-over and inclined loading."""
