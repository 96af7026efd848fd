"""JSON of anybody: what is no table of finite numbers and text is refused."""

import pytest

from vsf_drake.analysis.tuning.schedule import load_schedule
from vsf_drake.errors import InputError
from vsf_drake.files import read_json, write_json
from vsf_drake.report.results_folder import ResultsFolder


@pytest.mark.parametrize("text", [
    "", "[1]", "3", "{", "[" * 100_000, '{"a":' * 100_000, '{"a": ' + "9" * 400 + "}", '{"a": ' + "9" * 5000 + "}",
    '{"a": NaN}', '{"a": 1e999}', '{"a": "\\u001b[31m"}', '{"\\ud800": 1}', "{\0}",
    '{"a": [' + "{}," * 1_000_000 + "0]}", b'{"a": "\xff"}'])
@pytest.mark.parametrize("read", [
    read_json, load_schedule,
    lambda path: ResultsFolder(kind="tuning", command="tune", table=path.name).read(path.parent)])
def test_what_is_no_table_is_refused(tmp_path, text, read):
    path = tmp_path / "table.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=r"table\.json: cannot be read"):
        read(path)


def test_a_table_comes_back(tmp_path):
    table = {"a": [1, 0.1 + 0.2, None, True], "ä": {"b": "x\ny", "c": 10**60}}
    write_json(tmp_path / "a.json", table)
    assert read_json(tmp_path / "a.json") == table
