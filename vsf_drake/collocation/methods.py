"""The methods of collocation by name, see `problem.Grid`: for options, which need nothing else of
it."""

METHODS = ("hermite_simpson", "trapezoidal")
