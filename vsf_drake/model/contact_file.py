"""The file that a contact fit leaves: what was fitted, to whom, on which recordings, and whether it
can be trusted.

    format: vsf_drake contact 1
    subject: {mass_kg: 78.0, stature_m: 1.81, prosthetic_side: right}
    law: kelvin_voigt
    strategy: joint
    converged: true
    verdict: [Two settings were fitted., ...]
    values: {contact.forefoot.stiffness: 7.9e+3, offset.height: 0.002, coordinate.hip_flexion_r:
        0.01}
    curves: [{coordinate: hip_flexion_r, coefficients: [0.0, 0.001, ...]}]
    trials: [{name: low 1, fingerprint: 3f..., height_m: 0.001, path: {pelvis_tx: [0.0, ...]},
              curves: {hip_flexion_r: [0.0, ...]}}]
    momentum: {vertical_bw: [-0.02, ...], fore_aft_bw: [...], trials: [3f..., ...], ...}
    person_curve: {walks: [{fingerprint: 3f..., fulcrum_m: 0.066, vertical_bw: [...], ...}], ...}
    provenance: {versions: {...}, seed: 0}

`values` are variables of a walk (`vsf_drake.simulation.variables`): those of contact, friction,
keel, fulcrum and socket replace the model's, offsets and coordinates are added to the trial's. The
keel's modulus and the support's stiffness are always among them, fitted or not: foam that was
fitted on one keel is wrong on another. `curves` are added over the gait cycle; what `trials` hold
belongs to one recording alone (`motion.fitted_trial`). SI units and radians. `momentum` and
`person_curve`, which a file need not have, are what the plates of the fitted recordings, told by
their fingerprints, teach a prediction beyond the physics (`walks.prediction`).
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml

from vsf_drake.base import errors
from vsf_drake.base.errors import InputError
from vsf_drake.base.files import write_text
from vsf_drake.base.schema import check, choice, load_yaml, quantity, to_plain
from vsf_drake.base.yaml_file import Dumper
from vsf_drake.laws.contact_laws import CONTACT_LAWS, FITTED_LAW
from vsf_drake.model.model_file import check_model, foam_under_load, in_shell
from vsf_drake.model.parameters import SIDES, ModelParameters, person_coordinates

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
FORMAT = "vsf_drake contact 1"
RETIRED = "discrepancy"  # a key of earlier files
FEWEST_COEFFICIENTS = 4  # of a cubic spline
# translations of the pelvis that a fit may correct recording by recording
PATHS = ("pelvis_tx", "pelvis_tz")
STANCE_POINTS = 101  # of a curve over stance
LARGEST_FOOT_M = 0.6  # that a centre of pressure is from its mean, beyond any foot
SAME_LENGTH_M = 1e-6  # by which feet of one length may differ, in rounding
LARGEST_FORCE_BW = 5.0  # of what the plates taught, beyond what walking takes
LARGEST_CORRECTION = 1.0  # rad, m: of a coordinate, far beyond what any recording errs by
_UNITS = {
    r"contact\..+\.stiffness": "N/m^exponent",
    r"contact\..+\.exponent": "1",
    r"contact\..+\.damping": "N s/m",
    r"contact\..+\.(full_damping_depth|rise)": "m",
    r"friction\.mu_(static|kinetic)": "1",
    r"friction\.threshold_velocity": "m/s",
    r"keel\.flexural_modulus": "Pa",
    r"fulcrum\.stiffness": "N/m",
    r"socket\.(tx|ty|tz)\.stiffness": "N/m",
    r"socket\.(flexion|adduction|rotation)\.stiffness": "N m/rad",
    r"offset\.(height|fore_aft)": "m",
    r"offset\.(alignment|inversion|toe_out)": "rad",
    r"coordinate\..+_t[xyz]": "m",
    r"coordinate\..+": "rad",
}
"""By pattern of the variable's name; the first that fits."""


