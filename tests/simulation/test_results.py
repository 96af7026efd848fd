"""A result that is read back is the one that was saved, and nothing half-written stays behind."""

from __future__ import annotations

import dataclasses
import errno
import os
import signal
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_results import make_bench, make_walk

from vsf_drake.base.errors import InputError
from vsf_drake.simulation.archive import RECORD_FILE, check_target
from vsf_drake.simulation.results import load_bench, load_walk, result_folder, save_bench, save_walk


def assert_same(first, second):
    for field in dataclasses.fields(first):
        a, b = getattr(first, field.name), getattr(second, field.name)
        if isinstance(a, np.ndarray):
            assert b.dtype == a.dtype
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        else:
            assert a == b, field.name
            assert type(a) is type(b), field.name


def test_walk_and_bench_are_read_back_bit_for_bit(tmp_path):
    walk, bench = make_walk(), make_bench()
    assert np.isnan(walk.cop_W).any(), "gaps must survive too"
    save_walk(walk, tmp_path / "walk")
    assert_same(walk, load_walk(tmp_path / "walk"))
    save_bench(bench, tmp_path / "bench")
    again = load_bench(tmp_path / "bench")
    assert_same(dataclasses.replace(bench, settings=()), dataclasses.replace(again, settings=()))
    for first, second in zip(bench.settings, again.settings, strict=True):
        assert_same(first, second)


def test_arrays_need_no_pickle_and_each_is_described(tmp_path):
    save_walk(make_walk(), tmp_path / "out")
    sidecar = yaml.safe_load((tmp_path / "out" / "result.yaml").read_text())
    with np.load(tmp_path / "out" / "result.npz", allow_pickle=False) as stored:
        assert set(stored.files) == set(sidecar["arrays"])
        for name in stored.files:
            described = sidecar["arrays"][name]
            assert (
                described["size"] == list(stored[name].shape)
                and described["unit"]
                and described["meaning"]
            )
            if name.endswith("_W"):
                assert described["frame"] == "W"
    assert sidecar["coordinate_units"]["pelvis_tx"] == "m"
    assert sidecar["coordinate_units"]["knee_angle_r"] == "rad"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_nothing_stays_after_a_failure(tmp_path, error):
    with pytest.raises(error), result_folder(tmp_path / "new" / "deep", "walk") as folder:
        (folder / "half.txt").write_text("half")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_failure_leaves_an_older_result_as_it_was(tmp_path):
    save_walk(make_walk(), tmp_path / "out")
    before = {f.name: f.read_bytes() for f in (tmp_path / "out").iterdir()}
    with pytest.raises(RuntimeError), result_folder(tmp_path / "out", "walk") as folder:
        (folder / "result.npz").write_bytes(b"half")
        raise RuntimeError
    assert {f.name: f.read_bytes() for f in (tmp_path / "out").iterdir()} == before
    assert [f.name for f in tmp_path.iterdir()] == ["out"]


def test_missing_damaged_or_foreign_results_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"result\.yaml: there is no such file"):
        load_walk(tmp_path)
    save_walk(make_walk(), tmp_path / "walk")
    with pytest.raises(InputError, match="of a walk, not of a bench"):
        load_bench(tmp_path / "walk")
    sidecar = tmp_path / "walk" / "result.yaml"
    text = sidecar.read_text()
    sidecar.write_text(text.replace("subject_mass_kg:", "subject_mass:"))
    with pytest.raises(InputError, match="subject_mass_kg: is missing"):
        load_walk(tmp_path / "walk")
    sidecar.write_text(text)
    (tmp_path / "walk" / "result.npz").write_bytes(b"PK but not a zip")
    with pytest.raises(InputError, match="SHA-256 differs"):
        load_walk(tmp_path / "walk")
    (tmp_path / "walk" / "result.npz").unlink()
    with pytest.raises(InputError, match=r"result\.npz: there is no such file"):
        load_walk(tmp_path / "walk")


def write(out, kind="walk", **texts):
    with result_folder(out, kind) as folder:
        for name, text in texts.items():
            (folder / name).mkdir()
            (folder / name / "figure.txt").write_text(text)


def files(out):
    return {path.relative_to(out).as_posix() for path in out.rglob("[!.]*") if path.is_file()}


def test_a_later_run_leaves_nothing_of_an_earlier_one_of_its_kind_and_all_of_others(tmp_path):
    write(tmp_path / "out", a="1", b="1", c="1")
    write(tmp_path / "out", "bench", bench="1")
    (tmp_path / "out" / "b" / "mine.txt").write_text("mine")
    (tmp_path / "out" / "c" / "figure.txt").write_text("edited")
    write(tmp_path / "out", a="2")
    assert files(tmp_path / "out") == {
        "a/figure.txt",
        "b/mine.txt",
        "c/figure.txt",
        "bench/figure.txt",
    }
    assert (tmp_path / "out" / "c" / "figure.txt").read_text() == "edited"


