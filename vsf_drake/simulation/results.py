"""What a run leaves: walk and bench as frozen data, saved in a folder and read back exactly;
standing in numbers.

Every array carries unit, shape, frame and meaning in its field, and the sidecar repeats them. W is
x forward, y left, z up, ground at z = 0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import read_npz, sha256, write_npz, write_text
from vsf_drake.base.schema import load_plain, to_plain
from vsf_drake.base.tables import Headline, LabelledArrays, Quantity, Tabular
from vsf_drake.base.yaml_file import dump
from vsf_drake.model.setting import AtSetting
from vsf_drake.simulation.archive import SIDECAR_FILE, result_folder

__all__ = [
    "BenchResult",
    "BenchSetting",
    "WalkResult",
    "coordinate_unit",
    "load_bench",
    "load_walk",
    "result_folder",
    "save_bench",
    "save_walk",
]

ARRAYS_FILE = "result.npz"  # no pickle; everything else is in a readable YAML sidecar
FORMAT = 1  # version of the layout on disk
_XYZ = ("x", "y", "z")
_Result = TypeVar("_Result", "WalkResult", "BenchSetting", "BenchResult")


def _array(shape: str, unit: str, meaning: str, **more: Any) -> Any:
    return dataclasses.field(metadata={"shape": shape, "unit": unit, "meaning": meaning, **more})


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkResult(Tabular):
    """A finished walk: n instants (the ends of the steps), m coordinates, p prescribed ones, N
    spheres.

    `converged` is false if any step was accepted without convergence (`unconverged_steps` of them):
    look before trusting the numbers. Steps that were cut into smaller ones to converge
    (`refined_steps`) are as good as the others.
    """

    time_s: np.ndarray = _array("n", "s", "instants, clock of the recording")
    coordinate_names: tuple[str, ...]
    q: np.ndarray = _array("n, m", "by column", "coordinates", columns="coordinate_names")
    v: np.ndarray = _array("n, m", "by column, per s", "their rates", columns="coordinate_names")
    generalized_force: np.ndarray = _array(
        "n, m",
        "N m (rotations), N (translations)",
        "loads of the driver; 0 for free coordinates",
        columns="coordinate_names",
    )
    grf_W: np.ndarray = _array(
        "n, 3", "N", "force of the ground on the prosthetic foot", frame="W", columns=_XYZ
    )
    cop_W: np.ndarray = _array(
        "n, 3", "m", "its centre of pressure; NaN unloaded", frame="W", columns=_XYZ
    )
    free_moment_nm: np.ndarray = _array(
        "n", "N m", "vertical moment at the centre of pressure", frame="W"
    )
    intact_grf_W: np.ndarray = _array(
        "n, 3", "N", "force of the ground on the intact foot", frame="W", columns=_XYZ
    )
    intact_cop_W: np.ndarray = _array(
        "n, 3", "m", "its centre of pressure; NaN unloaded", frame="W", columns=_XYZ
    )
    sphere_normal_n: np.ndarray = _array(
        "n, N", "N", "normal force on each sphere of the prosthetic foot"
    )
    sphere_depth_m: np.ndarray = _array("n, N", "m", "penetration of each sphere")
    sphere_friction_W: np.ndarray = _array(
        "n, N, 2", "N", "friction on each sphere", frame="W", columns=("x", "y")
    )
    socket_wrench: np.ndarray = _array(
        "n, 6",
        "N, N, N, N m, N m, N m",
        "force of the bushing on the socket",
        columns=("tx", "ty", "tz", "flexion", "adduction", "rotation"),
        frame="residual shank",
    )
    fulcrum_m: np.ndarray = _array("n", "m", "fulcrum from the keel's posterior end")
    prescribed_q: np.ndarray = _array(
        "n, p", "by column", "commanded coordinates", columns="prescribed_names"
    )
    prescribed_names: tuple[str, ...]
    energy_j: np.ndarray = _array(
        "n, E", "J", "energy ledger from the start", columns="energy_names"
    )
    energy_names: tuple[str, ...]
    sphere_zones: tuple[str, ...] = ()
    unconverged_steps: int
    refined_steps: int = 0
    converged: bool
    simulated_s: float
    wall_s: float
    compile_s: float
    step_s: float
    subject_mass_kg: float
    foot_length_m: float
    side: str
    trial_name: str
    synthetic: bool
    parameters: dict[str, Any]
    provenance: dict[str, Any]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        sizes = {
            "n": len(self.time_s),
            "m": len(self.coordinate_names),
            "p": len(self.prescribed_names),
            "E": len(self.energy_names),
        }
        _check_shapes(self, {**sizes, "N": np.shape(self.sphere_normal_n)[-1]})

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one coordinate; KeyError if the model has no such."""
        if name not in self.coordinate_names:
            raise KeyError(
                f"there is no coordinate {name}; there are {', '.join(self.coordinate_names)}"
            )
        return self.q[:, self.coordinate_names.index(name)]

    def labelled(self) -> LabelledArrays:
        """Every array over time_s: q_hip_flexion_r, grf_W_z, cop_W_x, ... in a table."""
        arrays = {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if "shape" in field.metadata
        }
        names = {
            field.name: getattr(self, field.metadata["columns"])
            for field in dataclasses.fields(self)
            if isinstance(field.metadata.get("columns"), str)
        }
        return walk_arrays(
            arrays,
            names,
            {
                "trial": self.trial_name,
                "side": self.side,
                "synthetic": self.synthetic,
                "converged": self.converged,
                "subject_mass_kg": self.subject_mass_kg,
            },
            {"trial": (self.trial_name, "")},
        )

    def headline(self) -> Headline:
        """Fulcrum, duration, largest force."""
        return Headline(
            kind="Walk",
            name=self.trial_name,
            synthetic=self.synthetic,
            unconverged_steps=self.unconverged_steps,
            facts=(
                ("Fulcrum from the keel's posterior end", 1e3 * float(self.fulcrum_m.mean()), "mm"),
                ("Simulated", self.simulated_s, "s"),
                ("Largest vertical force", float(self.grf_W[:, 2].max()), "N"),
                ("Steps cut into smaller ones", self.refined_steps, ""),
            ),
        )


