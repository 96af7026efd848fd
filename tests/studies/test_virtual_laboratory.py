"""The virtual laboratory: its foot meets beam theory, statics and the published bench, is passive
and converges."""

from __future__ import annotations

import ast
import copy
import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from make_reference_subject import DATA, SEED
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation
from virtual_laboratory import bench, bench_truth, laws, prosthesis
from virtual_laboratory import floor as floors
from virtual_laboratory.assembly import add_fulcrum
from virtual_laboratory.bench import LOADS_N
from virtual_laboratory.design import (
    Design,
    FrameDesign,
    KeelDesign,
    SupportDesign,
    in_shell,
    longer,
)
from virtual_laboratory.dynamics import chain
from virtual_laboratory.motion import COORDINATES, DEVICE, SHANK, Person
from virtual_laboratory.people import person_in_shell, true_persons
from virtual_laboratory.prosthesis import prosthesis_of
from virtual_laboratory.sole import UNSUPPORTED, make_sole
from virtual_laboratory.tiers import PLATE_N, TRIAL_DEG, TRIAL_M

from vsf_drake.model.bench_curves import load_bench_curves, load_bench_file
from vsf_drake.model.parameters import (
    GRAVITY,
    PELVIS_TRANSLATIONS,
    FootParameters,
    SocketParameters,
    Subject,
)
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import default_model, load_trial
from vsf_drake.plants.anthropometry import scale_body

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


@pytest.mark.slow
def test_the_bench_files_come_out_again_and_hold_what_the_foot_that_walked_shows_on_the_bench(
    tmp_path,
):
    curves, read = (
        load_bench_curves(DATA / "bench_curves.csv").curves,
        load_bench_file(DATA / "bench.yaml"),
    )
    assert read.synthetic and "SYNTHETIC" in read.name and read.max_load_n == LOADS_N[1]
    heel = bench.heel_stiffness(Design())
    for x, k, curve in zip(read.fulcrum_m, read.stiffness_n_per_m, curves[:-1], strict=True):
        forefoot = bench.forefoot_stiffness(Design(), x)
        for one, stiffness in ((curve, forefoot), (curves[-1], heel)):
            low, high = np.interp([200.0, 600.0], one.load_n, one.displacement_m)
            assert 400.0 / (high - low) == pytest.approx(stiffness, rel=5e-5)
        assert curve.fulcrum_m == x and k == pytest.approx(forefoot, abs=0.6)
        assert read.heel_stiffness_n_per_m == pytest.approx(heel, abs=0.6)
    again = bench_truth.write_bench_curves(tmp_path / "made").read_text(encoding="utf-8")
    assert again == (DATA / "bench_curves.csv").read_text(encoding="utf-8")
    assert load_bench_file(bench_truth.write_bench(tmp_path / "made")) == read


# Its bench and its laws.


UNIFORM = dataclasses.replace(KeelDesign(), thickness_tip_m=6.6e-3, width_tip_m=0.0684)
BENDING = UNIFORM.modulus_pa * UNIFORM.width_rear_m * UNIFORM.thickness_rear_m**3 / 12
RIGID = SupportDesign(stiffness_n_per_m=1e11)
LOAD_POINT = FrameDesign().load_point_m


def keel_stiffness(design: Design, fulcrum_m: float | None, load_n: float = 1.0) -> float:
    """Load / height (N/m) of the keel alone at the load point."""
    d, point = bench.bench_device(design, fulcrum_m), design.frame.load_point_m
    [q] = bench.keel_under_load(d, point, np.array([load_n]))
    return load_n / bench.point_height(d, np.cumsum(q), point)


@pytest.mark.parametrize("scale", [1.0, 1.1])
@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_uniform_keel_is_the_overhung_beam_also_in_another_size(fulcrum_m, scale):
    """A longer keel on the same carriage: 3 E I / (a^2 L) with the load point at scale L."""
    found = keel_stiffness(longer(Design(keel=UNIFORM, support=RIGID), scale), fulcrum_m)
    point = scale * LOAD_POINT
    assert found == pytest.approx(3 * BENDING / ((point - fulcrum_m) ** 2 * point), rel=0.01)


@pytest.mark.parametrize(("clamp", "share"), [(1e-3, 0.0), (1e9, 1.0)])
def test_a_soft_clamp_makes_the_pinned_beam_and_a_stiff_one_the_built_in_beam(clamp, share):
    """Deflection under an overhung load, F a^2 (l + a) / (3 E I) pinned; a built-in end turns the
    beam at its support by F a l / (4 E I) instead of F a l / (3 E I), l its span."""
    keel = dataclasses.replace(UNIFORM, clamp_nm_per_rad=clamp)
    span, over = 0.108, LOAD_POINT - 0.108
    deflection = over**2 * (span + over) / (3 * BENDING) - share * over**2 * span / (12 * BENDING)
    assert 1.0 / keel_stiffness(Design(keel=keel, support=RIGID), span) == pytest.approx(
        deflection, rel=0.01
    )


