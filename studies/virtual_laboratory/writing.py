"""The files of data/reference_subject and data/sessions: OpenSim tables, manifests, figures and
pages."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from virtual_laboratory.figures import against_bands, null_error
from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.recording import Foot, Recorded
from virtual_laboratory.tiers import Tier
from vsf_drake.base.files import replaced
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.formats.recording import world_to_os
from vsf_drake.motion.formats.tables import write_storage

TEMPLATE, SESSIONS = (
    Path(__file__).with_name(name) for name in ("readme_template.md", "sessions_template.md")
)
NAME = "SYNTHETIC reference subject"
NOTICE = "SYNTHETIC, nobody walked this (made by studies/make_reference_subject.py)"
SUBJECT = f"""\
# {NOTICE}. The subject's published figures: McGeehan 2021
# (doi 10.1115/1.4050456). Lengths are scaled from the stature.
name: {NAME}
mass_kg: 78.0
stature_m: 1.81
sex: male
prosthetic_side: right
"""
PASSIVE = "package://vsf_drake/passive.yaml"
OTHER_FOOT = "a passive foot, not the one that was worn, whose bench nobody measured"
BEFORE_S = 0.02
"""From the end of the window to a strike."""
FORCE_DECIMALS, PLACE_DECIMALS, MOMENT_DECIMALS = 2, 5, 3


def write_subject(folder: Path, text: str = SUBJECT) -> Path:
    """`subject.yaml` in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with replaced(folder / "subject.yaml") as stream:
        stream.write(text)
    return folder / "subject.yaml"


@dataclass(frozen=True, kw_only=True)
class Label:
    """What the files of a trial say of themselves, and whose they are; `subject` by its path from
    them."""

    name: str
    notice: str
    subject: str
    mirrored: bool = False
    """The prosthesis is on the left, and what is written is the trial's mirror image."""
    foot_length_mm: float | None = None
    """of the shell; None where the files do not say it"""


REFERENCE = Label(name=NAME, notice=NOTICE, subject="../subject.yaml")


def write_trial(folder: Path, trial: Recorded, tier: Tier, label: Label = REFERENCE) -> None:
    """Manifest, kinematics and forces of one trial in the tier's folder."""
    place = folder / tier.name
    place.mkdir(parents=True, exist_ok=True)
    draw = trial.draw
    title = f"{label.name}, {tier.name}, {draw.name}: {label.notice}"
    names, coordinates, right, left = COORDINATES, tier.coordinates, tier.right, tier.left
    if label.mirrored:
        names, coordinates, right, left = *mirrored(coordinates), _mirrored(left), _mirrored(right)
    write_storage(
        place / f"{draw.name}_kinematics.mot",
        time_s=trial.time_s,
        names=names,
        values=coordinates,
        in_degrees=True,
        title=title,
    )
    columns = {**_columns(right, "r"), **_columns(left, "l")}
    write_storage(
        place / f"{draw.name}_forces.mot",
        time_s=trial.force_time_s,
        names=list(columns),
        values=np.column_stack(list(columns.values())),
        title=title,
    )
    shell = "" if label.foot_length_mm is None else f", foot_length_mm: {label.foot_length_mm:g}"
    if draw.fulcrum_m is None:
        worn = f"model: {PASSIVE}  # {OTHER_FOOT}\nprosthesis: {{{shell.removeprefix(', ')}}}\n"
    else:
        worn = f"prosthesis: {{fulcrum_mm: {1e3 * draw.fulcrum_m:g}{shell}}}\n"
    with replaced(place / f"{draw.name}.yaml") as stream:
        stream.write(
            f"# {label.notice}.\nname: {label.name}, {tier.name}, {draw.condition} stiffness, "
            f"trial {draw.number}\nsynthetic: true\nsubject: {label.subject}\nkinematics: "
            f"{draw.name}_kinematics.mot\nforces: {{file: {draw.name}_forces.mot, right: "
            f"ground_force_r, left: ground_force_l}}\n{worn}"
            f"window: {{start_s: 0, end_s: {_before_second_strike(trial):.2f}}}\n"
        )


