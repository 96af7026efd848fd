"""MuJoCo's contact in newtons and metres, for any geom of any model: stiffness · depthⁿ + damping ·
depth rate.

MuJoCo states the softness of a contact as an acceleration, `solref` and `solimp`, which it scales
with inertias that it works out as it compiles the whole model. `calibrate` reads these from the
compiled model and turns the scaling round. It needs no plugin and changes numbers of the model
only:

    model = mujoco.MjModel.from_xml_path("scene.xml")
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    calibrate(model, geoms=["ball"], stiffness=2e4, damping=30.0)

How it works. MuJoCo finds the normal force f of a contact of depth r, depth rate v and depth
acceleration a from

    f = (aref(r, v) + a) / R,    R = (1 - d) / d · A,

never below 0, where d is the impedance out of `solimp`, aref comes from `solref`, and A is the sum
of `body_invweight0` of the two bodies that touch. aref / R is made the spring k and damper c. What
is left is a mass 1 / R at the contact. A small d makes it small, but spring and damper act as at
the start of the step h, which for a stiff contact of a light body is unsteady. So d is chosen such
that 1 / R = h² k + h c, and a little damping is added, d h k:

    f = k (r + d h v + h² a) + c (v + h a).

The damper is that of the end of the step. So is the spring where it is stiff for the step, d near
1, and its contact is steady at any stiffness. Where the step resolves it, d is near 0, and it loses
next to nothing. The error falls with the step, as that of every other force in the model.

What to mind:

- d belongs to `model.opt.timestep`, and A to the masses. Call it again after a change of either
  (and after `mj_setConst`, which updates `body_invweight0`).
- A counts both bodies. A floor, or anything without joints, counts 0 and needs no thought. Should
  the geoms meet something that moves, name it in `against`: against a partner that it was not
  told of, force and mass are less, by A of the geom over A of both. If two of the geoms touch one
  another, MuJoCo mixes their numbers: calibrate one of the two.
- d is 1e-4 at least. So a body of great inertia (one that is led along a path, its joints given a
  huge armature) has a contact mass of 1e-4 of that. Set its `body_invweight0` to 1 before.
- The force is that of one contact point; a box that lies flat has four.
- A contact in MuJoCo never pulls, and its damper acts both ways and along the ground: without
  damping there is no friction. Damping in loading only, as of
  foam, cannot be written; half of it loses about the same energy.
- MuJoCo's implicit integrators take dampers of joints and tendons at the end of the step, but only
  after it has found the contacts' forces. These are found as if the bodies could still be
  accelerated freely, and rattle where a damper is strong for the inertia that it acts on (h times
  its coefficient is the greater). The damper's step then has to be seen as inertia: an `armature`
  of h times `damping` in that joint or tendon. In a foot that `vsf-drake export` wrote, this is
  done here.
- Friction and normal force depend on one another in MuJoCo. With the elliptic cone, a contact that
  sticks has the whole stiffness. In one that slides it is divided by 1 + mu² / `opt.impratio`, and
  the damper feels mu times the sliding speed. `impratio` 10 makes the former 2.5 % with mu 0.5. A
  contact that sticks creeps, by its force along the ground over `impratio` times the damping. The
  pyramidal cone, which is MuJoCo's default, has other stiffnesses when it sticks and when it
  slides, and is refused.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from vsf_drake.base.errors import InputError, require

if TYPE_CHECKING:
    import mujoco

DEPTH_M = 0.015  # up to which an exponent that is not 1 is approached, unless another is given
_SPHERE = "foam_"
_KEEL = "keel_"
_SUPPORT = "vsf_support"
_NUMERIC = "sphere_"
"""In an exported foot: what the names of the contact spheres and of the keel's joints begin with,
the tendon's name, and what the names of the spheres' custom numerics begin with."""
_LOADING_SHARE = 0.5
"""Of the damping that a foot's foam has in loading only, as damping both ways: a depth that goes up
and down alike loses the same energy in both."""
_RANGES = {"stiffness": (0.0, 1e30), "damping": (0.0, 1e30), "exponent": (1.0, 6.0)}
"""The law's numbers; up to exponent 6 `_impedance` was held against it."""
_LEAST = 1e-4
_MOST = 0.9999
"""MuJoCo's own limits of an impedance, mjMINIMP and mjMAXIMP."""
_LEAST_OF_CURVED = 0.01
"""Impedance at `depth` where the exponent is not 1: less leaves no room above MuJoCo's least, 1e-4,
for it to fall towards the surface. It is a mass of 1 % of the body's."""
_MOST_OF_CURVED = 0.9
"""The most for which the fit was held against the law, a mass of 9 times the body's: a curved
contact that would need more for the step is less steady than a straight one."""