def test_a_keel_without_fulcrum_is_a_cantilever_and_a_play_lets_it_be_one_until_it_touches():
    """F L^3 / (3 E I) and a hinge's F L^2 / c at A; at a fulcrum l it rises F l^2 (3 L - l) / (6 E
    I) + F L l / c."""
    clamp, span, L = 80.0, 0.108, LOAD_POINT
    keel = dataclasses.replace(UNIFORM, clamp_nm_per_rad=clamp)
    cantilever = L**3 / (3 * BENDING) + L**2 / clamp
    assert 1.0 / keel_stiffness(Design(keel=keel, support=None), None) == pytest.approx(
        cantilever, rel=0.01
    )
    touches_n = 1e-3 / (span**2 * (3 * L - span) / (6 * BENDING) + L * span / clamp)
    with_play = Design(keel=keel, support=dataclasses.replace(RIGID, one_sided=True, play_m=1e-3))
    assert 1.0 / keel_stiffness(with_play, span, 0.95 * touches_n) == pytest.approx(
        cantilever, rel=0.01
    )
    assert keel_stiffness(with_play, span, 1.3 * touches_n) > 1.1 / cantilever


def test_work_on_the_bent_keel_is_the_energy_in_its_hinges_and_fulcrum():
    d = bench.bench_device(Design(), 0.066)
    loads = np.linspace(0.0, 800.0, 201)
    q = bench.keel_under_load(d, 0.199, loads)
    heights = np.array([bench.point_height(d, np.cumsum(row), 0.199) for row in q])
    work = float(np.sum(0.5 * (loads[1:] + loads[:-1]) * np.diff(heights)))
    # the fulcrum's gap follows from moments about A, taken on the bent keel: the roller pushes
    # along its normal
    angles = np.cumsum(q[-1])
    x = np.concatenate(([0.0], np.cumsum(d.lengths * np.cos(angles))))
    z = np.concatenate(([0.0], np.cumsum(d.lengths * np.sin(angles))))
    gap = np.interp(d.fulcrum, x, z)
    energy = 0.5 * np.sum(d.hinge_stiffness * q[-1] ** 2) + 0.5 * d.fulcrum_stiffness * gap**2
    assert heights[-1] > 0.05
    assert work == pytest.approx(energy, rel=2e-3)


def test_bench_meets_the_published_stiffness_and_tuning_finds_the_recorded_constants():
    """Between the ends: the joints that the authors of the public model tuned, a cantilever from
    the fulcrum on with a spring of 62.8 N/mm in series."""
    for x, k in {0.066: 10e3, 0.151: 32e3}.items():
        assert bench.forefoot_stiffness(Design(), x) == pytest.approx(k, rel=1e-3)
    for mm in (87, 108, 129):
        joint = np.degrees(13.839 - 0.0677 * mm)
        arms = 0.199 - np.arange(1e-3 * mm, 0.199, 0.021)
        tuned_by_the_authors = 1.0 / (np.sum(arms**2) / joint + 1.0 / 62.8e3)
        assert bench.forefoot_stiffness(Design(), 1e-3 * mm) == pytest.approx(
            tuned_by_the_authors, abs=0.8e3
        )
    assert bench.heel_stiffness(Design()) == pytest.approx(65e3, rel=1e-3)
    d = bench.bench_device(Design(), 0.066)
    [q] = bench.keel_under_load(d, LOAD_POINT, np.array([600.0]))
    assert 0.0 < bench.point_height(d, np.cumsum(q), d.fulcrum) < 1e-3
    found = bench.tuned(Design(keel=dataclasses.replace(KeelDesign(), modulus_pa=9e9)))
    for part, name in (
        ("keel", "modulus_pa"),
        ("sole", "foam_modulus_pa"),
        ("sole", "heel_modulus_pa"),
    ):
        recorded = getattr(getattr(Design(), part), name)
        assert getattr(getattr(found, part), name) == pytest.approx(recorded, rel=1e-3), name


@pytest.mark.slow
def test_a_tested_specimen_keeps_its_stiffness_but_for_the_errors_of_a_test(tmp_path):
    folder = bench_truth.write_bench(tmp_path, seed=3).parent
    read = load_bench_file(folder / "bench.yaml")
    curves = load_bench_curves(bench_truth.write_bench_curves(folder, seed=3)).curves
    assert len(curves) == 1 + len(read.fulcrum_m)
    errors = [
        k / bench.forefoot_stiffness(Design(), x) - 1.0
        for x, k in zip(read.fulcrum_m, read.stiffness_n_per_m, strict=True)
    ]
    assert 1e-3 < np.abs(errors).max() < 4 * bench_truth.TRAVEL_SD
    assert np.ptp(errors) > 1e-3


