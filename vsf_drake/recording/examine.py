"""Every check of one trial, from markers or from joint angles, and what a report needs to show
them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsf_drake.base.schema import to_plain
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS
from vsf_drake.motion.events import (
    Stance,
    kinematic_stances,
    overlap_s,
    stances_on,
    walking_direction,
    within,
)
from vsf_drake.motion.formats.recording import SIDES, PlateRecording, os_to_world
from vsf_drake.motion.markers.joints import orientations_of
from vsf_drake.motion.markers.posture import NOTE
from vsf_drake.motion.markers.segments import TrackedMotion, rolls_with_shank, subset
from vsf_drake.motion.trajectory import CoordinateTrajectory, columns_at
from vsf_drake.motion.trial import RecordingMark, Trial, on_the_belt
from vsf_drake.recording import (
    DOUBTFUL_BW,
    GOOD_BW,
    LEVEL_BW,
    MARKS,
    Check,
    checked,
    expected_error,
    force_checks,
    leading,
    motion_checks,
    overall,
)
from vsf_drake.recording import foot as feet_of
from vsf_drake.recording.foot import FootMotion, flat_phases, model_motion

GRID_S = 1e-3
# velocities this near an end of a filtered recording are not its own (a choice: half a period of
# 6 Hz)
EDGE_S = 0.1
# a plate that sees less of a stance than its motion tells by more than this has seen a part of it
PARTIAL_S = 0.12

# a foot that bends otherwise than in the other walks of its setting by this much, and by this many
# times as much as in those of another (choices)
APART_MM = 12.0
CLEARLY = 2.0


@dataclass(frozen=True, eq=False)
class Examined:
    """A trial with all that was found about it."""

    trial: Trial
    checks: tuple[Check, ...]  # in the order of the report
    notes: tuple[str, ...]  # the trial's, and the tracking's
    feet: dict[str, FootMotion]  # that were judged, as markers saw them where there are any
    stances: dict[str, list[Stance]]

    @property
    def mark(self) -> str:
        """Of its expected error, unless a fault makes it unusable."""
        return overall(self.checks)

    @property
    def expected_error_bw(self) -> float:
        """Of the predicted force, in body weights; see `recording.expected_error`."""
        return expected_error(self.checks)

    @property
    def verdict(self) -> str:
        """Mark and expected error in words, with what made it so: the limit that the error is
        beyond and its largest shares, the checks that are unusable, the doubts that alone make a
        recording doubtful."""
        error = self.expected_error_bw
        largest, others, others_bw = leading(self.checks)
        beyond = {"doubtful": GOOD_BW, "unusable": DOUBTFUL_BW}.get(self.mark)
        [verdict] = say(
            "recording",
            "verdict",
            mark=self.mark,
            error=error,
            largest=largest,
            others=others,
            others_bw=others_bw,
            limit=beyond if beyond is not None and error >= beyond else None,
            failed=self._named(check for check in self.checks if check.mark == "unusable"),
            doubted=self._named(
                check for check in self.checks if check.mark == "doubtful" and check.needed
            ),
        )
        return verdict

    @property
    def by_cost(self) -> tuple[list[Check], list[Check]]:
        """The checks that a reader must see, the most costly first: unusable, needed and doubted,
        or at least LEVEL_BW; and the others, the worst marks first."""
        weighty = [
            check
            for check in self.checks
            if check.mark == "unusable"
            or (check.needed and check.mark != "good")
            or (check.cost_bw or 0.0) >= LEVEL_BW
        ]
        others = [check for check in self.checks if check not in weighty]
        return (
            sorted(weighty, key=lambda check: -(check.cost_bw or 0.0)),
            sorted(others, key=lambda check: -MARKS.index(check.mark)),
        )

    @property
    def judged(self) -> RecordingMark:
        """What results made of the trial carry on."""
        return RecordingMark(
            mark=self.mark, expected_error_bw=self.expected_error_bw, verdict=self.verdict
        )

    @staticmethod
    def _named(checks: Iterable[Check]) -> list[str]:
        """The names of checks, once, each with the sides that it is about."""
        sides: dict[str, list[str]] = {}
        for check in checks:
            sides.setdefault(check.name, []).extend(filter(None, [check.side]))
        return [
            f"{name}, {' and '.join(dict.fromkeys(of))}" if of else name
            for name, of in sides.items()
        ]


def examine(trial: Trial, *, stated: Sequence[Check] = ()) -> Examined:
    """Looks at one trial from every side; `stated` are checks on what was stated and what had to be
    estimated. What a plate shows at rest is judged by itself, and taken off for all else."""
    recorded = trial
    trial = dataclasses.replace(trial, plates=_without_rest(trial))
    model_feet, body = model_motion(
        trial.subject, trial.model, trial.trajectory, offsets=trial.offsets
    )
    feet = model_feet
    if trial.tracked is not None:
        feet, body = _tracked(trial, trial.tracked)
    pelvis = pelvis_in_world(trial.trajectory.time_s, trial)
    measured = stances_on(trial.plates)
    moving = _moving(feet, pelvis, trial)
    travel = pelvis[-1] - pelvis[0]
    heading_rad = float(np.arctan2(travel[1], travel[0]))
    stances = {
        side: _within(trial, _joined(moving[side], measured.get(side, []))) for side in SIDES
    }
    durations = [s.duration_s for of_foot in stances.values() for s in of_foot if s.complete]
    side, usual = trial.subject.prosthetic_side, float(np.mean(durations)) if durations else None
    if feet_of.turns_in_stance(feet[side], stances[side], usual_s=usual):
        feet = {**feet, side: dataclasses.replace(feet[side], undeformed=True)}
    flats = {side: flat_phases(feet[side], stances[side], usual_s=usual) for side in SIDES}
    checks: list[Check | None] = list(stated)
    for side in sorted(SIDES, key=lambda side: side != trial.subject.prosthetic_side):
        foot = feet[side]
        plate = trial.plates.get(side)
        felt = _within(trial, measured.get(side, []))
        cop = (
            columns_at(foot.time_s, plate.time_s, plate.cop_W, np.nan)
            if plate is not None and plate.has_cop
            else None
        )
        checks += force_checks.foot_checks(foot, flats[side], cop, heading_rad=heading_rad)
        checks.append(_roll_from_shank(trial, foot, flats[side]))
        if foot.prosthetic:
            checks += [
                force_checks.sole_roll(
                    foot,
                    rows,
                    model_feet[side],
                    number,
                    seen=trial.tracked is not None,
                    inversion_rad=trial.subject.prosthesis_inversion_rad,
                )
                for number, rows in flats[side].items()
            ]
        checks += [
            force_checks.clearance(model_feet[side], stances[side]),
            force_checks.touch_down(model_feet[side], felt),
            force_checks.depth(
                model_feet[side], felt, mass_kg=trial.subject.mass_kg, fulcrum_m=trial.fulcrum_m
            ),
        ]
        if plate is not None and cop is not None:
            checks.append(force_checks.cop_under_foot(foot, plate, cop))
            if foot.prosthetic:
                modelled = model_feet[side]
                at_model = columns_at(modelled.time_s, plate.time_s, plate.cop_W, np.nan)
                checks += [
                    force_checks.strike(modelled, at_model, measured.get(side, [])),
                    force_checks.bending(
                        modelled,
                        trial.model,
                        plate,
                        at_model,
                        span=(trial.start_s, trial.end_s),
                        mass_kg=trial.subject.mass_kg,
                        fulcrum_m=trial.fulcrum_m,
                    ),
                ]
    slides = [
        float(feet_of.slip_velocity(foot, feet_of.floor_point(foot))[rows, 0].mean())
        for side, foot in feet.items()
        for rows in flats[side].values()
    ]
    checks += [
        *_plate_zeros(recorded, measured),
        *_forces(trial, body, measured, moving),
        motion_checks.belt(slides),
        *_angles(trial, pelvis, _strides_per_s(stances)),
        *_markers(trial),
    ]
    notes = (
        trial.notes
        if trial.tracked is None
        else tuple(dict.fromkeys((*trial.notes, *trial.tracked.notes)))
    )
    return Examined(
        recorded, tuple(check for check in checks if check is not None), notes, feet, stances
    )


def settings_compared(items: Sequence[Examined]) -> list[Examined]:
    """The walks, with a doubt of the setting of those whose foot bends as in other walks of the
    person with another one, and not as in those with its own: the clearest first, which then says
    nothing of the others."""
    bent = {
        number: check
        for number, item in enumerate(items)
        for check in item.checks
        if check.name == force_checks.BENDING
    }
    told = list(items)
    while bent:
        clearest = {number: _clearer_setting(number, items, bent) for number in bent}
        number = max(clearest, key=lambda one: clearest[one][1])
        nearest_m, nearer_mm = clearest[number]
        if nearer_mm <= 0.0:
            break
        doubted = bent.pop(number)
        named_m = items[number].trial.fulcrum_m
        check = checked(
            "setting",
            doubted.name,
            "doubtful",
            doubted.value,
            doubted.unit,
            side=doubted.side,
            cost_bw=force_checks.SETTING_BW_PER_M * abs(nearest_m - named_m),
            named=1e3 * named_m,
            nearest=1e3 * nearest_m,
        )
        told[number] = dataclasses.replace(
            items[number],
            checks=tuple(check if one is doubted else one for one in items[number].checks),
        )
    return told


def _clearer_setting(
    number: int, items: Sequence[Examined], bent: Mapping[int, Check]
) -> tuple[float, float]:
    """The setting (m) in whose walks the foot bends most as in walk `number`, and how much nearer
    (mm) that is than its own; not positive where it is not clear."""
    named_m = items[number].trial.fulcrum_m
    others: dict[float, list[float]] = {}
    for other, check in bent.items():
        if other != number and items[other].trial.subject == items[number].trial.subject:
            others.setdefault(items[other].trial.fulcrum_m, []).append(check.value or 0.0)
    own_mm = bent[number].value or 0.0
    apart = {
        fulcrum_m: abs(float(np.median(values)) - own_mm) for fulcrum_m, values in others.items()
    }
    # alone with its setting: doubted if it bends as another's walks, unless it hardly bends at all
    bends = own_mm < 1e3 * force_checks.BENT_FULCRUMS_M[-1] - APART_MM
    apart.setdefault(named_m, CLEARLY * APART_MM if bends else 0.0)
    nearest_m = min(apart, key=apart.__getitem__)
    clear = apart[named_m] >= max(APART_MM, CLEARLY * apart[nearest_m])
    return nearest_m, clear * (apart[named_m] - apart[nearest_m])


def weighed(trial: Trial) -> Check:
    """The mass that the plates felt in a trial from markers, whatever the trial says it is."""
    if trial.tracked is None:
        raise ValueError("only a trial from markers knows which foot was where")
    feet, body = _tracked(trial, trial.tracked)
    moving = _moving(feet, pelvis_in_world(trial.trajectory.time_s, trial), trial)
    felt = _forces(trial, body, stances_on(trial.plates), moving)[0]
    assert felt is not None
    return felt


def pelvis_in_world(time_s: np.ndarray, trial: Trial) -> np.ndarray:
    """(n, 3) m, the pelvis's origin at `time_s`."""
    return os_to_world(
        trial.trajectory.ordered(("pelvis_tx", "pelvis_ty", "pelvis_tz")).sample(time_s)[0]
    )


