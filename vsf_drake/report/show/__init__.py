"""The model to look at and to move by sliders, in Meshcat or as one page.

It stands with the report because it draws, and it advances nothing in time: a slider gives a pose, and what bends
under a load is asked of `simulation.bench`, which knows the statics.
"""
