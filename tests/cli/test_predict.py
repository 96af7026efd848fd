"""`vsf-drake predict` as a laboratory calls it: what comes out, that the page begins with the
verdict and is made again, how mistakes are refused."""

from __future__ import annotations

import io
import re
from contextlib import redirect_stdout

import numpy as np
import pytest
from command_line import exit_code, read_json

from vsf_drake.base.files import read_npz, resource
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.report.predict_page import PREDICT

LABORATORY = resource("data/reference_subject/laboratory")
CONTACT = LABORATORY / "contact.yaml"
SOFT, STIFF = ([LABORATORY / f"{name}_{k}.yaml" for k in (1, 2)] for name in ("low", "high"))


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    out = tmp_path_factory.mktemp("predicted") / "out"
    words = ("--contact", CONTACT, "--fulcrum-mm", 108, "--step-ms", 2, "--out", out)
    with redirect_stdout(io.StringIO()) as screen:
        assert exit_code("predict", *SOFT, *STIFF, *words) == 0
    out.with_name("screen").write_text(screen.getvalue(), encoding="utf-8")
    return out


def body_of(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    return " ".join(re.sub("<[^>]*>", " ", text[text.index("<body>") :]).split())


def test_the_page_says_what_is_measured_then_the_verdict_then_that_it_interpolates(predicted):
    body = body_of(predicted)
    first = body.index("SYNTHETIC: nobody walked these trials")
    verdict = body.index("At 108 mm the prosthesis is predicted to stand for")
    limits = body.index("It does not know how people adapt")
    assert first < verdict < limits < body.index("peak force on the residual limb")


def test_the_screen_says_first_that_nobody_walked_then_the_verdict(predicted):
    first, verdict = predicted.with_name("screen").read_text(encoding="utf-8").splitlines()[:2]
    assert "SYNTHETIC" in first and verdict.startswith("At 108 mm the prosthesis is predicted")


def test_the_page_is_made_again_of_what_is_saved(predicted):
    before = (predicted / "report.html").read_bytes()
    assert PREDICT.remake(predicted) == []
    assert (predicted / "report.html").read_bytes() == before
    assert exit_code("report", predicted) == 0


def test_peaks_of_the_verdict_are_those_of_the_saved_curve(predicted):
    curve = read_npz(predicted / "predict.npz")["person"][:, 2]
    table = read_json(predicted / "predict.json")
    assert table["layer"] == "person"
    assert table["force"]["person"]["second_peak"] == pytest.approx(curve[51:].max())
    assert (
        f"{curve[:51].max():.2f} and {curve[51:].max():.2f} body weights" in table["sentences"][0]
    )


def test_the_motion_for_opensim_is_the_predicted_one(predicted):
    arrays = read_npz(predicted / "predict.npz")
    table = read_json(predicted / "predict.json")
    written = read_storage(predicted / "walk_ik.mot")
    knee = written.column("knee_angle_r")
    at = table["stance_s"] * arrays["share"]
    own = np.interp(
        written.time_s, at, arrays["predicted"][:, table["names"].index("knee_angle_r")]
    )
    assert np.abs(knee - own).max() < 1.5  # momentum may move the knee; degrees


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([*SOFT, *STIFF, "--contact", CONTACT], "--fulcrum-mm: is missing"),
        ([*SOFT, *STIFF, "--fulcrum-mm", 108], "--contact: is missing"),
        ([*SOFT, "--contact", CONTACT, "--fulcrum-mm", 66], "all walks are of one setting"),
        ([SOFT[0], "--contact", CONTACT, "--fulcrum-mm", 66], "one walk tells nothing"),
        ([SOFT[0], SOFT[0], "--contact", CONTACT, "--fulcrum-mm", 66], "is named twice"),
        (
            [*SOFT, LABORATORY / "medium_1.yaml", "--contact", CONTACT, "--fulcrum-mm", 120],
            "--fulcrum-mm: 120 mm lies outside of the recorded settings, 66 to 108 mm",
        ),
    ],
    ids=["no setting", "no contact", "one setting", "one walk", "twice", "outside"],
)
def test_mistakes_end_in_one_line_that_names_them(words, says, tmp_path, capsys):
    assert exit_code("predict", *words, "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert says in said and "Traceback" not in said
    assert not (tmp_path / "out").exists()