@dataclass(frozen=True, kw_only=True)
class FittedSubject:
    """Who a contact was fitted to."""

    mass_kg: float = quantity(  # of the body with the prosthesis
        unit="kg", low=20.0, high=250.0, source="the trials' subject"
    )
    stature_m: float = quantity(unit="m", low=0.8, high=2.5, source="the trials' subject")
    """standing height"""
    prosthetic_side: str = choice(options=SIDES, source="the trials' subject")
    """side of the prosthesis"""


@dataclass(frozen=True, kw_only=True)
class FittedTrial:
    """What was fitted to one recording alone.

    `height_m` is added to the height offset: + moves the foot up against the limb, as
    `offset.height`. `path` has, by translation of the pelvis (OpenSim's axes), the coefficients (m)
    of `motion.trajectory.window_bsplines` over the recording's window that are added to the
    recorded coordinate; `curves` the same (rad) by joint angle.
    """

    name: str  # of the fitted trial
    fingerprint: str  # of the recording, see `motion.fitted_trial.fingerprint`
    height_m: float = quantity(  # added to the height offset, + shortens the prosthesis
        0.0, unit="m", low=-0.2, high=0.2, source="fitted"
    )
    path: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """spline coefficients by pelvis translation, OpenSim's axes"""
    curves: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """spline coefficients by joint angle"""


@dataclass(frozen=True, kw_only=True)
class JointCurve:
    """A periodic curve over the gait cycle, added to one coordinate: see
    `motion.trajectory.periodic_bsplines`."""

    coordinate: str  # to which the curve is added
    coefficients: tuple[float, ...] = quantity(  # of periodic B-splines over the gait cycle
        unit="rad (m for a translation)",
        low=-LARGEST_CORRECTION,
        high=LARGEST_CORRECTION,
        source="fitted",
    )


_force = functools.partial(
    quantity,
    unit="BW",
    low=-LARGEST_FORCE_BW,
    high=LARGEST_FORCE_BW,
    source="plates of the fitted trials",
)
_moments = functools.partial(_force, count=3)
_curve = functools.partial(_force, count=STANCE_POINTS)
_place = functools.partial(
    quantity,
    unit="m",
    low=-LARGEST_FOOT_M,
    high=LARGEST_FOOT_M,
    source="plates of the fitted trials",
    count=STANCE_POINTS,
)


@dataclass(frozen=True, kw_only=True)
class MomentumBias:
    """What the recorded motion's m (a_com - g) has over the plate in single support of the
    prosthesis: Legendre coefficients 0, 1, 2 of the fore-aft and the vertical force, their means
    over the fitted `trials` (fingerprints) and their standard deviations between these, which one
    trial does not tell."""

    fore_aft_bw: tuple[float, ...] = _moments()
    """fore-aft m (a_com - g) less plate, Legendre coefficients 0 to 2"""
    vertical_bw: tuple[float, ...] = _moments()
    """vertical m (a_com - g) less plate, Legendre coefficients 0 to 2"""
    fore_aft_sd_bw: tuple[float, ...] | None = _moments(None)
    """standard deviation of fore_aft_bw between trials"""
    vertical_sd_bw: tuple[float, ...] | None = _moments(None)
    """standard deviation of vertical_bw between trials"""
    trials: tuple[str, ...]  # fingerprints of the recordings averaged


