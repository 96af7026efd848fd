"""A session as a laboratory meets it: what it asks for, makes, and does not do again."""

from __future__ import annotations

import base64
import re

import pytest
from command_line import exit_code, read_json
from made_session import FACTS
from page_layers import both_layers

import vsf_drake as vsf
from vsf_drake.base.errors import InputError
from vsf_drake.report import import_outputs
from vsf_drake.sessions import run
from vsf_drake.sessions.found import WALK
from vsf_drake.sessions.plan import read_rows
from vsf_drake.sessions.table import FITTED, HELD_OUT


def everything(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_what_files_do_not_say_is_asked_for_and_nothing_but_the_table_is_written(folder, tmp_path):
    before = everything(folder)
    (folder / "66mm_1.c3d").rename(folder / "walk one.c3d")
    with pytest.raises(InputError) as asked:
        vsf.session(folder, out=tmp_path / "out")
    said = str(asked.value)
    assert "walk one.c3d" in said and "--sex" in said and "--prosthetic-side" in said
    assert set(everything(folder)) - set(before) == {"session.csv", "walk one.c3d"}
    assert not (tmp_path / "out").exists()
    table = folder / "session.csv"
    table.write_text(table.read_text().replace("walk one.c3d,walk,,", "walk one.c3d,walk,stiff,"))
    changed = table.read_bytes()
    with pytest.raises(InputError, match="setting stiff"):
        vsf.session(folder, out=tmp_path / "out", **FACTS)
    assert table.read_bytes() == changed, "what somebody wrote is not written over"


def test_where_names_tell_all_it_goes_straight_on_and_names_what_it_leaves_out(
    kept, done, tmp_path, stood_in
):
    before = everything(kept / "recorded" / done.name)
    found = vsf.session(done, out=tmp_path / "out", **FACTS)
    assert set(everything(done)) - set(before) == {"session.csv"}
    assert {name: everything(done)[name] for name in before} == before
    [(fitted, held_out)] = stood_in
    roles = {walk.file: (walk.role, walk.fulcrum_mm) for walk in found.table.walks}
    assert roles == {
        "66mm_1.c3d": (FITTED, 66.0),
        "F108 walk2.c3d": (HELD_OUT, 108.0),
        "151 mm 3.c3d": (FITTED, 151.0),
    }
    assert fitted == ["66mm_1", "151 mm 3"] and held_out == ["F108 walk2"]
    page = both_layers(tmp_path / "out")
    for told in ("66mm_9.c3d", "export_failed.c3d", "static yesterday.c3d", "1 day", "SYNTHETIC"):
        assert told in page
    assert 'src="import/replay.html"' in page, "to be played"
    imported = (tmp_path / "out" / "import" / "import.html").read_text(encoding="utf-8")
    assert 'href="import/import.html#markers"' in page and 'id="markers"' in imported
    for link in re.findall(r'href="([^"#]+)', page):
        assert link == "fit/report.html" or (tmp_path / "out" / link).is_file()
    saved = read_json(tmp_path / "out" / "session.json")
    assert saved["verdict"] == found.verdict and "failed" in found.verdict
    [held] = [walk for walk in saved["walks"] if walk["role"] == HELD_OUT]
    assert (held["error_bw"], held["null_bw"]) == (0.03, 0.04)
    assert [walk["error_bw"] for walk in saved["walks"]].count(None) == 2, "of predictions alone"
    assert found.trials[0].subject.mass_kg == pytest.approx(78.2, abs=0.05), "as PROCESSING says"


def test_a_step_is_done_again_only_if_what_it_is_made_of_has_changed(
    done, tmp_path, stood_in, monkeypatch
):
    imports = []
    real = run.import_walks

    def counted(files, options, *, progress):
        imports.append(options.fulcrum_mm)
        return real(files, options, progress=progress)

    monkeypatch.setattr(run, "import_walks", counted)
    table = done / "session.csv"

    def again():
        return vsf.session(done, out=tmp_path / "out", **FACTS)

    table.write_text(
        table.read_text().replace(
            "F108 walk2.c3d,walk,108,yes,", "F108 walk2.c3d,walk,108,yes,new shoes"
        )
    )
    found = again()
    assert not imports and [step.kept for step in found.table.steps] == [True]
    assert "new shoes" in both_layers(tmp_path / "out")
    table.write_text(table.read_text().replace("walk,108,", "walk,129,"))
    again()
    assert len(imports) == 1 and "129.0" in imports[0]


def test_of_walks_that_did_not_change_nothing_is_drawn_again(done, tmp_path, stood_in, monkeypatch):
    drawn = set()

    def counted(make):
        def figure(item):
            drawn.add(item.trial.name)
            return make(item)

        return figure

    makers = {kind: counted(make) for kind, make in import_outputs._MAKERS.items()}
    monkeypatch.setattr(import_outputs, "_MAKERS", makers)
    figures = tmp_path / "out" / "import" / "figures"
    before = everything(figures)
    table = done / "session.csv"
    table.write_text(table.read_text().replace("walk,108,", "walk,129,"))
    vsf.session(done, out=tmp_path / "out", **FACTS)
    assert drawn == {"F108 walk2"}
    after = everything(figures)
    assert set(after) == set(before) and len(before) == 3 * len(makers)
    assert {name for name in after if after[name] != before[name]} == set(), "no setting is drawn"
    page = (figures.parent / "import.html").read_text(encoding="utf-8")
    for image in after.values():
        assert base64.b64encode(image).decode() in page


def test_a_stated_length_of_the_shell_is_that_of_all_walks_though_they_were_imported_before(
    done, tmp_path, stood_in
):
    found = vsf.session(done, out=tmp_path / "out", foot_length_mm=270.0, **FACTS)
    assert {trial.model.foot.length_m for trial in found.trials} == {0.27}


def test_a_copy_of_a_walk_is_left_out_and_says_of_what(folder, tmp_path, stood_in):
    copy = folder / "66mm_2.c3d"
    copy.write_bytes((folder / "66mm_1.c3d").read_bytes())
    found = vsf.session(folder, out=tmp_path / "out", **FACTS)
    [left] = [walk for walk in found.table.walks if walk.role == "left out"]
    assert left.file == "66mm_2.c3d" and "same recording" in left.why
    assert any("66mm_2.c3d again" in sentence for sentence in found.table.next)


def test_the_command_says_the_verdict_and_ends_as_a_fit_that_failed(run, done, tmp_path, stood_in):
    words = ("session", done, "--out", tmp_path / "out", "--prosthetic-side", "right")
    code, _, error = run(*words)
    assert code == 2 and "--sex male or female" in error and "session.md" in error
    code, said, error = run(*words, "--sex", "male", "--synthetic")
    steps = read_json(tmp_path / "out" / "session.json")["steps"]
    assert steps[0]["kept"], "the same as from Python"
    assert code == 4 and "nobody fitted" in error
    assert "F108 walk2.c3d" in said and "export_failed.c3d is not used" in said
    page = tmp_path / "out" / "report.html"
    written = page.read_text(encoding="utf-8")
    page.unlink()
    assert run("report", tmp_path / "out")[0] == 0
    assert page.read_text(encoding="utf-8") == written


def test_after_an_interruption_it_goes_on_and_what_was_removed_is_made_again(
    done, tmp_path, stood_in, monkeypatch, capsys
):
    out = tmp_path / "out"
    working = run._fitted

    def pressed(*_):
        raise KeyboardInterrupt

    (out / "import" / "import.json").unlink()
    monkeypatch.setattr(run, "_fitted", pressed)
    with pytest.raises(KeyboardInterrupt):
        vsf.session(done, out=out, **FACTS)
    assert exit_code("report", out) == 2
    assert "holds an unfinished run" in capsys.readouterr().err.replace("\n", " ")
    assert (out / "import" / "import.json").is_file()
    for verdict in ("session.json", "report.html"):
        assert not (out / verdict).exists(), "of a fit that is no longer there"
    monkeypatch.setattr(run, "_fitted", working)
    assert vsf.session(done, out=out, **FACTS).table.steps[0].kept


def test_results_may_lie_in_a_folder_below_but_not_among_the_recordings(done, tmp_path, stood_in):
    with pytest.raises(InputError, match="is the folder of the recordings"):
        vsf.session(done, out=done, **FACTS)
    (tmp_path / "out").rename(done / "results")
    found = vsf.session(done, out=done / "results", **FACTS)
    assert len(found.table.walks) == 3 and found.table.steps[0].kept


def test_recordings_in_folders_below_are_said_not_to_be_read(done, tmp_path, stood_in):
    (done / "Tuesday" / "raw").mkdir(parents=True)
    (done / "results").mkdir()
    (done / "Tuesday" / "raw" / "walk.C3D").write_bytes(b"never read")
    found = vsf.session(done, out=tmp_path / "out", **FACTS)
    [note] = [note for note in found.table.notes if "below" in note]
    assert "(Tuesday)" in note and len(found.table.walks) == 3
    with pytest.raises(InputError, match=r"folders below it \(Tuesday\)"):
        vsf.session(done, out=tmp_path / "out")
    for path in done.glob("*.c*"):
        path.unlink()
    with pytest.raises(InputError, match=r"holds no recording.*\(Tuesday\)"):
        vsf.session(done, out=tmp_path / "out", **FACTS)


def test_the_results_of_another_session_are_not_written_over(done, tmp_path, stood_in):
    before = everything(tmp_path / "out" / "import")
    done.rename(tmp_path / "Dienstag")
    with pytest.raises(InputError, match="holds the session of Montag"):
        vsf.session(tmp_path / "Dienstag", out=tmp_path / "out", **FACTS)
    assert everything(tmp_path / "out" / "import") == before


def test_a_file_of_the_person_is_taken_and_does_not_go_with_options(folder, tmp_path, stood_in):
    (folder / "subject.yaml").write_text(
        "mass_kg: 80\nstature_m: 1.81\nsex: male\nprosthetic_side: right\nname: Ann\n"
    )
    with pytest.raises(InputError, match=r"subject\.yaml, which says it"):
        vsf.session(folder, out=tmp_path / "out", sex="male")
    found = vsf.session(folder, out=tmp_path / "out")
    assert (found.table.person, found.trials[0].subject.mass_kg) == ("Ann", 80.0)


@pytest.mark.parametrize("kind", ["missing", "empty", "notes", "file"])
def test_a_folder_without_recordings_is_refused(tmp_path, kind):
    folder = tmp_path / "monday"
    if kind == "file":
        folder.write_text("no folder")
    elif kind != "missing":
        folder.mkdir()
    if kind == "notes":
        (folder / "notes.txt").write_text("66 mm was soft")
    with pytest.raises(InputError, match="monday"):
        vsf.session(folder, out=tmp_path / "out", **FACTS)
    assert kind != "notes" or [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_a_folder_that_cannot_be_read_is_refused(tmp_path, monkeypatch):
    def refused(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(tmp_path), "iterdir", refused)
    with pytest.raises(InputError, match="cannot be read"):
        run.find_files(tmp_path, {}, lambda what, share: None)


def test_curves_of_an_unknown_kind_are_refused_before_anything_is_done(folder, tmp_path):
    with pytest.raises(InputError, match="csv, excel, opensim"):
        vsf.session(folder, out=tmp_path / "out", curves=("parquet",), **FACTS)
    assert not (folder / "session.csv").exists()


def test_walks_on_a_passive_foot_come_to_a_session_without_a_setting(folder, tmp_path, stood_in):
    """One setting: two walks judge the third."""
    passive = "package://vsf_drake/passive.yaml"
    found = vsf.session(folder, out=tmp_path / "out", model=passive, **FACTS)
    assert [row.fulcrum_mm for row in read_rows(folder / "session.csv") if row.role == WALK] == [
        "",
        "",
        "",
    ]
    assert {trial.model.foot.name for trial in found.trials} == {"passive"}
    [(fitted, held_out)] = stood_in
    assert len(fitted) == 1 and len(held_out) == 2
    manifests = sorted((tmp_path / "out" / "import").glob("[0-9F]*.yaml"))
    assert len(manifests) == 3
    assert all("fulcrum_mm" not in path.read_text(encoding="utf-8") for path in manifests)
