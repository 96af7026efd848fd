"""Presses the condensed foot with OpenSim Moco, in a process of its own, for
`test_condensed_osim.py`: python press_in_moco.py FILE.osim OUT.npz.

The mount goes down a vertical rail under a drive whose force follows a smooth rise to LOAD_N within
DURATION_S. Written are the instants of the mesh (s), the mount's height (m), and the force of the
ground (N).
"""

from __future__ import annotations

import sys

import numpy as np
import opensim

LOAD_N = 800.0
DURATION_S = 0.3
ABOVE_M = 2e-3
"""The ground, at first: from there on the stations bear the foot's own weight, about."""
MESH = 25
HEIGHT = "/jointset/rail/height"
HINGES = ("/jointset/keel_1/keel_1", "/jointset/keel_2/keel_2")
DRIVE = "/forceset/drive"


def rise(share):
    """From 0 to 1, at rest at both ends."""
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def on_a_rail(file):
    """The model with a vertical rail instead of the planar joint of its mount, its drive on that,
    and the height (m) at which the sole touches."""
    model = opensim.Model(file)
    planar = model.getJointSet().get("vsf_mount")
    touching = model.getCoordinateSet().get("vsf_mount_ty").getDefaultValue()
    mount = opensim.PhysicalOffsetFrame.safeDownCast(planar.getChildFrame()).get_translation()
    mount = opensim.Vec3(mount[0], mount[1], mount[2])
    model.updJointSet().remove(planar)
    upright = opensim.Vec3(0.0, 0.0, 0.5 * np.pi)
    frame = model.getBodySet().get("vsf_frame")
    rail = opensim.SliderJoint(
        "rail", model.getGround(), opensim.Vec3(0.0), upright, frame, mount, upright
    )
    rail.updCoordinate().setName("height")
    model.addJoint(rail)
    drive = opensim.CoordinateActuator("height")
    drive.setName("drive")
    drive.setOptimalForce(LOAD_N)
    drive.setMinControl(-2.0)
    drive.setMaxControl(2.0)
    model.addForce(drive)
    model.initSystem()
    return model, touching


def study_of(model, touching):
    """The press as a problem of Moco, and its solver."""
    study = opensim.MocoStudy()
    problem = study.updProblem()
    problem.setModel(model)
    problem.setTimeBounds(0.0, DURATION_S)
    start = touching + ABOVE_M
    problem.setStateInfo(f"{HEIGHT}/value", [touching - 0.03, touching + 0.01], start)
    problem.setStateInfo(f"{HEIGHT}/speed", [-1.0, 1.0], 0.0, 0.0)
    for hinge in HINGES:
        problem.setStateInfo(f"{hinge}/value", [-0.3, 0.5], 0.0)
        problem.setStateInfo(f"{hinge}/speed", [-20.0, 20.0], 0.0, 0.0)
    table = opensim.TimeSeriesTable()
    table.setColumnLabels([DRIVE])
    for time_s in np.linspace(-0.1, DURATION_S + 0.1, 501):
        share = float(np.clip(time_s / DURATION_S, 0.0, 1.0))
        table.appendRow(float(time_s), opensim.RowVector([-rise(share)]))
    follow = opensim.MocoControlTrackingGoal("load", 1.0)
    follow.setReference(opensim.TableProcessor(table))
    problem.addGoal(follow)
    solver = study.initCasADiSolver()
    solver.set_num_mesh_intervals(MESH)
    solver.set_transcription_scheme("legendre-gauss-radau-3")
    solver.set_multibody_dynamics_mode("explicit")
    solver.set_optim_finite_difference_scheme("forward")
    solver.set_scale_variables_using_bounds(True)
    solver.set_optim_convergence_tolerance(1e-3)
    solver.set_optim_constraint_tolerance(1e-4)
    solver.set_optim_max_iterations(200)
    solver.set_optim_ipopt_print_level(0)
    solver.set_parallel(0)
    guess = solver.createGuess("bounds")
    guess.resampleWithNumTimes(MESH)
    pressed = rise(np.linspace(0.0, 1.0, MESH))
    moves = {HEIGHT: start - 8e-3 * pressed} | {hinge: 0.02 * pressed for hinge in HINGES}
    for name, values in moves.items():
        rates = np.gradient(values, DURATION_S / (MESH - 1))
        guess.setState(f"{name}/value", opensim.Vector.createFromMat(values))
        guess.setState(f"{name}/speed", opensim.Vector.createFromMat(rates))
    guess.setControl(DRIVE, opensim.Vector.createFromMat(-pressed))
    solver.setGuess(guess)
    return study


def ground_force(model, solution):
    """(n,) N, up, at the instants of the solution."""
    forces = model.getForceSet()
    forces = [forces.get(i) for i in range(forces.getSize())]
    stations = [force for force in forces if force.getConcreteClassName() == "MeyerFregly2016Force"]
    found = []
    states = solution.exportToStatesTrajectory(model)
    for i in range(states.getSize()):
        model.realizeVelocity(states.get(i))
        found.append(sum(force.getRecordValues(states.get(i)).get(1) for force in stations))
    return np.array(found)


if __name__ == "__main__":
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    model, touching = on_a_rail(sys.argv[1])
    study = study_of(model, touching)
    solution = study.solve()
    if not solution.success():
        sys.exit(solution.getStatus())
    np.savez(
        sys.argv[2],
        time_s=solution.getTimeMat(),
        height_m=solution.getStateMat(f"{HEIGHT}/value"),
        force_n=ground_force(model, solution),
    )
