"""The implicit stepper: compiled dynamics of a tree of joints under stiff forces, and its exact
sensitivities."""
