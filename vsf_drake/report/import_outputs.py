"""What an import or a check of recordings leaves on disk: trials, a table, and a page with
figures."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import plain, write_text
from vsf_drake.base.schema import dump_yaml, to_plain
from vsf_drake.base.yaml_file import dump
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.model.model_file import model_yaml
from vsf_drake.model.parameters import GRAVITY, PELVIS_TRANSLATIONS
from vsf_drake.model.setting import moves
from vsf_drake.motion.events import USUAL_STANCE_S
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.formats.recording import SIDES
from vsf_drake.motion.formats.tables import opensim_files
from vsf_drake.motion.markers.joints import COORDINATES, orientations_of
from vsf_drake.motion.markers.segments import PARENTS, Calibration
from vsf_drake.motion.trial import Trial, load_trial, write_trial_files
from vsf_drake.optimal_control.normal import ANGLES, FORCES, NormalGait, normal_gait
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.recording import EXPECTED, LEVEL_BW, MARKS, motion_checks, worst
from vsf_drake.recording.examine import Examined, person_table, trial_table
from vsf_drake.recording.foot import flat_phases
from vsf_drake.recording.force_checks import REST_N, ZERO
from vsf_drake.recording.import_walks import ImportedWalks
from vsf_drake.report.page import FIGURES, render
from vsf_drake.report.recorded_replay import REPLAY, flaws, write_recordings
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import (
    ASIDE_S,
    MARK_COLOURS,
    NEUTRAL,
    PANEL,
    SHADE,
    drawing,
    label,
    legend_below,
    png,
)
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import PACKAGE, digest, software

IMPORT = ResultsFolder(kind="import", command="import", table="import.json", names=(REPLAY,))
CHECK = ResultsFolder(kind="check", command="check", table="check.json", names=(REPLAY,))
_SUBJECT = "subject.yaml"
_MODEL = "model.yaml"
DRAWN_BY = ("report", "recording", "motion", "optimal_control/normal.py")
"""Sources of the figures, beside those of `simulation.batch.cases.software`."""


def write_import(imported: ImportedWalks, out: Path) -> None:
    """Writes what an import leaves to `out`; every manifest is read back before anything appears
    there. Figures that an earlier import to `out` drew of the same are taken as they are."""
    first = imported.items[0]
    failures = {Path(path).name: why for path, why in imported.failures.items()}
    of_walks = [
        {
            "manifest": f"{name}.yaml",
            **dict(zip(("kinematics", "forces"), opensim_files(name), strict=True)),
        }
        for name in imported.names
    ]

    shown = [_shown(item) for item in imported.items]
    figures = _drawn(imported, shown, out)

    def write_files(folder: Path) -> None:
        (folder / FIGURES).mkdir()
        for name, image in figures.items():
            (folder / name).write_bytes(image)
        write_text(folder / _SUBJECT, dump_yaml(first.trial.subject))
        if imported.model is not None:
            write_text(folder / _MODEL, model_yaml(imported.model))
        for item, name, files in zip(imported.items, imported.names, of_walks, strict=True):
            write_trial_files(item.trial, folder, name)
            write_text(folder / files["manifest"], _manifest(item, files, imported))
            load_trial(folder / files["manifest"])
        write_recordings(imported.items, folder / REPLAY)
        write_text(
            folder / "import.html",
            import_page(
                imported.items,
                title=f"Import of {first.trial.subject.name}",
                person=first,
                failures=failures,
                replay=REPLAY,
                drawn=[[figures[file] for file in _figure_files(name)] for name in imported.names],
            ),
        )

    IMPORT.write(
        out,
        {
            "kind": "import",
            "mark": "unusable"
            if imported.failures
            else worst(item.mark for item in imported.items),
            "trials": [
                trial_table(item) | files | {"shown_sha256": key}
                for item, files, key in zip(imported.items, of_walks, shown, strict=True)
            ],
            "failures": imported.failures,
            **person_table(first),
            **provenance(imported.inputs),
            "files": sorted(
                [
                    _SUBJECT,
                    *([] if imported.model is None else [_MODEL]),
                    "import.json",
                    "import.html",
                    REPLAY,
                    *figures,
                    *(name for files in of_walks for name in files.values()),
                ]
            ),
        },
        more=lambda folder, table: write_files(folder),
    )


def _drawn(imported: ImportedWalks, shown: Sequence[str], out: Path) -> dict[str, bytes]:
    """The figures of all walks as PNG, by file."""
    before = {}
    with contextlib.suppress(InputError, LookupError, TypeError):
        before = {row["manifest"]: row["shown_sha256"] for row in IMPORT.read(out)[0]["trials"]}
    images = {}
    for item, name, key in zip(imported.items, imported.names, shown, strict=True):
        files = _figure_files(name)
        kept = before.get(f"{name}.yaml") == key and all((out / file).is_file() for file in files)
        for file, make in zip(files, _MAKERS.values(), strict=True):
            images[file] = (out / file).read_bytes() if kept else png(make(item))
    return images


def _figure_files(name: str) -> list[str]:
    return [f"{FIGURES}/{name}_{kind}.png" for kind in _MAKERS]


def _shown(item: Examined) -> str:
    """Digest of all that the figures show of a walk."""
    trial = item.trial
    facts = {
        "recording": fingerprint(trial),
        "inputs": trial.inputs,
        "subject": to_plain(trial.subject),
        "synthetic": trial.synthetic,
        "found": [item.checks, item.stances, trial.unmeasured],
        "tracked": trial.tracked and [trial.tracked.residual_rms_m, trial.tracked.gaps],
        "names": trial.tracked and trial.tracked.names,
        "standing": trial.calibration and trial.calibration.angles_rad,
        "software": software(),
        "drawn_by": [sources_sha256(PACKAGE, DRAWN_BY), version("matplotlib")],
    }
    arrays = {
        f"{side} {name}": getattr(foot, name)
        for side, foot in item.feet.items()
        for name in ("time_s", "heel_W", "toe_W")
    }
    if trial.tracked:
        arrays |= {"tracked": trial.tracked.values, "tracked_s": trial.tracked.time_s}
    return digest(plain(facts), arrays)


def write_check(items: Sequence[Examined], failures: Mapping[str, str], out: Path) -> None:
    """Writes check.json and check.html to `out`."""
    person = items[0] if len({item.trial.subject for item in items}) == 1 else None
    page = import_page(
        items, title="Check of recordings", person=person, failures=failures, replay=REPLAY
    )

    def more(folder: Path, table: dict[str, Any]) -> None:
        write_recordings(items, folder / REPLAY)
        write_text(folder / "check.html", page)

    CHECK.write(
        out,
        {
            "kind": "check",
            "mark": "unusable" if failures else worst(item.mark for item in items),
            "trials": [
                {**trial_table(item), **person_table(item), "manifest": str(item.trial.path)}
                for item in items
            ],
            "failures": failures,
            **provenance(),
        },
        more=more,
    )


def _manifest(item: Examined, files: Mapping[str, str], imported: ImportedWalks) -> str:
    """The manifest's text; what the belt carried is in the files already."""
    trial = item.trial
    shell_mm = imported.foot_length_mm
    plates = {side: f"ground_force_{side[0]}" for side in SIDES if side in trial.plates}
    unknown = {
        side: [[round(end, 6) for end in span] for span in spans]
        for side, spans in trial.unmeasured.items()
        if spans
    }
    rest_n: dict[str, float] = {}
    for check in item.checks:
        shown = check.value or 0.0
        if check.side and check.name.startswith(ZERO) and abs(shown) > REST_N:
            rest_n[check.side] = max(shown, rest_n.get(check.side, 0.0), key=abs)
    content = {
        "name": trial.name,
        "subject": _SUBJECT,
        "kinematics": files["kinematics"],
        "forces": {"file": files["forces"], **plates},
        **({} if imported.model is None else {"model": _MODEL}),
        "prosthesis": {
            **({"fulcrum_mm": round(1e3 * trial.fulcrum_m, 6)} if moves(trial.model.foot) else {}),
            **({} if shell_mm is None else {"foot_length_mm": shell_mm}),
        },
        "window": {"start_s": float(trial.start_s), "end_s": float(trial.end_s)},
        **({"unknown_force": unknown} if unknown else {}),
        **({"plate_rest_n": {side: round(n, 3) for side, n in rest_n.items()}} if rest_n else {}),
        **({"synthetic": True} if trial.synthetic else {}),
    }
    return f"# Made by vsf-drake import from {' '.join(trial.path.name.split())}.\n" + dump(content)