def _tracked(
    trial: Trial, tracked: TrackedMotion
) -> tuple[dict[str, FootMotion], CoordinateTrajectory]:
    """Seen from the belt: feet, and the body's centre of mass with the pelvis, where their own
    markers show them."""
    shift = np.outer(trial.belt_speed_m_per_s * tracked.time_s, [1.0, 0.0, 0.0])
    R_W, _ = orientations_of(tracked.values)
    feet = {
        side: FootMotion(
            track.heel_W + shift,
            track.toe_W + shift,
            track.ankle_W + shift,
            side=side,
            time_s=tracked.time_s,
            prosthetic=side == trial.subject.prosthetic_side,
            lowest_m=np.minimum(track.heel_W[:, 2], track.toe_W[:, 2]),
            left_W=R_W[f"foot_{side}"][:, :, 1],
        )
        for side, track in tracked.feet.items()
    }
    motion = tracked.trajectory(trial.trajectory.names, source=trial.trajectory.source)
    motion, _, _ = on_the_belt(motion, {}, speed_m_per_s=trial.belt_speed_m_per_s)
    return feet, model_motion(trial.subject, trial.model, motion)[1]


def _moving(
    feet: Mapping[str, FootMotion], pelvis: np.ndarray, trial: Trial
) -> dict[str, list[Stance]]:
    forward = walking_direction(feet, pelvis)
    return {
        side: kinematic_stances(
            foot.time_s,
            foot,
            columns_at(foot.time_s, trial.trajectory.time_s, pelvis),
            forward_W=forward,
        )
        for side, foot in feet.items()
    }


