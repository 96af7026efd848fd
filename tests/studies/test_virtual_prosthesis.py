"""The virtual laboratory's prosthesis obeys statics, is passive and converges."""

from __future__ import annotations

import ast
import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation
from virtual_laboratory import device, prosthesis
from virtual_laboratory.design import Design, KeelDesign
from virtual_laboratory.keel import make_keel

from vsf_drake.parameters import GRAVITY, FootParameters, Subject

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
WEIGHT_N = SUBJECT.mass_kg * GRAVITY
UPRIGHT = np.eye(3)
FIRM = {"hysteresis_s_per_m": 0.0, "friction": 50.0}


def made(fulcrum_m: float = 0.108, *, step_s: float = 5e-4, **sole: float) -> prosthesis.Prosthesis:
    design = Design(sole=dataclasses.replace(Design().sole, **sole))
    return prosthesis.Prosthesis(SUBJECT, fulcrum_m, design=design, step_s=step_s)


def knee(p: prosthesis.Prosthesis, pressed_m: float) -> np.ndarray:
    return np.array([0.0, 0.0, p.sole_below_knee - pressed_m])


def roll_over(p: prosthesis.Prosthesis, lateral: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth step: from the air over heel and toe and off again, leaning and turning by `lateral` (rad)."""
    time = np.arange(0.0, 0.9 + 1e-9, 1e-3)
    s = np.clip((time - 0.08) / 0.7, 0.0, 1.0)
    s = s * s * (3 - 2 * s)
    pitch, down = np.radians(-16 + 38 * s), np.sin(np.pi * np.clip(time / 0.9, 0.0, 1.0)) ** 2
    turns = np.column_stack([lateral * np.sin(2 * np.pi * time), pitch, lateral * np.sin(3 * np.pi * time)])
    wheel, leg = 0.30, p.sole_below_knee - 0.30
    x, z = wheel * pitch + leg * np.sin(pitch), wheel + leg * np.cos(pitch) + 0.05 - 0.065 * down
    return time, Rotation.from_euler("zxy", turns[:, [2, 0, 1]]).as_matrix(), np.column_stack([x, 0 * x, z])


def low_passed(force: np.ndarray) -> np.ndarray:
    return filtfilt(*butter(4, 40.0, fs=1000.0), force, axis=0)


def work_on(p: prosthesis.Prosthesis, time: np.ndarray, R: np.ndarray, x: np.ndarray, load: np.ndarray) -> float:
    """Work (J) of the shank on the prosthesis, from the load that the prosthesis reports."""
    end = x - p.residual_length * R[:, :, 2]
    force = np.einsum("nij,nj->ni", R, load[:, :3])
    moment = np.einsum("nij,nj->ni", R, load[:, 3:])
    turn = (Rotation.from_matrix(R[1:]) * Rotation.from_matrix(R[:-1]).inv()).as_rotvec()
    mean = [0.5 * (a[1:] + a[:-1]) for a in (force, moment)]
    return -float(np.sum(mean[0] * np.diff(end, axis=0)) + np.sum(mean[1] * turn))


def test_hangs_in_the_socket_with_its_weight():
    p = made()
    p.reset(UPRIGHT, knee(p, -0.1))
    assert p.mass_kg == pytest.approx(0.8 + 0.4 + 0.649)
    np.testing.assert_allclose(p.socket_load[:3], [0.0, 0.0, -p.mass_kg * GRAVITY], atol=1e-4)
    np.testing.assert_array_equal(p.force, 0.0)
    assert np.isnan(p.cop).all()


@pytest.mark.parametrize("lean", [(0.0, 0.0, 0.0), (0.05, 0.1, 0.2), (-0.04, -0.2, 0.0)])
def test_standing_still_forces_and_moments_balance(lean):
    p = made()
    R = Rotation.from_euler("xyz", lean).as_matrix()
    x = R @ knee(p, 0.02)
    p.reset(R, x)
    assert p.force[2] > 200.0
    masses = np.concatenate([p.device.masses, p.device.node_masses])
    weights = np.outer(masses, [0.0, 0.0, -GRAVITY])
    on_prosthesis, moment = -R @ p.socket_load[:3], -R @ p.socket_load[3:]
    np.testing.assert_allclose(p.force + on_prosthesis + weights.sum(axis=0), 0.0, atol=1e-3 * WEIGHT_N)
    free = p.free_moment * np.array([0.0, 0.0, 1.0])
    end = x - p.residual_length * R[:, 2]
    total = (np.cross(p.cop, p.force) + free + np.cross(end, on_prosthesis) + moment
             + np.cross(p.state.mass_x, weights).sum(axis=0))
    np.testing.assert_allclose(total, 0.0, atol=0.1)


def test_standing_on_the_toe_the_keel_is_where_its_energy_is_stationary():
    """Second method: virtual work of ground and weight against the energy of hinges and fulcrum, by differences."""
    p = made(0.066)
    R = Rotation.from_euler("y", 0.35).as_matrix()
    toe = 0.15
    p.reset(R, R @ knee(p, 0.0) + [0.0, 0.0, toe * np.sin(0.35) - 0.03])
    d, state, ground = p.device, copy.deepcopy(p.state), p._forces.copy()
    assert p.force[2] > 100.0 and p.cop[0] > 0.05

    def energy(q: np.ndarray) -> float:
        state.q[:] = q
        p._place(state)
        angles = np.cumsum(q)
        x = d.anchor[0] + np.concatenate(([0.0], np.cumsum(d.lengths * np.cos(angles))))
        z = np.concatenate(([0.0], np.cumsum(d.lengths * np.sin(angles))))
        gap = np.interp(d.anchor[0] + d.fulcrum, x, z)
        nodes = state.mass_x[len(d.masses):, 2]
        return float(0.5 * np.sum(d.hinge_stiffness * q**2) + 0.5 * d.fulcrum_stiffness * gap**2
                     + GRAVITY * np.sum(d.node_masses * nodes) - np.sum(ground * state.cell_x))

    q, e = p.state.q.copy(), 1e-6
    slopes = [(energy(q + e * row) - energy(q - e * row)) / (2 * e) for row in np.eye(len(q))]
    assert np.max(np.abs(d.hinge_stiffness * q)) > 10.0
    np.testing.assert_allclose(slopes, 0.0, atol=0.01)


def test_a_fulcrum_out_of_reach_and_a_foot_elsewhere_are_refused():
    with pytest.raises(ValueError, match="fulcrum reaches"):
        prosthesis.Prosthesis(SUBJECT, 0.2)
    with pytest.raises(ValueError, match="standard place"):
        prosthesis.Prosthesis(dataclasses.replace(SUBJECT, prosthesis_toe_out_rad=0.1), 0.108)


def test_a_path_in_the_plane_of_symmetry_gives_no_lateral_force():
    p = made()
    reaction = p.walk(*roll_over(p))
    assert reaction.unconverged == 0
    assert 300.0 < reaction.force[:, 2].max() < 3 * WEIGHT_N
    assert np.abs(reaction.force[:, 1]).max() < 1e-6
    assert np.nanmax(np.abs(reaction.cop[:, 1])) < 1e-8
    assert np.nanmax(np.abs(reaction.free_moment)) < 1e-6


def test_ground_knows_no_direction():
    p = made()
    time, R, x = roll_over(p, lateral=0.05)
    turn, shift = Rotation.from_euler("z", 0.7).as_matrix(), np.array([3.0, -2.0, 0.0])
    here, there = p.walk(time, R, x), p.walk(time, turn @ R, x @ turn.T + shift)
    np.testing.assert_allclose(there.force, here.force @ turn.T, atol=0.01)
    heavy = here.force[:, 2] > 50.0
    np.testing.assert_allclose(there.cop[heavy], (here.cop @ turn.T + shift)[heavy], atol=1e-5)


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.151])
def test_half_the_step_changes_the_force_by_less_than_a_five_hundredth_of_body_weight(fulcrum_m):
    motion = roll_over(made(), lateral=0.05)
    coarse, fine = (made(fulcrum_m, step_s=h).walk(*motion) for h in (5e-4, 2.5e-4))
    assert coarse.unconverged == fine.unconverged == 0
    assert np.abs(low_passed(coarse.force) - low_passed(fine.force)).max() < 2e-3 * WEIGHT_N


def test_step_by_step_is_the_same_walk():
    p = made(step_s=1e-3)
    time, R, x = roll_over(p)
    time, R, x = time[:400], R[:400], x[:400]
    whole = p.walk(time, R, x)
    p.reset(R[0], x[0], velocity=(x[1] - x[0]) / 1e-3)
    single = np.array([p.force] + [p.step(R[i], x[i])[0] for i in range(1, len(time))])
    np.testing.assert_allclose(single, whole.force, atol=0.02)


@pytest.mark.parametrize("lateral", [0.0, 0.03, -0.08])
def test_takes_energy_from_the_walker_and_never_gives_any(lateral):
    p = made()
    time, R, x = roll_over(p, lateral)
    time, R, x = np.concatenate([time, time[-1] + 1e-3 + time]), np.concatenate([R, R[::-1]]), np.vstack([x, x[::-1]])
    load = p.walk(time, R, x).socket_load
    work = [work_on(p, time[:n], R[:n], x[:n], load[:n]) for n in range(10, len(time) + 1, 10)]
    moving = 0.5 * p.mass_kg * 1.0**2  # J that the prosthesis brings along at no more than 1 m/s
    assert min(work) > -moving
    assert 1.0 < work[-1] < (5.0 if lateral == 0.0 else 40.0)


@pytest.mark.parametrize("seed", range(4))
def test_rough_treatment_is_survived(seed):
    p, random = made(), np.random.default_rng(seed)
    time = np.arange(0.0, 0.6, 1e-3)
    wave = random.normal(size=(6, 3, 1)) * np.sin(
        2 * np.pi * random.uniform(1.0, 4.0, size=(6, 3, 1)) * time + random.uniform(0, 6, size=(6, 3, 1)))
    turns, shifts = 0.1 * wave[:3].sum(axis=1), 0.008 * wave[3:].sum(axis=1)
    R = Rotation.from_rotvec(turns.T).as_matrix()
    reaction = p.walk(time, R, (R @ knee(p, 0.01)) + shifts.T)
    assert reaction.unconverged == 0
    assert np.isfinite(reaction.force).all()
    assert reaction.force[:, 2].min() >= 0.0
    assert reaction.force[:, 2].max() > WEIGHT_N
    friction = np.linalg.norm(reaction.force[:, :2], axis=1)
    assert (friction <= Design().sole.friction * reaction.force[:, 2] + 1e-6).all()


def test_without_damping_and_sliding_a_slow_press_gives_its_work_back():
    keel = dataclasses.replace(KeelDesign(), damping_time_s=0.0, fulcrum_damping_time_s=0.0)
    socket = dataclasses.replace(
        Design().socket, axial_damping_n_s_per_m=0.0, shear_damping_n_s_per_m=0.0, bending_damping_nm_s=0.0,
        twist_damping_nm_s=0.0)
    design = Design(keel=keel, sole=dataclasses.replace(Design().sole, **FIRM), socket=socket)
    p = prosthesis.Prosthesis(SUBJECT, 0.066, design=design)
    time = np.arange(0.0, 4.0 + 1e-9, 1e-3)
    press = 0.06 * np.sin(np.pi * time / 4.0) ** 2
    R = np.tile(Rotation.from_euler("y", 0.3).as_matrix(), (len(time), 1, 1))
    x = (R[0] @ knee(p, 0.0)) + np.outer(0.04 - press, [0.0, 0.0, 1.0])
    load = p.walk(time, R, x).socket_load
    half = len(time) // 2
    stored = work_on(p, time[:half], R[:half], x[:half], load[:half])
    assert stored > 5.0
    assert work_on(p, time, R, x, load) == pytest.approx(0.0, abs=0.02 * stored)


def test_friction_holds_without_creep():
    p = made()
    time = np.arange(0.0, 4.0, 2e-3)
    press, push = np.clip(time / 0.4, 0, 1), np.clip((time - 0.5) / 0.4, 0, 1)
    x = knee(p, 0.0) + np.outer(-0.015 * press, [0, 0, 1]) + np.outer(0.004 * push, [1, 0.5, 0])
    reaction = p.walk(time, np.tile(UPRIGHT, (len(time), 1, 1)), x)
    held = time > 1.5
    tangential = np.linalg.norm(reaction.force[held, :2], axis=1)
    assert 20.0 < tangential[0] < 0.5 * Design().sole.friction * reaction.force[held][0, 2]
    assert np.ptp(tangential) < 0.01
    assert np.ptp(reaction.cop[held], axis=0).max() < 1e-6
    assert reaction.slip_speed[held].max() < 1e-6


def test_a_dragged_foot_is_held_back_by_coulombs_force():
    p = made()
    time = np.arange(0.0, 1.0, 1e-3)
    x = knee(p, 0.012) + np.outer(0.2 * time, [0, 1, 0])
    reaction = p.walk(time, np.tile(UPRIGHT, (len(time), 1, 1)), x)
    late = time > 0.6
    ratio = np.linalg.norm(reaction.force[:, :2], axis=1) / reaction.force[:, 2]
    np.testing.assert_allclose(ratio[late], Design().sole.friction, rtol=1e-3)
    np.testing.assert_allclose(reaction.slip_speed[late], 0.2, rtol=0.02)
    assert (reaction.force[late, 1] < 0.0).all()


def test_it_is_finer_than_the_model_and_sits_where_the_model_does():
    p, foot = made(), FootParameters()
    assert len(make_keel(KeelDesign(), 0.229).lengths) >= 30
    assert len(p.device.bodies) >= 150
    state = device.new_state(p.device)
    state.p[2] = -p.residual_length
    p._place(state)
    assert state.cell_x[:, 2].min() == pytest.approx(-p.sole_below_knee, abs=2e-5)
    assert p.sole_below_knee == pytest.approx(p.residual_length + p.pylon_length + foot.build_height_m)
    assert state.cell_x[:, 0].min() < -foot.pylon_x_m < state.cell_x[:, 0].max() - 0.2


def test_shares_no_law_and_no_stepper_with_the_model():
    folder = Path(prosthesis.__file__).parent
    for name in ("assembly", "bench", "design", "device", "dynamics", "keel", "laws", "prosthesis", "sole", "stepping"):
        tree = ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        modules |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        ours = {module for module in modules if module.startswith("vsf_drake")}
        assert ours <= {"vsf_drake.parameters", "vsf_drake.plants.anthropometry"}, name
