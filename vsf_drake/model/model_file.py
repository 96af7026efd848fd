"""Model files, and what the parameters in one must have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import user_path
from vsf_drake.base.schema import check, load_yaml, quantity, to_plain, unit_hint
from vsf_drake.base.yaml_file import dump
from vsf_drake.laws.beam import section_inertia, taper
from vsf_drake.model.parameters import (
    ContactZone,
    FootParameters,
    FulcrumParameters,
    KeelParameters,
    ModelParameters,
)
from vsf_drake.model.setting import moves

FOAM_LOADS_N = (200.0, 600.0)
"""Between these the bench measures the stiffness (McGeehan 2021, doi 10.1115/1.4050456; the upper
one a choice)."""
NO_FULCRUM = "this foot has no fulcrum: it is passive"
DEEPEST_M = 1.0  # a foam that bears less than the largest load at this depth is none


@dataclass(frozen=True, kw_only=True)
class _FootInFile(FootParameters):
    """A foot as people write it: of a passive one they say where its keel is clamped."""

    clamp_m: float | None = quantity(
        None, unit="m", low=0.0, high=1.0, source="from the keel's posterior end A, measured"
    )


@dataclass(frozen=True, kw_only=True)
class _ModelInFile(ModelParameters):
    foot: _FootInFile = field(default_factory=_FootInFile)


def load_model(path: str | Path) -> ModelParameters:
    """Reads and checks a model file, such as `package://vsf_drake/soft_support.yaml`, which comes
    with the package.

    `clamp_m` of its foot makes a passive one of it, a foot without a fulcrum: its keel is clamped
    there (m from A). In the model that is a support that cannot move, `rearmost_m` and `foremost_m`
    of the fulcrum in one. A passive foot without a name has the file's.
    """
    path = user_path(path)
    read = load_yaml(path, _ModelInFile)
    foot = FootParameters(
        **{key.name: getattr(read.foot, key.name) for key in fields(FootParameters)}
    )
    if read.foot.clamp_m is not None:
        own = foot.fulcrum
        require(
            (own.rearmost_m, own.foremost_m)
            == (FulcrumParameters.rearmost_m, FulcrumParameters.foremost_m),
            "does not go with clamp_m: a keel that is clamped has no fulcrum",
            "foot.fulcrum.rearmost_m, foremost_m",
            "Leave these two out, or clamp_m",
            file=path,
        )
        at = read.foot.clamp_m
        foot = replace(foot, fulcrum=replace(own, rearmost_m=at, foremost_m=at))
    if not moves(foot):
        foot = replace(foot, name=foot.name or path.stem)
    model = ModelParameters(
        **{key.name: getattr(read, key.name) for key in fields(ModelParameters)} | {"foot": foot}
    )
    return check_model(model, file=path)


def model_yaml(model: ModelParameters) -> str:
    """`model` as the text of a file that `load_model` reads."""
    plain = to_plain(model)
    foot = plain["foot"]
    if not moves(model.foot):
        del foot["fulcrum"]["foremost_m"]
        foot = {"clamp_m": foot["fulcrum"].pop("rearmost_m")} | foot
    return dump({**plain, "foot": foot})


def check_model(model: ModelParameters, *, file: str | Path | None = None) -> ModelParameters:
    """Returns `model` after checking ranges and whether its parts make a foot; see `check_foot`."""
    check(model, file=file)
    _check_zones(model.intact_foot.zones, "intact_foot.", file)
    check_foot(model.foot, file=file, group="foot.")
    return model


def check_foot(
    foot: FootParameters, *, file: str | Path | None = None, group: str = ""
) -> FootParameters:
    """Returns `foot` after checking its ranges and whether its parts make a foot; `group` is what
    messages call it."""
    check(foot, file=file, where=group)
    _check_zones(foot.zones, group, file)
    length = sum(foot.keel.element_lengths_m)
    fulcrum = foot.fulcrum
    places = [1e-3 * x for zone in foot.zones for x in zone.x_mm]
    parts = (
        foot.keel.density_kg_m3 * length * foot.keel.width_m * foot.keel.thickness_m
        + fulcrum.carriage_mass_kg
    )
    reach = f"clamp {fulcrum.rearmost_m} m"
    if fulcrum.rearmost_m != fulcrum.foremost_m:
        reach = f"rearmost {fulcrum.rearmost_m} m, foremost {fulcrum.foremost_m} m"
    tip = foot.heel_x_m + foot.length_m
    below = 0.5 * foot.keel.thickness_m + foot.foam_thickness_m
    for holds, where, what, right in (
        (
            0.0 < fulcrum.rearmost_m <= fulcrum.foremost_m < foot.load_point_m <= length + 1e-12,
            "clamp_m" if fulcrum.rearmost_m == fulcrum.foremost_m else "fulcrum",
            (
                f"{reach} and load point {foot.load_point_m} m must increase and lie within the "
                f"keel of {length:.4f} m"
            ),
            None,
        ),
        (
            foot.keel.taper_from_m < length,
            "keel.taper_from_m",
            f"the keel of {length:.4f} m does not reach to {foot.keel.taper_from_m:g} m",
            "It must begin to thin before its tip",
        ),
        (
            max(places) <= max(length, tip) + 1e-9,
            "zones",
            f"a contact sphere at x = {1e3 * max(places):g} mm is ahead of keel and shell",
            f"The keel ends at {1e3 * length:g} mm, the shell at {1e3 * tip:g} mm",
        ),
        (
            min(places) < fulcrum.rearmost_m,
            "zones",
            "no contact sphere sits on the heel block",
            "At least one must lie behind the "
            f"{'rearmost fulcrum' if moves(foot) else 'clamp'}, {1e3 * fulcrum.rearmost_m:g} mm",
        ),
        (
            parts < foot.mass_kg,
            "mass_kg",
            f"keel and carriage weigh {parts:.3f} kg, the whole foot {foot.mass_kg:g} kg",
            "Give the mass of the whole foot, or make keel or carriage lighter",
        ),
        (
            foot.build_height_m > below,
            "build_height_m",
            (
                f"{foot.build_height_m:g} m from sole to pylon leaves no room above the keel, "
                f"whose middle is {below:.4g} m above the sole"
            ),
            None,
        ),
    ):
        require(holds, what, f"{group}{where}", right, file=file)
    return foot


def in_shell(
    foot: FootParameters, length_m: float, *, file: str | Path | None = None, group: str = ""
) -> FootParameters:
    """`foot` in a shell of `length_m`: ends and contact points lie farther from A in proportion,
    and it has so much more foam, and mass beside keel and carriage (choices). The device has one
    size: keel, fulcrum, reach, load point, pylon and the foam under the bench's platen stay. The
    bench tells the spheres under its platen and on the heel block by where they lay before, which
    `shell_ratio` keeps. InputError with `file` and `group` as of `check_foot`."""
    ratio = length_m / foot.length_m
    keel = foot.keel
    device_kg = (
        sum(keel.element_lengths_m) * keel.width_m * keel.thickness_m * keel.density_kg_m3
        + foot.fulcrum.carriage_mass_kg
    )
    zones = tuple(
        replace(
            zone,
            x_mm=tuple(ratio * x for x in zone.x_mm),
            stiffness=ratio * zone.stiffness,
            damping_n_s_per_m=ratio * zone.damping_n_s_per_m,
        )
        for zone in foot.zones
    )
    return check_foot(
        replace(
            foot,
            zones=zones,
            length_m=length_m,
            shell_ratio=ratio * foot.shell_ratio,
            heel_x_m=ratio * foot.heel_x_m,
            mass_kg=foot.mass_kg + (ratio - 1.0) * (foot.mass_kg - device_kg),
        ),
        file=file,
        group=group,
    )


def _check_zones(zones: tuple[ContactZone, ...], group: str, file: str | Path | None) -> None:
    require(
        zones, "there are no contact zones", f"{group}zones", "A foot needs at least one", file=file
    )
    for i, zone in enumerate(zones):
        require(
            len(zone.x_mm) == len(zone.y_mm) == len(zone.rise_mm) > 0,
            "x_mm, y_mm and rise_mm must have the same length, at least 1",
            f"{group}zones[{i}] ({zone.name})",
            file=file,
        )


def bending_stiffness(keel: KeelParameters) -> np.ndarray:
    """E I (N m^2) of each of the keel's elements, in its middle."""
    lengths = np.array(keel.element_lengths_m)
    ratio = taper(
        np.cumsum(lengths) - 0.5 * lengths,
        start=keel.taper_from_m,
        end=float(lengths.sum()),
        tip=keel.tip_stiffness,
    )
    return keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m) * ratio


