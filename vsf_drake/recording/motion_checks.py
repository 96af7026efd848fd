"""Whether angles, the pelvis's path and markers are those of a person who walks forward, and belong
together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake import recording
from vsf_drake.model.parameters import SHELLS_MM
from vsf_drake.motion.events import longest_run
from vsf_drake.motion.markers.segments import Gap
from vsf_drake.motion.trajectory import spacing
from vsf_drake.recording import DOUBTFUL_BW, GOOD_BW, Check, checked, grade

HIP_BW_PER_DEG = 0.075
MAIN = (
    "pelvis_tilt",
    "hip_flexion_r",
    "hip_flexion_l",
    "knee_angle_r",
    "knee_angle_l",
    "ankle_angle_r",
    "ankle_angle_l",
)
"""The sagittal angles, none of which is zero in a standing person."""
ZERO_MEAN = "angles zeroed at the walk's mean"
FOOT_LENGTH = "length of the foot"
TO_DO = (ZERO_MEAN, FOOT_LENGTH)
"""Names of checks that say what to do of all walks alike: commands print their sentences, once."""
EXACT_RAD = 1e-9
# standing angles this close to zero, all of them, are not a person's but a subtraction's (a choice)
ZERO_DEG = 0.3
FEWEST_ANGLES = 3
ZEROED_TILT_DEG, ZEROED_HIP_DEG = 2.0, 8.0
"""Pelvic tilt is about 11-12 degrees forward in walking and in standing, and mean hip flexion about
18 (Schwartz 2008, means); zeroed at standing they become about 0 and 3-6."""
MEAN_DEG, MOVES_DEG = 0.001, 2.0
"""An angle of a leg that moves by more than the second and whose mean over the recording is below
the first had that mean subtracted: files keep four decimals and more, and one of some hundred
angles of synthetic walks that were not comes to 0.002 degrees by chance (choices)."""
ANKLE_DEG = 20.0
# turn of a knee's axis beyond its own coupling of motions, some 5 degrees, and skin (a choice)
AXIS_DEG = 10.0
LEAST_FLEXION_DEG = 30.0  # a knee that bends less does not show its axis (a choice)
# prosthesis users 0.85 to 1.0 (Hermodsson 1994), able-bodied up to 2 before they run
SPEED_M_PER_S = (0.3, 2.2)
# against x: the model's socket and knee turn about y, forces along x are called fore-aft
HEADING_DEG = (20.0, 45.0)
BOB_M = (0.01, 0.10)  # rise and fall of the pelvis, 30-50 mm in usual walking (a choice around it)
# acceleration of a pelvis that no walk reaches (a choice: three times gravity)
JUMP_M_PER_S2 = 30.0
REST_M_PER_S = 0.05
BELT_M_PER_S = 0.3  # backward speed of standing feet that no ground allows (a choice)
ROUGH_BW_PER_DEG = 0.16
"""What a hip angle's content above ROUGH_HZ is of the force: more than of an angle that is held,
since keel and ground damp."""
ROUGH_DEG = (GOOD_BW / ROUGH_BW_PER_DEG, DOUBTFUL_BW / ROUGH_BW_PER_DEG)  # content above ROUGH_HZ
# twice the usual cut-off: above it an angle has noise, or a stride that was cut and pasted
ROUGH_HZ = 12.0
HARMONICS_HZ = 4.0
SMOOTHED_DEG = 0.29
"""Content of the sagittal angles of hips and knees (degrees, root mean square) above the former,
below which more than noise was filtered away (a choice). Published mean curves have 0.33 to 0.7
there at 0.83 to 1.1 strides a second (Schwartz 2008, doi 10.1016/j.jbiomech.2008.03.015), 0.30 and
more if filtered at 6 Hz, 0.20 at most at 3 Hz. Of 57 synthetic walks none has less than 0.38,
filtered again at 6 Hz none less than 0.32, at 3 Hz none more than 0.28."""
LEAST_STRIDES_PER_S = 0.78  # slower ones have their fifth harmonic below: not judged (a choice)
# slower walks have fewer harmonics, of which little is published: not judged
SMOOTHED_M_PER_S = 0.8
FITTED_SMOOTHED_BW = 0.05
"""What is left of filtering at 3 Hz; how far an angle was filtered is not known."""
FITTED_RESIDUAL_BW_PER_M = 0.5
"""What is left of markers that lie off their segments, once the offsets are fitted: a cluster or a
marker that slips, an axis or a hip centre found wrongly. Less than of the angle that one marker
alone would turn, since the other markers of its segment hold it."""
FITTED_NOISE_BW_PER_M = 7.5
"""What is left of noise, by what the markers hold of it above 12 Hz: below there is more of it."""
SPREADS = {
    "residuals": ("marker residuals", (0.010, 0.020)),
    "joint_gaps": ("gaps in joints", (0.020, 0.035)),
    "cluster_motion": ("motion of rigid clusters", (0.008, 0.015)),
}
"""Names and limits (m): distance of each marker from where its segment's pose puts it (20 mm is the
usual limit of OpenSim's guide, half of it a choice: 1.4 degrees over 0.4 m); how far each segment's
markers move against each other (skin moves by 5 to 15 mm on thighs); how far two segments disagree
about their joint's centre (hip regressions err by 10 to 15 mm, and skin moves). The latter two are
choices."""
# longest gap filled without markers of the same segment; the first is the default limit of filling
GAP_S = (0.1, 0.2)
BY_CLUSTER_S = (1.0, float("inf"))  # where the segment's other markers say where it was
# difference of the recorded and the model's foot length, as a share of the model's (a choice)
SAME_FOOT = 0.05
SAME_LENGTH = (0.03, 0.08)
"""Difference of two legs' lengths as a share: people differ by 1 %, joint centres are known to 2 %
(choices)."""
SMOOTH_M = 2e-5
"""Content above twice the cut-off (m, root mean square) that no camera is without: marker noise is
0.1 mm and more, and two decimals of a millimetre alone make 3e-6."""
LEAST_BAND = 0.15  # share of the spectrum that must lie above twice the cut-off to judge by it
NAMED = 4  # how many of the worst are named in a sentence


def zeroed(
    angles_rad: Mapping[str, np.ndarray],
    standing_rad: Mapping[str, float] | None,
    speed_m_per_s: np.ndarray,
) -> Check:
    """Whether angles (n,) by coordinate look as if standing (`standing_rad`, if measured) had been
    subtracted.

    `speed_m_per_s` (n,) is that of the pelvis over the floor.
    """

    def judged(mark: str, value: float, unit: str = "deg", **found: Any) -> Check:
        nothing: dict[str, Any] = {
            "relative": (),
            "subtracted": False,
            "calibrated": False,
            "hips": (),
        }
        return checked(
            "zeroed",
            "angles zeroed at standing",
            mark,
            value,
            unit,
            **(nothing | found),
            hip_bw_per_deg=HIP_BW_PER_DEG,
        )

    known = {key: np.asarray(angles_rad[key]) for key in MAIN if key in angles_rad}
    first = [
        key
        for key, values in known.items()
        if abs(values[0]) < EXACT_RAD and np.ptp(values) > EXACT_RAD
    ]
    if len(first) >= FEWEST_ANGLES:
        return judged("unusable", float(len(first)), "1", relative=first)
    still = speed_m_per_s < REST_M_PER_S
    standing = dict(standing_rad or {})
    if not standing and still.any():
        standing = {key: float(np.mean(values[still])) for key, values in known.items()}
    main = [
        abs(np.degrees(standing[key]))
        for key in MAIN
        if key in standing and np.ptp(known.get(key, [0, 1])) > 0
    ]
    if len(main) >= FEWEST_ANGLES:
        value = float(np.max(main))
        if value < ZERO_DEG:
            return judged("doubtful" if standing_rad else "unusable", value, subtracted=True)
        if standing_rad:
            return judged("good", value, calibrated=True)
    tilt = float(np.degrees(np.mean(known["pelvis_tilt"])))
    hips = [
        float(np.degrees(np.mean(known[key])))
        for key in ("hip_flexion_r", "hip_flexion_l")
        if key in known
    ]
    near_zero = abs(tilt) < ZEROED_TILT_DEG and hips and max(map(abs, hips)) < ZEROED_HIP_DEG
    return judged("doubtful" if near_zero else "good", tilt, hips=hips)


def zero_mean(angles_rad: Mapping[str, np.ndarray]) -> Check:
    """Whether angles of the legs (n,), by coordinate, have had their mean over the recording
    subtracted."""
    means = {
        name: abs(float(np.degrees(np.mean(values))))
        for name, values in angles_rad.items()
        if not name.startswith("pelvis") and np.degrees(np.ptp(values)) > MOVES_DEG
    }
    names = [name for name, mean in means.items() if mean < MEAN_DEG]
    return checked(
        "zero_mean", ZERO_MEAN, "doubtful" if names else "good", float(len(names)), "1", names=names
    )


def foot_length(recorded_m: float, model_m: float, *, intact: bool) -> Check:
    """The length of the recorded prosthetic foot, or of the `intact` one for want of it, against
    the model's."""
    value = recorded_m / model_m - 1.0
    return checked(
        "foot_length",
        FOOT_LENGTH,
        "good" if abs(value) <= SAME_FOOT else "doubtful",
        value,
        "1",
        recorded=recorded_m,
        model=model_m,
        states=SHELLS_MM[0] <= 1e3 * recorded_m <= SHELLS_MM[1],
        intact=intact,
    )


