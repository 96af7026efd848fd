"""Walks a person along a recorded motion by the implicit stepper."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import check, to_plain
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import (
    FOAM_LOADS_N,
    check_fulcrum,
    check_model,
    foam_under_load,
    secant_stiffness,
)
from vsf_drake.model.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation import reactions
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.mechanism import edited, gait_mechanism, supported_over, tangents_of
from vsf_drake.simulation.options import MAX_STEP_MS, StepOptions
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SITE_RECORD, SPRING_COLUMNS
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.sensitivity import ForwardSensitivity, rest_sensitivity
from vsf_drake.simulation.stepping.stepper import (
    ALONE,
    WITH_SENSITIVITIES,
    Inputs,
    Mechanism,
    Record,
    Stepper,
)
from vsf_drake.simulation.variables import (
    OFFSETS,
    MotionPerturbation,
    added,
    check_names,
    check_number,
    check_values,
    gait_variables,
    perturbation_variables,
)

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial


DEFAULT_STEP_S = 1e-3 * StepOptions.step_ms
MOST_BYTES = 1e9  # of memory that a walk with its recording may take


class Walker:
    """A subject with a prosthesis on the ground: built once, walked often.

    Parameters live in `context` (the diagram's): change them there between runs. A walk sets the
    foot's mount in it, under a lock: threads may share a walker as long as none of them changes the
    Context.

    `free` are anatomical coordinates that are not prescribed. `variables` are the numbers that
    `walk` takes by name (`values`), with units, bounds and what they were at first; one that is
    named replaces what the Context holds. InputError if a parameter is out of range or the segments
    do not fit.
    """

    def __init__(
        self, subject: Subject, model: ModelParameters, *, free: Sequence[str] = ()
    ) -> None:
        check(subject)
        check_model(model)
        self.subject = subject
        self.model = model
        self.gait = make_gait(subject, model, free=free)
        self.context = self.gait.diagram.CreateDefaultContext()
        self.free = tuple(free)
        self._reading = threading.Lock()
        self.variables = gait_variables(self.gait, gait_mechanism(self.gait, self.context))

    def walk(
        self,
        trajectory: CoordinateTrajectory,
        *,
        fulcrum_m: float | Callable[[np.ndarray], np.ndarray],
        start_s: float,
        end_s: float,
        step_s: float = DEFAULT_STEP_S,
        offsets: GeometricOffsets | None = None,
        perturbations: Sequence[MotionPerturbation] = (),
        values: Mapping[str, float] | None = None,
        with_respect_to: Sequence[str] = (),
        with_loads: bool = False,
        support_width_m: float = 0.0,
        initial: dict[str, float] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Walk:
        """Follows `trajectory` from `start_s` to `end_s` in steps of `step_s`.

        The run begins in the pose and with the velocities of `start_s`; socket and keel are at
        rest.

        Args:
            trajectory: must hold every prescribed coordinate (rad, m).
            fulcrum_m: from A (m), constant or a function of time (s, array to array).
            support_width_m: on either side of a keel joint over which the support passes from one
                rigid piece of the keel to the next, so that derivatives by `fulcrum.shift` are
                continuous too; 0 at the joint itself.
            perturbations: what changes prescribed coordinates with time; each is a variable,
                "perturbation.NAME".
            values: of `variables` and perturbations, for this walk only; what is not named stays as
                the Context has it.
            with_respect_to: variables by which the prosthetic foot's reaction is differentiated,
                exactly if the start is at rest. One costs as much as a walk, each further one a few
                percent of that.
            with_loads: whether loads of joints and socket and the state are differentiated too
                (`load_sensitivity`); not by `coordinate` and `perturbation` variables.
            initial: free coordinates that shall settle before the start, by name, with a first
                guess; others start as the trajectory says, with its velocity.
            progress: called with the finished fraction.

        Raises:
            InputError: a number is out of range, or the trajectory lacks a coordinate or the time.
            SimulationError: the run diverges.
        """
        started = time.perf_counter()
        moments, step_s = walk_grid(start_s, end_s, step_s)
        offsets = check_offsets(offsets)
        names = self.gait.prescribed
        variables = self.variables | perturbation_variables(perturbations, names, moments)
        values = check_values(values, variables)
        with_respect_to = check_names(with_respect_to, variables, where="with_respect_to")
        for name in with_respect_to:
            if with_loads and variables[name].by_unit.coordinate is not None:
                raise InputError(
                    f"loads are not differentiated by {name}: it moves a prescribed coordinate",
                    where="with_respect_to",
                    right="Leave it out, or walk without with_loads",
                )
        geometry, slide, shift, perturbation, perturbation_rate = added(
            variables, values, names, len(moments)
        )
        fulcrum = slide + fulcrum_on_grid(fulcrum_m, moments)
        for position in (fulcrum.min(), fulcrum.max()):
            check_fulcrum(float(position), self.model.foot)
        with self._reading:
            own = mount_of(offsets)
            set_mount(
                self.gait.plant_context(self.context),
                self.gait.person.foot,
                **{name: own[name] + more for name, more in zip(OFFSETS, geometry, strict=True)},
            )
            mechanism = edited(gait_mechanism(self.gait, self.context), variables, values)
        tangents = tangents_of(mechanism, (variables[name].by_unit for name in with_respect_to))
        trajectory.sample(moments[[0, -1]])  # a window outside the recording is told as that
        _check_memory(
            moments,
            bytes_a_step(mechanism, by=len(tangents), loads=with_loads),
            len(trajectory.time_s),
        )
        stepper = Stepper(supported_over(mechanism, support_width_m))
        mechanism = stepper.mechanism
        tree = mechanism.tree
        q = trajectory.ordered(names).sample(moments)[0] + shift + perturbation
        inputs = Inputs(
            time_s=moments,
            prescribed=np.array([tree.index(name) for name in (*names, "fulcrum")]),
            prescribed_q=np.column_stack([q, fulcrum]),
            fulcrum=np.array(fulcrum),
            ground=np.full(len(moments), mechanism.ground_height),
        )
        compile_s = stepper.warm_up(WITH_SENSITIVITIES if tangents else ALONE)
        q0, v0, rest_speed, by = self._start(
            stepper, inputs, trajectory, initial or {}, perturbation_rate, tangents
        )
        count = len(self.gait.person.foot.sites.radius)
        measured = np.arange(len(mechanism.sites)) < count
        forward = None
        if tangents:
            forward = ForwardSensitivity(
                tangents=tangents, measured=measured, q0=by, loads=with_loads
            )
        record = stepper.run(inputs, q0, v0, forward=forward, progress=progress)
        prosthetic, intact = (
            reactions.foot_reaction(record, foot, mechanism.ground_height)
            for foot in (reactions.PROSTHETIC, reactions.INTACT)
        )
        return Walk(
            mechanism=mechanism,
            record=record,
            prosthetic=prosthetic,
            intact=intact,
            sensitivity=reactions.reaction_sensitivity(record, prosthetic, with_respect_to)
            if tangents
            else None,
            load_sensitivity=reactions.load_sensitivity(
                mechanism, record, with_respect_to, tangents
            )
            if tangents and with_loads
            else None,
            commanded=q[1:],
            fulcrum_m=np.array(fulcrum),
            values=values,
            step_s=step_s,
            perturbations={f"perturbation.{item.name}": item.coordinate for item in perturbations},
            wall_s=time.perf_counter() - started - compile_s,
            compile_s=compile_s,
            rest_speed=rest_speed,
        )

    def _start(
        self,
        stepper: Stepper,
        inputs: Inputs,
        trajectory: CoordinateTrajectory,
        initial: Mapping[str, float],
        rate: np.ndarray,
        tangents: tuple[ParameterTangent, ...],
    ) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
        """q0, v0 (coordinates,) at the start of `inputs`, the largest speed that was taken for
        rest, and dq0 (n, P).

        Prescribed coordinates, and free ones that the recording knows, have its position and
        velocity, and the `rate` (prescribed,) of perturbations. Everything else (socket, keel, the
        free ones in `initial`) settles with those held.
        """
        tree = stepper.mechanism.tree
        prescribed = self.gait.prescribed
        for name in initial:
            if name not in self.free:
                raise InputError(
                    "is not a free coordinate",
                    where=f"initial[{name!r}]",
                    right=f"Free are: {', '.join(self.free)}",
                )
        recorded = [name for name in self.free if name not in initial]
        unknown = [name for name in recorded if name not in trajectory.names]
        if unknown:
            raise InputError(
                f"the free coordinate {unknown[0]} has no start",
                where="initial",
                right="Give it there, or a recording that holds it",
            )
        known = [*prescribed, *recorded]
        q, v, _ = trajectory.ordered(known).sample(float(inputs.time_s[0]))
        rows = np.array([tree.index(name) for name in known], dtype=np.int64)
        held = dataclasses.replace(
            inputs,
            prescribed=np.concatenate([inputs.prescribed, rows[len(prescribed) :]]),
            prescribed_q=np.concatenate([inputs.prescribed_q[0], q[0, len(prescribed) :]])[None, :],
        )
        q0 = np.zeros(tree.num_coordinates)
        q0[held.prescribed] = held.prescribed_q[0]
        for name, value in initial.items():
            q0[tree.index(name)] = value
        q0, rest_speed = stepper.settle(held, q0)
        v0 = np.zeros_like(q0)
        v0[rows] = v[0]
        v0[rows[: len(prescribed)]] += rate
        by = (
            rest_sensitivity(
                tree,
                stepper.mechanism.forces,
                held.prescribed,
                q0,
                tangents,
                fulcrum=float(inputs.fulcrum[0]),
                ground=float(inputs.ground[0]),
            )
            if tangents
            else np.zeros((len(q0), 0))
        )
        return q0, v0, rest_speed, by

    def walk_trial(self, trial: Trial, **changes: Any) -> Walk:
        """`walk` of a recorded trial, as its manifest says but for `changes`."""
        recorded: dict[str, Any] = {
            "fulcrum_m": trial.fulcrum_m,
            "start_s": trial.start_s,
            "end_s": trial.end_s,
            "offsets": trial.offsets,
        }
        return self.walk(trial.trajectory, **recorded | changes)

    def result(
        self, walk: Walk, trial: Trial, offsets: GeometricOffsets, *, energy: bool = True
    ) -> WalkResult:
        """Packs a run with all that it takes to understand and repeat it; the energy ledger takes
        as long as the run.
        """
        record = walk.record
        tree = walk.mechanism.tree
        sites = self.gait.person.foot.sites
        count = len(sites.radius)
        prescribed = np.isin(tree.coordinate_names, self.gait.prescribed)
        ledger = self.energies(walk) if energy else {}
        counts = record.counts()
        used = {  # contact, springs and support as the run used them, whatever the model file says
            "site_columns": list(SITE_COLUMNS),
            "sites": walk.mechanism.sites.tolist(),
            "spring_columns": list(SPRING_COLUMNS),
            "springs": walk.mechanism.springs.tolist(),
            "fulcrum_stiffness_and_damping": walk.mechanism.fulcrum.tolist(),
            "support_width_m": walk.mechanism.support_width,
        }
        friction = np.stack([record.site("friction_x"), record.site("friction_y")], axis=2)
        return WalkResult(
            time_s=record.time_s,
            coordinate_names=tree.coordinate_names,
            q=record.q,
            v=record.v,
            generalized_force=np.where(prescribed, record.load, 0.0),
            grf_W=walk.prosthetic.grf_W,
            cop_W=walk.prosthetic.cop_W,
            free_moment_nm=walk.prosthetic.free_moment_nm,
            intact_grf_W=walk.intact.grf_W,
            intact_cop_W=walk.intact.cop_W,
            sphere_normal_n=record.site("normal_force")[:, :count].copy(),
            sphere_depth_m=np.maximum(record.site("depth")[:, :count], 0.0),
            sphere_friction_W=friction[:, :count],
            socket_wrench=walk.socket_wrench,
            fulcrum_m=walk.fulcrum_m[1:],
            prescribed_q=walk.commanded,
            prescribed_names=self.gait.prescribed,
            energy_names=tuple(ledger),
            energy_j=np.stack([*ledger.values()], axis=1)
            if ledger
            else np.zeros((len(record.time_s), 0)),
            sphere_zones=tuple(sites.zone_names[i] for i in sites.zone),
            **counts,
            converged=counts["unconverged_steps"] == 0,
            simulated_s=float(record.time_s[-1] - record.time_s[0] + walk.step_s),
            wall_s=walk.wall_s,
            compile_s=walk.compile_s,
            step_s=walk.step_s,
            subject_mass_kg=self.subject.mass_kg,
            foot_length_m=self.model.foot.length_m,
            side=self.subject.prosthetic_side,
            trial_name=trial.name,
            synthetic=trial.synthetic,
            parameters={
                "subject": to_plain(self.subject),
                "model": to_plain(self.model),
                "offsets": to_plain(offsets),
                "values": dict(walk.values),
                "perturbations": dict(walk.perturbations),
                "fulcrum_m": [float(walk.fulcrum_m.min()), float(walk.fulcrum_m.max())],
                "stepper": used,
            },
            provenance=provenance(trial.inputs),
            notes=(*trial.notes, *walk_notes(walk, self.subject, self.model)),
        )

    def energies(self, walk: Walk) -> dict[str, np.ndarray]:
        """The terms of `reactions.energy_ledger` of a walk, each (n,) J."""
        driven = [walk.mechanism.tree.index(name) for name in (*self.gait.prescribed, "fulcrum")]
        return reactions.energy_ledger(
            walk.mechanism, walk.record, driven=np.array(driven), fulcrum_m=walk.fulcrum_m
        )


def bytes_a_step(mechanism: Mechanism, *, by: int = 0, loads: bool = False) -> float:
    """What a step takes, at most: 2.2 times its record, as was measured, and `by` derivatives (of
    loads too)."""
    n = len(mechanism.tree.coordinate_names)
    sites = len(mechanism.sites)
    return 8.0 * (2.2 * (3 * n + len(SITE_RECORD) * sites) + by * (6 + 3 * n * loads))


def _check_memory(moments: np.ndarray, step_bytes: float, rows: int) -> None:
    """InputError for a walk that would take more than MOST_BYTES."""
    # Measured on walks of 10 and 60 s and on a recording of ten minutes: 0.41 GB for the programs,
    # 2.5 kB for each row.
    left = MOST_BYTES - 4.1e8 - 2.5e3 * rows
    taken = len(moments) * step_bytes
    step_s = moments[1] - moments[0]
    if taken > left:
        raise InputError(
            f"{moments[-1] - moments[0]:.0f} s in steps of {1e3 * step_s:g} ms would take "
            f"{1e-9 * (MOST_BYTES - left + taken):.1f} GB of memory, more than "
            f"{1e-9 * MOST_BYTES:g} GB",
            where="window",
            right=(
                f"Choose at most {left / step_bytes * step_s:.0f} s of this recording, a part at a "
                "time"
            )
            if left > 0.0
            else f"Its files have {rows} rows, which take all of it: cut them into shorter ones",
        )


def simulate_trial(
    trial: Trial,
    *,
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray] | None = None,
    step_s: float = DEFAULT_STEP_S,
    offsets: GeometricOffsets | None = None,
    progress: Callable[[float], None] | None = None,
) -> WalkResult:
    """Simulates a recorded trial, with `fulcrum_m` (as `Walker.walk` takes it) and `offsets`
    instead of the manifest's: the person follows the recording, the prosthesis and the ground
    respond. Raises what `Walker.walk` does."""
    walker = Walker(trial.subject, trial.model)
    offsets = offsets or trial.offsets
    walk = walker.walk_trial(
        trial,
        fulcrum_m=trial.fulcrum_m if fulcrum_m is None else fulcrum_m,
        step_s=step_s,
        offsets=offsets,
        progress=progress,
    )
    return walker.result(walk, trial, offsets)


# One run of a walking person, as the stepper left it.


@dataclass(frozen=True)
class Walk:
    """One run of a `Walker`, before it is packed as a result."""

    mechanism: Mechanism
    record: Record
    prosthetic: reactions.FootReaction
    intact: reactions.FootReaction
    sensitivity: reactions.ReactionSensitivity | None
    """Of `prosthetic` to the variables that the walk was asked for; None if to none."""
    commanded: np.ndarray  # (n, prescribed) the motion at the ends of the steps
    fulcrum_m: np.ndarray  # (n + 1,) from A, start included
    values: Mapping[str, float]  # of the variables that were asked for
    perturbations: Mapping[str, str]  # the coordinate that each perturbation changed, by variable
    step_s: float
    wall_s: float
    compile_s: float
    rest_speed: float
    """largest speed (m/s, rad/s) left in the free coordinates when they were taken to be at rest"""
    load_sensitivity: reactions.LoadSensitivity | None = None
    """Of `record.load`, the socket's wrench and the state to those variables; None unless asked
    for."""

    @property
    def socket_wrench(self) -> np.ndarray:
        """(n, 6) force (N) and moment (N m) of the bushing on the socket, by its axes, at the ends
        of the steps."""
        return reactions.socket_wrench(self.mechanism, self.record)


# The instants of a walk's steps, and what a caller gives on them.


MAX_STEP_S = 1e-3 * MAX_STEP_MS
MOST_STEPS = 10_000_000  # longer walks are mistakes in a unit


def walk_grid(start_s: float, end_s: float, step_s: float) -> tuple[np.ndarray, float]:
    """The n + 1 instants (s) from `start_s` to `end_s`, and the step (s) as a float; InputError if
    there are none."""
    start_s, end_s, step_s = (
        check_number(value, where)
        for value, where in ((start_s, "start_s"), (end_s, "end_s"), (step_s, "step_s"))
    )
    if not 0.0 < step_s <= MAX_STEP_S:
        raise InputError(
            f"{step_s:g} s is not a usable step",
            where="step_s",
            right=f"It must be above 0 and at most {MAX_STEP_S:g} s",
        )
    if not 0.0 < end_s - start_s <= MOST_STEPS * step_s:
        raise InputError(
            f"{start_s:g} to {end_s:g} s in steps of {step_s:g} s is no time to walk",
            where="start_s, end_s, step_s",
            right=f"It must end after it starts, and have at most {MOST_STEPS:,} steps",
        )
    steps = max(1, round((end_s - start_s) / step_s))
    moments = start_s + step_s * np.arange(steps + 1)
    moments[-1] = min(moments[-1], end_s)
    return moments, step_s


def check_offsets(offsets: GeometricOffsets | None) -> GeometricOffsets:
    """The offsets, none for None; InputError unless they can be those of a prosthesis."""
    offsets = GeometricOffsets() if offsets is None else offsets
    if not isinstance(offsets, GeometricOffsets):
        raise InputError(f"is a {type(offsets).__name__}, no GeometricOffsets", where="offsets")
    check(offsets)
    return offsets


def fulcrum_on_grid(
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray], moments: np.ndarray
) -> np.ndarray:
    """Positions (n,) at the moments (n,)."""
    right = "Give a finite number (m), or a function with one for each time"
    try:
        given = np.asarray(fulcrum_m(moments.copy()) if callable(fulcrum_m) else fulcrum_m)
    except Exception as error:  # the caller's function can raise anything
        raise InputError(
            f"the function raises {type(error).__name__}: {error}", where="fulcrum_m", right=right
        ) from None
    if (
        given.dtype.kind not in "iuf"
        or given.shape not in ((), moments.shape)
        or not np.isfinite(given).all()
    ):
        raise InputError(
            f"gives {given.dtype} numbers of shape {given.shape} for {len(moments)} times, or "
            "not finite ones",
            where="fulcrum_m",
            right=right,
        )
    return np.broadcast_to(given.astype(float), moments.shape)


# What a reader of a walk's numbers has to know about the run.


# peak vertical force of walking, in body weights, with a wide margin
PLAUSIBLE_PEAK_BW = (0.6, 2.5)
# share by which the foam may differ between bench and walk before a note says so (a choice)
FOAM_AGREEMENT = 0.05
AT_REST = 1e-5  # speed (m/s, rad/s) below which free coordinates count as at rest at the start


def step_notes(record: Record, stop: str = "") -> list[str]:
    """Sentences on steps that did not converge or were cut; `stop` ends them."""
    counts = record.counts()
    return say(
        "walk",
        "steps",
        unconverged=counts["unconverged_steps"],
        refined=counts["refined_steps"],
        steps=len(record.time_s),
        most=record.parts.max(),
        stop=stop,
    )


def walk_notes(walk: Walk, subject: Subject, model: ModelParameters) -> list[str]:
    """Sentences on convergence, plausibility and the start of `walk`."""
    vertical = walk.prosthetic.grf_W[:, 2]
    foam = foam_under_load(model.foot)
    peak = vertical.max() / (subject.mass_kg * GRAVITY)
    bench = (model.foot.series_stiffness_n_per_m, model.foot.series_exponent)
    walk_k, bench_k = (secant_stiffness(*law, FOAM_LOADS_N[1]) for law in (foam or bench, bench))
    return [
        *step_notes(walk.record),
        *say(
            "walk",
            "notes",
            peak_bw=None if PLAUSIBLE_PEAK_BW[0] < peak < PLAUSIBLE_PEAK_BW[1] else peak,
            deep=_too_deep(walk, model),
            start_n=vertical[0] if vertical[0] > reactions.LOADED_N else 0.0,
            spheres=walk_k if abs(walk_k / bench_k - 1) > FOAM_AGREEMENT else 0.0,
            foam=bench_k,
            rest_speed=walk.rest_speed if walk.rest_speed > AT_REST else 0.0,
        ),
    ]


def _too_deep(walk: Walk, model: ModelParameters) -> list[tuple[str, float, float | None, float]]:
    """Feet that go deeper (m) into the ground than what their contact stands for is thick (m), and
    since when (s)."""
    count = sum(len(zone.x_mm) for zone in model.foot.zones)
    depth = walk.record.site("depth")
    feet = []
    for foot, depths, limit in (
        ("prosthetic", depth[:, :count], model.foot.foam_thickness_m),
        ("intact", depth[:, count:], float(walk.mechanism.sites[count:, 3].max(initial=0.0))),
    ):
        deepest = depths.max(axis=1, initial=0.0)
        if deepest.max() > limit:
            since = (
                None
                if deepest[0] > limit
                else float(walk.record.time_s[int(np.argmax(deepest > limit))])
            )
            feet.append((foot, float(deepest.max()), since, limit))
    return feet
