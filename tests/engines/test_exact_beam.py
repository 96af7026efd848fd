"""The keel with many elements, and Exudyn's beam, meet the elastica; the certificate's question to
Exudyn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asked_of_engines import asked_of
from scipy.integrate import solve_ivp
from scipy.optimize import root

from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape

NOMINAL = FootParameters()
BENDING = NOMINAL.keel.flexural_modulus_pa * section_inertia(
    NOMINAL.keel.width_m, NOMINAL.keel.thickness_m
)
SUPPORT = NOMINAL.fulcrum.stiffness_n_per_m
LOADED = NOMINAL.load_point_m
LENGTH = sum(NOMINAL.keel.element_lengths_m)
LOADS_N = np.array([100.0, 400.0, 800.0])
EQUAL = replace(NOMINAL, keel=replace(NOMINAL.keel, element_lengths_m=(LENGTH / 32,) * 32))


def elastica_rise(fulcrum_m, load_n):
    """Rise (m) of C of a beam that bends and does nothing else: E I theta' = M, M' = -V cos theta,
    with V = load + support's force up to the fulcrum and the load from there on."""

    def marched(theta, force):
        def slopes(vertical):
            return lambda _, y: [
                np.cos(y[2]),
                np.sin(y[2]),
                y[3] / BENDING,
                -vertical * np.cos(y[2]),
            ]

        fine = {"rtol": 1e-12, "atol": 1e-14}
        first = solve_ivp(slopes(load_n + force), (0.0, fulcrum_m), [0.0, 0.0, theta, 0.0], **fine)
        over = first.y[:, -1]
        return over, solve_ivp(slopes(load_n), (fulcrum_m, LOADED), over, **fine).y[:, -1]

    def unmet(unknown):
        over, end = marched(*unknown)
        return [unknown[1] / SUPPORT + over[1], end[3] / BENDING]

    found = root(unmet, [0.0, -load_n * LOADED / fulcrum_m], tol=1e-13)
    return marched(*found.x)[1][1]


@pytest.fixture(scope="module")
def exact():
    return np.array([[elastica_rise(at, load) for load in LOADS_N] for at in PUBLISHED_FULCRUMS_M])


def risen(foot):
    return np.array(
        [
            [keel_shape(foot, fulcrum_m=at, load_n=load).load_point_K[1] for load in LOADS_N]
            for at in PUBLISHED_FULCRUMS_M
        ]
    )


def test_elastica_under_a_small_load_is_the_closed_form():
    for fulcrum_m in PUBLISHED_FULCRUMS_M:
        known = combined_stiffness(
            bending_stiffness=BENDING,
            support=fulcrum_m,
            load_point=LOADED,
            fulcrum_stiffness=SUPPORT,
        )
        assert 0.1 / elastica_rise(fulcrum_m, 0.1) == pytest.approx(known, rel=1e-6)


def test_keel_of_32_equal_elements_is_within_a_fifth_of_a_percent_of_the_elastica(exact):
    assert np.abs(risen(EQUAL) / exact - 1.0).max() < 2e-3


def test_error_falls_about_with_the_square_of_the_elements_length(exact):
    """Joints in the middle of elements are a midpoint rule. Where fulcrum and load lie in an
    element counts too, and is not the same with another number of them: so at least 8 times for a
    quarter of the length, instead of 16."""
    finer = replace(NOMINAL, keel=replace(NOMINAL.keel, element_lengths_m=(LENGTH / 128,) * 128))
    assert np.abs(risen(finer) / exact - 1.0).max() < np.abs(risen(EQUAL) / exact - 1.0).max() / 8.0


def test_exudyns_beam_is_the_elastica(exact, tmp_path):
    pytest.importorskip("exudyn")
    from vsf_drake.engines.certificate.in_exudyn import answer  # noqa: PLC0415 - optional

    asked_of(NOMINAL, fulcrums_m=PUBLISHED_FULCRUMS_M, loads_n=LOADS_N).write(tmp_path)
    answer(tmp_path)
    with np.load(tmp_path / "exudyn.npz") as answered:
        np.testing.assert_allclose(answered["rise_m"], exact, rtol=1e-5)
