"""A shown model stands where its controls say, and its sliders lead it."""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import sys
import time

import numpy as np
import pytest
from meshcat_page import commands
from pydrake.geometry import Meshcat

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.report.show.drawing import open_meshcat
from vsf_drake.report.show.scene import (
    KINDS,
    RESET,
    RISE,
    SPHERES,
    STOP,
    SUPPORT,
    Scene,
    Viewer,
    gate,
    platen_travel,
)
from vsf_drake.simulation.bench import keel_shape

MODEL = ModelParameters()
SUBJECT = Subject(mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side="right")


class Clicked(Meshcat):
    """A Meshcat whose buttons a test presses."""

    clicks: dict[str, int]

    def GetButtonClicks(self, name):
        return self.clicks.get(name, 0)


@pytest.fixture(scope="module")
def meshcat():
    return open_meshcat()


def scene_of(meshcat, what, **options):
    meshcat.Delete()
    meshcat.DeleteAddedControls()
    return Scene(meshcat, what, MODEL, SUBJECT if what == "person" else None, **options)


def position(scene, body):
    return body.EvalPoseInWorld(scene.plant_context).translation()


def bottoms(scene, sites):
    context = scene.plant_context
    return [
        (scene.plant.get_body(body).EvalPoseInWorld(context) @ centre)[2] - radius
        for body, centre, radius in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
    ]


def test_the_platen_presses_the_foam_by_what_the_load_asks(meshcat):
    scene = scene_of(meshcat, "bench")
    loaded = scene.rest | {"fulcrum": 66.0, "load at the toe": 600.0}
    shape = scene.place(loaded)
    rise = keel_shape(MODEL.foot, fulcrum_m=0.066, load_n=600.0).load_point_K[1]
    assert shape.load_point_K[1] == rise
    travel = position(scene, scene.platen.child_body())[2] + MODEL.foot.build_height_m
    assert travel == pytest.approx(platen_travel(MODEL.foot, shape, 600.0))
    assert travel - rise == pytest.approx(600.0 / MODEL.foot.series_stiffness_n_per_m)


@pytest.mark.parametrize("what", KINDS)
def test_every_joint_of_the_model_has_a_control_or_is_bent_by_the_load(meshcat, what):
    scene = scene_of(meshcat, what)
    joints = [scene.plant.get_joint(i) for i in scene.plant.GetJointIndices()]
    moving = {joint.name() for joint in joints if joint.num_positions()}
    named = {control.name for control in scene.controls}
    assert moving - named - set(scene.foot.keel_joint_names) == (
        {"platen"} if what == "bench" else set()
    )
    assert named - moving == {"load at the toe"}
    single = scene_of(meshcat, what, keel_joints=True)
    assert {c.name for c in single.controls} - named == set(scene.foot.keel_joint_names)
    assert all(c.low <= c.rest <= c.high and c.step > 0 for c in single.controls)
    scene.place(scene.rest)
    # the unloaded sole stands on the ground; the slider of pelvis_ty has steps of 0.1 mm
    if what != "bench":
        assert min(bottoms(scene, scene.foot.sites)) == pytest.approx(0.0, abs=1e-3)


def test_sliders_lead_the_person_in_their_units(meshcat):
    scene = scene_of(meshcat, "person")
    viewer = Viewer(scene, pytest.fail)
    for label, value in (
        ("knee_angle_l (°)", 60.0),
        ("socket_tz (mm)", -8.0),
        ("fulcrum (mm)", 140.0),
        ("pelvis_tx (m)", 0.25),
        ("load at the toe (N)", 400.0),
    ):
        meshcat.SetSliderValue(label, value)
    assert viewer.poll()
    plant, context = scene.plant, scene.plant_context
    assert plant.GetJointByName("knee_angle_l").get_angle(context) == pytest.approx(
        math.radians(60.0)
    )
    assert plant.GetJointByName("socket_tz").get_translation(context) == pytest.approx(-0.008)
    assert plant.GetJointByName("fulcrum").get_translation(context) == pytest.approx(0.140)
    assert plant.GetJointByName("pelvis_tx").get_translation(context) == pytest.approx(0.25)
    expected = keel_shape(MODEL.foot, fulcrum_m=0.140, load_n=400.0)
    angles = [plant.GetJointByName(name).get_angle(context) for name in scene.foot.keel_joint_names]
    np.testing.assert_allclose(angles, expected.angles, atol=1e-12)


def test_the_same_load_bends_more_when_the_fulcrum_slides_back_and_the_page_says_how_much(meshcat):
    scene = scene_of(meshcat, "foot", keel_joints=True)
    viewer = Viewer(scene, pytest.fail)
    meshcat.SetSliderValue("load at the toe (N)", 500.0)
    tips = {}
    for fulcrum_mm in (151.0, 66.0):
        meshcat.SetSliderValue("fulcrum (mm)", fulcrum_mm)
        viewer.poll()
        tips[fulcrum_mm] = position(scene, scene.foot.keel[-1])[2]
        expected = keel_shape(MODEL.foot, fulcrum_m=1e-3 * fulcrum_mm, load_n=500.0)
        assert meshcat.GetSliderValue(RISE) == pytest.approx(
            1e3 * expected.load_point_K[1], abs=0.005
        )
        assert meshcat.GetSliderValue(SUPPORT) == pytest.approx(expected.support_force_n, abs=0.5)
    assert tips[66.0] - tips[151.0] > 0.02
    meshcat.SetSliderValue(RISE, 3.0)
    viewer.poll()
    assert meshcat.GetSliderValue(RISE) > 30.0, (
        "a number that is shown was moved by hand and stayed there"
    )
    meshcat.SetSliderValue("keel_8 (° added)", 10.0)
    viewer.poll()
    # a joint does not move its own place
    assert position(scene, scene.foot.keel[-1])[2] == pytest.approx(tips[66.0])
    last = keel_shape(MODEL.foot, fulcrum_m=0.066, load_n=500.0).angles[8] + math.radians(10.0)
    assert scene.plant.GetJointByName("keel_8").get_angle(scene.plant_context) == pytest.approx(
        last
    )


