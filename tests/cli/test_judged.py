"""Commands that read trials say what the recordings are worth; what they leave cannot be read as if
they were good."""

from __future__ import annotations

import dataclasses
import re

import pytest
import yaml
from command_line import read_json
from sweep_files import copied

from vsf_drake.base.files import resource
from vsf_drake.motion.trial import RecordingMark
from vsf_drake.tuning.inputs import load_tuning_trials
from vsf_drake.validation.run import validation_content
from vsf_drake.validation.study import StudyOptions, make_study
from vsf_drake.walks.embedded import embedded_contact

DATA = resource("data/reference_subject")
MEDIUM = DATA / "exact/medium_1.yaml"
UNUSABLE = RecordingMark(
    mark="unusable", expected_error_bw=0.2, verdict="unusable, expected error 20.0 % > 10 % BW"
)


@pytest.fixture(scope="module")
def too_light(tmp_path_factory):
    """A good walk of 78 kg whose subject is stated as 66 kg: every force in body weights is 18 %
    off."""
    folder = tmp_path_factory.mktemp("light")
    person = yaml.safe_load((DATA / "subject.yaml").read_text(encoding="utf-8")) | {"mass_kg": 66.0}
    (folder / "subject.yaml").write_text(yaml.safe_dump(person), encoding="utf-8")
    return copied(MEDIUM, folder, subject="subject.yaml", window={"start_s": 0.1, "end_s": 1.3})


@pytest.mark.parametrize("words", [("fit",), ("fit", MEDIUM, "--hold-out"), ("tune",)])
def test_what_rests_on_an_unusable_recording_is_refused_with_the_reason(
    run, too_light, tmp_path, words
):
    code, _, error = run(*words, too_light, "--out", tmp_path / "out")
    assert code == 2 and error.count("error:") == 1 and str(too_light) in error
    assert re.search(
        r"the recording is unusable \(mass from the forces\), expected error 1\d\.\d % > 10 % BW: "
        r"mass from the forces 1\d\.\d %.*--accept-unusable",
        error,
    )
    assert not (tmp_path / "out").exists()


def test_a_walk_of_an_unusable_recording_says_so_on_screen_in_its_table_sidecar_and_figure(
    run, too_light, tmp_path
):
    code, said, _ = run("simulate", too_light, "--out", tmp_path, "--step-ms", 2, "--no-replay")
    said = " ".join(said.split())
    assert (
        code == 0
        and "! Recording" in said
        and "unusable (mass from the forces), expected error 1" in said
    )
    metrics = read_json(tmp_path / "metrics.json")
    assert (
        metrics["recording"]["mark"] == "unusable"
        and metrics["recording"]["expected_error_bw"] > 0.1
    )
    about = (tmp_path / "result.yaml").read_text(encoding="utf-8")
    assert "UNUSABLE RECORDING (mass from the forces)" in " ".join(about.split())
    assert "UNUSABLE RECORDING" in (tmp_path / "walk.svg").read_text(encoding="utf-8")


def test_a_sweep_names_the_worst_of_its_recordings_and_keeps_every_mark(run, too_light, tmp_path):
    code, said, _ = run(
        "sweep",
        MEDIUM,
        too_light,
        "--out",
        tmp_path / "out",
        "--fulcrum-mm",
        "108",
        "--step-ms",
        4,
        "--workers",
        1,
    )
    assert code == 0 and "(worst of 2): unusable" in " ".join(said.split())
    marks = [
        trial["recording"]["mark"] for trial in read_json(tmp_path / "out/sweep.json")["trials"]
    ]
    assert marks == ["good", "unusable"]


def test_a_tuning_and_a_validation_keep_the_mark_among_their_notes():
    """As `judged` hands the trials on."""

    def judge(trials):
        return [dataclasses.replace(trial, judged=UNUSABLE) for trial in trials]

    tuning = load_tuning_trials([MEDIUM], contact=embedded_contact("exact"), judge=judge)
    assert tuning.notes == ("medium_1: UNUSABLE RECORDING, expected error 20.0 % > 10 % BW",)
    study = make_study(
        [MEDIUM], contact=embedded_contact("exact"), options=StudyOptions(quick=True), judge=judge
    )
    content, _ = validation_content(study, {})
    assert "medium_1: UNUSABLE RECORDING, expected error 20.0 % > 10 % BW" in content.notes
