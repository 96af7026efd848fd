"""Steps of Drake and MuJoCo with the foot's files: at rest where the bench has it, no energy out of
nothing; files without what makes them steady are found out."""

from __future__ import annotations

import re

import numpy as np
import pytest
from asked_of_engines import asked_of

from vsf_drake.engines.certificate import steady_in_drake
from vsf_drake.engines.certificate.asked import NOMINAL as NOMINAL_FILES
from vsf_drake.engines.certificate.asked import foot_file
from vsf_drake.engines.certificate.steadiness import DROPPED_KG, LOADS_N, STEPS_S, Drop
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape

NOMINAL = FootParameters()
WEIGHT_N = (DROPPED_KG + NOMINAL.mass_kg) * GRAVITY


def answered(folder, engine, fulcrums_m, change=lambda text: text):
    """What `engine`, drake or mujoco, says of files after a `change`."""
    asked_of(NOMINAL, fulcrums_m=fulcrums_m, loads_n=[100.0]).write(folder)
    (folder / NOMINAL_FILES).mkdir()
    write, ending = {"drake": (foot_sdf, "sdf"), "mujoco": (foot_mjcf, "xml")}[engine]
    for at in fulcrums_m:
        file = foot_file(folder, NOMINAL_FILES, 1e3 * at, ending)
        file.write_text(change(write(NOMINAL, fulcrum_m=at)), encoding="utf-8")
    if engine == "drake":
        steady_in_drake.answer(folder)
    else:
        pytest.importorskip("mujoco")
        from vsf_drake.engines.certificate import steady_in_mujoco  # noqa: PLC0415 - optional

        steady_in_mujoco.answer(folder)
    with np.load(folder / f"steady_{engine}.npz") as found:
        return dict(found)


def check(found, fulcrums_m, within):
    np.testing.assert_allclose(found["step_s"][1:], np.outer(STEPS_S, np.ones(len(fulcrums_m))))
    assert found["steady"].all()
    known = [
        [keel_shape(NOMINAL, fulcrum_m=at, load_n=load).load_point_K[1] for load in LOADS_N]
        for at in fulcrums_m
    ]
    for rise in found["rest_rise_m"]:
        np.testing.assert_allclose(rise, known, rtol=within, atol=1e-12)
    assert found["passive"].all(), found["energy_created_j"]
    np.testing.assert_allclose(found["borne_n"], WEIGHT_N, rtol=2e-3)


def test_drake_is_steady_up_to_two_milliseconds(tmp_path):
    found = answered(tmp_path, "drake", [0.108])
    assert found["step_s"][0] == 1e-3
    check(found, [0.108], 1e-6)


def test_mujoco_is_steady_up_to_two_milliseconds(tmp_path):
    check(answered(tmp_path, "mujoco", [0.108]), [0.108], 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "within"), [("drake", 1e-6), ("mujoco", 1e-4)])
def test_so_they_are_at_every_position(engine, within, tmp_path):
    check(answered(tmp_path, engine, PUBLISHED_FULCRUMS_M), PUBLISHED_FULCRUMS_M, within)


@pytest.mark.parametrize(("delayed", "created"), [(0.0, False), (0.01, True)])
def test_undamped_spring_creates_no_energy_but_one_that_is_late_does(delayed, created):
    """A mass of 1 kg on a spring, 20 steps a period; a share of the spring's force is that of the
    step before. What is left of a balance with K (h v)^2 / 4 is that."""
    step_s = 1e-2
    stiffness = (2.0 * np.pi / (20.0 * step_s)) ** 2
    position = 0.0
    speed = 1.0
    last = 0.0
    states = []
    for _ in range(400):
        states.append((0.5 * speed**2, 0.5 * stiffness * position**2, 0.0, 0.0))
        speed -= step_s * stiffness * ((1.0 - delayed) * position + delayed * last)
        last = position
        position += step_s * speed
    drop = Drop(*np.transpose(states))
    swings = 0.5 * stiffness * step_s**2 * drop.kinetic_j.max()
    assert (drop.created_j > (1.0 + 1e-9) * swings) == created


def test_support_without_damping_at_the_end_of_the_step_is_found_out(tmp_path):
    def change(text):
        return re.sub("<drake:tendon_constraint>.*</drake:tendon_constraint>", "", text, flags=re.S)

    found = answered(tmp_path, "drake", [0.108], change)
    assert not found["steady"].any()
    assert not found["passive"].any()


def test_support_of_mujoco_with_its_own_damping_only_is_found_out(tmp_path):
    def change(text):
        return re.sub(r'(name="vsf_support".* damping=)"[^"]*"', r'\1"200"', text)

    found = answered(tmp_path, "mujoco", [0.108], change)
    assert not found["steady"].any()
    assert not found["passive"].any()