def test_buttons_reset_and_end():
    meshcat = Clicked()
    meshcat.clicks = {}
    scene = Scene(meshcat, "foot", MODEL)
    viewer = Viewer(scene, pytest.fail)
    meshcat.SetSliderValue("load at the toe (N)", 300.0)
    viewer.poll()
    assert viewer.values() != scene.rest
    meshcat.clicks[RESET] = 1
    assert viewer.poll()
    assert viewer.values() == scene.rest
    assert meshcat.GetSliderValue(SUPPORT) == 0.0
    for clicks, shown in ((1, True), (2, False)):
        meshcat.clicks[SPHERES] = clicks
        viewer.poll()
        said = {
            c["path"]: c["value"]
            for c in commands(meshcat.StaticHtml())
            if c.get("property") == "visible"
        }
        assert said["/model/vsf/vsf_frame/vsf/site_0"] is shown
        assert said["/model/vsf/keel_body_8/vsf/sole"] is not shown
    meshcat.clicks[STOP] = 1
    assert not viewer.poll()


def test_what_cannot_be_shown_and_a_port_that_cannot_be_had_are_refused(meshcat):
    for what, subject, said in (
        ("leg", None, "foot, bench, person"),
        ("foot", SUBJECT, "--subject"),
        ("person", None, "--subject"),
    ):
        with pytest.raises(InputError, match=said):
            Scene(meshcat, what, MODEL, subject)
    with gate(meshcat) as address:
        port = int(address.rpartition(":")[2])
        with (
            pytest.raises(InputError, match=f"port {port} could not be opened"),
            gate(meshcat, port),
        ):
            pass
    for port in (80, 70000):
        with pytest.raises(InputError, match="between 1024 and 65535"), gate(meshcat, port):
            pass


def asked(address, *headers):
    """First line of the answer to a request with these headers, and the connection."""
    connection = socket.create_connection(
        ("127.0.0.1", int(address.rpartition(":")[2])), timeout=10
    )
    connection.sendall("\r\n".join(["GET / HTTP/1.1", *headers, "", ""]).encode())
    return connection.recv(100).partition(b"\r\n")[0], connection


SOCKET = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


@pytest.mark.parametrize("upgrade", [(), SOCKET], ids=["page", "web socket"])
def test_another_origin_and_another_host_are_refused(meshcat, upgrade):
    with gate(meshcat) as address:
        own = address.removeprefix("http://")
        port = own.partition(":")[2]
        foreign = [
            (f"Host: {own}", "Origin: http://evil.example"),
            (f"Host: {own}", "Origin: null"),
            (f"Host: {own}", f"Origin: http://localhost:{int(port) - 1}"),
            (f"Host: {own}", f"Origin: https://{own}"),
            (f"Host: evil.example:{port}", f"Origin: http://evil.example:{port}"),
            (f"Host: {own}", "Host: evil.example"),
            (f"Host: localhost.evil.example:{port}",),
            (),
        ]
        ours = [(f"Host: {own}", f"Origin: http://{own}"), (f"Host: 127.0.0.1:{port}",)]
        for headers in (*foreign, *ours):
            line, connection = asked(address, *headers, *upgrade)
            connection.close()
            assert (
                b" 403 " if headers in foreign else b" 101 " if upgrade else b" 200 "
            ) in line, headers


def test_a_slider_moved_in_the_browser_arrives_through_the_gate(meshcat):
    """As Drake's page sends it: a masked frame of MessagePack."""
    Viewer(scene_of(meshcat, "foot"), pytest.fail)
    name = b"fulcrum (mm)"
    message = (
        b"\x83\xa4type\xa6slider\xa4name"
        + bytes([0xA0 + len(name)])
        + name
        + b"\xa5value"
        + b"\xcb"
        + struct.pack(">d", 72.0)
    )
    with gate(meshcat) as address:
        _, connection = asked(
            address, f"Host: {address.removeprefix('http://')}", f"Origin: {address}", *SOCKET
        )
        connection.sendall(b"\x82" + bytes([0x80 + len(message)]) + bytes(4) + message)
        # what the server says is read, but it need not say anything more
        connection.settimeout(0.1)
        deadline = time.monotonic() + 10.0
        while meshcat.GetSliderValue(name.decode()) != 72.0 and time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):
                connection.recv(1 << 16)
        connection.close()
    assert meshcat.GetSliderValue(name.decode()) == 72.0


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere only 127.0.0.1 is this machine")
def test_drakes_own_server_is_not_at_the_address_that_every_page_knows(meshcat):
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", meshcat.port()), timeout=10)
