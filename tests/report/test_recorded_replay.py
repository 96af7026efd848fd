"""Recordings to play: the person where the recording has it, markers where the cameras saw them,
what is wrong where it is."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import chromium, look
from meshcat_page import commands, tracks

from vsf_drake.base.files import resource
from vsf_drake.motion.import_options import ImportOptions
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.segments import Gap
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import load_trial
from vsf_drake.recording.import_walks import gather, import_walks
from vsf_drake.report.import_outputs import force_figure, marker_figures, normal_of
from vsf_drake.report.recorded_replay import (
    ELSEWHERE,
    LONGEST_S,
    RATE_HZ,
    UNUSED,
    USED,
    flaws,
    write_recordings,
)
from vsf_drake.report.style import MARK_COLOURS

C3D = resource("data/reference_subject/c3d")
SESSIONS = Path(__file__).resolve().parents[2] / "data" / "sessions"


@pytest.fixture(scope="module")
def imported():
    """Two walks with markers; of the first, one marker is hidden for a while and one has no
    role."""
    files = gather(C3D / "static.c3d", [C3D / "low_1.c3d", C3D / "high_1.c3d"], ())
    person = PersonFacts(sex="male", prosthetic_side="right")
    items = import_walks(files, ImportOptions(person=person, fulcrum_mm=(66.0,))).items
    trial = items[0].trial
    label, other = list(trial.calibration.segments["thigh_left"].labels)[:2]
    markers = {name: x.copy() for name, x in trial.recording.markers.items()}
    time = trial.recording.marker_time_s
    hidden = (time > 0.5) & (time < 0.7)
    markers[label][hidden] = np.nan
    markers["HEAD"] = markers[other] + [0.0, 0.0, 1.0]
    gap = Gap(label, 0.5, 0.7, "rigid cluster")
    changed = dataclasses.replace(
        trial,
        recording=dataclasses.replace(trial.recording, markers=markers),
        tracked=dataclasses.replace(trial.tracked, gaps=(gap,)),
    )
    return [dataclasses.replace(items[0], trial=changed), items[1]], label


@pytest.fixture(scope="module")
def page(imported, tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "replay.html"
    write_recordings(imported[0], path)
    return path.read_text(encoding="utf-8")


def frames_of(item):
    return round((item.trial.end_s - item.trial.start_s) * RATE_HZ - 0.5) + 1


def test_walks_are_one_after_another_and_the_pelvis_is_where_the_recording_has_it(imported, page):
    frames, places = tracks(page)["/walk/pelvis"]["position"]
    first = 0
    for item in imported[0]:
        trial = item.trial
        count = frames_of(item)
        time = trial.start_s + np.arange(count) / RATE_HZ
        q = trial.trajectory.ordered(("pelvis_tx", "pelvis_tz", "pelvis_ty")).sample(time)[0]
        np.testing.assert_allclose(places[first : first + count], q * [1, -1, 1], atol=1e-9)
        first += count
    np.testing.assert_array_equal(frames, np.arange(first))


def test_markers_are_where_the_cameras_saw_them_and_hidden_in_their_gap(imported, page):
    item, label = imported[0][0], imported[1]
    trial = item.trial
    number = list(trial.recording.markers).index(label)
    track = tracks(page)[f"/markers/marker_{number}"]
    time = trial.start_s + np.arange(frames_of(item)) / RATE_HZ
    inside = (time > 0.5) & (time < 0.7)
    clock, seen = trial.recording.marker_time_s, trial.recording.markers[label]
    for column in range(3):
        own = np.interp(time[~inside], clock, seen[:, column])
        away = np.abs(track["position"][1][~inside, column] - own)
        assert np.nanmax(away) < 1e-6
    changes = dict(zip(*(np.asarray(each).tolist() for each in track["visible"]), strict=True))
    shown = [changes[max(k for k in changes if k <= i)] for i in range(len(time))]
    assert not any(np.array(shown)[inside])
    frames = tracks(page)["/markers1/marker_0"]["position"][0]
    assert frames[0] == len(time), "those of the second walk begin with it"
    # the samples beside the gap hide the frames between them and it
    assert sum(shown) >= np.count_nonzero(~inside) - 2


def test_markers_without_a_role_are_grey(imported, page):
    labels = list(imported[0][0].trial.recording.markers)
    colours = {
        command["path"]: command["object"]["materials"][0]["color"]
        for command in commands(page)
        if command["type"] == "set_object" and "/markers/marker_" in command["path"]
    }
    grey, green = (
        sum(round(255 * part) << shift for part, shift in zip(rgb, (16, 8, 0), strict=True))
        for rgb in (UNUSED, USED)
    )
    head = colours.pop(f"/markers/marker_{labels.index('HEAD')}")
    assert head == pytest.approx(grey, abs=0x010101)
    assert all(colour == pytest.approx(green, abs=0x010101) for colour in colours.values())


def test_a_gap_and_an_unknown_force_are_marked_where_they_are(imported, page):
    item, label = imported[0][0], imported[1]
    [gap] = [flaw for flaw in flaws(item) if label in flaw.text]
    assert (gap.start_s, gap.end_s, gap.colour) == (0.5, 0.7, MARK_COLOURS["doubtful"])
    start, lasts = item.trial.start_s, (frames_of(item) - 1) / RATE_HZ
    x = 1000.0 * (0.5 - start) / lasts
    assert f'<rect x="{x:.1f}" width="{1000 * 0.2 / lasts:.1f}"' in page
    assert f"0.50 to 0.70 s: {label} not seen, filled by rigid cluster" in page
    unknown = dataclasses.replace(
        item.trial, unmeasured={"right": ((0.1, 0.3),), "left": ((0.5, 0.7), (0.8, 0.9))}
    )
    unseen = flaws(dataclasses.replace(item, trial=unknown))
    found = {(f.start_s, f.end_s): f for f in unseen if "force" in f.text}
    # what the intact foot does beside the plates is no fault, and the worse of two colours wins
    assert {span: f.colour for span, f in found.items()} == {
        (0.1, 0.3): MARK_COLOURS["doubtful"],
        (0.5, 0.7): MARK_COLOURS["doubtful"],
        (0.8, 0.9): ELSEWHERE,
    }
    assert label in found[0.5, 0.7].text
    bands = {
        round(patch.get_x(), 3) for patch in force_figure(item).axes[0].patches if patch.get_hatch()
    }
    assert 0.5 in bands


def test_of_a_long_walk_the_beginning_is_shown(imported, page, tmp_path):
    trial = imported[0][1].trial
    slow = np.linspace(0.0, 40.0, len(trial.trajectory.time_s))
    long = dataclasses.replace(
        trial,
        start_s=1.0,
        end_s=39.0,
        trajectory=CoordinateTrajectory(slow, trial.trajectory.values, trial.trajectory.names),
    )
    write_recordings([dataclasses.replace(imported[0][1], trial=long)], tmp_path / "long.html")
    shown = (tmp_path / "long.html").read_text(encoding="utf-8")
    assert len(tracks(shown)["/walk/pelvis"]["position"][0]) == LONGEST_S * RATE_HZ + 1


def test_walks_without_plates_are_to_be_seen(imported, tmp_path):
    item = imported[0][0]
    bare = dataclasses.replace(item, trial=dataclasses.replace(item.trial, plates={}))
    write_recordings([bare], tmp_path / "bare.html")
    assert tracks((tmp_path / "bare.html").read_text("utf-8"))["/walk/pelvis"]


def test_the_map_names_every_label_with_its_role_beside_where_it_stood(imported):
    trial = imported[0][0].trial
    figures = marker_figures(trial)
    texts, others = ({text.get_text() for text in figure.axes[0].texts} for figure in figures)
    assert texts == others
    assert len(texts) == len(trial.calibration.standing_W)
    roles = trial.calibration.roles
    assert f"{roles['knee_lateral_left']}: knee lateral left" in texts
    # the ankles stand on the shanks: a hand's breadth above the floor
    ankle = trial.calibration.standing_W[roles["ankle_lateral_right"]]
    assert 0.02 < ankle[2] < 0.12
    assert marker_figures(load_trial(SESSIONS / "a/day_1/1p1/low_1.yaml")) == []


def test_able_bodied_lift_off_is_where_everybody_has_it(imported):
    """Stance is some 60 % of the gait cycle at usual speeds, and longer when slow."""
    gait, lift_off = normal_of(imported[0][0].trial)
    assert 0.58 < lift_off < 0.66
    assert gait.at("force_up", np.array([0.5 * lift_off]))[0] == pytest.approx(0.8, abs=0.1)
    fast = dataclasses.replace(imported[0][0].trial, end_s=imported[0][0].trial.start_s + 0.01)
    still = dataclasses.replace(
        fast,
        trajectory=fast.trajectory.with_values(
            np.tile(fast.trajectory.values[0], (len(fast.trajectory.time_s), 1))
        ),
    )
    assert normal_of(still) is None, "of no speed anything was published"


CLICKS = """
<script>
const wait = setInterval(() => {
  const part = id => document.getElementById(id), one = path => viewer.scene_tree.find(path).object;
  if (+part("time").max === 1) return;  // not ready yet
  clearInterval(wait);
  part("part").value = 1;
  part("part").dispatchEvent(new Event("change"));
  const found = {from: +part("time").min, to: +part("time").max, time: viewer.animator.time,
                 seen: [one(["markers"]).visible, one(["markers1"]).visible]};
  viewer.animator.clock.getDelta = () => 0.02;  // a frame, however busy the machine is
  viewer.animator.seek(found.to + 0.001);
  viewer.animator.display_progress(found.to + 0.001);
  viewer.animate();
  found.again = viewer.animator.actions.map(action => action.time);
  console.log("FOUND" + JSON.stringify(found) + "END");
}, 50);
</script>
"""


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_another_walk_is_chosen_and_begins_again_at_its_end(imported, page, tmp_path):
    (tmp_path / "clicked.html").write_text(page.replace("</body>", CLICKS + "</body>"))
    (tmp_path / "browser").mkdir()
    seen = look(tmp_path / "clicked.html", tmp_path / "browser", width=700, budget_ms=1500)
    [found] = [
        json.loads(re.search("FOUND(.*)END", line)[1]) for line in seen.console if "FOUND" in line
    ]
    counts = [frames_of(item) for item in imported[0]]
    assert found["from"] == pytest.approx(counts[0] / RATE_HZ)
    assert found["to"] == pytest.approx((sum(counts) - 1) / RATE_HZ)
    assert found["seen"] == [False, True]
    longest = max(found["again"])
    assert longest == pytest.approx(found["from"], abs=0.05)
    assert not [line for line in seen.console if "ERROR" in line or "Uncaught" in line]
    assert not seen.requests and not seen.out
