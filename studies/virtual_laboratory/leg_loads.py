"""What a walk truly loads the prosthetic leg with, by inverse dynamics on the virtual laboratory's
own mass points.

    tau_k = sum over points of m (a + g z) . dx/dq_k  -  (socket's force, moment) . dX_shank/dq_k

the generalised force of coordinate k, by virtual work: only what the coordinate moves counts,
thigh and residual shank. The socket's action on the residual limb is the virtual prosthesis's.
Costs are of these loads as `vsf_drake.tuning.costs` defines costs; the numbers owe nothing to its
model.
"""

from __future__ import annotations

import numpy as np

from virtual_laboratory.balance import UP
from virtual_laboratory.body import SEGMENTS, SHANK, MassPoints, body_points
from virtual_laboratory.motion import COORDINATES, MOVING, Person, cross
from virtual_laboratory.polish import limb_load
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.recording import MOVED_M, Recorded
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.tuning import costs
from vsf_drake.tuning.options import TuningOptions

LEG = ("thigh_right", "shank_right")
MARGIN_ROWS = 2
"""At both ends, where second differences do not reach."""


def leg_moments(
    person: Person, prosthesis: Prosthesis, trial: Recorded, joints: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, J) N m of the coordinates `joints` of the right leg, in their signs, (n, J) rad/s, their
    rates, and (n, 6) the residual shank's angular velocity and the velocity of what is fixed to it
    at W's origin."""
    time_s = trial.force_time_s
    step_s = time_s[1] - time_s[0]
    q, qd, _ = trial.trajectory.sample(time_s)
    u = np.column_stack([q, np.zeros((len(q), MOVING - len(COORDINATES)))])
    body = person.linearise(u)
    columns = [COORDINATES.index(name) for name in joints]
    every = body_points(person.handles, person.model.intact_foot, prosthesis.mass_kg)
    own = np.isin(every.segment, [SEGMENTS.index(name) for name in LEG])
    points = MassPoints(every.segment[own], every.p_B[own], every.mass[own])
    places = points.places(body.R_WB, body.p_WB)
    moving = np.zeros_like(places)
    moving[1:-1] = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / step_s**2
    moving += UP
    turn = body.J_WB[:, points.segment, :3][..., columns]
    shift = body.J_WB[:, points.segment, 3:][..., columns]
    arms = places - body.p_WB[:, points.segment]
    J = shift + cross(turn, arms[..., None])
    moments = np.einsum("p,npi,npij->nj", points.mass, moving, J)
    R_WS = body.R_WB[:, SHANK]
    p_WS = body.p_WB[:, SHANK]
    load = limb_load(prosthesis, trial.reaction, R_WS, p_WS)
    about = load.moment - np.cross(p_WS, load.force)
    J_S = body.J_WB[:, SHANK][..., columns]
    moments -= np.einsum("ni,nij->nj", about, J_S[:, :3])
    moments -= np.einsum("ni,nij->nj", load.force, J_S[:, 3:])
    twist = np.einsum("nij,nj->ni", body.J_WB[:, SHANK, :, : len(COORDINATES)], qd)
    twist[:, 3:] -= np.cross(twist[:, :3], p_WS)
    return moments, qd[:, columns], twist


def true_costs(person: Person, prosthesis: Prosthesis, trial: Recorded) -> dict[str, float]:
    """Costs of a walk by itself: joint_load, metabolic, push_off."""
    options = TuningOptions()
    joints = tuple(f"{name}_r" for name in options.joints)
    moments, rates, twist = leg_moments(person, prosthesis, trial, joints)
    time_s = trial.force_time_s
    step_s = float(time_s[1] - time_s[0])
    reaction = trial.reaction
    ahead = np.array([MOVED_M, 0.0, 0.0])
    ground = np.column_stack([reaction.moment + np.cross(ahead, reaction.force), reaction.force])
    stances = tuple(s for s in find_stances(time_s, reaction.force[:, 2]) if s.complete)
    inside = np.zeros(len(time_s))
    late = np.zeros(len(time_s))
    for stance in stances:
        start = stance.start_s + options.late_share * stance.duration_s
        end = stance.end_s + options.margin_s
        inside[(time_s >= stance.start_s - options.margin_s) & (time_s <= end)] = step_s
        late[(time_s >= start) & (time_s <= end)] = step_s
    rows = slice(MARGIN_ROWS, -MARGIN_ROWS)

    def smooth(values: np.ndarray) -> np.ndarray:
        return low_pass(values[rows], rate_hz=1.0 / step_s, cutoff_hz=options.cutoff_hz)[..., None]

    loads = costs.WalkLoads(smooth(ground), smooth(moments), smooth(reaction.socket_load))
    body = person.handles.body
    frame = costs.StanceFrame(
        time_s=time_s[rows],
        step_s=step_s,
        stances=stances,
        inside=inside[rows],
        late=late[rows],
        rates=rates[rows],
        twist=twist[rows],
        weight_n=person.subject.mass_kg * GRAVITY,
        mass_kg=person.subject.mass_kg,
        leg_m=body.thigh_length + body.shank_length + body.ankle_height,
        own=loads,
        plate_W=None,
    )
    terms = costs.walk_terms(frame, loads, options)
    return {name: costs.value_of(terms[name]) for name in ("joint_load", "metabolic", "push_off")}