def ankle_offset(angles_rad: Mapping[str, np.ndarray], intact_side: str) -> Check | None:
    """Whether the intact ankle's mean is that of an ankle measured from a right angle."""
    key = f"ankle_angle_{intact_side[0]}"
    if key not in angles_rad:
        return None
    value = float(np.degrees(np.mean(angles_rad[key])))
    return checked(
        "ankle_offset",
        "ankle's zero",
        "good" if abs(value) < ANKLE_DEG else "doubtful",
        value,
        "deg",
        side=intact_side,
    )


def knee_axis(angles_rad: Mapping[str, np.ndarray], side: str) -> Check | None:
    """Whether the knee bends about the axis from which its angles are measured; None where it bends
    too little.

    A hinge that bends by theta about an axis turned by phi (about the thigh's length) from the
    measured one shows sin(adduction) = sin(phi) sin(theta), by geometry: cross-talk. phi is the
    slope of the one sine against the other.
    """
    names = f"knee_angle_{side[0]}", f"knee_adduction_{side[0]}"
    if any(name not in angles_rad for name in names):
        return None
    flexion, adduction = (np.asarray(angles_rad[name]) for name in names)
    if np.degrees(np.ptp(flexion)) < LEAST_FLEXION_DEG:
        return None
    slope = float(np.polyfit(np.sin(flexion), np.sin(adduction), 1)[0])
    value = float(np.degrees(np.arcsin(np.clip(slope, -1.0, 1.0))))
    return checked(
        "knee_axis",
        "knee's axis",
        "good" if abs(value) < AXIS_DEG else "doubtful",
        value,
        "deg",
        side=side,
    )


