"""The implicit stepper as a system of Drake's: a person or a leg in diagrams that learn, control
and draw."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector_, Context, Diagram, DiscreteValues

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.laws.contact_law import LAW_COLUMNS
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.foot_handles import FULCRUM_M
from vsf_drake.plants.foot_wiring import WiredFoot
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation.mechanism import gait_mechanism, leg_mechanism
from vsf_drake.simulation.options import MAX_STEP_MS
from vsf_drake.simulation.reactions import FootReaction
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SPRING_COLUMNS
from vsf_drake.simulation.stepping.period import Period
from vsf_drake.simulation.stepping.runs import Inputs, Mechanism, Run, Torques
from vsf_drake.simulation.stepping.stepper import settle_side_by_side
from vsf_drake.systems._system import System, system_template

PERIOD_S, STEP_S = 0.01, 0.001
"""Of a stepped system: how often it takes inputs, and the stepper's steps in between (choices)."""
INPUTS = ("torques", "desired_positions", "fulcrum_position")
TORQUES, POSITIONS, FULCRUM = range(len(INPUTS))
OF_FOOT = {"grf": 3, "cop": 3, "free_moment": 1}


@system_template()
class SteppedPlant(System):
    """A plant with a foot, advanced by the implicit stepper instead of Drake's integrators: one
    discrete update a period, several steps of the stepper in it. `make_stepped_leg` and
    `make_stepped_person` make it.

    At t = k period the inputs are read, and the state becomes that at t + period. Everything that a
    period begins with is in the Context: a copy of it goes on as the original does, to the bit, a
    Context that is set back repeats itself, and threads may each have theirs. There are no
    derivatives: what is converted to AutoDiffXd refuses to advance.

    Inputs: torques (c,) N m or N on the coordinates `free`, held over the period, by default 0;
    desired_positions (p,) rad or m, where the coordinates `prescribed` are at the END of the
    period, by default where they are; fulcrum_position (1,) m from A, where the fulcrum is at the
    end, by default the parameter fulcrum_m. Each may stay unconnected, and what is prescribed moves
    at a constant speed.

    Outputs: state (2 n,), [q; v] of the plant; grf (3,) N in W, on the foot; cop (3,) m in W, 0
    without load; free_moment (1,) N m about the vertical, on the foot; driver_force (n,) N or N m,
    what the prescribed coordinates take; support_force (1,) N of the fulcrum on the keel;
    unconverged_steps (1,), how many since the Context was made. Forces are those of the last step
    of the period, and 0 before the first one. A person has intact_grf, intact_cop and
    intact_free_moment too, after free_moment.

    Args:
        mechanism: the plant and the forces on it.
        prescribed, free: names of coordinates, in the order of the inputs.
        carriage: the coordinate of the fulcrum's carriage.
        fulcrum_m: m from A.
        positions: (n,) of the plant at first; the carriage is put at fulcrum_m.
        constant_torques: (c,) on `free`, beside the input.
        feet: what is before the names of the outputs of each foot.
        period_s, step_s: s, the first a whole multiple of the second.

    Parameters in the Context: of the S spheres, (S,), stiffness, exponent, damping,
    full_damping_depth, mu_static, mu_kinetic, threshold_velocity, dissipation, depth_width,
    rate_width; joint_stiffness, joint_damping (m,) of the keel; fulcrum_stiffness, fulcrum_damping;
    fulcrum_m. See `FootForces`.

    Raises:
        InputError: period and step do not fit.
        SimulationError: (when advanced) a coordinate diverges.
    """

    def __init__(
        self,
        *,
        mechanism: Mechanism,
        prescribed: Sequence[str],
        free: Sequence[str],
        carriage: int,
        fulcrum_m: float,
        positions: np.ndarray,
        constant_torques: np.ndarray,
        feet: Sequence[str] = ("",),
        period_s: float = PERIOD_S,
        step_s: float = STEP_S,
    ) -> None:
        self._steps = _steps(period_s, step_s)
        self.mechanism = mechanism
        self.prescribed = tuple(prescribed)
        self.free = tuple(free)
        self.period_s = float(period_s)
        self._grid = (period_s / self._steps) * np.arange(self._steps + 1)
        names = mechanism.tree.coordinate_names
        at = [*(names.index(name) for name in self.prescribed), carriage]
        self._prescribed = np.array(at, dtype=np.int64)
        self._free = np.array([names.index(name) for name in self.free], dtype=np.int64)
        self._constant_torques = np.array(constant_torques, dtype=float)
        self._keel = len(mechanism.keel_coordinates)
        n = len(names)
        start = np.zeros(2 * n)
        start[:n] = positions
        start[carriage] = fulcrum_m
        self.DeclareDiscreteState(BasicVector_[self._T](start))
        self._feet = tuple(feet)
        self.DeclareDiscreteState(BasicVector_[self._T](np.zeros(6 * len(self._feet) + n + 2)))
        sizes = len(self._free), len(self.prescribed), 1
        self._declare_inputs(**dict(zip(INPUTS, sizes, strict=True)))
        spheres = dict(zip(SITE_COLUMNS, mechanism.sites.T, strict=True))
        springs = dict(zip(SPRING_COLUMNS, mechanism.springs[: self._keel].T, strict=True))
        self._declare_parameters(
            **{name: (spheres[name], (len(mechanism.sites),)) for name in LAW_COLUMNS},
            **{
                f"joint_{name}": (springs[name], (self._keel,)) for name in ("stiffness", "damping")
            },
            fulcrum_stiffness=(mechanism.fulcrum[0], ()),
            fulcrum_damping=(mechanism.fulcrum[1], ()),
            fulcrum_m=(fulcrum_m, ()),
        )
        self._work = self._declare_cached("work", self._prepare, self.all_parameters_ticket())
        state = self.xd_ticket()
        self._declare_output("state", 2 * n, self._state, state)
        ground = self._declare_cached("ground", self._ground, state)
        for prefix in self._feet:
            for name, size in OF_FOOT.items():
                self._declare_part(f"{prefix}{name}", size, ground, f"{prefix}{name}", state)
        loads = 6 * len(self._feet)
        for name, part in (
            ("driver_force", slice(loads, loads + n)),
            ("support_force", slice(loads + n, loads + n + 1)),
            ("unconverged_steps", slice(loads + n + 1, loads + n + 2)),
        ):
            self._declare_part(name, part.stop - part.start, _last, part, state)
        self._declare_periodic(self.period_s, self._advance if self._T is float else self._refuse)

    def SetStart(
        self,
        context: Context,
        positions: Mapping[str, float],
        velocities: Mapping[str, float] | None = None,
    ) -> None:
        """Puts the coordinates named in `positions` there, at `velocities` (rad, m, s; 0 by
        default), and everything else, as keel and socket, at rest with those held, the fulcrum at
        fulcrum_m.

        Raises:
            InputError: there is no such coordinate, or one has a velocity and no position.
            SimulationError: there is no rest.
        """
        names = self.mechanism.tree.coordinate_names
        velocities = velocities or {}
        carriage = int(self._prescribed[-1])
        known = [name for name in names if name != names[carriage]]
        for where, named, there in (
            ("positions", positions, known),
            ("velocities", velocities, positions),
        ):
            for name in named:
                require(
                    name in there,
                    f"there is no coordinate {name!r}",
                    where,
                    f"There are {', '.join(there)}",
                )
        n = len(names)
        fulcrum_m = float(self._constants(context)["fulcrum_m"])
        held = np.array([*(names.index(name) for name in positions), carriage], dtype=np.int64)
        guess = context.get_discrete_state(0).CopyToVector()
        guess[n:] = 0.0
        guess[held] = [*positions.values(), fulcrum_m]
        mechanism = self._mechanism(context)
        inputs = Inputs(
            time_s=self._grid,
            prescribed=held,
            prescribed_q=guess[None, held],
            fulcrum=np.full(2, fulcrum_m),
            ground=np.full(2, mechanism.ground_height),
        )
        [rest] = settle_side_by_side([Run(mechanism, inputs, guess[:n], guess[n:])])
        if isinstance(rest, SimulationError):
            raise rest
        guess[:n] = rest[0]
        for name, value in velocities.items():
            guess[n + names.index(name)] = value
        context.SetDiscreteState(0, guess)

    def _mechanism(self, context: Context) -> Mechanism:
        """With the parameters of the Context."""
        constants = self._constants(context)
        sites = self.mechanism.sites.copy()
        springs = self.mechanism.springs.copy()
        for name in LAW_COLUMNS:
            sites[:, SITE_COLUMNS.index(name)] = constants[name]
        for name in ("stiffness", "damping"):
            springs[: self._keel, SPRING_COLUMNS.index(name)] = constants[f"joint_{name}"]
        springs[: self._keel, SPRING_COLUMNS.index("stiffness_negative")] = constants[
            "joint_stiffness"
        ]
        fulcrum = np.array([constants["fulcrum_stiffness"], constants["fulcrum_damping"]])
        return dataclasses.replace(self.mechanism, sites=sites, springs=springs, fulcrum=fulcrum)

    def _prepare(self, context: Context) -> tuple[Period, np.ndarray, np.ndarray]:
        """The stepper's arrays for this Context, where the prescribed coordinates go if nothing is
        connected, and the torques then."""
        steps = self._steps
        mechanism = self._mechanism(context)
        nothing = np.zeros(mechanism.tree.num_coordinates)
        torques = Torques(
            coordinates=self._free,
            sensed=np.zeros(0, dtype=np.int64),
            feedforward=np.tile(self._constant_torques, (steps, 1)),
            feedback=np.zeros((steps, len(self._free), 0)),
            reference=np.zeros((steps, 0)),
        )
        inputs = Inputs(
            time_s=self._grid,
            prescribed=self._prescribed,
            prescribed_q=np.zeros((steps + 1, len(self._prescribed))),
            fulcrum=np.zeros(steps + 1),
            ground=np.full(steps + 1, mechanism.ground_height),
            torques=torques,
        )
        ends = np.full(len(self._prescribed), np.nan)
        ends[-1] = self._constants(context)["fulcrum_m"]
        period = Period(Run(mechanism, inputs, nothing, nothing))
        return period, ends, self._constant_torques.copy()

    def _advance(self, context: Context, discrete: DiscreteValues) -> None:
        period, ends, torques = self._work(context)
        given = self.EvalVectorInput(context, TORQUES)
        if given is not None:
            torques[:] = given.value()
            torques += self._constant_torques
        given = self.EvalVectorInput(context, POSITIONS)
        if given is not None:
            ends[:-1] = given.value()
        given = self.EvalVectorInput(context, FULCRUM)
        if given is not None:
            ends[-1] = self._fulcrum_place(context)

        # what is to be changed begins as it is in the Context
        x = discrete.get_mutable_value(0)
        if not period(x, ends, torques, discrete.get_mutable_value(1)):
            error = period.block.outcome(0)
            assert isinstance(error, SimulationError)
            raise SimulationError(error.what, time_s=context.get_time() + error.time_s)

    def _refuse(self, context: Context, discrete: DiscreteValues) -> None:
        raise InputError(
            "has no derivatives",
            where=self.get_name(),
            right="For AutoDiffXd take the plant with wire_foot, under Drake's own integrators",
        )

    def _state(self, context: Context) -> np.ndarray:
        return context.get_discrete_state(0).CopyToVector()

    def _ground(self, context: Context) -> dict[str, np.ndarray]:
        outputs = {}
        wrenches = _last(context)[: 6 * len(self._feet)].reshape(-1, 1, 6)
        for prefix, wrench in zip(self._feet, wrenches, strict=True):
            reaction = FootReaction(
                grf_W=wrench[:, 3:],
                moment_W=wrench[:, :3],
                ground_height=self.mechanism.ground_height,
            )
            outputs[f"{prefix}grf"] = reaction.grf_W[0]
            outputs[f"{prefix}cop"] = np.nan_to_num(reaction.cop_W[0])
            outputs[f"{prefix}free_moment"] = reaction.free_moment_nm
        return outputs