def calibrate(
    model: mujoco.MjModel,
    *,
    geoms: Sequence[str] | None = None,
    stiffness: npt.ArrayLike | None = None,
    damping: npt.ArrayLike | None = None,
    exponent: npt.ArrayLike | None = None,
    depth: float = DEPTH_M,
    against: str | None = None,
) -> None:
    """Makes the normal force of the contacts of `geoms` stiffness · depth^exponent + damping · rate
    of depth (N, depth in m), by their `solref`, `solimp` and `priority`.

    Without `geoms` these are the contact spheres of every foot that `vsf-drake export` wrote,
    attached under whatever prefix, with the stiffness, exponent and half of the damping in loading
    that the file states, unless they are given here. The joints of their keels and their supports
    are given the armature that their damping needs, see above.

    Args:
        model: compiled; its `opt.timestep` is the one to be used with, see above.
        geoms: names. Their contacts follow their own law and friction, whatever they touch.
        stiffness: N/m^exponent, one number or one for each geom.
        damping: N s/m, of growing and of falling depth; 0 if left out. Where the exponent n is not
            1 that is at `depth`, and less before, about in proportion to depth^((n - 1) / 2).
        exponent: from 1 to 6; 1 if left out, which is exact. Others are approached by `solimp`.
        depth: m, up to which an exponent that is not 1 is approached, within 1 % of the force
            there. A contact that bears a hundredth of that force may be off by half: take the depth
            that it reaches, no more.
        against: name of a geom that the geoms meet, if its body moves.

    Raises:
        InputError: no such geom, or none that moves; a number out of range; the pyramidal cone; a
            law of the whole model (`mjENBL_OVERRIDE`) or of a pair that would replace this one.

    Source: MuJoCo's documentation, "Computation", on constraint impedance and reference.
    """
    require(not isinstance(geoms, str), "is one name", "geoms", f"Give a list, such as [{geoms!r}]")
    names, law = _foot(model) if geoms is None else (list(geoms), {"damping": 0.0, "exponent": 1.0})
    given = {"stiffness": stiffness, "damping": damping, "exponent": exponent}
    law |= {field: values for field, values in given.items() if values is not None}
    require("stiffness" in law, "is left out", "stiffness", "Give it with the geoms")
    numbers = [
        _numbers(law[field], len(names), field, low, high) for field, (low, high) in _RANGES.items()
    ]
    require(math.isfinite(depth) and depth > 0.0, f"is {depth:g} m", "depth", "It must be positive")
    ids = np.array([_geom(model, name, "geoms") for name in names], dtype=int)
    _refuse_other_laws(model, ids)

    inverse_masses = model.body_invweight0[model.geom_bodyid, 0]  # A of a geom's body, 1/kg
    partner = 0.0 if against is None else inverse_masses[_geom(model, against, "against")]
    still = [name for name, i in zip(names, ids, strict=True) if inverse_masses[i] + partner <= 0.0]
    require(
        not still,
        "does not move, and what it meets is not named",
        still[0] if still else None,
        "Attach its body to what moves, or name the geom that it meets in `against`",
    )
    priority = 1 + np.delete(model.geom_priority, ids).max(initial=0)
    step_s = model.opt.timestep
    for i, k, c, n in zip(ids, *numbers, strict=True):
        A = inverse_masses[i] + partner
        secant = k * depth ** (n - 1.0)
        share = A * (step_s**2 * n * secant + step_s * c)
        d, solimp = _impedance(float(n), float(share / (1.0 + share)))
        highest = solimp[1]
        model.geom_solimp[i] = solimp * [1.0, 1.0, depth, 1.0, 1.0]
        model.geom_solref[i] = [
            -secant * A * (1.0 - d) * (highest / d) ** 2,
            -(c + d * step_s * n * secant) * A * (1.0 - d) * (highest / d),
        ]
        model.geom_priority[i] = priority
    if geoms is None:
        _show_dampers_as_inertia(model)


def _prefixes(model: mujoco.MjModel) -> list[str]:
    """Under which exported feet were attached to `model`."""
    ending = f"{_NUMERIC}stiffness"
    written = [model.numeric(i).name for i in range(model.nnumeric)]
    return [name.removesuffix(ending) for name in written if name.endswith(ending)]


def _foot(model: mujoco.MjModel) -> tuple[list[str], dict[str, Any]]:
    """Names of all spheres of exported feet in `model`, and the numbers of their law."""
    prefixes = _prefixes(model)
    require(
        prefixes,
        "is left out, and the model holds no exported foot",
        "geoms",
        "Name the geoms, and give their stiffness",
    )
    law = {
        field: np.concatenate([model.numeric(f"{p}{_NUMERIC}{field}").data for p in prefixes])
        for field in _RANGES
    }
    names = [
        f"{prefix}{_SPHERE}{i}"
        for prefix in prefixes
        for i in range(len(model.numeric(f"{prefix}{_NUMERIC}stiffness").data))
    ]
    return names, {**law, "damping": _LOADING_SHARE * law["damping"]}