def _before_second_strike(trial: Recorded) -> float:
    """End (s) of the part of a recording whose prosthetic stances are whole; what follows makes the
    stride complete."""
    stances = find_stances(trial.force_time_s, trial.right.force[:, 2])
    cut = [stance.start_s for stance in stances if not stance.end_seen]
    return float(np.floor(1e2 * (min(cut) - BEFORE_S))) / 1e2 if cut else float(trial.time_s[-1])


def mirrored(coordinates: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and values (N, 21) of the mirror image: left is right, and what tells left from right
    in the pelvis changes its sign. A leg's angles are anatomical and do not."""
    names = tuple(
        name[:-1] + {"r": "l", "l": "r"}[name[-1]] if name[-2] == "_" else name
        for name in COORDINATES
    )
    sign = np.where(
        np.isin(COORDINATES, ("pelvis_tz", "pelvis_list", "pelvis_rotation")), -1.0, 1.0
    )
    return names, coordinates * sign + 0.0


def _mirrored(foot: Foot) -> Foot:
    turned = np.array([1.0, -1.0, 1.0])
    return Foot(foot.force * turned, foot.cop * turned, -foot.free_moment)


def _columns(foot: Foot, side: str) -> dict[str, np.ndarray]:
    """OpenSim's columns of one foot; place and moment are zero where it is not loaded, as in
    OpenSim's own files."""
    force = world_to_os(foot.force).round(FORCE_DECIMALS) + 0.0
    cop = world_to_os(np.nan_to_num(foot.cop)).round(PLACE_DECIMALS) + 0.0
    moment = np.nan_to_num(foot.free_moment).round(MOMENT_DECIMALS) + 0.0
    columns = {f"ground_force_{side}_v{axis}": force[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"ground_force_{side}_p{axis}": cop[:, i] for i, axis in enumerate("xyz")}
    still = np.zeros(len(moment))
    return columns | {
        f"ground_torque_{side}_{axis}": moment if axis == "y" else still for axis in "xyz"
    }


def write_tables(
    folder: Path, tables: Mapping[str, Mapping[str, Mapping[str, float | None]]], notice: str
) -> None:
    """CSV files by name, one line a trial: what came out, and what was drawn."""
    for name, rows in tables.items():
        columns = list(dict.fromkeys(key for row in rows.values() for key in row))
        with replaced(folder / name) as stream:
            stream.write(f"# {notice}\n")
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(["trial", *columns])
            writer.writerows(
                [
                    trial,
                    *("" if row.get(key) is None else f"{float(row[key]):.5g}" for key in columns),
                ]
                for trial, row in rows.items()
            )


def write_readme(
    folder: Path, figures: dict[str, dict[str, float]], null: dict[str, dict[str, float]]
) -> None:
    """`README.md` out of the template and what was achieved."""
    shown = {
        "stance_s": ("stance s", 1, 3),
        "speed_m_per_s": ("speed m/s", 1, 3),
        "first_peak_bw": ("peak 1 %BW", 100, 1),
        "trough_bw": ("trough %BW", 100, 1),
        "second_peak_bw": ("peak 2 %BW", 100, 1),
        "braking_bw": ("braking %BW", 100, 1),
        "propulsion_bw": ("propulsion %BW", 100, 1),
        "medial_peak_bw": ("medial %BW", 100, 1),
        "cop_travel_mm": ("CoP travel mm", 1, 0),
        "swing_clearance_mm": ("clearance mm", 1, 1),
        "slip_flat_mm": ("slip mm", 1, 1),
        "knee_loading_deg": ("knee, loading °", 1, 1),
        "step_width_mm": ("step width mm", 1, 0),
        "intact_first_peak_bw": ("intact peak 1 %BW", 100, 1),
        "intact_second_peak_bw": ("intact peak 2 %BW", 100, 1),
        "residual_force_bw": ("unexplained %BW", 100, 4),
        "lumped_force_rms_bw": ("trunk lumped %BW", 100, 1),
        "lumped_vertical_rms_bw": ("of it vertical", 100, 1),
        "lumped_fore_aft_rms_bw": ("fore-aft", 100, 1),
        "trunk_shift_rms_mm": ("trunk's shift mm", 1, 1),
        "trunk_shift_mm": ("at most", 1, 1),
        "gain_m_per_s": ("gains m/s", 1, 3),
        "stride_ends_deg": ("ends °", 1, 1),
    }
    achieved = {
        trial: [f"{scale * row[key]:.{digits}f}" for key, (_, scale, digits) in shown.items()]
        for trial, row in figures.items()
    }
    stretched = {
        one: [f"{100 * error:.1f}" if other != one else "-" for other, error in row.items()]
        for one, row in null.items()
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    text = text.replace(
        "{figures}", _table("trial", [title for title, _, _ in shown.values()], achieved)
    )
    text = text.replace("{bands}", bands_table({"1.0 to 1.2": (figures.values(), None)}))
    with replaced(folder / "README.md") as stream:
        stream.write(text.replace("{null}", _table("curve of", list(null), stretched)))


def write_session_readme(folder: Path, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """`README.md` of data/sessions from what is known of each trial, by its path."""
    shown = {
        "speed_m_per_s": (1, 2),
        "stance_s": (1, 3),
        "first_peak_bw": (100, 0),
        "trough_bw": (100, 0),
        "second_peak_bw": (100, 0),
        "floor_bw": (100, 1),
        "own_floor_bw": (100, 1),
    }
    sessions: dict[str, list[str]] = {}
    for name, row in rows.items():
        sessions.setdefault(
            f"{name.rpartition('/')[0]}{' passive' * (row['condition'] == 'passive')}", []
        ).append(name)
    summary = {}
    for title, names in sessions.items():
        fitted = (
            names[:1]
            if title.endswith("passive")
            else [name for name in names if name.endswith(("/low_1", "/high_1"))]
        )
        curves = {name: np.array(rows[name]["curve"]) for name in names}
        nulls = [
            min(null_error(curves[one], curves[name]) for one in fitted)
            for name in names
            if name not in fitted
        ]
        cells = [
            f"{scale * np.mean([rows[name]['figures'][key] for name in names]):.{digits}f}"
            for key, (scale, digits) in shown.items()
        ]
        summary[title] = [str(len(names)), *cells, f"{100 * np.mean(nulls):.1f}" if nulls else "-"]
    head = [
        "trials",
        "speed m/s",
        "stance s",
        "peak 1 %BW",
        "trough %BW",
        "peak 2 %BW",
        "floor %BW",
        "own %BW",
        "null %BW",
    ]
    speeds: dict[str, tuple[list[Mapping[str, float]], float]] = {}
    for name, row in rows.items():
        aimed = name.split("/")[-2].replace("p", ".")
        speeds.setdefault(aimed, ([], float(aimed)))[0].append(row["figures"])
    text = SESSIONS.read_text(encoding="utf-8")
    with replaced(folder / "README.md") as stream:
        stream.write(
            text.replace("{summary}", _table("session", head, summary)).replace(
                "{bands}", bands_table(speeds)
            )
        )


def bands_table(walks: Mapping[str, tuple[Iterable[Mapping[str, float]], float | None]]) -> str:
    """What walks reach against the bands of walking, by speed: figures of each, and the speed of
    the bands (its own if None); the band shown is the first walk's."""
    lines = {}
    for speed, (figures, of_all) in walks.items():
        found = [against_bands(row, of_all or row["speed_m_per_s"]) for row in figures]
        for name, (_, low, high) in found[0].items():
            values = [row[name][0] for row in found]
            out = sum(not a <= value <= b for value, a, b in (row[name] for row in found))
            digits = 0 if name.endswith("mm") else 2 if "N m" not in name else 1
            ends = (
                f"from {low:.{digits}f}"
                if high == float("inf")
                else f"{low:.{digits}f} to {high:.{digits}f}"
            )
            lines[f"{speed} | {name}"] = [
                ends,
                f"{min(values):.{digits}f} to {max(values):.{digits}f}",
                f"{out} of {len(values)}",
            ]
    return _table("at m/s | of each walk", ["band", "found", "outside"], lines).replace(
        "| --- |", "| --- | --- |", 1
    )


def _table(corner: str, head: list[str], rows: dict[str, list[str]]) -> str:
    lines = [
        [corner, *head],
        ["---"] * (1 + len(head)),
        *([name, *cells] for name, cells in rows.items()),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
