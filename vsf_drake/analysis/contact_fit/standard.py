"""The parameters that a contact fit starts from.

    contact.ZONE.force        N, load of one sphere of the zone at REFERENCE_DEPTH
    contact.ZONE.exponent     of its law
    contact.damping_time      s, damping of all zones over the slope of their law at REFERENCE_DEPTH
    contact.ZONE.rise         m, of the zone's spheres
    offset.height | fore_aft | alignment            of the foot under the pylon, in all trials
    coordinate.NAME           rad, error of a joint angle that all trials share
    curve.NAME.i              rad, smooth error over the gait cycle that all trials share
    socket.AXIS.stiffness     of the bushing
    trial.LABEL.height        m, of one recording alone; its deviation from the mean of all is what is added
    trial.LABEL.path.NAME.i   m, slow correction of the pelvis's path in one recording alone
    keel.flexural_modulus, fulcrum.stiffness, friction.NAME, contact.ZONE.full_damping_depth     frozen

A law's stiffness in N/m^exponent and its exponent cannot be told apart by what a foot carries; a force at a depth
that it reaches, and the exponent, can. All prior widths are choices, for the reason given with each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from vsf_drake.analysis.contact_fit.parameters import PATH_COORDINATES, FitParameter, FitParameters, zones_of
from vsf_drake.errors import InputError
from vsf_drake.simulation.variables import Variable
from vsf_drake.subject import SIDES

REFERENCE_DEPTH_M = 9e-3
"""To which the bench's 600 N presses the nominal foot: 600 N / 65 N/mm at the heel, / 63 N/mm at the forefoot."""
ANGLES = ("hip_flexion", "knee_angle", "hip_adduction")
"""Joint angles of the prosthetic side whose shared errors are fitted: the two that move the foot in the sagittal plane,
and the one that moves it sideways."""
CURVE_COEFFICIENTS = 8
PATH_COEFFICIENTS = 6
_ANGLE_SD, _CURVE_SD = math.radians(1.5), math.radians(0.5)


def standard_parameters(
    variables: Mapping[str, Variable], side: str, labels: Sequence[str], *, damping_by_zone: bool = False,
    curves: Sequence[str] = ANGLES, heights: bool = True, paths: bool = False
) -> FitParameters:
    """The parameters of the joint fit.

    Args:
        variables: of the walker. side: "right" or "left", the prosthetic one.
        labels: of the trials.
        damping_by_zone: a damping time for each zone in place of one for all.
        curves: joint angles (without the side) that have a smooth error over the gait cycle.
        heights: each of several trials has a height of its own.
        paths: each trial has a slow correction of the pelvis's path.

    Raises:
        InputError: see `FitParameters`.
    """
    if side not in SIDES:
        raise InputError(f"{side!r} is no side", where="side", right=f"It must be {' or '.join(SIDES)}")
    unknown = sorted(set(curves) - {name[: -len(f"_{side[0]}")].removeprefix("coordinate.") for name in variables})
    if unknown:
        raise InputError(f"there is no joint angle {unknown[0]!r}", where="curves",
                         right="Give names without the side, such as hip_flexion")
    zones = zones_of(variables)
    suffix = side[0]
    items = [item for zone in zones for item in _zone(variables, zone, damping_by_zone)]
    if not damping_by_zone:
        items.append(_damping_time("contact.damping_time", _default_time(variables, zones[-1])))
    items += _geometry()
    items += [_plain(f"coordinate.{name}_{suffix}", "rad", _ANGLE_SD, 10,
                     "misplaced markers: 1-2 degrees between sessions and examiners") for name in ANGLES]
    items += [_plain(f"curve.{name}_{suffix}.{i}", "rad", _CURVE_SD, 10, "sliding skin and crosstalk")
              for name in curves for i in range(CURVE_COEFFICIENTS)]
    items += [_stiffness(variables, f"socket.{axis}.stiffness", frozen=axis != "tz")
              for axis in ("tx", "ty", "tz", "flexion", "adduction", "rotation")]
    if heights and len(labels) > 1:
        items += [_plain(f"trial.{label}.height", "m", 2e-3, 10, "calibration of the laboratory from trial to trial")
                  for label in labels]
    if paths:
        items += [_plain(f"trial.{label}.path.{name}.{i}", "m", 1e-3, 10, "a slow drift that no foot could make")
                  for label in labels for name in PATH_COORDINATES for i in range(PATH_COEFFICIENTS)]
    items += [_scaled(variables, "keel.flexural_modulus", 0.1, "data sheets of G10/FR4 differ by 20 %"),
              _scaled(variables, "fulcrum.stiffness", 0.3, "calibrated to two published end points")]
    items += [_scaled(variables, f"friction.{name}", 0.3, "the paper's coefficients were given, not fitted")
              for name in ("mu_static", "mu_kinetic", "threshold_velocity")]
    return FitParameters(items)


def _zone(variables: Mapping[str, Variable], zone: str, own_damping: bool) -> list[FitParameter]:
    k, n = (variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent"))
    force = k * REFERENCE_DEPTH_M**n
    found = [
        FitParameter(name=f"contact.{zone}.force", unit="N", start=force, low=force / 8, high=force * 8, mean=force,
                     scale=0.5, logarithmic=True, why="the bench knows the foam under one load point, no more"),
        FitParameter(name=f"contact.{zone}.exponent", unit="1", start=max(n, 1.2), low=1.0, high=2.0,
                     mean=max(n, 1.2), scale=0.3, why="foam hardens; McGeehan 2021 starts from 1"),
        _plain(f"contact.{zone}.rise", "m", 4e-3, 4, "the sole is drawn flat; soles are round"),
        _scaled(variables, f"contact.{zone}.full_damping_depth", 0.5, "0.1 % body weight for twice of it")]
    if own_damping:
        found.append(_damping_time(f"contact.{zone}.damping_time", _default_time(variables, zone)))
    return found


def _default_time(variables: Mapping[str, Variable], zone: str) -> float:
    k, n, b = (variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent", "damping"))
    return float(b / (k * n * REFERENCE_DEPTH_M ** (n - 1.0)))


def _damping_time(name: str, default: float) -> FitParameter:
    return FitParameter(name=name, unit="s", start=default, low=default / 20, high=default * 20, mean=default,
                        scale=0.7, logarithmic=True, why="10 % loss a load cycle by default, a choice")


def _geometry() -> list[FitParameter]:
    return [_plain("offset.height", "m", 0.01, 4, "length of the prosthesis and of the limb in its socket"),
            _plain("offset.fore_aft", "m", 0.01, 4, "where the foot is bolted on"),
            _plain("offset.alignment", "rad", math.radians(3.0), 4, "what a prosthetist sets")]


def _plain(name: str, unit: str, scale: float, reach: float, why: str) -> FitParameter:
    """Zero unless the data say otherwise."""
    return FitParameter(name=name, unit=unit, start=0.0, low=-reach * scale, high=reach * scale, mean=0.0, scale=scale,
                        why=why)


def _stiffness(variables: Mapping[str, Variable], name: str, *, frozen: bool) -> FitParameter:
    v = variables[name]
    return FitParameter(name=name, unit=v.unit, start=v.default, low=v.low, high=v.high, mean=v.default, scale=0.5,
                        logarithmic=True, frozen=frozen, why="measured sockets fix it within a factor of two")


def _scaled(variables: Mapping[str, Variable], name: str, scale: float, why: str) -> FitParameter:
    v = variables[name]
    return FitParameter(name=name, unit=v.unit, start=v.default, low=v.low, high=v.high, mean=v.default, scale=scale,
                        logarithmic=True, frozen=True, why=why)
