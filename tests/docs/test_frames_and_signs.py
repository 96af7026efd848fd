"""The page of frames and signs says what the model does: positions, signs of coordinates, forces
and slopes."""

from __future__ import annotations

import math
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from frames.foot_positions import LOAD_N, SLOPE_DEG, DrawnFoot, foot_signs
from frames.person_poses import KINDS, DrawnPerson, effects, kind_of
from frames.pictures import GROUPS, NAMES, foot_effects, with_table

from vsf_drake.model.parameters import PELVIS_COORDINATES, FootParameters, leg_coordinates
from vsf_drake.plants.person import SOCKET_COORDINATES
from vsf_drake.simulation.bench import keel_shape

DOCS = Path(__file__).resolve().parents[2] / "docs"
FOOT = FootParameters()

# What the clinical words mean, whatever the model does: Wu et al. 2002, Grood & Suntay 1983,
# OpenSim's gait models.
MEANING = {
    "pelvis_tx": "pelvis forward",
    "pelvis_ty": "pelvis up",
    "pelvis_tz": "pelvis to the right",
    "pelvis_tilt": "trunk backward",
    "pelvis_list": "right hip down",
    "pelvis_rotation": "right hip forward",
    "hip_flexion": "knee forward",
    "hip_adduction": "knee inward",
    "hip_rotation": "toe inward",
    "knee_angle": "ankle backward",
    "knee_adduction": "ankle inward",
    "knee_rotation": "toe inward",
    "ankle_angle": "toe up",
    "ankle_adduction": "inner edge up",
    "ankle_rotation": "toe inward",
    "socket_tx": "pylon forward",
    "socket_ty": "pylon to the left",
    "socket_tz": "pylon up",
    "socket_flexion": "pylon's lower end forward",
    "socket_adduction": "pylon's lower end inward",
    "socket_rotation": "toe inward",
}


@pytest.fixture(scope="module")
def signs():
    return foot_signs(FOOT)


def test_positive_coordinates_do_what_their_names_mean_on_both_sides():
    everything = effects()
    for effect in everything:
        assert f"{effect.point} {effect.direction}" == MEANING[kind_of(effect.name)], effect.name
        assert effect.unit == (
            "m"
            if effect.name.startswith(("pelvis_t", "socket_t")) and effect.name != "pelvis_tilt"
            else "rad"
        )
    legs = {*leg_coordinates("right", intact=True), *leg_coordinates("left", intact=True)}
    assert {effect.name for effect in everything} == legs | {
        *PELVIS_COORDINATES,
        *SOCKET_COORDINATES,
    }
    assert {kind for group in GROUPS.values() for kind in group} == set(KINDS)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_right_angle_puts_the_leg_where_the_lengths_say(side):
    person = DrawnPerson(side)
    body, s = person.person.body, "l" if side == "right" else "r"  # the intact leg
    rest = person.points()
    seated = person.points(**{f"hip_flexion_{s}": math.pi / 2, f"knee_angle_{s}": math.pi / 2})
    hip = rest[f"hip_{s}"]
    np.testing.assert_allclose(seated[f"knee_{s}"] - hip, [body.thigh_length, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        seated[f"ankle_{s}"] - hip, [body.thigh_length, 0.0, -body.shank_length], atol=1e-12
    )
    across = person.points(**{f"hip_adduction_{s}": math.pi / 2})[f"knee_{s}"]
    inward = 1.0 if s == "r" else -1.0
    np.testing.assert_allclose(across - hip, [0.0, inward * body.thigh_length, 0.0], atol=1e-12)


def test_positive_keel_angles_lift_the_toe_and_the_carriage_goes_to_it():
    effects_of_foot = {
        effect.name: (effect.point, effect.direction) for effect in foot_effects(FOOT)
    }
    assert effects_of_foot.pop("fulcrum") == ("carriage", "forward")
    assert set(effects_of_foot.values()) == {("toe", "up")} and len(effects_of_foot) == 9


def test_frames_and_points_are_where_the_parameters_say():
    drawn = DrawnFoot(FOOT).positions(0.100)
    A = drawn.X_WK.translation()
    np.testing.assert_allclose(drawn.A, A, atol=1e-15)
    np.testing.assert_allclose(
        drawn.X_WM.translation(), [0.0, 0.0, FOOT.build_height_m], atol=1e-15
    )
    np.testing.assert_allclose(
        [drawn.B - A, drawn.C - A, drawn.tip - A, drawn.carriage - A],
        [[x, 0.0, 0.0] for x in (0.100, 0.199, 0.229, 0.100)],
        atol=1e-12,
    )
    assert A[0] == pytest.approx(-FOOT.pylon_x_m)
    assert A[2] == pytest.approx(FOOT.foam_thickness_m + 0.5 * FOOT.keel.thickness_m)
    assert len(drawn.spheres) == 24
    # all touch the ground
    np.testing.assert_allclose(drawn.spheres[:, 2], drawn.radius, atol=1e-12)


def test_the_fulcrum_holds_the_keel_down_while_the_toe_is_pressed_up(signs):
    shape = keel_shape(FOOT, fulcrum_m=signs.loaded.fulcrum_m, load_n=LOAD_N)
    assert signs.support_force == pytest.approx(shape.support_force_n, rel=1e-9)
    arms = (signs.loaded.C - signs.loaded.A)[0] / (signs.loaded.B - signs.loaded.A)[0]
    assert signs.support_force == pytest.approx(-LOAD_N * arms, rel=1e-6)


def test_the_ground_pushes_against_sliding_and_turning_and_along_the_normal_of_a_slope(signs):
    assert signs.sliding.grf[2] > 0.0 and signs.sliding.grf[0] < 0.0
    assert signs.sliding.free_moment == pytest.approx(0.0, abs=1e-9)
    # turned clockwise from above, it is pushed counter-clockwise
    assert signs.turning.free_moment > 0.0
    lowest, highest = signs.sliding.foot.spheres[:, 0].min(), signs.sliding.foot.spheres[:, 0].max()
    assert lowest < signs.sliding.cop[0] < highest and signs.sliding.cop[2] == pytest.approx(
        0.0, abs=1e-12
    )
    for axis, forces in enumerate((signs.sloping, signs.banked)):
        assert forces.normal[axis] < 0.0
        np.testing.assert_allclose(
            forces.grf / np.linalg.norm(forces.grf), forces.normal, atol=1e-9
        )
        assert forces.cop[2] == pytest.approx(
            math.tan(math.radians(SLOPE_DEG)) * forces.cop[axis], abs=1e-9
        )


def test_the_page_has_the_table_as_the_model_is_now_and_every_picture():
    text = (DOCS / "frames.md").read_text(encoding="utf-8")
    assert with_table(text) == text, "run python docs/make_pictures.py"
    with pytest.raises(ValueError, match="coordinates: begin"):
        with_table("a page without a table")
    shown = dict(re.findall(r"!\[([^\]]*)\]\(pictures/(\w+)\.svg\)", text))
    assert sorted(shown.values()) == sorted(NAMES)
    assert all(len(words) > 20 for words in shown)
    assert {path.name for path in (DOCS / "pictures").glob("*.svg")} >= {
        f"{name}.svg" for name in NAMES
    }


@pytest.mark.slow
def test_the_script_makes_every_picture(tmp_path, capsys):
    runpy.run_path(str(DOCS / "make_pictures.py"))["main"](tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in NAMES for kind in ("png", "svg")
    }
    assert all(path.stat().st_size > 10_000 for path in tmp_path.iterdir())
    assert len(capsys.readouterr().out.splitlines()) == 2 * len(NAMES)
