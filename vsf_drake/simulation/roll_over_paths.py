"""Where the foot's mount goes when the platform under it tilts: the test's frame and the platform's.

In a roll-over test the pylon stays on a fixed line and the platform under the foot turns by the tilt gamma about an
axis T across its surface; gamma < 0 lowers its front, so that the heel is loaded, gamma > 0 lifts it. With z along the
line, x forward and T as the origin the mount's origin is at (x0, h), x0 = minus how far T lies ahead of the line, h its
height above T.

Seen from the platform, which is then level ground, everything turns by -gamma about T. So the foot's pitch (toes up)
is -gamma, the mount's origin is at

    x = x0 cos(pitch) - h sin(pitch),    z = x0 sin(pitch) + h cos(pitch),

and the test's line of force has the direction (-sin(pitch), 0, cos(pitch)). Contact knows relative motion only, so both
give the same forces, but for the inertia of the foot in a frame that turns, which is left out: at 2.5 rad/s and 1 m/s
that is a few newtons for 0.65 kg.
"""

from __future__ import annotations

import numpy as np


def mount_path(tilt_rad: np.ndarray, height_m: np.ndarray, *, axis_ahead_m: float = 0.0) -> np.ndarray:
    """(n, 3) forward (m, from T), up (m) and pitch (rad) of the mount over level ground.

    Args:
        tilt_rad, height_m: (n,) of the platform, and of the mount's origin above T along the line of force.
        axis_ahead_m: how far T lies ahead of the line of force.
    """
    pitch = -np.asarray(tilt_rad, dtype=float)
    x0, h = -axis_ahead_m, np.asarray(height_m, dtype=float)
    return np.column_stack([x0 * np.cos(pitch) - h * np.sin(pitch), x0 * np.sin(pitch) + h * np.cos(pitch), pitch])


def line_of_force(pitch_rad: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors in W of the fixed line, up; it is the pylon's axis."""
    pitch = np.asarray(pitch_rad, dtype=float)
    return np.column_stack([-np.sin(pitch), np.zeros_like(pitch), np.cos(pitch)])


def in_mount_frame(points_W: np.ndarray, mount: np.ndarray) -> np.ndarray:
    """(n, 2) forward and up in the mount's frame of points (n, 3) in W, for the mount's coordinates (n, 3)."""
    x, z = points_W[:, 0] - mount[:, 0], points_W[:, 2] - mount[:, 1]
    cosine, sine = np.cos(mount[:, 2]), np.sin(mount[:, 2])
    return np.column_stack([cosine * x + sine * z, -sine * x + cosine * z])