def foam_under_load(foot: FootParameters) -> tuple[float, float] | None:
    """Stiffness (N/m^exponent) and exponent of the spheres in the patch that the bench loads; None
    without foam.

    In another shell the spheres lie farther apart in proportion to their stiffness: of each the
    platen, which is as long as it was, bears on a share of 1 / `shell_ratio`.

    It is the walker's side of what the bench knows as `series_stiffness_n_per_m` and
    `series_exponent`: the two should agree. Exact where the spheres share exponent and height; else
    the power law of the force that they bear together at FOAM_LOADS_N, counted from where the
    lowest touches.
    """
    loaded = [
        (zone.stiffness / foot.shell_ratio, zone.exponent, 1e-3 * rise_mm)
        for zone, rise_mm in spheres_under_load(foot)
    ]
    if not loaded:
        return None
    stiffness, exponent, rise = np.array(loaded).T
    gap = rise - rise.min()
    if not gap.any() and (exponent == exponent[0]).all():
        return float(stiffness.sum()), float(exponent[0])

    def surplus(depth: float, load: float) -> float:
        return float(np.sum(stiffness * np.maximum(depth - gap, 0.0) ** exponent)) - load

    if surplus(DEEPEST_M, FOAM_LOADS_N[1]) < 0.0:
        return None
    # F = k d^n at both loads: n = ln(F2 / F1) / ln(d2 / d1), k = F2 / d2^n, with n of 1 or more.
    low, high = (
        brentq(surplus, 0.0, DEEPEST_M, args=(load,), xtol=1e-15, maxiter=1000)
        for load in FOAM_LOADS_N
    )
    power = max(1.0, math.log(FOAM_LOADS_N[1] / FOAM_LOADS_N[0]) / math.log(high / low))
    return float(FOAM_LOADS_N[1] / high**power), power


