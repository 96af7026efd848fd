"""The story of a validation: its numbers against the saved arrays, and what a browser sees."""

from __future__ import annotations

import functools
import html
import json
import re
import shutil
import subprocess
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from browser import COMMAND, chromium, look
from command_line import read_json
from made_study import saved_section
from page_boxes import SIZES

from vsf_drake.base.files import plain
from vsf_drake.report.validation.story import moved_walk, story_chapter

needs_browser = pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
SCREENS = {1300: 1.0, 390: 2.0}
"""Screens that the story takes, by width: a desk's, and one thumb's scroll."""


@pytest.fixture(scope="module")
def moved(quick_validation):
    section = saved_section(quick_validation, "moved")
    return plain(section.table), dict(section.arrays)


def test_the_force_changes_by_nothing_where_the_walk_had_its_fulcrum_and_by_the_arrays_elsewhere(
    moved,
):
    table, arrays = moved
    frames = moved_walk(table, arrays)["frames"]
    own = [frame["moved-mm"] for frame in frames].index("108")
    assert (frames[own]["moved-change"], frames[own]["moved-push-off"]) == ("0", "0")
    force = arrays["resultant_model"]
    rms = 100.0 * np.linalg.norm(force[-1] - force[own]) / np.sqrt(101)
    assert frames[-1]["moved-change"] == f"{rms:.0f}"
    peaks = force[[own, -1], 50:].max(axis=1)
    assert frames[-1]["moved-push-off"] == f"{100.0 * (peaks[1] - peaks[0]):+.0f}"
    assert not any("error" in name for frame in frames for name in frame)


def test_push_off_is_of_the_second_half_of_stance_whatever_the_first_bears(moved):
    table, arrays = moved
    force = arrays["resultant_model"].copy()
    force[-1, 20] = 9.0
    spiked = moved_walk(table, arrays | {"resultant_model": force})["frames"][-1]
    assert spiked["moved-push-off"] == moved_walk(table, arrays)["frames"][-1]["moved-push-off"]


def test_the_arrow_of_a_load_is_as_long_as_the_load_is_large(moved):
    table, arrays = moved
    tails = []
    for frame in moved_walk(table, arrays)["frames"]:
        tail, head, *_ = (point.split(",") for point in frame["moved-arrow"].split())
        tails.append(float(tail[1]) - float(head[1]))
    load = arrays["load"][:, 0]
    np.testing.assert_allclose(tails, tails[-1] * load / load[-1], atol=0.2)


def test_the_drawn_fulcrum_stands_on_the_drawn_keel_and_moves_to_the_toe(moved):
    drawn = moved_walk(*moved)
    tips = []
    for frame in drawn["frames"]:
        keel = np.array([point.split(",") for point in frame["moved-keel"].split()], dtype=float)
        x, y = (float(place) for place in frame["moved-support"].split()[0].split(","))
        half = 0.5 * float(drawn["foot"]["wide_px"])
        assert np.interp(x, *keel.T) - y == pytest.approx(half, abs=0.2), "on its upper face"
        tips.append(x)
    assert (np.diff(tips) > 0.0).all()
    scale = (tips[-1] - tips[0]) / (151.0 - 66.0)  # px a mm
    keel_y = [float(frame["moved-keel"].split()[-1].split(",")[1]) for frame in drawn["frames"]]
    raised = moved[1]["keel_mm"][:, -1, 1]
    np.testing.assert_allclose(np.diff(keel_y), -scale * np.diff(raised), atol=0.2)