def test_a_run_that_is_killed_while_its_files_come_leaves_none_of_the_earlier_ones(
    tmp_path, monkeypatch
):
    out = tmp_path / "out"
    write(out, a="1", b="1", c="1")
    replace = os.replace
    with monkeypatch.context() as stopping:

        def stop(source, target):
            if Path(target).parent.name == "b":
                raise KeyboardInterrupt
            replace(source, target)

        stopping.setattr(os, "replace", stop)
        with pytest.raises(KeyboardInterrupt):
            write(out, a="2", b="2")
    assert files(out) == {"a/figure.txt"} and (out / "a" / "figure.txt").read_text() == "2"
    check_target(out, "walk")
    write(out, d="3")
    assert files(out) == {"d/figure.txt"}


def test_a_folder_on_another_disk_than_its_parent_is_filled(tmp_path, monkeypatch):
    disk, out = tmp_path / "disk", tmp_path / "here" / "out"
    disk.mkdir()
    out.parent.mkdir()
    out.symlink_to(disk)
    replace = os.replace

    def within(source, target):
        if disk not in Path(source).parents:
            raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))
        replace(source, target)

    write(out, a="1")
    monkeypatch.setattr(os, "replace", within)
    write(out, b="2")
    assert files(disk) == {"b/figure.txt"} and [path.name for path in out.parent.iterdir()] == [
        "out"
    ]


@pytest.mark.parametrize("way", ["file", "folder", "linked folder", "linked file", "other disk"])
def test_what_is_in_the_way_or_leads_out_is_refused_before_anything_goes(
    tmp_path, monkeypatch, way
):
    out, victim = tmp_path / "out", tmp_path / "victim"
    write(out, a="1", b="1")
    write(victim, "bench", b="mine")
    (out / "a" / "figure.txt").unlink()
    (out / "a").rmdir()
    if way == "file":
        (out / "a").write_text("mine")
    elif way == "folder":
        (out / "a" / "figure.txt").mkdir(parents=True)
    elif way == "linked folder":
        (out / "a").symlink_to(victim / "b")
    elif way == "linked file":
        (out / "a").mkdir()
        (out / "a" / "figure.txt").symlink_to(victim / "b" / "figure.txt")
    else:
        (out / "a").mkdir()
        stat = Path.stat
        monkeypatch.setattr(
            Path,
            "stat",
            lambda path, **options: os.stat_result(
                (
                    *(found := stat(path, **options))[:2],
                    found.st_dev + (path.name == "a"),
                    *found[3:],
                )
            ),
        )
    before = {path: path.read_text() for path in out.rglob("*") if path.is_file()}
    said = {
        "file": "it is a file",
        "folder": "it is a folder",
        "other disk": "on another file system",
    }
    with pytest.raises(InputError, match=said.get(way, "leads out of")):
        check_target(out, "walk")
    with pytest.raises(InputError, match=said.get(way, "leads out of")):
        write(out, a="2", b="2")
    assert {path: path.read_text() for path in out.rglob("*") if path.is_file()} == before
    assert (victim / "b" / "figure.txt").read_text() == "mine"


@pytest.mark.parametrize("content", ["a: [", "notes: mine", "kind: null", "- 3"])
def test_a_foreign_or_damaged_sidecar_makes_no_folder_ours(tmp_path, content):
    (tmp_path / "thesis.txt").write_text("mine")
    (tmp_path / "result.yaml").write_text(content)
    with pytest.raises(InputError, match="other things than an earlier walk"):
        check_target(tmp_path, "walk")


def test_a_result_whose_sidecar_or_record_is_lost_is_still_ours(tmp_path):
    save_walk(make_walk(), tmp_path / "out")
    (tmp_path / "out" / "result.yaml").write_text("a: [")
    check_target(tmp_path / "out", "walk")
    save_walk(make_walk(), tmp_path / "out")
    (tmp_path / "out" / RECORD_FILE).unlink()
    check_target(tmp_path / "out", "walk")


def test_what_an_earlier_version_left_goes_by_name_and_what_is_recorded_only_unchanged(tmp_path):
    for folder in ("old", "new"):
        write(tmp_path / folder, a="1")
        (tmp_path / folder / "a" / "mine.txt").write_text("mine")
    (tmp_path / "old" / RECORD_FILE).unlink()
    for folder in ("old", "new"):
        with result_folder(tmp_path / folder, "walk", stale=("a/fig*",)) as temporary:
            (temporary / "b.txt").write_text("2")
        assert files(tmp_path / folder) == {"a/mine.txt", "b.txt"}
        (tmp_path / folder / "b.txt").write_text("edited")
        with result_folder(tmp_path / folder, "walk", stale=("b*",)) as temporary:
            (temporary / "c.txt").write_text("3")
        assert files(tmp_path / folder) == {"a/mine.txt", "b.txt", "c.txt"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_waits_until_the_new_files_have_taken_the_place_of_the_old(
    tmp_path, monkeypatch, number
):
    def interrupt(*_):
        raise KeyboardInterrupt

    def disturbed(source, target):
        signal.raise_signal(number)
        replace(source, target)

    replace, before = os.replace, signal.signal(number, interrupt)
    try:
        write(tmp_path, a="1", b="1")
        monkeypatch.setattr(os, "replace", disturbed)
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path, b="2", c="2")
        assert files(tmp_path) == {"b/figure.txt", "c/figure.txt"}
        assert signal.getsignal(number) is interrupt
    finally:
        signal.signal(number, before)