@pytest.mark.parametrize("depth", [5e-3, 0.019, 0.03])
def test_foam_force_and_slope_belong_together(depth):
    force, slope = laws.foam(depth, 700.0, 0.024)
    around = [laws.foam(depth + e, 700.0, 0.024)[0] for e in (-1e-7, 1e-7)]
    assert slope == pytest.approx((around[1] - around[0]) / 2e-7, rel=1e-4)
    assert force >= 700.0 * depth


# Its prosthesis under a walker.


WEIGHT_N = SUBJECT.mass_kg * GRAVITY
UPRIGHT = np.eye(3)
FIRM = {"hysteresis_s_per_m": 0.0, "friction": 50.0}


def virtual_foot(
    fulcrum_m: float = 0.108, *, step_s: float = 5e-4, **sole: float
) -> prosthesis.Prosthesis:
    design = Design(sole=dataclasses.replace(Design().sole, **sole))
    return prosthesis_of(SUBJECT, fulcrum_m, design=design, step_s=step_s)


def knee(p: prosthesis.Prosthesis, pressed_m: float) -> np.ndarray:
    return np.array([0.0, 0.0, p.sole_below_knee - pressed_m])


def roll_over(
    p: prosthesis.Prosthesis, lateral: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth step: from the air over heel and toe and off again, leaning and turning by `lateral`
    (rad)."""
    time = np.arange(0.0, 0.9 + 1e-9, 1e-3)
    s = np.clip((time - 0.08) / 0.7, 0.0, 1.0)
    s = s * s * (3 - 2 * s)
    pitch, down = np.radians(-16 + 38 * s), np.sin(np.pi * np.clip(time / 0.9, 0.0, 1.0)) ** 2
    turns = np.column_stack(
        [lateral * np.sin(2 * np.pi * time), pitch, lateral * np.sin(3 * np.pi * time)]
    )
    wheel, leg = 0.30, p.sole_below_knee - 0.30
    x, z = wheel * pitch + leg * np.sin(pitch), wheel + leg * np.cos(pitch) + 0.05 - 0.065 * down
    return (
        time,
        Rotation.from_euler("zxy", turns[:, [2, 0, 1]]).as_matrix(),
        np.column_stack([x, 0 * x, z]),
    )


def low_passed(force: np.ndarray) -> np.ndarray:
    return filtfilt(*butter(4, 40.0, fs=1000.0), force, axis=0)


def work_on(
    p: prosthesis.Prosthesis, time: np.ndarray, R: np.ndarray, x: np.ndarray, load: np.ndarray
) -> float:
    """Work (J) of the shank on the prosthesis, from the load that the prosthesis reports."""
    end = x - p.residual_length * R[:, :, 2]
    force = np.einsum("nij,nj->ni", R, load[:, :3])
    moment = np.einsum("nij,nj->ni", R, load[:, 3:])
    turn = (Rotation.from_matrix(R[1:]) * Rotation.from_matrix(R[:-1]).inv()).as_rotvec()
    mean = [0.5 * (a[1:] + a[:-1]) for a in (force, moment)]
    return -float(np.sum(mean[0] * np.diff(end, axis=0)) + np.sum(mean[1] * turn))


@pytest.mark.slow
@pytest.mark.parametrize("lean", [(0.0, 0.0, 0.0), (0.05, 0.1, 0.2), (-0.04, -0.2, 0.0)])
def test_standing_still_forces_and_moments_balance(lean):
    p = virtual_foot()
    R = Rotation.from_euler("xyz", lean).as_matrix()
    x = R @ knee(p, 0.02)
    p.reset(R, x)
    assert p.force[2] > 200.0
    masses = np.concatenate([p.device.masses, p.device.node_masses])
    weights = np.outer(masses, [0.0, 0.0, -GRAVITY])
    on_prosthesis, moment = -R @ p.socket_load[:3], -R @ p.socket_load[3:]
    np.testing.assert_allclose(
        p.force + on_prosthesis + weights.sum(axis=0), 0.0, atol=1e-3 * WEIGHT_N
    )
    free = p.free_moment * np.array([0.0, 0.0, 1.0])
    end = x - p.residual_length * R[:, 2]
    total = (
        np.cross(p.cop, p.force)
        + free
        + np.cross(end, on_prosthesis)
        + moment
        + np.cross(p.state.mass_x, weights).sum(axis=0)
    )
    np.testing.assert_allclose(total, 0.0, atol=0.1)


HINGED = dataclasses.replace(KeelDesign(), twists=6, clamp_nm_per_rad=150.0)
OTHER = Design(keel=HINGED, support=SupportDesign(one_sided=True, play_m=2e-4))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("design", "fulcrum_m"),
    [
        (Design(), 0.066),
        (OTHER, 0.1),
        (Design(keel=dataclasses.replace(HINGED, modulus_pa=4e10), support=None), None),
    ],
)
def test_standing_on_the_toe_the_keel_is_where_its_energy_is_stationary(design, fulcrum_m):
    """Second method: virtual work of ground and weight against the energy of hinges and roller, by
    differences."""
    p = prosthesis_of(SUBJECT, fulcrum_m, design=design)
    R = Rotation.from_euler("xyz", [0.1, 0.35, 0.0]).as_matrix()
    toe = 0.15
    p.reset(R, R @ knee(p, 0.0) + [0.0, 0.0, toe * np.sin(0.35) - 0.03])
    d, state, ground = p.device, copy.deepcopy(p.state), p._forces.copy()
    assert p.force[2] > 100.0 and p.cop[0] > 0.05
    stiffness = np.concatenate([d.hinge_stiffness, d.twist_stiffness])

    def energy(q: np.ndarray) -> float:
        state.q[:] = q
        p._place(state)
        beyond = np.zeros(2)
        parts = np.empty((37, 3)), np.empty((36, 3, 3)), np.empty((len(q), 3))
        chain(d, q, *parts)
        add_fulcrum(
            d,
            state,
            *parts,
            np.inf,
            np.zeros(6 + len(q)),
            np.zeros((6 + len(q), 6 + len(q))),
            beyond,
        )
        pressed = np.maximum(beyond, 0.0) if d.fulcrum_one_sided else beyond
        nodes = state.mass_x[len(d.masses) :, 2]
        return float(
            0.5 * np.sum(stiffness * q**2)
            + 0.25 * d.fulcrum_stiffness * np.sum(pressed**2)
            + GRAVITY * np.sum(d.node_masses * nodes)
            - np.sum(ground * state.cell_x)
        )

    q, e = p.state.q.copy(), 1e-6
    slopes = [(energy(q + e * row) - energy(q - e * row)) / (2 * e) for row in np.eye(len(q))]
    assert np.max(np.abs(stiffness * q)) > 10.0
    np.testing.assert_allclose(slopes, 0.0, atol=0.01)


@pytest.mark.slow
def test_a_keel_loaded_on_its_edge_twists_by_its_torque_over_its_torsional_stiffness():
    """Saint-Venant: the integral of T / (G J), J = b h^3 (1/3 - 0.21 h / b) of a flat rectangle, T
    of the ground; of a keel that does not bend."""
    keel = dataclasses.replace(UNIFORM, twists=18, clamp_nm_per_rad=1e7, modulus_pa=1e12)
    p = prosthesis_of(SUBJECT, None, design=Design(keel=keel, support=None))
    R = Rotation.from_euler("xyz", [0.25, 0.3, 0.0]).as_matrix()
    p.reset(R, R @ knee(p, 0.0) + [0.0, 0.0, 0.15 * np.sin(0.3) - 0.04])
    x, y, z = ((p.state.cell_x - p.state.p) @ p.state.R - p.device.anchor).T
    f = p._forces @ p.state.R
    torque = y * f[:, 2] - z * f[:, 1]  # about the straight keel
    b, h = keel.width_rear_m, keel.thickness_rear_m
    on_keel = p.device.bodies > 0
    twist = np.sum((torque * x)[on_keel]) / (
        keel.shear_modulus_pa * b * h**3 * (1 / 3 - 0.21 * h / b)
    )
    assert abs(twist) > 5e-3
    assert np.sum(p.state.q[36:]) == pytest.approx(twist, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("one_sided", [True, False])
def test_a_one_sided_support_does_not_hold_up_a_keel_that_hangs(one_sided):
    """Its own weight w a length bends it by w L^4 / (8 E I) and its clamp by w L^3 / (2 c); a
    roller holds it up."""
    sole = dataclasses.replace(Design().sole, rear_m=-0.012)
    keel = dataclasses.replace(UNIFORM, clamp_nm_per_rad=150.0)
    p = prosthesis_of(
        SUBJECT,
        0.15,
        design=Design(keel=keel, support=SupportDesign(one_sided=one_sided), sole=sole),
    )
    p.reset(UPRIGHT, knee(p, -0.1))
    tip = np.sum(p.device.lengths * np.sin(np.cumsum(p.state.q[:36])))
    weight = keel.density_kg_m3 * keel.width_rear_m * keel.thickness_rear_m * GRAVITY
    hanging = (
        weight
        * keel.length_m**3
        * (keel.length_m / (8 * BENDING) + 1 / (2 * keel.clamp_nm_per_rad))
    )
    if one_sided:
        assert tip == pytest.approx(-hanging, rel=0.02)
    else:
        assert abs(tip) < 0.2 * hanging


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 2])
def test_momentum_changes_by_ground_limb_and_weight(every):
    """As exactly as the steps are solved (1e-9 m, 1e5 N/m), whatever steps lie in between; of
    angular momentum but for the step times m a x v."""
    placed = dataclasses.replace(SUBJECT, prosthesis_inversion_rad=0.05, prosthesis_toe_out_rad=0.1)
    p = prosthesis_of(placed, 0.1, design=OTHER, step_s=1e-3 / every)
    time, R, x = roll_over(p, lateral=0.05)
    r = p.walk(time, R, x)
    assert r.unconverged == 0 and r.force[:, 2].max() > 300.0
    np.testing.assert_allclose(
        np.diff(r.com, axis=0) / 1e-3 * r.mass_kg,
        r.linear_momentum[1:],
        atol=1e-9 if every == 1 else 0.1,
    )
    on_device = -np.einsum("nij,nj->ni", R, r.socket_load[:, :3])
    weight = np.array([0.0, 0.0, -GRAVITY * r.mass_kg])
    change = np.diff(r.linear_momentum, axis=0) / 1e-3
    np.testing.assert_allclose(change, (r.force + on_device + weight)[1:], atol=1e-4)
    end = x - p.residual_length * R[:, :, 2]
    moment = (
        np.cross(np.nan_to_num(r.cop), r.force)
        + np.outer(np.nan_to_num(r.free_moment), [0.0, 0.0, 1.0])
        + np.cross(end, on_device)
        - np.einsum("nij,nj->ni", R, r.socket_load[:, 3:])
        + np.cross(r.com, weight)
    )
    loaded = np.isfinite(r.free_moment[1:]) | (r.force[1:, 2] == 0.0)
    missing = np.diff(r.angular_momentum, axis=0) / 1e-3 - moment[1:]
    assert np.abs(missing[loaded]).max() < 0.2 / every


@pytest.mark.slow
def test_the_foot_sits_where_the_model_has_it():
    """Against the model's own plant: the keel's end A and the keel's axes, for a foot that is
    placed askew."""
    askew = dataclasses.replace(
        SUBJECT,
        prosthesis_fore_aft_m=0.012,
        prosthesis_lateral_m=0.007,
        prosthesis_alignment_rad=0.06,
        prosthesis_inversion_rad=-0.04,
        prosthesis_toe_out_rad=0.15,
        prosthesis_length_m=0.53,
    )
    R_WB, p_WB = Person(askew, default_model()).leg_poses(np.zeros((1, len(COORDINATES))))
    p = prosthesis_of(askew, 0.108)
    p.reset(R_WB[0, SHANK], p_WB[0, SHANK] + [0.0, 0.0, 2.0])
    thinner, d = 0.5 * (KeelDesign().thickness_rear_m - FootParameters().keel.thickness_m), p.device
    assert p.force[2] == 0.0
    rest = R_WB[0, SHANK] @ (d.R_EP @ d.anchor - [0.0, 0.0, p.residual_length]) + p_WB[0, SHANK]
    np.testing.assert_allclose(R_WB[0, SHANK] @ d.R_EP, R_WB[0, DEVICE], atol=1e-12)
    np.testing.assert_allclose(rest - thinner * R_WB[0, DEVICE, :, 2], p_WB[0, DEVICE], atol=1e-9)
    # in the air, but for what its weight leans it
    np.testing.assert_allclose(p.state.R, R_WB[0, DEVICE], atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("length_m", [0.22, 0.27, 0.30])
def test_a_shell_of_another_length_is_worn_over_the_same_device_by_the_same_person(length_m):
    own, other = person_in_shell(SEED, 0.245), person_in_shell(SEED, length_m)
    assert (own.subject, own.residual_length_m) == (other.subject, other.residual_length_m)
    assert (own.foot.keel, own.foot.support, own.foot.socket) == (
        other.foot.keel,
        other.foot.support,
        other.foot.socket,
    )
    sole = other.foot.sole
    assert sole.front_m - sole.rear_m == pytest.approx(length_m)
    for mm in (66, 108, 151):
        keel = [
            bench.keel_under_load(bench.bench_device(foot, 1e-3 * mm), 0.199, np.array([600.0]))
            for foot in (own.foot, other.foot)
        ]
        np.testing.assert_array_equal(*keel)
    mass_kg = [person.prosthesis(0.108).mass_kg for person in (own, other)]
    assert np.sign(mass_kg[1] - mass_kg[0]) == np.sign(length_m - 0.245)


def test_foam_that_no_keel_bears_is_softer_by_a_stated_share():
    def cells(design):
        sole = make_sole(design, sole_height=0.0, foam_thickness=0.03, block_until=0.066)
        return sole.points[:, 0], sole.stiffness

    design = in_shell(Design(), 0.30).sole
    x, unsupported = cells(design)
    _, supported = cells(dataclasses.replace(design, unsupported_from_m=np.inf))
    ahead = x > Design().keel.length_m
    assert ahead.any()
    np.testing.assert_allclose(unsupported[ahead], UNSUPPORTED * supported[ahead])
    np.testing.assert_array_equal(unsupported[~ahead], supported[~ahead])


def test_a_fulcrum_out_of_reach_and_a_keel_that_nothing_holds_are_refused():
    with pytest.raises(ValueError, match="fulcrum reaches"):
        prosthesis_of(SUBJECT, 0.2)
    with pytest.raises(ValueError, match="takes None"):
        prosthesis_of(SUBJECT, None)
    with pytest.raises(ValueError, match="falls off"):
        prosthesis_of(SUBJECT, 0.1, design=Design(support=SupportDesign(one_sided=True)))


@pytest.mark.slow
def test_ground_knows_no_direction_and_a_path_in_the_plane_of_symmetry_gives_no_lateral_force():
    p = virtual_foot()
    straight = p.walk(*roll_over(p))
    assert straight.unconverged == 0 and 300.0 < straight.force[:, 2].max() < 3 * WEIGHT_N
    assert np.abs(straight.force[:, 1]).max() < 1e-6
    assert (
        np.nanmax(np.abs(straight.cop[:, 1])) < 1e-8
        and np.nanmax(np.abs(straight.free_moment)) < 1e-6
    )
    time, R, x = roll_over(p, lateral=0.05)
    turn, shift = Rotation.from_euler("z", 0.7).as_matrix(), np.array([3.0, -2.0, 0.0])
    here, there = p.walk(time, R, x), p.walk(time, turn @ R, x @ turn.T + shift)
    np.testing.assert_allclose(there.force, here.force @ turn.T, atol=0.01)
    heavy = here.force[:, 2] > 50.0
    np.testing.assert_allclose(there.cop[heavy], (here.cop @ turn.T + shift)[heavy], atol=1e-5)


@pytest.mark.slow
def test_half_the_step_changes_the_force_by_less_than_a_five_hundredth_of_body_weight():
    motion = roll_over(virtual_foot(), lateral=0.05)
    coarse, fine = (virtual_foot(0.066, step_s=h).walk(*motion) for h in (5e-4, 2.5e-4))
    assert coarse.unconverged == fine.unconverged == 0
    assert np.abs(low_passed(coarse.force) - low_passed(fine.force)).max() < 2e-3 * WEIGHT_N


@pytest.mark.slow
@pytest.mark.parametrize("lateral", [0.0, -0.08])
def test_takes_energy_from_the_walker_and_never_gives_any(lateral):
    p = virtual_foot()
    time, R, x = roll_over(p, lateral)
    time, R, x = (
        np.concatenate([time, time[-1] + 1e-3 + time]),
        np.concatenate([R, R[::-1]]),
        np.vstack([x, x[::-1]]),
    )
    load = p.walk(time, R, x).socket_load
    work = [work_on(p, time[:n], R[:n], x[:n], load[:n]) for n in range(10, len(time) + 1, 10)]
    moving = 0.5 * p.mass_kg * 1.0**2  # J that the prosthesis brings along at no more than 1 m/s
    assert min(work) > -moving
    assert 1.0 < work[-1] < (5.0 if lateral == 0.0 else 40.0)


@pytest.mark.slow
def test_without_damping_and_sliding_a_slow_press_gives_its_work_back():
    keel = dataclasses.replace(KeelDesign(), damping_time_s=0.0)
    socket = dataclasses.replace(
        Design().socket,
        axial_damping_n_s_per_m=0.0,
        shear_damping_n_s_per_m=0.0,
        bending_damping_nm_s=0.0,
        twist_damping_nm_s=0.0,
    )
    design = Design(
        keel=keel,
        support=SupportDesign(damping_time_s=0.0),
        sole=dataclasses.replace(Design().sole, **FIRM),
        socket=socket,
    )
    p = prosthesis_of(SUBJECT, 0.066, design=design)
    time = np.arange(0.0, 4.0 + 1e-9, 1e-3)
    press = 0.06 * np.sin(np.pi * time / 4.0) ** 2
    R = np.tile(Rotation.from_euler("y", 0.3).as_matrix(), (len(time), 1, 1))
    x = (R[0] @ knee(p, 0.0)) + np.outer(0.04 - press, [0.0, 0.0, 1.0])
    load = p.walk(time, R, x).socket_load
    half = len(time) // 2
    stored = work_on(p, time[:half], R[:half], x[:half], load[:half])
    assert stored > 5.0
    assert work_on(p, time, R, x, load) == pytest.approx(0.0, abs=0.02 * stored)


@pytest.mark.slow
def test_friction_holds_without_creep_and_a_dragged_foot_is_held_back_by_coulombs_force():
    p = virtual_foot()
    time = np.arange(0.0, 2.5, 2e-3)
    press, push = np.clip(time / 0.4, 0, 1), np.clip((time - 0.5) / 0.4, 0, 1)
    x = knee(p, 0.0) + np.outer(-0.015 * press, [0, 0, 1]) + np.outer(0.004 * push, [1, 0.5, 0])
    reaction = p.walk(time, np.tile(UPRIGHT, (len(time), 1, 1)), x)
    held = time > 1.5
    tangential = np.linalg.norm(reaction.force[held, :2], axis=1)
    assert 20.0 < tangential[0] < 0.5 * Design().sole.friction * reaction.force[held][0, 2]
    assert np.ptp(tangential) < 0.01 and reaction.slip_speed[held].max() < 1e-6
    assert np.ptp(reaction.cop[held], axis=0).max() < 1e-6
    time = np.arange(0.0, 1.0, 1e-3)
    x = knee(p, 0.012) + np.outer(0.2 * time, [0, 1, 0])
    reaction = p.walk(time, np.tile(UPRIGHT, (len(time), 1, 1)), x)
    late = time > 0.6
    ratio = np.linalg.norm(reaction.force[:, :2], axis=1) / reaction.force[:, 2]
    np.testing.assert_allclose(ratio[late], Design().sole.friction, rtol=1e-3)
    np.testing.assert_allclose(reaction.slip_speed[late], 0.2, rtol=0.02)
    assert (reaction.force[late, 1] < 0.0).all()


def test_shares_no_law_and_no_stepper_with_the_model():
    folder = Path(prosthesis.__file__).parent
    for name in (
        "assembly",
        "bench",
        "design",
        "device",
        "dynamics",
        "keel",
        "laws",
        "prosthesis",
        "sole",
        "stepping",
    ):
        tree = ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        modules |= {
            alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.Import)
            for alias in node.names
        }
        ours = {module for module in modules if module.startswith("vsf_drake")}
        assert ours <= {"vsf_drake.model.parameters", "vsf_drake.plants.anthropometry"}, name


def test_persons_come_out_again_and_are_none_whom_the_model_would_assume():
    """Light and heavy, left and right; lengths, hips and placement of their own; the passive foot
    inside the published range of commercial ones."""
    persons = true_persons(SEED)
    assert persons == true_persons(SEED) != true_persons(SEED + 1)
    assert [person.side for person in persons] == ["right", "left", "right"]
    for person in persons:
        stated = Subject(
            mass_kg=person.subject.mass_kg,
            stature_m=person.subject.stature_m,
            sex=person.subject.sex,
            prosthetic_side="right",
        )
        true, assumed = (
            scale_body(one, FootParameters(), SocketParameters())
            for one in (person.subject, stated)
        )
        for name in (
            "thigh_length",
            "shank_length",
            "ankle_height",
            "foot_length",
            "hip_forward",
            "hip_up",
            "hip_lateral",
            "prosthetic_thigh_length",
            "prosthesis_length",
        ):
            assert 1e-4 < abs(getattr(true, name) - getattr(assumed, name)) < 0.06, name
        assert true.placement != assumed.placement
        stiffness = [bench.forefoot_stiffness(person.foot, x) for x in (0.066, 0.108, 0.151)]
        assert 5e3 < stiffness[0] < stiffness[1] < stiffness[2] < 40e3
        p = person.prosthesis(0.108)
        assert p.sole_below_knee == pytest.approx(person.subject.prosthesis_length_m)
        p.reset(UPRIGHT, knee(p, 0.02))
        assert p.force[2] > 100.0
    assert 28e3 < bench.forefoot_stiffness(persons[2].passive, None) < 76e3
    assert 27e3 < bench.heel_stiffness(persons[2].passive) < 68e3
    with pytest.raises(ValueError, match="no passive foot"):
        persons[0].prosthesis(None)


# The floor: on exact kinematics the true prosthesis gives the plate, on noisy ones what the noise
# makes of it.


STORED = Path(floors.__file__).resolve().parents[1] / "results" / "floor.json"
NAMES = [f"{setting}_{i}" for setting in ("low", "medium", "high") for i in (1, 2, 3)]


def tier(name, of):
    return load_trial(DATA / of / f"{name}.yaml")


@pytest.fixture(scope="module")
def stored():
    return json.loads(STORED.read_text(encoding="utf-8"))


def test_on_the_exact_tier_the_route_reproduces_the_plate_and_noise_is_2_n_within_40_hz():
    """White noise of 2 N at 1000 Hz through a zero-phase low-pass of 40 Hz keeps about 40 / 500 of
    its power."""
    trial = tier("high_1", "exact")
    walk, plate, weight = (
        floors.virtual_walk(trial),
        trial.prosthetic_plate,
        trial.subject.mass_kg * GRAVITY,
    )
    # the plate goes on to the second strike and beyond, the window does not
    rows = plate.time_s <= trial.end_s + 1e-9
    assert walk.time_s[-1] == pytest.approx(trial.end_s) and not rows.all()
    np.testing.assert_allclose(walk.time_s, plate.time_s[rows], atol=1e-9)
    force, cop = plate.force_W[rows], plate.cop_W[rows]
    assert np.abs(walk.grf_W - force).max() < 1e-3 * weight
    loaded = np.isfinite(cop[:, 0]) & (force[:, 2] > 50.0)
    np.testing.assert_allclose(walk.cop_W[loaded], cop[loaded], atol=2e-4)
    error = floors.scores(walk, plate)
    assert (
        error["grf_rmse_bw"] < 1e-4
        and error["cop_rmse_fl"] < 1e-3
        and abs(error["stance_time_error_s"]) < 1e-4
    )
    assert error["unconverged_steps"] == 0
    noisy = floors.scores(walk, tier("high_1", "laboratory").prosthetic_plate)
    for name in ("vertical", "fore_aft"):
        assert noisy[f"{name}_rmse_bw"] == pytest.approx(
            PLATE_N * np.sqrt(40.0 / 500.0) / weight, rel=0.2
        )


def test_without_the_shared_errors_each_trial_keeps_only_constants_of_its_own():
    """Of the size that the tier draws: 0.1 degrees and 0.4 mm; what changes with time is what the
    stride's five digits in draws.csv leave, 1e-5 of a phase times errors of some 0.5 degrees a
    radian."""
    constants = []
    for name in NAMES:
        exact = tier(name, "exact").trajectory.ordered(COORDINATES)
        cleaned = floors.without_shared_errors(tier(name, "laboratory"), SEED)
        assert cleaned.names == COORDINATES
        off = cleaned.values - exact.values
        assert np.ptp(off, axis=0).max() < 1e-5
        constants.append(off[0])
    shifted = np.isin(COORDINATES, PELVIS_TRANSLATIONS)
    assert np.std(np.array(constants)[:, shifted]) == pytest.approx(TRIAL_M, rel=0.3)
    assert np.std(np.degrees(np.array(constants)[:, ~shifted])) == pytest.approx(TRIAL_DEG, rel=0.2)


@pytest.mark.slow
def test_a_height_that_was_put_in_is_found(monkeypatch):
    """The exact kinematics 2 mm too low under the exact plate: 2 mm are found and the error is
    gone."""
    trial = tier("high_1", "exact")
    lowered = trial.trajectory.ordered(COORDINATES)
    values = lowered.values - 2e-3 * np.isin(COORDINATES, "pelvis_ty")
    low = dataclasses.replace(
        trial, trajectory=floors.CoordinateTrajectory(lowered.time_s, values, COORDINATES)
    )
    monkeypatch.setattr(floors, "without_shared_errors", lambda trial, seed: trial.trajectory)
    before, error = floors.floor(low), floors.floor_with_height_fitted(low, SEED)
    assert before["grf_rmse_bw"] > 0.03
    assert error["height_mm"] == pytest.approx(2.0, abs=0.06)
    assert error["grf_rmse_bw"] < 2e-3


def test_what_has_no_floor_is_refused():
    exact = tier("low_1", "exact")
    with pytest.raises(ValueError, match="only trials of the laboratory tier"):
        floors.floor_with_shared_errors_removed(exact, SEED)
    left = dataclasses.replace(
        exact, subject=dataclasses.replace(exact.subject, prosthetic_side="left")
    )
    moved = dataclasses.replace(exact, offsets=GeometricOffsets(height_m=1e-3))
    for trial in (left, moved):
        with pytest.raises(ValueError, match="the reference subject's: on the right, no offsets"):
            floors.floor(trial)


def test_the_stored_floor_is_of_all_trials_and_falls_as_errors_are_taken_off(stored):
    assert stored["synthetic"] is True and set(stored["trials"]) == set(NAMES)
    assert stored["provenance"]["seed"] == SEED
    # the subject, the model, trials
    assert len(stored["provenance"]["inputs_sha256"]) == 2 + 2 * 3 * len(NAMES)
    for name, row in stored["trials"].items():
        order = [
            row[kind]["grf_rmse_bw"]
            for kind in (
                "exact",
                "plate_noise",
                "height_fitted",
                "shared_errors_removed",
                "laboratory",
            )
        ]
        assert order == sorted(order) and order[0] < 1e-4, name
    errors = [row["laboratory"]["grf_rmse_bw"] for row in stored["trials"].values()]
    assert all("rmse" in key for means in stored["mean_of_trials"].values() for key in means)
    assert stored["mean_of_trials"]["laboratory"]["grf_rmse_bw"] == pytest.approx(np.mean(errors))


@pytest.mark.slow
def test_the_script_finds_the_stored_floor_again(tmp_path, stored):
    script = STORED.parents[1] / "floor_of_the_reference_subject.py"
    subprocess.run(
        [sys.executable, script, "--quick", "--out", tmp_path], check=True, capture_output=True
    )
    again = json.loads((tmp_path / "floor.json").read_text(encoding="utf-8"))
    [(name, row)] = again["trials"].items()
    for kind in stored["definitions"]:
        for key in (
            "grf_rmse_bw",
            "fore_aft_rmse_bw",
            "cop_rmse_fl",
            "impulse_rmse_bws",
            "stance_model_s",
        ):
            assert row[kind][key] == pytest.approx(stored["trials"][name][kind][key], abs=5e-4), (
                kind,
                key,
            )