def _joined(moving: Sequence[Stance], measured: Sequence[Stance]) -> list[Stance]:
    """All stances; where a plate saw the whole of one, its instants."""

    joined = []
    for stance in moving:
        whole = [
            m
            for m in measured
            if overlap_s(m, stance) > 0.5 * m.duration_s
            and abs(m.start_s - stance.start_s) + abs(m.end_s - stance.end_s) < 2 * PARTIAL_S
            and m.complete
        ]
        joined.append(whole[0] if whole else stance)
    joined += [m for m in measured if not any(overlap_s(m, s) > 0.0 for s in joined)]
    return sorted(joined, key=lambda s: s.start_s)


def _within(trial: Trial, stances: Iterable[Stance]) -> list[Stance]:
    return [s for s in stances if overlap_s(s, trial) > 0.0]


def _forces(
    trial: Trial,
    motion: CoordinateTrajectory,
    measured: Mapping[str, list[Stance]],
    moving: Mapping[str, list[Stance]],
) -> list[Check | None]:
    mass_kg = trial.subject.mass_kg
    if not trial.plates:
        return [force_checks.untold_mass(mass_kg)]
    start = max([motion.start_s, *(float(plate.time_s[0]) for plate in trial.plates.values())])
    end = min([motion.end_s, *(float(plate.time_s[-1]) for plate in trial.plates.values())])
    time = np.arange(start, end, GRID_S)
    if len(time) < 3:
        raise ValueError(f"forces and motion of {trial.name} do not overlap")
    vertical = sum(
        (np.interp(time, plate.time_s, plate.force_W[:, 2]) for plate in trial.plates.values()),
        start=np.zeros(len(time)),
    )
    known = force_checks.covered(time, trial.plates, measured, moving)
    known &= (time >= motion.start_s + EDGE_S) & (time <= motion.end_s - EDGE_S)
    known &= ~within(time, (span for spans in trial.unmeasured.values() for span in spans))
    _, velocity, acceleration = motion.sample(time)
    shears = [
        force_checks.shear(
            plate, columns_at(plate.time_s, motion.time_s, motion.values, np.nan), side
        )
        for side, plate in trial.plates.items()
        if plate.has_cop
    ]
    return [
        force_checks.mass(
            time,
            vertical,
            velocity[:, 2],
            known,
            mass_kg=mass_kg,
            feet=len(trial.plates),
        ),
        *shears,
        force_checks.lag(time, vertical, acceleration[:, 2], known)
        or force_checks.event_lag(measured, moving, trial.subject.prosthetic_side),
    ]