SteppedPlant_ = SteppedPlant.template


def _last(context: Context) -> np.ndarray:
    """What the last step has left but for the state."""
    return context.get_discrete_state(1).CopyToVector()


def _steps(period_s: float, step_s: float) -> int:
    """How many steps a period has."""
    require(
        0.0 < step_s <= 1e-3 * MAX_STEP_MS,
        f"{step_s:g} s is not a usable step",
        "step_s",
        f"It must be above 0 and at most {1e-3 * MAX_STEP_MS:g} s",
    )
    steps = round(period_s / step_s) if period_s < np.inf else 0
    require(
        steps >= 1 and abs(period_s - steps * step_s) <= 1e-9 * period_s,
        f"{period_s:g} s is no whole multiple of the step of {step_s:g} s",
        "period_s",
        "Give both in seconds, as period_s=0.01, step_s=0.001",
    )
    return steps


def make_stepped_leg(
    diagram: Diagram,
    wired: WiredFoot,
    *,
    prescribed: Sequence[str] = (),
    period_s: float = PERIOD_S,
    step_s: float = STEP_S,
) -> SteppedPlant:
    """The plant with the foot that `wire_foot` wired in `diagram`, as one discrete system.

    It is made of what the default Context of `diagram` holds: bodies, joints and their default
    positions, gravity, joint damping, springs in joints, the foot, its contact and the level ground
    under it. What else is connected to the plant there has no part in it: torques come in by the
    system's own port. `diagram` stays as it is.

    Args:
        diagram: finished, with a continuous plant of revolute, prismatic and welded joints.
        wired: what `wire_foot` returned, the only foot that touches the ground.
        prescribed: names of joints that `desired_positions` leads; the others, the foot's own left
            out, are `free`.
        period_s, step_s: s; the first a whole multiple of the second.

    Raises:
        InputError: no such joint, or the plant or foot has what the stepper does not know.
    """
    foot = wired.foot
    plant = foot.frame.GetParentPlant()  # type: ignore[no-untyped-call]
    context = diagram.CreateDefaultContext()
    mechanism, constant = leg_mechanism(plant, wired, context)
    own = [plant.get_joint(i).name() for i in plant.GetJointIndices(foot.instance)]
    names = [name for name in mechanism.tree.coordinate_names if name not in own]
    require(
        not isinstance(prescribed, str) and set(prescribed) <= set(names),
        f"{prescribed!r} are not names of joints outside the foot",
        "prescribed",
        f"There are {', '.join(names)}",
    )
    free = [name for name in names if name not in prescribed]
    return SteppedPlant(
        mechanism=mechanism,
        prescribed=prescribed,
        free=free,
        carriage=foot.carriage_joint(plant).velocity_start(),
        fulcrum_m=float(
            wired.forces.GetParameter(wired.forces.GetMyContextFromRoot(context), "fulcrum_m")
        ),
        positions=plant.GetPositions(plant.GetMyContextFromRoot(context)),
        constant_torques=constant[[mechanism.tree.index(name) for name in free]],
        period_s=period_s,
        step_s=step_s,
    )


