"""One recorded step on level ground, a slope, a step, a soft mat and a slippery floor: only the ground changes.

The prosthesis alone is pulled along the path of the residual limb in an embedded, synthetic trial, by springs as stiff
as its socket (models/scenarios/guided_pylon.yaml), in the sagittal plane, by Drake's Simulator. Nobody adapts: the limb
moves as on level ground and gives way only by its springs, so a step that nobody saw is met in full. On the slope the
path is tilted with the ground, as the scenario's rail is; there the forces must be those of level ground, tilted, but
for the weight of the prosthesis.

    python studies/examples/walking_over_grounds.py --out results/walking_over_grounds

Half a minute: 3 s a stance by implicit_euler at accuracy 1e-3. radau3 passes most of it in half the steps, but took
15000 of them at one corner of the friction law.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from grounds_figure import draw
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial

from vsf_drake.analysis.json_file import write_json
from vsf_drake.contact_file import load_contact
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import make_gait
from vsf_drake.plants.station import Station, make_station
from vsf_drake.report.style import save_figure
from vsf_drake.resources import resource
from vsf_drake.scenario import Scenario, load_scenario
from vsf_drake.simulation.adaptive import advance, drive

TRIAL, CONTACT = (f"data/reference_subject/exact/{name}.yaml" for name in ("medium_1", "contact"))
"""A trial that the contact was not fitted to."""
SLOPE_DEG, EDGE_M, STEP_M = 5.0, 0.53, 0.005
"""The slope rises through x = 0 of the recording; the step's edge lies under the midfoot."""
GROUNDS = {
    "level": Ground(),
    "slope": Ground(patches=(GroundPatch(name="slope", slope_deg=SLOPE_DEG),)),
    "step": Ground(patches=(GroundPatch(name="floor"), GroundPatch(name="step", from_x_m=EDGE_M, height_m=STEP_M))),
    "mat": Ground(patches=(GroundPatch(name="mat", stiffness_n_per_m=1e4),)),
    "ice": Ground(patches=(GroundPatch(name="ice", mu_static=0.08, mu_kinetic=0.05),)),
}
SAMPLE_S = 2e-3


@dataclass(frozen=True, eq=False)
class GroundRun:
    """One step on one ground at n instants: force (n, 3) N and its point (n, 3) m in W, NaN in swing.

    Attributes:
        outline: (n, p, 2) x and z (m) of the pylon's top, the mount, and the foot's sole from heel to toe.
        steps: of the integrator; wall_s: time it took.
    """

    time_s: np.ndarray
    grf_W: np.ndarray
    cop_W: np.ndarray
    outline: np.ndarray
    steps: int
    wall_s: float


def limb_path(trial: Trial) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (n,), path (n, 3) of the residual limb's end (forward m, up m, pitch rad), and the pylon's length (m)."""
    gait = make_gait(trial.subject, trial.model)
    plant, names = gait.plant, gait.person.coordinate_names
    times = np.arange(trial.start_s, trial.end_s, 5e-3)
    at = [plant.GetJointByName(name).position_start() for name in names]
    shank = plant.GetBodyByName(f"shank_{trial.subject.prosthetic_side}")
    context, q, path = plant.CreateDefaultContext(), np.zeros(plant.num_positions()), []
    for row in trial.trajectory.ordered(names).sample(times)[0]:
        q[at] = row
        plant.SetPositions(context, q)
        X_WS = shank.EvalPoseInWorld(context)
        end = X_WS @ np.array([0.0, 0.0, -gait.person.body.residual_length])
        ahead = X_WS.rotation().matrix()[:, 0]
        path.append([end[0], end[2], np.arctan2(ahead[2], ahead[0])])
    return times, np.array(path), float(gait.person.body.pylon_length)


def on_ground(base: Scenario, ground: Ground, pylon_length_m: float, trial: Trial) -> Scenario:
    """`base` with another ground, its rail tilted as the first patch is, and with the subject's pylon and socket."""
    slope, socket = ground.patches[0].slope_deg, trial.model.socket
    guides = tuple(replace(guide, stiffness=axis.stiffness, damping=axis.damping) for guide, axis in
                   zip(base.guides, (socket.tx, socket.tz, socket.flexion), strict=True))
    return replace(base, ground=ground, fulcrum_mm=1e3 * trial.fulcrum_m, guides=guides,
                   contact_file=str(resource(CONTACT)), directives=(
        base.directives[0],
        {"add_frame": {"name": "pylon_end", "X_PF": {
            "base_frame": "guided::pylon", "translation": [0.0, 0.0, -pylon_length_m]}}},
        {"add_weld": {"parent": "world", "child": "guided::rail", "X_PC": {
            "rotation": {"deg": [0.0, -slope, 0.0]}}}}))