def _without_rest(trial: Trial) -> dict[str, PlateRecording]:
    """The plates less what they show at rest; where they were assigned to feet, which leaves zero
    outside of loads, less what each of them shows under its own, or what the manifest says."""
    levelled = {}
    for side, plate in trial.plates.items():
        force_W = plate.force_W
        if side in trial.rest_n:
            force_W = force_W.copy()
            force_W[force_W.any(axis=1), 2] -= trial.rest_n[side]
        elif trial.recording is None:
            force_W = force_W - force_checks.at_rest(plate.time_s, force_W, plate.time_s)
        else:
            forces = {recorded.name: recorded.force_n for recorded in trial.recording.plates}
            force_W = force_W.copy()
            for load in (one for one in trial.contacts if one.side == side):
                rows = within(plate.time_s, [load.span])
                force_W[rows] -= force_checks.at_rest(
                    trial.recording.force_time_s, forces[load.plate], plate.time_s[rows]
                )
        levelled[side] = dataclasses.replace(plate, force_W=force_W)
    return levelled


def _plate_zeros(trial: Trial, measured: Mapping[str, Sequence[Stance]]) -> list[Check | None]:
    """Of every plate that carried a foot; of columns that are a foot's, by its name."""
    prosthetic = trial.subject.prosthetic_side

    def of(
        time_s: np.ndarray, force_n: np.ndarray, loads: Sequence[Stance], plate: str, side: str
    ) -> Check | None:
        return force_checks.plate_zero(
            time_s,
            force_n,
            loads,
            plate=plate,
            side=side,
            prosthetic=side == prosthetic,
            mass_kg=trial.subject.mass_kg,
            told_n=trial.rest_n.get(side, 0.0),
        )

    if trial.recording is None:
        return [
            of(
                plate.time_s,
                plate.force_W,
                measured.get(side, ()),
                f"the {side} foot's plate",
                side,
            )
            for side, plate in trial.plates.items()
        ]
    loads: dict[tuple[str, str], list[Stance]] = {}
    for contact in trial.contacts:
        if contact.side is not None:
            loads.setdefault((contact.plate, contact.side), []).append(contact)
    forces = {plate.name: plate.force_n for plate in trial.recording.plates}
    time_s = trial.recording.force_time_s
    return [
        of(time_s, forces[name], own, f"plate {name}", side) for (name, side), own in loads.items()
    ]