def _show_dampers_as_inertia(model: mujoco.MjModel) -> None:
    """Gives keels and supports of exported feet the armature that a step of their damping is."""
    prefixes = _prefixes(model)
    starts = tuple(f"{prefix}{_KEEL}" for prefix in prefixes)
    keels = [
        model.jnt_dofadr[i] for i in range(model.njnt) if model.joint(i).name.startswith(starts)
    ]
    names = {f"{prefix}{_SUPPORT}" for prefix in prefixes}  # a condensed foot has none
    supports = [i for i in range(model.ntendon) if model.tendon(i).name in names]
    model.dof_armature[keels] = model.opt.timestep * model.dof_damping[keels]
    model.tendon_armature[supports] = model.opt.timestep * model.tendon_damping[supports]


def _numbers(values: npt.ArrayLike, count: int, field: str, low: float, high: float) -> np.ndarray:
    """(count,) numbers from `low` to `high`."""
    try:
        numbers = np.broadcast_to(np.asarray(values, dtype=float), count)
    except (TypeError, ValueError):
        raise InputError(
            "is neither one number nor one for each geom",
            where=field,
            right=f"There are {count} geoms",
        ) from None
    wrong = numbers[~((numbers >= low) & (numbers <= high))]
    require(
        not wrong.size,
        f"is {wrong.max(initial=-math.inf):g}",
        field,
        f"It must be from {low:g} to {high:g}",
    )
    return numbers


def _geom(model: mujoco.MjModel, name: str, where: str) -> int:
    """Its index."""
    try:
        return int(model.geom(name).id)
    except (KeyError, TypeError):
        raise InputError(f"there is no geom {name!r} in the model", where=where) from None


def _refuse_other_laws(model: mujoco.MjModel, ids: np.ndarray) -> None:
    """InputError where the softness of the contacts of the geoms `ids` would not be their own."""
    import mujoco  # noqa: PLC0415 - optional

    require(
        model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC or np.all(model.geom_condim[ids] == 1),
        "is pyramidal, whose stiffness changes as a contact begins to slide",
        "opt.cone",
        "Set it to mujoco.mjtCone.mjCONE_ELLIPTIC, or the geoms' condim to 1 (no friction)",
    )
    require(
        not model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE,
        "gives all contacts one softness (override)",
        "opt.enableflags",
        "Clear mujoco.mjtEnableBit.mjENBL_OVERRIDE",
    )
    paired = np.isin(model.pair_geom1, ids) | np.isin(model.pair_geom2, ids)
    require(
        not paired.any(),
        "a pair states the softness of its own contact",
        "geoms",
        "Remove the pair from the model",
    )


@functools.lru_cache(maxsize=256)
def _impedance(exponent: float, wanted: float) -> tuple[float, np.ndarray]:
    """Impedance d at full depth, as near to `wanted` as can be, and `solimp` for depths as shares
    of the full depth.

    With `solimp`, the spring's force is in proportion to r d(r)² / (1 - d(r)). With one d it is
    straight. For other exponents d falls towards the surface, about as r^((exponent - 1) / 2); its
    least, width, midpoint and power are fitted to the force.
    """
    if exponent == 1.0:
        d = float(np.clip(wanted, _LEAST, _MOST))
        return d, np.array([d, d, 1.0, 0.5, 2.0])
    d = float(np.clip(wanted, _LEAST_OF_CURVED, _MOST_OF_CURVED))
    depth = np.linspace(0.02, 1.0, 50)

    def solimp(numbers: np.ndarray) -> np.ndarray:
        share, width, midpoint, power = numbers
        least = share * d
        rise = (d - least) / _sigmoid(np.array(1.0 / width), midpoint, power)
        return np.array([least, min(least + rise, _MOST), width, midpoint, power])

    def excess(numbers: np.ndarray) -> np.ndarray:
        at = _at(depth, solimp(numbers))
        force = depth * (at / d) ** 2 * (1.0 - d) / (1.0 - at)
        return np.asarray(force - depth**exponent)

    lowest = np.array([_LEAST / d, 1.0, 1e-4, 1.0])
    highest = np.array([0.99, 20.0, 0.9999, 8.0])
    starts = ([0.1, 2.0, 0.05, 1.5], [0.01, 1.5, 0.4, 1.5], [0.3, 5.0, 0.01, 6.0])
    fits = [
        least_squares(
            excess,
            np.clip(start, 1.01 * lowest, 0.99 * highest),
            bounds=(lowest, highest),
            max_nfev=60,
        )
        for start in starts
    ]
    best = solimp(min(fits, key=lambda fit: float(fit.cost)).x)
    return float(_at(np.array(1.0), best)), best


def _at(depth: np.ndarray, solimp: np.ndarray) -> np.ndarray:
    """Impedance at `depth`, as a share of the full depth."""
    least, most, width, midpoint, power = solimp
    return np.asarray(least + (most - least) * _sigmoid(depth / width, midpoint, power))


def _sigmoid(x: np.ndarray, midpoint: float, power: float) -> np.ndarray:
    """MuJoCo's, from 0 at 0 to 1 at 1 and beyond."""
    u = np.minimum(x, 1.0)
    below = u**power / midpoint ** (power - 1.0)
    above = 1.0 - (1.0 - u) ** power / (1.0 - midpoint) ** (power - 1.0)
    return np.asarray(np.where(u <= midpoint, below, above))
