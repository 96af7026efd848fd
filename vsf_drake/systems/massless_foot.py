"""All forces on a foot whose keel has no inertia, and the rates of the keel."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, SupportsInt

import numpy as np
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError
from vsf_drake.systems import _foot_kernel as kernel
from vsf_drake.systems import _massless_kernel as massless
from vsf_drake.systems._system import system_template
from vsf_drake.systems.foot_forces import DEVICE, Constant, FootForces, Varied, _apart

if TYPE_CHECKING:
    _Base = FootForces
else:
    _Base = FootForces.__bases__[0]  # for any scalar type


@system_template()
class MasslessFootForces(_Base):
    """Every force on a variable-stiffness foot whose keel has no inertia; `wire_foot` makes and
    connects it.

    The keel's joint angles are states of first order, and the plant has only the rigid frame F,
    which bears the keel's mass. Forces and laws are those of `FootForces`, with the damping of
    joints, support and contact. The joints' rates are those at which the net moment in each joint
    is zero; they are found anew at each call and depend on the inputs alone. What is left out are
    the keel's own vibrations, of 10^5 1/s and more; the fastest rate left is the support's,
    stiffness over damping. Under AutoDiffXd the rates' derivatives are exact, by the implicit
    function theorem.

    In a plant with a time step every step is implicit in the keel: forces and rates are those with
    the keel as it is at the step's end, under the frame's motion at its start.

    Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; keel (m,) rad, the
    joints' angles from A on, positive toe up; fulcrum_position (1,) m from A, where it is not
    connected the parameter fulcrum_m holds; gathered (G,) of a coupled foot. Outputs:
    spatial_forces on F; support_force (1,) N of the fulcrum on the keel along z_K; joint_moment
    (m,) N m of the keel's springs and dampers; grf (3,) N in W, on the foot; cop (3,) m in W;
    free_moment (1,) N m about the mean normal, on the foot; normal_force (N,) N, >= 0; depth (N,) m
    of foam and ground together; depth_rate (N,) m/s, also without contact; friction_force (3 N,),
    N rows in W, N; constants (C,) of a coupled foot; applied (6 + m,), moment and force on F at Fo
    in its axes, then the keel's rates (rad/s), or with a time step its angles at the step's end
    (rad). With `law` None there is no contact and no output from grf to friction_force.

    Parameters in the Context: joint_stiffness, joint_damping (m,);
    fulcrum_stiffness, fulcrum_damping, fulcrum_m; and with a law p_BS (N, 3), radius, stiffness,
    exponent, damping, full_damping_depth, dissipation (N,), depth_width, rate_width,
    threshold_velocity; and of the M patches ground_bounds (M, 4), ground_reference_x,
    ground_height, ground_slope, ground_bank, ground_compliance, mu_static, mu_kinetic, ground_speed
    (M,); units as of `FootForces`.

    Args:
        num_states: of the plant, positions and velocities.
        time_step: of the plant (s); 0 in a continuous one.
        frame_body_index, keel_starts, site_keel, law, constants, chain, foam_thickness: as of
            `FootForces`.

    Raises:
        InputError: (when evaluated) as `FootForces`; or the support or a sprung joint has no
            damping.
    """

    _known: ClassVar[dict[str, str]] = {
        name: code for name, code in DEVICE.items() if not name.startswith("carriage")
    }
    _moments: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        *,
        num_states: int,
        time_step: float,
        frame_body_index: SupportsInt,
        keel_starts: np.ndarray,
        site_keel: Sequence[int],
        law: str | None,
        constants: dict[str, Constant],
        chain: np.ndarray,
        foam_thickness: float = np.inf,
    ) -> None:
        self._states = num_states
        self._step = time_step
        m = self._joints = len(keel_starts)
        # for the compiled forces the keel is a plant of its own
        super().__init__(
            num_positions=m + 1,
            num_velocities=m,
            position_indices=range(m + 1),
            velocity_indices=[*range(m), 0],
            frame_body_index=frame_body_index,
            keel_starts=keel_starts,
            site_keel=site_keel,
            law=law,
            constants=constants,
            chain=chain,
            foam_thickness=foam_thickness,
        )

    def _declare_coordinates(self, states: int) -> int:
        self._declare_inputs(keel=self._joints)
        return self._joints + self._states

    def _pack(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        constants = self._constants(context)
        for name, damped in (
            ("fulcrum_damping", constants["fulcrum_damping"] > 0.0),
            ("joint_damping", (constants["joint_damping"][1:] > 0.0).all()),
        ):
            if not damped:
                raise InputError(
                    "is 0, and in a keel without inertia nothing else bounds the rates",
                    where=f"{name} of {self.get_name()!r}",
                    right='It must be above 0, or take add_foot(..., keel="full")',
                )
        return super()._pack(context)

    def _calc_work(self, context: Context) -> np.ndarray:
        given: Any = self._ports["gathered"].Eval(context)
        work = np.empty(self._size + massless.room_for(self._joints))
        if not (self._linked and massless.settled_foot(given, True, self._step, work)):
            work[:12], work[12:18] = self._frame_motion(context)
            massless.settled_foot(given, False, self._step, work)
        self._check_settled(context, work)
        return work

    def _applied_at_once(self, part: slice) -> Callable[[Context, Any], None]:
        owner: Callable[[], Any] = weakref.ref(self)
        step = self._step
        size = self._size + massless.room_for(self._joints)

        def write(context: Context, out: Any) -> None:
            forces = owner()
            work = np.empty(size)
            given = forces._ports["gathered"].Eval(context)
            if not massless.settled_foot(given, True, step, work) or math.isnan(
                work[part.stop - 1]
            ):
                work = forces._calc_work(context)
            out.SetFromVector(work[part])

        return write

    def _calc_varied(self, context: Context) -> Varied:
        table, table_by = self._table(context)
        place = self._fulcrum_place(context)
        keel = self._value(context, "keel")
        rest = np.zeros(self._joints)
        coordinates = np.concatenate([keel, rest, [place, 0.0, place]])
        value, by = _apart(np.concatenate([*self._frame_motion(context), coordinates]))
        directions = max(by.shape[1], table_by.shape[2])
        if by.size and table_by.size and by.shape[1] != table_by.shape[2]:
            raise ValueError(
                f"{self.get_name()!r}: inputs have derivatives in {by.shape[1]} directions, "
                f"parameters in {table_by.shape[2]}"
            )
        turns = slice(18, 18 + self._joints)
        speeds = slice(turns.stop, turns.stop + self._joints)
        work = np.empty(self._size + massless.room_for(self._joints))
        work[:18] = value[:18]
        cells = (self._numbers, table.ravel(), self._chain.ravel(), value[-1:], value[turns])
        massless.settled_foot(np.concatenate(cells), False, self._step, work)
        self._check_settled(context, work)

        # Net moments r(x, s) = 0 give ds = -(dr/ds)^-1 dr/dx dx: derivatives by what is given, then
        # by the rates s, with which the angles go by the step
        work = work[: self._size].copy()
        work_by = np.zeros((self._size, directions + self._joints))
        work_by[: len(value), : by.shape[1]] = by
        work_by[speeds, directions:] = np.eye(self._joints)
        work_by[turns, directions:] = self._step * np.eye(self._joints)
        if table_by.shape[2]:
            table_by = np.pad(table_by, ((0, 0), (0, 0), (0, self._joints)))
        kernel.differentiate(self._numbers, table, table_by, work, work_by)
        moment_by = work_by[self._slices["moment"]]
        rates_by = np.linalg.solve(moment_by[:, directions:], -moment_by[:, :directions])
        work_by = work_by[:, :directions] + work_by[:, directions:] @ rates_by
        moves = self._slices["generalized_force"]
        work[moves] = work[turns if self._step else speeds]
        work_by[moves] = work_by[turns if self._step else speeds]
        return Varied(work, work_by)

    def _check_settled(self, context: Context, work: np.ndarray) -> None:
        if math.isnan(work[self._slices["generalized_force"].stop - 1]):
            time = _apart(np.array([context.get_time()]))[0][0]  # of AutoDiffXd too
            raise InputError(
                f"{self.get_name()!r}: no rates of the keel balance its joints at {time:.6g} s",
                where="state of the foot",
                right=(
                    f"Steps of {1e3 * self._step:g} ms may be too long for what the foot bears: "
                    "take shorter ones, keel full with contact drake_point or hydroelastic, or a "
                    "continuous plant"
                    if self._step
                    else "Take shorter steps, more damping, or keel full"
                ),
            )


MasslessFootForces_ = MasslessFootForces.template
