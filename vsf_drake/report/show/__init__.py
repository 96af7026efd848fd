"""The model to look at and to move by sliders, in Meshcat or as one page; nothing advances in
time."""
