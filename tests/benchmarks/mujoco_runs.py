"""The same foot in MuJoCo, run: pressed on the bench, and walking with the shank led along the recorded motion."""

from __future__ import annotations

import time
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco_model import ARMATURE, DRIVEN, Contact, MujocoFoot, make_mujoco_foot

from vsf_drake.motion.trial import Trial
from vsf_drake.parameters import FOAM_DAMPING_TIME_S, FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot_handles import ContactSites
from vsf_drake.simulation.walk import Walk, Walker

BALL_RADIUS_M = 1e-3
"""Of the bench's ball on the load point; without friction its size does not matter."""


@dataclass(frozen=True)
class Press:
    """A stroke: travel_m (n,) m from first touch, load_n (n,) N, and the seconds it took."""

    travel_m: np.ndarray
    load_n: np.ndarray
    simulated_s: float
    wall_s: float


def shank_path(walker: Walker, trial: Trial, moments: np.ndarray) -> np.ndarray:
    """(n, 6) driven coordinates of the residual shank in W at `moments` (s): place (m), then turns z, x, y (rad)."""
    gait = walker.gait
    context = gait.plant.CreateDefaultContext()
    shank = gait.person.segments[f"shank_{walker.subject.prosthetic_side}"]
    columns = [gait.plant.GetJointByName(name).position_start() for name in gait.prescribed]
    q, path = np.zeros(gait.plant.num_positions()), np.zeros((len(moments), len(DRIVEN)))
    for row, prescribed in zip(path, trial.trajectory.ordered(gait.prescribed).sample(moments)[0], strict=True):
        q[columns] = prescribed
        gait.plant.SetPositions(context, q)
        X_WS = shank.EvalPoseInWorld(context)
        R = X_WS.rotation().matrix()
        row[:3] = X_WS.translation()
        row[3:] = np.arctan2(-R[0, 1], R[1, 1]), np.arcsin(R[2, 1]), np.arctan2(-R[2, 0], R[2, 2])
    path[:, 3:] = np.unwrap(path[:, 3:], axis=0)
    return path


def lead(
    foot: MujocoFoot, path: np.ndarray, own_q: np.ndarray, own_v: np.ndarray
) -> tuple[np.ndarray, mujoco.MjData, float]:
    """Leads the driven joints along `path` (n + 1, 6), one row a step, from the others' state `own_q`, `own_v`.

    At the start of each step they are put on the path, with the velocity of the last step and the force that gives
    their armature the next one: what hangs from them feels the velocity and acceleration of the path.

    Returns:
        (n, 3) N of the floor on the foot at the ends of the steps, which is what the constraint forces do on the three
        driven slides; the state at the end; wall seconds, of which Python's part is a tenth.
    """
    data, step_s, n = mujoco.MjData(foot.model), foot.model.opt.timestep, len(DRIVEN)
    velocity = np.diff(path, axis=0, prepend=2 * path[:1] - path[1:2]) / step_s
    push = ARMATURE * np.diff(velocity, axis=0) / step_s
    data.qpos[n:], data.qvel[n:] = own_q, own_v
    force = np.zeros((len(push), 3))
    started = time.perf_counter()
    for i in range(len(push)):
        data.qpos[:n], data.qvel[:n], data.qfrc_applied[:n] = path[i], velocity[i], push[i]
        mujoco.mj_step(foot.model, data)
        force[i] = data.qfrc_constraint[:3]
    wall_s = time.perf_counter() - started
    if not np.isfinite(force).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
        raise RuntimeError(f"MuJoCo diverged at steps of {1e3 * step_s:g} ms")
    return force, data, wall_s


def walking_model(walker: Walker, *, fulcrum_m: float, step_s: float) -> MujocoFoot:
    """Socket and foot below the shank, all spheres of the foot on the floor."""
    gait = walker.gait
    return make_mujoco_foot(
        gait.plant, gait.plant_context(walker.context), gait.person.foot, fulcrum_m=fulcrum_m, step_s=step_s,
        contacts=contacts(gait.person.foot.sites), friction=walker.model.foot.friction.mu_static,
        socket=gait.person.socket)


def walk(walker: Walker, trial: Trial, like: Walk, step_s: float) -> tuple[np.ndarray, float]:
    """(n, 3) N on the prosthetic foot and wall seconds, over the time of `like` and from its state at the start."""
    made = walking_model(walker, fulcrum_m=trial.fulcrum_m, step_s=step_s)
    start, end = like.record.time_s[0] - like.step_s, like.record.time_s[-1]
    moments = np.minimum(start + step_s * np.arange(round((end - start) / step_s) + 1), end)
    tree = like.mechanism.tree
    own = [tree.index(name) for name in made.coordinate_names[len(DRIVEN):]]
    path = shank_path(walker, trial, moments)
    force, _, wall_s = lead(made, path, like.record.q0[own], like.record.v0[own])
    return force, wall_s


def press(
    parameters: FootParameters, *, fulcrum_m: float, travel_m: float, heel: bool = False, step_s: float = 1e-3,
    speed_m_per_s: float = 5e-3
) -> Press:
    """Lowers the forefoot's load point, or the heel, on the floor by `travel_m` from first touch, without weight."""
    bench = make_bench(parameters, heel=heel)
    foot = bench.foot
    if heel:
        sites = [site for site in contacts(foot.sites) if site.body == foot.frame.index()]
    else:
        j, k = foot.keel_body_at(parameters.load_point_m), parameters.series_stiffness_n_per_m
        point = np.array([parameters.load_point_m - foot.keel_starts[j], 0.0, 0.0])
        sites = [Contact(foot.keel[j].index(), point, BALL_RADIUS_M, k, k * FOAM_DAMPING_TIME_S)]
    made = make_mujoco_foot(bench.plant, bench.plant.CreateDefaultContext(), foot, fulcrum_m=fulcrum_m, step_s=step_s,
                            contacts=sites, friction=0.0, gravity=False)
    moments = step_s * np.arange(round(travel_m / speed_m_per_s / step_s) + 1)
    path = np.zeros((len(moments), len(DRIVEN)))
    path[:, 2] = -min(site.p_BS[2] - site.radius for site in sites) - speed_m_per_s * moments
    own = np.zeros(len(made.coordinate_names) - len(DRIVEN))
    force, _, wall_s = lead(made, path, own, own)
    return Press(travel_m=speed_m_per_s * moments[1:], load_n=force[:, 2], simulated_s=moments[-1], wall_s=wall_s)


def contacts(sites: ContactSites) -> list[Contact]:
    """The foot's spheres."""
    if np.any(sites.exponent != 1.0):
        raise ValueError("MuJoCo's contact is linear in depth: every exponent must be 1")
    return [Contact(*site) for site in zip(
        sites.body_indices, sites.p_BS, sites.radius, sites.stiffness, sites.damping, strict=True)]
