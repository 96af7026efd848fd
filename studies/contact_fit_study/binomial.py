"""How often something was so, with what so few cases leave open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scipy.stats import binomtest


def counted(held: Sequence[bool]) -> dict[str, Any]:
    """Of how many cases how many hold, their share, and the exact 95 % interval of the probability
    (Clopper & Pearson 1934, doi 10.1093/biomet/26.4.404), which takes the cases for independent;
    None of no case."""
    n, k = len(held), sum(held)
    if not n:
        return {"n": 0, "held": 0, "share": None, "binomial_95": None}
    found = binomtest(k, n).proportion_ci(method="exact")
    return {"n": n, "held": k, "share": k / n, "binomial_95": [float(found.low), float(found.high)]}
