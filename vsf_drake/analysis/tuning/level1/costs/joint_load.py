"""Load on the prosthetic leg: moments at hip and knee, and what the socket passes to the residual limb.

    J = 1/T int  sum_j (tau_j / (m g L))^2  +  w [ |F|^2 / (m g)^2 + |M|^2 / (m g L)^2 ]  dt

over prosthetic stance of duration T, with leg length L, the moments tau_j of the prosthetic joints and the bushing's
force F and moment M; without unit. The squared moment is the usual measure where no muscle is modelled. The intact leg
is left out because it cannot change: with the motion given, its forces are those of the recording at every setting.
"""

from __future__ import annotations

from vsf_drake.analysis.tuning.level1.costs.term import CostTerm, mean_square
from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads


def joint_load(frame: StanceFrame, loads: WalkLoads, *, socket_weight: float) -> tuple[CostTerm, ...]:
    """Terms "joint_moments" and "socket", the latter multiplied by its weight."""
    force, moment = frame.weight_n, frame.weight_n * frame.leg_m
    joints = mean_square(loads.joints.value / moment, loads.joints.by / moment, frame.inside, frame.duration_s)
    found = [CostTerm("joint_moments", "prosthetic hip and knee moments squared", *joints)]
    parts = [mean_square(loads.socket.value[:, rows] / scale, loads.socket.by[:, rows] / scale, frame.inside,
                         frame.duration_s) for rows, scale in ((slice(0, 3), force), (slice(3, 6), moment))]
    value, by = (a + b for a, b in zip(*parts, strict=True))
    found.append(CostTerm("socket", "socket force and moment squared", value, by).times(socket_weight))
    return tuple(found)
