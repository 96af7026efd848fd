"""JSON of anybody: what is no table of finite numbers and text is refused."""

from dataclasses import dataclass
from typing import Literal

import pytest

from vsf_drake.analysis.tuning.schedule import load_schedule
from vsf_drake.errors import InputError
from vsf_drake.files import flat, plain, read_json, record, write_json
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


@dataclass(frozen=True)
class Inner:
    value: float
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outer:
    inner: Inner
    rows: list[Inner]
    by_name: dict[str, float | None]
    way: Literal["load", "motion"]
    limits: tuple[float, int] | None = None


MADE = Outer(inner=Inner(1.5, ("a",)), rows=[Inner(2.0)], by_name={"x": None, "y": 0.5}, way="load", limits=(1.0, 2))


def test_a_record_comes_back_from_a_file(tmp_path):
    write_json(tmp_path / "a.json", plain(MADE))
    assert record(Outer, read_json(tmp_path / "a.json")) == MADE


@dataclass(frozen=True)
class Flat:
    n: int
    means: dict[str, float | None] = flat()


def test_entries_of_a_flat_mapping_stand_among_the_fields_and_come_back():
    values = {"n": 2, "error_bw": 0.5, "late_ms": None}
    assert plain(Flat(2, {"error_bw": 0.5, "late_ms": None})) == values
    assert record(Flat, values) == Flat(2, {"error_bw": 0.5, "late_ms": None})
    with pytest.raises(ValueError, match="error_bw is 'x'"):
        record(Flat, values | {"error_bw": "x"})


@pytest.mark.parametrize(("change", "message"), [
    ({"inner": {}}, r"^inner\.value is missing"), ({"rows": [{"value": "1"}]}, r"^rows\[0\]\.value is '1', not float"),
    ({"by_name": {"x": True}}, r"^by_name\.x is 'True'"), ({"way": "up"}, "^way is 'up'"),
    ({"limits": [1.0]}, "^limits is"), ({"inner": 3}, "^inner is no table")])
def test_what_a_record_cannot_be_made_of_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        record(Outer, plain(MADE) | change)
