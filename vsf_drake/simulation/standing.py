"""The person standing still on both feet: joints held, the pelvis as free as a stiff person can stay up with.

Three ways, the freest first that stays up:

    all six     the pelvis is free altogether; takes a posture whose centre of mass is over both feet, in which the
                feet right the person faster than the weight topples it
    sideways    place and list free; tilt and rotation held
    upright     place free; the attitude held, at the list at which both unloaded soles touch the floor

The person is let go a little off rest (NUDGE_M, NUDGE_RAD), so that standing still means coming back.

At anatomically neutral angles hip, knee and ankle stand over each other and the centre of mass over the ankle, near
the heel's end of the foot: leaning back on their own sponginess the feet lose their toes before they right the body,
so that nobody of this build balances fore and aft without leaning at the ankles, as people do. What holding took is
therefore part of the result. Sideways it depends on the weight and on how much softer the prosthesis is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.person import PELVIS_COORDINATES
from vsf_drake.simulation.posture import LEAST_SHARE, ROTATIONS, TRANSLATIONS, Equilibrium, Posture
from vsf_drake.simulation.standing_result import NUDGE_M, NUDGE_RAD, Standing
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker
from vsf_drake.simulation.walk_notes import AT_REST

LARGEST_SWAY_RAD = np.radians(1.0)
"""Turn of a free pelvis from its equilibrium after which the person counts as falling (a choice)."""
LONGEST_S = 120.0
"""Longest time (s) to stand: the record of every step stays in memory."""


def simulate_standing(
    subject: Subject, model: ModelParameters, *, fulcrum_m: float = 0.108, duration_s: float = 10.0,
    step_s: float = DEFAULT_STEP_S, angles: Mapping[str, float] | None = None, upright: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Standing:
    """Stands the person on both feet for `duration_s`.

    Args:
        angles: rad by coordinate, such as those of a recorded standing trial; 0 (anatomically neutral) where not
            named. Joints stay there; pelvis_tilt and pelvis_rotation are where the pelvis is held, or looked for.
        upright: whether to hold the attitude in any case, so that persons and settings compare.
        progress: called with the finished fraction of a run.

    Raises:
        InputError, SimulationError: see `Walker`; or the feet cannot both stand on the ground.
    """
    if not 0.0 < duration_s <= LONGEST_S:
        raise InputError(f"{duration_s:g} s is no time to stand", where="duration_s",
                         right=f"It must be above 0 and at most {LONGEST_S:g} s")
    posture = Posture(subject, model, angles or {}, fulcrum_m=fulcrum_m)
    tilt = posture.angles["pelvis_tilt"]
    notes: list[str] = []
    for found in () if upright else _balances(posture, tilt, notes):
        walker = Walker(subject, model, free=TRANSLATIONS + _freed(found))
        try:
            walk, rest_speed = _let_go(posture, walker, found.tilt, found.list, duration_s, step_s, progress)
        except SimulationError as error:
            notes.append(f"With {_names(found)} free the person fell ({error}).")
            continue
        standing = _result(posture, walk, found, rest_speed, notes)
        if standing.turn_rad < LARGEST_SWAY_RAD:
            return standing
        notes.append(f"With {_names(found)} free the person turned by {np.degrees(standing.turn_rad):.1f} degrees.")
    walk, rest_speed = _let_go(
        posture, posture.walker, tilt, posture.level_list(tilt), duration_s, step_s, progress)
    return _result(posture, walk, None, rest_speed, notes)


def _let_go(
    posture: Posture, walker: Walker, tilt: float, list_: float, duration_s: float, step_s: float,
    progress: Callable[[float], None] | None
) -> tuple[Walk, float]:
    """Settles the person at an attitude, nudges what is free and lets go; also the largest speed left when settled."""
    q, rest_speed = posture.settled(tilt, list_)
    q["pelvis_ty"] += NUDGE_M
    towards = 1.0 if walker.subject.prosthetic_side == "right" else -1.0
    for name, sign in zip(ROTATIONS, (1.0, towards, towards), strict=True):
        if name in walker.free:
            q[name] += sign * NUDGE_RAD
    return posture.run(walker, q, duration_s=duration_s, step_s=step_s, progress=progress), rest_speed


def _balances(posture: Posture, tilt: float, notes: list[str]) -> list[Equilibrium]:
    """Stable equilibria, the freest first; `notes` learns why there are no more."""
    try:
        return _stable(posture, tilt, notes)
    except SimulationError as error:
        notes.append(f"Whether the person can balance is not known: some attitudes of the pelvis fail ({error}).")
        return []


def _stable(posture: Posture, tilt: float, notes: list[str]) -> list[Equilibrium]:
    sideways = posture.sideways_equilibrium(tilt)
    if sideways is None:
        notes.append("Sideways a person with stiff joints cannot balance on these legs: leaning onto the softer or "
                     "shorter one, the weight topples the body faster than the feet right it. In life muscles about "
                     "the hips do; here the pelvis's list is held where both unloaded soles touch the floor.")
        return []
    found = []
    full = posture.equilibrium(sideways)
    if full is None:
        best, moment = posture.least_tilt_moment(tilt, sideways.list)
        notes.append("Fore and aft no attitude of the pelvis balances a person with stiff joints at these angles: at "
                     f"best (tilt {np.degrees(best):.1f} degrees) the centre of mass stays "
                     f"{_place(moment / posture.weight_n)} the centre of pressure. People lean at the ankles, which "
                     "stand at their given angles here.")
    elif not full.stable:
        notes.append("Fore and aft there is an attitude in balance, but the weight topples the body from it faster "
                     "than the feet right it.")
    else:
        found.append(full)
    if not sideways.stable:
        notes.append("Sideways there is an attitude in balance, but the person topples from it.")
    else:
        found.append(sideways)
    return found


def _freed(found: Equilibrium) -> tuple[str, ...]:
    """The pelvis angles that go free with a balance: rotation, which only friction opposes, with the full one alone."""
    return ROTATIONS if len(found.free) == 2 else found.free


def _names(found: Equilibrium) -> str:
    return "the whole pelvis" if len(found.free) == 2 else "the pelvis's list"


def _place(ahead_m: float) -> str:
    return f"{1e3 * abs(ahead_m):.0f} mm {'behind' if ahead_m < 0 else 'ahead of'}"


def _result(
    posture: Posture, walk: Walk, found: Equilibrium | None, rest_speed: float, notes: list[str]
) -> Standing:
    tree, record = walk.mechanism.tree, walk.record
    columns = [tree.index(name) for name in PELVIS_COORDINATES]
    free = TRANSLATIONS + (_freed(found) if found else ())
    held = {name: float(record.load[-1, tree.index(name)]) for name in ROTATIONS if name not in free}
    said = list(notes)
    if "pelvis_tilt" in held:
        said.append(f"Holding the pelvis's tilt took {abs(held['pelvis_tilt']):.1f} N m: the centre of mass is "
                    f"{_place(held['pelvis_tilt'] / posture.weight_n)} the centre of pressure.")
    if "pelvis_list" in held:
        side = posture.walker.subject.prosthetic_side
        towards = "prosthetic" if (held["pelvis_list"] < 0.0) == (side == "left") else "intact"
        said.append(f"Holding its list took {abs(held['pelvis_list']):.1f} N m: the centre of pressure is "
                    f"{1e3 * abs(held['pelvis_list']) / posture.weight_n:.0f} mm from the centre of mass towards the "
                    f"{towards} foot.")
    prosthetic, intact = walk.prosthetic.grf_W[:, 2], walk.intact.grf_W[:, 2]
    share = float(prosthetic.sum() / max((prosthetic + intact).sum(), 1e-9))
    if not LEAST_SHARE < share < 1.0 - LEAST_SHARE:
        said.append(f"The person stands on one leg: the prosthetic foot carries {share:.0%}.")
    if rest_speed > AT_REST:
        said.append(f"The person did not come to rest before the start (speed {rest_speed:.2g}).")
    unconverged = int(np.sum(~record.converged))
    if unconverged:
        said.append(f"{unconverged} of {len(record.time_s)} steps did not converge.")
    refined = int(np.sum(record.parts > 1))
    if refined:
        said.append(f"{refined} of {len(record.time_s)} steps were cut into up to {record.parts.max()} pieces.")
    body = posture.walker.gait.person.body
    plant = walk.mechanism.plant
    plant.SetPositions(walk.mechanism.context, record.q[-1])
    com = plant.CalcCenterOfMassPositionInWorld(walk.mechanism.context)[2] - walk.mechanism.ground_height
    stiffness = None if found is None else float(
        np.linalg.eigvalsh(0.5 * (found.stiffness + found.stiffness.T)).min())
    return Standing(
        time_s=record.time_s, prosthetic_n=prosthetic, intact_n=intact,
        pelvis=np.vstack([record.q0[columns], record.q[:, columns]]), weight_n=posture.weight_n,
        fulcrum_m=posture.fulcrum_m, side=posture.walker.subject.prosthetic_side, name=posture.walker.subject.name,
        free=free, held_nm=held, stiffness_nm_per_rad=stiffness, com_height_m=float(com),
        leg_lengths_m=(body.prosthetic_leg_length, body.leg_length), unconverged_steps=unconverged,
        refined_steps=refined, notes=tuple(said))
