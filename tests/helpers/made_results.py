"""Results made from formulas, with known answers: no simulation and no Drake."""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.simulation.results import BenchResult, BenchSetting, WalkResult

MASS_KG = 80.0
WEIGHT_N = MASS_KG * 9.81
FOOT_LENGTH_M = 0.25
STRIKE_S, LIFT_S = 0.6, 1.3
SPHERES = 24
ZONES = (
    ("heel_posterior",) * 2
    + ("heel",)
    + ("heel_anterior",) * 3
    + ("midfoot",) * 5
    + ("forefoot",) * 13
)


def walk_load(time_s, *, strike_s=STRIKE_S, lift_s=LIFT_S, scale=1.0):
    """(n, 3) force in W: a double hump, braking then propulsion, a push to the left."""
    s = np.clip((time_s - strike_s) / (lift_s - strike_s), 0.0, 1.0)
    vertical = 1.15 * np.sin(np.pi * s) + 0.35 * np.sin(3.0 * np.pi * s)
    return (
        scale
        * WEIGHT_N
        * np.column_stack([-0.16 * np.sin(2.0 * np.pi * s), 0.05 * np.sin(np.pi * s), vertical])
    )


def walk_cop(time_s, force_W, *, strike_s=STRIKE_S, lift_s=LIFT_S, shift=(0.0, 0.0)):
    """(n, 3) centre of pressure rolling from heel to toe; NaN up to 20 N."""
    s = (time_s - strike_s) / (lift_s - strike_s)
    x, y = 0.5 + 0.9 * FOOT_LENGTH_M * s + shift[0], 0.1 + 0.01 * np.sin(np.pi * s) + shift[1]
    cop = np.column_stack([x, y, np.zeros_like(s)])
    cop[force_W[:, 2] <= 20.0] = np.nan
    return cop


def make_plate(
    *, start_s=0.0, end_s=2.0, rate_hz=2000.0, stances=((STRIKE_S, LIFT_S),)
) -> PlateRecording:
    """A plate that records `stances` (heel strike, toe-off)."""
    time = start_s + np.arange(round((end_s - start_s) * rate_hz) + 1) / rate_hz
    force, cop = np.zeros((len(time), 3)), np.full((len(time), 3), np.nan)
    for strike, lift in stances:
        own = walk_load(time, strike_s=strike, lift_s=lift)
        force += own
        loaded = own[:, 2] > 20.0
        cop[loaded] = walk_cop(time, own, strike_s=strike, lift_s=lift)[loaded]
    return PlateRecording(time, force, cop, np.zeros(len(time)), True)


def make_walk(
    *,
    start_s=0.2,
    end_s=1.7,
    step_s=1e-3,
    delay_s=0.0,
    scale=1.0,
    cop_shift=(0.0, 0.0),
    stances=((STRIKE_S, LIFT_S),),
    **changes,
) -> WalkResult:
    """A walk whose foot is loaded like `make_plate`'s, but later, scaled, or with its CoP
    shifted."""
    time = start_s + step_s * np.arange(1, round((end_s - start_s) / step_s) + 1)
    n = len(time)
    force, cop = np.zeros((n, 3)), np.full((n, 3), np.nan)
    for strike, lift in stances:
        span = {"strike_s": strike + delay_s, "lift_s": lift + delay_s}
        own = walk_load(time, scale=scale, **span)
        force += own
        loaded = own[:, 2] > 20.0
        cop[loaded] = walk_cop(time, own, shift=cop_shift, **span)[loaded]
    names = (
        "pelvis_tx",
        "pelvis_ty",
        "pelvis_tz",
        "hip_flexion_r",
        "knee_angle_r",
        "keel_1",
        "fulcrum",
    )
    q = np.column_stack(
        [
            1.1 * time,
            0.95 + 0.02 * np.sin(9.0 * time),
            0.0 * time,
            0.4 * np.sin(5.0 * time),
            0.5 - 0.3 * np.cos(5.0 * time),
            1e-4 * force[:, 2],
            np.full(n, 0.066),
        ]
    )
    share = np.exp(
        -0.5 * ((np.arange(SPHERES) - 24.0 * ((time - STRIKE_S) / 0.7)[:, None]) / 5.0) ** 2
    )
    share /= share.sum(axis=1, keepdims=True) + 1e-300
    normal = share * force[:, 2:3]
    values = {
        "time_s": time,
        "coordinate_names": names,
        "q": q,
        "v": np.gradient(q, step_s, axis=0),
        "generalized_force": np.cos(q),
        "grf_W": force,
        "cop_W": cop,
        "free_moment_nm": 0.002 * force[:, 2],
        "intact_grf_W": walk_load(time, strike_s=0.0, lift_s=0.7),
        "intact_cop_W": np.full((n, 3), np.nan),
        "sphere_normal_n": normal,
        "sphere_depth_m": normal / 7e3,
        "sphere_friction_W": np.stack([0.1 * normal, -0.05 * normal], axis=-1),
        "socket_wrench": np.outer(force[:, 2], np.arange(6)),
        "fulcrum_m": q[:, 6],
        "prescribed_q": q[:, :5].copy(),
        "prescribed_names": names[:5],
        "sphere_zones": ZONES,
        "unconverged_steps": 0,
        "converged": True,
        "simulated_s": end_s - start_s,
        "wall_s": 0.1,
        "compile_s": 2.5,
        "step_s": step_s,
        "subject_mass_kg": MASS_KG,
        "foot_length_m": FOOT_LENGTH_M,
        "side": "right",
        "trial_name": "made-up walk",
        "synthetic": False,
        "parameters": {
            "foot": {"mass_kg": 0.649, "zones": [{"name": "heel", "x_mm": [21.0]}], "none": None}
        },
        "provenance": {
            "versions": {"numpy": np.__version__},
            "inputs": {"walk.mot": "00ff"},
            "seed": None,
        },
        "notes": ("the knee's adduction is not recorded and held at zero",),
        "energy_j": np.zeros((n, 2)),
        "energy_names": ("driver_work", "remainder"),
    }
    return WalkResult(**(values | changes))


