"""`vsf-drake session` on folders as laboratories keep them, and the commands that take folders."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import exit_code, read_json
from made_session import session_folder, spoil

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.cli import fit_run
from vsf_drake.sessions.table import FITTED, HELD_OUT
from vsf_drake.simulation.archive import RECORD_FILE

ROOT = Path(__file__).parents[2]
SETTINGS = {"low": 66, "medium": 108, "high": 151}
PERSONS = {
    "a": ("{mm}mm_{n}", ("--prosthetic-side", "right", "--sex", "male")),
    "b": ("{word} {n}", ("--prosthetic-side", "left", "--sex", "female")),
    "c": ("F{mm}_walk{n}", ("--prosthetic-side", "right", "--sex", "male")),
}
WORDS = {"low": "soft", "medium": "middle", "high": "stiff"}
MARKERS_COST_BW = 0.01
"""What markers, plates under single steps and another choice of the fitted walks may add to the
error that the same walks have with their joint angles given (a choice: a third of what still
counts as good)."""


@pytest.mark.slow
@pytest.mark.parametrize("person", PERSONS)
def test_a_laboratorys_folder_comes_to_a_verdict_in_two_commands(run, tmp_path, person):
    form, options = PERSONS[person]
    names = {
        f"{setting}_{n}": form.format(mm=mm, word=WORDS[setting], n=n)
        for setting, mm in SETTINGS.items()
        for n in (1, 2, 3)
    }
    folder = session_folder(person, tmp_path / "monday", names, facts=person != "b")
    spoil(folder)
    words = ("session", folder, "--out", tmp_path / "out", *options, "--synthetic")
    code, said, error = run(*words)
    if person == "b":  # whose settings have names: where they stood has to be told, once
        assert code == 2 and "middle, soft, stiff" in error
        table = folder / "session.csv"
        text = table.read_text()
        for setting, mm in SETTINGS.items():
            text = text.replace(f"{WORDS[setting]},setting,,", f"{WORDS[setting]},setting,{mm},")
        table.write_text(text)
        code, said, error = run(*words)
    assert code == 0, error
    for told in ("66mm_9.c3d", "export_failed.c3d", "static yesterday.c3d", "null"):
        assert told in said
    saved = read_json(tmp_path / "out" / "session.json")
    by_role = {
        role: [walk for walk in saved["walks"] if walk["role"] == role]
        for role in (FITTED, HELD_OUT)
    }
    assert sorted(walk["fulcrum_mm"] for walk in by_role[FITTED]) == [66.0, 151.0]
    assert len(by_role[HELD_OUT]) == 7
    stored = read_json(ROOT / "studies/results/session_fit.json")["cases"][f"{person}_day_1"]
    angles_given = stored["mean"]["held out"]["layers"]["person"]["grf_rmse_bw"]
    errors = [walk["error_bw"] for walk in by_role[HELD_OUT]]
    assert np.mean(errors) == pytest.approx(angles_given, abs=MARKERS_COST_BW)
    if person == "b":  # whose mass is the median of what all walks' forces tell: all hang together
        return
    # a held-out walk less: all is judged again, but not searched
    table = folder / "session.csv"
    left = by_role[HELD_OUT][0]["file"]
    search = (tmp_path / "out" / "search.json").stat().st_mtime_ns
    row = next(line for line in table.read_text().splitlines() if line.startswith(left))
    table.write_text(table.read_text().replace(row, row.replace(",yes,", ",no,")))
    assert run(*words)[0] == 0
    assert (tmp_path / "out" / "search.json").stat().st_mtime_ns == search
    again = read_json(tmp_path / "out" / "session.json")
    kept = {walk["file"]: walk["error_bw"] for walk in again["walks"]}
    assert left not in kept
    assert all(
        kept[walk["file"]] == pytest.approx(walk["error_bw"], abs=1e-6)
        for walk in by_role[HELD_OUT][1:]
    )
    assert exit_code("check", tmp_path / "out", "--out", tmp_path / "check") == 0
    walked = tmp_path / "walked"
    assert exit_code("simulate", tmp_path / "out", "--out", walked, "--no-replay") == 0
    assert len([*walked.glob("*/person_force.csv")]) == 8, "by the session's contact"


@pytest.mark.slow
def test_the_script_of_the_guide_predicts_the_walk_in_between_as_well_as_published(
    tmp_path, monkeypatch
):
    """The paper's model, fitted to the walk itself, is left with 5 % of body weight."""
    page = (ROOT / "docs/guide/python.md").read_text(encoding="utf-8")
    [script] = [
        block
        for block in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
        if "vsf.session(" in block
    ]
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(script, names)
    walks = {walk.file: walk for walk in names["found"].table.walks}
    assert walks["108mm.c3d"].role == HELD_OUT and walks["66mm.c3d"].role == FITTED
    assert walks["108mm.c3d"].error_bw < 0.05
    assert not (resource("data/reference_subject/c3d") / "session.csv").exists()


@pytest.fixture
def walks(tmp_path):
    """A folder of three manifests of the embedded subject."""
    home = resource("data/reference_subject")
    (tmp_path / "walks").mkdir()
    shutil.copy(home / "subject.yaml", tmp_path)
    for name in ("low_1", "medium_1", "high_1"):
        for file in (home / "exact").glob(f"{name}*"):
            shutil.copy(file, tmp_path / "walks")
    return tmp_path / "walks"


def test_simulate_and_check_take_every_trial_of_a_folder(run, walks, tmp_path):
    for name in ("low_1", "high_1"):
        (walks / f"{name}.yaml").unlink()
    code, _, error = run("simulate", walks, "--out", tmp_path / "out", "--no-replay")
    assert code == 0, error
    assert (tmp_path / "out" / "medium_1" / "metrics.json").is_file()
    assert run("check", walks, "--out", tmp_path / "check")[0] == 0
    assert [trial["name"] for trial in read_json(tmp_path / "check" / "check.json")["trials"]]


@pytest.mark.parametrize("out", [".", "import", "fit"])
def test_walks_of_a_session_are_not_put_among_its_results(run, walks, tmp_path, out):
    session = tmp_path / "monday"
    (session / "fit").mkdir(parents=True)
    (session / "fit" / RECORD_FILE).write_text("{}", encoding="utf-8")  # as a fit leaves one
    shutil.move(walks, session / "import")
    shutil.copy(tmp_path / "subject.yaml", session)
    before = sorted(session.rglob("*"))
    code, _, error = run("simulate", session, "--out", session / out)
    assert code == 2 and "--out: holds the trials or other results" in error
    assert sorted(session.rglob("*")) == before


def test_of_a_folder_the_outer_settings_are_fitted(run, walks, tmp_path, monkeypatch):
    def told(fitted, held_out, request, search):
        raise InputError(f"{[t.path.stem for t in fitted]} {[t.path.stem for t in held_out]}")

    monkeypatch.setattr(fit_run, "make_task", told)
    code, _, error = run("fit", walks, "--out", tmp_path / "out")
    assert code == 2 and "['low_1', 'high_1'] ['medium_1']" in error
    other = walks / "low_1.yaml"
    code, _, error = run("fit", walks, "--hold-out", other, "--out", tmp_path / "out")
    assert code == 2 and "stands alone" in error


@pytest.mark.parametrize("command", ["check", "fit", "simulate"])
def test_a_folder_without_trials_is_refused(run, tmp_path, command):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "notes.yaml").write_text("a: 1\n")
    code, _, error = run(command, tmp_path / "empty", "--out", tmp_path / "out")
    assert code == 2 and "holds no trial manifests" in error
