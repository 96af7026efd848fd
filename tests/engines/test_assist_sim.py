"""The foot as a device for `assist_sim`: on a leg made by hand, always; on the legs of `myo_sim`
where `assist_sim` is installed (it takes no MuJoCo from 3.12 on)."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from vsf_drake.base.errors import InputError
from vsf_drake.engines.assist_sim import LEGS, SHANK_M, transtibial
from vsf_drake.engines.assisted_model import DEVICE, prepare, touch_sums
from vsf_drake.model.parameters import GRAVITY, FootParameters, ModelParameters

mujoco = pytest.importorskip("mujoco")


def with_assist_sim(test):
    missing = importlib.util.find_spec("assist_sim") is None
    return pytest.mark.slow(pytest.mark.skipif(missing, reason="assist_sim is not installed")(test))


NOMINAL = ModelParameters()
UNUSUAL = replace(NOMINAL, foot=FootParameters(pylon_x_m=0.07, mass_kg=0.8, build_height_m=0.11))
STEP_S = 2e-3
"""The host's own."""
BODY_KG = 60.0
LOST = {
    "myolegs26": {"soleus", "tibant", "edl", "fdl"},
    "myolegs": {
        *("soleus", "tibant", "edl", "fdl", "ehl"),
        *("fhl", "tibpost", "perlong", "perbrev"),
    },
}
GUIDE = Path(__file__).resolve().parents[2] / "docs/guide/assist_sim.md"
COMBINED = [(model, leg) for leg, host in LEGS.items() for model in host.models]


@pytest.fixture(scope="module")
def device(tmp_path_factory):
    """(config file, its values) of the device, written once for each choice."""
    written = {}

    def make(parameters=NOMINAL, **choices):
        key = (id(parameters), *sorted(choices.items()))
        if key not in written:
            folder = tmp_path_factory.mktemp("device")
            for name, text in transtibial(parameters, **{"fulcrum_m": 0.108} | choices).items():
                (folder / name).write_text(text)
            written[key] = folder / "config.yaml"
        return written[key], yaml.safe_load(written[key].read_text())

    return make


def on_hand_made_leg(device, drop_m=0.0, **choices):
    """A rail, a body of 60 kg and a shank with the device, over a floor `drop_m` below the sole."""
    file, config = device(**choices)
    spec = mujoco.MjSpec()
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.timestep = STEP_S
    height = LEGS[choices.get("leg", "myolegs26")].sole_m + drop_m
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    # the shank's frame: y up, z to the right
    shank = spec.worldbody.add_body(name="shank", pos=[0, 0, height], quat=[1, 1, 0, 0])
    shank.add_joint(name="rail", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0])
    shank.add_geom(size=[0.1, 0.1, 0.1], mass=BODY_KG, contype=0, conaffinity=0)
    (attached,) = config["attachments"]
    own = mujoco.MjSpec.from_file(str(file.parent / config["device"]["model_xml"]))
    frame = shank.add_frame(pos=attached["pos"], quat=attached["quat"])
    frame.attach_body(own.body(attached["device_body"]), prefix=f"{DEVICE}_")
    for sensor in config["sensors"]:
        if sensor["type"] == "touch":
            spec.add_sensor(
                name=sensor["name"],
                type=mujoco.mjtSensor.mjSENS_TOUCH,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=f"{DEVICE}_{sensor['site']}",
            )
    return spec.compile()


