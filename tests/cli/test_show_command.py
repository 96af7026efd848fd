"""`vsf-drake show`: a page that needs no network, a server that ends when told, and mistakes that are refused."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
from browser import chromium, look
from command_line import exit_code
from meshcat_page import tracks

from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import keel_shape

SERVING = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
import sys
from vsf_drake.cli import main
sys.argv = ["vsf-drake", "show", "--no-browser"]
main()
"""


@pytest.fixture(scope="module")
def bench_page(tmp_path_factory):
    path = tmp_path_factory.mktemp("shown") / "bench.html"
    assert exit_code("show", "--what", "bench", "--html", path) == 0
    return path


def test_the_page_bends_the_keel_under_the_fulcrum_that_moves(bench_page):
    page = bench_page.read_text(encoding="utf-8")
    assert "<title>vsf_drake: bench</title>" in page and "fulcrum from 66 to 151 mm" in page
    moved = tracks(page)
    frame, carriage = (moved[f"/model/vsf/{name}"]["position"][1] for name in ("vsf_frame", "vsf_carriage"))
    tip = moved["/model/vsf/keel_body_8"]["position"][1] - frame
    fulcrum = carriage[:, 0] - frame[:, 0]
    assert (fulcrum[0], fulcrum[-1]) == (pytest.approx(0.066), pytest.approx(0.151))
    assert tip[[0, -1], 2] == pytest.approx(0.0, abs=1e-9)
    moving = np.flatnonzero(np.diff(fulcrum) > 1e-6)
    under_load = np.arange(moving[0], moving[-1] + 2)
    assert np.all(np.diff(tip[under_load, 2]) < 0.0)
    foot = FootParameters()
    for i in under_load[[0, -1]]:
        shape = keel_shape(foot, fulcrum_m=float(fulcrum[i]), load_n=400.0)
        arrow = moved["/load"]["position"][1][i] - frame[i]
        np.testing.assert_allclose(arrow[[0, 2]], shape.load_point_K, atol=1e-9)


def test_an_unwritable_page_is_refused_and_nothing_is_left(run, tmp_path):
    code, _, error = run("show", "--html", tmp_path / "no such folder" / "page.html")
    assert code == 2 and "cannot be written" in error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("words", "said"), [
    (("--what", "leg"), "Say one of foot, bench, person"), (("--subject", "nobody.yaml"), "nobody.yaml"),
    (("--port", 80, "--no-browser"), "between 1024 and 65535"), (("--model", "none.yaml"), "there is no such file")])
def test_mistakes_are_refused(run, words, said):
    code, _, error = run("show", *words)
    assert code == 2 and said in error


@pytest.mark.slow
def test_it_serves_a_page_until_ctrl_c():
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, "-c", SERVING], text=True, **pipes)
    try:
        line = process.stdout.readline()
        address = re.search(r"http://localhost:\d+", line)
        assert address, line + process.stderr.read()
        with urllib.request.urlopen(address[0], timeout=10) as answer:
            assert b"<title>" in answer.read()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert not errors.strip()


@pytest.mark.slow
@pytest.mark.skipif(chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)")
def test_the_page_opens_without_a_network_or_a_complaint(bench_page, tmp_path):
    seen = look(bench_page, tmp_path, width=500, height=300, budget_ms=1500)
    assert not seen.requests
    assert not [line for line in seen.console if "ERROR" in line or "Uncaught" in line]
    assert not seen.out and seen.scroll <= seen.width