def import_page(
    items: Sequence[Examined],
    *,
    title: str,
    person: Examined | None = None,
    failures: Mapping[str, str] | None = None,
    replay: str = "",
    drawn: Sequence[Sequence[Figure | bytes]] | None = None,
) -> Markup:
    """The page: trials with their checks and figures (`drawn` already, or now), the `person` of one
    of them, by file what failed and why, and the file beside it in which the trials are to be
    played."""
    synthetic = [item.trial.name for item in items if item.trial.synthetic]
    figures = drawn or [
        [make(item) for kind, make in _MAKERS.items() if kind != "forces" or item.trial.plates]
        for item in items
    ]
    return render(
        "import.html.j2",
        title=f"{title} (SYNTHETIC)" if synthetic else title,
        synthetic=synthetic,
        trials=items,
        figures=figures,
        worst=max(range(len(items)), key=lambda i: items[i].expected_error_bw),
        failures=failures or {},
        passive=all(item.trial.setting.fulcrum_mm is None for item in items),
        replay=replay,
        map_figures=marker_figures(person.trial) if person else [],
        to_do=dict.fromkeys(
            check.sentence
            for item in items
            for check in item.checks
            if check.name in motion_checks.TO_DO and check.mark != "good"
        ),
        marks=MARKS,
        level=LEVEL_BW,
        colours=MARK_COLOURS,
        expected=EXPECTED,
        degrees=math.degrees(1.0),
        person=person and person.trial,
        subject_numbers=to_plain(person.trial.subject) if person else {},
        translations=PELVIS_TRANSLATIONS,
    )


