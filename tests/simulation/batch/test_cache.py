"""A cache returns what was asked for, nothing that was made otherwise and no damaged entry."""

from __future__ import annotations

import errno
import subprocess
import sys
import zipfile
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vsf_drake
from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import read_npz
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.batch import WalkCase, cases, run, simulate_batch
from vsf_drake.simulation.batch.cases import Planner
from vsf_drake.simulation.walk import Walker

PACKAGE = Path(vsf_drake.__file__).parent


def entries(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.npz"))


def test_a_second_sweep_reads_what_the_first_has_walked(tmp_path, walks, sweep, assert_same):
    first = simulate_batch(sweep(3), workers=1, cache=tmp_path)
    again = simulate_batch(sweep(3), workers=1, cache=tmp_path)
    assert len(walks) == 3 and len(entries(tmp_path)) == 1
    assert [o.from_cache for o in first + again] == [False] * 3 + [True] * 3
    assert_same(first, again)
    assert [o.wall_s for o in first] == [o.wall_s for o in again]
    assert [o.notes for o in first] == [o.notes for o in again]


def test_a_sweep_that_was_stopped_goes_on_from_there(
    tmp_path, walks, sweep, assert_same, blocks_of
):
    """The block that was finished last is kept before anybody is told of it."""

    def stop(state):
        if state.done == 3:
            raise KeyboardInterrupt

    blocks_of(2)
    with pytest.raises(KeyboardInterrupt):
        simulate_batch(sweep(5), workers=1, cache=tmp_path, progress=stop)
    assert len(walks) == 4
    outcomes = simulate_batch(sweep(5), workers=1, cache=tmp_path)
    assert len(walks) == 5
    assert [o.from_cache for o in outcomes] == [True] * 4 + [False]
    assert_same(outcomes, simulate_batch(sweep(5), workers=1))


def changed(trial):
    """Every way in which a member can differ in its numbers."""

    def with_trial(**fields):
        return WalkCase(trial=replace(trial, **fields))

    motion = trial.trajectory
    nudged = motion.values.copy()
    nudged[100, 3] = np.nextafter(nudged[100, 3], 1.0)
    foot = replace(
        trial.model.foot, series_stiffness_n_per_m=trial.model.foot.series_stiffness_n_per_m + 1.0
    )
    yield from (
        with_trial(subject=replace(trial.subject, mass_kg=trial.subject.mass_kg + 1e-9)),
        with_trial(model=replace(trial.model, foot=foot)),
        with_trial(trajectory=CoordinateTrajectory(motion.time_s, nudged, motion.names)),
        with_trial(
            trajectory=CoordinateTrajectory(motion.time_s + 1e-9, motion.values, motion.names)
        ),
        with_trial(start_s=trial.start_s + 1e-3),
        with_trial(end_s=trial.end_s + 1e-3),
        with_trial(fulcrum_m=trial.fulcrum_m + 1e-9),
        with_trial(offsets=replace(trial.offsets, height_m=1e-9)),
        WalkCase(trial=trial, values={"friction.mu_static": 0.51}),
        WalkCase(trial=trial, values={"friction.mu_static": 0.52}),
        WalkCase(trial=trial, values={"friction.mu_kinetic": 0.51}),
        WalkCase(trial=trial, step_s=2e-3),
        WalkCase(trial=trial, free=("knee_angle_r",)),
        WalkCase(trial=trial, fulcrum_m=lambda t: 0.1 + 0 * t),
        WalkCase(trial=trial, fulcrum_m=lambda t: 0.1 + 1e-9 * t),
    )


def test_whatever_changes_the_numbers_changes_the_key(monkeypatch, trial):
    plan = Planner(("grf_W",))
    found = [plan.task(case).key for case in (WalkCase(trial=trial), *changed(trial))]
    found.append(Planner(("grf_W", "time_s")).task(WalkCase(trial=trial)).key)
    real = cases.software()
    for name in real:
        monkeypatch.setattr(cases, "software", lambda name=name: real | {name: "another"})
        found.append(Planner(("grf_W",)).task(WalkCase(trial=trial)).key)
    assert len(set(found)) == len(found)


def test_what_does_not_change_the_numbers_does_not_change_the_key(trial):
    values = {"friction.mu_static": 0.5, "friction.mu_kinetic": 0.3}
    motion = trial.trajectory
    same = replace(
        trial,
        name="other",
        path=Path("other"),
        notes=("a",),
        plates={},
        inputs={},
        trajectory=CoordinateTrajectory(
            motion.time_s.copy(), np.asfortranarray(motion.values), motion.names
        ),
    )
    plan = Planner(("grf_W", "time_s"))
    expected = plan.task(WalkCase(trial=trial, values=values)).key
    for case in (
        WalkCase(
            trial=same, values=dict(reversed(values.items())), label="mine", offsets=trial.offsets
        ),
        WalkCase(trial=trial, values=values, fulcrum_m=trial.fulcrum_m),
        WalkCase(trial=trial, values={name: np.float64(value) for name, value in values.items()}),
    ):
        assert plan.task(case).key == expected
    assert Planner(("time_s", "grf_W")).task(WalkCase(trial=trial, values=values)).key == expected


def test_a_changed_law_or_wording_changes_the_digest_of_the_sources(tmp_path):
    for part in cases.SOURCES:
        for file in (
            [PACKAGE / part] if part.endswith(".py") else (PACKAGE / part).rglob("*.[pj][y2]")
        ):
            target = tmp_path / file.relative_to(PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(file.read_bytes())
    made = sources_sha256(PACKAGE, cases.SOURCES)
    assert sources_sha256(tmp_path, cases.SOURCES) == made == cases.software()["sources_sha256"]
    for name in ("laws/kelvin_voigt.py", "simulation/wording/walk.txt.j2"):
        file, content = tmp_path / name, (PACKAGE / name).read_bytes()
        file.write_bytes(content + b"\n")
        assert sources_sha256(tmp_path, cases.SOURCES) != made
        file.write_bytes(content)


IMPORTED = """
import sys
import vsf_drake.simulation.walk
for name, module in sorted(sys.modules.items()):
    if name.startswith("vsf_drake") and module.__file__:
        print(module.__file__)
"""


def test_every_source_that_a_walk_imports_is_in_the_digest_or_makes_no_numbers(tmp_path):
    """Reading recordings makes the trajectory, whose numbers are in the key themselves."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    files = done.stdout.split()
    covered = [PACKAGE / part for part in cases.SOURCES]
    beside = [
        PACKAGE / name
        for name in (
            "__init__.py",
            "base",
            "model/__init__.py",
            "model/bench_curves.py",
            "model/contact_file.py",
            "model/setting.py",  # words
            "motion",
        )
    ]
    assert len(files) > 30
    for file in map(Path, files):
        assert any(file == part or part in file.parents for part in covered + beside), file


def test_a_failed_simulation_is_kept_and_an_unusable_case_is_not(
    monkeypatch, tmp_path, trial, walks
):
    def diverge(walker, requests, **_):
        walks.extend(requests)
        return [
            InputError("there is no such variable")
            if request["values"]
            else SimulationError("keel_1 diverged", time_s=0.1)
            for request in requests
        ]

    monkeypatch.setattr(Walker, "walk_many", diverge)
    both = [WalkCase(trial=trial), WalkCase(trial=trial, values={"nonsense": 1.0})]
    for _ in range(2):
        failed, refused = simulate_batch(both, workers=1, cache=tmp_path)
        assert "keel_1 diverged" in failed.failure and not refused.ok
    assert failed.from_cache and not refused.from_cache
    assert len(entries(tmp_path)) == 1 and len(walks) == 3


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_damaged_file_is_noticed_and_its_walks_alone_are_computed_anew(
    tmp_path, walks, sweep, assert_same, blocks_of, share
):
    blocks_of(2)
    first = simulate_batch(sweep(6)[:4], workers=1, cache=tmp_path)
    path = entries(tmp_path)[0]
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    walks.clear()
    second = simulate_batch(sweep(6), workers=1, cache=tmp_path)
    assert len(walks) == 4
    damaged = [o for o in second if any("cache was damaged" in note for note in o.notes)]
    assert not any(o.from_cache for o in damaged)
    # of a file without content nobody can say what it held
    assert len(damaged) == (4 if share == 0.0 else 2)
    third = simulate_batch(sweep(6), workers=1, cache=tmp_path)
    assert len(walks) == 4 and not any("cache" in note for o in third for note in o.notes)
    assert_same(first, second[:4])
    assert_same(second, third)


def test_no_changed_byte_anywhere_changes_what_is_read(tmp_path, sweep):
    outcomes = simulate_batch(sweep(2), workers=1, cache=tmp_path)
    path, store = entries(tmp_path)[0], run.WalkCache(tmp_path)
    planner = Planner(run.DEFAULT_KEEP)
    tasks = [planner.task(case) for case in sweep(2)]
    content, noticed = path.read_bytes(), 0
    for place in np.linspace(0, len(content) - 1, 400).astype(int):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :])
        replies, notes = store.read([task.key for task in tasks], tasks[0].made_by)
        noticed += bool(notes)
        assert not notes or not replies
        if replies:  # the byte was one of the archive's own, a date for example
            for task, outcome in zip(tasks, outcomes, strict=True):
                reply = replies[task.key]
                assert all(
                    reply.arrays[name].tobytes() == array.tobytes()
                    for name, array in outcome.arrays.items()
                )
                assert reply.text == "" and reply.unconverged_steps == outcome.unconverged_steps
    assert noticed > 350


def test_a_sound_file_with_another_number_in_it_is_noticed(tmp_path, walks, sweep):
    simulate_batch(sweep(2), workers=1, cache=tmp_path)
    [path] = entries(tmp_path)
    arrays = read_npz(path)
    about = arrays.pop(run.ABOUT)
    arrays["grf_W"][7, 2] = np.nextafter(arrays["grf_W"][7, 2], np.inf)
    np.savez(path, **arrays)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(run.ABOUT, about)
    outcomes = simulate_batch(sweep(2), workers=1, cache=tmp_path)
    assert len(walks) == 4 and all("SHA-256 differs" in outcome.notes[-1] for outcome in outcomes)


def test_files_of_other_software_and_of_earlier_versions_are_left_alone(tmp_path, walks, sweep):
    (tmp_path / "00").mkdir()
    others = [tmp_path / "00" / f"{'0' * 64}.npz", tmp_path / f"{'0' * 24}-{'1' * 24}.npz"]
    for path in others:
        path.write_bytes(b"of an earlier version")
    [outcome] = simulate_batch(sweep(1), workers=1, cache=tmp_path)
    assert outcome.notes == simulate_batch(sweep(1), workers=1)[0].notes
    assert all(path.read_bytes() == b"of an earlier version" for path in others)


def test_a_full_disk_ends_with_a_message_and_leaves_sound_entries_only(
    monkeypatch, tmp_path, walks, sweep, blocks_of
):
    blocks_of(1)
    real = run.replaced

    @contextmanager
    def filling(path, mode, **options):
        with real(path, mode, **options) as stream:
            if len(entries(tmp_path)) == 2:
                stream.write(b"half of it")
                raise OSError(errno.ENOSPC, "No space left on device")
            yield stream

    with monkeypatch.context() as patch:
        patch.setattr(run, "replaced", filling)
        with pytest.raises(
            InputError, match=r"No space left on device.*Make room and run the same again"
        ):
            simulate_batch(sweep(5), workers=1, cache=tmp_path)
    assert len(entries(tmp_path)) == 2
    assert sorted(p for p in tmp_path.rglob("*") if p.is_file()) == entries(tmp_path)
    outcomes = simulate_batch(sweep(5), workers=1, cache=tmp_path)
    assert sum(o.from_cache for o in outcomes) == 2 and all(o.ok for o in outcomes)
