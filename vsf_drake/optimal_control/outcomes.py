"""What a solved stride means to a person, and which published signs of stiffness a pair of strides
has."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.optimal_control.stride import Stride
from vsf_drake.simulation.sagittal.model import SOCKET
from vsf_drake.walks.published import direction, published_effects

SIGNS_OF = "Nichols 2023"
"""The source, in the table of published effects, whose signs were measured on the
variable-stiffness foot itself."""
MEASURES = {
    "dorsiflexion": "dorsiflexion",
    "plantarflexor moment": "ankle_moment",
    "knee extension": "knee_extension",
    "knee flexor moment": "knee_flexor_moment",
    "push-off power": "push_off_power",
    "energy stored": "stored_energy",
    "energy returned": "returned_energy",
}
"""Its measures, and the outcome that stands for each."""


def outcomes(solution: TrajectorySolution, stride: Stride) -> dict[str, float]:
    """FREE_OUTCOMES of a solved stride; the changes are from its reference, or from the own stride
    where that holds it, NaN where nothing was recorded."""
    y = solution.last_y()
    index = stride.function.index
    reference = stride.reference
    model = stride.model
    mass = model.subject.mass_kg
    weight = model.weight
    last = solution.last

    def column(name: str) -> np.ndarray:
        return np.asarray(y[:, index(name)[0]])

    def largest(name: str) -> float:
        return float(np.abs(column(name)).max() / mass)

    def peak(foot: str, late: bool) -> float:
        rows = np.flatnonzero(reference.stance[foot])
        # A stance that goes over the end of the period begins late in it.
        gap = np.flatnonzero(np.diff(rows) > 1)
        rows = rows if not len(gap) else np.concatenate([rows[gap[0] + 1 :], rows[: gap[0] + 1]])
        half = rows[len(rows) // 2 :] if late else rows[: len(rows) // 2]
        return float(column(f"{foot}_fz")[half].max() / weight) if len(half) else float("nan")

    # About the pylon's end, the origin of the link that the alignment turns: -M_y turns the toe up.
    layout = stride.function.layout
    n = len(model.coordinates)
    k = len(model.quasi_static)
    motion = model.motion(*stride.function.parts(last.z, last.p)[:-1])
    pylon = model.dynamics.link[n + k + 1]
    moment = column("prosthetic_my") - (
        motion.z[pylon] * column("prosthetic_fx") - motion.x[pylon] * column("prosthetic_fz")
    )
    w = last.z[:, layout.w]
    turn = w[:, len(SOCKET) :] @ model.support.signs

    # A laboratory's markers are on the socket: what it calls shank turns with it against the
    # residual limb.
    wrench = np.stack([column(f"prosthetic_{part}") for part in ("my", "fx", "fz")])
    power = np.einsum("cn,cn->n", wrench, motion.V[:, model.socket])
    socket_bends = model.socket_bends * w[:, SOCKET.index("socket_flexion")]

    _, _, _, hip_p, knee_p, _, knee_i, _ = layout.coordinates
    late = reference.late & reference.stance["prosthetic"]
    wanted = np.hstack([reference.q, *reference.force.values()])
    if stride.hold is not None:
        wanted, _ = stride.hold.at(last.p[0], len(y))
    change = np.degrees(y[:, stride.function.starting_with("q_")][:, 3:] - wanted[:, 3:n])
    changed = np.nan if stride.recorded is None else float(np.sqrt(np.mean(change**2)))
    force = [
        np.sum(
            (y[:, index(f"{foot}_fx", f"{foot}_fz")] - wanted[:, n + 2 * i : n + 2 * i + 2]) ** 2,
            axis=1,
        )[reference.known[foot]].mean()
        for i, foot in enumerate(reference.force)
        if reference.known[foot].any()
    ]
    pace = float(last.p[-1])
    taken, given = taken_and_given(power, pace * stride.grid.weights)
    return {
        "push_off_work": -pace * stride.value("push_off", y),
        "com_push_off_work": _work_on_the_centre_of_mass(
            y[:, index("prosthetic_fx", "prosthetic_fz")],
            y[:, index("intact_fx", "intact_fz")],
            late,
            stride,
            pace,
        ),
        "stored_energy": taken,
        "returned_energy": given,
        "strain_energy": float(column("stored_energy").max()),
        "push_off_power": float(power[late].max() / mass),
        "dorsiflexion": float(np.degrees(turn.max())),
        "ankle_moment": float(-moment.min() / mass),
        "prosthetic_first_peak": peak("prosthetic", False),
        "prosthetic_second_peak": peak("prosthetic", True),
        "intact_first_peak": peak("intact", False),
        "intact_knee_moment": largest(f"torque_{knee_i}"),
        "prosthetic_hip_moment": largest(f"torque_{hip_p}"),
        "prosthetic_knee_moment": largest(f"torque_{knee_p}"),
        "knee_flexor_moment": float(column(f"torque_{knee_p}")[late].max() / mass),
        "knee_extension": float(-np.degrees((column(f"q_{knee_p}") + socket_bends)[late].min())),
        "socket_moment": largest("force_socket_flexion"),
        "metabolic": stride.value("metabolic", y) / stride.advance_m,
        "joint_load": stride.value("joint_load", y),
        "activation": stride.value("activation", y),
        "muscle_energy": muscle_energy(solution, stride),
        "stride_time": pace * stride.grid.duration_s,
        "stride_length": pace * stride.advance_m,
        "motion_change": changed,
        "force_change": float(np.sqrt(max(force)) / weight) if force else float("nan"),
    }


def taken_and_given(power: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """J, the negative and the positive work of a power (N,) W on what carries a device, weights
    (N,) s of its integral. A passive device that ends as it began gives no more than it took; what
    lacks, it lost."""
    return float(weights @ np.maximum(-power, 0.0)), float(weights @ np.maximum(power, 0.0))


def _work_on_the_centre_of_mass(
    own: np.ndarray, other: np.ndarray, late: np.ndarray, stride: Stride, pace: float
) -> float:
    """J/kg, the positive work of a foot's force (N, 2) N late in its stance; the velocity follows
    from both forces, at the stride's speed and with no way up on average."""
    mass = stride.model.subject.mass_kg
    grid = stride.grid
    v = cumulative_trapezoid(
        (own + other) / mass - [0.0, GRAVITY], pace * grid.times_s, axis=0, initial=0.0
    )
    v += [stride.speed, 0.0] - grid.weights @ v / grid.duration_s
    return pace * float(grid.weights @ (late * np.maximum((own * v).sum(axis=1), 0.0))) / mass


