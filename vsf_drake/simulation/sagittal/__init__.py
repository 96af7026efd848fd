"""The person in the sagittal plane as smooth functions of one instant, with exact derivatives; no
time stepping."""
