"""The reference subject in Plug-in Gait, heel and toe put so far below the ankle centre (0: all on
one line), and the feet's true orientation. SYNTHETIC, as the subject is."""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.base.files import resource
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.segments import segment_poses

PERSON = PersonFacts(sex="male", prosthetic_side="right", mass_kg=78.0, stature_m=1.81)
NAMES = {
    "ASI": "ASI",
    "PSI": "PSI",
    "TH1": "THI",
    "LFC": "KNE",
    "MFC": "KNM",
    "TB1": "TIB",
    "LMAL": "ANK",
    "MMAL": "MED",
    "CAL": "HEE",
    "TOE": "TOE",
}


def flat_feet(
    below_m: float, walk: str = "low_1"
) -> tuple[Recording, Recording, dict[str, np.ndarray]]:
    """Standing trial, walk without medial markers, and R_WF (n, 3, 3) of its feet by side, as the
    markers had them that do not lie on a line."""
    folder = resource("data/reference_subject")
    rajagopal = load_marker_map("rajagopal")
    calibration = calibrate(read_trial(folder / "markers/static.trc"), rajagopal, PERSON)

    def flattened(path, forces=None):
        recording = rajagopal.rename(read_trial(path, forces=forces))
        poses = segment_poses(calibration.segments, recording.markers)
        markers = {
            f"{side}{name}": recording.markers[f"{side}{known}"].copy()
            for known, name in NAMES.items()
            for side in "RL"
        }
        for side in SIDES:
            foot = calibration.segments[f"foot_{side}"]
            for known in ("CAL", "TOE"):
                p_F = foot.p_BM[foot.labels.index(f"{side[0].upper()}{known}")]
                markers[f"{side[0].upper()}{NAMES[known]}"] = poses[f"foot_{side}"].points(
                    np.array([p_F[0], 0.0, -below_m])
                )
        return dataclasses.replace(recording, markers=markers), poses

    standing, _ = flattened(folder / "markers/static.trc")
    walking, poses = flattened(folder / f"markers/{walk}.trc", folder / f"exact/{walk}_forces.mot")
    seen = {label: x for label, x in walking.markers.items() if not label.endswith(("KNM", "MED"))}
    return (
        standing,
        dataclasses.replace(walking, markers=seen),
        {side: poses[f"foot_{side}"].R_WB for side in SIDES},
    )
