"""How a stiffness tuning with a free motion is to be done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from vsf_drake.collocation.problem import METHODS
from vsf_drake.errors import InputError
from vsf_drake.simulation.sagittal.contact_spheres import Smoothing
from vsf_drake.simulation.sagittal.model import DESIGN

COSTS = ("joint_load", "metabolic", "push_off", "tracking")
WEIGHTED = "weighted"
MORE_DESIGN = DESIGN[1:]
STAGES = (
    Smoothing(depth_m=2e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0),
    Smoothing(depth_m=1e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0))
"""Down to the fitted contact, but for its last millimetre; the optimum counts only at the end of them. From a recorded
stride no softer ones are needed (a choice)."""


@dataclass(frozen=True, kw_only=True)
class StrideOptions:
    """Options of a stiffness tuning by trajectory optimisation. All numbers without a source are choices.

    Attributes:
        method, intervals: of the collocation. Trapezoidal takes twice as many for the same accuracy.
        bounds_mm: least and largest fulcrum position from A; None for the carriage's reach.
        design: of MORE_DESIGN, tuned together with the fulcrum; design_bounds: (low, high) by name, in its unit.
        weights: of COSTS in the weighted cost, each cost divided by its size in the tracked stride.
        deviation_weight: how much of its own size a cost may lose for a deviation of one, a root mean square of
            `angle_deg` and `place_m` from the recorded motion and of `force_bw` and `cop_m` from the recorded force.
            A cost without it exploits what the model does not know: balance, comfort, the contact's law.
        acceleration_weight: of deviations from the recorded accelerations by `acceleration_rad_per_s2` and
            `acceleration_m_per_s2` in the deviation.
        torque_weight: of the squared joint moments in the tracking cost, to make the solution unique.
        socket_weight: see the level-1 option of that name.
        smooth_power_w: power (W) below which positive and negative work are rounded.
        late_share: of prosthetic stance, after which the prosthesis's positive power is push-off.
        torque_nm_per_kg: largest joint moment. angle_margin_deg: how far an angle may leave the range of its recording.
        clearance_m: least height of a foot over the ground in the middle of its swing.
        stages: of smoothing, the last of which counts.
        positions: how many fixed positions the sweep takes. starts: searches with the fulcrum free.
        iterations, time_limit_s: of one solve. confirm: solvers that search again from the optimum.
        draws: of the contact's parameters, with which the optimum is searched again; 0 for none. seed: of these.
    """

    method: str = "hermite_simpson"
    intervals: int = 40
    bounds_mm: tuple[float, float] | None = None
    design: tuple[str, ...] = ()
    design_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    weights: Mapping[str, float] = field(
        default_factory=lambda: {"joint_load": 1.0, "metabolic": 1.0, "push_off": 1.0})
    deviation_weight: float = 0.5
    angle_deg: float = 2.0
    place_m: float = 0.01
    force_bw: float = 0.05
    cop_m: float = 0.05
    acceleration_rad_per_s2: float = 20.0
    acceleration_m_per_s2: float = 2.0
    acceleration_weight: float = 0.005
    torque_weight: float = 0.1
    socket_weight: float = 0.01
    smooth_power_w: float = 5.0
    late_share: float = 0.5
    torque_nm_per_kg: float = 4.0
    angle_margin_deg: float = 15.0
    clearance_m: float = 0.01
    stages: tuple[Smoothing, ...] = STAGES
    positions: int = 9
    starts: int = 3
    iterations: int = 200
    time_limit_s: float = 120.0
    confirm: tuple[str, ...] = ("snopt", "ipopt")
    draws: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"{self.method!r} is no collocation", where="method",
                             right=f"There are: {', '.join(METHODS)}")
        for name, least, most in (("intervals", 10, 400), ("positions", 2, 100), ("starts", 1, 20),
                                  ("iterations", 1, 10000),
                                  ("draws", 0, 1000), ("seed", 0, 2**31)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise InputError(f"{value!r} is not usable", where=name,
                                 right=f"It must be a whole number from {least} to {most}")
        for name, low, high in (
                ("deviation_weight", 1e-4, 1e3), ("angle_deg", 0.1, 30.0), ("place_m", 1e-4, 0.2),
                ("force_bw", 1e-3, 1.0), ("cop_m", 1e-3, 0.2), ("acceleration_rad_per_s2", 0.1, 1e4),
                ("acceleration_m_per_s2", 0.01, 1e3), ("acceleration_weight", 0.0, 10.0),
                ("torque_weight", 0.0, 10.0), ("socket_weight", 0.0, 10.0),
                ("smooth_power_w", 0.1, 100.0), ("late_share", 0.0, 0.95), ("torque_nm_per_kg", 0.5, 20.0),
                ("angle_margin_deg", 1.0, 90.0), ("clearance_m", -0.05, 0.05), ("time_limit_s", 1.0, 1e5)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) \
                    or not low <= value <= high:
                raise InputError(f"{value!r} is not usable", where=name,
                                 right=f"It must be a number from {low:g} to {high:g}")
        for name in (*self.design, *self.design_bounds):
            if name not in MORE_DESIGN:
                raise InputError(f"{name!r} is none", where="design", right=f"There are: {', '.join(MORE_DESIGN)}")
        if not self.weights or any(name not in COSTS for name in self.weights) \
                or not sum(self.weights.values()) > 0.0 or min(self.weights.values()) < 0.0:
            raise InputError(f"{dict(self.weights)!r} are no weights", where="weights",
                             right=f"Give numbers from 0 on, one above 0, for some of {', '.join(COSTS)}")
        if not self.stages:
            raise InputError("there are none", where="stages", right="Give at least one")
