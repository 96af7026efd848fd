"""The foot in a plant with a time step: springs and support where the step's own solver takes them implicitly.

A discrete MultibodyPlant takes forces on its ports, and the springs of its joints, as they are at the start of a step.
Keel pieces of some 10 g on 10^2 to 10^3 N m/rad do not survive that. Implicit are PD-controlled actuators and
constraints, so

    keel springs       PD actuators that want the keel straight, gains the joints' stiffness and damping
    carriage           PD actuator that wants the fulcrum position
    fulcrum support    a compliant distance constraint: a rod of ROD_M along z_K from the frame to the keel's point at
                       the fulcrum, with the support's stiffness and damping

The rod's far end is on the frame above the fulcrum. Its direction differs from z_K by the keel's sideways travel there
over ROD_M, so as a support it is exact to 1e-5. Its place belongs to the plant's Context, not to a port:
`place_fulcrum` moves it, and `foot_wiring.follow_fulcrum` does so in every step of a Simulator.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import DistanceConstraintParams, MultibodyPlant
from pydrake.multibody.tree import MultibodyConstraintId, PdControllerGains
from pydrake.systems.framework import Context

from vsf_drake.errors import InputError
from vsf_drake.model_file import check_fulcrum, secant_stiffness
from vsf_drake.plants.contact_geometry import REFERENCE_LOAD_N
from vsf_drake.plants.foot_handles import FootHandles, check_context

ROD_M = 10.0
"""Length of the rod that stands for the support's direction (a choice)."""
CARRIAGE_FREQUENCY = 2 * np.pi * 100.0
"""Natural frequency (rad/s) of the carriage's actuator, critically damped (a choice)."""
STABLE_STEPS = {"kelvin_voigt": 3.1, "smooth": 3.1, "hunt_crossley": 1.6}
"""Of `largest_step`, from drops of the nominal foot: smooth at 0.1 ms and 0.05 ms, ragged at 0.15 ms and 0.1 ms."""
STICKING_STEPS = {"kelvin_voigt": 8.0, "smooth": 8.0, "hunt_crossley": 4.0}
"""Of `grip_limit`, from drops of the nominal foot under 10 to 80 kg, level and on its forefoot: up to here forces are
within 3 % of their peak (root mean square) of those of a tenth of the step, at twice that up to 46 % off."""


def largest_step(foot: FootHandles) -> float:
    """The longest time step (s) at which the foot's own contact law stays stable in a discrete plant; inf without.

    Our laws act there as forces from the start of the step. The dampers must not reverse in one the speed of the keel
    piece they act on: STABLE_STEPS times the least mass over damping lets through what stayed smooth in drops of the
    nominal foot and little else. Nor may the springs: an undamped mass m on a spring k diverges beyond 2 sqrt(m / k),
    of which half is taken, k the slope of the foam's force under REFERENCE_LOAD_N on each sphere.
    """
    if foot.contact not in STABLE_STEPS:
        return np.inf
    sites, longest = foot.sites, np.inf
    on = np.array([int(body) for body in sites.body_indices])
    slope = [n * secant_stiffness(k, n, REFERENCE_LOAD_N) for k, n in zip(sites.stiffness, sites.exponent, strict=True)]
    for body in foot.keel:
        here = on == int(body.index())
        damping, stiffness, mass = np.sum(sites.damping[here]), np.sum(np.array(slope)[here]), body.default_mass()
        if damping > 0.0:
            longest = min(longest, STABLE_STEPS[foot.contact] * mass / damping)
        if stiffness > 0.0:
            longest = min(longest, np.sqrt(mass / stiffness))
    return float(longest)


def grip_limit(foot: FootHandles, time_step_s: float) -> np.ndarray:
    """(len(keel),) N s/m, the most friction per speed that each keel piece bears at `time_step_s` under our own laws.

    While the foot sticks, friction is a damper of mu_static / threshold velocity times the load on the piece. It is as
    explicit as the foam's and grows with the load, so `FootForces` looks at it while it runs.
    """
    return STICKING_STEPS[foot.contact] / time_step_s * np.array([body.default_mass() for body in foot.keel])