def make_stepped_person(
    subject: Subject,
    model: ModelParameters,
    *,
    free: Sequence[str] = (),
    fulcrum_m: float = FULCRUM_M,
    period_s: float = PERIOD_S,
    step_s: float = STEP_S,
) -> SteppedPlant:
    """The person of `plants.gait.make_gait` on the plane z = 0, as one discrete system.

    Put it at a start, as `SetStart(context, positions)` does: with all coordinates at 0 the pelvis
    is at the ground.

    Args:
        free: anatomical coordinates that are not prescribed but move under the torques on them.
        fulcrum_m: m from A, where no `fulcrum_position` is connected.
        period_s, step_s: s; the first a whole multiple of the second.

    Raises:
        InputError: a number is out of range.
        ValueError: no such coordinate in `free`.
    """
    gait = make_gait(subject, model, free=free)
    foot = gait.person.foot
    mechanism = gait_mechanism(gait, gait.diagram.CreateDefaultContext())
    return SteppedPlant(
        mechanism=mechanism,
        prescribed=gait.prescribed,
        free=free,
        carriage=foot.carriage_joint(gait.plant).velocity_start(),
        fulcrum_m=check_fulcrum(fulcrum_m, model.foot),
        positions=np.zeros(mechanism.tree.num_coordinates),
        constant_torques=np.zeros(len(free)),
        feet=("", "intact_"),
        period_s=period_s,
        step_s=step_s,
    )