def muscle_energy(solution: TrajectorySolution, stride: Stride) -> float:
    """J/(kg m), heat and work of the muscles over the length of a solved stride; rest is not in
    it."""
    model = stride.model
    last = solution.last
    q, v, *_ = stride.function.parts(last.z, last.p)
    activation = solution.last_y()[:, stride.function.starting_with("activation_")].T
    power = stride.function.muscles.metabolic_power(activation, q[3:], v[3:]).sum(0)
    # Time and length both go with the pace, which so cancels.
    return float(stride.grid.weights @ power) / (model.subject.mass_kg * stride.advance_m)


def published_signs(
    strides: Sequence[dict[str, float]], *, every_step: bool = False
) -> dict[str, bool | None]:
    """By measure of SIGNS_OF, whether outcomes change from the first of some settings, the softest,
    to the last, the stiffest, as published; None where they have no `published.direction`. With
    `every_step` from each to the next too.

    The source gives regressions over its settings. The line through three evenly spaced ones has
    the direction of their ends: what lies between may go another way, see `steady_signs`.
    """
    judged = strides if every_step else (strides[0], strides[-1])
    found = {}
    for effect in published_effects():
        if effect.source == SIGNS_OF and effect.measure in MEASURES:
            sign = direction([(row[MEASURES[effect.measure]],) for row in judged])
            found[effect.measure] = sign == effect.effect if sign else None
    return found


def steady_signs(strides: Sequence[dict[str, float]]) -> dict[str, bool]:
    """By measure, whether no step from one setting to the next has the opposite sign."""
    steps = [published_signs(pair) for pair in pairwise(strides)]
    return {measure: not any(step[measure] is False for step in steps) for measure in steps[0]}


def beyond_the_load(
    strides: Sequence[dict[str, float]], load: Sequence[dict[str, float]]
) -> dict[str, bool]:
    """By measure whose published sign the foot alone lacks at some step under an equal load
    (`device.equal_load`), whether strides have it at every step from one setting to the next."""
    null = published_signs(load, every_step=True)
    found = published_signs(strides, every_step=True)
    return {measure: found[measure] is True for measure, has in null.items() if has is not True}
