"""The virtual foot meets beam theory and the published bench; its laws are what they say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from virtual_laboratory import bench, laws
from virtual_laboratory.design import Design, KeelDesign

from vsf_drake.parameters import FootParameters


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.108, 0.151])
def test_uniform_keel_is_the_overhung_beam(fulcrum_m):
    uniform = dataclasses.replace(KeelDesign(), thickness_tip_m=6.6e-3, width_tip_m=0.0684)
    rigid = dataclasses.replace(uniform, fulcrum_stiffness_n_per_m=1e11)
    foot = FootParameters()
    d = bench.bench_device(Design(keel=rigid), fulcrum_m)
    [q] = bench.keel_under_load(d, foot.load_point_m, np.array([1.0]))
    bending = uniform.modulus_pa * uniform.width_rear_m * uniform.thickness_rear_m**3 / 12
    closed_form = 3 * bending / ((foot.load_point_m - fulcrum_m) ** 2 * foot.load_point_m)
    assert 1.0 / bench.point_height(d, np.cumsum(q), foot.load_point_m) == pytest.approx(closed_form, rel=0.01)


def test_work_on_the_bent_keel_is_the_energy_in_its_hinges_and_fulcrum():
    d = bench.bench_device(Design(), 0.066)
    loads = np.linspace(0.0, 800.0, 201)
    q = bench.keel_under_load(d, 0.199, loads)
    heights = np.array([bench.point_height(d, np.cumsum(row), 0.199) for row in q])
    work = float(np.sum(0.5 * (loads[1:] + loads[:-1]) * np.diff(heights)))
    # the fulcrum's gap follows from moments about A, taken on the bent keel: the roller pushes along its normal
    angles = np.cumsum(q[-1])
    x = np.concatenate(([0.0], np.cumsum(d.lengths * np.cos(angles))))
    z = np.concatenate(([0.0], np.cumsum(d.lengths * np.sin(angles))))
    gap = np.interp(d.fulcrum, x, z)
    energy = 0.5 * np.sum(d.hinge_stiffness * q[-1] ** 2) + 0.5 * d.fulcrum_stiffness * gap**2
    assert heights[-1] > 0.05
    assert work == pytest.approx(energy, rel=2e-3)


def test_bench_meets_the_published_stiffness():
    stiffness = {x: bench.forefoot_stiffness(bench.bench_device(Design(), x)) for x in (0.066, 0.108, 0.151)}
    assert stiffness[0.066] == pytest.approx(10e3, rel=0.01)
    assert stiffness[0.151] == pytest.approx(32e3, rel=0.01)
    assert 17e3 < stiffness[0.108] < 19e3
    assert bench.heel_stiffness(bench.bench_device(Design(), 0.066)) == pytest.approx(65e3, rel=0.02)


def test_tuning_finds_the_recorded_constants():
    start = Design(keel=dataclasses.replace(KeelDesign(), fulcrum_stiffness_n_per_m=3e5))
    found, recorded = bench.tuned(start), Design()
    assert found.keel.fulcrum_stiffness_n_per_m == pytest.approx(recorded.keel.fulcrum_stiffness_n_per_m, rel=1e-3)
    assert found.sole.foam_modulus_pa == pytest.approx(recorded.sole.foam_modulus_pa, rel=1e-3)
    assert found.sole.heel_modulus_pa == pytest.approx(recorded.sole.heel_modulus_pa, rel=1e-3)


@pytest.mark.parametrize("depth", [1e-4, 5e-3, 0.019, 0.0205, 0.03])
def test_foam_force_and_slope_belong_together(depth):
    force, slope = laws.foam(depth, 700.0, 0.024)
    around = [laws.foam(depth + e, 700.0, 0.024)[0] for e in (-1e-7, 1e-7)]
    assert slope == pytest.approx((around[1] - around[0]) / 2e-7, rel=1e-4)
    assert force >= 700.0 * depth


def test_foam_never_pulls_and_gives_back_less_than_it_took():
    time = np.linspace(0.0, 0.5, 2001)
    depth = 0.01 * np.sin(2 * np.pi * time)
    rate, h = np.gradient(depth, time), time[1]
    pressed = zip(depth, rate, strict=True)
    force = np.array([laws.foam_with_hysteresis(d, v, h, 700.0, 0.024, 2.5)[0] for d, v in pressed])
    assert force.min() >= 0.0
    lost = np.trapezoid(force * rate, time)
    assert 0.02 < lost / (0.5 * 700.0 * 0.01**2) < 0.5


def test_socket_hardens_and_holds_in_both_directions():
    s = Design().socket
    press, pull = (laws.axial(u, s.axial_force_n, s.axial_length_m, s.axial_linear_n_per_m) for u in (8e-3, -6e-3))
    assert press[0] == pytest.approx(800.0, rel=0.1)
    assert pull[0] == pytest.approx(-90.0, rel=0.25)
    assert laws.hardening(0.09, 800.0, 0.09)[1] > 1.4 * laws.hardening(0.0, 800.0, 0.09)[1]
    assert laws.hardening(-0.1, 800.0, 0.09)[0] == -laws.hardening(0.1, 800.0, 0.09)[0]
