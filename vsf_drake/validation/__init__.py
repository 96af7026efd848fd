"""The paper's study on any trials: bench, standing, walking, energy, roll-over, what it can tell
apart, sensitivity.

`study.make_study` reads and walks the trials; each section is a function of the study.
"""