def secant_stiffness(stiffness: float, exponent: float, load_n: float) -> float:
    """Force over depth (N/m) of a foam that bears stiffness * depth**exponent, under `load_n`:
    k^(1/n) F^(1 - 1/n)."""
    secant: float = stiffness ** (1.0 / exponent) * load_n ** (1.0 - 1.0 / exponent)
    return secant


def spheres_under_load(foot: FootParameters) -> list[tuple[ContactZone, float]]:
    """Zone and rise (mm) of each contact sphere in the patch that the bench loads, told by where
    it lies in a shell of `shell_ratio` 1."""
    return [
        (zone, rise_mm)
        for zone in foot.zones
        for x, rise_mm in zip(zone.x_mm, zone.rise_mm, strict=True)
        if abs(1e-3 * x / foot.shell_ratio - foot.load_point_m) <= 0.5 * foot.series_patch_m
    ]


def check_fulcrum(
    fulcrum_m: float,
    foot: FootParameters,
    *,
    file: str | Path | None = None,
    where: str = "fulcrum",
) -> float:
    """Returns `fulcrum_m` (m from A) if it is a number and the carriage of `foot` can reach it; of
    a passive foot, if that is where its keel is clamped."""
    low = foot.fulcrum.rearmost_m
    high = foot.fulcrum.foremost_m
    require(
        not np.ndim(fulcrum_m) and np.asarray(fulcrum_m).dtype.kind in "iuf",
        f"{fulcrum_m!r} is not a number",
        where,
        "Its unit is m from A",
        file=file,
    )
    reached = low - 1e-9 <= fulcrum_m <= high + 1e-9
    require(reached or moves(foot), NO_FULCRUM, where, "Leave it out", file=file)
    require(
        reached,
        f"the fulcrum at {1e3 * fulcrum_m:g} mm is out of the carriage's reach",
        where,
        f"It must be between {1e3 * low:g} and {1e3 * high:g} mm"
        f"{unit_hint(1e3 * fulcrum_m, 'mm', 1e3 * low, 1e3 * high)}",
        file=file,
    )
    return fulcrum_m


def stated_fulcrum(
    stated_mm: float | None,
    foot: FootParameters,
    *,
    default_m: float | None = None,
    file: str | Path | None = None,
    where: str = "fulcrum_mm",
) -> float:
    """The fulcrum's position (m from A) that is stated in mm, else the default; of a passive foot,
    for which nothing may be stated, where its keel is clamped. InputError where that fails."""
    if not moves(foot):
        require(stated_mm is None, NO_FULCRUM, where, "Leave it out", file=file)
        return foot.fulcrum.rearmost_m
    place_m = default_m if stated_mm is None else 1e-3 * stated_mm
    if place_m is None:
        raise InputError(
            "the key is missing",
            file=file,
            where=where,
            right="Its unit is mm, from the keel's end",
        )
    return check_fulcrum(place_m, foot, file=file, where=where)


def check_movable(foot: FootParameters, right: str, file: str | Path | None = None) -> None:
    """InputError, with what would be `right`, for a passive foot, in the trial `file`."""
    require(moves(foot), NO_FULCRUM, "foot", right, file=file)
