"""MuJoCo's contact in newtons and metres: against what theory says of one step, and of rest."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.mujoco import calibrate

mujoco = pytest.importorskip("mujoco")

MASS_KG = 0.2
RADIUS_M = 0.05
WEIGHT_N = MASS_KG * GRAVITY


def ball(*, step_s=1e-3, condim=1, more="", floor=""):
    """A ball of 0.2 kg that touches a floor."""
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{step_s}" gravity="0 0 -{GRAVITY}" cone="elliptic"/>
          <worldbody>
            <geom name="floor" type="plane" size="1 1 1" condim="{condim}" {floor}/>
            <body pos="0 0 {RADIUS_M}">
              <freejoint/>
              <geom name="ball" size="{RADIUS_M}" mass="{MASS_KG}" condim="{condim}"/>
            </body>
          </worldbody>
          {more}
        </mujoco>""")


def settled(model, steps=4000):
    """State after so many steps."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=steps)
    return data


def depth(data):
    return RADIUS_M - data.qpos[2]


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("damping", [0.0, 3.0, 300.0])
def test_ball_goes_step_by_step_as_on_a_spring_and_a_damper_at_the_end_of_the_step(
    stiffness, damping
):
    """m a = m g - k (r + d h v + h² a) - c (v + h a), with v and r of the start; d / (1 - d) is the
    mass h² k + h c of the contact over that of the ball."""
    model = ball()
    calibrate(model, geoms=["ball"], stiffness=stiffness, damping=damping)
    data = mujoco.MjData(model)
    r, v, h = 1e-3 + WEIGHT_N / stiffness, 0.0, model.opt.timestep
    data.qpos[2] -= r
    mass = h**2 * stiffness + h * damping
    d = max(mass / (mass + MASS_KG), 1e-4)
    mass = MASS_KG * d / (1.0 - d)
    for _ in range(20):
        force = stiffness * (r + d * h * v) + damping * v
        if force + mass * (WEIGHT_N - force) / (MASS_KG + mass) <= 0.0:
            break
        v += h * (WEIGHT_N - force) / (MASS_KG + mass)
        r += h * v
        mujoco.mj_step(model, data)
        assert depth(data) == pytest.approx(r, rel=1e-9, abs=1e-14)
    else:
        assert stiffness < 1e6


@pytest.mark.parametrize("step_s", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_dropped_ball_never_rises_higher_than_it_was_let_go(step_s, stiffness):
    """However stiff for the step: the longest is 11 times the stiffest period of the ball."""
    model = ball(step_s=step_s)
    calibrate(
        model, geoms=["ball"], stiffness=stiffness, damping=0.1 * np.sqrt(stiffness * MASS_KG)
    )
    data = mujoco.MjData(model)
    data.qpos[2] = start = RADIUS_M + 0.02
    for _ in range(4000):
        mujoco.mj_step(model, data)
        assert data.qpos[2] < start


def test_contact_bears_the_weight_at_the_depth_of_its_stiffness():
    for stiffness in (1e3, 1e5):
        model = ball()
        damping = 2.0 * np.sqrt(stiffness * MASS_KG)
        calibrate(model, geoms=["ball"], stiffness=stiffness, damping=damping)
        assert stiffness * depth(settled(model)) == pytest.approx(WEIGHT_N, rel=1e-6)


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.5, 2.0, 3.0, 4.5, 6.0])
@pytest.mark.parametrize(("full_n", "step_s"), [(20.0, 2e-3), (2000.0, 2e-4)])
def test_ball_rests_where_the_power_of_its_depth_bears_the_weight(exponent, full_n, step_s):
    """Within 1 % of the force at the full depth."""
    largest = 0.015
    for share in (0.1, 0.4, 0.7, 0.95):
        model = ball(step_s=step_s)
        model.opt.gravity[2] = -share * full_n / MASS_KG
        calibrate(
            model,
            geoms=["ball"],
            stiffness=full_n / largest**exponent,
            damping=2.0 * np.sqrt(full_n / largest * MASS_KG),
            exponent=exponent,
            depth=largest,
        )
        data = settled(model, 5000)
        assert (depth(data) / largest) ** exponent == pytest.approx(share, abs=0.01)
        assert abs(data.qvel[2]) < 1e-6


def test_partner_that_moves_is_counted_where_it_is_named():
    """A lift of 0.05 kg, held by a spring, bears the ball. Not told of it, the contact is softer by
    A of the ball over A of both, which are 1 / mass."""
    lift = """
        <mujoco>
          <option timestep="1e-3" cone="elliptic"/>
          <worldbody>
            <body>
              <joint type="slide" axis="0 0 1" stiffness="1e4" damping="50"/>
              <geom name="lift" type="box" size="0.2 0.2 0.05" mass="0.05" condim="1"/>
            </body>
            <body pos="0 0 0.1">
              <joint type="slide" axis="0 0 1"/>
              <geom name="ball" size="0.05" mass="0.2" condim="1"/>
            </body>
          </worldbody>
        </mujoco>"""
    for against, factor in (("lift", 1.0), (None, 0.05 / (0.05 + 0.2))):
        model = mujoco.MjModel.from_xml_string(lift)
        calibrate(model, geoms=["ball"], stiffness=1e3, damping=20.0, against=against)
        data = settled(model)
        assert factor * 1e3 * -data.contact[0].dist == pytest.approx(WEIGHT_N, rel=1e-6)


def test_law_is_the_geoms_whatever_the_priority_of_what_it_touches():
    model = ball(floor='priority="3" solref="-1 -1"')
    calibrate(model, geoms=["ball"], stiffness=1e4, damping=30.0)
    calibrate(model, geoms=["ball"], stiffness=2e4, damping=30.0)
    assert 2e4 * depth(settled(model)) == pytest.approx(WEIGHT_N, rel=1e-6)


def test_sliding_contact_is_softer_by_what_impratio_leaves_and_its_damper_feels_the_sliding():
    """(k r + mu c speed) / (1 + mu² / impratio), as the model says of its limits."""
    k, c, mu, pressed, speed = 1e4, 30.0, 0.8, 1e-3, 1.0
    model = ball(step_s=1e-6, condim=3)
    model.opt.impratio = 10.0
    model.geom_friction[:, 0] = mu
    calibrate(model, geoms=["ball"], stiffness=k, damping=c)
    data = mujoco.MjData(model)
    data.qpos[2] -= pressed
    data.qvel[0] = speed
    mujoco.mj_forward(model, data)
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    assert force[0] == pytest.approx(
        (k * pressed + mu * c * speed) / (1.0 + mu**2 / 10.0), rel=1e-3
    )
    assert np.hypot(*force[1:3]) == pytest.approx(mu * force[0], rel=1e-6)


def two_feet():
    """A leg of 60 kg on a rail, with two feet of one file under it."""
    leg = mujoco.MjSpec.from_string("""
        <mujoco>
          <option timestep="1e-3" integrator="implicitfast" cone="elliptic" impratio="4"/>
          <worldbody>
            <geom name="floor" type="plane" size="1 1 1"/>
            <body name="leg" pos="0 0 0.09">
              <joint type="slide" axis="0 0 1"/>
              <geom type="box" size="0.05 0.05 0.2" pos="0.05 0 0.3" mass="60" contype="0"
                conaffinity="0"/>
            </body>
          </worldbody>
        </mujoco>""")
    for prefix, y in (("left_", 0.1), ("right_", -0.1)):
        foot = mujoco.MjSpec.from_string(foot_mjcf(FootParameters(), fulcrum_m=0.108))
        foot.delete(foot.key("rest"))  # without the rail's coordinate
        leg.attach(foot, prefix=prefix, frame=leg.body("leg").add_frame(pos=[0.0, y, 0.0]))
    return leg.compile()


def test_foam_of_all_attached_feet_is_as_stiff_as_the_file_says():
    model = two_feet()
    calibrate(model)
    data = mujoco.MjData(model)
    for prefix in ("left_", "right_"):
        data.joint(f"{prefix}fulcrum").qpos = 0.108
    data.ctrl[:] = 0.108
    mujoco.mj_step(model, data, nstep=3000)
    foam = FootParameters().zones[-1].stiffness
    heel = FootParameters().zones[0].stiffness
    force = np.zeros(6)
    names = []
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, force)
        names += [model.geom(geom).name for geom in data.contact[i].geom if geom != 0]
        known = heel if int(names[-1].rpartition("_")[2]) < 6 else foam
        assert force[0] == pytest.approx(known * -data.contact[i].dist, rel=1e-3)
    assert {name.partition("_")[0] for name in names} == {"left", "right"}


def pyramidal():
    model = two_feet()
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    return model


def foot_alone():
    return mujoco.MjModel.from_xml_string(foot_mjcf(FootParameters(), fulcrum_m=0.108))


BALL = {"geoms": ["ball"], "stiffness": 1e4}
PAIR = '<contact><pair geom1="floor" geom2="ball"/></contact>'


@pytest.mark.parametrize(
    ("model", "asked", "message"),
    [
        (ball, {}, "geoms: is left out, and the model holds no exported foot"),
        (ball, {"geoms": ["bal"], "stiffness": 1.0}, "geoms: there is no geom 'bal'"),
        (ball, {"geoms": "ball"}, "geoms: is one name. Give a list, such as ['ball']"),
        (ball, BALL | {"against": "flor"}, "against: there is no geom 'flor'"),
        (ball, {"geoms": ["ball"]}, "stiffness: is left out"),
        (ball, BALL | {"stiffness": -1.0}, "stiffness: is -1. It must be from 0"),
        (ball, BALL | {"stiffness": [1.0, 2.0]}, "stiffness: is neither one number nor one for"),
        (ball, BALL | {"damping": np.nan}, "damping: is nan. It must be from 0"),
        (ball, BALL | {"exponent": 0.5}, "exponent: is 0.5. It must be from 1 to 6"),
        (ball, BALL | {"exponent": "two"}, "exponent: is neither one number"),
        (ball, BALL | {"depth": 0.0}, "depth: is 0 m. It must be positive"),
        (ball, BALL | {"geoms": ["ball", "floor"]}, "floor: does not move"),
        (foot_alone, {}, "foam_0: does not move"),
        (lambda: ball(more=PAIR), BALL, "geoms: a pair states the softness"),
        (
            lambda: ball(more='<option><flag override="enable"/></option>'),
            BALL,
            "opt.enableflags: gives all contacts one softness",
        ),
        (pyramidal, {}, "opt.cone: is pyramidal"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_changed(model, asked, message):
    model = model()
    before = model.geom_solref.copy(), model.geom_priority.copy()
    with pytest.raises(InputError) as refused:
        calibrate(model, **asked)
    assert str(refused.value).startswith(message)
    np.testing.assert_array_equal(model.geom_solref, before[0])
    np.testing.assert_array_equal(model.geom_priority, before[1])
