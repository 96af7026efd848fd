"""One prosthetic stance of the whole person on level ground, a slope, a step, a soft mat and ice.

The person (28 degrees of freedom and the keel's) follows an embedded, synthetic trial; socket, keel
and foam are free. Ground and forces are systems of the diagram, Drake's Simulator runs it, see
`walk_over_ground`.

  slope           5 degrees up through the world's origin, under both feet. The whole motion is
                  turned with it, so that in the slope's axes all forces are those of level ground
                  but for the weight of what hangs free.
  step, mat, ice  on the prosthesis's side of the path only: the other foot shows that nothing else
                  has changed.

What this is not: a person on a slope or on ice. The motion is prescribed, so nobody adapts, slips
or falls: a step that nobody saw is met in full, a foot that slides on ice is carried on by the
body.

    python studies/examples/walking_over_grounds.py --out results/walking_over_grounds

About 5 s a stance by radau3 at accuracy 1e-3, on ice too. implicit_euler and
velocity_implicit_euler take three times as long; they agree within 0.02 % of body weight (root mean
square) under the prosthesis and 0.1 % under the other foot.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from grounds_figure import draw
from pydrake.math import RotationMatrix
from walk_over_ground import ReferenceWalk, walk_over

from vsf_drake.base.files import resource, write_json
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.report.style import save_figure

TRIAL, CONTACT = (f"data/reference_subject/exact/{name}.yaml" for name in ("medium_1", "contact"))
"""A right prosthesis, and a trial that the contact was not fitted to."""
SLOPE_DEG, EDGE_M, STEP_M, RIGHT_M = 5.0, 0.59, 0.005, 0.0
"""The step begins under the middle of the sole, between two rows of spheres. The right foot walks
at y < RIGHT_M."""
GROUNDS = {
    "level": Ground(),
    "slope": Ground(patches=(GroundPatch(name="slope", slope_deg=SLOPE_DEG),)),
    "step": Ground(
        patches=(
            GroundPatch(),
            GroundPatch(name="step", from_x_m=EDGE_M, to_y_m=RIGHT_M, height_m=STEP_M),
        )
    ),
    "mat": Ground(
        patches=(GroundPatch(), GroundPatch(name="mat", to_y_m=RIGHT_M, stiffness_n_per_m=1e4))
    ),
    "ice": Ground(
        patches=(
            GroundPatch(),
            GroundPatch(name="ice", to_y_m=RIGHT_M, mu_static=0.08, mu_kinetic=0.05),
        )
    ),
}
"""The highest patch carries; of equally high ones the last."""
SAMPLE_S = 2e-3


def uphill(trajectory: CoordinateTrajectory, slope_deg: float) -> CoordinateTrajectory:
    """The same motion with the pelvis, and all that hangs on it, turned about the lateral axis
    through W's origin.

    The pelvis slides in W first (tx forward, ty up, tz right), then tilts about W's rightward axis,
    front up positive, before list and rotation. So its tilt grows by the slope and its place turns
    in W's sagittal plane.
    """
    values, slope = trajectory.values.copy(), np.radians(slope_deg)
    forward, up, tilt = (trajectory.names.index(f"pelvis_{name}") for name in ("tx", "ty", "tilt"))
    turn = np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    values[:, [forward, up]] = values[:, [forward, up]] @ turn.T
    values[:, tilt] += slope
    return CoordinateTrajectory(trajectory.time_s, values, trajectory.names)


def walk_on(trial: Trial, ground: Ground, longest_s: float = np.inf) -> ReferenceWalk:
    """Walks from 20 ms before the prosthetic foot first strikes to 20 ms after it leaves, or for
    `longest_s`."""
    plate = trial.prosthetic_plate
    stance = find_stances(plate.time_s, plate.force_W[:, 2])[0]
    start_s = round(stance.start_s, 3) - 0.02
    return walk_over(
        trial.subject,
        trial.model,
        uphill(trial.trajectory, ground.patches[0].slope_deg),
        ground,
        fulcrum_m=trial.fulcrum_m,
        offsets=trial.offsets,
        start_s=start_s,
        end_s=start_s + min(round(stance.end_s, 3) + 0.02 - start_s, longest_s),
        sample_s=SAMPLE_S,
    )


def in_ground(vectors_W: np.ndarray, ground: Ground) -> np.ndarray:
    """(n, 3) in W as seen along, across and normal to the first patch of `ground`."""
    return (
        vectors_W @ RotationMatrix.MakeYRotation(-np.radians(ground.patches[0].slope_deg)).matrix()
    )


def off(force: np.ndarray, time_s: np.ndarray, plate: PlateRecording) -> float:
    """Root mean square distance (N) of vertical forces (n,) at times (n,) from what `plate`
    recorded."""
    return float(
        np.sqrt(np.mean((force - np.interp(time_s, plate.time_s, plate.force_W[:, 2])) ** 2))
    )


def summary(
    run: ReferenceWalk, level: ReferenceWalk, ground: Ground, body_weight_n: float
) -> dict[str, float]:
    """The prosthetic foot's force in the ground's axes, what the other foot felt of it, and the
    computing time."""
    force, rise = in_ground(run.grf_W, ground), round(0.02 / SAMPLE_S)
    return {
        "peak_bw": float(force[:, 2].max() / body_weight_n),
        "loading_rate_bw_per_s": float(
            (force[rise:, 2] - force[:-rise, 2]).max() / 0.02 / body_weight_n
        ),
        "braking_n": float(force[:, 0].min()),
        "propulsion_n": float(force[:, 0].max()),
        "off_level_n": float(np.abs(force - level.grf_W).max()),
        "other_foot_off_level_n": float(
            np.abs(in_ground(run.intact_grf_W, ground) - level.intact_grf_W).max()
        ),
        "integrator_steps": run.steps,
        "wall_s": run.wall_s,
    }


def main(out: Path, quick: bool = False) -> dict[str, ReferenceWalk]:
    """Writes grounds.json and the figure into `out`; quick: until the foot is flat, instead of the
    whole stance."""
    trial = trial_with(load_trial(resource(TRIAL)), load_contact(resource(CONTACT)))
    runs = {
        name: walk_on(trial, ground, 0.2 if quick else np.inf) for name, ground in GROUNDS.items()
    }
    weight, level = GRAVITY * trial.subject.mass_kg, runs["level"]
    rows = {name: summary(run, level, GROUNDS[name], weight) for name, run in runs.items()}
    for name, row in rows.items():
        print(f"{name:6s}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    from_plate = {
        "prosthetic": 100.0 * off(level.grf_W[:, 2], level.time_s, trial.prosthetic_plate) / weight,
        "intact": 100.0
        * off(level.intact_grf_W[:, 2], level.time_s, trial.plates["left"])
        / weight,
    }
    print(
        "Level ground, off the SYNTHETIC recording (vertical, root mean square, % of body "
        f"weight): prosthetic foot {from_plate['prosthetic']:.1f}, intact foot "
        f"{from_plate['intact']:.1f}, whose contact was not fitted"
    )
    out.mkdir(parents=True, exist_ok=True)
    write_json(
        out / "grounds.json",
        {
            "trial": trial.name,
            "synthetic": trial.synthetic,
            "grounds": rows,
            "level_off_recording_percent_bw": from_plate,
        },
    )
    save_figure(draw(runs, GROUNDS, trial), out / "walking_over_grounds")
    return runs


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("results/walking_over_grounds"))
    parser.add_argument("--quick", action="store_true", help="until the foot is flat")
    arguments = parser.parse_args()
    main(arguments.out, arguments.quick)