# Figures: markers, angles, forces, floor.


COLOURS = {"right": "#31688e", "left": "#c8553d"}
# a force curve is thinned to about this many points; peaks of walking are far wider
MOST_POINTS = 1500
_ANGLES = (
    ("pelvis_tilt", "Pelvic tilt (front up +)"),
    ("pelvis_list", "Pelvic list"),
    ("pelvis_rotation", "Pelvic rotation"),
    ("ankle_angle", "Ankle (dorsiflexion +)"),
    ("hip_flexion", "Hip flexion"),
    ("hip_adduction", "Hip adduction"),
    ("hip_rotation", "Hip internal rotation"),
    ("knee_angle", "Knee flexion"),
)
_SWING_SHARE = 1.6
_ABLE_BODIED: dict[str, Any] = {"color": NEUTRAL, "linewidth": 0.9, "linestyle": "--"}
_TIME = "time (s)"
_LINE_M = 0.045  # a line of text beside the drawn person
OFF_BW = 0.03  # vertical force of able-bodied walking (body weights) below which a foot has left


def marker_figures(trial: Trial) -> list[Figure]:
    """The standing person from the front and from the right: which label was taken for what; none
    where nobody stood."""
    calibration = trial.calibration
    if calibration is None or not calibration.standing_W:
        return []
    # who faces us has the left where our right is
    return [
        _marker_figure(calibration, axis, title, x)
        for axis, title, x in (
            (1, "From the front", "left (m)"),
            (0, "From the right", "forward (m)"),
        )
    ]


def _marker_figure(calibration: Calibration, axis: int, title: str, x_label: str) -> Figure:
    role_of = {label: role for role, label in calibration.roles.items()}
    used = {label for own in calibration.segments.values() for label in own.labels}
    centres = _standing_centres(calibration)
    middle = float(np.median([p_W[axis] for p_W in calibration.standing_W.values()]))
    with drawing(1.2 * PANEL[0], 7.0) as figure:
        axes = figure.subplots()
        for name, parent in PARENTS.items():
            if parent is not None:
                ends = np.array([centres[parent], centres[name]])
                axes.plot(ends[:, axis], ends[:, 2], color="0.8", linewidth=4, zorder=0)
        for end, aligned in ((-0.4, "right"), (0.4, "left")):
            own = [
                (p_W[2], p_W[axis], name)
                for name, p_W in calibration.standing_W.items()
                if (p_W[axis] < middle) == (end < 0.0)
            ]
            height = 0.0
            for z, x, name in sorted(own):
                height = max(z, height + _LINE_M)
                colour = MARK_COLOURS["good"] if name in used else NEUTRAL
                role = role_of.get(name, "").replace("_", " ")
                axes.plot([x, middle + end], [z, height], color=colour, linewidth=0.4, alpha=0.5)
                axes.plot(x, z, "o", color=colour, markersize=4)
                axes.text(
                    middle + end,
                    height,
                    f"{name}: {role}" if role else name,
                    color=colour,
                    fontsize=7.5,
                    ha=aligned,
                    va="center",
                )
        axes.set_xlim(middle - 1.6, middle + 1.6)
        label(axes, x=x_label, y="up (m)", title=title)
    return figure