def floor_force(model, data):
    """Sum (N) of the normal forces of all contacts of the floor."""
    force = np.zeros(6)
    total = 0.0
    for i in range(data.ncon):
        if model.geom("floor").id in data.contact[i].geom:
            mujoco.mj_contactForce(model, data, i, force)
            total += force[0]
    return total


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize(
    "parameters, residuum_m", [(NOMINAL, 0.15), (NOMINAL, 0.3), (UNUSUAL, 0.264)]
)
def test_sole_is_flat_where_the_intact_one_was_and_the_mount_under_the_ankle(
    device, leg, side, parameters, residuum_m
):
    model = on_hand_made_leg(
        device, parameters=parameters, leg=leg, side=side, residuum_m=residuum_m
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    spheres = [i for i in range(model.ngeom) if model.geom(i).name.startswith(f"{DEVICE}_foam")]
    bottoms = data.geom_xpos[spheres, 2] - model.geom_size[spheres, 0]
    assert len(spheres) == 24
    np.testing.assert_allclose(bottoms, 0.0, atol=1e-9)
    mount = data.site(f"{DEVICE}_vsf_mount")
    np.testing.assert_allclose(
        mount.xpos, [LEGS[leg].ankle_x_m, 0.0, parameters.foot.build_height_m], atol=1e-9
    )
    np.testing.assert_allclose(mount.xmat.reshape(3, 3), np.eye(3), atol=1e-9)


def test_device_weighs_socket_pylon_and_foot_and_moves_in_the_keel_alone(device):
    model = on_hand_made_leg(device, parameters=UNUSUAL)
    socket = UNUSUAL.socket
    own = socket.socket_mass_kg + socket.pylon_mass_kg + UNUSUAL.foot.mass_kg
    assert model.body_mass.sum() == pytest.approx(BODY_KG + own, rel=1e-9)
    joints = {model.joint(i).name for i in range(model.njnt)} - {"rail"}
    assert joints == {f"{DEVICE}_keel_{i}" for i in ["pin", *range(1, 9)]}


def test_residual_limb_is_the_upper_part_of_a_frustum(device):
    """Its mass, centre and moments by discs; the whole frustum, 55 mm at the knee, has the
    centre of mass of de Leva's shank."""
    _, config = device(residuum_m=0.2)
    (limb,) = config["body_overrides"]
    z = np.linspace(0.0, SHANK_M, 100001)
    tapers = np.linspace(0.3, 1.0, 7001)
    centres = (1 + 2 * tapers + 3 * tapers**2) / (4 * (1 + tapers + tapers**2))
    taper = np.interp(0.4395, centres, tapers)
    radius = 0.055 * (1.0 + (taper - 1.0) * z / SHANK_M)
    kept = z <= 0.2
    mass = 3.7075 * (radius**2)[kept].sum() / (radius**2).sum()
    z, radius = z[kept], radius[kept]
    centre = np.average(z, weights=radius**2)
    axial = mass * np.average(0.5 * radius**2, weights=radius**2)
    lateral = mass * np.average(0.25 * radius**2 + (z - centre) ** 2, weights=radius**2)
    assert limb["mass"] == pytest.approx(mass, rel=1e-4)
    np.testing.assert_allclose(limb["ipos"], [0.0, -centre, 0.0], rtol=1e-4)
    np.testing.assert_allclose(limb["diaginertia"], [lateral, axial, lateral], rtol=1e-4)


@pytest.mark.parametrize("leg", LEGS)
def test_calf_keeps_its_fibres_and_its_line(device, leg):
    """What is gone of the tendon is gone of both ends of the range, so the lengths of the fibres,
    which are shares of the range, are as before."""
    _, config = device(leg=leg, residuum_m=0.2)
    pairs = zip(
        LEGS[leg].calves,
        config["tendon_modifications"],
        config["actuator_overrides"],
        strict=True,
    )
    for calf, tendon, muscle in pairs:
        above, end = np.array(calf.above_m), np.array(calf.end_m)
        place = np.array(tendon["wraps"][0]["pos"])
        assert place[1] == pytest.approx(-0.2)
        np.testing.assert_allclose(np.cross(place - above, end - above), 0.0, atol=1e-12)
        gone = np.linalg.norm(end - place)
        np.testing.assert_allclose(muscle["lengthrange"], np.array(calf.lengths_m) - gone)


def test_left_mirrors_right(device):
    right, left = (device(side=side) for side in ("right", "left"))
    assert right[0].with_name("model.xml").read_text() == left[0].with_name("model.xml").read_text()
    ends = [config["tendon_modifications"][0]["wraps"][0]["pos"] for _, config in (right, left)]
    np.testing.assert_allclose(ends[1], np.array(ends[0]) * [1, 1, -1])
    assert left[1]["body_removals"] == ["talus_l"]
    assert {sensor["name"][0] for sensor in left[1]["sensors"]} == {"l"}


@pytest.mark.parametrize(
    "choices, named",
    [
        ({"fulcrum_m": 0.2}, "fulcrum_m"),
        ({"leg": "myoleg"}, "myolegs26"),
        ({"side": "r"}, "right or left"),
        ({"residuum_m": 0.05}, "residuum_m"),
        ({"residuum_m": 0.36}, "between 0.1 and 0.357 m"),
        ({"residuum_m": float("nan")}, "residuum_m"),
    ],
)
def test_what_cannot_be_built_is_refused(choices, named):
    with pytest.raises(InputError, match=named):
        transtibial(NOMINAL, **{"fulcrum_m": 0.108} | choices)


def test_step_with_which_the_foot_is_unsteady_is_refused(device):
    model = on_hand_made_leg(device)
    prepare(model)
    model.opt.timestep = 1.1 * STEP_S
    with pytest.raises(InputError, match=r"opt\.timestep.*0\.002 s or less"):
        prepare(model)


def test_model_without_the_device_is_refused():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    for function in (prepare, touch_sums):
        with pytest.raises(InputError, match="variable-stiffness foot"):
            function(model)


@pytest.mark.parametrize("integrator", ["mjINT_EULER", "mjINT_IMPLICITFAST"])
@pytest.mark.parametrize(
    "fulcrum_m, step_s",
    [(0.066, STEP_S), (0.108, STEP_S), (0.151, STEP_S), (0.108, 0.5 * STEP_S)],
)
def test_body_dropped_on_it_comes_to_rest_on_foam_of_the_stated_stiffness(
    device, fulcrum_m, step_s, integrator
):
    """From 20 mm. The touch sensors feel what the floor feels, in the air nothing; in the end that
    is the weight, and the depths times the stiffnesses of the foam."""
    model = on_hand_made_leg(device, drop_m=0.02, fulcrum_m=fulcrum_m)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    model.opt.timestep = step_s
    prepare(model)
    data, sum_up = mujoco.MjData(model), touch_sums(model)
    total = []
    for _ in range(round(2.0 / step_s)):
        mujoco.mj_step(model, data)
        sum_up(data)
        total.append(floor_force(model, data))
        felt = data.sensor("r_foot").data[0] + data.sensor("r_toes").data[0]
        assert felt == pytest.approx(total[-1], rel=1e-9, abs=1e-9)
    assert total[0] == 0.0
    assert not sum(warning.number for warning in data.warning)
    weight = model.body_mass.sum() * GRAVITY
    np.testing.assert_allclose(total[-50:], weight, rtol=2e-3)
    stiffness = model.numeric(f"{DEVICE}_sphere_stiffness").data
    foam = 0.0
    for contact in data.contact:
        (name,) = (model.geom(i).name for i in contact.geom if i != model.geom("floor").id)
        foam -= stiffness[int(name.rpartition("_")[2])] * contact.dist
    assert foam == pytest.approx(weight, rel=5e-3)
    # the whole energy of the fall in all spheres at once, on a rigid keel, without damping
    most = weight * (1.0 + np.sqrt(1.0 + 2.0 * stiffness.sum() * 0.02 / weight))
    assert weight < max(total) < most


def combined(device, model, *, export_xml=None, **choices):
    from assist_sim import DeviceConfig  # noqa: PLC0415 - optional
    from assist_sim.combine import ModelCombiner  # noqa: PLC0415

    file, _ = device(**choices)
    spec = leg_of(model)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
    config = DeviceConfig.from_yaml(str(file))
    return ModelCombiner().combine(spec, config, msk_key=model, export_xml=export_xml)


def leg_of(model):
    from assist_sim import resolve_model_path  # noqa: PLC0415 - optional

    return resolve_model_path(model, "KFoot_L1")[0]


def lengths(model, data, knee):
    """Of all muscles (m), with the right knee flexed by `knee` (rad) and what follows it."""
    mujoco.mj_resetData(model, data)
    joint = model.joint("knee_angle_r")
    flexed = knee if joint.range[1] > 1.0 else -knee
    data.qpos[joint.qposadr[0]] = flexed
    for i in range(model.neq):
        if model.eq_obj2id[i] == joint.id and model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            at = model.jnt_qposadr[model.eq_obj1id[i]]
            data.qpos[at] = model.qpos0[at] + np.polyval(model.eq_data[i, 4::-1], flexed)
    mujoco.mj_forward(model, data)
    return {model.actuator(i).name: data.actuator_length[i] for i in range(model.nu)}


@with_assist_sim
@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("model, leg", COMBINED)
def test_numbers_of_the_leg_are_those_of_myo_sim(model, leg, side):
    host, s = LEGS[leg], side[0]
    known = leg_of(model).compile()
    data = mujoco.MjData(known)
    mujoco.mj_forward(known, data)
    shank = known.body(f"tibia_{s}")
    R_WS, origin = data.body(shank.id).xmat.reshape(3, 3), data.body(shank.id).xpos
    foot = [known.body(f"{name}_{s}").id for name in ("talus", "calcn", "toes")]
    assert shank.mass[0] == pytest.approx(host.shank_mass_kg)
    assert known.body_mass[foot].sum() == pytest.approx(host.foot_mass_kg, rel=1e-6)
    np.testing.assert_allclose(known.body(f"talus_{s}").pos, [host.ankle_x_m, -SHANK_M, 0.0])
    mirror = [1.0, 1.0, 1.0 if s == "r" else -1.0]
    for calf in host.calves:
        end = data.site(calf.site.format(s=s)).xpos
        np.testing.assert_allclose(
            R_WS.T @ (end - origin), calf.end_m * np.array(mirror), atol=1e-5
        )
        muscle = known.actuator(calf.name.format(s=s))
        np.testing.assert_allclose(muscle.lengthrange, calf.lengths_m, atol=1e-6)
        tendon = muscle.trnid[0]
        points = data.wrap_xpos.reshape(-1, 3)[data.ten_wrapadr[tendon] :]
        above = points[data.ten_wrapnum[tendon] - 2]
        np.testing.assert_allclose(
            R_WS.T @ (above - origin), calf.above_m * np.array(mirror), atol=1e-5
        )
    lowest = []
    for i in range(known.ngeom):
        if known.geom_bodyid[i] in foot and known.geom_contype[i]:
            # a mesh by its corners, anything else by its bounding box in the shank
            R_SG = R_WS.T @ data.geom_xmat[i].reshape(3, 3)
            at = (R_WS.T @ (data.geom_xpos[i] - origin))[1]
            size = known.geom_size[i]
            if known.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = known.geom_dataid[i]
                start = known.mesh_vertadr[mesh]
                corners = known.mesh_vert[start : start + known.mesh_vertnum[mesh]]
                lowest.append(at + (corners @ R_SG[1]).min())
            elif known.geom_type[i] == mujoco.mjtGeom.mjGEOM_CAPSULE:
                lowest.append(at - size[0] - size[1] * abs(R_SG[1, 2]))
            else:
                lowest.append(at - np.linalg.norm(R_SG[1] * size))
    assert min(lowest) == pytest.approx(-host.sole_m, abs=1e-5)


@with_assist_sim
@pytest.mark.parametrize("model, leg", COMBINED)
def test_amputation_takes_the_muscles_of_the_ankle_and_leaves_the_others_as_they_were(
    device, model, leg, recwarn
):
    """Calf: moment arm at the knee within 0.5 mm, and the share of its range within 1 %, up to 100
    degrees; with the ankle as it stands straight."""
    after, data = combined(device, model, leg=leg)
    assert not recwarn.list
    before = leg_of(model).compile()
    known = mujoco.MjData(before)
    straight = lengths(before, known, 0.0)
    assert straight.keys() - lengths(after, data, 0.0).keys() == {f"{name}_r" for name in LOST[leg]}
    calves = [calf.name.format(s="r") for calf in LEGS[leg].calves]
    for knee in (0.0, 0.5, 1.2, 1.75):
        own, others = lengths(after, data, knee), lengths(before, known, knee)
        flexed_own, flexed = lengths(after, data, knee + 1e-4), lengths(before, known, knee + 1e-4)
        for name in own:
            if name in calves:
                arm, arm_before = flexed_own[name] - own[name], flexed[name] - others[name]
                assert arm / 1e-4 == pytest.approx(arm_before / 1e-4, abs=5e-4), (name, knee)
                shares = [
                    (length - low) / (high - low)
                    for length, (low, high) in (
                        (own[name], after.actuator(name).lengthrange),
                        (others[name], before.actuator(name).lengthrange),
                    )
                ]
                assert shares[0] == pytest.approx(shares[1], abs=0.01), (name, knee)
            else:
                assert own[name] == pytest.approx(others[name], abs=1e-12), (name, knee)


@with_assist_sim
@pytest.mark.parametrize("model, leg", COMBINED)
def test_foot_is_the_same_in_the_file_that_assist_sim_exports_and_caches(
    device, model, leg, tmp_path
):
    """To the six digits that it writes, and so what `prepare` gives it."""
    known = combined(device, model, leg=leg, export_xml=str(tmp_path / "leg.xml"))[0]
    read = mujoco.MjModel.from_xml_path(str(tmp_path / "leg.xml"))
    for one in (known, read):
        one.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        prepare(one)
    own = {
        "geom": [i for i in range(known.ngeom) if known.geom(i).name.startswith(DEVICE)],
        "body": [i for i in range(known.nbody) if known.body(i).name.startswith(DEVICE)],
        "dof": [i for i, name in enumerate(joint_names(known)) if name.startswith(DEVICE)],
        "tendon": known.tendon(f"{DEVICE}_vsf_support").id,
    }
    for field in (
        *("geom_margin", "geom_friction", "geom_solref", "geom_solimp", "geom_priority"),
        *("geom_contype", "geom_conaffinity", "geom_condim", "geom_size"),
        *("body_mass", "body_inertia", "body_pos", "body_quat"),
        *("dof_damping", "dof_armature", "dof_frictionloss"),
        *("tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_lengthspring"),
    ):
        at = own[field.split("_", maxsplit=1)[0]]
        np.testing.assert_allclose(
            getattr(read, field)[at], getattr(known, field)[at], rtol=2e-5, atol=2e-8, err_msg=field
        )


@with_assist_sim
@pytest.mark.parametrize("model, leg", COMBINED)
def test_person_whose_joints_are_held_stands_on_it(device, model, leg):
    """All of the person's joints held but the height, dropped from 10 mm on the prosthesis alone,
    with the host's own integrator and step."""
    person, data = combined(device, model, leg=leg)
    assert person.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    person.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    assert person.opt.timestep == STEP_S
    prepare(person)
    sum_up = touch_sums(person)

    mujoco.mj_resetData(person, data)
    mujoco.mj_forward(person, data)
    own = [person.geom(i).name.startswith(DEVICE) for i in range(person.ngeom)]
    own[person.geom("floor").id] = True
    person.geom_contype[np.logical_not(own)] = 0
    person.geom_conaffinity[np.logical_not(own)] = 0
    data.eq_active[:] = 0
    held = np.array([not name.startswith(DEVICE) for name in joint_names(person)])
    spheres = [i for i in range(person.ngeom) if person.geom(i).name.startswith(f"{DEVICE}_foam")]
    bottom = (data.geom_xpos[spheres, 2] - person.geom_size[spheres, 0]).min()
    if person.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE:
        height = 2
    else:
        height = person.joint("pelvis_ty").id
    held[height] = False
    data.qpos[height] += 0.01 - bottom
    person.dof_armature[held] = 1e6
    total = []
    for _ in range(round(2.0 / STEP_S)):
        mujoco.mj_step(person, data)
        total.append(floor_force(person, data))
    sum_up(data)
    assert not sum(warning.number for warning in data.warning)
    weight = person.body_mass.sum() * GRAVITY
    np.testing.assert_allclose(total[-50:], weight, rtol=5e-3)
    felt = data.sensor("r_foot").data[0] + data.sensor("r_toes").data[0]
    assert felt == pytest.approx(total[-1], rel=1e-9)


def joint_names(model):
    """One for each degree of freedom."""
    return [model.joint(i).name for i in model.dof_jntid]


def run_guide(count):
    """The names that the first `count` blocks of the guide leave."""
    blocks = re.findall(
        r"^```(?:{code-block} )?python\n(.*?)^```$", GUIDE.read_text("utf-8"), re.M | re.S
    )
    names: dict = {}
    for block in blocks[:count]:
        exec(block, names)
    return names


def test_guide_writes_the_device(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_guide(1)
    assert {file.name for file in (tmp_path / "VSF").iterdir()} == {"config.yaml", "model.xml"}


@with_assist_sim
def test_guide_steps_the_leg_and_states_its_mass(tmp_path, monkeypatch):
    from assist_sim import load_msk  # noqa: PLC0415 - optional

    monkeypatch.chdir(tmp_path)
    after, before = run_guide(2)["model"], load_msk("myolegs26")[0]
    shank = sum(before.body(f"{name}_r").mass[0] for name in ("tibia", "talus", "calcn", "toes"))
    now = shank + after.body_mass.sum() - before.body_mass.sum()
    assert f"weighs {now:.1f} kg in place of {shank:.1f} kg" in " ".join(GUIDE.read_text().split())
