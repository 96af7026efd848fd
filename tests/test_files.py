"""Files appear whole or not at all."""

import hashlib
import os
import stat
import subprocess
import sys

import pytest

from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256


def test_file_appears_whole(tmp_path):
    path = tmp_path / "result.txt"
    with replaced(path) as stream:
        stream.write("δ\n")
        assert not path.exists()
    assert path.read_bytes() == "δ\n".encode()
    assert [p.name for p in tmp_path.iterdir()] == ["result.txt"]


def test_failure_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "result.bin"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError), replaced(path, "wb") as stream:
        stream.write(b"half")
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["result.bin"]


def test_new_file_has_the_permissions_of_any_other(tmp_path):
    with replaced(tmp_path / "a"):
        pass
    (tmp_path / "b").write_text("")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match=r"absent.result\.txt: cannot be written"), \
            replaced(tmp_path / "absent" / "result.txt"):
        pass


def test_folder_in_the_way_is_named_and_nothing_stays(tmp_path):
    (tmp_path / "taken" / "x").mkdir(parents=True)
    with pytest.raises(InputError, match="cannot be written"), replaced(tmp_path / "taken"):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_only_writing_is_possible(tmp_path):
    with pytest.raises(ValueError, match="'a'"), replaced(tmp_path / "x", "a"):
        pass


def test_sha256_is_that_of_the_bytes(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"abc")
    assert sha256(path) == hashlib.sha256(b"abc").hexdigest()
    with pytest.raises(InputError, match="absent: there is no such file"):
        sha256(tmp_path / "absent")


WRITING = """
import os, signal, sys
from vsf_drake.files import replaced
with replaced(sys.argv[1]) as stream:
    stream.write("half")
    stream.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_has_begun_goes_with_the_next_write_and_what_a_living_one_has_stays(tmp_path):
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
    monkeypatch.setattr(os, "fsync", lambda descriptor: done.append(stat.S_ISDIR(os.fstat(descriptor).st_mode)))
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda *paths: (done.append("named"), replace(*paths)))
    with replaced(tmp_path / "a", lasting=True) as stream:
        stream.write("text")
    assert done == [False, "named", True]
