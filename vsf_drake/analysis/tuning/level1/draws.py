"""Other contacts that the data would have allowed as well, drawn around the one that walks.

A contact file holds values, no covariance. What is drawn is half of what was believed before the fit, which is where
the fit itself begins to call a parameter told by the data (`contact_fit.uncertainty.SURE_SHARE`): so the spread is that
of parameters that are just identified; of those that the data say nothing about it is too small. Geometry (offsets,
joint angles) is not drawn: the force fixes it, and a draw alone would lift the foot off the ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.contact_fit.standard import REFERENCE_DEPTH_M, standard_parameters
from vsf_drake.analysis.contact_fit.uncertainty import SURE_SHARE
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import Sweep, lowest, positions, sweep
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.simulation.walk import Walker

SPACING_MM = 10.0
"""Of the sweep of each draw; a parabola finds the minimum between (a choice)."""


@dataclass(frozen=True)
class Draw:
    """One draw: the values it changed, where its cost is least and how much that is, and its sweep.

    NaN if every walk of the sweep fails.
    """

    values: dict[str, float]
    fulcrum_mm: float
    cost: float
    sweep: Sweep


def contact_draws(walker: Walker, side: str, count: int, seed: int) -> list[dict[str, float]]:
    """`count` sets of walk values: force and exponent of each zone's law, damping, friction, keel and support."""
    spread = {item.name: item.scale for item in standard_parameters(walker.variables, side, ()).items}
    own = {name: variable.default for name, variable in walker.variables.items()}
    zones = [name.split(".")[1] for name in own if name.startswith("contact.") and name.endswith(".stiffness")]
    plain = [name for name in ("keel.flexural_modulus", "fulcrum.stiffness", "friction.mu_static",
                               "friction.mu_kinetic", "friction.threshold_velocity") if name in spread]
    rng = np.random.default_rng([seed, 7])
    found = []
    for _ in range(count):
        values, slower = {}, math.exp(SURE_SHARE * spread["contact.damping_time"] * rng.standard_normal())
        for zone in zones:
            k, n, b = (own[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent", "damping"))
            force = math.exp(SURE_SHARE * spread[f"contact.{zone}.force"] * rng.standard_normal())
            exponent = n + SURE_SHARE * spread[f"contact.{zone}.exponent"] * rng.standard_normal()
            exponent = min(max(exponent, min(n, 1.0)), max(n, 2.0))
            values[f"contact.{zone}.stiffness"] = force * k * REFERENCE_DEPTH_M ** (n - exponent)
            values[f"contact.{zone}.exponent"] = exponent
            values[f"contact.{zone}.damping"] = slower * force * b
        for name in plain:
            values[name] = own[name] * math.exp(SURE_SHARE * spread[name] * rng.standard_normal())
        found.append(values)
    return found


def drawn_optima(
    tuning: StiffnessTuning, x: np.ndarray, progress: Callable[[float], None] | None = None
) -> tuple[tuple[Draw, ...], tuple[str, ...]]:
    """The fulcrum with the least cost for each of the options' draws, the rest of the setting as in x (P,).

    Returns:
        The draws that walk, and why others do not.
    """
    first = tuning.parts[0]
    if any(part.walker.model != first.walker.model for part in tuning.parts):
        return (), ("the trials' models differ, so that one draw cannot be for all",)
    values = contact_draws(first.walker, first.trial.subject.prosthetic_side, tuning.options.draws, tuning.options.seed)
    grid = positions(tuning, SPACING_MM)
    found: list[Draw] = []
    failed: list[str] = []
    for k, base in enumerate(values):
        try:
            swept = sweep(tuning, grid, x, step_s=tuning.options.search_step_s, base=base)
        except (InputError, SimulationError) as error:  # no stance at the trial's own setting
            failed.append(str(error))
        else:
            found.append(Draw(base, *lowest(swept.fulcrum_mm, swept.cost), swept))
        if progress:
            progress((k + 1) / len(values))
    return tuple(found), tuple(failed)
