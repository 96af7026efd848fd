"""How strong hips, knees and ankles are, what of that a torque takes (activation), and what energy
this needs.

    strength    c1 m g h  cos(c2 (q - c3))  (2 c4 c5 + s (c5 - 3 c4)) / (2 c4 c5 + s (2 c5 - 4 c4))
                (1 - c6 min(v, 0))
    passive     b1 exp(k1 q) + b2 exp(k2 q), N m against flexion
    activation  (torque - passive) / strength of its direction
    power       |activation| c1 m g h cos(c2 (q - c3)) w phi(v / w),  w = c5 (1 + 2 k) / k
                phi(x) = (0.054 + 0.506 x + 2.46 x^2) / (1 - 1.13 x + 12.8 x^2 - 1.64 x^3)

q is the joint's flexion (rad), of the ankle dorsiflexion; v its rate in the direction of the torque
(rad/s), positive where muscles shorten; s = |v|; w the largest rate of phi's muscle (rad/s); m, h
mass (kg) and stature (m), g 9.81 m/s^2. Anderson, Madigan & Nussbaum 2007, Journal of Biomechanics
40:3105-3113, doi 10.1016/j.jbiomech.2007.03.022: dynamometer, healthy adults; here the means of
those from 18 to 25 years. The paper was out of reach: Table 3 and equation 1 were read in RBDL's
muscle add-on (Millard2016TorqueMuscle), equation 9 in ProtoMotions' human model. At c4 and c5
(rad/s) three quarters and half of the strength at rest are left.

power is metabolic, heat and work: Minetti & Alexander 1997, Journal of Theoretical Biology
186:467-476, doi 10.1006/jtbi.1997.0407. The paper was out of reach: phi was read in GaitSym
(MAMuscleComplete) and BioMAC-Sim-Toolbox (getErate_Minetti), which agree; Moco's of 2019
(MinettiAlexander1997Metabolics) multiplies by 0.054 where they add it. phi belongs to a muscle
whose force by rate is Hill's (1 - x) / (1 + x / k) of that at rest, with k = 0.17 (GaitSym's human
model); at most 0.45 of its power is then work. Half of its force is left at x = k / (1 + 2 k) =
0.127, half of a joint's strength at c5, which dynamometers reach: w makes these one rate (a
choice), 15 to 41 rad/s. So at most half of the power is work at any rate up to 10 rad/s, faster
than joints move in walking. Far beyond more of it would be: of the ankle, whose extension's
strength by the equation never falls below 0.19 of that at rest, from 10 rad/s in extension and 21
in flexion (the male one's 0.67 at 30); of hip and knee, since strength is kept above zero, from 35.
The rate at which Anderson's strength would be zero, |2 c4 c5 / (c5 - 3 c4)|, which RBDL takes, is
extrapolated and cannot be w: of a hip's extension it is 6.5 rad/s, where at half of it 0.9 of the
power would be work. In walking, holding alone (phi = 0.054) takes most of the energy, and w is
large: what comes out compares, it does not measure.

The knee's flexion, as measured, is of hamstrings and gastrocnemius together: of a leg that ends
below the knee it is too strong, by what was not found.

What is not the sources' (choices): each direction of a joint is one muscle, and of two only one
works; within LITTLE of m g h one direction's strength goes smoothly over to the other's; the
corners of s and min(v, 0) are rounded over SLOW, so that strength at rest is up to 6 % less;
neither factor falls below LEAST_BY_ANGLE and LEAST_BY_RATE, rounded over LEAST_WIDTH, since outside
of the angles that were measured the cosine goes to zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsf_drake.laws._elementwise import rounded_positive_part, smooth_step

GRAVITY_OF_SOURCE = 9.81  # m/s^2, by which the source divides
SLOW = 0.5  # rad/s
LITTLE = 0.005
SHAPE = 0.17  # k of the muscle that phi is of
# the share of its largest rate at which half of its force is left
HALF = SHAPE / (1.0 + 2.0 * SHAPE)
# shares of the strongest, isometric torque
LEAST_BY_ANGLE = 0.25
LEAST_BY_RATE = 0.1
LEAST_WIDTH = 0.05
# c1 (1), c2 (1/rad), c3 (rad), c4, c5 (rad/s), c6 (s/rad), of extension (plantarflexion) and
# flexion
ACTIVE = {
    "male": {
        "hip": (
            (0.161, 0.958, 0.932, 1.578, 3.190, 0.242),
            (0.113, 0.738, -0.214, 2.095, 4.267, 0.218),
        ),
        "knee": (
            (0.163, 1.258, 1.133, 1.517, 3.952, 0.095),
            (0.087, 0.869, 0.522, 2.008, 5.233, 0.304),
        ),
        "ankle": (
            (0.095, 1.391, 0.408, 0.987, 3.558, 0.295),
            (0.033, 1.510, -0.187, 0.699, 1.940, 0.828),
        ),
    },
    "female": {
        "hip": (
            (0.181, 0.697, 1.242, 1.567, 3.164, 0.164),
            (0.127, 0.650, -0.350, 2.136, 4.349, 0.156),
        ),
        "knee": (
            (0.159, 1.187, 1.274, 1.393, 3.623, 0.173),
            (0.080, 0.873, 0.635, 1.698, 4.412, 0.175),
        ),
        "ankle": (
            (0.104, 1.399, 0.424, 0.862, 3.109, 0.189),
            (0.027, 1.079, -0.302, 0.864, 2.399, 0.771),
        ),
    },
}
PASSIVE = {  # b1 (N m), k1 (1/rad), b2 (N m), k2 (1/rad)
    "male": {
        "hip": (-1.210, -6.351, 0.476, 5.910),
        "knee": (0.0, 0.0, -6.250, -4.521),
        "ankle": (-0.0005781, -5.819, 0.967, 6.090),
    },
    "female": {
        "hip": (-1.753, -6.358, 0.239, 3.872),
        "knee": (0.0, 0.0, -8.033, -5.250),
        "ankle": (-0.005218, -4.875, 0.470, 6.425),
    },
}


class Muscles:
    """What moves some joints of one person, vectorised over them.

    joints: "hip", "knee" or "ankle", J of them; sex: "male" or "female"; scale: m g h (N m).
    """

    def __init__(self, joints: Sequence[str], sex: str, scale: float) -> None:
        self.scale = scale
        self._extension, self._flexion = (
            np.array([ACTIVE[sex][joint][way] for joint in joints]).T[:, :, None] for way in (0, 1)
        )
        self._passive = np.array([PASSIVE[sex][joint] for joint in joints]).T[:, :, None]

    def passive_torque(self, angle: np.ndarray) -> np.ndarray:
        """(..., J, N) N m toward flexion, of the joints' flexion (rad)."""
        b1, k1, b2, k2 = self._passive
        return np.asarray(-b1 * np.exp(k1 * angle) - b2 * np.exp(k2 * angle))

    def activation(self, torque: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """(..., J, N) shares of the strength, positive toward flexion; above 1 where torque exceeds
        what was measured.

        torque: N m toward flexion; angle, rate: the flexion, rad, rad/s. Real or complex arrays;
        only real parts are compared, so that a complex step differentiates it.
        """
        active = (torque - self.passive_torque(angle)) / self.scale
        extension = 1.0 / strength(self._extension, angle, -rate)
        flexion = 1.0 / strength(self._flexion, angle, rate)
        return np.asarray(
            active
            * (extension + (flexion - extension) * smooth_step(0.5 * (active / LITTLE + 1.0)))
        )

    def metabolic_power(
        self, activation: np.ndarray, angle: np.ndarray, rate: np.ndarray
    ) -> np.ndarray:
        """(J, N) W, heat and work of the muscles of each joint; passive torques need none.

        activation: positive toward flexion; angle, rate: the flexion, rad, rad/s.
        """
        flexes = activation > 0.0
        constants = np.where(flexes, self._flexion, self._extension)
        *_, c5, _ = constants
        largest = c5 / HALF
        x = np.where(flexes, rate, -rate) / largest
        phi = (0.054 + x * (0.506 + x * 2.46)) / (1.0 + x * (-1.13 + x * (12.8 - x * 1.64)))
        return np.asarray(
            np.abs(activation) * self.scale * isometric(constants, angle) * largest * phi
        )


def isometric(constants: Sequence[float] | np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(...) the strength at rest over m g h, of flexion (rad); constants: see `strength`."""
    c1, c2, c3, *_ = constants
    by_angle = np.cos(c2 * (angle - c3)) - LEAST_BY_ANGLE
    return np.asarray(c1 * (LEAST_BY_ANGLE + rounded_positive_part(by_angle, LEAST_WIDTH)))


def strength(
    constants: Sequence[float] | np.ndarray, angle: np.ndarray, rate: np.ndarray
) -> np.ndarray:
    """(...) the largest torque over m g h, of flexion (rad) and its rate in the torque's direction
    (rad/s); constants: c1 to c6, numbers or arrays that broadcast."""
    _, _, _, c4, c5, c6 = constants
    shorter = rounded_positive_part(rate, SLOW)
    longer = rounded_positive_part(-rate, SLOW)
    speed = shorter + longer
    by_rate = (2.0 * c4 * c5 + speed * (c5 - 3.0 * c4)) / (
        2.0 * c4 * c5 + speed * (2.0 * c5 - 4.0 * c4)
    )
    by_rate = by_rate * (1.0 + c6 * longer) - LEAST_BY_RATE
    return np.asarray(
        isometric(constants, angle) * (LEAST_BY_RATE + rounded_positive_part(by_rate, LEAST_WIDTH))
    )
