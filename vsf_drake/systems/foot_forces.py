"""All forces on one foot in one system: contact, friction, fulcrum support, keel springs,
carriage."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, SupportsInt

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError
from vsf_drake.laws.contact_laws import CONTACT_LAWS, FITTED_LAW
from vsf_drake.systems import _foot_kernel as kernel
from vsf_drake.systems._system import System, system_template, weakly

DEVICE = dict.fromkeys(kernel.JOINT_COLUMNS, "m") | dict.fromkeys(
    ("fulcrum_stiffness", "fulcrum_damping", "fulcrum_m", "carriage_gain", "carriage_rate_gain"), ""
)
CONTACT = {
    "p_BS": "N3",
    **dict.fromkeys(kernel.SITE_COLUMNS, "N"),
    "ground_bounds": "M4",
    **dict.fromkeys(kernel.PATCH_COLUMNS, "M"),
    **dict.fromkeys(("threshold_velocity", "depth_width", "rate_width"), ""),
}
"""Parameters and their shapes, of m keel joints, N spheres and M patches."""
Constant = float | np.ndarray
"""One value, or one for each joint, sphere or patch."""
FORCES = ("support_force", "joint_moment")
GROUND = ("grf", "cop", "free_moment", "normal_force", "depth", "depth_rate", "friction_force")


class Varied:
    """Numbers (n,) and their derivatives (n, d), as an array of AutoDiffXd of what is taken."""

    def __init__(self, value: np.ndarray, by: np.ndarray) -> None:
        self.value = value
        self.by = by

    def __getitem__(self, part: slice) -> np.ndarray:
        taken: np.ndarray = InitializeAutoDiff(self.value[part].reshape(-1, 1), self.by[part])
        return taken.ravel()


@system_template()
class FootForces(System):
    """Every force on one variable-stiffness foot, for any plant that `add_foot` put it into;
    `wire_foot` makes and connects it.

    Contact with a ground of plane patches, friction, fulcrum support, keel springs and the
    carriage's servo are one system. Of the plant's poses and velocities only those of the rigid
    frame F are used, for the keel's joint angles are in the state, and the plant gets one spatial
    force on F beside moments in the keel's joints. Laws and sources: `vsf_drake.laws`, McGeehan
    2021 (doi 10.1115/1.4050456); with the law "smooth" friction is smooth too.

    A sphere touches the highest patch at its centre S, of equally high ones the last, and none
    beyond all bounds. Depth, depth rate and slip, against the belt of a patch that has one, are
    taken along and across that patch's normal n; friction acts at C, a radius from S against n. The
    centre of pressure is the point about which the moment has no component across the mean normal,
    in the plane through the mean contact point, as a force plate makes it; it differs from the
    force-weighted mean of eq. 4 by at most the friction coefficient times the largest depth.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; state
    (num_positions + num_velocities,), [q; v] of the plant; fulcrum_position (1,) m from the keel's
    posterior end A, where it is not connected the parameter fulcrum_m holds; gathered (G,) of a
    coupled foot. Outputs: spatial_forces on F; generalized_force (num_velocities,), zero outside
    keel and carriage; support_force (1,) N of the fulcrum on the keel along z_K; joint_moment (m,)
    N m of the keel's springs and dampers; grf (3,) N in W, on the foot; cop (3,) m in W;
    free_moment (1,) N m about the mean normal, on the foot; normal_force (N,) N, >= 0; depth (N,) m
    of foam and ground together; depth_rate (N,) m/s, also without contact; friction_force (3 N,), N
    rows in W, N; constants (C,) of a coupled foot; applied (6 + num_velocities,), moment and force
    on F at Fo in its axes, then the generalized force. Without load grf, cop and free_moment are
    zero. With `law` None there is no contact, and there are no outputs from grf to friction_force.

    Args:
        position_indices, velocity_indices: (m + 1,) of the m keel joints and the carriage in the
            plant's q and v.
        frame_body_index: body F. keel_starts: (m,) distances (m) of the keel's joints from A.
        site_keel: N indices of the keel bodies that carry the spheres; -1 for F.
        law: one of CONTACT_LAWS, or None.
        constants: values of the parameters below by name; a scalar stands for equal values.
        grip_limit: (m,) N s/m, in a plant with a time step: the most friction per speed, normal
            force · mu_static / threshold_velocity on the roughest patch, that each keel body bears
            there. None: no limit.
        chain: of a coupled foot, see `plants.foot_coupling`. travel: (2,) m from A, where the
            carriage can be; None without one.
        foam_thickness: m; a Simulator that starts with a sphere deeper in the ground warns of it.
        underivable: a contact of Drake's without derivatives. None: there is none.

    Attributes:
        law: number of the contact law.

    Parameters in the Context: joint_stiffness, joint_damping (m,) N m/rad, N m s/rad;
    fulcrum_stiffness, fulcrum_damping N/m, N s/m; fulcrum_m (m from A); carriage_gain,
    carriage_rate_gain N/m, N s/m; and with a law p_BS (N, 3) m, radius (N,) m, stiffness, exponent,
    damping, full_damping_depth (N,) of `laws.kelvin_voigt`, dissipation (N,) s/m of
    `laws.hunt_crossley`, depth_width, rate_width (m, m/s) of `laws.smooth_contact`,
    threshold_velocity (m/s); and of the M patches ground_bounds (M, 4), ground_reference_x,
    ground_height, ground_slope, ground_bank, ground_compliance, mu_static, mu_kinetic, ground_speed
    (M,), see `vsf_drake.model.ground`.

    Raises:
        InputError: (when evaluated) the fulcrum's position is not a number, or in mm; the carriage
            is at 0, outside its travel, where a Context of a clone or SetPositions with zeros puts
            it; a load beyond grip_limit; a constant out of bounds; derivatives of an underivable.
    """

    _known: ClassVar[dict[str, str]] = DEVICE
    _moments: ClassVar[tuple[str, ...]] = ("generalized_force",)

    def __init__(
        self,
        *,
        num_positions: int,
        num_velocities: int,
        position_indices: Sequence[int],
        velocity_indices: Sequence[int],
        frame_body_index: SupportsInt,
        keel_starts: np.ndarray,
        site_keel: Sequence[int],
        law: str | None,
        constants: dict[str, Constant],
        grip_limit: np.ndarray | None = None,
        chain: np.ndarray | None = None,
        travel: tuple[float, float] | None = None,
        foam_thickness: float = np.inf,
        underivable: str | None = None,
    ) -> None:
        if law is not None and law not in CONTACT_LAWS:
            raise ValueError(
                f"law is {law!r}, but must be one of {', '.join(CONTACT_LAWS)}, or None"
            )
        self._grip_limit = grip_limit
        self._frame = int(frame_body_index)
        self._travel = travel if travel and travel[0] > 0.0 else None
        self._foam_thickness = foam_thickness
        self._underivable = underivable
        self.law = list(CONTACT_LAWS).index(law or FITTED_LAW)
        starts = np.array(keel_starts, dtype=float)
        self._site_keel = np.array(site_keel if law else [], dtype=np.int64)
        m = len(starts)
        sites = len(self._site_keel)
        if not len(position_indices) == len(velocity_indices) == m + 1:
            raise ValueError(
                f"{m} keel joints and the carriage have {m + 1} indices, not "
                f"{len(position_indices)} and {len(velocity_indices)}"
            )
        patches = len(np.atleast_1d(constants.get("ground_height", 0.0)))
        at_q = np.array(position_indices, dtype=np.int64)
        at_v = num_positions + np.array(velocity_indices, dtype=np.int64)
        self._chain = np.zeros((0, kernel.CHAIN_COLUMNS)) if chain is None else np.array(chain)
        counts = [self.law, m, sites, patches, num_positions, num_velocities, len(self._chain)]
        self._numbers = np.concatenate([counts, at_q, at_v, self._site_keel]).astype(float)
        self._coordinates = np.concatenate([at_q[:m], at_v[:m], at_q[m:], at_v[m:]])
        self._blank, cells = kernel.table_cells(starts, sites, patches)
        self._slices = kernel.slices(m, sites, num_velocities)
        self._carriage = self._slices["place"].start - 2
        self._size = self._slices["chain"].stop
        self._declare_kinematics()
        states = self._declare_coordinates(num_positions + num_velocities)
        self._declare_inputs(fulcrum_position=1)
        self._constants_size = len(self._numbers) + self._blank.size + self._chain.size + 1
        self._coupled = chain is not None
        self._linked = len(self._chain) > 0
        if self._coupled:
            self._declare_inputs(gathered=self._constants_size + states + 3 * self._linked)
        known = self._known | (CONTACT if law else {})
        wrong = known.keys() ^ constants.keys()
        if wrong:
            raise ValueError(
                f"missing or unknown: {', '.join(sorted(wrong))}; known are {', '.join(known)}"
            )
        self._declare_parameters(
            **{
                name: (constants[name], _shape(code, m=m, N=sites, M=patches))
                for name, code in known.items()
            }
        )
        self._cells = {name: cells[name] for name in known if name in cells}
        self._declare_outputs(law)

    def _declare_outputs(self, law: str | None) -> None:
        self._table = self._declare_cached("table", self._pack, self.all_parameters_ticket())
        self._packed = self._declare_cached("packed", self._pack_all, self.all_parameters_ticket())
        calc: Any = self._calc_varied if self._T is AutoDiffXd else self._calc_work
        self._values = values = self._declare_cached("values", calc)
        inputs = (self.all_parameters_ticket(), self.all_input_ports_ticket())
        self._declare_spatial_forces(self._spatial_forces)
        for name in (*self._moments, *FORCES, *(GROUND if law else ())):
            part = self._slices[name]
            self._declare_part(name, part.stop - part.start, values, part, *inputs)
        if self._coupled:
            self._declare_output(
                "constants",
                self._constants_size,
                self._calc_constants,
                self.all_parameters_ticket(),
                self.input_port_ticket(self._ports["fulcrum_position"].get_index()),
            )
        first = self._slices["frame_wrench"].start
        applied = slice(first, self._slices["generalized_force"].stop)
        size = applied.stop - first
        if self._T is float and self._linked and self._grip_limit is None:
            write = self._applied_at_once(applied)
            self.DeclareVectorOutputPort("applied", size, write, set(inputs))
        else:
            self._declare_part("applied", size, weakly(calc), applied, *inputs)
        if law and self._T is float:
            self._declare_start(self._warn_of_depth)

    def _declare_coordinates(self, states: int) -> int:
        """Declares the input of the joints' coordinates; returns how many numbers beside constants
        and point `gathered` has."""
        self._declare_inputs(state=states)
        return states

    def _pack(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        """The table of `_foot_kernel` and its derivatives (rows, columns, d)."""
        constants = self._constants(context)
        given = np.concatenate([np.ravel(constants[name]) for name in self._cells])
        value, by = _apart(given)
        cells = np.concatenate([cells.ravel() for cells in self._cells.values()])
        table = self._blank.copy()
        table.reshape(-1)[cells] = value
        table_by = np.zeros((table.size, by.shape[1]))
        table_by[cells] = by
        return table, table_by.reshape(*table.shape, by.shape[1])

    def _pack_all(self, context: Context) -> np.ndarray:
        """What `_foot_kernel.foot_vector` is given but for state and point, the fulcrum at 0."""
        table, table_by = self._table(context)
        cells = table.ravel()
        if self._T is AutoDiffXd:
            cells = Varied(cells, table_by.reshape(table.size, table_by.shape[2]))[:]
        packed: np.ndarray = np.concatenate([self._numbers, cells, self._chain.ravel(), [0.0]])
        packed = packed + self._T(0.0)
        return packed

    def _calc_constants(self, context: Context) -> np.ndarray:
        constants = self._packed(context).copy()
        constants[-1] = self._fulcrum_place(context)
        return constants

    def _calc_work(self, context: Context) -> np.ndarray:
        given: Any
        if self._coupled:
            given = self._ports["gathered"].Eval(context)
        else:
            given = np.concatenate([self._calc_constants(context), self._value(context, "state")])
        work = np.empty(self._size)
        if not (self._linked and kernel.foot_vector(given, True, work)):
            work[:12], work[12:18] = self._frame_motion(context)
            kernel.foot_vector(given, False, work)
        if work[self._carriage] == 0.0:
            self._refuse_carriage()
        if self._grip_limit is not None:
            self._check_grip(context, work[self._slices["normal_force"]])
        return work

    def _applied_at_once(self, part: slice) -> Callable[[Context, Any], None]:
        """`_calc_work` for the plant, which asks in every evaluation: past the cache that serves
        the other outputs, and with few calls in between, since they cost as much as the foot."""
        owner: Callable[[], Any] = weakref.ref(self)
        size = self._size
        carriage = self._carriage

        def write(context: Context, out: Any) -> None:
            forces = owner()
            work = np.empty(size)
            given = forces._ports["gathered"].Eval(context)
            if not kernel.foot_vector(given, True, work) or work[carriage] == 0.0:
                work = forces._calc_work(context)
            out.SetFromVector(work[part])

        return write

    def _calc_varied(self, context: Context) -> Varied:
        if self._underivable:
            raise InputError(
                f"{self._underivable} has no derivatives in Drake",
                where=f"contact of {self.get_name()!r}",
                right=f"For AutoDiffXd take contact hydroelastic, {', '.join(CONTACT_LAWS)}",
            )
        table, table_by = self._table(context)
        place = self._fulcrum_place(context)
        coordinates = self._value(context, "state")[self._coordinates]
        value, by = _apart(np.concatenate([*self._frame_motion(context), coordinates, [place]]))
        directions = max(by.shape[1], table_by.shape[2])
        if by.size and table_by.size and by.shape[1] != table_by.shape[2]:
            raise ValueError(
                f"{self.get_name()!r}: inputs have derivatives in {by.shape[1]} directions, "
                f"parameters in {table_by.shape[2]}"
            )
        if value[self._carriage] == 0.0:
            self._refuse_carriage()
        work = np.zeros(self._size)
        work_by = np.zeros((self._size, directions))
        work[: len(value)] = value
        work_by[: len(value), : by.shape[1]] = by
        kernel.differentiate(self._numbers, table, table_by, work, work_by)
        return Varied(work, work_by)

    def _frame_motion(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        """(12,) pose, row by row, and (6,) spatial velocity of F from the plant's lists."""
        X_WF = self._value(context, "body_poses")[self._frame].GetAsMatrix34()
        V_WF = self._value(context, "body_spatial_velocities")[self._frame].get_coeffs()
        return X_WF.ravel(), V_WF

    def _refuse_carriage(self) -> None:
        # A trial step of an integrator may be anywhere, but exactly at 0 is only what nobody placed
        if self._travel is None:
            return
        rearmost, foremost = self._travel
        raise InputError(
            "the fulcrum's carriage is at 0 mm from A, but travels from "
            f"{1e3 * rearmost:g} to {1e3 * foremost:g} mm",
            where=f"state of {self.get_name()!r}",
            right=(
                "Drake drops the default positions of joints where it clones or converts: start "
                "there by copied_context.SetTimeStateAndParametersFrom(context). After "
                "SetPositions: foot.carriage_joint(plant).set_translation(plant_context, "
                "fulcrum_m)"
            ),
        )

    def _warn_of_depth(self, context: Context) -> None:
        deepest = self._values(context)[self._slices["depth"]].max(initial=0.0)
        self._warn_if_deep(deepest, self._foam_thickness)

    def _check_grip(self, context: Context, normal_force: np.ndarray) -> None:
        constants = self._constants(context)
        on = self._site_keel
        load = np.bincount(on[on >= 0], normal_force[on >= 0], int(self._numbers[1]))
        share = (
            load * constants["mu_static"].max() / constants["threshold_velocity"] / self._grip_limit
        )
        worst = int(np.argmax(share))
        if share[worst] > 1.0:
            raise InputError(
                f"{self.get_name()!r}: friction under {load[worst]:.0f} N on keel body {worst}, "
                f"at {context.get_time():.4g} s, is an explicit force and diverges in steps of "
                "this length",
                where="time_step",
                right=(
                    f"This step bears {load[worst] / share[worst]:.0f} N there: take one shorter "
                    "in proportion to the load, contact drake_point or hydroelastic, or a "
                    "continuous plant"
                ),
            )

    def _spatial_forces(self, context: Context) -> Iterable[tuple[int, np.ndarray]]:
        return [(self._frame, self._values(context)[self._slices["wrench"]])]


def _shape(code: str, **sizes: int) -> tuple[int, ...]:
    return tuple(int(sizes.get(part, part)) for part in code)


def _apart(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (n,) without their derivatives, and these (n, d)."""
    if numbers.dtype != object:
        return numbers, np.zeros((len(numbers), 0))
    column = numbers.reshape(-1, 1)
    return ExtractValue(column).ravel(), ExtractGradient(column)


FootForces_ = FootForces.template