BENCH_PARAMETERS = {
    "keel": {"width_m": 0.0684, "thickness_m": 0.00635, "flexural_modulus_pa": 18.6e9},
    "fulcrum": {"stiffness_n_per_m": 236e3},
    "series_stiffness_n_per_m": 54.8e3,
    "load_point_m": 0.199,
}


def make_setting(
    fulcrum_m,
    stiffness,
    *,
    max_load_n=600.0,
    hardening=0.0,
    samples=400,
    approach_m=0.5e-3,
    **changes,
):
    """A pass whose load is k x + hardening x² after an approach through the air."""
    reach = max_load_n / stiffness
    travel = np.linspace(0.0, reach, samples)
    platen = np.concatenate(([-approach_m], travel))
    load = np.concatenate(([0.0], stiffness * travel + hardening * travel**2))
    values = {
        "fulcrum_m": fulcrum_m,
        "time_s": 0.01 * np.arange(samples + 1),
        "platen_m": platen,
        "load_n": load,
    }
    return BenchSetting(**(values | changes))


def make_bench(**changes) -> BenchResult:
    """Five straight forefoot curves and a straight heel curve, in no particular order."""
    pairs = (
        (0.151, 32.0e3),
        (None, 65e3),
        (0.066, 10.0e3),
        (0.087, 14.1e3),
        (0.108, 18.9e3),
        (0.129, 24.8e3),
    )
    settings = tuple(make_setting(fulcrum, k, hardening=0.0) for fulcrum, k in pairs)
    values = {
        "settings": settings,
        "wall_s": 0.5,
        "compile_s": 2.0,
        "simulated_s": 180.0,
        "speed_m_per_s": 0.05 / 60.0,
        "max_load_n": 600.0,
        "parameters": {"foot": BENCH_PARAMETERS},
        "provenance": {"seed": None},
    }
    return BenchResult(**(values | changes))


def turned(walk: WalkResult, plate: PlateRecording, angle: float):
    """The same walk in another direction of the laboratory: everything turned about the vertical by
    `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    q = walk.q.copy()
    horizontal = np.column_stack([q[:, 0], -q[:, 2], np.zeros(len(q))]) @ turn.T
    q[:, 0], q[:, 2] = horizontal[:, 0], -horizontal[:, 1]
    new = dataclasses.replace(
        walk, q=q, prescribed_q=q[:, :5], grf_W=walk.grf_W @ turn.T, cop_W=walk.cop_W @ turn.T
    )
    return new, dataclasses.replace(
        plate, force_W=plate.force_W @ turn.T, cop_W=plate.cop_W @ turn.T
    )