def smoothness(time_s: np.ndarray, angles_rad: Mapping[str, np.ndarray]) -> Check | None:
    """The roughest sagittal angle: what it holds above 12 Hz. None if the sampling cannot tell."""
    known = _main_content(time_s, angles_rad, ROUGH_HZ)
    if not known or 1.0 / spacing(time_s) <= 2.5 * ROUGH_HZ:
        return None
    angle = max(known, key=known.__getitem__)
    value = float(np.degrees(known[angle]))
    return checked(
        "smoothness",
        "smoothness of angles",
        grade(value, *ROUGH_DEG),
        value,
        "deg",
        cost_bw=ROUGH_BW_PER_DEG * value,
        angle=angle,
        above_hz=ROUGH_HZ,
    )


def _main_content(
    time_s: np.ndarray, angles_rad: Mapping[str, np.ndarray], above_hz: float
) -> dict[str, float]:
    """Content (rad) of the sagittal angles above a frequency, of those long enough to tell."""
    rate = 1.0 / spacing(time_s)
    return {
        key: size
        for key in MAIN
        if key in angles_rad
        and (size := high_content(angles_rad[key][:, None], rate, above_hz)) is not None
    }


def smoothed(
    time_s: np.ndarray,
    angles_rad: Mapping[str, np.ndarray],
    *,
    speed_m_per_s: float,
    strides_per_s: float,
) -> Check | None:
    """Whether the angles (n,) of hips and knees lack what every walk has at its higher harmonics.
    None where the record is too short, or the walk too slow."""
    known = [
        size
        for key, size in _main_content(time_s, angles_rad, HARMONICS_HZ).items()
        if not key.startswith(("pelvis", "ankle"))
    ]
    if not known or speed_m_per_s < SMOOTHED_M_PER_S or strides_per_s < LEAST_STRIDES_PER_S:
        return None
    value = float(np.degrees(np.sqrt(np.mean(np.square(known)))))
    lacks = value < SMOOTHED_DEG
    return checked(
        "smoothed",
        "angles filtered away",
        "doubtful" if lacks else "good",
        value,
        "deg",
        above_hz=HARMONICS_HZ,
        cost_bw=FITTED_SMOOTHED_BW if lacks else None,
    )


