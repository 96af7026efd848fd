"""Every contact under every way to advance it: what runs, how fast, how far from the fitted law.

All are held to one drop and one press (`drop_and_press`). What is compared is the whole of foot, contact and
integrator, under Drake's own Simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.model_file import secant_stiffness, zones_under_load
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS, REFERENCE_LOAD_N
from vsf_drake.plants.foot import CONTACTS
from vsf_drake.simulation.drop_and_press import LEG_KG, PRESS_LOADS_N, SAMPLE_S, Advance, drop, press

DROP_S, LAST_S = 0.8, 0.05
"""Length of a drop, and of its end over which the settled load is averaged."""
REFERENCE = Advance("discrete 0.01 ms", time_step_s=1e-5)
"""Explicit in contact, a tenth of what is stable: the stiff integrators need hours for the paper's law to this end."""
WAYS = (
    Advance("radau3", scheme="radau3"),
    Advance("implicit_euler", scheme="implicit_euler"),
    Advance("velocity_implicit_euler", scheme="velocity_implicit_euler", accuracy=1e-4, max_step_s=1e-3),
    Advance("runge_kutta3", scheme="runge_kutta3"),
    Advance("cenic, steps to 1 ms", scheme="cenic", max_step_s=1e-3),
    Advance("cenic, steps to 10 ms", scheme="cenic"),
    Advance("cenic, steps to 0.1 ms", scheme="cenic", max_step_s=1e-4),
    Advance("discrete 1 ms", time_step_s=1e-3),
    Advance("discrete 0.1 ms", time_step_s=1e-4),
    Advance("discrete 0.05 ms", time_step_s=5e-5),
)


@dataclass(frozen=True)
class Row:
    """One contact under one way to advance it; None where it does not run so far.

    Attributes:
        note: why it does not run; else "".
        simulated_s: how far the drop came.
        real_time_factor: wall time / simulated time of the drop, its samples every SAMPLE_S included.
        settled: mean load over the last LAST_S / weight.
        stiffness_n_per_m: of the forefoot with the foam of this contact in series, between PRESS_LOADS_N.
        peak_n: largest vertical force. rms_n: difference from the reference's, root of mean square over the drop.
    """

    contact: str
    way: str
    note: str
    simulated_s: float
    real_time_factor: float | None
    settled: float | None
    stiffness_n_per_m: float | None
    peak_n: float | None
    rms_n: float | None


@dataclass(frozen=True)
class Comparison:
    """All rows, the vertical forces (N) by (contact, way) over `time_s`, and what they are held against."""

    rows: tuple[Row, ...]
    time_s: np.ndarray
    force_n: dict[tuple[str, str], np.ndarray]
    reference_n: np.ndarray
    reference_name: str
    weight_n: float
    fulcrum_m: float


def compare_contacts(
    foot: FootParameters, *, contacts: Sequence[str] = CONTACTS, ways: Sequence[Advance] = WAYS,
    reference: Advance = REFERENCE, fulcrum_m: float = 0.108, drop_s: float = DROP_S, wall_limit_s: float = 60.0,
    progress: Callable[[str], None] | None = None
) -> Comparison:
    """Drops the leg and presses the foot, for each of `contacts` under each of `ways`.

    Args:
        reference: how the paper's law is advanced that all forces are held against, without a limit of wall time.
        wall_limit_s: a drop or press that takes longer is stopped, and its row says how far it came.
        progress: called with what is done next.

    Raises:
        InputError: the reference does not run, or the carriage cannot reach `fulcrum_m`.
    """
    tell = progress or (lambda text: None)
    tell(f"reference: kelvin_voigt, {reference.name}")
    samples = round(drop_s / SAMPLE_S)
    fitted, _, note = drop(foot, "kelvin_voigt", reference, fulcrum_m, drop_s, np.inf)
    if len(fitted) < samples:
        raise InputError(f"the reference does not run: {note}", where="foot")
    rises = {}
    for way in ways:
        tell(f"press: {way.name}")
        rises[way.name] = press(foot, way, fulcrum_m, wall_limit_s)
    rows, forces = [], {}
    for contact in contacts:
        for way in ways:
            tell(f"drop: {contact}, {way.name}")
            force, wall_s, note = drop(foot, contact, way, fulcrum_m, drop_s, wall_limit_s)
            forces[contact, way.name] = force
            rows.append(_row(foot, contact, way, rises[way.name], force, wall_s, note, fitted))
    return Comparison(
        rows=tuple(rows), time_s=SAMPLE_S * np.arange(1, samples + 1), force_n=forces, reference_n=fitted,
        reference_name=reference.name, weight_n=(LEG_KG + foot.mass_kg) * GRAVITY, fulcrum_m=fulcrum_m)


def foam_stiffness(foot: FootParameters, contact: str) -> float:
    """Secant stiffness (N/m) between PRESS_LOADS_N of the foam under the bench's load, as `contact` has it.

    Of our laws and the bench itself: `series_stiffness_n_per_m`. Of Drake's: the spheres or pads in the patch of
    `series_patch_m`, which are equally stiff.
    """
    if contact not in DRAKE_CONTACTS:
        depth = (np.array(PRESS_LOADS_N) / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)
        return float(np.diff(PRESS_LOADS_N)[0] / np.diff(depth)[0])
    return sum(secant_stiffness(zone.stiffness, zone.exponent, REFERENCE_LOAD_N) for zone in zones_under_load(foot))


def _row(
    foot: FootParameters, contact: str, way: Advance, rise: np.ndarray | None, force: np.ndarray, wall_s: float,
    note: str, reference: np.ndarray
) -> Row:
    whole, refused = len(force) == len(reference), note.startswith("refused")
    if whole and not np.all(np.isfinite(force)):
        whole, note = False, "gives forces that are not finite"
    weight = (LEG_KG + foot.mass_kg) * GRAVITY
    stiffness = None
    if rise is not None and not refused:
        slope = (PRESS_LOADS_N[1] - PRESS_LOADS_N[0]) / (rise[1] - rise[0])
        stiffness = float(1.0 / (1.0 / slope + 1.0 / foam_stiffness(foot, contact)))
    simulated = SAMPLE_S * len(force)
    return Row(
        contact=contact, way=way.name, note=note, simulated_s=simulated,
        real_time_factor=wall_s / simulated if simulated else None,
        settled=float(np.mean(force[-round(LAST_S / SAMPLE_S):]) / weight) if whole else None,
        stiffness_n_per_m=stiffness, peak_n=float(np.max(force)) if whole else None,
        rms_n=float(np.sqrt(np.mean((force - reference) ** 2))) if whole else None)
