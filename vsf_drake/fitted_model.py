"""Fitted values written into a model: the same walk as with these values given to `Walker.walk`.

    contact.ZONE.stiffness | exponent | damping | full_damping_depth    the zone's own, prosthetic foot
    contact.ZONE.rise           added to each of the zone's rises
    friction.*                  of the prosthetic foot
    keel.flexural_modulus       its damping time stays, so the joints' damping goes along
    fulcrum.stiffness           its damping time stays, so its damping goes along
    socket.AXIS.stiffness       with stiffness_negative in its ratio; damping stays

What a walk adds to the trial (offsets, coordinates) is no part of a model and stays out (`motion.fitted_trial`).
Where the spheres under the bench's load change, the foam that the bench finds there becomes theirs
(`model_file.foam_under_load`), so that the bench presses the foot that walks.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.contact_file import variable_unit
from vsf_drake.errors import InputError
from vsf_drake.model_file import check_model, foam_under_load
from vsf_drake.parameters import ContactZone, FootParameters, ModelParameters, SocketParameters

_ZONE_FIELDS = {"stiffness": "stiffness", "exponent": "exponent", "damping": "damping_n_s_per_m",
                "full_damping_depth": "full_damping_depth_m"}
_FRICTION_FIELDS = {"mu_static": "mu_static", "mu_kinetic": "mu_kinetic",
                    "threshold_velocity": "threshold_velocity_m_per_s"}
_NOT_THE_MODELS = ("offset", "coordinate")


def model_with(
    model: ModelParameters, values: Mapping[str, float], *, file: str | Path | None = None
) -> ModelParameters:
    """`model` with those of `values` (SI, by name) that are its own.

    Args:
        file: where the values come from, for messages.

    Raises:
        InputError: a name is unknown, or is of a zone that the model lacks; a number is out of the model's range, or
            the parts no longer make a foot.
    """
    foot, socket = model.foot, model.socket
    for name, value in values.items():
        where = f"values.{name}"
        variable_unit(name, file=file, where=where)
        group, rest = name.split(".", 1)
        if group == "contact":
            zone, law = rest.rsplit(".", 1)
            names = [other.name for other in foot.zones]
            if names.count(zone) != 1:
                raise InputError(f"the model has {names.count(zone) or 'no'} contact zones {zone!r}", file=file,
                                 where=where, right=f"It has: {', '.join(names)}")
            foot = _with_zone(foot, zone, law, float(value))
        elif group == "socket":
            axis = rest.split(".")[0]
            if not getattr(socket, axis).stiffness > 0.0:
                raise InputError(f"the model's {axis} axis has no stiffness to go with", file=file, where=where)
            socket = _with_axis(socket, axis, float(value))
        elif group not in _NOT_THE_MODELS:
            foot = _with_device(foot, name, float(value))
    foam = foam_under_load(foot)
    if foam is not None and foam != foam_under_load(model.foot):
        foot = dataclasses.replace(foot, series_stiffness_n_per_m=foam[0], series_exponent=foam[1])
    return check_model(dataclasses.replace(model, foot=foot, socket=socket), file=file)


def _with_zone(foot: FootParameters, name: str, law: str, value: float) -> FootParameters:
    def changed(zone: ContactZone) -> ContactZone:
        if law == "rise":
            return dataclasses.replace(zone, rise_mm=tuple(rise + 1e3 * value for rise in zone.rise_mm))
        field: dict[str, Any] = {_ZONE_FIELDS[law]: value}
        return dataclasses.replace(zone, **field)

    return dataclasses.replace(
        foot, zones=tuple(changed(zone) if zone.name == name else zone for zone in foot.zones))


def _with_axis(socket: SocketParameters, name: str, stiffness: float) -> SocketParameters:
    axis = getattr(socket, name)
    negative = stiffness * (axis.stiffness_negative / axis.stiffness)
    return dataclasses.replace(
        socket, **{name: dataclasses.replace(axis, stiffness=stiffness, stiffness_negative=negative)})


def _with_device(foot: FootParameters, name: str, value: float) -> FootParameters:
    if name == "keel.flexural_modulus":
        return dataclasses.replace(foot, keel=dataclasses.replace(foot.keel, flexural_modulus_pa=value))
    if name == "fulcrum.stiffness":
        return dataclasses.replace(foot, fulcrum=dataclasses.replace(foot.fulcrum, stiffness_n_per_m=value))
    field = _FRICTION_FIELDS[name.removeprefix("friction.")]
    return dataclasses.replace(foot, friction=dataclasses.replace(foot.friction, **{field: value}))