def _standing_centres(calibration: Calibration) -> dict[str, np.ndarray]:
    """(3,) m in W of the joint from which each segment hangs, as the person stood."""
    values = np.array([calibration.angles_rad[name] for name in COORDINATES])
    R_W, p_WPelvis = orientations_of(values[None])
    found: dict[str, np.ndarray] = {}
    for name, parent in PARENTS.items():
        found[name] = (
            p_WPelvis[0]
            if parent is None
            else found[parent] + R_W[parent][0] @ calibration.segments[name].p_PB
        )
    return found


def normal_of(trial: Trial) -> tuple[NormalGait, float] | None:
    """Able-bodied walking at this walk's speed, and the phase of its lift-off; None at a speed of
    which nothing was published."""
    motion = trial.trajectory.sample(np.array([trial.start_s, trial.end_s]))[0]
    columns = [trial.trajectory.names.index(name) for name in ("pelvis_tx", "pelvis_tz")]
    far = float(np.linalg.norm(np.diff(motion[:, columns], axis=0)))
    leg = scale_body(trial.subject, trial.model.foot, trial.model.socket).leg_length
    try:
        gait = normal_gait(far / (trial.end_s - trial.start_s), leg)
    except InputError:
        return None
    phase = np.linspace(0.0, 1.0, 1001)
    carries = gait.at(FORCES[1], phase) > OFF_BW
    return gait, float(phase[np.flatnonzero(~carries & (phase > 0.4))[0]])


def angle_figure(item: Examined) -> Figure:
    """Joint angles of both sides over each stance and the swing after it; dotted: at standing;
    shaded: able-bodied walking at this speed."""
    normal = normal_of(item.trial)
    share = np.linspace(0.0, _SWING_SHARE, 161)
    motion = item.trial.tracked or item.trial.trajectory  # markers know both ankles
    standing = item.trial.calibration.angles_rad if item.trial.calibration else {}
    with drawing(PANEL[0], 7.8) as figure:
        for axes, (stem, title) in zip(figure.subplots(4, 2).ravel(), _ANGLES, strict=True):
            if normal and stem in ANGLES:
                gait, lift_off = normal
                quantity, sign = ANGLES[stem]
                mean = sign * gait.at(quantity, share * lift_off)
                wide = gait.sd[quantity]
                axes.fill_between(
                    100 * share, mean - wide, mean + wide, color=SHADE, linewidth=0, zorder=0
                )
            for side in SIDES:
                name = stem if stem.startswith("pelvis") else f"{stem}_{side[0]}"
                if name not in motion.names:
                    continue
                series = np.degrees(motion.values[:, motion.names.index(name)])
                for start, duration in _laid_out(item, side):
                    shares = (motion.time_s - start) / duration
                    rows = (shares >= 0.0) & (shares <= _SWING_SHARE)
                    axes.plot(100 * shares[rows], series[rows], color=COLOURS[side], linewidth=1.5)
                if name in standing:
                    axes.axhline(
                        np.degrees(standing[name]),
                        color=COLOURS[side],
                        linewidth=1.0,
                        linestyle=":",
                    )
            axes.axvline(100.0, color=NEUTRAL, linewidth=0.8, linestyle=":")
            label(axes, x="share of stance (%)", y="angle (°)", title=title)
        return _with_legend(
            figure,
            item,
            "dotted: at standing" if standing else "",
            "grey: able-bodied, ± 1 SD" if normal else "no able-bodied band at this speed",
        )


def _laid_out(item: Examined, side: str) -> list[tuple[float, float]]:
    whole = [s.duration_s for stances in item.stances.values() for s in stances if s.complete]
    usual = float(np.mean(whole)) if whole else USUAL_STANCE_S
    return [
        (s.start_s, s.duration_s)
        if s.complete
        else (s.start_s if s.start_seen else s.end_s - usual, usual)
        for s in item.stances[side]
        if s.start_seen or s.end_seen
    ]


