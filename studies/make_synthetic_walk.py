"""Makes data/synthetic_walk: one walk at 1.1 m/s out of published group means. Nobody walked it.

Published: joint angles and ground reaction force of able-bodied people (data/published). Constructed here: the
path of the pelvis, which is not published, such that the feet carry the published load and do not slide:

    height      what each foot needs to carry its published vertical force, on soles of linear springs, averaged
                over the feet with these forces as weights;
    horizontal  velocity that lets the loaded points of the soles rest on the ground, averaged likewise; integrated.

Both have as many harmonics as the angles. data/synthetic_walk/README.md says what the result is and is not.
Deterministic; values are rounded so that the files are the same on every machine.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from scipy.interpolate import PchipInterpolator

from vsf_drake.analysis.metrics import GRAVITY
from vsf_drake.files import replaced
from vsf_drake.motion.storage import write_storage
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.foot import ContactSites
from vsf_drake.plants.person import add_person
from vsf_drake.schema import load_yaml

DATA = Path(__file__).resolve().parents[1] / "data"
ANGLES, FORCES = "able_bodied_angles_1p1mps.csv", "able_bodied_forces_1p1mps.csv"

SPEED_M_PER_S = 1.1
STRIDE_S = 1.26
"""Time of a stride (s): with it the no-slip speed is the 1.1 m/s of the angles. Published: 1.200 s for a leg of
0.93 m; this subject's is 0.97 m, so the same angles make longer steps."""
STRIKE_S, END_S = 0.4, 1.6
"""Initial contact of the right (prosthetic) foot, and the end of the walk (s), which starts at 0."""
KINEMATICS_HZ, FORCES_HZ, PHASES, HARMONICS = 200, 1000, 200, 6
LOADED_BW = 0.026
"""Published forces below this (20 N) count as no load when the pelvis path is made."""
SOCKET_N_PER_M, SOCKET_NM_PER_RAD, LEVER_M = 1e5, 1e3, 0.144
HEEL_N_PER_M = 1 / (1 / 65e3 + 1 / SOCKET_N_PER_M)
"""Heel of the prosthesis (published 65 N/mm) and socket in series."""
FOREFOOT_N_PER_M = 1 / (1 / 17.3e3 + 1 / SOCKET_N_PER_M + LEVER_M**2 / SOCKET_NM_PER_RAD)
"""Keel at 108 mm (17.3 N/mm, beam theory between the published end points) and socket in series, which also tilts."""
INTACT_SPHERE_N_PER_M = 25e3

SUBJECT = """\
# Published figures of the subject of McGeehan 2021 (doi 10.1115/1.4050456). Lengths are scaled from the stature.
name: synthetic walk, no person
mass_kg: 78.0
stature_m: 1.81
sex: male
prosthetic_side: right
"""
TRIAL = """\
# A SYNTHETIC walk, constructed from published group means by studies/make_synthetic_walk.py. Not a recording.
name: synthetic walk, 1.1 m/s
synthetic: true
subject: subject.yaml
kinematics: kinematics.mot
forces: {file: forces.mot, right: ground_force_r, left: ground_force_l}
prosthesis: {fulcrum_mm: 108}
"""
LEG = {"hip_flexion": "hip_flexion", "hip_adduction": "hip_adduction", "hip_rotation": "hip_rotation",
       "knee_angle": "knee_flexion", "knee_adduction": "knee_adduction", "knee_rotation": "knee_rotation"}


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the synthetic walk out of published group means.")
    parser.add_argument("--out", type=Path, default=DATA / "synthetic_walk", help="folder to write to")
    parser.add_argument("--quick", action="store_true", help="accepted like in every study; this one is quick anyway")
    (out := parser.parse_args().out).mkdir(parents=True, exist_ok=True)
    for name, text in (("subject.yaml", SUBJECT), ("trial.yaml", TRIAL)):
        with replaced(out / name) as stream:
            stream.write(text)
    subject = load_yaml(out / "subject.yaml", Subject)
    angles, forces = read_angles(DATA / "published" / ANGLES), read_forces(DATA / "published" / FORCES)
    write_forces(out / "forces.mot", forces, subject)
    height, velocity = pelvis_cycle(angles, forces, subject)
    write_kinematics(out / "kinematics.mot", angles, height, velocity)
    print(f"synthetic walk in {out}: pelvis {height.min():.3f} to {height.max():.3f} m high, no-slip speed "
          f"{velocity[:, 0].mean():.4f} m/s (set to {SPEED_M_PER_S:g}), stride {STRIDE_S:g} s")