def step_on(
    scenario: Scenario, path: PiecewisePolynomial, offsets: GeometricOffsets, start_s: float, end_s: float
) -> GroundRun:
    """Follows `path` from `start_s` to `end_s` under Drake's Simulator, the foot placed by `offsets`."""
    station = make_station(scenario)
    builder = DiagramBuilder()
    builder.AddSystem(station.diagram)
    drive(builder, "path", path, 1, station.diagram.GetInputPort("desired_state"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own, plant_context = station.own_context(context), station.plant_context(context)
    x = station.plant.GetPositionsAndVelocities(plant_context)
    for i, name in enumerate(("forward", "up", "pitch")):
        joint = station.plant.GetJointByName(name)
        x[joint.position_start()] = path.value(start_s)[i, 0]
        x[station.plant.num_positions() + joint.velocity_start()] = path.EvalDerivative(start_s)[i, 0]
    station.plant.SetPositionsAndVelocities(plant_context, x)
    set_mount(plant_context, station.feet["vsf"], height=offsets.height_m, fore_aft=offsets.fore_aft_m,
              alignment=offsets.alignment_rad)
    config = station.simulator_config()
    config.start_time = start_s
    ports = [station.diagram.GetOutputPort(name) for name in ("grf", "cop")]
    times = start_s + SAMPLE_S * np.arange(round((end_s - start_s) / SAMPLE_S) + 1)
    run = advance(diagram, context, times,
                  lambda: (*(port.Eval(own) for port in ports), outline(station, plant_context)), config, None)
    grf, cop, lines = (np.array(column) for column in zip(*run.rows, strict=True))
    return GroundRun(time_s=times, grf_W=grf, cop_W=np.where(grf[:, 2:] > 10.0, cop, np.nan), outline=lines,
                     steps=run.steps, wall_s=run.wall_s)


def outline(station: Station, context: Any) -> np.ndarray:
    """(p, 2) x and z (m): the pylon's top, the mount, then the lowest points of the foot's spheres from heel to toe."""
    foot, plant = station.feet["vsf"], station.plant
    starts = {body.index(): start for body, start in zip(foot.keel, foot.keel_starts, strict=True)}
    along = [starts.get(index, 0.0) + centre[0] for index, centre in zip(foot.sites.body_indices, foot.sites.p_BS,
                                                                         strict=True)]
    points = [plant.GetBodyByName("pylon").EvalPoseInWorld(context).translation(),
              foot.mount.CalcPoseInWorld(context).translation()]
    sole = [plant.get_body(index).EvalPoseInWorld(context) @ (centre - [0.0, 0.0, radius])
            for index, centre, radius in zip(foot.sites.body_indices, foot.sites.p_BS, foot.sites.radius, strict=True)]
    return np.array(points + [sole[i] for i in np.argsort(along)])[:, [0, 2]]


def summary(run: GroundRun, body_weight_n: float) -> dict[str, float]:
    """Peak, impulses and greatest loading rate of one step, the rate over 20 ms."""
    f = run.grf_W
    window = round(0.02 / SAMPLE_S)
    rate = (f[window:, 2] - f[:-window, 2]) / 0.02
    return {
        "peak_bw": float(f[:, 2].max() / body_weight_n), "loading_rate_bw_per_s": float(rate.max() / body_weight_n),
        "vertical_impulse_n_s": float(f[:, 2].sum() * SAMPLE_S), "braking_n": float(f[:, 0].min()),
        "propulsion_n": float(f[:, 0].max()),
        "integrator_steps": run.steps, "wall_s": run.wall_s}


def main(out: Path, quick: bool = False) -> dict[str, GroundRun]:
    """Writes grounds.json and the figure into `out`; quick: until the foot is flat, instead of the whole stance."""
    trial = trial_with(load_trial(resource(TRIAL)), load_contact(resource(CONTACT)))
    times, points, length = limb_path(trial)
    path = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, points.T)
    base = load_scenario(resource("models/scenarios/guided_pylon.yaml"))
    plate = trial.prosthetic_plate
    stance = plate.time_s[plate.force_W[:, 2] > 20.0][[0, -1]]
    start_s = float(stance[0]) - 0.02
    end_s = start_s + 0.2 if quick else float(stance[1]) + 0.02
    runs = {name: step_on(on_ground(base, ground, length, trial), path, trial.offsets, start_s, end_s)
            for name, ground in GROUNDS.items()}
    weight = GRAVITY * trial.subject.mass_kg
    rows = {name: summary(run, weight) for name, run in runs.items()}
    for name, row in rows.items():
        print(f"{name:6s}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "grounds.json", {"trial": trial.name, "synthetic": trial.synthetic, "grounds": rows})
    save_figure(draw(runs, GROUNDS, plate, weight), out / "walking_over_grounds")
    return runs


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/walking_over_grounds"))
    parser.add_argument("--quick", action="store_true", help="until the foot is flat")
    arguments = parser.parse_args()
    main(arguments.out, arguments.quick)
