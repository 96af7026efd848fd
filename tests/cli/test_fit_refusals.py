"""`vsf-drake fit`: what it refuses, in one message and before the long part; the folder stays as it
was."""

from __future__ import annotations

import pytest
import yaml
from sweep_files import copied

from vsf_drake.base.files import resource

DATA = resource("data/reference_subject")
LOW, HIGH = DATA / "exact/low_1.yaml", DATA / "exact/high_1.yaml"
BENCH = DATA / "bench.yaml"


WORDS = [
    (
        ("--free", "friction.mu_statik"),
        "--free: there is no parameter 'friction.mu_statik'. Did you mean friction.mu_static",
    ),
    (
        ("--freeze", "frictoin.*"),
        "--freeze: there is no parameter 'frictoin.*'. Did you mean friction.*",
    ),
    (("--freeze", "curve"), "Did you mean curve.*"),
    (("--free", "zzz"), "There are contact.*, offset.*"),
    (("--freeze", "*"), "--freeze: all parameters are frozen"),
    (("--freeze", "curve.*", "--free", "curve.*"), "curve.* is to be free and frozen"),
    (("--strategy", "papre"), "--strategy: 'papre' is not known. Known are: joint, paper"),
    (("--strategy", "paper", "--paths"), "--paths: is an option of the joint strategy"),
    (("--held-out-height",), "--held-out-height: there is no held-out trial"),
    (("--quick", "--starts", "3"), "--starts: cannot go with --quick"),
    (("--solver", "simplex"), "solver: 'simplex' is not known. Known are: gauss_newton"),
    (("--resume",), "there is no interrupted fit to go on from"),
    (("--hold-out", LOW), "is fitted and held out"),
    (("--bench", LOW), "unknown key"),
]


@pytest.mark.parametrize(
    ("words", "said"), WORDS, ids=lambda value: value if isinstance(value, str) else None
)
def test_options_that_make_no_sense_are_refused_in_one_message(run, tmp_path, words, said):
    code, _, error = run("fit", LOW, "--out", tmp_path / "fit", *words)
    assert code == 2
    assert said in error and error.count("error:") == 1 and "Traceback" not in error
    assert not (tmp_path / "fit").exists()


def test_trials_that_do_not_go_together_are_refused_by_file(run, tmp_path):
    person = yaml.safe_load((DATA / "subject.yaml").read_text(encoding="utf-8")) | {"mass_kg": 90.0}
    heavy = copied(
        LOW, tmp_path / "heavy", subject="subject.yaml", window={"start_s": 0.1, "end_s": 1.3}
    )
    (tmp_path / "heavy/subject.yaml").write_text(yaml.safe_dump(person), encoding="utf-8")
    for other, said, held in (
        (heavy, "is of another subject", ()),
        (
            copied(HIGH, tmp_path / "twin", name="another name"),
            "the same recording as",
            ("--hold-out",),
        ),
    ):
        code, _, error = run(
            "fit", HIGH, *held, other, "--accept-unusable", "--out", tmp_path / "fit"
        )
        assert (
            code == 2 and said in error and str(other) in error and not (tmp_path / "fit").exists()
        )


HEAD = "fulcrum_mm,displacement_mm,load_n\n"
CURVE = HEAD + "".join(f"200,{load / 10.0:.6f},{load}\n" for load in range(0, 601, 20))


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        (
            "far.yaml",
            BENCH.read_text(encoding="utf-8").replace("fulcrum_mm: 66", "fulcrum_mm: 30"),
            ["forefoot", "30 mm"],
        ),
        ("far.csv", CURVE, ["column fulcrum", "200 mm"]),
        ("head.csv", CURVE.replace("load_n", "force"), ["line 1", "force"]),
    ],
)
def test_a_bench_that_cannot_be_fitted_is_refused_before_the_fit(run, tmp_path, file, text, words):
    bench = tmp_path / file
    bench.write_text(text, encoding="utf-8")
    code, _, error = run(
        "fit", LOW, "--bench", bench, "--strategy", "paper", "--out", tmp_path / "fit"
    )
    assert code == 2 and error.count("error:") == 1 and not (tmp_path / "fit").exists()
    for word in (str(bench), *words):
        assert word in error


def test_folders_with_other_things_are_refused_and_left_alone(run, tmp_path):
    for name, files in (
        ("walk", {"result.yaml": "kind: walk\n"}),
        ("odd", {"fit.json": '{"kind": "sweep"}'}),
        ("broken", {"fit.json": "{"}),
    ):
        (tmp_path / name).mkdir()
        for file, text in files.items():
            (tmp_path / name / file).write_text(text, encoding="utf-8")
        code, _, error = run("fit", LOW, "--out", tmp_path / name)
        assert code == 2 and str(tmp_path / name) in error
        assert {
            path.name: path.read_text(encoding="utf-8") for path in (tmp_path / name).iterdir()
        } == files
    (tmp_path / "dirs" / "fit.json").mkdir(parents=True)
    code, _, error = run("fit", LOW, "--out", tmp_path / "dirs")
    assert code == 2 and "Traceback" not in error


@pytest.mark.parametrize("text", ["{", '{"key": "0", "searches": []}'])
def test_a_damaged_checkpoint_is_refused_and_kept(run, tmp_path, text):
    path = tmp_path / "fit" / "checkpoint.json"
    path.parent.mkdir()
    path.write_text(text)
    code, _, error = run("fit", LOW, "--out", path.parent, "--resume")
    assert code == 2
    assert str(path) in error and "Traceback" not in error
    assert path.read_text() == text
    assert [item.name for item in path.parent.iterdir()] == ["checkpoint.json"]