@dataclass(frozen=True, kw_only=True)
class PersonWalk:
    """One fitted recording over stance, 0 ... 100 %, means of its whole stances, in the walk's own
    axes (fore-aft, lateral, vertical): its plate over the measured stance, the model with the
    person's momentum over the model's own.

    `*_cop_*_m` are ahead of, and to the left of, where the model's centre of pressure is on
    average; None where the plate has none. What was not seen of the intact foot is None:
    `needed_bw` and `intact_lift_off_percent`; so are the model's curves where momentum was not
    believed.
    """

    fingerprint: str  # of the recording, as under `trials`
    fulcrum_m: float = quantity(  # distance of the fulcrum from A in this recording
        unit="m", low=0.0, high=1.0, source="the trial's manifest"
    )
    fore_aft_bw: tuple[float, ...] = _curve()  # plate, fore-aft force
    lateral_bw: tuple[float, ...] = _curve()  # plate, lateral force
    vertical_bw: tuple[float, ...] = _curve()  # plate, vertical force
    fore_aft_cop_m: tuple[float, ...] | None = _place(None)  # plate, fore-aft centre of pressure
    lateral_cop_m: tuple[float, ...] | None = _place(None)  # plate, lateral centre of pressure
    model_fore_aft_bw: tuple[float, ...] | None = _curve(None)  # model, fore-aft force
    model_lateral_bw: tuple[float, ...] | None = _curve(None)  # model, lateral force
    model_vertical_bw: tuple[float, ...] | None = _curve(None)  # model, vertical force
    model_fore_aft_cop_m: tuple[float, ...] | None = _place(None)
    """model, fore-aft centre of pressure"""
    model_lateral_cop_m: tuple[float, ...] | None = _place(None)
    """model, lateral centre of pressure"""
    needed_bw: tuple[float, ...] | None = _moments(None)
    """vertical m (a_com - g) in single support, Legendre coefficients 0 to 2"""
    intact_lift_off_percent: float | None = quantity(
        None, unit="% of stance", low=0.0, high=100.0, source="the recorded motion"
    )
    """where in stance the intact foot leaves the ground, by its motion"""
    stance_s: float = quantity(  # duration of the measured stance
        unit="s", low=0.1, high=5.0, source="plates of the fitted trials"
    )
    strike_error_s: float = quantity(  # the model's strike less the measured one
        unit="s", low=-1.0, high=1.0, source="plates of the fitted trials"
    )
    lift_off_error_s: float = quantity(  # the model's lift-off less the measured one
        unit="s", low=-1.0, high=1.0, source="plates of the fitted trials"
    )


CURVES = tuple(one.name for one in fields(PersonWalk) if one.metadata.get("count") == STANCE_POINTS)


@dataclass(frozen=True, kw_only=True)
class PersonCurve:
    """The person's own curve: what the plates of the fitted recordings show, walk by walk, and how
    far walks of one setting lie apart, each left out and told by the others (standard deviation
    from their setting's mean; no `*_sd_bw` where no setting was fitted twice)."""

    walks: tuple[PersonWalk, ...]
    fore_aft_sd_bw: tuple[float, ...] | None = _curve(None)  # fore-aft force, between walks
    lateral_sd_bw: tuple[float, ...] | None = _curve(None)  # lateral force, between walks
    vertical_sd_bw: tuple[float, ...] | None = _curve(None)  # vertical force, between walks
    resultant_sd_bw: tuple[float, ...] | None = _curve(None)  # resultant, between walks


@dataclass(frozen=True, kw_only=True)
class FittedContact:
    """The content of a contact file; see the module's example."""

    format: str = choice(options=(FORMAT,), source="version of this schema")
    """name and version of the file format"""
    subject: FittedSubject
    law: str = choice(FITTED_LAW, options=tuple(CONTACT_LAWS), source="the fit")
    """contact law with which it was fitted"""
    strategy: str  # procedure of the fit, as `fit --strategy`
    converged: bool  # whether the fit converged
    foot_length_m: float | None = quantity(  # of the foot that it was fitted on
        None, unit="m", low=0.05, high=0.5, source="the trials' model"
    )
    verdict: tuple[str, ...] = ()  # of the fit, in sentences
    values: dict[str, float] = field(default_factory=dict)  # fitted variables by name
    curves: tuple[JointCurve, ...] = ()
    trials: tuple[FittedTrial, ...] = ()
    momentum: MomentumBias | None = None
    person_curve: PersonCurve | None = None
    provenance: dict[str, Any] = field(default_factory=dict)  # versions, seed and solver of the fit


