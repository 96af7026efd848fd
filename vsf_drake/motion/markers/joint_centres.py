"""Hip, knee and ankle centres from surface markers. Pure functions of arrays; lengths in m, points (..., 3).

Hip regressions give (forward, up, lateral towards the limb) from the midpoint of the anterior superior iliac spines, in
the pelvis frame of Wu et al. (2002), from PW (inter-ASIS width), PD (mid-ASIS to mid-PSIS) and LL (ASIS to medial
malleolus):

    Harrington et al. 2007, doi 10.1016/j.jbiomech.2006.02.003; the forms with PW only and LL only as in
        Sangeux et al. 2015 and the public pyCGM2
    Hara et al. 2016, doi 10.1038/srep37707
    Bell et al. 1990, doi 10.1016/0021-9290(90)90054-7, with 0.30 PW for the vertical as HAS-Motion's CODA pelvis has
    Davis et al. 1991, doi 10.1016/0167-9457(91)90046-Z

Harrington's and Hara's start from the bone, the pelvis' origin here lies at the markers' centres: their forward
coordinate is reduced by the marker's radius and base plate, as pyCGM2 does. Davis' formula holds the radius itself;
Bell's is used as published.
"""

from __future__ import annotations

import math

import numpy as np

HIP_METHODS = ("harrington", "harrington_pw", "harrington_ll", "hara", "bell", "davis")
NEEDS_LEG_LENGTH = ("harrington", "harrington_ll", "hara", "davis")
_DAVIS_THETA, _DAVIS_BETA = math.radians(28.4), math.radians(18.0)


def hip_offset(
    method: str, *, pelvis_width: float, pelvis_depth: float, leg_length: float, marker_radius: float,
    base_plate: float
) -> np.ndarray:
    """(3,) m: forward, up and lateral coordinate of the hip centre from the midpoint of the ASIS markers.

    Raises:
        ValueError: another method than those of `HIP_METHODS`.
    """
    pw, pd, ll = (1e3 * length for length in (pelvis_width, pelvis_depth, leg_length))
    skin = 1e3 * (marker_radius + base_plate)
    if method == "harrington":
        mm = (-0.24 * pd - 9.9 - skin, -0.16 * pw - 0.04 * ll - 7.1, 0.28 * pd + 0.16 * pw + 7.9)
    elif method == "harrington_pw":
        mm = (-0.138 * pw - 10.4 - skin, -0.305 * pw - 10.9, 0.33 * pw + 7.3)
    elif method == "harrington_ll":
        mm = (-0.041 * ll - 6.3 - skin, -0.083 * ll - 7.9, 0.0874 * ll + 5.4)
    elif method == "hara":
        mm = (11 - 0.063 * ll - skin, -9 - 0.078 * ll, 8 + 0.086 * ll)
    elif method == "bell":
        mm = (-0.19 * pw, -0.30 * pw, 0.36 * pw)
    elif method == "davis":
        c, depth = 0.115 * ll - 15.3, 0.1288 * ll - 48.56 + 1e3 * marker_radius
        sin_b, cos_b = math.sin(_DAVIS_BETA), math.cos(_DAVIS_BETA)
        along = c * math.cos(_DAVIS_THETA)
        mm = (along * sin_b - depth * cos_b, -along * cos_b - depth * sin_b, pw / 2 - c * math.sin(_DAVIS_THETA))
    else:
        raise ValueError(f"{method!r} is none of {', '.join(HIP_METHODS)}")
    return 1e-3 * np.array(mm)


def chord(proximal: np.ndarray, lateral: np.ndarray, plane: np.ndarray, medially: np.ndarray, distance: float
          ) -> np.ndarray:
    """The joint centre C in the plane of the proximal joint centre P, the lateral marker L and a plane marker.

    |LC| is `distance` (half the joint's width and the marker's radius) and the angle PCL is a right one, so C lies on
    the circle over the diameter PL; of the two such points the one on the side of `medially`. It is the construction
    of Kadaba et al. (1990, doi 10.1002/jor.1100080310), derived here from its definition. NaN where the three points
    lie on a line or `distance` exceeds |PL|.
    """
    to_proximal = np.asarray(proximal) - lateral
    length = np.linalg.norm(to_proximal, axis=-1, keepdims=True)
    u = to_proximal / length
    w = _unit(_reject(np.asarray(plane) - lateral, u))
    w = w * np.sign(np.sum(w * medially, axis=-1, keepdims=True))
    cosine = distance / length
    with np.errstate(invalid="ignore"):
        sine = np.sqrt(1 - cosine**2)
    return lateral + distance * (cosine * u + sine * w)


def beside(proximal: np.ndarray, lateral: np.ndarray, axis_medially: np.ndarray, distance: float) -> np.ndarray:
    """The joint centre at `distance` from the lateral marker, in the direction of `axis_medially` as seen from it and
    at a right angle to the line from the centre to the `proximal` one: a chord whose plane holds the joint's axis."""
    return chord(proximal, lateral, np.asarray(lateral) + axis_medially, axis_medially, distance)


def hinge_axis(R_relative: np.ndarray) -> tuple[np.ndarray, float]:
    """The axis about which a distal segment turns in a proximal one, by least squares over all frames.

    The unit directions a (proximal) and b (distal) minimise sum |a - R b|^2: the singular vector of the stacked
    [1, -R] with the smallest singular value, the direction that Ehrig et al. (2007, doi
    10.1016/j.jbiomech.2006.10.026) find in their symmetrical axis of rotation approach.

    Args:
        R_relative: (n, 3, 3), the distal segment's orientation in the proximal one's frame; NaN frames are left out.

    Returns:
        a, (3,), of either sense, and the range (rad) of the rotation about it.
    """
    R = R_relative[np.isfinite(R_relative).all(axis=(1, 2))]
    if not len(R):
        return np.full(3, np.nan), 0.0
    total = R.sum(axis=0)
    normal = np.block([[len(R) * np.eye(3), -total], [-total.T, len(R) * np.eye(3)]])
    a = np.linalg.eigh(normal)[1][:3, 0]
    a = a / np.linalg.norm(a)
    u = np.linalg.svd(a[None])[2][1]
    turned = R @ (R[0].T @ u)
    return a, float(np.ptp(np.unwrap(np.arctan2(turned @ np.cross(a, u), turned @ u))))


def frame_from(z: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3, 3): columns x, y, z of the frame whose z is along `z` and whose y lies as near to `y` as it can."""
    e_z = _unit(np.asarray(z))
    e_y = _unit(_reject(np.asarray(y), e_z))
    return np.stack([np.cross(e_y, e_z), e_y, e_z], axis=-1)


def pelvis_frame(asis_right: np.ndarray, asis_left: np.ndarray, back: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_WP (..., 3, 3) and origin (..., 3) after Wu et al. (2002): y to the left along the ASIS line, x forward in the
    plane of both ASIS and `back` (the midpoint of the PSIS or the sacrum), origin midway between the ASIS."""
    origin = 0.5 * (np.asarray(asis_right) + asis_left)
    e_y = _unit(np.asarray(asis_left) - asis_right)
    e_x = _unit(_reject(origin - back, e_y))
    return np.stack([e_x, e_y, np.cross(e_x, e_y)], axis=-1), origin


def _reject(vector: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """The part of `vector` at a right angle to `unit`."""
    return vector - np.sum(vector * unit, axis=-1, keepdims=True) * unit


def _unit(vector: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return vector / np.linalg.norm(vector, axis=-1, keepdims=True)
