"""Damaged files: a reader gives something sound or an InputError. The long form is `python tests/fuzz/run.py`."""

import pytest
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
    faults = {number: workbench.fault(reader, number) for number in range(max(1, MUTATIONS // reader.slow))}
    assert not {number: fault for number, fault in faults.items() if fault}