def belt(feet_m_per_s: Sequence[float]) -> Check | None:
    """Whether both feet slide backward alike while they stand flat, as on a belt; velocities along
    x, forward +."""
    speed = -float(np.median(feet_m_per_s)) if len(feet_m_per_s) > 1 else 0.0
    if speed < BELT_M_PER_S or np.ptp(feet_m_per_s) > 0.5 * speed:
        return None
    return checked("belt", "treadmill", "unusable", speed, "m/s")


def walking(time_s: np.ndarray, pelvis_W: np.ndarray) -> list[Check]:
    """Speed, direction and path of the pelvis (n, 3) m, on the laboratory's floor or, on a
    treadmill, on its belt."""
    travel = (pelvis_W[-1] - pelvis_W[0])[:2]
    speed = float(np.hypot(*travel)) / float(time_s[-1] - time_s[0])
    usual = SPEED_M_PER_S[0] <= speed <= SPEED_M_PER_S[1]
    checks = [checked("speed", "walking speed", "good" if usual else "doubtful", speed, "m/s")]
    if speed >= SPEED_M_PER_S[0]:
        heading = float(np.degrees(np.arctan2(travel[1], travel[0])))
        checks.append(
            checked("heading", "direction of walking", grade(heading, *HEADING_DEG), heading, "deg")
        )
    bob = float(np.ptp(pelvis_W[:, 2] - np.polyval(np.polyfit(time_s, pelvis_W[:, 2], 1), time_s)))
    fits = BOB_M[0] <= bob <= BOB_M[1]
    checks.append(
        checked("bob", "rise and fall of the pelvis", "good" if fits else "doubtful", bob, "m")
    )
    jerks = np.linalg.norm(
        np.gradient(np.gradient(pelvis_W, time_s, axis=0), time_s, axis=0), axis=1
    )
    if jerks.max() > JUMP_M_PER_S2:
        checks.append(
            checked(
                "jerk",
                "path of the pelvis",
                "doubtful",
                float(jerks.max()),
                "m/s^2",
                when_s=float(time_s[int(np.argmax(jerks))]),
            )
        )
    return checks


# How well markers, rigid segments and the standing trial fit together.