def force_figure(item: Examined) -> Figure:
    """Vertical, fore-aft and medio-lateral force of each foot in body weights, while a foot is
    loaded; grey: the trial's window; hatched: what is wrong there; broken: able-bodied walking at
    this speed, over whole stances."""
    trial = item.trial
    wrong = [*flaws(item)]
    normal = normal_of(trial)
    share = np.linspace(0.0, 1.0, 101)
    with drawing(PANEL[0], 5.6) as figure:
        titles = ("Vertical", "Fore-aft (forward +)", "Medio-lateral (left +)")
        for axes, column, title in zip(
            figure.subplots(3, sharex=True), (2, 0, 1), titles, strict=True
        ):
            for side, plate in trial.plates.items():
                thin = slice(None, None, max(1, len(plate.time_s) // MOST_POINTS))
                axes.plot(
                    plate.time_s[thin],
                    plate.force_W[thin, column] / (trial.subject.mass_kg * GRAVITY),
                    color=COLOURS[side],
                    linewidth=1.4,
                )
            for stance in (s for side in trial.plates for s in item.stances[side] if s.complete):
                if normal and column != 1:
                    axes.plot(
                        stance.start_s + share * stance.duration_s,
                        normal[0].at(FORCES[column // 2], share * normal[1]),
                        **_ABLE_BODIED,
                    )
            axes.axvspan(trial.start_s, trial.end_s, color=SHADE, zorder=0, linewidth=0)
            for flaw in wrong:
                axes.axvspan(
                    flaw.start_s,
                    flaw.end_s,
                    facecolor="none",
                    edgecolor=flaw.colour,
                    hatch="////",
                    alpha=0.4,
                    zorder=0,
                    linewidth=0,
                )
            label(axes, x=_TIME, y="force (body weights)", title=title)
        figure.axes[0].set_xlim(*_loaded_s(trial))
        handles: list[Artist] = [Patch(facecolor=SHADE, edgecolor=NEUTRAL, label="the part used")]
        if wrong:
            known = "doubtful: see the replay's time bar"
            handles.append(Patch(facecolor="none", edgecolor=NEUTRAL, hatch="////", label=known))
        if normal:
            handles.append(Line2D([], [], label="able-bodied, mean", **_ABLE_BODIED))
        return _with_legend(figure, item, handles=handles)


def _loaded_s(trial: Trial) -> tuple[float, float]:
    """From when to when a foot is loaded, or the trial's window if that is longer (s)."""
    ends = [trial.start_s, trial.end_s]
    for plate in trial.plates.values():
        loaded = plate.time_s[plate.force_W[:, 2] > REST_N]
        ends += [*loaded[:1], *loaded[-1:]]
    return min(ends) - ASIDE_S, max(ends) + ASIDE_S


def floor_figure(item: Examined) -> Figure:
    """The floor from above: centres of pressure, each foot from heel to toe as it stands flat,
    corners of plates."""
    with drawing(PANEL[0], 2.7) as figure:
        axes = figure.subplots()
        for plate in item.trial.recording.plates if item.trial.recording else ():
            if plate.corners_m is not None:
                ring = np.vstack([plate.corners_m, plate.corners_m[:1]])
                axes.plot(ring[:, 0], ring[:, 1], color="0.7", linewidth=1.0)
        for side, foot in item.feet.items():
            for point in (foot.heel_W, foot.toe_W):
                axes.plot(point[:, 0], point[:, 1], color=COLOURS[side], linewidth=0.5, alpha=0.4)
            for rows in flat_phases(foot, item.stances[side]).values():
                ends = np.array([foot.heel_W[rows].mean(axis=0), foot.toe_W[rows].mean(axis=0)])
                axes.plot(
                    *ends[:, :2].T,
                    color=COLOURS[side],
                    linewidth=7,
                    alpha=0.25,
                    solid_capstyle="round",
                )
            if side in item.trial.plates:
                cop = item.trial.plates[side].cop_W[
                    :: max(1, len(item.trial.plates[side].time_s) // MOST_POINTS)
                ]
                axes.plot(cop[:, 0], cop[:, 1], ".", color=COLOURS[side], markersize=2.5)
        axes.set_aspect("equal", adjustable="datalim")
        label(
            axes,
            x="forward (m)",
            y="left (m)",
            title="Floor: centre of pressure (dots), feet, plates (grey)",
        )
        return _with_legend(figure, item)


def _with_legend(
    figure: Figure, item: Examined, *more: str, handles: Sequence[Artist] = ()
) -> Figure:
    prosthetic = item.trial.subject.prosthetic_side
    entries: list[Artist] = [
        Line2D(
            [],
            [],
            color=COLOURS[side],
            label=f"{side} ({'prosthetic' if side == prosthetic else 'intact'})",
        )
        for side in SIDES
    ]
    entries += handles
    entries += [
        Line2D([], [], color="none", label=text)
        for text in (*more, "SYNTHETIC, not recorded" if item.trial.synthetic else "")
        if text
    ]
    legend_below(figure, entries)
    return figure


_MAKERS = {"angles": angle_figure, "forces": force_figure, "floor": floor_figure}
"""Figures of a walk, by the end of their files' names."""
