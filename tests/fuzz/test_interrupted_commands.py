"""What a signal leaves of a command, and what the next run makes of it. The long form is `python tests/fuzz/run.py`."""

import time

import pytest
from kills import CODES, commands, interrupted, started


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
