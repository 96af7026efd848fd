"""The replay: one page without a network, in which every body is where forward kinematics puts
it."""

from __future__ import annotations

import dataclasses
import functools
import json
import re
import socket

import numpy as np
import pytest
from browser import chromium, look
from made_results import MASS_KG, make_walk
from markupsafe import escape
from meshcat_page import commands, tracks
from pydrake.multibody.tree import PrismaticJoint

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import to_plain
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.foot_visuals import SPHERE
from vsf_drake.plants.gait import make_gait
from vsf_drake.report import replay
from vsf_drake.report.replay import LOADED, make_frames, walk_replay
from vsf_drake.report.show.drawing import open_meshcat
from vsf_drake.simulation.results import load_walk, save_walk

STEP_S, SAMPLES, RATE_HZ = 0.01, 25, 50.0
OFFSETS = GeometricOffsets(height_m=-0.003, fore_aft_m=0.01, alignment_rad=0.05)
WEIGHT_N = 9.81 * MASS_KG
FORCE_W = np.array([0.3, -0.1, 1.0]) * WEIGHT_N


def subject(side):
    return Subject(mass_kg=MASS_KG, stature_m=1.8, sex="male", prosthetic_side=side)


@functools.cache
def gait(side):
    return make_gait(subject(side), ModelParameters())


def short_walk(side="right", **changes):
    """A quarter of a second of smooth arbitrary motion of every joint; the foot is loaded in its
    second half."""
    plant = gait(side).plant
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    names = tuple(
        joint.name()
        for joint in sorted(joints, key=lambda j: j.position_start())
        if joint.num_positions()
    )
    time = 0.4 + STEP_S * np.arange(SAMPLES)
    rng = np.random.default_rng(3)
    size = 0.3 * rng.uniform(-1.0, 1.0, len(names))
    q = size * np.sin(5.0 * time[:, None] + rng.uniform(0.0, 6.0, len(names)))
    q[:, names.index("pelvis_tx")] = 1.3 * time
    q[:, names.index("pelvis_ty")] = 1.0
    loaded = time >= 0.52 - 1e-9
    cop = np.where(loaded[:, None], np.column_stack([time, 0.0 * time + 0.1, 0.0 * time]), np.nan)
    normal = np.zeros((SAMPLES, 24))
    normal[loaded, 5] = 0.025 * WEIGHT_N
    normal[loaded, 6] = 0.30 * WEIGHT_N
    values = {
        "coordinate_names": names,
        "q": q,
        "v": np.zeros_like(q),
        "generalized_force": np.zeros_like(q),
        "side": side,
        "grf_W": np.outer(loaded, FORCE_W),
        "cop_W": cop,
        "sphere_normal_n": normal,
        "fulcrum_m": np.full(SAMPLES, 0.108),
        "parameters": {
            "subject": to_plain(subject(side)),
            "model": to_plain(ModelParameters()),
            "offsets": to_plain(OFFSETS),
            "fulcrum_m": 0.108,
        },
    }
    walk = make_walk(
        start_s=0.4 - STEP_S,
        end_s=0.4 + STEP_S * (SAMPLES - 1),
        step_s=STEP_S,
        **(values | changes),
    )
    np.testing.assert_allclose(walk.time_s, time)
    return walk


def plate():
    """A constant force of one body weight upward, at 1 kHz, only up to 0.5 s."""
    time = 0.001 * np.arange(501)
    return PlateRecording(
        time,
        np.tile([0.0, 0.0, WEIGHT_N], (501, 1)),
        np.tile([0.5, 0.2, 0.0], (501, 1)),
        np.zeros(501),
        True,
    )


def replay_page(walk, **options):
    return walk_replay(walk, frame_rate_hz=RATE_HZ, **options)