def spread(part: str, values_m: Mapping[str, float]) -> Check | None:
    """The worst of what is measured under one name of SPREADS, by marker, segment or joint (m)."""
    ranked = sorted(
        (item for item in values_m.items() if np.isfinite(item[1])), key=lambda item: -item[1]
    )
    if not ranked:
        return None
    (name, limits), value = SPREADS[part], ranked[0][1]
    names = ", ".join(f"{key.replace('_', ' ')} {1e3 * size:.1f}" for key, size in ranked[:NAMED])
    cost_bw = FITTED_RESIDUAL_BW_PER_M * value if part == "residuals" else None
    return checked(
        part, name, grade(value, *limits), 1e3 * value, "mm", names=names, cost_bw=cost_bw
    )


def gaps_filled(gaps: Sequence[Gap]) -> Check:
    """What was filled, and the longest of it."""
    longest = max(gaps, key=lambda gap: gap.end_s - gap.start_s, default=None)
    marks = [
        grade(
            gap.end_s - gap.start_s - 1e-9,
            *(BY_CLUSTER_S if gap.how.startswith("rigid cluster") else GAP_S),
        )
        for gap in gaps
    ]
    lasted = longest.end_s - longest.start_s if longest else 0.0
    return checked(
        "gaps_filled",
        "gaps filled",
        recording.worst(marks),
        lasted,
        "s",
        count=len(gaps),
        longest=longest,
    )


def leg_lengths(lengths_m: Mapping[str, float]) -> list[Check]:
    """Right against left, for every length that is known on both sides."""
    checks = []
    for key, right in lengths_m.items():
        left = (
            lengths_m.get(key.removesuffix("_right") + "_left") if key.endswith("_right") else None
        )
        if left is None or key.startswith("ankle"):
            continue
        value = left / right - 1.0
        what = key.removesuffix("_right").replace("_", " ")
        mark = grade(value, *SAME_LENGTH)
        if not key.startswith("thigh"):  # below the knee a prosthesis may be as long as it likes
            mark = recording.at_most(mark, "doubtful")
        checks.append(
            checked(
                "leg_lengths",
                f"{what}, left against right",
                mark,
                value,
                "1",
                what=what,
                right=right,
                left=left,
            )
        )
    return checks


def filtered_before(
    markers_m: Mapping[str, np.ndarray], rate_hz: float, *, cutoff_hz: float | None
) -> Check | None:
    """Whether the markers, (frames, 3) by label as recorded, had been low-passed before.

    `cutoff_hz` is that of our filter, None where it was left out.
    """
    above = 2 * (cutoff_hz or 6.0)
    if above > (1 - LEAST_BAND) * rate_hz / 2:
        return None
    sizes = [
        size
        for values in markers_m.values()
        if (size := high_content(values, rate_hz, above)) is not None
    ]
    if not sizes:
        return None
    value = float(np.median(sizes))
    noisy = value > SMOOTH_M
    left_out = cutoff_hz is None
    return checked(
        "filtered_before",
        "filter applied before",
        "doubtful" if noisy == left_out else "good",
        1e3 * value,
        "mm",
        cost_bw=None if left_out else FITTED_NOISE_BW_PER_M * value,
        above_hz=above,
        noisy=noisy,
        left_out=left_out,
    )


def high_content(values: np.ndarray, rate_hz: float, above_hz: float) -> float | None:
    """Root mean square (m) of a marker's content above a frequency, over its longest unbroken
    stretch.

    A quadratic is taken out and a Hann window laid over it, so that its ends do not leak into the
    band. None if short.
    """
    run = longest_run(np.isfinite(values).all(axis=1))
    if len(run) < max(24, rate_hz / 2):
        return None
    x = np.arange(len(run)) / len(run)
    series = values[run] - np.stack(
        [np.polyval(np.polyfit(x, column, 2), x) for column in values[run].T], axis=1
    )
    window = np.hanning(len(run))[:, None]

    # Parseval, one-sided: the mean square in the band is 2 sum |X_k|^2 / (n sum w^2).
    power = np.abs(np.fft.rfft(series * window, axis=0)) ** 2
    band = np.fft.rfftfreq(len(run), 1.0 / rate_hz) > above_hz
    return float(np.sqrt(2.0 * power[band].sum() / (len(run) * np.sum(window**2))))