def test_bars_have_the_errors_that_the_sections_hold(quick_validation):
    content = read_json(quick_validation / "validation.json")
    tables = {name: section["table"] for name, section in content["sections"].items()}
    facts = story_chapter(content, {}).facts
    off, null = facts["numbers"]["error"]["values"][0], facts["numbers"]["error"]["values"][-1]
    assert off == pytest.approx(100.0 * tables["walking"]["held_out"]["grf_rmse_bw"])
    said = f"{off:.1f} % of body weight off (RMS), theirs {null:.1f} %"
    assert said in content["verdict"][0]
    assert facts["numbers"]["stiffness"]["published"] == [10.0, 32.0]
    returned = [row["returned_j"] for row in tables["energy"]["conditions"]]
    assert facts["numbers"]["energy"]["values"] == returned


def test_of_a_validation_without_walks_the_story_has_the_rest(quick_validation):
    content = read_json(quick_validation / "validation.json")
    bench = {"bench": content["sections"]["bench"]}
    facts = story_chapter({**content, "sections": bench}, {}).facts
    assert facts["moved"] is None and facts["numbers"]["error"] is None
    assert facts["numbers"]["stiffness"] and facts["numbers"]["energy"] is None


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("width", SCREENS)
def test_the_story_is_one_screen_and_short(quick_validation, tmp_path, width):
    shutil.copytree(quick_validation, tmp_path / "out")
    high = dict((x, y) for x, y in SIZES)[width]
    seen = look(
        tmp_path / "out" / "report.html",
        tmp_path / "out",
        width=width,
        height=high,
        act='document.querySelectorAll("details").forEach(one => { one.open = true; }); return 0;',
    )
    assert seen.high <= SCREENS[width] * high
    assert seen.words <= 1200 and seen.scroll <= width and not seen.out and not seen.requests
    for answer in ("prosthetic foot", "fulcrum", "% of body weight", "harder null", "SYNTHETIC"):
        assert answer in (quick_validation / "report.html").read_text(encoding="utf-8")


FOLLOWS = """<!doctype html><meta charset="utf-8"><pre id="seen"></pre>
<iframe id="page" src="report.html" width="1300" height="900"></iframe><script>
const page = document.getElementById("page"), wait = ms => new Promise(done => setTimeout(done, ms));
page.onload = async () => {
  const story = page.contentDocument, slider = story.getElementById("fulcrum"), seen = [];
  const now = () => story.getElementById("replay").contentDocument.getElementById("part").selectedOptions[0].textContent;
  for (const value of [slider.defaultValue, slider.max, 0]) {
    slider.value = value;
    slider.dispatchEvent(new page.contentWindow.Event("input"));
    await wait(1500);
    const parts = ["resultant", "cop", "keel", "support", "foam"].map(
      name => story.getElementById(`moved-${name}`).getAttribute("points"));
    seen.push({mm: story.getElementById("moved-mm").textContent, now: now(), parts});
  }
  document.getElementById("seen").textContent = JSON.stringify(seen);
};</script>"""  # noqa: E501
"""Opens the story as a visitor of a server does, whose page may look into its replay."""


@pytest.mark.slow
@needs_browser
def test_one_slider_leads_the_curves_the_foot_and_the_replay(quick_validation, tmp_path):
    shutil.copytree(quick_validation, tmp_path / "out")
    (tmp_path / "out" / "follows.html").write_text(FOLLOWS, encoding="utf-8")
    handler = functools.partial(Quiet, directory=tmp_path / "out")
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        command = [
            chromium(),
            *COMMAND,
            f"--user-data-dir={tmp_path / 'profile'}",
            "--virtual-time-budget=20000",
            "--dump-dom",
            f"http://127.0.0.1:{server.server_port}/follows.html",
        ]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
        server.shutdown()
    found = re.search(r'<pre id="seen">(.*?)</pre>', ended.stdout, re.DOTALL)[1]
    seen = json.loads(html.unescape(found))
    assert [one["mm"] for one in seen] == ["108", "151", "66"]
    for one in seen:
        assert one["now"] == f"fulcrum {one['mm']} mm", "the replay is of this setting"
    for parts in zip(*(one["parts"] for one in seen), strict=True):
        assert len(set(parts)) == len(seen), "each part is another at each setting"


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass
