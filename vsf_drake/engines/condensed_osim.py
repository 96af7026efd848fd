"""The condensed foot as a model of OpenSim for Moco, whose text is in `engines/templates`.

Its ground is OpenSim's MeyerFregly2016Force, which is smooth everywhere. It knows points, no
spheres, and there is one at each of two places of a station:

    centre    bears nearly all, wherever the sphere rolls to, and has no friction: the centre of a
              sphere that rolls moves, its lowest point does not
    sole      the point of the sphere that is lowest at the piece's mean inclination bears
              SOLE_SHARE and has all the friction

Its law is not the foot's own: the damping grows with the force and acts in unloading, too.
Stiffness, resting length and dissipation of a station are those with which it comes closest, by
least squares, to the station's own force over a half-sine stroke of STROKE_S, as deep as the
station is pressed in a roll-over. Friction has the same slope at rest and the same coefficient in
sliding; the peak of static friction between the two is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from vsf_drake.device.roll_over import iso_22675
from vsf_drake.engines.condensed import (
    ALIKE_AT_M,
    LIGHTEST_N,
    POSE_STEP_S,
    CondensedFoot,
    Station,
)
from vsf_drake.engines.condensed_error import CondensedError
from vsf_drake.engines.sagittal_foot import at_rest
from vsf_drake.engines.written import rendered
from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.plants.rigid_foot import NAME

STROKE_KG = 75.0
"""The person in whose roll-over, by the profile of ISO 22675, a stroke is as deep (a choice: in the
middle of those for whom the foot is condensed)."""
STROKE_S = 0.6
"""How long a stroke lasts: the load cycle for which the foam's damping was chosen, see
`FOAM_DAMPING_TIME_S`."""
SAMPLES = 200  # of a stroke
SOLE_SHARE = 0.1
"""Of a station's force, on the point that has its friction (a choice): as little as lets the
station roll, and much more than rounding."""
# constants of OpenSim's law
SOFTEST_N_PER_M = 0.1
CORNER_M = 1e-3
NO_FORCE_M = 1e-2
TALLEST_M = 0.7


@dataclass(frozen=True, kw_only=True)
class MocoStation:
    """A station with the constants of its two MeyerFregly2016Forces."""

    sole_m: np.ndarray  # (3,) its point on the sole, in K at rest
    stiffness_n_per_m: float  # of both together
    resting_length_m: float  # of the centre, and
    sole_length_m: float  # of the point on the sole
    dissipation_s_per_m: float


@dataclass(frozen=True, kw_only=True)
class MocoGround:
    """The stations, and how far their forces are from their own in the roll-over of STROKE_KG."""

    stations: tuple[MocoStation, ...]
    largest: float  # difference of the whole force at rest, over its peak
    touching_n: float  # of all at rest as they just touch the ground
    lost: float | None  # energy lost in the strokes, over what the own damping loses, if it does


def condensed_osim(condensed: CondensedFoot, error: CondensedError, *, fulcrum_m: float) -> str:
    """The condensed foot with its fulcrum at `fulcrum_m` (m from A) as the text of an OpenSim 4.6
    model (.osim), named vsf, with the `error` against the full foot in its head. OpenSim's axes: x
    forward, y up, z right.

    The mount M stands on a planar joint over the ground, which is the plane y = 0. Bodies are named
    vsf_frame, vsf_middle and vsf_toe, their hinges keel_1 and keel_2, positive with the toe up.
    InputError if the carriage cannot reach the fulcrum; SimulationError if the foot finds no rest
    under a load of a roll-over.
    """
    at = condensed.at(fulcrum_m)
    friction = condensed.full.friction
    sliding = min(friction.mu_kinetic, friction.mu_static)
    latch_m_per_s = friction.threshold_velocity_m_per_s
    if sliding > 0.0:
        latch_m_per_s *= sliding / friction.mu_static
    return rendered(
        "condensed.osim.j2",
        name=NAME,
        foot=condensed,
        error=error,
        at=at,
        ground=moco_ground(condensed, fulcrum_m=fulcrum_m),
        stroke_kg=STROKE_KG,
        stroke_s=STROKE_S,
        sole_share=SOLE_SHARE,
        sliding=sliding,
        latch_m_per_s=latch_m_per_s,
        gravity=GRAVITY,
    )


def moco_ground(condensed: CondensedFoot, *, fulcrum_m: float) -> MocoGround:
    """The stations' forces as Moco takes them, with the fulcrum at `fulcrum_m` (m from A)."""
    profile = iso_22675(POSE_STEP_S)
    pitch = -profile.tilt_rad
    rest = at_rest(
        condensed.sagittal(np.full(len(pitch), fulcrum_m)),
        pitch_rad=pitch,
        load_n=np.maximum(STROKE_KG * GRAVITY * profile.force_bw, LIGHTEST_N),
    )
    turned = np.column_stack([np.zeros(len(pitch)), np.cumsum(rest.q, axis=1)])
    stations = []
    fitted = np.empty_like(rest.at.normal)
    touching_n = 0.0
    lost = np.zeros(2)
    for i, station in enumerate(condensed.stations):
        depth = rest.at.depth[:, i]
        stroke = Stroke(station, max(float(depth.max()), ALIKE_AT_M))
        constants = stroke.fitted()
        stiffness, length, dissipation = map(float, constants)
        fitted[:, i] = force(depth, np.zeros_like(depth), constants)
        touching_n += float(force(np.zeros(1), np.zeros(1), constants)[0])
        lost += stroke.lost(constants)
        weight = rest.at.normal[:, i]
        # a station that bears nothing is taken as it stands
        weight = weight if weight.any() else np.ones_like(weight)
        inclined = pitch + turned[:, station.piece]
        mean = float(np.average(inclined, weights=weight))
        # wherever the piece is not inclined by the mean, the point is not the sphere's lowest
        above = station.radius_m * np.average(1.0 - np.cos(inclined - mean), weights=weight)
        lowest = station.radius_m * np.array([np.sin(mean), 0.0, np.cos(mean)])
        stations.append(
            MocoStation(
                sole_m=np.array([station.x_m, 0.0, station.z_m]) - lowest,
                stiffness_n_per_m=stiffness,
                resting_length_m=station.radius_m + length,
                sole_length_m=length + float(above),
                dissipation_s_per_m=dissipation,
            )
        )
    off = fitted.sum(axis=1) - rest.at.force
    damped = any(station.damping_n_s_per_m for station in condensed.stations)
    return MocoGround(
        stations=tuple(stations),
        largest=float(np.abs(off).max() / rest.at.force.max()),
        touching_n=touching_n,
        lost=float(lost[1] / lost[0]) if damped else None,
    )


