"""How the prosthetic foot sits under the pylon, as measured on the person.

    D    the pylon's lower end: origin on the pylon's axis, x forward, y left, z up along the pylon
    P    the foot's place: where the foot's mount M goes (`foot.add_foot`)

P is D moved forward and away from the midline (in D's axes), then turned about its own origin, which is the
pylon's end, `build_height_m` above the sole: first toe up about the axis to the right, then into inversion
about the forward axis that this has turned, then outward about the upright axis that both have turned. That is
the order of the ankle's coordinates (flexion, adduction, rotation; Wu et al. 2002, doi
10.1016/S0021-9290(01)00222-6), so that alignment, inversion and minus toe-out are the ankle angles of the
prosthesis. What a trial's manifest adds (`foot.set_mount`) acts between P and the foot, in the foot's own
axes: its meaning does not depend on the placement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from vsf_drake.parameters import Subject


@dataclass(frozen=True, kw_only=True)
class FootPlacement:
    """Metres and radians, signed by anatomy: forward, away from the midline, toe up, inverted, toe out."""

    fore_aft: float = 0.0
    lateral: float = 0.0
    alignment: float = 0.0
    inversion: float = 0.0
    toe_out: float = 0.0

    def pose(self, *, mirrored: bool) -> RigidTransform:
        """X_DP; `mirrored` on the left side."""
        right = -1.0 if mirrored else 1.0
        # Toe up is a turn about -y; inversion about +x and toe-out about -z on the right, opposite on the left.
        R_DP = (RotationMatrix.MakeYRotation(-self.alignment) @ RotationMatrix.MakeXRotation(right * self.inversion)
                @ RotationMatrix.MakeZRotation(-right * self.toe_out))
        return RigidTransform(R_DP, np.array([self.fore_aft, -right * self.lateral, 0.0]))

    def sole_below(self, build_height: float) -> float:
        """Distance (m) from the pylon's end down the pylon's axis to the plane of the unloaded sole.

        The sole's plane lies `build_height` under P's origin, normal to P's z. Without turns that is
        the build height itself.
        """
        X_DP = self.pose(mirrored=False)
        normal = X_DP.rotation().matrix()[:, 2]
        return float((build_height - normal @ X_DP.translation()) / normal[2])


def foot_placement(subject: Subject) -> FootPlacement:
    """What is known of it; standard where nothing is."""
    return FootPlacement(
        fore_aft=subject.prosthesis_fore_aft_m or 0.0, lateral=subject.prosthesis_lateral_m or 0.0,
        alignment=subject.prosthesis_alignment_rad or 0.0, inversion=subject.prosthesis_inversion_rad or 0.0,
        toe_out=subject.prosthesis_toe_out_rad or 0.0)
