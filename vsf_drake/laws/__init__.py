"""Force laws as pure functions of arrays: no simulator, no state, no pydrake.

Every function works on float arrays and on object arrays of `pydrake.autodiffutils.AutoDiffXd`,
broadcasts over sites, and has finite gradients wherever its value is finite.
"""