class Stroke:
    """A half-sine stroke of a station, and the station's own force along it."""

    def __init__(self, station: Station, deepest_m: float) -> None:
        phase = np.linspace(0.0, np.pi, SAMPLES)
        self.depth = deepest_m * np.sin(phase)
        self.rate = deepest_m * np.pi / STROKE_S * np.cos(phase)
        law = LawConstants(
            stiffness=station.stiffness,
            exponent=station.exponent,
            damping=station.damping_n_s_per_m,
            full_damping_depth=station.full_damping_depth_m,
        )
        self.own, *_ = kelvin_voigt.normal_force(self.depth, self.rate, law)

    def fitted(self) -> np.ndarray:
        """(3,) constants of OpenSim's law, as `force` takes them."""
        scale = np.array([self.own.max() / self.depth.max(), CORNER_M, 1.0])

        def errors(p: np.ndarray) -> np.ndarray:
            off = force(self.depth, self.rate, scale * p) - self.own
            return np.asarray(off / self.own.max())

        return np.asarray(scale * least_squares(errors, np.ones(3)).x)

    def lost(self, constants: np.ndarray) -> np.ndarray:
        """(2,) energy that is lost, but for a factor: by the own force, by OpenSim's."""
        fitted = force(self.depth, self.rate, constants)
        return np.array([self.own @ self.rate, fitted @ self.rate])


def force(depth: np.ndarray, depth_rate: np.ndarray, constants: np.ndarray) -> np.ndarray:
    """Vertical force (N) of OpenSim's MeyerFregly2016Force on points at a depth (m) and its rate
    (m/s). Its constants are the stiffness (N/m), what is added to the depth (m), which is what the
    resting length is for, and the dissipation (s/m).

    Meyer, Eskinazi, Jackson, Rao, Patten, Fregly 2016 (doi 10.3389/fbioe.2016.00077), as OpenSim
    4.6 has it: stiffness * (depth - 1 mm) * (1 + dissipation * depth rate) once a point is some
    millimetres deep, a smooth corner 1 mm wide, and next to nothing above the ground.
    """
    stiffness, length, dissipation = constants
    y = -TALLEST_M * np.tanh((depth + length) / TALLEST_M)
    half = 0.5 * (stiffness - SOFTEST_N_PER_M)
    slope = 0.5 * (stiffness + SOFTEST_N_PER_M)
    at_rest_n = half * (_corner(y) - _corner(np.array(NO_FORCE_M))) - slope * (y - NO_FORCE_M)
    return np.asarray(at_rest_n * (1.0 + dissipation * depth_rate))


def _corner(height: np.ndarray) -> np.ndarray:
    """CORNER_M * log(cosh((height + CORNER_M) / CORNER_M)), also where the cosine is too large."""
    u = np.abs(height + CORNER_M) / CORNER_M
    return np.asarray(CORNER_M * (u + np.log1p(np.exp(-2.0 * u)) - np.log(2.0)))
