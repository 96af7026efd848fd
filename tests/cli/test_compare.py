"""`vsf-drake compare` as a laboratory calls it: what comes out, that the page is made again, how
mistakes are refused."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from command_line import exit_code, read_json

from vsf_drake.report.compare_page import COMPARE

SESSIONS = Path(__file__).resolve().parents[2] / "data/sessions"
WALKS = SESSIONS / "a/day_1/1p1"
ON_TWO_FEET = SESSIONS / "c/day_1/1p1"  # one with a fulcrum, a passive one


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    out = tmp_path_factory.mktemp("compared") / "out"
    assert exit_code("compare", f"{WALKS}@66", f"{WALKS}@151", "--out", out) == 0
    return out


def test_a_folder_at_two_settings_gives_a_page_with_the_verdict_before_the_numbers(compared):
    text = (compared / "report.html").read_text(encoding="utf-8")
    body = " ".join(re.sub("<[^>]*>", " ", text[text.index("<body>") :]).split())
    first = body.index("SYNTHETIC: nobody walked these trials. A: 3 walks")
    assert first < body.index("B differs from A beyond the spread") < body.index("CoP at 50 % mm")
    assert '<iframe src="replay.html"' in text
    table = read_json(compared / "compare.json")["table"]
    assert [len(table[side]["walks"]) for side in "ab"] == [3, 3]
    assert table["a"]["fulcrum_mm"] == pytest.approx(66) and table["same_subject"]


def test_the_page_is_made_again_of_what_is_saved(compared):
    before = (compared / "report.html").read_bytes()
    assert COMPARE.remake(compared) == []
    assert (compared / "report.html").read_bytes() == before
    assert exit_code("report", compared) == 0


def test_a_folder_whose_walks_lie_in_folders_of_it_is_a_side_too(tmp_path, capsys):
    """As a session's folder has them, in that of its import."""
    imported = tmp_path / "session" / "import"
    imported.mkdir(parents=True)
    for name in ("low_1", "low_2", "high_1", "high_2"):
        for file in WALKS.glob(f"{name}*"):
            text = file.read_text(encoding="utf-8")
            (imported / file.name).write_text(text.replace("../../", ""), encoding="utf-8")
    shutil.copy(WALKS.parent / "subject.yaml", imported)
    for manifest in imported.glob("*.yaml"):
        text = manifest.read_text(encoding="utf-8").replace("../subject.yaml", "subject.yaml")
        manifest.write_text(text, encoding="utf-8")
    session = imported.parent
    words = ("compare", f"{session}@66", f"{session}@151", "--out", tmp_path / "out")
    assert exit_code(*words) == 0, capsys.readouterr().err
    assert read_json(tmp_path / "out" / "compare.json")["table"]["b"]["walks"] == [
        "high_1",
        "high_2",
    ]


def test_walks_on_a_passive_foot_are_named_by_it_in_a_folder_of_several_feet(tmp_path):
    words = (f"{ON_TWO_FEET}@66", f"{ON_TWO_FEET}@passive", "--out", tmp_path / "out")
    assert exit_code("compare", *words) == 0
    table = read_json(tmp_path / "out" / "compare.json")["table"]
    assert table["a"]["walks"] == ["low_1", "low_2", "low_3"]
    assert table["b"]["walks"] == ["passive_1", "passive_2", "passive_3"]
    assert table["b"]["fulcrum_mm"] is None and table["b"]["foot"] == "passive"


@pytest.mark.parametrize(
    ("a", "says"),
    [
        (f"{WALKS}@151", "is on both sides"),
        (WALKS, "holds walks of 3 settings (66, 108, 151 mm). Name the setting behind the folder"),
        (
            f"{WALKS}@77",
            "holds no walk at 77 mm. There are walks with fulcrum 66 mm, fulcrum 108",
        ),
        (f"{WALKS}@", "behind the @: '' is no position of the fulcrum"),
        (f"{WALKS}@soft", "behind the @: 'soft' is no position of the fulcrum"),
        (f"{ON_TWO_FEET}@77", "There are walks with foot passive, fulcrum 66 mm, fulcrum 108 mm"),
        (ON_TWO_FEET, "holds walks on 2 feet (one with a fulcrum, passive). Name one foot behind"),
        (WALKS / "nowhere", "there is no such file or folder"),
        (WALKS.parents[2], "holds no trial manifests"),
        (WALKS / "low_1_forces.mot", "is a table and no trial manifest"),
    ],
    ids=[
        "twice",
        "settings",
        "no such setting",
        "nothing",
        "no number",
        "no such foot",
        "feet",
        "nowhere",
        "no walks",
        "no manifest",
    ],
)
def test_mistakes_end_in_one_line_that_names_them(a, says, tmp_path, capsys):
    assert exit_code("compare", a, f"{WALKS}@151", "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert says in said and "Traceback" not in said
    assert not (tmp_path / "out").exists()
