"""The paper's study on any trials: bench, standing, walking, energy, roll-over.

`study.make_study` reads and walks the trials; each section is a function of the study. Which
settings can be told apart, and sensitivity, are records of what a study has computed.
"""
