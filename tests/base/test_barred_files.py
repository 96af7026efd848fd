"""What is no file to read, or far too large, is refused at once by everything that reads: no
waiting, no hashing."""

from __future__ import annotations

import os
import signal

import pytest
from command_line import exit_code
from made_laboratory import STATED, Laboratory
from made_trial import TrialFiles

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import MOST_FILE_BYTES, read_bytes, read_json, read_npz, sha256
from vsf_drake.base.text_table import text_lines
from vsf_drake.base.yaml_file import read_yaml
from vsf_drake.motion.formats.c3d import read_c3d

SPARSE_BYTES = 300 * 10**9
KINDS = {
    "pipe": "is no ordinary file",
    "device": "is no ordinary file",
    "folder": "is a folder",
    "sparse": f"has {SPARSE_BYTES} bytes, which is more than the",
}
READERS = {
    "bytes": lambda path: read_bytes(path, most=MOST_FILE_BYTES),
    "hash": sha256,
    "JSON": read_json,
    "npz": read_npz,
    "table": lambda path: list(text_lines(path)),
    "C3D": read_c3d,
    "YAML": read_yaml,
}
PATIENCE_S = 120.0
"""Longer than kernels take to compile; nothing here takes a second otherwise."""


@pytest.fixture(autouse=True)
def _hurry():
    """Ends a test that waits for the other end of a pipe, or reads without end."""

    def ring(number, frame):
        raise TimeoutError("it still reads")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def bar(path, kind):
    """Puts what is no file to read at `path`, in place of what is there."""
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.touch()
        os.truncate(path, SPARSE_BYTES)
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_every_reader_refuses_it_by_name(tmp_path, kind, read):
    path = bar(tmp_path / "given", kind)
    with pytest.raises(InputError) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}")
    assert KINDS[kind] in str(refused.value)


def test_a_link_to_an_ordinary_file_and_one_of_exactly_the_limit_are_read(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "file")
    (tmp_path / "file").write_bytes(b"abc")
    assert read_bytes(tmp_path / "link", most=3) == b"abc"
    with pytest.raises(InputError, match="has 3 bytes, which is more than the 2 that are read"):
        read_bytes(tmp_path / "link", most=2)


@pytest.mark.parametrize("kind", ["pipe", "device", "sparse"])
@pytest.mark.parametrize("command", ["check", "simulate", "import", "report"])
def test_every_command_refuses_it_in_one_line_that_names_it(tmp_path, capfd, kind, command):
    """The forces of a trial, a walk to import, the table of a result."""
    out = tmp_path / "out"
    if command == "report":
        out.mkdir()
        barred = bar(out / "validation.json", kind)
        words = [out]
    elif command == "import":
        laboratory = Laboratory(tmp_path)
        barred = laboratory.walk()
        words = [laboratory.standing(), bar(barred, kind), "--out", out, *STATED]
    else:
        manifest = TrialFiles(tmp_path).write()
        barred = bar(next(tmp_path.glob("*.mot")), kind)
        words = [manifest, "--out", out]
    assert exit_code(command, *words) == 2
    said, *more = capfd.readouterr().err.strip().splitlines()
    assert said.startswith("error: ")
    assert barred.name in said
    assert KINDS[kind] in said
    assert all(line.startswith("guide: ") for line in more)