def load_contact(path: str | Path, *, even_if_failed: bool = False) -> FittedContact:
    """Reads and checks a contact file; also one that a fit left that did not converge, if
    `even_if_failed`."""
    try:
        contact = check_contact(load_yaml(path, FittedContact), file=path)
    except InputError as error:
        if not (error.where or "").endswith(RETIRED):
            raise
        raise InputError(
            "is the third layer of earlier versions: the person's own curve has taken its place",
            file=path,
            where=RETIRED,
            right="Fit again, or delete this key: physics and momentum stay as they are",
        ) from None
    errors.require(
        contact.converged or even_if_failed,
        "this fit did not converge",
        "converged",
        "Its numbers are where the search gave up: fit again",
        file=path,
    )
    return contact


def save_contact(contact: FittedContact, path: str | Path) -> None:
    """Checks `contact` and writes it so that `load_contact` reads an equal one: every digit, units
    as comments."""
    check_contact(contact, file=path)
    title = (
        "Contact fitted"
        if contact.converged
        else "NOT TO BE USED: the search ended before its end. Contact fitted"
    )
    lines = [
        (
            f"# {title} by vsf_drake; see vsf_drake.model.contact_file for what the keys "
            "mean. SI units, radians.\n"
        )
    ]
    for key, value in to_plain(contact).items():
        text = yaml.dump(
            {key: value}, Dumper=_ContactDumper, sort_keys=False, allow_unicode=True, width=math.inf
        )
        lines += [_commented(key, line) for line in text.splitlines(keepends=True)]
    write_text(path, "".join(lines))


def check_contact(contact: FittedContact, *, file: str | Path | None = None) -> FittedContact:
    """Returns `contact` after checking what it names, once each, and every number in it; none may
    be missing."""
    require = functools.partial(errors.require, file=file)
    check(contact, file=file)
    if any(name.startswith("contact.") for name in contact.values):
        for name in DEVICE:
            require(
                name in contact.values,
                "is missing: the foam in this file was fitted on a keel and a support that "
                "it does not tell",
                f"values.{name}",
                "Fit again, or add the value of the model that was fitted",
            )
    require(
        contact.provenance,
        "is missing",
        "provenance",
        "It stands last: without it the file may have been cut short, with values missing too",
    )
    values = {f"values.{name}": value for name, value in contact.values.items()}
    for where in values:
        variable_unit(where.removeprefix("values."), file=file, where=where)
    known = person_coordinates(contact.subject.prosthetic_side)
    prefix = "values.coordinate."
    named = [
        (where, where.removeprefix(prefix), known) for where in values if where.startswith(prefix)
    ]
    splines = {}
    for i, curve in enumerate(contact.curves):
        named.append((f"curves[{i}].coordinate", curve.coordinate, known))
        splines[f"curves[{i}].coefficients"] = curve.coefficients
    for i, trial in enumerate(contact.trials):
        for kind, own, those in (("path", trial.path, PATHS), ("curves", trial.curves, known)):
            for name, spline in own.items():
                named.append((f"trials[{i}].{kind}", name, those))
                splines[f"trials[{i}].{kind}.{name}"] = spline
    for where, name, those in named:
        require(
            name in those,
            f"{name!r} is no coordinate that can be corrected",
            where,
            f"There are: {', '.join(those)}",
        )
    for where, spline in splines.items():
        require(
            len(spline) >= FEWEST_COEFFICIENTS,
            f"{len(spline)} coefficients make no cubic spline",
            where,
            f"At least {FEWEST_COEFFICIENTS} are needed",
        )
        values |= {f"{where}[{i}]": value for i, value in enumerate(spline)}
    for where, value in values.items():
        require(
            isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value),
            f"{value!r} is not a finite number",
            where,
        )
        correction = where.startswith(prefix) or not where.startswith("values.")
        require(
            not correction or abs(value) <= LARGEST_CORRECTION,
            f"{value:g} corrects no recording",
            where,
            f"It must be between {-LARGEST_CORRECTION:g} and {LARGEST_CORRECTION:g} (rad, m)",
        )
    prints = [trial.fingerprint for trial in contact.trials]
    for i, text in enumerate(prints):
        require(
            re.fullmatch(r"[0-9a-f]{64}", text),
            "is no fingerprint of a recording: 64 hexadecimal digits",
            f"trials[{i}].fingerprint",
        )
        require(
            text not in prints[:i], "the same recording stands twice", f"trials[{i}].fingerprint"
        )
    curved = [curve.coordinate for curve in contact.curves]
    for i, name in enumerate(curved):
        require(name not in curved[:i], f"{name} has two curves", f"curves[{i}].coordinate")
    _check_learned(contact, file)
    return contact


