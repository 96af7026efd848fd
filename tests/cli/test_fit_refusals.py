"""`vsf-drake fit`: what it refuses, in one message and before the long part; the folder stays as it was."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml
from sweep_files import copied

from vsf_drake.files import resource

DATA = resource("data/reference_subject")
LOW, HIGH = DATA / "exact/low_1.yaml", DATA / "exact/high_1.yaml"
BENCH = DATA / "bench.yaml"


def changed_bench(path: Path, **changes: object) -> Path:
    path.write_text(yaml.safe_dump(yaml.safe_load(BENCH.read_text(encoding="utf-8")) | changes), encoding="utf-8")
    return path


def changed_subject(folder: Path, **changes: object) -> Path:
    """The trial LOW of another person."""
    folder.mkdir()
    person = yaml.safe_load((DATA / "subject.yaml").read_text(encoding="utf-8")) | changes
    (folder / "subject.yaml").write_text(yaml.safe_dump(person), encoding="utf-8")
    return copied(LOW, folder, subject="subject.yaml", window={"start_s": 0.1, "end_s": 1.3})


WORDS = [
    (("--free", "friction.mu_statik"), "--free: there is no parameter 'friction.mu_statik'. Did you mean "
                                       "friction.mu_static"),
    (("--freeze", "frictoin.*"), "--freeze: there is no parameter 'frictoin.*'. Did you mean friction.*?"),
    (("--freeze", "curve"), "Did you mean curve.*?"),
    (("--free", "zzz"), "Their names begin with contact, offset"),
    (("--freeze", "*"), "--freeze: all parameters are frozen"),
    (("--freeze", "curve.*", "--free", "curve.*"), "curve.* is to be free and frozen"),
    (("--free", "trial.low_1.height"), "there is no parameter 'trial.low_1.height'"),
    (("--strategy", "papre"), "--strategy: 'papre' is no strategy"),
    (("--strategy", "paper", "--paths"), "--paths: is an option of the joint strategy"),
    (("--strategy", "paper", "--free", "friction.*"), "--free: is an option of the joint strategy"),
    (("--quick", "--starts", "3"), "--starts: cannot go with --quick"),
    (("--solver", "simplex"), "solver: 'simplex' is not known. Known are: gauss_newton"),
    (("--resume",), "there is no interrupted fit to go on from"),
    (("--hold-out", LOW), "is fitted and held out"), (("--bench", LOW), "unknown key"),
]


@pytest.mark.parametrize(("words", "said"), WORDS, ids=lambda value: value if isinstance(value, str) else None)
def test_options_that_make_no_sense_are_refused_in_one_message(run, tmp_path, words, said):
    code, _, error = run("fit", LOW, "--out", tmp_path / "fit", *words)
    assert code == 2
    assert said in error and error.count("error:") == 1 and "Traceback" not in error
    assert not (tmp_path / "fit").exists()


@pytest.mark.parametrize(("option", "value"), [("--starts", 0), ("--seed", -1)])
def test_a_number_out_of_range_is_refused(run, tmp_path, option, value):
    code, _, error = run("fit", LOW, "--out", tmp_path / "fit", option, value)
    assert code == 2 and option in error and "Traceback" not in error
    assert not (tmp_path / "fit").exists()


def with_sides_swapped(folder: Path) -> Path:
    """The trial LOW as if the other leg had the prosthesis."""
    trial = changed_subject(folder, prosthetic_side="left")
    lines = (LOW.parent / "low_1_kinematics.mot").read_text(encoding="utf-8").splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("time"))
    sides = {"_r": "_l", "_l": "_r"}
    lines[at] = "\t".join(name[:-2] + sides.get(name[-2:], name[-2:]) for name in lines[at].split("\t"))
    (folder / "motion.mot").write_text("\n".join(lines) + "\n", encoding="utf-8")
    content = yaml.safe_load(trial.read_text(encoding="utf-8"))
    content["kinematics"] = "motion.mot"
    content["forces"] |= {"right": "ground_force_l", "left": "ground_force_r"}
    trial.write_text(yaml.safe_dump(content), encoding="utf-8")
    return trial


@pytest.mark.parametrize("held", [False, True])
def test_trials_of_several_persons_or_sides_are_refused(run, tmp_path, held):
    for other, said in ((changed_subject(tmp_path / "heavy", mass_kg=90.0), "is of another subject"),
                        (with_sides_swapped(tmp_path / "left"), "its prosthesis is on the left")):
        code, _, error = run("fit", HIGH, *(["--hold-out"] if held else []), other, "--out", tmp_path / "fit")
        assert code == 2
        assert said in error and str(other) in error


def test_the_same_recording_is_refused_whatever_its_file_is_called(run, tmp_path):
    twin = copied(LOW, tmp_path / "twin", name="another name")
    code, _, error = run("fit", LOW, twin, "--out", tmp_path / "fit")
    assert code == 2 and "is the same recording as" in error and str(twin) in error


def test_a_plate_that_saw_part_of_the_stance_is_refused(run, tmp_path):
    cut = copied(LOW, tmp_path / "cut", window={"start_s": 0.6, "end_s": 1.4})
    code, _, error = run("fit", cut, "--out", tmp_path / "fit")
    assert code == 2 and "saw only part of the stance" in error and str(cut) in error


def without_cop(folder: Path) -> Path:
    """The trial LOW with a plate that tells no centre of pressure."""
    lines = (LOW.parent / "low_1_forces.mot").read_text(encoding="utf-8").splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("time"))
    names = lines[at].split("\t")
    kept = [i for i, name in enumerate(names) if not name.startswith("ground_force_r_p")]
    rows = ["\t".join(line.split("\t")[i] for i in kept) for line in lines[at:]]
    folder.mkdir()
    head = [f"nColumns={len(kept)}" if line.startswith("nColumns") else line for line in lines[:at]]
    (folder / "forces.mot").write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return copied(LOW, folder, forces={"file": "forces.mot", "right": "ground_force_r", "left": "ground_force_l"})


def test_a_trial_without_centre_of_pressure_is_refused_where_it_is_compared(run, tmp_path):
    trial = without_cop(tmp_path / "bare")
    code, _, error = run("fit", trial, "--out", tmp_path / "fit", "--freeze", "*")
    assert code == 2 and "no centre of pressure" in error
    code, _, error = run("fit", trial, "--out", tmp_path / "fit", "--freeze", "*", "--no-cop")
    assert code == 2 and "all parameters are frozen" in error, "the trial itself is accepted without it"


@pytest.mark.parametrize("strategy", ["joint", "paper"])
@pytest.mark.parametrize("mm", [30, 200])
def test_a_bench_beyond_the_carriage_is_refused_before_the_fit(run, tmp_path, strategy, mm):
    bench = changed_bench(tmp_path / "far.yaml", forefoot=[{"fulcrum_mm": mm, "stiffness_n_per_mm": 10.0}])
    code, _, error = run("fit", LOW, "--bench", bench, "--strategy", strategy, "--out", tmp_path / "fit")
    assert code == 2
    assert str(bench) in error and "forefoot" in error and f"{mm} mm" in error and not (tmp_path / "fit").exists()


def test_folders_with_other_things_are_refused_and_left_alone(run, tmp_path):
    for name, files in (("walk", {"result.yaml": "kind: walk\n"}), ("mine", {"notes.txt": "mine"}),
                        ("odd", {"fit.json": '{"kind": "sweep"}'}), ("broken", {"fit.json": "{"})):
        (tmp_path / name).mkdir()
        for file, text in files.items():
            (tmp_path / name / file).write_text(text, encoding="utf-8")
        code, _, error = run("fit", LOW, "--out", tmp_path / name)
        assert code == 2 and str(tmp_path / name) in error
        assert {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / name).iterdir()} == files
    (tmp_path / "file").write_text("mine")
    (tmp_path / "dirs" / "fit.json").mkdir(parents=True)
    for out in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "dirs"):
        code, _, error = run("fit", LOW, "--out", out)
        assert code == 2 and "Traceback" not in error
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("text", ["{", "[1, 2]", '{"key": "0", "searches": []}', "\xff", ""])
def test_a_damaged_checkpoint_is_refused_and_kept(run, tmp_path, text):
    path = tmp_path / "fit" / "checkpoint.json"
    path.parent.mkdir()
    path.write_bytes(text.encode("latin-1"))
    code, _, error = run("fit", LOW, "--out", path.parent, "--resume")
    assert code == 2
    assert str(path) in error and "Traceback" not in error
    assert path.read_bytes() == text.encode("latin-1")
    assert [item.name for item in path.parent.iterdir()] == ["checkpoint.json"]


def test_a_manifest_in_the_folder_of_results_is_safe(run, tmp_path):
    folder = tmp_path / "trials"
    shutil.copytree(DATA, folder)
    before = sorted(folder.rglob("*"))
    code, _, _ = run("fit", folder / "exact/low_1.yaml", "--out", folder / "exact")
    assert code == 2 and sorted(folder.rglob("*")) == before
