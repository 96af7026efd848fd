"""Damaged files: a reader gives something sound or an InputError. The long form is `python
tests/fuzz/run.py`."""

import time

import pytest
from kills import CODES, commands, interrupted, started
from readers import READERS, Workbench

MUTATIONS = 60

every_reader = pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)


@pytest.fixture(scope="module")
def workbench(tmp_path_factory):
    return Workbench(tmp_path_factory.mktemp("fuzz"))


@every_reader
def test_undamaged_files_read(workbench, reader):
    workbench.undamaged(reader)


@pytest.mark.filterwarnings("error")
@every_reader
def test_damaged_files_read_or_are_refused(workbench, reader):
    faults = {
        number: workbench.fault(reader, number)
        for number in range(max(1, MUTATIONS // reader.slow))
    }
    assert not {number: fault for number, fault in faults.items() if fault}


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
        assert not interrupted(
            command,
            signal,
            0.25 * (i + 1) * usual_s,
            tmp_path / signal / "out",
            whole,
            always=False,
        )