def _check_learned(contact: FittedContact, file: str | Path | None) -> None:
    """What the plates taught: of the file's own recordings."""
    named: dict[str, str] = {}
    if contact.momentum is not None:
        named |= {f"momentum.trials[{i}]": text for i, text in enumerate(contact.momentum.trials)}
    if contact.person_curve is not None:
        named |= {
            f"person_curve.walks[{i}].fingerprint": walk.fingerprint
            for i, walk in enumerate(contact.person_curve.walks)
        }
    prints = [trial.fingerprint for trial in contact.trials]
    for where, text in named.items():
        errors.require(text in prints, "is none of the recordings under trials", where, file=file)


def variable_unit(name: str, *, file: str | Path | None = None, where: str | None = None) -> str:
    """The unit of a walk's variable; InputError for one that a contact may not hold."""
    for pattern, unit in _UNITS.items():
        if re.fullmatch(pattern, name):
            return unit
    raise InputError(
        f"there is no {name!r} in a fitted contact",
        file=file,
        where=where,
        right=(
            "There are contact.ZONE.stiffness | exponent | damping | full_damping_depth | rise, "
            "friction.mu_static | mu_kinetic | threshold_velocity, keel.flexural_modulus, "
            "fulcrum.stiffness, socket.AXIS.stiffness, offset.height | fore_aft | alignment | "
            "inversion | toe_out, coordinate.NAME"
        ),
    )


class _ContactDumper(Dumper):
    """Lists of numbers on one line, and texts with line breaks too, so that every line is one
    key."""


def _list(dumper: _ContactDumper, values: list[Any]) -> yaml.Node:
    flow = bool(values) and all(isinstance(value, float) for value in values)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=flow)


def _text(dumper: _ContactDumper, value: str) -> yaml.Node:
    return dumper.represent_scalar(
        "tag:yaml.org,2002:str", value, style=None if value.splitlines() == [value] else '"'
    )


_ContactDumper.add_representer(list, _list)
_ContactDumper.add_representer(str, _text)


_UNITS_OF = {
    section: {one.name: one.metadata["unit"] for one in fields(kind) if "unit" in one.metadata}
    for section, kind in {
        "subject": FittedSubject,
        "trials": FittedTrial,
        "curves": JointCurve,
        "momentum": MomentumBias,
        "person_curve": PersonWalk,
    }.items()
}
"""Of the keys of each section."""


def _commented(section: str, line: str) -> str:
    """The line of YAML with its unit behind it, where it has one."""
    key, colon, number = line.strip().removeprefix("- ").partition(": ")
    key = key.strip("'\"")
    unit = _UNITS_OF.get(section, {}).get(key)
    if section == "values" and colon:
        unit = variable_unit(key)
    elif section == "trials" and number.startswith("["):
        unit = "m" if key in PATHS else "rad"
    return f"{line.rstrip()}  # {unit}\n" if unit and number else line


# Fitted values written into a model: the same walk as with these values given to `Walker.walk`. A
# zone's `rise` is added to each of its rises; damping times of keel and fulcrum stay, so their
# damping goes along; a socket axis keeps the ratio of its two stiffnesses, and its damping. What a
# walk adds to the trial (offsets, coordinates) is no part of a model (`motion.fitted_trial`). Where
# the spheres under the bench's load change, the foam that the bench finds there becomes theirs
# (`model_file.foam_under_load`), so that the bench presses the foot that walks.


