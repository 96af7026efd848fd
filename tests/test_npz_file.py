"""NPZ files of anybody: what is no honest file of numbers and text is refused before it takes time or memory."""

from __future__ import annotations

import io
import json
import struct
import time
import tracemalloc
import zipfile

import numpy as np
import pytest
import yaml

from vsf_drake.analysis.validation.run import SectionStore
from vsf_drake.errors import InputError
from vsf_drake.files import ALWAYS_BYTES, read_npz, sha256
from vsf_drake.report.fit_output import FIT
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.simulation.archive import read_archive
from vsf_drake.simulation.many.run import WalkCache

HONEST = {
    "a": np.arange(24.0).reshape(2, 3, 4), "fortran": np.asfortranarray(np.eye(3)), "text": np.array(["ä", "b", ""]),
    "one": np.array(3), "word": np.array("vsf_drake"), "none": np.zeros((0, 5)), "truth": np.array([True, False]),
    "nan": np.array([np.nan, np.inf])}


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
    """Two bytes changed where the only member is described, at these offsets in its two descriptions."""
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
    "1e13 elements": shaped("(10000000000000,)"), "1e21 elements": shaped("(1000000000000000000000,)"),
    "1e21 of no size": shaped("(1000000000000000000000,)", "<U0", b""), "overflow": shaped("(4294967296, 536870912)"),
    "no element, much besides": shaped("(0, 1000000000000000000000000000000)", content=b""),
    "negative": shaped("(-8,)"), "more than stated": shaped("(7,)"), "less than stated": shaped("(9,)"),
    "bomb": zipped(("a.npy", b"\x93NUMPY\1\0" + b"\0" * (2 * ALWAYS_BYTES))),
    "bombs": zipped(*((f"{i}.npy", b"\0" * (ALWAYS_BYTES // 16)) for i in range(40))),
    "bomb that lies": poked(zipped(("a.npy", b"\0" * ALWAYS_BYTES)), local=24, central=26, value=b"\0\0"),
    "encrypted": poked(ONE, local=6, central=8, value=b"\1\0"),
    "unknown method": poked(ONE, local=8, central=10, value=b"\x63\0"),
    "bzip2": zipped(("a.npy", BARE.getvalue()), method=zipfile.ZIP_BZIP2),
    "lzma": zipped(("a.npy", BARE.getvalue()), method=zipfile.ZIP_LZMA),
    "empty": b"", "bare .npy": BARE.getvalue(), "text": b"no zip file\n" * 100, "PK": b"PK\5\6",
    "pickle": zipped(("a.npy", PICKLED.getvalue())), "objects": shaped("(8,)", "|O"), "bare pickle": PICKLED.getvalue(),
    "records": stated("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (8,), }"),
    "brackets": stated("(" * 9000), "code": stated("{'descr': '<f8', 'fortran_order': False, 'shape': (exit(),), }"),
    "half a character": shaped("(1,)", "<U1", b"\0\xd8\0\0"), "beyond Unicode": shaped("(1,)", "<U1", b"\xff" * 4),
    "escape": shaped("(1,)", "<U1", b"\x1b\0\0\0"), "name": zipped(("\x1b[31m.npy", BARE.getvalue())),
    "twice": zipped(("a.npy", BARE.getvalue()), ("a.npy", BARE.getvalue())),
    "many": zipped(*((f"{i}.npy", b"") for i in range(20_000))),
    "zip64": b"PK\6\6" + b"\0" * 52 + b"PK\6\7" + b"\0" * 16 + END,
    "truncated": FULL[:-30], "no beginning": FULL[30:], "damaged": FULL[:200] + b"\xff" * 100 + FULL[300:],
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("harm", HARMFUL)
def test_no_file_harms(tmp_path, harm):
    path = tmp_path / "result.npz"
    path.write_bytes(HARMFUL[harm])
    tracemalloc.start()
    start = time.perf_counter()
    with pytest.raises(InputError, match=r"result\.npz"):
        read_npz(path)
    assert time.perf_counter() - start < 10.0
    assert tracemalloc.get_traced_memory()[1] < 1.5 * ALWAYS_BYTES
    tracemalloc.stop()


def from_archive(path):
    (path.parent / "result.yaml").write_text(yaml.safe_dump({"arrays_sha256": sha256(path)}), encoding="utf-8")
    read_archive(path.parent)


def from_fit(path):
    (path.parent / "fit.json").write_text(json.dumps({"kind": "fit", "arrays_sha256": sha256(path)}), encoding="utf-8")
    path.rename(path.parent / "fit.npz")
    FIT.read(path.parent)


def from_store(path):
    about = {"key": "k", "arrays_sha256": sha256(path), "table": {}, "missing": [], "wall_s": 1.0}
    path.with_suffix(".json").write_text(json.dumps(about), encoding="utf-8")
    if SectionStore(path.parent, "k").read("result") is None:  # it is computed anew
        raise InputError("damaged")


def from_cache(path):
    store = WalkCache(path.parent)
    store._path("abc").parent.mkdir()
    path.rename(store._path("abc"))
    reply, said = store.read("abc")
    if reply is None and "damaged" in said:  # it is computed anew
        raise InputError("damaged")


def from_folder(path):
    (path.parent / "a.json").write_text(json.dumps({"arrays_sha256": sha256(path)}), encoding="utf-8")
    ResultsFolder(kind="a", command="a", table="a.json", arrays=path.name).read(path.parent)


READERS = {
    "archive": from_archive, "fit": from_fit, "section": from_store, "cache": from_cache,
    "report": from_folder}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("harm", [
    "1e13 elements", "bomb", "encrypted", "unknown method", "empty", "bare .npy", "pickle"])
def test_every_reader_asks_the_same_door(tmp_path, harm, reader):
    path = tmp_path / "result.npz"
    path.write_bytes(HARMFUL[harm])
    with pytest.raises(InputError):
        READERS[reader](path)


@pytest.mark.parametrize("compressed", [np.savez, np.savez_compressed])
def test_what_numpy_writes_is_read_as_numpy_reads_it(tmp_path, compressed):
    path = tmp_path / "a.npz"
    compressed(path, **HONEST)
    found = read_npz(path)
    assert list(found) == list(HONEST)
    for name, array in HONEST.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype and found[name].shape == array.shape
        assert found[name].flags.f_contiguous == array.flags.f_contiguous and found[name].flags.writeable


def test_a_large_honest_file_is_read(tmp_path):
    path, array = tmp_path / "a.npz", np.random.default_rng(0).normal(size=(ALWAYS_BYTES // 64, 9))
    np.savez(path, array=array)
    np.testing.assert_array_equal(read_npz(path)["array"], array)
