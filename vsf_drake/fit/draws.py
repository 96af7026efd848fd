"""Other contacts that the data would have allowed as well, drawn around the one that walks.

A contact file holds values, no covariance. What is drawn is half of what was believed before the
fit, which is where the fit itself begins to call a parameter told by the data
(`solve.SURE_SHARE`): so the spread is that of parameters that are just identified; of
those that the data say nothing about it is too small. Geometry (offsets, joint angles) is not
drawn: the force fixes it, and a draw alone would lift the foot off the ground.
"""

from __future__ import annotations

import math

import numpy as np

from vsf_drake.fit.parameters import REFERENCE_DEPTH_M, standard_parameters
from vsf_drake.fit.solve import SURE_SHARE
from vsf_drake.simulation.walk import Walker


def contact_draws(walker: Walker, side: str, count: int, seed: int) -> list[dict[str, float]]:
    """`count` sets of walk values: force and exponent of each zone's law, damping, friction, keel
    and support."""
    spread = {
        item.name: SURE_SHARE * item.scale
        for item in standard_parameters(walker.variables, side, ()).items
    }
    own = {name: variable.default for name, variable in walker.variables.items()}
    zones = [
        name.split(".")[1]
        for name in own
        if name.startswith("contact.") and name.endswith(".stiffness")
    ]
    plain = [
        name
        for name in (
            "keel.flexural_modulus",
            "fulcrum.stiffness",
            "friction.mu_static",
            "friction.mu_kinetic",
            "friction.threshold_velocity",
        )
        if name in spread
    ]
    rng = np.random.default_rng([seed, 7])

    def factor(name: str) -> float:
        return math.exp(spread[name] * rng.standard_normal())

    sets: list[dict[str, float]] = []
    for _ in range(count):
        values: dict[str, float] = {}
        slower = factor("contact.damping_time")
        for zone in zones:
            # F = k d^n with drawn F and n has at the reference depth d_0 the force: k' = f k
            # d_0^(n - n')
            k, n, b = (
                own[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent", "damping")
            )
            force = factor(f"contact.{zone}.force")
            exponent = n + spread[f"contact.{zone}.exponent"] * rng.standard_normal()
            exponent = min(max(exponent, min(n, 1.0)), max(n, 2.0))
            values[f"contact.{zone}.stiffness"] = force * k * REFERENCE_DEPTH_M ** (n - exponent)
            values[f"contact.{zone}.exponent"] = exponent
            values[f"contact.{zone}.damping"] = slower * force * b
        sets.append(values | {name: own[name] * factor(name) for name in plain})
    return sets
