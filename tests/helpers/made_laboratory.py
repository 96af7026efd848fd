"""A laboratory's folder: a made person's standing trial and walks as TRC, with forces beside them
as MOT."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_person import Person, markers, poses, walking_angles
from virtual_laboratory.trc import write_trc

from vsf_drake.motion.events import kinematic_stances
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.formats.tables import write_forces_mot
from vsf_drake.motion.markers.segments import FootTrack

MASS = 78.0
RATE_HZ, FORCE_HZ = 100.0, 1000.0
DURATION_S = 3.0
NOISE_M = 2e-4
"""Of a good camera system; without any, the markers would look filtered already."""
STATED = (
    "--prosthetic-side",
    "right",
    "--sex",
    "male",
    "--mass-kg",
    str(MASS),
    "--stature-m",
    "1.81",
    "--fulcrum-mm",
    "108",
)
MADE = {
    "figures",
    "import.html",
    "import.json",
    "replay.html",
    "subject.yaml",
    "walk.yaml",
    "walk_ik.mot",
    "walk_grf.mot",
}
"""What an import of one walk writes."""


class Laboratory:
    """Files of one person in a folder."""

    def __init__(self, folder: Path, *, person: Person | None = None, seed: int = 0) -> None:
        self.folder, self.person, self.rng = folder, person or Person(), np.random.default_rng(seed)

    def standing(self, name: str = "static.trc") -> Path:
        """A second of standing."""
        path = self.folder / name
        write_trc(
            path,
            self._seen(markers({}, self.person, label_set="rajagopal", frames=100)),
            rate_hz=RATE_HZ,
            unit="mm",
        )
        return path

    def walk(
        self, name: str = "walk.trc", *, forces: bool = True, hidden: tuple[str, ...] = ()
    ) -> Path:
        """A walk and, beside it, forces under each foot as it touches the floor; `hidden` labels
        not seen for 0.5 s."""
        time = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
        angles = walking_angles(time)
        seen = self._seen(markers(angles, self.person, label_set="rajagopal"))
        for label in hidden:
            seen[label][100:150] = np.nan
        path = self.folder / name
        write_trc(path, seen, rate_hz=RATE_HZ, unit="mm")
        if forces:
            force_time = np.arange(0.0, DURATION_S, 1.0 / FORCE_HZ)
            plates = self._plates(time, angles, force_time)
            write_forces_mot(
                path.with_suffix(".mot"),
                time_s=force_time,
                plates={str(number): plate for number, plate in enumerate(plates, start=1)},
            )
        return path

    def _seen(self, truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {
            label: place + NOISE_M * self.rng.standard_normal(place.shape)
            for label, place in truth.items()
        }

    def _plates(
        self, time: np.ndarray, angles: dict[str, np.ndarray], force_time: np.ndarray
    ) -> list[Plate]:
        """One plate for each foot's whole path, so that nothing is missed; load and its centre run
        from heel to toe."""
        where = poses(angles, self.person)
        plates = []
        for side in ("right", "left"):
            R, p = where[f"foot_{side}"]
            heel, toe = ((p + R @ point) for point in self.person.sole(side))
            track = FootTrack(heel, toe, p)
            force, cop = np.zeros((len(force_time), 3)), np.zeros((len(force_time), 3))
            for stance in kinematic_stances(time, track, where["pelvis"][1]):
                duration = stance.duration_s if stance.complete else 0.7
                start = stance.start_s if stance.start_seen else stance.end_s - duration
                phase = (force_time - start) / duration
                on = (phase > 0.0) & (phase < 1.0)
                force[on, 2] = 1.2 * MASS * 9.81 * np.sin(np.pi * phase[on]) ** 0.7
                force[on, 0] = -0.1 * force[on, 2] * np.cos(np.pi * phase[on])
                under = heel + np.interp(time, force_time, np.clip(phase, 0.0, 1.0))[:, None] * (
                    toe - heel
                )
                for axis in range(2):
                    cop[on, axis] = np.interp(force_time[on], time, under[:, axis])
            plates.append(Plate(side, force, cop, np.zeros(len(force_time))))
        return plates


def leftovers(folder: Path) -> list[str]:
    """Names of half-written files anywhere below `folder`."""
    return [path.name for path in folder.rglob("*") if path.name.endswith(".part")]
