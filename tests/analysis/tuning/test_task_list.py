"""Tasks as a user names them: on the command line and in a file; and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from vsf_drake.analysis.tuning.schedule import DESCRIPTORS, read_tasks
from vsf_drake.errors import InputError

NONE = dict.fromkeys(DESCRIPTORS)


def written(folder, text):
    path = folder / "tasks.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_words_name_a_task_and_its_trials():
    slow, fast = read_tasks(["slow=a/low_1.yaml", "fast=high_1.yaml", "slow=a/low_2.yaml"])
    assert (slow.label, slow.manifests, dict(slow.descriptors)) == (
        "slow", (Path("a/low_1.yaml"), Path("a/low_2.yaml")), NONE)
    assert (fast.label, fast.manifests) == ("fast", (Path("high_1.yaml"),))


def test_a_file_tells_descriptors_and_its_paths_are_its_own(tmp_path):
    path = written(tmp_path, "tasks:\n- {label: slow, trials: [low_1.yaml], speed_m_per_s: 0.8}\n"
                             "- {label: up, trials: [x/up.yaml], speed_m_per_s: 1, slope_deg: 5, carried_kg: 0}\n")
    slow, up = read_tasks([path])
    assert slow.manifests == (tmp_path / "low_1.yaml",)
    assert dict(slow.descriptors) == NONE | {"speed_m_per_s": 0.8}
    assert up.manifests == (tmp_path / "x/up.yaml",)
    assert dict(up.descriptors) == {"speed_m_per_s": 1.0, "slope_deg": 5.0, "carried_kg": 0.0}


def test_a_label_with_an_equals_sign_in_its_path_is_cut_at_the_first():
    tasks = read_tasks(["a=x=1.yaml", "b=y.yaml"])
    assert tasks[0].manifests == (Path("x=1.yaml"),)


@pytest.mark.parametrize(
    ("words", "said"),
    [(["a=x.yaml"], "1 task make no schedule"), ([], "0 tasks make no schedule"),
     (["=x.yaml", "b=y.yaml"], "is no task"),
     (["a=", "b=y.yaml"], "is no task"), (["a=x.yaml", "b=x.yaml"], "x.yaml: a and b: is named twice"),
     (["a=x.yaml", "a=./x.yaml", "b=y.yaml"], "named twice"), (["none.yaml"], "none.yaml: there is no such file")])
def test_words_that_are_no_tasks_are_refused(words, said):
    with pytest.raises(InputError, match=said.replace(".", r"\.")):
        read_tasks(words)


@pytest.mark.parametrize(
    ("text", "said"),
    [("tasks: [{label: a, trials: [x.yaml], speed: 1}]", "speed"),
     ("tasks: [{label: '', trials: [x.yaml]}]", "is empty"),
     ("tasks: [{label: a, trials: []}]", "names no trial"), ("tasks: [{trials: [x.yaml]}]", "label"),
     ("tasks: [{label: a, trials: [x.yaml], speed_m_per_s: -1}]", "speed_m_per_s"),
     ("tasks: [{label: a, trials: [x.yaml]}, {label: a, trials: [y.yaml]}]", "has two tasks 'a'"),
     ("subject: 1", "tasks")])
def test_files_that_are_no_tasks_are_refused_with_file_and_place(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=said) as raised:
        read_tasks([path])
    assert path in str(raised.value)


def test_one_label_with_two_descriptions_is_refused(tmp_path):
    path = written(tmp_path, "tasks: [{label: a, trials: [x.yaml], speed_m_per_s: 1}, {label: b, trials: [y.yaml]}]")
    with pytest.raises(InputError, match="'a' is described in two ways"):
        read_tasks([path, "a=z.yaml"])
