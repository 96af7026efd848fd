"""Tables come back from JSON as they were written, and what no table can be is refused with the file's name."""

import pytest

from vsf_drake.analysis.json_file import MOST_BYTES, read_json, write_json
from vsf_drake.errors import InputError


def test_a_table_comes_back_with_every_digit(tmp_path):
    table = {"third": 1.0 / 3.0, "name": "Süd \N{BICYCLE} C:\\udata", "none": None, "rows": [{"n": 2**64}, []]}
    write_json(tmp_path / "a.json", table)
    assert read_json(tmp_path / "a.json") == table


@pytest.mark.parametrize("text", [
    "", "{", '{"a": NaN}', '{"a": -Infinity}', '{"a": 1e999}', "9" * 5000, "1" + "0" * 400, "[" * 100_000,
    '{"a":' * 100_000, '{"a": "\\ud800"}', "[0," + " " * MOST_BYTES + "0]"], ids=lambda text: text[:12])
def test_what_no_table_can_be_is_refused(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"a\.json: cannot be read as JSON"):
        read_json(tmp_path / "a.json")


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"there is no such file\. Look elsewhere"):
        read_json(tmp_path / "a.json", right="Look elsewhere")
    with pytest.raises(InputError, match="cannot be read as JSON"):
        read_json(tmp_path)
