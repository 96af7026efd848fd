"""What every engine of the certificate is asked, as a file in a folder; numpy alone, so that any
interpreter that has an engine can read it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FILE = "asked.npz"
NOMINAL = "nominal"
"""Folder of the files with the foot's own contact law."""
ELASTIC = "elastic"
"""Folder of the files whose spheres have no damping."""
CONTINUOUS = "continuous"
"""Folder of the SDF for a plant without a time step."""
CONDENSED = "condensed"
"""Folder of the condensed foot's OpenSim model."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Asked:
    """The questions, in SI units; B is the number of the keel's bodies, which is that of its
    hinges.

    The mount M is where the pylon attaches, the load point C lies on the keel, its posterior end is
    A, and K is the keel's frame: origin A, x to the toe, z up.
    """

    fulcrum_mm: np.ndarray  # (F,) positions of the fulcrum, from A
    load_n: np.ndarray  # (L,) N vertical, on C, of the static rows
    load_point_m: float  # from A to C
    hinges: np.ndarray  # (B,) names, from the pin at A to the toe
    bodies: np.ndarray  # (B,) names of the keel's bodies
    starts_m: np.ndarray  # (B,) from A to their frames
    poses_rad: np.ndarray  # (P, B) angles of the hinges, positive lifts the toe
    gravity: float  # m/s^2
    roll_fulcrum_mm: float  # fulcrum of poses and roll-over
    time_s: np.ndarray  # (T,)
    mount: np.ndarray
    """(T, 3) path of M over level ground at z = 0: forward (m), up (m), pitch (rad, lifts the toe);
    between these instants a natural cubic spline"""
    beam_ei_nm2: float  # N m^2, bending stiffness of the keel
    keel_length_m: float
    support_n_per_m: float  # of the fulcrum's support, along z of K
    sphere_bodies: np.ndarray  # (N,) names of the bodies that the contact spheres are on
    sphere_p_BS: np.ndarray  # (N, 3) m, their centres in those bodies' frames, at rest along K's
    sphere_radius: np.ndarray  # (N,) m, and below the constants of `laws.kelvin_voigt`
    sphere_stiffness: np.ndarray
    sphere_exponent: np.ndarray
    sphere_damping: np.ndarray
    sphere_full_damping_depth: np.ndarray

    @classmethod
    def read(cls, folder: Path) -> Asked:
        """From `FILE` in `folder`."""
        with np.load(folder / FILE, allow_pickle=False) as stored:
            return cls(
                **{name: value if value.ndim else value.item() for name, value in stored.items()}
            )

    @property
    def carrier(self) -> int:
        """Index of the keel's body that C lies on."""
        return int(np.searchsorted(self.starts_m, self.load_point_m, side="right")) - 1

    @property
    def p_BC(self) -> np.ndarray:
        """(3,) m, C in the frame of that body."""
        return np.array([self.load_point_m - self.starts_m[self.carrier], 0.0, 0.0])

    def write(self, folder: Path) -> None:
        """As `FILE` into `folder`."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        np.savez(folder / FILE, allow_pickle=False, **fields)


def foot_file(folder: Path, law: str, fulcrum_mm: float, ending: str) -> Path:
    """The foot's file in the certificate's `folder`: with the law `NOMINAL` or `ELASTIC`, or
    `CONTINUOUS` or `CONDENSED`; `ending` osim, xml or sdf."""
    return folder / law / f"vsf_foot_at_{fulcrum_mm:g}mm.{ending}"
