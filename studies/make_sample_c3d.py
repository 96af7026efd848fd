"""C3D files of the reference subject, to try `vsf-drake import` with: a standing trial, and a walk
at each setting.

    python studies/make_sample_c3d.py --out here

They hold what markers/*.trc and exact/*_forces.mot of data/reference_subject hold, as a
laboratory's system would write it: z up, mm, and two force plates in the floor (AMTI's kind: six
channels, positive down), under the prosthetic foot's step and the intact foot's next one; what the
feet do beside these plates no plate tells. SYNTHETIC: nobody walked.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import ezc3d
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from make_reference_subject import DATA

from vsf_drake.motion.events import find_stances
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trial import load_trial

FOLDER = DATA / "c3d"
WALKS = ("low_1", "medium_1", "high_1")
DEPTH_M, MARGIN_M = 0.04, 0.12
"""From a plate's surface to its sensors, and from the last place of the foot's centre of pressure
to its edge (choices; the sole reaches 0.1 m beyond it)."""
PLATE_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def main() -> None:
    """Writes all files, or those of one walk and the standing trial."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=FOLDER)
    parser.add_argument(
        "--quick", action="store_true", help="the standing trial and one walk; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and arguments.out == FOLDER:
        parser.error("a part of the files must not replace them all: give --out")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in ("static", *WALKS[: 1 if arguments.quick else None]):
        print(write(name, arguments.out))


def write(name: str, folder: Path) -> Path:
    """One file; of a walk with the plates under the first whole stance of each foot."""
    recorded = read_trial(DATA / "markers" / f"{name}.trc")
    file = ezc3d.c3d()
    # (3, markers, frames), mm
    points = 1e3 * np.stack([*recorded.markers.values()], axis=2).transpose(1, 2, 0)
    file["data"]["points"] = np.concatenate([points, np.ones((1, *points.shape[1:]))])
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [recorded.marker_rate_hz], ["mm"]
    point["LABELS"]["value"] = list(recorded.markers)
    point["DESCRIPTIONS"]["value"] = ["SYNTHETIC"] * len(recorded.markers)
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    if name != "static":
        trial = load_trial(DATA / "exact" / f"{name}.yaml")
        _add_plates(file, trial.plates, points.shape[2], recorded.marker_rate_hz)
    path = folder / f"{name}.c3d"
    file.write(str(path))
    return path


def _add_plates(
    file: ezc3d.c3d, plates: dict[str, PlateRecording], frames: int, marker_hz: float
) -> None:
    """Channels and places of a plate for each foot."""
    rate = round(1.0 / np.median(np.diff(plates["right"].time_s)))
    samples = round(rate / marker_hz) * frames
    channels, corners = [], []
    for plate in plates.values():
        stance = next(s for s in find_stances(plate.time_s, plate.force_W[:, 2]) if s.complete)
        on = (
            (plate.time_s >= stance.start_s - 0.02)
            & (plate.time_s <= stance.end_s + 0.02)
            & (plate.force_W[:, 2] > 0)
        )
        cop = plate.cop_W[on]
        low, high = np.nanmin(cop, axis=0)[:2] - MARGIN_M, np.nanmax(cop, axis=0)[:2] + MARGIN_M
        # x forward, y to the right, z down, so that a foot presses with a positive Fz
        corners.append(
            np.array(
                [
                    [high[0], low[1], 0.0],
                    [low[0], low[1], 0.0],
                    [low[0], high[1], 0.0],
                    [high[0], high[1], 0.0],
                ]
            )
        )
        force = np.where(on[:, None], -plate.force_W, 0.0)
        arm = np.nan_to_num(plate.cop_W - [*(0.5 * (low + high)), -DEPTH_M])
        moment = np.cross(arm, force) - np.outer(
            np.where(on, np.nan_to_num(plate.free_moment_nm), 0.0), [0, 0, 1]
        )
        wrench = np.zeros((samples, 6))
        told = min(samples, len(force))
        wrench[:told] = (np.hstack([force, 1e3 * moment]) * [1, -1, -1, 1, -1, -1])[:told]
        channels.append(wrench)
    file["data"]["analogs"] = np.hstack(channels).T[None]
    analog = file["parameters"]["ANALOG"]
    analog["RATE"]["value"] = [float(rate)]
    analog["LABELS"]["value"] = [f"{name}{k}" for k in (1, 2) for name in PLATE_CHANNELS]
    analog["UNITS"]["value"] = [*["N"] * 3, *["Nmm"] * 3] * len(channels)
    for name, value in {
        "USED": [len(channels)],
        "TYPE": [2] * len(channels),
        "ZERO": [1, 0],
        "CORNERS": 1e3 * np.stack([corner.T for corner in corners], axis=2),
        "ORIGIN": np.array([[0.0, 0.0, -1e3 * DEPTH_M]] * len(channels)).T,
        "CHANNEL": np.arange(1.0, 1.0 + 6 * len(channels)).reshape(-1, 6).T,
    }.items():
        file.add_parameter("FORCE_PLATFORM", name, value)


if __name__ == "__main__":
    main()