def rotation(quaternion):
    """Matrix of three.js's quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize("side", ["left", "right"])
def test_bodies_are_where_forward_kinematics_puts_them(tmp_path, side):
    save_walk(short_walk(side), tmp_path / "walk")
    walk = load_walk(tmp_path / "walk")
    page = replay_page(walk)
    animation, model = tracks(page), gait(side)
    context = model.plant.CreateDefaultContext()
    set_mount(
        context,
        model.person.foot,
        height=OFFSETS.height_m,
        fore_aft=OFFSETS.fore_aft_m,
        alignment=OFFSETS.alignment_rad,
    )
    bodies = [
        *model.person.segments.values(),
        *model.person.foot.keel,
        model.person.foot.frame,
        model.person.socket.socket,
        model.person.socket.pylon,
        model.plant.GetBodyByName("vsf_carriage"),
    ]
    every = round(1.0 / (RATE_HZ * STEP_S))
    for i, q in enumerate(walk.q[::every]):
        for name, value in zip(walk.coordinate_names, q, strict=True):
            joint = model.plant.GetJointByName(name)
            move = joint.set_translation if isinstance(joint, PrismaticJoint) else joint.set_angle
            move(context, value)
        for body in bodies:
            pose, track = body.EvalPoseInWorld(context), animation[f"/walk/{body.name()}"]
            frames, positions = track["position"]
            assert frames[i] == i
            np.testing.assert_allclose(positions[i], pose.translation(), atol=1e-9)
            np.testing.assert_allclose(
                rotation(track["quaternion"][1][i]), pose.rotation().matrix(), atol=1e-9
            )
    moving = {
        path
        for path, track in animation.items()
        if path.startswith("/walk/") and "position" in track
    }
    arms = {f"{replay.WALK}/{replay.UPRIGHT}/arm_{arm}" for arm in ("left", "right")}
    assert moving == {f"/walk/{body.name()}" for body in bodies} | arms
    assert len(animation["/walk/pelvis"]["position"][0]) == (SAMPLES - 1) // every + 1
    # the trunk, drawn, is upright on average; arms swing against the legs
    [trunk] = [
        np.reshape(command["matrix"], (4, 4)).T
        for command in commands(page)
        if command.get("path") == f"{replay.WALK}/{replay.UPRIGHT}"
        and command["type"] == "set_transform"
    ]
    tilt = walk.column("pelvis_tilt")[::every].mean()
    cos, sin = np.cos(tilt), np.sin(tilt)
    np.testing.assert_allclose(
        trunk[:3, :3], [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]], atol=1e-12
    )
    for arm, thigh in (("left", "hip_flexion_r"), ("right", "hip_flexion_l")):
        turns = animation[f"{replay.WALK}/{replay.UPRIGHT}/arm_{arm}"]["quaternion"][1]
        swing = [2.0 * np.arctan2(-y, w) for x, y, z, w in turns]
        hip = walk.column(thigh)[::every]
        np.testing.assert_allclose(swing, replay.ARM_SWING * (hip - hip.mean()), atol=1e-9)
    # spheres take colour with their load
    # in linear light, as three.js keeps colours
    low, high = np.array(SPHERE[:3]) ** 2.2, np.array(LOADED) ** 2.2
    for i, share in ((4, 0.0), (5, 0.5), (6, 1.0)):
        body = model.plant.get_body(model.person.foot.sites.body_indices[i]).name()
        colours = animation[f"/walk/{body}/site_{i}/<object>"]["material.color"][1]
        np.testing.assert_allclose(colours[0], low)
        np.testing.assert_allclose(colours[-1], low + share * (high - low))


def test_frames_between_samples_are_interpolated():
    walk = short_walk()
    frames = make_frames(walk, plate=None, rate_hz=200.0)
    np.testing.assert_allclose(frames.q[1::2], 0.5 * (walk.q[1:] + walk.q[:-1]), atol=1e-12)
    np.testing.assert_allclose(frames.time_s[[0, -1]], walk.time_s[[0, -1]])
    for rate in (0.0, 1e9, float("nan")):
        with pytest.raises(InputError, match="frames per second"):
            make_frames(walk, plate=None, rate_hz=rate)
    unknown = dataclasses.replace(plate(), cop_W=np.full((501, 3), np.nan))
    assert (
        not make_frames(walk, plate=unknown, rate_hz=200.0)
        .forces["prosthetic measured"]
        .shown.any()
    )


def test_arrow_stands_at_the_centre_of_pressure_and_is_a_metre_for_a_body_weight(tmp_path):
    walk = short_walk(grf_W=np.tile(FORCE_W, (SAMPLES, 1)))
    animation = tracks(replay_page(walk))
    arrow = animation["/forces/prosthetic predicted/arrow"]
    np.testing.assert_array_equal(arrow["visible"][1], walk.time_s[::2] >= 0.52 - 1e-9)
    np.testing.assert_allclose(arrow["position"][1], walk.cop_W[12::2], atol=1e-12)
    tip = animation["/forces/prosthetic predicted/arrow/head"]["position"][1][-1]
    np.testing.assert_allclose(
        rotation(arrow["quaternion"][1][-1]) @ tip, FORCE_W / WEIGHT_N, atol=1e-9
    )
    assert "/forces/prosthetic measured/arrow" not in animation


def test_plate_is_drawn_beside_the_prediction_while_it_records(tmp_path):
    page = replay_page(short_walk(), plate=plate())
    arrow, head = (
        tracks(page)[f"/forces/prosthetic measured/arrow{part}"] for part in ("", "/head")
    )
    np.testing.assert_array_equal(arrow["visible"][1], np.arange(0.4, 0.6401, 0.02) <= 0.5 + 1e-9)
    np.testing.assert_allclose(arrow["position"][1], np.tile([0.5, 0.2, 0.0], (6, 1)))
    np.testing.assert_allclose(head["position"][1][-1], [0.0, 0.0, 1.0])
    assert "prosthetic foot, measured" in page and "intact foot, measured" not in page
    both = replay_page(short_walk(), plate=plate(), intact_plate=plate())
    assert "intact foot, measured" in both and "/forces/intact measured/arrow" in tracks(both)
    # it loads nothing from a network
    assert not re.findall(r"<(?:script|img|iframe|link|source)[^>]*\s(?:src|href)\s*=", page)
    assert not re.search(r"@import|fetch\(\s*[\"']https?:|new WebSocket\(\s*[\"']", page)
    assert 1e5 < len(page) < 15e6
    assert "UNFITTED" not in page
    shouted = replay_page(
        short_walk(
            synthetic=True, converged=False, unconverged_steps=3, notes=("UNFITTED: to <nobody>",)
        ),
        plate=plate(),
    )
    assert "<b>UNFITTED</b>" in shouted and "<li>UNFITTED: to &lt;nobody&gt;</li>" in shouted
    assert (
        re.search(r"<title>made-up walk: synthetic walk", shouted)
        and "3 STEPS NOT CONVERGED" in shouted
    )
    assert "prosthetic foot, reference (SYNTHETIC)" in shouted
    assert "measured<" not in shouted and "recorded walk" not in shouted


def test_a_walk_at_other_settings_is_played_one_at_a_time_and_the_plate_is_its_own_alone():
    walk = short_walk()
    stiff = dataclasses.replace(walk, fulcrum_m=np.full(SAMPLES, 0.151), grf_W=2.0 * walk.grf_W)
    page = replay_page(walk, plate=plate(), settings={0.108: walk, 0.151: stiff})
    frames = len(np.arange(0.4, 0.6401, 0.02))
    seen = tracks(page)
    own, other = (seen[f"/forces{part}/prosthetic predicted/arrow"] for part in ("", "1"))
    assert max(own["position"][0]) < frames <= min(other["position"][0])
    assert "/forces1/prosthetic measured/arrow" not in seen
    assert re.findall(r"<option value=.\d+.>(.*?)</option>", page) == [
        "fulcrum 108 mm",
        "fulcrum 151 mm",
    ]


def test_the_time_bar_has_ticks_on_the_clock_of_the_recording():
    page = replay_page(short_walk())
    ticks = re.findall(r'<span style="left:([\d.]+)%">([\d.]+)', page)
    assert len(ticks) >= 3
    for share, instant in ticks:
        assert 0.4 + 0.24 * float(share) / 100.0 == pytest.approx(float(instant), abs=1e-4)


def test_trial_name_is_text_and_nothing_else(tmp_path):
    name = r'</title><script>alert("1")</script> & \g<0>'
    page = replay_page(short_walk(trial_name=name))
    assert name not in page and '<script>alert("1")' not in page
    assert f"<title>{escape(name)}: recorded walk</title>" in page
    assert page.count(escape(name)) == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parameters": {"model": {}}}, "parameters.subject"),
        (
            {"parameters": {"subject": to_plain(subject("left")), "model": {}, "offsets": {}}},
            "ankle_angle_r",
        ),
        (
            {
                "sphere_normal_n": np.zeros((SAMPLES, 3)),
                "sphere_depth_m": np.zeros((SAMPLES, 3)),
                "sphere_friction_W": np.zeros((SAMPLES, 3, 2)),
            },
            "has 3 spheres",
        ),
    ],
)
def test_walk_that_cannot_be_shown_says_why(changes, words):
    with pytest.raises(InputError, match=re.escape(words)):
        walk_replay(short_walk(**changes))


def test_no_server_remains(tmp_path, monkeypatch):
    servers = []

    def noted():
        meshcat = open_meshcat()
        host, _, port = meshcat.web_url().removeprefix("http://").partition(":")
        servers.append((host, int(port)))
        with socket.socket() as client:
            assert client.connect_ex(servers[0]) == 0
        return meshcat

    monkeypatch.setattr(replay, "open_meshcat", noted)
    walk_replay(short_walk())
    with socket.socket() as client:
        assert client.connect_ex(servers[0]) != 0


CLICKS = """
<script>
const wait = setInterval(() => {
  const part = id => document.getElementById(id);
  if (+part("time").max === 1) return;  // not ready yet
  clearInterval(wait);
  const shown = path => viewer.scene_tree.find(path).object.visible;
  const sole = ["walk", "vsf_frame", "sole"], sphere = ["walk", "vsf_frame", "site_0"];
  part("time").value = 0.36;
  part("time").dispatchEvent(new Event("input"));
  setTimeout(() => {
    const pelvis = viewer.scene_tree.find(["walk", "pelvis"]).object.getWorldPosition(new MeshCat.THREE.Vector3());
    const found = {time: viewer.animator.time, playing: viewer.animator.playing, now: part("now").textContent,
                   aside: viewer.camera.parent.worldToLocal(pelvis).sub(viewer.controls.target).setY(0).length(),
                   foot: viewer.scene_tree.find(["walk", "vsf_frame"]).object.position.toArray(),
                   before: [shown(sole), shown(sphere)]};
    part("spheres").click();
    part("play").click();
    found.after = [shown(sole), shown(sphere)];
    found.plays = viewer.animator.playing;
    console.log("FOUND" + JSON.stringify(found) + "END");
  }, 200);
}, 50);
</script>
"""  # noqa: E501


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
@pytest.mark.parametrize("width", [1300, 390])
def test_the_time_bar_leads_the_walk_and_the_page_needs_nothing_else(tmp_path, width):
    walk = short_walk()
    page = replay_page(walk, plate=plate(), intact_plate=plate())
    last = (
        make_frames(walk, plate=None, rate_hz=RATE_HZ).forces["prosthetic predicted"].force_W[-1, 2]
    )
    (tmp_path / "clicked.html").write_text(
        page.replace("</body>", CLICKS + "</body>"), encoding="utf-8"
    )
    (tmp_path / "browser").mkdir()
    seen = look(
        tmp_path / "clicked.html", tmp_path / "browser", width=width, height=400, budget_ms=1500
    )
    [found] = [
        json.loads(re.search("FOUND(.*)END", line)[1]) for line in seen.console if "FOUND" in line
    ]
    assert found["time"] == pytest.approx(0.24), "the bar ends with the walk"
    assert not found["playing"] and found["plays"]
    assert found["now"] == f"0.640 s of the trial, fulcrum 108 mm, predicted {last:.0f} N"
    np.testing.assert_allclose(
        found["foot"], tracks(page)["/walk/vsf_frame"]["position"][1][-1], atol=1e-5
    )
    assert found["aside"] == pytest.approx(0.0, abs=1e-5), "the person is not in the middle"
    assert found["before"] == [True, False] and found["after"] == [False, True]
    assert not [line for line in seen.console if "ERROR" in line or "Uncaught" in line]
    assert not seen.requests and not seen.out and seen.scroll <= seen.width
