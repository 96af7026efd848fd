"""Costs of one walk with the motion given: each a function of the stance and the loads, with exact derivatives."""
