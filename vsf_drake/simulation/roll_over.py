"""Presses and rolls the prosthetic foot alone over level ground, by the implicit stepper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.bench import MOUNT_COORDINATES, RollOverDiagram, make_roll_over_machine
from vsf_drake.simulation.energy import energy_ledger
from vsf_drake.simulation.mechanism import coordinate_limits, fulcrum_arrays, ground_sites, keel_springs
from vsf_drake.simulation.reactions import foot_reaction
from vsf_drake.simulation.roll_over_control import (
    COARSE_STEPS,
    Following,
    follow_coarsely,
    line_of_force,
    mount_path,
    smooth_path,
)
from vsf_drake.simulation.stepping.stepper import Inputs, Mechanism, Record, Stepper
from vsf_drake.simulation.stepping.tree import tree_of

LONGEST_TRAVEL_M = 0.12
"""Travel after which a foot that does not bear the load has given way."""
LARGEST_PITCH_RAD = np.radians(60.0)


@dataclass(frozen=True, eq=False)
class RollOverRun:
    """One run of the machine over n instants (the ends of the steps), ground level and z = 0 in W.

    Attributes:
        mount: (n, 3) m, m, rad (toes up): MOUNT_COORDINATES. load: (n, 3) N, N, N m that the drive exerts along them.
        grf_W: (n, 3) N on the foot. cop_W: (n, 3) m, NaN below 20 N. sphere_normal_n: (n, spheres).
        energy: `simulation.energy.energy_ledger` (n,) J by name.
        unconverged_steps: steps that were accepted without convergence.
    """

    time_s: np.ndarray
    mount: np.ndarray
    load: np.ndarray
    grf_W: np.ndarray
    cop_W: np.ndarray
    sphere_normal_n: np.ndarray
    energy: dict[str, np.ndarray]
    unconverged_steps: int


class RollOver:
    """One machine, built once and used often.

    Args:
        parameters: the foot.
        friction: the foot's own friction with the ground, or none.
    """

    def __init__(self, parameters: FootParameters, *, friction: bool) -> None:
        self.machine = make_roll_over_machine(parameters, friction=friction)
        self.context = self.machine.diagram.CreateDefaultContext()
        self.parameters, self.friction = parameters, friction
        self._centres = self._sphere_centres()

    def touch_height(self, pitch_rad: float | np.ndarray) -> np.ndarray:
        """Height (m) of the mount's origin over the ground at which the unloaded foot touches it."""
        pitch = np.atleast_1d(np.asarray(pitch_rad, dtype=float))[:, None]
        x, z = self._centres.T
        radius = self.machine.foot.sites.radius
        return np.asarray(-(x * np.sin(pitch) + z * np.cos(pitch) - radius).min(axis=1))

    def follow(self, *, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray) -> RollOverRun:
        """Moves the mount along `mount` (n + 1, 3: MOUNT_COORDINATES) at `time_s` (n + 1,), the foot at rest at first.

        Raises:
            InputError: the fulcrum is out of reach.
            SimulationError: the run diverges.
        """
        stepper = self._stepper(fulcrum_m)
        inputs = self._inputs(stepper.mechanism, fulcrum_m, np.asarray(time_s, dtype=float), mount)
        q0 = self._start(stepper.mechanism, inputs)
        return self._pack(stepper.mechanism, stepper.run(inputs, q0, np.zeros_like(q0)), inputs)

    def press(
        self, *, fulcrum_m: float, pitch_rad: float, max_load_n: float, speed_m_per_s: float, steps_per_mm: float
    ) -> RollOverRun:
        """Lowers the pitched foot from first touch at constant speed until the vertical load is reached, and raises it.

        Raises:
            InputError: a number is out of range.
            SimulationError: the foot gives way before the load is reached, or the run diverges.
        """
        for value, where, most in ((max_load_n, "max_load_n", 5000.0), (speed_m_per_s, "speed_m_per_s", 1.0),
                                   (steps_per_mm, "steps_per_mm", 1e4)):
            if not 0.0 < value <= most:
                raise InputError(f"is {value:g}", where=where, right=f"It must be above 0 and at most {most:g}")
        if not abs(pitch_rad) <= LARGEST_PITCH_RAD:
            raise InputError(f"is {pitch_rad:g} rad", where="pitch_rad", right="It must be within 60 degrees")
        top = float(self.touch_height(pitch_rad)[0])
        steps = int(np.ceil(min(LONGEST_TRAVEL_M, top) * 1e3 * steps_per_mm))
        travel = 1e-3 / steps_per_mm * np.arange(steps + 1)
        stepper = self._stepper(fulcrum_m)
        down = self._inputs(stepper.mechanism, fulcrum_m, travel / speed_m_per_s, _lowered(top, travel, pitch_rad))
        q0 = self._start(stepper.mechanism, down)

        def reached(done: int, record: Record) -> bool:
            return record.site("normal_force")[done - 1].sum() >= max_load_n

        load = stepper.run(down, q0, np.zeros_like(q0), stop=reached).site("normal_force").sum(axis=1)
        above = np.flatnonzero(load >= max_load_n)
        if not above.size:
            raise SimulationError(
                f"the foot gave way: {load.max():.0f} N of {max_load_n:g} N after {1e3 * travel[len(load)]:.0f} mm at "
                f"{np.degrees(pitch_rad):g} degrees with the fulcrum at {1e3 * fulcrum_m:g} mm",
                time_s=float(down.time_s[len(load)]))
        count = int(above[0]) + 1
        path = np.concatenate([travel[: count + 1], travel[count - 1 :: -1]])
        moments = 1e-3 / steps_per_mm / speed_m_per_s * np.arange(2 * count + 1)
        return self.follow(fulcrum_m=fulcrum_m, time_s=moments, mount=_lowered(top, path, pitch_rad))

    def roll(
        self, *, fulcrum_m: float, time_s: np.ndarray, tilt_rad: np.ndarray, force_n: np.ndarray,
        axis_ahead_m: float = 0.0
    ) -> tuple[RollOverRun, Following]:
        """Rolls the foot: tilt and force along the fixed line are given, the mount's height is found.

        Args:
            time_s, tilt_rad, force_n: (n + 1,); the foot starts unloaded, as it touches.
            axis_ahead_m: see `roll_over_control`.

        Returns:
            The run, made anew along the heights that were found, and how well it follows the force.

        Raises:
            InputError: the fulcrum is out of reach.
            SimulationError: the run diverges.
        """
        stepper = self._stepper(fulcrum_m)
        touch = self._touch_along_line(float(tilt_rad[0]), axis_ahead_m)
        start = mount_path(tilt_rad[:1], np.array([touch]), axis_ahead_m=axis_ahead_m)
        first = self._inputs(stepper.mechanism, fulcrum_m, np.asarray(time_s[:2]), np.repeat(start, 2, axis=0))
        q0 = self._start(stepper.mechanism, first)
        coarse_s = np.linspace(time_s[0], time_s[-1], COARSE_STEPS + 1)
        coarse = follow_coarsely(
            stepper, first, q0, time_s=coarse_s, tilt_rad=np.interp(coarse_s, time_s, tilt_rad),
            force_n=np.interp(coarse_s, time_s, force_n), start_height_m=touch, axis_ahead_m=axis_ahead_m)
        line = line_of_force(-tilt_rad[1:])

        def force_along(height: np.ndarray) -> np.ndarray:
            mount = mount_path(tilt_rad, height, axis_ahead_m=axis_ahead_m)
            inputs = self._inputs(stepper.mechanism, fulcrum_m, time_s, mount)
            record = stepper.run(inputs, q0, np.zeros_like(q0))
            return np.asarray(line[:, 0] * record.site("friction_x").sum(axis=1)
                              + line[:, 2] * record.site("normal_force").sum(axis=1))

        height = smooth_path(coarse_s, coarse, time_s, force_along, force_n[1:])
        mount = mount_path(tilt_rad, height, axis_ahead_m=axis_ahead_m)
        run = self.follow(fulcrum_m=fulcrum_m, time_s=time_s, mount=mount)
        unloaded = np.array([self._touch_along_line(float(tilt), axis_ahead_m) for tilt in tilt_rad])
        return run, Following.of(run.grf_W, mount[1:], force_n[1:], height[1:], unloaded[1:])

    def _touch_along_line(self, tilt: float, axis_ahead_m: float) -> float:
        """Height (m) above T along the line of force at which the unloaded foot touches the tilted platform."""
        return float((self.touch_height(-tilt)[0] - axis_ahead_m * np.sin(tilt)) / np.cos(tilt))

    def _stepper(self, fulcrum_m: float) -> Stepper:
        check_fulcrum(fulcrum_m, self.parameters)
        stepper = Stepper(roll_over_mechanism(self.machine, self.context))
        stepper.warm_up()
        return stepper

    def _inputs(self, mechanism: Mechanism, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray) -> Inputs:
        names = (*MOUNT_COORDINATES, self.machine.foot.carriage_joint_name)
        fulcrum = np.full(len(time_s), fulcrum_m)
        return Inputs(
            time_s=time_s, prescribed=np.array([mechanism.tree.index(name) for name in names]),
            prescribed_q=np.column_stack([mount, fulcrum]), fulcrum=fulcrum, ground=np.zeros(len(time_s)))

    @staticmethod
    def _start(mechanism: Mechanism, inputs: Inputs) -> np.ndarray:
        q0 = np.zeros(mechanism.tree.num_coordinates)
        q0[inputs.prescribed] = inputs.prescribed_q[0]
        return q0

    def _pack(self, mechanism: Mechanism, record: Record, inputs: Inputs) -> RollOverRun:
        columns = inputs.prescribed[:3]
        keel = np.array([mechanism.tree.index(name) for name in self.machine.foot.keel_joint_names])
        reaction = foot_reaction(record, slice(0, None))
        return RollOverRun(
            time_s=record.time_s, mount=record.q[:, columns], load=record.load[:, columns], grf_W=reaction.grf_W,
            cop_W=reaction.cop_W, sphere_normal_n=record.site("normal_force"),
            energy=energy_ledger(mechanism, record, keel=keel, driven=inputs.prescribed, fulcrum_m=inputs.fulcrum),
            unconverged_steps=int(np.sum(~record.converged)))

    def _sphere_centres(self) -> np.ndarray:
        """(N, 2) forward and up of the spheres' centres in the mount's frame, the keel straight."""
        sites, plant = self.machine.foot.sites, self.machine.plant
        context = plant.CreateDefaultContext()
        centres = [plant.get_body(body).EvalPoseInWorld(context) @ p
                   for body, p in zip(sites.body_indices, sites.p_BS, strict=True)]
        return np.array(centres)[:, [0, 2]]


def _lowered(top: float, travel: np.ndarray, pitch: float) -> np.ndarray:
    """(n, 3) the mount at one pitch, lowered by `travel` from the height `top`."""
    return np.column_stack([np.zeros_like(travel), top - travel, np.full_like(travel, pitch)])


# Reads a roll-over machine and its Context into the arrays of a `Mechanism`.


def roll_over_mechanism(machine: RollOverDiagram, context: Context) -> Mechanism:
    """The machine with the parameters in `context` (the diagram's)."""
    plant, foot = machine.plant, machine.foot
    own = plant.GetMyContextFromRoot(context)
    springs, index = keel_springs(plant, foot, machine.device, context)
    return Mechanism(
        plant=plant, context=own, tree=tree_of(plant, own), sites=ground_sites(machine.ground, context),
        site_bodies=np.array([int(body) for body in foot.sites.body_indices], dtype=np.int64), ground_height=0.0,
        springs=springs, spring_index=index, **fulcrum_arrays(plant, foot, machine.device, context),
        limits=coordinate_limits(plant.num_velocities(), keel=index))
