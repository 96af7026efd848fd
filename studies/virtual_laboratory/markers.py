"""Ideal markers on the synthetic person, by the names of the OpenSim gait models (Rajagopal 2016).

They sit on the segments as the written coordinates move them, so on the prosthetic side too they
tell the coordinates: shank markers follow the residual limb (no socket moves under them) and foot
markers the undeformed prosthesis, on a shell as long as the intact foot. Pelvis dimensions are
chosen such that Harrington's regression (2007) finds the model's hip centres within 4 mm. Standing,
half of the weight shortens the virtual prosthesis; that hip is lower by it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from virtual_laboratory.body import SEGMENTS
from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.placing import RATE_HZ
from virtual_laboratory.prosthesis import Prosthesis, prosthesis_of
from virtual_laboratory.trc import write_trc
from vsf_drake.base.files import replaced
from vsf_drake.model.parameters import GRAVITY

MARKER_HZ, STANDING_S = 100, 1.0
ASIS_WIDTH_M, PELVIS_DEPTH_M, PSIS_WIDTH_M = 0.260, 0.150, 0.100
KNEE_HALF_WIDTH_M, ANKLE_HALF_WIDTH_M = 0.055, 0.037
"""Of the markers' centres."""
DECIMALS = 5
"""Of metres: hundredths of a millimetre."""
Places = dict[str, tuple[str, tuple[float, float, float]]]
"""Segment and place (m) in it by label."""


def marker_places(person: Person) -> Places:
    """All markers, right and left; x forward, y left, z up in the segment's frame."""
    body = person.handles.body
    places: Places = {
        "RASI": ("pelvis", (0.0, -0.5 * ASIS_WIDTH_M, 0.0)),
        "LASI": ("pelvis", (0.0, 0.5 * ASIS_WIDTH_M, 0.0)),
        "RPSI": ("pelvis", (-PELVIS_DEPTH_M, -0.5 * PSIS_WIDTH_M, 0.0)),
        "LPSI": ("pelvis", (-PELVIS_DEPTH_M, 0.5 * PSIS_WIDTH_M, 0.0)),
    }
    for s, side, out in (("R", "right", -1.0), ("L", "left", 1.0)):
        thigh, shank, knee, ankle = (
            f"thigh_{side}",
            f"shank_{side}",
            body.thigh_length,
            body.shank_length,
        )
        places |= {
            f"{s}TH1": (thigh, (0.03, out * 0.08, -0.40 * knee)),
            f"{s}TH2": (thigh, (-0.03, out * 0.075, -0.55 * knee)),
            f"{s}TH3": (thigh, (0.06, out * 0.05, -0.65 * knee)),
            f"{s}LFC": (thigh, (0.0, out * KNEE_HALF_WIDTH_M, -knee)),
            f"{s}MFC": (thigh, (0.0, -out * KNEE_HALF_WIDTH_M, -knee)),
            f"{s}TB1": (shank, (0.04, out * 0.04, -0.25 * ankle)),
            f"{s}TB2": (shank, (-0.02, out * 0.06, -0.4 * ankle)),
            f"{s}TB3": (shank, (0.03, out * 0.045, -0.55 * ankle)),
            f"{s}LMAL": (shank, (0.0, out * ANKLE_HALF_WIDTH_M, -ankle)),
            f"{s}MMAL": (shank, (0.0, -out * ANKLE_HALF_WIDTH_M, -ankle)),
        }
    length, heel = body.foot_length, -person.model.intact_foot.ankle_x_ratio * body.foot_length
    for s, segment, rear, floor, size, out in (
        ("R", "vsf_frame", 0.0, person.sole_height, length, -1.0),
        ("L", "foot_left", heel, -body.ankle_height, length, 1.0),
    ):
        places |= {
            f"{s}CAL": (segment, (rear - 0.009, 0.0, floor + 0.03)),
            f"{s}TOE": (segment, (rear + 0.72 * size, 0.0, floor + 0.05)),
            f"{s}MT5": (segment, (rear + 0.65 * size, out * 0.04, floor + 0.03)),
        }
    return places


def follow(person: Person, q: np.ndarray) -> dict[str, np.ndarray]:
    """(N, 3) m in W by label for coordinates q (N, 21) in m and rad."""
    R_WB, p_WB = person.leg_poses(q)
    found = {}
    for label, (segment, place) in marker_places(person).items():
        i = SEGMENTS.index(segment)
        found[label] = (p_WB[:, i] + R_WB[:, i] @ np.array(place)).round(DECIMALS)
    return found


def shortening(prosthesis: Prosthesis, load_n: float) -> float:
    """How much (m) the upright prosthesis gives under a vertical load."""

    def beyond(depth: float) -> float:
        prosthesis.reset(np.eye(3), np.array([0.0, 0.0, prosthesis.sole_below_knee - depth]))
        return float(prosthesis.force[2]) - load_n

    return float(brentq(beyond, 0.0, 0.05, xtol=1e-5))


def standing(person: Person, shorter_m: float) -> np.ndarray:
    """(N, 21) upright on both feet for STANDING_S, knees straight, the right leg `shorter_m` under
    load."""
    body = person.handles.body
    slope = float(np.arcsin(0.5 * shorter_m / body.hip_lateral))
    place = {
        "pelvis_list": slope,
        "hip_adduction_r": -slope,
        "hip_adduction_l": slope,
        "pelvis_ty": body.thigh_length
        + body.shank_length
        + body.ankle_height
        - body.hip_up * np.cos(slope)
        - body.hip_lateral * np.sin(slope),
    }
    upright = np.array([place.get(name, 0.0) for name in COORDINATES])
    return np.tile(upright, (round(STANDING_S * MARKER_HZ) + 1, 1))


def write_standing(folder: Path, person: Person) -> None:
    """`static.trc` in `folder`: half of the weight on the prosthesis, its fulcrum in mid-range."""
    folder.mkdir(parents=True, exist_ok=True)
    shorter_m = shortening(
        prosthesis_of(person.subject, 0.108), 0.5 * GRAVITY * person.subject.mass_kg
    )
    _write(folder / "static.trc", follow(person, standing(person, shorter_m)))


def write_walk(folder: Path, person: Person, name: str, q: np.ndarray) -> None:
    """`<name>.trc` in `folder` of coordinates q (N, 21) in m and rad at RATE_HZ."""
    _write(folder / f"{name}.trc", follow(person, q[:: RATE_HZ // MARKER_HZ]))


def _write(path: Path, places: dict[str, np.ndarray]) -> None:
    """In mm; the header's place for a file name says that it is synthetic."""
    write_trc(path, places, rate_hz=MARKER_HZ, unit="mm")
    text = path.read_text(encoding="utf-8").replace(path.name, f"SYNTHETIC {path.name}", 1)
    with replaced(path) as stream:
        stream.write(text)