def _strides_per_s(stances: Mapping[str, Sequence[Stance]]) -> float | None:
    """From touch-downs of either foot after the other; None without two at different instants."""
    touched = sorted(
        (stance.start_s, side)
        for side, own in stances.items()
        for stance in own
        if stance.start_seen
    )
    steps = [after[0] - before[0] for before, after in pairwise(touched) if before[1] != after[1]]
    steps = [step for step in steps if step > 0.0]
    return 0.5 / float(np.median(steps)) if steps else None


def _angles(trial: Trial, pelvis: np.ndarray, strides_per_s: float | None) -> list[Check | None]:
    motion = trial.trajectory
    angles = dict(zip(motion.names, motion.values.T, strict=True))
    speed = np.linalg.norm(np.gradient(pelvis[:, :2], motion.time_s, axis=0), axis=1)
    standing = None if trial.calibration is None else trial.calibration.angles_rad
    intact = next(side for side in SIDES if side != trial.subject.prosthetic_side)
    return [
        motion_checks.zeroed(angles, standing, speed),
        motion_checks.zero_mean(angles),
        motion_checks.ankle_offset(angles, intact),
        _foot_length(trial),
        *(motion_checks.knee_axis(angles, side) for side in SIDES),
        motion_checks.smoothness(motion.time_s, angles),
        None
        if strides_per_s is None
        else motion_checks.smoothed(
            motion.time_s,
            angles,
            speed_m_per_s=float(np.median(speed)),
            strides_per_s=strides_per_s,
        ),
        *motion_checks.walking(motion.time_s, pelvis),
    ]


