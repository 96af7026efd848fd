"""Every reader of files that there is, with whole files for it, and what a damaged one may do to
it.

A call returns something sound, or raises an InputError that names the file; within 10 s, and 300 MB
of memory.
"""

from __future__ import annotations

import contextlib
import functools
import random
import re
import shutil
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from resource import RLIMIT_AS, getpagesize, getrlimit, setrlimit
from typing import Any

import numpy as np
import yaml
from made_c3d import KISTLER_9281E, MadePlate, rectangle, with_parameters, write_c3d
from made_contact import made_contact
from made_fit import made_fit
from made_laboratory import Laboratory
from made_results import make_walk
from made_scenario import one_of_everything
from made_trial import TrialFiles
from made_tuning import made_arrays, made_table, small_table
from mutations import mutated
from virtual_laboratory.trc import write_trc

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import plain, resource, sha256, write_json
from vsf_drake.cli.tune import read_warm_start
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.fit.table import fit_arrays, fit_json
from vsf_drake.model.bench_curves import load_bench_curves, load_bench_file
from vsf_drake.model.contact_file import load_contact, save_contact
from vsf_drake.model.foot_curves import load_foot_curves
from vsf_drake.model.ground import load_ground
from vsf_drake.model.model_file import load_model
from vsf_drake.model.scenario import load_scenario
from vsf_drake.motion.formats.read import list_labels, read_trial
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.formats.tables import write_forces_mot
from vsf_drake.motion.manifest import load_stated_subject
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.trial import load_subject, load_trial
from vsf_drake.report.fit_output import FIT
from vsf_drake.report.outputs import check_sweep_folder
from vsf_drake.report.tuning.chapters import TUNING
from vsf_drake.report.validation.output import VALIDATION
from vsf_drake.sessions.fitting import Checkpoint
from vsf_drake.simulation.archive import check_target
from vsf_drake.simulation.batch.cases import WorkerTask, digest
from vsf_drake.simulation.batch.run import _NAMED, Kind, Reply, WalkCache
from vsf_drake.simulation.results import load_walk, save_walk
from vsf_drake.validation.bench_section import StoodTable
from vsf_drake.validation.run import Finished, SectionStore
from vsf_drake.validation.study import Section

MOST_S, MOST_BYTES = 10.0, 300_000_000
FRAMES, SAMPLES = 20, 40
KEY = "ab" * 32
MADE_BY = "5" * 64
"""Of what is kept under a key."""


class TooLong(BaseException):
    """A call that is not back in time; no handler of exceptions takes it for one of its own."""


@dataclass(frozen=True)
class Reader:
    """Calls that read the same files, one of which is damaged."""

    name: str  # what is read, and the folder where its files lie
    files: tuple[str, ...]
    calls: tuple[Callable[[Path], Any], ...]  # each given the path of the damaged file
    check: Callable[[Any], None]  # of what a call returns
    signed: str = ""
    """the file beside an NPZ with its SHA-256, made good so that the reader looks further"""
    slow: int = 1  # how many times fewer mutations it gets in a long run


def sound(value: Any) -> None:
    """No NaN anywhere in what was read, nor a number that is one."""
    if isinstance(value, float | np.ndarray):
        assert np.asarray(value).dtype.kind not in "fc" or not np.isnan(value).any()
    elif isinstance(value, Mapping):
        sound(list(value.values()))
    elif isinstance(value, list | tuple):
        for item in value:
            sound(item)
    elif type(value).__module__.startswith("vsf_drake") and hasattr(value, "__dict__"):
        sound(
            [
                item
                for name, item in vars(value).items()
                if name not in ("cop_W", "recording", "tracked")
            ]
        )


def lost_shares(path: Path) -> list[Any]:
    """The curves of a foot, and what each loses."""
    curves = load_foot_curves(path)
    return [*curves, *(curve.lost_share for curve in curves)]


def anything(value: Any) -> None:
    """Saved results may hold NaN, and a table or a cache entry what it likes: who shows it has to
    see to that."""


