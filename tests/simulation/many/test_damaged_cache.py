"""A cache never returns a damaged entry, and is never left with one by a full disk."""

from __future__ import annotations

import errno
import subprocess
import sys
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.simulation.many import run as cache_module
from vsf_drake.simulation.many import simulate_many


def entries(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.npz"))


def spoil(path: Path, how: str) -> None:
    content = path.read_bytes()
    if how == "empty":
        path.write_bytes(b"")
    elif how == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif how == "other":
        path.write_bytes(b"not a zip file at all" * 100)
    else:
        place = int(float(how) * len(content))
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1:])


@pytest.mark.parametrize("how", ["empty", "truncated", "other", "0.1", "0.3", "0.5", "0.7", "0.9"])
def test_a_damaged_entry_is_noticed_computed_anew_and_replaced(tmp_path, walks, sweep, assert_same, how):
    first = simulate_many(sweep(1), workers=1, cache=tmp_path)
    spoil(entries(tmp_path)[0], how)
    second = simulate_many(sweep(1), workers=1, cache=tmp_path)
    assert len(walks) == 2 and not second[0].from_cache
    assert any("cache entry was damaged" in note for note in second[0].notes)
    assert_same(first, second)
    third = simulate_many(sweep(1), workers=1, cache=tmp_path)
    assert len(walks) == 2 and not any("cache" in note for note in third[0].notes)
    assert_same(first, third)


def test_no_changed_byte_anywhere_changes_what_is_read(tmp_path, sweep):
    [outcome] = simulate_many(sweep(1), workers=1, cache=tmp_path)
    path, store = entries(tmp_path)[0], cache_module.WalkCache(tmp_path)
    content, noticed = path.read_bytes(), 0
    for place in np.linspace(0, len(content) - 1, 400).astype(int):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1:])
        reply, note = store.read(path.stem)
        noticed += bool(note)
        if reply is not None:  # the byte was one of the archive's own, a date for example
            assert all(reply.arrays[name].tobytes() == array.tobytes() for name, array in outcome.arrays.items())
            assert reply.text == "" and reply.unconverged_steps == outcome.unconverged_steps
    assert noticed > 350


def test_an_entry_under_another_name_is_not_believed(tmp_path, walks, sweep):
    simulate_many(sweep(2), workers=1, cache=tmp_path)
    one, other = entries(tmp_path)
    other.write_bytes(one.read_bytes())
    assert sorted(o.from_cache for o in simulate_many(sweep(2), workers=1, cache=tmp_path)) == [False, True]


def test_an_array_changed_with_a_valid_archive_around_it_is_noticed(tmp_path, walks, sweep):
    simulate_many(sweep(1), workers=1, cache=tmp_path)
    path = entries(tmp_path)[0]
    with np.load(path) as stored:
        content = {name: stored[name] for name in stored.files}
    about = content.pop("about.json")
    content["grf_W"] = content["grf_W"] + 1e-12
    with path.open("wb") as stream:
        np.savez(stream, **content)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("about.json", about)
    [outcome] = simulate_many(sweep(1), workers=1, cache=tmp_path)
    assert not outcome.from_cache and any("SHA-256" in note for note in outcome.notes)


def test_a_full_disk_ends_with_a_message_and_leaves_sound_entries_only(monkeypatch, tmp_path, walks, sweep):
    real = cache_module.replaced

    @contextmanager
    def filling(path, mode, **options):
        with real(path, mode, **options) as stream:
            if len(entries(tmp_path)) == 2:
                stream.write(b"half of it")
                raise OSError(errno.ENOSPC, "No space left on device")
            yield stream

    with monkeypatch.context() as patch:
        patch.setattr(cache_module, "replaced", filling)
        with pytest.raises(InputError, match=r"No space left on device.*Make room and run the same again"):
            simulate_many(sweep(5), workers=1, cache=tmp_path)
    assert len(entries(tmp_path)) == 2
    assert sorted(p for p in tmp_path.rglob("*") if p.is_file()) == entries(tmp_path)
    outcomes = simulate_many(sweep(5), workers=1, cache=tmp_path)
    assert sum(o.from_cache for o in outcomes) == 2 and all(o.ok for o in outcomes)


LIMITED = """
import resource, sys
from dataclasses import replace
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.many import WalkCase, simulate_many
trial = load_trial(embedded_trials("exact")[0])
cases = [WalkCase(trial=replace(trial, start_s=0.45, end_s=end)) for end in (0.46, 0.9)]
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
simulate_many(cases, workers=1, cache=sys.argv[1])
"""


def test_a_file_system_that_refuses_to_go_on_leaves_no_half_entry(tmp_path):
    done = subprocess.run([sys.executable, "-c", LIMITED, tmp_path / "cache"], capture_output=True, text=True,
                          check=False)
    assert "a finished walk cannot be kept (File too large)" in done.stderr
    files = [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]
    assert files == entries(tmp_path / "cache") and len(files) == 1


def test_a_cache_that_cannot_be_a_folder_is_refused(tmp_path, sweep):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be a folder"):
        simulate_many(sweep(1), workers=1, cache=tmp_path / "file")