def read_angles(path: Path) -> dict[str, np.ndarray]:
    """Angle name -> (1 + 2 * harmonics,) coefficients a0, a1, b1, a2, ... in degrees."""
    rows = list(csv.reader(line for line in path.read_text().splitlines() if not line.startswith("#")))
    return {row[0]: np.array(row[1:-1], dtype=float) for row in rows[1:]}


def read_forces(path: Path) -> PchipInterpolator:
    """(fore-aft, vertical) force of one foot in body weights as a periodic function of its phase."""
    table = np.loadtxt(path, delimiter=",", comments=("#", "cycle_percent"))
    table[-1, 1:] = table[0, 1:]
    return PchipInterpolator(table[:, 0] / 100.0, table[:, 1:])


def joint_angles(series: dict[str, np.ndarray], phase: np.ndarray) -> dict[str, np.ndarray]:
    """The model's coordinates (deg) at phases of the right foot; the left leg is half a cycle later.

    Pelvis tilt is positive with the front up, list with the left side up, rotation with the right side forward.
    """
    def at(name: str, shifted: np.ndarray) -> np.ndarray:
        k = np.arange(1, (len(series[name]) + 1) // 2)
        turn = 2 * np.pi * np.multiply.outer(shifted, k)
        return series[name][0] + np.cos(turn) @ series[name][1::2] + np.sin(turn) @ series[name][2::2]

    angles = {"pelvis_tilt": -at("pelvis_anterior_tilt", phase), "pelvis_list": -at("pelvis_up", phase),
              "pelvis_rotation": at("pelvis_forward", phase)}
    for side, shifted in (("r", phase), ("l", phase + 0.5)):
        angles |= {f"{name}_{side}": at(published, shifted) for name, published in LEG.items()}
    return angles | {"ankle_angle_l": at("ankle_dorsiflexion", phase + 0.5)}


@dataclass(frozen=True)
class Sole:
    """Springs under one foot, P of them at N phases of the cycle, with the pelvis's origin at rest at zero.

    Attributes:
        points: (3, N, P, 3) m in W: where each material point is one phase before, at, and one after each phase.
        lean: (3, N, P, 2) forward and left movement of a point per metre that the ground lifts it.
        stiffness: (P,) N/m.
    """

    points: np.ndarray
    lean: np.ndarray
    stiffness: np.ndarray

    def load(self, height: np.ndarray) -> np.ndarray:
        """(N, P) N on each spring with the pelvis at `height` (N,) m."""
        return self.stiffness * np.maximum(0.0, -(self.points[1, ..., 2] + height[:, None]))

    def height(self, force: np.ndarray) -> np.ndarray:
        """(N,) m of the pelvis at which the springs carry `force` (N,) N: bisection."""
        low, high = np.full(len(force), 0.5), np.full(len(force), 1.5)
        for _ in range(50):
            middle = 0.5 * (low + high)
            heavy = self.load(middle).sum(axis=1) > force
            low, high = np.where(heavy, middle, low), np.where(heavy, high, middle)
        return 0.5 * (low + high)

    def resting_velocity(self, height: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(N, 2) m/s of the pelvis, forward and left, with which the points that carry `force` (N,) N rest.

        Args:
            height: (N,) m of the pelvis over the cycle.
        """
        around = np.stack([np.roll(height, 1), height, np.roll(height, -1)])
        lift = np.maximum(0.0, -(self.points[..., 2] + around[..., None]))
        place = self.points[..., :2] + lift[..., None] * self.lean
        velocity = (place[2] - place[0]) * PHASES / (2 * STRIDE_S)
        weight = self.load(self.height(force)) + 1e-6
        return -np.einsum("np,npk->nk", weight, velocity) / weight.sum(axis=1)[:, None]


def soles(angles: dict[str, np.ndarray], subject: Subject) -> tuple[Sole, Sole]:
    """The prosthetic foot as two springs, heel and forefoot, and the intact one with a spring at each sphere.

    The prosthesis is undeformed; each spring sits at the lowest sphere of its part. What bends the keel moves
    the forefoot along the foot's own vertical.
    """
    plant = MultibodyPlant(0.0)
    person = add_person(plant, subject, ModelParameters())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    bodies = sorted({int(b) for b in person.foot.sites.body_indices + person.intact_sites.body_indices})
    poses = np.empty((PHASES, len(bodies), 3, 4))
    for k in range(PHASES):
        q = np.zeros(plant.num_positions())
        for name, values in angles.items():
            q[plant.GetJointByName(name).position_start()] = np.radians(values[k])
        plant.SetPositions(context, q)
        poses[k] = [plant.get_body(BodyIndex(b)).EvalPoseInWorld(context).GetAsMatrix34() for b in bodies]

    def followed(sites: ContactSites) -> tuple[np.ndarray, np.ndarray]:
        """(3, N, S, 3) lowest points of the spheres, followed as material points; (3, N, S, 2) lean."""
        X = poses[:, [bodies.index(int(b)) for b in sites.body_indices]]
        down = np.einsum("nsji,j->nsi", X[..., :3], [0.0, 0.0, -1.0]) * sites.radius[:, None]
        around = np.stack([np.roll(X, 1, axis=0), X, np.roll(X, -1, axis=0)])
        points = np.einsum("tnsij,nsj->tnsi", around[..., :3], sites.p_BS + down) + around[..., 3]
        return points, around[..., :2, 2] / around[..., 2:, 2]

    heel = np.array([person.foot.sites.zone_names[zone].startswith("heel") for zone in person.foot.sites.zone])
    points, lean = followed(person.foot.sites)
    parts = [(np.arange(PHASES), group[points[1][:, group, 2].argmin(axis=1)])
             for group in (np.flatnonzero(heel), np.flatnonzero(~heel))]
    device = Sole(points=np.stack([points[:, n, s] for n, s in parts], axis=2),
                  lean=np.stack([np.zeros((3, PHASES, 2)), lean[(slice(None), *parts[1])]], axis=2),
                  stiffness=np.array([HEEL_N_PER_M, FOREFOOT_N_PER_M]))
    points, lean = followed(person.intact_sites)
    intact = Sole(points=points, lean=np.zeros_like(lean), stiffness=np.full(points.shape[2], INTACT_SPHERE_N_PER_M))
    return device, intact


def pelvis_cycle(series: dict[str, np.ndarray], forces: PchipInterpolator,
                 subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Height (N,) m and velocity (N, 2) m/s, forward and left, of the pelvis over one cycle of the right foot."""
    phase = np.arange(PHASES) / PHASES
    feet = soles(joint_angles(series, phase), subject)
    shares = [forces((phase + later) % 1.0)[:, 1] for later in (0.0, 0.5)]
    shares = [np.where(share > LOADED_BW, share, 0.0) for share in shares]
    total = sum(shares)
    loads = [subject.mass_kg * GRAVITY * share for share in shares]
    both = list(zip(feet, shares, loads, strict=True))
    height = periodic(sum(share * foot.height(load) for foot, share, load in both) / total, phase)
    resting = sum(share[:, None] * foot.resting_velocity(height, load) for foot, share, load in both)
    return height, resting / total[:, None]


def periodic(values: np.ndarray, phase: np.ndarray, *, integrated: bool = False) -> np.ndarray:
    """The first HARMONICS of `values` (N, over one cycle) at `phase`; or their integral over phase, of mean zero."""
    k = np.arange(1, HARMONICS + 1)
    spectrum = np.fft.rfft(values) / len(values)
    terms = 2.0 * spectrum[k] / (2j * np.pi * k if integrated else 1.0)
    waves = np.exp(2j * np.pi * np.multiply.outer(phase, k)) @ terms
    return waves.real + (0.0 if integrated else spectrum[0].real)


def write_kinematics(path: Path, series: dict[str, np.ndarray], height: np.ndarray, velocity: np.ndarray) -> None:
    """OpenSim's frame and names: degrees, pelvis tx forward, ty up, tz right, m."""
    time = np.arange(round(END_S * KINEMATICS_HZ) + 1) / KINEMATICS_HZ
    phase = (time - STRIKE_S) / STRIDE_S
    forward, left = (STRIDE_S * periodic(v, phase, integrated=True) for v in velocity.T)
    columns = {"pelvis_tx": SPEED_M_PER_S * time + forward, "pelvis_ty": periodic(height, phase), "pelvis_tz": -left}
    columns |= joint_angles(series, phase)
    write_storage(path, time_s=time, names=list(columns), values=np.column_stack(list(columns.values())).round(7),
                  in_degrees=True, title="SYNTHETIC walk from published group means, not a recording")


def write_forces(path: Path, forces: PchipInterpolator, subject: Subject) -> None:
    """OpenSim's frame, N on the person; vz, which is not published, is zero."""
    time = np.arange(round(END_S * FORCES_HZ) + 1) / FORCES_HZ
    columns: dict[str, np.ndarray] = {}
    for side, later in (("r", 0.0), ("l", 0.5)):
        force = subject.mass_kg * GRAVITY * forces(((time - STRIKE_S) / STRIDE_S + later) % 1.0)
        columns |= {f"ground_force_{side}_vx": force[:, 0], f"ground_force_{side}_vy": force[:, 1],
                    f"ground_force_{side}_vz": np.zeros(len(time))}
    write_storage(path, time_s=time, names=list(columns), values=np.column_stack(list(columns.values())).round(3),
                  title="SYNTHETIC forces from published group means, not a recording")


if __name__ == "__main__":
    main()
