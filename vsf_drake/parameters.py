"""Every physical parameter of the model as a frozen dataclass: default, unit, source and range.

Schema only; `plants` gives it meaning. SI units inside; a field in another unit says so in
its name. Sources are abbreviated here and spelled out in the README's list of references:

    McGeehan 2021       doi 10.1115/1.4050456, the paper that describes the Simscape model
    GaitModel_VSF       m-mcgeehan/GaitModel_VSF_LumpedParameterBuild, its authors' public scripts
    Glanzer 2018        Glanzer & Adamczyk, the prototype of the foot, PMC6289620
    derived, choice     derived from the former, or an engineering choice nobody has measured
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from vsf_drake.errors import InputError
from vsf_drake.schema import check, choice, load_yaml, quantity

_PAPER = "McGeehan 2021"
_PUBLIC = "GaitModel_VSF scripts"
_CHOICE = "choice, not measured"

SIDES = ("left", "right")
GRAVITY = 9.81
"""m/s^2, as in Drake; what body weight means everywhere here."""
FOAM_DAMPING_TIME_S = 0.1 * 2 * 0.6 / math.pi**2
"""Foam damping / stiffness (s) by default: loses 10 % of the energy of a 0.6 s half-sine load cycle when it acts
in loading only (loss / stored energy = time * pi^2 / (2 * 0.6 s)), as much as the keel's. A choice; McGeehan 2021
starts its contact fit from 0.5 s, at which the foam can hardly be compressed within a step."""


@dataclass(frozen=True, kw_only=True)
class KeelParameters:
    """The leaf-spring keel as a chain of elements: rigid half, sprung revolute joint, rigid half."""

    element_lengths_m: tuple[float, ...] = quantity(
        (0.066,) + (0.163 / 7,) * 7, unit="m", low=1e-4, high=1.0,
        source=f"{_PAPER}: 16 rigid pieces, 8 joints, rigid posterior part of 66 mm, keel of 229 mm")
    width_m: float = quantity(0.0684, unit="m", low=1e-3, high=0.5, source=_PUBLIC)
    thickness_m: float = quantity(0.00635, unit="m", low=1e-4, high=0.05, source=_PUBLIC)
    flexural_modulus_pa: float = quantity(
        18.6e9, unit="Pa", low=1e6, high=1e12, source=f"{_PAPER}: G10/FR4; data sheets 2.7 Mpsi lengthwise")
    density_kg_m3: float = quantity(
        1850.0, unit="kg/m^3", low=100.0, high=2e4, source="G10/FR4 data sheets: specific gravity 1.80-1.85")
    damping_time_s: float = quantity(
        6.1e-3, unit="s", low=0.0, high=1.0,
        source="choice: joint damping / joint stiffness that loses 10 % of the energy of a 0.6 s load cycle")


@dataclass(frozen=True, kw_only=True)
class FulcrumParameters:
    """The movable support under the keel and the carriage that moves it."""

    stiffness_n_per_m: float = quantity(
        176.5e3, unit="N/m", low=1e3, high=1e9, source="studies/calibrate_device.py: published 10 and 32 N/mm")
    damping_time_s: float = quantity(1e-3, unit="s", low=0.0, high=1.0, source=_CHOICE)
    carriage_mass_kg: float = quantity(0.1, unit="kg", low=1e-3, high=2.0, source=_CHOICE)
    rearmost_m: float = quantity(0.066, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 66 mm")
    foremost_m: float = quantity(0.151, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 151 mm")


@dataclass(frozen=True, kw_only=True)
class ContactZone:
    """Contact spheres that share one foam: where they sit in the keel frame K and their law.

    Normal force stiffness * depth**exponent + damping that is full from `full_damping_depth_m` on.
    """

    name: str
    x_mm: tuple[float, ...] = quantity(unit="mm", low=-200.0, high=500.0, source=_PUBLIC)
    y_mm: tuple[float, ...] = quantity(
        unit="mm", low=-200.0, high=200.0, source="derived from the published count of 24")
    rise_mm: tuple[float, ...] = quantity(unit="mm", low=-100.0, high=100.0, source=_CHOICE)
    radius_m: float = quantity(unit="m", low=1e-4, high=0.2, source=_PUBLIC)
    stiffness: float = quantity(unit="N/m^exponent", low=0.0, high=1e30, source="derived")
    exponent: float = quantity(1.0, unit="1", low=1.0, high=20.0, source=f"{_PAPER}: first guess 1")
    damping_n_s_per_m: float = quantity(
        unit="N s/m", low=0.0, high=1e7, source="choice: see FOAM_DAMPING_TIME_S")
    full_damping_depth_m: float = quantity(1e-3, unit="m", low=1e-6, high=0.1, source=f"{_PAPER}: first guess 1 mm")


@dataclass(frozen=True, kw_only=True)
class FrictionParameters:
    """Stick-slip friction between the spheres of a foot and the ground."""

    mu_static: float = quantity(0.5, unit="1", low=0.0, high=5.0, source=_PAPER)
    mu_kinetic: float = quantity(0.3, unit="1", low=0.0, high=5.0, source=_PAPER)
    threshold_velocity_m_per_s: float = quantity(0.1, unit="m/s", low=1e-6, high=10.0, source=_PAPER)


def _zone(name: str, x: tuple[float, ...], y: tuple[float, ...], radius: float, stiffness: float) -> ContactZone:
    return ContactZone(name=name, x_mm=x, y_mm=y, rise_mm=(0.0,) * len(x), radius_m=radius,
                       stiffness=stiffness, damping_n_s_per_m=stiffness * FOAM_DAMPING_TIME_S)


def _pairs(*x: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(v for v in x for _ in "lr"), (25.0, -25.0) * len(x)


def _foot_zones() -> tuple[ContactZone, ...]:
    heel, foam = 65e3 / 3, 62.98e3 / 8
    anterior, midfoot, forefoot = _pairs(71.2), _pairs(144.7, 155.7), _pairs(166.2, 176.7, 187.2, 197.7, 208.2, 218.7)
    return (
        _zone("heel_posterior", *_pairs(3.0), 0.0424, heel),
        _zone("heel", (21.0,), (0.0,), 0.0424, heel),
        _zone("heel_anterior", anterior[0] + (82.2,), anterior[1] + (0.0,), 0.0424, heel),
        _zone("midfoot", (130.0,) + midfoot[0], (0.0,) + midfoot[1], 0.0011, foam),
        _zone("forefoot", forefoot[0] + (229.0,), forefoot[1] + (0.0,), 0.0011, foam),
    )


@dataclass(frozen=True, kw_only=True)
class FootParameters:
    """The variable-stiffness foot. Keel frame K: origin at the keel's posterior end A, x to the toe, z up."""

    keel: KeelParameters = field(default_factory=KeelParameters)
    fulcrum: FulcrumParameters = field(default_factory=FulcrumParameters)
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    zones: tuple[ContactZone, ...] = field(default_factory=_foot_zones)
    series_stiffness_n_per_m: float = quantity(
        62.98e3, unit="N/m", low=1e3, high=1e9,
        source="foam under the load; studies/calibrate_device.py: published 10 and 32 N/mm")
    series_patch_m: float = quantity(
        0.040, unit="m", low=1e-3, high=0.2, source="choice: length of the foam patch that the bench loads")
    heel_stiffness_n_per_m: float = quantity(65e3, unit="N/m", low=1e3, high=1e9, source=f"{_PAPER}: 65 N/mm")
    load_point_m: float = quantity(0.199, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 30 mm behind the keel tip")
    mass_kg: float = quantity(0.649, unit="kg", low=0.05, high=5.0, source="Glanzer 2018, with battery")
    build_height_m: float = quantity(0.087, unit="m", low=0.01, high=0.5, source="Glanzer 2018")
    foam_thickness_m: float = quantity(0.030, unit="m", low=0.0, high=0.2, source=_PUBLIC)
    length_m: float = quantity(0.245, unit="m", low=0.05, high=0.5, source=f"{_PUBLIC}: foam base")
    pylon_x_m: float = quantity(0.055, unit="m", low=-0.1, high=0.3, source=f"{_CHOICE}: pylon axis ahead of A")


@dataclass(frozen=True, kw_only=True)
class BushingAxis:
    """One direction of the socket bushing; force (N or N m) opposes displacement (m or rad)."""

    stiffness: float = quantity(unit="N/m or N m/rad", low=0.0, high=1e9, source="derived")
    stiffness_negative: float = quantity(unit="N/m or N m/rad", low=0.0, high=1e9, source="derived")
    damping: float = quantity(unit="N s/m or N m s/rad", low=0.0, high=1e9, source=f"{_CHOICE}: stiffness times 10 ms")
    limit: float = quantity(unit="m or rad", low=1e-6, high=1.0, source="derived")
    rate_limit: float = quantity(unit="m/s or rad/s", low=1e-6, high=100.0, source=_CHOICE)


def _axis(stiffness: float, limit: float, rate_limit: float, negative: float | None = None) -> BushingAxis:
    return BushingAxis(stiffness=stiffness, stiffness_negative=stiffness if negative is None else negative,
                       damping=0.01 * stiffness, limit=limit, rate_limit=rate_limit)


@dataclass(frozen=True, kw_only=True)
class SocketParameters:
    """Socket, pylon and the six-axis bushing between residual shank and socket.

    Displacements are of the socket in the frame of the residual shank (x forward, y left, z up):
    positive tz is the socket pressed onto the limb, negative tz the socket pulled off.
    """

    tx: BushingAxis = field(default_factory=lambda: _axis(4e4, 0.009, 0.5))
    ty: BushingAxis = field(default_factory=lambda: _axis(4e4, 0.009, 0.5))
    tz: BushingAxis = field(default_factory=lambda: _axis(1e5, 0.015, 0.5, negative=1.5e4))
    flexion: BushingAxis = field(default_factory=lambda: _axis(1000.0, 0.1309, 5.0))
    adduction: BushingAxis = field(default_factory=lambda: _axis(1000.0, 0.0873, 5.0))
    rotation: BushingAxis = field(default_factory=lambda: _axis(300.0, 0.1745, 5.0))
    stop_ratio: float = quantity(
        10.0, unit="1", low=0.0, high=1e4,
        source=f"{_CHOICE}: stiffness and damping added beyond a limit, as multiples of the axis's own")
    socket_mass_kg: float = quantity(0.8, unit="kg", low=0.05, high=10.0, source=f"{_CHOICE}: typical, unverified")
    pylon_mass_kg: float = quantity(0.4, unit="kg", low=0.05, high=10.0, source=f"{_CHOICE}: typical, unverified")
    pylon_radius_m: float = quantity(0.015, unit="m", low=1e-3, high=0.1, source=_PUBLIC)
    residual_length_ratio: float = quantity(
        0.66, unit="1", low=0.1, high=0.95, source=f"{_PUBLIC}: residual shank / intact shank")


def _intact_zones() -> tuple[ContactZone, ...]:
    k = 10.6e3 * 24 / 10
    return (
        _zone("heel", (25.0, 45.0, 45.0), (0.0, 20.0, -20.0), 0.03, k),
        _zone("lateral", (110.0,), (-35.0,), 0.02, k),
        _zone("metatarsal", (180.0, 185.0, 165.0), (30.0, 0.0, -35.0), 0.015, k),
        _zone("forefoot", (223.0, 213.0, 193.0), (30.0, 0.0, -30.0), 0.01, k),
    )


@dataclass(frozen=True, kw_only=True)
class IntactFootParameters:
    """Contact of the intact (right-foot layout) foot, in a foot of 268.3 mm; scales with foot length.

    Sphere x from the heel, y to the left, rise of the sphere's bottom above the flat sole. The foot has
    no toe joint, so its contact ends where a foot bends, at 0.83 of its length (a choice; the
    effective foot length usually quoted for able-bodied walking, unverified).
    """

    zones: tuple[ContactZone, ...] = field(default_factory=_intact_zones)
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    reference_length_m: float = quantity(
        0.2683, unit="m", low=0.1, high=0.5, source="de Leva 1996, male foot scaled to 1.81 m")
    ankle_x_ratio: float = quantity(0.25, unit="1", low=0.0, high=1.0,
                                    source=f"{_CHOICE}: ankle ahead of the heel / foot length")


@dataclass(frozen=True, kw_only=True)
class ModelParameters:
    """Everything about the devices and the contact; the person is in `Subject`."""

    foot: FootParameters = field(default_factory=FootParameters)
    socket: SocketParameters = field(default_factory=SocketParameters)
    intact_foot: IntactFootParameters = field(default_factory=IntactFootParameters)


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The person: measured where known, scaled from the stature (de Leva 1996) where None."""

    mass_kg: float = quantity(unit="kg", low=20.0, high=250.0, source="measured, prosthesis included")
    stature_m: float = quantity(unit="m", low=0.8, high=2.5, source="measured")
    sex: str = choice(options=("male", "female"), source="stated")
    prosthetic_side: str = choice(options=SIDES, source="stated")
    name: str = "subject"
    thigh_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.8, source="measured: hip to knee centre")
    shank_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.8, source="measured: knee to ankle centre")
    ankle_height_m: float | None = quantity(None, unit="m", low=0.02, high=0.2, source="measured: ankle centre to sole")
    foot_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.4, source="measured: heel to toe tip")
    hip_forward_m: float | None = quantity(
        None, unit="m", low=-0.2, high=0.2, source="measured: hip centre ahead of the pelvis origin")
    hip_up_m: float | None = quantity(
        None, unit="m", low=-0.3, high=0.2, source="measured: hip centre above the pelvis origin")
    hip_lateral_m: float | None = quantity(
        None, unit="m", low=0.03, high=0.2, source="measured: hip centre beside the pelvis origin")


def load_model(path: str | Path) -> ModelParameters:
    """Reads and checks a model file.

    Raises:
        InputError: see `vsf_drake.schema.load_yaml` and `check_model`.
    """
    return check_model(load_yaml(path, ModelParameters), file=path)


def check_model(model: ModelParameters, *, file: str | Path | None = None) -> ModelParameters:
    """Returns `model` after checking ranges and what fields must share.

    Raises:
        InputError: a value is out of range, or lists of one zone differ in length, or the
            fulcrum or the load point lies outside the keel.
    """
    check(model, file=file)
    for group, zones in (("foot", model.foot.zones), ("intact_foot", model.intact_foot.zones)):
        for i, zone in enumerate(zones):
            if not len(zone.x_mm) == len(zone.y_mm) == len(zone.rise_mm) > 0:
                raise InputError("x_mm, y_mm and rise_mm must have the same length, at least 1",
                                 file=file, where=f"{group}.zones[{i}] ({zone.name})")
    length = sum(model.foot.keel.element_lengths_m)
    fulcrum = model.foot.fulcrum
    if not 0.0 < fulcrum.rearmost_m < fulcrum.foremost_m < model.foot.load_point_m <= length + 1e-12:
        raise InputError(
            f"rearmost {fulcrum.rearmost_m} m, foremost {fulcrum.foremost_m} m and load point "
            f"{model.foot.load_point_m} m must increase and lie within the keel of {length:.4f} m",
            file=file, where="foot.fulcrum")
    return model


def check_fulcrum(fulcrum_m: float, foot: FootParameters, *, file: str | Path | None = None,
                  where: str = "fulcrum") -> float:
    """Returns `fulcrum_m` (m from A) if the carriage of `foot` can reach it.

    Raises:
        InputError: it is outside the range of the carriage.
    """
    low, high = foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m
    if not low - 1e-9 <= fulcrum_m <= high + 1e-9:
        raise InputError(f"the fulcrum at {1e3 * fulcrum_m:g} mm is out of the carriage's reach", file=file,
                         where=where, right=f"It must be between {1e3 * low:g} and {1e3 * high:g} mm")
    return fulcrum_m
