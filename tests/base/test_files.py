"""Files appear whole or not at all, and what anybody may have made of JSON and NPZ is refused
before it harms."""

from __future__ import annotations

import io
import os
import stat
import struct
import subprocess
import sys
import time
import tracemalloc
import zipfile
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from vsf_drake.base import files
from vsf_drake.base.errors import InputError
from vsf_drake.base.files import flat, plain, read_json, read_npz, record, replaced, write_json


def test_a_file_appears_whole_or_the_old_one_stays_and_nothing_else(tmp_path):
    path = tmp_path / "result.txt"
    with replaced(path) as stream:
        stream.write("δ\n")
        assert not path.exists()
    with pytest.raises(RuntimeError), replaced(path, "wb") as stream:
        stream.write(b"half")
        raise RuntimeError
    (tmp_path / "taken" / "x").mkdir(parents=True)
    for target in (tmp_path / "absent" / "result.txt", tmp_path / "taken"):
        with (
            pytest.raises(InputError, match=rf"{target.name}: cannot be written"),
            replaced(target),
        ):
            pass
    assert path.read_bytes() == "δ\n".encode()
    assert {p.name for p in tmp_path.iterdir()} == {"result.txt", "taken"}


WRITING = """
import os, signal, sys
from vsf_drake.base.files import replaced
with replaced(sys.argv[1]) as stream:
    stream.write("half")
    stream.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_has_begun_goes_with_the_next_write_and_what_a_living_one_has_stays(
    tmp_path,
):
    target = tmp_path / "a[1].json"
    subprocess.run([sys.executable, "-c", WRITING, target], check=False)
    [dead] = tmp_path.iterdir()
    foreign = tmp_path / f".{target.name}.00000000-00000000.part"
    foreign.touch()
    with replaced(target) as living:
        assert not dead.exists()
        with replaced(target) as stream:
            stream.write("second")
        living.write("first")
    assert target.read_text(encoding="utf-8") == "first"
    assert foreign.exists()
    os.utime(foreign, (1e9, 1e9))
    with replaced(target):
        pass
    assert list(tmp_path.iterdir()) == [target]


def test_what_must_last_is_on_the_disk_before_it_has_its_name(monkeypatch, tmp_path):
    done = []
    monkeypatch.setattr(
        os, "fsync", lambda descriptor: done.append(stat.S_ISDIR(os.fstat(descriptor).st_mode))
    )
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda *paths: (done.append("named"), replace(*paths)))
    with replaced(tmp_path / "a", lasting=True) as stream:
        stream.write("text")
    assert done == [False, "named", True]


@pytest.mark.parametrize("name", ["a\0b", "a\ud800b"])
def test_what_can_be_no_name_of_a_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read"), files.opened(tmp_path / name):
        pass


# JSON.


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[1]",
        "3",
        "{",
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"a": ' + "9" * 400 + "}",
        '{"a": ' + "9" * 5000 + "}",
        '{"a": NaN}',
        '{"a": 1e999}',
        '{"a": "\\u001b[31m"}',
        '{"\\ud800": 1}',
        "{\0}",
        '{"a": [' + "{}," * 1_000_000 + "0]}",
        b'{"a": "\xff"}',
    ],
)
def test_what_is_no_table_is_refused(tmp_path, text):
    path = tmp_path / "table.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=r"table\.json: cannot be read"):
        read_json(path)


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


MADE = Outer(
    inner=Inner(0.3, ("ä\n",)),
    rows=[Inner(2.0)],
    by_name={"x": None, "y": 0.5},
    way="load",
    limits=(1.0, 2),
)


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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inner": {}}, r"^inner\.value is missing"),
        ({"rows": [{"value": "1"}]}, r"^rows\[0\]\.value is '1', not float"),
        ({"by_name": {"x": True}}, r"^by_name\.x is 'True'"),
        ({"way": "up"}, "^way is 'up'"),
        ({"limits": [1.0]}, "^limits is"),
        ({"limits": [1.0, "x"]}, r"^limits\[1\] is 'x', not int"),
        ({"inner": 3}, "^inner is no table"),
    ],
)
def test_what_a_record_cannot_be_made_of_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        record(Outer, plain(MADE) | change)


# NPZ.

ALWAYS = 2**22  # instead of `files.ALWAYS_BYTES`, so that honest and harmful files are small


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(files, "ALWAYS_BYTES", ALWAYS)


HONEST = {
    "a": np.arange(24.0).reshape(2, 3, 4),
    "fortran": np.asfortranarray(np.eye(3)),
    "text": np.array(["ä", "b", ""]),
    "one": np.array(3),
    "word": np.array("vsf_drake"),
    "none": np.zeros((0, 5)),
    "truth": np.array([True, False]),
    "nan": np.array([np.nan, np.inf]),
}


def packed(**arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def zipped(*members, method=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method, compresslevel=1) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return stream.getvalue()


def stated(header, content=b"\0" * 64, name="a.npy"):
    """A zip file of one array with this header."""
    header = header.encode("latin-1") + b"\n"
    return zipped((name, b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + content))


def shaped(shape, kind="<f8", content=b"\0" * 64):
    return stated(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", content)


def poked(content, *, local, central, value):
    """Two bytes changed where the only member is described, at these offsets in its two
    descriptions."""
    content = bytearray(content)
    for place, offset in ((0, local), (content.rindex(b"PK\1\2"), central)):
        content[place + offset : place + offset + 2] = value
    return bytes(content)


ONE = zipped(("a.npy", b"\x93NUMPY\1\0"))
FULL = packed(a=np.arange(1000.0))
PICKLED = io.BytesIO()
np.save(PICKLED, np.array([{"a": 1}], dtype=object), allow_pickle=True)
BARE = io.BytesIO()
np.save(BARE, np.arange(3.0))
END = zipped()
HARMFUL = {
    "1e13 elements": shaped("(10000000000000,)"),
    "1e21 elements": shaped("(1000000000000000000000,)"),
    "1e21 of no size": shaped("(1000000000000000000000,)", "<U0", b""),
    "overflow": shaped("(4294967296, 536870912)"),
    "no element, much besides": shaped("(0, 1000000000000000000000000000000)", content=b""),
    "negative": shaped("(-8,)"),
    "more than stated": shaped("(7,)"),
    "less than stated": shaped("(9,)"),
    "bomb": packed(a=np.zeros(ALWAYS // 4)),
    "bombs": zipped(*((f"{i}.npy", b"\0" * (ALWAYS // 16)) for i in range(40))),
    "bomb that lies": poked(zipped(("a.npy", b"\0" * ALWAYS)), local=24, central=26, value=b"\0\0"),
    "encrypted": poked(ONE, local=6, central=8, value=b"\1\0"),
    "unknown method": poked(ONE, local=8, central=10, value=b"\x63\0"),
    "bzip2": zipped(("a.npy", BARE.getvalue()), method=zipfile.ZIP_BZIP2),
    "lzma": zipped(("a.npy", BARE.getvalue()), method=zipfile.ZIP_LZMA),
    "empty": b"",
    "bare .npy": BARE.getvalue(),
    "text": b"no zip file\n" * 100,
    "PK": b"PK\5\6",
    "pickle": zipped(("a.npy", PICKLED.getvalue())),
    "objects": shaped("(8,)", "|O"),
    "bare pickle": PICKLED.getvalue(),
    "records": stated("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (8,), }"),
    "brackets": stated("(" * 9000),
    "code": stated("{'descr': '<f8', 'fortran_order': False, 'shape': (exit(),), }"),
    "half a character": shaped("(1,)", "<U1", b"\0\xd8\0\0"),
    "beyond Unicode": shaped("(1,)", "<U1", b"\xff" * 4),
    "escape": shaped("(1,)", "<U1", b"\x1b\0\0\0"),
    "name": zipped(("\x1b[31m.npy", BARE.getvalue())),
    "twice": zipped(("a.npy", BARE.getvalue()), ("a.npy", BARE.getvalue())),
    "many": zipped(*((f"{i}.npy", b"") for i in range(20_000))),
    "zip64": b"PK\6\6" + b"\0" * 52 + b"PK\6\7" + b"\0" * 16 + END,
    "truncated": FULL[:-30],
    "no beginning": FULL[30:],
    "damaged": FULL[:200] + b"\xff" * 100 + FULL[300:],
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("harm", HARMFUL)
def test_no_npz_file_harms(tmp_path, small, harm):
    path = tmp_path / "result.npz"
    path.write_bytes(HARMFUL[harm])
    tracemalloc.start()
    start = time.perf_counter()
    with pytest.raises(InputError, match=r"result\.npz"):
        read_npz(path)
    assert time.perf_counter() - start < 10.0
    assert tracemalloc.get_traced_memory()[1] < 1.5 * ALWAYS
    tracemalloc.stop()


def test_what_numpy_writes_is_read_as_numpy_reads_it(tmp_path):
    path = tmp_path / "a.npz"
    for write in (np.savez, np.savez_compressed):
        write(path, **HONEST)
        arrays = read_npz(path)
        assert list(arrays) == list(HONEST)
        for name, array in HONEST.items():
            np.testing.assert_array_equal(arrays[name], array)
            assert arrays[name].dtype == array.dtype and arrays[name].shape == array.shape
            assert (
                arrays[name].flags.f_contiguous == array.flags.f_contiguous
                and arrays[name].flags.writeable
            )


def test_a_large_honest_file_is_read(tmp_path, small):
    path, array = tmp_path / "a.npz", np.arange(9.0 * (ALWAYS // 64)).reshape(-1, 9)
    np.savez(path, array=array)
    assert array.nbytes > ALWAYS
    np.testing.assert_array_equal(read_npz(path)["array"], array)
