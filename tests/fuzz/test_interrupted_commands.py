"""What a signal leaves of a command, and what the next run makes of it. The long form is `python tests/fuzz/run.py`."""

import time

import pytest
from kills import CODES, commands, content, differences, interrupted, started


@pytest.mark.slow
@pytest.mark.parametrize("name", ["simulate", "sweep", "import"])
def test_a_command_that_a_signal_ended_leaves_no_trace_in_the_next_run(tmp_path, name):
    (tmp_path / "inputs").mkdir()
    command = next(each for each in commands(tmp_path / "inputs") if each.name == name)
    whole = tmp_path / "whole"
    process, began = started(command, whole), time.monotonic()
    assert process.wait(300.0) == 0
    usual_s = time.monotonic() - began
    for i, signal in enumerate(CODES):
        (tmp_path / signal).mkdir()
        assert not interrupted(command, signal, 0.25 * (i + 1) * usual_s, tmp_path / signal / "out", whole,
                               always=False)


def test_results_that_differ_in_more_than_times_are_told_apart(tmp_path):
    for name, wall_s, cost in (("a", 1, 2.0), ("b", 3, 2.0), ("c", 1, 2.5)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "fit.json").write_text(f'{{"wall_s": {wall_s}, "rows": [{{"cost": {cost}}}]}}')
    a, b, c = (content(tmp_path / name) for name in "abc")
    assert list(differences(a, b)) == []
    assert list(differences(a, c)) == ["/fit.json/rows[0]/cost: 2.0 became 2.5"]
    assert list(differences(a, {})) == ["/fit.json is gone"]
