"""What this package itself answers, with which the other engines are compared: statics by
`keel_shape`, the plant of `add_foot`, roll-overs by the stepper.

python -m vsf_drake.engines.certificate.in_stepper FOLDER
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from scipy.interpolate import CubicSpline

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.schema import load_yaml
from vsf_drake.engines.certificate.ask import FOOT
from vsf_drake.engines.certificate.asked import ELASTIC, NOMINAL, Asked
from vsf_drake.engines.certificate.steadiness import LOADS_N, STEPS_S
from vsf_drake.laws.beam import combined_stiffness
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.foot import add_foot
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.roll_over import RollOver

FILE = "stepper.npz"
STEPS = 40
"""Of the stepper between two instants, 25 us."""
FINE = 32
"""Equal elements of the keel that is compared with a beam."""


def rises(asked: Asked, foot: FootParameters, loads_n: Iterable[float]) -> np.ndarray:
    """(F, L) m by which the load point rises under each load, fulcrum by fulcrum."""
    return np.array(
        [
            [
                keel_shape(foot, fulcrum_m=1e-3 * mm, load_n=float(load)).load_point_K[1]
                for load in loads_n
            ]
            for mm in asked.fulcrum_mm
        ]
    )


def small_rises(asked: Asked) -> np.ndarray:
    """(F, L) m, of the beam in closed form for small angles."""
    stiffness = combined_stiffness(
        bending_stiffness=asked.beam_ei_nm2,
        support=1e-3 * asked.fulcrum_mm,
        load_point=asked.load_point_m,
        fulcrum_stiffness=asked.support_n_per_m,
    )
    return np.asarray(asked.load_n / stiffness[:, None])


def mass_and_gravity(asked: Asked, foot: FootParameters) -> tuple[np.ndarray, np.ndarray]:
    """(P, B, B) kg m^2 mass matrices of the hinges and (P, B) N m that gravity exerts on them, the
    frame held."""
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), foot)
    plant.mutable_gravity_field().set_gravity_vector(np.array([0.0, 0.0, -asked.gravity]))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name, handles.instance) for name in handles.keel_joint_names]
    rows = np.array([joint.velocity_start() for joint in joints])
    masses = []
    torques = []
    for pose in asked.poses_rad:
        positions = plant.GetPositions(context)
        positions[rows] = pose
        plant.SetPositions(context, positions)
        masses.append(plant.CalcMassMatrix(context)[np.ix_(rows, rows)])
        torques.append(plant.CalcGravityGeneralizedForces(context)[rows])
    return np.array(masses), np.array(torques)


def roll_over(asked: Asked, foot: FootParameters, *, friction: bool) -> np.ndarray:
    """(T, 3) N of the ground on the foot in W along the path of the mount, without weight."""
    time_s = np.linspace(asked.time_s[0], asked.time_s[-1], STEPS * (len(asked.time_s) - 1) + 1)
    run = RollOver(foot, friction=friction).follow(
        fulcrum_m=1e-3 * asked.roll_fulcrum_mm,
        time_s=time_s,
        mount=CubicSpline(asked.time_s, asked.mount, bc_type="natural")(time_s),
    )
    if run.unconverged_steps:
        raise SimulationError(
            f"{run.unconverged_steps} steps did not converge", time_s=float(time_s[-1])
        )
    # at first the foot just touches
    return np.vstack([np.zeros(3), run.grf_W[STEPS - 1 :: STEPS]])


def answer(folder: Path) -> None:
    """Reads what is asked in `folder` and writes `FILE` there."""
    asked = Asked.read(folder)
    foot = load_yaml(folder / NOMINAL / FOOT, FootParameters)
    lengths = (asked.keel_length_m / FINE,) * FINE
    fine = replace(foot, keel=replace(foot.keel, element_lengths_m=lengths))
    held = rises(asked, foot, LOADS_N)
    masses, torques = mass_and_gravity(asked, foot)
    own = roll_over(asked, foot, friction=True)
    np.savez(
        folder / FILE,
        rise_m=rises(asked, foot, asked.load_n),
        rise_fine_m=rises(asked, fine, asked.load_n),
        rest_rise_m=np.array([held] * (1 + len(STEPS_S))),
        rise_small_m=small_rises(asked),
        mass_matrix_kg_m2=masses,
        gravity_torque_nm=torques,
        roll_elastic_n=roll_over(
            asked, load_yaml(folder / ELASTIC / FOOT, FootParameters), friction=False
        )[:, 2],
        roll_nominal_n=roll_over(asked, foot, friction=False)[:, 2],
        roll_own_n=own[:, 2],
        roll_own_fore_aft_n=own[:, 0],
        version=version("vsf-drake"),
    )


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