def check_step(time_step_s: float, foot: FootHandles) -> None:
    """Raises InputError if the foot's contact cannot be had in a plant with this time step."""
    longest = largest_step(foot)
    if time_step_s > longest:
        raise InputError(
            f"contact {foot.contact} is an explicit force in a plant with a time step, and {1e3 * time_step_s:g} ms is "
            f"too long for this foot", where="time_step",
            right=f"Take at most {1e3 * longest:.2g} ms, contact drake_point or hydroelastic, or a continuous plant")


def add_implicit_device(plant: MultibodyPlant, foot: FootHandles, fulcrum_m: float) -> MultibodyConstraintId:
    """Adds springs, carriage and support of `foot` to a plant with a time step, before Finalize.

    Returns:
        The support, which `place_fulcrum` moves.

    Raises:
        InputError: the carriage cannot reach `fulcrum_m` (m from A), or the plant's solver knows no constraints.
    """
    check_fulcrum(fulcrum_m, foot.parameters)
    for name, stiffness, damping in zip(
            foot.keel_joint_names, foot.joint_stiffness, foot.joint_damping, strict=True):
        if stiffness > 0.0:
            _actuate(plant, foot, name, stiffness, damping)
    mass = foot.parameters.fulcrum.carriage_mass_kg
    _actuate(plant, foot, foot.carriage_joint_name, mass * CARRIAGE_FREQUENCY**2, 2.0 * mass * CARRIAGE_FREQUENCY)
    plant.GetJointByName(foot.carriage_joint_name, foot.instance).set_default_translation(fulcrum_m)
    rod = _rod(foot, fulcrum_m)
    try:
        return plant.AddDistanceConstraint(
            plant.get_body(rod.bodyA()), rod.p_AP(), plant.get_body(rod.bodyB()), rod.p_BQ(), rod.distance(),
            rod.stiffness(), rod.damping())
    except RuntimeError as error:
        raise InputError(f"the plant takes no distance constraint: {error}", where="plant",
                         right="Leave its contact approximation at kLagged, Drake's default, or take kSap or kSimilar, "
                         "or a continuous plant") from None


def place_fulcrum(plant: MultibodyPlant, plant_context: Context, foot: FootHandles, fulcrum_m: float) -> None:
    """Puts the support of `foot` at `fulcrum_m` (m from A) in the plant's Context; the carriage stays where it is.

    Raises:
        InputError: the carriage cannot reach it, the plant has no time step, or the Context is not the plant's.
    """
    support, rod = support_of(foot), _rod(foot, check_fulcrum(fulcrum_m, foot.parameters))
    check_context(plant, plant_context)
    plant.SetDistanceConstraintParams(plant_context, support, rod)


def support_of(foot: FootHandles) -> MultibodyConstraintId:
    """The constraint that is the support of `foot`; raises InputError for a foot in a continuous plant."""
    if foot.support is None:
        raise InputError(f"the foot {foot.name!r} is in a continuous plant", where="foot",
                         right="There the support follows its port by itself: leave this call out")
    return foot.support


def _rod(foot: FootHandles, fulcrum_m: float) -> DistanceConstraintParams:
    piece, fulcrum = foot.keel_body_at(fulcrum_m), foot.parameters.fulcrum
    return DistanceConstraintParams(
        bodyA=foot.keel[piece].index(), p_AP=[fulcrum_m - foot.keel_starts[piece], 0.0, 0.0],
        bodyB=foot.frame.index(), p_BQ=[fulcrum_m, 0.0, ROD_M], distance=ROD_M,
        stiffness=fulcrum.stiffness_n_per_m, damping=fulcrum.stiffness_n_per_m * fulcrum.damping_time_s)


def _actuate(plant: MultibodyPlant, foot: FootHandles, joint: str, stiffness: float, damping: float) -> None:
    actuator = plant.AddJointActuator(f"{foot.name}_{joint}", plant.GetJointByName(joint, foot.instance))
    actuator.set_controller_gains(PdControllerGains(p=stiffness, d=damping))
