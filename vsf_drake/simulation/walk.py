"""Walks a person along a recorded motion by the implicit stepper."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.model_file import check_fulcrum, check_model
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.foot import set_mount
from vsf_drake.plants.gait import make_gait
from vsf_drake.schema import check, to_plain
from vsf_drake.simulation.applied import AppliedTorques, torques_on_grid
from vsf_drake.simulation.courses import Course, course_motion, course_variables
from vsf_drake.simulation.energy import energy_ledger
from vsf_drake.simulation.load_sensitivity import check_differentiable_loads, load_sensitivity
from vsf_drake.simulation.mechanism import edited, gait_mechanism, gait_variables, supported_over
from vsf_drake.simulation.provenance import provenance
from vsf_drake.simulation.reactions import foot_reaction, reaction_sensitivity
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.start import start_state
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SITE_RECORD, SPRING_COLUMNS
from vsf_drake.simulation.stepping.carried import Carried
from vsf_drake.simulation.stepping.stepper import Inputs, Mechanism, Stepper
from vsf_drake.simulation.variables import added, check_names, check_values
from vsf_drake.simulation.walk_grid import fulcrum_on_grid, walk_grid
from vsf_drake.simulation.walk_notes import walk_notes
from vsf_drake.simulation.walk_run import Walk

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial

DEFAULT_STEP_S = 1e-3
MOST_BYTES = 1e9
"""Of memory that a walk with its recording may take."""


class Walker:
    """A subject with a prosthesis on the ground: built once, walked often.

    Parameters live in `context` (the diagram's): change them there between runs. A walk sets the foot's mount in it,
    under a lock: threads may share a walker as long as none of them changes the Context.

    Args:
        subject, model: the person and the devices.
        free: anatomical coordinates that are not prescribed.

    Attributes:
        variables: the numbers that `walk` takes by name (`values`), with units, bounds and what they were at first. One
            that is named replaces what the Context holds.

    Raises:
        InputError: a parameter is out of range or the segments do not fit.
        ValueError: `free` names a coordinate that the person does not have.
    """

    def __init__(self, subject: Subject, model: ModelParameters, *, free: Sequence[str] = ()) -> None:
        check(subject)
        check_model(model)
        self.subject, self.model = subject, model
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
        courses: Sequence[Course] = (),
        values: Mapping[str, float] | None = None,
        with_respect_to: Sequence[str] = (),
        with_loads: bool = False,
        support_width_m: float = 0.0,
        initial: dict[str, float] | None = None,
        applied: AppliedTorques | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Walk:
        """Follows `trajectory` from `start_s` to `end_s` in steps of `step_s`.

        The run begins in the pose and with the velocities of `start_s`; socket and keel are at rest.

        Args:
            trajectory: must hold every prescribed coordinate (rad, m).
            fulcrum_m: from A (m), constant or a function of time (s, array to array).
            support_width_m: on either side of a keel joint over which the support passes from one rigid piece of the
                keel to the next, so that derivatives by `fulcrum.shift` are continuous too; 0 at the joint itself.
            offsets: height, fore-aft and alignment of the prosthesis; none by default.
            courses: what changes prescribed coordinates with time; each is a variable of this walk, "course.NAME".
            values: of `variables` and courses, for this walk only; what is not named stays as the Context has it.
            with_respect_to: names of `variables` and courses by which the prosthetic foot's reaction is differentiated,
                exactly if the start is at rest. One costs as much as a walk, each further one a few percent of that.
            with_loads: whether the loads of joints and socket and the state are differentiated too, as the walk's
                `load_sensitivity`; not by `coordinate` and `course` variables.
            initial: free coordinates that shall settle before the start, by name, with a first guess; others
                start as the trajectory says, with its velocity.
            applied: torques on free coordinates. What settles before the start does so without them.
            progress: called with the finished fraction.

        Raises:
            InputError: a number is out of range, or the trajectory lacks a coordinate or the time.
            SimulationError: the run diverges.
        """
        started = time.perf_counter()
        moments, step_s = walk_grid(start_s, end_s, step_s)
        offsets = GeometricOffsets() if offsets is None else offsets
        if not isinstance(offsets, GeometricOffsets):
            raise InputError(f"is a {type(offsets).__name__}, no GeometricOffsets", where="offsets")
        check(offsets)
        coursed = course_variables(courses, self.gait.prescribed, moments)
        variables = self.variables | coursed
        values = check_values(values, variables)
        with_respect_to = check_names(with_respect_to, variables, where="with_respect_to")
        if with_loads:
            check_differentiable_loads(with_respect_to, variables)
        edits = tuple(variables[name].edit for name in with_respect_to)
        geometry, slide, shift = added(variables, values, self.gait.prescribed)
        course, course_rate = course_motion(variables, values, self.gait.prescribed, len(moments))
        fulcrum = slide + fulcrum_on_grid(fulcrum_m, moments)
        for position in (fulcrum.min(), fulcrum.max()):
            check_fulcrum(float(position), self.model.foot)
        with self._reading:
            set_mount(self.gait.plant_context(self.context), self.gait.person.foot,
                      height=offsets.height_m + geometry[0], fore_aft=offsets.fore_aft_m + geometry[1],
                      alignment=offsets.alignment_rad + geometry[2])
            mechanism = edited(gait_mechanism(self.gait, self.context), variables, values)
        trajectory.sample(moments[[0, -1]])  # a window outside the recording is told as that
        _check_memory(moments, bytes_a_step(mechanism, by=len(edits), loads=with_loads), len(trajectory.time_s))
        stepper = Stepper(supported_over(mechanism, support_width_m))
        tree = stepper.mechanism.tree
        motion = trajectory.ordered(self.gait.prescribed)
        q = motion.sample(moments)[0] + shift + course
        prescribed = np.array([*(tree.index(name) for name in motion.names), tree.index("fulcrum")])
        inputs = Inputs(time_s=moments, prescribed=prescribed, prescribed_q=np.column_stack([q, fulcrum]),
                        fulcrum=np.array(fulcrum), ground=np.full(len(moments), mechanism.ground_height),
                        torques=torques_on_grid(applied, free=self.free, coordinate_names=tree.coordinate_names,
                                                moments=moments))
        compile_s = stepper.warm_up(sensitivities=bool(edits))
        q0, v0, rest_speed, by = start_state(
            stepper, inputs, trajectory, prescribed=self.gait.prescribed, free=self.free, initial=initial or {},
            rate=course_rate, edits=edits)
        count = len(self.gait.person.foot.sites.radius)
        measured = np.arange(len(mechanism.sites)) < count
        carried = Carried(edits=edits, measured=measured, q0=by, loads=with_loads) if edits else None
        record = stepper.run(inputs, q0, v0, carried=carried, progress=progress)
        ground = stepper.mechanism.ground_height
        prosthetic = foot_reaction(record, slice(0, count), ground)
        intact = foot_reaction(record, slice(count, None), ground)
        return Walk(
            mechanism=stepper.mechanism, record=record, prosthetic=prosthetic,
            sensitivity=reaction_sensitivity(record, prosthetic, with_respect_to) if edits else None,
            load_sensitivity=load_sensitivity(stepper.mechanism, record, with_respect_to, edits)
            if edits and with_loads else None,
            intact=intact, commanded=q[1:], fulcrum_m=np.array(fulcrum),
            values=values, courses={name: variables[name].edit.coordinate for name in coursed}, step_s=step_s,
            wall_s=time.perf_counter() - started - compile_s, compile_s=compile_s, rest_speed=rest_speed,
            applied_names=() if applied is None else tuple(applied.names))

    def result(self, walk: Walk, trial: Trial, offsets: GeometricOffsets, *, energy: bool = True) -> WalkResult:
        """Packs a run with all that it takes to understand and repeat it.

        Args:
            energy: whether to work out the energy ledger, which takes about as long as the run.
        """
        record, tree = walk.record, walk.mechanism.tree
        sites = self.gait.person.foot.sites
        count = len(sites.radius)
        driven = np.zeros_like(record.load)
        columns = [tree.index(name) for name in (*self.gait.prescribed, *walk.applied_names)]
        driven[:, columns] = record.load[:, columns]
        unconverged, refined = int(np.sum(~record.converged)), int(np.sum(record.parts > 1))
        ledger = self._ledger(walk) if energy else {}
        friction = np.stack([record.site("friction_x"), record.site("friction_y")], axis=2)
        return WalkResult(
            time_s=record.time_s, coordinate_names=tree.coordinate_names, q=record.q, v=record.v,
            generalized_force=driven, grf_W=walk.prosthetic.grf_W, cop_W=walk.prosthetic.cop_W,
            free_moment_nm=walk.prosthetic.free_moment_nm, intact_grf_W=walk.intact.grf_W,
            intact_cop_W=walk.intact.cop_W, sphere_normal_n=record.site("normal_force")[:, :count].copy(),
            sphere_depth_m=np.maximum(record.site("depth")[:, :count], 0.0), sphere_friction_W=friction[:, :count],
            socket_wrench=walk.socket_wrench, fulcrum_m=walk.fulcrum_m[1:],
            prescribed_q=walk.commanded, prescribed_names=self.gait.prescribed,
            energy_names=tuple(ledger),
            energy_j=np.stack([*ledger.values()], axis=1) if ledger else np.zeros((len(record.time_s), 0)),
            sphere_zones=tuple(sites.zone_names[i] for i in sites.zone), unconverged_steps=unconverged,
            refined_steps=refined, newton_iterations=int(record.iterations.sum()), converged=unconverged == 0,
            simulated_s=float(record.time_s[-1] - record.time_s[0] + walk.step_s), wall_s=walk.wall_s,
            compile_s=walk.compile_s, step_s=walk.step_s, subject_mass_kg=self.subject.mass_kg,
            foot_length_m=self.model.foot.length_m, side=self.subject.prosthetic_side, trial_name=trial.name,
            synthetic=trial.synthetic,
            parameters={"subject": to_plain(self.subject), "model": to_plain(self.model),
                        "offsets": to_plain(offsets), "values": dict(walk.values), "courses": dict(walk.courses),
                        "fulcrum_m": [float(walk.fulcrum_m.min()), float(walk.fulcrum_m.max())],
                        "stepper": used_numbers(walk.mechanism)},
            provenance=provenance(trial.inputs), notes=(*trial.notes, *walk_notes(walk, self.subject, self.model)))

    def _ledger(self, walk: Walk) -> dict[str, np.ndarray]:
        keel, driven = ([walk.mechanism.tree.index(name) for name in names] for names in (
            self.gait.person.foot.keel_joint_names, (*self.gait.prescribed, "fulcrum")))
        return energy_ledger(walk.mechanism, walk.record, keel=np.array(keel), driven=np.array(driven),
                             fulcrum_m=walk.fulcrum_m)


def bytes_a_step(mechanism: Mechanism, *, by: int = 0, loads: bool = False) -> float:
    """What a step takes, at most: 2.2 times its record, as was measured, and `by` derivatives (of loads too)."""
    n, sites = len(mechanism.tree.coordinate_names), len(mechanism.sites)
    return 8.0 * (2.2 * (3 * n + len(SITE_RECORD) * sites) + by * (6 + 3 * n * loads))


def _check_memory(moments: np.ndarray, step_bytes: float, rows: int) -> None:
    """Raises InputError for a walk that would take more than MOST_BYTES.

    Measured on walks of 10 and 60 s and on a recording of ten minutes: 0.41 GB for the programs, and 2.5 kB for each of
    the `rows` of the recording.
    """
    left, taken, step_s = MOST_BYTES - 4.1e8 - 2.5e3 * rows, len(moments) * step_bytes, moments[1] - moments[0]
    if taken > left:
        raise InputError(
            f"{moments[-1] - moments[0]:.0f} s in steps of {1e3 * step_s:g} ms would take "
            f"{1e-9 * (MOST_BYTES - left + taken):.1f} GB of memory, more than {1e-9 * MOST_BYTES:g} GB",
            where="window",
            right=f"Choose at most {left / step_bytes * step_s:.0f} s of this recording, a part at a time" if left > 0.0
            else f"Its files have {rows} rows, which take all of it: cut them into shorter ones")


def used_numbers(mechanism: Mechanism) -> dict[str, list | float]:
    """Contact, springs and support as the run used them, whatever the model file says."""
    return {"site_columns": list(SITE_COLUMNS), "sites": mechanism.sites.tolist(),
            "spring_columns": list(SPRING_COLUMNS), "springs": mechanism.springs.tolist(),
            "fulcrum_stiffness_and_damping": mechanism.fulcrum.tolist(),
            "support_width_m": mechanism.support_width}


def simulate_trial(
    trial: Trial,
    *,
    step_s: float = DEFAULT_STEP_S,
    offsets: GeometricOffsets | None = None,
    progress: Callable[[float], None] | None = None,
) -> WalkResult:
    """Simulates a recorded trial: the person follows the recording, the prosthesis and the ground respond.

    Args:
        offsets: instead of the manifest's.
        progress: called with the finished fraction.

    Raises:
        InputError, SimulationError: see `Walker.walk`.
    """
    walker = Walker(trial.subject, trial.model)
    offsets = offsets or trial.offsets
    walk = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                       step_s=step_s, offsets=offsets, progress=progress)
    return walker.result(walk, trial, offsets)