_FIELDS = {
    "stiffness": "stiffness",
    "exponent": "exponent",
    "damping": "damping_n_s_per_m",
    "full_damping_depth": "full_damping_depth_m",
    "mu_static": "mu_static",
    "mu_kinetic": "mu_kinetic",
    "threshold_velocity": "threshold_velocity_m_per_s",
}
DEVICE = {
    "keel.flexural_modulus": ("keel", "flexural_modulus_pa"),
    "fulcrum.stiffness": ("fulcrum", "stiffness_n_per_m"),
}


def model_with(
    model: ModelParameters, values: Mapping[str, float], *, file: str | Path | None = None
) -> ModelParameters:
    """`model` with those of `values` (SI, by name) that are its own; `file` is where they come
    from.

    InputError for a zone that the model lacks, a number out of its range, and parts that no longer
    make a foot.
    """
    foot = model.foot
    socket = model.socket
    for name, value in values.items():
        where = f"values.{name}"
        variable_unit(name, file=file, where=where)
        group, rest = name.split(".", 1)
        if group == "contact":
            zone_name, law = rest.rsplit(".", 1)
            names = [zone.name for zone in foot.zones]
            errors.require(
                names.count(zone_name) == 1,
                f"the model has {names.count(zone_name) or 'no'} contact zones {zone_name!r}",
                where,
                f"It has: {', '.join(names)}",
                file=file,
            )
            i = names.index(zone_name)
            if law == "rise":
                zone = replace(
                    foot.zones[i],
                    rise_mm=tuple(r + 1e3 * float(value) for r in foot.zones[i].rise_mm),
                )
            else:
                zone = _with(foot.zones[i], _FIELDS[law], float(value))
            foot = replace(foot, zones=(*foot.zones[:i], zone, *foot.zones[i + 1 :]))
        elif group == "socket":
            axis_name = rest.split(".")[0]
            axis = getattr(socket, axis_name)
            errors.require(
                axis.stiffness > 0.0,
                f"the model's {axis_name} axis has no stiffness to go with",
                where,
                file=file,
            )
            socket = _with(
                socket,
                axis_name,
                replace(
                    axis,
                    stiffness=float(value),
                    stiffness_negative=float(value) * (axis.stiffness_negative / axis.stiffness),
                ),
            )
        elif group not in ("offset", "coordinate"):  # those are no part of a model
            part, field = DEVICE.get(name) or ("friction", _FIELDS[rest])
            foot = _with(foot, part, _with(getattr(foot, part), field, float(value)))
    foam = foam_under_load(foot)
    if foam is not None and foam != foam_under_load(model.foot):
        foot = replace(foot, series_stiffness_n_per_m=foam[0], series_exponent=foam[1])
    return check_model(replace(model, foot=foot, socket=socket), file=file)


def fitted_model(
    model: ModelParameters,
    contact: FittedContact,
    *,
    file: str | Path | None = None,
    in_its_shell: bool = False,
) -> ModelParameters:
    """`model` with the fitted values that are its own, and the law that they were fitted with; its
    foot in the shell of the contact first, if `in_its_shell` and that is known.

    InputError for a foot of another length than that of the fit, and as of `model_with`."""
    theirs_m = contact.foot_length_m
    if in_its_shell and theirs_m is not None:
        model = replace(model, foot=in_shell(model.foot, theirs_m))
    own_m = model.foot.length_m
    errors.require(
        theirs_m is None or abs(own_m - theirs_m) < SAME_LENGTH_M,
        f"it was fitted to a foot of {1e3 * (theirs_m or 0.0):g} mm, this one has {1e3 * own_m:g} "
        "mm",
        "foot_length_m",
        "State the same prosthesis.foot_length_mm in the manifest, name a model of that length "
        "or, where there is no manifest, none; or fit this foot",
        file=file,
    )
    return replace(model_with(model, contact.values, file=file), contact_law=contact.law)


def _with(part: T, field: str, value: Any) -> T:
    return replace(part, **{field: value})