def consistent(read: Any) -> None:
    """Shapes, finite numbers and gaps of a recording are as `Recording` says; lists of labels are
    let through."""
    if isinstance(read, list):
        return
    assert (read.marker_rate_hz is None) == (not read.markers) or read.marker_rate_hz > 0.0
    for place in read.markers.values():
        assert place.shape == (read.frames, 3)
        assert (np.isnan(place).all(axis=1) == np.isnan(place).any(axis=1)).all() and not np.isinf(
            place
        ).any()
    samples = len(read.force_time_s)
    for plate in read.plates:
        assert plate.force_n.shape == plate.cop_m.shape == (
            samples,
            3,
        ) and plate.free_moment_nm.shape == (samples,)
        assert np.isfinite(plate.force_n).all() and np.isfinite(plate.free_moment_nm).all()
        loaded = plate.force_n[:, 2] > 20.0
        assert np.isnan(plate.cop_m[~loaded]).all() and not np.isinf(plate.cop_m).any()
        assert (plate.cop_m[loaded, 2] == 0.0).all() or np.isnan(plate.cop_m[loaded]).all()
        assert plate.corners_m is None or np.isfinite(plate.corners_m).all()
    assert np.isfinite(read.marker_time_s).all() and np.isfinite(read.force_time_s).all()
    assert read.frames or read.plates
    np.testing.assert_allclose(read.rotation_W @ read.rotation_W.T, np.eye(3), atol=0)


def in_folder(read: Callable[[Path], Any]) -> Callable[[Path], Any]:
    """The same of the folder in which the damaged file lies."""
    return lambda path: read(path.parent)


RECORDING = (read_trial, lambda path: read_trial(path, up="y"))
MANIFESTS = ("trial.yaml", "subject.yaml", "walk_ik.mot", "walk_grf.mot")
READERS = (
    Reader("c3d", ("a.c3d", "b.c3d"), (*RECORDING, list_labels), consistent),
    Reader("trc", ("a.trc", "comma.trc"), (*RECORDING, list_labels), consistent),
    Reader("forces", ("a.mot", "a.sto", "b.sto", "a.csv", "a.forces"), RECORDING, consistent),
    Reader(
        "trial",
        MANIFESTS,
        (in_folder(lambda folder: load_trial(folder / "trial.yaml")),),
        sound,
        slow=2,
    ),
    Reader(
        "markers",
        ("trial.yaml", "subject.yaml", "static.trc", "walk.trc", "walk.mot"),
        (in_folder(lambda folder: load_trial(folder / "trial.yaml")),),
        sound,
        slow=60,
    ),
    Reader("subject", ("subject.yaml", "whole.yaml"), (load_subject, load_stated_subject), sound),
    Reader(
        "marker_map", ("plug_in_gait.yaml", "rajagopal.yaml", "ior.yaml"), (load_marker_map,), sound
    ),
    Reader("model", ("nominal.yaml",), (load_model,), sound, slow=2),
    Reader("contact", ("contact.yaml",), (load_contact,), sound),
    Reader("ground", ("ground.yaml",), (load_ground,), sound),
    Reader("scenario", ("scenario.yaml", "person.yaml", "bench.yaml"), (load_scenario,), sound),
    Reader("bench_file", ("bench.yaml",), (load_bench_file, load_measured_bench), sound),
    Reader("bench_curves", ("curves.csv",), (load_bench_curves, load_measured_bench), sound),
    Reader("foot_curves", ("curves.csv", "level.csv"), (lost_shares,), sound),
    Reader(
        "walk",
        ("result.yaml", "result.npz"),
        (in_folder(load_walk), in_folder(lambda out: check_target(out, "walk"))),
        anything,
        signed="result.yaml",
        slow=2,
    ),
    Reader(
        "fit",
        ("fit.json", "fit.npz", "checkpoint.json"),
        (
            in_folder(FIT.read),
            in_folder(FIT.check),
            in_folder(lambda out: Checkpoint(out / "checkpoint.json", resume=True)),
        ),
        anything,
        signed="fit.json",
    ),
    Reader(
        "tuning",
        ("tuning.json", "tuning.npz"),
        (in_folder(TUNING.read), in_folder(TUNING.check), read_warm_start),
        anything,
        signed="tuning.json",
    ),
    Reader(
        "validation",
        ("validation.json", "validation.npz"),
        (in_folder(VALIDATION.read), in_folder(VALIDATION.check)),
        anything,
        signed="validation.json",
    ),
    Reader(
        "section",
        ("standing.json", "standing.npz"),
        (in_folder(lambda at: SectionStore(at, KEY).read("standing", StoodTable)),),
        anything,
        signed="standing.json",
    ),
    Reader(
        "sweep",
        ("sweep.json",),
        (in_folder(lambda out: check_sweep_folder(out, [small_trial()])),),
        anything,
    ),
    Reader(
        "cache",
        (f"{MADE_BY[:_NAMED]}-{digest([KEY])[:_NAMED]}.npz",),
        (lambda path: WalkCache(path.parent).read([KEY], MADE_BY),),
        anything,
    ),
)


