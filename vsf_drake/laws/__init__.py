"""Force laws as pure functions of numbers: no simulator, no state, no pydrake.

Those of `compiled.generic` take floats, arrays, `pydrake.autodiffutils.AutoDiffXd` and object
arrays of it, and are compiled for one walk and for eight; gradients are finite wherever the value
is.
"""