def _foot_length(trial: Trial) -> Check | None:
    """The length of the prosthetic foot, or where only that is known of the intact one, against the
    model's."""
    if trial.calibration is not None:
        recorded = trial.calibration.lengths_m[f"foot_{trial.subject.prosthetic_side}"]
    elif trial.subject.foot_length_m is not None:
        recorded = trial.subject.foot_length_m
    else:
        return None
    return motion_checks.foot_length(
        recorded, trial.model.foot.length_m, intact=trial.calibration is None
    )


def _roll_from_shank(
    trial: Trial, foot: FootMotion, flats: Mapping[int, np.ndarray]
) -> Check | None:
    if trial.tracked is None or trial.calibration is None:
        return None
    name = f"foot_{foot.side}"
    markers = subset(trial.calibration.segments[name], trial.tracked.residual_rms_m)
    if not rolls_with_shank(name, markers.p_BM):
        return None
    return force_checks.roll_from_shank(foot, flats, markers.labels)


def _markers(trial: Trial) -> list[Check | None]:
    tracked = trial.tracked
    calibration = trial.calibration
    recording = trial.recording
    if tracked is None or calibration is None or recording is None:
        return []
    used = {label for segment in calibration.segments.values() for label in segment.labels}
    raw = {
        label: values for label, values in recording.markers.items() if label in used
    } or recording.markers
    return [
        motion_checks.spread("residuals", tracked.residual_rms_m),
        motion_checks.spread("cluster_motion", tracked.cluster_motion_m),
        motion_checks.spread("joint_gaps", tracked.joint_gap_m),
        motion_checks.gaps_filled(tracked.gaps),
        motion_checks.filtered_before(
            raw, recording.marker_rate_hz or 0.0, cutoff_hz=trial.cutoff_hz
        ),
        *(
            checked(
                "plate_and_foot",
                "plate and foot",
                "doubtful",
                c.start_s,
                "s",
                side=c.side,
                plate=c.plate,
                start_s=c.start_s,
                end_s=c.end_s,
                warning=c.warning,
            )
            for c in trial.contacts
            if c.warning
        ),
        Check("left and right", "doubtful", None, "", NOTE) if NOTE in recording.notes else None,
        *motion_checks.leg_lengths(calibration.lengths_m),
    ]


# An examined trial in numbers, for import.json and check.json.


def trial_table(item: Examined) -> dict[str, object]:
    """Everything that was found about one trial; units are in the names, or beside the value."""
    trial = item.trial
    tracked = item.trial.tracked
    table: dict[str, object] = {
        "name": trial.name,
        "synthetic": trial.synthetic,
        "mark": item.mark,
        "verdict": item.verdict,
        "expected_error_bw": item.expected_error_bw,
        "checks": item.checks,
        "notes": item.notes,
        "window_s": (trial.start_s, trial.end_s),
        **vars(trial.setting),
        "stances": item.stances,
        "contacts": trial.contacts,
        "unmeasured_s": trial.unmeasured,
        "inputs_sha256": trial.inputs,
    }
    if tracked is not None:
        table |= {
            "marker_cutoff_hz": trial.cutoff_hz,
            "residual_rms_m": tracked.residual_rms_m,
            "cluster_motion_m": tracked.cluster_motion_m,
            "joint_gap_m": tracked.joint_gap_m,
            "gaps": tracked.gaps,
        }
    return table


def person_table(item: Examined) -> dict[str, object]:
    """The subject, and what the standing trial told where there was one."""
    table: dict[str, object] = {"subject": to_plain(item.trial.subject)}
    calibration = item.trial.calibration
    if calibration is not None:
        table["calibration"] = {
            "lengths_m": calibration.lengths_m,
            "method": calibration.method,
            "notes": calibration.notes,
            "standing_angles_deg": {
                name: float(np.degrees(value))
                for name, value in calibration.angles_rad.items()
                if name not in PELVIS_TRANSLATIONS
            },
        }
    return table