class Workbench:
    """An empty folder, filled with whole files for every reader, in which one at a time is damaged
    and read.

    `validation` is that of a real one, to be damaged instead of a small made one; a tuning is whole
    then, too.
    """

    def __init__(self, folder: Path, *, validation: Path | None = None) -> None:
        self.folder = folder
        _write_recordings(folder)
        _write_descriptions(folder)
        _write_results(folder, validation)
        self._whole = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def undamaged(self, reader: Reader) -> None:
        """Reads the whole files: what is to be damaged must be good."""
        for name in reader.files:
            read, refusals = 0, []
            for call in reader.calls:
                try:
                    reader.check(call(self.folder / reader.name / name))
                    read += 1
                except InputError as error:  # not every call is for every file
                    refusals.append(str(error))
            assert read, refusals

    def fault(self, reader: Reader, number: int) -> str | None:
        """What is wrong with how `reader` takes its mutation of that `number`, or None."""
        rng = random.Random(f"{reader.name} {number}")
        path = self.folder / reader.name / rng.choice(reader.files)
        signed = path.parent / reader.signed
        damaged = mutated(self._whole[path], path.suffix, rng)
        try:
            path.write_bytes(damaged)
            if path.suffix == ".npz" and reader.signed:
                signed.write_bytes(
                    re.sub(
                        rb"(arrays_sha256\W+)[0-9a-f]{64}",
                        rb"\g<1>" + sha256(path).encode(),
                        self._whole[signed],
                    )
                )
            for call in reader.calls:
                with limited():
                    reader.check(call(path))
        except InputError as error:
            said = str(error)
            if str(self.folder) not in said:
                return f"the message names no file: {said[:300]}"
        except (Exception, TooLong) as error:
            own = [
                at
                for at in traceback.extract_tb(error.__traceback__)
                if "site-packages" not in at.filename
            ][-1]
            return (
                f"{type(error).__name__} at {Path(own.filename).name}:{own.lineno}: "
                f"{str(error)[:200]!r}"
            )
        finally:
            path.write_bytes(self._whole[path])
            if reader.signed:
                signed.write_bytes(self._whole[signed])
        return None


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Ends what is inside after so much processor time, and (on Linux) refuses it 300 MB beyond
    what there is."""

    def late(*_: object) -> None:
        raise TooLong(f"not back after {MOST_S:g} s")

    had, own = getrlimit(RLIMIT_AS), Path("/proc/self/statm")
    if own.exists():
        now = int(own.read_text(encoding="ascii").split()[0]) * getpagesize()
        setrlimit(RLIMIT_AS, (now + MOST_BYTES, had[1]))
    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, MOST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        setrlimit(RLIMIT_AS, had)


@functools.cache
def small_trial() -> Any:
    """A trial to sweep."""
    return load_trial(resource("data/reference_subject/exact/low_1.yaml"))


def _write_recordings(folder: Path) -> None:
    """A recording in each format, and two trials."""
    for name in ("c3d", "trc", "forces", "trial", "markers"):
        (folder / name).mkdir()
    at = np.random.default_rng(1).uniform([0, -0.3, 0.05], [0.3, 0.3, 1.6], (6, 3))
    markers = {
        f"M{k}": p + np.outer(np.linspace(0, 1, FRAMES), [1, 0, 0]) for k, p in enumerate(at)
    }
    phase = np.linspace(0, 1, SAMPLES)
    force = np.column_stack([50 * np.sin(6 * phase), 20 * phase, 700 + 50 * phase])
    cop = np.column_stack([0.4 + 0.1 * phase, 0.1 * phase, 0 * phase])
    made = MadePlate(2, force, cop, 3 * phase, rectangle((0.45, 0.05)))
    kinds = (
        made,
        *(MadePlate(k, force, cop, 3 * phase, rectangle((1.0 + k, 0.0))) for k in (1, 3, 4)),
    )
    write_c3d(folder / "c3d" / "a.c3d", markers, plates=kinds, subframes=2)
    person = {
        f"{side}{label}{k}": np.add(place, [0.0, 0.0, height])
        for side in "RL"
        for label, height in (("HEE", 0.0), ("ASI", 0.9))
        for k, place in enumerate(list(markers.values())[:3])
    }
    more = tuple(MadePlate(k, force, cop, 3 * phase, rectangle((1.0 + k, 0.0))) for k in (6, 7))
    path = write_c3d(
        folder / "c3d" / "b.c3d",
        person,
        plates=(*more, MadePlate(2, 0.01 * force, cop, 0 * phase, rectangle((0.45, 0.05)))),
        subframes=2,
        screen=("+X", "-Z"),
        zero=(1, 5),
    )
    correction = np.transpose([KISTLER_9281E] * 3, (2, 1, 0))
    with_parameters(path, "FORCE_PLATFORM", FPCOPPOLY=correction)
    write_trc(folder / "trc" / "a.trc", markers, rate_hz=20.0)
    text = (folder / "trc" / "a.trc").read_text()
    (folder / "trc" / "comma.trc").write_text(text.replace("\t", ","))
    plate, at_s = Plate("r", force, cop, 3 * phase), np.arange(SAMPLES) / 100
    for suffix in (".mot", ".sto"):
        write_forces_mot(folder / f"forces/a{suffix}", time_s=at_s, plates={"r": plate, "l": plate})
    text = (folder / "forces" / "a.sto").read_text()
    (folder / "forces" / "b.sto").write_text(text.replace(".", ",").replace("\t", ";"))
    rows = np.column_stack([at_s, force[:, [0, 2, 1]], cop[:, [0, 2, 1]], phase])
    text = "\n".join(",".join(repr(float(x)) for x in row) for row in rows)
    (folder / "forces" / "a.csv").write_text(
        f"time,Fx1,Fy1,Fz1,COPx1,COPy1,COPz1,Mz1\ns,N,N,N,m,m,m,Nm\n{text}\n"
    )
    rows[:, 4:] *= 1e3
    text = "\n".join(
        "\t".join([str(i + 1), *(f"{x:.2f}" for x in row[1:])]) for i, row in enumerate(rows)
    )
    (folder / "forces" / "a.forces").write_text(
        "[Force Data]\nNumberOfForcePlates=1\nSampleRate=100.0\nNumberOfSamples=40\n"
        f"#Sample\tFX1\tFY1\tFZ1\tX1\tY1\tZ1\tMZ1\n{text}\n"
    )
    TrialFiles(folder / "trial", force_time=np.arange(0.0, 1.8001, 0.005)).write()
    laboratory = Laboratory(folder / "markers")
    laboratory.standing()
    laboratory.walk()
    (folder / "markers" / "subject.yaml").write_text(
        "sex: male\nprosthetic_side: right\nmass_kg: 78\nstature_m: 1.81\n"
    )
    (folder / "markers" / "trial.yaml").write_text(
        "subject: subject.yaml\nmarkers: walk.trc\nstanding: static.trc\nforces: walk.mot\n"
        "hip_centre: harrington\nmarker_cutoff_hz: 6\nprosthesis: {fulcrum_mm: 66}\n"
    )


def _write_descriptions(folder: Path) -> None:
    """Persons, models, contacts, places and benches."""
    for name in (
        "subject",
        "marker_map",
        "model",
        "contact",
        "ground",
        "scenario",
        "bench_file",
        "bench_curves",
        "foot_curves",
    ):
        (folder / name).mkdir()
    reference = resource("data/reference_subject")
    maps = resource("models/marker_maps").iterdir()
    for source in (reference / "subject.yaml", resource("models/nominal.yaml"), *maps):
        kind = {"subject.yaml": "subject", "nominal.yaml": "model"}.get(source.name, "marker_map")
        shutil.copy(source, folder / kind)
    (folder / "subject" / "whole.yaml").write_text(
        yaml.safe_dump(
            {
                "name": "somebody",
                "mass_kg": 80.0,
                "stature_m": 1.8,
                "sex": "female",
                "prosthetic_side": "left",
                "thigh_length_m": 0.43,
                "prosthesis_length_m": 0.48,
                "prosthesis_toe_out_rad": 0.1,
            }
        )
    )
    save_contact(made_contact(), folder / "contact" / "contact.yaml")
    (folder / "ground" / "ground.yaml").write_text(
        "patches:\n  - {name: floor}\n  - {name: ramp, from_x_m: 1.0, reference_x_m: 1.0, "
        "slope_deg: 5.0}\n  - {name: mat, from_x_m: 0.6, to_x_m: 1.0, height_m: 0.01, "
        "stiffness_n_per_m: 2.0e+4}\n"
    )
    one_of_everything(folder / "scenario")
    for name in ("person.yaml", "bench.yaml"):
        shutil.copy(resource("models/scenarios") / name, folder / "scenario")
    shutil.copy(reference / "bench.yaml", folder / "bench_file")
    shutil.copy(reference / "bench_curves.csv", folder / "bench_curves" / "curves.csv")
    rows = {"forefoot": range(31), "heel": range(16)}
    way = [
        f"{part},{mm},{share * k * mm},{angle},{branch}"
        for part, k, angle in (("forefoot", 30.0, 20), ("heel", 60.0, -15))
        for branch, share, along in (("loading", 1.0, 1), ("unloading", 0.9, -1))
        for mm in rows[part][::along]
    ]
    (folder / "foot_curves" / "curves.csv").write_text(
        "\n".join(["part,displacement_mm,load_n,angle_deg,branch", *way])
    )
    level = [f"forefoot;{mm};{0.03 * mm}".replace(".", ",") for mm in range(31)]
    (folder / "foot_curves" / "level.csv").write_text(
        "\n".join(["part;displacement_mm;load_kn", *level])
    )


def _write_results(folder: Path, validation: Path | None) -> None:
    """What commands leave."""
    save_walk(make_walk(step_s=0.02), folder / "walk")
    fit = made_fit()
    _save(folder / "fit", "fit", {**fit_json(fit), "files": []}, fit_arrays(fit))
    (folder / "fit" / "checkpoint.json").write_text(
        '{"key": "x", "searches": [{"start": [0.0], "cost": 1.0}]}'
    )
    tuning = small_table() if validation is None else made_table()
    _save(folder / "tuning", "tuning", plain(tuning), made_arrays())
    if validation is not None:
        shutil.copytree(
            validation, folder / "validation", ignore=shutil.ignore_patterns("walks", "replay.html")
        )
    else:
        _save(
            folder / "validation",
            "validation",
            {
                "kind": "validation",
                "format": 1,
                "title": "Validation",
                "first_line": "SYNTHETIC",
                "synthetic": True,
                "notes": [],
                "failed": [["a", "b"]],
                "summary": [],
                "trials": [],
                "contact": "none",
                "options": {"quick": True, "seed": 0, "step_s": 2e-3},
                "provenance": {"versions": {}, "inputs_sha256": {}},
                "sections": {},
            },
            {"walking__x": np.ones(3)},
        )
    stood = StoodTable(
        rows=(), worst_mass_error=None, paper_mass_error=0.026, duration_s=10.0, all_stand=None
    )
    SectionStore(folder / "section", KEY).write(
        "standing", Finished(section=Section(table=stood, arrays={"x": np.ones(3)}), wall_s=1.0)
    )
    (folder / "sweep").mkdir()
    own = small_trial()
    write_json(
        folder / "sweep" / "sweep.json",
        {
            "kind": "sweep",
            "trials": [{"name": own.name, "file": str(own.path), "inputs": own.inputs}],
        },
    )
    task = WorkerTask(
        key=KEY,
        made_by=MADE_BY,
        person_key="person",
        person=None,
        motion_key="motion",
        motion=None,
        steps=4,
        options={"step_s": 1e-3},
        keep=("grf_W",),
        scorer=None,
        software={"numpy": "2"},
    )
    reply = Reply(
        Kind.DONE,
        arrays={"grf_W": np.ones((4, 3))},
        columns={"q": ("a", "b")},
        unconverged_steps=0,
        refined_steps=0,
        wall_s=0.1,
        notes=("a note",),
    )
    WalkCache(folder / "cache").write([(task, reply)])


def _save(
    folder: Path, name: str, table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
) -> None:
    """A table and its arrays as commands write them, without the page."""
    folder.mkdir()
    np.savez_compressed(folder / f"{name}.npz", **arrays)
    write_json(folder / f"{name}.json", {**table, "arrays_sha256": sha256(folder / f"{name}.npz")})
