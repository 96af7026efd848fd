"""The foot as a device for `assist_sim`, which puts devices on muscle-driven legs in MuJoCo: below
the residual limb of a transtibial amputation.

The device is two files in the form that `assist_sim` reads, and it is `assist_sim` that operates:
it cuts the leg, hangs the device there and compiles. What only the compiled model can be given is
`vsf_drake.engines.assisted_model`'s.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.tree import SpatialInertia

from vsf_drake.base.errors import require
from vsf_drake.base.sentences import text_templates
from vsf_drake.engines.assisted_model import DEVICE, LONGEST_STEP, PARTS
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.plants import solids
from vsf_drake.plants.anthropometry import (
    DE_LEVA,
    LEAST_PYLON_M,
    SHANK_RADIUS_M,
    residual_volume_ratio,
)
from vsf_drake.plants.person import SOCKET_RADIUS_M
from vsf_drake.plants.rigid_foot import NAME

LIMITED = "keel_1"
"""The joint that stands for the ankle in the legs' sensors of joint limits, with a range that it
never reaches."""
SHORTEST_RESIDUUM_M = 0.1
"""From the knee's centre: below the wrapping surfaces of the calf muscles (a choice)."""
_TEMPLATES = text_templates("engines/templates")
_SHANK = DE_LEVA["male"]


@dataclass(frozen=True)
class Calf:
    """A muscle from the thigh to the heel: names with {s} for the side; where its tendon comes from
    and where it ends in the straight right leg (m, see `Leg`); its own range of lengths (m)."""

    name: str
    site: str
    above_m: tuple[float, float, float]
    end_m: tuple[float, float, float]
    lengths_m: tuple[float, float]


@dataclass(frozen=True)
class Leg:
    """A leg of `myo_sim`: names with {s} for the side. Places are in the right shank's frame, its
    origin in the knee's centre, x forward, y up the shank, z to the right, in the straight leg."""

    models: tuple[str, ...]
    ankle_x_m: float
    sole_m: float
    shank_mass_kg: float
    foot_mass_kg: float
    bones: tuple[str, ...]
    calves: tuple[Calf, ...]
    limit_sensors: bool


SHANK_M = 0.4
"""From the knee's centre down to the ankle's, of both legs."""
LEGS = {
    "myolegs26": Leg(
        models=("myolegs22", "myolegs26"),
        ankle_x_m=0.0,
        sole_m=0.454085,
        shank_mass_kg=3.7075,
        foot_mass_kg=1.5666,
        bones=("tibia_{s}_geom_1", "tibia_{s}_geom_2"),
        calves=(
            Calf(
                name="gastroc_{s}",
                site="gastroc_{s}_med_gas_{s}-P3",
                above_m=(-0.022431, -0.0039, -0.02498),
                end_m=(-0.04877, -0.41095, 0.00262),
                lengths_m=(0.362049, 0.489534),
            ),
        ),
        limit_sensors=True,
    ),
    "myolegs": Leg(
        models=("myolegs", "myofullbody"),
        ankle_x_m=-0.01,
        sole_m=0.46395,
        shank_mass_kg=3.8,
        foot_mass_kg=1.203491,
        bones=("tibia_{s}", "fibula_{s}", "tibia2_col_{s}"),
        calves=(
            Calf(
                name="gasmed_{s}",
                site="gasmed-P2_{s}",
                above_m=(-0.061989, -0.077688, -0.017966),
                end_m=(-0.05437, -0.41095, 0.00262),
                lengths_m=(0.371968, 0.472667),
            ),
            Calf(
                name="gaslat_{s}",
                site="gaslat-P2_{s}",
                above_m=(-0.054383, -0.07189, 0.031983),
                end_m=(-0.05437, -0.41095, 0.00262),
                lengths_m=(0.366291, 0.463723),
            ),
        ),
        limit_sensors=False,
    ),
}
"""By the name of the model that stands for its family. Source: read from the models that myo_sim
0.2.4 composes (Apache-2.0); `foot_mass_kg` is that of talus, heel and toes, `sole_m` the lowest
point of what collides of the foot."""


