"""Walks a person along a recorded motion by the implicit stepper."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, VsfError
from vsf_drake.base.schema import check, to_plain
from vsf_drake.base.sentences import say
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.model.model_file import (
    FOAM_LOADS_N,
    check_fulcrum,
    check_model,
    foam_under_load,
    secant_stiffness,
)
from vsf_drake.model.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.motion.events import STRUCK_N
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation import reactions
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.mechanism import (
    edited,
    gait_mechanism,
    mounted,
    supported_over,
    tangents_of,
)
from vsf_drake.simulation.options import (
    MAX_STEP_MS,
    STARTS_LOADED,
    TRANSIENT_BW,
    TRANSIENT_S,
    StepOptions,
)
from vsf_drake.simulation.results import ARRAYS, WalkResult
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SITE_RECORD, SPRING_COLUMNS
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.runs import Inputs, Mechanism, Record, Run
from vsf_drake.simulation.stepping.sensitivity import ForwardSensitivity
from vsf_drake.simulation.stepping.stepper import (
    ALONE,
    CARRIED,
    SIDE_BY_SIDE,
    Stepper,
    rest_sensitivity,
    run_side_by_side,
    settle_side_by_side,
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
# recorded motions, on the instants of a walk, that a walker keeps for the next walk along them: how
# many, and of how many bytes at most
KEPT_MOTIONS = 16
KEPT_BYTES = 1e7
OF_SITES = ("sphere_normal_n", "sphere_depth_m", "sphere_friction_W", "energy_j")
"""Arrays of a result for which a walk's record needs its sites."""


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
        held = self.context.get_parameters()
        self._held = [
            held.get_numeric_parameter(i) for i in range(held.num_numeric_parameter_groups())
        ]
        self._parameters = np.zeros(0)  # what they were when `_mechanism` was read
        self._mechanism: Mechanism
        self._refresh()
        self._motions: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = {}
        self.variables = gait_variables(self.gait, self._mechanism)

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
        self._refresh()
        plan = self._plan(
            trajectory,
            fulcrum_m=fulcrum_m,
            start_s=start_s,
            end_s=end_s,
            step_s=step_s,
            offsets=offsets,
            perturbations=perturbations,
            values=values,
            with_respect_to=with_respect_to,
            with_loads=with_loads,
            support_width_m=support_width_m,
            initial=initial,
        )
        [walk] = self._walked([plan], started_s=started, progress=progress)
        if isinstance(walk, VsfError):
            raise walk
        return walk

    def walk_many(
        self, requests: Sequence[Mapping[str, Any]], *, sites: bool = True
    ) -> list[Walk | VsfError]:
        """Several walks of this person side by side: for each of the `requests`, which are
        arguments of `walk` by name, the walk that it gives alone, to the bit, or the error that
        `walk` raises: of bad input too it ends no other.

        Those with sensitivities follow one after the other. Many at a time take much memory, see
        `parts`. Without `sites` the records have nothing of single spheres, which is sooner.

        Raises:
            TypeError: a request has not the arguments of `walk`: none of them is walked.
        """
        started = time.perf_counter()
        self._refresh()
        made: dict[int, Walk | VsfError] = {}
        alike: dict[tuple[object, ...], list[tuple[int, _Plan]]] = {}
        for i, request in enumerate(requests):
            try:
                plan = self._plan(**request)
            except VsfError as error:
                made[i] = error
            else:
                own = (i,) if plan.tangents else ()
                key = (plan.held.prescribed.tobytes(), plan.mechanism.support_width, *own)
                alike.setdefault(key, []).append((i, plan))
        for members in alike.values():
            walks = self._walked([plan for _, plan in members], started_s=started, sites=sites)
            made |= {i: walk for (i, _), walk in zip(members, walks, strict=True)}
            started = time.perf_counter()
        return [made[i] for i in range(len(requests))]

    def walk_each(
        self, requests: Sequence[Mapping[str, Any]], *, sites: bool = True
    ) -> Iterator[Walk | VsfError]:
        """`walk_many` of any number of requests, a part of them at a time (`parts`), for who needs
        them one after the other; errors come and are raised as there, part by part."""
        steps = [1] * len(requests)
        for i, request in enumerate(requests):
            with contextlib.suppress(InputError, KeyError):  # `walk_many` says it
                start_s, end_s = request["start_s"], request["end_s"]
                moments, _ = walk_grid(start_s, end_s, request.get("step_s", DEFAULT_STEP_S))
                steps[i] = len(moments)
        for rows in self.parts(steps):
            yield from self.walk_many([requests[i] for i in rows], sites=sites)

    def parts(self, steps: Sequence[int]) -> list[range]:
        """Walks of so many steps in parts that `walk_many` should be asked for at a time: what it
        can make side by side in the memory that one may take, evenly."""
        most = 0.5 * MOST_BYTES / (max(steps, default=1) * bytes_a_step(self._mechanism))
        count = -(-len(steps) // max(1, min(WIDTH, int(most))))
        ends = [i * len(steps) // max(count, 1) for i in range(count + 1)]
        return [range(*pair) for pair in itertools.pairwise(ends)]

    def _plan(
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
        initial: Mapping[str, float] | None = None,
    ) -> _Plan:
        """What `walk` is asked for, checked and read."""
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
        mechanism = edited(self._mounted(offsets, geometry), variables, values)
        tangents = tangents_of(mechanism, (variables[name].by_unit for name in with_respect_to))
        trajectory.inside(moments[[0, -1]])  # a window outside the recording is told as that
        _check_memory(
            moments,
            bytes_a_step(mechanism, by=len(tangents), loads=with_loads),
            len(trajectory.time_s),
        )
        mechanism = supported_over(mechanism, support_width_m)

        # the motion of the prescribed coordinates on the grid
        initial = initial or {}
        recorded, recorded_rate = self._motion(trajectory, moments, initial)
        count = len(names)
        prescribed_q = np.empty((len(moments), count + 1))
        q = np.add(recorded[:, :count], shift, out=prescribed_q[:, :-1])
        if perturbations:
            q += perturbation
        prescribed_q[:, -1] = fulcrum
        tree = mechanism.tree
        inputs = Inputs(
            time_s=moments,
            prescribed=np.array([tree.index(name) for name in (*names, "fulcrum")]),
            prescribed_q=prescribed_q,
            fulcrum=np.array(fulcrum),
            ground=np.full(len(moments), mechanism.ground_height),
        )

        # Prescribed coordinates, and free ones that the recording knows, have its position and
        # velocity at the start, and the rate of perturbations. Everything else (socket, keel, the
        # free ones in `initial`) settles with those held.
        known = [*names, *(name for name in self.free if name not in initial)]
        rows = np.array([tree.index(name) for name in known], dtype=np.int64)
        held = dataclasses.replace(
            inputs,
            prescribed=np.concatenate([inputs.prescribed, rows[count:]]),
            prescribed_q=np.concatenate([prescribed_q[0], recorded[0, count:]])[None, :],
        )
        guess = np.zeros(tree.num_coordinates)
        guess[held.prescribed] = held.prescribed_q[0]
        for name, value in initial.items():
            guess[tree.index(name)] = value
        v0 = np.zeros_like(guess)
        v0[rows] = recorded_rate
        v0[rows[:count]] += perturbation_rate
        return _Plan(
            mechanism=mechanism,
            inputs=inputs,
            held=held,
            guess=guess,
            v0=v0,
            with_respect_to=with_respect_to,
            tangents=tangents,
            with_loads=with_loads,
            values=values,
            perturbations={f"perturbation.{item.name}": item.coordinate for item in perturbations},
            step_s=step_s,
        )

    def _walked(
        self,
        plans: Sequence[_Plan],
        *,
        started_s: float,
        sites: bool = True,
        progress: Callable[[float], None] | None = None,
    ) -> list[Walk | VsfError]:
        """The planned walks side by side, or why there is none: they prescribe the same coordinates
        and have one support width; one with sensitivities is alone. The work on them began at
        `started_s` of the performance counter."""
        with_sensitivities = bool(plans[0].tangents)
        alone = CARRIED if with_sensitivities else ALONE
        stepper = Stepper(plans[0].mechanism)
        compile_s = stepper.warm_up(SIDE_BY_SIDE if len(plans) > 1 else alone)
        settled = settle_side_by_side(
            [Run(plan.mechanism, plan.held, plan.guess, plan.v0) for plan in plans]
        )
        runs = [
            Run(plan.mechanism, plan.inputs, rest[0], plan.v0)
            for plan, rest in zip(plans, settled, strict=True)
            if not isinstance(rest, SimulationError)
        ]
        try:
            forward = self._forward(plans[0], runs[0].q0) if with_sensitivities and runs else None
        except InputError as error:  # its rest has no derivative
            return [error]
        records = iter(run_side_by_side(runs, sites=sites, forward=forward, progress=progress))
        took_s = (time.perf_counter() - started_s - compile_s) / len(plans)
        outcomes: list[Walk | VsfError] = []
        for plan, rest in zip(plans, settled, strict=True):
            if isinstance(rest, SimulationError):
                outcomes.append(rest)
                continue
            record = next(records)
            outcomes.append(
                record
                if isinstance(record, SimulationError)
                else self._finished(plan, record, rest[1], wall_s=took_s, compile_s=compile_s)
            )
        return outcomes

    def _forward(self, plan: _Plan, q0: np.ndarray) -> ForwardSensitivity:
        """What a walk with sensitivities carries along from rest at q0 (coordinates,)."""
        mechanism = plan.mechanism
        by = rest_sensitivity(Run(mechanism, plan.held, q0, np.zeros_like(q0)), plan.tangents)
        measured = np.arange(len(mechanism.sites)) < len(self.gait.person.foot.sites.radius)
        return ForwardSensitivity(
            tangents=plan.tangents, measured=measured, q0=by, loads=plan.with_loads
        )

    def _finished(
        self, plan: _Plan, record: Record, rest_speed: float, *, wall_s: float, compile_s: float
    ) -> Walk | SimulationError:
        """The walk that was planned and left this record, failed if a force in it is no number."""
        for what, forces in (("the ground's force", record.wrench), ("a load", record.load)):
            if not np.isfinite(forces).all():
                step = int(np.argwhere(~np.isfinite(forces))[0, 0])
                return SimulationError(
                    f"{what} is not a finite number", time_s=float(record.time_s[step])
                )
        mechanism = plan.mechanism
        names = plan.with_respect_to
        prosthetic = reactions.foot_reaction(record, reactions.PROSTHETIC, mechanism.ground_height)
        return Walk(
            mechanism=mechanism,
            record=record,
            spheres=len(self.gait.person.foot.sites.radius),
            prosthetic=prosthetic,
            sensitivity=reactions.reaction_sensitivity(record, prosthetic, names)
            if plan.tangents
            else None,
            load_sensitivity=reactions.load_sensitivity(mechanism, record, names, plan.tangents)
            if plan.tangents and plan.with_loads
            else None,
            commanded=plan.inputs.prescribed_q[1:, :-1],
            fulcrum_m=plan.inputs.fulcrum,
            values=plan.values,
            step_s=plan.step_s,
            perturbations=plan.perturbations,
            wall_s=wall_s,
            compile_s=compile_s,
            rest_speed=rest_speed,
        )

    def _refresh(self) -> None:
        """Reads the mechanism anew if another parameter of the Context has changed than the foot's
        mount."""
        with self._reading:
            set_mount(self.gait.plant_context(self.context), self.gait.person.foot)
            parameters = np.concatenate([group.value() for group in self._held])
            if not np.array_equal(parameters, self._parameters, equal_nan=True):
                self._mechanism = gait_mechanism(self.gait, self.context)
                self._parameters = parameters

    def _mounted(self, offsets: GeometricOffsets, geometry: np.ndarray) -> Mechanism:
        """The mechanism with the foot mounted by the offsets and the `geometry` (OFFSETS,) added to
        them."""
        own = mount_of(offsets)
        mount = {name: own[name] + more for name, more in zip(OFFSETS, geometry, strict=True)}
        foot = self.gait.person.foot
        with self._reading:
            set_mount(self.gait.plant_context(self.context), foot, **mount)
            return mounted(self._mechanism, foot)

    def _motion(
        self, trajectory: CoordinateTrajectory, moments: np.ndarray, initial: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is recorded of the prescribed coordinates, then of the free ones that are not in
        `initial`: positions (n + 1, c) at the moments, and the rates (c,) at the first."""
        for name in initial:
            if name not in self.free:
                raise InputError(
                    "is not a free coordinate",
                    where=f"initial[{name!r}]",
                    right=f"Free are: {', '.join(self.free)}",
                )
        free = tuple(name for name in self.free if name not in initial)
        unknown = [name for name in free if name not in trajectory.names]
        if unknown:
            raise InputError(
                f"the free coordinate {unknown[0]} has no start",
                where="initial",
                right="Give it there, or a recording that holds it",
            )
        key = (trajectory, moments.tobytes(), free)
        with self._reading:
            kept = self._motions.get(key)
        if kept is not None:
            return kept
        q, v, _ = trajectory.ordered((*self.gait.prescribed, *free)).sample(moments)
        motion = (q, v[0].copy())
        for shared in motion:
            shared.setflags(write=False)
        if q.nbytes <= KEPT_BYTES:
            with self._reading:
                if len(self._motions) >= KEPT_MOTIONS:
                    del self._motions[next(iter(self._motions))]
                self._motions[key] = motion
        return motion

    def walk_trial(self, trial: Trial, **changes: Any) -> Walk:
        """`walk` of a recorded trial, as its manifest says but for `changes`."""
        return self.walk(**trial_request(trial, **changes))

    def result(
        self, walk: Walk, trial: Trial, offsets: GeometricOffsets, *, energy: bool = True
    ) -> WalkResult:
        """Packs a run with all that it takes to understand and repeat it; the energy ledger takes
        as long as the run.
        """
        record = walk.record
        counts = record.counts()
        arrays, columns = self.arrays(
            walk, [name for name in ARRAYS if energy or name != "energy_j"]
        )
        sites = self.gait.person.foot.sites
        used = {  # contact, springs and support as the run used them, whatever the model file says
            "site_columns": list(SITE_COLUMNS),
            "sites": walk.mechanism.sites.tolist(),
            "spring_columns": list(SPRING_COLUMNS),
            "springs": walk.mechanism.springs.tolist(),
            "fulcrum_stiffness_and_damping": walk.mechanism.fulcrum.tolist(),
            "support_width_m": walk.mechanism.support_width,
        }
        return WalkResult(
            **{"energy_j": np.zeros((len(record.time_s), 0))} | arrays,
            coordinate_names=columns["q"],
            prescribed_names=columns["prescribed_q"],
            energy_names=columns.get("energy_j", ()),
            sphere_zones=tuple(sites.zone_names[i] for i in sites.zone),
            unconverged_steps=counts["unconverged_steps"],
            refined_steps=counts["refined_steps"],
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

    def arrays(
        self, walk: Walk, names: Collection[str]
    ) -> tuple[dict[str, np.ndarray], dict[str, tuple[str, ...]]]:
        """Arrays of the walk's `WalkResult` by name, those `names` alone; and the names of columns
        of those of them whose columns are coordinates or energies."""
        record = walk.record
        count = walk.spheres
        prescribed = self.gait.prescribed
        coordinates = walk.mechanism.tree.coordinate_names
        columns = dict.fromkeys(("q", "v", "generalized_force"), coordinates)
        columns["prescribed_q"] = prescribed
        ledger = self.energies(walk) if "energy_j" in names else {}
        columns["energy_j"] = tuple(ledger)
        made: dict[str, Callable[[], np.ndarray]] = {
            "time_s": lambda: record.time_s,
            "q": lambda: record.q,
            "v": lambda: record.v,
            "generalized_force": lambda: np.where(
                np.isin(coordinates, prescribed), record.load, 0.0
            ),
            "grf_W": lambda: walk.prosthetic.grf_W,
            "cop_W": lambda: walk.prosthetic.cop_W,
            "free_moment_nm": lambda: walk.prosthetic.free_moment_nm,
            "intact_grf_W": lambda: walk.intact.grf_W,
            "intact_cop_W": lambda: walk.intact.cop_W,
            "sphere_normal_n": lambda: np.array(record.site("normal_force")[:, :count]),
            "sphere_depth_m": lambda: np.maximum(record.site("depth")[:, :count], 0.0),
            "sphere_friction_W": lambda: np.stack(
                [record.site("friction_x")[:, :count], record.site("friction_y")[:, :count]], axis=2
            ),
            "socket_wrench": lambda: walk.socket_wrench,
            "fulcrum_m": lambda: walk.fulcrum_m[1:],
            "prescribed_q": lambda: walk.commanded,
            "energy_j": lambda: np.stack([*ledger.values()], axis=1),
        }
        return (
            {name: made[name]() for name in names},
            {name: of for name, of in columns.items() if name in names},
        )

    def energies(self, walk: Walk) -> dict[str, np.ndarray]:
        """The terms of `reactions.energy_ledger` of a walk, each (n,) J."""
        driven = [walk.mechanism.tree.index(name) for name in (*self.gait.prescribed, "fulcrum")]
        return reactions.energy_ledger(
            walk.mechanism, walk.record, driven=np.array(driven), fulcrum_m=walk.fulcrum_m
        )


def trial_request(trial: Trial, **changes: Any) -> dict[str, Any]:
    """What `Walker.walk` takes for a recorded trial, as its manifest says but for `changes`."""
    return {
        "trajectory": trial.trajectory,
        "fulcrum_m": trial.fulcrum_m,
        "start_s": trial.start_s,
        "end_s": trial.end_s,
        "offsets": trial.offsets,
    } | changes


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


@dataclass(frozen=True, eq=False)
class _Plan:
    """A walk that was asked for, checked and read: what the stepper needs of it."""

    mechanism: Mechanism
    inputs: Inputs
    held: Inputs  # what is held while the rest settles, of one instant
    guess: np.ndarray  # (coordinates,) from where that settles
    v0: np.ndarray  # (coordinates,) at the start
    with_respect_to: tuple[str, ...]
    tangents: tuple[ParameterTangent, ...]  # of these
    with_loads: bool
    values: Mapping[str, float]
    perturbations: Mapping[str, str]  # the coordinate that each changes, by variable
    step_s: float


# One run of a walking person, as the stepper left it.


@dataclass(frozen=True)
class Walk:
    """One run of a `Walker`, before it is packed as a result."""

    mechanism: Mechanism
    record: Record
    spheres: int  # of the prosthetic foot, the first of the record's sites
    prosthetic: reactions.FootReaction
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

    @cached_property
    def intact(self) -> reactions.FootReaction:
        """The other foot's."""
        return reactions.foot_reaction(self.record, reactions.INTACT, self.mechanism.ground_height)

    @property
    def time_s(self) -> np.ndarray:
        """(n,) the ends of the steps."""
        return self.record.time_s

    @property
    def grf_W(self) -> np.ndarray:
        """(n, 3) N on the prosthetic foot."""
        return self.prosthetic.grf_W

    @property
    def cop_W(self) -> np.ndarray:
        """(n, 3) m of it, NaN unloaded."""
        return self.prosthetic.cop_W

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one coordinate."""
        return self.record.q[:, self.mechanism.tree.index(name)]

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
            starts_loaded=STARTS_LOADED,
            start_n=vertical[0] if vertical[0] > STRUCK_N else 0.0,
            transient_s=TRANSIENT_S,
            transient_bw=TRANSIENT_BW,
            spheres=walk_k if abs(walk_k / bench_k - 1) > FOAM_AGREEMENT else 0.0,
            foam=bench_k,
            rest_speed=walk.rest_speed if walk.rest_speed > AT_REST else 0.0,
        ),
    ]


def _too_deep(walk: Walk, model: ModelParameters) -> list[tuple[str, float, float | None, float]]:
    """Feet that go deeper (m) into the ground than what their contact stands for is thick (m), and
    since when (s)."""
    other = float(walk.mechanism.sites[walk.spheres :, 3].max(initial=0.0))
    feet = []
    for foot, place, limit in (
        ("prosthetic", reactions.PROSTHETIC, model.foot.foam_thickness_m),
        ("intact", reactions.INTACT, other),
    ):
        deepest = walk.record.deepest[:, place]
        if deepest.max(initial=0.0) > limit:
            since = (
                None
                if deepest[0] > limit
                else float(walk.record.time_s[int(np.argmax(deepest > limit))])
            )
            feet.append((foot, float(deepest.max()), since, limit))
    return feet