ARRAYS = {f.name: f.metadata for f in dataclasses.fields(WalkResult) if "shape" in f.metadata}
"""Arrays of a `WalkResult` by name, each with its shape, unit and meaning."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchSetting:
    """One pass of the testing machine; `fulcrum_m` (from the keel's posterior end) is None for the
    heel."""

    fulcrum_m: float | None
    time_s: np.ndarray = _array("n", "s", "instants")
    platen_m: np.ndarray = _array(
        "n", "m", "height of the platen above where it first touches the foot"
    )
    load_n: np.ndarray = _array("n", "N", "vertical load of the platen on the foot")
    unconverged_steps: int = 0
    refined_steps: int = 0

    def __post_init__(self) -> None:
        _check_shapes(self, {"n": len(self.time_s)})

    @property
    def converged(self) -> bool:
        """Whether every step converged."""
        return self.unconverged_steps == 0


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchResult(Tabular):
    """A finished bench: its passes, in order, and what they were made with."""

    settings: tuple[BenchSetting, ...]
    wall_s: float
    compile_s: float
    simulated_s: float
    speed_m_per_s: float
    max_load_n: float
    parameters: dict[str, Any]
    provenance: dict[str, Any]

    @property
    def converged(self) -> bool:
        """Whether every step of every pass converged."""
        return all(setting.converged for setting in self.settings)

    @property
    def heel(self) -> BenchSetting | None:
        """The pass at the heel, if there is one."""
        return next((s for s in self.settings if s.fulcrum_m is None), None)

    @property
    def forefoot(self) -> tuple[BenchSetting, ...]:
        """The passes at the forefoot, by fulcrum position."""
        return tuple(
            sorted(
                (s for s in self.settings if s.fulcrum_m is not None),
                key=lambda s: s.fulcrum_m or 0.0,
            )
        )

    def labelled(self) -> LabelledArrays:
        """The curves of all passes, one below the other; `fulcrum_m` is NaN at the heel."""
        place = Quantity(
            name="fulcrum_m",
            dims=("sample",),
            unit="m",
            meaning="fulcrum from the keel's posterior end; NaN: heel",
            values=np.concatenate(
                [
                    np.full(len(s.time_s), np.nan if s.fulcrum_m is None else s.fulcrum_m)
                    for s in self.settings
                ]
            ),
        )
        curves = [
            Quantity(
                name=field.name,
                dims=("sample",),
                unit=field.metadata["unit"],
                meaning=field.metadata["meaning"],
                values=np.concatenate([getattr(s, field.name) for s in self.settings]),
            )
            for field in dataclasses.fields(BenchSetting)
            if "shape" in field.metadata
        ]
        return LabelledArrays(
            labels={"sample": range(len(place.values))},
            quantities=[place, *curves],
            about={"converged": self.converged},
        )

    def headline(self) -> Headline:
        """What each pass came to."""
        return Headline(
            kind="Bench",
            name="",
            synthetic=False,
            unconverged_steps=sum(s.unconverged_steps for s in self.settings),
            facts=tuple(
                (
                    "Largest displacement, "
                    + ("heel" if s.fulcrum_m is None else f"{1e3 * s.fulcrum_m:g} mm"),
                    1e3 * float(s.platen_m.max()),
                    "mm",
                )
                for s in self.settings
            ),
        )


def coordinate_unit(name: str) -> str:
    """Unit of a coordinate: m for translations (`…_tx`, `…_ty`, `…_tz`, `fulcrum`), rad for the
    rest."""
    return "m" if name == "fulcrum" or name.endswith(("_tx", "_ty", "_tz")) else "rad"


_DIMENSIONS = {
    "n": "time_s",
    "m": "coordinate",
    "p": "prescribed",
    "E": "energy",
    "N": "sphere",
    "3": "axis",
    "2": "axis_xy",
    "6": "socket",
}
"""Names of the dimensions that the shapes of `WalkResult` have, elsewhere."""


def walk_arrays(
    arrays: Mapping[str, np.ndarray],
    columns: Mapping[str, Sequence[str]],
    about: Mapping[str, str | float | bool],
    setting: Mapping[str, tuple[str | float, str]],
) -> LabelledArrays:
    """Arrays of a walk as other tools take them: `arrays` of `WalkResult` by name, `time_s` among
    them; `columns` by array where the class names no fixed ones."""
    fields = {
        field.name: field.metadata
        for field in dataclasses.fields(WalkResult)
        if field.name in arrays
    }
    labels: dict[str, Quantity | Sequence[str | int]] = {}
    quantities = []
    for name, known in fields.items():
        dims = tuple(_DIMENSIONS[size] for size in known["shape"].split(", "))
        last = columns[name] if isinstance(known.get("columns"), str) else known.get("columns", ())
        units = tuple(_column_units(known["unit"], last))
        quantity = Quantity(
            name=name,
            values=arrays[name],
            dims=dims,
            meaning=known["meaning"],
            unit=units[0] if len(set(units)) == 1 else units,
            frame=known.get("frame", ""),
        )
        labels |= {
            dim: range(size) for dim, size in zip(dims[1:], np.shape(arrays[name])[1:], strict=True)
        }
        if last:
            labels[dims[-1]] = tuple(last)
        if name == "time_s":
            labels = {name: quantity, **labels}
        else:
            quantities.append(quantity)
    return LabelledArrays(labels=labels, quantities=quantities, about=about, setting=setting)


def _column_units(unit: str, names: Sequence[str]) -> list[str]:
    """The unit of each column of a field whose metadata has `unit`."""
    if unit.startswith("by column"):
        return [
            coordinate_unit(name) + unit.removeprefix("by column").replace(", per s", "/s")
            for name in names
        ]
    if unit.startswith("N m (rotations)"):
        return ["N" if coordinate_unit(name) == "m" else "N m" for name in names]
    return unit.split(", ")


def save_walk(result: WalkResult, folder: str | Path) -> None:
    """Writes `result` as a folder: all of it or nothing; raises what `result_folder` does."""
    arrays, plain, described = _parts(result)
    units = {
        name: coordinate_unit(name) for name in (*result.coordinate_names, *result.prescribed_names)
    }
    _save(folder, "walk", arrays, {**plain, "coordinate_units": units, "arrays": described})


def load_walk(folder: str | Path) -> WalkResult:
    """Reads what `save_walk` wrote, `converged` false included; InputError if it is missing,
    damaged, or not a walk."""
    arrays, sidecar = _read(folder, "walk")
    return _build(WalkResult, {**sidecar, **arrays}, folder)


def save_bench(result: BenchResult, folder: str | Path) -> None:
    """As `save_walk`."""
    arrays: dict[str, np.ndarray] = {}
    described: dict[str, Any] = {}
    passes: list[dict[str, Any]] = []
    for i, setting in enumerate(result.settings):
        prefix = f"setting_{i}_"
        columns, plain, meanings = _parts(setting, prefix)
        arrays = arrays | columns
        described = described | meanings
        passes.append(plain | {"converged": setting.converged, "arrays_prefix": prefix})
    _save(
        folder,
        "bench",
        arrays,
        {
            "converged": result.converged,
            **_parts(result)[1],
            "settings": passes,
            "arrays": described,
        },
    )


def load_bench(folder: str | Path) -> BenchResult:
    """Reads what `save_bench` wrote; InputError if it is missing, damaged, or not a bench."""
    arrays, sidecar = _read(folder, "bench")
    settings = []
    for i, scalars in enumerate(sidecar.get("settings") or ()):
        prefix = f"setting_{i}_"
        columns = {
            name.removeprefix(prefix): value
            for name, value in arrays.items()
            if name.startswith(prefix)
        }
        settings.append(_build(BenchSetting, {**scalars, **columns}, folder))
    return _build(BenchResult, {**sidecar, "settings": settings}, folder)


def _check_shapes(result: Any, sizes: dict[str, int]) -> None:
    for field in dataclasses.fields(result):
        if "shape" in field.metadata:
            wanted = tuple(
                int(s) if s.isdigit() else sizes[s] for s in field.metadata["shape"].split(", ")
            )
            shape = np.shape(getattr(result, field.name))
            if shape != wanted:
                raise ValueError(
                    f"{field.name} has shape {shape}, not {wanted} ({field.metadata['shape']})"
                )


def _parts(
    result: Any, prefix: str = ""
) -> tuple[dict[str, np.ndarray], dict[str, Any], dict[str, Any]]:
    """Arrays, everything else as plain values, and what the arrays are; `prefix` before the arrays'
    names."""
    arrays = {}
    plain = {}
    described = {}
    for field in dataclasses.fields(result):
        value = getattr(result, field.name)
        if "shape" in field.metadata:
            arrays[prefix + field.name] = np.asarray(value)
            described[prefix + field.name] = {
                **to_plain(dict(field.metadata)),
                "size": list(np.shape(value)),
            }
        elif field.name != "settings":
            plain[field.name] = to_plain(value)
    return arrays, plain, described


def _save(
    folder: str | Path, kind: str, arrays: dict[str, np.ndarray], sidecar: dict[str, Any]
) -> None:
    with result_folder(folder, kind) as temporary:
        write_npz(temporary / ARRAYS_FILE, arrays)
        content = {
            "kind": kind,
            "format": FORMAT,
            **sidecar,
            "arrays_sha256": sha256(temporary / ARRAYS_FILE),
        }
        write_text(temporary / SIDECAR_FILE, dump(content, width=120))


def _read(folder: str | Path, kind: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    sidecar = load_plain(Path(folder) / SIDECAR_FILE, right="A result folder holds one")
    if not isinstance(sidecar, dict):
        raise InputError("does not describe a result", file=Path(folder) / SIDECAR_FILE)
    path = Path(folder) / ARRAYS_FILE
    if sha256(path) != sidecar.pop("arrays_sha256", None):
        raise InputError(
            f"is not the file that {SIDECAR_FILE} describes (its SHA-256 differs)", file=path
        )
    saved = sidecar.get("kind")
    version = sidecar.get("format")
    if saved != kind:
        raise InputError(f"holds the result of a {saved}, not of a {kind}", file=folder)
    if version != FORMAT:
        raise InputError(
            f"has format {version}, and this version reads format {FORMAT}", file=folder
        )
    return read_npz(path), sidecar


def _build(cls: type[_Result], values: dict[str, Any], folder: str | Path) -> _Result:
    arguments: dict[str, Any] = {}
    for field in dataclasses.fields(cls):
        if field.name not in values:
            raise InputError("is missing from the result", file=folder, where=field.name)
        value = values[field.name]
        arguments[field.name] = tuple(value) if isinstance(value, list) else value
    try:
        return cls(**arguments)
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(f"is damaged ({error})", file=folder) from None


# Standing still: forces, the pelvis, what it took to stay up; and that in numbers.


NUDGE_M, NUDGE_RAD = 2e-4, 2e-4
"""How far from rest a person is let go: raised, and turned back, towards the prosthesis and outward
as far as these are free. At exact rest a model would stay even where it cannot balance; from here
(some 0.2 mm at the pelvis, a choice) it must come back by itself."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A person who stood for `time_s[-1]` s, let go at NUDGE_M and NUDGE_RAD from rest."""

    time_s: np.ndarray  # (n,) ends of the steps
    prosthetic_n: np.ndarray  # (n,) vertical force on the foot (N)
    intact_n: np.ndarray
    pelvis: np.ndarray
    """(n + 1, 6) place (m; forward, up, right) and attitude (rad; tilt, list, rotation), start
    included."""
    weight_n: float
    setting: AtSetting
    side: str
    name: str
    free: tuple[str, ...]  # the pelvis coordinates that nothing held
    held_nm: dict[str, float]  # what it took, at the end, to hold the others (N m by coordinate)
    stiffness_nm_per_rad: float | None
    """Least stiffness, less the weight's, that keeps a free attitude; None if none is free."""
    leg_lengths_m: tuple[float, float]  # prosthetic, intact, unloaded
    unconverged_steps: int
    notes: tuple[str, ...]  # on what was held and why
    refined_steps: int = 0  # that were cut into smaller ones

    @property
    def turn_rad(self) -> float:
        """Largest change of an angle of the pelvis."""
        return float(np.abs(self.pelvis[1:, 3:] - self.pelvis[0, 3:]).max())


# Standing in numbers: what the ground carries against the weight, and whether the pelvis stays
# where it is.


LARGEST_WEIGHT_ERROR = 0.01
"""Share of the weight by which the mean vertical force may miss it (McGeehan 2021 reports 2.6 % too
little)."""
# how far the pelvis may move (m) and still be said to stand still (a choice)
LARGEST_DRIFT_M = 1e-3
# rate of the series in the table (a choice): a figure shows the sway, not the samples
SERIES_RATE_HZ = 200.0
ATTITUDE = ("tilt", "list", "rotation")


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingSeries:
    """What standing looks like, at SERIES_RATE_HZ."""

    time_s: np.ndarray  # (k,)
    prosthetic_n: np.ndarray  # (k,) vertical force on the foot
    intact_n: np.ndarray  # (k,)
    drift_mm: np.ndarray  # (k,) of the pelvis from its start


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingTable(AtSetting):
    """What `vsf-drake stand` writes as standing.json. Newtons, millimetres, degrees."""

    subject: str
    prosthetic_side: str
    duration_s: float
    weight_n: float
    mean_vertical_n: float
    weight_error: float  # share of the weight by which the mean force misses it
    prosthetic_share: float
    intact_share: float
    drift_mm: float  # largest
    turn_deg: float
    pelvis_deg: dict[str, float]  # at the end, by ATTITUDE
    free: tuple[str, ...]
    held_nm: dict[str, float]
    stiffness_nm_per_rad: float | None
    leg_length_mm: dict[str, float]  # prosthetic, intact, unloaded
    unconverged_steps: int
    refined_steps: int
    converged: bool
    stands: bool  # within LARGEST_WEIGHT_ERROR and LARGEST_DRIFT_M, all steps converged
    notes: tuple[str, ...]
    series: StandingSeries


def standing_table(standing: Standing) -> StandingTable:
    """The numbers of somebody who stood."""
    every = max(
        1, round(1.0 / SERIES_RATE_HZ / float(np.diff(standing.time_s, prepend=0.0).mean()))
    )
    rows = slice(every - 1, None, every)
    vertical = standing.prosthetic_n + standing.intact_n
    pelvis = standing.pelvis
    error = float(vertical.mean() / standing.weight_n - 1.0)
    share = float(standing.prosthetic_n.mean() / vertical.mean())
    drift = np.linalg.norm(pelvis[1:, :3] - pelvis[0, :3], axis=1)
    converged = standing.unconverged_steps == 0
    return StandingTable(
        subject=standing.name,
        prosthetic_side=standing.side,
        **vars(standing.setting),
        duration_s=float(standing.time_s[-1]),
        weight_n=standing.weight_n,
        mean_vertical_n=float(vertical.mean()),
        weight_error=error,
        prosthetic_share=share,
        intact_share=1.0 - share,
        drift_mm=1e3 * float(drift.max()),
        turn_deg=float(np.degrees(standing.turn_rad)),
        pelvis_deg=dict(zip(ATTITUDE, np.degrees(pelvis[-1, 3:]).tolist(), strict=True)),
        free=standing.free,
        held_nm=standing.held_nm,
        stiffness_nm_per_rad=standing.stiffness_nm_per_rad,
        leg_length_mm={
            leg: 1e3 * m
            for leg, m in zip(("prosthetic", "intact"), standing.leg_lengths_m, strict=True)
        },
        unconverged_steps=standing.unconverged_steps,
        refined_steps=standing.refined_steps,
        converged=converged,
        stands=converged
        and abs(error) <= LARGEST_WEIGHT_ERROR
        and float(drift.max()) <= LARGEST_DRIFT_M,
        notes=standing.notes,
        series=StandingSeries(
            time_s=standing.time_s[rows],
            prosthetic_n=standing.prosthetic_n[rows],
            intact_n=standing.intact_n[rows],
            drift_mm=1e3 * drift[rows],
        ),
    )