def transtibial(
    parameters: ModelParameters,
    *,
    fulcrum_m: float,
    leg: str = "myolegs26",
    side: str = "right",
    residuum_m: float = 0.66 * SHANK_M,
) -> dict[str, str]:
    """Texts of the device's `config.yaml` and `model.xml`, to be written into one folder.

    The sole is where the intact foot's is, so the pylon takes what the residual limb leaves. The
    foot's mount stands under the ankle's centre, the toe straight ahead. Socket and pylon are fixed
    to the limb, without the socket's bushing. The residual limb is the upper part of a shank whose
    shape is a frustum (de Leva 1996, male). The calf muscles that begin on the thigh end on it,
    where their tendons passed; their fibres keep their length. All others of the ankle are gone.

    Args:
        parameters: of the foot, the socket and the pylon.
        fulcrum_m: where the support stands (m from A).
        leg: one of `LEGS`.
        side: "right" or "left".
        residuum_m: m, from the knee's centre to the end of the residual limb.

    Raises:
        InputError: a fulcrum out of the carriage's reach, no such leg or side, no room for the
            pylon.
    """
    require(leg in LEGS, f"there is no {leg!r}", "leg", f"It must be one of {', '.join(LEGS)}")
    require(side in ("right", "left"), f"is {side!r}", "side", "It must be right or left")
    host = LEGS[leg]
    mount_m = host.sole_m - parameters.foot.build_height_m
    longest_m = mount_m - LEAST_PYLON_M
    require(
        SHORTEST_RESIDUUM_M <= residuum_m <= longest_m,
        f"a residual limb of {residuum_m:g} m has no place above this foot",
        "residuum_m",
        f"It must be between {SHORTEST_RESIDUUM_M:g} and {longest_m:.3f} m",
    )
    pylon_m = mount_m - residuum_m
    model, carriers = _model(parameters, fulcrum_m, residuum_m, pylon_m)
    ratio = residuum_m / SHANK_M
    mass = host.shank_mass_kg * residual_volume_ratio(_SHANK, ratio)
    taper = 1.0 + (solids.frustum_taper(_SHANK.shank_center) - 1.0) * ratio
    limb = solids.frustum(mass, SHANK_RADIUS_M, SHANK_RADIUS_M * taper, residuum_m)
    socket = parameters.socket
    config = _TEMPLATES.get_template("assist_sim.yaml.j2").render(
        device=DEVICE,
        name=NAME,
        limited=LIMITED,
        host=host,
        s=side[0],
        side=side,
        fulcrum_mm=1e3 * fulcrum_m,
        residuum_m=residuum_m,
        pylon_m=pylon_m,
        limb=_numbers(limb),
        new_mass=mass + parameters.foot.mass_kg + socket.socket_mass_kg + socket.pylon_mass_kg,
        calves=[_shortened(calf, residuum_m, mirrored=side == "left") for calf in host.calves],
        carriers=carriers,
        half=math.sqrt(0.5),
    )
    return {"config.yaml": config, "model.xml": model}


def _model(
    parameters: ModelParameters, fulcrum_m: float, residuum_m: float, pylon_m: float
) -> tuple[str, dict[str, list[str]]]:
    """Text of the device's model, and the names of the bodies with contact spheres, by part of the
    foot. What `assist_sim` does not take over is left out, and the carriage is fixed where the
    support stands."""
    exported = ET.fromstring(foot_mjcf(parameters.foot, fulcrum_m=fulcrum_m))
    socket = parameters.socket
    radius_m = socket.pylon_radius_m
    text = _TEMPLATES.get_template("assist_sim.xml.j2").render(
        name=NAME,
        longest_step=LONGEST_STEP,
        longest_step_s=2.0 * float(_one(exported, "option").get("timestep", "")),
        residuum_m=residuum_m,
        pylon_m=pylon_m,
        socket_radius_m=SOCKET_RADIUS_M,
        pylon_radius_m=radius_m,
        socket=_numbers(
            solids.frustum(
                socket.socket_mass_kg, SOCKET_RADIUS_M, 0.75 * SOCKET_RADIUS_M, residuum_m
            )
        ),
        pylon=_numbers(solids.frustum(socket.pylon_mass_kg, radius_m, radius_m, pylon_m)),
    )
    root = ET.fromstring(text)
    frame = _one(exported, f"worldbody/body[@name='{NAME}_frame']")
    _one(root, f".//frame[@name='{NAME}_foot']").append(frame)
    for section in ("default", "custom"):
        _one(root, section).extend(_one(exported, section))
    root.append(_one(exported, "tendon"))
    carriage = _one(frame, f"body[@name='{NAME}_carriage']")
    carriage.remove(_one(carriage, "joint"))
    _one(frame, f".//joint[@name='{LIMITED}']").attrib |= {"range": "-1.5 1.5", "limited": "true"}
    _one(frame, ".//joint[@name='keel_pin']").attrib.pop("damping")

    carriers: dict[str, list[str]] = {part: [] for part in PARTS}
    part = PARTS[0]
    for body in frame.iter("body"):
        if body.find(f"geom[@class='{NAME}_sphere']") is not None:
            name = body.get("name", "")
            carriers[part].append(name)
            ET.SubElement(body, "site", {"class": f"{NAME}_touch", "name": f"{name}_touch"})
        if body.find(f"site[@name='{NAME}_over_fulcrum']") is not None:
            part = PARTS[1]
    ET.indent(root)
    return f"{ET.tostring(root, encoding='unicode')}\n", carriers


def _one(element: ET.Element, path: str) -> ET.Element:
    (found,) = element.iterfind(path)
    return found


def _numbers(solid: SpatialInertia) -> dict[str, Any]:
    """Of a solid on the z axis: mass (kg), height of its centre (m), central moments (kg m^2)."""
    centre = solid.get_com()
    moments = solid.Shift(centre).CalcRotationalInertia().get_moments()
    return {
        "mass": float(solid.get_mass()),
        "z": float(centre[2]),
        "moments": [float(moment) for moment in moments],
    }


def _shortened(calf: Calf, residuum_m: float, *, mirrored: bool) -> dict[str, Any]:
    """The muscle with its tendon cut at the end of the residual limb, on the line that it had: the
    new end, and the range of lengths less what is gone of the tendon."""
    above = np.array(calf.above_m)
    end = np.array(calf.end_m)
    kept = (residuum_m + above[1]) / (above[1] - end[1])
    place = above + kept * (end - above)
    gone = float(np.linalg.norm(end - place))
    if mirrored:
        place[2] = -place[2]
    return {
        "name": calf.name,
        "site": calf.site,
        "place_m": place.tolist(),
        "lengths_m": [length - gone for length in calf.lengths_m],
    }
