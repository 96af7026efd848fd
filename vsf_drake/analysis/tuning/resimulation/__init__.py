"""Solutions of the sagittal problem carried out by the stepper with the full model."""
